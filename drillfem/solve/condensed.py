"""The straight string condensed onto the bit: exact linear dynamics between the ends, the bit law solved per step.

An axial-torsional string is linear except at the bit.  Each of its two channels,
``M q'' + C q' + K q = load - e_bit P``, is brought to modal coordinates once; a step then propagates every mode by
its exact solution, so that only the history of the bit force P within the step is approximated:

* the cutting force is linear in the step while the bit cuts at both ends of it (second order);
* the wear-flat force is constant in the step and takes its end value, and so is everything while the bit is
  stalled, turns backwards, leaves the bottom or lands: a linear multiplier would ring where the bit sticks;
* a step in which the wear-flat force changes, or that is not cutting throughout, is divided so that the fastest mode is
  resolved: on longer steps the modes beyond the sampling rate answer a sticking bit with the wrong sign, and it rings.

At the end of the step the modes answer the bit force by affine maps, and `drillfem.bitrock` solves the bit on them.
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
from drillfem.bitrock.solve import bit_step
from drillfem.bitrock.surface import RockSurface, SurfaceData, ahead, commit
from drillfem.models.straight import Channel

F8 = NDArray[np.float64]
TopMotion = Callable[[F8], tuple[F8, F8]]

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
    """A channel in mass-normalised modal coordinates, for the whole step (first index 0) and for a part of it (1).

    Few arrays, because the compiled functions hand them on in every step.
    """

    table: F8  # (2, rows, n): one number per mode in the rows named below
    number: F8  # (2, numbers named below)
    big: F8  # (2, 2, 2n, 2n): step matrix and dissipation form where damping couples the modes; else (2, 2, 1, 1)


# rows of Modes.table.  Step matrix of (x, v); answers of x, v to a unit bit force constant over the step (CX, CV) and
# to one that grows from 0 to 1 (RX, RV); dissipation over the step as a quadratic form of (x, v, constant, growing)
(E11, E12, E21, E22, CX, CV, RX, RV, QXX, QXV, QVV, QXP, QVP, QXR, QVR) = range(15)
# mode shapes at bit and top; omega^2; static position under load and mean bit force; momentum in a uniform motion;
# static answer to a uniform acceleration; its restoring and damping rows; constant load
(BIT, HOOK, SQUARE, REST, UNIFORM, STILL, PULL, DRAG, LOAD) = range(15, 24)
# numbers: rest of the dissipation form; bit force that balances the load on the uniform motion; answers of the bit to
# the two unit forces, against the force (GU, GV constant; HU, HV growing); total inertia; UNIFORM . BIT
(QPP, QPR, QRR, MEAN, GU, GV, HU, HV, INERTIA, REACH) = range(10)


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


def _condense(
    channel: Channel, free: NDArray[np.int64], load: F8, step: float, parts: int, driven: bool
) -> tuple[Modes, F8]:
    """A channel over its free degrees of freedom for a step and its ``parts``-th, and the mode shapes (free, n)."""
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
    diagonal = np.diag(damping).copy()
    dense = bool(np.abs(damping - np.diag(diagonal)).max() > 1e-9 * max(diagonal.max(), 1e-300))
    hook = np.zeros(len(square)) if driven else shapes[list(free).index(channel.top)]
    momentum = channel.mass.sum(axis=0)
    modes = (square, damping, dense, shapes[list(free).index(channel.bit)], shapes.T @ load[free], hook)
    uniform, inertia = shapes.T @ momentum[free], float(momentum.sum())
    both = [_step_data(*modes, uniform, inertia, h, driven) for h in (step, step / parts)]
    return Modes(*(np.stack(arrays) for arrays in zip(*both, strict=True))), shapes


def _step_data(
    square: F8,
    damping: F8,
    dense: bool,
    bit: F8,
    weight: F8,
    hook: F8,
    uniform: F8,
    inertia: float,
    step: float,
    driven: bool,
) -> tuple[F8, F8, F8]:
    """Exact propagation of the modes over one step, and what is read from them."""
    n = len(square)
    diagonal = np.diag(damping)
    # unknowns (omega x, v, p, r): balanced, so that few doublings are needed
    scale = np.sqrt(np.maximum(square, 1.0 / step**2))
    if dense:
        a, loss = np.zeros((1, 2 * n + 2, 2 * n + 2)), np.zeros((1, 2 * n + 2, 2 * n + 2))
        i, j = np.arange(n), np.arange(n, 2 * n)
        a[0, i, j] = scale
        a[0, j, i] = -square / scale
        a[0, n : 2 * n, n : 2 * n] = -damping
        a[0, j, 2 * n] = -bit
        a[0, 2 * n, 2 * n + 1] = 1.0 / step
        loss[0, n : 2 * n, n : 2 * n] = damping
        # the force enters scaled, for the same reason
        size = np.abs(bit).max() * step
        a[0, j, 2 * n] /= size
        es, qs = _step_matrices(a, loss, step)
        e, q = es[0], qs[0]
        unscale: F8 = np.concatenate([scale, np.ones(n), [size, size]])
        e, q = e * unscale[None, :] / unscale[:, None], q * unscale[None, :] * unscale[:, None]
        big = np.stack([e[: 2 * n, : 2 * n], q[: 2 * n, : 2 * n]])
        e11 = e12 = e21 = e22 = qxx = qxv = qvv = np.zeros_like(square)
        p, r = 2 * n, 2 * n + 1
        cx, cv, rx, rv = e[:n, p], e[n : 2 * n, p], e[:n, r], e[n : 2 * n, r]
        qxp, qvp, qxr, qvr = q[:n, p], q[n : 2 * n, p], q[:n, r], q[n : 2 * n, r]
        qpp, qpr, qrr = q[p, p], 2 * q[p, r], q[r, r]
    else:
        es, qs = np.empty((n, 4, 4)), np.empty((n, 4, 4))
        norms = (scale + diagonal) * step
        for level in np.unique(np.ceil(np.log2(norms))):
            some = np.ceil(np.log2(norms)) == level
            a, loss = np.zeros((some.sum(), 4, 4)), np.zeros((some.sum(), 4, 4))
            a[:, 0, 1], a[:, 1, 0], a[:, 1, 1] = scale[some], -square[some] / scale[some], -diagonal[some]
            a[:, 1, 2], a[:, 2, 3] = -1.0 / step, 1.0 / step  # unit force, scaled by the step
            loss[:, 1, 1] = diagonal[some]
            es[some], qs[some] = _step_matrices(a, loss, step)
        unscale = np.stack([scale, np.ones(n), bit * step, bit * step], axis=1)
        e = es[:, :2] * unscale[:, None, :] / unscale[:, :2, None]
        q = qs * unscale[:, None, :] * unscale[:, :, None]
        big = np.zeros((2, 1, 1))
        e11, e12, e21, e22 = e[:, 0, 0], e[:, 0, 1], e[:, 1, 0], e[:, 1, 1]
        cx, cv, rx, rv = e[:, 0, 2], e[:, 1, 2], e[:, 0, 3], e[:, 1, 3]
        qxx, qxv, qvv = q[:, 0, 0], 2 * q[:, 0, 1], q[:, 1, 1]
        qxp, qvp, qxr, qvr = q[:, 0, 2], q[:, 1, 2], q[:, 0, 3], q[:, 1, 3]
        qpp, qpr, qrr = q[:, 2, 2].sum(), 2 * q[:, 2, 3].sum(), q[:, 3, 3].sum()
    mean = 0.0 if driven else weight[0] / bit[0]
    rest = np.where(square > 0, (weight - bit * mean) / np.where(square > 0, square, 1.0), 0.0)
    still = np.zeros(n) if not driven else uniform / square
    rows = [e11, e12, e21, e22, cx, cv, rx, rv, qxx, qxv, qvv, 2 * qxp, 2 * qvp, 2 * qxr, 2 * qvr]
    rows += [bit, hook, square, rest, uniform, still, square * uniform, damping @ uniform, weight]
    answers = [-bit @ cx, -bit @ cv, -bit @ rx, -bit @ rv]
    return np.stack(rows), np.array([qpp, qpr, qrr, mean, *answers, inertia, uniform @ bit]), big


@kernel("reassoc", "contract", "nsz")
def _propagate(
    table: F8, big: F8, last: F8, x: F8, v: F8, p: float, r: float, x1: F8, v1: F8
) -> tuple[float, float, float, float, float]:
    """Add the bit force of the last step (rows ``last``), then advance freely by a step into x1, v1.

    Returns bit position and speed without bit force, and the sums of the dissipation of the coming step:
    loss = s0 + p s1 + r s2 + (terms in p, r).  State between calls: free part of the modes, force still to be added.
    Only sums are reassociated (for SIMD); the order is fixed by the compiled code, so runs repeat to the bit.
    """
    n = table.shape[1]
    u = w = s0 = s1 = s2 = 0.0
    cx, cv, rx, rv, bit = last[CX], last[CV], last[RX], last[RV], table[BIT]
    qxp, qvp, qxr, qvr = table[QXP], table[QVP], table[QXR], table[QVR]
    if big.shape[1] > 1:
        z = np.empty(2 * n)
        for j in range(n):
            a = x[j] + (cx[j] * p + rx[j] * r)
            b = v[j] + (cv[j] * p + rv[j] * r)
            z[j] = a
            z[n + j] = b
            s1 += a * qxp[j] + b * qvp[j]
            s2 += a * qxr[j] + b * qvr[j]
        s0 = np.dot(z, np.dot(big[1], z))
        z = np.dot(big[0], z)
        for j in range(n):
            x1[j] = z[j]
            v1[j] = z[n + j]
            u += bit[j] * z[j]
            w += bit[j] * z[n + j]
        return u, w, s0, s1, s2
    e11, e12, e21, e22 = table[E11], table[E12], table[E21], table[E22]
    qxx, qxv, qvv = table[QXX], table[QXV], table[QVV]
    for j in range(n):
        a = x[j] + (cx[j] * p + rx[j] * r)
        b = v[j] + (cv[j] * p + rv[j] * r)
        s0 += a * (qxx[j] * a + qxv[j] * b) + qvv[j] * b * b
        s1 += a * qxp[j] + b * qvp[j]
        s2 += a * qxr[j] + b * qvr[j]
        a1 = e11[j] * a + e12[j] * b
        b1 = e21[j] * a + e22[j] * b
        x1[j] = a1
        v1[j] = b1
        u += bit[j] * a1
        w += bit[j] * b1
    return u, w, s0, s1, s2


@kernel("reassoc", "contract", "nsz")
def _observe(
    table: F8, x: F8, v: F8, p: float, r: float, shift: float
) -> tuple[float, float, float, float, float, float, float]:
    """Sums over the modes: v.v, stored square, momentum, its position, restoring force, load position, top position.

    ``shift`` is the uniform acceleration of the frame, whose static answer is taken out of x.
    """
    kinetic = strain = momentum = position = force = load = top = 0.0
    cx, cv, rx, rv, square, rest, still = (
        table[CX],
        table[CV],
        table[RX],
        table[RV],
        table[SQUARE],
        table[REST],
        table[STILL],
    )
    uniform, pull, drag, load_row, hook = table[UNIFORM], table[PULL], table[DRAG], table[LOAD], table[HOOK]
    for j in range(table.shape[1]):
        a = x[j] + (cx[j] * p + rx[j] * r)
        b = v[j] + (cv[j] * p + rv[j] * r)
        actual = a - still[j] * shift
        whole = actual + rest[j]
        kinetic += b * b
        strain += square[j] * whole * whole
        momentum += uniform[j] * b
        position += uniform[j] * actual
        force += pull[j] * a + drag[j] * b
        load += load_row[j] * a
        top += hook[j] * a
    return kinetic, strain, momentum, position, force, load, top


# scalars of the state: what one step hands to the next
(U, V, PHI, W, WC, WF, TC, TF, DEPTH, WEAR, CONTACT, PA, RA, PT, RT, ACC, TOP, TOP_SPEED, KIND, SWING) = range(20)
(E_TOP, E_CUT, E_WEAR, E_LOSS, IMPULSE, MOMENTUM, DIVIDED, SOLVED) = range(20, 28)
N_SCALARS = 28


@kernel()
def _cut_smoothly(
    par: F8,
    surface: SurfaceData,
    axial: F8,
    torsion: F8,
    s: F8,
    u_free: float,
    v_free: float,
    w_free: float,
    turn_free: float,
    work: F8,
    out: F8,
) -> bool:
    """Step with the cutting force linear in time: closed form.  False, and nothing changed, if it is not cutting."""
    m = surface.share.size
    ta, tf = 0.5 * par[RADIUS] / par[ZETA], 0.5 * par[RADIUS] * par[MU] * par[GAMMA]
    kappa = par[EPS1] * par[ZETA] * par[RADIUS]
    flat = par[SIGMA1] * par[RADIUS] * par[FLAT]
    wc0, tc0 = s[WC], s[TC]
    # end values as affine maps of the end cutting force wc and the wear force wf
    ua = u_free - axial[GU] * (wc0 - axial[MEAN]) + axial[HU] * wc0
    va = v_free - axial[GV] * (wc0 - axial[MEAN]) + axial[HV] * wc0
    fa = turn_free - torsion[GU] * tc0 + torsion[HU] * tc0
    wa = w_free - torsion[GV] * tc0 + torsion[HV] * tc0
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
    out[0], out[1], out[2], out[3], out[4], out[5] = wc, wf, ta * wc, tf * wf, v, w
    out[6], out[7], out[8], out[9] = u, turn, depth, x
    return True


@kernel()
def _substep(
    par: F8,
    surface: SurfaceData,
    axial: Modes,
    torsion: Modes,
    kind: int,
    modes: F8,
    spare: F8,
    s: F8,
    step: float,
    angle1: float,
    speed1: float,
    work: F8,
    out: F8,
) -> bool:
    """One step of one kind (0 whole, 1 part).  A whole step must be smooth: else False, and nothing has changed."""
    ca, ct = axial.number[kind], torsion.number[kind]
    last = int(s[KIND])
    acceleration = s[ACC]
    uf, vf, a0, a1, a2 = _propagate(
        axial.table[kind], axial.big[kind], axial.table[last], modes[0], modes[1], s[PA], s[RA], spare[0], spare[1]
    )
    yf, wf_, t0, t1, t2 = _propagate(
        torsion.table[kind],
        torsion.big[kind],
        torsion.table[last],
        modes[2],
        modes[3],
        s[PT],
        s[RT],
        spare[2],
        spare[3],
    )
    wf_ += speed1
    turned = angle1 - s[TOP]
    turn_free = yf - s[SWING] * acceleration - s[PHI] + turned

    smooth = s[CONTACT] > 0.0 and _cut_smoothly(par, surface, ca, ct, s, uf, vf, wf_, turn_free, work, out)
    if kind == 0 and not (smooth and out[9] == s[WEAR]):
        return False
    momentum0 = position0 = 0.0
    if acceleration != 0.0:
        obs = _observe(torsion.table[last], modes[2], modes[3], s[PT], s[RT], acceleration)
        momentum0, position0 = obs[2] + ct[INERTIA] * s[TOP_SPEED], obs[3]
    modes[:] = spare
    if smooth:
        wc, wf, tc, tf, v, w = out[0], out[1], out[2], out[3], out[4], out[5]
        u, turn, depth, wear = out[6], out[7], out[8], out[9]
        pc, rc, qc, zc = s[WC], wc - s[WC], s[TC], tc - s[TC]
        # the path of the bit in the rock is smooth too
        commit(surface, turn, s[U], u, s[V] / s[W], v / w)
    else:
        wc, wf, tc, tf, v, w, u, turn, depth = bit_step(
            par,
            surface,
            vf + ca[GV] * ca[MEAN],
            ca[GV],
            uf + ca[GU] * ca[MEAN],
            ca[GU],
            wf_,
            ct[GV],
            turn_free,
            ct[GU] / ct[GV],
            s[W],
        )[2:]
        wear = wear_fraction(par, v)
        pc, rc, qc, zc = wc, 0.0, tc, 0.0
        s[SOLVED] += 1.0
        chord = (u - s[U]) / turn if turn != 0.0 else 0.0
        commit(surface, turn, s[U], u, chord, chord)
    # work of the bit force: exact for its constant part, fourth order for its linear part
    s[E_CUT] += pc * (u - s[U]) + rc * (0.5 * (u - s[U]) + step / 12.0 * (v - s[V]))
    s[E_CUT] += qc * turn + zc * (0.5 * turn + step / 12.0 * (w - s[W]))
    s[E_WEAR] += wf * (u - s[U]) + tf * turn
    p, r = pc + wf - ca[MEAN], rc
    s[E_LOSS] += a0 + p * a1 + r * a2 + ca[QPP] * p * p + ca[QPR] * p * r + ca[QRR] * r * r
    s[PA], s[RA] = p, r
    p, r = qc + tf, zc
    s[E_LOSS] += t0 + p * t1 + r * t2 + ct[QPP] * p * p + ct[QPR] * p * r + ct[QRR] * r * r
    s[PT], s[RT] = p, r
    # top drive: its torque is the bit's plus the change of angular momentum
    if acceleration == 0.0:
        s[IMPULSE] += (p + 0.5 * r) * step
    else:
        obs = _observe(torsion.table[kind], modes[2], modes[3], p, r, acceleration)
        speed0 = s[TOP_SPEED]
        s[E_TOP] += (obs[2] + ct[INERTIA] * speed1) * speed1 - momentum0 * speed0
        s[E_TOP] -= acceleration * (obs[3] - position0 + ct[INERTIA] * turned)
        s[E_TOP] += step * (p * 0.5 * (speed0 + speed1) + r * (speed0 / 6.0 + speed1 / 3.0))
    s[U], s[V], s[W] = u, v, w
    s[PHI] = s[PHI] - turned + turn
    s[WC], s[WF], s[TC], s[TF], s[DEPTH], s[WEAR] = wc, wf, tc, tf, depth, wear
    s[TOP], s[TOP_SPEED] = angle1, speed1
    s[KIND] = kind
    contact = w >= max(par[C2], par[C3]) and w > 0.0 and depth >= 0.0
    if contact and not smooth:
        ahead(surface, 0.0, True, work[0], work[1])
        for i in range(work.shape[1]):
            contact = contact and u >= work[0, i]
    s[CONTACT] = 1.0 if contact else 0.0
    return True


@kernel()
def _march(
    par: F8,
    surface: SurfaceData,
    axial: Modes,
    torsion: Modes,
    modes: F8,
    s: F8,
    first: int,
    step: float,
    parts: int,
    top: F8,
    hook_load: float,
    every: int,
    rows: F8,
) -> None:
    """Steps after number ``first``, as many as ``top`` (steps + 1, 2: angle, speed) has; a row each ``every`` steps."""
    work, out, spare = np.empty((2, surface.share.size)), np.empty(10), np.empty_like(modes)
    written = 0
    for k in range(top.shape[0] - 1):
        angle1, speed1 = top[k + 1, 0], top[k + 1, 1]
        acceleration = (speed1 - s[TOP_SPEED]) / step
        if abs(acceleration) * step <= 1e-14 * abs(speed1):
            acceleration = 0.0
        if acceleration != s[ACC]:
            table = torsion.table[int(s[KIND])]
            momentum = _observe(table, modes[2], modes[3], s[PT], s[RT], s[ACC])[2]
            momentum += torsion.number[0, INERTIA] * s[TOP_SPEED]
            if s[ACC] == 0.0:  # close the account of the uniform motion
                s[E_TOP] += s[TOP_SPEED] * (s[IMPULSE] + momentum - s[MOMENTUM])
                s[IMPULSE] = 0.0
            s[MOMENTUM] = momentum
            # the frame turns with the top: the static answer to its acceleration is kept out of the modes
            modes[2, : table.shape[1]] += table[STILL] * (acceleration - s[ACC])
            s[ACC] = acceleration
        steady = s[CONTACT] > 0.0 and (s[WEAR] == 0.0 or s[WEAR] == 1.0)
        if not steady or not _substep(
            par, surface, axial, torsion, 0, modes, spare, s, step, angle1, speed1, work, out
        ):
            angle0, speed0 = s[TOP], s[TOP_SPEED]
            s[DIVIDED] += 1.0
            for part in range(1, parts + 1):
                f = part / parts
                # the angle of a uniformly accelerated top that ends where it should
                angle = angle0 + f * (angle1 - angle0) - 0.5 * acceleration * step * step * f * (1.0 - f)
                speed = speed0 + f * (speed1 - speed0)
                if part == parts:
                    angle, speed = angle1, speed1
                _substep(par, surface, axial, torsion, 1, modes, spare, s, step / parts, angle, speed, work, out)
        if (first + k + 1) % every == 0:
            _row(par, surface, axial, torsion, modes, s, (first + k + 1) * step, hook_load, rows[written])
            written += 1


@kernel()
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
    kind = int(s[KIND])
    ct = torsion.number[kind]
    a = _observe(axial.table[kind], modes[0], modes[1], s[PA], s[RA], 0.0)
    t = _observe(torsion.table[kind], modes[2], modes[3], s[PT], s[RT], s[ACC])
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


def _fastest(channel: Channel, free: NDArray[np.int64]) -> float:
    """Highest natural frequency, rad/s."""
    part, last = np.ix_(free, free), len(free) - 1
    square = eigh(channel.stiffness[part], channel.mass[part], eigvals_only=True, subset_by_index=[last, last])
    return float(np.sqrt(square[0]))


class CondensedString:
    """Axial-torsional string on a cutting bit, marched with a fixed step.

    Parameters
    ----------
    axial, torsion : Channel.  The axial top carries ``hook_load`` (N, up); the top angle is imposed.
    law, surface : the bit and its rock; the surface is owned from here on.
    step : s.
    hook_load : N.
    top : rad/s, or a function of an array of times that returns the arrays (angle, speed).
    parts : division of a step that is not smooth; default: so that the fastest mode turns at most 2 rad in a part.
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
        parts: int | None = None,
    ) -> None:
        if not step > 0:
            raise ValueError(f"condensed string: step = {step}: must be > 0")
        self.axial, self.torsion, self.law, self.surface = axial, torsion, law, surface
        self.step, self.hook_load = float(step), float(hook_load)
        self._top: TopMotion = top if callable(top) else lambda t: (top * t, np.full_like(t, top))
        n = len(axial.mass)
        load = np.zeros(n) if axial.load is None else np.array(axial.load, float)
        load[axial.top] -= hook_load
        self._free = np.flatnonzero(np.arange(len(torsion.mass)) != torsion.top)
        fastest = max(_fastest(axial, np.arange(n)), _fastest(torsion, self._free))
        self.parts = max(1, int(np.ceil(0.5 * fastest * step))) if parts is None else parts
        self._axial, self._axial_shapes = _condense(axial, np.arange(n), load, self.step, self.parts, driven=False)
        self._torsion, self._torsion_shapes = _condense(
            torsion, self._free, np.zeros(len(torsion.mass)), self.step, self.parts, driven=True
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
        # rows: axial position and speed, torsional position and speed
        self._modes = np.zeros((4, max(len(xa), len(xt))))
        for row, values in zip(self._modes, (xa, va, xt, vt), strict=True):
            row[: len(values)] = values
        s = self._s = np.zeros(N_SCALARS)
        s[TOP], s[TOP_SPEED] = angle, speed
        s[V], s[PHI], s[W] = a[BIT] @ va, t[BIT] @ xt, speed + t[BIT] @ vt
        s[MOMENTUM], s[SWING] = t[UNIFORM] @ vt + self._torsion.number[0, INERTIA] * speed, t[BIT] @ t[STILL]
        s[WEAR] = wear_fraction(self._par, s[V])
        gap = -self.surface.ahead(0.0)[0]
        share = self.surface.data.share
        s[DEPTH] = self.surface.depth_of_cut(0.0)
        contact = share @ (gap >= 0) / share.sum()
        s[WC : TF + 1] = law_forces(self._par, s[V], s[W], s[DEPTH], contact)[2:]
        s[CONTACT] = float(contact == 1.0 and s[W] > 0 and s[W] >= max(self._par[C2], self._par[C3]))
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
            self.parts,
            top,
            self.hook_load,
            every,
            rows,
        )
        self.count += steps
        rows -= self._offset
        return dict(zip(OUTPUTS, np.ascontiguousarray(rows.T), strict=True))

    def fields(self) -> dict[str, F8]:
        """Nodal displacement (m), angle (rad) and their speeds now, in the numbering of the channels."""
        s, kind = self._s, int(self._s[KIND])
        a, t = self._axial.table[kind], self._torsion.table[kind]
        x, v = self._modes[:2, : a.shape[1]]
        y, w = self._modes[2:, : t.shape[1]]
        xa, va = x + a[CX] * s[PA] + a[RX] * s[RA] + a[REST], v + a[CV] * s[PA] + a[RV] * s[RA]
        xt = y + t[CX] * s[PT] + t[RX] * s[RT] - t[STILL] * s[ACC]
        vt = w + t[CV] * s[PT] + t[RV] * s[RT]
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


def energy_imbalance(history: dict[str, F8]) -> F8:
    """Stored energy minus what came in plus what left, from its first value, J: zero up to the scheme's error."""
    h = history
    stored = h["kinetic_energy"] + h["strain_energy"]
    balance = stored - h["work_top_drive"] - h["work_hook_load"] - h["work_gravity"]
    balance = balance + h["work_cutting"] + h["work_wear_flat"] + h["dissipated"]
    return balance - balance[0]
