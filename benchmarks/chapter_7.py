"""Chapter 7, deterministic: cases A and B in pictures, the missing clearance, convergence, cost of a member.

Writes docs/chapter-7.md and docs/img/chapter-7-*.png; takes about five minutes of one core. The claims of the thesis
are judged one by one by `drillfem reproduce 7`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr
from common import DOCS, machine, table

import drillfem
from drillfem.ensemble.member import Worker, numbers
from drillfem.render import style
from drillfem.reproduce.chapter7 import LITERAL, UNPROJECTED, clearance, sag
from drillfem.scene import Scene, load_scene

Array = npt.NDArray[np.float64]

END = 10.0
TICKS = (2, 5, 10, 20, 50, 100)
GAPS = (2e-3, 3e-3, 5e-3, 7e-3, 10e-3, 13e-3, 16e-3, 20e-3, 30e-3, 50e-3, 70e-3, 100e-3)
READINGS: dict[str, tuple[dict[str, Any], str]] = {
    "as shipped": ({}, style.INK),
    "starts on its wall": ({"initial.state": "laid"}, style.GREEN),
    "bounces without loss": ({"contact.retardation_time": 0.0}, style.SKY),
    "friction against bounces too (as printed)": (UNPROJECTED, style.VERMILION),
    "and the bit's force with the sign of print": (LITERAL, style.PURPLE),
}
STEPS = (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4)
ELEMENTS = (8, 12, 16, 24, 32, 48)
FINE = {"mesh.elements": 96, "time.step": 1.25e-4}
ROUNDINGS = (1e-2, 3e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5)
QUANTITIES = {"bit_depth": "displacement", "work_friction": "work of friction", "power_ratio": "p_r"}


@dataclass(frozen=True)
class Member:
    """Numbers of a run, and the processor seconds that it took."""

    numbers: dict[str, float]
    seconds: float

    def __getitem__(self, name: str) -> float:
        return self.numbers[name]


def scene(case: str, changes: Mapping[str, Any]) -> Scene:
    return load_scene(f"horizontal-{case}", changes)


def run(case: str, **changes: Any) -> Member:
    return member(scene(case, changes))


def member(given: Scene, worker: Worker | None = None) -> Member:
    worker = worker or Worker(given)
    start = time.process_time()
    found = worker.run(given)
    return Member(found, time.process_time() - start)


# -- A and B ----------------------------------------------------------------------------------------------------------
def draw_cases(found: Mapping[str, xr.Dataset], folder: Path) -> None:
    with style.page(1200, 720) as figure:
        style.heading(figure, "Case A and case B", "bit of a horizontal string: displacement and speed (figure 7.2)")
        axes = figure.subplots(2, 2)
        colours = {"A, 10 mm": style.INK, "A, 20 mm": style.BLUE, "B": style.VERMILION}
        for name, history in found.items():
            t, d, v = (history[k].values for k in ("time", "bit_depth", "bit_axial_speed"))
            axes[0, 0].plot(t, d, color=colours[name], label=name)
            if name == "B":
                axes[0, 1].plot(t, 1e3 * d, color=colours[name])
            axes[1, 0].plot(t, 1e3 * v, color=colours[name], lw=1.0)
            early = t <= 0.5
            if name != "A, 20 mm":
                axes[1, 1].plot(t[early], 1e3 * v[early], color=colours[name], lw=1.0)
        axes[0, 0].set(ylabel="displacement, m", title="both")
        axes[0, 0].legend(loc="upper left")
        axes[0, 1].set(ylabel="displacement, mm", title="B alone")
        axes[1, 0].set(xlabel="time, s", ylabel="speed, mm/s", title="speed of the bit")
        axes[1, 1].set(xlabel="time, s", ylabel="speed, mm/s", title="its first half second")
        figure.tight_layout(rect=(0, 0, 1, 0.89))
        style.save(figure, folder / "chapter-7-cases.png")


def draw_wall(folder: Path) -> None:
    """Where the string touches, and how deep (figure 7.3)."""
    with style.page(1200, 520) as figure:
        style.heading(
            figure, "Contact acts on a section", "case A at 10 s, by clearance: place of the string, side force"
        )
        left, right = figure.subplots(1, 2)
        for gap, colour in ((5e-3, style.SKY), (10e-3, style.INK), (20e-3, style.BLUE), (50e-3, style.VERMILION)):
            result = drillfem.simulate(scene("a", clearance(gap)), warn=False)
            assert result.fields is not None
            last = result.fields.isel(time=-1)
            s, place = last["arc_length"].values, last["position"].values[:, 0]
            left.plot(s, 1e3 * place, color=colour, label=f"{1e3 * gap:g} mm")
            left.axhline(1e3 * gap, color=colour, lw=0.7, ls=":")
            right.plot(last["wall_arc_length"].values, last["wall_side_force"].values / 756.03, color=colour)
        left.invert_yaxis()
        left.set(
            xlim=(0, 60), xlabel="arc length, m", ylabel="below the hole's axis, mm", title="place (dotted: the wall)"
        )
        left.legend(loc="center right", bbox_to_anchor=(1.0, 0.32), title="clearance")
        right.set(
            xlim=(0, 60), xlabel="arc length, m", ylabel="over the weight per length", title="side force of the wall"
        )
        figure.tight_layout(rect=(0, 0, 1, 0.86))
        style.save(figure, folder / "chapter-7-wall.png")


# -- the clearance ----------------------------------------------------------------------------------------------------
def sweep(b: float) -> dict[str, list[Member]]:
    found = {}
    for name, (changes, _) in READINGS.items():
        first = scene("a", changes)
        worker = Worker(first)
        found[name] = [member(scene("a", {**changes, **clearance(gap)}), worker) for gap in GAPS]
    return found


def draw_sweep(found: Mapping[str, list[Member]], b: float, folder: Path) -> None:
    with style.page(1200, 600) as figure:
        what = "displacement of A over that of B after 10 s, by the clearance that is not printed"
        style.heading(figure, "A hundred times?", what)
        left, right = figure.subplots(1, 2, width_ratios=[3, 2])
        x = 1e3 * np.array(GAPS)
        for name, (_, colour) in READINGS.items():
            left.loglog(x, [m["bit_depth"] / b for m in found[name]], "o-", ms=4, color=colour, label=name)
        left.axhline(100, color=style.GREY, lw=0.9, ls=":")
        left.text(2, 108, "published", color=style.GREY)
        left.set(xlabel="clearance, mm", ylabel="A over B", ylim=(1.5, 1000), title="displacement", xticks=TICKS)
        figure.legend(*left.get_legend_handles_labels(), loc="lower left", ncols=3, bbox_to_anchor=(0.04, 0.0))
        net = [5500 - m["work_friction"] / m["bit_depth"] for m in found["starts on its wall"]]
        right.semilogx(x, net, "o-", ms=4, color=style.GREEN)
        gap: Array = np.geomspace(2e-3, 0.1, 100)
        right.semilogx(
            1e3 * gap, [5500 - friction(c) for c in gap.tolist()], color=style.GREY, ls="--", label="formula"
        )
        right.axhline(1400, color=style.GREY, lw=0.9, ls=":")
        right.text(2, 1405, "bit's full resistance", color=style.GREY)
        right.set(xlabel="clearance, mm", ylabel="N", title="what friction leaves of 5500 N", xticks=TICKS)
        for ax in (left, right):
            ax.minorticks_off()
            ax.xaxis.set_major_formatter("{x:g}")
        right.legend(loc="lower right")
        figure.tight_layout(rect=(0, 0.1, 1, 0.87))
        style.save(figure, folder / "chapter-7-clearance.png")


def friction(gap: float) -> float:
    """k_fr (W - 2/3 w l), l = (72 EI c_gap/w)^(1/4) (spec 10.5), of string and bit (N)."""
    given = scene("a", clearance(gap))
    w = given.string[0].mass_per_length * 9.81
    return 0.1 * (60 * w + 20 * 9.81 - 2 / 3 * w * sag(given))


def sweep_table(found: Mapping[str, list[Member]], b: float) -> str:
    chosen = [GAPS.index(g) for g in (2e-3, 5e-3, 10e-3, 16e-3, 20e-3, 30e-3, 50e-3, 100e-3)]
    header = ["A over B", *(f"{1e3 * GAPS[i]:g} mm" for i in chosen)]
    rows = [[name, *(f"{found[name][i]['bit_depth'] / b:.3g}" for i in chosen)] for name in READINGS]
    return table(header, rows)


# -- accuracy ---------------------------------------------------------------------------------------------------------
def order(sizes: Sequence[float], errors: Sequence[float]) -> str:
    """Slope of a fit error ~ size^p, of what lies above round-off."""
    return f"{np.polyfit(np.log(sizes), np.log(np.maximum(errors, 1e-12)), 1)[0]:.1f}"


def convergence(case: str, fine: Member) -> tuple[str, str]:
    """Tables of relative errors: by the step on the finest mesh, by the elements at the least of these steps."""

    def errors(runs: Sequence[Member], exact: Member) -> dict[str, list[float]]:
        return {name: [abs(m[name] / exact[name] - 1) for m in runs] for name in QUANTITIES}

    by_step = [run(case, **{"mesh.elements": 96, "time.step": h}) for h in STEPS]
    by_mesh = [run(case, **{"mesh.elements": n, "time.step": FINE["time.step"] * 2}) for n in ELEMENTS]
    tables = []
    for label, columns, runs, sizes, exact in (
        ("step (96 elements)", [f"{1e3 * h:g} ms" for h in STEPS], by_step, STEPS, fine),
        ("elements (0.25 ms)", [str(n) for n in ELEMENTS], by_mesh, [1 / n for n in ELEMENTS], by_step[-1]),
    ):
        found = errors(runs, exact)
        rows = [
            [text, *(f"{x:.1e}" for x in found[name]), order(sizes, found[name])] for name, text in QUANTITIES.items()
        ]
        rows.append(["energy balance", *(f"{m['energy_balance_error']:.1e}" for m in runs), ""])
        tables.append(table([label, *columns, "order"], rows))
    return tables[0], tables[1]


def shipped_table(runs: Mapping[str, tuple[Member, Member]]) -> str:
    rows = []
    for case, (ours, fine) in runs.items():
        cells = [f"{ours[name]:.5g} ({100 * (ours[name] / fine[name] - 1):+.2f} %)" for name in QUANTITIES]
        rows.append([case, *cells, f"{ours['energy_balance_error']:.1e}"])
    units = {"bit_depth": "m", "work_friction": "J", "power_ratio": ""}
    header = ["", *(f"{text} {units[name]}".strip() for name, text in QUANTITIES.items()), "energy balance"]
    return table(header, rows)


def rounding_table() -> str:
    header = ["v_0, mm/s", *(f"{1e3 * v:g}" for v in ROUNDINGS)]
    rows = []
    for case in ("a", "b"):
        runs = [run(case, **{"contact.friction_velocity_scale": 1 / v, "time.step": 5e-4}) for v in ROUNDINGS]
        rows.append([f"{case.upper()}: displacement, mm", *(f"{1e3 * m['bit_depth']:.4g}" for m in runs)])
        rows.append([f"{case.upper()}: p_r", *(f"{m['power_ratio']:.4f}" for m in runs)])
    return table(header, rows)


def parting() -> str:
    """What a step does to a string that bounces for ever, beside the one as shipped."""
    rows = []
    for name, changes in (("as shipped", {}), ("bounces without loss", {"contact.retardation_time": 0.0})):
        cells = []
        for h in (1e-3, 5e-4, 2.5e-4):
            history = Worker().simulate(scene("a", {**changes, "time.step": h})).history
            depth = np.interp((1.0, 2.0, 5.0, 10.0), history["time"].values, history["bit_depth"].values)
            cells.append(", ".join(f"{1e3 * d:.1f}" for d in depth))
        rows.append([name, *cells])
    return table(["displacement at 1, 2, 5, 10 s, mm", "1 ms", "0.5 ms", "0.25 ms"], rows)


# -- cost -------------------------------------------------------------------------------------------------------------
def cost_table() -> tuple[str, float]:
    given = scene("a", {})
    spent: dict[str, float] = {}

    def clock(what: str, work: Any, repeat: int = 5) -> Any:
        best, found = math.inf, None
        for _ in range(repeat):
            start = time.process_time()
            found = work()
            best = min(best, time.process_time() - start)
        spent[what] = best
        return found

    drillfem.simulate(given, warn=False)
    worker = clock("`Worker(scene)`: mesh, forms, kernels from the disk, once per process", lambda: Worker(given), 2)
    clock("`drillfem.simulate`, set up each time", lambda: drillfem.simulate(given, warn=False), 3)
    kept = clock("`worker.run`, 10 s", lambda: worker.run(given))
    short = load_scene("horizontal-a", {"time.end": 0.02, "output.fields_interval": 0.02})
    clock("`worker.run`, its first 0.02 s: what a member costs before it moves", lambda: worker.run(short))
    fresh = numbers(drillfem.simulate(given, warn=False))
    assert kept == fresh, "a member must not know what ran before"
    rows = [[what, f"{seconds:.3f}"] for what, seconds in spent.items()]
    steps = kept["steps"]
    rows.append(["steps; iterations per step; factorisations", f"{steps:.0f}; "
                 f"{kept['newton_iterations'] / steps:.2f}; {kept['factorisations']:.0f}"])  # fmt: skip
    return table(["processor seconds (least of several)", ""], rows), spent["`worker.run`, 10 s"]


def main() -> None:
    folder = DOCS / "img"
    speed = machine()
    costs, seconds = cost_table()
    print(costs)
    often = {"output.interval": 2e-3, "output.fields_interval": 1.0}
    histories = {
        "A, 10 mm": Worker().simulate(scene("a", often)).history,
        "A, 20 mm": Worker().simulate(scene("a", often | clearance(20e-3))).history,
        "B": Worker().simulate(scene("b", often)).history,
    }
    draw_cases(histories, folder)
    draw_wall(folder)
    b = run("b")
    found = sweep(b["bit_depth"])
    draw_sweep(found, b["bit_depth"], folder)
    fine = {case: run(case, **FINE) for case in "ab"}
    shipped = {f"{case.upper()} as shipped": (run(case), fine[case]) for case in "ab"}
    by_step, by_mesh = convergence("a", fine["a"])
    by_step_b, by_mesh_b = convergence("b", fine["b"])
    given = scene("a", {})
    worst = max(abs(ours["bit_depth"] / exact["bit_depth"] - 1) for ours, exact in shipped.values())
    pace = "; ".join(f"{k}: {1e3 * v:.1f} ms" for k, v in speed.items())
    text = f"""# Chapter 7, deterministic: a horizontal string

