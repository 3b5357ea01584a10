"""Sweeps: a scene with every combination of some values, a result folder each, and one table.

>>> from drillfem.sweep import sweep
>>> table = sweep("vertical-c1-cd4", {"bit.blades": ["4", "6"]}, "blades", until=20.0)      # doctest: +SKIP
>>> [row["drilled_depth"] for row in table.rows]                                            # doctest: +SKIP

A sweep can be stopped at any moment; the same call goes on where it was, and finished runs are not repeated. With
``jobs`` > 1 the runs are spread over processes: one that fails, or dies, takes no other run with it.
"""

from __future__ import annotations

import csv
import hashlib
import io
import itertools
import math
import os
import re
import shutil
import signal
import threading
import time
import typing
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from drillfem.errors import SceneError, SimulationError
from drillfem.scene import Scene, load_scene
from drillfem.scene.keys import slots

if TYPE_CHECKING:
    from multiprocessing.connection import Connection
    from multiprocessing.process import BaseProcess

    from rich.table import Table

TABLE = "table.json"
Progress = Callable[[float, float, float], None]
Tell = Callable[[str], None]


@dataclass(frozen=True)
class Member:
    """One run of a sweep: what it sets, as given; its scene; its folder."""

    values: dict[str, Any]
    scene: Scene
    folder: Path

    @property
    def label(self) -> str:
        """``bit.blades=5, model=lumped``."""
        return ", ".join(f"{key}={value}" for key, value in self.values.items())


