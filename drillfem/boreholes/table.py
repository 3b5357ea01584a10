"""A hole as a table: quintic pieces of the centreline, radius and friction along it, in arrays that kernels can read.

The centreline is r(p), p the measured depth: |dr/dp| = 1. Every kind of hole is given by its unit tangent t(p) and
curvature vector dt/dp on segments in which they are smooth. Position follows by integration, and each piece of the
table is the quintic that has the position, tangent and curvature of the hole at its two ends (Hermite): the table has a
continuous curvature wherever the hole has. Pieces are made short enough for `TOLERANCE`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

F8 = NDArray[np.float64]

#: Greatest error of the tangent within a piece (1): what |dr/dp| may differ from 1 by.
TOLERANCE = 1e-10
#: Longest piece (m), so that what is looked up by piece stays local.
LONGEST = 30.0
#: Most halvings of a segment: what still needs more bends within the radius of any hole.
_DEEPEST = 12

_GAUSS, _SHARE = (np.asarray(x, dtype=np.float64) for x in np.polynomial.legendre.leggauss(12))


class Table(NamedTuple):
    """The hole in arrays (float64, contiguous). Beyond its ends the hole goes on straight, and as wide and rough."""

    knots: F8  # (n,) measured depth where pieces meet, m
    coefficients: F8  # (n - 1, 6, 3) position by powers of (p - knot)
    radius_at: F8  # (m,) measured depth, m; piecewise linear between
    radius: F8  # (m,) radius of the hole, m
    friction_at: F8  # (k,) measured depth, m; none: friction does not depend on depth
    friction: F8  # (k, 2) static and dynamic coefficient


class Segment(NamedTuple):
    """A stretch of the hole in which its direction is smooth, up to the measured depth ``end`` (m).

    ``direction``: measured depth (m,) to unit tangent (m, 3) and curvature vector dt/dp (m, 3; 1/m).
    """

    end: float
    direction: Callable[[F8], tuple[F8, F8]]


def hermite(knots: F8, position: F8, tangent: F8, curvature: F8) -> F8:
    """Coefficients (n - 1, 6, 3) of the quintics with these values at their ends.

    knots (n,); position (n, 3) in m; tangent (n, 3); curvature (n - 1, 2, 3): at the upper and lower end of each piece.
    The error of the position falls with the sixth power of the spacing.
    """
    h = np.diff(knots)[:, None]
    r, t, k = position[:-1], tangent[:-1], curvature[:, 0]
    a = np.diff(position, axis=0) - (t + k * h / 2) * h
    b = (np.diff(tangent, axis=0) - k * h) * h
    c = (curvature[:, 1] - k) * h**2
    cubic, quartic, quintic = (10 * a - 4 * b + c / 2, -15 * a + 7 * b - c, 6 * a - 3 * b + c / 2)
    return np.ascontiguousarray(np.stack([r, t, k / 2, cubic / h**3, quartic / h**4, quintic / h**5], axis=1))


def table_of(segments: Sequence[Segment]) -> tuple[F8, F8]:
    """Knots (n,) and coefficients (n - 1, 6, 3) of the hole that starts at the origin and is made of these segments."""
    knots: list[F8] = [np.zeros(1)]
    position: list[F8] = [np.zeros((1, 3))]
    coefficients: list[F8] = []
    start = 0.0
    for end, direction in segments:
        pieces = max(1, int(np.ceil((end - start) / LONGEST)))
        for _ in range(_DEEPEST):
            at: F8 = np.linspace(start, end, pieces + 1, dtype=np.float64)
            h = np.diff(at)
            mid = (at[:-1] + at[1:]) / 2
            gauss = mid[:, None] + h[:, None] / 2 * _GAUSS
            t, _k = direction(gauss.ravel())
            along = np.einsum("q,iqc,i->ic", _SHARE / 2, t.reshape(pieces, -1, 3), h)
            r: F8 = position[-1][-1] + np.vstack([np.zeros(3), np.cumsum(along, axis=0)])
            t_at, k_at = direction(at)
            found = hermite(at, r, t_at, np.stack([k_at[:-1], k_at[1:]], axis=1))
            x = gauss - at[:-1, None]
            powers = np.stack([j * x ** (j - 1) if j else 0 * x for j in range(6)], axis=-1)
            slope = np.einsum("iqj,ijc->iqc", powers, found)
            if np.abs(slope - t.reshape(pieces, -1, 3)).max() < TOLERANCE:
                break
            pieces *= 2
        knots.append(at[1:])
        position.append(r[1:])
        coefficients.append(found)
        start = end
    return np.concatenate(knots), np.concatenate(coefficients)