Written by `benchmarks/chapter_7.py`. One core of x86_64, beside other work.
This machine: {pace}.

60 m of string in a horizontal hole, pushed with 5500 N by the pipes behind, shaken by a mud motor with 500 N at 100
rpm, resisted by a bit with 1400 N (1 - exp(-400 v)), rubbed by the wall with k_fr = 0.10. It starts at rest on the
axis of the hole. Case A (`horizontal-a`): what presses is the wall, by penalty. Case B (`horizontal-b`,
`contact.normal_force = "weight"`): the string's weight presses, everywhere and always, as Ritto et al. (2013) have
it. The planar rod, {given.mesh.elements} cubic elements, steps of {1e3 * given.time.step:g} ms, compiled engine.

What print does not say, and what is taken here:

- The clearance: 10 mm, chapter 4's. What it does, see below.
- How friction passes through zero speed: mu v/sqrt(v^2 + v_0^2) with v_0 = 0.2 mm/s. That is the law of the other
  chapters with `friction_static = friction_dynamic`, `friction_regularisation = 1`, `friction_velocity_scale = 1/v_0`.
- Damping. As printed (7-4), friction acts against the whole velocity, bounces too, and takes a fifth of the energy
  of each (k_fr |f_s| on the way in and out). Friction along the wall only, the recommended reading, takes none: the
  string would bounce for ever. So the wall is given a `retardation_time` of 0.6 ms, which takes as much: exp(-pi
  omega tau) = 0.8 with omega = (k_s/(rho A))^(1/2).
