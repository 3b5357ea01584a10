"""The lumped model of the thesis' string, built by hand: as a condensed string and as a delay equation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from bitlab import C1

from drillfem.bitrock import BitLaw, RockSurface
from drillfem.bitrock.delay import LumpedBit
from drillfem.solve.condensed import Channel, CondensedString

STIFFNESS, INERTIA, MASS = 938.096, 112.786, 24614.4  # spec 8.4
WEIGHT, SPEED = 45.7e3, 14.42
#: nearly no wear flats: what pushes such a bit up lifts it off
SHARP: dict[str, Any] = {"law": {"wear_flat_length": 1e-4}, "weight": 16e3}
UNEQUAL = [0.0, 0.9, 2.1, 3.0, 4.4, 5.3]


def lumped_string(
    step: float,
    scheme: str = "profile",
    *,
    law: dict[str, Any] | None = None,
    weight: float = WEIGHT,
    mass: float = MASS,
    inertia: float = INERTIA,
    spin: float = 0.1,
    axial_speed: float | None = None,
    top: Callable[[Any], Any] | None = None,
    blade_angles: list[float] | None = None,
    **surface: Any,
) -> CondensedString:
    """Steady drilling, the bit turning faster by the fraction ``spin``, and sinking with ``axial_speed`` if given."""
    bit = BitLaw(**C1 | (law or {}))
    cut = bit.depth_of_cut(weight)
    rock = RockSurface(scheme, bit.blades, blade_angles, incline=-cut / (2 * np.pi), **surface)
    spring = STIFFNESS * np.array([[1.0, -1.0], [-1.0, 1.0]])
    axial = Channel(np.array([[mass]]), np.zeros((1, 1)), np.zeros((1, 1)), 0, 0, np.array([weight]))
    torsion = Channel(np.diag([0.0, inertia]), 0 * spring, spring, 1, 0)
    string = CondensedString(axial, torsion, bit, rock, step, hook_load=0.0, top=SPEED if top is None else top)
    u, twist = string.nominal()
    v = cut * SPEED / (2 * np.pi) if axial_speed is None else axial_speed
    string.reset(u, np.array([v]), twist, np.array([SPEED, SPEED * (1 + spin)]))
    return string


def lumped_bit(
    *, law: dict[str, Any] | None = None, weight: float = WEIGHT, spin: float = 0.1, top: Any = None
) -> LumpedBit:
    """The same as a delay equation."""
    bit = LumpedBit.steady(
        mass=MASS,
        inertia=INERTIA,
        stiffness=STIFFNESS,
        weight_on_bit=weight,
        law=BitLaw(**C1 | (law or {})),
        speed=SPEED,
        perturbation=spin,
    )
    return bit if top is None else LumpedBit(**{**vars(bit), "top": top})


def reversing_top(t: Any) -> tuple[Any, Any]:
    """A top that drills for half a second and then turns to and fro: the bit is wound backwards."""
    late = np.maximum(np.asarray(t) - 0.5, 0.0)
    return SPEED * (np.minimum(t, 0.5) + np.sin(2.5 * late) / 2.5), SPEED * np.cos(2.5 * late)
