"""Time series in NetCDF-4 that grow, and are a complete file at every moment.

HDF5 files are not safe against being killed while they are written. So a file is never written in place: rows
collect in memory, and a flush copies the file, appends to the copy and moves it over the old one. Memory
holds only what was not flushed yet, whatever the length of the run.
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5netcdf
import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from drillfem.errors import SimulationError

from .atomic import replacing


@dataclass(frozen=True)
class Variable:
    """One variable of a time series: its units, its dimensions after ``time``, and what it is in words."""

    units: str
    dims: tuple[str, ...] = ()
    long_name: str = ""


STANDARD: dict[str, Variable] = {
    "bit_angular_speed": Variable("rad/s", long_name="angular speed of the bit, positive when drilling"),
    "bit_axial_speed": Variable("m/s", long_name="axial speed of the bit, positive down"),
    "bit_angle": Variable("rad", long_name="angle the bit has turned by"),
    "bit_depth": Variable("m", long_name="depth drilled, from 0"),
    "bit_torque": Variable("N m", long_name="torque on bit"),
    "bit_weight": Variable("N", long_name="weight on bit"),
    "depth_of_cut": Variable("m", long_name="depth of cut, sum over the blades"),
    "top_torque": Variable("N m", long_name="torque of the top drive"),
    "top_angular_speed": Variable("rad/s", long_name="angular speed of the top drive"),
    "hook_load": Variable("N", long_name="hook load"),
    "top_power": Variable("W", long_name="power put in by the top drive"),
    "kinetic_energy": Variable("J", long_name="kinetic energy of the string"),
    "strain_energy": Variable("J", long_name="strain energy of the string"),
}
"""What every drilling scene stores; a scene without a bit leaves out ``bit_*`` and ``depth_of_cut``."""


class SeriesFile:
    """A growing data set over ``time``, in ``path`` or (``path=None``) in memory.

    Args:
        path: NetCDF-4 file, created at the first flush; an existing one is continued.
        variables: what a row consists of, by name.
        sizes: length of each dimension that a variable has besides ``time``.
        static: variables that do not change: name to (dimensions, values, units).
    """

    def __init__(
        self,
        path: Path | None,
        variables: Mapping[str, Variable],
        sizes: Mapping[str, int] | None = None,
        static: Mapping[str, tuple[tuple[str, ...], ArrayLike, str]] | None = None,
    ) -> None:
        self.path = path
        self.variables = dict(variables)
        self.sizes = dict(sizes or {})
        self.static = {
            name: (dims, np.asarray(values), units) for name, (dims, values, units) in (static or {}).items()
        }
        self.last_time = -math.inf
        self.ends: dict[str, tuple[float, float]] = {}
        """First and last value of each scalar variable and of ``time``, of all rows so far."""
        self._names = tuple(self.variables)
        self._rows: list[tuple[float, ...]] = []
        self._blocks: list[dict[str, NDArray[np.float64]]] = []
        self._keep: int | None = None
        if path is not None and path.exists():
            with h5netcdf.File(path, "r") as file:
                missing = set(self.variables).symmetric_difference(set(file.variables) - {"time"} - set(self.static))
                if missing:
                    raise ValueError(f"{path.name} has other variables than this run: {', '.join(sorted(missing))}")
                self._read_ends(file, file.dimensions["time"].size)

    @property
    def pending(self) -> bool:
        """Whether there are rows that are not in the file."""
        return bool(self._rows or self._blocks)

    def append(self, time: float, values: Mapping[str, float]) -> None:
        """Add one row of scalars at ``time`` (s).

        Raises:
            ValueError: time does not increase, or ``values`` are not the variables of this file.
            SimulationError: a value is not finite; the row is not stored.
        """
        if len(values) != len(self._names):
            self._wrong_names(values)
        try:
            row = (float(time), *(float(values[name]) for name in self._names))
        except KeyError:
            self._wrong_names(values)
        if not row[0] > self.last_time:
            raise ValueError(f"time must increase: {time} s after {self.last_time} s")
        if not math.isfinite(sum(row)):
            bad = next((n for n, v in zip(self._names, row[1:], strict=True) if not math.isfinite(v)), "a value")
            raise SimulationError(f"{bad} is not finite at t = {time:g} s")
        self._rows.append(row)
        self.last_time = row[0]

    def append_block(self, times: ArrayLike, arrays: Mapping[str, ArrayLike]) -> None:
        """Add many rows: ``times`` (n,) in s, and arrays of shape (n, ...) for each variable.

        Raises:
            ValueError: times do not increase, or names or shapes are not those of this file.
            SimulationError: a value is not finite; the rows before it are stored.
        """
        time = np.array(times, dtype=float, ndmin=1)
        if set(arrays) != set(self._names):
            self._wrong_names(arrays)
        if len(time) == 0:
            return
        block = {"time": time}
        for name, variable in self.variables.items():
            block[name] = np.array(arrays[name], dtype=float, ndmin=1)
            shape = (len(time), *(self.sizes[dim] for dim in variable.dims))
            if block[name].shape != shape:
                raise ValueError(f"{name} has shape {block[name].shape}, not {shape}")
        if not (time[0] > self.last_time and np.all(np.diff(time) > 0)):
            raise ValueError(f"time must increase: {time[0]} s to {time[-1]} s after {self.last_time} s")
        first_bad, culprit = len(time), ""
        for name, values in block.items():
            finite = np.isfinite(values).reshape(len(time), -1).all(axis=1)
            if not finite.all() and int(np.argmin(finite)) < first_bad:
                first_bad, culprit = int(np.argmin(finite)), name
        self._seal()
        if first_bad:
            self._add({name: values[:first_bad] for name, values in block.items()})
            self.last_time = float(time[first_bad - 1])
        if culprit:
            raise SimulationError(f"{culprit} is not finite at t = {time[first_bad]:g} s")

    def flush(self) -> None:
        """Bring the file up to date with all rows. Without a path: does nothing."""
        self._seal()
        if self.path is None or not self._blocks:
            return
        exists = self.path.exists()
        with replacing(self.path) as part:
            if exists:
                shutil.copyfile(self.path, part)
            with h5netcdf.File(part, "a" if exists else "w") as file:
                if not exists:
                    self._create(file)
                start = file.dimensions["time"].size if self._keep is None else self._keep
                block = self._joined(float(file.variables["time"][start - 1]) if start else -math.inf)
                stop = start + len(block["time"])
                file.resize_dimension("time", stop)  # longer, or shorter after a truncation
                for name, values in block.items():
                    file.variables[name][start:stop] = values
        # Only now: an interruption before this line must find the rows still here. One after the move and
        # before this line makes them come twice; _joined drops what the file has already.
        self._blocks, self._keep = [], None

    def truncate(self, time: float) -> None:
        """Drop all rows after ``time`` (s). The file loses them with the first flush that brings new ones."""
        self.flush()
        if self.path is None or not self.path.exists():
            return
        with h5netcdf.File(self.path, "r") as file:
            times = np.asarray(file.variables["time"][:])
            self._keep = int(np.searchsorted(times, time + 1e-9 * max(1.0, abs(time)), side="right"))
            self._read_ends(file, self._keep)

    def dataset(self) -> xr.Dataset:
        """All rows so far, loaded into memory."""
        self.flush()
        if self.path is not None and self.path.exists():
            return xr.load_dataset(self.path, engine="h5netcdf")
        block = self._joined(-math.inf)
        data = xr.Dataset(coords={"time": ("time", block["time"], {"units": "s", "long_name": "time"})})
        for name, variable in self.variables.items():
            data[name] = (("time", *variable.dims), block[name], self._attributes(variable))
        for name, (dims, values, units) in self.static.items():
            data[name] = (dims, values, {"units": units})
        return data

    def _wrong_names(self, values: Mapping[str, Any]) -> None:
        wrong = ", ".join(sorted(set(values).symmetric_difference(self._names)))
        raise ValueError(f"a row must have exactly the variables that were announced; missing or unknown: {wrong}")

    def _seal(self) -> None:
        """Turn the rows that came one by one into a block."""
        if self._rows:
            table = np.array(self._rows)
            self._add({name: table[:, k] for k, name in enumerate(("time", *self._names))})
            self._rows = []

    def _add(self, block: dict[str, NDArray[np.float64]]) -> None:
        self._blocks.append(block)
        for name, values in block.items():
            if values.ndim == 1:
                self.ends[name] = (self.ends.get(name, values)[0], float(values[-1]))

    def _joined(self, after: float) -> dict[str, NDArray[np.float64]]:
        """All blocks as one, without the rows at or before ``after`` and without repetitions."""
        if not self._blocks:
            return {n: np.empty((0, *(self.sizes[d] for d in v.dims))) for n, v in self._all().items()}
        block = {name: np.concatenate([b[name] for b in self._blocks]) for name in self._all()}
        before = np.concatenate([[after], np.maximum.accumulate(np.maximum(block["time"], after))[:-1]])
        new = block["time"] > before
        return block if new.all() else {name: values[new] for name, values in block.items()}

    def _all(self) -> dict[str, Variable]:
        return {"time": Variable("s", long_name="time"), **self.variables}

    @staticmethod
    def _attributes(variable: Variable) -> dict[str, str]:
        return {"units": variable.units} | ({"long_name": variable.long_name} if variable.long_name else {})

    def _create(self, file: h5netcdf.File) -> None:
        file.dimensions = {"time": None, **self.sizes}
        for name, variable in self._all().items():
            shape = tuple(self.sizes[dim] for dim in variable.dims)
            rows = max(1, min(2048, 2**14 // math.prod(shape)))
            new = file.create_variable(name, ("time", *variable.dims), float, chunks=(rows, *shape))
            new.attrs.update(self._attributes(variable))
        for name, (dims, values, units) in self.static.items():
            file.create_variable(name, dims, values.dtype, data=values).attrs["units"] = units

    def _read_ends(self, file: h5netcdf.File, size: int) -> None:
        self.ends, self.last_time = {}, -math.inf
        if size:
            scalar = ["time", *(name for name, variable in self.variables.items() if not variable.dims)]
            self.ends = {n: (float(file.variables[n][0]), float(file.variables[n][size - 1])) for n in scalar}
            self.last_time = self.ends["time"][1]
