"""The motor of a top drive: a torque about the string's axis that follows the motion of the top (4-1), (B-1).

The forms know the top's angle from a reference on: two directors that whoever marches renews now and then. So the angle
is as many turns as there were, though a rotation knows it modulo 2 pi only, and its derivative is exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import ufl
from ufl.core.expr import Expr

from .kinematics import Configuration, Twist


@dataclass(frozen=True)
class Motor:
    """Torque k_p (speed - w) + k_i (error - turn) + masked w-dot, clipped to the limit.

    ``error``: angle that the integral lacks at the reference (rad); ``speed``: wanted (rad/s); ``proportional`` k_p
    (N m s/rad), ``integral`` k_i (N m/rad); ``masked``: inertia that the motor makes up for (kg m2); ``director1``,
    ``director2`` (3) of the reference. ``limit`` (N m) holds for the torque plus ``credit`` (N m), which is taken off
    again: an integrator that solves for a weighted mean has the limit hold for the mean. None: no limit.
    """

    error: Expr
    speed: Expr
    proportional: Expr
    integral: Expr
    masked: Expr
    director1: Expr
    director2: Expr
    limit: Expr | None = None
    credit: Expr | None = None

    def turn(self, x: Configuration) -> Expr:
        """Angle (rad, within half a turn) about d3 from the reference to where the top is."""
        d1, d2 = (ufl.as_vector([x.R[i, k] for i in range(3)]) for k in (0, 1))
        sine = ufl.dot(d1, self.director2) - ufl.dot(d2, self.director1)
        cosine = ufl.dot(d1, self.director1) + ufl.dot(d2, self.director2)
        return 2 * ufl.atan(sine / (cosine + ufl.sqrt(sine**2 + cosine**2)))

    def torque(self, x: Configuration, twist: Twist, rate: Twist) -> Expr:
        """Torque (N m) on the top about d3."""
        asked = self.integral * (self.error - self.turn(x)) + self.proportional * (self.speed - twist.w[2])
        asked = asked + self.masked * rate.w[2]
        if self.limit is None or self.credit is None:
            return asked
        return ufl.max_value(-self.limit, ufl.min_value(self.limit, asked + self.credit)) - self.credit


def motor(x: Configuration, twist: Twist, rate: Twist, virtual: Twist, drive: Motor) -> Expr:
    """Virtual work of the motor on the top, a load: it is on the left with a minus."""
    return -drive.torque(x, twist, rate) * virtual.w[2]
