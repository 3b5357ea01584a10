"""The ladder, rung by rung: speed beside accuracy, integrators, the limit alpha -> 0, how far a run can be foretold.

Prints the tables and writes docs/ladder.md and docs/img/ladder-horizon.png. Run it with OPENBLAS_NUM_THREADS=1 on a
quiet machine; processor seconds stand beside wall seconds, the best of a few repetitions.
"""

from __future__ import annotations

import platform
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from common import DOCS, machine, table, timed

from drillfem.render import style
from drillfem.scene import Scene, load_scene
from drillfem.solve.characteristics import CharacteristicString
from drillfem.solve.condensed import CondensedString, energy_imbalance, stable_step
from drillfem.solve.straight import StraightRun

Array = npt.NDArray[np.float64]
Rows = dict[str, Array]
String = CondensedString | CharacteristicString

UNTIL, FIRST = 80.0, 10.0
"""Timed horizon, and the seconds in which errors are counted."""
REFINED = 16
"""The reference of an error: the same with its step halved four times."""
MEASURED = ("bit_angle", "bit_depth", "bit_angular_speed")


@dataclass(frozen=True)
class Rung:
    """A rung of the ladder in an engine: built-in scene, and what is set in it."""

    title: str
    scene: str
    overrides: dict[str, Any]

    def at(self, **more: Any) -> Rung:
        """The same with more set; ``__`` stands for a dot."""
        return Rung(self.title, self.scene, self.overrides | {k.replace("__", "."): v for k, v in more.items()})

    def load(self, step: float) -> Scene:
        """The scene at a step (s)."""
        return load_scene(self.scene, self.overrides | {"time.step": step, "output.interval": step})

    def string(self, step: float) -> String:
        """The string at its start."""
        return StraightRun(self.load(step)).string


LUMPED = Rung("lumped", "cutting-c1", {"model": "lumped"})
TORSIONAL = Rung("torsional", "cutting-c1", {"model": "torsional"})
WAVES = Rung("torsional, characteristics", "cutting-c1", {"model": "torsional", "time.engine": "characteristics"})
BOTH = Rung("axial-torsional, c_d = 1e-4 s", "vertical-c1-cd4", {"model": "axial-torsional"})
LIGHT = Rung("axial-torsional, c_d = 1e-5 s", "vertical-c1-cd5", {"model": "axial-torsional"})
PROFILE = "profile"


def run(string: String, until: float, spacing: float) -> Rows:
    """Rows every ``spacing`` s up to ``until``."""
    return string.advance(round(until / string.step), max(1, round(spacing / string.step)))


def errors(rows: Rows, reference: Rows, until: float = np.inf) -> dict[str, tuple[float, float]]:
    """Of each measured variable: largest difference over largest value, and the same of root mean squares."""
    some = rows["time"] <= until + 1e-9
    out = {}
    for name in MEASURED:
        a, b = rows[name][some], reference[name][: len(rows[name])][some]
        out[name] = float(np.abs(a - b).max() / np.abs(b).max()), float(np.sqrt(((a - b) ** 2).sum() / (b**2).sum()))
    return out


def pace(string: String, until: float = UNTIL, repeat: int = 5) -> tuple[float, float]:
    """Simulated seconds per wall and per processor second of ``until`` s, every step stored; best of ``repeat``."""
    string.advance(2)  # compiled before the clock starts
    start, steps, wall, cpu = string.state_dict(), round(until / string.step), np.inf, np.inf
    for _ in range(repeat):
        string.load(start)
        w, c = time.perf_counter(), time.process_time()
        string.advance(steps)
        wall, cpu = min(wall, time.perf_counter() - w), min(cpu, time.process_time() - c)
    return until / wall, until / cpu


def number(x: float) -> str:
    """Two figures."""
    return f"{x:.1e}"


def speed_rows(rung: Rung, surfaces: dict[str, tuple[float, ...]]) -> list[list[str]]:
    """A row for each surface and step."""
    out = []
    for surface, steps in surfaces.items():
        one = rung.at(rock__surface__scheme=surface)
        for step in steps:
            string = one.string(step)
            rows = run(string, FIRST, step)
            error = errors(rows, run(one.string(step / REFINED), FIRST, step))
            wall, cpu = pace(string)
            angle, depth, spin = (error[name] for name in MEASURED)
            cells = [rung.title, surface, f"{1e3 * step:g} ms", f"{wall:.0f}", f"{cpu:.0f}"]
            out.append([*cells, *(number(x) for x in (angle[0], depth[0], spin[1], spin[0]))])
            print(" | ".join(out[-1]), flush=True)
    return out


