"""Buckling of a string in its hole: onset against theory and mesh, snaking and winding, loading and unloading.

Writes docs/buckling.md and its pictures in five minutes of one core.
"""

from __future__ import annotations

import json
import math
import shutil
import tempfile
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt
from common import DOCS, table

from drillfem.buckling import (
    Column,
    Onset,
    Pipe,
    Step,
    equal_energy,
    find_onset,
    follow,
    helix,
    onset,
    pinned_onset,
    pipe_of,
    pipe_scene,
    snake,
    wound,
)
from drillfem.buckling.command import run as push
from drillfem.buckling.drawing import shapes
from drillfem.models.rod import Rod
from drillfem.render import style
from drillfem.scene import load_scene

Array = npt.NDArray[np.float64]
IMG = DOCS / "img"
LEVEL = math.pi / 2
#: Clearances of the thesis' drill pipe in its holes, m.
CLEARANCES = (0.010, 0.0445)
WAVES = 10


def column(
    length: float,
    inclination: float,
    clearance: float,
    spacing: float,
    degree: int = 3,
    k: float = 1e8,
    kind: type[Rod] = Rod,
) -> Column:
    """The thesis' pipe, pinned at both ends."""
    return Column(kind(pipe_scene(length, inclination, clearance, spacing, degree, k)), pinned=True)


def with_points(points: int) -> type[Rod]:
    """A rod whose contact has so many points per element."""
    return type("Rod", (Rod,), {"wall_degree": property(lambda _: 2 * points - 1)})


def found(c: Column, guess: float) -> Onset:
    """The onset of a straight string, looked for around a guess."""
    at = find_onset(c, c.lying(), 0.85 * guess, 4 * guess)
    assert at is not None
    return at


# -- onset -----------------------------------------------------------------------------------------------------------
def over_inclination() -> tuple[list[tuple[float, float, float, float, float]], str]:
    """(clearance, inclination, rod, theory for this length, endless level theory) and the table of them."""
    rows, lines = [], []
    for clearance in CLEARANCES:
        for degrees in (0, 1, 2, 3, 5, 10, 15, 20, 30, 45, 60, 75, 90):
            angle = math.radians(degrees)
            pipe = pipe_of(pipe_scene(1.0, angle, clearance))
            length = WAVES * pipe.wave if degrees else 8 * pipe.scale
            c = column(length, angle, clearance, length / 60)
            theory = onset(pipe_of(c.rod.scene), length)
            rod = found(c, theory).load
            plain = pipe.snaking if degrees else 1.94 * pipe.along * pipe.scale
            rows.append((clearance, degrees, rod, theory, plain))
            lines.append(
                [
                    f"{1e3 * clearance:g} mm, {degrees}°",
                    f"{length:.0f}",
                    f"{rod / 1e3:.2f}",
                    f"{theory / 1e3:.2f}",
                    f"{1e4 * (rod / theory - 1):+.1f}e-4",
                    f"{plain / 1e3:.2f}",
                    f"{rod / plain:.3f}",
                ]
            )
            print(*lines[-1])
    head = ["clearance, inclination", "length, m", "rod, kN", "beam, kN", "difference", "formula, kN", "rod/formula"]
    return rows, table(head, lines)


#: Degree of the fields and points of contact per element.
RULES = {
    (1, 2): "degree 1",
    (2, 3): "degree 2",
    (3, 4): "degree 3",
    (3, 3): "degree 3, 3 points",
    (3, 2): "degree 3, 2 points",
}
SPACINGS = (12.5, 8.0, 6.25, 4.0, 3.0, 2.0, 1.0)
Errors = dict[tuple[int, int], list[tuple[float, float]]]


