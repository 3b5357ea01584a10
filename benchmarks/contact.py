"""Contact and friction: methods beside each other at rest and in time, step limits, the closest point, friction.

Writes docs/contact.md and its pictures in about ten minutes of one core.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from common import DOCS, table

from drillfem.errors import SimulationError
from drillfem.models.rod import Rod
from drillfem.render import style
from drillfem.scene import Scene
from drillfem.solve.direct import DirectRun
from drillfem.solve.laid import lay
from drillfem.torque_drag.operation import Operation
from drillfem.torque_drag.stiff import Sliding

Array = npt.NDArray[np.float64]
STEEL = {"youngs_modulus": 210e9, "shear_modulus": 77e9, "density": 7850.0}
PIPE = {"name": "pipe", "outer_diameter": 0.127, "inner_diameter": 0.108}
ALPHA = {"integrator": "generalized-alpha"}
#: well A: 60 deg reached on an arc of 573 m
BEND = {"kind": "build", "kick_off": 1500.0, "radius": 573.0, "final_inclination": math.pi / 3, "diameter": 0.2}
#: the same in small
SHORT = {"kind": "build", "kick_off": 30.0, "radius": 80.0, "final_inclination": 0.9, "diameter": 0.2}


def scene(length: float, elements: int, hole: dict[str, Any], **tables: Any) -> Scene:
    """A pipe hung in a hole; tables complete the default ones."""
    data: dict[str, Any] = {
        "model": "spatial",
        "string": [PIPE | {"length": length}],
        "material": STEEL,
        "hole": hole,
        "contact": {"stiffness": 1e6, "friction_static": 0.3, "friction_dynamic": 0.15},
        "ends": {"top": "hung", "bottom": "free"},
        "initial": {"state": "laid"},
        "mesh": {"elements": elements, "degree": 3},
        "time": {"end": 1.0, "step": 5e-3, "engine": "compiled"},
    }
    return Scene.from_dict({k: data.get(k, {}) | v if isinstance(v, dict) else v for k, v in (data | tables).items()})


def number(x: float, digits: int = 2) -> str:
    return f"{x:.{digits}g}"


# -- at rest ----------------------------------------------------------------------------------------------------------


def side_load(case: Scene, s: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
    """|w sin(i) - F kappa| (points,; N/m) of well A, and where it is fair to compare: away from kinks and crossing."""
    assert case.hole.radius and case.hole.kick_off and case.hole.final_inclination
    w = case.string[0].mass_per_length * case.gravity.magnitude
    radius, start, final = case.hole.radius, case.hole.kick_off, case.hole.final_inclination
    end = start + radius * final
    i = np.clip((s - start) / radius, 0, final)
    F = w * (case.length - end) * math.cos(final) + w * radius * (math.sin(final) - np.sin(i))
    in_bend = (s > start) & (s < end)
    side = w * np.sin(i) - F * in_bend / radius
    crossing = s[in_bend][np.abs(side[in_bend]).argmin()]
    off = np.minimum(np.abs(s - start), np.abs(s - end))
    return np.abs(side), (s > start) & (s < case.length - 50) & (off > 60) & (np.abs(s - crossing) > 80)


@dataclass(frozen=True)
class Laid:
    """A string at rest: where (points,; m), what presses (points,; N/m), its error, penetration (m), seconds."""

    name: str
    s: Array
    force: Array
    error: float
    penetration: float
    cpu: float


def laid(method: str, stiffness: float, elements: int) -> Laid | str:
    """Well A by a method, or why not."""
    case = scene(2500.0, elements, BEND, contact={"method": method, "stiffness": stiffness})
    rod = Rod(case)
    wall = rod.wall
    assert wall is not None and case.contact is not None
    try:
        lay(rod)  # compiles
        wall.multipliers[:] = 0.0
        begin = time.process_time()
        u = lay(rod)
    except SimulationError:
        return "no equilibrium"
    cpu = time.process_time() - begin
    rod.set_state(u, np.zeros_like(u))
    order = np.argsort(wall.arc_length)
    s, force = wall.arc_length[order], wall.side_force(u, case.contact)[order]
    expected, fair = side_load(case, s)
    w = case.string[0].mass_per_length * case.gravity.magnitude
    error = float(np.abs(force - expected)[fair].max() / w)
    return Laid(f"{method}, {stiffness:.0e}", s, force, error, -wall.gap, cpu)


def at_rest() -> tuple[str, list[Laid]]:
    rows, kept = [], []
    for method, stiffness in (
        *(("penalty", k) for k in (1e4, 1e5, 1e6, 1e7)),
        ("smooth", 1e6),
        *(("augmented", k) for k in (1e5, 1e6, 1e7)),
    ):
        row = [f"`{method}`", f"{stiffness:.0e}"]
        for elements in (100, 200):
            found = laid(method, stiffness, elements)
            if isinstance(found, str):
                row += [found, "", ""]
                continue
            row += [f"{100 * found.error:.2f} %", f"{1e3 * found.penetration:.2g}", f"{found.cpu:.1f}"]
            if elements == 200:
                kept.append(found)
        rows.append(row)
    header = ["method", "k_s (N/m²)"] + [
        text for n in (100, 200) for text in (f"error, {n} elements", "penetration (mm)", "CPU (s)")
    ]
    return table(header, rows), kept


def inclined() -> str:
    """Side force of a string that lies straight in an inclined hole, away from its ends, over w sin i."""
    rows = []
    for degrees in (15, 30, 60, 90):
        row = [f"{degrees}"]
        for method in ("penalty", "smooth", "augmented"):
            hole = {"kind": "straight", "inclination": math.radians(degrees), "diameter": 0.2}
            case = scene(200.0, 80, hole, contact={"method": method})
            rod = Rod(case)
            wall, contact = rod.wall, case.contact
            assert wall is not None and contact is not None
            u = lay(rod)
            rod.set_state(u, np.zeros_like(u))
            middle = (wall.arc_length > 50) & (wall.arc_length < 150)
            w = case.string[0].mass_per_length * case.gravity.magnitude
            error = wall.side_force(u, contact)[middle] / (w * math.sin(math.radians(degrees))) - 1
            row.append(f"{100 * float(np.abs(error).max()):.2g} %")
        rows.append(row)
    return table(["inclination (deg)", "`penalty`", "`smooth`", "`augmented`"], rows)


@contextmanager
def points(per_element: int) -> Iterator[None]:
    """Contact integrated with this many points per cubic element."""
    chosen = Rod.wall_degree
    Rod.wall_degree = property(lambda _: 2 * per_element - 1)  # type: ignore[assignment, method-assign]
    try:
        yield
    finally:
        Rod.wall_degree = chosen  # type: ignore[method-assign]


def rules() -> str:
    """The error with the points of the mass matrix, and with the fewest."""
    rows = []
    for method, stiffness in (("penalty", 1e5), ("penalty", 1e6), ("penalty", 1e7), ("augmented", 1e6)):
        row = [f"`{method}`", f"{stiffness:.0e}"]
        for elements in (100, 200, 400):
            for per_element in (4, 2):
                with points(per_element):
                    found = laid(method, stiffness, elements)
                row.append(found if isinstance(found, str) else f"{100 * found.error:.2f} %")
        rows.append(row)
    header = [f"{n} elements, {count} points" for n in (100, 200, 400) for count in (4, 2)]
    return table(["method", "k_s (N/m²)", *header], rows)


def draw_rest(found: list[Laid]) -> None:
    case = scene(2500.0, 200, BEND)
    w = case.string[0].mass_per_length * case.gravity.magnitude
    shown = {"penalty, 1e+06": style.SKY, "penalty, 1e+04": style.BLUE, "augmented, 1e+06": style.VERMILION}
    with style.page(1300, 560) as figure:
        style.heading(
            figure, "What the wall carries", "build and hold, 2500 m in 200 elements, at rest without friction"
        )
        axes = figure.add_axes((0.06, 0.11, 0.92, 0.72))
        for item, colour in ((f, shown[f.name]) for f in found if f.name in shown):
            axes.plot(item.s, item.force / w, color=colour, label=item.name, lw=1.1)
        s = np.linspace(1450, 2500, 2000)
        axes.plot(s, side_load(case, s)[0] / w * (s > 1500), color=style.INK, lw=0.9, ls="--", label="|w sin i − Fκ|")
        axes.set(xlim=(1450, 2350), ylim=(0, 1.9), xlabel="arc length (m)", ylabel="side force over weight")
        axes.legend()
        style.save(figure, DOCS / "img" / "contact-rest.png")


# -- what bounces -----------------------------------------------------------------------------------------------------


def falling(step: float, method: str = "penalty", retardation: float = 0.0, **keys: Any) -> Scene:
    """A pipe falls across its hole; one element, no friction."""
    contact = {"method": method, "friction_static": 0, "friction_dynamic": 0, "retardation_time": retardation}
    return scene(
        5.0,
        1,
        {"kind": "straight", "diameter": 0.2},
        gravity={"direction": [1, 0, 0]},
        contact=contact,
        initial={"state": "rest"},
        ends={"top": "free"},
        mesh={"degree": 1},
        time={"end": 3.0, "step": step} | keys,
    )


def gained(case: Scene, rate: bool = True, within: bool = True) -> float:
    """Most that the energy rose above that at the start, in falls across the clearance; inf where the run broke off.

    rate: whether the approach counts; within: whether multipliers are moved within the step, or after it.
    """
    rod = Rod(case)
    assert rod.wall is not None and rod.loads.wall is not None
    if not rate:
        rod.wall.retardation = rod.loads.wall.retardation.value = 0.0  # type: ignore[union-attr]
    move = rod.augment
    if not within:
        rod.augment = lambda _: False  # type: ignore[method-assign]
    run, worst, t = DirectRun(rod), 0.0, 0.0
    weight = case.mass * case.gravity.magnitude
    try:
        while t < case.time.end - 1e-9:
            t = run.step(case.time.end)
            if not within:
                move(0.0)
            u = run.stepper.u
            rod.set_state(u, np.zeros_like(u))
            fallen = float(u.reshape(-1, rod.ansatz.size)[:, 0].mean())
            worst = max(worst, sum(rod.energies()) + rod.contact_energy() - weight * fallen)
    except SimulationError:
        return math.inf
    finally:
        run.destroy()
    return worst / (weight * 0.0365)


PERIOD = 2 * math.pi * math.sqrt(falling(1e-3).string[0].mass_per_length / 1e6)


def bouncing() -> str:
    """Draws the energy gained against the step; returns a table."""
    steps = (1.5, 2, 3, 5, 8, 10, 14, 20, 28, 40, 80)
    kinds: dict[str, tuple[str, dict[str, Any], dict[str, Any]]] = {
        "trapezoidal": (style.BLUE, {}, {"integrator": "theta"}),
        "generalised-α, ρ = 0.9": (style.VERMILION, {}, ALPHA | {"rho_infinity": 0.9}),
        "generalised-α, ρ = 0.8": (style.ORANGE, {}, ALPHA | {"rho_infinity": 0.8}),
        "generalised-α, ρ = 0.5": (style.GREEN, {}, ALPHA | {"rho_infinity": 0.5}),
        "ρ = 0.9, retardation of a step": (style.PURPLE, {"retardation": True}, ALPHA | {"rho_infinity": 0.9}),
        "ρ = 0.9, augmented": (style.INK, {"method": "augmented"}, ALPHA | {"rho_infinity": 0.9}),
    }
    found = {
        name: [
            gained(falling(PERIOD / n, keys.get("method", "penalty"), PERIOD / n * ("retardation" in keys), **time_))
            for n in steps
        ]
        for name, (_, keys, time_) in kinds.items()
    }
    floor = 1e-4
    with style.page(1300, 600) as figure:
        style.heading(figure, "Energy out of nothing", "a pipe falls across its hole and bounces for 3 s, undamped")
        axes = figure.add_axes((0.07, 0.11, 0.91, 0.72))
        for name, gain in found.items():
            last = name in list(found)[4:]
            axes.loglog(
                steps,
                np.maximum(gain, floor),
                color=kinds[name][0],
                label=name,
                marker="o",
                ms=10 if "retardation" in name else 4,
                ls="--" if last else "-",
            )
        axes.set(xlabel="steps in the period of the wall's spring", ylabel="energy gained, in falls")
        axes.set_ylim(floor / 1.5, 1e4)
        axes.set_xticks(steps, [f"{n:g}" for n in steps])
        axes.minorticks_off()
        axes.legend(ncols=2)
        style.save(figure, DOCS / "img" / "contact-bounce.png")

    def least(gain: list[float], most: float) -> str:
        """Fewest steps from which on no more is gained."""
        fine = np.array(gain) <= most
        k = len(steps) if not fine[-1] else int(np.flatnonzero(~fine)[-1]) + 1 if not fine.all() else 0
        return "all" if k == 0 else f"{steps[k]:g}" if k < len(steps) else f"> {steps[-1]:g}"

    return table(
        ["", "100 %", "10 %", "3 %", "1 %"],
        [[name, *(least(gain, most) for most in (1.0, 0.1, 0.03, 0.01))] for name, gain in found.items()],
    )


def multipliers() -> str:
    """Energy gained by ways to move the multipliers, at eight steps per period."""
    rows = []
    for name, rate, within in (
        ("after every step", False, False),
        ("within the step", False, True),
        ("within the step, with the rate of a step", True, True),
    ):
        row = [name]
        for keys in ({"integrator": "theta"}, ALPHA | {"rho_infinity": 0.9}, ALPHA | {"rho_infinity": 0.5}):
            gain = gained(falling(PERIOD / 8, "augmented", **keys), rate, within)
            row.append("breaks off" if math.isinf(gain) else f"{gain:.1e}" if gain > 1e-3 else "0")
        rows.append(row)
    return table(["multipliers are moved", "trapezoidal", "generalised-α, ρ = 0.9", "ρ = 0.5"], rows)


# -- in time ----------------------------------------------------------------------------------------------------------


def start_up(elements: int = 12, end: float = 1.0, step: float = 5e-3, **contact: Any) -> Scene:
    """A short string in a bend, its top spun up."""
    return scene(
        140.0,
        elements,
        SHORT,
        contact=contact,
        top_drive={"kind": "imposed-speed", "speed": 8.0, "rise_time": 0.2},
        ends={"top": "driven"},
        time={"step": step, "end": end},
    )


@dataclass(frozen=True)
class Ran:
    """What a run came to: history (by name), counts, milliseconds per step, last unknowns, the rod."""

    row: dict[str, float]
    summary: dict[str, Any]
    per_step: float
    u: Array
    rod: Rod
    penetration: float


def ran(case: Scene) -> Ran:
    rod = Rod(case)
    run = DirectRun(rod)
    t = run.step(case.time.end)
    run.row(t)  # compiles
    begin, worst = time.process_time(), 0.0
    while t < case.time.end - 1e-9:
        t = run.step(case.time.end)
    cpu = time.process_time() - begin
    row = run.row(t)
    worst = row["penetration"]
    return Ran(row, run.summary(), 1e3 * cpu / (run.steps - 1), run.stepper.u.copy(), rod, worst)


def in_time() -> str:
    rows = []
    for name, contact in {
        "`penalty`, 1e5": {"stiffness": 1e5},
        "`penalty`, 1e6": {},
        "`penalty`, 1e6, retardation 5 ms": {"retardation_time": 5e-3},
        "`penalty`, 1e7": {"stiffness": 1e7},
        "`smooth`, 1e6": {"method": "smooth"},
        "`augmented`, 1e5": {"method": "augmented", "stiffness": 1e5},
        "`augmented`, 1e6": {"method": "augmented"},
        "`augmented`, 1e7": {"method": "augmented", "stiffness": 1e7},
    }.items():
        r = ran(start_up(**contact))
        steps = r.summary["steps"]
        rows.append(
            [
                name,
                number(1e3 * r.penetration),
                f"{r.row['work_friction']:.1f}",
                f"{100 * r.summary['energy_balance_error']:.2g} %",
                f"{r.summary['newton_iterations'] / steps:.1f}",
                f"{r.summary['factorisations'] / steps:.2f}",
                f"{r.per_step:.2f}",
            ]
        )
    header = ["method, k_s", "penetration (mm)", "friction (J)", "balance", "iterations", "factorisations"]
    return table([*header, "ms per step"], rows)


def closest_points() -> tuple[str, str]:
    """Table of the closest point as an unknown against local projection; fitted order of the string's place."""
    rows, places = [], []
    sizes = (8, 16, 32, 64)
    for elements in sizes:
        one, other = (ran(start_up(elements, 0.2, closest_point=kind)) for kind in ("newton", "field"))
        wall = other.rod.wall
        assert wall is not None
        other.rod.set_state(other.u, np.zeros_like(other.u))
        error = float(np.abs(wall.p - wall.hole.nearest(wall.position(other.u))).max())
        r = [x.u.reshape(-1, x.rod.ansatz.size)[:, :3] for x in (one, other)]
        places.append(float(np.abs(r[0] - r[1]).max()))
        force = [x.row["side_force"] for x in (one, other)]
        rows.append(
            [
                f"{elements}",
                number(1e6 * error),
                number(1e6 * places[-1]),
                number(abs(force[1] / force[0] - 1)),
                *(f"{x.summary['newton_iterations']}" for x in (one, other)),
                *(f"{x.per_step:.2f}" for x in (one, other)),
            ]
        )
    header = ["elements", "p between the nodes (µm)", "place of the string (µm)", "side force"]
    header += ["iterations", "as field", "ms per step", "as field"]
    return table(header, rows), f"{np.polyfit(np.log(1 / np.array(sizes)), np.log(places), 1)[0]:.1f}"