@dataclass
class SweepTable:
    """One row per run, SI units; in the folder of the sweep as table.csv and table.json.

    Every row has ``folder``, the swept keys, ``status`` (done, failed, interrupted, not run) and ``reason``; runs with
    results also have the statistics of `drillfem.results.statistics`, and what steady drilling would give as
    ``nominal_*``.
    """

    scene: str
    keys: list[str]
    set: dict[str, str]
    until: float | None
    rows: list[dict[str, Any]] = field(default_factory=list)
    units: dict[str, str] = field(default_factory=dict)

    @property
    def columns(self) -> list[str]:
        """Names of all columns."""
        return list(dict.fromkeys(name for row in self.rows for name in row))

    def changing(self) -> list[str]:
        """Final values (``final_*``) that are not the same in all runs, those of the tip first."""
        names = [name for name in self.columns if name.startswith("final_")]
        names = [name for name in names if len({row.get(name) for row in self.rows}) > 1]
        return sorted(names, key=lambda name: not name.startswith("final_tip_"))

    def write(self, folder: Path) -> None:
        """Write table.csv and table.json, each in one go."""
        from drillfem.results.atomic import replacing, write_json

        columns = self.columns
        head = {"scene": self.scene, "set": self.set, "until": self.until, "keys": self.keys}
        units = {name: self.units[name] for name in columns if name in self.units}
        write_json(folder / TABLE, head | {"units": units, "rows": self.rows})
        text = io.StringIO()
        writer = csv.DictWriter(text, columns, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(self.rows)
        with replacing(folder / "table.csv") as part:
            part.write_text(text.getvalue(), encoding="utf-8")

    def printable(self) -> Table:
        """The table for a screen: the swept keys, the main numbers, and how each run ended."""
        from rich import box
        from rich.markup import escape
        from rich.table import Table

        from drillfem.results.table import LATE, WHOLE

        shown = [row for row in (*WHOLE, *LATE) if row.key in _SHOWN and any(row.key in r for r in self.rows)]
        others = [] if shown else self.changing()[:6]
        table = Table(title=escape(self.scene), title_justify="left", box=box.SIMPLE, pad_edge=False)
        for key in self.keys:
            table.add_column(_with_unit(key, self.units.get(key, "")))
        for row in shown:
            table.add_column(_with_unit(_SHOWN[row.key], row.unit), justify="right")
        for name in others:
            table.add_column(_with_unit(name.removeprefix("final_"), self.units[name]), justify="right")
        table.add_column("")
        for numbers in self.rows:
            cells = [short(numbers[key]) for key in self.keys]
            cells += [row.text(numbers) for row in shown]
            cells += [f"{numbers[name]:.6g}" if name in numbers else "-" for name in others]
            ended = numbers["status"]
            ended += f": {numbers['reason']}" if ended == "failed" else ""
            table.add_row(*map(escape, cells), escape(ended))
        return table


#: Statistics that the printed table has room for, with short names.
_SHOWN = {
    "drilled_depth": "depth",
    "mean_rate_of_penetration": "rate of penetration",
    "mean_mechanical_specific_energy": "specific energy",
    "mean_drilled_per_energy": "depth per energy",
    "torsional_frequency_1": "torsional wave",
    "axial_frequency_1": "axial wave",
    "torsional_stick_fraction": "bit stands",
}
#: SI units of what the tables print in others.
_SI = {"mm/s": "m/s", "MPa": "Pa", "mm/MJ": "m/J", "kN": "N", "% of time": "1", "": "1"}


def axis(text: str) -> tuple[str, list[str]]:
    """``bit.blades=4,5,6`` as key and values; commas within brackets and quotes do not part. Raises SceneError."""
    key, equals, rest = text.partition("=")
    values, depth, quote = [""], 0, ""
    for c in rest:
        if quote:
            quote = "" if c == quote else quote
        elif c in "\"'":
            quote = c
        depth += (c in "([{") - (c in ")]}")
        if c == "," and not depth and not quote:
            values.append("")
        else:
            values[-1] += c
    values = [value.strip() for value in values]
    if not equals or not key.strip() or not all(values):
        raise SceneError(f"{text!r}: must be KEY=A,B,C, as in bit.blades=4,5,6")
    return key.strip(), values


def members(
    scene: str | Path, values: Mapping[str, Sequence[Any]], out: str | Path, overrides: Mapping[str, Any] | None = None
) -> list[Member]:
    """All combinations of ``values`` (by dotted key), the last key fastest; see `sweep`. Writes nothing.

    Raises SceneError: a key or a value that the scene does not take, or one that is given twice.
    """
    overrides = dict(overrides or {})
    for key, given in values.items():
        if key in overrides:
            raise SceneError(f"{key}: is swept and set, must be one of both")
        for i, value in enumerate(given):
            if value in given[:i]:
                raise SceneError(f"{key} = {value!r}: is given twice")
        if not given:
            raise SceneError(f"{key}: must have values")
    if not values:
        raise SceneError("nothing to sweep: must be KEY=A,B,C, as in bit.blades=4,5,6")
    found: list[Member] = []
    for combination in itertools.product(*values.values()):
        chosen = dict(zip(values, combination, strict=True))
        name = _folder_name(chosen)
        if any(name.casefold() == member.folder.name.casefold() for member in found):
            name = f"{name[:80]}-{hashlib.sha256(repr(chosen).encode()).hexdigest()[:8]}"
        found.append(Member(chosen, load_scene(scene, overrides | chosen), Path(out) / name))
    return found


def sweep(
    scene: str | Path,
    values: Mapping[str, Sequence[Any]],
    out: str | Path,
    overrides: Mapping[str, Any] | None = None,
    until: float | None = None,
    jobs: int = 1,
    progress: Progress | None = None,
    tell: Tell | None = None,
) -> SweepTable:
    """Simulate every combination of ``values`` into folders in ``out``, and put their numbers into one table.

    Args:
        scene: built-in name or TOML file.
        values: by dotted key, what `load_scene` takes as overrides.
        out: folder of the sweep; one that holds a part of it is completed.
        overrides: for all runs.
        until: stop all runs at this time (s).
        jobs: how many runs at a time. More than one takes processes, which import the calling script: guard it with
            ``if __name__ == "__main__"``.
        progress: of the present run, as for `drillfem.simulate`; only with one job.
        tell: is given a line whenever a run has ended.

    Failing runs are in the table with their reason, and the others go on. An interruption (Ctrl-C, SIGTERM) keeps what
    there is, table included, and is raised again as KeyboardInterrupt.

    Raises SceneError (bad input, or ``out`` holds something else; nothing is written).
    """
    if jobs < 1:
        raise SceneError(f"jobs = {jobs}: must be a whole number >= 1")
    out = Path(out)
    found = members(scene, values, out, overrides)
    _check_place(out)
    table = SweepTable(str(scene), list(values), {k: str(v) for k, v in (overrides or {}).items()}, until)
    finished = [_is_finished(member, until) for member in found]
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SceneError(f"{out}: cannot be made ({error.strerror})") from error
    for member, ready in zip(found, finished, strict=True):
        table.rows.append({})
        _fill(table, len(table.rows) - 1, member, "done" if ready else "not run")
        if not ready and member.folder.exists():  # of an earlier call
            table.rows[-1]["status"] = "interrupted"
    table.write(out)
    todo = [i for i, ready in enumerate(finished) if not ready]

    def ended(i: int, status: str, reason: str, seconds: float) -> None:
        _fill(table, i, found[i], status, reason)
        table.write(out)
        if tell is not None:
            count = sum(row["status"] in ("done", "failed") for row in table.rows)
            how = f"failed: {reason}" if status == "failed" else f"{status} in {seconds:.1f} s"
            tell(f"{count} of {len(found)}: {found[i].label}: {how}")

    with _terminable():
        try:
            if jobs == 1:
                _one_by_one(todo, found, until, progress, ended)
            else:
                _in_processes(todo, found, until, jobs, ended)
        except KeyboardInterrupt:
            left = sum(row["status"] not in ("done", "failed") for row in table.rows)
            raise KeyboardInterrupt(
                f"interrupted: {out} holds {len(found) - left} of {len(found)} runs; the same command goes on"
            ) from None
    return table


# -- the runs ---------------------------------------------------------------------------------------------------------
Ended = Callable[[int, str, str, float], None]


def _attempt(member: Member, until: float | None, progress: Progress | None) -> str:
    """Run a member, or go on with it, and note its numbers; the reason if it fails, in one line."""
    import drillfem
    from drillfem.results import is_result, store_statistics

    end = member.scene.time.end if until is None else until
    try:
        if is_result(member.folder) and (member.folder / "checkpoint").exists():
            result = drillfem.resume(member.folder, progress=progress, until=end)
        else:
            if is_result(member.folder):  # ended before its first checkpoint
                shutil.rmtree(member.folder)
            result = drillfem.simulate(member.scene, out=member.folder, progress=progress, until=until)
        store_statistics(result)
    except Exception as error:
        # whatever it is: the other runs go on
        text = " ".join(str(error).split())
        known = isinstance(error, SceneError | SimulationError | OSError)
        return text if known and text else f"{type(error).__name__}: {text}"
    return ""


def _one_by_one(
    todo: list[int], found: list[Member], until: float | None, progress: Progress | None, ended: Ended
) -> None:
    for i in todo:
        start = time.perf_counter()
        try:
            reason = _attempt(found[i], until, progress)
        except KeyboardInterrupt:
            ended(i, "interrupted", "", time.perf_counter() - start)
            raise
        ended(i, "failed" if reason else "done", reason, time.perf_counter() - start)


def _worker(parent: Connection) -> None:
    """What a process of a sweep does: runs that it is given, one after the other; it answers with `_attempt`'s text."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's, which passes it on as SIGTERM
    signal.signal(signal.SIGTERM, _interrupt)
    with suppress(KeyboardInterrupt, EOFError):
        while True:
            member, until = parent.recv()
            parent.send(_attempt(member, until, None))


def _in_processes(todo: list[int], found: list[Member], until: float | None, jobs: int, ended: Ended) -> None:
    import multiprocessing
    from multiprocessing.connection import wait

    context = multiprocessing.get_context("spawn")
    waiting = list(todo)
    workers: dict[Any, BaseProcess] = {}
    busy: dict[Any, tuple[int, float]] = {}  # what each works on, and since when

    def hire() -> Connection:
        ours, theirs = context.Pipe()
        with single_threaded():
            # a daemon: it does not outlive this process
            workers[ours] = context.Process(target=_worker, args=(theirs,), daemon=True)
            workers[ours].start()
        theirs.close()
        return ours

    def collect(worker: Connection, stopped: bool) -> None:
        i, start = busy.pop(worker)
        try:
            reason = worker.recv()
            status = "failed" if reason else "done"
        except (EOFError, OSError):
            process = workers.pop(worker)
            process.join()
            status = "interrupted" if stopped else "failed"
            reason = "" if stopped else f"its process ended with code {process.exitcode}"
        ended(i, status, reason, time.perf_counter() - start)

    try:
        while waiting or busy:
            while waiting and len(busy) < jobs:
                worker = next((w for w, p in workers.items() if w not in busy and p.is_alive()), None) or hire()
                busy[worker] = waiting[0], time.perf_counter()
                with suppress(OSError):  # died just now, which `collect` will find out
                    worker.send((found[waiting.pop(0)], until))
            for ready in wait(list(busy)):
                collect(typing.cast("Connection", ready), stopped=False)
    except KeyboardInterrupt:
        for worker in busy:
            workers[worker].terminate()
        for worker in list(busy):
            collect(worker, stopped=True)
        raise
    finally:
        for worker, process in workers.items():
            worker.close()
            process.join()


@contextmanager
def single_threaded() -> Iterator[None]:
    """Processes started here use one thread each for linear algebra, unless the user has said otherwise."""
    new = [name for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS") if name not in os.environ]
    os.environ.update(dict.fromkeys(new, "1"))
    try:
        yield
    finally:
        for name in new:
            del os.environ[name]


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt


@contextmanager
def _terminable() -> Iterator[None]:
    """SIGTERM interrupts as Ctrl-C does."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, _interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


# -- folders ----------------------------------------------------------------------------------------------------------
def _folder_name(values: Mapping[str, Any]) -> str:
    """``bit.blades=5,top_drive.weight_on_bit=40_kN``: of characters that every file system takes."""
    name = ",".join(f"{key}={value}" for key, value in values.items())
    plain = re.sub(r"[^A-Za-z0-9.,=+_-]+", "_", name)
    if len(plain) > 120:
        plain = f"{plain[:100]}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"
    return plain


def _check_place(out: Path) -> None:
    """SceneError if ``out`` is neither new, nor empty, nor the folder of a sweep."""
    from drillfem.results import check_new_folder

    if not (out / TABLE).is_file():
        check_new_folder(out)


def _is_finished(member: Member, until: float | None) -> bool:
    """Whether the member's run has reached its end. SceneError if its folder holds another run, or a longer one."""
    from drillfem.results import check_new_folder, is_result
    from drillfem.results.atomic import read_json

    start, end = member.scene.time.start, member.scene.time.end if until is None else until
    if not end > start:
        raise SceneError(f"until = {end:g} s: must be later than the start of the scene, {start:g} s")
    folder = member.folder
    if not is_result(folder):
        check_new_folder(folder)
        return False
    if Scene.from_dict(read_json(folder / "manifest.json")["scene"]) != member.scene:
        raise SceneError(f"{folder}: holds the result of another scene; choose another folder for the sweep")
    if not (folder / "summary.json").exists():
        return False
    summary = read_json(folder / "summary.json")
    reached = start + float(summary.get("simulated_seconds") or 0.0)
    near = 1e-9 * max(1.0, abs(end))
    if reached > end + near:
        raise SceneError(f"{folder}: has reached {reached:g} s, later than {end:g} s; choose another folder")
    return bool(summary.get("converged")) and (reached >= end - near or member.scene.time.analysis == "static")


# -- the table --------------------------------------------------------------------------------------------------------
def _fill(table: SweepTable, i: int, member: Member, status: str, reason: str = "") -> None:
    """Row ``i``: what the member sets, how it ended, and its numbers as its folder has them."""
    from drillfem.results import is_result

    row: dict[str, Any] = {"folder": member.folder.name}
    for key, given in member.values.items():
        row[key] = value_of(member.scene, key, given)
        if unit := unit_of(key):
            table.units[key] = unit
    row |= {"status": status, "reason": reason}
    if is_result(member.folder) and status != "not run":
        with suppress(SceneError):  # nothing was computed
            numbers, units = _numbers(member)
            row |= numbers
            table.units |= units
    table.rows[i] = row


def _numbers(member: Member) -> tuple[dict[str, float], dict[str, str]]:
    """The statistics of a run, from its summary or its history, with their units."""
    from drillfem.results import open_result, statistics
    from drillfem.results.atomic import read_json
    from drillfem.results.history import STANDARD
    from drillfem.results.table import LATE, RUN, WHOLE, nominal_statistics

    summary = read_json(member.folder / "summary.json")
    units = {row.key: _SI.get(row.unit, row.unit) for row in (*WHOLE, *LATE, *RUN)}
    stored = summary.get("statistics", {})
    if member.scene.bit is not None and "this run" in stored:
        numbers, nominal = stored["this run"], stored.get("nominal", {})
    else:
        result = open_result(member.folder)
        numbers, nominal = statistics(result), nominal_statistics(result)
        if member.scene.bit is None:
            for name, variable in result.history.data_vars.items():
                if name not in STANDARD:
                    numbers[f"final_{name}"] = float(variable.values[-1])
                    units[f"final_{name}"] = str(variable.attrs["units"])
    units |= {f"nominal_{name}": units[name] for name in nominal if name in units} | {"wall_seconds": "s"}
    every = {**numbers, **{f"nominal_{k}": v for k, v in nominal.items()}, "wall_seconds": summary.get("wall_seconds")}
    found = {name: value for name, value in every.items() if value is not None and math.isfinite(value)}
    return found, units


def value_of(scene: Scene, key: str, given: Any) -> Any:
    """What a dotted key has become in a scene, in SI units; as given where the scene does not keep it."""
    here: Any = scene.to_dict()
    for part in key.split("."):
        if isinstance(here, list) and part.isdecimal() and int(part) < len(here):
            here = here[int(part)]
        elif isinstance(here, dict) and part in here:
            here = here[part]
        else:
            return given
    return here if isinstance(here, int | float | str) else given


def unit_of(key: str) -> str:
    """SI unit of a dotted key; empty for a pure number, for what is no number, and for a key that is not known."""
    kind: Any = Scene
    unit = ""
    for part in key.split("."):
        if part.isdecimal():
            continue
        slot = slots(kind).get(part) if hasattr(kind, "__dataclass_fields__") else None
        if slot is None:
            return ""
        kind = typing.get_args(slot.type)[0] if typing.get_origin(slot.type) is tuple else slot.type
        unit = slot.key.unit
    return "" if unit == "1" else unit


def short(value: Any) -> str:
    """A value as short as it can be: 45700.0 is 45700, 0.0001 is 1e-4."""
    if not isinstance(value, float) or not math.isfinite(value):
        return str(value)
    if value and abs(value) < 1e-2:
        mantissa, exponent = f"{value:.5e}".split("e")
        return f"{float(mantissa):g}e{int(exponent)}"
    return f"{value:.6g}"


def _with_unit(text: str, unit: str) -> str:
    return f"{text.strip()}\n({unit})" if unit and unit != "1" else text.strip()


def main(
    scene: str, axes: Sequence[str], out: Path, overrides: Mapping[str, str], until: float | None, jobs: int, tell: Tell
) -> None:
    """The command ``drillfem sweep``: run, print the table, draw it. Raises SimulationError if a run failed."""
    from rich.console import Console

    from drillfem.cli import ProgressDisplay

    values: dict[str, list[str]] = {}
    for text in axes:
        key, given = axis(text)
        if key in values:
            raise SceneError(f"{key}: is swept twice; give all its values at once, separated by commas")
        values[key] = given
    with ProgressDisplay() as progress:
        table = sweep(scene, values, out, overrides, until, jobs, progress, tell)
    console = Console(highlight=False)
    shown = table.printable()
    if not console.is_terminal:
        console = Console(file=console.file, highlight=False, width=300, color_system=None)
        shown.box, shown.padding = None, (0, 2, 0, 0)
    console.print(shown)
    print(f"table: {out / 'table.csv'}")
    from drillfem.render.sweep import draw

    for path in draw(table, out):
        print(f"picture: {path}")
    failed = [row for row in table.rows if row["status"] == "failed"]
    if failed:
        raise SimulationError(
            f"{len(failed)} of {len(table.rows)} runs failed; {failed[0]['folder']}: {failed[0]['reason']}"
        )
