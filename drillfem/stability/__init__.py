"""Linear stability of steady drilling: transfer functions, characteristic roots, maps over speed and weight on bit."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from drillfem.stability.loop import UNSTABLE, DrillingLoop, Roots, pitch
    from drillfem.stability.maps import StabilityMap, confirm, stability_map
    from drillfem.stability.margin import Crossing, phase_crossings
    from drillfem.stability.timedomain import TimePoint
    from drillfem.stability.transfer import Oscillator, Waves, surface_delay

#: Public names and where they live; imported on first use, because scenes ask for roots and must load at once.
_HOME = {
    "UNSTABLE": "loop",
    "Crossing": "margin",
    "DrillingLoop": "loop",
    "Oscillator": "transfer",
    "Roots": "loop",
    "StabilityMap": "maps",
    "TimePoint": "timedomain",
    "Waves": "transfer",
    "confirm": "maps",
    "phase_crossings": "margin",
    "pitch": "loop",
    "stability_map": "maps",
    "surface_delay": "transfer",
}

__all__ = [
    "UNSTABLE",
    "Crossing",
    "DrillingLoop",
    "Oscillator",
    "Roots",
    "StabilityMap",
    "TimePoint",
    "Waves",
    "confirm",
    "phase_crossings",
    "pitch",
    "stability_map",
    "surface_delay",
]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(f".{_HOME[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
