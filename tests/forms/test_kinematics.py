"""Kinematics as written in the forms, against calculus: spec 1, acceptance test 1."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import ufl
from rodlab import Array, S, T, at, hamilton, vec
from scipy.spatial.transform import Rotation

from drillfem.forms import kinematics as k
from drillfem.forms.ansatz import Spatial, ansatz

ANSATZE = ("spatial", "planar", "axial-torsional", "torsional")


def fields(name: str, t: Any = T) -> Any:
    """Configuration fields of an ansatz, along the rod and in time; the quaternion's norm changes too."""
    r = vec(ufl.sin(S * t), S**2 * t, S + t * ufl.cos(S))
    q = vec(1 + S * t, ufl.sin(S + 2 * t), t * ufl.cos(3 * S), S**2 - t / 2)
    angle = ufl.sin(2 * S + t)
    return {
        "spatial": vec(*r, *q),
        "planar": vec(r[0], r[2], angle),
        "axial-torsional": vec(r[2], angle),
        "torsional": vec(angle),
    }[name]


POSITION, Q = (vec(*(fields("spatial")[i] for i in part)) for part in (range(3), range(3, 7)))


def spin(R: Array, rate: Array) -> Array:
    """Axial vector of R^T R-dot."""
    W = R.T @ rate
    return np.array([W[2, 1], W[0, 2], W[1, 0]])


@pytest.mark.parametrize("scale", [1e-3, 0.5, 1.0, 30.0])
def test_rotation_matrix_of_any_quaternion(scale: float) -> None:
    rng = np.random.default_rng(1)
    for q in rng.standard_normal((5, 4)):
        R = at(k.rotation_of_quaternion(vec(*(scale * q))))
        np.testing.assert_allclose(R, Rotation.from_quat(q[[1, 2, 3, 0]]).as_matrix(), atol=1e-14)
        a = rng.standard_normal(3)  # Hamilton: R a is the vector part of q a q*
        turned = hamilton(hamilton(vec(*q), vec(0, *a)), vec(q[0], *-q[1:]))
        np.testing.assert_allclose(at(turned)[1:] / (q @ q), R @ a, atol=1e-14)


def test_conical_motion_tells_material_from_spatial_angular_velocity() -> None:
    # precession alpha about e3, fixed tilt beta about e1, spin gamma about d3
    alpha, beta, gamma = 2.0, 0.6, 5.0

    def turn(axis: int, angle: ufl.core.expr.Expr) -> ufl.core.expr.Expr:
        return vec(ufl.cos(angle / 2), *(ufl.sin(angle / 2) if i == axis else 0 for i in range(3)))

    q = hamilton(hamilton(turn(2, alpha * T), turn(0, ufl.as_ufl(beta))), turn(2, gamma * T))
    t = 0.7
    material = np.array(
        [
            alpha * np.sin(beta) * np.sin(gamma * t),
            alpha * np.sin(beta) * np.cos(gamma * t),
            alpha * np.cos(beta) + gamma,
        ]
    )
    R = at(k.rotation_of_quaternion(q), t=t)
    np.testing.assert_allclose(at(k.material_rate_of_quaternion(q, q.dx(1)), t=t), material, atol=1e-14)
    np.testing.assert_allclose(at(k.quaternion_rate(q, vec(*material)), t=t), at(q.dx(1), t=t), atol=1e-14)
    # the literal reading puts spatial components into the same map: not this motion
    literal = at(k.quaternion_rate(q, vec(*(R @ material))), t=t) - at(q.dx(1), t=t)
    assert np.linalg.norm(literal) == pytest.approx(np.linalg.norm(R @ material - material) / 2)
    assert np.linalg.norm(literal) > 0.5
    # and cannot be told from the right one where the axis of rotation stays fixed
    q = turn(2, gamma * T)
    np.testing.assert_allclose(at(k.quaternion_rate(q, vec(0, 0, gamma))), at(q.dx(1)), atol=1e-14)


@pytest.mark.parametrize("direction", [0, 1])
def test_curvature_and_spin_from_the_quaternion_are_those_of_the_rotation(direction: int) -> None:
    R = k.rotation_of_quaternion(Q)
    found = at(k.material_rate_of_quaternion(Q, Q.dx(direction)))
    np.testing.assert_allclose(found, at(k.axial(R.T * R.dx(direction))), atol=1e-13)
    np.testing.assert_allclose(found, spin(at(R), at(R.dx(direction))), atol=1e-13)


@pytest.mark.parametrize("name", ANSATZE)
def test_strain_rates_are_the_time_derivative_of_the_strains(name: str) -> None:
    a, x = ansatz(name), fields(name)
    at_ = a.configuration(x, S)
    v_m, u_m = k.strains(at_)
    if name == "spatial":
        velocity = vec(*(x[i].dx(1) for i in range(3)), *k.material_rate_of_quaternion(Q, Q.dx(1)))
    else:
        velocity = x.dx(1)
    for rate, strain in zip(k.strain_rates(at_, a.twist(velocity, at_)), (v_m, u_m), strict=True):
        np.testing.assert_allclose(at(rate), at(strain.dx(1)), atol=1e-12)
    h = 1e-5  # and by finite differences, without UFL's calculus in time
    for rate, strain in zip(k.strain_rates(at_, a.twist(velocity, at_)), (v_m, u_m), strict=True):
        difference = (at(strain, t=0.7 + h) - at(strain, t=0.7 - h)) / (2 * h)
        np.testing.assert_allclose(at(rate), difference, atol=1e-8)


@pytest.mark.parametrize("name", ANSATZE)
def test_virtual_strains_are_directional_derivatives(name: str) -> None:
    a, x = ansatz(name), fields(name, 0.4)
    change = vec(*(ufl.cos((i + 1) * S + i) for i in range(len(a.x_names))))
    virtual = k.strain_rates(a.configuration(x, S), a.variation(change, x))
    varied = a.configuration(x + T * change, S)  # T now scales the variation
    for d, strain in zip(virtual, k.strains(varied), strict=True):
        np.testing.assert_allclose(at(d), at(strain.dx(1), t=0.0), atol=1e-12)


def test_drift_of_the_norm_changes_neither_rotation_nor_strains() -> None:
    drifted = (1 + S**2 + ufl.exp(T)) * Q
    for q in (Q, drifted):
        x = vec(*POSITION, *q)
        c = ansatz("spatial").configuration(x, S)
        found = (at(c.R), at(k.strains(c)[0]), at(c.u_m), at(k.material_rate_of_quaternion(q, q.dx(1))))
        if q is Q:
            expected = found
    for one, other in zip(expected, found, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-13)
    R = at(k.rotation_of_quaternion(drifted))
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-14)


def test_norm_correction_does_not_turn_the_section() -> None:
    a = ansatz("spatial")
    assert isinstance(a, Spatial)
    x, still = vec(*POSITION, *Q), vec(0, 0, 0, 0, 0, 0)
    correction = vec(*(a.rate(x, still)[i] for i in range(3, 7)))
    q = at(Q)
    np.testing.assert_allclose(at(correction), (1 - q @ q) * q, atol=1e-13)
    np.testing.assert_allclose(at(k.material_rate_of_quaternion(Q, correction)), 0, atol=1e-14)
    # the printed c q_m, with another section's quaternion, turns it: 2 c Im(q^-1 q_m)
    other = vec(1, 0, 0, 0)
    expected = at(hamilton(vec(q[0], *-q[1:]), other))[1:] * 2 / (q @ q)
    np.testing.assert_allclose(at(k.material_rate_of_quaternion(Q, other)), expected, atol=1e-14)
    assert np.linalg.norm(expected) > 0.1
