"""The command line. Each command imports what it needs: ``drillfem list`` works without DOLFINx.

Exit codes: 0 done, 1 the simulation failed (what was computed is kept), 2 bad input, 130 interrupted. Errors
are one line on stderr; DRILLFEM_DEBUG=1 shows the traceback instead.
"""

from __future__ import annotations

import logging
import os
import re
import shlex
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Self

import typer
from rich.console import Console

from drillfem.errors import DrillfemError, MissingDependency, SceneError, SimulationError

if TYPE_CHECKING:
    from rich.progress import Progress

    from drillfem.results import Result

PLAIN_INTERVAL = 10.0
"""Seconds of wall time between two progress lines where there is no terminal."""
FIRST_RANK = 5.0
"""Seconds that other ranks leave the first one to say what is wrong."""

app = typer.Typer(
    name="drillfem",
    help="Drill-string dynamics: a Cosserat rod drills rock.",
    add_completion=False,
    pretty_exceptions_enable=False,
)
stderr = Console(stderr=True, highlight=False)

Folder = Annotated[Path, typer.Argument(metavar="DIR", help="Result folder.")]
SceneName = Annotated[str, typer.Argument(metavar="SCENE", help="A built-in scene (drillfem list) or a TOML file.")]
Until = Annotated[str | None, typer.Option(metavar="SECONDS", help="Stop at this simulated time.")]


def main(arguments: list[str] | None = None) -> int:
    """Run the command line with ``arguments`` (those of the process by default) and return the exit code."""
    _log_to(stderr)
    command = typer.main.get_command(app)
    try:
        return int(command.main(args=arguments, prog_name="drillfem", standalone_mode=False) or 0)
    except Exception as error:
        if os.environ.get("DRILLFEM_DEBUG"):
            raise
        message, code = _explain(error)
    except KeyboardInterrupt:
        message, code = "interrupted", 130
    if code != 2 or _rank() == "0":  # bad input is bad on all ranks
        stderr.print(message, markup=False, soft_wrap=True)
    else:
        time.sleep(FIRST_RANK)  # mpirun ends the job with the first rank that fails: it shall be the one that speaks
    return code


@app.callback(invoke_without_command=True)
def _start(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        print(f"drillfem {_version()}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        print(context.get_help())
        raise typer.Exit


@app.command("list")
def list_scenes() -> None:
    """List the built-in scenes."""
    from drillfem.scene import builtin_scenes

    scenes = builtin_scenes()
    width = max(map(len, scenes), default=0)
    for name, title in scenes.items():
        print(f"{name:{width}}  {title}".rstrip())


@app.command()
def info(
    scene: SceneName,
    set_: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a key.")] = None,
) -> None:
    """Say what a scene simulates."""
    from drillfem.scene import describe, load_scene

    rows = describe(load_scene(scene, _overrides(set_)))
    width = max(len(label) for label, _ in rows)
    for label, text in rows:
        print(f"{label:{width}}  {text}")


@app.command()
def run(
    scene: SceneName,
    out: Annotated[Path, typer.Option(metavar="DIR", help="New folder for the result.")],
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Change a key of the scene: bit.blades=5."),
    ] = None,
    until: Until = None,
    certify: Annotated[
        bool | None,
        typer.Option(
            "--certify/--no-certify",
            help="Repeat with half the step, a finer mesh, nearby starts; compare. Default: where it takes seconds.",
        ),
    ] = None,
) -> None:
    """Simulate a scene."""
    from drillfem.results import check_new_folder
    from drillfem.scene import load_scene

    end = _seconds(until)
    loaded = load_scene(scene, _overrides(set_))
    check_new_folder(out)
    import drillfem

    with _keeping(out):
        with ProgressDisplay() as progress:
            result = drillfem.simulate(loaded, out=out, progress=progress, until=end)
        companions = None
        # a straight drilling string costs seconds: its numbers never come without what they are worth
        if certify or (certify is None and result.summary.get("engine") == "condensed"):
            from drillfem.solve import certify as repeat

            print("again with half the step, a finer mesh and nearby starts (--no-certify leaves this out)")
            companions = repeat(loaded, end)
        _report(result, companions)


@app.command()
def resume(folder: Folder, until: Until = None) -> None:
    """Continue a result as if it had never stopped."""
    from drillfem.results import open_result

    end = _seconds(until)
    open_result(folder)
    import drillfem

    with _keeping(folder):
        with ProgressDisplay() as progress:
            result = drillfem.resume(folder, progress=progress, until=end)
        _report(result)


@app.command()
def render(
    folder: Folder,
    time: Annotated[
        list[str] | None,
        typer.Option(metavar="SECONDS", help="Which moment; the last by default; repeat it to compare along a well."),
    ] = None,
    field: Annotated[str | None, typer.Option(metavar="NAME", help="What colours the string.")] = None,
    film: Annotated[bool, typer.Option("--film", help="Make a film too.")] = False,
    window: Annotated[
        list[str] | None, typer.Option(metavar="FROM:TO", help="Times (s) to take spectra from; may be repeated.")
    ] = None,
) -> None:
    """Make pictures of a result."""
    at = [found for text in time or [] if (found := _seconds(text, "--time")) is not None] or None
    windows = [_window(text) for text in window or []] or None
    from drillfem.results import is_result, open_result

    if not is_result(folder):
        open_result(folder)  # says what is wrong with it
    from drillfem.render import render_all

    for path in render_all(folder, time=at, field=field, film=film, windows=windows):
        print(path)


@app.command()
def demo(
    job: Annotated[
        str,
        typer.Argument(metavar="[JOB]", help="drilling: a 1200 m string in rock; well: a real, horizontal well."),
    ] = "drilling",
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the result.")] = Path("drillfem-demo"),
) -> None:
    """Drill with a 1200 m string, or turn one in a real well: history, pictures, and a table."""
    from drillfem.demo import main as run_demo

    with _keeping(out):
        run_demo(out, job)


@app.command()
def chart(
    cases: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[CASE]...", help="waves, lumped, torsional, axial-torsional, off-bottom; all by default."
        ),
    ] = None,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for pictures and numbers.")] = Path("charts"),
    quick: Annotated[bool, typer.Option("--quick", help="Seconds rather than minutes: fewer points.")] = False,
) -> None:
    """Measure speed against accuracy: error over cost of every method."""
    from drillfem.chart.report import main as draw_charts

    draw_charts(cases or [], out, quick)


