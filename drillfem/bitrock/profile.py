"""The exact moving profile of the rock surface (scheme ``profile``).

Knots do not move.  Their key is the total turn at which the blade behind the sector meets them, so that
sector i always covers the keys [phi, phi + width_i], and the first and last knot sit exactly on these ends.
Between knots the height is a cubic; two knots with one key make a step.  Turning forwards takes knots from the
front of a sector and puts what the blade leaves at the back of the next one; turning backwards takes them from
the back and returns them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drillfem.bitrock.jit import kernel

F8 = NDArray[np.float64]
CAPACITY = 16384
CELLS = 2048  # knots closer than width / CELLS are joined, so that a stalled bit cannot fill the ring


class ProfileData(NamedTuple):
    """Rings of knots, one row per sector."""

    key: F8  # (m, capacity)
    height: F8
    before: F8  # slope on the low-key side of a knot
    after: F8  # slope on the high-key side
    first: NDArray[np.int64]  # (m,): index of the front knot
    size: NDArray[np.int64]  # (m,): number of knots
    phi: F8  # (1,): total turn


def profile_setup(width: F8, capacity: int = CAPACITY) -> ProfileData:
    """Flat profile of height zero."""
    m = width.size
    key, height, before, after = np.zeros((4, m, capacity))
    data = ProfileData(key, height, before, after, np.zeros(m, np.int64), np.full(m, 2, np.int64), np.zeros(1))
    data.key[:, 1] = width
    return data


@kernel()
def _piece(k0: float, h0: float, m0: float, k1: float, h1: float, m1: float, x: float) -> tuple[float, float]:
    """Value and slope at x of the cubic through (k0, h0), (k1, h1) with end slopes m0, m1."""
    d = k1 - k0
    if d <= 0.0:
        return h1, m1
    t = (x - k0) / d
    y = 1.0 - t
    secant = (h1 - h0) / d
    # deviation from the chord: exact for straight pieces
    value = h0 + t * (h1 - h0) + d * t * y * ((m0 - secant) * y - (m1 - secant) * t)
    slope = secant + (m0 - secant) * y * (1.0 - 3.0 * t) + (m1 - secant) * t * (3.0 * t - 2.0)
    return value, slope


@kernel()
def _area(k0: float, h0: float, m0: float, k1: float, h1: float, m1: float) -> float:
    d = k1 - k0
    return 0.5 * d * (h0 + h1) + d * d * (m0 - m1) / 12.0


@kernel()
def _at(p: ProfileData, s: int, i: int, x: float) -> tuple[float, float]:
    """Value and slope at key x on the piece behind knot number i of sector s."""
    n = p.key.shape[1]
    j, k = (p.first[s] + i) % n, (p.first[s] + i + 1) % n
    return _piece(p.key[s, j], p.height[s, j], p.after[s, j], p.key[s, k], p.height[s, k], p.before[s, k], x)


@kernel()
def _knot_area(p: ProfileData, s: int, i: int) -> float:
    n = p.key.shape[1]
    j, k = (p.first[s] + i) % n, (p.first[s] + i + 1) % n
    return _area(p.key[s, j], p.height[s, j], p.after[s, j], p.key[s, k], p.height[s, k], p.before[s, k])


@kernel()
def profile_ahead(p: ProfileData, width: F8, turn: float, forward: bool, height: F8, slope: F8) -> None:
    """Height of the rock that each blade meets after ``turn``, and its slope in the turn (up to one sector)."""
    m, n = width.size, p.key.shape[1]
    for b in range(m):
        if forward:
            s = (b + 1) % m
            x = p.phi[0] + min(turn, width[s])
            i = 0
            while i + 2 < p.size[s] and p.key[s, (p.first[s] + i + 1) % n] <= x:
                i += 1
        else:
            s = b
            x = p.phi[0] + width[s] + max(turn, -width[s])
            i = p.size[s] - 2
            while i > 0 and p.key[s, (p.first[s] + i) % n] >= x:
                i -= 1
        height[b], slope[b] = _at(p, s, i, x)


@kernel()
def sector_area(p: ProfileData, s: int) -> float:
    """Integral of the height over sector s, m rad."""
    total = 0.0
    for i in range(p.size[s] - 1):
        total += _knot_area(p, s, i)
    return total


@kernel()
def _thin(p: ProfileData, s: int, spacing: float) -> float:
    """Drop knots closer than ``spacing`` to the one before; returns the change of the profile's integral."""
    n = p.key.shape[1]
    change = -sector_area(p, s)
    kept, skipped, old = p.first[s], False, p.size[s]
    p.size[s] = 1
    for i in range(1, old):
        j = (p.first[s] + i) % n
        if i < old - 1 and p.key[s, j] - p.key[s, kept] < spacing:
            skipped = True
            continue
        to = (kept + 1) % n
        p.key[s, to], p.height[s, to] = p.key[s, j], p.height[s, j]
        p.before[s, to], p.after[s, to] = p.before[s, j], p.after[s, j]
        if skipped:
            _straighten(p, s, kept, to)
        kept, skipped = to, False
        p.size[s] += 1
    return change + sector_area(p, s)


