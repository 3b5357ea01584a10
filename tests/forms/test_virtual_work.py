"""The section law and the named terms: the literal law loses stiffness, and every ansatz restricts the same terms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import ufl
from rodlab import Array, S, T, at, vec

from drillfem.forms import kinematics as k
from drillfem.forms import virtual_work as vw
from drillfem.forms.ansatz import Ansatz, ansatz
from drillfem.forms.constitutive import SECTION, Section, elastic_resultants
from drillfem.forms.wall import Wall, friction_coefficient

VALUES = dict(zip(SECTION, (2.0, 3.0, 50.0, 1.5, 2.5, 0.8, 1.2, 0.3, 0.4, 0.05, 0.1), strict=True))
SECTION_AT_A_POINT = Section(vec(*VALUES.values()))


def axial_force_of_a_tilted_section(angle: float, literal: bool) -> float:
    """Force along the section's normal per unit stretch."""
    R = k.rotation_about(2, ufl.as_ufl(angle))
    tilted = k.Configuration(R * vec(0, 0, S * 1.5), R, vec(0, 0, 0))
    n, _ = elastic_resultants(tilted, SECTION_AT_A_POINT, vec(0, 0, 0), literal)
    return float(at(n)[2]) / 0.5


@pytest.mark.parametrize("degrees", [0, 30, 60, 90])
def test_literal_law_loses_axial_stiffness_with_tilt(degrees: float) -> None:
    angle = math.radians(degrees)
    EA, GA = VALUES["axial"], VALUES["shear1"]
    expected = EA * math.cos(angle) ** 2 + GA * math.sin(angle) ** 2
    assert axial_force_of_a_tilted_section(angle, literal=True) == pytest.approx(expected, rel=1e-13)
    assert axial_force_of_a_tilted_section(angle, literal=False) == pytest.approx(EA, rel=1e-13)


def a_wall(velocity_scale: float = 5.0, regularisation: float = 1e-4) -> Wall:
    """A hole that bends in the plane x-z and widens, near the motions below."""
    numbers = (0.02, 0, 0.9, 0.05, 0, 1, 0.1, 0, 0, 0.15, 0.02, 0.3, 0.15, 7.0)
    return Wall(vec(*numbers), *(ufl.as_ufl(x) for x in (1e2, 1e-3, velocity_scale, regularisation)))


def test_friction_peaks_at_the_static_coefficient() -> None:
    wall = a_wall(velocity_scale=20.0, regularisation=1e-8)
    alpha = math.sqrt(0.3 * 0.15)
    v = np.linspace(0.5, 2.0, 301) * 0.3 / (alpha * 20.0)
    mu = np.array([float(at(friction_coefficient(ufl.as_ufl(x), wall))) * x for x in v])
    assert mu.max() == pytest.approx(0.3, rel=1e-5)
    assert v[np.argmax(mu)] == pytest.approx(0.3 / (alpha * 20.0), rel=1e-2)  # n v = mu_s/alpha
    assert float(at(friction_coefficient(ufl.as_ufl(1e3), wall))) * 1e3 == pytest.approx(0.15, rel=1e-3)


# -- one weak form, restricted ----------------------------------------
ANGLE = ufl.sin(2 * S + T)
R1, R3 = ufl.sin(S * T), S + T * ufl.cos(S) / 5


def pointwise(a: Ansatz, x: Any, v: Any, test: Any, literal: bool = False) -> dict[str, Array]:
    """Value at a point of the integrand of every term, along the motion x(S, T)."""
    n = len(a.x_names)
    dx = ufl.dx(domain=ufl.domain.extract_unique_domain(S))
    mass, inertia = ufl.as_ufl(0.7), ufl.as_ufl(0.2)
    end = vw.EndLoad(vec(0.2, 0, -0.7), vec(0, 0.4, 0), mass, inertia)
    straight = vec(0, 0, 0)
    wall = a_wall() if a.name in ("planar", "spatial") else None
    bit = vw.BitLoad(ufl.as_ufl(3.0), ufl.as_ufl(2.0))
    loads = vw.Loads(vec(1.0, 0, 9.0) if wall else vec(0, 0, 9.0), straight, end, end, bit, wall)
    on = vw.Measures(dx, dx, dx, dx, dx, dx)
    u = vec(*x, *v)
    u_dot = u.dx(1)
    test = vec(*(0 for _ in range(n)), *test)
    terms = vw.dynamic_terms(a, u, u_dot, test, S, SECTION_AT_A_POINT, loads, on, literal)
    terms.pop("kinematics")
    return {name: at(form.integrals()[0].integrand()) for name, form in terms.items()}


def turned(axis: int, angle: Any) -> Any:
    c, s = ufl.cos(angle / 2), ufl.sin(angle / 2)
    return vec(c, *(s if i + 1 == axis else 0 for i in range(3)))


def spatial(r: Any, axis: int, angle: Any, dr: tuple[Any, ...], dtheta: Any, literal: bool = False) -> dict[str, Array]:
    """The same motion and virtual motion for the spatial ansatz, with a quaternion that is not a unit one."""
    q = (1 + S * T) * turned(axis, angle)
    w = tuple(angle.dx(1) if i + 1 == axis else 0 for i in range(3))
    virtual = tuple(dtheta if i + 1 == axis else 0 for i in range(3))
    v = vec(*r).dx(1)
    return pointwise(ansatz("spatial"), vec(*r, *q), vec(v[0], v[1], v[2], *w), (*dr, *virtual), literal)


def assert_agree(one: dict[str, Array], other: dict[str, Array]) -> None:
    assert set(one) <= set(other)
    for name, value in one.items():
        np.testing.assert_allclose(value, other[name], atol=1e-12, err_msg=name)
        assert abs(value) > 1e-6, f"{name} is not exercised"


def test_planar_terms_are_the_spatial_ones() -> None:
    x, test = vec(R1, R3, ANGLE), (S, ufl.cos(S), ufl.exp(S))
    one = pointwise(ansatz("planar"), x, x.dx(1), test)
    assert_agree(one, spatial((R1, 0, R3), 2, ANGLE, (test[0], 0, test[1]), test[2]))


def test_axial_torsional_terms_are_the_spatial_ones() -> None:
    x, test = vec(R3, ANGLE), (ufl.cos(S), ufl.exp(S))
    one = pointwise(ansatz("axial-torsional"), x, x.dx(1), test)
    other = spatial((0, 0, R3), 3, ANGLE, (0, 0, test[0]), test[1])
    assert_agree({k: v for k, v in one.items() if k in other}, other)
    # about e3 the literal law cannot be told from the right one: both give the axial and the torsional work
    literal = spatial((0, 0, R3), 3, ANGLE, (0, 0, test[0]), test[1], literal=True)
    for name in ("internal force", "internal moment"):
        np.testing.assert_allclose(literal[name], one[name], atol=1e-12)


def test_torsional_terms_are_the_axial_torsional_ones() -> None:
    one = pointwise(ansatz("torsional"), vec(ANGLE), vec(ANGLE.dx(1)), (ufl.exp(S),))
    other = pointwise(ansatz("axial-torsional"), vec(S, ANGLE), vec(0, ANGLE.dx(1)), (0, ufl.exp(S)))
    for name in ("inertia", "internal moment", "damping", "top drive", "tip load", "bit"):
        np.testing.assert_allclose(one[name], other[name], atol=1e-13, err_msg=name)