@app.command()
def sweep(
    scene: SceneName,
    axes: Annotated[list[str], typer.Argument(metavar="KEY=A,B,C...", help="Keys with the values to combine.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the sweep; a part of it is completed.")],
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a key in all runs.")
    ] = None,
    until: Until = None,
    jobs: Annotated[int, typer.Option(metavar="N", help="Runs at a time, in processes of their own.")] = 1,
) -> None:
    """Simulate a scene with every combination of some values: one table, and the performance of drilling."""
    from drillfem.sweep import main as run_sweep

    def tell(line: str) -> None:
        stderr.print(line, markup=False, soft_wrap=True)

    try:
        run_sweep(scene, axes, out, _overrides(set_), _seconds(until), jobs, tell)
    except KeyboardInterrupt as error:
        raise _StoppedError(str(error) or "interrupted", 130) from error


@app.command()
def ensemble(
    scene: SceneName,
    count: Annotated[int, typer.Option("-n", "--members", metavar="N", help="How many members there shall be.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the ensemble; a part of it is completed.")],
    seed: Annotated[int, typer.Option(metavar="S", help="Seed of all random numbers.")] = 0,
    method: Annotated[str, typer.Option(metavar="NAME", help="monte-carlo, sobol or latin-hypercube.")] = "monte-carlo",
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a key of the scene.")
    ] = None,
    until: Until = None,
    keep: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Keep this history, or random field, of every member; may be repeated."),
    ] = None,
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Compute failed members again.")] = False,
    tolerance: Annotated[
        str | None, typer.Option(metavar="X", help="Stop when the mean is known so well: 0.01 or 1%.")
    ] = None,
    quantity: Annotated[str | None, typer.Option(metavar="NAME", help="The mean of what: power_ratio ...")] = None,
) -> None:
    """Simulate many members of a scene with random inputs; under mpirun or srun on all ranks."""
    from drillfem.ensemble.analysis import share
    from drillfem.ensemble.command import main as run_ensemble

    try:
        run_ensemble(
            *(scene, count, out, seed, method, _overrides(set_), _seconds(until), keep or [], retry_failed),
            *(share(tolerance), quantity),
        )
    except KeyboardInterrupt as error:
        raise _StoppedError(str(error) or "interrupted", 130) from error


@app.command()
def statistics(
    folders: Annotated[
        list[Path], typer.Argument(metavar="DIR...", help="An ensemble; more of other seeds: their mean has an error.")
    ],
    quantity: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Of a member's summary; may be repeated.")
    ] = None,
) -> None:
    """Mean, deviation, quantiles and density of an ensemble, each with its error; pictures into its folder."""
    from drillfem.ensemble.analysis import statistics as tell

    tell(folders, quantity or [])