@kernel()
def _straighten(p: ProfileData, s: int, j: int, k: int) -> None:
    d = p.key[s, k] - p.key[s, j]
    p.after[s, j] = p.before[s, k] = (p.height[s, k] - p.height[s, j]) / d if d > 0.0 else 0.0


@kernel()
def _push(p: ProfileData, s: int, y0: float, m0: float, key: float, y1: float, m1: float, spacing: float) -> float:
    """Append the piece from the last knot (value y0, slope m0) to (key, y1, m1); returns its integral."""
    n = p.key.shape[1]
    change = 0.0
    j = (p.first[s] + p.size[s] - 1) % n
    if y0 != p.height[s, j]:  # a step in the rock
        k = (j + 1) % n
        p.key[s, k], p.height[s, k], p.before[s, k] = p.key[s, j], y0, 0.0
        p.after[s, j] = 0.0
        p.size[s] += 1
        j = k
    p.after[s, j] = m0
    back = (j - 1) % n
    if p.size[s] > 2 and key - p.key[s, back] < spacing:
        # the last knot is too close to the one before: one straight piece in place of two (slopes over the tiny
        # turns of a stalled bit are huge: a cubic would overshoot)
        change -= _knot_area(p, s, p.size[s] - 2)
        p.key[s, j], p.height[s, j], p.before[s, j], p.after[s, j] = key, y1, m1, m1
        _straighten(p, s, back, j)
        return change + _knot_area(p, s, p.size[s] - 2)
    k = (j + 1) % n
    p.key[s, k], p.height[s, k], p.before[s, k], p.after[s, k] = key, y1, m1, m1
    p.size[s] += 1
    return change + _knot_area(p, s, p.size[s] - 2)


@kernel()
def _turn_forward(
    p: ProfileData, width: F8, share: F8, phi1: float, u0: float, u1: float, s0: float, s1: float
) -> float:
    m, n = width.size, p.key.shape[1]
    phi0 = p.phi[0]
    removed = 0.0
    for b in range(m):
        s = (b + 1) % m  # the sector whose rock meets blade b; what the blade leaves enters sector b
        spacing, w = width[b] / CELLS, width[b]
        last = 0  # knots met on the way
        cutting = True
        while p.key[s, (p.first[s] + last) % n] < phi1:
            j = (p.first[s] + last) % n
            u, _ = _piece(phi0, u0, s0, phi1, u1, s1, p.key[s, j])
            cutting = cutting and u >= p.height[s, j]
            last += 1
        end, end_slope = _at(p, s, last - 1, phi1)
        gain = 0.0
        if cutting and u1 >= end:
            gain += _push(p, b, u0, s0, phi1 + w, u1, s1, spacing)
        else:
            # piece by piece between the knots met: the deeper of blade and rock, divided where they cross
            for i in range(last):
                j, k = (p.first[s] + i) % n, (p.first[s] + i + 1) % n
                x0, r0, t0 = p.key[s, j], p.height[s, j], p.after[s, j]
                if i < last - 1:
                    x1, r1, t1 = p.key[s, k], p.height[s, k], p.before[s, k]
                else:
                    x1, r1, t1 = phi1, end, end_slope
                if x1 <= x0:
                    continue
                a0, g0 = _piece(phi0, u0, s0, phi1, u1, s1, x0)
                a1, g1 = _piece(phi0, u0, s0, phi1, u1, s1, x1)
                if (a0 >= r0) == (a1 >= r1):
                    if a0 >= r0:
                        gain += _push(p, b, a0, g0, x1 + w, a1, g1, spacing)
                    else:
                        gain += _push(p, b, r0, t0, x1 + w, r1, t1, spacing)
                    continue
                lo, hi = x0, x1
                for _ in range(60):
                    x = 0.5 * (lo + hi)
                    u, _g = _piece(phi0, u0, s0, phi1, u1, s1, x)
                    r, _g = _piece(x0, r0, t0, x1, r1, t1, x)
                    if (u >= r) == (a0 >= r0):
                        lo = x
                    else:
                        hi = x
                x = lo
                u, g = _piece(phi0, u0, s0, phi1, u1, s1, x)
                r, t = _piece(x0, r0, t0, x1, r1, t1, x)
                if a0 >= r0:
                    gain += _push(p, b, a0, g0, x + w, u, g, spacing)
                    gain += _push(p, b, u, t, x1 + w, r1, t1, spacing)
                else:
                    gain += _push(p, b, r0, t0, x + w, u, t, spacing)
                    gain += _push(p, b, u, g, x1 + w, a1, g1, spacing)
        removed += share[b] * gain
    for s in range(m):  # what was met leaves the front
        while p.size[s] > 2 and p.key[s, (p.first[s] + 1) % n] <= phi1:
            removed -= share[s] * _knot_area(p, s, 0)
            p.first[s] = (p.first[s] + 1) % n
            p.size[s] -= 1
        j, k = p.first[s], (p.first[s] + 1) % n
        value, slope = _at(p, s, 0, phi1)
        removed -= share[s] * _area(p.key[s, j], p.height[s, j], p.after[s, j], phi1, value, slope)
        p.key[s, j], p.height[s, j], p.before[s, j], p.after[s, j] = phi1, value, slope, slope
        p.key[s, (p.first[s] + p.size[s] - 1) % n] = phi1 + width[s]
    p.phi[0] = phi1
    return removed


