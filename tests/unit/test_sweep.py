"""Sweeps: what they refuse, keep, and do not repeat; with a simulation in place that is over at once."""

from __future__ import annotations

import csv
import json
import math
import multiprocessing
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

import drillfem
from drillfem import cli
from drillfem.errors import SceneError, SimulationError
from drillfem.results import Result, ResultWriter, open_result
from drillfem.scene import Scene, load_scene
from drillfem.sweep import SweepTable, axis, members, short, sweep, unit_of, value_of

SCENE = "vertical-c1-cd4"
UNITS = {
    "bit_depth": "m",
    "rock_volume": "m^3",
    "work_bit": "J",
    "work_top_drive": "J",
    "work_gravity": "J",
    "work_hook_load": "J",
}
ROCK = 4e8  # J/m3 that the bit of these runs spends


def rows(scene: Scene, time: np.ndarray) -> dict[str, np.ndarray]:
    """Steady drilling: 1 mm/s and blade, a tenth of what is put in is lost."""
    assert scene.bit is not None
    depth = 1e-3 * scene.bit.blades * time
    volume = math.pi * scene.bit.radius**2 * depth
    works = {"work_bit": ROCK * volume, "work_top_drive": ROCK * volume / 0.9}
    return {"bit_depth": depth, "rock_volume": volume, "work_gravity": 0 * depth, "work_hook_load": 0 * depth, **works}


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str, float]]:
    """Runs that were made: what was called, the name of the folder, its end. Blades: 13 fail, 14 are interrupted."""
    made: list[tuple[str, str, float]] = []

    def simulate(scene: Scene, out: Path, progress: object = None, until: float | None = None) -> Result:
        end = until or scene.time.end
        made.append(("simulate", out.name, end))
        assert scene.bit is not None
        with ResultWriter(out, scene, "lumped", 4, UNITS) as writer:
            writer.checkpoint(0.0, {"x": 1.0})
            times = np.linspace(0.0, end, 11)
            stop = 6 if scene.bit.blades in (13, 14) else 11
            writer.append_block(times[:stop], {k: v[:stop] for k, v in rows(scene, times).items()})
            if stop == 6:
                raise KeyboardInterrupt if scene.bit.blades == 14 else SimulationError("the bit broke")
            return writer.finish({"converged": True, "energy_balance_error": 0.0})

    def resume(folder: Path, progress: object = None, until: float | None = None) -> Result:
        assert until is not None
        made.append(("resume", folder.name, until))
        scene = open_result(folder).scene
        with ResultWriter(folder, scene, "lumped", 4, UNITS, resume=True) as writer:
            times = np.linspace(0.0, until, 11)
            writer.append_block(times[1:], {k: v[1:] for k, v in rows(scene, times).items()})
            return writer.finish({"converged": True})

    monkeypatch.setitem(drillfem.__dict__, "simulate", simulate)
    monkeypatch.setitem(drillfem.__dict__, "resume", resume)
    return made


def test_values_are_parted_at_commas() -> None:
    assert axis("bit.blades=4, 5,6") == ("bit.blades", ["4", "5", "6"])
    assert axis("gravity.direction=[0, 0, 1],[1,0,0]") == ("gravity.direction", ["[0, 0, 1]", "[1,0,0]"])
    assert axis("title='a,b',c") == ("title", ["'a,b'", "c"])
    assert axis("top_drive.weight_on_bit=40 kN,4.5e4") == ("top_drive.weight_on_bit", ["40 kN", "4.5e4"])
    for wrong in ("bit.blades", "bit.blades=", "=3", "bit.blades=4,,5"):
        with pytest.raises(SceneError, match="KEY=A,B,C"):
            axis(wrong)


def test_all_combinations_each_in_its_folder(tmp_path: Path) -> None:
    found = members(SCENE, {"bit.blades": ["4", "5"], "top_drive.weight_on_bit": ["40 kN", "40.0 kN"]}, tmp_path)
    assert [(m.scene.bit.blades, m.scene.top_drive.weight_on_bit) for m in found if m.scene.bit] == [
        *[(4, 40e3), (4, 40e3), (5, 40e3), (5, 40e3)]
    ]
    assert found[0].folder.name == "bit.blades=4,top_drive.weight_on_bit=40_kN"
    assert len({m.folder for m in found}) == 4
    # names that only differ in what a file system cannot hold, and long ones
    titles = members(SCENE, {"title": ["a b", "a_b", "A/b", "x" * 300]}, tmp_path)
    assert len({m.folder.name.casefold() for m in titles}) == 4
    assert max(len(m.folder.name) for m in titles) < 130