- The sign of the bit's force: (7-5) with (7-6) as printed pushes the bit forward. `reading = "literal"` keeps that.
- In case B, what holds the string where it is: the springs k_s, to both sides. Nothing else would: clamped at one
  end and free at the other it buckles under 2.9 kN, and with its weight carried but nothing to lie on it is 8 m off
  after 10 s.
- Its mass of 20 kg makes the bit weigh 196 N, which print leaves out: 20 N of friction in case A.

## A and B

![cases](img/chapter-7-cases.png)

![wall](img/chapter-7-wall.png)

Without the motor B moves at the speed at which push, friction and resistance balance, 2.9 mm/s; with it, it swings
about a little more. B never stands: where the motor pulls back hardest, 464 N are left of the push. It slows down to a
third of its mean speed in each turn of the motor, so that its displacement rises in steps, which may be what print
calls pseudo stick-slip. A with this clearance does so too; with more of it, it does not.

## A hundred times?

"Case A shows a penetration that is 100 times higher in order" (7.4.1).

![clearance](img/chapter-7-clearance.png)

{sweep_table(found, b["bit_depth"])}

The clamp at the top carries two thirds of the weight of the length l = (72 EI c/w)^(1/4) that sags through the
clearance c. What the wall carries less, friction takes less. At about 15 mm it leaves just the 1400 N that the bit
can resist: with less clearance the bit creeps, with more the string is accelerated without bound. The published
hundred is what the printed friction gives at about 30 mm; with friction along the wall only it takes more than 100
mm; with the printed sign, no clearance is too small.

