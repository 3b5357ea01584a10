"""The command line, with a simulation in its place that is over at once."""

from __future__ import annotations

import io
import json
import logging
import os
import signal
import subprocess
import sys
import textwrap
import types
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

import drillfem
from drillfem import cli
from drillfem.errors import MissingDependency, SceneError, SimulationError
from drillfem.results import Result, ResultWriter, open_result, print_summary, statistics, summary_table
from drillfem.scene import Scene, load_scene

sys.path.insert(0, os.path.dirname(__file__))
from test_results import UNITS, breaches

SCENE = "vertical-c1-cd4"
Run = Callable[..., tuple[int, str, str]]


def history(times: np.ndarray, frequency: float = 13.1) -> dict[str, np.ndarray]:
    """Drilling with waves in it: a tenth of the time the bit stands still, a fifth it is off bottom."""
    phase = np.mod(times, 1.0)
    values = dict.fromkeys(UNITS, np.ones_like(times)) | {
        "bit_angular_speed": np.where(phase < 0.1 - 1e-9, 0.05, 14.42 + 3 * np.sin(2 * np.pi * 0.45 * times)),
        "bit_axial_speed": 2.9e-3 + 2e-3 * np.cos(2 * np.pi * frequency * times),
        "bit_depth": 2.9e-3 * times,
        "bit_torque": np.full_like(times, 3264.0),
        "bit_weight": np.where(phase >= 0.8 - 1e-9, 0.0, 45.7e3),
    }
    return {name: np.asarray(value) for name, value in values.items()}


def simulate(
    scene: Scene,
    out: Path | None = None,
    progress: Callable[[float, float, float], None] | None = None,
    until: float | None = None,
    frequency: float = 13.1,
) -> Result:
    end = until or scene.time.end
    times = np.round(np.arange(0, end + 5e-3, 1e-2), 10)
    with ResultWriter(out, scene, "axial-torsional", 386, UNITS) as writer:
        writer.checkpoint(0.0, {"u": np.zeros(3)})
        writer.append_block(times, history(times, frequency))
        if progress is not None:
            progress(end, end, 50.0)
        return writer.finish({"converged": True, "energy_balance_error": 3.2e-7, "wall_seconds": 1.0})


def certify(scene: Scene, until: float | None) -> dict[str, Result]:
    waves = {"half step": 13.12, "double mesh": 13.08, "start 1": 13.05, "start 2": 13.2}
    return {name: simulate(scene, None, None, until, frequency) for name, frequency in waves.items()}


def resume(folder: Path, progress: object = None, until: float | None = None) -> Result:
    first = open_result(folder)
    assert until is not None
    with ResultWriter(folder, first.scene, "axial-torsional", 386, UNITS, resume=True) as writer:
        assert writer.restart is not None
        times = np.arange(writer.restart[0] + 1e-2, until + 5e-3, 1e-2)
        writer.append_block(times, history(times))
        return writer.finish({"converged": True})


