"""The wear flats' kink: plain Newton flips between its branches; the product brackets the bit and cannot fail."""

from __future__ import annotations

import numpy as np
import pytest
from rodfailures import LAW, bit_residual, bit_states, bracketed, newton_path, snes_iterations

import drillfem
from drillfem.models.initial import initial_state
from drillfem.models.rod import Rod
from drillfem.solve.contact import RockContact
from drillfem.solve.dynamics import Stepper
from drillfem.solve.newton import BitCoupledNewton

STATES = bit_states(300)
UNITS = np.array([1.0, 1e-3])


def held(speeds: np.ndarray) -> np.ndarray:
    """States whose solution lies on the ramp of the wear-flat force: the bit hardly moves along the axis."""
    return (speeds[:, 0] > 0) & (speeds[:, 0] < LAW.axial_regularisation)


def test_bracketed_solver_never_fails() -> None:
    calls, speeds = bracketed(STATES)
    missing = max(abs(UNITS * bit_residual(x, state)).max() for x, state in zip(speeds, STATES, strict=True))
    assert missing < 1e-11
    assert calls.max() <= 20
    assert 0.2 < held(speeds).mean() < 0.6  # of these states many are on the ramp


def test_plain_newton_flips_between_the_branches() -> None:
    _, speeds = bracketed(STATES)
    taken = snes_iterations(STATES, "basic")
    on_ramp = held(speeds)
    assert np.all(taken[on_ramp] == 0)
    assert np.mean(taken[~on_ramp] > 0) > 0.9
    # two points for ever: above and below the ramp
    path = newton_path(STATES[np.flatnonzero(on_ramp)[0]])
    assert path[-1] == pytest.approx(path[-3], rel=1e-6)
    assert path[-1, 0] * path[-2, 0] < 0


@pytest.mark.parametrize("line_search, failing", [("bt", 0.05), ("l2", 0.9), ("cp", 0.9)])
def test_line_searches_do_not_cure_it(line_search: str, failing: float) -> None:
    _, speeds = bracketed(STATES)
    taken = snes_iterations(STATES, line_search)
    assert np.mean(taken[held(speeds)] == 0) > failing


def test_the_product_brackets_the_bit_whatever_the_scene_asks_for() -> None:
    keys = {"time.engine": "petsc", "mesh.elements": 6, "mesh.degree": 2, "initial.spin_perturbation": 0.9}
    for jacobian in ("kept", "every-iteration"):
        rod = Rod(drillfem.load_scene("vertical-c1-cd5", keys | {"time.jacobian": jacobian}))
        stepper = Stepper(rod, initial_state(rod), RockContact.from_scene(rod.scene))
        snes = stepper.ts.getSNES()
        assert snes.getType() == "python"
        newton = snes.getPythonContext().newton
        assert isinstance(newton, BitCoupledNewton)
        assert isinstance(newton.bit, RockContact)
        stepper.destroy()
    # a run through axial stick: hundreds of steps on the ramp, one iteration each
    result = drillfem.simulate(drillfem.load_scene("vertical-c1-cd5", keys), until=0.8)
    speed = result.history.bit_axial_speed.values
    assert np.count_nonzero((speed > 0) & (speed < 1e-5)) > 100
    assert result.summary["newton_iterations"] < 1.5 * result.summary["steps"]
    assert result.summary["rejected_steps"] == 0