def over_mesh(clearance: float) -> tuple[Errors, str]:
    """Relative error of the onset by rule, as (spacing over wave, error), and the table of it with waves found."""
    errors: Errors = {}
    lines = []
    pipe = pipe_of(pipe_scene(1.0, LEVEL, clearance))
    length = WAVES * pipe.wave
    for (degree, points), name in RULES.items():
        errors[degree, points], cells = [], [name]
        for spacing in SPACINGS:
            c = column(length, LEVEL, clearance, spacing, degree, kind=with_points(points))
            exact, _ = pinned_onset(pipe_of(c.rod.scene), length)
            at = found(c, exact)
            error, way = at.load / exact - 1, at.motion[c.rod.nodes, 1]
            halves = int((np.diff(np.sign(way[np.abs(way) > 1e-6 * np.abs(way).max()])) != 0).sum()) + 1
            errors[degree, points].append((length / c.rod.scene.mesh.elements / pipe.wave, error))
            size = f"{100 * error:+.2g} %" if abs(error) > 1e-4 else f"{error:+.0e}"
            cells.append(size if halves == 2 * WAVES else f"{size} ({halves})")
        (x2, e2), (x1, e1) = errors[degree, points][-3:-1]
        cells.append(f"{math.log(e2 / e1) / math.log(x2 / x1):.2f}")
        lines.append(cells)
        print(*cells)
    return errors, table([f"waves of {pipe.wave:.1f} m", *(f"h = {h:g} m" for h in SPACINGS), "order"], lines)


def draw_onset(rows: Sequence[tuple[float, ...]], errors: dict[float, Errors]) -> None:
    """Load over inclination, error over mesh."""
    with style.page(1500, 680) as figure:
        style.heading(
            figure, "Where a string starts to snake", "127/108 mm steel pipe, ten waves long, pinned at both ends"
        )
        left, right = figure.add_axes((0.06, 0.11, 0.42, 0.70)), figure.add_axes((0.56, 0.11, 0.42, 0.70))
        for clearance, colour in zip(CLEARANCES, (style.BLUE, style.VERMILION), strict=True):
            mine = np.array([r[1:] for r in rows if r[0] == clearance])
            name = f"{1e3 * clearance:g} mm of clearance"
            left.plot(mine[:, 0], mine[:, 1] / 1e3, "o", color=colour, ms=6, label=f"rod, {name}")
            left.plot(
                mine[1:, 0], mine[1:, 2] / 1e3, color=colour, lw=1.3, label="beam on the wall, weight along the hole"
            )
            fine = np.radians(np.linspace(0, 90, 200))
            pipe = pipe_of(pipe_scene(1.0, LEVEL, clearance))
            left.plot(
                np.degrees(fine),
                pipe.snaking * np.sqrt(np.sin(fine)) / 1e3,
                color=colour,
                lw=1.1,
                ls=(0, (4, 3)),
                label="2 √(EI w sin(i)/r)",
            )
        left.set(xlabel="inclination (degrees)", ylabel="load on the lower end (kN)", xlim=(-1.5, 91.5), ylim=(0, None))
        left.set_title("Onset")
        left.legend(loc="center right", bbox_to_anchor=(1.0, 0.24), fontsize=9)
        colours = (style.ORANGE, style.GREEN, style.BLUE, style.SKY, style.PURPLE)
        for clearance, mark in zip(CLEARANCES, ("o", "s"), strict=True):
            for (rule, at), colour in zip(errors[clearance].items(), colours, strict=True):
                x, e = np.array(at).T
                label = RULES[rule] if clearance == CLEARANCES[0] else None
                right.loglog(x, np.maximum(np.abs(e), 1e-9), marker=mark, ms=4, color=colour, lw=1.0, label=label)
        for clearance in CLEARANCES:
            x = 12.5 / pipe_of(pipe_scene(1.0, LEVEL, clearance)).wave
            right.axvline(x, color=style.GREY, lw=0.9, ls=(0, (5, 3)))
            right.text(x * 0.98, 2e-9, f"12.5 m at {1e3 * clearance:g} mm", rotation=90, ha="right", color=style.GREY)
        right.set(xlabel="element over wave", ylabel="size of the error of the load, relative", ylim=(1e-9, 30.0))
        right.set_xticks([0.05, 0.1, 0.2, 0.5], ["0.05", "0.1", "0.2", "0.5"])
        right.minorticks_off()
        right.set_title("Error of the mesh (dots: 10 mm, squares: 44.5 mm)")
        right.legend(loc="upper left", fontsize=9, ncols=2)
        style.save(figure, IMG / "buckling-onset.png")


# -- snaking and winding ----------------------------------------------------------------------------------------------
def betas(first: float, last: float, step: float = 0.05) -> Array:
    """Loads from one to another, over the snaking load."""
    return np.round(np.arange(first, last + step / 2 * np.sign(step), step), 4)


