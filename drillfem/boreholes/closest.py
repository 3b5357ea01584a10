"""The closest point of a hole to points of a string: local Newton iteration from the last one, compiled.

The closest point c = r(p) of a point r satisfies g(p) = (r - c) . t = 0 (D-6), with t = dr/dp and k = d2r/dp2:
g' = -(t . t - k . (r - c)), which is negative as long as r is nearer than the centre of curvature.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..bitrock.jit import kernel
from .table import F8, Table

I4 = NDArray[np.int32]

#: What the wall tells the forms, per quadrature point; see `project`.
WALL = 14
#: Where the pressure of the augmented Lagrangian stands, which is not the wall's to say.
PRESSURE = 13

_MOST = 50  # iterations
_CLOSE = 1e-9  # (r - c) . t that is nought, m
_REACH = 20.0  # longest step of an iteration, m
_STEEP = 0.25  # least -g' that a step is made with
_NEXT = 1e-4  # distance along the hole that a row of `project` carries, m: the forms go it by themselves, to 1e-11 m


class Projection(NamedTuple):
    """What `project` found of a string in its hole."""

    gap: float  # smallest gap, m; negative: penetration
    narrow: int  # its point; -1: none
    lost: int  # number of points without a closest point; they keep their last one
    first: int  # the first of them; -1: none
    low: float  # least measured depth of a point, m
    high: float  # greatest


@kernel(lean=True)
def _interval(at: F8, p: float) -> int:
    """Index i of the interval at[i] <= p < at[i + 1]; the first or last one beyond the ends."""
    low, high = 0, at.size - 1
    while high - low > 1:
        mid = (low + high) // 2
        if p < at[mid]:
            high = mid
        else:
            low = mid
    return low


@kernel(lean=True)
def _point(knots: F8, a: F8, p: float):  # type: ignore[no-untyped-def]
    """Position, tangent and second derivative at measured depth p: nine numbers."""
    i = _interval(knots, p)
    x = min(max(p, knots[0]), knots[knots.size - 1]) - knots[i]
    c0 = a[i, 0, 0] + x * (a[i, 1, 0] + x * (a[i, 2, 0] + x * (a[i, 3, 0] + x * (a[i, 4, 0] + x * a[i, 5, 0]))))
    c1 = a[i, 0, 1] + x * (a[i, 1, 1] + x * (a[i, 2, 1] + x * (a[i, 3, 1] + x * (a[i, 4, 1] + x * a[i, 5, 1]))))
    c2 = a[i, 0, 2] + x * (a[i, 1, 2] + x * (a[i, 2, 2] + x * (a[i, 3, 2] + x * (a[i, 4, 2] + x * a[i, 5, 2]))))
    t0 = a[i, 1, 0] + x * (2 * a[i, 2, 0] + x * (3 * a[i, 3, 0] + x * (4 * a[i, 4, 0] + x * 5 * a[i, 5, 0])))
    t1 = a[i, 1, 1] + x * (2 * a[i, 2, 1] + x * (3 * a[i, 3, 1] + x * (4 * a[i, 4, 1] + x * 5 * a[i, 5, 1])))
    t2 = a[i, 1, 2] + x * (2 * a[i, 2, 2] + x * (3 * a[i, 3, 2] + x * (4 * a[i, 4, 2] + x * 5 * a[i, 5, 2])))
    beyond = p - knots[i] - x
    if beyond != 0.0:  # straight on
        return c0 + beyond * t0, c1 + beyond * t1, c2 + beyond * t2, t0, t1, t2, 0.0, 0.0, 0.0
    k0 = 2 * a[i, 2, 0] + x * (6 * a[i, 3, 0] + x * (12 * a[i, 4, 0] + x * 20 * a[i, 5, 0]))
    k1 = 2 * a[i, 2, 1] + x * (6 * a[i, 3, 1] + x * (12 * a[i, 4, 1] + x * 20 * a[i, 5, 1]))
    k2 = 2 * a[i, 2, 2] + x * (6 * a[i, 3, 2] + x * (12 * a[i, 4, 2] + x * 20 * a[i, 5, 2]))
    return c0, c1, c2, t0, t1, t2, k0, k1, k2


@kernel(lean=True)
def _nearest(knots: F8, a: F8, r0: float, r1: float, r2: float, p: float):  # type: ignore[no-untyped-def]
    """Measured depth of the closest point, from a start p; whether it was found; and `_point` there."""
    found = False
    c0, c1, c2, t0, t1, t2, k0, k1, k2 = _point(knots, a, p)
    for _ in range(_MOST):
        d0, d1, d2 = r0 - c0, r1 - c1, r2 - c2
        g = d0 * t0 + d1 * t1 + d2 * t2
        slope = t0 * t0 + t1 * t1 + t2 * t2 - d0 * k0 - d1 * k1 - d2 * k2
        if abs(g) <= _CLOSE:
            found = slope > 0.0  # else it is the farthest point, or as near as others
            break
        p += min(max(g / max(slope, _STEEP), -_REACH), _REACH)
        c0, c1, c2, t0, t1, t2, k0, k1, k2 = _point(knots, a, p)
    return p, found, c0, c1, c2, t0, t1, t2, k0, k1, k2


@kernel(lean=True)
def _fill(table: Table, p: float, out: F8, i: int) -> float:
    """Write radius, its slope and friction at measured depth p into row i; returns the radius."""
    at, radius = table.radius_at, table.radius
    j = _interval(at, p)
    width, beside = at[j + 1] - at[j], p - at[j]
    step = radius[j + 1] - radius[j]
    inside = 0.0 <= beside <= width  # beyond the ends: as wide as there
    out[i, 9] = radius[j] + min(max(beside / width, 0.0), 1.0) * step
    out[i, 10] = step / width if inside else 0.0
    at, friction = table.friction_at, table.friction
    if at.size:
        j = _interval(at, p)
        share = min(max((p - at[j]) / (at[j + 1] - at[j]), 0.0), 1.0)
        out[i, 11] = friction[j, 0] + share * (friction[j + 1, 0] - friction[j, 0])
        out[i, 12] = friction[j, 1] + share * (friction[j + 1, 1] - friction[j, 1])
    return out[i, 9]


@kernel(lean=True)
def wall(table: Table, p: F8, out: F8) -> None:
    """What the wall tells at given measured depths p (n,), as rows of `project`: for depths that are unknowns (D-6)."""
    for i in range(p.size):
        c0, c1, c2, t0, t1, t2, k0, k1, k2 = _point(table.knots, table.coefficients, p[i])
        out[i, 0], out[i, 1], out[i, 2] = c0, c1, c2
        out[i, 3], out[i, 4], out[i, 5] = t0, t1, t2
        out[i, 6], out[i, 7], out[i, 8] = k0, k1, k2
        _fill(table, p[i], out, i)


@kernel(lean=True)
def closest(table: Table, r: F8, p: F8) -> int:
    """Closest points of r (n, 3) from the last ones p (n,), which are replaced; returns how many were lost.

    Where one is lost, p keeps its last value. A start must be nearer to its closest point than to where the hole
    comes back to r: `Borehole.nearest` finds one.
    """
    lost = 0
    for i in range(p.size):
        new, found, _, _, _, _, _, _, _, _, _ = _nearest(
            table.knots, table.coefficients, r[i, 0], r[i, 1], r[i, 2], p[i]
        )
        if found:
            p[i] = new
        else:
            lost += 1
    return lost


@kernel(lean=True)
def piece(table: Table, r: F8, p: float, out: F8) -> float:
    """Measured depth (m) of the closest point of r (3,), from the last one p, to round-off; p where it is lost.

    out (9,): the hole at a point next to it, which the forms carry on from: centre, dr/dp, d2r/dp2.
    """
    new, found, c0, c1, c2, t0, t1, t2, k0, k1, k2 = _nearest(table.knots, table.coefficients, r[0], r[1], r[2], p)
    if not found:
        return p
    out[0], out[1], out[2] = c0, c1, c2
    out[3], out[4], out[5] = t0, t1, t2
    out[6], out[7], out[8] = k0, k1, k2
    # the search stops at a nanometre, which the law of the bit feels: the rest of the way is linear
    return new + (r[0] - c0) * t0 + (r[1] - c1) * t1 + (r[2] - c2) * t2


@kernel(lean=True)
def _carry(out: F8, i: int, r0: float, r1: float, r2: float) -> tuple[float, float]:
    """Distance (m) along the hole from row i of `project` to the closest point of r, and the room there from r to the
    wall (m): what the forms make of the row. nan for a row of zeros."""
    d0, d1, d2 = r0 - out[i, 0], r1 - out[i, 1], r2 - out[i, 2]
    t0, t1, t2, k0, k1, k2 = out[i, 3], out[i, 4], out[i, 5], out[i, 6], out[i, 7], out[i, 8]
    slope = t0 * t0 + t1 * t1 + t2 * t2 - d0 * k0 - d1 * k1 - d2 * k2
    if slope <= 0.0:
        return math.nan, math.nan
    d = (d0 * t0 + d1 * t1 + d2 * t2) / slope
    half = d * d / 2
    d0, d1, d2 = d0 - t0 * d - k0 * half, d1 - t1 * d - k1 * half, d2 - t2 * d - k2 * half
    return d, out[i, 9] + out[i, 10] * d - math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)


@kernel(lean=True)
def project(u: F8, size: int, cells: I4, basis: F8, radius: F8, table: Table, p: F8, out: F8) -> Projection:
    """What the wall of a hole tells every quadrature point of a string.

    u: unknowns, one block of ``size`` per node, position (m) first. cells (c, nodes per cell): node numbers. basis
    (q, nodes per cell): shape functions at the points. radius (c,): outer radius of the string, m. p (c q,): measured
    depth of the last closest points, replaced. out (c q, 14), replaced but for its last column: centre (3), tangent
    dr/dp (3), d2r/dp2 (3), radius of the hole and its slope, static and dynamic friction; the pressure is not touched,
    nor is friction where the table has none.

    A row is kept as long as the point stays next to it: the forms take the rest of the way by its quadratic piece. Rows
    of zeros are always renewed. A lost point keeps its last p and row.
    """
    gap, narrow, lost, first = math.inf, -1, 0, -1
    low, high = math.inf, -math.inf
    knots, coefficients = table.knots, table.coefficients
    points = basis.shape[0]
    for c in range(cells.shape[0]):
        for q in range(points):
            i = c * points + q
            r0, r1, r2 = 0.0, 0.0, 0.0
            for n in range(cells.shape[1]):
                at, share = cells[c, n] * size, basis[q, n]
                r0 += share * u[at]
                r1 += share * u[at + 1]
                r2 += share * u[at + 2]
            new = p[i]
            ahead, room = _carry(out, i, r0, r1, r2)
            if not abs(ahead) <= _NEXT:
                new, found, c0, c1, c2, t0, t1, t2, k0, k1, k2 = _nearest(knots, coefficients, r0, r1, r2, p[i])
                if not found:
                    lost += 1
                    if first < 0:
                        first = i
                    continue
                p[i] = new
                out[i, 0], out[i, 1], out[i, 2] = c0, c1, c2
                out[i, 3], out[i, 4], out[i, 5] = t0, t1, t2
                out[i, 6], out[i, 7], out[i, 8] = k0, k1, k2
                _fill(table, new, out, i)
                ahead, room = _carry(out, i, r0, r1, r2)
            low, high = min(low, new), max(high, new)
            room -= radius[c]
            if room < gap:
                gap, narrow = room, i
    return Projection(gap, narrow, lost, first, low, high)
