"""All charts of speed against accuracy, into docs/img, and the page docs/accuracy-and-speed.md from their numbers.

Run it with OPENBLAS_NUM_THREADS=1 on a quiet machine (minutes). Name cases to measure only those; with ``--text`` none
is measured. The page is written from the numbers in docs/img.
"""

from __future__ import annotations

import platform
import sys
import textwrap

from common import DOCS, table

from drillfem.chart import CASES, Chart
from drillfem.chart.points import NORMALISER, Panel, Point, reach
from drillfem.chart.report import TARGETS, cheapest, cost_text, header, main, never, rows, size_text

IMAGES = DOCS / "img"

INTRODUCTION = """\
What accuracy costs: error against CPU time, by integrator, step, element, rock-surface scheme, \
Newton strategy and rung of the ladder. Written by `benchmarks/charts.py`; `drillfem chart` measures the same on \
your machine.

**Cost** is the CPU time of the stepping alone (no set-up, no compilation; the least of a few repetitions) over \
that of a fixed piece of work measured in the same run: {normaliser}. Here that took {least:.2f} to {most:.2f} \
ms on {machine}. **Error** is a relative L2 error over the whole horizon, against the reference named above each \
panel. **Orders** are fitted by least squares to the finest points with an error below 0.1 that lie clear of the \
floor (the error that all points share). The pale band is the **Pareto front**: nothing computed is both cheaper \
and more accurate. The ring is what the program takes by **default**. In the tables, costs of an accuracy are \
read off between the points; "≤" stands where the coarsest point computed is accurate enough."""

#: What a panel shows, true whatever the numbers are.
PROSE = {
    ("waves", "integrators"): (
        "A pulse of twist runs down the pipe, is split at the collars, and comes back from the bit and the top. All "
        "methods step the same weak form through PETSc TS with the Jacobian kept."
    ),
    ("waves", "modes"): (
        "A straight string is linear between its ends. In modal coordinates its waves cost no accuracy at any step, "
        "which is what the condensed engine builds on; the other two rules have an error in time on the same matrices. "
        "Central differences fail beyond their limit, which the mesh sets."
    ),
    ("waves", "meshes"): (
        "Exact in time, so that only the elements are seen. Waves are carried too slowly or too fast by "
        "coarse elements long before their shape is lost: until the error of the shape takes over, the fitted order "
        "lies above degree + 1."
    ),
    ("lumped", "steps"): (
        "One mass, one inertia, one spring: the engine is exact between the bit's forces, and the step is there to "
        "resolve the cut."
    ),
    ("torsional", "steps"): (
        "Waves of twist, undamped: characteristics march them exactly, elements leave the error of the dashed level, "
        "which is not in the points, as each engine is compared with itself. Without damping spin jumps run through "
        "the string whenever the bit sticks or slips, and no method is of a high order."
    ),
    ("axial-torsional", "steps"): (
        "The condensed engine beside PETSc TS on the weak form, the latter with its Jacobian kept and renewed in every "
        "Newton iteration: the strategies differ in cost and not in error."
    ),
    ("axial-torsional", "rungs"): (
        "The lower rungs on the same scene. A finer step does not bring them nearer: what is left is their modelling "
        "error, the dashed level. Along the axis the torsional and the lumped model carry the collars only, as one "
        "rigid mass."
    ),
    ("torsional", "rungs"): (
        "The lumped model on the same scene: what no step removes is its modelling error, the dashed level."
    ),
    ("off-bottom", "steps"): (
        "The whole rod on its wall. The compiled engine and PETSc take the same steps by the same forms: engine and "
        "Newton strategy differ in cost and not in error. Methods of the second order are of the first here, probably "
        "because the motion is not smooth in time: fronts of waves run down, and points touch, leave and slide."
    ),
    ("off-bottom", "contact"): (
        "One string, one step, and walls from soft to stiff, against a wall that lets nothing in. The error of a "
        "penalty goes with its compliance until the wall is stiffer than mesh and step can follow. The closest point "
        "as an unknown (D-6) gives the same and costs three times as much; an augmented Lagrangian 1.5 to 2 "
        "times, on a soft wall many times."
    ),
    ("off-bottom", "meshes"): (
        "Reduced integration, the default, lets sections turn that torque then feeds: on 50 m elements the run breaks "
        "down, on shorter ones it lasts these two seconds and is the cheapest. Whether it lasts longer is what the "
        "guard tells ([where methods fail](failure-atlas.md)); full integration needs none."
    ),
    ("off-bottom", "laid"): (
        "The start alone: a frictionless equilibrium. Where the wall's boundary layer is shorter than the elements, "
        "four points per element zigzag, the two of the augmented Lagrangian do not ([contact](contact.md))."
    ),
}
#: Facts of that case: engine, Newton strategy by engine.
OFF_BOTTOM = (
    "PETSc over compiled",
    "full Newton over kept Jacobian, compiled",
    "full Newton over kept Jacobian, PETSc",
)
SURFACES = (
    "All with one step, against the exact surface at the same step: what is seen is the scheme alone. First-order "
    "upwind cells diffuse the profile and with it the self-excitation."
)
MESHES = (
    "All with one step and the exact surface: what is seen is the mesh alone. Cost grows more slowly than the "
    "mesh, as part of it is the bit's."
)


