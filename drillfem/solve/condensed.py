"""The straight string condensed onto the bit: linear dynamics between the ends, the bit law solved per step.

An axial-torsional string is linear except at the bit.  Each of its two channels,
``M q'' + C q' + K q = load - e_bit P``, is brought to modal coordinates once; a step then propagates every mode by
its exact solution, so that only the history of the bit force P within the step is approximated:

* where the bit cuts throughout the step, the cutting force is a parabola through its values at the start, the middle
  and the end of the step (fourth order), and the wear-flat force is constant;
* the wear-flat force is constant in the step and takes its end value, and so is everything while the bit is
  stalled, turns backwards, leaves the bottom or lands: a linear multiplier would ring where the bit sticks;
* a rigid mass that sticks axially on a turning bit is held in the middle and at the end of the step (second order);
* a step in which the wear-flat force changes, or that is not cutting throughout, is divided: so that the fastest mode
  is resolved (on longer steps the modes beyond the sampling rate answer a sticking bit with the wrong sign, and it
  rings), and so that the moment at which it sticks or slips is.

At the end of the step the modes answer the bit force by affine maps, and `drillfem.bitrock` solves the bit on them.

Two common integrators of the string can take the place of the exact modes, to compare: the trapezoidal rule and
explicit central differences (velocity form).  The bit is solved in the same way, with a cutting force linear in the
step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from drillfem.bitrock.jit import kernel
from drillfem.bitrock.law import (
    BLADES,
    C1,
    C2,
    C3,
    EPS1,
    FLAT,
    GAMMA,
    MU,
    RADIUS,
    SIGMA1,
    ZETA,
    BitLaw,
    law_forces,
    wear_fraction,
)
from drillfem.bitrock.solve import bit_step_in
from drillfem.bitrock.surface import RockSurface, SurfaceData, ahead, commit
from drillfem.models.straight import Channel

F8 = NDArray[np.float64]
TopMotion = Callable[[F8], tuple[F8, F8]]

INTEGRATORS = ("exact", "trapezoidal", "explicit")
"""Time integrators of the string between its ends."""
LEAST_PARTS = {False: 2, True: 8}
"""Least division of a step in which a turning bit begins or ceases to stick axially, stalls or leaves the bottom.

