"""The straight string condensed onto the bit: exact linear dynamics between the ends, the bit law solved per step.

An axial-torsional string is linear except at the bit.  Each of its two channels, ``M q'' + C q' + K q = load - e_bit P``,
is brought to modal coordinates once; a step then propagates every mode by its exact solution, so that only the history of
the bit force P within the step is approximated:

* the cutting force is linear in the step while the bit cuts at both ends of it (second order);
* the wear-flat force is constant in the step and takes its end value, and so is everything while the bit is stalled, turns
  backwards, leaves the bottom or lands: a linear multiplier would ring where the bit sticks.

At the end of the step the modes answer the bit force by affine maps, and `drillfem.bitrock` solves the bit on them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import eigh

from drillfem.bitrock.law import BLADES, C1, C2, C3, EPS1, FLAT, GAMMA, MU, RADIUS, SIGMA1, ZETA, BitLaw, law_forces
from drillfem.bitrock.solve import bit_step
from drillfem.bitrock.surface import RockSurface, SurfaceData, ahead, commit

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


@dataclass(frozen=True)
class Channel:
    """One direction of the string, as assembled: dense symmetric matrices over nodal degrees of freedom.

    mass, damping, stiffness : (n, n).  bit, top : indices of the end degrees of freedom.
    load : (n,) constant load (gravity), N; None for none.
    A uniform motion must be a vector of ones with stiffness @ 1 = damping @ 1 = 0 (no foundation).
    """

    mass: F8
    damping: F8
    stiffness: F8
    bit: int
    top: int
    load: F8 | None = None

    def __post_init__(self) -> None:
        for name in ("damping", "stiffness"):
            matrix = getattr(self, name)
            if np.abs(matrix.sum(axis=1)).max() > 1e-8 * max(np.abs(matrix).max(), 1e-300):
                raise ValueError(f"condensed string: {name} resists a uniform motion")


class ModeData(NamedTuple):
    """A channel in modal coordinates (mass-normalised), with its exact propagation over one step; n modes."""

    dense: bool  # damping couples the modes: full matrices instead of 2 x 2 blocks
    e11: F8
    e12: F8
    e21: F8
    e22: F8  # (n,) step matrices of (x, v)
    cx: F8
    cv: F8  # (n,) answer to a unit bit force constant over the step
    rx: F8
    rv: F8  # (n,) answer to a bit force that grows from 0 to 1 over the step
    bit: F8  # (n,) mode shapes at the bit
    qxx: F8
    qxv: F8
    qvv: F8
    qxp: F8
    qvp: F8
    qxr: F8
    qvr: F8  # (n,) dissipation over the step as a quadratic form of (x, v, constant force p, growing force r)
    qpp: float
    qpr: float
    qrr: float
    big_e: F8  # (2n, 2n) or (1, 1)
    big_q: F8
    square: F8  # (n,) eigenvalues omega^2
    rest: F8  # (n,) static position under the load and the mean bit force
    uniform: F8  # (n,) momentum of each mode in uniform motion: 1' M shape
    drag: F8  # (n,) uniform' times modal damping
    weight: F8  # (n,) constant load on the modes
    hook: F8  # (n,) mode shapes at the top
    mean: float  # bit force that balances the constant load on the rigid mode, N
    gu: float
    gv: float
    hu: float
    hv: float  # answers of the bit to the two unit forces (positive: against the force)
    inertia: float  # total mass or moment of inertia


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


def _condense(channel: Channel, free: NDArray[np.int64], mean_load: F8, step: float, driven: bool) -> tuple[ModeData, F8]:
    """Modes of a channel over its free degrees of freedom, and the mode shapes (free, n)."""
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
    n = len(square)
    bit = shapes[list(free).index(channel.bit)]

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
        e, q = (m[0] for m in _step_matrices(a, loss, step))
        unscale = np.concatenate([scale, np.ones(n), [size, size]])
        e, q = e * unscale[None, :] / unscale[:, None], q * unscale[None, :] * unscale[:, None]
        big_e, big_q = np.ascontiguousarray(e[: 2 * n, : 2 * n]), np.ascontiguousarray(q[: 2 * n, : 2 * n])
        e11 = e12 = e21 = e22 = qxx = qxv = qvv = np.zeros(n)
        p, r = 2 * n, 2 * n + 1
        cx, cv, rx, rv = e[:n, p], e[n : 2 * n, p], e[:n, r], e[n : 2 * n, r]
        qxp, qvp, qxr, qvr = q[:n, p], q[n : 2 * n, p], q[:n, r], q[n : 2 * n, r]
        qpp, qpr, qrr = q[p, p], 2 * q[p, r], q[r, r]
    else:
        e, q = np.empty((n, 4, 4)), np.empty((n, 4, 4))
        norms = (scale + diagonal) * step
        for level in np.unique(np.ceil(np.log2(norms))):
            some = np.ceil(np.log2(norms)) == level
            a, loss = np.zeros((some.sum(), 4, 4)), np.zeros((some.sum(), 4, 4))
            a[:, 0, 1], a[:, 1, 0], a[:, 1, 1] = scale[some], -square[some] / scale[some], -diagonal[some]
            a[:, 1, 2], a[:, 2, 3] = -1.0 / step, 1.0 / step  # unit force, scaled by the step
            loss[:, 1, 1] = diagonal[some]
            e[some], q[some] = _step_matrices(a, loss, step)
        unscale = np.stack([scale, np.ones(n), bit * step, bit * step], axis=1)
        e[:, :2] = e[:, :2] * unscale[:, None, :] / unscale[:, :2, None]
        q = q * unscale[:, None, :] * unscale[:, :, None]
        big_e = big_q = np.zeros((1, 1))
        e11, e12, e21, e22 = e[:, 0, 0], e[:, 0, 1], e[:, 1, 0], e[:, 1, 1]
        cx, cv, rx, rv = e[:, 0, 2], e[:, 1, 2], e[:, 0, 3], e[:, 1, 3]
        qxx, qxv, qvv = q[:, 0, 0], 2 * q[:, 0, 1], q[:, 1, 1]
        qxp, qvp, qxr, qvr = q[:, 0, 2], q[:, 1, 2], q[:, 0, 3], q[:, 1, 3]
        qpp, qpr, qrr = q[:, 2, 2].sum(), 2 * q[:, 2, 3].sum(), q[:, 3, 3].sum()
    weight = shapes.T @ mean_load[free]
    mean = 0.0 if driven else weight[0] / bit[0]
    rest = np.where(square > 0, (weight - bit * mean) / np.where(square > 0, square, 1.0), 0.0)
    momentum = channel.mass.sum(axis=0)
    uniform = shapes.T @ momentum[free]
    hook = np.zeros(n) if driven else shapes[list(free).index(channel.top)]
    arrays = [e11, e12, e21, e22, cx, cv, rx, rv, bit, qxx, qxv, qvv, 2 * qxp, 2 * qvp, 2 * qxr, 2 * qvr]
    tail = [square, rest, uniform, damping @ uniform, weight, hook]
    data = ModeData(
        dense,
        *(np.ascontiguousarray(x) for x in arrays),
        float(qpp),
        float(qpr),
        float(qrr),
        big_e,
        big_q,
        *(np.ascontiguousarray(x) for x in tail),
        float(mean),
        float(-bit @ cx),
        float(-bit @ cv),
        float(-bit @ rx),
        float(-bit @ rv),
        float(momentum.sum()),
    )
    return data, shapes


@njit(cache=True, fastmath={"reassoc", "contract", "nsz"})
def _propagate(c: ModeData, x: F8, v: F8, p: float, r: float) -> tuple[float, float, float, float, float]:
    """Add the bit force of the last step, then advance freely by one step.

    Returns bit position and speed without bit force, and the sums of the dissipation of the coming step:
    loss = s0 + p s1 + r s2 + (terms in p, r).  State between calls: free part of the modes, force still to be added.
    Only sums are reassociated (for SIMD); the order is fixed by the compiled code, so runs repeat to the bit.
    """
    n = x.size
    u = w = s0 = s1 = s2 = 0.0
    if c.dense:
        z = np.empty(2 * n)
        for j in range(n):
            z[j] = x[j] + c.cx[j] * p + c.rx[j] * r
            z[n + j] = v[j] + c.cv[j] * p + c.rv[j] * r
            s1 += z[j] * c.qxp[j] + z[n + j] * c.qvp[j]
            s2 += z[j] * c.qxr[j] + z[n + j] * c.qvr[j]
        s0 = z @ np.dot(c.big_q, z)
        z = np.dot(c.big_e, z)
        for j in range(n):
            x[j] = z[j]
            v[j] = z[n + j]
            u += c.bit[j] * z[j]
            w += c.bit[j] * z[n + j]
        return u, w, s0, s1, s2
    e11, e12, e21, e22, bit = c.e11, c.e12, c.e21, c.e22, c.bit
    cx, cv, rx, rv = c.cx, c.cv, c.rx, c.rv
    qxx, qxv, qvv, qxp, qvp, qxr, qvr = c.qxx, c.qxv, c.qvv, c.qxp, c.qvp, c.qxr, c.qvr
    for j in range(n):
        a = x[j] + (cx[j] * p + rx[j] * r)
        b = v[j] + (cv[j] * p + rv[j] * r)
        s0 += a * (qxx[j] * a + qxv[j] * b) + qvv[j] * b * b
        s1 += a * qxp[j] + b * qvp[j]
        s2 += a * qxr[j] + b * qvr[j]
        a1 = e11[j] * a + e12[j] * b
        b1 = e21[j] * a + e22[j] * b
        x[j] = a1
        v[j] = b1
        u += bit[j] * a1
        w += bit[j] * b1
    return u, w, s0, s1, s2


@njit(cache=True, fastmath={"reassoc", "contract", "nsz"})
def _observe(c: ModeData, x: F8, v: F8, p: float, r: float, shift: float) -> tuple[float, float, float, float, float, float, float]:
    """Sums over the modes: v.v, stored square, momentum, its position, restoring force, load position, top position.

    ``shift`` is the uniform acceleration of the frame, whose static answer is taken out of x.
    """
    kinetic = strain = momentum = position = force = load = top = 0.0
    for j in range(x.size):
        a = x[j] + (c.cx[j] * p + c.rx[j] * r)
        b = v[j] + (c.cv[j] * p + c.rv[j] * r)
        offset = c.uniform[j] / c.square[j] * shift if shift != 0.0 else 0.0
        whole = a - offset + c.rest[j]
        kinetic += b * b
        strain += c.square[j] * whole * whole
        momentum += c.uniform[j] * b
        position += c.uniform[j] * (a - offset)
        force += c.uniform[j] * c.square[j] * a + c.drag[j] * b
        load += c.weight[j] * a
        top += c.hook[j] * a
    return kinetic, strain, momentum, position, force, load, top


# scalars of the state: what one step hands to the next
(U, V, PHI, W, WC, WF, TC, TF, DEPTH, CONTACT, PA, RA, PT, RT, ACC, TOP, TOP_SPEED) = range(17)
(E_TOP, E_CUT, E_WEAR, E_LOSS, IMPULSE, MOMENTUM, REDONE, SOLVED) = range(17, 25)
N_SCALARS = 25


@njit(cache=True)
def _cut_smoothly(
    par: F8,
    surface: SurfaceData,
    axial: ModeData,
    torsion: ModeData,
    s: F8,
    u_free: float,
    v_free: float,
    w_free: float,
    turn_free: float,
    work: F8,
    out: F8,
) -> bool:
    """Step with the cutting force linear in time: closed form.  False if the bit leaves the regime (nothing is changed)."""
    m = surface.share.size
    ta, tf = 0.5 * par[RADIUS] / par[ZETA], 0.5 * par[RADIUS] * par[MU] * par[GAMMA]
    kappa = par[EPS1] * par[ZETA] * par[RADIUS]
    flat = par[SIGMA1] * par[RADIUS] * par[FLAT]
    wc0, tc0 = s[WC], s[TC]
    # end values as affine maps of the end cutting force wc and the wear force wf
    ua = u_free - axial.gu * (wc0 - axial.mean) + axial.hu * wc0
    va = v_free - axial.gv * (wc0 - axial.mean) + axial.hv * wc0
    fa = turn_free - torsion.gu * tc0 + torsion.hu * tc0
    wa = w_free - torsion.gv * tc0 + torsion.hv * tc0
    turn = fa - torsion.hu * tc0 - torsion.gu * s[TF]
    wc = wf = u = v = w = 0.0
    for _sweep in range(4):
        if turn < 0.0:
            return False
        ahead(surface, turn, True, work[0], work[1])
        heights = slopes = 0.0
        for i in range(m):
            heights += surface.share[i] * (work[0, i] - work[1, i] * turn)
            slopes += surface.share[i] * work[1, i]
        stiff = 1.0 + kappa * (par[BLADES] * axial.hu - slopes * torsion.hu * ta)
        a0 = kappa * (par[BLADES] * ua - heights - slopes * fa) / stiff
        a1 = kappa * (par[BLADES] * axial.gu - slopes * torsion.gu * tf) / stiff
        v0 = va - axial.hv * a0
        fall = (axial.gv - axial.hv * a1) * flat
        if stiff <= 0.0 or fall < 0.0:
            return False
        x = 1.0 if v0 - fall >= par[C1] else (0.0 if v0 <= 0.0 else v0 / (par[C1] + fall))
        wf = x * flat
        wc = a0 - a1 * wf
        v = v0 - x * fall
        u = ua - axial.hu * wc - axial.gu * wf
        w = wa - torsion.hv * ta * wc - torsion.gv * tf * wf
        guess = turn
        turn = fa - torsion.hu * ta * wc - torsion.gu * tf * wf
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
    out[6], out[7], out[8] = u, turn, depth
    return True


@njit(cache=True)
def _march(
    par: F8,
    surface: SurfaceData,
    axial: ModeData,
    torsion: ModeData,
    xa: F8,
    va: F8,
    xt: F8,
    vt: F8,
    s: F8,
    first: int,
    step: float,
    top: F8,
    hook_load: float,
    every: int,
    rows: F8,
) -> int:
    """Steps first, first + 1, ...: as many as ``top`` (steps + 1, 2: angle, speed) has; a row each ``every`` steps."""
    m = surface.share.size
    work, out = np.empty((2, m)), np.empty(9)
    flow = 0.0
    for q in range(torsion.bit.size):
        flow += torsion.bit[q] * torsion.uniform[q] / torsion.square[q]
    written = 0
    for k in range(top.shape[0] - 1):
        angle1, speed1 = top[k + 1, 0], top[k + 1, 1]
        acceleration = (speed1 - s[TOP_SPEED]) / step
        if abs(acceleration) * step <= 1e-14 * abs(speed1):
            acceleration = 0.0
        if acceleration != s[ACC]:
            obs = _observe(torsion, xt, vt, s[PT], s[RT], s[ACC])
            momentum = obs[2] + torsion.inertia * s[TOP_SPEED]
            if s[ACC] == 0.0:  # close the account of the uniform motion
                s[E_TOP] += s[TOP_SPEED] * (s[IMPULSE] + momentum - s[MOMENTUM])
                s[IMPULSE] = 0.0
            s[MOMENTUM] = momentum
            # the frame turns with the top: the static answer to its acceleration is kept out of the modes
            for j in range(xt.size):
                xt[j] += torsion.uniform[j] / torsion.square[j] * (acceleration - s[ACC])
            s[ACC] = acceleration
        position0 = momentum0 = 0.0
        if acceleration != 0.0:
            obs = _observe(torsion, xt, vt, s[PT], s[RT], acceleration)
            momentum0, position0 = obs[2] + torsion.inertia * s[TOP_SPEED], obs[3]
        uf, vf, a0, a1, a2 = _propagate(axial, xa, va, s[PA], s[RA])
        yf, wf_, t0, t1, t2 = _propagate(torsion, xt, vt, s[PT], s[RT])
        wf_ += speed1
        turned = angle1 - s[TOP]
        turn_free = yf - flow * acceleration - s[PHI] + turned

        smooth = s[CONTACT] > 0.0 and _cut_smoothly(par, surface, axial, torsion, s, uf, vf, wf_, turn_free, work, out)
        if smooth:
            wc, wf, tc, tf, v, w = out[0], out[1], out[2], out[3], out[4], out[5]
            u, turn, depth = out[6], out[7], out[8]
            pc, rc, qc, zc = s[WC], wc - s[WC], s[TC], tc - s[TC]
        else:
            # everything constant in the step
            res = bit_step(
                par,
                surface,
                vf + axial.gv * axial.mean,
                axial.gv,
                uf + axial.gu * axial.mean,
                axial.gu,
                wf_,
                torsion.gv,
                turn_free,
                torsion.gu / torsion.gv,
                s[W],
            )
            wc, wf, tc, tf, v, w = res[2], res[3], res[4], res[5], res[6], res[7]
            u, turn, depth = res[8], res[9], res[10]
            pc, rc, qc, zc = wc, 0.0, tc, 0.0
            s[SOLVED] += 1.0
            s[REDONE] += s[CONTACT]
        # the rock: the bit's path in angle is smooth while it cuts, else a chord
        chord = (u - s[U]) / turn if turn != 0.0 else 0.0
        if smooth:
            commit(surface, turn, s[U], u, s[V] / s[W], v / w)
        else:
            commit(surface, turn, s[U], u, chord, chord)
        # work of the bit force: exact for its constant part, fourth order for its linear part
        s[E_CUT] += pc * (u - s[U]) + rc * (0.5 * (u - s[U]) + step / 12.0 * (v - s[V]))
        s[E_CUT] += qc * turn + zc * (0.5 * turn + step / 12.0 * (w - s[W]))
        s[E_WEAR] += wf * (u - s[U]) + tf * turn
        p, r = pc + wf - axial.mean, rc
        s[E_LOSS] += a0 + p * a1 + r * a2 + axial.qpp * p * p + axial.qpr * p * r + axial.qrr * r * r
        s[PA], s[RA] = p, r
        p, r = qc + tf, zc
        s[E_LOSS] += t0 + p * t1 + r * t2 + torsion.qpp * p * p + torsion.qpr * p * r + torsion.qrr * r * r
        s[PT], s[RT] = p, r
        # top drive: its torque is the bit's plus the change of angular momentum
        if acceleration == 0.0:
            s[IMPULSE] += (p + 0.5 * r) * step
        else:
            obs = _observe(torsion, xt, vt, p, r, acceleration)
            speed0 = s[TOP_SPEED]
            s[E_TOP] += (obs[2] + torsion.inertia * speed1) * speed1 - momentum0 * speed0
            s[E_TOP] -= acceleration * (obs[3] - position0 + torsion.inertia * turned)
            s[E_TOP] += step * (p * 0.5 * (speed0 + speed1) + r * (speed0 / 6.0 + speed1 / 3.0))
        s[U], s[V], s[W] = u, v, w
        s[PHI] = s[PHI] - turned + turn
        s[WC], s[WF], s[TC], s[TF], s[DEPTH] = wc, wf, tc, tf, depth
        s[TOP], s[TOP_SPEED] = angle1, speed1
        all_cut = w >= max(par[C2], par[C3]) and w > 0.0 and depth >= 0.0
        if all_cut and not smooth:
            ahead(surface, 0.0, True, work[0], work[1])
            for i in range(m):
                all_cut = all_cut and u >= work[0, i]
        s[CONTACT] = 1.0 if all_cut else 0.0
        if (first + k + 1) % every == 0:
            _row(par, surface, axial, torsion, xa, va, xt, vt, s, (first + k + 1) * step, hook_load, rows[written])
            written += 1
    return written


@njit(cache=True)
def _row(
    par: F8,
    surface: SurfaceData,
    axial: ModeData,
    torsion: ModeData,
    xa: F8,
    va: F8,
    xt: F8,
    vt: F8,
    s: F8,
    time: float,
    hook_load: float,
    row: F8,
) -> None:
    """Fill one row of OUTPUTS; the works of the loads have offsets that the caller takes off."""
    a = _observe(axial, xa, va, s[PA], s[RA], 0.0)
    t = _observe(torsion, xt, vt, s[PT], s[RT], s[ACC])
    torque, speed = s[TC] + s[TF], s[TOP_SPEED]
    top_torque = torque + torsion.inertia * s[ACC] - t[4]
    for j in range(xt.size):
        top_torque -= torsion.uniform[j] * torsion.bit[j] * torque
    row[0], row[1], row[2], row[3], row[4] = time, s[W], s[V], s[TOP] + s[PHI], s[U]
    row[5], row[6], row[7] = torque, s[WC] + s[WF], s[DEPTH]
    row[8], row[9], row[10], row[11] = top_torque, speed, hook_load, top_torque * speed
    row[12] = 0.5 * (a[0] + t[0] + torsion.inertia * speed * speed) + speed * t[2]
    row[13] = 0.5 * (a[1] + t[1])
    row[14] = s[E_TOP]
    if s[ACC] == 0.0:
        row[14] += (s[IMPULSE] + t[2] + torsion.inertia * speed - s[MOMENTUM]) * speed
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
        self._axial, self._axial_shapes = _condense(axial, np.arange(n), load, self.step, driven=False)
        self._torsion, self._torsion_shapes = _condense(
            torsion, self._free, np.zeros(len(torsion.mass)), self.step, driven=True
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
    def frequencies(self) -> tuple[F8, F8]:
        """Undamped natural frequencies of the axial and the torsional channel, Hz."""
        return np.sqrt(self._axial.square) / (2 * np.pi), np.sqrt(self._torsion.square) / (2 * np.pi)

    def nominal(self) -> tuple[F8, F8]:
        """Nodal displacement (m, zero at the top) and twist (rad, zero at the top) of steady drilling (spec 9.2, 9.3)."""
        weight = self._axial.mean
        torque = self.law.torque(self.law.depth_of_cut(weight))
        u = self._axial_shapes @ self._axial.rest
        # static answer of the modes to the nominal torque
        twist = np.zeros(len(self.torsion.mass))
        twist[self._free] = -self._torsion_shapes @ (self._torsion.bit * torque / self._torsion.square)
        return u - u[self.axial.top], twist

    def reset(self, u: F8, u_dot: F8, phi: F8, phi_dot: F8) -> None:
        """Start at time 0 from nodal positions (m, rad) and speeds; the bit's depth counts from here."""
        a, t = self._axial, self._torsion
        angle, speed = (float(x[0]) for x in self._top(np.zeros(1)))
        mass = self._torsion_shapes.T @ self.torsion.mass[np.ix_(self._free, self._free)]
        self._xa = self._axial_shapes.T @ (self.axial.mass @ u) - a.rest
        self._va = self._axial_shapes.T @ (self.axial.mass @ u_dot)
        self._xt, self._vt = mass @ (phi - angle)[self._free], mass @ (phi_dot - speed)[self._free]
        # the uniform part of the displacement is set so that the bit starts at depth 0
        self._origin = float(a.bit @ self._xa)
        self._xa[0] -= self._origin / a.bit[0]
        s = self._s = np.zeros(N_SCALARS)
        s[TOP], s[TOP_SPEED] = angle, speed
        s[U], s[V] = 0.0, a.bit @ self._va
        s[PHI], s[W] = t.bit @ self._xt, speed + t.bit @ self._vt
        s[MOMENTUM] = t.uniform @ self._vt + t.inertia * speed
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
        arrays = (self._xa, self._va, self._xt, self._vt, self._s)
        _row(self._par, self.surface.data, self._axial, self._torsion, *arrays, self.time, self.hook_load, row)
        return dict(zip(OUTPUTS, (float(x) for x in row - self._offset), strict=True))

    def advance(self, steps: int, every: int = 1) -> dict[str, F8]:
        """March; returns the outputs at each step number that ``every`` divides.  Chunks of any size give the same numbers."""
        times = self.step * np.arange(self.count, self.count + steps + 1)
        top = np.stack(self._top(times), axis=1)
        rows = np.empty(((self.count + steps) // every - self.count // every, len(OUTPUTS)))
        arrays = (self._xa, self._va, self._xt, self._vt, self._s)
        surface = self.surface.data
        _march(
            self._par, surface, self._axial, self._torsion, *arrays, self.count, self.step, top, self.hook_load, every, rows
        )
        self.count += steps
        rows -= self._offset
        return dict(zip(OUTPUTS, np.ascontiguousarray(rows.T), strict=True))

    def fields(self) -> dict[str, F8]:
        """Nodal displacement (m), angle (rad) and their speeds now, in the numbering of the channels."""
        s, a, t = self._s, self._axial, self._torsion
        xa = self._xa + a.cx * s[PA] + a.rx * s[RA] + a.rest
        va = self._va + a.cv * s[PA] + a.rv * s[RA]
        xt = self._xt + t.cx * s[PT] + t.rx * s[RT] - t.uniform / t.square * s[ACC]
        vt = self._vt + t.cv * s[PT] + t.rv * s[RT]
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
        """Steps taken, steps in which the bit needed the general solver, and smooth steps that had to be redone."""
        return {"steps": self.count, "solved": int(self._s[SOLVED]), "redone": int(self._s[REDONE])}

    def state_dict(self) -> dict[str, Any]:
        """Everything that changes in time, as arrays; `load` goes on as if never stopped, to the bit."""
        own = {"xa": self._xa, "va": self._va, "xt": self._xt, "vt": self._vt, "scalars": self._s, "offset": self._offset}
        state: dict[str, Any] = {name: array.copy() for name, array in own.items()}
        state |= {"count": np.array(self.count), "origin": np.array(self._origin)}
        return state | {f"surface_{name}": array for name, array in self.surface.state_dict().items()}

    def load(self, state: dict[str, Any]) -> None:
        """Take over a state of `state_dict` of a string made in the same way."""
        own = {"xa": self._xa, "va": self._va, "xt": self._xt, "vt": self._vt, "scalars": self._s, "offset": self._offset}
        for name, array in own.items():
            array[:] = state[name]
        self.count, self._origin = int(state["count"]), float(state["origin"])
        self.surface.load({name[8:]: array for name, array in state.items() if name.startswith("surface_")})


def energy_imbalance(history: dict[str, F8]) -> F8:
    """Stored energy minus what came in and plus what left, relative to its first value, J; zero up to the scheme's error."""
    h = history
    stored = h["kinetic_energy"] + h["strain_energy"]
    balance = stored - h["work_top_drive"] - h["work_hook_load"] - h["work_gravity"]
    balance = balance + h["work_cutting"] + h["work_wear_flat"] + h["dissipated"]
    return balance - balance[0]
