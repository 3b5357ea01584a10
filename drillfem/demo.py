"""The main job, end to end: a 1200 m string drills rock; a history, a table and pictures."""

from __future__ import annotations

from pathlib import Path

from .cli import ProgressDisplay
from .render import render_all
from .results import Result, print_summary, store_statistics
from .scene import load_scene
from .solve.run import certify, simulate

#: The scene and how much of it the spatial rod drills.
SCENE, SECONDS = "vertical-c1-cd4", 20.0


def free_folder(wish: Path) -> Path:
    """``wish``, or the first of ``wish-2``, ``wish-3``, ... that does not exist yet: no result is overwritten."""
    folder, k = wish, 2
    while folder.exists() and any(folder.iterdir()):
        folder, k = wish.with_name(f"{wish.name}-{k}"), k + 1
    return folder


def main(out: Path, seconds: float = SECONDS) -> Result:
    """Drill ``seconds`` with the spatial rod into ``out`` (or a free folder beside it), compare, draw."""
    folder = free_folder(out)
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
