"""Appendix B.4 (B.1.4 in print): a vertical string under a PI drive, on an empirical bit law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from drillfem.bitrock.empirical import EmpiricalLaw
from drillfem.scene import Scene

from .chapter4 import FAST
from .claims import Case, Claim, Experiment, Run, Runs, Value, Variation, of_scene, statement
from .signals import PENETRATION, SIDE_FORCE, SPIN, TOP_SPIN, Reading

WHOLE, EARLY, LATE = (0.0, 100.0), (0.0, 40.0), (60.0, 100.0)
RPM = np.pi / 30


# -- the law ----------------------------------------------------------------------------------------------------------
def _law(scene: Scene, rounded: bool = True) -> tuple[EmpiricalLaw, float]:
    """Law of the bit and weight on it (N); not ``rounded``: as measured, without the regularisation."""
    law = EmpiricalLaw.from_scene(scene)
    return law if rounded else replace(law, regularisation=1e-9), scene.nominal().weight_on_bit


def _rate(scene: Scene, rpm: float = 100.0) -> float:
    """(B-2), m/s."""
    law, weight = _law(scene, False)
    return law.rate_of_penetration(weight, rpm * RPM)


def _torque(scene: Scene, rpm: float = 100.0, rounded: bool = True) -> float:
    """(B-4) or (B-5), N m."""
    law, weight = _law(scene, rounded)
    return law.torque(weight, rpm * RPM)


def _peak(scene: Scene) -> tuple[float, float]:
    """Greatest torque (N m) of (B-5), and the spin (rad/s) where it is."""
    law, weight = _law(scene)
    spins = np.linspace(1.0, 12.0, 1101)
    torque = np.array([law.torque(weight, float(w)) for w in spins])
    return float(torque.max()), float(spins[torque.argmax()])


# -- the run ----------------------------------------------------------------------------------------------------------
def _start(runs: Runs) -> Value:
    spin = runs["CR"].at(SPIN, 0.0)
    return Value(None if spin is None else spin / RPM)


def _straight(runs: Runs) -> tuple[bool | None, str]:
    """The rod's spins are those of the straight string."""
    apart, window = [], runs["CR"].reading.window or WHOLE
    for name in (SPIN, TOP_SPIN):
        a, b = (runs[run].part(name, window) for run in ("CR", "straight"))
        if not len(a) or len(a) != len(b):
            return None, ""
        apart.append(float(np.abs(a - b).max() / np.abs(b).max()))
    return max(apart) < 0.02, f"spins of bit and top to {100 * max(apart):.1g} % of the largest"


def _within(runs: Runs) -> tuple[bool | None, str]:
    """The string sinks less than the clearance into the wall."""
    deepest, force = (runs["CR"].part(name, WHOLE) for name in (PENETRATION, SIDE_FORCE))
    if not len(deepest):
        return None, ""
    room = min((runs["CR"].scene.hole.diameter or 0.0) / 2 - s.contact_radius for s in runs["CR"].scene.string)
    if not force.max():
        return True, "it never touches the wall"
    return float(deepest.max()) < room, f"penetrates by {1e3 * deepest.max():.2g} mm, side force {force.max():.2g} N"


def _period(runs: Runs) -> Value:
    """Time between falls of the top's spin through the speed wanted, over that of drive and string as one body."""
    run = runs["CR"]
    drive, ends = run.scene.top_drive, run.scene.ends
    over = run.values[TOP_SPIN] > (drive.speed or 0.0)
    falls = run.time[1:][over[:-1] & ~over[1:]]
    if len(falls) < 2 or not drive.integral_gain:
        return Value(None)
    inertia = ends.top_inertia + ends.bottom_inertia
    inertia += sum(2 * s.rotary_inertia * s.length for s in run.scene.string)
    period, stiff = float(np.diff(falls).mean()), float(2 * np.pi * np.sqrt(inertia / drive.integral_gain))
    return Value(period / stiff, f"{period:.2f} and {stiff:.2f} s")