# -- friction ---------------------------------------------------------------------------------------------------------


def draw_friction() -> str:
    """Draws law and freeing; returns the largest error of the axial friction of a string that turns."""
    mu, inclination, lowering = 0.3, 1.0, 0.1
    case = scene(
        100.0,
        40,
        {"kind": "straight", "inclination": inclination, "diameter": 0.2},
        contact={"friction_static": mu, "friction_dynamic": mu},
    )
    rod = Rod(case)
    sliding, at_rest_ = Sliding(rod), lay(rod)
    w = case.string[0].mass_per_length * case.gravity.magnitude * math.sin(inclination)
    radius = case.string[0].contact_radius
    spins = np.array([0.0, 0.3, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0, 12.0])
    drags, torques = [], []
    for spin in spins:
        sliding.operate(at_rest_, Operation("", "", speed=lowering, spin=float(spin)))
        f = rod.fields()
        a, b = np.searchsorted(f["arc_length"], [30.0, 70.0])
        length = f["arc_length"][b] - f["arc_length"][a]
        drags.append(w / math.tan(inclination) - (f["axial_force"][a] - f["axial_force"][b]) / length)
        torques.append((f["torque"][b] - f["torque"][a]) / length)

    def exact(spin: Array) -> tuple[Array, Array]:
        about = spin * radius
        share = about / np.hypot(lowering, about)
        N = w / np.hypot(1, mu * share)
        return mu * N * lowering / np.hypot(lowering, about), mu * N * share * radius

    along, around = exact(spins)
    error = max(np.abs(np.array(drags) / along - 1).max(), np.abs(np.array(torques)[1:] / around[1:] - 1).max())
    fine = np.linspace(0, 12, 200)
    with style.page(1400, 560) as figure:
        style.heading(
            figure, "Friction", "the law with three velocity scales; a string lowered by 0.1 m/s while it turns"
        )
        left, right = figure.add_axes((0.06, 0.12, 0.42, 0.71)), figure.add_axes((0.56, 0.12, 0.42, 0.71))
        v = np.geomspace(1e-3, 3, 400)
        for n, colour in ((5, style.SKY), (20, style.BLUE), (100, style.INK)):
            alpha = math.sqrt(0.3 * 0.15)
            k = (0.15 * np.sqrt(v**2 + 1e-4 / n**2) + 2 * alpha / n) / (v**2 + 1 / n**2) * v
            left.semilogx(v, k, color=colour, label=f"n = {n} s/m")
        left.axhline(0.3, color=style.GREY, lw=0.8, ls=":")
        left.axhline(0.15, color=style.GREY, lw=0.8, ls=":")
        left.set(xlabel="sliding speed (m/s)", ylabel="friction over normal force", ylim=(0, 0.33))
        left.legend()
        for values, points, colour, name in (
            (exact(fine)[0] / w, np.array(drags) / w, style.BLUE, "along the hole"),
            (exact(fine)[1] / w / radius, np.array(torques) / w / radius, style.VERMILION, "about the string"),
        ):
            right.plot(fine, values, color=colour, label=name)
            right.plot(spins, points, "o", color=colour, ms=5)
        right.set(xlabel="spin (rad/s)", ylabel="friction over weight across the hole", ylim=(0, 0.32))
        right.legend()
        style.save(figure, DOCS / "img" / "contact-friction.png")
    return f"{100 * error:.2g} %"


