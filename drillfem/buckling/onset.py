"""The load at which a string in its hole loses its stability: where its static stiffness becomes singular."""

from __future__ import annotations

from typing import NamedTuple

from scipy.optimize import brentq

from ..compat import Array
from ..errors import SimulationError
from .column import Column

#: Ratio of one load to the last in the search, and relative accuracy of the load found.
STEP, ACCURACY = 1.05, 1e-7


class Onset(NamedTuple):
    """A critical load (N), the motion (nodes, 6) that meets no resistance there, and the equilibrium (flat)."""

    load: float
    motion: Array
    x: Array


def find_onset(column: Column, x: Array, start: float, end: float) -> Onset | None:
    """First load from ``start`` to ``end`` (N) under which the equilibrium that x is part of stops to be stable.

    Loads rise by a constant factor until the softest motion (`Column.softest`) has a negative stiffness; where it has
    none is found by interpolation. None if it stays stable up to ``end``. Raises SimulationError.
    """
    load = start
    x = column.equilibrium(x, load)
    if column.softest(x)[0] < 0:
        raise SimulationError(f"buckling: the string is not stable under {load / 1e3:.4g} kN: start lower")
    while load < end:
        after = min(load * STEP, end)
        y = column.equilibrium(x, after)
        if column.softest(y)[0] >= 0:
            load, x = after, y
            continue

        def stiffness(at: float, low: float = load, x: Array = x) -> float:
            column.push(low)
            return column.softest(column.equilibrium(x, at))[0]

        found = float(brentq(stiffness, load, after, xtol=ACCURACY * load, rtol=ACCURACY))
        column.push(load)
        x = column.equilibrium(x, found)
        return Onset(found, column.softest(x)[1], x)
    return None