@kernel()
def _turn_backward(p: ProfileData, width: F8, phi1: float) -> None:
    m, n = width.size, p.key.shape[1]
    for b in range(m):
        s, w = (b + 1) % m, width[b]
        start = True
        while True:
            j = (p.first[b] + p.size[b] - 1) % n
            front = p.first[s]
            if start:
                start = False
                if p.height[b, j] == p.height[s, front]:
                    p.before[s, front] = p.before[b, j]
                else:
                    front = (front - 1) % n
                    p.key[s, front], p.height[s, front] = p.phi[0], p.height[b, j]
                    p.before[s, front], p.after[s, front] = p.before[b, j], 0.0
                    p.first[s], p.size[s] = front, p.size[s] + 1
            else:
                front = (front - 1) % n
                p.key[s, front], p.height[s, front] = p.key[b, j] - w, p.height[b, j]
                p.before[s, front], p.after[s, front] = p.before[b, j], p.after[b, j]
                p.first[s], p.size[s] = front, p.size[s] + 1
            i = (j - 1) % n
            if p.key[b, i] < phi1 + w:
                break
            p.size[b] -= 1
        # the piece that the blade stands on is divided
        value, slope = _at(p, b, p.size[b] - 2, phi1 + w)
        front = (p.first[s] - 1) % n
        p.key[s, front], p.height[s, front], p.before[s, front], p.after[s, front] = phi1, value, slope, slope
        p.first[s], p.size[s] = front, p.size[s] + 1
        p.key[b, j], p.height[b, j], p.before[b, j], p.after[b, j] = phi1 + w, value, slope, slope
    p.phi[0] = phi1


@kernel()
def profile_commit(
    p: ProfileData, width: F8, share: F8, turn: float, u0: float, u1: float, s0: float, s1: float
) -> float:
    """Turn the bit; returns the rock removed (m rad over all blades)."""
    parts = max(1, int(np.ceil(2.0 * abs(turn) / width.min())))
    phi, removed = p.phi[0], 0.0
    for k in range(parts):
        for s in range(width.size):  # a turn can put four knots for each it meets
            if 4 * p.size[s] > p.key.shape[1] - 32:
                removed += share[s] * _thin(p, s, width[s] / CELLS)
        end = phi + turn * (k + 1) / parts
        if end > p.phi[0]:
            y0, m0 = _piece(phi, u0, s0, phi + turn, u1, s1, p.phi[0])
            y1, m1 = _piece(phi, u0, s0, phi + turn, u1, s1, end)
            if k == 0:
                y0, m0 = u0, s0
            if k == parts - 1:
                y1, m1 = u1, s1
            removed += _turn_forward(p, width, share, end, y0, y1, m0, m1)
        elif end < p.phi[0]:
            _turn_backward(p, width, end)
    return removed
