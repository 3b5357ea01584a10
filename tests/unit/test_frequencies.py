"""Natural frequencies of straight strings against closed forms, without DOLFINx."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drillfem.scene import load_scene
from drillfem.scene.frequencies import End, Uniform, standing_waves, straight_frequencies

BAR = Uniform(2.0, 8.0, 0.5)  # wave speed 4, so that the fundamental of the free bar is 1 Hz


def test_uniform_bars() -> None:
    free, held = End(False), End(True)
    n = np.arange(1, 6)
    np.testing.assert_allclose(standing_waves([BAR], free, free, 5.1), n, rtol=1e-13)
    np.testing.assert_allclose(standing_waves([BAR], held, held, 5.1), n, rtol=1e-13)
    np.testing.assert_allclose(standing_waves([BAR], held, free, 4.9), n - 0.5, rtol=1e-13)
    np.testing.assert_allclose(standing_waves([BAR], free, held, 4.9), n - 0.5, rtol=1e-13)
    halves = [Uniform(0.7, 8.0, 0.5), Uniform(1.3, 8.0, 0.5)]
    np.testing.assert_allclose(standing_waves(halves, held, free, 4.9), n - 0.5, rtol=1e-13)
    assert standing_waves([BAR], held, free, 0.4) == []


def test_lumps_at_the_ends() -> None:
    # light spring: two masses on it, and one against a wall
    light = Uniform(2.0, 8.0, 1e-9)
    two = standing_waves([light], End(False, 3.0), End(False, 6.0), 10.0)
    assert two == pytest.approx([math.sqrt(4.0 / 2.0) / (2 * math.pi)], rel=1e-8)
    assert standing_waves([light], End(True), End(False, 4.0), 10.0) == pytest.approx([1 / (2 * math.pi)], rel=1e-8)
    # a heavy lump nearly holds an end
    assert standing_waves([BAR], End(True), End(False, 1e9), 1.2)[1] == pytest.approx(1.0, rel=1e-8)


def test_neighbours_are_told_apart() -> None:
    # two equal rods, one held at each end, through a very soft joint: pairs of frequencies that nearly coincide
    soft = Uniform(1e-3, 1e-9, 1e-9)
    found = standing_waves([BAR, soft, BAR], End(True), End(True), 2.0)
    np.testing.assert_allclose(found, [0.5, 0.5, 1.5, 1.5], atol=1e-6)


def test_the_thesis_string() -> None:
    found = straight_frequencies(load_scene("vertical-c1-cd4"))
    # spec 8.5 and 9.7
    torsional = [0.4534, 1.7108, 3.1781, 4.6768, 6.1440, 7.4014, 8.3083, 9.5657, 11.0329, 12.5316, 13.999, 15.256]
    np.testing.assert_allclose(found["torsional"][:12], torsional, atol=5e-4)
    np.testing.assert_allclose(found["axial"][:8], [1.69, 4.02, 6.49, 8.96, 11.28, 12.97, 14.66, 16.99], atol=6e-3)
    assert max(found["axial"] + found["torsional"]) <= 40
    assert list(straight_frequencies(load_scene("vertical-c1-cd4", {"model": "torsional"}))) == ["torsional"]
    lumped = straight_frequencies(load_scene("vertical-c1-cd4", {"model": "lumped"}))
    assert lumped == {"torsional": [pytest.approx(0.459, abs=5e-4)]}


@pytest.mark.parametrize(("share", "published"), [(0.8, [6.47, 7.43, 8.89]), (0.4, [6.68, 8.06])])
def test_inertia_lumped_at_the_bit(share: float, published: list[float]) -> None:
    """Spec 8.6: what the thesis' runs with alpha show."""
    found = straight_frequencies(load_scene("vertical-c1-cd4", {"inertia.distributed": share}))["torsional"]
    for frequency in published:
        assert min(abs(f - frequency) for f in found) < 6e-3
