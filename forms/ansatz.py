"""The ansätze: which scalar fields are unknown, and how they give the state of the Cosserat rod.

The unknown is one vector field ``u = (configuration, velocity)``. An ansatz maps its configuration part to
(r, R) and its velocity part to a twist; rates and virtual motions go through the same map. The weak form in
:mod:`drillfem.forms.virtual_work` is written once and knows nothing of the ansatz.

| ansatz          | configuration      | velocity            | r, R                       |
|-----------------|--------------------|---------------------|----------------------------|
| spatial         | r (3), q (4)       | r-dot (3), w_m (3)  | r, R(q)                    |
| planar          | x, z, theta        | their rates         | (x, 0, z), R about e2      |
| axial-torsional | z, phi             | their rates         | (0, 0, z), R about e3      |
| torsional       | phi                | its rate            | (0, 0, s), R about e3      |

Where the hole's closest point is solved with the rod (D-6), its measured depth p is one more configuration field. It
has no velocity: an algebraic equation ties it to r.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import ufl
from ufl.core.expr import Expr

from .kinematics import (
    Configuration,
    Twist,
    configuration,
    material_rate_of_quaternion,
    quaternion_rate,
    rotation_about,
    rotation_of_quaternion,
)

#: Name of the measured depth of the closest point among the configuration fields: the last one of them.
DEPTH = "hole_depth"


@dataclass(frozen=True)
class Ansatz:
    """A restriction of the rod. ``x_names`` and ``v_names`` name the components of the unknown, in order."""

    name: str
    x_names: tuple[str, ...]
    v_names: tuple[str, ...]

    @property
    def size(self) -> int:
        """Number of scalar fields."""
        return len(self.x_names) + len(self.v_names)

    def split(self, u: Expr) -> tuple[Expr, Expr]:
        """Configuration part and velocity part of a field of this ansatz (also of a test function)."""
        n = len(self.x_names)
        return ufl.as_vector([u[i] for i in range(n)]), ufl.as_vector([u[i] for i in range(n, self.size)])

    def index(self, name: str) -> int:
        """Component of the unknown that carries this name."""
        return (self.x_names + self.v_names).index(name)

    @property
    def bare(self) -> Ansatz:
        """The same without the measured depth among its fields."""
        return replace(self, x_names=tuple(name for name in self.x_names if name != DEPTH))

    def depth(self, x: Expr) -> Expr | None:
        """Measured depth of the closest point (m) where it is among the configuration fields ``x`` (or their tests)."""
        return x[self.index(DEPTH)] if DEPTH in self.x_names else None

    def configuration(self, x: Expr, s: Expr) -> Configuration:
        """Configuration of the rod; ``s`` is the arc length of the reference rod."""
        raise NotImplementedError

    def twist(self, v: Expr, at: Configuration | None) -> Twist:
        """Twist of a velocity field, of its time derivative or of a test function."""
        raise NotImplementedError

    def variation(self, dx: Expr, x: Expr) -> Twist:
        """Virtual twist of a variation of the configuration fields (statics)."""
        raise NotImplementedError

    def virtual(self, test: Expr) -> Twist:
        """Virtual twist of a test function with as many components as the configuration (statics)."""
        return self.twist(test, None)

    def rate(self, x: Expr, v: Expr) -> Expr:
        """Time derivative of the configuration fields that belongs to a velocity field (not of the measured depth)."""
        return v

    def constraint(self, x: Expr, test: Expr) -> Expr | None:
        """What the configuration must satisfy besides equilibrium, tested with what :meth:`virtual` leaves over."""
        return None


class _Minimal(Ansatz):
    """Ansätze whose velocities are the plain rates of their configuration fields."""

    def variation(self, dx: Expr, x: Expr) -> Twist:
        return self.twist(dx, None)


class Planar(_Minimal):
    """Motion in the (e1, e3) plane, rotation about e2."""

    def configuration(self, x: Expr, s: Expr) -> Configuration:
        return replace(configuration(ufl.as_vector((x[0], 0, x[1])), rotation_about(2, x[2])), p=self.depth(x))

    def twist(self, v: Expr, at: Configuration | None) -> Twist:
        return Twist(ufl.as_vector((v[0], 0, v[1])), ufl.as_vector((0, v[2], 0)))


class AxialTorsional(_Minimal):
    """A straight string that stretches and twists."""

    def configuration(self, x: Expr, s: Expr) -> Configuration:
        return configuration(ufl.as_vector((0, 0, x[0])), rotation_about(3, x[1]))

    def twist(self, v: Expr, at: Configuration | None) -> Twist:
        return Twist(ufl.as_vector((0, 0, v[0])), ufl.as_vector((0, 0, v[1])))


class Torsional(_Minimal):
    """A straight string that only twists."""

    def configuration(self, x: Expr, s: Expr) -> Configuration:
        return configuration(ufl.as_vector((0, 0, s)), rotation_about(3, x[0]))

    def twist(self, v: Expr, at: Configuration | None) -> Twist:
        return Twist(ufl.as_vector((0, 0, 0)), ufl.as_vector((0, 0, v[0])))


@dataclass(frozen=True)
class Spatial(Ansatz):
    """The full rod; q need not be a unit quaternion.

    ``correction``: k (1/s) in q-dot = 1/2 q w + k(1 - q.q) q, which only restores the norm: it multiplies the
    local q and therefore never turns R (the spatial maximum q_m of (2-26) would).
    ``literal``: the thesis as printed, errata 2: the unknown angular velocity is called spatial and yet used as
    a material one in q-dot. The motion differs as soon as the axis of rotation moves.
    """

    correction: float = 1.0
    literal: bool = field(default=False)

    def configuration(self, x: Expr, s: Expr) -> Configuration:
        r, q = ufl.as_vector([x[i] for i in range(3)]), self.quaternion(x)
        return Configuration(r, rotation_of_quaternion(q), material_rate_of_quaternion(q, q.dx(0)), self.depth(x))

    @staticmethod
    def quaternion(x: Expr) -> Expr:
        """The quaternion (4) among the configuration fields."""
        return ufl.as_vector([x[i] for i in range(3, 7)])

    def twist(self, v: Expr, at: Configuration | None) -> Twist:
        w = ufl.as_vector([v[i] for i in range(3, 6)])
        if self.literal and at is not None:
            w = at.R.T * w
        return Twist(ufl.as_vector([v[i] for i in range(3)]), w)

    def variation(self, dx: Expr, x: Expr) -> Twist:
        dr = ufl.as_vector([dx[i] for i in range(3)])
        return Twist(dr, material_rate_of_quaternion(self.quaternion(x), self.quaternion(dx)))

    def virtual(self, test: Expr) -> Twist:
        # (dr, multiplier of the constraint, dtheta): virtual rotations are interpolated, as in dynamics
        return Twist(ufl.as_vector([test[i] for i in range(3)]), ufl.as_vector([test[i] for i in range(4, 7)]))

    def rate(self, x: Expr, v: Expr) -> Expr:
        q = self.quaternion(x)
        dq = quaternion_rate(q, ufl.as_vector([v[i] for i in range(3, 6)])) + self.correction * (1 - ufl.dot(q, q)) * q
        return ufl.as_vector([v[i] for i in range(3)] + [dq[i] for i in range(4)])

    def constraint(self, x: Expr, test: Expr) -> Expr:
        q = self.quaternion(x)
        return (ufl.dot(q, q) - 1) * test[3]


def ansatz(name: str, literal: bool = False, depth: bool = False) -> Ansatz:
    """The ansatz called ``name``: spatial, planar, axial-torsional or torsional.

    depth: with the measured depth of the closest point among its fields. Raises KeyError for any other name.
    """
    makers = {
        "spatial": lambda: Spatial(
            name,
            ("r1", "r2", "r3", "q_a", "q_b", "q_c", "q_d"),
            ("v1", "v2", "v3", "w1", "w2", "w3"),
            literal=literal,
        ),
        "planar": lambda: Planar(name, ("r1", "r3", "theta"), ("v1", "v3", "w2")),
        "axial-torsional": lambda: AxialTorsional(name, ("r3", "phi"), ("v3", "w3")),
        "torsional": lambda: Torsional(name, ("phi",), ("w3",)),
    }
    found = makers[name]()
    return replace(found, x_names=(*found.x_names, DEPTH)) if depth else found
