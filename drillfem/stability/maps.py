"""Maps of linear stability over top speed and weight on bit, and the runs that confirm them."""

from __future__ import annotations

import itertools
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drillfem.errors import SceneError
from drillfem.results.atomic import write_json
from drillfem.stability.loop import DrillingLoop, Roots, pitch
from drillfem.stability.timedomain import TimePoint, at_point, measure
from drillfem.stability.transfer import F8

if TYPE_CHECKING:
    from drillfem.scene import Scene

SHAPE = (72, 48)
"""Default numbers of speeds and weights of a map."""


@dataclass(frozen=True)
class StabilityMap:
    """Rightmost characteristic root over speeds (m,) in rad/s and weights on bit (k,) in N; fields are (k, m).

    Below ``least_weight``, which the wear flats carry, nothing is cut: nan there, and 0 roots. If it lies in the map it
    is one of the weights; the growth there is that of the limit.
    """

    scene: Scene
    model: str
    loop: DrillingLoop
    speeds: F8
    weights: F8
    least_weight: float  # N
    growth: F8  # 1/s
    frequency: F8  # Hz
    torsional: NDArray[np.bool_]  # the rightmost root follows torsion
    unstable: NDArray[np.int64]  # roots with positive growth, by the argument principle; pairs count as two
    band: float  # Hz: roots are looked for below
    complete: bool  # whether there can be no unstable ones beyond
    own: Roots  # at the scene's own speed and weight on bit
    points: list[TimePoint] = field(default_factory=list)  # runs at some points, see `confirm`

    @property
    def own_point(self) -> tuple[float, float]:
        """The scene's top speed (rad/s) and weight on bit (N)."""
        return float(self.scene.top_drive.speed or 0.0), self.scene.nominal().weight_on_bit

    @property
    def agreement(self) -> tuple[int, int]:
        """Points at which the run does what the roots say, and points."""
        return sum(p.agrees for p in self.points), len(self.points)

    def sweep(self, weight: float, samples: int = 400) -> tuple[F8, Roots]:
        """Roots at one weight on bit (N), over ``samples`` speeds (rad/s) of the map."""
        speeds = np.linspace(self.speeds[0], self.speeds[-1], samples)
        return speeds, self.loop.roots(speeds, pitch(self.scene, weight))

    def stable_speeds(self, weight: float, samples: int = 200) -> list[tuple[float, float]]:
        """Intervals of speed (rad/s) of the map in which no root grows, at one weight on bit (N); edges to 1e-5."""
        speeds = np.linspace(self.speeds[0], self.speeds[-1], samples)
        rho = pitch(self.scene, weight)

        def stable(at: F8) -> NDArray[np.bool_]:
            return np.asarray(self.loop.count(at, rho) == 0)

        quiet = stable(speeds)
        change = np.flatnonzero(quiet[1:] != quiet[:-1])
        a, b = speeds[change], speeds[change + 1]
        while len(change) and np.max((b - a) / b) > 1e-5:
            middle = 0.5 * (a + b)
            like_a = stable(middle) == quiet[change]
            a, b = np.where(like_a, middle, a), np.where(like_a, b, middle)
        edges = [float(x) for x in 0.5 * (a + b)]
        if quiet[0]:
            edges.insert(0, float(speeds[0]))
        if quiet[-1]:
            edges.append(float(speeds[-1]))
        return list(zip(edges[::2], edges[1::2], strict=True))

    def outline(self) -> tuple[F8, list[F8]]:
        """Boundary between stable and unstable, and the stable region, in (rad/s, N).

        Segments (q, 2, 2) and polygons (corners, 2), one per cell of the map. Their corners on the edges of cells are
        bisected to 1e-4 of an edge by counting roots, so that they do not know of the map's resolution.
        """
        cuts = np.isfinite(self.growth[:, 0])
        x, y, quiet = self.speeds, self.weights[cuts], self.unstable[cuts] == 0
        nodes = np.stack(np.meshgrid(x, y), axis=-1)

        def crossings(a: F8, b: F8, quiet_a: NDArray[np.bool_], quiet_b: NDArray[np.bool_]) -> F8:
            """Where the edges from a to b (r, c, 2) cross the boundary; nan where they do not."""
            where = quiet_a != quiet_b
            out = np.full(a.shape, np.nan)
            if not where.any():
                return out
            low, high, like = a[where], b[where], quiet_a[where]
            for _ in range(14):
                middle = 0.5 * (low + high)
                same = (self.loop.count(middle[:, 0], pitch(self.scene, middle[:, 1])) == 0) == like
                low, high = np.where(same[:, None], middle, low), np.where(same[:, None], high, middle)
            out[where] = 0.5 * (low + high)
            return out

        across = crossings(nodes[:, :-1], nodes[:, 1:], quiet[:, :-1], quiet[:, 1:])
        up = crossings(nodes[:-1], nodes[1:], quiet[:-1], quiet[1:])
        segments, polygons = [], []
        for i in range(len(y) - 1):
            for j in range(len(x) - 1):
                # round the cell: corner, crossing of the edge that follows, and so on
                corners = ((i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j))
                edges = (across[i, j], up[i, j + 1], across[i + 1, j], up[i, j])
                ring, cut = [], []
                for corner, edge in zip(corners, edges, strict=True):
                    if quiet[corner]:
                        ring.append(nodes[corner])
                    if np.isfinite(edge[0]):
                        ring.append(edge)
                        cut.append(edge)
                if ring:
                    polygons.append(np.array(ring))
                segments += [np.array(pair) for pair in zip(cut[::2], cut[1::2], strict=True)]
        return np.array(segments).reshape(-1, 2, 2), polygons

    def save(self, path: Path) -> Path:
        """Write everything that is drawn as JSON, in SI units."""
        nominal = self.scene.nominal()
        roots = self.own.values[0][np.isfinite(self.own.values[0])]
        agree, of = self.agreement
        write_json(
            path,
            {
                "scene": self.scene.name,
                "title": self.scene.title,
                "model": self.model,
                "units": {"speed": "rad/s", "weight": "N", "growth": "1/s", "frequency": "Hz"},
                "band": self.band,
                "complete": self.complete,
                "least_weight": self.least_weight,
                "own": {
                    "speed": self.own_point[0],
                    "weight": self.own_point[1],
                    "depth_of_cut": nominal.depth_of_cut,
                    "unstable_roots": int(self.own.unstable[0]),
                    "roots": [
                        {"growth": r.real, "frequency": r.imag / (2 * np.pi), "torsional": bool(t)}
                        for r, t in zip(roots, self.own.torsional[0], strict=False)
                    ],
                },
                "stable_speeds": self.stable_speeds(self.own_point[1]),
                "agreement": {"agree": agree, "of": of},
                "points": [{**asdict(p), "agrees": p.agrees} for p in self.points],
                "speeds": self.speeds,
                "weights": self.weights,
                "growth": self.growth,
                "frequency": self.frequency,
                "torsional": self.torsional,
                "unstable": self.unstable,
            },
        )
        return path


