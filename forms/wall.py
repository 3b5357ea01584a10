"""The wall of the borehole: closest point, gap, contact and friction (chapter 4, spec 5).

Of the hole the forms know a quadratic piece about a point near the closest one, at every quadrature point: centre c,
tangent t = dc/dp and t' = d2c/dp2 in the measured depth p. The closest point on it lies at d = (r - c).t/(t.t -
t'.(r - c)) from c. Whoever evaluates the forms puts c at the closest point of the present r: then d = 0, the residual
is that of the true hole, and its derivative by d is the consistent one.

Where p is an unknown of the rod (the thesis' way, (D-6)), c is where the present p says, d = p - the depth of c, and
:func:`closest_point` is the equation that ties p to r.
"""

from __future__ import annotations

from dataclasses import dataclass

import ufl
from ufl.core.expr import Expr

from .kinematics import Configuration, Twist

#: What the forms know of the hole at a quadrature point, in the order in which the coefficient stores it. SI units.
WALL = (
    *("centre1", "centre2", "centre3"),  # c (m)
    *("tangent1", "tangent2", "tangent3"),  # t = dc/dp (1)
    *("second1", "second2", "second3"),  # d2c/dp2 (1/m)
    "hole_radius",  # (m)
    "radius_slope",  # d(hole radius)/dp (1)
    "friction_static",  # mu_s
    "friction_dynamic",  # mu_d
    "pressure",  # multiplier of the augmented Lagrangian (N/m)
)
#: What follows where the measured depth is an unknown: the depth of the centre, m.
DEPTH = len(WALL)


@dataclass(frozen=True)
class Hole:
    """A quadratic piece of the hole's centreline at every point; ``field`` carries the first nine of :data:`WALL`."""

    field: Expr

    def __getitem__(self, name: str) -> Expr:
        return self.field[WALL.index(name)]

    def _vector(self, name: str) -> Expr:
        return ufl.as_vector([self[f"{name}{i}"] for i in (1, 2, 3)])

    def advance(self, r: Expr, p: Expr | None = None) -> Expr:
        """Measured depth d (m) from the stored centre to the closest point of r (3), or to p where that is unknown."""
        if p is not None:
            return p - self.field[DEPTH]
        away, t = r - self._vector("centre"), self._vector("tangent")
        return ufl.dot(away, t) / (ufl.dot(t, t) - ufl.dot(self._vector("second"), away))

    def offset(self, r: Expr, p: Expr | None = None) -> Expr:
        """r_r = r - r_p (3, m): from the closest point of the centreline (4-4)."""
        d = self.advance(r, p)
        return r - self._vector("centre") - self._vector("tangent") * d - self._vector("second") * d**2 / 2

    def direction(self, r: Expr, p: Expr | None = None) -> Expr:
        """dr_p/dp (3) at the closest point."""
        return self._vector("tangent") + self._vector("second") * self.advance(r, p)

    def tangent(self, r: Expr, p: Expr | None = None) -> Expr:
        """Unit tangent (3) of the hole at the closest point."""
        t = self.direction(r, p)
        return t / ufl.sqrt(ufl.dot(t, t))


def closest_point(x: Configuration, test: Expr, hole: Hole) -> Expr:
    """r_r . t_p tested (D-6): the equation of the measured depth p where it is an unknown."""
    return ufl.dot(hole.offset(x.r, x.p), hole.direction(x.r, x.p)) * test


@dataclass(frozen=True)
class Wall(Hole):
    """Wall with contact and regularised Coulomb friction (4-5)-(4-11); ``field`` carries all of :data:`WALL`.

    ``stiffness`` k_s (N/m2); ``smoothing`` (m) of the method "smooth"; ``velocity_scale`` n (s/m); ``regularisation``
    eps. ``method``: penalty, smooth or augmented. ``projected``: friction along the wall only (else the literal,
    unprojected velocity). ``retardation`` (s): what presses is the penetration, and this times its rate; None: no rate.
    ``load`` (3, N/m): the wall presses with what of it points across the hole, always and everywhere, and the string
    lies still: springs k_s hold it on the centreline, to both sides (chapter 7, case B). None: it acts by penetration.
    """

    stiffness: Expr
    smoothing: Expr
    velocity_scale: Expr
    regularisation: Expr
    method: str = "penalty"
    projected: bool = True
    retardation: Expr | None = None
    load: Expr | None = None


def _contact(x: Configuration, radius: Expr, wall: Wall) -> tuple[Expr, Expr]:
    """Outward normal (3) and penetration (m, negative off the wall) of a string of this radius; no 0/0 on the axis."""
    offset = wall.offset(x.r, x.p)
    distance = ufl.sqrt(ufl.dot(offset, offset) + 1e-24)
    hole = wall["hole_radius"] + wall["radius_slope"] * wall.advance(x.r, x.p)
    return offset / distance, distance + radius - hole


def _closing(x: Configuration, v: Expr, normal: Expr, wall: Wall) -> Expr:
    """Rate of the penetration (m/s) along a velocity v (3), or its variation along a virtual one."""
    away, t = wall.offset(x.r, x.p), wall.direction(x.r, x.p)
    along = ufl.dot(t, v) / (ufl.dot(t, t) - ufl.dot(wall._vector("second"), away))
    return ufl.dot(normal, v) - wall["radius_slope"] * along