def integrators() -> list[list[str]]:
    """Exact modes, trapezoidal rule and central differences on the axial-torsional string."""
    one, spacing, until, out = BOTH.at(rock__surface__scheme=PROFILE), 4e-3, 4.0, []
    exact = run(one.string(1.25e-4), until, spacing)
    limit = stable_step(one.string(1e-3).axial, one.string(1e-3).torsion)
    for integrator, steps in (
        ("exact", (4e-3, 2e-3, 1e-3)),
        ("trapezoidal", (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4)),
        ("explicit", (5e-4, 2.5e-4)),
    ):
        for step in steps:
            string = one.at(time__integrator=integrator).string(step)
            rows = run(string, until, spacing)
            error = errors(rows, exact)
            balance = np.abs(energy_imbalance(rows)).max() / rows["work_top_drive"][-1]
            cells = [integrator, f"{1e3 * step:g} ms", f"{pace(string, 10.0)[1]:.0f}"]
            out.append([*cells, *(number(error[n][1]) for n in MEASURED), number(balance)])
            print(" | ".join(out[-1]), flush=True)
    print(f"explicit central differences: stable up to {limit:.4g} s")
    return out


def retardations() -> tuple[float, float]:
    """Simulated per processor second with one retardation time, and with another in the collars."""
    collars = {"youngs_modulus": 210e9, "shear_modulus": 77e9, "density": 7800.0, "retardation_time": 2e-4}
    return pace(BOTH.string(1e-3), 4.0)[1], pace(BOTH.at(string__1__material=collars).string(1e-3), 4.0, 2)[1]


# -- alpha -> 0 -------------------------------------------------------------------------------------------------------

ALPHAS = (0.4, 0.2, 0.1, 0.05, 0.025)
FEWER = (0.0125, 0.00625, 0.003125, 0.0015625, 0.00078125)


def limit(rung: Rung, alpha: float, until: float = 5.0, step: float = 1e-3) -> Rows:
    """A rung whose inertia sits at the bit but for the share ``alpha``, and whose collars are stiff in proportion."""
    stiff = {"youngs_modulus": 210e9, "shear_modulus": 77e9 / alpha, "density": 7800.0}
    changed = rung.at(inertia__distributed=alpha, string__1__material=stiff, rock__surface__scheme=PROFILE)
    return run(changed.string(step), until, 4e-3)


def limits() -> tuple[list[list[str]], dict[str, float]]:
    """Distance to the lumped model for shrinking alpha, and the fitted rates."""
    lumped = run(LUMPED.at(rock__surface__scheme=PROFILE).string(1e-3), 5.0, 4e-3)
    undamped = Rung("axial-torsional", "cutting-c1", {"model": "axial-torsional"})
    found: dict[str, list[Array]] = {}
    for rung in (WAVES, undamped):
        found[rung.title] = []
        for alpha in ALPHAS + (FEWER if rung is undamped else ()):
            error = errors(limit(rung, alpha), lumped)
            found[rung.title].append(np.array([error[n][0] for n in MEASURED]))
    rows = []
    for i, alpha in enumerate(ALPHAS + FEWER):
        cells = [f"{alpha:g}"]
        for values in found.values():
            cells += [number(x) for x in values[i]] if i < len(values) else [""] * 3
        rows.append(cells)
        print(" | ".join(cells), flush=True)
    log = np.log
    waves, axial = (np.array(v) for v in found.values())
    rates = {
        WAVES.title: float(np.polyfit(log(ALPHAS), log(waves[:, 0]), 1)[0]),
        undamped.title: float(np.polyfit(log(FEWER[-3:]), log(axial[-3:, 0]), 1)[0]),
    }
    return rows, rates


# -- agreement and horizon --------------------------------------------------------------------------------------------


