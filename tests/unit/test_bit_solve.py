"""The bit solver: 1e5 random states, every branch, continuity, set-valued contact."""

from __future__ import annotations

import numpy as np
import pytest
from bitlab import C1
from numba import njit

from drillfem.bitrock import BitLaw, RockSurface, bit_step, solve_bit
from drillfem.bitrock.law import law_forces

LAW = BitLaw(**C1)
ONE = np.array([6.0])
FLAT = 32659.2
KAPPA = 0.252e9 * 0.38 * 0.108  # per total depth


def solve(law=LAW, share=ONE, v=0.0, gv=1e-6, gap=1e-4, gu=1e-9, w=14.0, gw=1e-4, previous=14.0, **more):
    gap = np.broadcast_to(np.asarray(gap, float), share.shape)
    height = np.stack([-gap, -np.broadcast_to(more.get("gap_back", gap), share.shape)])
    slope = np.broadcast_to(more.get("slope", 0.0), height.shape).copy()
    turn, rho = more.get("turn", 1.0), more.get("rho", 0.0)
    return solve_bit(
        law.array, share, v, gv, 0.0, gu, w, gw, turn, rho, np.zeros(2), height, slope, previous, np.empty(share.size)
    )


@njit
def run_random(par, share, cases, gaps, misses):
    """Solve each case; misses[:, 0] distance of the forces from what the law allows, [:, 1] error of the affine maps.

    The law is evaluated around the end state, within the rounding of that state: it may be arbitrarily steep.
    """
    m = share.size
    zero, height, work = np.zeros(2), np.empty((2, m)), np.empty(m)
    low, high = np.empty(4), np.empty(4)
    for k in range(len(cases)):
        v_free, w_free, previous, gv, gw, gu = cases[k]
        gap = gaps[k, :m]
        height[0], height[1] = -gap, -gap
        r = solve_bit(par, share, v_free, gv, 0.0, gu, w_free, gw, 1.0, 0.0, zero, height, 0.0 * height, previous, work)
        weight, torque, v, w = r[0], r[1], r[6], r[7]
        dv = 4e-16 * (abs(v_free) + gv * weight) + 1e-300
        du = 4e-16 * (np.abs(gap).max() + gu * weight) + 1e-300
        dw = 4e-16 * (abs(w_free) + gw * abs(torque)) + 2e-18
        low[:], high[:] = np.inf, -np.inf
        for corner in range(8):
            edge = gap - gu * weight + (du if corner & 1 else -du)
            depth = contact = 0.0
            for i in range(m):
                depth += share[i] * max(edge[i], 0.0)
                contact += share[i] / par[11] if edge[i] >= 0.0 else 0.0
            f = law_forces(par, v + (dv if corner & 2 else -dv), w + (dw if corner & 4 else -dw), depth, contact)
            for q in range(4):
                low[q], high[q] = min(low[q], f[q + 2]), max(high[q], f[q + 2])
        miss = 0.0
        for q in range(4):
            slack = 1e-9 * (abs(high[q]) + abs(weight)) + 1e-9
            miss = max(miss, low[q] - slack - r[q + 2], r[q + 2] - high[q] - slack)
        if min(r[2], r[3]) < -1e-9 * (1 + weight) or not np.isfinite(weight + torque + v + w):
            miss = np.inf
        misses[k, 0] = miss / (1.0 + abs(weight))
        misses[k, 1] = max(abs(v - (v_free - gv * weight)) / dv, abs(w - (w_free - gw * torque)) / dw)


@pytest.mark.parametrize("literal", [False, True])
@pytest.mark.parametrize("c1", [1e-5, 0.0])
@pytest.mark.parametrize("share", [ONE, np.ones(6)])
def test_hundred_thousand_random_states(literal, c1, share):
    """Speeds, impulses and clearances over many decades, of both signs, and zero; all variants together."""
    rng, n = np.random.default_rng(7), 25_000
    low, high = np.array([-8, -6, -5, -12, -12, -15]), np.array([4, 4, 3, 2, 2, 0])
    cases = 10 ** rng.uniform(low, high, (n, 6)) * (rng.random((n, 6)) > 0.1)
    cases[:, :3] *= rng.choice([-1, 1], (n, 3))
    gaps = rng.choice([-1, 1], (n, 6)) * 10 ** rng.uniform(-9, 0, (n, 6)) * (rng.random((n, 6)) > 0.1)
    misses = np.empty((n, 2))
    run_random(BitLaw(**C1, literal=literal, axial_regularisation=c1).array, share, cases, gaps, misses)
    assert misses[:, 0].max() < 1e-8 and misses[:, 1].max() < 8.0, misses.max(axis=0)


def test_branches_of_the_axial_force():
    # off bottom
    assert solve(v=1.0, gap=-1e-3, gu=0.0)[0] == 0.0
    # it would land, but the force needed is less than the wear flats give: the edge just touches
    gu, gap = 1e-9, 1e-5
    r = solve(v=10.0, gv=1e-6, gap=gap, gu=gu)
    assert r[3] < FLAT and r[0] == pytest.approx(gap / gu) and r[2] == pytest.approx(0.0, abs=1e-6)
    # full wear flat and cutting
    r = solve(v=1.0, gv=1e-6, gap=1e-3, gu=0.0)
    assert r[3] == pytest.approx(FLAT) and r[2] == pytest.approx(KAPPA * 6e-3)
    # sliding upwards
    r = solve(v=-1.0, gv=1e-6, gap=1e-3, gu=0.0)
    assert r[3] == 0.0 and r[2] > 0
    # stuck between: speed between 0 and c1
    r = solve(v=0.09, gv=1e-6, gap=1e-3, gu=0.0)
    assert 0 < r[6] < 1e-5 and 0 < r[3] < FLAT
    # the same with the set-valued law: exactly at rest
    r = solve(BitLaw(**C1, axial_regularisation=0.0), v=0.09, gv=1e-6, gap=1e-3, gu=0.0)
    assert r[6] == pytest.approx(0.0, abs=1e-16) and 0 < r[3] < FLAT
    # one blade of six touches: a sixth of the wear flat
    gap = np.array([1e-3, -1, -1, -1, -1, -1])
    r = solve(share=np.ones(6), v=1.0, gap=gap, gu=0.0)
    assert r[3] == pytest.approx(FLAT / 6) and r[2] == pytest.approx(KAPPA * 1e-3)


