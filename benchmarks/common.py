"""What the benchmarks share: timing in CPU and wall seconds, the speed of the machine, tables, differences of runs."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import drillfem
from drillfem.results import Result
from drillfem.scene import load_scene

Array = npt.NDArray[np.float64]
DOCS = Path(__file__).resolve().parents[1] / "docs"


@dataclass(frozen=True)
class Timed:
    """A run with the seconds it took: on the clock, and of the processor (others may share the machine)."""

    result: Result
    wall: float
    cpu: float

    @property
    def simulated(self) -> float:
        """Simulated seconds."""
        return float(self.result.summary["simulated_seconds"])

    @property
    def per_wall(self) -> float:
        """Simulated seconds per wall second."""
        return self.simulated / self.wall

    @property
    def per_cpu(self) -> float:
        """Simulated seconds per processor second."""
        return self.simulated / self.cpu


def timed(name: str, until: float, **overrides: Any) -> Timed:
    """Simulate a built-in scene in memory; ``__`` in a keyword stands for a dot."""
    scene = load_scene(name, {key.replace("__", "."): value for key, value in overrides.items()})
    wall, cpu = time.perf_counter(), time.process_time()
    result = drillfem.simulate(scene, until=until)
    return Timed(result, time.perf_counter() - wall, time.process_time() - cpu)


def difference(one: Result, other: Result, name: str, until: float = np.inf) -> float:
    """Largest difference of a history variable up to a time (s), relative to its largest value; on common times."""
    a, b = one.history, other.history
    ta, tb = a["time"].values, b["time"].values
    spacing = max(ta[1] - ta[0], tb[1] - tb[0])
    at = np.arange(0.0, min(ta[-1], tb[-1], until) + spacing / 2, spacing)
    x, y = (h[name].values[np.searchsorted(t, at - 1e-9)] for h, t in ((a, ta), (b, tb)))
    return float(np.abs(x - y).max() / np.abs(x).max())


def processor_seconds(work: Callable[[], object], repeat: int = 5) -> float:
    """Least processor time of ``work`` in ``repeat`` calls, s."""
    best = np.inf
    for _ in range(repeat):
        start = time.process_time()
        work()
        best = min(best, time.process_time() - start)
    return best


def machine() -> dict[str, float]:
    """How fast this core is: two operations that anyone can repeat, in processor seconds."""
    rng = np.random.default_rng(0)
    a, x = rng.standard_normal((600, 600)) + 600 * np.eye(600), rng.standard_normal(600)
    y = np.linspace(0.0, 1.0, 10_000)
    return {
        "100 matrix-vector products, 600 x 600": processor_seconds(lambda: [a @ x for _ in range(100)]),
        "1000 sums of 10 000 squares": processor_seconds(lambda: [float((y * y).sum()) for _ in range(1000)]),
    }


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [header, ["---", *["---:"] * (len(header) - 1)], *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
