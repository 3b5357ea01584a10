"""Speed beside accuracy: the string of vertical-c1-cd4 on both rungs. Prints a table and writes docs/speed.md.

Run it with OPENBLAS_NUM_THREADS=1 on a quiet machine; processor seconds stand beside wall seconds.
"""

from __future__ import annotations

import platform

from common import DOCS, Timed, difference, machine, table, timed

SCENE, END = "vertical-c1-cd4", 5.0
COMPARED = ("bit_angle", "bit_depth", "bit_angular_speed", "depth_of_cut")
ROW = 4e-3
"""Common spacing of the history rows, s."""


def run(until: float = END, **overrides: object) -> Timed:
    return timed(SCENE, until, output__interval=ROW, output__fields_interval=END, **overrides)


def rows(runs: dict[str, Timed], reference: Timed) -> list[list[str]]:
    return [
        [name, f"{one.per_wall:.3g}", f"{one.per_cpu:.3g}"]
        + [f"{difference(reference.result, one.result, variable):.1e}" for variable in COMPARED]
        for name, one in runs.items()
    ]


def main() -> None:
    for model in ("spatial", "axial-torsional"):  # compile before the clock starts
        run(0.02, model=model)
    normal = machine()

    full = {"model": "spatial", "time__jacobian": "every-iteration"}
    kept = {"model": "spatial", "time__jacobian": "kept"}
    spatial = {
        "Jacobian kept, 1 ms": run(**kept, time__step=1e-3),
        "full Newton, 1 ms": run(**full, time__step=1e-3),
        "Jacobian kept, 0.5 ms": run(**kept, time__step=5e-4),
        "full Newton, 0.5 ms": run(**full, time__step=5e-4),
        "trapezoidal rule, Jacobian kept, 1 ms": run(**kept, time__step=1e-3, time__integrator="theta"),
    }
    fine = run(**kept, time__step=1e-4)
    straight = {
        "condensed, 2 ms": run(model="axial-torsional", time__step=2e-3),
        "condensed, 1 ms": run(model="axial-torsional", time__step=1e-3),
        "condensed, 0.5 ms": run(model="axial-torsional", time__step=5e-4),
        "PETSc, 1 ms": run(model="axial-torsional", time__engine="petsc", time__step=1e-3),
        "PETSc, 0.5 ms": run(model="axial-torsional", time__engine="petsc", time__step=5e-4),
    }
    exact = run(model="axial-torsional", time__step=5e-5)
    long = timed(SCENE, 200.0, model="axial-torsional")

    quick, slow = spatial["Jacobian kept, 1 ms"], spatial["full Newton, 0.5 ms"]
    same = max(difference(spatial["full Newton, 1 ms"].result, quick.result, v) for v in COMPARED)
    shared = [
        f"{spatial[a].per_cpu / spatial[b].per_cpu:.1f}"
        for a, b in (("Jacobian kept, 1 ms", "full Newton, 1 ms"), ("Jacobian kept, 0.5 ms", "full Newton, 0.5 ms"))
    ]
    head = ["", "simulated / wall", "simulated / CPU", *[f"error: {v.replace('_', ' ')}" for v in COMPARED]]
    between = max(difference(exact.result, fine.result, v) for v in ("bit_angle", "bit_depth"))
    text = f"""# Speed

`{SCENE}`, 64 cubic elements, the first {END:g} s, one core of {platform.machine()}. Written by `benchmarks/speed.py`. Errors are
the largest in these {END:g} s, relative to the largest value, against the last line of what is said under each table. CPU seconds
are those of the process; wall seconds include whatever else the machine did.

This machine: {"; ".join(f"{name}: {1e3 * seconds:.1f} ms" for name, seconds in normal.items())}.

## The rod in space (13 fields, {quick.result.summary["dofs"]} unknowns)

{table(head, rows(spatial, fine))}

Reference: the same rod at 0.1 ms. Keeping the Jacobian (and turning it with the string) is {shared[0]} times (1 ms) and
{shared[1]} times (0.5 ms) as fast as full Newton; the two differ by {same:.0e} at the same step. Against full Newton at half the step
the run is {quick.per_cpu / slow.per_cpu:.1f} times as fast. What half the step gains is the error of the time integrator (second order), which
is the same for both.

## The straight string (condensed to its bit)

{table(head, rows(straight, exact))}

Reference: condensed at 0.05 ms. Angle and depth of the two references differ by {between:.0e}. The whole scene, 200 s at its own
step with all rows stored: {long.per_wall:.0f} simulated seconds per wall second, {long.per_cpu:.0f} per CPU second.
"""
    (DOCS / "speed.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
