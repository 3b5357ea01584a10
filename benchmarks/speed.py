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
        "generalised-alpha, kept, 1 ms": run(**kept, time__step=1e-3, time__integrator="generalized-alpha"),
        "generalised-alpha, kept, 0.5 ms": run(**kept, time__step=5e-4, time__integrator="generalized-alpha"),
    }
    fine = run(**kept, time__step=1e-4)
    # the condensed string is so fast that 5 s would time its set-up
    straight = {
        f"condensed, {1e3 * h:g} ms": run(100.0, model="axial-torsional", time__step=h)
        for h in (4e-3, 2e-3, 1e-3, 5e-4)
    }
    straight |= {
        f"PETSc, {1e3 * h:g} ms": run(model="axial-torsional", time__engine="petsc", time__step=h) for h in (1e-3, 5e-4)
    }
    exact = run(model="axial-torsional", time__step=5e-5)
    long = timed(SCENE, 200.0, model="axial-torsional")

    at_one, at_half = (
        difference(spatial[f"full Newton, {h} ms"].result, spatial[f"Jacobian kept, {h} ms"].result, "bit_angle")
        for h in ("1", "0.5")
    )
    one, half = (
        spatial[f"Jacobian kept, {h} ms"].per_cpu / spatial[f"full Newton, {h} ms"].per_cpu for h in ("1", "0.5")
    )
    quick, slow = spatial["Jacobian kept, 1 ms"], spatial["full Newton, 0.5 ms"]
    halving = quick.per_cpu / spatial["Jacobian kept, 0.5 ms"].per_cpu
    head = ["", "simulated / wall", "simulated / CPU", *[f"error: {v.replace('_', ' ')}" for v in COMPARED]]
    between = max(difference(exact.result, fine.result, v) for v in ("bit_angle", "bit_depth"))
    speeds = "; ".join(f"{name}: {1e3 * seconds:.1f} ms" for name, seconds in normal.items())
    text = f"""# Speed

`{SCENE}`, 64 cubic elements, one core of {platform.machine()}. Written by `benchmarks/speed.py`.
Errors are the largest over the first {END:g} s, relative to the largest value, against the reference named under
each table; that of the depth of cut is one of timing, of steep fronts that come a little early or late.
CPU seconds are those of the process; wall seconds include what else the machine did.

This machine: {speeds}.

## The rod in space (13 fields, {quick.result.summary["dofs"]} unknowns)

{table(head, rows(spatial, fine))}

Reference: the same rod at 0.1 ms. Keeping the Jacobian, and turning it with the string, is {one:.0f} times as
fast as full Newton at 1 ms and {half:.0f} times at 0.5 ms, and costs no accuracy: the angles differ by
{at_one:.0e} and {at_half:.0e} at equal step. Half the step takes {halving:.1f} times as long and has a quarter of the
error of the time integrator, with either Newton. Kept at 1 ms is {quick.per_cpu / slow.per_cpu:.0f} times as fast as
full Newton at half the step.

## The straight string (condensed to its bit)

{table(head, rows(straight, exact))}

Reference: condensed at 0.05 ms. Angle and depth of the two references differ by {between:.0e}. Condensed
speeds are of 100 s with a row every 4 ms. The whole scene, 200 s at its own step with every step stored:
{long.per_wall:.0f} simulated seconds per wall second, {long.per_cpu:.0f} per CPU second.
"""
    (DOCS / "speed.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
