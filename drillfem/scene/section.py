"""Cross-sections: area, moments, and the stiffness of a rod made of an isotropic or orthotropic material.

The stiffness is that of a section whose lateral stresses vanish, thesis (2-87)-(2-112): with
C33~ = C33 + C31 k1 + C32 k2 in the place of Young's modulus, k1 and k2 in the place of minus Poisson's ratio.
"""

# ruff: noqa: RUF009 (key() is dataclasses.field with a fixed set of metadata)
from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from drillfem.scene.keys import NOT_NEGATIVE, POSITIVE, Bound, key


class SectionStiffness(NamedTuple):
    """Diagonals of K_n = (shear1, shear2, axial) in N and K_m = (bending1, bending2, torsion) in N m2, in the
    frame of the directors d1, d2, d3 (2-109)-(2-112)."""

    shear1: float
    shear2: float
    axial: float
    bending1: float
    bending2: float
    torsion: float


class Moduli(NamedTuple):
    """What a rod feels of its material, in Pa: axial with free lateral faces, shear in planes 1-3 and 2-3."""

    axial: float
    shear1: float
    shear2: float


def annulus(outer_diameter: float, inner_diameter: float = 0.0) -> tuple[float, float]:
    """Area in m2 and second moment about a diameter in m4 of a ring; the polar moment is twice that."""
    ro, ri = outer_diameter / 2, inner_diameter / 2
    return math.pi * (ro**2 - ri**2), math.pi / 4 * (ro**4 - ri**4)


def section_stiffness(
    moduli: Moduli, area: float, moment1: float, moment2: float, shear_correction: float = 1.0
) -> SectionStiffness:
    """Stiffness of a section with moment1 = int zeta2^2 dA, moment2 = int zeta1^2 dA (2-103), (2-110).

    The thesis has no shear correction (2-109): it is 1 unless a scene gives one, and acts on shear only.
    """
    axial, shear1, shear2 = moduli
    return SectionStiffness(
        shear_correction * shear1 * area,
        shear_correction * shear2 * area,
        axial * area,
        axial * moment1,
        axial * moment2,
        shear2 * moment2 + shear1 * moment1,
    )


@dataclass(frozen=True)
class Elasticity:
    """Orthotropic stiffnesses in Pa, axis 3 along the rod; 44 is the shear 2-3, 55 the shear 1-3."""

    C11: float = key("stiffness across the rod, direction 1", "Pa", POSITIVE)
    C12: float = key("coupling of directions 1 and 2", "Pa")
    C13: float = key("coupling of direction 1 and the rod's axis", "Pa")
    C22: float = key("stiffness across the rod, direction 2", "Pa", POSITIVE)
    C23: float = key("coupling of direction 2 and the rod's axis", "Pa")
    C33: float = key("stiffness along the rod at held lateral faces", "Pa", POSITIVE)
    C44: float = key("shear modulus of the plane 2-3", "Pa", POSITIVE)
    C55: float = key("shear modulus of the plane 1-3", "Pa", POSITIVE)
    C66: float | None = key("shear modulus of the plane 1-2; a rod does not feel it", "Pa", POSITIVE, default=None)

    def check(self) -> Iterator[tuple[str, str]]:
        if self.C11 * self.C22 <= self.C12**2:
            yield "C12", f"must be smaller than sqrt(C11 C22) = {math.sqrt(self.C11 * self.C22):.4g} Pa"
        elif self.moduli().axial <= 0:
            yield "C33", "must be larger, the material is not stable (the matrix is not positive definite)"

    def lateral_factors(self) -> tuple[float, float]:
        """k1, k2: lateral per axial strain when lateral stresses vanish, (2-87)-(2-89); isotropic: -nu.

        They give gamma_1 = k1 (E33 + u2 zeta1/2), gamma_2 = k2 (E33 - u1 zeta2/2) of (2-93), (2-94).
        """
        d = self.C11 * self.C22 - self.C12**2
        return (
            (self.C12 * self.C23 - self.C13 * self.C22) / d,
            (self.C12 * self.C13 - self.C11 * self.C23) / d,
        )

    def moduli(self) -> Moduli:
        """Axial modulus C33~ of (2-97) and the shear moduli C55 (direction 1), C44 (direction 2)."""
        k1, k2 = self.lateral_factors()
        return Moduli(self.C33 + self.C13 * k1 + self.C23 * k2, self.C55, self.C44)


