"""Energy balance of a run: what comes in at the top and by gravity is stored, cut, rubbed or damped."""

from __future__ import annotations

from dataclasses import dataclass, field

#: History variables of the audit: cumulative work since the start (J).
WORKS = {
    "work_top_drive": "work put in by the top drive",
    "work_gravity": "work of gravity",
    "work_hook_load": "work of the hook load and other end forces",
    "work_bit": "work taken by the rock",
    "dissipated": "work lost to internal damping",
    "work_wall": "work of contact and friction at the wall",
}


@dataclass
class EnergyAudit:
    """Integrates powers by the trapezoidal rule over the times at which the integrator evaluated them."""

    stored_at_start: float
    time: float
    powers: dict[str, float]
    works: dict[str, float] = field(default_factory=lambda: dict.fromkeys(WORKS, 0.0))
    #: largest of stored energy and energy that went through, the scale of the error
    scale: float = 0.0

    def add(self, time: float, powers: dict[str, float]) -> None:
        """Powers (W) at ``time`` (s): positive put energy in for drive, gravity and hook, take it out for the others."""
        half = (time - self.time) / 2
        for name, power in powers.items():
            self.works[name] += half * (power + self.powers[name])
        self.time, self.powers = time, powers

    def error(self, stored: float) -> float:
        """Relative error of the balance: missing energy over the largest energy in play."""
        w = self.works
        put_in = w["work_top_drive"] + w["work_gravity"] + w["work_hook_load"]
        taken = w["work_bit"] + w["dissipated"] + w["work_wall"]
        self.scale = max(
            self.scale, stored, abs(w["work_top_drive"]), abs(w["work_gravity"] + w["work_hook_load"]), abs(taken)
        )
        missing = put_in - taken - (stored - self.stored_at_start)
        return abs(missing) / self.scale if self.scale > 0 else 0.0