def conclusions(chart: Chart, panel: Panel) -> list[str]:
    """What to take for which accuracy, in numbers; what never pays; and what the default is worth."""
    lines, before = [], None
    for target in TARGETS:
        best = cheapest(panel, target)
        if best is None:
            lines.append(f"Nothing computed has an error of {target:.0e} or less.")
            break
        if best is not before:
            lines.append(f"Error {target:.0e} or less: **{best.series}**, {told(chart, panel, best)}.")
        before = best
    for point in panel.points:
        if point.default:
            least = cheapest(panel, point.error)
            assert least is not None
            text = "the cheapest computed for this accuracy"
            if least is not point:
                text = f"{point.cpu / least.cpu:.2f} times the cost of {least.series}, {told(chart, panel, least)}"
            lines.append(f"The default ({point.series}, {told(chart, panel, point)}): {text}.")
    if absent := never(panel):
        lines.append(f"Never on the front: {'; '.join(absent)}.")
    failed = {n: sum(not p.error < 1 for p in points) for n, points in panel.series.items()}
    if any(failed.values()):
        text = "; ".join(f"{name} at {k} of {len(panel.series[name])}" for name, k in failed.items() if k)
        lines.append(f"Error above 1, or no result: {text}.")
    return lines + [f"Dashed: {level.name}, {level.error:.1e}." for level in panel.levels]


def told(chart: Chart, panel: Panel, point: Point) -> str:
    """Size, error and cost of a point."""
    size = size_text(point.size, panel.unit)
    return f"{panel.refined} {size}: error {point.error:.1e}, cost {cost_text(chart.cost(point))}"


