"""What acts on the lower end along the string's axis e3 and no turning bit gives: chapter 7 (spec 10.2)."""

from __future__ import annotations

from dataclasses import dataclass

import ufl
from ufl.core.expr import Expr

from .kinematics import E3, Twist


@dataclass(frozen=True)
class Saturating:
    """Rock that resists with c1 (1 - exp(-c2 v)) where the end advances with v > 0, and lets go where it comes back.

    ``strength`` c1 (N), of the other sign where (7-5), (7-6) are taken as printed; ``rate`` c2 (s/m).
    """

    strength: Expr
    rate: Expr

    def resistance(self, speed: Expr) -> Expr:
        """Force (N) against the motion, of the speed along e3 (m/s)."""
        return self.strength * (1 - ufl.exp(-self.rate * ufl.max_value(0.0, speed)))


def resisted(twist: Twist, virtual: Twist, rock: Saturating) -> Expr:
    """Virtual work of that rock on the end (7-6)."""
    return rock.resistance(ufl.dot(E3, twist.v)) * ufl.dot(E3, virtual.v)


def push(virtual: Twist, force: Expr) -> Expr:
    """Virtual work of a force (N) on the end along e3, as a mud motor's (7-7): a load, on the left with a minus."""
    return -force * ufl.dot(E3, virtual.v)
