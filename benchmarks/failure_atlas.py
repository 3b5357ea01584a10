"""The failure atlas: small experiments in which methods fail, each beside theory and beside the guard that warns.

Writes docs/failure-atlas.md and docs/img/failure-*.png; takes about five minutes of one core. The experiments are those
of tests/stability, which holds the numbers. Name entries (functions of this file and of contact_atlas.py) to compute
only those: the rest of the page stays as it is.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from atlas import COLOURS, RPM, Entry, number, picture, run
from common import DOCS

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import failurelab as lab
import rodfailures as rods

from drillfem.errors import SceneError, SimulationError
from drillfem.render import style
from drillfem.results import open_result
from drillfem.scene import load_scene
from drillfem.scene.tables import Surface
from drillfem.solve.guards import (
    PASSAGE,
    RUNAWAY,
    Method,
    boundary,
    locking_factor,
    quaternion_norm,
    refuse,
    self_excitation,
    warnings,
    wear_flat_feed,
)
from drillfem.solve.run import simulate

EULER = {"integrator": "theta", "theta": 1.0}
UNDAMPED = {"material.retardation_time": 0.0, "time.engine": "petsc"}


# -- the entries ------------------------------------------------------------------------------------------------------
def high_order_bdf() -> Entry:
    """BDF of order 3 and more on undamped waves."""
    phase = np.linspace(0.02, 6, 1500)
    at = np.array([0.2, 0.5, 0.9, 1.2, 1.6, 2.0, 2.4, 3.0, 3.6, 4.2, 4.8, 5.5])
    measured = {k: [rods.growth(x, integrator="bdf", order=k) for x in at] for k in (2, 3, 4, 5)}

    def draw(panels: Sequence[Any]) -> None:
        (axes,) = panels
        axes.axhline(1.0, color=style.GREY, lw=1)
        for k, colour in zip((2, 3, 4, 5), COLOURS, strict=False):
            axes.plot(phase, Method("bdf", k).amplification(1j * phase), color=colour, label=f"BDF{k}")
            axes.plot(at, measured[k], "o", color=colour, ms=4)
        axes.set(xlim=(0, 6), ylim=(0.5, 1.5), xlabel="phase of the wave per step ωh, rad", ylabel="growth per step")
        axes.text(5.95, 1.01, "grows for ever", ha="right", va="bottom", color=style.GREY)
        axes.legend(ncols=2)

    picture(
        "bdf",
        "BDF of order 3 and more feeds waves",
        "dots: PETSc on an undamped shaft; lines: stability polynomial",
        1,
        draw,
    )
    turn = 2 * math.pi / 20
    rows = []
    for k in (2, 3):
        grown, theory = (
            rods.growth(turn, integrator="bdf", order=k) ** 20,
            Method("bdf", k).amplification(1j * turn) ** 20,
        )
        rows.append((f"BDF{k}: amplitude after a period of 20 steps", number(grown), number(float(theory))))
    for k, worst in ((3, 1.140), (4, 1.862), (5, 2.384)):
        grown, theory = rods.growth(worst, integrator="bdf", order=k), Method("bdf", k).amplification(1j * worst)
        rows.append((f"BDF{k}: growth per step at ωh = {worst:g}", number(grown, 5), number(float(theory), 5)))
    keys = {"time.integrator": "bdf", "time.order": 3}
    return Entry(
        "High-order BDF on undamped waves",
        "bdf",
        "An undamped wave is an eigenvalue on the imaginary axis. The stability regions of BDF3 to BDF6 leave out a "
        "piece of it: BDF3 amplifies for ωh < 1.94, BDF4 for ωh < 4.71, BDF5 and BDF6 nearly everywhere. A drill-"
        "string has waves of all frequencies, so a finer step only moves the growth to others. Codes that choose the "
        "order of BDF by themselves walk into this.",
        rows,
        "Finds the wave of the string that grows fastest, damping included, and says by how much; the default is "
        "another method.",
        warnings(load_scene("vertical-c1-cd5", UNDAMPED | keys)),
        run(
            "vertical-c1-cd5",
            "material.retardation_time=0",
            "time.engine=petsc",
            "time.integrator=bdf",
            "time.order=3",
            until="2",
        ),
    )


def low_order() -> Entry:
    """Backward Euler on undamped waves."""
    methods: dict[str, dict[str, Any]] = {
        "default (generalised-alpha)": {},
        "BDF2": {"integrator": "bdf", "order": 2},
        "BDF1 (backward Euler)": {"integrator": "bdf", "order": 1},
    }
    pulses = {name: rods.pulse(**keys) for name, keys in methods.items()}

    def draw(panels: Sequence[Any]) -> None:
        (axes,) = panels
        s = pulses["BDF2"][0]
        axes.fill_between(s, np.exp(-(((s - 500) / 60) ** 2)), color=style.FAINT, label="exact")
        for (name, (at, spin)), colour in zip(pulses.items(), COLOURS, strict=False):
            axes.plot(at, spin, color=colour, label=name)
        axes.set(xlim=(0, 1000), xlabel="depth along the string, m", ylabel="spin / spin at the start")
        axes.legend()

    picture(
        "euler",
        "Backward Euler kills waves",
        "a twist wave on 1000 m of drill pipe, back where it began after 4 s up and down; 1 ms steps",
        1,
        draw,
    )
    turn, blades = 2 * math.pi / 20, 6 * 14.42e-3
    rows = []
    for name, keys, theory in (
        ("BDF1", {"integrator": "bdf", "order": 1}, Method("bdf", 1)),
        ("BDF2", {"integrator": "bdf", "order": 2}, Method("bdf", 2)),
        ("generalised-alpha", {}, Method("generalized-alpha")),
    ):
        after = rods.growth(turn, 120, 20, **keys) ** 20
        rows.append(
            (
                f"{name}: amplitude after a period of 20 steps",
                number(after),
                number(float(theory.amplification(1j * turn) ** 20)),
            )
        )
    left = rods.growth(blades, **EULER) ** (2 * math.pi / blades)
    rows.append(
        (
            "backward Euler, 1 ms: left after one blade passage of 13.8 Hz",
            number(left),
            number(float(Method("bdf", 1).amplification(1j * blades) ** (2 * math.pi / blades))),
        )
    )
    rows += [(f"{name}: peak of the pulse after 4 s", number(float(p[1].max()), 3), "1") for name, p in pulses.items()]
    return Entry(
        "Backward Euler on waves",
        "euler",
        "Backward Euler (BDF of order 1, theta = 1) damps a wave by 1/√(1 + (ωh)²) per step: it is a Kelvin-Voigt "
        "damping with a retardation time of about one step. With 1 ms steps the four dampings of chapter 6 (1e-2 to "
        "1e-5 s) would become two.",
        rows,
        "Says what is left after a period of the slowest wave and of the blade passage, and which retardation time "
        "does the same.",
        warnings(load_scene("vertical-c1-cd5", UNDAMPED | {"time.integrator": "theta", "time.theta": 1.0})),
        run("vertical-c1-cd5", "time.engine=petsc", "time.integrator=theta", "time.theta=1", until="5"),
    )


def surfaces() -> Entry:
    """First-order upwind on the rock surface."""
    speed, true = 217 * RPM, boundary(lab.surface_scene(14.42, 16, "dg", 2))
    runs = {
        "DG2, 16 elements": lab.cutting_wave(lab.surface_scene(speed, 16, "dg", 2), 8.0),
        "upwind, 16 cells": lab.cutting_wave(lab.surface_scene(speed, 16), 8.0),
    }
    kinds = {
        "exact": ("profile", 0, 16),
        "DG1, 8": ("dg", 1, 8),
        "SUPG, 16": ("supg", 1, 16),
        "upwind, 64": ("upwind", 0, 64),
        "upwind, 16": ("upwind", 0, 16),
    }
    speeds, scene = np.linspace(8, 25.5, 71), lab.surface_scene(14.42, 16)
    curves = {name: self_excitation(scene, speeds, surface_of(*kind)) for name, kind in kinds.items()}
    theory = {
        name: float(self_excitation(scene, np.array([speed]), surface_of(*kind))[0])
        for name, kind in zip(runs, (("dg", 2, 16), ("upwind", 0, 16)), strict=True)
    }

    def draw(panels: Sequence[Any]) -> None:
        left, right = panels
        for (name, (t, y, _)), colour in zip(runs.items(), (style.INK, style.VERMILION), strict=True):
            left.semilogy(t, abs(y), color=colour, lw=0.8, label=name)
        left.set(xlim=(0, 8), ylim=(1e-7, 30), xlabel="time, s", ylabel="|axial speed over nominal − 1|")
        left.set_title("217 rpm, in time")
        left.legend(loc="upper center", ncols=2)
        right.axhline(0, color=style.GREY, lw=1)
        for i, (name, curve) in enumerate(curves.items()):
            line = {"lw": 5, "color": style.FAINT} if i == 0 else {"color": COLOURS[i], "ls": "--" if i == 2 else "-"}
            right.plot(speeds / RPM, curve, label=name, **line)
        right.axvline(217, color=style.FAINT)
        right.set(xlim=(speeds[0] / RPM, speeds[-1] / RPM), xlabel="speed of the top, rpm", ylabel="growth rate, 1/s")
        right.set_title("characteristic roots")
        right.legend(loc="lower left")

    picture(
        "upwind",
        "First-order upwind moves the stability boundary",
        "case C1, lumped: the cut that a blade leaves is what the next one meets; numerical diffusion forgets it",
        2,
        draw,
    )
    rows = []
    for name, (_, _, measured) in runs.items():
        rows.append((f"{name}: growth at 217 rpm, 1/s", number(measured), number(theory[name])))
    usual, kinds = np.array([14.42]), kinds | {"DG2, 16": ("dg", 2, 16)}
    for name, kind in list(kinds.items())[1:]:
        grown = float(self_excitation(scene, usual, surface_of(*kind))[0])
        rows.append(
            (f"{name}: root at 138 rpm, 1/s", number(grown, 5), number(float(self_excitation(scene, usual)[0]), 5))
        )
    for cells in (16, 64):
        moved = boundary(lab.surface_scene(14.42, cells), surface_of("upwind", 0, cells)) / RPM
        closed = cells * math.tan(math.pi / cells)
        pace = math.sqrt(6 * 0.252e9 * 0.38 * 0.108 * (1 + math.cos(math.pi / cells) ** cells) / 24614.4) / closed
        rows.append((f"upwind, {cells} cells: stable above, rpm", number(moved), number(pace * math.pi / 3 / RPM)))
    exact = math.sqrt(2 * 6 * 0.252e9 * 0.38 * 0.108 / 24614.4) / math.pi * math.pi / 3
    rows.append(("rock as it is: stable above, rpm", number(true / RPM), number(exact / RPM)))
    return Entry(
        "Upwind cells on the rock surface",
        "upwind",
        "The delay between two blades is carried by the rock surface. First-order upwind smears it: each of N cells "
        "passes on 1/(1 + p/N) of exp(−p/N). A bit that chatters in truth drills smoothly in such a code. The theory "
        "of the boundary is the closed form of a rigid mass, (1 + p/N)⁻ᴺ at the phase θ where N atan(θ/N) = π; what "
        "is measured keeps the twist of the string, half a per cent. (In time, what stays on 16 cells is the slow "
        "twist of the string.) Higher order on few elements keeps the delay.",
        rows,
        "Finds the characteristic root with the scene's own surface and with the exact one, and where each changes "
        "sign.",
        warnings(lab.surface_scene(14.42, 64)),
        run("cutting-c1", "model=lumped", "rock.surface.scheme=upwind", "rock.surface.elements=64", until="20"),
    )


def surface_of(scheme: str, degree: int, elements: int) -> Surface:
    """Numerics of a rock surface."""
    return Surface(scheme=scheme, degree=degree, elements=elements)


def newton() -> Entry:
    """Plain Newton on the kink of the wear-flat force."""
    states = rods.bit_states(1000)
    calls, speeds = rods.bracketed(states)
    ramp = (speeds[:, 0] > 0) & (speeds[:, 0] < rods.LAW.axial_regularisation)
    taken = {
        "Newton": rods.snes_iterations(states, "basic"),
        "with line search (bt)": rods.snes_iterations(states, "bt"),
        "with line search (l2)": rods.snes_iterations(states, "l2"),
    }
    state = states[np.flatnonzero(ramp & (states[:, 0] > 0.03))[0]]
    path = rods.newton_path(state, 4)
    v = np.linspace(-0.04, 0.09, 4001)

    def draw(panels: Sequence[Any]) -> None:
        left, right = panels
        spin = float(speeds[np.flatnonzero(ramp & (states[:, 0] > 0.03))[0], 1])
        left.axhline(0, color=style.GREY, lw=1)
        left.plot(v * 1e3, [rods.bit_residual(np.array([x, spin]), state)[0] * 1e3 for x in v], color=style.INK)
        for a, b in zip(path[:-1, 0], path[1:, 0], strict=True):
            height = rods.bit_residual(np.array([a, spin]), state)[0]
            left.plot([a * 1e3, a * 1e3], [0, height * 1e3], color=style.VERMILION, lw=1, ls=":")
            left.annotate(
                "",
                (b * 1e3, 0),
                (a * 1e3, height * 1e3),
                arrowprops={"arrowstyle": "->", "color": style.VERMILION, "lw": 1.3, "shrinkA": 0, "shrinkB": 0},
            )
        left.set(xlabel="axial speed of the bit, mm/s", ylabel="what is missing, mm/s")
        left.set_title("Newton's steps jump over the ramp")
        names = ["bracketed", *taken]
        failed = [0.0] + [100 * float(np.mean(k == 0)) for k in taken.values()]
        stuck = [0.0] + [100 * float(np.mean(k[ramp] == 0)) for k in taken.values()]
        place = np.arange(len(names))
        right.barh(place + 0.18, stuck, 0.34, color=style.VERMILION, label="of those that end on the ramp")
        right.barh(place - 0.18, failed, 0.34, color=style.INK, label="of all states")
        right.set_yticks(place, ["bracketed", "Newton", "Newton\n+ bt", "Newton\n+ l2"])
        right.invert_yaxis()
        right.set(xlim=(0, 108), xlabel="not solved in 50 iterations, %")
        right.set_title("1000 random states of the bit")
        right.legend(loc="upper right", bbox_to_anchor=(1.0, 0.97))

    picture(
        "newton",
        "Plain Newton flips between the branches of the wear-flat force",
        "the force climbs to 33 kN over 10 µm/s: 5000 times the impedance of the string, over a step of 1 ms",
        2,
        draw,
    )
    missing = max(abs(np.array([1, 1e-3]) * rods.bit_residual(x, s)).max() for x, s in zip(speeds, states, strict=True))
    rows = [
        ("states that end on the ramp (the bit is held along its axis)", f"{100 * ramp.mean():.3g} %", ""),
        *[
            (f"{name}: not solved, of those on the ramp", f"{100 * np.mean(k[ramp] == 0):.3g} %", "")
            for name, k in taken.items()
        ],
        (
            "bracketed: evaluations of the law, median and most",
            f"{np.median(calls):.0f}, {calls.max()}",
            "bracketed from the start",
        ),
        ("bracketed: largest residual, m/s", f"{missing:.1e}", "round-off"),
    ]
    return Entry(
        "Newton's method on the wear flats",
        "newton",
        "The force under the wear flats climbs over 10 µm/s of axial speed. On either side of that ramp the tangent "
        "knows nothing of it, so Newton's method jumps across, back, and across again, for ever. A line search stops "
        "the jumps and then often stops altogether: the ramp is a thousandth of the way.",
        rows,
        "No scene can choose plain Newton at the bit. The string is linearised, the rock is not: each iteration ends "
        "with the exact solution of the remaining problem, bracketed from the start (`bitrock/solve.py`). 800 ms of a"
        " bit that sticks along its axis take one iteration per step.",
        [],
        "./run pytest tests/stability/test_rod_newton.py",
    )


def literal() -> Entry:
    """The wear-flat torque as printed."""
    scene = load_scene("cutting-c2", {"reading": "literal"})
    histories = {}
    why = ""
    for name, s in (("as printed", scene), ("with the sign of the spin", load_scene("cutting-c2"))):
        with tempfile.TemporaryDirectory() as folder:
            try:
                simulate(s, out=Path(folder) / "run", until=6.0)
            except SimulationError as error:
                why = str(error)
            history = open_result(Path(folder) / "run").history
            histories[name] = {
                k: np.array(history[k].values) for k in ("time", "bit_angular_speed", "bit_torque", "work_bit")
            }
    limit = RUNAWAY * 14.42

    def draw(panels: Sequence[Any]) -> None:
        left, right = panels
        for (name, h), colour in zip(histories.items(), (style.VERMILION, style.INK), strict=True):
            left.plot(h["time"], h["bit_angular_speed"], color=colour, lw=1, label=name)
            right.plot(h["time"], h["work_bit"] / 1e3, color=colour, label=name)
        for sign in (-1, 1):
            left.axhline(sign * limit, color=style.GREY, lw=1, ls="--")
        left.text(0.1, limit * 1.02, f"stop: {RUNAWAY:g} times the top", color=style.GREY, va="bottom")
        left.set(xlabel="time, s", ylabel="spin of the bit, rad/s", ylim=(-360, 360), xlim=(0, 6))
        right.set(xlabel="time, s", ylabel="work taken by the rock, kJ", xlim=(0, 6))
        left.legend(loc="lower left")

    picture(
        "literal",
        "A torque that keeps its sign drives the bit",
        "case C2, torsional model, the wear-flat torque of (5-19) as printed and with the sign of the spin",
        2,
        draw,
    )
    printed = histories["as printed"]
    spin = printed["bit_angular_speed"]
    over = np.flatnonzero(abs(spin) > limit)[0]
    calm = histories["with the sign of the spin"]["bit_angular_speed"]
    rows = [
        ("as printed: passes the stop at, s", number(float(printed["time"][over]), 3), ""),
        ("as printed: largest spin before the run is stopped, rad/s", number(float(abs(spin).max())), ""),
        (
            "as printed: largest torque on a bit that turns backwards, N m",
            number(float(printed["bit_torque"][spin < 0].max()), 5),
            number(wear_flat_feed(scene)[0], 5),
        ),
        ("with the sign of the spin: fastest and slowest spin, rad/s", f"{calm.max():.3g}, {calm.min():.1g}", ""),
    ]
    return Entry(
        "The wear-flat torque as printed",
        "literal",
        "The printed torque of the wear flats (5-19) does not change sign when the bit turns backwards: instead of "
        "braking it, the rock drives it, with the strength of the stalled rock. In case C2 each swing backwards gains"
        " more than the next swing forwards loses, 12.2 kN m against 7.96 kN m, and the spin grows without limit.",
        rows,
        "Warns before the run, with the power at the speed of the top; stops a run whose bit spins 20 times as fast "
        "as the top, "
        f"keeps what was computed, and says why (`{why.split(':')[0]}`).",
        warnings(scene),
        run("cutting-c2", "reading=literal"),
    )


def quaternions() -> Entry:
    """The norm of quaternions."""
    h, end = 0.05, 8.0
    steps, speed = round(end / h), 100 * RPM
    t, x = h * np.arange(steps + 1), 100 * RPM * h / 2
    drifts = {
        "backward Euler, uncorrected": rods.spinning(h, steps, 0.0, **EULER),
        "backward Euler, corrected": rods.spinning(h, steps, 1.0, **EULER),
        "trapezoidal rule": rods.spinning(h, steps, 0.0, integrator="theta"),
    }
    balance = quaternion_norm(rods.spinning_scene(h, steps, **EULER))

    def draw(panels: Sequence[Any]) -> None:
        (axes,) = panels
        axes.plot(
            t, (1 + x**2) ** np.arange(steps + 1), color=style.ORANGE, label="explicit Euler, uncorrected (theory)"
        )
        for (name, q), colour in zip(drifts.items(), (style.VERMILION, style.BLUE, style.INK), strict=True):
            axes.plot(t, q, color=colour, label=name)
        axes.plot(t, (1 + x**2) ** -np.arange(steps + 1.0), color=style.VERMILION, ls=":", label="theory")
        axes.axhline(balance, color=style.BLUE, ls=":")
        axes.set(yscale="log", xlim=(0, end), ylim=(1e-5, 1e5), xlabel="time, s", ylabel="q·q")
        axes.legend(ncols=2, loc="upper left")

    picture(
        "quaternion",
        "The norm of a quaternion drifts",
        "a rod that spins at 100 rpm, 50 ms steps; correction: q̇ = ½ q ω + k (1 − q·q) q with k = 1 1/s",
        1,
        draw,
    )
    fine = rods.spinning(0.01, 200, 0.0, **EULER)
    y = speed * 0.01 / 2
    rows = [
        (
            "backward Euler, 10 ms: q·q per step",
            number(float((fine[-1] / fine[0]) ** (1 / 200)), 7),
            number(1 / (1 + y * y), 7),
        ),
        (
            "backward Euler, 10 ms: ln q·q in 100 s",
            number(50 * math.log(fine[-1]), 3),
            number(-1e4 * math.log1p(y * y), 3),
        ),
        (
            "backward Euler, 50 ms, corrected: settles at",
            number(float(drifts["backward Euler, corrected"][-1])),
            number(balance),
        ),
        ("trapezoidal rule: q·q − 1 after 8 s", f"{abs(drifts['trapezoidal rule'][-1] - 1):.1e}", "0"),
    ]
    scene = load_scene(
        "spin-up",
        {
            "model": "spatial",
            "time.integrator": "theta",
            "time.theta": 1.0,
            "time.step": 0.12,
            "output.interval": 0.12,
            "output.fields_interval": 1.2,
        },
    )
    return Entry(
        "Quaternions that drift",
        "quaternion",
        "A quaternion turns at half the spin, and an integrator that damps or feeds turning damps or feeds its norm: "
        "per step |q|² changes by 1/(1 + (ωh/2)²) with backward Euler, by the inverse with explicit Euler, not at all"
        " with the trapezoidal rule. Left alone, it underflows within the hour. The rotation matrix divides by |q|² "
        "and does not see it until then; the thesis' (2-18) does not divide, and every error of |q|² is an error of "
        "length.",
        rows,
        "Every quaternion is pulled towards unit norm along itself, which turns nothing. Where that is not enough, a "
        "warning has the norm at which drift and pull balance.",
        [text for text in warnings(scene) if "quaternions" in text],
        run(
            "spin-up",
            "model=spatial",
            "time.integrator=theta",
            "time.theta=1",
            "time.step=0.12",
            "output.interval=0.12",
            "output.fields_interval=1.2",
        ),
    )


def locking() -> Entry:
    """Shear locking of linear elements."""
    sizes = np.array([0.5, 1, 2, 4, 8, 12.5, 20])
    kinds = {
        "degree 1, full": (1, "full"),
        "degree 1, reduced": (1, "reduced"),
        "degree 2, full": (2, "full"),
        "degree 3, reduced": (3, "reduced"),
    }
    found = {name: [rods.bending_ratio(float(h), *kind) for h in sizes] for name, kind in kinds.items()}
    line = [locking_factor(rods.pipe_cantilever(float(h), 1, "full")) for h in sizes]

    def draw(panels: Sequence[Any]) -> None:
        (axes,) = panels
        axes.loglog(sizes, line, color=style.GREY, ls=":", label="1 + kGA h²/(12 EI)")
        for (name, y), colour, mark in zip(
            found.items(), (style.VERMILION, style.INK, style.BLUE, style.GREEN), "osd^", strict=True
        ):
            axes.loglog(sizes, y, mark, color=colour, ms=6, label=name, mfc="none")
        axes.set_xticks(sizes, [f"{x:g}" for x in sizes])
        axes.minorticks_off()
        axes.set(xlabel="length of an element, m", ylabel="bending stiffness over the true one", ylim=(0.5, 1e4))
        axes.legend(loc="upper left")

    picture(
        "locking",
        "Linear elements lock in bending",
        "drill pipe of the thesis, clamped, bent by a moment at its tip",
        1,
        draw,
    )
    rows = []
    for size in (1.0, 2.0, 12.5):
        rows.append(
            (
                f"degree 1, full, {size:g} m elements: too stiff by",
                number(rods.bending_ratio(size)),
                number(locking_factor(rods.pipe_cantilever(size, 1, "full"))),
            )
        )
    rows += [(f"{name}, 12.5 m: too stiff by", f"{found[name][5]:.7f}", "1") for name in list(kinds)[1:]]
    return Entry(
        "Shear locking",
        "locking",
        "A straight element with linear fields cannot bend without shearing. Integrated fully, a slender one answers "
        "with its shear stiffness: on the 12.5 m elements that a 1200 m string invites, three orders of magnitude too"
        " stiff.",
        rows,
        "Internal work is integrated with as many points as the degree (`mesh.quadrature = 'reduced'`), which is "
        "exact for what can be exact. Whoever asks for linear elements and full integration is told the factor.",
        warnings(
            load_scene(
                "vertical-c1-cd4",
                {"model": "spatial", "mesh.degree": 1, "mesh.quadrature": "full", "mesh.elements": 96},
            )
        ),
        run("roll-up", "mesh.degree=1", "mesh.quadrature=full"),
    )


def rotation() -> Entry:
    """The trapezoidal rule in large rotation."""
    kinds = {"trapezoidal rule": "theta", "generalised-alpha": "generalized-alpha", "ARKIMEX, order 4": "arkimex"}
    runs = {name: rods.spin_up(kind) for name, kind in kinds.items()}

    def draw(panels: Sequence[Any]) -> None:
        (axes,) = panels
        for (name, (rows, _)), colour in zip(runs.items(), (style.VERMILION, style.INK, style.SKY), strict=True):
            axes.semilogy(rows[1:, 0], rows[1:, 2], color=colour, label=name)
        axes.set(xlim=(0, 15), ylim=(1, 1e10), xlabel="time, s", ylabel="kinetic and strain energy, J")
        axes.legend(loc="upper left")

    picture(
        "rotation",
        "The trapezoidal rule breaks down in large rotation",
        "spin-up of a flexible rod to 6 rad/s in 15 s (appendix B.1.2), 20 ms steps",
        1,
        draw,
    )
    blown = runs["trapezoidal rule"][0]
    steady = 1.2 * 10**3 / 6 * 36 + 6e-4 * 10 * 18
    rows = [
        ("trapezoidal rule: breaks down at, s", number(float(blown[-1, 0])), ""),
        ("trapezoidal rule: energy then, J", number(float(blown[-1, 2]), 3), number(steady) + " in steady rotation"),
        *[
            (f"{name}: energy at 15 s, J", number(float(rows[-1, 2])), number(steady) + " in steady rotation")
            for name, (rows, _) in list(runs.items())[1:]
        ],
    ]
    keys = {
        "time.integrator": "theta",
        "time.step": 0.02,
        "output.interval": 0.02,
        "mesh.elements": 4,
        "time.end": 15.0,
    }
    return Entry(
        "The trapezoidal rule in large rotation",
        "rotation",
        "On linear waves the trapezoidal rule is neutral: it damps nothing, resolved or not. In large rotation the "
        "waves that the steps do not resolve are fed by the turning of the rod, nothing takes them away, and the "
        "energy grows until no step succeeds. Generalised-alpha with ρ = 0.9 keeps the resolved waves and removes the"
        " others; its energy is high because it meets equilibrium inside the step, on the chord: at the ends the rod "
        "looks stretched by (ωh)²/8.",
        rows,
        "The default in free motion is generalised-alpha. Whoever asks for theta = 0.5 hears how far the rod turns "
        "and how many radians its fastest wave turns in a step; a run that breaks down keeps what was computed.",
        warnings(load_scene("spin-up", keys)),
        run(
            "spin-up",
            "time.integrator=theta",
            "time.step=0.02",
            "output.interval=0.02",
            "mesh.elements=4",
            until="15",
        ),
    )


def steps() -> Entry:
    """Steps between two blades."""
    counts = {"petsc": (16, 32, 48, 64, 96, 128), "condensed": (10, 12, 16, 24, 32)}
    roots = {13.34: 1.8705380, 26.33: 1.8819}
    found = {
        (engine, f): np.abs([lab.cutting_growth(engine, n, f) / true - 1 for n in some])
        for engine, some in counts.items()
        for f, true in roots.items()
    }

    def draw(panels: Sequence[Any]) -> None:
        (axes,) = panels
        for (engine, f), errors in found.items():
            colour = style.VERMILION if engine == "petsc" else style.INK
            line = "o-" if f < 20 else "s--"
            axes.loglog(counts[engine], errors, line, color=colour, label=f"{engine} engine, {f:.1f} Hz", ms=5)
            axes.axvline(PASSAGE[engine], color=colour, ls=":", lw=1)
        axes.set(xlabel="steps between two blades", ylabel="error of the growth rate", ylim=(1e-5, 5))
        axes.set_xticks([10, 16, 32, 64, 128], ["10", "16", "32", "64", "128"])
        axes.minorticks_off()
        axes.legend(loc="upper right", ncols=2)

    picture(
        "steps",
        "Steps between two blades",
        "two growing motions of chapter 6's string, c_d = 1e-4 s, against their characteristic roots; dotted: the "
        "guards",
        1,
        draw,
    )
    step = 2 * load_scene("vertical-c1-cd4").blade_passage / 64
    rows = []
    for engine, n in (("petsc", 16), ("petsc", 32), ("petsc", 64), ("condensed", 16)):
        for f, true in roots.items():
            error = found[engine, f][counts[engine].index(n)]
            rows.append(
                (
                    f"{engine}, {n} steps: error of the growth at {f:.1f} Hz",
                    f"{100 * error:.2g} % of {true:.4g} 1/s",
                    "0",
                )
            )
    return Entry(
        "Too few steps between two blades",
        "steps",
        "The bit meets what it cut one blade passage ago, and the growth of the self-excitation lives on that phase. "
        "The trapezoidal rule turns it too slowly, in second order; the condensed engine propagates the string "
        "exactly and needs few steps.",
        rows,
        "Refuses less than 8 steps between two blades; warns below 64 (PETSc) and 16 (condensed).",
        warnings(
            load_scene(
                "vertical-c1-cd4",
                {"time.engine": "petsc", "time.step": round(step, 4), "output.interval": round(step, 4)},
            )
        ),
        run("vertical-c1-cd4", "time.engine=petsc", "time.step=2e-3", "output.interval=2e-3", until="2"),
    )


def explicit() -> Entry:
    """Explicit steps beyond what the mesh allows."""
    factors = (0.99, 1.001, 1.01, 1.05)
    runs = {f: lab.central_differences(f, 160) for f in factors}

    def draw(panels: Sequence[Any]) -> None:
        (axes,) = panels
        for (factor, (size, _, _)), colour in zip(
            runs.items(), (style.INK, style.BLUE, style.ORANGE, style.VERMILION), strict=True
        ):
            axes.semilogy(size, color=colour, label=f"{factor:g} × limit")
        axes.set(
            xlim=(0, 160), ylim=(1e-1, 1e20), xlabel="steps", ylabel="largest spin in the string / that at the start"
        )
        axes.legend(loc="upper left")

    picture(
        "explicit",
        "Explicit steps have a limit",
        "twist waves on the undamped string of the thesis, 24 linear elements of 50 m, central differences",
        1,
        draw,
    )
    _, limit, crossing = runs[0.99]
    keys = {"time.integrator": "explicit", "time.step": 2e-3, "output.interval": 2e-3}
    refused = ""
    try:
        refuse(load_scene("cutting-c1", keys))
    except SceneError as error:
        refused = str(error)
    rows = [
        (
            "limit over the time in which a wave crosses an element",
            number(limit / crossing),
            number(1 / math.sqrt(3)) + " = 1/√3",
        )
    ]
    for factor in (1.001, 1.01, 1.05):
        size = lab.central_differences(factor, 400 if factor < 1.005 else 160)[0]
        x = (2 * factor) ** 2 / 2 - 1
        rows.append(
            (
                f"growth per step at {factor:g} × limit",
                number(float((size[-1] / size[-41]) ** (1 / 40)), 5),
                number(x + math.sqrt(x * x - 1), 5),
            )
        )
    return Entry(
        "Explicit steps beyond h/c",
        "explicit",
        "Central differences are stable while the fastest wave of the mesh turns by less than 2 rad per step: h/c "
        "over √3 for linear elements with consistent mass, less for higher degrees. 0.1 % more, and that wave takes "
        "over within a hundred steps.",
        rows,
        "Refuses the scene before anything is written, with the limit of its mesh and what the fastest wave would do."
        " Only the condensed engine offers explicit steps; its default propagates the waves exactly and has no limit.",
        [refused],
        run("cutting-c1", "time.integrator=explicit", "time.step=2e-3", "output.interval=2e-3"),
    )


def sections(page: str) -> dict[str, str]:
    """Entries of a page by title."""
    return {part.split("\n", 1)[0]: "## " + part.strip() for part in page.split("\n## ")[1:]}


def main(names: Sequence[str] = ()) -> None:
    """Write the page and its pictures; only these entries, if any are named."""
    import contact_atlas

    own: tuple[Callable[[], Entry], ...] = (
        high_order_bdf,
        low_order,
        explicit,
        surfaces,
        steps,
        newton,
        literal,
        quaternions,
        locking,
        rotation,
    )
    makers = {make.__name__: make for make in (*own, *contact_atlas.ENTRIES)}
    if unknown := set(names) - set(makers):
        raise SystemExit(f"{', '.join(sorted(unknown))}: must be of {', '.join(makers)}")
    path = DOCS / "failure-atlas.md"
    page = sections(path.read_text(encoding="utf-8")) if names else {}
    for name in names or makers:
        entry = makers[name]()
        page[entry.title] = entry.text()
    path.write_text(HEADER + "\n\n".join(page.values()) + "\n", encoding="utf-8")


HEADER = """# Where methods fail

Every method fails somewhere. This page shows where, with the number of theory beside the one that was measured,
and what drillfem says before a user gets there: `drillfem.solve.guards.warnings(scene)` computes such sentences
before every run. The page is generated by `benchmarks/failure_atlas.py`; `tests/stability` holds the numbers, so
that no method changes silently.

"""

if __name__ == "__main__":
    main(sys.argv[1:])
