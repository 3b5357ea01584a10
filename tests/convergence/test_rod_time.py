"""Orders in time of every integrator offered, and what each does to an undamped wave."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from rodlab import Array, bar, dynamic, order, put, stepped, take

from drillfem.models.modes import natural_frequencies
from drillfem.models.rod import Rod
from drillfem.solve.dynamics import march


@cache
def shaft() -> tuple[Rod, float, Array]:
    """An undamped shaft, its first angular frequency and shape: phi = shape cos(omega t) is exact for its mesh."""
    rod = Rod(
        bar(
            1.0,
            axial=1.0,
            torsion=1.0,
            inertia=0.5,
            model="axial-torsional",
            mesh={"elements": 4},
            time=dynamic(1e3, 0.1),
        )
    )
    mode = natural_frequencies(rod, 1)["torsional"]
    shape = mode.shape[0, :, rod.ansatz.v_names.index("w3")]
    return rod, 2 * math.pi * mode.frequency[0], shape / shape[-1]


def swing(per_period: int, periods: float, **integrator: Any) -> Array:
    """Rows (t, angle, spin/omega, size of the whole state) of the free end, from full deflection."""
    rod, omega, shape = shaft()
    period, rows = 2 * math.pi / omega, []

    def observe(t: float, u: Array) -> None:
        rows.append((t, take(rod, u, "phi")[-1], take(rod, u, "w3")[-1] / omega, abs(u).max()))

    march(rod, put(rod, phi=shape), periods * period, stepped(rod.scene, period / per_period, **integrator), observe)
    return np.array(rows)


def error(per_period: int, **integrator: Any) -> float:
    omega = shaft()[1]
    t, angle, spin, _ = swing(per_period, 1.0, **integrator)[-1]
    return math.hypot(angle - math.cos(omega * t), spin + math.sin(omega * t))


def amplitude(**integrator: Any) -> float:
    """Amplitude after a period over that before, at 20 steps per period, once the start-up is over."""
    rows = swing(20, 5.0, **integrator)
    size = np.hypot(rows[:, 1], rows[:, 2])
    return float((size[100] / size[20]) ** 0.25)


@pytest.mark.parametrize(
    ("integrator", "expected", "steps"),
    [
        ({}, 2, (40, 80, 160)),
        ({"integrator": "generalized-alpha", "rho_infinity": 0.5}, 2, (40, 80, 160)),
        ({"integrator": "theta", "theta": 0.5}, 2, (40, 80, 160)),
        ({"integrator": "theta", "theta": 1.0}, 1, (320, 640, 1280)),
        ({"integrator": "bdf", "order": 1}, 1, (320, 640, 1280)),
        ({"integrator": "bdf", "order": 2}, 2, (80, 160, 320)),
        # PETSc starts BDF at first order: what the start leaves behind is of second order, whatever comes after
        ({"integrator": "bdf", "order": 4}, 2, (40, 80, 160)),
        ({"integrator": "arkimex", "order": 2}, 2, (20, 40, 80)),
        ({"integrator": "arkimex", "order": 3}, 3, (20, 40, 80)),
        ({"integrator": "arkimex", "order": 4}, 4, (20, 40, 80)),
        ({"integrator": "arkimex", "order": 5}, 5, (10, 20, 40)),
    ],
    ids=lambda x: "-".join(map(str, x.values())) or "default" if isinstance(x, dict) else "",
)
def test_order_in_time(integrator: dict[str, Any], expected: int, steps: tuple[int, ...]) -> None:
    errors = [error(n, **integrator) for n in steps]
    assert order([1 / n for n in steps], errors) == pytest.approx(expected, abs=0.15)


def test_default_keeps_undamped_waves_and_low_order_bdf_kills_them() -> None:
    # field of integrators at 20 steps per period: amplitude that one period leaves
    assert amplitude() == pytest.approx(0.99999, abs=1e-5)
    assert amplitude(integrator="theta") == pytest.approx(1.0, abs=1e-12)
    assert amplitude(integrator="arkimex", order=4) == pytest.approx(1.0, abs=1e-6)
    assert amplitude(integrator="bdf", order=1) == pytest.approx(0.390, abs=1e-3)
    assert amplitude(integrator="bdf", order=2) == pytest.approx(0.962, abs=1e-3)
    assert amplitude(integrator="bdf", order=3) == pytest.approx(1.045, abs=1e-3)  # grows


def test_high_order_bdf_blows_up_on_undamped_waves() -> None:
    # the shaft's fast waves lie where BDF5 amplifies: finer steps only bring them there
    assert swing(160, 1.0, integrator="bdf", order=5)[-1, 3] > 10
    assert swing(160, 1.0)[-1, 3] < 1 + math.pi
