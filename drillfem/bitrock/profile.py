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

from drillfem.bitrock.jit import kernel, least

F8 = NDArray[np.float64]
CAPACITY = 16384
CELLS = 2048  # knots closer than width / CELLS are joined, so that a stalled bit cannot fill the ring


class ProfileData(NamedTuple):
    """Rings of knots, one per sector: few arrays, because the compiled functions hand them on in every step."""

    number: NDArray[np.int64]  # (2, m): index of the front knot, number of knots
    ring: F8  # (m, capacity, 4): key, height, slope on the low-key side, slope on the high-key side
    phi: F8  # (1,): total turn


KEY, HEIGHT, BEFORE, AFTER = range(4)
FIRST, SIZE = 0, 1


def profile_setup(width: F8, capacity: int = CAPACITY) -> ProfileData:
    """Flat profile of height zero; ``capacity`` is a power of two."""
    m = width.size
    data = ProfileData(np.stack([np.zeros(m, np.int64), np.full(m, 2)]), np.zeros((m, capacity, 4)), np.zeros(1))
    data.ring[:, 1, KEY] = width
    return data


@kernel(lean=True)
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


@kernel(lean=True)
def _area(k0: float, h0: float, m0: float, k1: float, h1: float, m1: float) -> float:
    d = k1 - k0
    return 0.5 * d * (h0 + h1) + d * d * (m0 - m1) / 12.0


@kernel(lean=True)
def _at(p: ProfileData, s: int, i: int, x: float) -> tuple[float, float]:
    """Value and slope at key x on the piece behind knot number i of sector s."""
    n = p.ring.shape[1]
    j, k = (p.number[FIRST, s] + i) & (n - 1), (p.number[FIRST, s] + i + 1) & (n - 1)
    return _piece(
        p.ring[s, j, KEY],
        p.ring[s, j, HEIGHT],
        p.ring[s, j, AFTER],
        p.ring[s, k, KEY],
        p.ring[s, k, HEIGHT],
        p.ring[s, k, BEFORE],
        x,
    )


@kernel(lean=True)
def _knot_area(p: ProfileData, s: int, i: int) -> float:
    n = p.ring.shape[1]
    j, k = (p.number[FIRST, s] + i) & (n - 1), (p.number[FIRST, s] + i + 1) & (n - 1)
    return _area(
        p.ring[s, j, KEY],
        p.ring[s, j, HEIGHT],
        p.ring[s, j, AFTER],
        p.ring[s, k, KEY],
        p.ring[s, k, HEIGHT],
        p.ring[s, k, BEFORE],
    )


@kernel(lean=True)
def profile_ahead(p: ProfileData, width: F8, turn: float, forward: bool, height: F8, slope: F8) -> None:
    """Height of the rock that each blade meets after ``turn``, and its slope in the turn (up to one sector)."""
    m, n = width.size, p.ring.shape[1]
    for b in range(m):
        if forward:
            s = (b + 1) % m
            x = p.phi[0] + min(turn, width[s])
            i = 0
            while i + 2 < p.number[SIZE, s] and p.ring[s, (p.number[FIRST, s] + i + 1) & (n - 1), KEY] <= x:
                i += 1
        else:
            s = b
            x = p.phi[0] + width[s] + max(turn, -width[s])
            i = p.number[SIZE, s] - 2
            while i > 0 and p.ring[s, (p.number[FIRST, s] + i) & (n - 1), KEY] >= x:
                i -= 1
        height[b], slope[b] = _at(p, s, i, x)


@kernel(lean=True)
def sector_area(p: ProfileData, s: int) -> float:
    """Integral of the height over sector s, m rad."""
    total = 0.0
    for i in range(p.number[SIZE, s] - 1):
        total += _knot_area(p, s, i)
    return total