def _pressed(x: Configuration, twist: Twist, radius: Expr, wall: Wall) -> tuple[Expr, Expr]:
    """Outward normal (3) and normal force per length (N/m)."""
    if wall.load is not None:
        t = wall.tangent(x.r, x.p)
        across = wall.load - ufl.dot(wall.load, t) * t
        size = ufl.sqrt(ufl.dot(across, across) + 1e-24)
        return across / size, size
    normal, g = _contact(x, radius, wall)
    if wall.retardation is not None:
        g = g + wall.retardation * _closing(x, twist.v, normal, wall)
    return normal, wall_pressure(g, wall)


def wall_pressure(penetration: Expr, wall: Wall) -> Expr:
    """Normal force per length (N/m): k_s max(0, penetration) (4-5), (4-6), and its variants.

    "smooth" builds up quadratically within +-smoothing; "augmented" adds the multiplier before the cut-off.
    """
    k, g, width = wall.stiffness, penetration, wall.smoothing
    if wall.method == "smooth":
        begins = ufl.conditional(ufl.gt(g, -width), k * (g + width) ** 2 / (4 * width), 0.0)
        return ufl.conditional(ufl.gt(g, width), k * g, begins)
    if wall.method == "augmented":
        return ufl.max_value(0.0, wall["pressure"] + k * g)
    return k * ufl.max_value(0.0, g)


def wall_energy(x: Configuration, radius: Expr, wall: Wall) -> Expr:
    """Potential of the normal force, per length (J/m): its derivative along a motion is :func:`contact`."""
    _, g = _contact(x, radius, wall)
    k, width = wall.stiffness, wall.smoothing
    if wall.load is not None:
        return k * ufl.dot(wall.offset(x.r, x.p), wall.offset(x.r, x.p)) / 2
    if wall.method == "smooth":
        begins = ufl.conditional(ufl.gt(g, -width), k * (g + width) ** 3 / (12 * width), 0.0)
        return ufl.conditional(ufl.gt(g, width), k * (g**2 / 2 + width**2 / 6), begins)
    if wall.method == "augmented":
        return ufl.max_value(0.0, wall["pressure"] + k * g) ** 2 / (2 * k)
    return k * ufl.max_value(0.0, g) ** 2 / 2


def friction_coefficient(speed: Expr, wall: Wall) -> Expr:
    """mu-tilde = k_fr/|v_c| of (4-7), (4-9) (spec 5.3); its product with |v_c| peaks at friction_static."""
    n, mu_s, mu_d = wall.velocity_scale, wall["friction_static"], wall["friction_dynamic"]
    # rounding must not take the root below zero where both are equal
    alpha = ufl.sqrt(ufl.max_value(mu_s * (mu_s - mu_d), 0.0) + 1e-32)
    return (mu_d * ufl.sqrt(speed**2 + wall.regularisation / n**2) + 2 * alpha / n) / (speed**2 + 1 / n**2)


def contact(x: Configuration, twist: Twist, virtual: Twist, radius: Expr, wall: Wall) -> Expr:
    """Virtual work of the wall's normal force, per length (arm and force are parallel: no moment).

    Where the hole narrows the force has a part along it: both come from the one potential.
    """
    normal, force = _pressed(x, twist, radius, wall)
    if wall.load is not None:
        return ufl.dot(force * normal + wall.stiffness * wall.offset(x.r, x.p), virtual.v)
    return force * _closing(x, virtual.v, normal, wall)


def sliding(x: Configuration, twist: Twist, radius: Expr, normal: Expr) -> Expr:
    """Velocity (3, m/s) of the touching point of the string, v + w x (radius n)."""
    return twist.v + ufl.cross(x.R * twist.w, radius * normal)


def friction(x: Configuration, twist: Twist, virtual: Twist, radius: Expr, wall: Wall) -> Expr:
    """Virtual work of the wall friction on the touching point, per length (4-7)-(4-12)."""
    normal, force = _pressed(x, twist, radius, wall)
    v_c = sliding(x, twist, radius, normal)
    if wall.projected:
        v_c = v_c - ufl.dot(v_c, normal) * normal
    mu = friction_coefficient(ufl.sqrt(ufl.dot(v_c, v_c) + 1e-24), wall)
    return force * mu * ufl.dot(v_c, sliding(x, virtual, radius, normal))


def steady_friction(
    x: Configuration, virtual: Twist, radius: Expr, wall: Wall, coefficient: Expr, speed: Expr, spin: Expr
) -> Expr:
    """Virtual work of the wall friction on a string that slides steadily as a whole, per length.

    ``speed`` along the hole (down is positive, m/s) and ``spin`` about it (rad/s) give the direction in which every
    touching point slides; only their ratio counts. ``coefficient``: friction over normal force.
    """
    normal, g = _contact(x, radius, wall)
    t = wall.tangent(x.r, x.p)
    along = (speed * t + spin * radius * ufl.cross(t, normal)) / ufl.sqrt(speed**2 + (spin * radius) ** 2)
    return coefficient * wall_pressure(g, wall) * ufl.dot(along, sliding(x, virtual, radius, normal))
