"""Chapter 7, deterministic: a horizontal string with contact by penalty (A), or its weight for the normal force (B)."""

from __future__ import annotations

from typing import Any

import numpy as np

from drillfem.scene import Scene

from .claims import Case, Check, Claim, Experiment, Run, Runs, Value, Variation, statement
from .signals import ADVANCE, BIT_WORK, DEPTH, END_WORK, SIDE_FORCE, Signals, Window

LATE: Window = (5.0, 10.0)
CLEARANCES = (0.002, 0.005, 0.015, 0.020, 0.030, 0.050, 0.100)
"""Clearances (m) that are tried in the place of the one that print does not have."""
STILL = 0.05
"""Speed over its mean below which a bit is said to stick."""
UNPROJECTED = {"contact.projected": False, "contact.retardation_time": 0.0}
"""Friction against the whole velocity of the string, bounces too, as printed; nothing else then damps them."""
LITERAL = {"reading": "literal", "contact.retardation_time": 0.0}


def clearance(gap: float, **more: Any) -> dict[str, Any]:
    """Changes of the scenes for a clearance (m)."""
    return {"hole.diameter": 0.15 + 2 * gap, **more}


def rough(friction: float) -> dict[str, Any]:
    """Changes of the scenes for another coefficient of friction."""
    return {"contact.friction_static": friction, "contact.friction_dynamic": friction}


def sag(scene: Scene) -> float:
    """Length (m) of string between the clamp and the wall, (72 EI c_gap/w)^(1/4) (spec 10.5)."""
    section, hole = scene.string[0], scene.hole.diameter
    assert hole is not None
    weight = section.mass_per_length * scene.gravity.magnitude
    gap = hole / 2 - section.contact_radius
    return float((72 * section.section_stiffness().bending1 * gap / weight) ** 0.25)


def _times(runs: Runs) -> Value:
    """How many times as far the bit of A goes as that of B."""
    ends = [runs[name].at(DEPTH, 10.0) for name in ("A", "B")]
    if ends[0] is None or ends[1] is None:
        return Value(None)
    return Value(ends[0] / ends[1], f"{ends[0]:.3g} and {ends[1]:.3g} m")


def power_ratio(run: Signals, window: Window) -> float | None:
    """p_r of a window: work of the rock over that of the loads at the ends (7-10), (7-11)."""
    ends = [[run.at(name, t) for t in window] for name in (BIT_WORK, END_WORK)]
    (out0, out1), (in0, in1) = ends
    if out0 is None or out1 is None or in0 is None or in1 is None or not in1 > in0:
        return None
    return (out1 - out0) / (in1 - in0)


def _efficient(runs: Runs) -> tuple[bool | None, str]:
    """A makes more of its power than B, for its wall presses less."""
    ratios = [power_ratio(runs[name], LATE) for name in ("A", "B")]
    if ratios[0] is None or ratios[1] is None:
        return None, ""
    return ratios[0] > ratios[1], f"p_r = {ratios[0]:.3f} and {ratios[1]:.3f} from 5 to 10 s"


def _sticks(name: str, expected: bool) -> Check:
    """Between phases of motion the bit stands nearly still, or never does."""

    def check(runs: Runs) -> tuple[bool | None, str]:
        part = runs[name].part(ADVANCE, LATE)
        if not len(part):
            return None, ""
        share = float(np.mean(np.abs(part) < STILL * part.mean()))
        least = float(np.abs(part).min() / part.mean())
        return (
            share > 0.05
        ) == expected, f"nearly still for {100 * share:.2g} % of the time, least {100 * least:.2g} %"

    return check


def _part_touches(runs: Runs) -> tuple[bool | None, str]:
    load = runs["A"].side_load(10.0)
    if load is None:
        return None, ""
    s, q = load
    first = float(s[q > 0].min())
    return first > 1.0, f"from {first:.1f} m on; a beam that sags through the clearance: {sag(runs['A'].scene):.1f} m"


def _side_force(name: str, formula: float) -> Claim:
    def measure(runs: Runs) -> Value:
        force = runs[name].mean(SIDE_FORCE, LATE)
        return Value(None if force is None else 0.1 * force)

    source = "k_fr rho A g L" if name == "B" else "k_fr (w L - 2/3 w l), l = (72 EI c_gap/w)^(1/4)"
    what = f"{name}: k_fr times the wall's force, mean from 5 to 10 s"
    return Claim(f"friction {name}", what, formula, source, measure, (name,), "N")