@dataclass(frozen=True)
class Material:
    """Linear elastic with Kelvin-Voigt damping: give youngs_modulus and one of shear_modulus, poisson_ratio,
    or the orthotropic elasticity."""

    density: float = key("mass per volume", "kg/m^3", POSITIVE)
    youngs_modulus: float | None = key(
        "Young's modulus E", "Pa", POSITIVE, default=None, default_text="required without elasticity"
    )
    shear_modulus: float | None = key(
        "shear modulus G", "Pa", POSITIVE, default=None, default_text="required with E, or nu"
    )
    poisson_ratio: float | None = key(
        "Poisson's ratio nu, in the place of G",
        "1",
        Bound("> -1 and <= 0.5", lambda x: -1 < x <= 0.5),
        default=None,
        default_text="see G",
    )
    elasticity: Elasticity | None = key("orthotropic stiffnesses, in the place of E and G", default=None)
    retardation_time: float = key(
        "Kelvin-Voigt time c_d: stress = C (strain + c_d strain rate)", "s", NOT_NEGATIVE, default=0.0
    )
    shear_correction: float = key(
        "factor on the shear stiffness (a thin tube has about 0.5)",
        "1",
        Bound("> 0 and <= 1", lambda x: 0 < x <= 1),
        default=1.0,
    )

    def check(self) -> Iterator[tuple[str, str]]:
        if self.elasticity is not None:
            for name in ("youngs_modulus", "shear_modulus", "poisson_ratio"):
                if getattr(self, name) is not None:
                    yield name, "must be left out where elasticity is given"
        elif self.youngs_modulus is None:
            yield "youngs_modulus", "must be given in Pa, or the table elasticity in its place"
        elif self.shear_modulus is None and self.poisson_ratio is None:
            yield "shear_modulus", "must be given in Pa, or poisson_ratio in its place"
        elif self.shear_modulus is not None and self.poisson_ratio is not None:
            yield "poisson_ratio", f"must be left out where shear_modulus = {self.shear_modulus:g} is given"

    def moduli(self) -> Moduli:
        """Axial and shear moduli in Pa."""
        if self.elasticity is not None:
            return self.elasticity.moduli()
        assert self.youngs_modulus is not None  # check() saw to it
        shear = self.shear_modulus
        if shear is None:
            assert self.poisson_ratio is not None
            shear = self.youngs_modulus / (2 * (1 + self.poisson_ratio))
        return Moduli(self.youngs_modulus, shear, shear)


@dataclass(frozen=True)
class Stiffness:
    """Section stiffness given directly, for benchmark rods."""

    axial: float = key("EA", "N", POSITIVE)
    shear: float = key("GA, both directions", "N", POSITIVE)
    bending: float = key("EI, both directions", "N m^2", POSITIVE)
    torsion: float = key("GJ", "N m^2", POSITIVE)


