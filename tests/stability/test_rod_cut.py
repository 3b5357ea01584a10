"""Steps between two blades: how many each engine needs to keep the growth of the self-excitation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from failurelab import cutting_growth

from drillfem.scene import load_scene
from drillfem.solve.guards import PASSAGE
from drillfem.stability.loop import DrillingLoop


def root() -> float:
    """Growth (1/s) of the characteristic root at 13.3 Hz."""
    scene = load_scene("vertical-c1-cd4")
    pitch = scene.nominal().depth_of_cut / (2 * math.pi)
    values = DrillingLoop.from_scene(scene).roots(np.array([14.42]), np.array([pitch])).values[0]
    return float(values[np.nanargmin(abs(values.imag / (2 * math.pi) - 13.34))].real)


@pytest.mark.parametrize("engine", ["condensed", "petsc"])
def test_engines_keep_the_growth_at_the_steps_that_their_guard_wants(engine: str) -> None:
    assert root() == pytest.approx(1.8705, abs=1e-4)
    assert cutting_growth(engine, PASSAGE[engine]) == pytest.approx(root(), rel=0.02)


def test_longer_steps_lose_it() -> None:
    coarse, fine = (abs(cutting_growth("petsc", steps) / root() - 1) for steps in (16, 32))
    assert coarse > 0.1 and fine > 0.03
    assert math.log2(coarse / fine) == pytest.approx(2, abs=0.3)  # second order
