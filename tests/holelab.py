"""A length of the thesis' drill pipe in a hole: scenes for tests of contact. Needs no DOLFINx."""

from __future__ import annotations

import math
from typing import Any

from drillfem.scene import Scene

#: The thesis' drill pipe.
PIPE = {"name": "drill pipe", "outer_diameter": 0.127, "inner_diameter": 0.108}
STEEL = {"youngs_modulus": 210e9, "shear_modulus": 77e9, "density": 7800}
AREA, SECOND = math.pi / 4 * (0.127**2 - 0.108**2), math.pi / 64 * (0.127**4 - 0.108**4)
EA, EI, GJ, MASS = 210e9 * AREA, 210e9 * SECOND, 77e9 * 2 * SECOND, 7800 * AREA
WEIGHT, RADIUS = MASS * 9.80665, 0.0635
HORIZONTAL = {"kind": "straight", "inclination": math.pi / 2}
VERTICAL = {"kind": "straight"}


def in_hole(
    hole: dict[str, Any],
    length: float,
    elements: int,
    clearance: float = 0.01,
    friction: tuple[float, float] = (0.0, 0.0),
    contact: dict[str, Any] | None = None,
    time: dict[str, Any] | None = None,
    ends: dict[str, Any] | None = None,
    **tables: Any,
) -> Scene:
    """A length of drill pipe in a hole, laid in it, held at the top; ``tables`` replace or add others."""
    law = {"stiffness": 1e6, "friction_static": friction[0], "friction_dynamic": friction[1]}
    data = {
        "string": [PIPE | {"length": length}],
        "material": STEEL,
        "model": "spatial",
        "hole": {"diameter": PIPE["outer_diameter"] + 2 * clearance, **hole},
        "contact": law | (contact or {}),
        "ends": {"top": "clamped", "bottom": "free"} | (ends or {}),
        "initial": {"state": "laid"},
        "mesh": {"elements": elements},
        "time": time or {"end": 1.0, "step": 1e-3},
    }
    return Scene.from_dict(data | tables)


def stepping(end: float, step: float, integrator: str, rho: float = 0.9) -> dict[str, Any]:
    """A time table: ``integrator`` is theta (the trapezoidal rule) or generalized-alpha."""
    table = {"end": end, "step": step, "integrator": integrator}
    return table | ({"rho_infinity": rho} if integrator == "generalized-alpha" else {})


def period(stiffness: float) -> float:
    """Period (s) of the pipe on the springs of its wall, 2 pi sqrt(rho A/k_s)."""
    return 2 * math.pi * math.sqrt(MASS / stiffness)
