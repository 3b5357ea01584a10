"""The thesis' numerics, rebuilt: backward differences in time, 64 linear SUPG elements for the rock surface.

The thesis marches string, bit and rock together with BDF in COMSOL, the surface on 64 linear Lagrange elements with
streamline stabilisation; it prints neither steps nor tolerances.  Here the same is done with a fixed step: BDF1 or
BDF2 of every mode of the string (what it does to the nodal equations), and of the SUPG equations of the surface, all
solved together in each step.  What the accurate engine does not have, and this has, is the damping of the BDF formula
and the smoothing of the linear elements: the difference of the two runs shows what they change.

Per step, with a bit that spins at w, the surface answers ``L(end) = a(w) + b(w) L(start)``, string and bit law give one
monotone axial problem, and what is left is one bracketed equation in w.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from scipy.linalg import eigh

from drillfem.bitrock.jit import kernel
from drillfem.bitrock.law import (
    BLADES,
    C2,
    C3,
    FLAT,
    GAMMA,
    MU,
    RADIUS,
    ZETA,
    BitLaw,
    sign_of_spin,
    specific_energy,
    strength,
)
from drillfem.bitrock.law import C1 as C_AXIAL
from drillfem.bitrock.solve import solve_axial
from drillfem.errors import SceneError, SimulationError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drillfem.models.straight import Channel
    from drillfem.scene import Scene

    F8 = NDArray[np.float64]

COLUMNS = {
    "bit_angular_speed": "rad/s",
    "bit_axial_speed": "m/s",
    "bit_angle": "rad",
    "bit_depth": "m",
    "bit_torque": "N*m",
    "bit_weight": "N",
    "depth_of_cut": "m",
}


@dataclass(frozen=True)
class Numerics:
    """How the thesis computed, as far as it says: ``order`` of BDF, ``step`` (s, not printed), surface ``elements``."""

    step: float = 1e-3
    order: int = 2
    elements: int = 64

    def __post_init__(self) -> None:
        if self.order not in (1, 2) or not self.step > 0 or self.elements < 2:
            raise SceneError(f"imitation: {self}: order must be 1 or 2, step > 0 and elements >= 2")


@kernel()
def _surface(w: float, lead: float, cell: float, past: F8, upper: F8, rhs: F8, answer: F8) -> tuple[float, float]:
    """SUPG surface at the end of a step with spin ``w``: height at the outflow = a + b (height at the inflow).

    ``past``: what the difference formula carries over, so that dL/dt = lead L - past.  ``answer`` (2, n + 1) is filled
    with the profiles for inflow 0 and for unit inflow without past.  Weight of the test function:
    v + (cell / 2) sign(w) v', optimal for pure advection; it makes the equations linear in w.
    """
    n = past.size - 1
    back = w < 0.0
    speed = abs(w)
    # seen in the direction of flow, the two cases are the same; rows 1 ... n of a tridiagonal matrix
    m0, m1, s = 2.0 * cell / 3.0, cell / 6.0, 0.5 * cell
    # test function i over its upstream element (derivative +1/cell) and downstream element (-1/cell):
    # mass with weight v + (cell/2) v': upstream (m1 + s/2, m0/2 + s/2), downstream (m0/2 - s/2, m1 - s/2)
    low, mid_up, mid_down, high = m1 + 0.5 * s, 0.5 * m0 + 0.5 * s, 0.5 * m0 - 0.5 * s, m1 - 0.5 * s
    # advection with weight v + (cell/2) v': upstream 1/2 + 1/2 times (-1, 1), downstream 1/2 - 1/2 times (-1, 1)
    a_low, a_mid = lead * low - speed, 0.0
    for i in range(1, n + 1):
        k, j = (n - i, n - i + 1) if back else (i, i - 1)
        load = low * past[j] + mid_up * past[k]
        a_mid = lead * mid_up + speed
        a_high = 0.0
        if i < n:
            nxt = n - i - 1 if back else i + 1
            load += mid_down * past[k] + high * past[nxt]
            a_mid += lead * mid_down
            a_high = lead * high
        unit = 0.0
        if i == 1:
            unit = -a_low
        else:
            factor = a_low
            a_mid -= factor * upper[i - 1]
            load -= factor * rhs[0, i - 1]
            unit = -factor * rhs[1, i - 1]
        upper[i] = a_high / a_mid
        rhs[0, i] = load / a_mid
        rhs[1, i] = unit / a_mid
    answer[0, n if back else 0], answer[1, n if back else 0] = 0.0, 1.0
    x0 = x1 = 0.0
    for i in range(n, 0, -1):
        x0 = rhs[0, i] - upper[i] * x0
        x1 = rhs[1, i] - upper[i] * x1
        k = n - i if back else i
        answer[0, k], answer[1, k] = x0, x1
    end = 0 if back else n
    return answer[0, end], answer[1, end]


@kernel()
def _bit(
    w: float,
    par: F8,
    lead: float,
    cell: float,
    past: F8,
    u_free: float,
    gu: float,
    v_free: float,
    gv: float,
    upper: F8,
    rhs: F8,
    answer: F8,
    gap: F8,
    share: F8,
) -> tuple[float, float, float, float]:
    """(T, W, cutting part of W, inflow height) at a trial spin."""
    a, b = _surface(w, lead, cell, past, upper, rhs, answer)
    if w >= 0.0:
        # a blade leaves U behind it and meets a + b U
        gap[0] = (1.0 - b) * u_free - a
        weight, cut = solve_axial(
            gap,
            share,
            (1.0 - b) * gu,
            specific_energy(par, w) * par[ZETA] * par[RADIUS],
            strength(par, w) * par[RADIUS] * par[FLAT] / par[BLADES],
            v_free,
            gv,
            par[C_AXIAL],
        )
        u = u_free - gu * weight
        inflow = u if (1.0 - b) * u >= a else a / (1.0 - b)
    else:
        # backwards nothing is cut: what lay ahead comes back
        inflow = a / (1.0 - b)
        gap[0] = u_free - inflow
        flat = strength(par, w) * par[RADIUS] * par[FLAT] / par[BLADES]
        weight, cut = solve_axial(gap, share, gu, 0.0, flat, v_free, gv, par[C_AXIAL])
    torque = 0.5 * par[RADIUS] / par[ZETA] * cut
    torque += 0.5 * par[RADIUS] * par[MU] * par[GAMMA] * sign_of_spin(par, w) * (weight - cut)
    return torque, weight, cut, inflow


@kernel()
def _march(
    par: F8,
    modes: F8,
    torsion: F8,
    state: F8,
    twist: F8,
    surface: F8,
    top: F8,
    step: float,
    order: int,
    width: float,
    steps: int,
    every: int,
    rows: F8,
) -> int:
    """March; returns the steps done.

    modes (4, n): shape at the bit, omega^2, damping, load.  torsion (4, m): the same, load per acceleration of the top.
    state (4, n), twist (4, m): position and speed now and a step before.  surface (2, cells + 1): heights, likewise.
    top (3, steps + 1): angle, speed and acceleration of the top.
    """
    n, m, cells = modes.shape[1], torsion.shape[1], surface.shape[1] - 1
    cell = width / cells
    lead = 1.5 / step if order == 2 else 1.0 / step
    c1, c2 = (2.0 / step, -0.5 / step) if order == 2 else (1.0 / step, 0.0)
    gv = gu = gw = 0.0
    for k in range(n):
        stiff = lead + modes[2, k] + modes[1, k] / lead
        gv += modes[0, k] ** 2 / stiff
    gu = gv / lead
    for k in range(m):
        stiff = lead + torsion[2, k] + torsion[1, k] / lead
        gw += torsion[0, k] ** 2 / stiff
    x, v, z = np.empty(n), np.empty(n), np.empty(m)
    past, upper = np.empty(cells + 1), np.empty(cells + 1)
    rhs, answer = np.empty((2, cells + 1)), np.empty((2, cells + 1))
    gap, share = np.empty(1), np.full(1, par[BLADES])
    spin = top[1, 0]
    for k in range(m):
        spin += torsion[0, k] * twist[1, k]
    marks = np.array([-par[C3], 0.0, par[C3], par[C2]])
    for i in range(1, steps + 1):
        v_free = u_free = w_free = turn = 0.0
        for k in range(n):
            px = c1 * state[0, k] + c2 * state[2, k]
            pv = c1 * state[1, k] + c2 * state[3, k]
            v[k] = (pv + modes[3, k] - modes[1, k] * px / lead) / (lead + modes[2, k] + modes[1, k] / lead)
            x[k] = (px + v[k]) / lead
            v_free += modes[0, k] * v[k]
            u_free += modes[0, k] * x[k]
        for k in range(m):
            px = c1 * twist[0, k] + c2 * twist[2, k]
            pv = c1 * twist[1, k] + c2 * twist[3, k]
            load = torsion[3, k] * top[2, i]
            z[k] = (pv + load - torsion[1, k] * px / lead) / (lead + torsion[2, k] + torsion[1, k] / lead)
            w_free += torsion[0, k] * z[k]
        w_free += top[1, i]
        for j in range(cells + 1):
            past[j] = c1 * surface[0, j] + c2 * surface[1, j]
        args = (par, lead, cell, past, u_free, gu, v_free, gv, upper, rhs, answer, gap, share)

        # follow the root from the last spin in the direction in which the residual falls
        a = spin
        ra = a - w_free + gw * _bit(a, *args)[0]
        b, rb = a, ra
        stride = 1.01 * abs(ra) + 1e-12  # the torque rises with the spin: as a rule the root is no farther
        for _ in range(200):
            if rb == 0.0 or (rb > 0.0) != (ra > 0.0):
                break
            a, ra = b, rb
            b = a - stride if ra > 0.0 else a + stride
            for j in range(4):  # no kink of the law inside a bracket
                if min(a, b) < marks[j] < max(a, b):
                    b = marks[j]
            stride *= 2.0
            rb = b - w_free + gw * _bit(b, *args)[0]
        else:
            return i - 1
        side = 0
        for _ in range(200):
            if rb == 0.0 or abs(b - a) <= 1e-12 * (1.0 + abs(b)):
                break
            # Illinois: regula falsi that halves the weight of an end that stays
            c = b - rb * (b - a) / (rb - ra)
            if not min(a, b) < c < max(a, b):
                c = 0.5 * (a + b)
            rc = c - w_free + gw * _bit(c, *args)[0]
            if (rc > 0.0) == (rb > 0.0):
                b, rb = c, rc
                if side == 1:
                    ra *= 0.5
                side = 1
            else:
                a, ra = b, rb
                b, rb = c, rc
                side = 0
        spin = b
        torque, weight, _, inflow = _bit(spin, *args)

        for k in range(n):
            v[k] -= modes[0, k] * weight / (lead + modes[2, k] + modes[1, k] / lead)
            px = c1 * state[0, k] + c2 * state[2, k]
            state[2, k], state[3, k] = state[0, k], state[1, k]
            state[0, k], state[1, k] = (px + v[k]) / lead, v[k]
        for k in range(m):
            z[k] -= torsion[0, k] * torque / (lead + torsion[2, k] + torsion[1, k] / lead)
            px = c1 * twist[0, k] + c2 * twist[2, k]
            twist[2, k], twist[3, k] = twist[0, k], twist[1, k]
            twist[0, k], twist[1, k] = (px + z[k]) / lead, z[k]
            turn += torsion[0, k] * twist[0, k]
        for j in range(cells + 1):
            surface[1, j] = surface[0, j]
            surface[0, j] = answer[0, j] + inflow * answer[1, j]
        if i % every == 0:
            r = i // every
            rows[0, r], rows[1, r] = spin, v_free - gv * weight
            rows[2, r], rows[3, r] = top[0, i] + turn, u_free - gu * weight
            rows[4, r], rows[5, r] = torque, weight
            rows[6, r] = par[BLADES] * (surface[0, 0] - surface[0, cells]) if spin > 0.0 else 0.0
    return steps


def _modal(channel: Channel, free: NDArray[np.int64]) -> tuple[F8, F8]:
    """Rows (bit, omega^2, damping) and mass-normalised shapes of a channel; its damping must be proportional."""
    part = np.ix_(free, free)
    square, shapes = eigh(channel.stiffness[part], channel.mass[part])
    square[np.abs(square) < 1e-9 * square[-1]] = 0.0
    damping = np.einsum("ik,ij,jk->k", shapes, channel.damping[part], shapes)
    bit = shapes[list(free).index(channel.bit)]
    return np.stack([bit, square, np.where(square > 0, damping, 0.0)]), shapes


def march(
    axial: Channel,
    torsion: Channel,
    law: BitLaw,
    start: tuple[F8, F8, F8, F8],
    top: F8,
    hook_load: float,
    incline: float,
    numerics: Numerics,
    every: int = 1,
) -> xr.Dataset:
    """Drill with a straight string whose damping is proportional, computed as the thesis computes.

    start: nodal displacement (m), its speed, angle (rad), its speed.  top (3, n + 1): angle, speed and acceleration
    of the top at the start and at the ends of the steps.  incline: dL/deta of the first rock surface, m/rad.
    Returns a history over ``time`` (s) with the variables of `COLUMNS`.  Raises SimulationError.
    """
    step, order = numerics.step, numerics.order
    u, u_dot, phi, phi_dot = start
    angle, speed, _ = top
    free = np.flatnonzero(np.arange(len(torsion.mass)) != torsion.top)
    load = np.zeros(len(axial.mass)) if axial.load is None else np.array(axial.load, float)
    load[axial.top] -= hook_load

    rows_a, shapes = _modal(axial, np.arange(len(axial.mass)))
    x, v = shapes.T @ axial.mass @ u, shapes.T @ axial.mass @ u_dot
    x[0] -= rows_a[0] @ x / rows_a[0, 0]  # the uniform motion: the bit starts at depth 0
    modes = np.concatenate([rows_a, (shapes.T @ load)[None]])
    state = np.stack([x, v, x - step * v, v])

    rows_t, shapes = _modal(torsion, free)
    project = shapes.T @ torsion.mass[np.ix_(free, free)]
    y, z = project @ (phi - angle[0])[free], project @ (phi_dot - speed[0])[free]
    uniform = shapes.T @ torsion.mass.sum(axis=1)[free]
    twist = np.stack([y, z, y - step * z, z])
    width = 2 * np.pi / law.blades
    heights = incline * np.linspace(0.0, width, numerics.elements + 1)
    rate = -incline * speed[0]  # of the surface in steady drilling
    surface = np.stack([heights, heights - step * rate])

    steps = len(angle) - 1
    rows = np.empty((len(COLUMNS), steps // every + 1))
    first = law.forces(float(rows_a[0] @ v), float(speed[0] + rows_t[0] @ z), -incline * 2 * np.pi)
    rows[:, 0] = (
        speed[0] + rows_t[0] @ z,
        rows_a[0] @ v,
        angle[0] + rows_t[0] @ y,
        0.0,
        *first[1::-1],
        -incline * 2 * np.pi,
    )
    torsional = np.concatenate([rows_t, -uniform[None]])
    done = _march(law.array, modes, torsional, state, twist, surface, top, step, order, width, steps, every, rows)
    if done < steps:
        raise SimulationError(f"imitation: no state of the bit found at t = {done * step:g} s")
    time = step * every * np.arange(rows.shape[1])
    data = {name: ("time", row, {"units": unit}) for (name, unit), row in zip(COLUMNS.items(), rows, strict=True)}
    return xr.Dataset(data, {"time": ("time", time, {"units": "s"})})


def imitate(scene: Scene, numerics: Numerics = Numerics(), until: float | None = None) -> xr.Dataset:
    """Run a scene with a straight drilling string as the thesis computes; rows every ``output.interval`` or step.

    Raises SceneError for a scene that is no such string, and SimulationError.
    """
    from drillfem.models.straight import StraightString

    if not scene.condensable:
        raise SceneError(f"scene {scene.name}: only a straight drilling string can be computed as the thesis does")
    string, drive = StraightString(scene), scene.top_drive
    end = scene.time.end if until is None else until
    steps = round((end - scene.time.start) / numerics.step)
    top = np.array([drive.motion(scene.time.start + numerics.step * i) for i in range(steps + 1)]).T.copy()
    every = max(1, round(scene.output.interval / numerics.step))
    incline = -scene.nominal().depth_of_cut / (2 * np.pi)
    law = BitLaw.from_scene(scene)
    return march(
        string.axial, string.torsion, law, string.start(), top, scene.nominal().hook_load, incline, numerics, every
    )