@kernel(lean=True)
def _thin(p: ProfileData, s: int, spacing: float) -> float:
    """Drop knots closer than ``spacing`` to the one before; returns the change of the profile's integral."""
    n = p.ring.shape[1]
    change = -sector_area(p, s)
    kept, skipped, old = p.number[FIRST, s], False, p.number[SIZE, s]
    p.number[SIZE, s] = 1
    for i in range(1, old):
        j = (p.number[FIRST, s] + i) & (n - 1)
        if i < old - 1 and p.ring[s, j, KEY] - p.ring[s, kept, KEY] < spacing:
            skipped = True
            continue
        to = (kept + 1) & (n - 1)
        p.ring[s, to, KEY], p.ring[s, to, HEIGHT] = p.ring[s, j, KEY], p.ring[s, j, HEIGHT]
        p.ring[s, to, BEFORE], p.ring[s, to, AFTER] = p.ring[s, j, BEFORE], p.ring[s, j, AFTER]
        if skipped:
            _straighten(p, s, kept, to)
        kept, skipped = to, False
        p.number[SIZE, s] += 1
    return change + sector_area(p, s)


@kernel(lean=True)
def _straighten(p: ProfileData, s: int, j: int, k: int) -> None:
    d = p.ring[s, k, KEY] - p.ring[s, j, KEY]
    p.ring[s, j, AFTER] = p.ring[s, k, BEFORE] = (p.ring[s, k, HEIGHT] - p.ring[s, j, HEIGHT]) / d if d > 0.0 else 0.0


@kernel(lean=True)
def _push(p: ProfileData, s: int, y0: float, m0: float, key: float, y1: float, m1: float, spacing: float) -> float:
    """Append the piece from the last knot (value y0, slope m0) to (key, y1, m1); returns its integral."""
    n = p.ring.shape[1]
    change = 0.0
    j = (p.number[FIRST, s] + p.number[SIZE, s] - 1) & (n - 1)
    if y0 != p.ring[s, j, HEIGHT]:  # a step in the rock
        k = (j + 1) & (n - 1)
        p.ring[s, k, KEY], p.ring[s, k, HEIGHT], p.ring[s, k, BEFORE] = p.ring[s, j, KEY], y0, 0.0
        p.ring[s, j, AFTER] = 0.0
        p.number[SIZE, s] += 1
        j = k
    p.ring[s, j, AFTER] = m0
    back = (j - 1) & (n - 1)
    if p.number[SIZE, s] > 2 and key - p.ring[s, back, KEY] < spacing:
        # the last knot is too close to the one before: one straight piece in place of two (slopes over the tiny
        # turns of a stalled bit are huge: a cubic would overshoot)
        change -= _knot_area(p, s, p.number[SIZE, s] - 2)
        p.ring[s, j, KEY], p.ring[s, j, HEIGHT], p.ring[s, j, BEFORE], p.ring[s, j, AFTER] = key, y1, m1, m1
        _straighten(p, s, back, j)
        return change + _knot_area(p, s, p.number[SIZE, s] - 2)
    k = (j + 1) & (n - 1)
    p.ring[s, k, KEY], p.ring[s, k, HEIGHT], p.ring[s, k, BEFORE], p.ring[s, k, AFTER] = key, y1, m1, m1
    p.number[SIZE, s] += 1
    return change + _knot_area(p, s, p.number[SIZE, s] - 2)


@kernel(lean=True)
def _turn_forward(
    p: ProfileData, width: F8, share: F8, phi1: float, u0: float, u1: float, s0: float, s1: float
) -> float:
    m, n = width.size, p.ring.shape[1]
    phi0 = p.phi[0]
    removed = 0.0
    for b in range(m):
        s = (b + 1) % m  # the sector whose rock meets blade b; what the blade leaves enters sector b
        spacing, w = width[b] / CELLS, width[b]
        last = 0  # knots met on the way
        cutting = True
        while p.ring[s, (p.number[FIRST, s] + last) & (n - 1), KEY] < phi1:
            j = (p.number[FIRST, s] + last) & (n - 1)
            u, _ = _piece(phi0, u0, s0, phi1, u1, s1, p.ring[s, j, KEY])
            cutting = cutting and u >= p.ring[s, j, HEIGHT]
            last += 1
        end, end_slope = _at(p, s, last - 1, phi1)
        gain = 0.0
        if cutting and u1 >= end:
            gain += _push(p, b, u0, s0, phi1 + w, u1, s1, spacing)
        else:
            # piece by piece between the knots met: the deeper of blade and rock, divided where they cross
            for i in range(last):
                j, k = (p.number[FIRST, s] + i) & (n - 1), (p.number[FIRST, s] + i + 1) & (n - 1)
                x0, r0, t0 = p.ring[s, j, KEY], p.ring[s, j, HEIGHT], p.ring[s, j, AFTER]
                if i < last - 1:
                    x1, r1, t1 = p.ring[s, k, KEY], p.ring[s, k, HEIGHT], p.ring[s, k, BEFORE]
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
        while p.number[SIZE, s] > 2 and p.ring[s, (p.number[FIRST, s] + 1) & (n - 1), KEY] <= phi1:
            removed -= share[s] * _knot_area(p, s, 0)
            p.number[FIRST, s] = (p.number[FIRST, s] + 1) & (n - 1)
            p.number[SIZE, s] -= 1
        j, k = p.number[FIRST, s], (p.number[FIRST, s] + 1) & (n - 1)
        value, slope = _at(p, s, 0, phi1)
        removed -= share[s] * _area(p.ring[s, j, KEY], p.ring[s, j, HEIGHT], p.ring[s, j, AFTER], phi1, value, slope)
        p.ring[s, j, KEY], p.ring[s, j, HEIGHT], p.ring[s, j, BEFORE], p.ring[s, j, AFTER] = phi1, value, slope, slope
        p.ring[s, (p.number[FIRST, s] + p.number[SIZE, s] - 1) & (n - 1), KEY] = phi1 + width[s]
    p.phi[0] = phi1
    return removed