@pytest.fixture
def patched(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Put functions into ``drillfem`` (``simulate=...``) or into one of its modules (``solve={...}``)."""

    def patch(**replacements: object) -> None:
        for name, value in replacements.items():
            if isinstance(value, dict):
                module = types.ModuleType(f"drillfem.{name}")
                module.__dict__.update(value)
                monkeypatch.setitem(sys.modules, f"drillfem.{name}", module)
            else:
                monkeypatch.setitem(drillfem.__dict__, name, value)

    patch(simulate=simulate, resume=resume, solve={"certify": certify})
    return patch


@pytest.fixture
def run(patched: object, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(cli, "stderr", Console(stderr=True, highlight=False))
        code = cli.main([str(argument) for argument in arguments])
        return code, *capsys.readouterr()

    return call


def one_line(text: str) -> str:
    assert text.endswith("\n"), text
    assert text.count("\n") == 1, text
    return text.strip()


def test_a_run_from_end_to_end(run: Run, tmp_path: Path) -> None:
    code, out, err = run("run", SCENE, "--out", tmp_path / "a", "--until", "8 s", "--set", "bit.blades=5")
    assert (code, err) == (0, "")
    assert breaches(tmp_path / "a") == []
    assert open_result(tmp_path / "a").scene == load_scene(SCENE, {"bit.blades": "5"})
    assert "axial-torsional, 386 unknowns, 8 s" in out
    rows = {line[:35].strip(): line[35:].split() for line in out.splitlines()}
    assert rows["depth drilled"] == ["m", "0.0232", "0.02315"]
    assert rows["mean rate of penetration"] == ["mm/s", "2.9", "2.894"]
    assert "from 4 to 8 s" in rows
    assert rows["axial oscillation, strongest wave"] == ["Hz", "13.1"]
    assert rows["bit off bottom"] == ["%", "of", "time", "20"]
    assert rows["mean torque on bit"] == ["N", "m", "3264", "3264"]
    assert rows["energy balance error"] == ["3.2e-07"]
    assert f"drillfem render {tmp_path / 'a'}" in out
    stored = json.loads((tmp_path / "a" / "summary.json").read_text())["statistics"]
    assert stored["this run"]["torsional_stick_fraction"] == pytest.approx(0.1, abs=2e-3)
    assert stored["this run"]["axial_frequency_1"] == pytest.approx(13.1, abs=0.01)
    assert stored["nominal"]["mean_bit_torque"] == pytest.approx(3264.0, rel=1e-4)


def test_certified_numbers_stand_beside_their_refinements(run: Run, tmp_path: Path) -> None:
    code, out, _ = run("run", SCENE, "--out", tmp_path / "a", "--until", 40, "--certify")
    assert code == 0
    for text in ("half step", "double mesh", "2 nearby starts", "13.12", "13.08", "13.05 to 13.2"):
        assert text in out
    assert max(map(len, out.splitlines())) < 130
    stored = json.loads((tmp_path / "a" / "summary.json").read_text())["statistics"]
    assert stored["start 2"]["axial_frequency_1"] == pytest.approx(13.2, abs=0.01)


def test_resume(run: Run, tmp_path: Path) -> None:
    run("run", SCENE, "--out", tmp_path, "--until", 2)
    code, out, err = run("resume", tmp_path, "--until", "0.1 min")
    assert (code, err) == (0, "")
    assert open_result(tmp_path).history["time"].values[-1] == pytest.approx(6.0)
    assert "0.0174" in out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", SCENE], "Missing option '--out'"),
        (["run"], "Missing argument"),
        (["run", SCENE, "--out"], "requires an argument"),
        (["run", SCENE, "--out", "OUT", "--fast"], "No such option: --fast"),
        (["drill"], "No such command 'drill'"),
        (["run", "vertical-c1", "--out", "OUT"], "vertical-c1"),
        (["run", "missing.toml", "--out", "OUT"], "missing.toml"),
        (["run", SCENE, "--out", "OUT", "--set", "bit.blades"], "must be KEY=VALUE"),
        (["run", SCENE, "--out", "OUT", "--set", "=3"], "must be KEY=VALUE"),
        (["run", SCENE, "--out", "OUT", "--set", "bit.blade=3"], "bit.blade"),
        (["run", SCENE, "--out", "OUT", "--set", "bit.radius=-3 mm"], "bit.radius"),
        (["run", SCENE, "--out", "OUT", "--until", "soon"], "--until 'soon'"),
        (["run", SCENE, "--out", "OUT", "--until", "-3"], "--until '-3'"),
        (["run", SCENE, "--out", "OUT", "--until", "3 m"], "--until '3 m'"),
        (["run", SCENE, "--out", "OUT", "--until", "1.2.3"], "--until '1.2.3'"),
        (["info", SCENE, "--set", "bit.blades=0"], "bit.blades"),
        (["resume", "OUT"], "no such folder"),
        (["render", "OUT"], "no such folder"),
        (["render", "OUT", "--time", "now"], "--time 'now'"),
        (["render", "OUT", "--window", "60"], "must be FROM:TO"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(run: Run, tmp_path: Path, arguments: list[str], message: str) -> None:
    code, out, err = run(*(str(tmp_path / "out") if a == "OUT" else a for a in arguments))
    assert (code, out) == (2, "")
    assert one_line(err).startswith("error: ")
    assert message in err
    assert not list(tmp_path.iterdir())


def test_a_result_is_not_written_over(run: Run, tmp_path: Path) -> None:
    run("run", SCENE, "--out", tmp_path, "--until", 1)
    before = (tmp_path / "history.nc").stat()
    code, _, err = run("run", SCENE, "--out", tmp_path, "--until", 1)
    assert code == 2
    assert "drillfem resume" in one_line(err)
    assert (tmp_path / "history.nc").stat() == before


def failing(error: BaseException, rows: bool = True) -> Callable[..., Result]:
    def simulate_until_it_fails(scene: Scene, out: Path, progress: object = None, until: float | None = None) -> Result:
        with ResultWriter(out, scene, "axial-torsional", 386, UNITS) as writer:
            if rows:
                times = np.array([0.0, 0.1])
                writer.append_block(times, history(times))
                writer.checkpoint(0.1, {"u": 1.0})
            raise error

    return simulate_until_it_fails


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (SimulationError("SNES diverged\n(-6)"), 1, "SNES diverged (-6); what was computed is kept in "),
        (SceneError("scene x: bit.radius = '-3 mm': must be > 0"), 2, "must be > 0"),
        (MissingDependency("DOLFINx is needed: apt install python3-dolfinx"), 1, "apt install"),
        (ModuleNotFoundError("No module named 'petsc4py'", name="petsc4py"), 1, "petsc4py is needed"),
        (OSError(28, "No space left on device"), 1, "No space left"),
        (ZeroDivisionError("division by zero"), 1, "DRILLFEM_DEBUG=1"),
    ],
)
def test_failures_are_one_line(
    run: Run, patched: Callable[..., None], tmp_path: Path, error: Exception, code: int, message: str
) -> None:
    patched(simulate=failing(error))
    got, _, err = run("run", SCENE, "--out", tmp_path / "out")
    assert got == code
    assert message in one_line(err)
    assert breaches(tmp_path / "out") == []


def test_the_traceback_is_there_for_who_asks(
    run: Run, patched: Callable[..., None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DRILLFEM_DEBUG", "1")
    patched(simulate=failing(ZeroDivisionError()))
    with pytest.raises(ZeroDivisionError):
        run("run", SCENE, "--out", tmp_path / "out")


def test_an_interruption_says_how_to_go_on(run: Run, patched: Callable[..., None], tmp_path: Path) -> None:
    patched(simulate=failing(KeyboardInterrupt()))
    code, _, err = run("run", SCENE, "--out", tmp_path / "a b")
    assert code == 130
    assert f"drillfem resume '{tmp_path / 'a b'}'" in one_line(err)
    patched(simulate=failing(KeyboardInterrupt(), rows=False))
    code, _, err = run("run", SCENE, "--out", tmp_path / "c")
    assert (code, one_line(err)) == (130, "interrupted before anything was computed")


@pytest.mark.parametrize("sign", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_leaves_a_folder_that_resumes(tmp_path: Path, sign: signal.Signals) -> None:
    script = f"""
        import sys; sys.path.insert(0, {os.path.dirname(__file__)!r})
        import time
        import drillfem
        from test_cli import *

        def endless(scene, out, progress, until):
            with ResultWriter(out, scene, "axial-torsional", 386, UNITS) as writer:
                k = 0
                while True:
                    times = k + np.arange(0, 1, 0.01)
                    writer.append_block(times, history(times))
                    k += 1
                    writer.checkpoint(times[-1], dict(k=k))
                    if k == 3:
                        writer.flush()
                        print("ready", flush=True)
                    time.sleep(0.002)

        drillfem.__dict__["simulate"] = endless
        sys.exit(cli.main(["run", "{SCENE}", "--out", {str(tmp_path / "out")!r}]))
    """
    process = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(script)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    process.send_signal(sign)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "drillfem resume" in one_line(err)
    assert breaches(tmp_path / "out") == []
    result = open_result(tmp_path / "out")
    assert result.summary["reason"].startswith("interrupted at t = ")
    assert result.history["time"].values[-1] == pytest.approx(result.summary["simulated_seconds"])


def test_list_info_version_help(run: Run) -> None:
    code, out, _ = run("list")
    assert code == 0
    assert any(line.startswith(f"{SCENE} ") for line in out.splitlines())
    code, out, _ = run("info", SCENE)
    assert code == 0
    assert "axial-torsional" in out
    code, out, _ = run("--version")
    assert code == 0
    assert out.startswith("drillfem ")
    for arguments in ([], ["--help"], ["run", "--help"]):
        code, out, _ = run(*arguments)
        assert code == 0
        assert "Usage: drillfem" in out


@pytest.mark.parametrize("arguments", [["list"], ["--help"], ["info", SCENE], ["run", SCENE, "--out", "/"]])
def test_light_commands_import_nothing_heavy(arguments: list[str]) -> None:
    script = f"""
        import sys
        for name in ("dolfinx", "petsc4py", "mpi4py", "ufl", "basix"):
            sys.modules[name] = None
        from drillfem import cli
        code = cli.main({arguments!r})
        heavy = set() if "run" in {arguments!r} else {{"xarray", "numba", "pyvista", "matplotlib"}}
        assert not heavy & set(sys.modules), heavy & set(sys.modules)
        print("code", code)
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(script)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == f"code {2 if 'run' in arguments else 0}"


def test_render_demo_and_warm_up_call_their_rooms(run: Run, patched: Callable[..., None], tmp_path: Path) -> None:
    calls: list[object] = []

    def render_all(folder: Path, **options: object) -> list[Path]:
        calls.append((folder, options))
        return [folder / "string.png"]

    patched(
        render={"render_all": render_all},
        demo={"main": lambda out, job: calls.append(out)},
        solve={"warm_up": lambda: calls.append("warm")},
    )
    run("run", SCENE, "--out", tmp_path / "a", "--until", 1)
    code, out, _ = run("render", tmp_path / "a", "--time", "0.5", "--field", "spin", "--film", "--window", "0:1")
    assert (code, out) == (0, f"{tmp_path / 'a' / 'string.png'}\n")
    assert calls == [(tmp_path / "a", {"time": [0.5], "field": "spin", "film": True, "windows": [(0.0, 1.0)]})]
    assert run("demo", "--out", tmp_path / "d")[0] == 0
    assert calls[-1] == tmp_path / "d"
    code, out, _ = run("warm-up")
    assert code == 0
    assert out.startswith("compiled in ")
    assert calls[-1] == "warm"


def test_what_the_package_logs_is_shown(run: Run, patched: Callable[..., None], tmp_path: Path) -> None:
    def loud(*arguments: object, **options: object) -> Result:
        logging.getLogger("drillfem.solve").info("compiling forms, once")
        return simulate(*arguments, **options)  # type: ignore[arg-type]

    patched(simulate=loud)
    code, _, err = run("run", SCENE, "--out", tmp_path / "a", "--until", 1)
    assert (code, err) == (0, "compiling forms, once\n")


def test_plain_progress_is_sparse(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(cli.time, "perf_counter", lambda: now[0])
    file = io.StringIO()
    with cli.ProgressDisplay(Console(file=file, highlight=False)) as progress:
        for k in range(1, 101):
            now[0] = 0.3 * k
            progress(0.1 * k, 200.0, 1 / 3)
    lines = file.getvalue().splitlines()
    assert len(lines) == 2
    assert lines[0] == "3.40 of 200 s, 2 %, 0.333 simulated s per s, 9:50 left"


def test_a_bar_on_a_terminal() -> None:
    file = io.StringIO()
    console = Console(file=file, force_terminal=True, width=100)
    with cli.ProgressDisplay(console) as progress:
        progress._shown = 0.0
        progress(50.0, 200.0, 25.0)
    assert "50.00 of 200 s, 25 %, 25 simulated s per s, 0:06 left" in file.getvalue()


def test_clock() -> None:
    assert [cli.clock(s) for s in (0, 59.6, 3599, 3661)] == ["0:00", "1:00", "59:59", "1:01:01"]


def test_a_short_run_has_a_table_too() -> None:
    scene = load_scene(SCENE)
    for times in ([0.0], [0.0, 0.001]):
        writer = ResultWriter(None, scene, "axial-torsional", 386, UNITS)
        writer.append_block(times, history(np.array(times)))
        result = writer.finish({"reason": "failed [1/2]"})
        console = Console(file=io.StringIO(), width=100)
        print_summary(result, console=console)
        assert "failed [1/2]" in console.file.getvalue()  # type: ignore[attr-defined]


def test_uneven_times_are_weighed() -> None:
    scene = load_scene(SCENE)
    times = np.concatenate([np.linspace(0, 5, 10001), np.linspace(5.01, 10, 500)])
    values = history(times)
    values["bit_torque"] = np.where(times <= 7.5, 1000.0, 3000.0)
    writer = ResultWriter(None, scene, "axial-torsional", 386, UNITS)
    writer.append_block(times, values)
    numbers = statistics(writer.finish(), (2.5, 10.0))
    assert numbers["mean_bit_torque"] == pytest.approx(1666.7, rel=2e-3)


def test_without_a_bit_the_table_shows_how_it_ended() -> None:
    names = {n: u for n, u in UNITS.items() if not n.startswith(("bit_", "depth_of_cut"))} | {"tip_x": "m"}

    def static(tip: float) -> Result:
        with ResultWriter(None, load_scene("roll-up"), "planar", 99, names) as out:
            for t in (0.0, 1.0):
                out.append(t, dict.fromkeys(names, 0.0) | {"tip_x": tip * t})
            return out.finish({"converged": True, "energy_balance_error": 1e-12})

    console = Console(file=io.StringIO(), width=100)
    print_summary(static(0.25), {"double mesh": static(0.251)}, console)
    text = console.file.getvalue()  # type: ignore[attr-defined]
    assert ["tip", "x", "m", "0.25", "0.251"] in [line.split() for line in text.splitlines()]
    assert "stick" not in text
    assert summary_table(static(1.0)).row_count >= 2