def path(c: Column, x: Array, pipe: Pipe, loads: Array, name: str) -> list[Step]:
    """Equilibria under loads (over the snaking load) one after the other."""
    steps = []
    for step in follow(c, x, loads * pipe.snaking):
        steps.append(step)
        print(
            f"{name} {step.load / pipe.snaking:.2f}: {step.turns:.2f} turns, side force {step.side[:, 1].max():.0f} N/m"
        )
    return steps


def jump(steps: Sequence[Step], pipe: Pipe, wound_up: bool) -> str:
    """Between which loads (over sqrt(EI w/r)) the string first makes a whole turn, or first makes none any more."""
    for a, b in pairwise(steps):
        if (a.turns < 1) == wound_up and (b.turns >= 1) == wound_up:
            return f"{2 * a.load / pipe.snaking:.2f} to {2 * b.load / pipe.snaking:.2f}"
    return f"none up to {2 * steps[-1].load / pipe.snaking:.2f}"


def energies(c: Column, steps: Sequence[Step], pipe: Pipe) -> Array:
    """Energy per length over that of the straight string, in w r, of steps on the axis at both ends."""
    out = []
    c.push(0.5 * pipe.snaking)
    straight = c.settle(c.hanging(), 0.5 * pipe.snaking)
    for step in sorted(steps, key=lambda s: s.load):
        # Newton's iteration keeps the symmetry, and with it the straight string that is not stable
        straight = c.equilibrium(straight, step.load)
        out.append((step.load / pipe.snaking, step.energy - c.energy(straight)))
    return np.array(out) * [1.0, 1.0 / (pipe.across * pipe.clearance * c.rod.length)]


def crossings(c: Column, pipe: Pipe, turns: Sequence[int], snakes: Array) -> tuple[float, float]:
    """Loads (over sqrt(EI w/r)) at which the best of some helices has the energy of the straight string, of the
    snaking one."""
    best = []
    for n in turns:
        c.push(1.7 * pipe.snaking)
        x = wound(c, n, 1.7 * pipe.snaking, pipe.wave / 3)
        e = energies(c, path(c, x, pipe, betas(1.65, 1.3, -0.05), f"helix of {n}"), pipe)
        best.append(np.interp(snakes[:, 0], e[:, 0], e[:, 1]))

    def zero(gap: Array) -> float:
        i = int(np.flatnonzero((gap[:-1] > 0) & (gap[1:] <= 0))[0])
        return float(2 * np.interp(0.0, -gap[i : i + 2], snakes[i : i + 2, 0]))

    energy: Array = np.min(best, axis=0)
    return zero(energy), zero(energy - snakes[:, 1])