def rough() -> str:
    """Torque per metre of a string that turns in a hole with a profile of friction, over that of each stretch."""
    profile = [(0.0, 0.15), (60.0, 0.15), (60.001, 0.3), (140.0, 0.3), (200.0, 0.45)]
    case = scene(
        200.0,
        80,
        {"kind": "straight", "inclination": 1.0, "diameter": 0.2},
        contact={"friction_profile": [[p, mu, mu] for p, mu in profile]},
    )
    rod = Rod(case)
    Sliding(rod).operate(lay(rod), Operation("", "", spin=1.0))
    f = rod.fields()
    w = case.string[0].mass_per_length * case.gravity.magnitude * math.sin(1.0)
    rows = []
    for a, b in ((25.0, 50.0), (75.0, 125.0), (150.0, 175.0)):
        i, j = np.searchsorted(f["arc_length"], [a, b])
        s = np.linspace(f["arc_length"][i], f["arc_length"][j], 2001)
        mu = np.interp(s, *np.array(profile).T)
        exact = float(np.trapezoid(mu * w / np.hypot(1, mu), s)) * case.string[0].contact_radius
        found = float(f["torque"][i] - f["torque"][j])
        text = f"{mu[0]:.3g}" if np.ptp(mu) < 1e-9 else f"{mu[0]:.3g} to {mu[-1]:.3g}"
        rows.append([f"{s[0]:g} to {s[-1]:g}", text, f"{abs(found):.2f}", f"{exact:.2f}"])
    return table(["measured depth (m)", "μ", "torque taken (N m)", "∫ μ r w sin i/√(1 + μ²)"], rows)