def agreement() -> list[list[str]]:
    """Engines, meshes and rock surfaces against each other, over the seconds before the bit first stalls and after."""
    out = []

    def compare(title: str, a: Rows, b: Rows) -> None:
        cells = [title]
        for until in (2.0, 5.0, 10.0):
            error = errors(a, b, until)
            cells.append(" / ".join(number(error[n][0]) for n in MEASURED[:2]))
        out.append(cells)
        print(" | ".join(cells), flush=True)

    def rows(rung: Rung, surface: str, step: float = 1e-3, **more: Any) -> Rows:
        return run(rung.at(rock__surface__scheme=surface, **more).string(step), 10.0, 4e-3)

    for rung in (LUMPED, WAVES, BOTH):
        exact = rows(rung, PROFILE)
        compare(f"{rung.title}: dg 2 x 16, profile", rows(rung, "dg"), exact)
        compare(f"{rung.title}: dg 2 x 64, profile", rows(rung, "dg", rock__surface__elements=64), exact)
    waves = rows(WAVES, PROFILE)
    for elements in (32, 64, 128):
        fem = rows(TORSIONAL, PROFILE, mesh__elements=elements)
        compare(f"torsional: {elements} elements, characteristics", fem, waves)
    compare("torsional: characteristics at 1 ms, at 0.25 ms", waves, rows(WAVES, PROFILE, 2.5e-4))
    exact = rows(BOTH, PROFILE)
    for elements in (32, 128):
        compare(f"axial-torsional: {elements} elements, 64", rows(BOTH, PROFILE, mesh__elements=elements), exact)
    return out


FELT = ("bit_angular_speed", "bit_axial_speed", "depth_of_cut")
NUDGES = (1e-6, 1e-8, 1e-10)
NOTED = 0.05


@dataclass(frozen=True)
class Parting:
    """Nearby runs: times (s), separation for each nudge of the start, and their rows (first: not nudged)."""

    title: str
    time: Array
    apart: list[Array]
    rows: list[Rows]

    def exponent(self) -> tuple[float, float, float]:
        """Rate (1/s) fitted to the smallest nudge, from 5 s to the time at which it has grown to 1e-3, or the end."""
        t, d = self.time, self.apart[-1]
        late = np.flatnonzero(d > 1e-3)
        end = float(t[late[0]]) if len(late) else float(t[-1])
        some = (t >= min(5.0, end / 2)) & (t <= end)
        return float(np.polyfit(t[some], np.log(d[some]), 1)[0]), float(t[some][0]), end

    def horizon(self, nudge: int) -> float:
        """Time (s) at which runs that started ``nudge`` apart differ by a hundredth; infinite if never."""
        late = np.flatnonzero(self.apart[nudge] > 1e-2)
        return float(self.time[late[0]]) if len(late) else np.inf


def parting(rung: Rung, until: float, step: float = 1e-3) -> Parting:
    """Runs whose spin perturbation differs by a factor 1 + nudge; separation: largest within a second, of the scaled
    differences of spin, axial speed and depth of cut."""
    begin = load_scene(rung.scene).initial.spin_perturbation
    rows = [
        run(rung.at(initial__spin_perturbation=begin * (1 + nudge)).string(step), until, NOTED)
        for nudge in (0.0, *NUDGES)
    ]
    seconds = np.arange(1.0, until + 0.5)
    size = {name: np.abs(rows[0][name] - rows[0][name].mean()).max() for name in FELT}
    apart = []
    for other in rows[1:]:
        d = np.sqrt(sum(((other[n] - rows[0][n]) / size[n]) ** 2 for n in FELT))
        apart.append(d.reshape(len(seconds), -1).max(axis=1))
    return Parting(rung.title, seconds, apart, rows)


def draw(found: list[Parting], path: Path) -> None:
    """One panel per rung."""
    with style.page(1200, 760) as figure:
        style.heading(
            figure,
            "How long a run can be foretold",
            "Runs that start a nudge apart: "
            "largest difference in each second of spin, axial speed, depth of cut, scaled",
        )
        axes = figure.subplots(2, 2, sharey=True)
        for ax, p in zip(axes.flat, found, strict=True):
            for nudge, d, colour in zip(NUDGES, p.apart, (style.VERMILION, style.BLUE, style.GREEN), strict=True):
                ax.semilogy(p.time, d, color=colour, label=f"nudge {nudge:g}")
            rate, start, end = p.exponent()
            t = np.array([start, end])
            some = (p.time >= start) & (p.time <= end)
            line = np.polyfit(p.time[some], np.log(p.apart[-1][some]), 1)
            ax.semilogy(t, np.exp(np.polyval(line, t)), color=style.INK, ls="--", lw=1.1, label=f"{rate:+.2g} per s")
            ax.axhline(1e-2, color=style.GREY, lw=0.8, ls=":")
            ax.set(title=p.title, ylim=(1e-13, 10), xlim=(0, p.time[-1]), xlabel="time [s]")
            ax.legend(loc="lower right", ncols=2)
        for ax in axes[:, 0]:
            ax.set_ylabel("separation")
        figure.tight_layout(rect=(0, 0, 1, 0.92))
        style.save(figure, path)


