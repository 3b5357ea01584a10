"""Run a scene: choose the engine, write the results, continue what was stopped."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from ..errors import SceneError
from ..models.frequencies import natural_frequencies_of
from ..results import Result, ResultWriter, open_result
from ..scene import Scene
from . import guards

log = logging.getLogger("drillfem")

#: relative error of the energy balance above which a run is not to be trusted
_SUSPECT = 1e-2

#: progress(t, t_end, simulated per wall second)
Progress = Callable[[float, float, float], None]


def _run(
    scene: Scene, out: Path | None, until: float | None, progress: Progress | None, resume: bool, warn: bool = True
) -> Result:
    end = scene.time.end if until is None else until
    if not end > scene.time.start:
        raise SceneError(f"until = {end:g} s: must be later than the start of the scene, {scene.time.start:g} s")
    engine = scene.engine
    guards.refuse(scene)
    for text in guards.warnings(scene) if warn else []:
        log.warning(text)
    began: list[float] = []

    def tell(t: float) -> None:
        # the pace counts from the first sign of life: compiling and setting up are not simulating
        if not began:
            began.extend((t, time.perf_counter()))
        elif progress is not None:
            progress(t, end, (t - began[0]) / max(time.perf_counter() - began[1], 1e-9))

    def writer(model: str, dofs: int, variables: dict[str, str]) -> ResultWriter:
        w = ResultWriter(out, scene, model, dofs, variables, resume)
        w.update(engine=engine, natural_frequencies=natural_frequencies_of(scene))
        return w

    if scene.time.analysis == "static":
        from .direct import run_static

        return run_static(scene, writer, tell)
    if engine == "soft-string":
        from .soft_string import run_soft_string

        result = run_soft_string(scene, writer, end, tell)
    elif engine not in ("petsc", "compiled"):
        from .straight import run_condensed

        result = run_condensed(scene, writer, end, tell)
    else:
        from .direct import run_dynamic

        result = run_dynamic(scene, writer, end, tell)
    error = result.summary["energy_balance_error"]
    if warn and error is not None and error > _SUSPECT:
        log.warning("energy balance error %.2g: these results are not to be trusted, try a smaller time.step", error)
    return result


def simulate(
    scene: Scene,
    out: str | Path | None = None,
    progress: Progress | None = None,
    until: float | None = None,
    *,
    warn: bool = True,
) -> Result:
    """Simulate a scene.

    scene: what to simulate. out: new folder for the result, or None to keep it in memory. progress: called with
    (time reached, time of the end, simulated seconds per wall second). until: stop at this time (s) rather than at
    ``time.end``. warn: log what is known to go wrong with the scene (`drillfem.solve.guards`), and an energy balance
    that does not close.

    Raises SceneError (bad input; nothing is written) and SimulationError (what was computed is kept in ``out``).
    """
    if warn and scene.random:
        means = ", ".join(f"{r.target} {r.centre:g}" for r in scene.random)
        log.info(f"random inputs at their means: {means}")
    return _run(scene, None if out is None else Path(out), until, progress, resume=False, warn=warn)


def resume(folder: str | Path, progress: Progress | None = None, until: float | None = None) -> Result:
    """Continue the run in ``folder`` from its last checkpoint, as if it had never stopped.

    Rows behind the checkpoint are computed again; the continued history equals that of an uninterrupted run bit for
    bit. ``until`` may lie beyond the scene's end. Raises SceneError if there is nothing to continue.
    """
    stored = open_result(folder)
    scene = stored.scene
    if scene is None:
        raise SceneError(f"{folder}: its manifest holds no scene, it cannot be continued")
    end = scene.time.end if until is None else until
    reached = float(stored.history["time"][-1])
    if scene.time.analysis == "static" or (stored.summary.get("converged") and reached >= end * (1 - 1e-12)):
        raise SceneError(f"{folder}: has reached t = {reached:g} s; give a later time to continue (--until)")
    return _run(scene, Path(folder), end, progress, resume=True)


def certify(scene: Scene, until: float | None = None, starts: int = 4) -> dict[str, Result]:
    """The same scene with half the step, with twice the elements, and from nearby initial states.

    Keys: ``half step``, ``double mesh``, ``start 1`` ... A number is worth what these leave unchanged.
    """
    half = replace(scene, time=replace(scene.time, step=scene.time.step / 2)).checked()
    mesh = replace(scene.mesh, elements=2 * scene.mesh.elements)
    rock = scene.rock
    if rock is not None:
        rock = replace(rock, surface=replace(rock.surface, elements=2 * rock.surface.elements))
    # explicit steps must follow the mesh
    double = replace(scene, mesh=mesh, rock=rock, time=half.time if scene.time.integrator == "explicit" else scene.time)
    double = double.checked()
    runs = {"half step": half, "double mesh": double}
    for k in range(1, starts + 1):
        nearby = replace(scene.initial, seed_perturbation=1e-3, seed=k)
        runs[f"start {k}"] = replace(scene, initial=nearby).checked()
    # what is wrong with the scene has been said about the run that these certify
    return {name: simulate(s, until=until, warn=False) for name, s in runs.items()}