@kernel(lean=True)
def _turn_backward(p: ProfileData, width: F8, phi1: float) -> None:
    m, n = width.size, p.ring.shape[1]
    for b in range(m):
        s, w = (b + 1) % m, width[b]
        start = True
        while True:
            j = (p.number[FIRST, b] + p.number[SIZE, b] - 1) & (n - 1)
            front = p.number[FIRST, s]
            if start:
                start = False
                if p.ring[b, j, HEIGHT] == p.ring[s, front, HEIGHT]:
                    p.ring[s, front, BEFORE] = p.ring[b, j, BEFORE]
                else:
                    front = (front - 1) & (n - 1)
                    p.ring[s, front, KEY], p.ring[s, front, HEIGHT] = p.phi[0], p.ring[b, j, HEIGHT]
                    p.ring[s, front, BEFORE], p.ring[s, front, AFTER] = p.ring[b, j, BEFORE], 0.0
                    p.number[FIRST, s], p.number[SIZE, s] = front, p.number[SIZE, s] + 1
            else:
                front = (front - 1) & (n - 1)
                p.ring[s, front, KEY], p.ring[s, front, HEIGHT] = p.ring[b, j, KEY] - w, p.ring[b, j, HEIGHT]
                p.ring[s, front, BEFORE], p.ring[s, front, AFTER] = p.ring[b, j, BEFORE], p.ring[b, j, AFTER]
                p.number[FIRST, s], p.number[SIZE, s] = front, p.number[SIZE, s] + 1
            i = (j - 1) & (n - 1)
            if p.ring[b, i, KEY] < phi1 + w:
                break
            p.number[SIZE, b] -= 1
        # the piece that the blade stands on is divided
        value, slope = _at(p, b, p.number[SIZE, b] - 2, phi1 + w)
        front = (p.number[FIRST, s] - 1) & (n - 1)
        p.ring[s, front, KEY], p.ring[s, front, HEIGHT], p.ring[s, front, BEFORE], p.ring[s, front, AFTER] = (
            phi1,
            value,
            slope,
            slope,
        )
        p.number[FIRST, s], p.number[SIZE, s] = front, p.number[SIZE, s] + 1
        p.ring[b, j, KEY], p.ring[b, j, HEIGHT], p.ring[b, j, BEFORE], p.ring[b, j, AFTER] = (
            phi1 + w,
            value,
            slope,
            slope,
        )
    p.phi[0] = phi1


@kernel(lean=True)
def profile_commit(
    p: ProfileData, width: F8, share: F8, turn: float, u0: float, u1: float, s0: float, s1: float
) -> float:
    """Turn the bit; returns the rock removed (m rad over all blades)."""
    parts = max(1, int(np.ceil(2.0 * abs(turn) / least(width))))
    phi, removed = p.phi[0], 0.0
    for k in range(parts):
        for s in range(width.size):  # a turn can put four knots for each it meets
            if 4 * p.number[SIZE, s] > p.ring.shape[1] - 32:
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
