"""The compiled engine beside the PETSc engine: parts of a step, whole steps, growth with the number of elements.

Prints the page and writes docs/compiled-engine.md. Processor seconds, the least of several goes; both engines run in
turns in the same process, so that their ratio does not depend on who else uses the machine. Run it with
OPENBLAS_NUM_THREADS=1.
"""

from __future__ import annotations

import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from common import DOCS, machine, table
from petsc4py import PETSc

from drillfem.forms import virtual_work as vw
from drillfem.models.initial import initial_state
from drillfem.models.rod import Rod
from drillfem.scene import load_scene
from drillfem.solve.direct import DirectRun
from drillfem.solve.native import NativeScalar, NativeSolver, NativeVector

Array = npt.NDArray[np.float64]

#: Whole steps: title, scene, overrides, steps before and between the clock's readings.
SCENES: tuple[tuple[str, str, dict[str, Any], int, int], ...] = (
    ("vertical-c1-cd4 in space, 1 ms", "vertical-c1-cd4", {"model": "spatial"}, 50, 50),
    ("curved-c2, 5 ms", "curved-c2", {"time.end": 100, "output.interval": 0.1, "output.fields_interval": 10}, 50, 50),
    ("off-bottom, 200 elements, 5 ms", "off-bottom", {}, 50, 20),
    ("pendulum in the plane, 16 elements, 1 ms", "pendulum", {}, 50, 100),
)
COUNTS = (64, 128, 256, 512, 1000)


def least(works: dict[str, Callable[[], object]], repeat: int, goes: int = 7) -> dict[str, float]:
    """Least processor seconds of each of these, which take turns; ``repeat`` calls per go."""
    best = dict.fromkeys(works, np.inf)
    for work in works.values():
        work()
    for _ in range(goes):
        for name, work in works.items():
            start = time.process_time()
            for _ in range(repeat):
                work()
            best[name] = min(best[name], (time.process_time() - start) / repeat)
    return best


@dataclass(frozen=True)
class Parts:
    """Seconds of what a step is made of, by name: with PETSc and DOLFINx, and compiled."""

    petsc: dict[str, float]
    compiled: dict[str, float]


