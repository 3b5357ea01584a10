"""Drilling fluid around and inside the string: buoyancy, viscous drag, added mass.

The string is open below and full of the mud that stands around it. The fluid is at rest but for what the string moves;
drag is that of the laminar flow in a concentric annulus of outer radius r and hole radius R.

* Buoyancy: the fluid pressure on a stretch of string and the ends that a cut would have add up to minus the weight of
  the fluid that the steel displaces. With this load the internal axial force is the effective tension, the one that
  bends and buckles: the force in the steel less p_o A_o - p_i A_i.
* Turning: Couette flow, torque 4 pi mu w r^2 R^2/(R^2 - r^2) per length.
* Sliding along the axis: 2 pi mu v/ln(R/r) per length, for an annulus that is open at both ends.
* Moving across: Stokes flow past a cylinder in a concentric one that rests, 4 pi mu v/(ln(R/r) - (R^2 - r^2)/(R^2 +
  r^2)) per length (from the stream function (A rho^3 + B rho ln rho + C rho + D/rho) sin theta).
* Added mass across: rho pi r^2 (R^2 + r^2)/(R^2 - r^2) of the fluid around (potential flow; Fritz 1972), and the fluid
  inside, which goes along. Neither moves or turns with the string along and about its axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import ufl
from ufl.core.expr import Expr

from .kinematics import Configuration, Twist

#: What mud does to a stretch of string, in the order in which the coefficient field stores it. SI units.
MUD = (
    "displaced",  # fluid that the steel displaces (kg/m)
    "added",  # fluid that moves across with the string (kg/m)
    "turning",  # torque per spin (N m s/rad per m)
    "along",  # force along the axis per speed (N s/m per m)
    "across",  # force across it per speed (N s/m per m)
)


@dataclass(frozen=True)
class Mud:
    """Mud as UFL expressions, read from a piecewise constant field; ``moves``: with added mass, ``drags``: viscous."""

    field: Expr
    moves: bool
    drags: bool

    def __getitem__(self, name: str) -> Expr:
        return self.field[MUD.index(name)]


def buoyancy(virtual: Twist, mud: Mud, g: Expr) -> Expr:
    """Virtual work of the mud's pressure, per length: the weight that it takes off the string."""
    return mud["displaced"] * ufl.dot(g, virtual.v)


def drag(x: Configuration, twist: Twist, virtual: Twist, mud: Mud) -> Expr:
    """Virtual work of the viscous drag, per length."""
    d3 = ufl.as_vector([x.R[i, 2] for i in range(3)])
    along, moved = ufl.dot(twist.v, d3), ufl.dot(virtual.v, d3)
    across = ufl.dot(twist.v, virtual.v) - along * moved
    return mud["turning"] * twist.w[2] * virtual.w[2] + mud["along"] * along * moved + mud["across"] * across


def _across(v: Expr) -> Expr:
    return ufl.as_vector((v[0], v[1], 0))


def added_inertia(x: Configuration, twist: Twist, rate: Twist, virtual: Twist, mud: Mud) -> Expr:
    """Virtual work of the inertia of the added mass, per length: Kirchhoff's equations of a body in a fluid.

    With the momentum p = m_a (v_1, v_2, 0) in material components: force p-dot + w x p, moment v x p. So its power is
    the rate of the kinetic energy m_a (v_1^2 + v_2^2)/2, however the section turns.
    """
    v = x.R.T * twist.v
    p, p_dot = _across(v), _across(x.R.T * rate.v + ufl.cross(v, twist.w))
    force = ufl.dot(p_dot + ufl.cross(twist.w, p), x.R.T * virtual.v)
    return mud["added"] * (force + ufl.dot(ufl.cross(v, p), virtual.w))


def added_energy(x: Configuration, twist: Twist, mud: Mud) -> Expr:
    """Kinetic energy of the added mass, per length (J/m)."""
    v = x.R.T * twist.v
    return mud["added"] * (v[0] ** 2 + v[1] ** 2) / 2
