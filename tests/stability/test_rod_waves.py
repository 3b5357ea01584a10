"""BDF on undamped waves: from order 3 on they grow, order 1 kills them; and the guards that say so."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest
from rodfailures import growth

from drillfem.scene import Scene, load_scene
from drillfem.solve.guards import Method, warnings

PERIOD = 2 * math.pi / 20  # phase per step at 20 steps per period


def undamped(**time: Any) -> Scene:
    """The string of chapter 6 without damping, through PETSc."""
    keys = {f"time.{name}": value for name, value in time.items()}
    return load_scene("vertical-c1-cd5", {"material.retardation_time": 0.0, "time.engine": "petsc"} | keys)


def number(text: str, pattern: str) -> float:
    """The number in a warning where ``pattern`` has its group."""
    found = re.search(pattern, text)
    assert found, text
    return float(found.group(1))


@pytest.mark.parametrize("order, after", [(1, 0.390), (2, 0.962), (3, 1.045), (4, 1.006)])
def test_amplitude_that_a_period_of_20_steps_leaves(order: int, after: float) -> None:
    assert growth(PERIOD, integrator="bdf", order=order) ** 20 == pytest.approx(after, abs=1e-3)
    assert Method("bdf", order).amplification(1j * PERIOD) ** 20 == pytest.approx(after, abs=1e-3)


@pytest.mark.parametrize(
    "order, worst, most, end", [(3, 1.140, 1.0456, 1.936), (4, 1.862, 1.1910, 4.712), (5, 2.384, 1.3791, None)]
)
def test_growth_window_of_high_order_bdf(order: int, worst: float, most: float, end: float | None) -> None:
    assert growth(worst, integrator="bdf", order=order) == pytest.approx(most, abs=2e-3)
    assert Method("bdf", order).amplification(1j * worst) == pytest.approx(most, abs=1e-4)
    if end is not None:
        inside, outside = (growth(x * end, 60, 20, integrator="bdf", order=order) for x in (0.95, 1.05))
        assert inside > 1 > outside


@pytest.mark.parametrize(
    "keys",
    [
        {"integrator": "theta", "theta": 0.5},
        {"integrator": "theta", "theta": 1.0},
        {"integrator": "theta", "theta": 0.6},
        {"integrator": "generalized-alpha", "rho_infinity": 0.9},
        {"integrator": "generalized-alpha", "rho_infinity": 0.5},
        {"integrator": "bdf", "order": 2},
        {"integrator": "bdf", "order": 6},
    ],
    ids=lambda keys: "-".join(map(str, keys.values())),
)
def test_recurrences_of_the_guards_are_those_of_petsc(keys: dict[str, Any]) -> None:
    parameters = {name: value for name, value in keys.items() if name != "integrator"}
    method = Method(keys["integrator"], **parameters)
    assert growth(0.5, 60, 20, **keys) == pytest.approx(float(method.amplification(0.5j)), abs=2e-4)


def test_guard_names_the_wave_that_grows_and_by_how_much() -> None:
    (text,) = warnings(undamped(integrator="bdf", order=3))
    turn = 2 * math.pi * number(text, r"wave of ([\d.]+) Hz") * 1e-3
    percent = number(text, r"by ([\d.]+) % per step")
    assert 100 * (growth(turn, integrator="bdf", order=3) - 1) == pytest.approx(percent, rel=0.01)
    # the worst wave of the string lies at the top of the window: nothing grows faster
    assert percent == pytest.approx(4.56, abs=0.01)
    assert "order = 2" in text


@pytest.mark.parametrize("keys", [{"integrator": "bdf", "order": 1}, {"integrator": "theta", "theta": 1.0}])
def test_guard_says_what_backward_euler_leaves(keys: dict[str, Any]) -> None:
    (text,) = warnings(undamped(**keys))
    left = number(text, r"and ([\d.]+) % after one period of the passage")
    turn = 6 * 14.42 * 1e-3
    assert 100 * growth(turn, **keys) ** (2 * math.pi / turn) == pytest.approx(left, abs=0.1)
    assert left == pytest.approx(76.3, abs=0.1)
    # a wave under Kelvin-Voigt damping loses exp(-pi c omega) per period
    late = number(text, r"retardation time of ([\d.]+) s")
    assert 100 * math.exp(-math.pi * late * 6 * 14.42) == pytest.approx(left, abs=0.2)
    assert late == pytest.approx(1e-3, rel=0.01)


def test_damping_takes_waves_out_of_the_window() -> None:
    damped = load_scene("vertical-c1-cd2", {"time.engine": "petsc", "time.integrator": "bdf", "time.order": 3})
    assert warnings(damped) == []
    assert len(warnings(undamped(integrator="bdf", order=3))) == 1


@pytest.mark.parametrize(
    "keys", [{}, {"integrator": "bdf", "order": 2}, {"integrator": "theta"}, {"integrator": "arkimex", "order": 4}]
)
def test_guards_are_silent_where_waves_are_kept(keys: dict[str, Any]) -> None:
    assert warnings(undamped(**keys)) == []


def test_growth_is_that_of_the_fastest_vibration_at_any_damping() -> None:
    z = np.array([0.5j, -0.1 + 1.2j])
    assert Method("bdf", 3).amplification(z).shape == (2,)
    assert Method("theta", theta=1.0).amplification(z) == pytest.approx(1 / abs(1 - z))
