"""What mud does to a stretch of string, from diameters, density and viscosity. NumPy only; formulas: `forms/mud.py`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from drillfem.scene.scene import Scene

F8 = NDArray[np.float64]


def turning_drag(viscosity: float, radius: float, hole: float) -> float:
    """Torque per length and spin (N m s/rad per m) of Couette flow between ``radius`` and ``hole`` (m); Pa s."""
    return 4 * math.pi * viscosity * radius**2 * hole**2 / (hole**2 - radius**2)


def sliding_drag(viscosity: float, radius: float, hole: float) -> float:
    """Force per length and axial speed (N s/m per m) in an open annulus between ``radius`` and ``hole`` (m)."""
    return 2 * math.pi * viscosity / math.log(hole / radius)


def crossing_drag(viscosity: float, radius: float, hole: float) -> float:
    """Force per length and lateral speed (N s/m per m) in Stokes flow between ``radius`` and ``hole`` (m)."""
    narrow = (hole**2 - radius**2) / (hole**2 + radius**2)
    return 4 * math.pi * viscosity / (math.log(hole / radius) - narrow)


def added_mass(density: float, radius: float, inner: float, hole: float) -> float:
    """Fluid that moves across with a string (kg/m): around it, confined by ``hole``, and inside it; radii in m."""
    around = (hole**2 + radius**2) / (hole**2 - radius**2)
    return math.pi * density * (around * radius**2 + inner**2)


def mud_properties(scene: Scene, section: NDArray[np.int32], at: F8) -> F8:
    """Properties (n, 5) in the order of `forms.mud.MUD` of stretches of string, SI.

    section (n,): which section of the string; at (n,): measured depth of their middle at the start (m), where the hole
    is taken from: as far as mud is concerned, a string that drills stays where it was.
    """
    mud, hole = scene.mud, scene.borehole
    assert mud is not None
    moves = mud.viscosity > 0 or mud.added_mass
    around = hole.frame(at).radius if moves and hole is not None else np.full(len(at), np.inf)
    out = np.zeros((len(at), 5))
    for i, k in enumerate(section):
        s, wall = scene.string[k], float(around[i])
        r = s.outer_radius
        out[i, 0] = mud.density * s.area
        if mud.added_mass:
            out[i, 1] = added_mass(mud.density, r, s.inner_diameter / 2, wall)
        if mud.viscosity > 0:
            out[i, 2] = turning_drag(mud.viscosity, r, wall)
            out[i, 3] = sliding_drag(mud.viscosity, r, wall)
            out[i, 4] = crossing_drag(mud.viscosity, r, wall)
    return out
