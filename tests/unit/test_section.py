"""Section stiffness: the thesis' numbers, the isotropic limit, integrated stresses."""

import math

import numpy as np
import pytest

from drillfem.errors import SceneError
from drillfem.scene import (
    Elasticity,
    Material,
    Scene,
    Section,
    Stiffness,
    annulus,
    load_scene,
    section_stiffness,
)
from drillfem.scene.keys import read

WOOD = Elasticity(C11=12e9, C12=5e9, C13=6e9, C22=9e9, C23=4e9, C33=40e9, C44=3e9, C55=4.5e9, C66=2e9)


def isotropic(youngs: float, poisson: float) -> Elasticity:
    shear = youngs / (2 * (1 + poisson))
    lame = youngs * poisson / ((1 + poisson) * (1 - 2 * poisson))
    p = lame + 2 * shear
    return Elasticity(C11=p, C12=lame, C13=lame, C22=p, C23=lame, C33=p, C44=shear, C55=shear, C66=shear)


def integrated(c: Elasticity, ro: float, ri: float, v: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Resultants (n1, n2, n3, m1, m2, m3) of the stresses for strains v - e3 and u, by quadrature.

    Strains D13, D23, E33 of (2-80); the lateral strains are solved for at each point from T11 = T22 = 0.
    """
    x, w = np.polynomial.legendre.leggauss(6)
    r, wr = ri + (ro - ri) * (x + 1) / 2, w * (ro - ri) / 2
    phi = 2 * np.pi * np.arange(24) / 24
    total = np.zeros(6)
    for radius, weight in zip(r, wr, strict=True):
        z1, z2 = radius * np.cos(phi), radius * np.sin(phi)
        d13, d23 = v[0] - u[2] * z2, v[1] + u[2] * z1
        e33 = v[2] - u[1] * z1 + u[0] * z2
        lateral = np.linalg.solve([[c.C11, c.C12], [c.C12, c.C22]], -np.array([[c.C13], [c.C23]]) * e33)
        t13, t23 = c.C55 * d13, c.C44 * d23
        t33 = c.C13 * lateral[0] + c.C23 * lateral[1] + c.C33 * e33
        each = np.array([t13, t23, t33, z2 * t33, -z1 * t33, z1 * t23 - z2 * t13])
        total += each.sum(axis=1) * weight * radius * 2 * np.pi / len(phi)
    return total


@pytest.mark.parametrize("elasticity", [WOOD, isotropic(210e9, 0.3), isotropic(5e6, 0.49)])
def test_stiffness_is_the_integral_of_the_stresses(elasticity: Elasticity) -> None:
    ro, ri = 0.0762, 0.028
    area, moment = annulus(2 * ro, 2 * ri)
    k = np.array(section_stiffness(elasticity.moduli(), area, moment, moment))
    columns = np.array([integrated(elasticity, ro, ri, e[:3], e[3:]) for e in np.eye(6)]).T
    np.testing.assert_allclose(np.diag(columns), k, rtol=1e-12)
    scale = np.sqrt(np.outer(k, k))
    assert np.abs(columns - np.diag(k)).max() <= 1e-12 * scale.max()  # nothing off the diagonal


def test_isotropic_limit_of_the_orthotropic_formulas() -> None:
    elasticity = isotropic(210e9, 0.3)
    assert elasticity.moduli() == pytest.approx((210e9, 210e9 / 2.6, 210e9 / 2.6), rel=1e-13)
    assert elasticity.lateral_factors() == pytest.approx((-0.3, -0.3), rel=1e-13)
    plain = Material(density=7800, youngs_modulus=210e9, poisson_ratio=0.3)
    orthotropic = Material(density=7800, elasticity=elasticity)
    assert orthotropic.moduli() == pytest.approx(plain.moduli(), rel=1e-13)


def test_lateral_stretches_of_the_thesis_free_the_lateral_stresses() -> None:
    k1, k2 = WOOD.lateral_factors()
    u1, u2, v3 = 0.3, -0.2, 0.01

    def e33(z1: float, z2: float) -> float:
        return v3 - u2 * z1 + u1 * z2

    def gamma(z1: float, z2: float) -> tuple[float, float]:
        return k1 * (e33(z1, z2) + u2 * z1 / 2), k2 * (e33(z1, z2) - u1 * z2 / 2)

    z1, z2, h = 0.04, -0.03, 1e-5
    g1, g2 = gamma(z1, z2)
    e11 = g1 + z1 * (gamma(z1 + h, z2)[0] - gamma(z1 - h, z2)[0]) / (2 * h)
    e22 = g2 + z2 * (gamma(z1, z2 + h)[1] - gamma(z1, z2 - h)[1]) / (2 * h)
    e = e33(z1, z2)
    assert WOOD.C11 * e11 + WOOD.C12 * e22 + WOOD.C13 * e == pytest.approx(0, abs=1e-9 * WOOD.C13 * abs(e))
    assert WOOD.C12 * e11 + WOOD.C22 * e22 + WOOD.C23 * e == pytest.approx(0, abs=1e-9 * WOOD.C23 * abs(e))


def test_numbers_of_the_thesis_string() -> None:
    pipe, collars = load_scene("vertical-c1-cd4").string
    assert (pipe.polar_moment, collars.polar_moment) == pytest.approx((1.218307e-5, 5.199350e-5), rel=1e-6)
    assert (pipe.area, collars.area) == pytest.approx((3.506803e-3, 1.577846e-2), rel=1e-6)
    assert pipe.section_stiffness().torsion / pipe.length == pytest.approx(938.096, abs=1e-3)
    assert collars.mass_per_length * collars.length == pytest.approx(24614.4, abs=0.05)
    assert pipe.mass_per_length == pytest.approx(7800 * pipe.area)
    assert pipe.rotary_inertia == pytest.approx(7800 * pipe.polar_moment / 2)
    assert pipe.section_stiffness().bending1 == pytest.approx(1.2792e6, rel=1e-4)
    assert pipe.retardation_time == 1e-4
    assert pipe.outer_radius == 0.0635


def test_shear_correction_acts_on_shear_only() -> None:
    one = Section("a", 1.0, 0.1, 0.05, Material(density=1, youngs_modulus=2.6, poisson_ratio=0.3))
    half = Section(
        "a", 1.0, 0.1, 0.05, Material(density=1, youngs_modulus=2.6, poisson_ratio=0.3, shear_correction=0.5)
    )
    k, c = one.section_stiffness(), half.section_stiffness()
    assert c[:2] == pytest.approx((k.shear1 / 2, k.shear2 / 2))
    assert c[2:] == k[2:]


def test_orthotropic_bar_tells_its_directions_apart() -> None:
    k = section_stiffness(WOOD.moduli(), area=2.0, moment1=3.0, moment2=5.0)
    axial = WOOD.moduli().axial
    assert k == pytest.approx((4.5e9 * 2, 3e9 * 2, axial * 2, axial * 3, axial * 5, 3e9 * 5 + 4.5e9 * 3))
    assert axial < WOOD.C33


def test_direct_stiffness() -> None:
    rod = Section("rod", 10.0, stiffness=Stiffness(2.8e7, 1e7, 1.4e4, 1e4), given_mass=1.2, given_inertia=6e-4)
    assert rod.section_stiffness() == (1e7, 1e7, 2.8e7, 1.4e4, 1.4e4, 1e4)
    assert (rod.mass_per_length, rod.rotary_inertia, rod.retardation_time, rod.outer_radius) == (
        1.2,
        6e-4,
        0,
        0,
    )
    assert (rod.area, rod.second_moment) == (0.0, 0.0)


def test_a_section_without_material_says_so() -> None:
    with pytest.raises(ValueError, match="material"):
        Section("bare", 1.0, 0.1).section_stiffness()


@pytest.mark.parametrize(("change", "key"), [({"C12": 20e9}, "C12"), ({"C33": 1e9}, "C33"), ({"C44": 0}, "C44")])
def test_unstable_material_is_refused(change: dict[str, float], key: str) -> None:
    data = {name: getattr(WOOD, name) for name in ("C11", "C12", "C13", "C22", "C23", "C33", "C44", "C55", "C66")}
    with pytest.raises(SceneError, match=f"material.elasticity.{key}"):
        read(Material, {"density": 1, "elasticity": data | change}, "material")


def test_orthotropic_scene_goes_round() -> None:
    data = load_scene("roll-up").to_dict()
    data["material"] = {
        "density": 500,
        "elasticity": {n: getattr(WOOD, n) for n in WOOD.__dataclass_fields__},
    }
    data["string"] = [{"name": "wood", "length": 10, "outer_diameter": 0.1}]
    scene = Scene.from_dict(data)
    assert scene.string[0].section_stiffness().axial == pytest.approx(WOOD.moduli().axial * math.pi * 0.05**2)
    assert Scene.from_dict(scene.to_dict()) == scene