def parts(elements: int) -> Parts:
    """What a step of the vertical string is made of."""
    rod = Rod(load_scene("vertical-c1-cd4", {"model": "spatial", "mesh.elements": elements}))
    rod.set_state(initial_state(rod), np.zeros(rod.size))
    shift = 2e3
    rod.shift.value = shift
    off = vw.total({k: v for k, v in rod.terms.items() if k not in ("contact", "friction")})
    on, damping = vw.total(rod.terms), rod._powers["damping"]
    power = vw.powers(rod.ansatz, rod.u, rod.u_dot, rod.s, rod.section, rod.loads, rod.on)["damping"]
    matrix = rod.create_matrix()
    ksp = PETSc.KSP().create(matrix.comm)
    ksp.setOperators(matrix)
    ksp.setType("preonly")
    ksp.getPC().setType("lu")
    ksp.getPC().setFactorOrdering("rcm")
    b, y = matrix.createVecRight(), matrix.createVecLeft()
    out, u, u_dot = np.zeros(rod.size), rod.u.x.array.copy(), rod.u_dot.x.array.copy()
    assembled = {"off": rod._residual_off_wall, "on": rod._residual}
    native = {"off": NativeVector(off, rod), "on": NativeVector(on, rod)}
    native_power, solver = NativeScalar(power, rod), NativeSolver(rod.tangent, rod)

    def factorise() -> None:
        rod.jacobian(u, u_dot, shift, matrix)
        ksp.setOperators(matrix)
        ksp.setUp()

    factorise()
    solver.factorise()
    repeat = max(10, 20000 // elements)
    quick = least(
        {
            "residual, off the wall": lambda: assembled["off"](out),
            "residual, with contact": lambda: assembled["on"](out),
            "solve": lambda: ksp.solve(b, y),
            "power of damping": damping,
            "compiled residual, off the wall": lambda: native["off"](out),
            "compiled residual, with contact": lambda: native["on"](out),
            "compiled solve": lambda: solver.solve(out),
            "compiled power of damping": native_power,
        },
        repeat,
    )
    slow = least({"Jacobian and LU": factorise, "compiled Jacobian and LU": solver.factorise}, max(2, repeat // 30))
    both = quick | slow
    for item in (matrix, b, y, ksp):
        item.destroy()
    names = [name for name in both if not name.startswith("compiled")]
    return Parts({n: both[n] for n in names}, {n: both[f"compiled {n}"] for n in names})


@dataclass(frozen=True)
class Steps:
    """Seconds per step of both engines; iterations, factorisations; length of a step (s); relative difference."""

    petsc: float
    compiled: float
    iterations: float
    factorisations: float
    step: float
    apart: float


def steps(name: str, keys: dict[str, Any], before: int, count: int) -> Steps:
    """Both engines on a scene, in turns."""
    runs = []
    for engine in ("petsc", "compiled"):
        run = DirectRun(Rod(load_scene(name, keys | {"time.engine": engine})))
        run.restart()
        for _ in range(before):
            run.step(np.inf)
        runs.append(run)
    petsc, compiled = runs
    apart = float(np.abs(petsc.stepper.u - compiled.stepper.u).max() / np.abs(petsc.stepper.u).max())
    newton = compiled.stepper.newton
    begun = (compiled.steps, newton.iterations, newton.factorisations)
    seconds = least({"petsc": lambda: petsc.step(np.inf), "compiled": lambda: compiled.step(np.inf)}, count, goes=10)
    done = compiled.steps - begun[0]
    petsc.destroy()
    return Steps(
        seconds["petsc"],
        seconds["compiled"],
        (newton.iterations - begun[1]) / done,
        (newton.factorisations - begun[2]) / done,
        compiled.rod.scene.time.step,
        apart,
    )


def whole_step(elements: int) -> float:
    """Seconds of a step of the vertical string with the compiled engine."""
    keys = {"model": "spatial", "mesh.elements": elements, "time.engine": "compiled"}
    run = DirectRun(Rod(load_scene("vertical-c1-cd4", keys)))
    run.restart()
    for _ in range(10):
        run.step(np.inf)
    return least({"step": lambda: run.step(np.inf)}, max(10, 5000 // elements), goes=10)["step"]


def main() -> None:
    normal = machine()
    by_count = {n: parts(n) for n in COUNTS}
    cost = {part: [by_count[n].compiled[part] for n in COUNTS] for part in by_count[COUNTS[0]].compiled}
    cost["a whole step"] = [whole_step(n) for n in COUNTS]
    taken = {title: steps(name, keys, before, count) for title, name, keys, before, count in SCENES}
    shown = [64, 1000]
    part_rows = [
        [part]
        + [
            cell
            for n in shown
            for cell in (
                f"{1e6 * by_count[n].petsc[part]:.0f}",
                f"{1e6 * by_count[n].compiled[part]:.1f}",
                f"{by_count[n].petsc[part] / by_count[n].compiled[part]:.1f}",
            )
        ]
        for part in by_count[64].petsc
    ]
    growth = [
        [part, *[f"{1e6 * t:.1f}" for t in times], f"{np.polyfit(np.log(COUNTS), np.log(times), 1)[0]:.2f}"]
        for part, times in cost.items()
    ]
    step_rows = [
        [
            title,
            f"{1e3 * s.petsc:.3f}",
            f"{1e3 * s.compiled:.3f}",
            f"{s.petsc / s.compiled:.1f}",
            f"{s.iterations:.1f}",
            f"{s.factorisations:.2f}",
            f"{s.step / s.compiled:.3g}",
            f"{s.apart:.0e}",
        ]
        for title, s in taken.items()
    ]
    speeds = "; ".join(f"{name}: {1e3 * seconds:.1f} ms" for name, seconds in normal.items())
    step_head = [
        *("", "PETSc, ms", "compiled, ms", "ratio", "iterations", "factorisations"),
        *("simulated / processor", "apart"),
    ]
    head = ["µs per call", *[f"{n} elements: {what}" for n in shown for what in ("PETSc", "compiled", "ratio")]]
    text = f"""# The compiled engine

`time.engine = "compiled"` steps a rod by loops in C. It is no other model and no other method: forms, kernels of the
form compiler, Newton's method, bit, wall, drive, audit, results and checkpoints are those of the PETSc engine, and so
are the steps, up to round-off. It offers the integrators `theta` and `generalized-alpha` with equal steps, for every
dynamic scene that the PETSc engine runs. That engine is what this one is checked against. Default is this one in holes
that bend (its steps are the same, and there are many), the PETSc engine where the hole is straight.

```
drillfem run vertical-c1-cd4 --out cd4 --set model=spatial --set time.engine=compiled
```

## What is different

**Who assembles** (`solve/native.c`, `solve/native.py`). The kernels that FFCx wrote for the forms are called element by
element, on numbers read straight from the vectors of unknowns, the section field and the wall. Kernels of the cells are
compiled once more with SIMD lanes (`solve/lanes.py`): FFCx writes one operation per line on numbers of one element; the
same lines on vectors of numbers do 8 elements at once (4 or 2 on processors without AVX-512 or AVX). Where a line is
not of the few shapes that are known to be right, or does not compile, the kernel itself is called.

**Who factorises.** The Jacobian of a string of n elements of degree d is eliminated in three moves that are each linear
in n. (1) The kinematic rows, dr/dt = v and its like, are collocated at the nodes: they are solved node by node, which
leaves the velocities, 6 of 13 unknowns per node. (2) The d - 1 inner nodes of each element are condensed onto its two
vertices. (3) The vertices are a block tridiagonal system, of 6 x 6 blocks. Pivots are sought inside the blocks. Held
velocities are unit rows, as with PETSc. That the kinematic rows are local is checked at the first factorisation.

**Who steps** (`solve/compiled.py`). The end-point theta method and generalised-alpha as PETSc's TS states them,
including its start by two half steps of backward Euler and its way of refusing steps (a quarter of the length, ten
times at most). What it does not have: adaptive steps, BDF, ARKIMEX.

**Who iterates.** Without rock, in a hole that does not bend, in the plane or along the axis, Newton's method itself
runs in C: search of the wall, residual, solution, decision about a new factorisation, until a step is solved
([chapter 7](chapter-7.md) lives on it). It decides as the loop in Python does, on the same numbers.

The library is compiled once per source and processor, into the cache folder of the kernels; the loops keep no state of
their own, so that any number of engines live in one process.

## Parts of a step

`vertical-c1-cd4` in space (cubic elements, 13 unknowns per node), one core of {platform.machine()}, processor time.
This machine: {speeds}.

{table(head, part_rows)}

## Whole steps

Everything counts: Newton's method, search of the wall, bit and rock, powers for the energy balance. Iterations and
factorisations are per step, alike for both engines; the last column is the largest difference of the unknowns after 50
steps, relative to the largest unknown.

{table(step_head, step_rows)}

## Growth with the number of elements

Microseconds per call of the compiled loops, and the exponent p of a fit t ~ n^p:

{table(["", *[f"{n} elements" for n in COUNTS], "exponent"], growth)}

Written by `benchmarks/compiled.py`.
"""
    (DOCS / "compiled-engine.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