def after(p: Parting) -> list[list[str]]:
    """Statistics of the last half of nearby runs: what can still be said."""
    out = []
    for name, rows in zip(("as is", *(f"nudged by {n:g}" for n in NUDGES)), p.rows, strict=True):
        late = rows["time"] > rows["time"][-1] / 2
        spin, depth, t = rows["bit_angular_speed"][late], rows["bit_depth"][late], rows["time"][late]
        torque = rows["work_cutting"] + rows["work_wear_flat"]  # mean torque on the bit from its work: no aliasing
        angle = rows["bit_angle"][late]
        mean = (torque[late][-1] - torque[late][0]) / (angle[-1] - angle[0])
        advance = 1e3 * (depth[-1] - depth[0]) / (t[-1] - t[0])
        out.append([f"{p.title}, {name}", f"{advance:.4f}", f"{mean:.0f}", f"{spin.std():.2f}", f"{spin.max():.1f}"])
        print(" | ".join(out[-1]), flush=True)
    return out


def whole(rung: Rung, step: float, **more: Any) -> list[str]:
    """A scene as a user runs it: every step stored in a result."""
    best = max(
        (timed(rung.scene, UNTIL, **rung.overrides, time__step=step, output__interval=step, **more) for _ in range(2)),
        key=_per_wall,
    )
    print(f"{rung.title}: {best.per_wall:.0f}", flush=True)
    return [rung.title, f"{1e3 * step:g} ms", f"{best.per_wall:.0f}", f"{best.per_cpu:.0f}"]


def _per_wall(one: Any) -> float:
    return float(one.per_wall)


def seconds(x: float, end: float) -> str:
    """A time, or that it was not reached."""
    return f"{x:.0f} s" if np.isfinite(x) else f"not in {end:.0f} s"


