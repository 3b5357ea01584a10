"""The main jobs, end to end: a 1200 m string drills rock, or a string starts to turn in a real well."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .cli import ProgressDisplay
from .errors import SceneError
from .render import render_all
from .results import Result, print_summary, store_statistics
from .scene import load_scene
from .solve.run import certify, simulate
from .torque_drag.command import run as torque_and_drag

#: The scene and how much of it the spatial rod drills.
SCENE, SECONDS = "vertical-c1-cd4", 20.0
#: The real well, and how long its string is turned.
WELL, TURNED = "survey-p11-a-02", 30.0
JOBS = ("drilling", "well")


def free_folder(wish: Path) -> Path:
    """``wish``, or the first of ``wish-2``, ``wish-3``, ... that does not exist yet: no result is overwritten."""
    folder, k = wish, 2
    while folder.exists() and any(folder.iterdir()):
        folder, k = wish.with_name(f"{wish.name}-{k}"), k + 1
    return folder


def main(out: Path, job: str = JOBS[0], seconds: float | None = None) -> Result:
    """Do one of `JOBS` for so many simulated ``seconds`` into ``out`` (or a free folder beside it)."""
    if job not in JOBS:
        raise SceneError(f"demo {job!r}: must be one of {', '.join(JOBS)}")
    folder = free_folder(out)
    return drill(folder, seconds or SECONDS) if job == "drilling" else turn(folder, seconds or TURNED)


def drill(folder: Path, seconds: float) -> Result:
    """Drill ``seconds`` with the spatial rod into ``folder``, compare, draw."""
    scene = load_scene(SCENE, {"model": "spatial", "output.fields_interval": "25 ms"})
    straight = load_scene(SCENE, {"model": "axial-torsional"})
    print(f"{scene.title}: a {scene.length:g} m string drills rock for {seconds:g} s, as a rod in space.")
    with ProgressDisplay() as progress:
        result = simulate(scene, out=folder, progress=progress, until=seconds)
    print("The same on the axial-torsional rung; then with half the step, a finer mesh, and nearby starts.")
    companions = {"axial-torsional": simulate(straight, until=seconds), **certify(straight, seconds)}
    print_summary(result, companions)
    print("The rod in space is stepped by a second-order rule, the straight string has exact waves: most of what")
    print("the first two runs differ by is that. With --set time.step='0.5 ms' it falls to a quarter.")
    store_statistics(result, companions)
    print(f"The result is in {folder}:")
    for path in render_all(folder):
        print(f"  {path}")
    print(f"Next: drillfem info {SCENE}; drillfem resume {folder} --until 60; drillfem list")
    return result


def turn(folder: Path, seconds: float) -> Result:
    """Turn a string in the real well for ``seconds`` from rest into ``folder``; torque and drag beside it; draw."""
    scene = load_scene(WELL, {"output.fields_interval": "0.1 s"})
    print(f"{scene.title}: a {scene.length:g} m string starts to turn in a real well, {seconds:g} s.")
    with ProgressDisplay() as progress:
        result = simulate(scene, out=folder, progress=progress, until=seconds)
    print_summary(result)
    store_statistics(result)
    print("Static torque and drag of the same string (soft string):")
    steady = torque_and_drag(scene, folder / "torque-drag").first[0]
    history = result.history
    late = np.asarray(history["time"]) > 2 / 3 * seconds
    torque = float(np.asarray(history["top_torque"])[late].mean())
    print(
        f"Torque of the drive, mean of the last {seconds / 3:.3g} s: {torque / 1e3:.2f} kN m; "
        f"steady rotation by torque and drag: {steady.surface_torque / 1e3:.2f} kN m."
    )
    print(f"The result is in {folder}:")
    for path in render_all(folder, film=True):
        print(f"  {path}")
    print(f"Next: docs/curved-wells.md; drillfem resume {folder} --until 60; drillfem torque-drag {WELL} --out loads")
    return result
