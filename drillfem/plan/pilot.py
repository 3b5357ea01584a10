"""Pilot runs: the same scene on every rung for a few seconds, to measure what a rung is off by and what it costs."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from drillfem.errors import DrillfemError
from drillfem.results import Result, dominant_in
from drillfem.scene import Scene
from drillfem.scene.ladder import BESIDE, rank

#: A pilot lasts this long (s), and no more steps than that.
SECONDS, STEPS = 20.0, 20_000
#: Wall time (s) of all runs together, compiling left out: those that are not done by then are given up, and said to be.
BUDGET = 7.0
#: Steps from which the pace of a rung is taken that is too slow for a whole pilot.
PACE_STEPS = 50
#: What is compared where the scene does not say what is wanted.
USUAL = ("bit_angular_speed", "bit_axial_speed", "bit_torque", "bit_weight", "rate_of_penetration")
#: Signals that only grow: their last value counts.
_GROWING = ("bit_depth", "bit_angle")
#: A wave of another run that is at least so strong, relative to its strongest, may be the one looked for.
_STRONG = 0.5


@dataclass(frozen=True)
class Signal:
    """A history in the last half of a run: mean, root mean square about it, and its waves (Hz, amplitude)."""

    mean: float
    spread: float
    waves: tuple[tuple[float, float], ...]

    @property
    def scale(self) -> float:
        """Size that errors are relative to: mean and spread together."""
        return abs(self.mean) + self.spread

    @property
    def main(self) -> float | None:
        """Frequency (Hz) of the wave that carries more than half of the variance; None if there is none to speak of."""
        if not self.waves or self.spread < 0.01 * self.scale:
            return None
        frequency, amplitude = self.waves[0]
        return frequency if amplitude**2 > self.spread**2 else None


@dataclass(frozen=True)
class Pilot:
    """What the pilot runs measured.

    ``off``: by rung and output, the error against ``reference``, the highest rung that was run whole, relative to mean
    plus spread (`deviation`). ``numerics``: the same for the ``subject`` (the model of the plan, or the nearest below
    that was run) against itself with half the step, a double mesh, nearby starts. ``speed``: simulated over wall
    time. ``main_wave``: frequency of the bit's strongest torsional wave (Hz). ``peak_weight``: greatest weight on bit
    (N) of the reference. ``failed``: why a rung could not be run. ``laid``: for models beside the ladder, the sum of
    their side forces at the start over that of the highest rung, less 1.
    """

    seconds: float
    reference: str = ""
    subject: str = ""
    off: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    numerics: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    speed: Mapping[str, float] = field(default_factory=dict)
    dofs: Mapping[str, int] = field(default_factory=dict)
    main_wave: Mapping[str, float] = field(default_factory=dict)
    peak_weight: float | None = None
    failed: Mapping[str, str] = field(default_factory=dict)
    laid: Mapping[str, float] = field(default_factory=dict)


class _TooSlowError(Exception):
    """A pilot run does not fit the budget."""


def signals(result: Result, names: tuple[str, ...]) -> dict[str, Signal]:
    """The histories ``names`` of a run as `Signal`; those that it does not have are left out."""
    history = result.history
    time = history["time"].values
    late = time >= time[0] + (time[-1] - time[0]) / 2 - 1e-9
    window = (float(time[late][0]), float(time[-1]))
    found = {}
    for name in names:
        if name == "rate_of_penetration" and "bit_depth" in history:
            depth = history["bit_depth"].values[late]
            found[name] = Signal(float((depth[-1] - depth[0]) / (window[1] - window[0])), 0.0, ())
        elif name in _GROWING and name in history:
            found[name] = Signal(float(history[name].values[-1]), 0.0, ())
        elif name in history:
            x = history[name].values[late]
            waves = tuple((p.frequency, p.amplitude) for p in dominant_in(history, name, window, 3))
            found[name] = Signal(float(x.mean()), float(x.std()), waves)
    return found


def deviation(one: Signal, other: Signal) -> float:
    """Relative error of ``one`` against ``other``: the greatest of three.

    The differences of mean and of spread over mean plus spread, and the relative distance from the wave that makes up
    most of ``other`` (`Signal.main`) to the nearest strong one of ``one``.
    """
    scale = max(other.scale, 1e-300)
    worst = max(abs(one.mean - other.mean), abs(one.spread - other.spread)) / scale
    if other.main is not None:
        strong = [f for f, amplitude in one.waves if amplitude >= _STRONG * one.waves[0][1]]
        worst = max(worst, min((abs(f / other.main - 1) for f in strong), default=1.0))
    return min(worst, 1.0)


def _deviations(one: dict[str, Signal], other: dict[str, Signal]) -> dict[str, float]:
    return {name: deviation(one[name], other[name]) for name in other if name in one}


def on(scene: Scene, model: str) -> Scene:
    """The scene on another rung, free to take its own engine there; what is wanted does not bind a pilot."""
    time = scene.time
    if model != scene.resolved_model().name:
        time = replace(time, engine="default", integrator="default")
    return replace(scene, model=model, time=time, output=replace(scene.output, wanted=None)).checked()


def run_pilot(scene: Scene, chosen: str, able: list[str]) -> Pilot:
    """Run the rungs ``able`` of a scene for `SECONDS`; those whose whole system is stepped only for `PACE_STEPS` steps.

    What cannot be run here, or does not fit `BUDGET`, is named in ``failed`` with the reason.
    """
    from drillfem.solve.run import simulate

    time = scene.time
    if time.analysis == "static":
        return Pilot(0.0)
    seconds = min(time.end - time.start, SECONDS, STEPS * time.step)
    names = tuple(scene.output.wanted or USUAL)
    runs: dict[str, Result] = {}
    speed: dict[str, float] = {}
    dofs: dict[str, int] = {}
    failed: dict[str, str] = {}

    rates: list[float] = []
    left = BUDGET

    def attempt(name: str, one: Scene, duration: float, counts: bool = True) -> Result | None:
        nonlocal left
        began = clock.perf_counter()
        rates.clear()

        def look(_t: float = 0.0, _end: float = 0.0, rate: float = 0.0) -> None:
            rates.append(rate)
            if counts and clock.perf_counter() - began >= left:
                raise _TooSlowError("its pilot run takes too long")

        try:
            look()
            return simulate(one, until=time.start + duration, progress=look, warn=False)  # the plan speaks for its runs
        except (DrillfemError, ImportError, _TooSlowError) as error:
            if isinstance(error, _TooSlowError) and rates and rates[-1] > 0:
                speed[name] = rates[-1]  # slow, but how slow is known
            else:
                failed[name] = " ".join(str(error).split())
            return None
        finally:
            left -= (clock.perf_counter() - began) * counts

    def pace(model: str, result: Result) -> None:
        wall = max(float(result.summary["wall_seconds"]), 1e-9)
        # what progress says leaves setting up out; a run of one stretch has not said it
        speed[model] = max(speed.get(model, 0.0), rates[-1] or float(result.summary["simulated_seconds"]) / wall)
        dofs[model] = int(result.summary["dofs"])

    def march(models: list[str], duration: float) -> dict[str, Result]:
        done = {}
        for model in models:
            there = on(scene, model)
            # kernels are loaded, and forms compiled, by a run that does not count
            if attempt(model, there, min(2 * time.step, seconds), counts=False) is None:
                continue
            result = attempt(model, there, duration)
            if result is not None:
                pace(model, result)
                done[model] = result
        return done

    ladder = [m for m in able if m not in BESIDE]
    whole = [m for m in ladder if on(scene, m).engine not in ("petsc", "compiled")]
    slow = [m for m in ladder if m not in whole]
    paced = min(seconds, PACE_STEPS * time.step)
    runs = march(whole, seconds)
    begun = march(slow, paced) if chosen in slow or not runs else {}
    laid = _laid(march([m for m in able if m in BESIDE], paced), begun)
    if not runs:
        return Pilot(seconds, speed=speed, dofs=dofs, failed=failed, laid=laid)
    reference = max(runs, key=rank)
    subject = chosen if chosen in runs else reference
    taken = {model: signals(result, names) for model, result in runs.items()}
    numerics = {}
    for name, other in _changed(on(scene, subject)).items():
        result = attempt(name, other, seconds)
        if result is not None:
            numerics[name] = _deviations(taken[subject], signals(result, names))
            if name.startswith("start"):
                pace(subject, result)
    if chosen not in slow:
        march(slow, paced)
    main = {}
    for model, result in runs.items():
        spin = signals(result, ("bit_angular_speed",)).get("bit_angular_speed")
        if spin is not None and spin.waves and spin.spread > 0.01 * spin.scale:
            main[model] = spin.waves[0][0]
    best = runs[reference].history
    return Pilot(
        seconds,
        reference,
        subject,
        {model: _deviations(taken[model], taken[reference]) for model in taken if model != reference},
        numerics,
        speed,
        dofs,
        main,
        float(np.max(best["bit_weight"].values)) if "bit_weight" in best else None,
        failed,
        laid,
    )


def _laid(beside: Mapping[str, Result], rungs: Mapping[str, Result]) -> dict[str, float]:
    """Side force at the start of models beside the ladder over that of the highest rung that has one, less 1."""
    pressed = {m: float(r.history["side_force"][0]) for m, r in rungs.items() if "side_force" in r.history}
    if not pressed or not (reference := pressed[max(pressed, key=rank)]):
        return {}
    return {m: float(r.history["side_force"][0]) / reference - 1 for m, r in beside.items()}


def _changed(base: Scene) -> dict[str, Scene]:
    """The scene from nearby starts, with half the step, with twice the elements of string and rock."""
    mesh, rock = replace(base.mesh, elements=2 * base.mesh.elements), base.rock
    if rock is not None:
        rock = replace(rock, surface=replace(rock.surface, elements=2 * rock.surface.elements))
    near = [replace(base, initial=replace(base.initial, seed_perturbation=1e-3, seed=k)) for k in (1, 2)]
    half = replace(base, time=replace(base.time, step=base.time.step / 2))
    changed = {
        "start 1": near[0],
        "half step": half,
        "start 2": near[1],
        "double mesh": replace(base, mesh=mesh, rock=rock),
    }
    return {name: scene.checked() for name, scene in changed.items()}
