"""Performance of drilling on made-up and on real histories."""

from __future__ import annotations

import math

import numpy as np
import pytest
import xarray as xr

from drillfem.results import performance, statistics
from drillfem.results.performance import FED
from drillfem.scene import load_scene

RADIUS = 0.1
AREA = math.pi * RADIUS**2


def history(**works: np.ndarray) -> xr.Dataset:
    """100 s, 1 mm/s in the first half and 3 mm/s in the second."""
    time = np.linspace(0.0, 100.0, 1001)
    depth = 1e-3 * np.minimum(time, 50) + 3e-3 * np.maximum(time - 50, 0)
    data = {"bit_depth": depth, "rock_volume": AREA * depth} | works
    return xr.Dataset({k: ("time", v) for k, v in data.items()}, coords={"time": time})


def test_by_hand() -> None:
    time = np.linspace(0.0, 100.0, 1001)
    h = history(work_bit=4e4 * time, work_top_drive=6e4 * time, work_gravity=5e3 * time, work_hook_load=-4e3 * time)
    early, late = performance(h, RADIUS, (0.0, 50.0)), performance(h, RADIUS, (60.0, 100.0))
    assert early["rate_of_penetration"] == pytest.approx(1e-3)
    assert late["rate_of_penetration"] == pytest.approx(3e-3)
    assert late["mechanical_specific_energy"] == pytest.approx(4e4 / (AREA * 3e-3))
    assert late["specific_energy_input"] == pytest.approx(6.1e4 / (AREA * 3e-3))
    assert late["drilled_per_energy"] == pytest.approx(3e-3 / 6.1e4)
    # between two samples
    assert performance(h, RADIUS, (70.03, 70.07))["rate_of_penetration"] == pytest.approx(3e-3)


def test_what_is_not_known_is_left_out() -> None:
    time = np.linspace(0.0, 100.0, 1001)
    assert performance(xr.Dataset(coords={"time": time}), RADIUS, (0.0, 1.0)) == {}
    assert set(performance(history(), RADIUS, (0.0, 1.0))) == {"rate_of_penetration"}
    still = history(work_bit=0 * time) * 0  # no rock cut: no energy per volume
    assert performance(still, RADIUS, (0.0, 1.0)) == {"rate_of_penetration": 0.0}
    flat = history(work_bit=time).drop_vars("rock_volume")
    assert performance(flat, RADIUS, (0.0, 50.0))["mechanical_specific_energy"] == pytest.approx(1 / (AREA * 1e-3))


def test_steady_drilling_is_teales() -> None:
    """E = W/A + 2 pi T/(A d), for the bit and, where nothing vibrates, for what is put in."""
    pytest.importorskip("dolfinx")
    import drillfem

    scene = load_scene("vertical-c1-cd2", {"initial.spin_perturbation": 0, "model": "axial-torsional"})
    result = drillfem.simulate(scene, until=2.0)
    n, area = scene.nominal(), math.pi * 0.108**2
    exact = n.weight_on_bit / area + 2 * math.pi * n.torque_on_bit / (area * n.depth_of_cut)
    assert exact == pytest.approx(445.1e6, rel=1e-3)
    found = statistics(result)
    for key in ("mechanical_specific_energy", "specific_energy_input"):
        assert found[key] == pytest.approx(exact, rel=1e-6)
        assert found[f"mean_{key}"] == pytest.approx(exact, rel=1e-6)
    assert found["drilled_per_energy"] == pytest.approx(1 / (exact * area), rel=1e-6)
    assert set(FED) <= set(map(str, result.history.data_vars))
