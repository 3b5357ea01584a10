"""Whole runs: the engine that is chosen, folders, interruption and continuation to the bit, failure, companions."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("dolfinx", reason="whole runs assemble the string with DOLFINx")

import drillfem
from drillfem.errors import SceneError, SimulationError
from drillfem.results import STANDARD, Result, open_result
from drillfem.scene import Scene, load_scene
from drillfem.solve.run import certify

SUMMARY = (
    "model dofs simulated_seconds wall_seconds steps newton_iterations rejected_steps drilled_depth "
    "energy_balance_error converged reason"
).split()

#: One drilling run per engine and rock surface, 1 ms steps.
DRILLING: dict[str, dict[str, Any]] = {
    "condensed, dg": {"model": "axial-torsional"},
    "condensed, profile": {"model": "axial-torsional", "rock.surface.scheme": "profile"},
    "petsc, bdf, dg": {"model": "axial-torsional", "time.engine": "petsc", "time.integrator": "bdf"},
    "petsc, profile": {"model": "axial-torsional", "time.engine": "petsc", "rock.surface.scheme": "profile"},
    "spatial, dg": {"model": "spatial"},
    "spatial, profile": {"model": "spatial", "rock.surface.scheme": "profile"},
}


def drilling(**overrides: Any) -> Scene:
    """A coarse string that drills; 300 steps of 1 ms, a checkpoint every 100."""
    keys = {"mesh.elements": 12, "time.end": 0.3, "output.checkpoint_interval": 0.1, "output.fields_interval": 0.05}
    return load_scene("vertical-c1-cd4", keys | overrides)


def scene_of(kind: str, **overrides: Any) -> Scene:
    return drilling(**DRILLING[kind], **overrides)


def stop_after(t_stop: float) -> Callable[[float, float, float], None]:
    """A progress function that does what Ctrl-C does once the run is past ``t_stop``."""

    def progress(t: float, end: float, speed: float) -> None:
        if t > t_stop:
            raise KeyboardInterrupt

    return progress


def files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def assert_same(one: Result, other: Result) -> None:
    """Bit for bit the same history and fields."""
    assert set(one.history.data_vars) == set(other.history.data_vars)
    np.testing.assert_array_equal(one.history["time"].values, other.history["time"].values)
    for name in one.history.data_vars:
        np.testing.assert_array_equal(one.history[name].values, other.history[name].values, err_msg=str(name))
    assert one.fields is not None and other.fields is not None
    for name in one.fields.data_vars:
        np.testing.assert_array_equal(one.fields[name].values, other.fields[name].values, err_msg=str(name))


def assert_contract(folder: Path, drills: bool) -> None:
    """What every finished result folder promises (names, units, entries)."""
    result = open_result(folder)
    history, t = result.history, result.history["time"]
    assert t.attrs["units"] == "s" and len(t) > 1 and np.all(np.diff(t.values) > 0)
    for name, variable in STANDARD.items():
        if drills or not name.startswith(("bit_", "depth_of_cut")):
            assert history[name].dims == ("time",) and history[name].attrs["units"] == variable.units, name
    for name, values in history.data_vars.items():
        assert "units" in values.attrs, name
        assert np.isfinite(values.values).all(), name
    assert set(SUMMARY) <= set(result.summary)
    assert result.summary["converged"] and result.summary["reason"] == "reached the end"
    assert {"scene", "versions"} <= set(result.manifest)
    assert (folder / "fields" / "string.vtkhdf").exists() and (folder / "fields" / "fields.nc").exists()


# -- the engine -------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("overrides", "engine"),
    [
        ({"model": "axial-torsional"}, "condensed"),
        ({"model": "auto"}, "condensed"),
        ({"model": "axial-torsional", "time.integrator": "exact"}, "condensed"),
        ({"model": "axial-torsional", "time.integrator": "bdf"}, "petsc"),
        ({"model": "axial-torsional", "time.engine": "petsc"}, "petsc"),
        ({"model": "spatial"}, "petsc"),
    ],
)
def test_the_straight_drilling_string_is_condensed(overrides: dict[str, Any], engine: str) -> None:
    assert drilling(**overrides).engine == engine


def test_strings_without_a_bit_go_through_petsc() -> None:
    for name in ("spin-up", "pendulum", "roll-up"):
        assert load_scene(name).engine == "petsc"


def test_the_condensed_engine_is_refused_where_the_string_is_not_linear() -> None:
    with pytest.raises(SceneError, match=r"time\.engine"):
        drilling(**{"model": "spatial", "time.engine": "condensed"})


# -- folders ----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("kind", DRILLING)
def test_an_interrupted_run_continues_to_the_bit(kind: str, tmp_path: Path) -> None:
    scene, calls = scene_of(kind), []
    whole = drillfem.simulate(scene, out=tmp_path / "whole", progress=lambda *x: calls.append(x))
    assert_contract(tmp_path / "whole", drills=True)
    assert whole.summary["engine"] == scene.engine and whole.summary["steps"] == 300
    times, ends, speeds = zip(*calls, strict=True)
    assert np.all(np.diff(times) > 0) and set(ends) == {0.3} and min(speeds) > 0

    with pytest.raises(KeyboardInterrupt):
        drillfem.simulate(scene, out=tmp_path / "stopped", progress=stop_after(0.17))
    stopped = open_result(tmp_path / "stopped")
    assert not stopped.summary["converged"] and "interrupted at t = 0." in stopped.summary["reason"]
    assert 0.17 < stopped.history["time"].values[-1] < 0.3

    continued = drillfem.resume(tmp_path / "stopped")
    assert_contract(tmp_path / "stopped", drills=True)
    assert_same(whole, continued)
    assert_same(whole, open_result(tmp_path / "stopped"))
    for entry in ("steps", "energy_balance_error", "drilled_depth"):
        assert whole.summary[entry] == continued.summary[entry], entry


@pytest.mark.parametrize("kind", ["condensed, dg", "spatial, dg"])
def test_a_finished_run_continues_beyond_its_end(kind: str, tmp_path: Path) -> None:
    scene = scene_of(kind)
    long = drillfem.simulate(scene, until=0.4)
    drillfem.simulate(scene, out=tmp_path / "short")
    with pytest.raises(SceneError, match="later time"):
        drillfem.resume(tmp_path / "short")
    assert_same(long, drillfem.resume(tmp_path / "short", until=0.4))


def test_until_shortens_a_run_and_resume_gets_to_the_end(tmp_path: Path) -> None:
    scene = scene_of("condensed, dg")
    short = drillfem.simulate(scene, out=tmp_path / "r", until=0.25)
    assert short.history["time"].values[-1] == pytest.approx(0.25, abs=1e-12)
    assert_same(drillfem.simulate(scene), drillfem.resume(tmp_path / "r"))
    for until in (0.0, -1.0):
        with pytest.raises(SceneError, match="until"):
            drillfem.simulate(scene, out=tmp_path / "none", until=until)
    assert not (tmp_path / "none").exists()


def test_nothing_is_written_over(tmp_path: Path) -> None:
    scene = scene_of("condensed, dg")
    drillfem.simulate(scene, out=tmp_path / "r", until=0.1)
    before = files(tmp_path / "r")
    with pytest.raises(SceneError, match="r"):
        drillfem.simulate(scene, out=tmp_path / "r", until=0.1)
    assert files(tmp_path / "r") == before


def test_a_run_in_memory_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    scene = scene_of("condensed, dg")
    result = drillfem.simulate(scene, until=0.1)
    assert result.folder is None and result.scene == scene and len(result.history["time"]) == 101
    assert not list(tmp_path.iterdir())


def test_rows_come_at_the_output_interval() -> None:
    fine = drillfem.simulate(scene_of("condensed, dg"), until=0.2).history
    coarse = drillfem.simulate(scene_of("condensed, dg", **{"output.interval": 0.01}), until=0.2).history
    np.testing.assert_allclose(coarse["time"].values, np.arange(21) * 0.01, atol=1e-12)
    np.testing.assert_array_equal(coarse["bit_depth"].values, fine["bit_depth"].values[::10])


# -- other analyses ---------------------------------------------------------------------------------------------------
def test_a_static_run(tmp_path: Path) -> None:
    result = drillfem.simulate(load_scene("roll-up", {"mesh.elements": 8, "time.load_steps": 4}), out=tmp_path / "r")
    assert_contract(tmp_path / "r", drills=False)
    np.testing.assert_allclose(result.history["time"].values, [0, 0.25, 0.5, 0.75, 1])
    # the load factor stands on the time axis: the energy of pure bending grows with its square
    energy = result.history["strain_energy"].values
    np.testing.assert_allclose(energy / energy[-1], result.history["time"].values ** 2, atol=1e-6)
    with pytest.raises(SceneError):
        drillfem.resume(tmp_path / "r")


def test_a_dynamic_run_without_a_bit(tmp_path: Path) -> None:
    drillfem.simulate(load_scene("pendulum", {"mesh.elements": 4}), out=tmp_path / "r", until=0.05)
    assert_contract(tmp_path / "r", drills=False)


# -- failure ----------------------------------------------------------------------------------------------------------
def test_a_failed_run_keeps_what_it_has_and_says_why(tmp_path: Path) -> None:
    # a whirling flexible rod in steps of a second: no Newton iteration can follow
    keys = {f"output.{name}": 1.0 for name in ("interval", "fields_interval", "checkpoint_interval")}
    scene = load_scene("spin-up", {"time.step": 1.0, "time.integrator": "generalized-alpha", **keys})
    with pytest.raises(SimulationError, match=r"t = .* s.*smaller time\.step") as error:
        drillfem.simulate(scene, out=tmp_path / "r")
    kept = open_result(tmp_path / "r")
    assert not kept.summary["converged"] and kept.summary["reason"] == str(error.value)
    assert 1.0 <= kept.history["time"].values[-1] < scene.time.end
    assert np.isfinite(kept.history["kinetic_energy"].values).all()
    json.loads((tmp_path / "r" / "manifest.json").read_text())


# -- companions -------------------------------------------------------------------------------------------------------
def test_certify_refines_and_scatters() -> None:
    scene = scene_of("condensed, dg")
    companions = certify(scene, until=0.1, starts=2)
    assert list(companions) == ["half step", "double mesh", "start 1", "start 2"]
    half, double = companions["half step"].scene, companions["double mesh"].scene
    assert half.time.step == scene.time.step / 2 and half.mesh == scene.mesh
    assert double.mesh.elements == 2 * scene.mesh.elements
    assert double.rock.surface.elements == 2 * scene.rock.surface.elements and double.time == scene.time
    own = drillfem.simulate(scene, until=0.1).history["bit_angle"].values[-1]
    ends = {name: float(run.history["bit_angle"].values[-1]) for name, run in companions.items()}
    assert len(set(ends.values()) | {own}) == 5
    assert max(abs(x - own) for x in ends.values()) < 1e-3 * own
