"""Error against cost: what a chart is made of, how cost is measured, fitted orders, the Pareto front, JSON."""

from __future__ import annotations

import gc
import json
import math
import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..bitrock.jit import kernel
from ..results.manifest import versions

F8 = NDArray[np.float64]
FORMAT = 1
#: Errors above this are not in the asymptotic range; points closer to the floor than the factor are not either.
COARSE, ABOVE_FLOOR = 0.1, 4.0
#: An order is fitted to at most so many of the finest points in the asymptotic range, and to no fewer than three.
FITTED = 4
#: What a dearer point on the Pareto front must gain in accuracy.
GAIN = 0.01
#: Calls shorter than this together (s) are repeated: what the caches hold decides their time.
_BRIEF = 0.02

NORMALISER = "turning 1000 pairs of numbers, each by its own angle, 2000 times (numba, one core)"


@kernel("reassoc", "contract", "nsz")
def _turn_pairs(c: F8, s: F8, x: F8, y: F8, times: int) -> None:
    for _ in range(times):
        for j in range(x.size):
            x[j], y[j] = c[j] * x[j] - s[j] * y[j], s[j] * x[j] + c[j] * y[j]


def normalise() -> float:
    """CPU seconds of a fixed piece of work (`NORMALISER`): least of nine. It is what the engines' inner loops do."""
    angle = np.linspace(0.1, 1.0, 1000)
    c, s, x, y = np.cos(angle), np.sin(angle), np.ones(1000), np.zeros(1000)
    _turn_pairs(c, s, x, y, 1)
    return cpu_seconds(lambda: _turn_pairs(c, s, x, y, 2000), repeat=9, patience=math.inf)[0]


def cpu_seconds(
    work: Callable[[], Any], repeat: int = 3, patience: float = 0.5, prepare: Callable[[], Any] = lambda: None
) -> tuple[float, Any]:
    """Least CPU seconds of ``work`` in ``repeat`` calls, and what it returned; no further call after ``patience`` s.

    Work of less than a few milliseconds is called more often. ``prepare`` is called before each, outside the clock.
    """
    best, spent, result, calls = math.inf, 0.0, None, 0
    while calls < repeat or (spent < _BRIEF and calls < 5 * repeat):
        calls += 1
        prepare()
        collecting = gc.isenabled()
        gc.disable()
        try:
            start = time.process_time()
            result = work()
            took = time.process_time() - start
        finally:
            if collecting:
                gc.enable()
        best, spent = min(best, took), spent + took
        if spent > patience:
            break
    return best, result


@dataclass(frozen=True)
class Point:
    """One computation: a method of a series at one size of its step or mesh.

    ``size``: what is refined (s, m or rad), the abscissa of the order. ``errors``: relative L2 error over the horizon
    by quantity; ``error`` is the one drawn: infinite where the method failed. ``cpu``: CPU seconds of the stepping.
    ``default``: what the program takes when it is not told otherwise.
    """

    series: str
    size: float
    error: float
    errors: dict[str, float]
    cpu: float
    settings: dict[str, Any]
    default: bool = False


@dataclass(frozen=True)
class Fit:
    """Order of a series: error = C size^order over the ``points`` finest points of its asymptotic range."""

    series: str
    order: float
    points: int
    sizes: tuple[float, float]


@dataclass(frozen=True)
class Level:
    """An error that no refinement removes: the modelling error of a lower rung, or that of a mesh."""

    name: str
    error: float


@dataclass(frozen=True)
class Panel:
    """Series drawn on one pair of axes: error against cost while ``refined`` (with ``unit``) is refined.

    ``floor``: error that all points share (of the reference, or of what is not refined here).
    """

    name: str
    title: str
    refined: str
    unit: str
    quantity: str
    reference: str
    points: tuple[Point, ...]
    floor: float = 0.0
    levels: tuple[Level, ...] = ()
    note: str = ""

    @property
    def series(self) -> dict[str, list[Point]]:
        """Points by series, coarsest first."""
        found: dict[str, list[Point]] = {}
        for point in self.points:
            found.setdefault(point.series, []).append(point)
        return {name: sorted(points, key=lambda p: -p.size) for name, points in found.items()}

    @property
    def fits(self) -> dict[str, Fit]:
        """Fitted orders, of the series that have an asymptotic range."""
        fits = {name: fit(points, self.floor) for name, points in self.series.items()}
        return {name: found for name, found in fits.items() if found is not None}

    @property
    def front(self) -> list[Point]:
        """The Pareto front: no other point is both cheaper and more accurate. Cheapest first."""
        return pareto(self.points)


