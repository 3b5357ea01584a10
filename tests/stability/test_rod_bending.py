"""What fails where a rod bends and turns in space: locking, drifting quaternions, the trapezoidal rule."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rodfailures import bending_ratio, pipe_cantilever, spin_up, spinning, spinning_scene

from drillfem.scene import load_scene
from drillfem.solve.guards import locking_factor, quaternion_norm, warnings

EULER = {"integrator": "theta", "theta": 1.0}
SPEED = 100 * math.pi / 30


# -- shear locking ----------------------------------------
@pytest.mark.parametrize("size, factor", [(1.0, 10.32), (2.0, 38.29), (12.5, 1458.0)])
def test_linear_elements_fully_integrated_lock(size: float, factor: float) -> None:
    assert bending_ratio(size) == pytest.approx(factor, rel=1e-3)
    scene = pipe_cantilever(size, 1, "full")
    assert locking_factor(scene) == pytest.approx(bending_ratio(size), rel=1e-6)
    (text,) = warnings(scene)
    assert f"{locking_factor(scene):.4g} times too stiff" in text


@pytest.mark.parametrize("degree, quadrature", [(1, "reduced"), (2, "full"), (3, "reduced")])
def test_what_does_not_lock(degree: int, quadrature: str) -> None:
    assert bending_ratio(12.5, degree, quadrature) == pytest.approx(1.0, abs=1e-6)
    assert warnings(pipe_cantilever(12.5, degree, quadrature)) == []


# -- quaternions ----------------------------------------
def test_norm_of_a_spinning_quaternion_drifts_per_step() -> None:
    h, steps = 0.01, 100
    x = SPEED * h / 2
    euler = spinning(h, steps, 0.0, **EULER)
    assert euler[-1] == pytest.approx((1 + x**2) ** -steps, rel=1e-9)
    assert math.log(euler[-1]) * 100 == pytest.approx(-27, abs=0.5)  # in 100 s
    assert spinning(h, steps, 0.0, integrator="theta")[-1] == pytest.approx(1.0, abs=1e-12)
    # explicit Euler is not offered: it grows as fast
    q = np.array([1.0, 0, 0, 0])
    for _ in range(steps):
        q = q + x * np.array([-q[3], q[2], -q[1], q[0]])
    assert q @ q == pytest.approx((1 + x**2) ** steps, rel=1e-12)


@pytest.mark.parametrize("step, speaks", [(0.01, False), (0.05, True)])
def test_correction_stops_the_drift_where_the_guard_says(step: float, speaks: bool) -> None:
    steps = round(8 / step)
    scene = spinning_scene(step, steps, **EULER)
    norm = quaternion_norm(scene)
    assert spinning(step, steps, 1.0, **EULER)[-1] == pytest.approx(norm, rel=0.05)
    said = [text for text in warnings(scene) if "quaternions" in text]
    assert len(said) == speaks
    assert not speaks or f"{norm:.3g}" in said[0]


def test_a_long_step_lets_the_quaternions_die_out() -> None:
    scene = spinning_scene(0.1, 200, **EULER)
    assert quaternion_norm(scene) < 0
    assert any("die out" in text for text in warnings(scene))
    assert spinning(0.1, 200, 1.0, **EULER)[-1] < 0.02
    # and it does not with a method that turns them without loss
    assert spinning(0.1, 50, 1.0, integrator="theta")[-1] == pytest.approx(1.0, abs=1e-9)
    assert quaternion_norm(spinning_scene(0.1, 50, integrator="theta")) == pytest.approx(1.0, abs=1e-12)


# -- large rotation ----------------------------------------
def test_trapezoidal_rule_breaks_down_in_large_rotation() -> None:
    rows, why = spin_up("theta")
    assert "breaks down" in why and rows[-1, 0] < 15
    assert rows[-1, 2] > 1e3 * 7e3  # it has blown up: steady rotation holds 7 kJ
    rows, why = spin_up("generalized-alpha")
    assert why == "" and rows[-1, 0] == pytest.approx(15.0)
    assert rows[-1, 2] == pytest.approx(7.2e3, rel=0.1)


def test_guard_against_the_trapezoidal_rule_in_large_rotation() -> None:
    keys = {"time.end": 15.0, "time.step": 0.02, "output.interval": 0.02, "mesh.elements": 4}
    (text,) = warnings(load_scene("spin-up", keys | {"time.integrator": "theta"}))
    assert "turns by 45 rad" in text  # 6 rad/s, reached in 15 s
    for integrator in ("generalized-alpha", "arkimex", "default"):
        assert warnings(load_scene("spin-up", keys | {"time.integrator": integrator})) == []
