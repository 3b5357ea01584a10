"""Configuration, strains and strain rates of a Cosserat rod (chapter 2).

A cross-section is a point ``r(s, t)`` and a rotation ``R(s, t)`` whose columns are the directors. Every
function works for any ansatz: UFL differentiates whatever fields ``r`` and ``R`` are made of.
"""

from __future__ import annotations

from dataclasses import dataclass

import ufl
from ufl.core.expr import Expr

E3 = ufl.as_vector((0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Configuration:
    """Where the rod is: centreline ``r`` (3, m), rotation ``R`` (3x3), material curvature ``u_m`` (3, 1/m).

    ``p``: measured depth (m) of the hole's closest point, where that is an unknown of the rod.
    """

    r: Expr
    R: Expr
    u_m: Expr
    p: Expr | None = None


@dataclass(frozen=True)
class Twist:
    """A motion of the cross-section, actual or virtual.

    ``v``: velocity (or variation) of the centreline, spatial components (3).
    ``w``: angular velocity (or variation of the rotation), material components (3).
    """

    v: Expr
    w: Expr


def derivative(f: Expr) -> Expr:
    """Derivative with respect to the arc length s of the reference rod (zero for what lives on no mesh)."""
    return f.dx(0) if ufl.domain.extract_domains(f) else 0 * f


def axial(A: Expr) -> Expr:
    """Axial vector (3) of the skew part of a 3x3 matrix."""
    return ufl.as_vector((A[2, 1] - A[1, 2], A[0, 2] - A[2, 0], A[1, 0] - A[0, 1])) / 2


def configuration(r: Expr, R: Expr) -> Configuration:
    """Configuration with the curvature found by differentiation, [u_m]_x = R^T R' (2-76)."""
    return Configuration(r, R, axial(R.T * derivative(R)))


def rotation_about(axis: int, angle: Expr) -> Expr:
    """Rotation matrix (3x3) about the fixed axis ``e_axis`` (1, 2 or 3) by ``angle`` (rad)."""
    c, s = ufl.cos(angle), ufl.sin(angle)
    rows = {
        1: ((1, 0, 0), (0, c, -s), (0, s, c)),
        2: ((c, 0, s), (0, 1, 0), (-s, 0, c)),
        3: ((c, -s, 0), (s, c, 0), (0, 0, 1)),
    }
    return ufl.as_matrix(rows[axis])


def rotation_of_quaternion(q: Expr) -> Expr:
    """Rotation matrix of any nonzero quaternion q = (a, b, c, d), Hamilton convention.

    (2-18) with the factor 1/(q.q) that the thesis omits: without it R^T R = |q|^4 I as soon as |q| drifts.
    """
    a, b, c, d = (q[i] for i in range(4))
    return ufl.as_matrix(
        (
            (a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (a * c + b * d)),
            (2 * (a * d + b * c), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)),
            (2 * (b * d - a * c), 2 * (a * b + c * d), a * a - b * b - c * c + d * d),
        )
    ) / ufl.dot(q, q)


def _left_matrix(q: Expr) -> Expr:
    """The 3x4 matrix E(q) with Im(q* p) = E(q) p."""
    a, b, c, d = (q[i] for i in range(4))
    return ufl.as_matrix(((-b, a, d, -c), (-c, -d, a, b), (-d, c, -b, a)))


def material_rate_of_quaternion(q: Expr, dq: Expr) -> Expr:
    """Material rotation rate (3) along any derivative ``dq`` of the quaternion: 2 Im(q* dq)/|q|^2.

    With dq = q' it is the curvature u_m, with q-dot the angular velocity, with a variation the virtual rotation.
    """
    return 2 * _left_matrix(q) * dq / ufl.dot(q, q)


def quaternion_rate(q: Expr, w: Expr) -> Expr:
    """q-dot = 1/2 q (0, w), with **material** w: the map printed in (2-27)."""
    return _left_matrix(q).T * w / 2


def strains(x: Configuration) -> tuple[Expr, Expr]:
    """Material strain vectors v_m = R^T r' (shear, shear, 1 + stretch) and u_m (bending, bending, twist)."""
    return x.R.T * derivative(x.r), x.u_m


def strain_rates(x: Configuration, twist: Twist) -> tuple[Expr, Expr]:
    """Rates of (v_m, u_m) along a twist (spec 1.4), without differentiating R in time.

    v_m-dot = R^T v' + v_m x w and u_m-dot = w' + u_m x w. Along the actual motion these are the Kelvin-Voigt
    strain rates, along a virtual one the virtual strains of Appendix D: one function serves both.
    """
    v_m, u_m = strains(x)
    return x.R.T * derivative(twist.v) + ufl.cross(v_m, twist.w), derivative(twist.w) + ufl.cross(u_m, twist.w)