For a rigid mass on the bit (True) these steps are few: sticking is not one of them, only its beginning and end.
"""
ROUGH_PARTS = {False: 2, True: 4}
"""Least division of a step that starts with the bit stalled, turning backwards, or off bottom."""


OUTPUTS = (
    "time",
    "bit_angular_speed",
    "bit_axial_speed",
    "bit_angle",
    "bit_depth",
    "bit_torque",
    "bit_weight",
    "depth_of_cut",
    "top_torque",
    "top_angular_speed",
    "hook_load",
    "top_power",
    "kinetic_energy",
    "strain_energy",
    "work_top_drive",
    "work_hook_load",
    "work_gravity",
    "work_cutting",
    "work_wear_flat",
    "dissipated",
    "rock_volume",
)
UNITS = dict(
    zip(
        OUTPUTS,
        "s rad/s m/s rad m N*m N m N*m rad/s N W J J J J J J J J m^3".split(),
        strict=True,
    )
)


class Modes(NamedTuple):
    """A channel in mass-normalised modal coordinates, for the whole step (first index 0) and for parts of it (1, 2).

    Few arrays, because the compiled functions hand them on in every step.
    """

    table: F8  # (3, rows, n): one number per mode in the rows named below
    number: F8  # (3, numbers named below)
    big: F8  # (3, 2, 2n, 2n): step matrix and dissipation form where damping couples the modes; else (3, 2, 1, 1)


# The bit force in a step is p + r x + b 4 x (1 - x), x from 0 to 1.
# Rows of Modes.table.  Step matrix of (x, v); answers of x, v to the three unit forces (C, R, B); dissipation over the
# step as a quadratic form of (x, v, p, r, b); position of the bit in the middle of the step from (x, v)
(E11, E12, E21, E22, CX, CV, RX, RV, BX, BV, QXX, QXV, QVV, QXP, QVP, QXR, QVR, QXB, QVB, MX, MV) = range(21)
# mode shapes at bit and top; omega^2; static position under load and mean bit force; momentum in a uniform motion;
# static answer to a uniform acceleration; its restoring and damping rows; constant load
(BIT, HOOK, SQUARE, REST, UNIFORM, STILL, PULL, DRAG, LOAD) = range(21, 30)
# Numbers: rest of the dissipation form; bit force that balances the load on the uniform motion; answers of the bit to
# the unit forces, against the force (U position and V speed at the end, M position in the middle); total inertia;
# UNIFORM . BIT; is there damping; is the step of fourth order; part of a step by which the work of a linear force
# exceeds the mean force times the path, per change of speed (1/12 where the modes are exact); speed at once per force;
# is the channel a rigid mass
(QPP, QPR, QRR, QPB, QRB, QBB, MEAN, GU, GV, GM, HU, HV, HM, KU, KV, KM) = range(16)
(INERTIA, REACH, DAMPED, FOURTH, TWELFTH, AT_ONCE, RIGID) = range(16, 23)


def _step_matrices(a: F8, loss: F8, step: float) -> tuple[F8, F8]:
    """exp(a step) and int_0^step exp(a't) loss exp(a t) dt for stacks (k, m, m), by doubling from a short time."""
    norm = np.abs(a).sum(axis=-1).max() * step
    doublings = max(0, int(np.ceil(np.log2(max(norm, 1e-300) / 0.25))))
    h = step / 2**doublings
    eye = np.broadcast_to(np.eye(a.shape[-1]), a.shape)

    def exponential(t: float) -> F8:
        e = eye.copy()
        for k in range(12, 0, -1):
            e = eye + a @ e * (t / k)
        return e

    e, q = exponential(h), np.zeros_like(a)
    for x, w in zip(*np.polynomial.legendre.leggauss(7), strict=True):
        g = exponential(0.5 * h * (1 + x))
        q += 0.5 * h * w * np.swapaxes(g, -1, -2) @ loss @ g
    for _ in range(doublings):
        q = q + np.swapaxes(e, -1, -2) @ q @ e
        e = e @ e
    return e, q


def _chain(a: F8, step: float) -> None:
    """The last three unknowns are the bit force and what its derivatives are made of: p + r x + 4 b x (1 - x)."""
    a[:, -3, -2], a[:, -2, -1] = 1.0 / step, -8.0 / step


def _exact(square: F8, damping: F8, dense: bool, bit: F8, step: float) -> tuple[F8, F8, F8]:
    """Exact step, half a step, and dissipation over the step, of (x, v, p, r, b).

    Stacks (n, 5, 5) of single modes, or (1, 2n + 3, 2n + 3) if damping couples them.
    """
    n = len(square)
    # unknowns (omega x, v, force ...): balanced, so that few doublings are needed; the force enters scaled, too
    scale = np.sqrt(np.maximum(square, 1.0 / step**2))
    if dense:
        a, loss = np.zeros((1, 2 * n + 3, 2 * n + 3)), np.zeros((1, 2 * n + 3, 2 * n + 3))
        i, j, size = np.arange(n), np.arange(n, 2 * n), np.abs(bit).max() * step
        a[0, i, j], a[0, j, i], a[0, n : 2 * n, n : 2 * n] = scale, -square / scale, -damping
        a[0, j, 2 * n] = -bit / size
        loss[0, n : 2 * n, n : 2 * n] = damping
        _chain(a, step)
        (e, q), half = _step_matrices(a, loss, step), _step_matrices(a, loss, 0.5 * step)[0]
        unscale: F8 = np.concatenate([scale, np.ones(n), [size, size, size]])[None]
    else:
        e, q, half = np.empty((3, n, 5, 5))
        diagonal = np.diag(damping)
        level = np.ceil(np.log2((scale + diagonal) * step))
        for some in (level == one for one in np.unique(level)):
            a, loss = np.zeros((some.sum(), 5, 5)), np.zeros((some.sum(), 5, 5))
            a[:, 0, 1], a[:, 1, 0], a[:, 1, 1] = scale[some], -square[some] / scale[some], -diagonal[some]
            a[:, 1, 2] = -1.0 / step
            loss[:, 1, 1] = diagonal[some]
            _chain(a, step)
            e[some], q[some] = _step_matrices(a, loss, step)
            half[some] = _step_matrices(a, loss, 0.5 * step)[0]
        unscale = np.stack([scale, np.ones(n), bit * step, bit * step, bit * step], axis=1)
    mix = np.eye(e.shape[-1])
    mix[-2, -1] = 4.0
    e, half = (x * unscale[:, None, :] / unscale[:, :, None] @ mix for x in (e, half))
    q = mix.T @ (q * unscale[:, None, :] * unscale[:, :, None]) @ mix
    return e, half, q


def _classical(kind: str, square: F8, damping: F8, dense: bool, bit: F8, step: float) -> tuple[F8, F8, F8]:
    """The same for the trapezoidal rule and for explicit central differences; half a step is left at zero."""
    k, c = (np.diag(square)[None], damping[None]) if dense else (square[:, None, None], np.diag(damping)[:, None, None])
    m, h, load = k.shape[-1], step, -(bit[None, :, None] if dense else bit[:, None, None])
    one, none = np.broadcast_to(np.eye(m), k.shape), np.zeros_like(k)
    if kind == "trapezoidal":
        a = np.block([[none, one], [-k, -c]])
        left = np.eye(2 * m) - 0.5 * h * a
        e = np.linalg.solve(left, np.eye(2 * m) + 0.5 * h * a)
        at_end = np.linalg.solve(left, np.concatenate([0.0 * load, 0.5 * h * load], axis=1))
        at_start = at_end
    else:
        left = one + 0.5 * h * c
        slow = one - 0.5 * h * c
        e_x = np.concatenate([one - 0.5 * h * h * k, h * slow], axis=2)
        e_v = np.concatenate([-0.5 * h * k, slow], axis=2) - 0.5 * h * k @ e_x
        e = np.concatenate([e_x, np.linalg.solve(left, e_v)], axis=1)
        x = 0.5 * h * h * load
        at_start = np.concatenate([x, np.linalg.solve(left, 0.5 * h * (load - k @ x))], axis=1)
        at_end = np.concatenate([0.0 * x, np.linalg.solve(left, 0.5 * h * load)], axis=1)
    # bit force p at the start, p + r at the end
    rows: F8 = np.concatenate([e, at_start + at_end, at_end, 0.0 * at_end], axis=2)
    mean = 0.5 * rows[:, m:]
    mean[:, np.arange(m), m + np.arange(m)] += 0.5
    q = h * np.swapaxes(mean, 1, 2) @ c @ mean
    full = np.zeros((len(rows), 2 * m + 3, 2 * m + 3))
    full[:, : 2 * m] = rows
    return full, np.zeros_like(full), q


def condense(
    channel: Channel,
    free: NDArray[np.int64],
    load: F8,
    steps: tuple[float, ...],
    driven: bool,
    integrator: str = "exact",
) -> tuple[Modes, F8]:
    """A channel over its free degrees of freedom for steps of all these lengths, and the mode shapes (free, n)."""
    part = np.ix_(free, free)
    mass = channel.mass[part]
    square, shapes = eigh(channel.stiffness[part], mass)
    if not driven:
        square[0] = 0.0  # the uniform motion, free of rounding
        ones = np.ones(len(free))
        shapes[:, 0] = ones / np.sqrt(ones @ mass @ ones)
    damping = shapes.T @ channel.damping[part] @ shapes
    if not driven:
        damping[0, :] = damping[:, 0] = 0.0
    largest = np.diag(damping).max()
    dense = bool(np.abs(damping - np.diag(np.diag(damping))).max() > 1e-9 * max(largest, 1e-300))
    hook = np.zeros(len(square)) if driven else shapes[list(free).index(channel.top)]
    momentum = channel.mass.sum(axis=0)
    uniform, inertia = shapes.T @ momentum[free], float(momentum.sum())
    bit, weight = shapes[list(free).index(channel.bit)], shapes.T @ load[free]
    mean = 0.0 if driven else weight[0] / bit[0]
    rest = np.where(square > 0, (weight - bit * mean) / np.where(square > 0, square, 1.0), 0.0)
    still = np.zeros(len(square)) if not driven else uniform / square
    shape_rows = [bit, hook, square, rest, uniform, still, square * uniform, damping @ uniform, weight]

    def data(step: float) -> tuple[F8, F8, F8]:
        if integrator == "exact":
            e, half, q = _exact(square, damping, dense, bit, step)
        else:
            e, half, q = _classical(integrator, square, damping, dense, bit, step)
        m = (e.shape[-1] - 3) // 2
        p, r, b = 2 * m, 2 * m + 1, 2 * m + 2
        answers = [e[:, i : i + m, j].ravel() for j in (p, r, b) for i in (0, m)]
        middle = [half[:, :m, j].ravel() for j in (p, r, b)]
        mixed = [2 * q[:, i : i + m, j].ravel() for j in (p, r, b) for i in (0, m)]
        if dense:
            big = np.stack([e[0, :p, :p], q[0, :p, :p]])
            own = [np.zeros_like(square)] * 4
            loss = [np.zeros_like(square)] * 3
            to_middle = [bit @ half[0, :m, :m], bit @ half[0, :m, m:p]]
        else:
            big = np.zeros((2, 1, 1))
            own = [e[:, 0, 0], e[:, 0, 1], e[:, 1, 0], e[:, 1, 1]]
            loss = [q[:, 0, 0], 2 * q[:, 0, 1], q[:, 1, 1]]
            to_middle = [bit * half[:, 0, 0], bit * half[:, 0, 1]]
        numbers = [
            f * q[:, i, j].sum() for f, i, j in ((1, p, p), (2, p, r), (1, r, r), (2, p, b), (2, r, b), (1, b, b))
        ]
        numbers.append(mean)
        for k in range(3):
            numbers += [-bit @ answers[2 * k], -bit @ answers[2 * k + 1], -bit @ middle[k]]
        exact = float(integrator == "exact")
        numbers += [inertia, uniform @ bit, float(largest > 0.0), exact, exact / 12.0, 0.0, float(not square.any())]
        return np.stack([*own, *answers, *loss, *mixed, *to_middle, *shape_rows]), np.array(numbers), big

    made = {step: data(step) for step in sorted(set(steps))}
    return Modes(*(np.stack(arrays) for arrays in zip(*(made[step] for step in steps), strict=True))), shapes


def _below(torsion: Channel) -> NDArray[np.int64]:
    """Degrees of freedom below the top, whose angle is imposed."""
    return np.flatnonzero(np.arange(len(torsion.mass)) != torsion.top)


def _fastest(channel: Channel, free: NDArray[np.int64]) -> float:
    """Highest natural frequency, rad/s."""
    part, last = np.ix_(free, free), len(free) - 1
    square = eigh(channel.stiffness[part], channel.mass[part], eigvals_only=True, subset_by_index=[last, last])
    return float(np.sqrt(max(square[0], 0.0)))


def stable_step(axial: Channel, torsion: Channel) -> float:
    """Longest stable step (s) of explicit central differences: 2 / (highest natural frequency of the two, rad/s).

    The axial top is free, the angle of the top is imposed.
    """
    return 2.0 / max(_fastest(axial, np.arange(len(axial.mass))), _fastest(torsion, _below(torsion)), 1e-300)


@kernel("reassoc", "contract", "nsz", lean=True)
def propagate(
    table: F8, big: F8, damped: float, last: F8, x: F8, v: F8, p: float, r: float, b: float, x1: F8, v1: F8, z: F8
) -> tuple[float, float, float, float, float, float, float]:
    """Add the bit force of the last step (rows ``last``), then advance freely by a step into x1, v1.

    Returns the bit's position in the middle, and position and speed at the end, without bit force, and the sums of
    the dissipation of the coming step: loss = s0 + p s1 + r s2 + b s3 + (terms in p, r, b).  State between calls: free
    part of the modes, force still to be added.  ``z`` (4n): scratch.
    Only sums are reassociated (for SIMD); the order is fixed by the compiled code, so runs repeat to the bit.
    """
    n = table.shape[1]
    m = u = w = s0 = s1 = s2 = s3 = 0.0
    if big.shape[1] > 1:
        step, loss = big[0], big[1]
        for j in range(n):
            f = x[j] + (last[CX, j] * p + last[RX, j] * r + last[BX, j] * b)
            g = v[j] + (last[CV, j] * p + last[RV, j] * r + last[BV, j] * b)
            z[j] = f
            z[n + j] = g
            m += table[MX, j] * f + table[MV, j] * g
            s1 += f * table[QXP, j] + g * table[QVP, j]
            s2 += f * table[QXR, j] + g * table[QVR, j]
            s3 += f * table[QXB, j] + g * table[QVB, j]
        for i in range(2 * n):
            row, form = step[i], loss[i]
            moved = lost = 0.0
            for j in range(2 * n):
                moved += row[j] * z[j]
                lost += form[j] * z[j]
            s0 += lost * z[i]
            z[2 * n + i] = moved
        for j in range(n):
            x1[j] = z[2 * n + j]
            v1[j] = z[3 * n + j]
            u += table[BIT, j] * x1[j]
            w += table[BIT, j] * v1[j]
        return m, u, w, s0, s1, s2, s3
    for j in range(n):
        f = x[j] + (last[CX, j] * p + last[RX, j] * r + last[BX, j] * b)
        g = v[j] + (last[CV, j] * p + last[RV, j] * r + last[BV, j] * b)
        z[j] = f
        z[n + j] = g
        m += table[MX, j] * f + table[MV, j] * g
        f1 = table[E11, j] * f + table[E12, j] * g
        g1 = table[E21, j] * f + table[E22, j] * g
        x1[j] = f1
        v1[j] = g1
        u += table[BIT, j] * f1
        w += table[BIT, j] * g1
    if damped > 0.0:
        for j in range(n):
            f, g = z[j], z[n + j]
            s0 += f * (table[QXX, j] * f + table[QXV, j] * g) + table[QVV, j] * g * g
            s1 += f * table[QXP, j] + g * table[QVP, j]
            s2 += f * table[QXR, j] + g * table[QVR, j]
            s3 += f * table[QXB, j] + g * table[QVB, j]
    return m, u, w, s0, s1, s2, s3


@kernel("reassoc", "contract", "nsz", lean=True)
def observe(
    table: F8, x: F8, v: F8, p: float, r: float, b: float, shift: float
) -> tuple[float, float, float, float, float, float, float]:
    """Sums over the modes: v.v, stored square, momentum, its position, restoring force, load position, top position.

    ``shift`` is the uniform acceleration of the frame, whose static answer is taken out of x.
    """
    kinetic = strain = momentum = position = force = load = top = 0.0
    for j in range(table.shape[1]):
        f = x[j] + (table[CX, j] * p + table[RX, j] * r + table[BX, j] * b)
        g = v[j] + (table[CV, j] * p + table[RV, j] * r + table[BV, j] * b)
        actual = f - table[STILL, j] * shift
        whole = actual + table[REST, j]
        kinetic += g * g
        strain += table[SQUARE, j] * whole * whole
        momentum += table[UNIFORM, j] * g
        position += table[UNIFORM, j] * actual
        force += table[PULL, j] * f + table[DRAG, j] * g
        load += table[LOAD, j] * f
        top += table[HOOK, j] * f
    return kinetic, strain, momentum, position, force, load, top


# Scalars of the state: what one step hands to the next.  (PA, RA, BA), (PT, RT, BT): the bit forces of the last step
(U, V, PHI, W, WC, WF, TC, TF, DEPTH, WEAR, CONTACT) = range(11)
(PA, RA, BA, PT, RT, BT, ACC, TOP, TOP_SPEED, KIND, SWING, SLOT) = range(11, 23)
(E_TOP, E_CUT, E_WEAR, E_LOSS, IMPULSE, MOMENTUM, DIVIDED, SOLVED, RAMP) = range(23, 32)
N_SCALARS = 32
# of the solution of a step: cutting force at the end and its bulge, wear-flat force, their torques, bit speeds,
# depth, turn, depth of cut, fraction of the wear-flat force, and by how much that force has grown in the step
(N_WC, N_BULGE, N_WF, N_TC, N_TF, N_V, N_W, N_U, N_TURN, N_DEPTH, N_WEAR, N_GROWN) = range(12)
N_FOUND = 12
SCRATCH = 8
"""Rows of scratch memory, each as long as the surface has sectors."""


@kernel(lean=True)
def _cut_on(par: F8, surface: SurfaceData, axial: F8, torsion: F8, s: F8, free: F8, work: F8, out: F8) -> bool:
    """Step in which the bit cuts and the wear flats press all the time, or not at all: fourth order.

    The cutting force is a parabola through its values now, in the middle and at the end of the step.  ``free`` (6,):
    middle position, position and speed of the end without bit force, axial and torsional.  False, and nothing changed,
    if it is not such a step.
    """
    m, blades, kappa = surface.share.size, par[BLADES], par[EPS1] * par[ZETA] * par[RADIUS]
    ta, tf = 0.5 * par[RADIUS] / par[ZETA], 0.5 * par[RADIUS] * par[MU] * par[GAMMA]
    wc0, wf = s[WC], s[WEAR] * par[SIGMA1] * par[RADIUS] * par[FLAT]
    # answers to the force in the middle (first) and at the end, and what the rest of the parabola does
    p, q = wc0 + wf - axial[MEAN], ta * wc0 + tf * wf
    um1, um2 = axial[KM], axial[HM] - 0.5 * axial[KM]
    ue1, ue2 = axial[KU], axial[HU] - 0.5 * axial[KU]
    tm1, tm2 = ta * torsion[KM], ta * (torsion[HM] - 0.5 * torsion[KM])
    te1, te2 = ta * torsion[KU], ta * (torsion[HU] - 0.5 * torsion[KU])
    um = free[0] - axial[GM] * p + (axial[HM] + 0.5 * axial[KM]) * wc0
    ue = free[1] - axial[GU] * p + (axial[HU] + 0.5 * axial[KU]) * wc0
    tm = free[3] - torsion[GM] * q + (torsion[HM] + 0.5 * torsion[KM]) * ta * wc0
    te = free[4] - torsion[GU] * q + (torsion[HU] + 0.5 * torsion[KU]) * ta * wc0
    # the force goes on as it did
    wm, we = wc0 + 0.5 * s[RAMP], wc0 + s[RAMP]
    turn_m, turn = tm - tm1 * wm - tm2 * we, te - te1 * wm - te2 * we
    for sweep in range(4):
        if turn_m < 0.0 or turn < turn_m:
            return False
        guess_m, guess = turn_m, turn
        ahead(surface, turn_m, True, work[0], work[1])
        ahead(surface, turn, True, work[2], work[3])
        high_m = high = slope_m = slope = 0.0
        for i in range(m):
            high_m += surface.share[i] * work[0, i]
            slope_m += surface.share[i] * work[1, i]
            high += surface.share[i] * work[2, i]
            slope += surface.share[i] * work[3, i]
        # the rock linearised there: two equations for the force in the middle and at the end
        high_m += slope_m * (tm - guess_m)
        high += slope * (te - guess)
        a11 = 1.0 + kappa * (blades * um1 - slope_m * tm1)
        a12 = kappa * (blades * um2 - slope_m * tm2)
        a21 = kappa * (blades * ue1 - slope * te1)
        a22 = 1.0 + kappa * (blades * ue2 - slope * te2)
        b1, b2 = kappa * (blades * um - high_m), kappa * (blades * ue - high)
        det = a11 * a22 - a12 * a21
        if a11 <= 0.0 or det <= 0.0:
            return False
        wm, we = (a22 * b1 - a12 * b2) / det, (a11 * b2 - a21 * b1) / det
        turn_m, turn = tm - tm1 * wm - tm2 * we, te - te1 * wm - te2 * we
        if abs(turn - guess) + abs(turn_m - guess_m) <= 1e-6 * abs(turn):
            break
        if sweep == 3:  # the rock is too rough for parabolas
            return False
    bulge = wm - 0.5 * (wc0 + we)
    v = free[2] - axial[GV] * p - axial[HV] * (we - wc0) - axial[KV] * bulge
    w = free[5] - torsion[GV] * q - ta * (torsion[HV] * (we - wc0) + torsion[KV] * bulge)
    if w < max(par[C2], par[C3]) or w <= 0.0 or (v < par[C1] if wf > 0.0 else v > 0.0):
        return False
    u_m, u = um - um1 * wm - um2 * we, ue - ue1 * wm - ue2 * we
    for i in range(m):
        if u_m < work[0, i] + work[1, i] * (turn_m - guess_m) or u < work[2, i] + work[3, i] * (turn - guess):
            return False
    out[N_WC], out[N_BULGE], out[N_WF], out[N_TC], out[N_TF] = we, bulge, wf, ta * we, tf * wf
    out[N_V], out[N_W], out[N_U], out[N_TURN], out[N_DEPTH], out[N_WEAR] = v, w, u, turn, we / kappa, s[WEAR]
    out[N_GROWN] = 0.0
    return True


@kernel(lean=True)
def _stick_on(par: F8, surface: SurfaceData, axial: F8, torsion: F8, s: F8, free: F8, work: F8, out: F8) -> bool:
    """Step in which a rigid mass on the bit sticks axially while the bit turns and cuts: as `_cut_on`, and the
    wear-flat force is linear in the step and holds the mass in its middle and at its end.

    Linear from one step to the next it would ring; so it may jump between steps (second order).  False, and nothing
    changed, if the mass comes loose.
    """
    m, kappa = surface.share.size, par[EPS1] * par[ZETA] * par[RADIUS]
    ta, tf = 0.5 * par[RADIUS] / par[ZETA], 0.5 * par[RADIUS] * par[MU] * par[GAMMA]
    flat, wc0 = par[SIGMA1] * par[RADIUS] * par[FLAT], s[WC]
    if flat <= 0.0:
        return False
    soft, push = par[C1] / flat, axial[GV]  # speed per force of the law and of the mass over the step
    wm, we, wear_m, wear = wc0 + 0.5 * s[RAMP], wc0 + s[RAMP], s[WF], s[WF]
    u_m = u = s[U]
    turn_m = turn = start = grown = bulge = 0.0
    for sweep in range(8):
        bulge = wm - 0.5 * (wc0 + we)
        # 2 x 2: the speeds that the law gives to the wear forces in the middle and at the end
        b1 = free[2] - push * (0.5 * (wc0 - axial[MEAN]) + (we - wc0) / 8.0 + bulge / 3.0)
        b2 = free[2] - push * (wc0 - axial[MEAN] + 0.5 * (we - wc0) + bulge / 1.5)
        # force 2 wear_m - wear at the start
        a11, a12 = soft + 0.75 * push, -0.25 * push
        a21, a22 = push, soft
        det = a11 * a22 - a12 * a21
        wear_m, wear = (a22 * b1 - a12 * b2) / det, (a11 * b2 - a21 * b1) / det
        start, grown = 2.0 * wear_m - wear, 2.0 * (wear - wear_m)
        p, q, r = wc0 + start - axial[MEAN], ta * wc0 + tf * start, we - wc0
        old_m, old = turn_m, turn
        turn_m = free[3] - torsion[GM] * q - torsion[HM] * (ta * r + tf * grown) - torsion[KM] * ta * bulge
        turn = free[4] - torsion[GU] * q - torsion[HU] * (ta * r + tf * grown) - torsion[KU] * ta * bulge
        u_m = free[0] - axial[GM] * p - axial[HM] * (r + grown) - axial[KM] * bulge
        u = free[1] - axial[GU] * p - axial[HU] * (r + grown) - axial[KU] * bulge
        if turn_m < 0.0 or turn < turn_m:
            return False
        ahead(surface, turn_m, True, work[0], work[1])
        ahead(surface, turn, True, work[2], work[3])
        wm = we = 0.0
        for i in range(m):
            if u_m < work[0, i] or u < work[2, i]:
                return False
            wm += kappa * surface.share[i] * (u_m - work[0, i])
            we += kappa * surface.share[i] * (u - work[2, i])
        if abs(turn - old) + abs(turn_m - old_m) <= 1e-9 * abs(turn):
            break
        if sweep == 7:
            return False
    w = free[5] - torsion[GV] * q - torsion[HV] * (ta * r + tf * grown) - torsion[KV] * ta * bulge
    if w < max(par[C2], par[C3]) or w <= 0.0:
        return False
    if min(wear_m, wear) < 0.0 or max(wear_m, wear) > flat:
        return False
    out[N_WC], out[N_BULGE], out[N_WF], out[N_TC], out[N_TF] = we, bulge, wear, ta * we, tf * wear
    out[N_V], out[N_W], out[N_U], out[N_TURN], out[N_DEPTH], out[N_WEAR] = (
        soft * wear,
        w,
        u,
        turn,
        we / kappa,
        wear / flat,
    )
    out[N_GROWN] = grown
    return True


@kernel(lean=True)
def _cut_smoothly(par: F8, surface: SurfaceData, axial: F8, torsion: F8, s: F8, free: F8, work: F8, out: F8) -> bool:
    """Step with the cutting force linear in time and any wear-flat force: closed form, second order.

    ``free`` as for `_cut_on`.  False, and nothing changed, if it is not cutting.
    """
    m = surface.share.size
    ta, tf = 0.5 * par[RADIUS] / par[ZETA], 0.5 * par[RADIUS] * par[MU] * par[GAMMA]
    kappa = par[EPS1] * par[ZETA] * par[RADIUS]
    flat = par[SIGMA1] * par[RADIUS] * par[FLAT]
    wc0, tc0 = s[WC], s[TC]
    # end values as affine maps of the end cutting force wc and the wear force wf
    ua = free[1] - axial[GU] * (wc0 - axial[MEAN]) + axial[HU] * wc0
    va = free[2] - axial[GV] * (wc0 - axial[MEAN]) + axial[HV] * wc0
    fa = free[4] - torsion[GU] * tc0 + torsion[HU] * tc0
    wa = free[5] - torsion[GV] * tc0 + torsion[HV] * tc0
    turn = fa - torsion[HU] * tc0 - torsion[GU] * s[TF]
    wc = wf = u = v = w = x = 0.0
    for _sweep in range(4):
        if turn < 0.0:
            return False
        ahead(surface, turn, True, work[0], work[1])
        heights = slopes = 0.0
        for i in range(m):
            heights += surface.share[i] * (work[0, i] - work[1, i] * turn)
            slopes += surface.share[i] * work[1, i]
        stiff = 1.0 + kappa * (par[BLADES] * axial[HU] - slopes * torsion[HU] * ta)
        a0 = kappa * (par[BLADES] * ua - heights - slopes * fa) / stiff
        a1 = kappa * (par[BLADES] * axial[GU] - slopes * torsion[GU] * tf) / stiff
        v0 = va - axial[HV] * a0
        fall = (axial[GV] - axial[HV] * a1) * flat
        if stiff <= 0.0 or fall < 0.0:
            return False
        x = 1.0 if v0 - fall >= par[C1] else (0.0 if v0 <= 0.0 else v0 / (par[C1] + fall))
        wf = x * flat
        wc = a0 - a1 * wf
        v = v0 - x * fall
        u = ua - axial[HU] * wc - axial[GU] * wf
        w = wa - torsion[HV] * ta * wc - torsion[GV] * tf * wf
        guess = turn
        turn = fa - torsion[HU] * ta * wc - torsion[GU] * tf * wf
        if abs(turn - guess) <= 1e-7 * abs(turn):
            break
    if w < max(par[C2], par[C3]) or w <= 0.0 or turn < 0.0:
        return False
    ahead(surface, turn, True, work[0], work[1])
    depth = 0.0
    for i in range(m):
        if u < work[0, i]:
            return False
        depth += surface.share[i] * (u - work[0, i])
    if abs(wc - kappa * depth) > 1e-6 * (abs(wc) + flat):  # over a step in the rock
        return False
    out[N_WC], out[N_BULGE], out[N_WF], out[N_TC], out[N_TF] = wc, 0.0, wf, ta * wc, tf * wf
    out[N_V], out[N_W], out[N_U], out[N_TURN], out[N_DEPTH], out[N_WEAR] = v, w, u, turn, depth, x
    out[N_GROWN] = 0.0
    return True


@kernel(lean=True)
def end_of_step(
    par: F8,
    surface: SurfaceData,
    axial: F8,
    torsion: F8,
    whole: bool,
    s: F8,
    step: float,
    free: F8,
    turned: float,
    work: F8,
    out: F8,
) -> bool:
    """Solve the bit, turn the rock and keep the books of one step; the bit forces of the step are left in ``s``.

    axial, torsion : Modes.number of the step.  free (7,) : as for `_cut_on`, turns from the committed angle; then the
    spin at the start without bit force, where the string has no inertia.
    turned : rad, by which the top turned.  A ``whole`` step must be smooth: else False, and nothing has changed.
    """
    steady = s[WEAR] == 0.0 or s[WEAR] == 1.0
    smooth = False
    if s[CONTACT] > 0.0 and axial[FOURTH] > 0.0:
        if steady:
            smooth = _cut_on(par, surface, axial, torsion, s, free, work, out)
        elif axial[RIGID] > 0.0:
            smooth = _stick_on(par, surface, axial, torsion, s, free, work, out)
    if not smooth and whole and (axial[FOURTH] > 0.0 or not steady):
        return False
    if not smooth and s[CONTACT] > 0.0:
        smooth = _cut_smoothly(par, surface, axial, torsion, s, free, work, out)
        if whole and not (smooth and out[N_WEAR] == s[WEAR]):
            return False
    if not smooth and whole:
        return False
    ta, tf = 0.5 * par[RADIUS] / par[ZETA], 0.5 * par[RADIUS] * par[MU] * par[GAMMA]
    w0, bulge, grown = s[W], 0.0, 0.0
    if smooth:
        wc, wf, tc, tf1, v, w = out[N_WC], out[N_WF], out[N_TC], out[N_TF], out[N_V], out[N_W]
        u, turn, depth, wear, bulge, grown = (
            out[N_U], out[N_TURN], out[N_DEPTH], out[N_WEAR], out[N_BULGE], out[N_GROWN]
        )  # fmt: skip
        pc, rc, qc, zc, pw, qw = s[WC], wc - s[WC], s[TC], tc - s[TC], wf - grown, tf1 - tf * grown
        # spin at the start: where the string has no inertia it follows the torque at once
        if torsion[AT_ONCE] > 0.0:
            w0 = free[6] - torsion[AT_ONCE] * (qc + qw)
        if turn > 0.0 and min(w0, w) > 0.2 * turn / step:  # the path of the bit in the rock is smooth too
            commit(surface, turn, s[U], u, s[V] / w0, v / w)
        else:
            chord = (u - s[U]) / turn if turn != 0.0 else 0.0
            commit(surface, turn, s[U], u, chord, chord)
    else:
        wc, wf, tc, tf1, v, w, u, turn, depth = bit_step_in(
            par,
            surface,
            free[2] + axial[GV] * axial[MEAN],
            axial[GV],
            free[1] + axial[GU] * axial[MEAN],
            axial[GU],
            free[5],
            torsion[GV],
            free[4],
            torsion[GU] / torsion[GV],
            s[W],
            work,
        )[2:]
        wear = wear_fraction(par, v)
        pc, rc, qc, zc, pw, qw = wc, 0.0, tc, 0.0, wf, tf1
        s[SOLVED] += 1.0
        chord = (u - s[U]) / turn if turn != 0.0 else 0.0
        commit(surface, turn, s[U], u, chord, chord)
    # work of the bit force: exact for its constant part, fourth order for the others
    sink, rise, spun = u - s[U], step * axial[TWELFTH] * (v - s[V]), step * torsion[TWELFTH] * (w - w0)
    s[E_CUT] += pc * sink + rc * (0.5 * sink + rise) + bulge * (0.8 * sink - step / 15.0 * (v + s[V]))
    s[E_CUT] += qc * turn + zc * (0.5 * turn + spun) + ta * bulge * (0.8 * turn - step / 15.0 * (w + w0))
    s[E_WEAR] += pw * sink + qw * turn + grown * (0.5 * sink + rise + tf * (0.5 * turn + spun))
    s[PA], s[RA], s[BA] = pc + pw - axial[MEAN], rc + grown, bulge
    s[PT], s[RT], s[BT], s[RAMP] = qc + qw, zc + tf * grown, ta * bulge, rc
    s[U], s[V], s[W] = u, v, w
    s[PHI] = s[PHI] - turned + turn
    s[WC], s[WF], s[TC], s[TF], s[DEPTH], s[WEAR] = wc, wf, tc, tf1, depth, wear
    contact = w >= max(par[C2], par[C3]) and w > 0.0 and depth >= 0.0
    if contact and not smooth:
        ahead(surface, 0.0, True, work[0], work[1])
        for i in range(work.shape[1]):
            contact = contact and u >= work[0, i]
    s[CONTACT] = 1.0 if contact else 0.0
    return True


@kernel(lean=True)
def _substep(
    par: F8,
    surface: SurfaceData,
    axial: Modes,
    torsion: Modes,
    kind: int,
    modes: F8,
    s: F8,
    step: float,
    angle1: float,
    speed1: float,
    work: F8,
    small: F8,
    z: F8,
) -> bool:
    """One step of one kind (0 whole, else a part).  A whole step must be smooth: else False, and nothing changes."""
    ca, ct = axial.number[kind], torsion.number[kind]
    if kind == 0 and (s[CONTACT] == 0.0 or (0.0 < s[WEAR] < 1.0 and ca[RIGID] == 0.0)):
        return False
    last, slot, acceleration = int(s[KIND]), int(s[SLOT]), s[ACC]
    old, new, free, out = modes[slot], modes[1 - slot], small[0], small[1]
    free[0], free[1], free[2], a0, a1, a2, a3 = propagate(
        axial.table[kind], axial.big[kind], ca[DAMPED], axial.table[last],
        old[0], old[1], s[PA], s[RA], s[BA], new[0], new[1], z,
    )  # fmt: skip
    free[3], free[4], free[5], t0, t1, t2, t3 = propagate(
        torsion.table[kind], torsion.big[kind], ct[DAMPED], torsion.table[last],
        old[2], old[3], s[PT], s[RT], s[BT], new[2], new[3], z,
    )  # fmt: skip
    turned, speed0 = angle1 - s[TOP], s[TOP_SPEED]
    shift = s[SWING] * acceleration + s[PHI]
    # half-way the top has turned as a uniform acceleration has it
    free[3] += 0.5 * turned - 0.125 * acceleration * step * step - shift
    free[4] += turned - shift
    free[5] += speed1
    momentum0 = position0 = 0.0
    if acceleration != 0.0:
        obs = observe(torsion.table[last], old[2], old[3], s[PT], s[RT], s[BT], acceleration)
        momentum0, position0 = obs[2] + ct[INERTIA] * speed0, obs[3]
    if not end_of_step(par, surface, ca, ct, kind == 0, s, step, free, turned, work, out):
        return False
    s[SLOT], s[KIND] = 1 - slot, kind
    p, r, b = s[PA], s[RA], s[BA]
    s[E_LOSS] += a0 + p * a1 + r * a2 + b * a3
    s[E_LOSS] += p * (ca[QPP] * p + ca[QPR] * r + ca[QPB] * b) + r * (ca[QRR] * r + ca[QRB] * b) + ca[QBB] * b * b
    p, r, b = s[PT], s[RT], s[BT]
    s[E_LOSS] += t0 + p * t1 + r * t2 + b * t3
    s[E_LOSS] += p * (ct[QPP] * p + ct[QPR] * r + ct[QPB] * b) + r * (ct[QRR] * r + ct[QRB] * b) + ct[QBB] * b * b
    # top drive: its torque is the bit's plus the change of angular momentum
    if acceleration == 0.0:
        s[IMPULSE] += (p + 0.5 * r + b / 1.5) * step
    else:
        obs = observe(torsion.table[kind], new[2], new[3], p, r, b, acceleration)
        s[E_TOP] += (obs[2] + ct[INERTIA] * speed1) * speed1 - momentum0 * speed0
        s[E_TOP] -= acceleration * (obs[3] - position0 + ct[INERTIA] * turned)
        s[E_TOP] += step * ((0.5 * p + b / 3.0) * (speed0 + speed1) + r * (speed0 / 6.0 + speed1 / 3.0))
    s[TOP], s[TOP_SPEED] = angle1, speed1
    return True


@kernel(lean=True)
def _march(
    par: F8,
    surface: SurfaceData,
    axial: Modes,
    torsion: Modes,
    modes: F8,
    s: F8,
    first: int,
    step: float,
    divisions: NDArray[np.int64],
    top: F8,
    hook_load: float,
    every: int,
    rows: F8,
    work: F8,
    small: F8,
    z: F8,
) -> None:
    """Steps after number ``first``, as many as ``top`` (steps + 1, 2: angle, speed) has; a row each ``every`` steps.

    work (SCRATCH, sectors), small (2, N_FOUND), z (4 modes): scratch.
    """
    written = 0
    for k in range(top.shape[0] - 1):
        angle1, speed1 = top[k + 1, 0], top[k + 1, 1]
        acceleration = (speed1 - s[TOP_SPEED]) / step
        if abs(acceleration) * step <= 1e-14 * abs(speed1):
            acceleration = 0.0
        if acceleration != s[ACC]:
            table, now = torsion.table[int(s[KIND])], modes[int(s[SLOT])]
            momentum = observe(table, now[2], now[3], s[PT], s[RT], s[BT], s[ACC])[2]
            momentum += torsion.number[0, INERTIA] * s[TOP_SPEED]
            if s[ACC] == 0.0:  # close the account of the uniform motion
                s[E_TOP] += s[TOP_SPEED] * (s[IMPULSE] + momentum - s[MOMENTUM])
                s[IMPULSE] = 0.0
            s[MOMENTUM] = momentum
            # the frame turns with the top: the static answer to its acceleration is kept out of the modes
            for j in range(table.shape[1]):
                now[2, j] += table[STILL, j] * (acceleration - s[ACC])
            s[ACC] = acceleration
        if not _substep(par, surface, axial, torsion, 0, modes, s, step, angle1, speed1, work, small, z):
            angle0, speed0 = s[TOP], s[TOP_SPEED]
            s[DIVIDED] += 1.0
            kind = 1 if s[CONTACT] > 0.0 else 2
            parts = divisions[kind]
            for part in range(1, parts + 1):
                f = part / parts
                # the angle of a uniformly accelerated top that ends where it should
                angle = angle0 + f * (angle1 - angle0) - 0.5 * acceleration * step * step * f * (1.0 - f)
                speed = speed0 + f * (speed1 - speed0)
                if part == parts:
                    angle, speed = angle1, speed1
                _substep(par, surface, axial, torsion, kind, modes, s, step / parts, angle, speed, work, small, z)
        if (first + k + 1) % every == 0:
            _row(par, surface, axial, torsion, modes, s, (first + k + 1) * step, hook_load, rows[written])
            written += 1


@kernel(lean=True)
def _row(
    par: F8,
    surface: SurfaceData,
    axial: Modes,
    torsion: Modes,
    modes: F8,
    s: F8,
    time: float,
    hook_load: float,
    row: F8,
) -> None:
    """Fill one row of OUTPUTS; the works of the loads have offsets that the caller takes off."""
    kind, now = int(s[KIND]), modes[int(s[SLOT])]
    ct = torsion.number[kind]
    a = observe(axial.table[kind], now[0], now[1], s[PA], s[RA], s[BA], 0.0)
    t = observe(torsion.table[kind], now[2], now[3], s[PT], s[RT], s[BT], s[ACC])
    torque, speed = s[TC] + s[TF], s[TOP_SPEED]
    top_torque = torque * (1.0 - ct[REACH]) + ct[INERTIA] * s[ACC] - t[4]
    row[0], row[1], row[2], row[3], row[4] = time, s[W], s[V], s[TOP] + s[PHI], s[U]
    row[5], row[6], row[7] = torque, s[WC] + s[WF], s[DEPTH]
    row[8], row[9], row[10], row[11] = top_torque, speed, hook_load, top_torque * speed
    row[12] = 0.5 * (a[0] + t[0] + ct[INERTIA] * speed * speed) + speed * t[2]
    row[13] = 0.5 * (a[1] + t[1])
    row[14] = s[E_TOP]
    if s[ACC] == 0.0:
        row[14] += (s[IMPULSE] + t[2] + ct[INERTIA] * speed - s[MOMENTUM]) * speed
    row[15] = -hook_load * a[6]
    row[16] = a[5] + hook_load * a[6]
    row[17], row[18], row[19] = s[E_CUT], s[E_WEAR], s[E_LOSS]
    row[20] = 0.5 * par[RADIUS] * par[RADIUS] * surface.removed[0]


class CondensedString:
    """Axial-torsional string on a cutting bit, marched with a fixed step.

    Parameters
    ----------
    axial, torsion : Channel.  The axial top carries ``hook_load`` (N, up); the top angle is imposed.
    law, surface : the bit and its rock; the surface is owned from here on.
    step : s.
    hook_load : N.
    top : rad/s, or a function of an array of times that returns the arrays (angle, speed).
    parts : divisions of a step that is not smooth: where the turning bit begins or ceases to stick or stalls, and
        where it starts stalled, backwards or off bottom.  Default: so that the fastest mode turns at most 2 rad in a
        part, and at least LEAST_PARTS and ROUGH_PARTS.
    integrator : "exact" (each mode by its exact solution), "trapezoidal" or "explicit" (central differences).

    Raises ValueError for a step that is not positive, or beyond the stability limit of "explicit" (`stable_step`).
    """

    def __init__(
        self,
        axial: Channel,
        torsion: Channel,
        law: BitLaw,
        surface: RockSurface,
        step: float,
        *,
        hook_load: float,
        top: float | TopMotion,
        parts: int | tuple[int, int] | None = None,
        integrator: str = "exact",
    ) -> None:
        if not step > 0:
            raise ValueError(f"condensed string: step = {step}: must be > 0")
        if integrator not in INTEGRATORS:
            raise ValueError(f"condensed string: integrator = {integrator!r}: must be one of {', '.join(INTEGRATORS)}")
        limit = stable_step(axial, torsion)
        if integrator == "explicit" and step > limit:
            raise ValueError(
                f"condensed string: step = {step:g} s: explicit central differences are stable up to {limit:.4g} s"
            )
        self.axial, self.torsion, self.law, self.surface = axial, torsion, law, surface
        self.step, self.hook_load, self.integrator = float(step), float(hook_load), integrator
        self._top: TopMotion = top if callable(top) else lambda t: (top * t, np.full_like(t, top))
        n = len(axial.mass)
        load = np.zeros(n) if axial.load is None else np.array(axial.load, float)
        load[axial.top] -= hook_load
        self._free = _below(torsion)
        if parts is None:
            resolved = int(np.ceil(step / limit))
            parts = max(LEAST_PARTS[n == 1], resolved), max(ROUGH_PARTS[n == 1], resolved)
        self.parts = parts if isinstance(parts, tuple) else (parts, parts)
        self._divisions = np.array([1, *self.parts])
        steps = tuple(self.step / self._divisions)
        self._axial, self._axial_shapes = condense(axial, np.arange(n), load, steps, False, integrator)
        self._torsion, self._torsion_shapes = condense(
            torsion, self._free, np.zeros(len(torsion.mass)), steps, True, integrator
        )
        self._par = law.array
        self.count = 0
        nt = len(torsion.mass)
        self.reset(np.zeros(n), np.zeros(n), np.zeros(nt), np.zeros(nt))

    @property
    def time(self) -> float:
        """Time reached, s."""
        return self.count * self.step

    @property
    def frequencies(self) -> tuple[F8, ...]:
        """Undamped natural frequencies of the axial and the torsional channel, Hz."""
        return tuple(np.sqrt(c.table[0, SQUARE]) / (2 * np.pi) for c in (self._axial, self._torsion))

    def nominal(self) -> tuple[F8, F8]:
        """Nodal displacement (m) and twist (rad) of steady drilling, both zero at the top (spec 9.2, 9.3)."""
        torque = self.law.torque(self.law.depth_of_cut(self._axial.number[0, MEAN]))
        u = self._axial_shapes @ self._axial.table[0, REST]
        twist, table = np.zeros(len(self.torsion.mass)), self._torsion.table[0]
        twist[self._free] = -self._torsion_shapes @ (table[BIT] * torque / table[SQUARE])
        return u - u[self.axial.top], twist

    def reset(self, u: F8, u_dot: F8, phi: F8, phi_dot: F8) -> None:
        """Start at time 0 from nodal positions (m, rad) and speeds; the bit's depth counts from here."""
        a, t = self._axial.table[0], self._torsion.table[0]
        angle, speed = (float(x[0]) for x in self._top(np.zeros(1)))
        mass = self._torsion_shapes.T @ self.torsion.mass[np.ix_(self._free, self._free)]
        xa = self._axial_shapes.T @ (self.axial.mass @ u) - a[REST]
        va = self._axial_shapes.T @ (self.axial.mass @ u_dot)
        xt, vt = mass @ (phi - angle)[self._free], mass @ (phi_dot - speed)[self._free]
        # the uniform part of the displacement is set so that the bit starts at depth 0
        self._origin = float(a[BIT] @ xa)
        xa[0] -= self._origin / a[BIT][0]
        # two copies, the current one at s[SLOT]; rows: axial position and speed, torsional position and speed
        self._modes = np.zeros((2, 4, max(len(xa), len(xt))))
        for row, values in zip(self._modes[0], (xa, va, xt, vt), strict=True):
            row[: len(values)] = values
        s = self._s = np.zeros(N_SCALARS)
        s[TOP], s[TOP_SPEED] = angle, speed
        s[V], s[PHI], s[W] = a[BIT] @ va, t[BIT] @ xt, speed + t[BIT] @ vt
        s[MOMENTUM], s[SWING] = t[UNIFORM] @ vt + self._torsion.number[0, INERTIA] * speed, t[BIT] @ t[STILL]
        start_bit(s, self._par, self.surface)
        self.count = 0
        self._offset = np.zeros(len(OUTPUTS))
        self._offset[[15, 16]] = [self.sample()[name] for name in OUTPUTS[15:17]]

    def sample(self) -> dict[str, float]:
        """The outputs now (names of OUTPUTS)."""
        row = np.empty(len(OUTPUTS))
        state = (self._axial, self._torsion, self._modes, self._s)
        _row(self._par, self.surface.data, *state, self.time, self.hook_load, row)
        return dict(zip(OUTPUTS, (float(x) for x in row - self._offset), strict=True))

    def advance(self, steps: int, every: int = 1) -> dict[str, F8]:
        """March; returns the outputs at step numbers that ``every`` divides.  Chunks of any size agree to the bit."""
        times = self.step * np.arange(self.count, self.count + steps + 1)
        top = np.stack(self._top(np.asarray(times, np.float64)), axis=1)
        rows = np.empty(((self.count + steps) // every - self.count // every, len(OUTPUTS)))
        _march(
            self._par,
            self.surface.data,
            self._axial,
            self._torsion,
            self._modes,
            self._s,
            self.count,
            self.step,
            self._divisions,
            top,
            self.hook_load,
            every,
            rows,
            np.empty((SCRATCH, len(self.surface.data.share))),
            np.empty((2, N_FOUND)),
            np.empty(4 * self._modes.shape[2]),
        )
        self.count += steps
        rows -= self._offset
        return dict(zip(OUTPUTS, np.ascontiguousarray(rows.T), strict=True))

    def fields(self) -> dict[str, F8]:
        """Nodal displacement (m), angle (rad) and their speeds now, in the numbering of the channels."""
        s, kind = self._s, int(self._s[KIND])
        a, t = self._axial.table[kind], self._torsion.table[kind]
        now = self._modes[int(s[SLOT])]
        x, v = now[:2, : a.shape[1]]
        y, w = now[2:, : t.shape[1]]
        xa = x + a[[CX, RX, BX]].T @ s[PA : BA + 1] + a[REST]
        va = v + a[[CV, RV, BV]].T @ s[PA : BA + 1]
        xt = y + t[[CX, RX, BX]].T @ s[PT : BT + 1] - t[STILL] * s[ACC]
        vt = w + t[[CV, RV, BV]].T @ s[PT : BT + 1]
        angle, spin = np.full(len(self.torsion.mass), s[TOP]), np.full(len(self.torsion.mass), s[TOP_SPEED])
        angle[self._free] += self._torsion_shapes @ xt
        spin[self._free] += self._torsion_shapes @ vt
        return {
            "displacement": self._axial_shapes @ xa + self._origin,
            "axial_speed": self._axial_shapes @ va,
            "angle": angle,
            "angular_speed": spin,
        }

    @property
    def counters(self) -> dict[str, int]:
        """Steps taken, those that were divided, and parts solved with the bit stalled, off bottom or in between."""
        return {"steps": self.count, "divided": int(self._s[DIVIDED]), "solved": int(self._s[SOLVED])}

    def state_dict(self) -> dict[str, Any]:
        """Everything that changes in time, as arrays; `load` goes on as if never stopped, to the bit."""
        state: dict[str, Any] = {"modes": self._modes.copy(), "scalars": self._s.copy(), "offset": self._offset.copy()}
        state |= {"count": np.array(self.count), "origin": np.array(self._origin)}
        return state | {f"surface_{name}": array for name, array in self.surface.state_dict().items()}

    def load(self, state: dict[str, Any]) -> None:
        """Take over a state of `state_dict` of a string made in the same way."""
        self._modes[:], self._s[:], self._offset[:] = state["modes"], state["scalars"], state["offset"]
        self.count, self._origin = int(state["count"]), float(state["origin"])
        self.surface.load({name[8:]: array for name, array in state.items() if name.startswith("surface_")})


def start_bit(s: F8, par: F8, surface: RockSurface) -> None:
    """Forces of a bit that starts with speeds s[V] (m/s) and s[W] (rad/s) at the depth and angle of the surface."""
    s[WEAR] = wear_fraction(par, s[V])
    gap, share = -surface.ahead(0.0)[0], surface.data.share
    s[DEPTH] = surface.depth_of_cut(0.0)
    contact = share @ (gap >= 0) / share.sum()
    s[WC : TF + 1] = law_forces(par, s[V], s[W], s[DEPTH], contact)[2:]
    s[CONTACT] = float(contact == 1.0 and s[W] > 0 and s[W] >= max(par[C2], par[C3]))


def energy_imbalance(history: dict[str, F8]) -> F8:
    """Stored energy minus what came in plus what left, from its first value, J: zero up to the scheme's error."""
    h = history
    stored = h["kinetic_energy"] + h["strain_energy"]
    balance = stored - h["work_top_drive"] - h["work_hook_load"] - h["work_gravity"]
    balance = balance + h["work_cutting"] + h["work_wear_flat"] + h["dissipated"]
    return balance - balance[0]
