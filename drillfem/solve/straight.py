"""Runs of strings that march in compiled loops: chunks of steps, rows, pictures and checkpoints between them."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from ..bitrock.jit import announce
from ..bitrock.law import BitLaw
from ..bitrock.surface import RockSurface
from ..errors import SimulationError
from ..models.straight import StraightString
from ..results import Result, ResultWriter
from ..scene import Scene
from .audit import WORKS, Array, imbalance, variables
from .characteristics import CharacteristicString, shafts_of
from .condensed import CondensedString
from .contact import rock_picture, surface_of
from .guards import runaway

#: The chunk between two looks at the clock (s of wall time, roughly) and its size at the start (steps).
_CHUNK_SECONDS, _FIRST_CHUNK = 0.25, 200


class Engine(Protocol):
    """A string that marches by itself; see `CondensedString`."""

    count: int

    @property
    def time(self) -> float: ...
    @property
    def counters(self) -> dict[str, int]: ...
    def sample(self) -> dict[str, float]: ...
    def advance(self, steps: int, every: int = 1) -> dict[str, Array]: ...


class Run(Protocol):
    """A scene in such an engine, with the history and the fields of a result."""

    energy_error: float
    #: model, unknowns, and variables of the history with their units
    model: str
    dofs: int
    variables: dict[str, str]

    @property
    def string(self) -> Engine: ...
    def history(self, rows: dict[str, Any]) -> tuple[Array, dict[str, Array]]: ...
    def fields(self) -> dict[str, Array]: ...
    def save(self) -> dict[str, Any]: ...
    def load(self, state: dict[str, Any]) -> None: ...


class StraightRun:
    """A scene's string in the condensed engine, with the fields and the history of a rod."""

    def __init__(self, scene: Scene) -> None:
        announce()
        self.scene, self.line = scene, StraightString(scene)
        self.model, self.dofs, self.variables = self.line.model, self.line.dofs, variables(True)
        drive, time = scene.top_drive, scene.time

        def top(times: Array) -> tuple[Array, Array]:
            motions = [drive.motion(float(t)) for t in times + time.start]
            return np.array([m[0] for m in motions]), np.array([m[1] for m in motions])

        law, rock = BitLaw.from_scene(scene), surface_of(scene)
        turned = (drive.speed or 0.0) if drive.kind == "imposed-speed" else top
        hook_load, line = scene.nominal().hook_load, self.line
        self.string: CondensedString | CharacteristicString
        if scene.engine == "characteristics":
            shafts, bit_inertia = shafts_of(scene)
            self.string = CharacteristicString(
                line.axial,
                shafts,
                line.arc_length,
                law,
                rock,
                time.step,
                hook_load=hook_load,
                top=turned,
                bit_inertia=bit_inertia,
                top_inertia=scene.ends.top_inertia,
            )
        else:
            self.string = CondensedString(
                line.axial,
                line.torsion,
                law,
                rock,
                time.step,
                hook_load=hook_load,
                top=turned,
                integrator="exact" if time.integrator == "default" else time.integrator,
            )
        self.string.reset(*self.line.start())
        first = self.string.sample()
        # the bit's angle counts from the start, and its twist there is part of the state
        self.angle_start = first["bit_angle"]
        self.stored_at_start = first["kinetic_energy"] + first["strain_energy"]
        self.scale = 0.0

    @property
    def surface(self) -> RockSurface:
        """The rock."""
        return self.string.surface

    def history(self, rows: dict[str, Any]) -> tuple[Array, dict[str, Array]]:
        """Times (n,) and history arrays (n,) from the engine's rows; updates the error of the energy balance."""
        rows = {name: np.atleast_1d(values) for name, values in rows.items()}
        rows["bit_angle"] = rows["bit_angle"] - self.angle_start
        rows["work_bit"] = rows["work_cutting"] + rows["work_wear_flat"]
        rows["work_wall"] = np.zeros_like(rows["time"])
        stored = rows["kinetic_energy"] + rows["strain_energy"]
        error, self.scale = imbalance({name: rows[name] for name in WORKS}, stored, self.stored_at_start, self.scale)
        self.energy_error = float(error[-1])
        return rows["time"] + self.scene.time.start, {name: rows[name] for name in variables(True)}

    energy_error = 0.0

    def fields(self) -> dict[str, Array]:
        """Fields along the string now."""
        return self.line.fields(**self.string.fields()) | rock_picture(self.surface)

    def save(self) -> dict[str, Any]:
        """State for a checkpoint."""
        return {"string": self.string.state_dict(), "scale": self.scale}

    def load(self, state: dict[str, Any]) -> None:
        """Continue from a saved state."""
        self.string.load(state["string"])
        self.scale = float(state["scale"])


def march(
    scene: Scene, run: Run, writer_of: Callable[..., ResultWriter], until: float, progress: Callable[[float], None]
) -> Result:
    """March a scene to ``until``, writing as it goes."""
    writer = writer_of(run.model, run.dofs, run.variables)
    string, start, step = run.string, scene.time.start, scene.time.step
    end = round((until - start) / step)
    every = round(scene.output.interval / step)
    pictures = max(every, round(scene.output.fields_interval / step))
    saves = max(1, round(scene.output.checkpoint_interval / step))

    def report() -> dict[str, Any]:
        return {"energy_balance_error": run.energy_error, **string.counters}

    with writer:
        if writer.restart is not None:
            run.load(writer.restart[1])
        else:
            times, rows = run.history(string.sample())
            writer.append_block(times, rows)
            writer.field(start, run.fields())
            writer.checkpoint(start, run.save())
        chunk = _FIRST_CHUNK
        while string.count < end:
            # chunks end at whatever comes first: a picture, a checkpoint, or the patience of the user
            stops = [end, string.count + chunk]
            stops += [(string.count // n + 1) * n for n in (pictures, saves)]
            stop = min(stops)
            began = time.perf_counter()
            rows = string.advance(stop - string.count, every)
            pace = (time.perf_counter() - began) / max(1, len(rows["time"])) / every
            chunk = max(_FIRST_CHUNK, math.floor(_CHUNK_SECONDS / max(pace, 1e-9)))
            t = start + string.time
            why = ""
            if len(rows["time"]):
                times, values = run.history(rows)
                writer.append_block(times, values)
                why = runaway({"time": times} | values, scene)
            writer.update(**report())
            if why:
                raise SimulationError(why)
            if string.count % pictures == 0:
                writer.field(t, run.fields())
            if string.count % saves == 0:
                writer.checkpoint(t, run.save())
            progress(t)
        return writer.finish({**report(), "converged": True})


def run_condensed(
    scene: Scene, writer_of: Callable[..., ResultWriter], until: float, progress: Callable[[float], None]
) -> Result:
    """March a straight drilling string to ``until``, writing as it goes."""
    return march(scene, StraightRun(scene), writer_of, until, progress)
