"""Entries of the failure atlas where a string touches the wall of its hole; see failure_atlas.py."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from atlas import RPM, Entry, number, picture, run

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import contactfailures as lab
from holelab import EI, GJ, MASS, RADIUS, WEIGHT

from drillfem.render import style
from drillfem.scene import Scene, load_scene
from drillfem.solve.guards import warnings
from drillfem.solve.integrators import Method
from drillfem.solve.wall_guards import (
    CHATTER,
    CREEP,
    NARROW,
    ROLL_UNDAMPED,
    WAVE,
    boundary_layer,
    creep,
    fed_turns,
    friction_law,
)

SPEED = 100 * RPM
THETA, ALPHA = "theta", "generalized-alpha"
#: Integrators that bounce: name, kind, rho.
METHODS = (
    ("trapezoidal rule", THETA, 0.9),
    ("generalised-alpha, ρ = 0.9", ALPHA, 0.9),
    ("generalised-alpha, ρ = 0.5", ALPHA, 0.5),
    ("generalised-alpha, ρ = 0", ALPHA, 0.0),
)


def said(scene: Scene, about: str) -> list[str]:
    """Warnings of a scene with these words."""
    return [text for text in warnings(scene) if about in text]


def off_bottom(about: str, **keys: Any) -> tuple[list[str], str]:
    """What is said about the start-up of chapter 4 with other keys (``__`` for a dot); the command that shows it."""
    changed = {name.replace("__", "."): value for name, value in keys.items()}
    if "time.step" in changed:
        changed["output.interval"] = max(0.05, changed["time.step"])
    command = run("off-bottom", *(f"{name}={value}" for name, value in changed.items()), until="5")
    return said(load_scene("off-bottom", changed), about), command


# -- the entries ------------------------------------------------------------------------------------------------------
def soft_penalty() -> Entry:
    """A penalty so soft that the string sinks through the clearance."""
    stiffness = (1e4, 1e5, 1e6)
    found = {k: lab.lying(k, 60.0) for k in stiffness}
    deep = {k: float(sunk[np.abs(s - 36) < 8].mean()) for k, (s, sunk, _) in found.items()}

    def draw(panels: Sequence[Any]) -> None:
        (axes,) = panels
        axes.axhspan(-40, -10, color=style.FAINT)
        axes.axhline(-10, color=style.INK, lw=1)
        axes.text(
            59.5, -20, "in the wall: the pipe's axis is more than 10 mm off that of the hole", ha="right", va="center"
        )
        for k, colour in zip(stiffness, (style.VERMILION, style.ORANGE, style.BLUE), strict=True):
            s, sunk, _ = found[k]
            axes.plot(s, -10 - 1e3 * sunk, color=colour, label=f"k_s = {k:.0e} N/m²")
        axes.set(xlim=(0, 60), ylim=(-40, 1), xlabel="along the pipe, m", ylabel="height of its axis, mm")
        axes.legend(loc="lower left", bbox_to_anchor=(0.4, 0.2))

    picture(
        "soft",
        "A soft penalty sinks through the clearance",
        "chapter 6's pipe (268 N/m) in a horizontal hole, 10 mm clear, held on the axis at its top",
        1,
        draw,
    )
    rows = [(f"k_s = {k:.0e} N/m²: sunk, mm", number(1e3 * deep[k], 3), number(1e3 * WEIGHT / k, 3)) for k in stiffness]
    says, command = off_bottom("is soft", contact__stiffness=1e4)
    return Entry(
        "Penalty contact too soft",
        "soft",
        "A penalty is a spring: the string lies side load/k_s deep in the wall, in statics too, and no mesh and no "
        "step changes that. With chapter 6's k_s = 1e4 N/m² the pipe is 26.8 mm behind a wall that is 10 mm away: it "
        "buckles, whirls and bends in a hole of another width.",
        rows,
        "Compares side load/k_s, weight and bends counted, with the clearance at the start and at the end of a run, "
        "and says which stiffness leaves a tenth of it. `contact.method = 'augmented'` leaves none.",
        says,
        command,
    )


def stiff_penalty() -> Entry:
    """A penalty so stiff that steps do not resolve a bounce."""
    counts = np.geomspace(1, 16, 90)
    runs = {name: lab.dropped(2, kind, rho, 1.0) for name, kind, rho in METHODS}
    runs["trapezoidal rule, augmented"] = lab.dropped(2, THETA, end=1.0, method="augmented")
    dots = {
        (kind, rho): [lab.bounced(2 * math.pi / n, 0.4, kind, rho) for n in (1.5, 2, 3, 5, 8)]
        for _, kind, rho in METHODS
    }

    def draw(panels: Sequence[Any]) -> None:
        left, right = panels
        colours = (style.VERMILION, style.ORANGE, style.PURPLE, style.GREEN, style.INK)
        for (name, (t, energy)), colour in zip(runs.items(), colours, strict=True):
            left.semilogy(t, np.maximum(energy, 1e-3), color=colour, label=name, lw=1.2)
        left.set(xlim=(0, 1), ylim=(1e-2, 1e4), xlabel="time, s", ylabel="energy / energy at the start")
        left.set_title("a pipe falls 10 mm: two steps per period of the contact")
        left.legend(loc="upper left", ncols=1)
        right.axhline(1, color=style.GREY, lw=1)
        for (_, kind, rho), colour in zip(METHODS, colours, strict=False):
            method = Method(kind, rho_infinity=rho)
            gains = np.array([method.bounce(2 * math.pi / n) for n in counts])
            right.fill_between(counts, gains.min(axis=1), gains.max(axis=1), color=colour, alpha=0.12, lw=0)
            right.plot(counts, gains.max(axis=1), color=colour, lw=1)
            right.plot((1.5, 2, 3, 5, 8), dots[kind, rho], "o", color=colour, ms=4)
        right.axhline(CHATTER, color=style.INK, ls=":", lw=1)
        right.text(15.5, CHATTER * 1.05, "guard", ha="right", va="bottom")
        right.set(xscale="log", yscale="log", xlim=(1, 16), ylim=(0.1, 12))
        right.set(xlabel="steps per period of the contact", ylabel="energy after a bounce / before")
        right.set_xticks([1, 2, 4, 8, 16], ["1", "2", "4", "8", "16"])
        right.minorticks_off()
        right.set_title("bands: wherever in a step the wall is met; dots: PETSc")

    picture(
        "stiff",
        "A wall that the steps do not resolve gives back more than it got",
        "penalty contact, 2π √(ρA/k_s) = 33 ms for chapter 6's pipe on 1e6 N/m²",
        2,
        draw,
    )
    rows = []
    for name, kind, rho in METHODS:
        gain = Method(kind, rho_infinity=rho).bounce(math.pi)
        found = lab.bounced(math.pi, (41 + 0.5) / len(gain), kind, rho)
        rows.append((f"{name}, 2 steps per period: energy after a bounce", number(found), number(float(gain[41]))))
        rows.append((f"{name}: energy after 1 s of bouncing", number(float(runs[name][1][-1]), 3), "1"))
    rows.append(
        (
            "trapezoidal rule, augmented: energy after 1 s",
            number(float(runs["trapezoidal rule, augmented"][1][-1]), 3),
            "1 or less",
        )
    )
    says, command = off_bottom("chatters", contact__stiffness=1e7)
    return Entry(
        "Penalty contact too stiff for the step",
        "stiff",
        "Half a period of the contact, π √(ρA/k_s), is what a bounce takes. Where steps do not resolve it, each bounce "
        "multiplies the energy by a factor that depends on where in a step the wall is met: with two steps per period "
        "up to 3.3, and those win; with four up to 1.55, with eight up to 1.09. The trapezoidal rule is neutral on "
        "waves and not on bounces; generalised-alpha does not help for ρ = 0.9 and little for 0.5, only ρ = 0 takes "
        "energy out wherever the wall is met.",
        rows,
        "Drops a mass on the wall by the scene's own integrator, in 64 phases and on softer walls too, and says the "
        f"worst factor above {CHATTER:g}. The augmented Lagrangian lets a string land without bouncing.",
        says,
        command,
    )


def stiff_bend() -> Entry:
    """The trapezoidal rule on a stiff wall in large rotation."""
    kinds = [*METHODS, ("trapezoidal rule, augmented", THETA, 0.9)]
    runs = {}
    for name, kind, rho in kinds:
        contact = {"method": "augmented"} if "augmented" in name else {}
        runs[name] = lab.turning(
            1e7, 1e-2, kind, rho, 1.5, length=20.0, elements=2, hole={"kind": "arc", "radius": 50.0}, contact=contact
        )
    alone = 7800 * EI / 210e9 * SPEED**2 * 20.0

    def draw(panels: Sequence[Any]) -> None:
        (axes,) = panels
        colours = (style.VERMILION, style.ORANGE, style.PURPLE, style.GREEN, style.INK)
        for (name, (rows, why, _)), colour in zip(runs.items(), colours, strict=True):
            axes.semilogy(rows[:, 0], rows[:, 1], color=colour, label=name, lw=1.2)
            if why:
                axes.plot(rows[-1, 0], rows[-1, 1], "x", color=colour, ms=8)
        axes.axhline(alone, color=style.GREY, lw=1, ls=":")
        axes.text(1.49, alone * 1.1, "spin alone", ha="right", va="bottom", color=style.GREY)
        axes.set(xlim=(0, 1.5), ylim=(1, 1e6), xlabel="time, s", ylabel="kinetic energy, J")
        axes.legend(loc="upper left", ncols=2)

    picture(
        "bend",
        "A stiff wall blows up a string that turns in a bend",
        "20 m of pipe, bend of 50 m radius, 100 rpm, 1e7 N/m², steps of 10 ms: one per period of the contact",
        1,
        draw,
    )
    rows = [
        (f"{name}: largest kinetic energy, J", number(float(r[:, 1].max()), 3), number(alone, 3) + " of spin alone")
        for name, (r, _, _) in runs.items()
    ]
    rows += [
        (f"{name}: breaks down at, s", number(float(r[-1, 0]), 3), "") for name, (r, why, _) in runs.items() if why
    ]
    says = said(runs["trapezoidal rule"][2], "chatters") + said(runs["trapezoidal rule"][2], "large rotation")
    return Entry(
        "The trapezoidal rule in large rotation with contact",
        "bend",
        "A string that is driven round in a bend is thrown from wall to wall by its own friction. With steps that do "
        "not resolve the contact each impact feeds it, its rotation couples to its whirl, and the energy grows by "
        "orders of magnitude until no step succeeds. Which of the undamped methods goes first is chance.",
        rows,
        "Warns of the wall (see above), and of the trapezoidal rule in large rotation; a run that breaks down keeps "
        "what was computed and says why.",
        says,
        run("off-bottom", "contact.stiffness=1e7", "time.integrator=theta", "time.step=0.01", until="20"),
    )


def coarse_contact() -> Entry:
    """A mesh coarser than the boundary layer of the contact."""
    counts, finest = (10, 20, 40, 80), 320
    found = {n: lab.kink(n) for n in (*counts, finest)}
    layer = float(boundary_layer(EI, 1e6))
    peaks = {n: lab.peak(s, force) for n, (s, force, _, _) in found.items()}
    sums = {n: total for n, (_, _, total, _) in found.items()}

    def draw(panels: Sequence[Any]) -> None:
        left, right = panels
        for n, colour, line in zip(
            (10, 20, finest), (style.VERMILION, style.ORANGE, style.INK), ("o", "s", "-"), strict=True
        ):
            s, force, _, _ = found[n]
            left.plot(s, force, line, color=colour, ms=3.5, label=f"elements of {80 / n:.3g} m")
        left.set(xlim=(32, 52), ylim=(0, 700), xlabel="along the pipe, m", ylabel="side force, N/m")
        left.legend(loc="upper left")
        left.set_title("kink at 40 m: straight above, 150 m radius below")
        size = np.array([80 / n / layer for n in counts])
        for values, name, colour in (
            (peaks, "largest side force", style.VERMILION),
            (sums, "sum of the side force", style.BLUE),
        ):
            error = np.array([abs(values[n] / values[finest] - 1) for n in counts])
            right.loglog(size, error, "o-", color=colour, label=name, ms=5)
        right.axvline(NARROW, color=style.INK, ls=":")
        right.set(xlabel="element / boundary layer", ylabel="relative error", ylim=(1e-4, 1))
        right.set_xticks([0.5, 1, 2, 3, 5], ["0.5", "1", "2", "3", "5"])
        right.minorticks_off()
        right.legend(loc="upper left")
        right.set_title("dotted: the guard")

    picture(
        "kink",
        "A mesh that does not see the boundary layer of the contact",
        f"pipe laid in a hole with a kink, k_s = 1e6 N/m²: (4EI/k_s)^¼ = {layer:.2f} m",
        2,
        draw,
    )
    error = {n: abs(peaks[n] / peaks[finest] - 1) for n in counts}
    order = np.polyfit(np.log([80 / n for n in counts]), np.log(list(error.values())), 1)[0]
    rows = [
        (f"elements of {80 / n:.3g} m: largest side force near the kink, N/m", number(peaks[n]), number(peaks[finest]))
        for n in counts
    ]
    rows += [
        ("order of its error in the element", number(float(order), 2), ""),
        *[
            (f"elements of {80 / n:.3g} m: sum of the side force, N", number(sums[n]), number(sums[finest]))
            for n in counts[:2]
        ],
    ]
    says, command = off_bottom("kink")
    return Entry(
        "A mesh coarser than the contact's boundary layer",
        "kink",
        "Where the curvature of the hole jumps, the wall must bend the string, within a length of (4EI/k_s)^¼: 1.5 m "
        "for drill pipe on 1e6 N/m². Elements that are longer put that force where their integration points are. The "
        "sum over tens of metres is right within three per cent on any of these meshes, the force at a place is not.",
        rows,
        f"Warns where elements at a kink are more than {NARROW:g} such lengths long and the kink counts beside the "
        "side load. `hole.transition` rounds kinks, as drilled holes do; surveys are smooth from the start.",
        says,
        command,
    )


def unseen_buckling() -> Entry:
    """A mesh that cannot see a string buckle."""
    kinds = {1: (3, 4, 6, 8, 12, 16), 2: (2, 3, 4, 6, 8), 3: (1, 4 / 3, 5 / 3, 2, 3, 4, 8)}
    found = {p: [lab.buckling_growth(n, p)[:2] for n in counts] for p, counts in kinds.items()}

    def draw(panels: Sequence[Any]) -> None:
        (axes,) = panels
        axes.axhline(1, color=style.GREY, lw=1)
        for (p, counts), colour in zip(kinds.items(), (style.VERMILION, style.BLUE, style.INK), strict=True):
            x = [1 / (n * p) for n in counts]
            axes.plot(x, [max(-0.3, a / b) for a, b in found[p]], "o-", color=colour, label=f"degree {p}", ms=5)
        axes.axvline(WAVE, color=style.INK, ls=":")
        axes.text(WAVE * 1.02, -0.25, "guard", va="bottom")
        axes.set(
            xscale="log", ylim=(-0.3, 1.6), xlabel="distance of nodes / length of a wave", ylabel="growth / true growth"
        )
        axes.set_xticks([1 / 32, 1 / 16, 1 / 8, 1 / 4, 1 / 3], ["1/32", "1/16", "1/8", "1/4", "1/3"])
        axes.minorticks_off()
        axes.legend(loc="lower left")

    picture(
        "buckling",
        "A mesh that cannot see buckling",
        "pipe in a horizontal hole, pushed with 1.3 times 2 √(EI w/r) = 370 kN: waves of 16.5 m grow out of a "
        "micrometre",
        1,
        draw,
    )
    rows = []
    for p, n in ((3, 8), (3, 2), (3, 1), (1, 8), (1, 4), (1, 3)):
        growth, true = found[p][kinds[p].index(n)]
        rows.append((f"degree {p}, elements of {16.5 / n:.3g} m: growth, 1/s", number(growth), number(true)))
    says = said(load_scene("vertical-pi", {"mesh.elements": 150}), "buckle")
    return Entry(
        "A mesh that cannot see buckling",
        "buckling",
        "A string that is pushed along a hole goes into waves; of the thesis' pipe, 10 mm clear, they are 16.5 m long, "
        "and the thesis' elements 12.5 to 19 m. A mesh on whose nodes a wave does not fit is stiffer than the string: "
        "the buckling comes late or never, and nothing else looks wrong.",
        rows,
        "Compares compression with the load at which the string buckles in its hole (2 √(EI N/r), in the vertical 1.94 "
        "(EI w²)^⅓), and the distance of nodes with an eighth of the wave. Cubic elements see a wave that is two of "
        "them long.",
        says,
        run("vertical-pi", "mesh.elements=150", until="5"),
    )


def creeping() -> Entry:
    """Friction that never sticks."""
    scales = (5, 10, 20, 50, 100, 500)
    found = [lab.sliding_down(n)[0] for n in scales]
    _, scene = lab.sliding_down(20, end=0.1)
    slow = creep(scene, 2 / 3) * 20

    def draw(panels: Sequence[Any]) -> None:
        left, right = panels
        v = np.linspace(0, 1.2, 600)
        for n, colour in zip((5, 20, 100), (style.VERMILION, style.ORANGE, style.BLUE), strict=True):
            left.plot(v, friction_law(scene, n * v), color=colour, label=f"n = {n} s/m")
        left.axvline(RADIUS * SPEED, color=style.GREY, lw=1)
        left.text(RADIUS * SPEED * 1.02, 0.02, "100 rpm", color=style.GREY)
        left.set(xlim=(0, 1.2), ylim=(0, 0.32), xlabel="sliding speed, m/s", ylabel="coefficient of friction")
        left.legend(loc="upper right")
        right.loglog(scales, [slow / n for n in scales], color=style.GREY, label="where the law gives 0.2")
        right.loglog(scales, found, "o", color=style.VERMILION, label="pipe on a slope of 0.2", ms=6)
        right.set(xlabel="n, s/m", ylabel="creep, m/s")
        right.legend(loc="upper right")

    picture(
        "creep",
        "Rounded friction never sticks",
        "μ_s = 0.3, μ_d = 0.15 and the law (4-7): chapter 4 has n = 5 s/m, chapter 6 has 20",
        2,
        draw,
    )
    rows = [
        (
            f"n = {n} s/m: a pipe held by 2/3 of its static friction creeps, mm/s",
            number(1e3 * v, 4),
            number(1e3 * slow / n, 4),
        )
        for n, v in zip(scales, found, strict=True)
    ]
    spin = load_scene("off-bottom-soft-string", {"soft_string.friction_argument": "spin"})
    assert spin.contact is not None
    at = spin.contact.friction_velocity_scale * (spin.top_drive.speed or 0.0)
    rows.append(
        (
            "the spin in the place of the sliding speed (4-12), 100 rpm: friction",
            number(float(friction_law(spin, at)), 3),
            number(float(friction_law(spin, at * spin.string[0].contact_radius)), 3),
        )
    )
    says, command = off_bottom("never sticks")
    return Entry(
        "Friction that never sticks",
        "creep",
        "The law (4-7) rises from zero: what should hold at rest lets go at the speed at which it reaches the pull. "
        "With chapter 4's n = 5 s/m a pipe that friction of 0.3 should hold on a slope of 0.2 slides at 100 mm/s, ten "
        "times faster than a bit drills, and the peak of the friction lies at 37 rpm of the 100 rpm of the drive. A "
        "larger n sticks better and needs shorter steps at break-off: in steps of 5 ms n = 500 s/m trembles by a "
        "tenth.",
        rows,
        f"Computes the creep at half of the static friction, and speaks above {100 * CREEP:g} % of the speed of the "
        "turning string. Also where the soft string takes the spin (rad/s) for a speed (m/s), errata 20.",
        [*says, *said(spin, "friction_argument")],
        command,
    )


def bouncing_friction() -> Entry:
    """Unprojected friction."""
    runs = {p: lab.thrown(p, 0.2, end=1.5) for p in (True, False)}

    def draw(panels: Sequence[Any]) -> None:
        left, right = panels
        for (projected, (rows, _)), colour in zip(runs.items(), (style.INK, style.VERMILION), strict=True):
            name = "along the wall only" if projected else "as printed (4-9)"
            left.plot(rows[:, 0], rows[:, 1], color=colour, label=name)
            right.plot(rows[:, 0], 1e3 * rows[:, 3], color=colour, label=name)
        rows = runs[True][0]
        left.plot(
            rows[:, 0],
            3 - 0.2 * (9.80665 * rows[:, 0] - rows[:, 2]),
            ":",
            color=style.BLUE,
            lw=2.5,
            label="Coulomb, exact",
        )
        left.set(xlim=(0, 1.5), xlabel="time, s", ylabel="speed along the hole, m/s")
        right.set(xlim=(0, 1.5), ylim=(-60, 220), xlabel="time, s", ylabel="height over where it rests, mm")
        left.legend(loc="lower left")

    picture(
        "unprojected",
        "Friction that takes a bounce for sliding",
        "a pipe thrown along its hole with 3 m/s from a height of 0.2 m, friction of 0.2",
        2,
        draw,
    )
    rows = []
    for projected, (r, _) in runs.items():
        name = "along the wall" if projected else "as printed"
        due = 0.2 * (9.80665 * r[-1, 0] - r[-1, 2])
        rows.append((f"{name}: speed lost in 1.5 s, m/s", number(3 - float(r[-1, 1])), number(due)))
        rows.append(
            (f"{name}: height of the third bounce, mm", number(1e3 * float(r[r[:, 0] > 1.15, 3].max()), 3), "200")
        )
    says, command = off_bottom("bounces", contact__projected="false")
    return Entry(
        "Unprojected friction",
        "unprojected",
        "The printed v_c (4-9) holds the speed towards the wall too (errata 21). Friction then points against the "
        "bounce as well as against the sliding: it brakes the string less along the wall and takes energy out of every "
        "bounce. A string that slides without bouncing does not feel it.",
        rows,
        "The default projects; `contact.projected = false` and `reading = 'literal'` do not, and a warning says how "
        "much of the friction is left for a string that falls through its clearance.",
        says,
        command,
    )


def rolling() -> Entry:
    """Steps too long for a string that rolls along the wall."""
    runs = {
        "generalised-alpha, 2 ms": lab.rolling(2e-3, ALPHA),
        "generalised-alpha, 15 ms": lab.rolling(1.5e-2, ALPHA),
        "trapezoidal rule, 2 ms": lab.rolling(2e-3, THETA),
        "trapezoidal rule, 5 ms": lab.rolling(5e-3, THETA),
        "trapezoidal rule, 10 ms": lab.rolling(1e-2, THETA),
    }
    circle = 0.005 + math.sqrt(0.005**2 + MASS * (SPEED * RADIUS) ** 2 / 1e6)

    def draw(panels: Sequence[Any]) -> None:
        left, right = panels
        for (name, (rows, _)), colour in zip(
            runs.items(), (style.INK, style.BLUE, style.GREEN, style.ORANGE, style.VERMILION), strict=True
        ):
            left.plot(
                rows[:, 0], rows[:, 1], color=colour, lw=1, zorder=1 if "10 ms" in name else 3 if "gen" in name else 2
            )
            right.plot(rows[:, 0], 1e3 * rows[:, 2], color=colour, lw=1.2, label=name)
        left.axhline(-SPEED * RADIUS / circle, color=style.GREY, ls=":")
        left.set(xlim=(0, 0.8), ylim=(-220, 200), xlabel="time, s", ylabel="rate at which it goes round, rad/s")
        right.set(xlim=(0, 0.8), ylim=(0, 32), xlabel="time, s", ylabel="radius of its circle, mm")
        right.legend(loc="upper left", ncols=1)

    picture(
        "rolling",
        "Steps too long for a string that rolls along the wall",
        "end of 20 m of pipe, 100 rpm, 10 mm clear: friction drives it into backward whirl, dotted: Ω r/R",
        2,
        draw,
    )
    rows = []
    base = runs["generalised-alpha, 2 ms"][0]
    late = base[base[:, 0] > 0.6]
    rows.append(
        ("goes round with, rad/s", number(-float(late[:, 1].mean())), number(SPEED * RADIUS / circle) + " rolling")
    )
    for name, h in (("generalised-alpha, 15 ms", 1.5e-2),):
        r = runs[name][0]
        wide = float(r[r[:, 0] > 0.6, 2].mean() / late[:, 2].mean() - 1)
        rows.append(
            (
                f"{name}: circle too wide by, %",
                number(100 * wide, 3),
                number(100 * (late[:, 1].mean() * h) ** 2 / 8, 3) + " = (ωh)²/8",
            )
        )
    for name in ("trapezoidal rule, 2 ms", "trapezoidal rule, 5 ms", "trapezoidal rule, 10 ms"):
        r = runs[name][0]
        rows.append((f"{name}: swing of its rate, rad/s", number(float(r[r[:, 0] > 0.6, 1].std()), 3), "0"))
    says, command = off_bottom("rolls", time__integrator="theta", time__step=5e-3)
    return Entry(
        "Steps too long for a string that rolls",
        "rolling",
        "Friction makes a turning string roll backwards along the wall, r/c times as fast as it turns: with 100 rpm "
        "and 10 mm of clearance ten rounds a second. The curvature of that path is that of the clearance. "
        "Generalised-alpha meets equilibrium on the chord and runs on a wider circle; the trapezoidal rule keeps the "
        "circle and its speeds ring, until it loses the wall.",
        rows,
        f"Computes the turn per step of a string that rolls, with what the wall gives, and speaks above "
        f"{ROLL_UNDAMPED:g} rad (trapezoidal rule) and 0.75 rad (others).",
        says,
        command,
    )


def unrotated() -> Entry:
    """The printed constitutive law where the hole leans."""
    angles = np.radians([0, 15, 30, 45, 60, 75, 90])
    pulled = [lab.stretch("literal", a) / lab.stretch("recommended", a) for a in angles]
    turned = [lab.twist("literal", a) / lab.twist("recommended", a) for a in angles]
    line = np.linspace(0, math.pi / 2, 100)

    def draw(panels: Sequence[Any]) -> None:
        (axes,) = panels
        axes.axhline(1, color=style.GREY, lw=1)
        for values, ratio, name, colour in (
            (pulled, 210 / 77, "stretch: cos² + sin² EA/GA", style.VERMILION),
            (turned, GJ / EI, "twist: cos² + sin² GJ/EI", style.BLUE),
        ):
            axes.plot(np.degrees(line), np.cos(line) ** 2 + np.sin(line) ** 2 * ratio, color=colour, label=name)
            axes.plot(np.degrees(angles), values, "o", color=colour, ms=6)
        axes.set(xlim=(0, 90), ylim=(0, 3), xlabel="inclination of the hole, deg", ylabel="as printed / right")
        axes.legend(loc="upper left")

    picture(
        "unrotated",
        "A stiffness that does not turn with the string",
        "20 m of pipe in a straight hole, pulled and twisted; dots: the rod with reading = 'literal'",
        1,
        draw,
    )
    at = 4
    rows = [
        ("60 deg: stretch over the right one", number(pulled[at]), number(0.25 + 0.75 * 210 / 77)),
        ("60 deg: twist over the right one", number(turned[at]), number(0.25 + 0.75 * GJ / EI)),
        ("vertical: stretch over the right one", number(pulled[0]), "1"),
    ]
    says, command = off_bottom("unrotated", reading="literal")
    return Entry(
        "A stiffness that does not turn with the string",
        "unrotated",
        "(2-113) and (2-114) put the stiffness in front of spatial vectors (errata 14). Where the string leans, its "
        "axial stiffness becomes part of a shear stiffness and its torsional one part of a bending stiffness. A "
        "vertical string does not show it.",
        rows,
        "The recommended reading rotates the stiffness; the literal one is warned of, with both factors where the hole "
        "leans most.",
        says,
        command,
    )


def spatial_spin() -> Entry:
    """The printed angular velocity in a bend."""
    bend = {"kind": "build", "kick_off": 5.0, "radius": 60.0, "final_inclination": math.radians(60)}
    keys: dict[str, Any] = {"length": 80.0, "elements": 8, "hole": bend, "contact": {"friction_velocity_scale": 5}}
    runs = {}
    for name, kind in (("trapezoidal rule", THETA), ("generalised-alpha", ALPHA)):
        runs[f"{name}, right"] = lab.turning(
            1e5,
            5e-3,
            kind,
            end=2.0,
            **keys,
        )
        with lab.spatial_spin():
            runs[f"{name}, as printed"] = lab.turning(1e5, 5e-3, kind, end=2.0, **keys)
    with lab.spatial_spin():
        growth = lab.fastest_growth()
    right = lab.fastest_growth()

    def draw(panels: Sequence[Any]) -> None:
        (axes,) = panels
        for (name, (rows, _, _)), colour, line in zip(
            runs.items(), (style.INK, style.VERMILION, style.BLUE, style.ORANGE), ("-", "-", "--", "-"), strict=True
        ):
            axes.semilogy(rows[:, 0], rows[:, 1], line, color=colour, label=name, lw=1.3)
        axes.set(xlim=(0, 2), ylim=(1, 1e8), xlabel="time, s", ylabel="kinetic energy, J")
        axes.legend(loc="upper left")

    picture(
        "spin",
        "An angular velocity that is spatial here and material there",
        "80 m of pipe driven round with 100 rpm in a bend of 60 m radius to 60 deg, steps of 5 ms",
        1,
        draw,
    )
    rows = [
        (f"{name}: energy that is missing or too much after {r[-1, 0]:.3g} s", number(float(r[-1, 4]), 2), "0")
        for name, (r, _, _) in runs.items()
    ]
    rows += [
        ("as printed: growth of the fastest vibration at rest, 1/s", number(growth, 3), "0"),
        ("right: growth of the fastest vibration at rest, 1/s", number(right, 3), "0"),
    ]
    says, command = off_bottom("unrotated", reading="literal", time__integrator="theta")
    return Entry(
        "Spatial and material spin mixed up",
        "spin",
        "The thesis calls the unknown angular velocity spatial and uses it as a material one in q̇ (2-27) (errata 2). "
        "In a vertical string both are the same. In a bend the string moves by one rule and carries its momentum by "
        "another: vibrations grow even at rest, the wall feels the wrong speed, and the energy that the drive puts in "
        "does not come out. An integrator that damps hides it, with the wrong energy and torque; the trapezoidal rule "
        "does not.",
        rows,
        "The unknown is the material angular velocity, and q̇, momentum, friction and damping all take it so. The "
        "literal reading keeps the mix-up, and is warned of where the hole leans.",
        says,
        command,
    )


def fed_sections() -> Entry:
    """Torque on elements with reduced integration."""
    waves = {kind: lab.torque_wave(kind, end=0.45)[0] for kind in ("reduced", "full")}
    counts = (15, 20, 30, 45, 60)
    found = {kind: [lab.fed_by_torque(n, kind) for n in counts] for kind in ("reduced", "full")}
    theory = [fed_turns(found["reduced"][0][2].string[0], 750 / n, 3, 3000.0) for n in counts]

    def draw(panels: Sequence[Any]) -> None:
        left, right = panels
        for (kind, rows), colour in zip(waves.items(), (style.VERMILION, style.INK), strict=True):
            left.semilogy(rows[:, 0], rows[:, 1], color=colour, label=f"{kind} integration")
        left.set(xlim=(0, 0.45), ylim=(1e-4, 1e4), xlabel="time, s", ylabel="turning across the axis, rad/s")
        left.set_title("top turned faster and faster, elements of 50 m")
        left.legend(loc="upper left")
        size = [750 / n for n in counts]
        for kind, colour in (("reduced", style.VERMILION), ("full", style.INK)):
            right.loglog(size, [max(g, 1e-2) for g, _, _ in found[kind]], "o-", color=colour, label=kind)
        right.loglog(size, [rate for rate, _ in theory], ":", color=style.GREY, label="the guard's estimate")
        right.set(xlabel="element, m", ylabel="growth, 1/s", ylim=(1e-2, 3e3))
        right.set_xticks([12.5, 16.7, 25, 37.5, 50], ["12.5", "16.7", "25", "37.5", "50"])
        right.minorticks_off()
        right.set_title("3 kN m at the free end, fastest growth below 2 kHz")
        right.legend(loc="center left", bbox_to_anchor=(0, 0.53))

    picture(
        "sections",
        "Torque feeds sections that reduced integration lets turn",
        "750 m of undamped drill pipe that hangs straight, off the wall; cubic elements",
        2,
        draw,
    )
    rows = []
    for n in (15, 30, 60):
        growth, frequency, _ = found["reduced"][counts.index(n)]
        rate, _ = theory[counts.index(n)]
        rows.append(
            (
                f"elements of {750 / n:.3g} m, reduced: growth, 1/s (at {frequency:.3g} Hz)",
                number(growth, 3),
                number(rate, 3) + " (fit)",
            )
        )
        rows.append(
            (
                f"elements of {750 / n:.3g} m, full: growth below 2 kHz, 1/s",
                number(found["full"][counts.index(n)][0], 2),
                "the same on any mesh",
            )
        )
    says, command = off_bottom("by themselves", mesh__elements=100, time__step=1.25e-3)
    return Entry(
        "Torque on elements with reduced integration",
        "sections",
        "With as many integration points as its degree p an element does not lock, and does not see one motion: all "
        "sections turning by the Legendre polynomial P_p, which is zero at those points. Shear cannot hold them; they "
        "vibrate at a few hundred hertz. A string without damping that carries a torque which varies along it feeds "
        "them: the interpolated virtual rotations are not conservative on them. On 25 m elements a start-up breaks "
        "down within a second, and shorter steps make it worse, because long ones do not resolve what grows. What is "
        "left with full integration is the same on every mesh and in proportion to the torque; where it comes from is "
        "open.",
        rows,
        "Estimates the growth from torque, element and damping, asks the scene's integrator whether it survives, and "
        "names the two cures: `mesh.quadrature = 'full'`, which from degree 2 on does not lock, or a retardation time "
        "of 1e-5 s.",
        says,
        command,
    )


ENTRIES: tuple[Callable[[], Entry], ...] = (
    soft_penalty,
    stiff_penalty,
    stiff_bend,
    coarse_contact,
    unseen_buckling,
    fed_sections,
    creeping,
    bouncing_friction,
    rolling,
    unrotated,
    spatial_spin,
)