def test_numbers_of_the_keys_are_si() -> None:
    scene = load_scene(SCENE, {"top_drive.weight_on_bit": "40 kN"})
    assert value_of(scene, "top_drive.weight_on_bit", "40 kN") == 40e3
    assert value_of(scene, "string.1.length", "x") == 200.0
    assert value_of(scene, "dimensionless.psi", "50") == "50"
    assert unit_of("top_drive.weight_on_bit") == "N"
    assert unit_of("string.1.length") == "m"
    assert unit_of("rock.surface.elements") == unit_of("model") == unit_of("dimensionless.psi") == ""
    assert [short(x) for x in (45700.0, 1e-4, 2.5e-3, 0.1, 6, "dg")] == ["45700", "1e-4", "2.5e-3", "0.1", "6", "dg"]


def test_one_table(calls: list[Any], tmp_path: Path) -> None:
    told: list[str] = []
    table = sweep(SCENE, {"bit.blades": ["4", "6"]}, tmp_path / "s", {"model": "lumped"}, until=10.0, tell=told.append)
    assert [row["status"] for row in table.rows] == ["done", "done"]
    assert [row["drilled_depth"] for row in table.rows] == pytest.approx([0.04, 0.06])
    assert table.rows[1]["mechanical_specific_energy"] == pytest.approx(ROCK)
    assert table.rows[1]["mean_specific_energy_input"] == pytest.approx(ROCK / 0.9)
    assert table.rows[0]["mean_drilled_per_energy"] == pytest.approx(0.9 / (ROCK * math.pi * 0.108**2))
    assert table.rows[0]["nominal_rate_of_penetration"] == pytest.approx(2.89389e-3, rel=1e-5)
    assert told[0].startswith("1 of 2: bit.blades=4: done in ") and len(told) == 2
    stored = json.loads((tmp_path / "s" / "table.json").read_text())
    assert stored["keys"] == ["bit.blades"] and stored["set"] == {"model": "lumped"}
    assert stored["rows"] == table.rows
    assert stored["units"]["mechanical_specific_energy"] == "Pa"
    assert stored["units"]["mean_drilled_per_energy"] == "m/J"
    with open(tmp_path / "s" / "table.csv", encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    assert [float(line["drilled_depth"]) for line in lines] == pytest.approx([0.04, 0.06])
    assert lines[0]["bit.blades"] == "4"
    # the numbers are in the folders too
    summary = json.loads((tmp_path / "s" / "bit.blades=6" / "summary.json").read_text())
    assert summary["statistics"]["this run"]["drilled_depth"] == pytest.approx(0.06)


def test_finished_runs_are_not_repeated(calls: list[Any], tmp_path: Path) -> None:
    sweep(SCENE, {"bit.blades": ["4", "6"]}, tmp_path, until=10.0)
    before = (tmp_path / "table.csv").read_text()
    sweep(SCENE, {"bit.blades": ["4", "6"]}, tmp_path, until=10.0)
    assert len(calls) == 2
    assert (tmp_path / "table.csv").read_text() == before
    table = sweep(SCENE, {"bit.blades": ["4", "5", "6"]}, tmp_path, until=10.0)
    assert calls[2:] == [("simulate", "bit.blades=5", 10.0)]
    assert [row["drilled_depth"] for row in table.rows] == pytest.approx([0.04, 0.05, 0.06])
    longer = sweep(SCENE, {"bit.blades": ["4"]}, tmp_path, until=20.0)
    assert calls[3:] == [("resume", "bit.blades=4", 20.0)]
    assert longer.rows[0]["drilled_depth"] == pytest.approx(0.08)


def test_a_run_that_fails_is_noted_and_the_others_go_on(calls: list[Any], tmp_path: Path) -> None:
    table = sweep(SCENE, {"bit.blades": ["13", "4"]}, tmp_path, until=10.0)
    assert [row["status"] for row in table.rows] == ["failed", "done"]
    assert table.rows[0]["reason"] == "the bit broke"
    assert table.rows[0]["drilled_depth"] == pytest.approx(0.065)  # what was computed
    assert "the bit broke" in (tmp_path / "table.csv").read_text()
    # it is tried again, from its last checkpoint
    table = sweep(SCENE, {"bit.blades": ["13", "4"]}, tmp_path, until=10.0)
    assert calls[2:] == [("resume", "bit.blades=13", 10.0)]
    assert [row["status"] for row in table.rows] == ["done", "done"]


def test_an_interruption_keeps_what_there_is(calls: list[Any], tmp_path: Path) -> None:
    values = {"bit.blades": ["4", "14", "6"]}
    with pytest.raises(KeyboardInterrupt, match="holds 1 of 3 runs"):
        sweep(SCENE, values, tmp_path, until=10.0)
    stored = json.loads((tmp_path / "table.json").read_text())
    assert [row["status"] for row in stored["rows"]] == ["done", "interrupted", "not run"]
    assert stored["rows"][1]["drilled_depth"] == pytest.approx(0.07)
    assert "drilled_depth" not in stored["rows"][2]
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    table = sweep(SCENE, values, tmp_path, until=10.0)
    assert calls[2:] == [("resume", "bit.blades=14", 10.0), ("simulate", "bit.blades=6", 10.0)]
    assert [row["status"] for row in table.rows] == ["done"] * 3


def test_what_is_refused_writes_nothing(calls: list[Any], tmp_path: Path) -> None:
    out = tmp_path / "s"
    for values, options, message in (
        ({"bit.blade": ["4"]}, {}, "unknown key bit.blade"),
        ({"bit.blades": ["4", "0"]}, {}, "bit.blades = 0"),
        ({"bit.blades": ["4", "4"]}, {}, "is given twice"),
        ({"bit.blades": ["4"]}, {"overrides": {"bit.blades": "5"}}, "swept and set"),
        ({"bit.blades": []}, {}, "must have values"),
        ({}, {}, "nothing to sweep"),
        ({"bit.blades": ["4"]}, {"until": 0.0}, "until = 0 s"),
        ({"bit.blades": ["4"]}, {"jobs": 0}, "jobs = 0"),
    ):
        with pytest.raises(SceneError, match=message):
            sweep(SCENE, values, out, **options)  # type: ignore[arg-type]
    assert not out.exists() and not calls


def test_what_another_folder_holds_is_left_alone(calls: list[Any], tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(SceneError, match="is not empty"):
        sweep(SCENE, {"bit.blades": ["4"]}, tmp_path, until=1.0)
    out = tmp_path / "s"
    sweep(SCENE, {"bit.blades": ["4"]}, out, until=10.0)
    with pytest.raises(SceneError, match="another scene"):
        sweep(SCENE, {"bit.blades": ["4"]}, out, {"bit.radius": "0.1 m"}, until=10.0)
    with pytest.raises(SceneError, match="has reached 10 s, later than 5 s"):
        sweep(SCENE, {"bit.blades": ["4"]}, out, until=5.0)
    assert len(calls) == 1


def test_the_command(
    calls: list[Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(cli, "stderr", Console(stderr=True, highlight=False))
        code = cli.main(["sweep", SCENE, *map(str, arguments)])
        return code, *capsys.readouterr()

    out = tmp_path / "s"
    code, text, err = run("bit.blades=4,6", "top_drive.weight_on_bit=40 kN,50 kN", "--out", out, "--until", "10 s")
    assert code == 0
    lines = text.splitlines()
    assert (
        lines[1].split() == "top_drive.weight_on_bit depth rate of penetration specific energy depth per energy".split()
    )
    assert [line.split()[:4] for line in lines[3:7]] == [
        ["4", "40000", "0.04", "4"],
        ["4", "50000", "0.04", "4"],
        ["6", "40000", "0.06", "6"],
        ["6", "50000", "0.06", "6"],
    ]
    assert err.count("\n") == 4 and "4 of 4: bit.blades=6, top_drive.weight_on_bit=50 kN: done" in err
    assert {p.name for p in out.iterdir() if p.is_file()} == {"table.csv", "table.json", "sweep.png", "depth.png"}
    code, _, err = run("bit.blades=13,4", "--out", tmp_path / "t", "--until", "10")
    assert code == 1
    assert err.splitlines()[-1] == "error: 1 of 2 runs failed; bit.blades=13: the bit broke"
    for arguments, message in (
        (["bit.blade=4"], "unknown key bit.blade"),
        (["bit.blades"], "KEY=A,B,C"),
        (["bit.blades=4", "bit.blades=5"], "swept twice"),
        (["bit.blades=4,5", "--until", "soon"], "--until 'soon'"),
        (["bit.blades=4,5", "--jobs", "0"], "jobs = 0"),
        ([], "KEY=A,B,C"),
    ):
        code, text, err = run(*arguments, "--out", tmp_path / "u")
        assert (code, text) == (2, "") and err.count("\n") == 1, err
        assert message in err
    assert not (tmp_path / "u").exists()


def test_pictures_show_what_was_swept(calls: list[Any], tmp_path: Path) -> None:
    from drillfem.render.sweep import Places, draw, read_depth

    table = sweep(SCENE, {"bit.blades": ["4", "6"], "model": ["lumped", "torsional"]}, tmp_path, until=10.0)
    made = draw(table, tmp_path)
    assert [p.name for p in made] == ["sweep.png", "depth.png"]
    assert all(p.stat().st_size > 20_000 for p in made)
    time, depth = read_depth(tmp_path / "bit.blades=6,model=lumped")
    np.testing.assert_allclose(depth, 6e-3 * time)
    assert Places([1e-5, 1e-2]).logarithmic and not Places([4, 6]).logarithmic
    assert Places(["a", "b"]).of("b") == 1.0 and Places([4, 6]).of(6) == 6.0
    assert (
        draw(SweepTable("x", ["a"], {}, None, [{"folder": "f", "a": 1, "status": "done", "reason": ""}]), tmp_path)
        == []
    )


def test_a_scene_without_a_bit_shows_how_its_runs_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def simulate(scene: Scene, out: Path, progress: object = None, until: float | None = None) -> Result:
        with ResultWriter(out, scene, "planar", 4, {"work_bit": "J", "tip_x": "m", "tip_z": "m"}) as writer:
            writer.append(0.0, {"work_bit": 0.0, "tip_x": 0.0, "tip_z": 1.0})
            writer.append(1.0, {"work_bit": 0.0, "tip_x": 0.5, "tip_z": 1.0 / scene.mesh.elements})
            return writer.finish({"converged": True})

    monkeypatch.setitem(drillfem.__dict__, "simulate", simulate)
    assert cli.main(["sweep", "roll-up", "mesh.elements=4,8", "--out", str(tmp_path / "s")]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert (lines[1], lines[2]) == (["tip_z"], ["mesh.elements", "(m)"])  # what differs between the runs
    assert [line[:2] for line in lines[3:5]] == [["4", "0.25"], ["8", "0.125"]]
    assert (tmp_path / "s" / "sweep.png").exists()


# -- processes --------------------------------------------------------------------------------------------------------
LUMPED = {"model": "lumped", "output.interval": "10 ms"}


def test_processes_give_the_same_table_and_one_that_dies_takes_no_other_with_it(tmp_path: Path) -> None:
    values = {"time.end": ["20000 s", "0.5 s", "0.6 s"]}
    told: list[str] = []

    def tell(line: str) -> None:
        told.append(line)
        if len(told) == 1:  # the short run is done: the long one is under way, the third waits
            while not (tmp_path / "p" / "time.end=20000_s" / "manifest.json").exists():
                time.sleep(0.05)
            for process in multiprocessing.active_children():
                process.kill()
                process.join()

    # first here, so that the kernels are compiled when the processes need them
    alone = sweep(SCENE, {"time.end": ["0.5 s"]}, tmp_path / "q", LUMPED)
    table = sweep(SCENE, values, tmp_path / "p", LUMPED, jobs=2, tell=tell)
    assert [row["status"] for row in table.rows] == ["failed", "done", "done"]
    assert table.rows[0]["reason"] == "its process ended with code -9"
    assert alone.rows[0]["drilled_depth"] == table.rows[1]["drilled_depth"]
    assert not multiprocessing.active_children()


@pytest.mark.parametrize(
    ("jobs", "sign"), [(1, signal.SIGINT), pytest.param(2, signal.SIGTERM, marks=pytest.mark.slow)]
)
def test_a_signal_leaves_a_sweep_that_goes_on(tmp_path: Path, jobs: int, sign: signal.Signals) -> None:
    script = f"""
        import sys
        from drillfem import cli
        if __name__ == "__main__":
            sys.exit(cli.main(["sweep", {SCENE!r}, "bit.blades=5,6", "--out", "s", "--set", "model=lumped",
                "--set", "time.end=20000 s", "--set", "output.interval=10 ms", "--jobs", "{jobs}"]))
    """
    (tmp_path / "go.py").write_text(textwrap.dedent(script))
    folders = [tmp_path / "s" / f"bit.blades={n}" for n in (5, 6)[:jobs]]
    with subprocess.Popen([sys.executable, "go.py"], cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        for folder in folders:
            while not (folder / "checkpoint").exists():
                assert process.poll() is None
                time.sleep(0.05)
        os.kill(process.pid, sign)
        _, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert err.splitlines()[-1].startswith("interrupted: s holds 0 of 2 runs"), err
    stored = json.loads((tmp_path / "s" / "table.json").read_text())
    assert [row["status"] for row in stored["rows"]] == ["interrupted", "interrupted" if jobs == 2 else "not run"]
    for folder in folders:
        result = open_result(folder)
        assert result.summary["reason"].startswith("interrupted at t = ")
        assert stored["rows"][0]["drilled_depth"] > 0
