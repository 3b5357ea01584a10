"""Maps of linear stability against nonlinear runs, and what the maps show."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from drillfem.scene import Scene, load_scene
from drillfem.stability import DrillingLoop, confirm, pitch, stability_map
from drillfem.stability.maps import time_point
from drillfem.stability.timedomain import at_point, motions_in


def scene(damping: str, **overrides: Any) -> Scene:
    keys = {key.replace("__", "."): value for key, value in overrides.items()}
    return load_scene("vertical-c1-cd4", {"material.retardation_time": damping, **keys})


@pytest.mark.parametrize(
    ("damping", "model", "speed", "weight"),
    [
        ("1e-3", "axial-torsional", 14.42, 45.7e3),  # 13.2 Hz, the thesis' own point
        ("1e-3", "axial-torsional", 8.0, 60e3),  # three motions grow
        ("1e-3", "axial-torsional", 12.5, 50e3),  # stable: the torsional fundamental fades
        ("1e-2", "spatial", 5.0, 70e3),  # a straight spatial string has the motions of the axial-torsional one
        ("0", "lumped", 14.42, 45.7e3),
        ("0", "lumped", 30.0, 60e3),  # torsion grows by 5e-4 1/s
        ("1e-4", "torsional", 30.0, 60e3),  # a higher torsional motion
    ],
)
def test_a_run_grows_as_its_roots_say(damping: str, model: str, speed: float, weight: float) -> None:
    given = scene(damping, model=model)
    loop = DrillingLoop.from_scene(given)
    band = loop.band(float(pitch(given, weight)))[0] / (2 * np.pi)
    point = time_point(given, loop, speed, weight, band)
    assert point.agrees
    assert point.growth == pytest.approx(point.rightmost, rel=3e-3, abs=2e-5)
    assert point.frequency == pytest.approx(point.predicted_frequency, rel=1e-3)


def test_unequal_blades_grow_as_their_roots_say() -> None:
    given = scene("1e-3", bit__blades=3, bit__blade_angles=[0.0, 1.8, 4.3])
    loop = DrillingLoop.from_scene(given)
    point = time_point(given, loop, 12.0, 45.7e3, 40.0)
    assert point.growth == pytest.approx(point.rightmost, rel=3e-3)
    # they calm: equal ones grow faster, and where these are stable already
    even, at = DrillingLoop.from_scene(scene("1e-3", bit__blades=3)), np.array([12.0, 20.0])
    uneven, equal = (x.roots(at, pitch(given, 45.7e3)).growth for x in (loop, even))
    assert point.growth < 0.8 * equal[0] and uneven[1] < 0 < equal[1]


def test_a_coarse_surface_grows_as_its_own_roots_say() -> None:
    """First-order upwinding on 16 cells: the run loses what the transfer function of its cells says."""
    given = scene("1e-3", rock__surface__scheme="upwind", rock__surface__elements=16)
    loop, exact = DrillingLoop.from_scene(given, "scene"), DrillingLoop.from_scene(given)
    point = time_point(given, loop, 18.0, 45.7e3, 40.0)
    assert point.growth == pytest.approx(point.rightmost, rel=5e-3)
    assert point.growth < 0.8 * exact.roots(np.array([18.0]), pitch(given, 45.7e3)).growth[0]


def test_the_map_of_a_damped_string() -> None:
    given = scene("1e-3")
    chart = stability_map(given, np.linspace(9, 26, 18), np.linspace(30e3, 72e3, 8))
    assert chart.complete and chart.own.unstable[0] == 2
    # stable windows: the edges at the own weight are roots on the axis
    windows = chart.stable_speeds(45.7e3)
    np.testing.assert_allclose(windows[0], (10.686, 14.140), atol=2e-3)
    for edge in (windows[0][0], windows[0][1], windows[1][0]):
        growth = chart.loop.roots(np.array([edge * (1 - 1e-4), edge * (1 + 1e-4)]), pitch(given, 45.7e3)).growth
        assert growth.min() < 0 < growth.max()
    # chatter of the pipes' axial motion does not know the weight; that beside a torsional frequency does
    light, heavy = chart.stable_speeds(33e3)[0], chart.stable_speeds(70e3)[0]
    assert abs(light[1] - heavy[1]) < 2e-3 < 1.0 < heavy[0] - light[0]
    # corners of the drawn boundary lie on it, and it is the same on any raster
    segments, polygons = chart.outline()
    speed, weight = segments.reshape(-1, 2).T
    assert len(speed) > 30 and np.abs(chart.loop.roots(speed, pitch(given, weight)).growth).max() < 1e-3
    area = sum(0.5 * abs(p[:, 0] @ np.roll(p[:, 1], 1) - p[:, 1] @ np.roll(p[:, 0], 1)) for p in polygons)
    finer = stability_map(given, np.linspace(9, 26, 35), np.linspace(30e3, 72e3, 15)).outline()[1]
    again = sum(0.5 * abs(p[:, 0] @ np.roll(p[:, 1], 1) - p[:, 1] @ np.roll(p[:, 0], 1)) for p in finer)
    assert area == pytest.approx(again, rel=3e-3)


def test_damping_calms() -> None:
    counts = []
    for damping in ("1e-2", "1e-3", "1e-4", "1e-5"):
        given = scene(damping)
        counts.append(int(DrillingLoop.from_scene(given).count(np.array([14.42]), pitch(given, 45.7e3))[0]))
    assert counts[:2] == [0, 2] and counts[1] < counts[2] < counts[3]


def test_runs_on_a_map() -> None:
    chart = stability_map(scene("1e-2"), np.linspace(4, 20, 9), np.linspace(30e3, 70e3, 5))
    confirm(chart, (3, 1), end=16.0)
    assert chart.agreement == (3, 3)
    assert {p.growth > 0 for p in chart.points} == {True, False}


def test_motions_of_a_signal() -> None:
    t = 1e-3 * np.arange(12_000)
    parts = [(0.51, 13.2, 1e-3), (-0.0034, 0.457, 1.0), (-0.4, 5.1, 30.0)]
    signal = sum(a * np.exp(g * t) * np.cos(2 * np.pi * f * t + f) for g, f, a in parts)
    found = motions_in(signal, 1e-3, 30.0)
    for motion, (growth, frequency, _) in zip(found, parts, strict=True):
        assert motion.growth == pytest.approx(growth, abs=1e-5)
        assert motion.frequency == pytest.approx(frequency, rel=1e-5)
    with pytest.raises(ValueError, match="too few"):
        motions_in(signal[:10], 1e-3, 30.0)


def test_a_point_is_a_scene_of_its_own() -> None:
    point = at_point(
        scene("1e-3", model="spatial", top_drive__kind="imposed-angle", top_drive__profile="c3"), 30.0, 5e4
    )
    assert (point.model, point.top_drive.kind, point.top_drive.speed) == ("axial-torsional", "imposed-speed", 30.0)
    assert point.nominal().weight_on_bit == pytest.approx(5e4)
