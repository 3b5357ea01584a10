"""The claims of the thesis as data: what it prints, where, how ours is read, and when the two agree."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np

from drillfem.scene import Scene

from .imitation import Numerics
from .signals import ADVANCE, DEPTH, SPIN, TORQUE, Reading, Signals, Window

AS_IS = Reading()
"""Lines resolved, windows as the claims have them."""


class Runs(Protocol):
    """The runs of a case by name; looking one up simulates it."""

    def __getitem__(self, name: str) -> Signals: ...

    def scene(self, name: str) -> Scene:
        """The scene of a run, without simulating it."""
        ...


class Value(NamedTuple):
    """What is ours: a number (None: there is none), and what else is worth a word. A statement is 1 or 0."""

    number: float | None
    text: str = ""


Measure = Callable[[Runs], Value]


@dataclass(frozen=True)
class Run:
    """A run of a case: a built-in scene, what is changed in it (by dotted key), and its end (s) if not the scene's."""

    scene: str
    changes: Mapping[str, Any] = field(default_factory=dict)
    until: float | None = None


@dataclass(frozen=True)
class Claim:
    """One number or statement of the thesis.

    Attributes:
        key: short name, unique in its case, for experiments and JSON.
        what: what it is.
        published: the number, or the statement in words.
        source: where it stands.
        measure: ours.
        unit, digits: for printing.
        tolerance: relative difference up to which two numbers agree.
        resolution: absolute difference that print cannot show (half a line of its spectrum, its last digit).
        needs: runs that the measure looks at.
        because: the reason for a difference, for a reading, in words.
        verdict: False for numbers that are no claim about the model (computing times).
    """

    key: str
    what: str
    published: float | str
    source: str
    measure: Measure
    needs: tuple[str, ...]
    unit: str = ""
    digits: int = 4
    tolerance: float = 0.01
    resolution: float = 0.0
    because: str = ""
    verdict: bool = True


@dataclass(frozen=True)
class Variation:
    """One thing changed: in the scenes (``changes``), in how they are computed (``numerics``) or read (``reading``).

    ``runs``: to which runs of the case it is applied, all by default.
    """

    label: str
    changes: Mapping[str, Any] = field(default_factory=dict)
    numerics: Numerics | None = None
    reading: Reading = AS_IS
    until: float | None = None
    runs: tuple[str, ...] = ()


@dataclass(frozen=True)
class Experiment:
    """Variations side by side, with the claims they are shown for, and what they tell (``answer``)."""

    title: str
    show: tuple[str, ...]
    variations: tuple[Variation, ...]
    answer: str
    explains: bool = True


@dataclass(frozen=True)
class Case:
    """A scenario: runs, claims, experiments. ``aliases``: names of its scenes. ``nearby``: give nearby starts."""

    name: str
    aliases: tuple[str, ...]
    title: str
    text: str
    runs: Mapping[str, Run]
    claims: tuple[Claim, ...]
    experiments: tuple[Experiment, ...]
    nearby: tuple[Mapping[str, Any], ...] = tuple(
        {"initial.seed_perturbation": 1e-3, "initial.seed": k} for k in (1, 2, 3, 4)
    )


# -- what is measured -------------------------------------------------------------------------------------------------
UNITS = {SPIN: (1.0, "rad/s"), ADVANCE: (1e3, "mm/s")}


def _line(run: str, name: str, window: Window, near: float | None, amplitude: bool) -> Measure:
    def measure(runs: Runs) -> Value:
        signals = runs[run]
        peak = signals.strongest(name, window) if near is None else signals.near(name, window, near)
        if peak is None:
            return Value(None)
        scale, unit = UNITS[name]
        size = scale * peak.amplitude
        return Value(size) if amplitude else Value(peak.frequency, f"{size:.2g} {unit}")

    return measure


def _spacing(window: Window) -> float:
    """Half the spacing of the lines of an unpadded spectrum of a window, and the last digit of print."""
    return 0.5 / (window[1] - window[0]) + 0.005


def main_line(key: str, run: str, name: str, window: Window, published: float, source: str, **more: Any) -> Claim:
    """The strongest line of a signal."""
    what = more.pop("what", f"{run}: main line of the {SHORT[name]}, {_between(window)}")
    measure = _line(run, name, window, None, False)
    return Claim(key, what, published, source, measure, (run,), "Hz", resolution=_spacing(window), **more)


def a_line(key: str, run: str, name: str, window: Window, published: float, source: str, **more: Any) -> Claim:
    """A line that print lists: ours is the strongest one near it."""
    what = more.pop("what", f"{run}: a line of the {SHORT[name]}, {_between(window)}")
    measure = _line(run, name, window, published, False)
    return Claim(key, what, published, source, measure, (run,), "Hz", resolution=_spacing(window), **more)


def its_amplitude(
    key: str, run: str, name: str, window: Window, near: float | None, published: float, source: str, **more: Any
) -> Claim:
    """The amplitude of the strongest line, or of the strongest one near a frequency (Hz)."""
    at = "main line" if near is None else f"{near:.2f} Hz"
    what = more.pop("what", f"{run}: amplitude at {at}, {_between(window)}")
    measure = _line(run, name, window, near, True)
    more = {"tolerance": 0.1, "digits": 3} | more
    return Claim(key, what, published, source, measure, (run,), UNITS[name][1], **more)