def capstan() -> str:
    rows = []
    for mu in (0.1, 0.3):
        for method in ("penalty", "augmented"):
            angle, radius, pull = 1.2, 100.0, 1e5
            section = {
                "name": "rope",
                "length": angle * radius,
                "outer_diameter": 0.02,
                "stiffness": {"axial": 6.6e7, "shear": 2.5e7, "bending": 50.0, "torsion": 50.0},
                "mass_per_length": 2.5,
                "rotary_inertia": 1e-4,
            }
            rod = Rod(
                scene(
                    120.0,
                    120,
                    {"kind": "arc", "radius": radius, "diameter": 0.03},
                    string=[section],
                    gravity={"magnitude": 0},
                    contact={"method": method, "stiffness": 1e8, "friction_static": mu, "friction_dynamic": mu},
                    ends={"tip_force": [pull * math.sin(angle), 0.0, pull * math.cos(angle)]},
                )
            )
            sliding, start = Sliding(rod), lay(rod)
            profile = sliding.operate(start, Operation("", "", speed=-1.0))
            f = rod.fields()
            a, b = np.searchsorted(f["arc_length"], [12.0, 108.0])
            between = math.acos(f["director3"][a] @ f["director3"][b])
            inner = f["axial_force"][a] / f["axial_force"][b] / math.exp(mu * between) - 1
            whole = profile.hook_load / pull / math.exp(mu * angle) - 1
            rows.append([f"{mu:g}", f"`{method}`", f"{100 * whole:.3f} %", f"{100 * inner:.4f} %"])
    return table(["μ", "method", "whole rope", "inner 80 %"], rows)


