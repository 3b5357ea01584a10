"""End-of-step state of the bit: the law against affine maps of the string.

An implicit step of the string leaves at the bit

    v = v_free - gv W      U = u_free - gu W      w = w_free - gw T      turn = turn_free - rho gw T

with non-negative impulse responses.  The law gives W and T back as functions of (v, U, w) and of the rock
height ahead.  For a fixed spin the axial equation is strictly monotone and piecewise linear, so it is
solved exactly; what is left is one scalar equation in the spin, bracketed from the start and solved to
round-off.  Because the strength under a stalled bit falls as the bit speeds up, that equation can have
several roots: the one met first when marching from the previous spin is taken.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drillfem.bitrock.jit import kernel
from drillfem.bitrock.law import (
    BLADES,
    C1,
    C2,
    C3,
    FLAT,
    GAMMA,
    MU,
    RADIUS,
    ZETA,
    sign_of_spin,
    specific_energy,
    strength,
)
from drillfem.bitrock.surface import SurfaceData, ahead

F8 = NDArray[np.float64]


@kernel(lean=True)
def _threshold(free: float, g: float) -> float:
    """Force at which ``free - g W`` reaches zero; infinite where it never does (zero itself counts as contact)."""
    if g > 0.0:
        return free / g
    return np.inf if free >= 0.0 else -np.inf


@kernel(lean=True)
def _pull(
    weight: float,
    limit: bool,
    gap: F8,
    share: F8,
    gu: float,
    kappa: float,
    flat: float,
    v_free: float,
    gv: float,
    c1: float,
) -> float:
    """Force of the law when the string yields to ``weight``; at a jump its upper value if ``limit``, else the lower."""
    stop, full = _threshold(v_free, gv), _threshold(v_free - c1, gv)
    if gv <= 0.0 and v_free <= 0.0:
        stop = full = -np.inf
    cut = count = 0.0
    for i in range(gap.size):
        lift = _threshold(gap[i], gu)
        if weight < lift or (limit and weight == lift):
            count += share[i]
            cut += share[i] * max(gap[i] - gu * weight, 0.0)
    wear = 0.0
    if weight < full or (limit and weight == full):
        wear = 1.0
    elif weight < stop:
        wear = min(max((v_free - gv * weight) / c1, 0.0), 1.0)
    return kappa * cut + flat * wear * count


@kernel(lean=True)
def solve_axial(
    gap: F8, share: F8, gu: float, kappa: float, flat: float, v_free: float, gv: float, c1: float
) -> tuple[float, float]:
    """Weight and its cutting part for given cutting stiffness ``kappa`` (N/m) and wear-flat force ``flat`` (N).

    gap : (m,) height of each blade group's edge below the rock ahead if W were 0, m.
    share : (m,) blades in each group; ``kappa`` and ``flat`` are per blade.
    """
    lo, hi = 0.0, _pull(0.0, False, gap, share, gu, kappa, flat, v_free, gv, c1)
    exact = hi <= 0.0
    weight = 0.0
    if not exact:
        # W - pull(W) rises strictly from below zero at 0 to above zero at pull(0): narrow it to one linear piece
        for k in range(gap.size + 2):
            if k < gap.size:
                b = _threshold(gap[k], gu)
            elif k == gap.size:
                b = _threshold(v_free, gv)
            else:
                b = _threshold(v_free - c1, gv)
            if not lo < b < hi:
                continue
            if b > _pull(b, True, gap, share, gu, kappa, flat, v_free, gv, c1):
                hi = b
            elif b < _pull(b, False, gap, share, gu, kappa, flat, v_free, gv, c1):
                lo = b
            else:  # the force is set-valued here (first contact, or v = 0 with c1 = 0) and takes up what is needed
                exact = True
                weight = b
                break
    mid = weight if exact else 0.5 * (lo + hi)
    stop, full = _threshold(v_free, gv), _threshold(v_free - c1, gv)
    if gv <= 0.0 and v_free <= 0.0:
        stop = full = -np.inf
    stiff = height = count = 0.0
    for i in range(gap.size):
        if mid < _threshold(gap[i], gu):
            count += share[i]
            stiff += share[i] * kappa * gu
            height += share[i] * kappa * gap[i]
    if exact:
        return weight, min(max(height - stiff * weight, 0.0), weight)
    if mid < full or mid >= stop:
        wear = flat * count if mid < full else 0.0
        weight = min(max((height + wear) / (1.0 + stiff), lo), hi)
        return weight, max(weight - wear, 0.0)
    slope = flat * count / c1
    weight = min(max((height + slope * v_free) / (1.0 + stiff + slope * gv), lo), hi)
    # the part whose own slope is small is evaluated, the other is the rest: no cancellation
    if stiff < slope * gv:
        return weight, min(max(height - stiff * weight, 0.0), weight)
    return weight, weight - min(max(slope * (v_free - gv * weight), 0.0), weight)


@kernel(lean=True)
def _at_spin(
    w: float,
    par: F8,
    share: F8,
    v_free: float,
    gv: float,
    u_free: float,
    gu: float,
    w_free: float,
    turn_free: float,
    rho: float,
    ref: F8 | tuple[float, float],
    height: F8,
    slope: F8,
    gap: F8,
) -> tuple[float, float, float, float]:
    """(T, W, Wc, Tc) at a trial spin."""
    turn = turn_free + rho * (w - w_free)
    side = 0 if turn >= 0.0 else 1
    for i in range(gap.size):
        gap[i] = u_free - (height[side, i] + slope[side, i] * (turn - ref[side]))
    kappa = specific_energy(par, w) * par[ZETA] * par[RADIUS]
    flat = strength(par, w) * par[RADIUS] * par[FLAT] / par[BLADES]
    weight, cut = solve_axial(gap, share, gu, kappa, flat, v_free, gv, par[C1])
    tc = 0.5 * par[RADIUS] / par[ZETA] * cut
    tf = 0.5 * par[RADIUS] * par[MU] * par[GAMMA] * sign_of_spin(par, w) * (weight - cut)
    return tc + tf, weight, cut, tc


@kernel(lean=True)
def solve_bit(
    par: F8,
    share: F8,
    v_free: float,
    gv: float,
    u_free: float,
    gu: float,
    w_free: float,
    gw: float,
    turn_free: float,
    rho: float,
    ref: F8 | tuple[float, float],
    height: F8,
    slope: F8,
    w_previous: float,
    work: F8,
) -> tuple[float, float, float, float, float, float, float, float]:
    """Find (W, T, Wc, Wf, Tc, Tf, v, w) of the end of the step.  Always succeeds.

    par : BitLaw.array.  share : (m,) blades per group.  gv, gu, gw : responses >= 0 (1/kg s, m/N, rad/s / N m).
    rho : turn of the bit per change of its end speed, s (>= 0).
    ref (2,), height (2, m), slope (2, m) : rock height ahead, ``height + slope (turn - ref)``, row 0 for
    turn >= 0 and row 1 for turn < 0.  w_previous : spin from which roots are followed.  work : (m,) scratch.
    """
    args = (par, share, v_free, gv, u_free, gu, w_free, turn_free, rho, ref, height, slope, work)
    bound = (
        0.5
        * par[RADIUS]
        * par[MU]
        * par[GAMMA]
        * par[RADIUS]
        * par[FLAT]
        * max(strength(par, -1.0), strength(par, par[C2] + 1.0))
    )
    # where the spin equation must have changed sign: T <= bound for w <= 0, T >= -bound everywhere
    far_lo = min(w_free - 1.001 * gw * bound, -1.001 * par[C3]) - 1e-12 * abs(w_free)
    far_hi = w_free + 1.001 * gw * bound + 1e-12 * abs(w_free)
    straight = w_free - turn_free / rho if rho > 0.0 else 0.0
    breaks = (-par[C3], 0.0, par[C3], par[C2], straight, far_lo, far_hi)

    a = w_previous
    torque, weight, cut, tc = _at_spin(a, *args)
    ra = a - w_free + gw * torque
    b, rb = a, ra
    torque_b, weight_b, cut_b, tc_b = torque, weight, cut, tc
    if ra != 0.0 and gw > 0.0:
        for _ in range(9):
            # next break point in the direction in which the residual falls
            target = -np.inf if ra > 0.0 else np.inf
            for j in range(7):
                if ra > 0.0 and breaks[j] < b:
                    target = max(target, breaks[j])
                if ra < 0.0 and breaks[j] > b:
                    target = min(target, breaks[j])
            if not np.isfinite(target):  # only by rounding, when the spin already sits at the end of the range
                target = b - ra
            a, ra, torque, weight, cut, tc = b, rb, torque_b, weight_b, cut_b, tc_b
            b = target
            torque_b, weight_b, cut_b, tc_b = _at_spin(b, *args)
            rb = b - w_free + gw * torque_b
            if (ra > 0.0) != (rb > 0.0) or rb == 0.0:
                break
        # Chandrupatla's method: inverse quadratic steps where they are safe, bisection across jumps.  The spin is
        # resolved to round-off, so that what remains of a steep torque is settled by interpolation below.
        t = 0.5
        for _ in range(300):
            if rb == 0.0:
                a, ra, torque, weight, cut, tc = b, rb, torque_b, weight_b, cut_b, tc_b
            if ra == 0.0:
                break
            mid = a + t * (b - a)
            if mid == a or mid == b:
                break
            torque_m, weight_m, cut_m, tc_m = _at_spin(mid, *args)
            rm = mid - w_free + gw * torque_m
            if (rm > 0.0) == (ra > 0.0) and rm != 0.0:
                c, rc = a, ra
            else:
                c, rc = b, rb
                b, rb, torque_b, weight_b, cut_b, tc_b = a, ra, torque, weight, cut, tc
            a, ra, torque, weight, cut, tc = mid, rm, torque_m, weight_m, cut_m, tc_m
            least = 2e-16 * max(abs(a), abs(b)) + 1e-18
            if abs(b - a) <= 2.0 * least:
                break
            t = 0.5
            if rc != rb and c != b and rc != ra:
                xi, phi = (a - b) / (c - b), (ra - rb) / (rc - rb)
                if phi * phi < xi and (1.0 - phi) ** 2 < 1.0 - xi:
                    t = ra / (rb - ra) * rc / (rb - rc) + (c - a) / (b - a) * ra / (rc - ra) * rb / (rc - rb)
            t_least = least / abs(b - a)
            t = min(1.0 - t_least, max(t_least, t))
    elif gw <= 0.0:
        a, ra = w_free, 0.0
        torque, weight, cut, tc = _at_spin(w_free, *args)
    if ra != 0.0 and rb != ra:
        # between neighbouring numbers: the force takes the value in between that balances
        f = min(max(-ra / (rb - ra), 0.0), 1.0)
        torque += f * (torque_b - torque)
        weight += f * (weight_b - weight)
        cut += f * (cut_b - cut)
        tc += f * (tc_b - tc)
        a += f * (b - a)
    return weight, torque, cut, weight - cut, tc, torque - tc, v_free - gv * weight, a


@kernel(lean=True)
def bit_step_in(
    par: F8,
    surface: SurfaceData,
    v_free: float,
    gv: float,
    u_free: float,
    gu: float,
    w_free: float,
    gw: float,
    turn_free: float,
    rho: float,
    w_previous: float,
    scratch: F8,
) -> tuple[float, float, float, float, float, float, float, float, float, float, float]:
    """Solve the bit over the rock surface: (W, T, Wc, Wf, Tc, Tf, v, w, U, turn, depth).

    Arguments as for `solve_bit`; u_free is the bit's depth (m) on the scale of the surface's heights, turn_free
    (rad) the turn from the surface's committed angle.  The rock ahead is linearised where the bit ends up, by
    iteration.
    The surface is not changed: commit it afterwards.  ``depth`` (m) is the signed total depth of cut: the sum of the
    cutting edges' depths, or, when no edge touches, minus the least clearance times the blades.  ``scratch``
    (8, m): anything.
    """
    m = surface.share.size
    height, slope = scratch[0:2], scratch[2:4]
    work, now, now_slope, old = scratch[4], scratch[5], scratch[6], scratch[7]
    turn = turn_free + rho * (w_previous - w_free)
    last = turn
    for sweep in range(20):
        ref = (max(turn, 0.0), min(turn, -0.0))
        ahead(surface, ref[0], True, height[0], slope[0])
        ahead(surface, ref[1], False, height[1], slope[1])
        if sweep > 3 and turn != last and (turn >= 0.0) == (last >= 0.0):
            # the height bends or jumps between the last two guesses: join them by a chord, which brackets it
            side = 0 if turn >= 0.0 else 1
            ahead(surface, last, last >= 0.0, old, now_slope)
            for i in range(m):
                slope[side, i] = (height[side, i] - old[i]) / (turn - last)
        res = solve_bit(
            par, surface.share, v_free, gv, u_free, gu, w_free, gw, turn_free, rho, ref, height, slope, w_previous, work
        )
        last, turn = turn, turn_free + rho * (res[7] - w_free)
        side = 0 if turn >= 0.0 else 1
        ahead(surface, turn, side == 0, now, now_slope)
        error = size = 0.0
        for i in range(m):
            error = max(error, abs(now[i] - height[side, i] - slope[side, i] * (turn - ref[side])))
            size = max(size, abs(now[i]) + abs(u_free - now[i]))
        if error <= 1e-14 * size:
            break
    u = u_free - gu * res[0]
    depth, best = 0.0, -np.inf
    for i in range(m):
        depth += surface.share[i] * max(u - now[i], 0.0)
        best = max(best, u - now[i])
    if best < 0.0:
        depth = best * par[BLADES]
    return res[0], res[1], res[2], res[3], res[4], res[5], res[6], res[7], u, turn, depth


@kernel()
def bit_step(
    par: F8,
    surface: SurfaceData,
    v_free: float,
    gv: float,
    u_free: float,
    gu: float,
    w_free: float,
    gw: float,
    turn_free: float,
    rho: float,
    w_previous: float,
) -> tuple[float, float, float, float, float, float, float, float, float, float, float]:
    """`bit_step_in` with scratch memory of its own."""
    scratch = np.empty((8, surface.share.size))
    return bit_step_in(par, surface, v_free, gv, u_free, gu, w_free, gw, turn_free, rho, w_previous, scratch)