def default_ranges(scene: Scene) -> tuple[tuple[float, float], tuple[float, float]]:
    """Speeds (rad/s) and weights (N) that a map shows unless told otherwise: around the scene's own point."""
    speed, nominal = float(scene.top_drive.speed or 0.0), scene.nominal()
    flat = least_weight(scene)
    return (0.35 * speed, 2.0 * speed), (0.9 * flat, flat + 3.0 * (nominal.weight_on_bit - flat))


def least_weight(scene: Scene) -> float:
    """Weight on bit in N that the wear flats carry without cutting: sigma_1 a l."""
    assert scene.bit is not None and scene.rock is not None
    return scene.rock.contact_strength * scene.bit.radius * scene.bit.wear_flat_length


def stability_map(
    scene: Scene,
    speeds: ArrayLike | None = None,
    weights: ArrayLike | None = None,
    surface: str = "exact",
) -> StabilityMap:
    """Map of a scene over ``speeds`` (m,) in rad/s and ``weights`` (k,) on bit in N, both rising.

    surface : "exact", or "scene" for what the scene's discretised rock surface makes of it.
    Raises SceneError for a scene without cutting bit, or speeds that are not positive.
    """
    loop = DrillingLoop.from_scene(scene, surface)
    ranges = default_ranges(scene)
    x: F8 = np.asarray(np.linspace(*ranges[0], SHAPE[0]) if speeds is None else speeds, np.float64)
    y: F8 = np.asarray(np.linspace(*ranges[1], SHAPE[1]) if weights is None else weights, np.float64)
    for name, values in (("speeds", x), ("weights", y)):
        if values.ndim != 1 or len(values) < 2 or np.any(np.diff(values) <= 0) or values[0] <= 0:
            raise SceneError(f"{name}: must be two or more numbers > 0 that rise")
    least = least_weight(scene)
    if y[-1] <= least:
        raise SceneError(f"weights up to {y[-1]:g} N: must exceed {least:.6g} N, or nothing is cut")
    if y[0] < least:
        y = np.asarray(np.union1d(y, [least]), np.float64)
    rho, cuts = pitch(scene, y), y >= least
    at_speed, at_pitch = (a.ravel() for a in np.meshgrid(x, rho[cuts]))
    roots = loop.roots(at_speed, at_pitch)
    shape = (len(y), len(x))
    growth, frequency = np.full(shape, np.nan), np.full(shape, np.nan)
    torsional, unstable = np.zeros(shape, bool), np.zeros(shape, np.int64)
    growth[cuts], frequency[cuts] = (a.reshape(-1, len(x)) for a in (roots.growth, roots.frequency))
    torsional[cuts], unstable[cuts] = (a.reshape(-1, len(x)) for a in (roots.torsional[:, 0], roots.unstable))
    band, complete = loop.band(float(rho[-1]))
    own = loop.roots(np.array([scene.top_drive.speed]), pitch(scene, np.array([scene.nominal().weight_on_bit])))
    return StabilityMap(
        scene,
        scene.resolved_model().name,
        loop,
        x,
        y,
        least,
        growth,
        frequency,
        torsional,
        unstable,
        band / (2 * np.pi),
        complete,
        own,
    )


