"""Centrelines in closed form: straight, arc, build, helix; and the spline through points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ..errors import SceneError
from .borehole import Borehole
from .table import F8, Segment

_GAUSS, _SHARE = np.polynomial.legendre.leggauss(24)


def heading(inclination: float, azimuth: float) -> F8:
    """Unit vector (3,) of a direction (rad): north, east, down."""
    level = math.sin(inclination)
    return np.array([level * math.cos(azimuth), level * math.sin(azimuth), math.cos(inclination)])


def _bend(start: float, end: float, inclination: float, bends: tuple[float, float], azimuth: float) -> Segment:
    """A stretch in the vertical plane of ``azimuth`` whose curvature (1/m) goes from the one to the other, linearly."""
    north, east = math.cos(azimuth), math.sin(azimuth)
    slope = (bends[1] - bends[0]) / (end - start)

    def direction(p: F8) -> tuple[F8, F8]:
        x = p - start
        angle, bend = inclination + x * (bends[0] + x * slope / 2), bends[0] + x * slope
        s, c = np.sin(angle), np.cos(angle)
        return np.stack([s * north, s * east, c], axis=1), np.stack([c * north, c * east, -s], axis=1) * bend[:, None]

    return Segment(end, direction)


def straight(length: float, inclination: float = 0.0, azimuth: float = 0.0, *, diameter: float) -> Borehole:
    """Straight hole; lengths in m, angles in rad."""
    return Borehole.of("straight", [_bend(0.0, length, inclination, (0.0, 0.0), azimuth)], diameter, open_ended=True)


def arc(length: float, radius: float, inclination: float = 0.0, azimuth: float = 0.0, *, diameter: float) -> Borehole:
    """Arc of a circle that builds inclination from its top; lengths and radius of curvature in m, angles in rad."""
    return Borehole.of("arc", [_bend(0.0, length, inclination, (1 / radius, 1 / radius), azimuth)], diameter)


def build(
    length: float,
    kick_off: float,
    radius: float,
    final_inclination: float,
    inclination: float = 0.0,
    azimuth: float = 0.0,
    transition: float = 0.0,
    *,
    diameter: float,
) -> Borehole:
    """Straight to kick_off (m), an arc of this radius (m) to final_inclination (rad), straight on.

    transition (m): length over which the curvature rises, centred on the kick-off, and falls again, linearly with
    measured depth (clothoids); the turn and the length of the whole are those of the plain arc. 0: it jumps.

    Raises SceneError where the transition has no room.
    """
    turn = final_inclination - inclination
    bend, end = math.copysign(1 / radius, turn), kick_off + abs(turn) * radius
    room = min(2 * kick_off, end - kick_off)
    if transition > room:
        raise SceneError(
            f"hole.transition = {transition:g}: must be at most {room:.6g} m, the length of the arc and twice that of "
            "the straight part above it"
        )
    half, full = transition / 2, max(length, end + transition)
    angle = abs(turn) and transition * bend / 2  # turn of a ramp
    parts = [
        (0.0, kick_off - half, inclination, (0.0, 0.0)),
        (kick_off - half, kick_off + half, inclination, (0.0, bend)),
        (kick_off + half, end - half, inclination + angle, (bend, bend)),
        (end - half, end + half, final_inclination - angle, (bend, 0.0)),
        (end + half, full, final_inclination, (0.0, 0.0)),
    ]
    segments = [_bend(a, b, i, k, azimuth) for a, b, i, k in parts if b > a]
    return Borehole.of("build", segments, diameter, open_ended=True)


def helix(length: float, radius: float, pitch: float, azimuth: float = 0.0, *, diameter: float) -> Borehole:
    """Helix about a vertical axis, to the right seen from above, that starts towards ``azimuth`` (rad).

    radius (m): of the cylinder it lies on; pitch (m): depth gained per turn. Its inclination is
    atan(2 pi radius/pitch), its curvature sin(inclination)^2 / radius.
    """
    inclination = math.atan2(2 * math.pi * radius, pitch)
    level, down = math.sin(inclination), math.cos(inclination)
    rate = level / radius  # of azimuth

    def direction(p: F8) -> tuple[F8, F8]:
        c, s = np.cos(azimuth + rate * p), np.sin(azimuth + rate * p)
        t = np.stack([level * c, level * s, np.full_like(p, down)], axis=1)
        return t, level * rate * np.stack([-s, c, np.zeros_like(p)], axis=1)

    return Borehole.of("helix", [Segment(length, direction)], diameter)


def spline(points: Sequence[Sequence[float]] | F8, *, diameter: float) -> Borehole:
    """Natural cubic spline through points (n, 3) in m (north, east, down), the first one the origin.

    Its parameter is the length of the chords; its curvature is continuous, and nought at both ends.

    Raises SceneError for points that do not differ, or do not start at the origin.
    """
    from scipy.interpolate import CubicSpline

    given = np.asarray(points, dtype=np.float64)
    if given.ndim != 2 or given.shape[1] != 3 or len(given) < 2:
        raise SceneError("hole.points: must be two or more rows of three numbers: north, east, down")
    if np.abs(given[0]).max() > 0:
        raise SceneError(f"hole.points.0 = {given[0].tolist()}: must be the origin [0, 0, 0], where the hole starts")
    chords = np.linalg.norm(np.diff(given, axis=0), axis=1)
    if chords.min() <= 0:
        i = int(chords.argmin()) + 1
        raise SceneError(f"hole.points.{i} = {given[i].tolist()}: must differ from the point above it")
    u = np.concatenate([[0.0], np.cumsum(chords)])
    curve = CubicSpline(u, given, bc_type="natural")

    def depth(start: float, end: F8) -> F8:
        """Arc length from parameter start to end (m,)."""
        at = start + (end - start)[:, None] / 2 * (1 + _GAUSS)
        return (end - start) / 2 * (np.linalg.norm(curve(at, 1), axis=-1) @ _SHARE)

    segments, top = [], 0.0
    for a, b in pairwise(u):
        bottom = top + float(depth(a, np.array([b]))[0])

        def direction(p: F8, a: float = a, b: float = b, top: float = top, bottom: float = bottom) -> tuple[F8, F8]:
            at = a + (p - top) / (bottom - top) * (b - a)
            for _ in range(8):  # Newton, from the parameter at even speed
                at = np.clip(at - (depth(a, at) - (p - top)) / np.linalg.norm(curve(at, 1), axis=1), a, b)
            # the second derivative of a cubic is linear: no ambiguity at the points
            first, second = curve(at, 1), curve(at, 2)
            speed = np.linalg.norm(first, axis=1)[:, None]
            t = first / speed
            return t, (second - np.sum(second * t, axis=1)[:, None] * t) / speed**2

        segments.append(Segment(bottom, direction))
        top = bottom
    return Borehole.of("spline", segments, diameter)