def break_off() -> tuple[str, str, str]:
    """Break-off torque of well A: of the rod, and mu r times the soft string's side force with and without 1/sqrt."""
    rod = Rod(scene(2500.0, 200, BEND, contact={"friction_dynamic": 0.3}))
    sliding = Sliding(rod, "static")
    torque = sliding.operate(lay(rod), Operation("", "", spin=1.0)).surface_torque
    s = np.linspace(0, 2500, 200_001)
    side, _ = side_load(rod.scene, s)
    soft = 0.3 * rod.scene.string[0].contact_radius * float(np.trapezoid(side, s))
    return f"{torque:.1f}", f"{soft:.1f}", f"{soft / math.hypot(1, 0.3):.1f}"


def well_a(method: str, stiffness: float, retardation: float) -> list[str]:
    """100 s of start-up in well A: worst error of the energy balance, penetration, speed."""
    case = replace(
        scene(
            2500.0,
            200,
            BEND,
            contact={
                "method": method,
                "stiffness": stiffness,
                "friction_velocity_scale": 5.0,
                "retardation_time": retardation,
            },
            top_drive={"kind": "imposed-speed", "speed": "100 rpm", "rise_time": 10.0},
            ends={"top": "driven"},
            time={"end": 100.0},
        )
    )
    run, t, worst, deep = DirectRun(Rod(case)), 0.0, 0.0, 0.0
    begin = time.process_time()
    while t < 100.0 - 1e-9:
        t = run.step(100.0)
        if run.steps % 100 == 0:
            deep = max(deep, run.row(t)["penetration"])
            worst = max(worst, run.summary()["energy_balance_error"])
    cpu = time.process_time() - begin
    row, summary = run.row(t), run.summary()
    run.destroy()
    name = f"`{method}`, {stiffness:.0e}" + (f", retardation {1e3 * retardation:g} ms" if retardation else "")
    return [
        name,
        f"{100 * worst:.3f} %",
        number(1e3 * deep),
        f"{row['work_top_drive'] / 1e6:.4f}",
        f"{row['work_friction'] / 1e6:.4f}",
        f"{summary['newton_iterations'] / summary['steps']:.1f}",
        f"{100 / cpu:.1f}",
    ]