@dataclass(frozen=True)
class Section:
    """A piece of the string with one cross-section: a pipe of some material, or a direct stiffness."""

    name: str = key("what it is called in tables and pictures")
    length: float = key("length", "m", POSITIVE)
    outer_diameter: float | None = key(
        "outer diameter; with a direct stiffness it serves contact and pictures only",
        "m",
        POSITIVE,
        default=None,
        default_text="required without stiffness",
    )
    inner_diameter: float = key("inner diameter", "m", NOT_NEGATIVE, default=0.0)
    material: Material | None = key(
        "material of this section, in the place of [material]", default=None, default_text="[material]"
    )
    stiffness: Stiffness | None = key("section stiffness given directly, in the place of a material", default=None)
    given_mass: float | None = key(
        "mass per length; only with a direct stiffness",
        "kg/m",
        POSITIVE,
        default=None,
        default_text="required for dynamics",
        name="mass_per_length",
    )
    given_inertia: float | None = key(
        "rho I about a diameter (the polar one is twice it); only with a direct stiffness",
        "kg m",
        POSITIVE,
        default=None,
        default_text="required for dynamics",
        name="rotary_inertia",
    )
    given_retardation: float | None = key(
        "Kelvin-Voigt time c_d; only with a direct stiffness",
        "s",
        NOT_NEGATIVE,
        default=None,
        default_text="0",
        name="retardation_time",
    )
    contact_diameter: float | None = key(
        "diameter of what touches the wall: tool joints, a stabiliser",
        "m",
        POSITIVE,
        default=None,
        default_text="outer_diameter",
    )

    def check(self) -> Iterator[tuple[str, str]]:
        if self.stiffness is not None:
            if self.inner_diameter:
                yield "inner_diameter", "must be left out where stiffness is given"
            if self.material is not None:
                yield "material", "must be left out where stiffness is given"
            return
        if self.outer_diameter is None:
            yield "outer_diameter", "must be given in m, or the table stiffness in its place"
        elif self.inner_diameter >= self.outer_diameter:
            yield "inner_diameter", f"must be smaller than outer_diameter = {self.outer_diameter:g} m"
        for name, given in (
            ("mass_per_length", self.given_mass),
            ("rotary_inertia", self.given_inertia),
            ("retardation_time", self.given_retardation),
        ):
            if given is not None:
                yield name, "must be left out of a section without stiffness: it follows from the material"

    def _pipe(self) -> Material:
        if self.material is None:
            raise ValueError(f"section {self.name!r} has neither material nor what was asked for")
        return self.material

    @property
    def outer_radius(self) -> float:
        """Outer radius in m; 0 for a direct stiffness without outer_diameter."""
        return (self.outer_diameter or 0.0) / 2

    @property
    def contact_radius(self) -> float:
        """Radius in m of what touches the wall; 0 for a direct stiffness without outer_diameter."""
        return (self.contact_diameter or self.outer_diameter or 0.0) / 2

    @property
    def area(self) -> float:
        """Area of the cross-section in m2 (0 if only a stiffness is known)."""
        return annulus(self.outer_diameter, self.inner_diameter)[0] if self.outer_diameter else 0.0

    @property
    def second_moment(self) -> float:
        """I about a diameter in m4."""
        return annulus(self.outer_diameter, self.inner_diameter)[1] if self.outer_diameter else 0.0

    @property
    def polar_moment(self) -> float:
        """J = 2 I in m4."""
        return 2 * self.second_moment

    @property
    def mass_per_length(self) -> float:
        """rho A in kg/m; 0 where a direct stiffness comes without mass (statics)."""
        return (self.given_mass or 0.0) if self.stiffness else self._pipe().density * self.area

    @property
    def rotary_inertia(self) -> float:
        """rho I about a diameter in kg m; about the rod's axis it is twice that."""
        return (self.given_inertia or 0.0) if self.stiffness else self._pipe().density * self.second_moment

    @property
    def retardation_time(self) -> float:
        """Kelvin-Voigt time c_d in s."""
        return (self.given_retardation or 0.0) if self.stiffness else self._pipe().retardation_time

    def section_stiffness(self) -> SectionStiffness:
        """Stiffness in the frame of the directors (2-109)-(2-112)."""
        if self.stiffness is not None:
            s = self.stiffness
            return SectionStiffness(s.shear, s.shear, s.axial, s.bending, s.bending, s.torsion)
        material = self._pipe()
        return section_stiffness(
            material.moduli(), self.area, self.second_moment, self.second_moment, material.shear_correction
        )
