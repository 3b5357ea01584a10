"""Write a result folder while the simulation runs; whoever stops it at any moment keeps a valid one."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from time import perf_counter
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from drillfem.errors import SceneError

from .atomic import Lock, read_json, remove_leftovers, write_json
from .checkpoint import flatten, read_checkpoint, write_checkpoint
from .fields import ALIASES, STATIC, field_variables, write_vtkhdf
from .history import STANDARD, SeriesFile, Variable
from .manifest import check_new_folder, new_manifest, this_run, versions
from .result import Result, _dataset

MAX_SHARE = 0.05
"""Share of the wall time that flushing may take: the intervals grow with what a flush costs."""


class ResultWriter:
    """The result folder of one run; with ``folder=None`` the result stays in memory.

    Rows, fields and checkpoints are collected and brought to disk together, every ``flush_interval`` seconds
    of wall time or less often when that costs more than 5 % of the time. The history on disk is never behind
    the checkpoint on disk, so that a run can be resumed after any kind of end.

    Use it as a context manager: if the block raises (an interruption too), what was computed is kept, and
    summary.json says why it ended.

    Args:
        folder: new or empty folder; made here, with the manifest in it. With ``resume``: an existing result.
        scene: the scene as run; its ``to_dict()`` goes into the manifest.
        model: name of the model rung.
        dofs: number of unknowns.
        variables: name to units of what every history row holds.
        resume: continue the result in ``folder`` from its last checkpoint, see `restart`; rows after it are
            dropped.
        field_units: units of fields whose name is not in `STANDARD_FIELDS`.
        flush_interval: seconds of wall time between flushes, at least.

    Attributes:
        restart: (time in s, state) of the checkpoint a resumed run must continue from, else ``None``.
        pictured: whether pictures are wanted; a run that is told otherwise makes none.

    Raises:
        SceneError: the folder cannot take a new result, or (``resume``) is none, or another process writes to
            it.
    """

    def __init__(
        self,
        folder: str | Path | None,
        scene: Any,
        model: str,
        dofs: int,
        variables: Mapping[str, str],
        resume: bool = False,
        *,
        field_units: Mapping[str, str] | None = None,
        flush_interval: float = 2.0,
    ) -> None:
        for name, units in variables.items():
            if name in STANDARD and units != STANDARD[name].units:
                raise ValueError(f"{name} is stored in {STANDARD[name].units}, not in {units}")
        self.restart: tuple[float, dict[str, Any]] | None = None
        self.pictured = True
        self._scene, self._field_units = scene, dict(field_units or {})
        self._summary: dict[str, Any] = {
            "model": model,
            "dofs": int(dofs),
            "simulated_seconds": 0.0,
            "wall_seconds": 0.0,
            "steps": 0,
            "newton_iterations": 0,
            "rejected_steps": 0,
            "drilled_depth": None,
            "energy_balance_error": None,
            "converged": False,
            "reason": "still running, or killed",
        }
        self._earlier_wall = 0.0
        self._folder: Path | None = None
        self._lock: Lock | None = None
        self._fields: SeriesFile | None = None
        self._checkpoint: tuple[float, dict[str, np.ndarray]] | None = None
        self._finished = False
        self._started = self._flushed = perf_counter()
        self._interval = self._shortest = flush_interval
        try:
            self._open(folder, variables, resume)
        except BaseException:
            self._unlock()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._finished:
            return
        if error is None:
            self.finish({"reason": "ended before the simulation did"})
            return
        at = f"at t = {self._history.last_time:g} s"
        reason = f"interrupted {at}" if isinstance(error, KeyboardInterrupt) else str(error) or repr(error)
        # A full disk must not hide what went wrong in the first place.
        with suppress(OSError):
            self.finish({"reason": reason})

    @property
    def folder(self) -> Path | None:
        """The result folder, ``None`` in memory."""
        return self._folder

    def append(self, time: float, values: Mapping[str, float]) -> None:
        """Add a history row at ``time`` (s) with a value, in SI units, for each announced variable.

        Raises:
            ValueError: time does not increase, or the variables are not those announced.
            SimulationError: a value is not finite; the row is not stored.
        """
        self._history.append(time, values)
        self._flush_if_due()

    def append_block(self, times: ArrayLike, arrays: Mapping[str, ArrayLike]) -> None:
        """Add many history rows: ``times`` (n,) in s, and an array (n,) for each announced variable.

        Raises:
            ValueError: times do not increase, or the variables or shapes are not those announced.
            SimulationError: a value is not finite; the rows before it are stored.
        """
        self._history.append_block(times, arrays)
        self._flush_if_due()

    def field(self, time: float, values: Mapping[str, ArrayLike]) -> None:
        """Add the string's state at ``time`` (s).

        Args:
            time: increasing from call to call.
            values: ``arc_length`` (n,), of the nodes, m; ``position`` (n, 3), m; ``director1``, ``director3``
                (n, 3); ``rock_angle``, ``rock_height`` (m,); and any other field (n,) or (n, 3), in SI units.
                The same names and shapes at every call; arc length and diameters are kept from the first.
        """
        arrays = {ALIASES.get(name, name): np.asarray(value, dtype=float) for name, value in values.items()}
        static = {name: arrays.pop(name) for name in STATIC if name in arrays}
        if self._fields is None:
            path = None
            if self._folder is not None:
                path = self._folder / "fields" / "fields.nc"
                path.parent.mkdir(exist_ok=True)
            known = field_variables(arrays, self._field_units)
            sizes = {known[name].dims[0]: len(array) for name, array in arrays.items()} | {"xyz": 3}
            nodal = {name: (("node",), array, "m") for name, array in static.items()}
            self._fields = SeriesFile(path, known, sizes, nodal)
        self._fields.append_block([time], {name: array[None] for name, array in arrays.items()})
        self._flush_if_due()

    def checkpoint(self, time: float, state: Mapping[str, Any]) -> None:
        """Take note of the state at ``time`` (s): arrays, numbers, texts, or mappings of these; copied here.

        Give all rows and fields up to ``time`` first. It reaches the disk with the next flush, the newest one
        counts.
        """
        self._checkpoint = (float(time), flatten(state))
        self._flush_if_due()

    def update(self, **summary: Any) -> None:
        """Set entries of the summary (``steps``, ``newton_iterations``, ...), kept however the run ends."""
        self._summary |= summary

    def flush(self) -> None:
        """Bring the folder up to date."""
        start = perf_counter()
        self._history.flush()
        if self._folder is not None:
            if self._fields is not None and self._fields.pending:
                write_vtkhdf(self._folder / "fields" / "string.vtkhdf", self._fields.dataset())
            if self._checkpoint is not None:
                write_checkpoint(self._folder, *self._checkpoint)
                self._checkpoint = None
        self._write_summary()
        self._flushed = perf_counter()
        self._interval = max(self._shortest, (self._flushed - start) / MAX_SHARE)

    def finish(self, summary: Mapping[str, Any] | None = None) -> Result:
        """Write everything, ``summary`` (``converged``, ``reason``) into summary.json; give the result."""
        self._summary |= summary or {}
        if self._summary["converged"] and "reason" not in (summary or {}):
            self._summary["reason"] = "reached the end"
        self.flush()
        self._finished = True
        self._unlock()
        manifest = {} if self._folder is None else read_json(self._folder / "manifest.json")
        fields = None if self._fields is None else self._fields.dataset()
        return Result(self._history.dataset(), dict(self._summary), fields, manifest, self._folder, self._scene)

    def _flush_if_due(self) -> None:
        if self._folder is not None and perf_counter() - self._flushed > self._interval:
            self.flush()

    def _write_summary(self) -> None:
        ends = self._history.ends
        if "time" in ends:
            self._summary["simulated_seconds"] = ends["time"][1] - ends["time"][0]
        if "bit_depth" in ends:
            self._summary["drilled_depth"] = ends["bit_depth"][1]
        self._summary["wall_seconds"] = self._earlier_wall + perf_counter() - self._started
        if self._folder is not None:
            write_json(self._folder / "summary.json", self._summary)

    def _open(self, folder: str | Path | None, variables: Mapping[str, str], resume: bool) -> None:
        if folder is not None:
            self._folder = Path(folder) if resume else check_new_folder(folder)
            if resume:
                manifest, summary = (
                    read_json(self._folder / "manifest.json"),
                    read_json(self._folder / "summary.json"),
                )
                manifest |= {"runs": [*manifest.get("runs", []), this_run()], "versions": versions()}
                self._earlier_wall = float(summary.get("wall_seconds") or 0.0)
            else:
                manifest = new_manifest(self._scene, self._summary["model"])
                self._make(self._folder)
            self._lock = Lock(self._folder)
            remove_leftovers(self._folder)
            if resume:
                self.restart = read_checkpoint(self._folder)
            write_json(self._folder / "manifest.json", manifest)
        path = self._folder and self._folder / "history.nc"
        known = {name: STANDARD.get(name, Variable(units)) for name, units in variables.items()}
        try:
            self._history = SeriesFile(path, known)
        except (OSError, ValueError) as error:
            raise SceneError(f"{path}: cannot be continued ({error})") from error
        if self.restart is not None:
            self._history.truncate(self.restart[0])
            self._reopen_fields(self.restart[0])
        self._write_summary()

    @staticmethod
    def _make(folder: Path) -> None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise SceneError(f"{folder}: cannot be made ({error.strerror})") from error
        if not os.access(folder, os.W_OK):
            raise SceneError(f"{folder}: cannot be written to; choose another folder for the result")

    def _unlock(self) -> None:
        if self._lock is not None:
            self._lock.release()

    def _reopen_fields(self, time: float) -> None:
        assert self._folder is not None
        path = self._folder / "fields" / "fields.nc"
        if not path.exists():
            return
        data = _dataset(path)
        known, static = {}, {}
        for name, values in data.data_vars.items():
            dims, units = tuple(map(str, values.dims)), values.attrs["units"]
            if dims[0] == "time":
                known[str(name)] = Variable(units, dims[1:])
            else:
                static[str(name)] = (dims, values.values, units)
        sizes = {str(d): n for d, n in data.sizes.items() if d != "time"}
        self._fields = SeriesFile(path, known, sizes, static)
        self._fields.truncate(time)
