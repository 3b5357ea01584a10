"""A borehole: centreline, radius and friction along measured depth, and where a point is in it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..errors import SimulationError
from .closest import Projection, closest
from .profile import Rows, friction_profile, radius_profile
from .table import F8, Segment, Table, table_of

#: How far a string may pass an end of a hole that is not known there, m: a stand, and what a string stretches by.
BEYOND = 30.0
#: Spacing of the points that a global search starts from, m.
_SPACING = 2.0


class Frame(NamedTuple):
    """The hole at measured depths (m,): what `Borehole.frame` gives."""

    position: F8  # (m, 3) north, east, down, m
    tangent: F8  # (m, 3)
    curvature: F8  # (m, 3) dt/dp, towards the inside of the bend, 1/m
    inclination: F8  # (m,) from the vertical, rad
    azimuth: F8  # (m,) from north to east, 0 to 2 pi, rad; 0 where the hole is vertical
    dogleg_severity: F8  # (m,) |dt/dp|, rad/m
    radius: F8  # (m,) of the hole, m


@dataclass(frozen=True, eq=False)
class Borehole:
    """A hole from the origin down; e1 is north, e2 east, e3 down. Made by `straight`, `arc`, ... or `hole_of`.

    ``open_ended``: the hole is known to go on straight beyond its lower end; else a string may pass it by `BEYOND`.
    ``stations`` (n, 3): the survey that it was made from: measured depth (m), inclination, azimuth (rad).
    """

    kind: str
    table: Table
    open_ended: bool = False
    stations: F8 | None = None

    @classmethod
    def of(cls, kind: str, segments: list[Segment], diameter: float, open_ended: bool = False) -> Borehole:
        """Hole of one diameter (m) from the segments of its centreline."""
        knots, coefficients = table_of(segments)
        at, radius = radius_profile(float(knots[-1]), diameter)
        return cls(kind, Table(knots, coefficients, at, radius, np.empty(0), np.empty((0, 2))), open_ended)

    def with_diameters(self, diameter: float, sections: Rows = (), caliper: Rows = ()) -> Borehole:
        """The same hole with other diameters, see `drillfem.boreholes.profile.radius_profile`."""
        at, radius = radius_profile(self.length, diameter, sections, caliper)
        return replace(self, table=self.table._replace(radius_at=at, radius=radius))

    def with_friction(self, static: float, dynamic: float, sections: Rows = (), profile: Rows = ()) -> Borehole:
        """The same hole with other friction, see `drillfem.boreholes.profile.friction_profile`."""
        at, friction = friction_profile(self.length, static, dynamic, sections, profile)
        return replace(self, table=self.table._replace(friction_at=at, friction=friction))

    @property
    def length(self) -> float:
        """Measured depth of the lower end, m."""
        return float(self.table.knots[-1])

    def frame(self, p: F8 | float) -> Frame:
        """The hole at measured depths p (m,) or a number; straight on beyond the ends."""
        p = np.atleast_1d(np.asarray(p, dtype=np.float64))
        knots, a = self.table.knots, self.table.coefficients
        inside = np.clip(p, knots[0], knots[-1])
        i = np.clip(np.searchsorted(knots, p, side="right") - 1, 0, len(knots) - 2)
        x, a = (inside - knots[i])[:, None], a[i]
        r = a[:, 5]
        t, k = np.zeros_like(r), np.zeros_like(r)
        for j in range(4, -1, -1):  # Horner's scheme, with its first two derivatives
            k, t, r = k * x + 2 * t, t * x + r, r * x + a[:, j]
        beyond = (p - inside)[:, None]
        r, k = r + beyond * t, np.where(beyond == 0, k, 0.0)
        level = np.hypot(t[:, 0], t[:, 1])
        azimuth = np.where(level > 1e-9, np.arctan2(t[:, 1], t[:, 0]) % (2 * math.pi), 0.0)
        radius = np.interp(p, self.table.radius_at, self.table.radius)
        return Frame(r, t, k, np.arctan2(level, t[:, 2]), azimuth, np.linalg.norm(k, axis=1), radius)

    @cached_property
    def _landmarks(self) -> F8:
        """Measured depths (m,) at most `_SPACING` apart, with all knots and, just above them, jumps of curvature."""
        knots = self.table.knots
        parts = [np.linspace(a, b, math.ceil((b - a) / _SPACING) + 1) for a, b in pairwise(knots)]
        for part in parts:
            part[-1] -= 1e-9 * max(1.0, part[-1])
        return np.concatenate([*parts, knots[-1:]])

    def sharpest(self) -> tuple[float, float]:
        """Greatest curvature (1/m) and the measured depth (m) where it is."""
        at = self._landmarks
        bend = self.frame(at).dogleg_severity
        worst = int(bend.argmax())
        return float(bend[worst]), float(at[worst])

    def nearest(self, r: F8) -> F8:
        """Measured depths (n,) of the closest points to r (n, 3), by a search of the whole hole.

        Raises SimulationError where there is none nearer than the centre of curvature.
        """
        from scipy.spatial import cKDTree

        r = np.ascontiguousarray(np.atleast_2d(r), dtype=np.float64)
        at = self._landmarks
        p: F8 = at[cKDTree(self.frame(at).position).query(r)[1]]
        if closest(self.table, r, p):
            found = [closest(self.table, r[i : i + 1], p[i : i + 1].copy()) for i in range(len(p))]
            raise SimulationError(self.lost(int(np.argmax(found)), r, p))
        return p

    # -- what a solver says when the hole fails it ------------------------------------------------------------
    def sharp_bend(self, outer_radius: float = 0.0) -> str:
        """Why the closest point is not unique for a string of this radius (m) in the hole; empty if it is."""
        at = self._landmarks
        frame = self.frame(at)
        share = (frame.radius - outer_radius) * frame.dogleg_severity
        worst = int(share.argmax())
        if share[worst] < 1:
            return ""
        return (
            f"the hole bends too sharply at a measured depth of {at[worst]:.6g} m: its radius of curvature is "
            f"{1 / frame.dogleg_severity[worst]:.4g} m and must exceed the clearance of the string, "
            f"{frame.radius[worst] - outer_radius:.4g} m"
        )

    def lost(self, i: int, r: F8, p: F8, lost: int = 1) -> str:
        """What is wrong with point i of a string at r (n, 3; m), last seen at p (n,; m), which lost the hole."""
        if not np.all(np.isfinite(r[i])):
            return f"the string is nowhere: point {i}, last at a measured depth of {p[i]:.6g} m, is at {r[i]}"
        frame = self.frame(p[i])
        away = float(np.linalg.norm(r[i] - frame.position[0]))
        bend = float(frame.dogleg_severity[0])
        text = (
            f"{lost} of {len(p)} points of the string lost the hole: the first is {away:.4g} m away from where it was "
            f"last, at a measured depth of {p[i]:.6g} m (radius of the hole {frame.radius[0]:.4g} m, of its curvature "
            f"{1 / bend if bend else math.inf:.4g} m)"
        )
        return f"{text}; try a smaller time.step, or a stiffer or augmented contact"

    def outside(self, low: float, high: float) -> str:
        """Why a string must not reach from measured depth low to high (m); empty if it may."""
        if low < -BEYOND:
            return (
                f"the string reaches {-low:.4g} m above the top of the hole, where it is guided for {BEYOND:g} m: stop "
                "earlier, or let it move slower"
            )
        if high > self.length + BEYOND and not self.open_ended:
            return (
                f"the string reaches a measured depth of {high:.6g} m, {high - self.length:.4g} m beyond the end of "
                f"the {self.kind} at {self.length:.6g} m; the hole is taken as straight for {BEYOND:g} m there: stop "
                "earlier, or give more of the hole"
            )
        return ""

    def complaint(self, found: Projection, r: F8, p: F8) -> str:
        """What is wrong with a projection of points r (n, 3), whose depths are now p (n,); empty if nothing is."""
        if found.lost:
            return self.lost(found.first, r, p, found.lost)
        return self.outside(found.low, found.high)
