"""Compile everything once: forms of every ansatz, and the numba kernels."""

from __future__ import annotations

from collections.abc import Callable

from ..scene import load_scene
from .run import simulate

#: A short run of each of these touches every kernel that the built-in scenes need.
_RUNS: tuple[tuple[str, dict[str, object], float | None], ...] = (
    ("vertical-c1-cd4", {"model": "spatial"}, 0.003),
    ("vertical-c1-cd4", {"model": "spatial", "time.engine": "compiled"}, 0.003),
    ("vertical-c1-cd4", {"model": "axial-torsional", "time.engine": "petsc"}, 0.003),
    ("vertical-c1-cd4", {"model": "axial-torsional"}, 0.003),
    ("cutting-c1", {}, 0.003),
    ("cutting-c1", {"time.engine": "characteristics", "rock.surface.scheme": "supg"}, 0.003),
    ("vertical-v1", {}, 0.003),
    ("off-bottom-soft-string", {}, 0.01),
    ("spin-up", {}, 0.01),
    ("pendulum", {}, 0.01),
    ("roll-up", {}, None),
    ("bend-45", {}, None),
    ("horizontal-a", {}, 0.01),
    ("horizontal-b", {}, 0.01),
)


def warm_up(tell: Callable[[str], None] | None = None) -> None:
    """Compile the kernels of the built-in scenes into the cache; does nothing that takes time when they are there."""
    for name, overrides, until in _RUNS:
        if tell is not None:
            tell(name)
        scene = load_scene(name, overrides)
        simulate(scene, until=None if until is None else max(until, 2 * scene.time.step), warn=False)