CASES: tuple[Case, ...] = (
    Case(
        "7",
        ("horizontal-a", "horizontal-b"),
        "Chapter 7.4.1: horizontal string, contact by penalty (A) and weight as normal force (B)",
        "Print has figures and a few statements. It lacks the clearance (10 mm here, chapter 4's), the shear modulus, "
        "how friction passes through zero speed (here within 0.2 mm/s), and any damping but friction. Pictures and "
        "convergence: [chapter-7.md](chapter-7.md).",
        {"A": Run("horizontal-a"), "B": Run("horizontal-b")},
        (
            Claim(
                "times",
                "displacement of the bit at 10 s, A over B",
                100.0,
                "7.4.1, fig. 7.2",
                _times,
                ("A", "B"),
                digits=3,
                tolerance=0.3,
                because="the clearance, which is not printed, and what friction does to bounces, decide it: from 2 to "
                "200, and 700 with the printed sign of the bit's force",
            ),
            statement(
                "B sticks",
                "pseudo stick-slip",
                "B",
                "7.4.1, fig. 7.2",
                _sticks("B", True),
                because="where the motor pulls back hardest, 464 N are left of the push beyond all friction: the bit "
                "slows down, and does not stand after its first 0.1 s",
            ),
            statement("A slips", "no stick-slip-like behaviour", "A", "7.4.1, fig. 7.2", _sticks("A", False)),
            statement("part", "contact acts only on a section", "A", "7.4.1, fig. 7.3", _part_touches),
            statement("p_r", "smaller contact forces, better performance", ("A", "B"), "7.4.2", _efficient),
            _side_force("A", 4136.0),
            _side_force("B", 4536.2),
        ),
        (
            Experiment(
                "The clearance that is not printed",
                ("times", "A slips", "p_r"),
                tuple(Variation(f"{1e3 * gap:g} mm", clearance(gap), runs=("A",)) for gap in CLEARANCES),
                "The clamp carries two thirds of the weight of the length that sags through the clearance. At about "
                "15 mm friction leaves 1400 N of the push, the bit's full resistance: below it the bit creeps, above "
                "it the string runs away. The ratio is that of the clearance chosen.",
            ),
            Experiment(
                "Friction against the whole velocity, as printed, for the same clearances",
                ("times", "A slips", "p_r"),
                tuple(
                    Variation(f"{1e3 * gap:g} mm", clearance(gap, **UNPROJECTED), runs=("A",))
                    for gap in (*CLEARANCES[:2], 0.010, *CLEARANCES[2:])
                ),
                "(7-4) takes the direction of the whole velocity. While the string bounces, friction then acts across "
                "the hole more than along it, and the string slides more easily. A clearance of about 30 mm gives 100 "
                "times.",
            ),
            Experiment(
                "Friction that takes all of the push",
                ("B sticks",),
                tuple(
                    Variation(f"B, k_fr = {mu:g}, v_0 = {1e3 / n:g} mm/s", more | rough(mu), runs=("B",))
                    for mu, n in ((0.10, 5e4), (0.12, 5e3), (0.12, 5e4), (0.13, 5e3), (0.13, 5e4))
                    for more in ({"contact.friction_velocity_scale": n},)
                ),
                "At 0.12, the mean of 7.4.2, friction leaves 57 N, at 0.13 nothing. Even then the bit does not stand: "
                "the motor shakes it against the elastic string, and all creeps by the rounding v_0 of friction.",
            ),
            Experiment(
                "Start, bounces and sign",
                ("times", "A slips", "p_r"),
                (
                    Variation("A starts on its wall", {"initial.state": "laid"}, runs=("A",)),
                    Variation("A bounces without loss", {"contact.retardation_time": 0.0}, runs=("A",)),
                    Variation("the bit's force with the sign of print", LITERAL),
                    Variation("A alone with the sign of print", LITERAL, runs=("A",)),
                ),
                "As printed, (7-5) and (7-6) push the bit forward with 1400 N: then B runs away as A does.",
            ),
        ),
        nearby=(),
    ),
)