def draw_paths(pipe: Pipe, runs: dict[str, list[Step]], snakes: Array, helices: Array, pinned: list[Step]) -> None:
    """Swing, energy and turns over the load."""
    with style.page(1700, 640) as figure:
        words = f"10 mm of clearance, level, {WAVES} waves long; load over √(EI w/r): 2 is where it starts to snake"
        style.heading(figure, "Snaking and winding", words)
        swing, energy, turns = (figure.add_axes((0.045 + 0.325 * i, 0.11, 0.27, 0.70)) for i in range(3))
        waves = snake(betas(1.002, 2.4, 0.02))
        swing.plot(
            [2 * w.beta for w in waves],
            [w.amplitude for w in waves],
            color=style.INK,
            lw=1.2,
            label="on the wall, by energy",
        )
        for steps, name, colour in (
            (runs["pushed"], "rod, ends on the axis", style.BLUE),
            (pinned, "rod, ends on the low side", style.ORANGE),
        ):
            at = [s for s in steps if s.turns < 1]
            swing.plot(
                [2 * s.load / pipe.snaking for s in at],
                [s.swing(1.5 * pipe.wave) for s in at],
                "o",
                ms=4,
                color=colour,
                label=name,
            )
        swing.set(xlabel="load over √(EI w/r)", ylabel="angle off the low side (rad)", xlim=(1.8, 4.8), ylim=(0, 1.8))
        swing.set_title("Swing of the snake")
        swing.legend(loc="upper left")
        coiled = helix(betas(2.4, 1.1, -0.02))
        for waves_, colour, name in ((waves, style.BLUE, "snake"), (coiled, style.VERMILION, "helix")):
            energy.plot(
                [2 * w.beta for w in waves_],
                [w.energy for w in waves_],
                color=colour,
                lw=1.2,
                label=f"{name}, on the wall",
            )
        energy.plot(2 * snakes[:, 0], snakes[:, 1], "o", ms=4, color=style.BLUE, label="rod, snaking")
        energy.plot(2 * helices[:, 0], helices[:, 1], "s", ms=4, color=style.VERMILION, label="rod, wound")
        energy.axvline(2 * equal_energy(), color=style.GREY, lw=0.9, ls=(0, (5, 3)))
        energy.set(xlabel="load over √(EI w/r)", ylabel="energy per length over w r", xlim=(1.8, 4.2), ylim=(-1.1, 0.3))
        energy.set_title("Energy, over that of the straight string")
        energy.legend(loc="lower left")
        looks = {
            "pushed": (style.BLUE, ">", "pushed, ends on the axis"),
            "let go": (style.VERMILION, "<", "a helix let go, ends on the axis"),
        }
        for name, (colour, mark, label) in looks.items():
            steps = runs[name]
            turns.plot(
                [2 * s.load / pipe.snaking for s in steps],
                [s.turns for s in steps],
                marker=mark,
                ms=4,
                color=colour,
                lw=0.9,
                label=label,
            )
        turns.plot(
            [2 * s.load / pipe.snaking for s in pinned],
            [s.turns for s in pinned],
            marker=">",
            ms=4,
            color=style.ORANGE,
            lw=0.9,
            label="pushed, ends on the low side",
        )
        for factor in (2.0, 2.83, 3.66):
            turns.axvline(factor, color=style.GREY, lw=0.9, ls=(0, (5, 3)))
            turns.text(factor - 0.03, 9.0, f"{factor:g}", rotation=90, ha="right", color=style.GREY)
        turns.set(
            xlabel="load over √(EI w/r)", ylabel="turns about the hole's axis", xlim=(1.8, 5.2), ylim=(-0.5, 22.0)
        )
        turns.set_title("Winding")
        turns.legend(loc="upper left", frameon=True, facecolor="white", edgecolor="none", framealpha=1.0)
        style.save(figure, IMG / "buckling-path.png")


# -- vertical ---------------------------------------------------------------------------------------------------------
def vertical() -> tuple[list[Step], Pipe, str]:
    """A vertical string pushed at its lower end, what it does, and the table of it."""
    pipe = pipe_of(pipe_scene(1.0, 0.0, CLEARANCES[1]))
    unit, length = pipe.along * pipe.scale, 16 * pipe.scale
    c = column(length, 0.0, CLEARANCES[1], 4.0, k=1e7)
    steps = list(follow(c, c.hanging(), np.arange(1.5, 9.01, 0.25) * unit))
    theory = onset(pipe, length)
    first = find_onset(c, c.equilibrium(c.hanging(), 0.0), 0.85 * theory, 4 * theory)
    assert first is not None

    def where(holds: list[bool]) -> str:
        i = holds.index(True)
        return f"{steps[i - 1].load / unit:.2f} to {steps[i].load / unit:.2f}"

    on = [s.radius > 0.98 * pipe.clearance for s in steps]
    lying = [float(np.trapezoid(o, s.arc_length)) for o, s in zip(on, steps, strict=True)]
    lines = [
        ["loses its straightness (softest motion)", f"{first.load / unit:.4f}"],
        ["  the same, by the beam's equation (Lubinski's problem at this length)", f"{theory / unit:.4f}"],
        ["touches the wall, at one point", where([bool(o.any()) for o in on])],
        ["leaves its plane", where([s.turns > 0.02 for s in steps])],
        ["lies along the wall, for more than 15 m", where([x > 15.0 for x in lying])],
        ["has made a whole turn", where([s.turns > 1 for s in steps])],
        [
            "has made a whole turn on the wall",
            where([bool(o.any()) and np.ptp(s.angle[o]) > 2 * math.pi for o, s in zip(on, steps, strict=True)]),
        ],
    ]
    return steps, pipe, table(["vertical string", "load over (EI w²)^(1/3)"], lines)