def confirm(chart: StabilityMap, shape: tuple[int, int] = (5, 3), end: float = 40.0) -> list[TimePoint]:
    """Run the scene at ``shape`` = (speeds, weights) even points of the map, and keep them in ``chart.points``.

    end : s that each point is run for.
    """
    bottom = max(float(chart.weights[0]), chart.least_weight)
    speeds = _inside(float(chart.speeds[0]), float(chart.speeds[-1]), shape[0])
    weights = _inside(bottom, float(chart.weights[-1]), shape[1])
    chart.points.clear()
    for weight, speed in itertools.product(weights, speeds):
        chart.points.append(time_point(chart.scene, chart.loop, float(speed), float(weight), chart.band, end))
    return chart.points


def time_point(
    scene: Scene, loop: DrillingLoop, speed: float, weight: float, highest: float, end: float = 40.0
) -> TimePoint:
    """Run a scene at one speed (rad/s) and weight (N), and set the motion that is seen beside the nearest root."""
    roots = loop.roots(np.array([speed]), pitch(scene, np.array([weight])), least_growth=-20.0)
    motion, window = measure(at_point(scene, speed, weight, end), highest, end)
    values = roots.values[0][np.isfinite(roots.values[0])]
    seen = motion.growth + 2j * np.pi * motion.frequency
    nearest = values[np.argmin(np.abs(values - seen))]
    return TimePoint(
        speed,
        weight,
        motion.growth,
        motion.frequency,
        float(nearest.real),
        float(nearest.imag / (2 * np.pi)),
        float(roots.growth[0]),
        window,
    )


def _inside(low: float, high: float, number: int) -> F8:
    """``number`` even points, half a spacing from either end."""
    return low + (high - low) * (np.arange(number) + 0.5) / number
