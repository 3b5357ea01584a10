"""Runs of the compiled engine beside the PETSc engine: drilling, contact in a curved hole; resumed; its cost."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import drillfem
from drillfem.models.rod import Rod
from drillfem.results import Result
from drillfem.scene import Scene, load_scene
from drillfem.solve.direct import DirectRun

VERTICAL = {"model": "spatial", "mesh.elements": 8, "rock.surface.elements": 8, "output.interval": 0.01}
CURVED = {
    "string.0.length": 160,
    "string.1.length": 40,
    "hole.kick_off": 60,
    "hole.radius": 150,
    "hole.final_inclination": "40 deg",
    "top_drive.hook_load": "20 kN",
    "mesh.elements": 10,
    "contact.stiffness": 1e5,
    "output.interval": 0.02,
    "output.fields_interval": 1.0,
}


def run(name: str, until: float, engine: str, keys: dict[str, Any], out: Path | None = None) -> Result:
    scene = load_scene(name, keys | {"time.engine": engine, "time.end": 3.0})
    return drillfem.simulate(scene, out, until=until, warn=False)


def assert_alike(one: Result, other: Result, tolerance: float) -> None:
    """Histories agree, relative to the largest value of each variable."""
    for name in one.history.data_vars:
        a, b = (r.history[name].values for r in (one, other))
        size = max(np.abs(a).max(), 1e-9)
        assert np.abs(a - b).max() < tolerance * size, name


def in_step(scene: Callable[[str], Scene], steps: int) -> list[DirectRun]:
    """Both engines, at the same time after some steps."""
    runs = []
    for engine in ("petsc", "compiled"):
        one = DirectRun(Rod(scene(engine)))
        one.restart()
        for _ in range(steps):
            one.step(np.inf)
        runs.append(one)
    return runs


def scaled(one: DirectRun, other: DirectRun) -> float:
    """Largest difference of two states: places in string lengths, speeds in those per step, rotations as such."""
    a, length, step = one.rod.ansatz, one.rod.length, one.rod.scene.time.step
    unit = {"r": length, "q": 1.0, "v": length / step, "w": 1.0 / step, "p": length}
    scale = np.array([unit[name[0]] for name in a.x_names + a.v_names])
    return float((np.abs(one.stepper.u - other.stepper.u).reshape(-1, a.size) / scale).max())


# -- the same runs --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "keys"), [("vertical-c1-cd4", VERTICAL), ("curved-c2", CURVED)])
def test_a_drilling_step_is_that_of_petsc(name: str, keys: dict[str, Any]) -> None:
    petsc, compiled = in_step(lambda engine: load_scene(name, keys | {"time.engine": engine}), 1)
    for _ in range(20):
        assert scaled(petsc, compiled) < 1e-10
        petsc.step(np.inf)
        # from the very same state, of string and rock
        compiled.load(petsc.stepper.now - petsc.rod.scene.time.step, compiled.save())
        compiled.step(np.inf)
    petsc.destroy()


@pytest.mark.parametrize(
    "keys", [{}, {"time.integrator": "generalized-alpha"}, {"model": "axial-torsional", "time.integrator": "theta"}]
)
def test_a_string_that_drills_straight_down(keys: dict[str, Any]) -> None:
    petsc, compiled = (run("vertical-c1-cd4", 0.3, engine, VERTICAL | keys) for engine in ("petsc", "compiled"))
    assert_alike(petsc, compiled, 1e-6)
    assert compiled.summary["newton_iterations"] == petsc.summary["newton_iterations"]
    assert compiled.summary["energy_balance_error"] == pytest.approx(petsc.summary["energy_balance_error"], rel=1e-3)


@pytest.mark.parametrize(
    ("keys", "until"),
    [({}, 0.2), ({"contact.closest_point": "field"}, 0.1), ({"contact.method": "augmented"}, 0.02)],
)
def test_a_string_that_drills_in_a_curved_hole(keys: dict[str, Any], until: float) -> None:
    petsc, compiled = (run("curved-c2", until, engine, CURVED | keys) for engine in ("petsc", "compiled"))
    assert petsc.history["side_force"].values[-1] > 1e3  # it lies on the wall
    assert_alike(petsc, compiled, 1e-6)


def test_a_resumed_run_is_the_same_bit_by_bit(tmp_path: Path) -> None:
    keys = CURVED | {"output.checkpoint_interval": 0.1}
    whole = run("curved-c2", 0.3, "compiled", keys)
    run("curved-c2", 0.15, "compiled", keys, tmp_path / "r")
    resumed = drillfem.resume(tmp_path / "r", until=0.3)
    for name in whole.history.data_vars:
        assert np.array_equal(whole.history[name].values, resumed.history[name].values), name
    assert resumed.summary["engine"] == "compiled"


# -- what it costs --------------------------------------------------------------------------------------------------


def least(work: Callable[[], object], repeat: int) -> float:
    """Least processor time of ``work`` (s) in five goes of ``repeat`` calls."""
    best = np.inf
    for _ in range(5):
        start = time.process_time()
        for _ in range(repeat):
            work()
        best = min(best, (time.process_time() - start) / repeat)
    return best


@pytest.mark.verify
def test_cost_is_linear_in_the_number_of_elements() -> None:
    counts, costs = [64, 250, 1000], []
    for n in counts:
        keys = {"model": "spatial", "mesh.elements": n, "time.engine": "compiled"}
        one = DirectRun(Rod(load_scene("vertical-c1-cd4", keys)))
        one.restart()
        for _ in range(5):
            one.step(np.inf)
        costs.append(least(lambda one=one: one.step(np.inf), 20000 // n))
    assert np.polyfit(np.log(counts), np.log(costs), 1)[0] < 1.1
    assert costs[-1] > 2 * costs[0]  # or it would be the overhead that is measured


@pytest.mark.verify
def test_steps_are_faster_than_those_of_petsc() -> None:
    keys = {"model": "spatial"}
    petsc, compiled = in_step(lambda engine: load_scene("vertical-c1-cd4", keys | {"time.engine": engine}), 20)
    slow, fast = (least(lambda one=one: one.step(np.inf), 100) for one in (petsc, compiled))
    assert fast < slow / 1.5
    petsc.destroy()