# -- a well ----------------------------------------------------------------------------------------------------------
def well() -> str:
    """P11-A-02 pushed, on a mesh that sees it and on one that does not; the table of the command."""
    rows = {}
    with tempfile.TemporaryDirectory() as folder:
        for elements in (300, 540):
            out = Path(folder) / str(elements)
            push(load_scene("survey-p11-a-02", {"mesh.elements": elements}), out, "450 kN")
            rows[elements] = json.loads((out / "buckling.json").read_text(encoding="utf-8"))["steps"]
        shutil.copyfile(out / "buckling.png", IMG / "buckling-well.png")
    head = [
        "weight on bit, kN",
        "compression over snaking load, up to",
        "bending moment up to, kN m",
        "winds by, turns",
    ]
    keys = (
        ("weight_on_bit", 1e-3, 0),
        ("compression_over_limit", 1.0, 2),
        ("bending_moment", 1e-3, 1),
        ("turns", 1.0, 2),
    )
    lines = [[f"{scale * row[key]:.{digits}f}" for key, scale, digits in keys] for row in rows[540]]
    lines = [[*line, f"{row['turns']:.2f}"] for line, row in zip(lines, rows[300], strict=True)]
    return table([*head, "on 300 elements"], lines)


# -- the page ---------------------------------------------------------------------------------------------------------
def onsets() -> dict[str, str]:
    """Onset over inclination and mesh."""
    rows, inclinations = over_inclination()
    meshes = {clearance: over_mesh(clearance) for clearance in CLEARANCES}
    draw_onset(rows, {clearance: errors for clearance, (errors, _) in meshes.items()})
    return {"inclinations": inclinations, "meshes": "\n\n".join(text for _, text in meshes.values())}


def paths() -> dict[str, str]:
    """Snaking, winding, and back."""
    pipe = pipe_of(pipe_scene(1.0, LEVEL, CLEARANCES[0]))
    c = column(WAVES * pipe.wave, LEVEL, CLEARANCES[0], 2.0)
    low = path(c, c.lying(), pipe, betas(0.95, 2.4), "ends on the low side")
    c = column(WAVES * pipe.wave, LEVEL, CLEARANCES[0], 2.0)
    half = c.settle(c.hanging(), 0.5 * pipe.snaking)
    pushed = path(c, half, pipe, betas(0.95, 2.6), "pushed")
    c.push(2.2 * pipe.snaking)
    coil = wound(c, round(WAVES * math.sqrt(2.2)), 2.2 * pipe.snaking, pipe.wave / 3)
    let_go = path(c, coil, pipe, betas(2.2, 0.95, -0.05), "let go")
    snakes = energies(c, [s for s in pushed if 1 < s.load / pipe.snaking and s.turns < 1], pipe)
    helices = energies(c, [s for s in let_go if s.turns > 5], pipe)
    straight, equal = crossings(c, pipe, (10, 11, 12, 13), snakes)
    draw_paths(pipe, {"pushed": pushed, "let go": let_go}, snakes, helices, low)

    def of(steps: Sequence[Step], load: float) -> Step:
        return min(steps, key=lambda s: abs(s.load / pipe.snaking - load))

    mixed = (
        next(s for s in let_go if s.turns < 5 and s.turns > 1) if any(1 < s.turns < 5 for s in let_go) else of(low, 1.6)
    )
    chosen = [of(pushed, 1.05), of(pushed, 1.5), of(pushed, 2.0), mixed, of(let_go, 1.7)]
    names = [f"{2 * s.load / pipe.snaking:.2f} √(EI w/r): {s.turns:.1f} turns" for s in chosen]
    words = f"127/108 mm pipe, 10 mm of clearance, {WAVES * pipe.wave:.0f} m; hole drawn too wide; colour: side force"
    shapes(
        chosen, names, pipe.clearance, "Shapes of a pushed string in a level hole", words, IMG / "buckling-shapes.png"
    )
    swings = [(s.load / pipe.snaking, s.swing(1.5 * pipe.wave)) for s in low if 1 < s.load / pipe.snaking < 1.41]
    at = np.array([b for b, _ in swings])
    theory, held = snake(at), snake(at, 1.0)
    snaking = table(
        ["load over √(EI w/r)", *(f"{2 * b:.1f}" for b, _ in swings[::2])],
        [
            ["rod, rad", *(f"{a:.3f}" for _, a in swings[::2])],
            ["on the wall, by energy, as many waves, rad", *(f"{w.amplitude:.3f}" for w in held[::2])],
            ["on the wall, by energy, waves as long as it likes, rad", *(f"{w.amplitude:.3f}" for w in theory[::2])],
        ],
    )
    winding = table(
        ["", "load over √(EI w/r)"],
        [
            ["a helix has the energy of the straight string (Chen, Lin, Cheatham)", "2.83"],
            [f"  the same of the rod, {WAVES} waves long, ends on the axis", f"{straight:.2f}"],
            ["a helix has the energy of the snake, on the wall", f"{2 * equal_energy():.2f}"],
            [f"  the same of the rod, {WAVES} waves long, ends on the axis", f"{equal:.2f}"],
            ["all of it wound up (Wu, Juvkam-Wold), 2 (2√2 - 1)", "3.66"],
            ["rod pushed, ends on the low side: first whole turn", jump(low, pipe, True)],
            ["rod pushed, ends on the axis: first whole turn", jump(pushed, pipe, True)],
            ["helix let go: last whole turn", jump(let_go, pipe, False)],
        ],
    )
    return {"snaking": snaking, "winding": winding}