def summary(charts: dict[str, Chart]) -> list[str]:
    """What the charts say together, in numbers of this run."""
    lines = []
    waves = charts["waves"].panel("integrators")
    best, default = cheapest(waves, 1e-3), reach(waves.series["generalised-alpha, 0.9"], 1e-3)
    assert best is not None and default is not None
    lines.append(
        f"Waves through PETSc TS, error 1e-03: {best.series} with steps of {size_text(best.size, 's')} costs "
        f"{best.cpu / default[0]:.2f} of generalised-alpha, 0.9 (the default, {size_text(default[1], 's')})."
    )
    steps = charts["axial-torsional"].panel("steps").series
    kept, full = steps["PETSc, kept Jacobian"], steps["PETSc, full Newton"]
    pairs = [(p, q) for p in kept for q in full if p.size == q.size]
    gain = [q.cpu / p.cpu for p, q in pairs]
    apart = max(abs(p.error / q.error - 1) for p, q in pairs)
    lines.append(
        f"Newton strategy: the kept Jacobian is {min(gain):.1f} to {max(gain):.1f} times as fast as a new one in every "
        f"iteration; their errors differ by {apart:.0e} of themselves."
    )
    slow, fast = reach(kept, 1e-2), reach(steps["condensed, exact surface"], 1e-2)
    assert slow is not None and fast is not None
    lines.append(
        f"A straight string, error 1e-02: the condensed engine costs at most 1/{slow[0] / fast[0]:.0f} of PETSc TS "
        f"with the kept Jacobian, with steps of {size_text(fast[1], 's')} rather than {size_text(slow[1], 's')}."
    )
    for case in ("lumped", "torsional", "axial-torsional"):
        series, step = charts[case].panel("steps").series, {}
        for name in ("condensed, DG surface", "condensed, exact surface"):
            step[name] = {p.size: p for p in series[name]}
        dg, exact = step.values()
        ratios = [dg[h].cpu / exact[h].cpu for h in dg if h in exact]
        lines.append(
            f"Rock surface, {case}: DG of degree 2 on 16 elements takes the string {min(ratios):.1f} to "
            f"{max(ratios):.1f} times the CPU time of the exact surface at the same step; "
        )
        found = {n: reach(p, 1e-3) for n, p in charts[case].panel("surfaces").series.items()}
        needs = [f"{name} {size_text(at[1], 'rad')}" for name, at in found.items() if at is not None]
        lacks = [name for name, at in found.items() if at is None]
        lines[-1] += f"cells for an error of 1e-03: {'; '.join(needs)}."
        lines[-1] += f" Not reached: {'; '.join(lacks)}." if lacks else ""
    well = charts["off-bottom"].facts
    span = {name: [well[f"steps: {name}, CPU, {end}"] for end in ("least", "most")] for name in OFF_BOTTOM}
    (slow, slowest), (new, newest), (dear, dearest) = span.values()
    lines.append(
        f"A string on its wall, off-bottom: PETSc takes {slow:.1f} to {slowest:.1f} times the CPU time of the compiled "
        f"engine for the same error; a new Jacobian in every iteration costs {new:.1f} to {newest:.1f} times the kept "
        f"one there, {dear:.1f} to {dearest:.1f} times in PETSc."
    )
    series = charts["off-bottom"].panel("contact").series
    stiff = {name: min(points, key=lambda p: p.error) for name, points in series.items()}
    lines.append(
        "Contact, the best of each, error and cost over that of the penalty: "
        + "; ".join(
            f"{name}, compliance {p.size:.0e} m2/N, {p.error:.1e} and {p.cpu / stiff['penalty'].cpu:.1f}"
            for name, p in stiff.items()
        )
        + "."
    )
    for case in ("torsional", "axial-torsional"):
        for level in charts[case].panel("rungs").levels:
            lines.append(f"Spin of {case}, {level.name}: {level.error:.1e}.")
    return lines


def bullets(lines: list[str]) -> str:
    """A Markdown list."""
    return "\n".join(textwrap.fill(line, 120, initial_indent="- ", subsequent_indent="  ") for line in lines) + "\n"


def section(chart: Chart) -> str:
    """A case: picture, and for each panel prose, table and conclusions."""
    parts = [
        f"## {chart.case}\n",
        prose(f"{chart.title}: {chart.scene}."),
        f"![{chart.case}](img/chart-{chart.case}.png)\n",
    ]
    for panel in chart.panels:
        text = PROSE.get((chart.case, panel.name), {"surfaces": SURFACES, "meshes": MESHES}.get(panel.name, ""))
        note = f" ({panel.note})" if panel.note else ""
        what = f"{panel.quantity[0].upper()}{panel.quantity[1:]}; reference: {panel.reference}{note}."
        parts += [f"### {panel.title}\n", prose(text), prose(what), table(header(panel), rows(chart, panel)) + "\n"]
        parts.append(bullets(conclusions(chart, panel)))
    facts = "; ".join(f"{name} {value:.3g}" for name, value in chart.facts.items())
    return "\n".join([*parts, prose(f"Measured besides: {facts}.")])


def prose(text: str) -> str:
    """Paragraphs, wrapped."""
    return "\n\n".join(textwrap.fill(part, 120, break_long_words=False) for part in text.split("\n\n")) + "\n"


def page(charts: dict[str, Chart]) -> str:
    """The whole page."""
    units = [1e3 * chart.normaliser for chart in charts.values()]
    text = INTRODUCTION.format(normaliser=NORMALISER, least=min(units), most=max(units), machine=platform.machine())
    head = ["# Accuracy and speed\n", prose(text), "## In short\n", bullets(summary(charts))]
    return "\n".join([*head, *map(section, charts.values())])


if __name__ == "__main__":
    if "--text" not in sys.argv:
        main([case for case in sys.argv[1:] if case in CASES], IMAGES)
    found = {case: Chart.read(IMAGES / f"chart-{case}.json") for case in CASES}
    (DOCS / "accuracy-and-speed.md").write_text(page(found), encoding="utf-8")
