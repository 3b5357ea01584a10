"""drillfem: drill-strings as Cosserat rods that turn, rub and cut rock, on DOLFINx and PETSc.

>>> import drillfem
>>> scene = drillfem.load_scene("vertical-c1-cd4")
>>> result = drillfem.simulate(scene, until=1.0)      # doctest: +SKIP
>>> result.history["bit_angular_speed"]               # doctest: +SKIP
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from .results import Result, open_result
    from .scene import Scene, load_scene
    from .solve.run import resume, simulate

#: Public names and where they live; imported on first use so that `drillfem list` starts at once.
_HOME = {
    "Result": "results",
    "Scene": "scene",
    "load_scene": "scene",
    "open_result": "results",
    "resume": "solve.run",
    "simulate": "solve.run",
}

__all__ = ["Result", "Scene", "__version__", "load_scene", "open_result", "resume", "simulate"]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(f".{_HOME[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