@app.command()
def multilevel(
    scene: SceneName,
    out: Annotated[Path, typer.Option(metavar="DIR", help="New folder for picture and numbers.")],
    quantity: Annotated[str | None, typer.Option(metavar="NAME", help="Of a member's summary.")] = None,
    levels: Annotated[int, typer.Option(metavar="N", help="The scene is the finest of them.")] = 4,
    refine: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY", help="What is refined: mesh.elements and time.step by default; may be repeated."),
    ] = None,
    pilot: Annotated[int, typer.Option(metavar="N", help="Pairs per level, to begin with.")] = 40,
    tolerance: Annotated[
        str | None, typer.Option(metavar="X", help="Go on to this relative error of the mean: 0.05 or 5%.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Of the members.")] = 0,
    jobs: Annotated[int, typer.Option(metavar="N", help="Members at a time, in processes of their own.")] = 1,
    set_: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a key.")] = None,
) -> None:
    """Say from slopes over mesh and step whether multilevel Monte Carlo pays for a random scene, and use it."""
    from drillfem.ensemble.analysis import multilevel as run_levels
    from drillfem.ensemble.analysis import share
    from drillfem.scene import load_scene

    loaded = load_scene(scene, _overrides(set_))
    run_levels(loaded, out, levels, pilot, share(tolerance), quantity, refine or (), seed, jobs)


@app.command()
def sensitivity(
    scene: SceneName,
    out: Annotated[Path, typer.Option(metavar="DIR", help="New folder for picture and numbers.")],
    quantity: Annotated[str | None, typer.Option(metavar="NAME", help="Of a member's summary.")] = None,
    count: Annotated[
        int, typer.Option("-n", metavar="N", help="Base points; there are N x (inputs + 2) members.")
    ] = 64,
    terms: Annotated[bool, typer.Option("--terms", help="Of every term of a field, not of the field.")] = False,
    seed: Annotated[int, typer.Option(help="Of the members.")] = 0,
    jobs: Annotated[int, typer.Option(metavar="N", help="Members at a time, in processes of their own.")] = 1,
    set_: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a key.")] = None,
) -> None:
    """Which random input an answer depends on: first-order and total Sobol' indices."""
    from drillfem.ensemble.analysis import sensitivity as find_indices
    from drillfem.scene import load_scene

    find_indices(load_scene(scene, _overrides(set_)), out, count, quantity, terms, seed, jobs)


