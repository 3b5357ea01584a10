"""A top drive that follows the speed (`drillfem.models.drive`), at the top of a rod: what the forms read of it and what
it remembers.

The forms hold its torque (`drillfem.forms.drive`). Between the steps of an integrator it is told where the top is: it
counts the turns, which the rotation of the top does not know, and keeps what the integral has left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import dolfinx
import numpy as np

from ..compat import Array
from ..forms.drive import Motor
from ..scene import Scene
from .drive import DriveLaw, response, slip, wanted

#: stands for no limit: a torque beyond all motors (N m)
_NONE = 1e30


class TopTorque:
    """The motor of a scene's top drive. ``motor``: what the forms read; ``law``: its numbers."""

    def __init__(self, scene: Scene, law: DriveLaw, constant: Callable[[Any], dolfinx.fem.Constant]) -> None:
        self.law, self._wanted = law, scene.top_drive.motion
        limited = math.isfinite(law.limit)
        self.motor = Motor(
            error=constant(0.0),
            speed=constant(0.0),
            proportional=constant(law.proportional),
            integral=constant(law.integral),
            masked=constant(law.masks * law.inertia),
            director1=constant((1.0, 0.0, 0.0)),
            director2=constant((0.0, 1.0, 0.0)),
            limit=constant(law.limit) if limited else None,
            credit=constant(0.0) if limited else None,
        )
        #: share of the end of a step in its mean, where the equations hold for the mean of start and end; else 1
        self.share = 1.0
        self._begins = scene.time.start
        #: at the last accepted step: time (s), angle since the start and what the integral left out (rad), spin (rad/s)
        self.time, self.counted, self.speed = self._begins, 0.0, 0.0
        #: of the last step: work done (J), mean acceleration (rad/s2), what its end made the integral leave out (rad)
        self.work, self._acceleration, self._late = 0.0, 0.0, 0.0
        self._directors: Array = np.eye(3)

    def begin(self, rotation: Array, speed: float, torque: float | None) -> None:
        """Start with the top at a rotation (3, 3) and a spin (rad/s); ``torque`` (N m) the drive gives there, if it can
        (None: the integral starts empty)."""
        law = self.law
        self._refer(rotation)
        self.time, self.counted, self.speed = self._begins, 0.0, speed
        if torque is not None and law.integral > 0.0:
            self.counted = -(torque - law.proportional * (self._wanted(self.time)[1] - speed)) / law.integral
        self._acceleration = self._late = 0.0

    def _refer(self, rotation: Array) -> None:
        self._directors = rotation.copy()
        self.motor.director1.value[:] = rotation[:, 0]
        self.motor.director2.value[:] = rotation[:, 1]

    def _errors(self, t: float) -> tuple[float, float]:
        """Angle (rad) that the integral lacks at the last accepted rotation, wanted speed (rad/s), at time t (s)."""
        angle, speed, _ = self._wanted(t)
        return angle - self._wanted(self._begins)[0] - self.counted, speed

    def at(self, t: float) -> None:
        """Let the forms have the drive of time t (s)."""
        law, m = self.law, self.motor
        m.error.value, m.speed.value = self._errors(t)
        if m.limit is None or m.credit is None or law.masks == 0.0 or self.share == 1.0:
            return
        # the torque depends on the acceleration, which is that of the step: the limit holds for the mean
        if t <= self.time:
            m.limit.value, m.credit.value = _NONE, 0.0
        else:
            error, speed = self._errors(self.time)
            m.limit.value = law.limit / self.share
            m.credit.value = (1 / self.share - 1) * wanted(law, error, speed - self.speed, 0.0)

    def turn(self, rotation: Array) -> float:
        """Angle (rad, within half a turn) from the last accepted rotation of the top to this one (3, 3)."""
        (d1, d2, _), (e1, e2, _) = rotation.T, self._directors.T
        return math.atan2(d1 @ e2 - d2 @ e1, d1 @ e1 + d2 @ e2)

    def accept(self, t: float, rotation: Array, speed: float) -> None:
        """A step has ended at time t (s), the top at this rotation (3, 3) and spin (rad/s)."""
        law, step = self.law, t - self.time
        error, wanted_speed = self._errors(self.time)
        asked = [wanted(law, error, wanted_speed - self.speed, 0.0)]
        self._acceleration = (speed - self.speed) / step
        self.counted += self.turn(rotation)
        error, wanted_speed = self._errors(t)
        asked += [wanted(law, error, wanted_speed - speed, 0.0)]
        self._late = slip(law, error, wanted_speed - speed, self._acceleration, step)
        self.counted += self._late
        if self._books:
            share = 0.5 if self.share == 1.0 else self.share
            if law.masks == 0.0:
                asked = [min(max(torque, -law.limit), law.limit) for torque in asked]
            mean = (1 - share) * asked[0] + share * asked[1] + law.masks * law.inertia * self._acceleration
            self.work = min(max(mean, -law.limit), law.limit) * step * (self.speed + speed) / 2
        self.time, self.speed = t, speed
        self._refer(rotation)

    def torque(self) -> float:
        """Torque (N m) at the last accepted step."""
        error, speed = self._errors(self.time)
        return float(response(self.law, error + self._late, speed - self.speed, self._acceleration)[0])

    @property
    def _books(self) -> bool:
        """Whether the work is that of the mean torque of a step: of integrators that take the mean, or of a masked
        inertia, whose rate of change is known no better. Else it follows from the power where they evaluate it."""
        return self.share != 1.0 or self.law.masks > 0.0

    def power(self, t: float, rotation: Array, speed: float) -> float:
        """Power (W) with the top like this at time t (s) in the last step; 0 where its ``work`` is counted instead."""
        if self._books:
            return 0.0
        error, wanted_speed = self._errors(t)
        error += self._late - self.turn(rotation)
        return float(response(self.law, error, wanted_speed - speed, 0.0)[0]) * speed

    def save(self) -> dict[str, float]:
        """State for a checkpoint."""
        names = ("time", "counted", "speed", "_acceleration", "_late")
        return {name: float(getattr(self, name)) for name in names}

    def load(self, state: dict[str, Any], rotation: Array) -> None:
        """Restore a state of :meth:`save`, with the top at this rotation (3, 3)."""
        for name, value in state.items():
            setattr(self, name, float(value))
        self._refer(rotation)