def test_set_valued_limit_is_approached():
    free = {"v": 0.09, "gv": 1e-6, "gap": 1e-3, "gu": 1e-12}
    limit = solve(BitLaw(**C1, axial_regularisation=0.0), **free)
    errors = [abs(solve(BitLaw(**C1, axial_regularisation=c), **free)[0] - limit[0]) for c in (1e-5, 1e-6, 1e-7)]
    assert errors[0] > 5 * errors[1] > 25 * errors[2] > 0


def test_branches_of_the_spin():
    # held by the wear flats: stuck, with the torque that balances, of either sign
    for drive in (1.0, -1.0):
        r = solve(v=1.0, gap=1e-4, w=0.1 * drive, gw=1e-4, previous=0.0)
        assert abs(r[7]) < 1e-3 and r[1] == pytest.approx(1e3 * drive, rel=0.02)
    # turned backwards against the braking wear flats: no cutting
    r = solve(v=1.0, gap=1e-4, w=-5.0, gw=1e-4, previous=-5.0)
    assert r[7] < -4 and r[2] == 0.0 and r[1] < 0
    # literal law: the torque drives it on
    r = solve(BitLaw(**C1, literal=True), v=1.0, gap=1e-4, w=-5.0, gw=1e-4, previous=-5.0)
    assert r[7] < -5 and r[1] > 0


def test_several_roots_are_told_apart_by_the_previous_spin():
    # the strength falls from stalled to turning: both states balance, the bit stays in its own
    free = {"v": 10.0, "gv": 1e-9, "gap": 1e-7, "gu": 0.0, "w": 2.0, "gw": 1e-3}
    stuck, turning = solve(**free, previous=0.0), solve(**free, previous=1.0)
    assert stuck[7] < 1e-3 and turning[7] > 0.1
    # more drive: the stalled state ends, by a jump
    free["w"] = 3.0
    assert solve(**free, previous=0.0)[7] > 0.1
    # less drive: the turning state ends
    free["w"] = 1.0
    assert solve(**free, previous=1.0)[7] < 1e-3


def test_solution_follows_the_drive_continuously_outside_jumps():
    previous, jumps = 14.0 - 1e-3 * 1411.0, []
    for w in np.concatenate([np.linspace(14, -14, 2801), np.linspace(-14, 14, 2801)]):
        now = solve(v=1.0, gv=1e-8, gap=1e-6, gu=0.0, w=w, gw=1e-3, previous=previous)[7]
        if abs(now - previous) > 0.05:
            jumps.append(now - previous)
        previous = now
    # sticking on the way down, slipping on the way up again
    assert len(jumps) == 2 and jumps[0] == pytest.approx(-0.1, abs=1e-2) and jumps[1] == pytest.approx(1.4, abs=2e-2)


def test_rock_height_that_depends_on_the_turn():
    # turning less leaves the bit on deeper cut rock: consistent end state
    slope, rho = 2e-4, 1e-3
    r = solve(v=1.0, gv=1e-6, gap=2e-4, gu=1e-9, w=14.0, gw=1e-4, slope=slope, turn=0.0144, rho=rho)
    turn = 0.0144 + rho * (r[7] - 14.0)
    edge = 2e-4 - slope * turn - 1e-9 * r[0]
    assert r[2] == pytest.approx(KAPPA * 6 * edge, rel=1e-12)


@pytest.mark.parametrize("scheme", ["dg", "profile"])
def test_step_on_a_surface_finds_the_rock_where_the_bit_ends(scheme):
    surface = RockSurface(scheme, 6, degree=3, elements=16)
    wave = [lambda x: 1e-4 * np.sin(9 * x)]
    surface.set_profile(wave)
    r = bit_step(LAW.array, surface.data, 0.1, 1e-6, 3e-4, 1e-9, 14.0, 1e-3, 0.05, 5e-4, 14.0)
    height = surface.ahead(r[9])[0]
    assert r[10] == pytest.approx(6 * (r[8] - height[0]), rel=1e-10)
    assert r[2] == pytest.approx(KAPPA * r[10], rel=1e-9)
    assert r[9] == pytest.approx(0.05 + 5e-4 * (r[7] - 14.0), rel=1e-12)


@pytest.mark.parametrize("scheme", ["dg", "profile"])
def test_step_on_a_surface_never_fails(scheme):
    rng = np.random.default_rng(3)
    surface = RockSurface(scheme, 6, incline=-2e-4)
    depth = 0.0
    for _ in range(3000):
        v, w = rng.normal(0, 0.1), rng.normal(5, 10)
        gv, gw = 10 ** rng.uniform(-7, -5), 10 ** rng.uniform(-5, -2)
        h = 1e-3
        r = bit_step(LAW.array, surface.data, v, gv, depth + h * v, h * gv, w, gw, h * w, h, w)
        assert np.all(np.isfinite(r))
        surface.commit(r[9], depth, r[8])
        depth = max(min(r[8], surface.ahead(0.0)[0][0] + 1e-2), -1.0)