# -- the page ---------------------------------------------------------------------------------------------------------


def main() -> None:
    (DOCS / "img").mkdir(exist_ok=True)
    rest, found = at_rest()
    draw_rest(found)
    points, order = closest_points()
    torque, soft, climbing = break_off()
    values = {
        "rest": rest,
        "inclined": inclined(),
        "rules": rules(),
        "bounce": bouncing(),
        "multipliers": multipliers(),
        "time": in_time(),
        "points": points,
        "order": order,
        "freed": draw_friction(),
        "rough": rough(),
        "capstan": capstan(),
        "torque": torque,
        "soft": soft,
        "climbing": climbing,
        "period": f"{1e3 * PERIOD:.0f}",
        "well": table(
            [
                "method, k_s",
                "worst balance",
                "penetration (mm)",
                "drive (MJ)",
                "friction (MJ)",
                "iterations",
                "simulated/CPU",
            ],
            [well_a("penalty", 1e6, 0.0), well_a("penalty", 1e6, 5e-3), well_a("augmented", 1e7, 0.0)],
        ),
    }
    text = TEXT
    for name, value in values.items():
        text = text.replace("{" + name + "}", value)
    (DOCS / "contact.md").write_text(text, encoding="utf-8")


TEXT = """# Contact and friction

Written by `benchmarks/contact.py`, every number and picture of it: ten minutes of one core. `tests/forms/test_wall.py`
and `tests/physics/test_contact.py`, `test_friction.py` and `test_wall_energy.py` hold what it claims. Where the methods
fail, and what is said then: [where methods fail](failure-atlas.md). What they cost for an accuracy:
[accuracy and speed](accuracy-and-speed.md), or `drillfem chart off-bottom`.

## What the wall does

At every quadrature point of the string the closest point of the hole's centreline is found
([boreholes](boreholes.md)). g is how far the string reaches into the wall there: its contact radius (of tool joints
and stabilisers where `contact_diameter` says so), plus its distance from the centreline, less the radius of the
hole. The normal force per length p(g) is one of three:

| `contact.method` | force | energy |
| --- | --- | --- |
| `penalty` (4-5), (4-6) | k_s max(0, g) | k_s max(0, g)²/2 |
| `smooth` | the same, but quadratic within ±`smoothing` of the wall: no kink | its integral |
| `augmented` | max(0, λ + k_s g), with λ moved until \\|g\\| ≤ `penetration_tolerance` | none: nothing goes in |

Force and tangent come from that one potential, also where the hole narrows (then the force has a part along the
hole) and bends; tests hold them to differences on the true hole, force by force and method by method.

`retardation_time` τ lets the normal force answer to g + τ dg/dt. It takes energy in both directions, never pulls,
and is 0 for `penalty` and `smooth` unless given; `augmented` takes one time step at least.

## At rest

A string that lies straight in an inclined hole presses on it with w sin i. 200 m of pipe, 80 elements, the middle
100 m; the largest error at any point:

{inclined}

Well A (2500 m, build to 60 deg on 573 m), laid in its hole. Error: of the side force against |w sin i − Fκ| in bend
and tangent, relative to the weight per length, the largest at any point that is 60 m from a kink of the curvature
and 80 m from where the string changes sides.

{rest}

![side force along well A](img/contact-rest.png)

A penalty must be stiff enough for the clearance: the string lies w/k_s deep. An augmented Lagrangian does not care
for k_s, which is how fast the multipliers get there and no longer how deep the string lies.

The boundary layer (4EI/k_s)^¼ next to a kink is 4.8, 2.7, 1.5 and 0.9 m for 1e4 to 1e7 N/m²; the elements are 25
and 12.5 m long. Where the wall is stiffer than what the mesh can follow, it matters at how many points it holds the
string. Penalties have the four points of the mass matrix per cubic element, which resolve a wall that the mesh
resolves; multipliers have two, the fewest that spread an even load as the fields do. With four they would hold more
points than there are unknowns to follow, and zigzag, as a penalty does that is too stiff for the mesh. The same
error with either:

{rules}

## In time: how long a step may be

The pipe of this page on the spring of a wall with k_s = 1e6 N/m² swings with 2π√(ρA/k_s) = {period} ms. It falls
across its clearance and bounces for 3 s (15 bounces) without friction or damping; what counts is the energy that it
gained above the start.

![energy gained against the step](img/contact-bounce.png)

Steps per period from which on no more is gained than

{bounce}

Below three steps per period every method without retardation feeds on the wall: energy grows a hundredfold within
seconds. Twenty keep it to a tenth, forty to three hundredths; damping by the integrator (ρ = 0.5) helps little, for
it is the moment of touching that a step misses. With a retardation of one step nothing is gained at any step length:
the impact is inelastic for what is faster than the step.

An augmented Lagrangian that holds a point by its place alone throws it back with more than it brought, for the
trapezoidal rule and generalised-α remember the force of the last step. Moved after every step it is unstable too: the
multipliers are an integral, and s³ + ω²s + ω²/h = 0 has a growing pair of roots for every step h. With the rate counted
for a step the point comes to rest on the wall. Energy gained in the same falls, eight steps per period:

{multipliers}

So they are moved within the step, until no point that pushes is further from the wall than the tolerance (where the
integrator evaluates the forces; at the end of a step it can be a few times that). The steps of the multipliers, k_s +
ρA σ²/(1 + τσ) with σ = d(u̇)/du of the integrator, allow for the inertia that resists the correction.

A short string in a bend (140 m, 12 elements, spun up to 8 rad/s within 0.2 s, steps of 5 ms, 1 s):

{time}

The start-up of well A, 200 elements, 100 rpm within 10 s, 100 s in steps of 5 ms; the balance is what is missing of
the energy at the worst moment, relative to the largest that went through:

{well}

`work_wall` is what contact and friction took together, `work_friction` friction's part; the rest is stored in the
wall (or lost to its retardation).

## The closest point as an unknown

`closest_point = "field"` is the thesis' way (D-6): the measured depth p of the closest point is one more field of
the rod, tied to r by (r − r_p)·t = 0 at the nodes, solved with everything else. The hole's numbers are taken at p,
so residual and tangent are exact; between the nodes p is interpolated, and off by that:

{points}

p is worst where the curvature jumps, for its interpolation knows no kinks; the place of the string comes nearer with
order {order}. Iterations are the same; the block of a node has 14 unknowns instead of 13, and the hole is evaluated
at every residual. Equilibria keep the local search, which gives the start.

## Friction

f = −N k_fr(|v|) v/|v| per length on the touching point, whose velocity v has a part by the spin, about the string,
and a part along the hole: (4-7)-(4-12). Only the velocity along the wall counts (`projected`; the thesis as printed
brakes bouncing as well). The peak of the law is μ_s, at n v = μ_s/√(μ_s(μ_s − μ_d)).

![the law, and how rotation frees](img/contact-friction.png)

Dots are the rod (steady sliding, `drillfem torque-drag`), lines closed forms; the largest error is {freed}. A
string that turns climbs the wall until weight and friction balance: N = w sin i/√(1 + μ²), so that the torque is
less by as much than the μ r w sin i of the books. The break-off torque of well A with μ = 0.3 is {torque} N m; the
soft string's side forces give {soft}, with the factor {climbing}.

The coefficient may be one number, one per `[[hole.section]]`, or a field of measured depth (`friction_profile`).
A string that turns in a straight hole, 1 rad inclined, on a profile that steps at 60 m and rises from 140 m on:

{rough}

A limp rope pulled through an arc of 1.2 rad, tension over exp(μθ):

{capstan}

The whole rope touches √(2c/R) = 0.01 rad less than the arc, for its ends are on the axis of the hole.

## Which one

`penalty`, the default, is the cheapest and what the thesis uses. k_s = 1e6 N/m² lets a string of 300 N/m sink by
0.3 mm and wants steps of 1.5 ms to bounce elastically; with longer steps give it a `retardation_time` of one step if
anything bounces: it costs nothing. `augmented` where penetration matters (narrow clearances, tool joints) or k_s is
not known: with k_s of about ten times ρA/step² its cost is that of a penalty with some more factorisations. `smooth`
has no kink for Newton's method: the fewest factorisations, and a wall that begins `smoothing` before itself.
"""


if __name__ == "__main__":
    main()