def main() -> None:
    normal = machine()
    speeds = speed_rows(LUMPED, {"dg": (1e-3, 2e-3, 4e-3), PROFILE: (1e-3, 2e-3, 4e-3)})
    speeds += speed_rows(TORSIONAL, {"dg": (1e-3, 2e-3), PROFILE: (1e-3, 2e-3)})
    speeds += speed_rows(WAVES, {"dg": (1e-3, 2e-3), PROFILE: (1e-3, 2e-3, 4e-3)})
    speeds += speed_rows(BOTH, {"dg": (1e-3, 2e-3), PROFILE: (1e-3, 2e-3)})
    runs = [whole(r, h, rock__surface__scheme=PROFILE) for r, h in ((LUMPED, 4e-3), (WAVES, 2e-3), (BOTH, 2e-3))]
    steps, (single, several) = integrators(), retardations()
    waves = WAVES.at(rock__surface__scheme=PROFILE)
    early = errors(run(waves.string(2e-3), 2.0, 2e-3), run(waves.string(2e-3 / REFINED), 2.0, 2e-3))
    stalled = [number(early[name][0]) for name in MEASURED]
    shrinking, rates = limits()
    alike = agreement()
    found = [parting(LUMPED, UNTIL), parting(WAVES, 40.0), parting(BOTH, UNTIL), parting(LIGHT, UNTIL)]
    draw(found, DOCS / "img" / "ladder-horizon.png")
    horizon = []
    for p in found:
        rate, start, end = p.exponent()
        times = [seconds(p.horizon(i), p.time[-1]) for i in range(len(NUDGES))]
        horizon.append([p.title, f"{rate:+.2f}", f"{start:.0f} to {end:.0f} s", *times])
        print(" | ".join(horizon[-1]), flush=True)
    statistics = after(found[1]) + after(found[3])
    string = BOTH.string(1e-3)
    stable = stable_step(string.axial, string.torsion)
    head = [
        "",
        "surface",
        "step",
        "simulated / wall",
        "simulated / CPU",
        "angle",
        "depth",
        "spin, rms",
        "spin, largest",
    ]
    text = f"""# The ladder: speed, accuracy, horizon

One core of {platform.machine()}. Written by `benchmarks/ladder.py`.
This machine: {"; ".join(f"{name}: {1e3 * s:.1f} ms" for name, s in normal.items())}.

## Speed beside accuracy

`cutting-c1` (lumped, torsional) and `vertical-c1-cd4` (axial-torsional): {UNTIL:g} s with every step stored, best of
five. Errors are against the same with its step halved four times, over the first {FIRST:g} s: of the bit's angle and
depth the largest difference over the largest value; of its spin also the root mean square.

{table(head, speeds)}

In the lumped model nothing jumps, and a step is of fourth order but for the steps in which the bit begins or ceases to
stick, which are divided by 8. In the undamped torsional model the torque of the wear flats jumps when the bit sticks,
and the spin of a bit without inertia jumps with it: its largest error says when, not how much, and does not shrink.
After some seconds this bit stalls, and what a stall does hangs on tenths of a millisecond: see the horizon below.
Before that (first 2 s) the errors of angle and depth at 2 ms are {stalled[0]} and {stalled[1]}.

Whole runs, results written to memory:

{table(["", "step", "simulated / wall", "simulated / CPU"], runs)}

## Integrators of the condensed string

`vertical-c1-cd4`, 4 s, rock `profile`; root-mean-square errors against the exact integrator at 0.125 ms. Balance:
largest error of the energy balance over the work of the top drive. Explicit central differences are refused beyond
2 / omega_max = {1e3 * stable:.3g} ms.

{table(["", "step", "simulated / CPU", "angle", "depth", "spin", "balance"], steps)}

Several retardation times in one string couple the modes: {single:.0f} simulated seconds per CPU second become
{several:.0f} (1 / {single / several:.0f}).

## Inertia at the bit: the limit alpha -> 0

`cutting-c1`, undamped; the share alpha of the inertia stays along the string, the rest sits at the bit, and the collars
are stiffer by 1 / alpha ("their flexibility removed", 5.5.4). Largest difference to the lumped model in the first 5 s,
over the largest value, of angle, depth and spin.

{
        table(
            ["alpha", *[f"torsional: {n}" for n in ("angle", "depth", "spin")]]
            + [f"axial-torsional: {n}" for n in ("angle", "depth", "spin")],
            shrinking,
        )
    }

Fitted rates of the angle: torsional {rates["torsional, characteristics"]:.2f}; axial-torsional
{rates["axial-torsional"]:.2f} over the last three. Before that the axial string is no small perturbation: its first
resonance, c / (4 L) / sqrt(alpha) = 1.08 Hz / sqrt(alpha), must first pass the 13 Hz of the chatter (alpha = 0.007).

## Agreement

Largest differences over largest values, angle / depth, in the first 2, 5 and 10 s, at 1 ms.

{table(["", "2 s", "5 s", "10 s"], alike)}

## Horizon

![separation of nearby runs](img/ladder-horizon.png)

Runs whose spin perturbation at the start differs by 1e-6, 1e-8 and 1e-10 of itself. Rate: fitted to the growth of the
smallest difference, up to 1e-3. Horizon: when a difference of a hundredth is reached.

{table(["", "rate [1/s]", "fitted", *[f"horizon, {n:g}" for n in NUDGES]], horizon)}

The lumped model and the axial-torsional string with c_d = 1e-4 s are not chaotic: nearby runs stay together, and a
pointwise comparison makes sense at any time. With c_d = 1e-5 s they part exponentially. The undamped torsional string
forgets small differences while it turns, and gains them in steps, when the bit stalls or turns back: it has no inertia,
so there its spin jumps, and whether it does in this part of a step or in the next is a matter of rounding; its fitted
rate is an average over such steps, not an exponent.

What remains after the horizon, over the last half of these runs (rate of penetration, mean torque from the work of the
bit, standard deviation and largest value of the spin):

{table(["", "mm/s", "N m", "rad/s", "rad/s"], statistics)}
"""
    (DOCS / "ladder.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
