"""Result folders: complete at every moment, whoever stops the run."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from drillfem.errors import SceneError, SimulationError
from drillfem.results import STANDARD, ResultWriter, check_new_folder, open_result, read_checkpoint
from drillfem.results.history import SeriesFile, Variable
from drillfem.scene import Scene, load_scene

UNITS = {name: variable.units for name, variable in STANDARD.items()}
NODES = 7


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene("vertical-c1-cd4")


def writer(folder: Path | None, scene: Scene, **options: object) -> ResultWriter:
    return ResultWriter(folder, scene, "axial-torsional", 386, UNITS, **options)  # type: ignore[arg-type]


def row(t: float) -> dict[str, float]:
    return {name: (k + 1) * np.sin(t + k) for k, name in enumerate(UNITS)} | {"bit_depth": 3e-3 * t}


def block(times: np.ndarray) -> dict[str, np.ndarray]:
    return {name: np.array([row(t)[name] for t in times]) for name in UNITS}


def shape(t: float) -> dict[str, np.ndarray]:
    s = np.linspace(0, 1200, NODES)
    zero, one = np.zeros(NODES), np.ones(NODES)
    return {
        "arc_length": s,
        "outer_diameter": 0.1 + zero,
        "position": np.column_stack([zero, zero, s + 1e-3 * t]),
        "director1": np.column_stack([np.cos(t) * one, np.sin(t) * one, zero]),
        "director3": np.column_stack([zero, zero, one]),
        "spin": t * s,
        "rock_angle": np.linspace(0, 1, 5),
        "rock_height": np.linspace(0, 1, 5) * t,
    }


def breaches(folder: Path) -> list[str]:
    """What the folder breaks of the contract: names, units, entries of the summary and the manifest."""
    bad = []
    history = xr.open_dataset(folder / "history.nc")
    t = history["time"].values
    if t.ndim != 1 or len(t) < 2 or not np.all(np.diff(t) > 0):
        bad.append("time does not increase")
    if history["time"].attrs.get("units") != "s":
        bad.append("time is not in s")
    for name, units in UNITS.items():
        if name not in history:
            if "bit_torque" in history or not name.startswith(("bit_", "depth_of_cut")):
                bad.append(f"{name} is missing")
            continue
        v = history[name]
        if v.dims != ("time",) or v.attrs.get("units") != units or not np.isfinite(v.values).all():
            bad.append(f"{name}: {v.dims}, {v.attrs}")
    bad += [f"{name} has no units" for name in history.data_vars if "units" not in history[name].attrs]
    summary = json.loads((folder / "summary.json").read_text())
    entries = (
        "model dofs simulated_seconds wall_seconds steps newton_iterations rejected_steps drilled_depth "
        "energy_balance_error converged reason"
    )
    bad += [f"summary.json has no {key}" for key in entries.split() if key not in summary]
    manifest = json.loads((folder / "manifest.json").read_text())
    bad += [f"manifest.json has no {key}" for key in ("scene", "versions", "seed") if key not in manifest]
    history.close()
    return bad


def test_a_finished_run_keeps_the_contract(tmp_path: Path, scene: Scene) -> None:
    folder = tmp_path / "deep" / "out"
    with writer(folder, scene) as out:
        out.append(0.0, row(0.0))
        out.checkpoint(0.0, {"u": np.arange(3.0)})
        out.append_block(np.array([0.1, 0.2]), block(np.array([0.1, 0.2])))
        out.append(0.3, row(0.3))
        out.update(steps=300, newton_iterations=600)
        result = out.finish({"converged": True, "energy_balance_error": 1e-9})
    assert breaches(folder) == []
    assert result.summary["reason"] == "reached the end"
    assert result.summary["steps"] == 300
    assert result.summary["simulated_seconds"] == 0.3
    assert result.summary["drilled_depth"] == row(0.3)["bit_depth"]
    again = open_result(folder)
    xr.testing.assert_identical(again.history, result.history)
    assert again.scene == scene
    assert again.history["time"].values.tolist() == [0.0, 0.1, 0.2, 0.3]
    for name in UNITS:
        assert again.history[name].values.tolist() == [row(t)[name] for t in (0.0, 0.1, 0.2, 0.3)]
    assert not list(folder.rglob("*.part"))


def test_every_flush_leaves_a_valid_folder(tmp_path: Path, scene: Scene) -> None:
    out = writer(tmp_path, scene)
    for k in range(5):
        out.append_block(k + np.array([0.1, 0.6]), block(k + np.array([0.1, 0.6])))
        out.flush()
        assert breaches(tmp_path) == []
        assert open_result(tmp_path).history.sizes["time"] == 2 * (k + 1)
    assert "time" in xr.open_dataset(tmp_path / "history.nc").encoding["unlimited_dims"]


def test_flushing_takes_a_small_share_of_the_time(
    tmp_path: Path, scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = iter(np.arange(1000.0))
    monkeypatch.setattr("drillfem.results.writer.perf_counter", lambda: float(next(clock)))
    out = writer(tmp_path, scene, flush_interval=2.0)
    out.flush()  # it takes some ticks of the clock, each of a second
    flushed = []
    monkeypatch.setattr(out, "flush", lambda: flushed.append(1))
    for k in range(18):
        out.append(float(k), row(k))
    assert not flushed


def test_a_killed_run_loses_its_unflushed_tail_only(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    script = f"""
        import sys; sys.path.insert(0, {os.path.dirname(__file__)!r})
        from test_results import *
        out = writer({str(folder)!r}, load_scene("vertical-c1-cd4"))
        t = 0.0
        while True:
            times = t + 1e-3 * np.arange(200)
            out.append_block(times, block(times))
            out.field(t, shape(t))
            t = times[-1] + 1e-3
            out.checkpoint(t, dict(t=t))
            out.flush()
            print(t, flush=True)
    """
    process = subprocess.Popen([sys.executable, "-c", textwrap.dedent(script)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    shown = [float(process.stdout.readline()) for _ in range(5)][-1]
    time.sleep(0.07)  # somewhere in the middle of something
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert breaches(folder) == []
    result = open_result(folder)
    assert result.history["time"].values[-1] >= shown - 1.5e-3
    assert result.summary["reason"] == "still running, or killed"
    at, state = read_checkpoint(folder)
    assert at == state["t"] <= result.history["time"].values[-1] + 1.5e-3
    assert result.fields is not None


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (KeyboardInterrupt(), "interrupted at t = 0.2 s"),
        (SimulationError("SNES diverged"), "SNES diverged"),
        (ZeroDivisionError(), "ZeroDivisionError()"),
    ],
)
def test_a_run_that_ends_early_says_why(tmp_path: Path, scene: Scene, error: BaseException, reason: str) -> None:
    with pytest.raises(type(error)), writer(tmp_path, scene) as out:
        out.append_block([0.1, 0.2], block(np.array([0.1, 0.2])))
        out.update(steps=7)
        raise error
    result = open_result(tmp_path)
    assert (result.summary["converged"], result.summary["reason"]) == (False, reason)
    assert result.summary["steps"] == 7
    assert breaches(tmp_path) == []


def test_an_interruption_inside_a_flush_loses_and_repeats_nothing(
    tmp_path: Path, scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace = os.replace

    def interrupt(before: bool) -> object:
        def replaced(source: Path, target: Path) -> None:
            monkeypatch.setattr(os, "replace", replace)
            if not before:
                replace(source, target)
            raise KeyboardInterrupt

        return replaced

    out = writer(tmp_path, scene)
    for k, before in enumerate((True, False, True)):
        out.append(float(k), row(k))
        monkeypatch.setattr(os, "replace", interrupt(before))
        with pytest.raises(KeyboardInterrupt):
            out.flush()
    assert out.finish().history["time"].values.tolist() == [0.0, 1.0, 2.0]


def test_rows_that_are_no_rows_are_refused(tmp_path: Path, scene: Scene) -> None:
    out = writer(tmp_path, scene)
    out.append(1.0, row(1.0))
    with pytest.raises(ValueError, match="time must increase"):
        out.append(1.0, row(1.0))
    with pytest.raises(ValueError, match="time must increase"):
        out.append_block([2.0, 2.0], block(np.array([2.0, 2.0])))
    with pytest.raises(ValueError, match="hook_load"):
        out.append(2.0, {name: value for name, value in row(2.0).items() if name != "hook_load"})
    with pytest.raises(ValueError, match="rpm"):
        out.append(2.0, row(2.0) | {"rpm": 1.0})
    with pytest.raises(ValueError, match="shape"):
        out.append_block([2.0, 3.0], block(np.array([2.0])))
    with pytest.raises(SimulationError, match="hook_load is not finite at t = 2 s"):
        out.append(2.0, row(2.0) | {"hook_load": np.nan})
    bad = block(np.array([2.0, 3.0, 4.0]))
    bad["bit_torque"][1] = np.inf
    with pytest.raises(SimulationError, match="bit_torque is not finite at t = 3 s"):
        out.append_block([2.0, 3.0, 4.0], bad)
    assert out.finish().history["time"].values.tolist() == [1.0, 2.0]
    with pytest.raises(ValueError, match="bit_torque is stored in N m"):
        ResultWriter(None, scene, "torsional", 1, {"bit_torque": "kN m"})


def test_resuming_gives_the_history_of_a_run_that_never_stopped(tmp_path: Path, scene: Scene) -> None:
    times = np.round(0.1 * np.arange(1, 31), 10)

    def go_on(out: ResultWriter, start: float, stop: float) -> None:
        for t in times[(times > start + 1e-9) & (times <= stop + 1e-9)]:
            out.append(t, row(t))
            if abs(t - round(t)) < 1e-9:
                out.field(t, shape(t))
                out.checkpoint(t, {"u": np.full(3, t), "rock": {"height": np.arange(4) * t, "sector": 3}})

    with writer(tmp_path / "whole", scene) as out:
        go_on(out, 0.0, 3.0)
        whole = out.finish({"converged": True})
    with writer(tmp_path / "parts", scene) as out:
        go_on(out, 0.0, 2.4)
        first = out.finish({"reason": "stopped"})
    assert first.history["time"].values[-1] == 2.4
    wall = first.summary["wall_seconds"]
    with writer(tmp_path / "parts", scene, resume=True) as out:
        assert out.restart is not None
        at, state = out.restart
        assert at == 2.0
        assert state["rock"]["sector"] == 3
        # Before there is anything new, nothing old is thrown away.
        assert open_result(tmp_path / "parts").history["time"].values[-1] == 2.4
        go_on(out, at, 3.0)
        parts = out.finish({"converged": True})
    xr.testing.assert_identical(parts.history, whole.history)
    assert parts.fields is not None
    xr.testing.assert_identical(parts.fields, whole.fields)
    assert parts.summary["wall_seconds"] > wall
    assert parts.summary["simulated_seconds"] == whole.summary["simulated_seconds"]
    assert len(parts.manifest["runs"]) == 2


def test_a_resumed_run_that_does_nothing_keeps_everything(tmp_path: Path, scene: Scene) -> None:
    with writer(tmp_path, scene) as out:
        out.append(1.0, row(1.0))
        out.checkpoint(1.0, {"u": 1.0})
        out.append(2.0, row(2.0))
        out.finish()
    with pytest.raises(SimulationError), writer(tmp_path, scene, resume=True):
        raise SimulationError("no licence")
    assert open_result(tmp_path).history["time"].values.tolist() == [1.0, 2.0]


def test_a_checkpoint_is_read_back_bit_for_bit(tmp_path: Path, scene: Scene) -> None:
    random = np.random.default_rng(1)
    state = {
        "u": random.standard_normal(1000) * 10.0 ** random.integers(-300, 300, 1000),
        "special": np.array([-0.0, np.nan, np.inf, 5e-324]),
        "count": np.arange(4, dtype=np.int32),
        "time": 0.1 + 0.2,
        "steps": 12345678901234567,
        "scheme": "dg",
        "sliding": True,
        "rock": {"0": {"height": np.ones((2, 3))}, "1": {"height": np.zeros(0)}},
    }
    with writer(tmp_path, scene) as out:
        out.append(0.0, row(0.0))
        out.checkpoint(0.5, state)
        state["u"] = state["u"].copy()
        before = state["u"].tobytes()
        out.finish()
    at, back = read_checkpoint(tmp_path)
    assert at == 0.5
    assert back["u"].tobytes() == before
    assert back["special"].tobytes() == state["special"].tobytes()
    assert back["count"].dtype == np.int32
    assert (back["time"], back["steps"], back["scheme"]) == (0.1 + 0.2, 12345678901234567, "dg")
    assert back["sliding"] is True
    assert back["rock"]["0"]["height"].shape == (2, 3)
    assert back["rock"]["1"]["height"].shape == (0,)


def test_a_checkpoint_is_a_copy(tmp_path: Path, scene: Scene) -> None:
    u = np.zeros(3)
    out = writer(tmp_path, scene)
    out.append(0.0, row(0.0))
    out.checkpoint(0.0, {"u": u})
    u += 1
    out.finish()
    assert read_checkpoint(tmp_path)[1]["u"].tolist() == [0, 0, 0]
    with pytest.raises(TypeError, match="rock/law is object"):
        out.checkpoint(1.0, {"rock": {"law": object()}})


def test_nothing_is_written_over(tmp_path: Path, scene: Scene) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("years of work")
    with pytest.raises(SceneError, match="not empty and not a result"):
        writer(tmp_path / "mine", scene)
    assert os.listdir(tmp_path / "mine") == ["thesis.tex"]
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(SceneError, match="is not a folder"):
        writer(file, scene)
    with pytest.raises(SceneError, match="is not a folder"):
        writer(file / "out", scene)
    with writer(tmp_path / "run", scene) as out:
        out.append(0.0, row(0.0))
        out.finish()
    before = {path: path.read_bytes() for path in (tmp_path / "run").rglob("*") if path.is_file()}
    with pytest.raises(SceneError, match="drillfem resume") as error:
        writer(tmp_path / "run", scene)
    assert "\n" not in str(error.value)
    assert before == {path: path.read_bytes() for path in (tmp_path / "run").rglob("*") if path.is_file()}
    (tmp_path / "empty").mkdir()
    assert check_new_folder(tmp_path / "empty") == tmp_path / "empty"
    assert not check_new_folder(tmp_path / "a" / "b").exists()


def test_two_runs_do_not_write_to_one_folder(tmp_path: Path, scene: Scene) -> None:
    with writer(tmp_path, scene) as out:
        out.append(0.0, row(0.0))
        out.checkpoint(0.0, {"u": 1.0})
        out.flush()
        with pytest.raises(SceneError, match="another process is writing"):
            writer(tmp_path, scene, resume=True)
        out.finish()
    writer(tmp_path, scene, resume=True).finish()


def test_a_damaged_folder_is_told_in_one_line(tmp_path: Path, scene: Scene) -> None:
    def complaint() -> str:
        with pytest.raises(SceneError) as error:
            open_result(tmp_path / "run")
        assert "\n" not in str(error.value)
        return str(error.value)

    assert "no such folder" in complaint()
    (tmp_path / "run").mkdir()
    assert "not a result folder" in complaint()
    (tmp_path / "run").rmdir()
    out = writer(tmp_path / "run", scene)
    assert "nothing was computed" in complaint()
    with pytest.raises(SceneError, match="no checkpoint was written yet"):
        read_checkpoint(tmp_path / "run")
    out.append(0.0, row(0.0))
    out.checkpoint(0.0, {"u": 1.0})
    out.finish()
    good = (tmp_path / "run" / "history.nc").read_bytes()
    (tmp_path / "run" / "history.nc").write_bytes(good[: len(good) // 2])
    assert "history.nc: cannot be read" in complaint()
    (tmp_path / "run" / "history.nc").write_bytes(b"")
    assert "history.nc: cannot be read" in complaint()
    with pytest.raises(SceneError, match=r"history\.nc: cannot be continued"):
        writer(tmp_path / "run", scene, resume=True)
    (tmp_path / "run" / "summary.json").write_text("{")
    assert "summary.json: cannot be read" in complaint()
    (tmp_path / "run" / "summary.json").write_text("[1]")
    assert "summary.json: cannot be read" in complaint()
    (tmp_path / "run" / "checkpoint" / "state.npz").write_bytes(b"PK")
    with pytest.raises(SceneError, match="the checkpoint cannot be read"):
        read_checkpoint(tmp_path / "run")


def test_results_in_memory(scene: Scene) -> None:
    with writer(None, scene) as out:
        out.append(0.0, row(0.0))
        out.append_block([1.0, 2.0], block(np.array([1.0, 2.0])))
        out.field(0.0, shape(0.0))
        out.checkpoint(1.0, {"u": 1.0})
        result = out.finish({"converged": True})
    assert result.folder is None
    assert result.scene is scene
    assert result.history["bit_depth"].values.tolist() == [0.0, 3e-3, 6e-3]
    assert result.history["bit_torque"].attrs["units"] == "N m"
    assert result.fields is not None
    assert result.fields["position"].shape == (1, NODES, 3)


def test_a_scene_without_a_bit(tmp_path: Path) -> None:
    names = {n: u for n, u in UNITS.items() if not n.startswith(("bit_", "depth_of_cut"))} | {"tip_x": "m"}
    with ResultWriter(tmp_path, load_scene("roll-up"), "planar", 99, names) as out:
        for t in (0.0, 0.5, 1.0):
            out.append(t, dict.fromkeys(names, t))
        result = out.finish({"converged": True})
    assert breaches(tmp_path) == []
    assert result.summary["drilled_depth"] is None


def test_fields_open_in_xarray_and_in_paraview(tmp_path: Path, scene: Scene) -> None:
    with writer(tmp_path, scene) as out:
        for k, t in enumerate((0.0, 0.5, 1.0)):
            out.append(t, row(t))
            out.field(t, shape(t))
            if k == 1:
                out.flush()
        out.finish()
    fields = open_result(tmp_path).fields
    assert fields is not None
    assert fields["position"].dims == ("time", "node", "xyz")
    assert fields["arc_length"].dims == fields["outer_diameter"].dims == ("node",)
    assert fields["rock_height"].dims == ("time", "rock")
    assert fields["spin"].attrs["units"] == "rad/s"
    np.testing.assert_array_equal(fields["director1"].values[2], shape(1.0)["director1"])
    pyvista = pytest.importorskip("pyvista")
    reader = pyvista.get_reader(str(tmp_path / "fields" / "string.vtkhdf"))
    assert reader.reader.GetNumberOfSteps() == 3
    for k, t in enumerate((0.0, 0.5, 1.0)):
        reader.reader.SetStep(k)
        line = reader.read()
        assert line.lines.tolist() == [NODES, *range(NODES)]
        np.testing.assert_array_equal(line.points, shape(t)["position"])
        for name in ("director1", "spin", "arc_length", "outer_diameter"):
            np.testing.assert_array_equal(line[name], shape(t)[name])


def test_short_names_of_fields(scene: Scene) -> None:
    s = np.linspace(0, 1, NODES)
    line = np.column_stack([0 * s, 0 * s, s])
    out = ResultWriter(None, scene, "torsional", 3, {"hook_load": "N"}, field_units={"heat": "W"})
    out.append(0.0, {"hook_load": 1.0})
    out.field(0.0, {"s": s, "r": line, "d1": line, "d3": line, "heat": s})
    fields = out.finish().fields
    assert fields is not None
    assert {"arc_length", "position", "director1", "director3", "heat"} == set(fields.data_vars)
    assert fields["heat"].attrs["units"] == "W"


def test_the_manifest_names_what_ran(tmp_path: Path, scene: Scene) -> None:
    writer(tmp_path, scene)
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert {"python", "numpy", "xarray"} <= set(manifest["versions"])
    assert manifest["seed"] == scene.initial.seed
    assert manifest["name"] == "vertical-c1-cd4"
    assert manifest["runs"][0]["command"]
    assert Scene.from_dict(manifest["scene"]) == scene


def test_a_long_run_stays_out_of_memory(tmp_path: Path) -> None:
    series = SeriesFile(tmp_path / "h.nc", {"x": Variable("m")})
    for k in range(10):
        times = 1000.0 * k + np.arange(1000)
        series.append_block(times, {"x": times**2})
        series.flush()
        assert not series.pending
    assert series.ends == {"time": (0.0, 9999.0), "x": (0.0, 9999.0**2)}
    np.testing.assert_array_equal(series.dataset()["x"], np.arange(10000.0) ** 2)