@dataclass
class Chart:
    """All panels of a case, measured in one run on one machine."""

    case: str
    title: str
    scene: str
    panels: list[Panel]
    normaliser: float
    quick: bool = False
    facts: dict[str, Any] = field(default_factory=dict)

    def cost(self, point: Point) -> float:
        """Cost without unit: CPU seconds over those of the normaliser."""
        return point.cpu / self.normaliser

    def panel(self, name: str) -> Panel:
        """The panel called ``name``."""
        return next(panel for panel in self.panels if panel.name == name)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON; a failed computation has error null."""
        return {
            "format": FORMAT,
            "case": self.case,
            "title": self.title,
            "scene": self.scene,
            "quick": self.quick,
            "cost": "CPU seconds of the stepping over those of the normaliser; no set-up, no compilation",
            "normaliser": {"what": NORMALISER, "cpu_seconds": self.normaliser},
            "versions": versions(),
            "machine": platform.machine(),
            "facts": self.facts,
            "panels": [self._panel(panel) for panel in self.panels],
        }

    def _panel(self, panel: Panel) -> dict[str, Any]:
        front = {id(point) for point in panel.front}
        return {
            "name": panel.name,
            "title": panel.title,
            "refined": panel.refined,
            "unit": panel.unit,
            "error": panel.quantity,
            "reference": panel.reference,
            "floor": panel.floor,
            "note": panel.note,
            "levels": [{"name": level.name, "error": level.error} for level in panel.levels],
            "fits": [
                {"series": f.series, "order": f.order, "points": f.points, "sizes": list(f.sizes)}
                for f in panel.fits.values()
            ],
            "points": [
                {
                    "series": p.series,
                    "size": p.size,
                    "error": _finite(p.error),
                    "errors": {name: _finite(e) for name, e in p.errors.items()},
                    "cpu_seconds": p.cpu,
                    "cost": self.cost(p),
                    "pareto": id(p) in front,
                    "default": p.default,
                    "settings": p.settings,
                }
                for p in panel.points
            ],
        }

    def write(self, path: Path) -> Path:
        """Write the JSON file."""
        path.write_text(json.dumps(self.to_dict(), indent=1, allow_nan=False) + "\n", encoding="utf-8")
        return path

    @classmethod
    def read(cls, path: Path) -> Chart:
        """The chart of a JSON file of `write`."""
        data = json.loads(path.read_text(encoding="utf-8"))
        panels = [
            Panel(
                p["name"],
                p["title"],
                p["refined"],
                p["unit"],
                p["error"],
                p["reference"],
                tuple(
                    Point(
                        q["series"],
                        q["size"],
                        _or_inf(q["error"]),
                        {name: _or_inf(e) for name, e in q["errors"].items()},
                        q["cpu_seconds"],
                        q["settings"],
                        q["default"],
                    )
                    for q in p["points"]
                ),
                p["floor"],
                tuple(Level(level["name"], level["error"]) for level in p["levels"]),
                p["note"],
            )
            for p in data["panels"]
        ]
        unit = data["normaliser"]["cpu_seconds"]
        return cls(data["case"], data["title"], data["scene"], panels, unit, data["quick"], data["facts"])


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _or_inf(value: float | None) -> float:
    return math.inf if value is None else value


def relative_l2(value: F8, exact: F8) -> float:
    """Relative L2 difference of two histories (or fields) on the same equal spacing; infinite if not finite."""
    with np.errstate(all="ignore"):
        size = float(np.linalg.norm(value - exact) / np.linalg.norm(exact))
    return size if math.isfinite(size) else math.inf


def fit(points: Sequence[Point], floor: float = 0.0) -> Fit | None:
    """Order of a series by least squares in logarithms over its asymptotic range; None without three such points.

    The range: error below `COARSE` and at least `ABOVE_FLOOR` times the floor; of that the `FITTED` finest points.
    A series whose finest point gains less than a fifth has come to a floor of its own.
    """
    points = sorted(points, key=lambda p: -p.size)
    if len(points) > 1 and points[-1].error > 0.8 * points[-2].error:
        floor = max(floor, points[-1].error)
    inside = [p for p in points if ABOVE_FLOOR * floor <= p.error <= COARSE]
    inside = [p for p in inside if p.error > 0][-FITTED:]
    if len(inside) < 3:
        return None
    size, error = np.array([p.size for p in inside]), np.array([p.error for p in inside])
    order = float(np.polyfit(np.log(size), np.log(error), 1)[0])
    return Fit(points[0].series, order, len(inside), (float(size[-1]), float(size[0])))


def reach(points: Sequence[Point], error: float) -> tuple[float, float] | None:
    """CPU seconds and size (step, element) at which a series first has this error, on its lines in logarithms.

    None where it does not come down to it; the first point if that is accurate enough already.
    """
    alive = [p for p in sorted(points, key=lambda p: -p.size) if 0 < p.error < math.inf]
    for k, p in enumerate(alive):
        if p.error <= error:
            if k == 0:
                return p.cpu, p.size
            q = alive[k - 1]
            share = math.log(q.error / error) / math.log(q.error / p.error)
            return q.cpu * (p.cpu / q.cpu) ** share, q.size * (p.size / q.size) ** share
    return None


def pareto(points: Sequence[Point]) -> list[Point]:
    """Points that no other point beats in both cost and error, cheapest first.

    What is not more accurate by `GAIN` than a cheaper point is left out: the last digits are no reason to pay.
    """
    front: list[Point] = []
    for point in sorted((p for p in points if math.isfinite(p.error)), key=lambda p: (p.cpu, p.error)):
        if not front or point.error < (1 - GAIN) * front[-1].error:
            front.append(point)
    return front