## Accuracy

Relative to {FINE["mesh.elements"]} elements and {1e3 * FINE["time.step"]:g} ms, by elements to
{FINE["mesh.elements"]} of them at the same step; after 10 s. Friction sharpens at zero speed and the wall at zero gap,
and where contact begins moves over the mesh: the errors of A fall with jumps, at an order of about two at most. B has
no wall to find: what is left there is the step, of first order, for the push sets in at once.

{shipped_table(shipped)}

Case A:

{by_step}

{by_mesh}

Case B:

{by_step_b}

{by_mesh_b}

A string that bounces without loss is chaotic: two steps give two strings after a few seconds, whatever the step.
Its power ratio is the same. With the wall's damping all of it converges:

{parting()}

The speed over which friction is rounded off:

{rounding_table()}

## What a member costs

{costs}

A member is 10 s of case A as shipped, history in memory, no pictures. `drillfem.ensemble.member.Worker` keeps mesh,
forms, kernels and the solver's memory, and changes only numbers: friction along the hole, loads, stiffnesses,
clearance. What it gives is what `drillfem.simulate` gives, bit for bit. At {seconds:.2f} s a member, 10 000 of them
take {10_000 * seconds / 3600:.1f} core hours. The displacement is right to {100 * worst:.1f} %.

```python
from dataclasses import replace
from drillfem import load_scene
from drillfem.ensemble.member import Worker

scene = load_scene("horizontal-a")
worker = Worker(scene)
rough = replace(scene.contact, friction_profile=((0, 0.10, 0.10), (30, 0.14, 0.14), (80, 0.09, 0.09)))
numbers = worker.run(replace(scene, contact=rough).checked())
print(numbers["bit_depth"], numbers["power_ratio"])
```
"""
    (DOCS / "chapter-7.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