def mean_torque(key: str, run: str, window: Window, published: float, source: str, **more: Any) -> Claim:
    """Mean torque on bit in a window."""

    def measure(runs: Runs) -> Value:
        return Value(runs[run].mean(TORQUE, window))

    what = f"{run}: mean torque on bit, {_between(window)}"
    return Claim(key, what, published, source, measure, (run,), "N m", **({"tolerance": 0.02} | more))


def of_scene(
    key: str, what: str, run: str, published: float, source: str, number: Callable[[Scene], float | None], **more: Any
) -> Claim:
    """A number that follows from the scene, without a run in time."""

    def measure(runs: Runs) -> Value:
        return Value(number(runs.scene(run)))

    return Claim(key, what, published, source, measure, (), **more)


def statement(
    key: str,
    says: str,
    needs: str | Iterable[str],
    source: str,
    check: Callable[[Runs], tuple[bool | None, str]],
    about: str = "",
    **more: Any,
) -> Claim:
    """A statement in words; its check gives whether it holds (None: the run is too short) and what that rests on.

    ``about``: what it is about, the runs by default.
    """

    def measure(runs: Runs) -> Value:
        truth, text = check(runs)
        return Value(None if truth is None else float(truth), text)

    names = (needs,) if isinstance(needs, str) else tuple(needs)
    return Claim(key, about or ", ".join(names), says, source, measure, names, **more)


SHORT = {SPIN: "spin", ADVANCE: "axial speed"}


def _between(window: Window) -> str:
    return f"{window[0]:g} to {window[1]:g} s"


# -- checks of statements ---------------------------------------------------------------------------------------------
Check = Callable[[Runs], tuple[bool | None, str]]


def turns_back(run: str, window: Window, expected: bool = True) -> Check:
    """The bit turns backwards (faster than the regularisation c3), or never does."""

    def check(runs: Runs) -> tuple[bool | None, str]:
        part = runs[run].part(SPIN, window)
        if not len(part):
            return None, ""
        least = float(part.min())
        bit = runs[run].scene.bit
        limit = -(bit.cutting_regularisation if bit else 0.0)
        back = float(np.mean(part < limit))
        text = f"least {_small(least)} rad/s" + (f", {100 * back:.2g} % of the time" if back else "")
        return (least < limit) == expected, text

    return check


def torque_changes_sign(run: str, window: Window, expected: bool = True) -> Check:
    """The torque on bit changes its sign, or never does."""

    def check(runs: Runs) -> tuple[bool | None, str]:
        part = runs[run].part(TORQUE, window)
        if not len(part):
            return None, ""
        return (float(part.min()) < 0) == expected, f"least {part.min():.0f} N m"

    return check


def torsional_stick(run: str, window: Window, expected: bool = True) -> Check:
    """The bit stands still (below c2, 0.1 rad/s) for a noticeable share of the time, or never does."""

    def check(runs: Runs) -> tuple[bool | None, str]:
        part = runs[run].part(SPIN, window)
        if not len(part):
            return None, ""
        share = float(np.mean(np.abs(part) < 0.1))
        return (share > 0.005) == expected, f"stands {100 * share:.1f} % of the time, least spin {_small(part.min())}"

    return check


def axial_stick(run: str, window: Window, expected: bool = True) -> Check:
    """The bit does not advance (below c1, 1e-5 m/s) for a noticeable share of the time, or always does."""

    def check(runs: Runs) -> tuple[bool | None, str]:
        part = runs[run].part(ADVANCE, window)
        if not len(part):
            return None, ""
        share = float(np.mean(np.abs(part) < 1e-5))
        return (share > 0.005) == expected, f"{100 * share:.0f} % of the time"

    return check


def dies_out(
    run: str,
    name: str,
    early: Window,
    late: Window,
    below: float | None = None,
    to: float = 0.1,
    expected: bool = True,
) -> Check:
    """The swing of a signal falls to less than a share ``to`` of what it was, or does not.

    Peak to peak; with ``below`` (Hz) the amplitude of the strongest line under that frequency.
    """

    def swing(signals: Signals, window: Window) -> float:
        if below is None:
            part = signals.part(name, window)
            return float(np.ptp(part)) if len(part) else np.nan
        return max((p.amplitude for p in signals.lines(name, window) if p.frequency < below), default=0.0)

    def check(runs: Runs) -> tuple[bool | None, str]:
        first, last = (swing(runs[run], w) for w in (early, late))
        if np.isnan(last) or runs[run].time[-1] < late[1] - 1e-6:
            return None, ""
        scale, unit = UNITS[name]
        return (last < to * first) == expected, f"{scale * first:.2g} to {scale * last:.2g} {unit}"

    return check


def deeper_than_nominal(run: str, time: float) -> Check:
    """The bit is deeper than in steady drilling."""

    def check(runs: Runs) -> tuple[bool | None, str]:
        depth = runs[run].at(DEPTH, time)
        if depth is None:
            return None, ""
        nominal = runs[run].scene.nominal().rate_of_penetration * time
        return depth > nominal, f"{depth:.4f} m, nominal {nominal:.4f} m"

    return check


def all_of(*checks: Check) -> Check:
    """Several checks that must all hold."""

    def check(runs: Runs) -> tuple[bool | None, str]:
        found = [c(runs) for c in checks]
        truth = None if any(t is None for t, _ in found) else all(t for t, _ in found)
        return truth, "; ".join(text for _, text in found)

    return check


def _small(x: float) -> str:
    return "0" if abs(x) < 5e-3 else f"{x:.2f}"
