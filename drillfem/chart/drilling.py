"""Cases ``lumped``, ``torsional``, ``axial-torsional``: a string that drills, by all engines, schemes and rungs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError, SimulationError
from ..models.straight import have_forms
from ..scene import Scene, load_scene
from ..solve.straight import StraightRun
from .points import Chart, Level, Panel, Point, cpu_seconds, normalise, relative_l2

F8 = NDArray[np.float64]
Tell = Callable[[str], None]

SCENES = {"lumped": "cutting-c1", "torsional": "cutting-c1", "axial-torsional": "vertical-c1-cd4"}
#: What the error is about, and the spacing (s) of the rows. Speeds are means between two rows, differences of angle and
#: depth: those of an undamped string jump, and which side of a jump a row is on is chance.
QUANTITIES, SPACING = ("spin", "axial speed"), 4e-3
WORST = "larger relative L2 error of the bit's spin and axial speed, means over 4 ms"
SPIN = "relative L2 error of the bit's spin, means over 4 ms"
#: The reference runs at the finest step of a panel over this: its own step halved four times.
FINER = 16
#: Upwind cells for each element of the other schemes: with as many there is nothing to see.
_MORE_UPWIND = 8
#: Meshes are compared at the default step over this, so that the error in time does not hide them.
STEADY = 4
_EXACT = "surfaces: cost of the exact surface"
_ITSELF = "reference against itself at twice its step"


@dataclass(frozen=True)
class Effort:
    """How much is computed.

    horizon: s, short enough that the motion is predictable. steps: halvings of `SPACING`, fewer
    for the slowest method. surfaces: elements of a
    surface; meshes: elements of the string. panels: names of those to compute, all if empty. tolerances: of the
    delay equation. repeat: least of so many.
    """

    horizon: float
    steps: tuple[int, ...] = (0, 1, 2, 3, 4)
    slow_steps: tuple[int, ...] = (0, 1, 2, 3)
    surfaces: tuple[int, ...] = (4, 8, 16, 32, 64, 128)
    meshes: tuple[int, ...] = (8, 16, 32, 64, 128)
    panels: tuple[str, ...] = ()
    tolerances: tuple[float, ...] = (1e-3, 1e-4, 1e-5, 1e-6)
    repeat: int = 3
    quick: bool = False


FULL = {"lumped": Effort(10.0), "torsional": Effort(3.0), "axial-torsional": Effort(4.0)}
QUICK = {
    case: Effort(
        horizon=1.2 if case == "axial-torsional" else 2.0,
        steps=(0, 1, 2, 3),
        slow_steps=(0, 1, 2),
        surfaces=(4, 8, 16, 32),
        meshes=(16, 32, 64),
        tolerances=(1e-3, 1e-4),
        repeat=2,
        quick=True,
    )
    for case in FULL
}


class Bench:
    """Runs of one scene with changed keys, all compared at the same times; runs that are the same are made once."""

    def __init__(self, case: str, effort: Effort, keys: dict[str, Any] | None = None) -> None:
        self.case, self.effort = case, effort
        self.keys = {"model": case, **(keys or {})}
        self.default = load_scene(SCENES[case])

    def scene(self, **keys: Any) -> Scene:
        """The scene of the case; keys with ``__`` for a dot."""
        given = {name.replace("__", "."): value for name, value in keys.items()}
        end = self.effort.horizon
        times = {"time.end": end, "output.interval": SPACING, "output.fields_interval": end}
        return load_scene(SCENES[self.case], {**self.keys, **times, **given})

    def run(self, repeat: int | None = None, **keys: Any) -> tuple[dict[str, F8], float]:
        """Histories of `QUANTITIES` between rows from the first on, and CPU seconds of the stepping."""
        scene = self.scene(**keys)
        many = self.effort.repeat if repeat is None else repeat
        return _petsc(scene, many) if scene.engine == "petsc" else _straight(scene, many)

    def point(
        self, series: str, size: float, reference: dict[str, F8], default: bool = False, drawn: str = "", **keys: Any
    ) -> Point:
        """A run with its errors against a reference; ``drawn``: the quantity whose error is drawn, default the worst.

        A run that the program refuses, or that breaks down, has an infinite error.
        """
        settings = {**self.keys, **{name.replace("__", "."): value for name, value in keys.items()}}
        try:
            rows, cpu = self.run(**keys)
        except (SceneError, SimulationError) as error:
            return Point(series, size, math.inf, {}, 0.0, {**settings, "failure": str(error)})
        errors = {name: relative_l2(rows[name], reference[name]) for name in QUANTITIES}
        return Point(series, size, errors[drawn] if drawn else max(errors.values()), errors, cpu, settings, default)


def _straight(scene: Scene, repeat: int) -> tuple[dict[str, F8], float]:
    """A run of an engine for straight strings."""
    try:
        string = StraightRun(scene).string
    except ValueError as error:  # a step beyond the stability limit
        raise SceneError(str(error)) from None
    start, every = string.state_dict(), round(SPACING / scene.time.step)
    steps = every * round((scene.time.end - scene.time.start) / SPACING)
    string.advance(every, every)  # loads the compiled kernels
    cpu, rows = cpu_seconds(lambda: string.advance(steps, every), repeat, prepare=lambda: string.load(start))
    return _means(rows["bit_angle"], rows["bit_depth"]), cpu


def _means(angle: F8, depth: F8) -> dict[str, F8]:
    """Mean speeds between rows."""
    return {"spin": np.diff(angle) / SPACING, "axial speed": np.diff(depth) / SPACING}


def _petsc(scene: Scene, repeat: int) -> tuple[dict[str, F8], float]:
    """A run through PETSc TS, with the energy audit that every run has."""
    from ..models.rod import Rod
    from ..solve.direct import DirectRun

    rod, made = Rod(scene), list[DirectRun]()
    times = SPACING * np.arange(1, round((scene.time.end - scene.time.start) / SPACING) + 1)

    def prepare() -> None:
        made.append(DirectRun(rod))
        made[-1].step(scene.time.step / 100)  # compiles and loads
        made[-1].destroy()
        made[-1] = DirectRun(rod)

    def run() -> dict[str, F8]:
        now, at, rows, t = made[-1], rod.bit, [], 0.0
        for until in times:
            while t < until * (1 - 1e-12):
                t = now.step(until)
            rows.append((now.bit_angle, now.stepper.u[at.depth]))
        return _means(*np.array(rows).T)

    try:
        cpu, found = cpu_seconds(run, repeat, prepare=prepare)
    finally:
        for one in made:
            one.destroy()
    return found, cpu


def chart(case: str, effort: Effort | None = None, progress: Tell = lambda _: None) -> Chart:
    """Compute a case: ``lumped``, ``torsional`` or ``axial-torsional``. ``progress`` is told what is computed."""
    effort = effort or FULL[case]
    bench = Bench(case, effort)
    makers = {"steps": _steps, "surfaces": _surfaces}
    if case != "lumped":
        makers |= {"meshes": _meshes, "rungs": _rungs}
    normaliser, panels, facts = [normalise()], [], dict[str, Any]()
    for name, make in makers.items():
        if not effort.panels or name in effort.panels:
            panels.append(make(bench, facts, lambda text: progress(f"{case}: {text}")))
            normaliser.append(normalise())
    if _EXACT in facts:
        facts[_EXACT] /= min(normaliser)
    title = {
        "lumped": "The lumped model (M1: one mass, one inertia, one spring) drills",
        "torsional": "The torsional model (M2: waves of twist, collars rigid along the axis) drills",
        "axial-torsional": "The axial-torsional string drills",
    }[case]
    return Chart(
        case, title, f"{SCENES[case]}, first {effort.horizon:g} s", panels, min(normaliser), effort.quick, facts
    )


def _halved(bench: Bench, halvings: tuple[int, ...]) -> Iterator[tuple[float, bool]]:
    """Steps (s), and whether it is the default one."""
    for k in halvings:
        step = SPACING / 2**k
        yield step, math.isclose(step, bench.default.time.step)


def _converged(bench: Bench, facts: dict[str, Any], name: str, finest: float, **keys: Any) -> dict[str, F8]:
    """Reference: exact surface, a sixteenth of the finest step; notes how far it is from the same at twice the step."""
    keys = {"rock__surface__scheme": "profile", "time__integrator": "exact", **keys}
    reference, _ = bench.run(repeat=1, time__step=finest / FINER, **keys)
    twice, _ = bench.run(repeat=1, time__step=2 * finest / FINER, **keys)
    facts[f"{name}: {_ITSELF}"] = max(relative_l2(twice[q], reference[q]) for q in QUANTITIES)
    return reference


def _steps(bench: Bench, facts: dict[str, Any], tell: Tell) -> Panel:
    """Integrator, engine, Newton strategy and kind of surface, over the step; each engine against itself, converged."""
    case, effort = bench.case, bench.effort
    finest = SPACING / 2 ** effort.steps[-1]
    profile = {"rock__surface__scheme": "profile"}
    condensed, exact = {"time__engine": "condensed"}, {"time__integrator": "exact"}
    marched = {"time__engine": "characteristics"}
    # its limit leaves few of the common steps
    more = () if case == "lumped" else (effort.steps[-1] + 1, effort.steps[-1] + 2)
    # name: keys, halvings, keys of the reference
    series: dict[str, tuple[dict[str, Any], tuple[int, ...], dict[str, Any]]] = {
        "condensed, DG surface": (condensed | exact, effort.steps, condensed),
        "condensed, exact surface": (condensed | profile | exact, effort.steps, condensed),
        "condensed trapezoidal": (condensed | profile | {"time__integrator": "trapezoidal"}, effort.steps, condensed),
        "condensed explicit": (
            condensed | profile | {"time__integrator": "explicit"},
            (*effort.steps, *more),
            condensed,
        ),
    }
    if case == "torsional":
        series["characteristics"] = (profile | marched, effort.steps, marched)
    if case == "axial-torsional" and have_forms():
        petsc, full = profile | {"time__engine": "petsc"}, {"time__jacobian": "every-iteration"}
        series["PETSc, kept Jacobian"] = (petsc | {"time__jacobian": "kept"}, effort.steps, condensed)
        series["PETSc, full Newton"] = (petsc | full, effort.slow_steps, condensed)
        alpha = {"time__integrator": "generalized-alpha"}
        series["PETSc, generalised-alpha"] = (petsc | alpha, effort.steps, condensed)
    references: dict[str, dict[str, F8]] = {}
    points, levels = [], []
    for name, (keys, halvings, of) in series.items():
        engine = of["time__engine"]
        if engine not in references:
            tell(f"reference, {engine}")
            references[engine] = _converged(bench, facts, engine, finest, **of)
        tell(name)
        for step, default in _halved(bench, halvings):
            default = default and name == "condensed, DG surface"
            points.append(bench.point(name, step, references[engine], default, time__step=step, **keys))
    points, refused = [p for p in points if p.cpu > 0], [p for p in points if p.cpu <= 0]
    for point in refused:
        facts[f"refused: {point.series}, step (s)"] = min(
            point.size, facts.get(f"refused: {point.series}, step (s)", math.inf)
        )
    if case == "lumped":
        tell("delay equation")
        points += _delay_equation(bench, references["condensed"])
        facts["delay equation, finest, against the reference"] = points[-1].error
    if case == "torsional":
        one, two = references.values()
        mesh = bench.default.mesh
        name = f"{mesh.elements} elements of degree {mesh.degree}"
        levels.append(Level(name, max(relative_l2(one[q], two[q]) for q in QUANTITIES)))
    return Panel(
        "steps",
        "Integrator, engine and step",
        "step",
        "s",
        WORST,
        f"{'each' if case == 'torsional' else 'condensed'} engine, exact surface, {1e6 * finest / FINER:.3g} µs",
        tuple(points),
        facts[f"condensed: {_ITSELF}"] / (2**2 - 1),
        tuple(levels),
    )


def _delay_equation(bench: Bench, reference: dict[str, F8]) -> list[Point]:
    """The oracle of the lumped model, which shares nothing with the engine but the law; its size is its mean step."""
    from ..bitrock.delay import LumpedBit, delay_equation

    scene, points = bench.scene(), []
    end, bit = bench.effort.horizon, LumpedBit.from_scene(scene)
    delay_equation(bit, SPACING, step=SPACING)  # loads the compiled kernels
    for tolerance in bench.effort.tolerances:
        cpu, rows = cpu_seconds(partial(delay_equation, bit, end, tolerance, step=SPACING), repeat=1)
        found = _means(rows["bit_angle"][1:], rows["bit_depth"][1:])
        errors = {name: relative_l2(found[name], reference[name]) for name in QUANTITIES}
        size, settings = end / len(rows["steps"]), {**bench.keys, "tolerance": tolerance}
        points.append(Point("delay equation", size, max(errors.values()), errors, cpu, settings))
    return points


def _surfaces(bench: Bench, facts: dict[str, Any], tell: Tell) -> Panel:
    """Scheme of the rock surface over its mesh, all with one step; the exact surface is the reference."""
    step = bench.default.time.step / STEADY
    same: dict[str, Any] = {"time__step": step, "time__engine": "condensed"}
    tell("reference of the surfaces")
    reference, cpu = bench.run(rock__surface__scheme="profile", **same)
    rock, bit = bench.default.rock, bench.default.bit
    assert rock is not None and bit is not None
    taken = (rock.surface.scheme, rock.surface.degree, rock.surface.elements)
    width = 2 * math.pi / bit.blades
    points = []
    schemes = {"upwind": ("upwind", 0), "SUPG": ("supg", 1)} | {f"DG, degree {k}": ("dg", k) for k in (1, 2, 3)}
    for name, (scheme, degree) in schemes.items():
        tell(f"surface {name}")
        for elements in (n * (_MORE_UPWIND if scheme == "upwind" else 1) for n in bench.effort.surfaces):
            if scheme == "dg" and elements * (degree + 1) > bench.effort.surfaces[-1] * 2:
                continue
            keys: dict[str, Any] = {"rock__surface__scheme": scheme, "rock__surface__elements": elements}
            keys |= {"rock__surface__degree": degree} if scheme == "dg" else {}
            default = (scheme, degree, elements) == taken
            points.append(bench.point(name, width / elements, reference, default, **same, **keys))
    facts[_EXACT] = cpu
    return Panel(
        "surfaces",
        "Scheme and mesh of the rock surface",
        "cell",
        "rad",
        WORST,
        "the exact surface at the same step",
        tuple(points),
        min(p.error for p in points),
        note=f"steps of {1e3 * step:g} ms",
    )


def _meshes(bench: Bench, facts: dict[str, Any], tell: Tell) -> Panel:
    """Degree and number of elements, all with one step and the exact surface, against exact waves or a fine mesh."""
    step, finest = bench.default.time.step / STEADY, bench.effort.meshes[-1]
    same: dict[str, Any] = {"time__engine": "condensed", "rock__surface__scheme": "profile", "time__step": step}
    tell("reference of the meshes")
    if bench.case == "torsional":
        reference, _ = bench.run(repeat=1, **same | {"time__engine": "characteristics"})
        what, floor = "characteristics, same step", 0.0
    else:
        reference, _ = bench.run(repeat=1, mesh__elements=finest, mesh__degree=4, **same)
        coarser, _ = bench.run(repeat=1, mesh__elements=finest // 2, mesh__degree=4, **same)
        what = f"{finest} elements of degree 4, same step"
        facts["meshes: reference against itself on half the elements"] = floor = max(
            relative_l2(coarser[q], reference[q]) for q in QUANTITIES
        )
    taken, points = (bench.default.mesh.degree, bench.default.mesh.elements), []
    for degree in (1, 2, 3, 4):
        tell(f"elements of degree {degree}")
        for elements in bench.effort.meshes:
            if (degree + 1) * elements > 4 * finest:  # no finer than the reference
                continue
            keys: dict[str, Any] = {"mesh__elements": elements, "mesh__degree": degree}
            size, default = bench.default.length / elements, (degree, elements) == taken
            points.append(bench.point(f"degree {degree}", size, reference, default, **same, **keys))
    return Panel(
        "meshes",
        "Degree and number of elements",
        "element",
        "m",
        WORST,
        what,
        tuple(points),
        floor / (2**4 - 1),
        note=f"exact surface, {1e3 * step:g} ms",
    )


def _rungs(bench: Bench, facts: dict[str, Any], tell: Tell) -> Panel:
    """The lower rungs of the ladder on the same scene: what no step removes is their modelling error."""
    effort, case = bench.effort, bench.case
    tell("reference of the rungs")
    finest = SPACING / 2 ** effort.steps[-1]
    reference = _converged(bench, facts, "rungs", finest)
    points, levels = [], []
    for model in [*dict.fromkeys(("lumped", "torsional", case))]:
        tell(f"model {model}")
        lower = Bench(case, effort, {"model": model, "rock.surface.scheme": "profile"})
        for step, _ in _halved(lower, effort.steps):
            points.append(lower.point(model, step, reference, drawn="spin", time__step=step))
        if model != case:
            levels.append(Level(f"modelling error of {model}", points[-1].error))
    return Panel(
        "rungs",
        "Rung of the ladder",
        "step",
        "s",
        SPIN,
        f"{case}, {1e6 * finest / FINER:.3g} µs",
        tuple(points),
        levels=tuple(levels),
        note="exact surface",
    )
