"""A hole from its survey: minimum curvature between stations, then a centreline whose curvature does not jump."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import MissingDependency, SceneError
from .borehole import Borehole
from .table import F8, Segment

#: Length over which the curvature passes from one arc to the next, m.
TRANSITION = 5.0
#: Largest turn between two stations, rad: beyond it, which arc joins them is anyone's guess.
SHARPEST = math.pi / 2


def headings(inclination: F8, azimuth: F8) -> F8:
    """Unit vectors (n, 3) of directions (n,; rad): north, east, down."""
    level = np.sin(inclination)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.cos(inclination)], axis=1)


def minimum_curvature(stations: F8) -> F8:
    """Positions (n, 3) in m (north, east, down) of stations (n, 3), from the first one on, by the library wellpathpy.

    stations: measured depth (m), inclination and azimuth (rad). Raises MissingDependency.
    """
    try:
        import wellpathpy
    except ImportError:
        raise MissingDependency("surveys need the package wellpathpy: pip install wellpathpy") from None
    p, inclination, azimuth = stations.T
    down, north, east, _ = wellpathpy.mincurve.minimum_curvature(
        p, np.degrees(inclination), np.degrees(azimuth) % 360.0
    )
    return np.stack([north, east, down], axis=1)


class Arcs:
    """The path of minimum curvature through stations: an arc of a circle from each to the next; its curvature jumps."""

    def __init__(self, stations: F8) -> None:
        self.at = stations[:, 0]
        self.position = minimum_curvature(stations)
        self.tangent = headings(stations[:, 1], stations[:, 2])
        a, b = self.tangent[:-1], self.tangent[1:]
        cross = np.linalg.norm(np.cross(a, b), axis=1)
        #: turn of each arc (n - 1,), rad
        self.turn = np.arctan2(cross, np.einsum("ic,ic->i", a, b))
        across = b - np.cos(self.turn)[:, None] * a
        with np.errstate(invalid="ignore"):
            self.normal = np.where(cross[:, None] > 0, across / np.linalg.norm(across, axis=1)[:, None], 0.0)
        #: curvature of each arc (n - 1,), 1/m
        self.curvature = self.turn / np.diff(self.at)

    def frame(self, p: F8) -> tuple[F8, F8]:
        """Positions and tangents (m, 3) at measured depths p (m,); beyond the ends the last arcs go on."""
        i = np.clip(np.searchsorted(self.at, p, side="right") - 1, 0, len(self.at) - 2)
        x = (p - self.at[i])[:, None]
        t, n, angle = self.tangent[i], self.normal[i], self.curvature[i][:, None] * x
        half = x * np.sinc(angle / (2 * np.pi))  # chord
        c, s = np.cos(angle / 2), np.sin(angle / 2)
        return self.position[i] + half * (c * t + s * n), np.cos(angle) * t + np.sin(angle) * n


def survey(stations: Sequence[Sequence[float]] | F8, transition: float = TRANSITION, *, diameter: float) -> Borehole:
    """Hole through the stations (n, 3) of a survey: measured depth (m), inclination and azimuth (rad).

    The direction at measured depth p is that of the chord of the path of minimum curvature from p - transition/2 to
    p + transition/2 (m): curvature passes from one arc to the next within the transition, and is nowhere greater than
    that of the arcs around (it is their mean). The hole leaves the path by about kappa transition^2/24, see
    `departure`. At its ends the first and the last arc count as going on.

    Raises SceneError for stations that cannot be joined, MissingDependency without wellpathpy.
    """
    given = np.ascontiguousarray(stations, dtype=np.float64)
    if given.ndim != 2 or given.shape[1] != 3 or len(given) < 2:
        raise SceneError("hole.survey: must be two or more rows of measured depth, inclination, azimuth")
    if given[0, 0] != 0:
        raise SceneError(f"hole.survey.0: starts at a measured depth of {given[0, 0]:g} m, must start at 0")
    if np.diff(given[:, 0]).min() <= 0:
        i = int(np.diff(given[:, 0]).argmin()) + 1
        raise SceneError(f"hole.survey.{i}: measured depth {given[i, 0]:g} m must be more than {given[i - 1, 0]:g} m")
    if transition <= 0:
        raise SceneError(f"hole.transition = {transition:g}: must be > 0 for a survey, or its curvature jumps")
    path = Arcs(given)
    if path.turn.max() > SHARPEST:
        i = int(path.turn.argmax())
        raise SceneError(
            f"hole.survey: turns by {math.degrees(path.turn[i]):.4g} deg from {given[i, 0]:g} m to {given[i + 1, 0]:g} "
            f"m, must turn by at most {math.degrees(SHARPEST):g} deg between two stations"
        )
    half, end = transition / 2, float(given[-1, 0])

    def direction(p: F8) -> tuple[F8, F8]:
        (r0, t0), (r1, t1) = path.frame(p - half), path.frame(p + half)
        chord, rate = r1 - r0, t1 - t0
        size = np.linalg.norm(chord, axis=1)[:, None]
        t = chord / size
        return t, (rate - np.sum(rate * t, axis=1)[:, None] * t) / size

    breaks = np.concatenate([given[1:-1, 0] - half, given[1:-1, 0] + half, [end]])
    breaks = np.unique(np.clip(breaks, 0.0, end))
    breaks = breaks[np.append(np.diff(breaks) > 1e-6, True)]  # what is shorter than a micrometre is no segment
    made = Borehole.of("survey", [Segment(float(b), direction) for b in breaks if b > 1e-6], diameter)
    return replace(made, stations=given)


def departure(hole: Borehole) -> tuple[float, float]:
    """Greatest distance (m) of a surveyed hole from its path of minimum curvature: at the same measured depth, and to
    the nearest point of the path."""
    assert hole.stations is not None
    path, end = Arcs(hole.stations), hole.length
    p = np.unique(np.concatenate([np.arange(0.0, end, 0.5), hole.stations[:, 0]]))
    r, _ = path.frame(p)
    away = r - hole.frame(p).position
    # from the hole's nearest point: what is left across it
    near = r - hole.frame(hole.nearest(r)).position
    return float(np.linalg.norm(away, axis=1).max()), float(np.linalg.norm(near, axis=1).max())