@app.command()
def plan(
    scene: SceneName,
    set_: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a key.")] = None,
    outputs: Annotated[
        str | None, typer.Option(metavar="NAME,...", help="What is wanted: bending_stress, bit_torque ...")
    ] = None,
    tolerance: Annotated[str | None, typer.Option(metavar="X", help="Relative error allowed: 0.05 or 5%.")] = None,
    pilot: Annotated[bool, typer.Option("--pilot/--no-pilot", help="Measure errors and speed by short runs.")] = True,
    json_: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Say which model a scene needs, why, and what it costs."""
    from drillfem.plan.report import main as print_plan

    print_plan(scene, _overrides(set_), outputs, tolerance, pilot, json_)


@app.command()
def stability(
    scene: SceneName,
    out: Annotated[Path, typer.Option(metavar="DIR", help="New folder for picture and numbers.")],
    set_: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a key.")] = None,
    speeds: Annotated[
        str | None, typer.Option(metavar="A..B", help="Speeds of the top: 5..30 (rad/s) or '50..250 rpm'.")
    ] = None,
    weights: Annotated[str | None, typer.Option(metavar="A..B", help="Weights on bit: '35..80 kN'.")] = None,
    runs: Annotated[bool, typer.Option("--runs/--no-runs", help="Confirm the map by short runs.")] = True,
    surface: Annotated[
        str, typer.Option(metavar="exact|scene", help="'scene': with the scene's discretised rock surface.")
    ] = "exact",
) -> None:
    """Map the linear stability of steady drilling over top speed and weight on bit."""
    from drillfem.scene import load_scene
    from drillfem.stability.command import run as draw_stability

    draw_stability(load_scene(scene, _overrides(set_)), out, speeds, weights, runs, surface)


@app.command()
def reproduce(
    cases: Annotated[
        list[str] | None,
        typer.Argument(metavar="[CASE]...", help="V1, V2, C1, C2, C3 (chapter 5), 6-V1, 6-C1; all by default."),
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="New folder for histories and numbers.")] = None,
    docs: Annotated[Path | None, typer.Option(metavar="FILE", help="Write the comparison as a page.")] = None,
    imitate: Annotated[
        bool, typer.Option("--imitate", help="Compute everything again with numerics like the thesis'.")
    ] = False,
    brief: Annotated[bool, typer.Option("--brief", help="Leave out the experiments that explain.")] = False,
) -> None:
    """Put the thesis' numbers beside ours, with verdict and reason."""
    from drillfem.reproduce.command import run as compare

    compare(cases or [], out, docs, imitate, brief, stderr)


@app.command("torque-drag")
def torque_drag(
    scene: SceneName,
    out: Annotated[Path, typer.Option(metavar="DIR", help="New folder for picture and numbers.")],
    operation: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="rotating, tripping-out, tripping-in, drilling, sliding; may be repeated."),
    ] = None,
    method: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="soft, stations, stiff (a rod); may be repeated.")
    ] = None,
    set_: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a key.")] = None,
    weight_on_bit: Annotated[str | None, typer.Option(metavar="LOAD", help="On bottom: '50 kN'.")] = None,
    torque_on_bit: Annotated[str | None, typer.Option(metavar="TORQUE", help="Of the rock: '5 kN m'.")] = None,
    friction: Annotated[str, typer.Option(metavar="dynamic|static", help="static: to break loose.")] = "dynamic",
    buckled: Annotated[
        bool, typer.Option("--buckled/--no-buckled", help="A string wound into a helix presses harder on the wall.")
    ] = True,
) -> None:
    """Hook load, torque and side force along a hole, per operation (static torque and drag)."""
    from drillfem.scene import load_scene
    from drillfem.torque_drag.command import run as compute

    loaded = load_scene(scene, _overrides(set_))
    compute(loaded, out, operation, method, weight_on_bit, torque_on_bit, friction, buckled)


@app.command()
def buckling(
    scene: SceneName,
    out: Annotated[Path, typer.Option(metavar="DIR", help="New folder for picture and numbers.")],
    weight_on_bit: Annotated[str, typer.Option(metavar="LOAD", help="Push so hard: '200 kN'.")],
    steps: Annotated[int, typer.Option(metavar="N", help="Steps from no push to that.")] = 10,
    set_: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a key.")] = None,
) -> None:
    """Push a string into its hole, without friction, and see where it snakes and winds."""
    from drillfem.buckling.command import run as push
    from drillfem.scene import load_scene

    push(load_scene(scene, _overrides(set_)), out, weight_on_bit, steps)


@app.command("warm-up")
def warm_up() -> None:
    """Compile all forms and kernels now, so that the first run starts at once."""
    from drillfem.solve import warm_up as compile_all

    start = time.perf_counter()
    compile_all()
    print(f"compiled in {time.perf_counter() - start:.0f} s")


class LiveLine:
    """How far something is: a bar on a terminal; elsewhere a line every ten seconds at most."""

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or stderr
        self._bar: Progress | None = None
        self._task: Any = None
        self._shown = time.perf_counter()

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            from rich.progress import BarColumn, Progress, TextColumn

            text = TextColumn("{task.fields[text]}", markup=False)
            self._bar = Progress(BarColumn(), text, console=self._console, transient=True)
            self._task = self._bar.add_task("", total=1.0, text="", visible=False)
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def due(self) -> bool:
        """Whether it is time to say something again."""
        return time.perf_counter() - self._shown >= (PLAIN_INTERVAL if self._bar is None else 0.1)

    def say(self, share: float, text: str) -> None:
        """Show that ``share`` of the whole is done, and the line ``text``."""
        self._shown = time.perf_counter()
        if self._bar is not None:
            self._bar.update(self._task, completed=share, text=text, visible=True)
        else:
            self._console.print(text, markup=False, soft_wrap=True)


class ProgressDisplay(LiveLine):
    """Progress of a run, to be called with (simulated time in s, its end in s, simulated seconds per second)."""

    def __call__(self, t: float, end: float, speed: float) -> None:
        """Show that the run is at ``t`` of ``end`` (s), at ``speed`` simulated seconds per second."""
        if not self.due():
            return
        share = t / end if end > 0 else 0.0
        left = f", {clock((end - t) / speed)} left" if speed > 0 else ""
        self.say(share, f"{t:.2f} of {end:g} s, {100 * share:.0f} %, {speed:.3g} simulated s per s{left}")