def upright() -> str:
    """The vertical string, drawn."""
    steps, hanging, lines = vertical()
    unit = hanging.along * hanging.scale
    three = [min(steps, key=lambda s: abs(s.load / unit - f)) for f in (2.5, 4.5, 9.0)]
    names = [f"{s.load / unit:.2f} (EI w²)^(1/3): {s.turns:.1f} turns" for s in three]
    words = "44.5 mm of clearance, lower end at the right; width of the hole exaggerated; colour: side force"
    shapes(three, names, hanging.clearance, "Shapes of a vertical string", words, IMG / "buckling-vertical.png")
    return lines


def write(parts: dict[str, str]) -> None:
    """docs/buckling.md."""
    text = TEXT
    for name, part in parts.items():
        text = text.replace(f"@{name}@", part)
    (DOCS / "buckling.md").write_text(text, encoding="utf-8")


def main() -> None:
    """All of it."""
    write(onsets() | paths() | {"vertical": upright(), "well": well()})


TEXT = """# Buckling of a string in its hole

Written by `benchmarks/buckling.py`.

```
drillfem buckling survey-p11-a-02 --weight-on-bit '450 kN' --out pushed      # table, buckling.png, buckling.json
```

pushes a scene's string into its hole in steps, without friction, and says how far it winds about the hole's axis, how
much it is bent, and how hard it presses on the wall. In Python: `drillfem.buckling.Column` (equilibria, their softest
motion, `settle`), `find_onset`, `follow`, `wound`, and the theories in `drillfem.buckling.theory`.

## How it is found

No formula of buckling is in the rod. A string that is pushed has its straight equilibrium under any load. It is stable
as long as the static stiffness K (the tangent of the weak form, with the contact's) has no motion without resistance:
the least eigenvalue of K against the string's length, by SLEPc about a shift below the most that compression can take
away, -F²/4EI. The **onset** is the load where that eigenvalue passes zero, found to 1e-7.

Beyond it, the string is nudged along that motion by a hundredth of its clearance and creeps, without inertia, in a
thick fluid: implicit steps that get longer as it comes to rest and are cut where it moves by more than 0.15
clearances. At rest the eigenvalue is looked at again, until there is none below zero: what is called an equilibrium
below is a stable one. Creeping goes down in energy all the way, so that nothing is jumped over. Rotations that differ
much between two nodes next to each other are refused: a whole turn could slip through there unnoticed.

The experiments hold the thesis' drill pipe (127/108 mm, EI = 1.279 MN m², w = 268.3 N/m) in a straight hole, both ends
pinned across the hole and free to bend, the upper one held along it, the lower one pushed, no torque. The wall is a
penalty of 1e8 N/m² (its give, 3 micrometres, is counted in the theories' clearance).

## Onset

![onset over inclination and mesh](img/buckling-onset.png)

@inclinations@

"Beam" is EI v'''' + (F v')' + (w sin(i)/r) v = 0 with the same length and ends and with the weight along the hole in F,
solved in sines; 0° is Lubinski's problem at L = 8 (EI/w)^(1/3), where its 1.94 holds. What is left between it and the
rod is shear and stretch, which the beam has not: level, with both counted (Haringx), the rod agrees to 2e-8 at
h = 1 m, and on coarser meshes to the errors below. "Formula" is 2 √(EI w sin(i)/r), and Lubinski's 1.94 (EI w²)^(1/3)
at 0°.
An inclined string needs more on its end than the formula says, because its compression falls off up the hole; the
fewer degrees, the more. The level ones are 370.5 kN with waves of 16.5 m at 10 mm and 175.6 kN, 24.0 m at 44.5 mm.

## What a mesh sees

Error of the onset, level; in brackets the half waves that the mesh buckles in, where they are not 20; order between 3
and 2 m; "points" are those of contact per element, degree + 1 if not said:

@meshes@

Orders are 2p; with too few points (2 at degree 3) they are not. Linear elements of 12.5 m are off by half and more,
and see a string as stable that has long wound up (`tests/physics/test_buckling_in_hole.py`); they need h ≤ 2 m for 1 to
2 %. The default elements (degree 3) see the onset on 12.5 m to 2 %, on 6 m to 1e-3.

Every run of a rod in a hole, `drillfem buckling` and `torque-drag --method stiff` warn that a mesh cannot see the
string buckle where its compression passes 0.9 of the load of the formula (curvature of the hole counted) and nodes
are farther apart than an eighth of a wave, 2π √(2 EI/F): here h = 2.1 m for degree 1 (off by 2.5 %),
6.2 m for degree 3 (7e-4). The warning says where, and how many elements it takes.

## Snaking, winding, and back

![swing, energy, turns](img/buckling-path.png)

Swing of a snake (ends on the low side, ten waves; these ends let it have no other number):

@snaking@

@winding@

![shapes](img/buckling-shapes.png)

- The snake is found where theory has it, and swings as the least energy on the wall says, to 0.5 %, until it lifts off
  the wall in places (from 3.5 √(EI w/r) on, with h = 1 m), which the theory has not.
- The rod's helix has the energy of the straight string at 2.79, and that of the snake, which is what it must compete
  with, at 2.90: 2.83 is the energy of an endless even helix; a real one bulges, and whole turns must fit.
- Pushed, a string does not wind there by itself. With ends on the low side it does, at 2.9 to 3.0: the first wave
  climbs more than the others and passes over the top. With ends on the hole's axis the snake is stable far beyond
  3.66, up to 5.2 at least, as the stiffness confirms; on the wall it exists up to 5.27 (Miska's upper bound is 5.66).
- Let go, the helix keeps its turns, loses pairs of them where fewer fit, and falls back to the snake at 2.5 to 2.6,
  where it no longer has the force to hold on to the top of the hole.
- So 2.83 and 3.66 are no two loads at which something happens to a string without friction: between 2.6 and 4.4 (where
  the helix was let go) both shapes are stable, and the history (and what shakes the string) decides which it has.
  3.66 = 2 (2√2 - 1) is no limit of stability either, but the load on the end of a string while it winds, if the mean
  from 2 on is 2.83.

## Vertical

@vertical@

![vertical shapes](img/buckling-vertical.png)

269 m of pipe, both ends pinned on the axis, 44.5 mm of clearance. The known 5.55 (EI w²)^(1/3) lies where the string
has come to rest along the wall and has made three quarters of a turn.

## A real well

![P11-A-02 pushed](img/buckling-well.png)

P11-A-02 with the string of its scene, without friction, on 540 elements:

@well@

The string snakes where its compression passes the formula's load with the curvature of the hole counted (2050 to
2640 m, the level part), and stays put in the bends above although the compression is the same there: a hole that builds
holds a pushed string down. It stays a snake beyond the load of the formula for winding, as in the level hole. "Winds
by" is the range of its angle about the hole's axis compared with the string laid there: half a turn, too, where it
changes from the low to the high side in a bend, which is what most of these numbers are.

The scene's own 300 elements are too few, and the command says so: there the string winds where it should snake. On 800
the numbers are those of 540, the turns to 0.02.

## What is not in it

No friction (which holds a snake back, and locks a helix up), no torque, no dynamics.
"""


if __name__ == "__main__":
    main()
