"""Section properties and the Kelvin-Voigt law of the rod (spec 3)."""

from __future__ import annotations

from dataclasses import dataclass

import ufl
from ufl.core.expr import Expr

from .kinematics import E3, Configuration, Twist, strain_rates, strains

#: What a cross-section is, in the order in which the coefficient field stores it. SI units.
SECTION = (
    "shear1",  # K_n,11 (N)
    "shear2",  # K_n,22 (N)
    "axial",  # K_n,33 (N)
    "bending1",  # K_m,11 (N m2)
    "bending2",  # K_m,22 (N m2)
    "torsion",  # K_m,33 (N m2)
    "mass",  # rho A (kg/m)
    "inertia1",  # rho I_1 (kg m)
    "inertia2",  # rho I_2 (kg m)
    "retardation",  # c_d (s)
    "contact_radius",  # r_ext, of what touches the wall (m)
)


@dataclass(frozen=True)
class Section:
    """Section properties as UFL expressions, read from a piecewise constant vector field."""

    field: Expr

    def __getitem__(self, name: str) -> Expr:
        return self.field[SECTION.index(name)]

    @property
    def K_n(self) -> Expr:
        """Stiffness of shear, shear and stretch (3x3, N), (2-110)."""
        return ufl.diag(ufl.as_vector((self["shear1"], self["shear2"], self["axial"])))

    @property
    def K_m(self) -> Expr:
        """Stiffness of bending, bending and twist (3x3, N m2)."""
        return ufl.diag(ufl.as_vector((self["bending1"], self["bending2"], self["torsion"])))

    @property
    def Theta(self) -> Expr:
        """Mass moments of inertia per length (3x3, kg m): rho diag(I_1, I_2, I_1 + I_2)."""
        i1, i2 = self["inertia1"], self["inertia2"]
        return ufl.diag(ufl.as_vector((i1, i2, i1 + i2)))


def elastic_resultants(x: Configuration, section: Section, u0: Expr, literal: bool = False) -> tuple[Expr, Expr]:
    """Elastic force and moment, material components (3, N) and (3, N m), (2-99)-(2-112).

    ``u0`` is the curvature of the stress-free rod. ``literal``: stiffness in front of spatial vectors as printed in
    (2-113), (2-114); right only when R turns about e3 (errata 14).
    """
    v_m, u_m = strains(x)
    if literal:
        n = section.K_n * (x.R * (v_m - E3))
        m = section.K_m * (x.R * (u_m - u0))
        return x.R.T * n, x.R.T * m
    return section.K_n * (v_m - E3), section.K_m * (u_m - u0)


def viscous_resultants(x: Configuration, twist: Twist, section: Section) -> tuple[Expr, Expr]:
    """Kelvin-Voigt force and moment c_d K v_m-dot, c_d K u_m-dot (2-115), material components; c_d in seconds."""
    dv, du = strain_rates(x, twist)
    c_d = section["retardation"]
    return c_d * section.K_n * dv, c_d * section.K_m * du
