"""The wall in the forms: force and energy, the exact derivative in a curved hole, friction; at a point, uncompiled."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
import ufl
from rodlab import Array, T, at, vec

from drillfem.boreholes import arc, closest, wall
from drillfem.forms.kinematics import Configuration, Twist, rotation_about
from drillfem.forms.wall import (
    DEPTH,
    WALL,
    Wall,
    closest_point,
    contact,
    friction,
    friction_coefficient,
    steady_friction,
    wall_energy,
    wall_pressure,
)

METHODS = ("penalty", "smooth", "augmented")
RADIUS = 0.05
#: bends within metres; narrows above 1.02 m
HOLE = arc(4.0, 3.0, 0.2, 0.7, diameter=0.2).with_diameters(0.2, [[1.02, 0.24]])
ALONG = {"even": 2.0, "narrowing": 0.8}
V, W = (0.3, -0.2, 0.9), (0.4, 0.1, 6.0)


def numbers(p: float, multiplier: float = 0.0) -> Array:
    """What the forms know of the hole at a measured depth, with that depth at the end."""
    out = np.zeros((1, DEPTH + 1))
    out[0, 11:13] = 0.3, 0.15
    wall(HOLE.table, np.array([p]), out)
    out[0, 13], out[0, DEPTH] = multiplier, p
    return out[0]


def nearest(r: Array, p: float) -> float:
    found = np.array([p])
    assert closest(HOLE.table, r[None], found) == 0
    return float(found[0])


def made(row: Array, method: str = "penalty", **keys: Any) -> Wall:
    given = {"stiffness": 2e4, "smoothing": 2e-3, "velocity_scale": 5.0, "regularisation": 1e-4} | keys
    return Wall(ufl.as_vector(row.tolist()), method=method, **given)


def touching(where: str, deep: float = 1.5e-3) -> tuple[Array, float]:
    """A point (3,) that presses into the wall this deep (m), and the measured depth of its closest point."""
    p = ALONG[where]
    frame = HOLE.frame(p)
    across = np.cross(frame.tangent[0], [0.3, 1.0, -0.2])
    across /= np.linalg.norm(across)
    return frame.position[0] + (frame.radius[0] - RADIUS + deep) * across, p


def put(r: Array, towards: Any = (0, 0, 0), p: float | None = None) -> Configuration:
    """A cross-section at r + T towards, turned somehow; p: its measured depth, where that is an unknown."""
    R = rotation_about(1, 0.4) * rotation_about(3, 0.9)
    return Configuration(
        vec(*(r[i] + T * towards[i] for i in range(3))), R, vec(0, 0, 0), p if p is None else ufl.as_ufl(p)
    )


def test_the_numbers_are_those_that_the_kernels_write() -> None:
    row = numbers(2.0, 7.0)
    assert WALL.index("pressure") == 13 and len(WALL) == DEPTH == 14
    frame = HOLE.frame(2.0)
    assert np.allclose(row[:3], frame.position[0]) and np.allclose(row[3:6], frame.tangent[0])
    assert np.allclose(row[6:9], frame.curvature[0]) and row[9] == frame.radius[0]
    assert numbers(ALONG["narrowing"])[10] == pytest.approx(-0.05)


# -- one potential ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
def test_pressure_is_the_slope_of_the_energy(method: str) -> None:
    """p = dE/d(penetration) at every depth, on both sides of every kink; nothing off the wall; continuous."""
    hole = np.zeros(DEPTH)
    hole[5], hole[9], hole[13] = 1.0, 0.1, 30.0 if method == "augmented" else 0.0
    law = made(hole, method)
    for g in (-0.02, -3e-3, -1.9e-3, -1e-4, 1e-4, 1.9e-3, 2.1e-3, 0.02):
        x = Configuration(vec(0.1 - RADIUS + g + T, 0, 0), rotation_about(3, 0.0), vec(0, 0, 0))
        force, slope = at(wall_pressure(g, law)), at(wall_energy(x, RADIUS, law).dx(1), t=0)
        assert force == pytest.approx(slope, rel=1e-6, abs=1e-9) and force >= 0.0
    assert at(wall_pressure(-0.02, law)) == 0.0
    assert at(wall_pressure(0.02, law)) == pytest.approx(2e4 * 0.02 + hole[13], rel=1e-12)
    for edge in (-2e-3, -30 / 2e4, 0.0, 2e-3):
        assert abs(at(wall_pressure(edge + 1e-9, law)) - at(wall_pressure(edge - 1e-9, law))) < 1e-4


def test_the_smooth_law_has_no_kink() -> None:
    law = made(np.zeros(DEPTH), "smooth")
    for edge in (-2e-3, 2e-3):
        below, above = (at(wall_pressure(edge + d + T, law).dx(1), t=0) for d in (-1e-9, 1e-9))
        assert below == pytest.approx(above, abs=2e4 * 1e-6)


@pytest.mark.parametrize(("method", "where"), [*product(METHODS, ALONG)])
def test_force_is_the_derivative_of_the_energy(method: str, where: str) -> None:
    """In a hole that bends and, in one case, narrows: what the forms say, against differences on the true hole."""
    r, p = touching(where)
    multiplier = 11.0 if method == "augmented" else 0.0
    law, still = made(numbers(p, multiplier), method), Twist(vec(0, 0, 0), vec(0, 0, 0))
    for towards in np.eye(3):
        force = at(contact(put(r), still, Twist(vec(*towards), vec(0, 0, 0)), RADIUS, law))
        assert force == pytest.approx(at(wall_energy(put(r, towards), RADIUS, law).dx(1), t=0), rel=1e-9, abs=1e-9)
        energy = []
        for h in (-1e-6, 1e-6):
            there = r + h * towards
            true = made(numbers(nearest(there, p), multiplier), method)
            energy.append(at(wall_energy(put(there), RADIUS, true)))
        assert force == pytest.approx((energy[1] - energy[0]) / 2e-6, rel=1e-5, abs=2e-4)


# -- the derivative ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("method", "where", "unknown", "projected"),
    [
        ("smooth", "narrowing", False, False),
        ("penalty", "narrowing", False, True),
        ("penalty", "narrowing", True, True),
        ("augmented", "even", True, False),
    ],
)
def test_the_tangent_is_that_of_the_true_hole(method: str, where: str, unknown: bool, projected: bool) -> None:
    """d/dr, and d/dp where p is an unknown, of contact and friction: with the numbers of the hole frozen, as the forms
    are differentiated, and with the hole found, or taken at p, anew."""
    r, p = touching(where)
    towards, rate = np.array([0.5, -0.3, 0.8]), 0.6
    twist, virtual = Twist(vec(*V), vec(*W)), Twist(vec(0.2, 1.0, -0.4), vec(0.3, -0.5, 0.8))
    multiplier = 11.0 if method == "augmented" else 0.0
    keys = {"projected": projected, "retardation": 1e-3 if method == "augmented" else None}

    def terms(x: Configuration, row: Array) -> list[Any]:
        law = made(row, method, **keys)
        found = [f(x, twist, virtual, RADIUS, law) for f in (contact, friction)]
        return [*found, closest_point(x, 1.0, law)] if unknown else found

    def derivative(frozen: bool) -> Array:
        """Along the direction, by differences of fourth order."""
        total, h = np.zeros(3 if unknown else 2), 2e-5
        for step, weight in ((1, 8), (-1, -8), (2, -1), (-2, 1)):
            there, q = r + step * h * towards, p + step * h * rate if unknown else None
            row = numbers(p if frozen else nearest(there, p) if q is None else q, multiplier)
            total += weight * np.array([at(term) for term in terms(put(there, p=q), row)]) / (12 * h)
        return total

    assert np.allclose(derivative(True), derivative(False), rtol=1e-6, atol=1e-9)


# -- friction ---------------------------------------------------------------------------------------------------------


def at_speed(v: Any, law: Wall) -> Array:
    return at(friction_coefficient(v, law) * v)


@pytest.mark.parametrize(("mu_s", "mu_d", "n"), [(0.3, 0.15, 5.0), (0.3, 0.15, 100.0), (0.885, 0.425, 20.0)])
def test_friction_peaks_at_the_static_coefficient(mu_s: float, mu_d: float, n: float) -> None:
    """(4-7): the peak mu_s lies at n v = mu_s/alpha, alpha = sqrt(mu_s (mu_s - mu_d)); far beyond there is mu_d."""
    row = numbers(2.0)
    row[11:13] = mu_s, mu_d
    law = made(row, velocity_scale=n, regularisation=1e-12)
    peak = mu_s / np.sqrt(mu_s * (mu_s - mu_d)) / n
    assert at_speed(peak, law) == pytest.approx(mu_s, rel=1e-9)
    assert max(at_speed(x * peak, law) for x in (0.9, 1.1)) < mu_s
    assert abs(at((friction_coefficient(peak + T, law) * (peak + T)).dx(1), t=0)) < 1e-9 * n
    assert at_speed(1e4 / n, law) == pytest.approx(mu_d, rel=1e-3)


def test_rotation_frees_the_string_along_the_hole() -> None:
    """The axial part of friction is mu(v) N v_axial/|v_c|: full without rotation, next to nothing with much."""
    r, p = touching("even")
    law, frame = made(numbers(p), regularisation=1e-12), HOLE.frame(p)
    t = frame.tangent[0]
    normal = (r - frame.position[0]) / np.linalg.norm(r - frame.position[0])
    N, R = 2e4 * 1.5e-3, at(put(r).R)
    for spin in (0.0, 1.0, 4.0, 40.0):
        twist = Twist(vec(*(0.02 * t)), vec(*(R.T @ (spin * t))))
        drag = at(friction(put(r), twist, Twist(vec(*t), vec(0, 0, 0)), RADIUS, law))
        speed = np.hypot(0.02, spin * RADIUS)
        assert drag == pytest.approx(at_speed(speed, law) * N * 0.02 / speed, rel=1e-8)
        # what turns it back is the rest
        moment = at(friction(put(r), twist, Twist(vec(0, 0, 0), vec(*(R.T @ t))), RADIUS, law))
        assert moment == pytest.approx(at_speed(speed, law) * N * RADIUS * spin * RADIUS / speed, rel=1e-8, abs=1e-9)
        # the same as of a string that slides steadily
        if spin:
            steady = [
                at(steady_friction(put(r), virtual, RADIUS, law, 0.3, 0.02, spin))
                for virtual in (Twist(vec(*t), vec(0, 0, 0)), Twist(vec(0, 0, 0), vec(*(R.T @ t))))
            ]
            assert np.allclose(steady, np.array([drag, moment]) * 0.3 / at_speed(speed, law), rtol=1e-8)
    push = at(friction(put(r), twist, Twist(vec(*normal), vec(0, 0, 0)), RADIUS, law))
    assert abs(push) < 1e-9 * N


def test_the_literal_reading_brakes_bouncing() -> None:
    """Unprojected, friction acts along the whole velocity, also across the wall (errata of 5.3)."""
    r, p = touching("even")
    frame = HOLE.frame(p)
    normal = (r - frame.position[0]) / np.linalg.norm(r - frame.position[0])
    twist = Twist(vec(*(0.1 * normal)), vec(0, 0, 0))
    for projected in (True, False):
        law = made(numbers(p), projected=projected)
        across = at(friction(put(r), twist, Twist(vec(*normal), vec(0, 0, 0)), RADIUS, law))
        assert across == pytest.approx(0.0 if projected else at_speed(0.1, law) * 30.0, rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_retardation_only_takes_energy(method: str) -> None:
    """Less push on the way out than on the way in, and never a pull."""
    r, p = touching("even", 1e-3)
    normal = (r - HOLE.frame(p).position[0]) / np.linalg.norm(r - HOLE.frame(p).position[0])
    outwards = Twist(vec(*normal), vec(0, 0, 0))
    row = numbers(p, 5.0 if method == "augmented" else 0.0)
    force = []
    for speed in (-5.0, -0.5, 0.0, 0.5, 5.0):
        law = made(row, method, retardation=1e-3)
        force.append(at(contact(put(r), Twist(vec(*(speed * normal)), vec(0, 0, 0)), outwards, RADIUS, law)))
    assert force[0] == 0.0 < force[1] < force[2] < force[3] < force[4]