def _decays(runs: Runs) -> tuple[bool | None, str]:
    """The swing of the bit falls, about the speed wanted."""
    early, late = (runs["CR"].part(SPIN, window) for window in (EARLY, LATE))
    if not len(late):
        return None, ""
    text = f"{early.min():.1f} to {early.max():.1f} rad/s up to 40 s, {late.min():.1f} to {late.max():.1f} from 60 s"
    return bool(np.ptp(late) < np.ptp(early)), text


_TILT = {"gravity.direction": [1e-3, 0.0, 0.9999995]}

B4 = Case(
    "B-4",
    ("vertical-pi",),
    "Appendix B.1.4: a vertical string under a PI drive, on an empirical bit law",
    "The thesis shows the spins of top and bit over 100 s and says that they match those of its reference, whose "
    "string is straight. The numbers of the law are what (B-2) to (B-5) and table B.2 come to; the string is that of "
    "table 4.3. Not printed: k_s (1e6 N/m2 here), whether F in (B-5) is the weight wanted or that on the bit (the "
    "latter here), and the regularised rate of penetration (that whose depth of cut gives the torque of (B-5)).",
    {"CR": Run("vertical-pi", FAST), "straight": Run("vertical-pi", {**FAST, "model": "axial-torsional"})},
    (
        *(
            of_scene(key, what, "CR", published, source, number, unit=unit, tolerance=2e-3)
            for key, what, published, unit, source, number in (
                ("ROP", "rate of penetration at 100 rpm", 3.682, "mm/s", "(B-2)", lambda s: 1e3 * _rate(s)),
                ("DOC", "depth of cut at 100 rpm", 0.3516, "mm/rad", "(B-3)", lambda s: 1e3 * _rate(s) / (100 * RPM)),
                ("TOB", "torque at 100 rpm", 4828.0, "N m", "(B-4)", lambda s: _torque(s, rounded=False)),
                ("TOB 100", "torque at 100 rpm, regularised", 4592.0, "N m", "(B-5)", _torque),
                ("TOB 70", "torque at 70 rpm, regularised", 5127.0, "N m", "(B-5)", lambda s: _torque(s, 70.0)),
                ("peak", "greatest torque, regularised", 5681.0, "N m", "(B-5)", lambda s: _peak(s)[0]),
            )
        ),
        of_scene(
            "at",
            "spin at the greatest torque",
            "CR",
            4.1,
            "(B-5)",
            lambda s: _peak(s)[1],
            unit="rad/s",
            resolution=0.05,
        ),
        Claim("start", "spin of the bit at the start", 70.0, "B.1.5", _start, ("CR",), "rpm"),
        statement("straight", "the rod is what the straight string is", ("CR", "straight"), "B.1.4.2", _straight),
        statement("within", "it stays within the clearance", "CR", "B.1.4.2", _within),
        Claim("period", "period of the top's swing", 1.0, "2 pi sqrt(J/k_i)", _period, ("CR",), "", 4, 0.05),
        statement("decays", "the swing of the bit decays", "CR", "figs. B.7, B.8", _decays, verdict=False),
    ),
    (
        Experiment(
            "A string that is disturbed",
            ("straight", "within"),
            (Variation("gravity tilted by 1e-3, 20 s", _TILT, None, Reading(window=(0.0, 20.0)), 20.0, ("CR",)),),
            "Nothing pushes the string of the scene aside, so it never touches the wall, though it is pushed with six "
            "times the load that buckles it. Disturbed, it lies on the wall and sinks some micrometres into it, and "
            "turns as before.",
            explains=False,
        ),
        Experiment(
            "What is open",
            ("straight", "period", "decays"),
            (
                Variation("F the weight wanted", {"bit.empirical.force": "nominal"}),
                Variation("300 elements", {"mesh.elements": 300}, runs=("straight",)),
                Variation("2.5 ms steps", {"time.step": 2.5e-3}, runs=("straight",)),
            ),
            "Nothing of it matters. Drive and string swing as one body on the integral gain, with a period of 21.5 "
            "s, and waves of twist on top of it die out.",
            explains=False,
        ),
    ),
    nearby=(),
)

CASES = (B4,)