class _StoppedError(Exception):
    """A run ended early: the line to print, and the exit code."""

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


@contextmanager
def _keeping(folder: Path) -> Iterator[None]:
    """Say what is in the ``folder`` of a run that is interrupted (by SIGTERM too) or fails."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    except KeyboardInterrupt as error:
        where = shlex.quote(str(folder))
        if not (folder / "history.nc").exists():
            raise _StoppedError("interrupted before anything was computed", 130) from error
        how = f"continue with: drillfem resume {where}"
        if not (folder / "checkpoint").exists():
            how = "it stopped before its first checkpoint, so it cannot be resumed"
        raise _StoppedError(f"interrupted: {where} is a valid result up to here; {how}", 130) from error
    except SimulationError as error:
        kept = f"; what was computed is kept in {folder}" if (folder / "history.nc").exists() else ""
        raise _StoppedError(f"error: {_line(error)}{kept}", 1) from error
    finally:
        signal.signal(signal.SIGTERM, before)


def _report(result: Result, companions: dict[str, Result] | None = None) -> None:
    """Print the table of a run, keep its numbers in the folder, and say how to go on."""
    from drillfem.results import print_summary, store_statistics

    print_summary(result, companions)
    store_statistics(result, companions)
    print(f"pictures: drillfem render {shlex.quote(str(result.folder))}")


def _explain(error: Exception) -> tuple[str, int]:
    """One line and an exit code for any exception."""
    if isinstance(error, _StoppedError):
        return str(error), error.code
    if isinstance(error, typer.Abort):
        return "interrupted", 130
    if hasattr(error, "format_message"):  # a usage error of click, in whichever package it lives
        return f"error: {_line(error.format_message())}", 2
    if isinstance(error, SceneError):
        return f"error: {_line(error)}", 2
    if isinstance(error, ModuleNotFoundError) and not (error.name or "").startswith("drillfem"):
        error = MissingDependency(f"{error.name} is needed for this and is not installed")
    if isinstance(error, DrillfemError | OSError):
        return f"error: {_line(error)}", 1
    return (
        f"error: {type(error).__name__}: {_line(error)} (a fault of drillfem; DRILLFEM_DEBUG=1 shows where)",
        1,
    )


def _line(text: object) -> str:
    return " ".join(str(text).split())


def _overrides(settings: list[str] | None) -> dict[str, str]:
    pairs = {}
    for setting in settings or []:
        key, equals, value = setting.partition("=")
        if not equals or not key.strip():
            raise SceneError(f"--set {setting!r}: must be KEY=VALUE, as in bit.blades=5")
        pairs[key.strip()] = value.strip()
    return pairs


def _seconds(text: str | None, option: str = "--until") -> float | None:
    """A time such as ``20``, ``20 s``, ``1.5 min``, in seconds."""
    if text is None:
        return None
    units = {"": 1.0, "ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0}
    match = re.fullmatch(r"\s*([\d.]+(?:[eE][+-]?\d+)?)\s*([a-z]*)\s*", text)
    try:
        if match and match[2] in units:
            return float(match[1]) * units[match[2]]
    except ValueError:
        pass
    raise SceneError(f"{option} {text!r}: must be a time, not negative, such as 20 or '1.5 min'")


def _window(text: str) -> tuple[float, float]:
    """Two times such as ``60:80``, in seconds."""
    start, colon, end = text.partition(":")
    if not colon:
        raise SceneError(f"--window {text!r}: must be FROM:TO in seconds, such as 60:80")
    return _seconds(start, "--window") or 0.0, _seconds(end, "--window") or 0.0


def clock(seconds: float) -> str:
    """``4:13`` or ``1:04:13``, of a time in s."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


def _version() -> str:
    import drillfem

    return getattr(drillfem, "__version__", "0")


def _rank() -> str:
    """Rank of this process among those of mpirun or srun, before MPI is there to ask."""
    names = ("OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK", "SLURM_PROCID")
    return next((os.environ[name] for name in names if os.environ.get(name)), "0")


def _log_to(console: Console) -> None:
    """Show what the package logs, on the first MPI rank only."""

    class Handler(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            console.print(self.format(record), markup=False, soft_wrap=True)

    logger = logging.getLogger("drillfem")
    logger.handlers = [Handler()] if _rank() == "0" else [logging.NullHandler()]
    logger.setLevel(logging.DEBUG if os.environ.get("DRILLFEM_DEBUG") else logging.INFO)
    logger.propagate = False


if __name__ == "__main__":
    sys.exit(main())
