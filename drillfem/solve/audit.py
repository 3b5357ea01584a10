"""What a run records, and its energy balance.

What comes in at the top and by gravity is stored, cut, rubbed or damped.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from ..results import STANDARD

Array = npt.NDArray[np.float64]

#: History variables of the audit: cumulative work since the start (J).
WORKS = {
    "work_top_drive": "work put in by the top drive",
    "work_gravity": "work of gravity",
    "work_hook_load": "work of the hook load and other end forces",
    "work_bit": "work taken by the rock",
    "dissipated": "work lost to internal damping and to mud",
    "work_wall": "work of contact and friction at the wall",
}
#: Part of the work at the wall that friction took; the rest is stored in the contact, and comes back.
FRICTION = "work_friction"

#: Part of the work of end forces that a mud motor did.
MOTOR = "work_motor"

_OF_THE_BIT = {name: v.units for name, v in STANDARD.items() if name.startswith("bit_") or name == "depth_of_cut"}
#: History variables of every run, and those that rock adds: name to unit.
COMMON = {name: v.units for name, v in STANDARD.items() if name not in _OF_THE_BIT}
DRILLING = _OF_THE_BIT | {"rock_volume": "m^3"}
TIP = {"tip_x": "m", "tip_y": "m", "tip_z": "m"}


#: of the lower end of a string that turns, and of a string in contact with its hole
TURNING = {name: _OF_THE_BIT[name] for name in ("bit_angular_speed", "bit_axial_speed", "bit_angle")}
#: of a bit that only resists being pushed, and of a mud motor
RESISTED = {name: _OF_THE_BIT[name] for name in ("bit_depth", "bit_axial_speed", "bit_weight")}
PUSHED = {"motor_force": "N", MOTOR: "J"}
WALL = {"side_force": "N", "wall_torque": "N m", "penetration": "m", FRICTION: "J"}


def variables(
    drilling: bool, turning: bool = False, wall: bool = False, resisted: bool = False, pushed: bool = False
) -> dict[str, str]:
    """History variables of a run, name to unit."""
    found = COMMON | dict.fromkeys(WORKS, "J") | (DRILLING if drilling else TIP)
    return (
        found
        | (TURNING if turning else {})
        | (WALL if wall else {})
        | (RESISTED if resisted else {})
        | (PUSHED if pushed else {})
    )


def imbalance(works: dict[str, Array], stored: Array, stored_at_start: float, scale: float) -> tuple[Array, float]:
    """Relative error of the energy balance at successive times (n,), and the scale it is relative to at the last one.

    works: cumulative works (n,) by the names of :data:`WORKS` (J); stored: kinetic and strain energy (n,). The scale is
    the largest energy in play so far; ``scale`` is what it was before.
    """
    fed = works["work_gravity"] + works["work_hook_load"]
    taken = works["work_bit"] + works["dissipated"] + works["work_wall"]
    drive = works["work_top_drive"]
    largest = np.max(np.abs([stored, drive, fed, taken]), axis=0)
    scales = np.maximum(np.maximum.accumulate(largest), scale)
    missing = np.abs(drive + fed - taken - (stored - stored_at_start))
    return missing / np.where(scales > 0, scales, 1.0), float(scales[-1])


@dataclass
class EnergyAudit:
    """Integrates powers by the trapezoidal rule over the times at which the integrator evaluated them."""

    stored_at_start: float
    time: float
    powers: dict[str, float]
    works: dict[str, float] = field(default_factory=dict)
    #: largest of stored energy and energy that went through, the scale of the error
    scale: float = 0.0

    def __post_init__(self) -> None:
        self.works = dict.fromkeys([*WORKS, *self.powers], 0.0) | self.works

    def add(self, time: float, powers: dict[str, float]) -> None:
        """Powers (W) at ``time`` (s): of drive, gravity and hook into the string, the others out of it."""
        half = (time - self.time) / 2
        for name, power in powers.items():
            self.works[name] += half * (power + self.powers[name])
        self.time, self.powers = time, powers

    def until(self, time: float) -> dict[str, float]:
        """Works (J) until ``time`` (s), which may lie behind the last evaluation by a part of a step."""
        return {name: work + (time - self.time) * self.powers[name] for name, work in self.works.items()}

    def error(self, stored: float, works_done: dict[str, float]) -> float:
        """Relative error of the balance when kinetic and strain energy are ``stored`` (J), after these works (J)."""
        works = {name: np.array([value]) for name, value in works_done.items()}
        error, self.scale = imbalance(works, np.array([stored]), self.stored_at_start, self.scale)
        return float(error[0])
