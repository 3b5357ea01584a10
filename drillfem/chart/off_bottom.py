"""Case ``off-bottom``: a string laid in well A and turned, by contact method, step, mesh, integrator and engine."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from time import process_time
from typing import Any

import numpy as np

from ..compat import Array
from ..errors import SimulationError
from ..models.rod import Rod
from ..scene import Scene, load_scene
from ..solve.dynamics import Marcher, Stepper
from ..solve.laid import lay
from .points import Chart, Panel, Point, cpu_seconds, normalise, relative_l2

Tell = Callable[[str], None]

SCENE = "off-bottom"
#: The drive of chapter 4 takes a minute to come up to its speed: here the top is there in half a second, so that all
#: of the string slides within the horizon. Energy is not audited: nothing but the stepping is timed.
DRIVE: dict[str, Any] = {
    "top_drive.kind": "imposed-speed",
    "top_drive.rise_time": 0.5,
    "top_drive.proportional_gain": None,
    "top_drive.integral_gain": None,
    "ends.top_inertia": 0.0,
}
#: What is compared, every so many seconds; `WORST` is drawn.
QUANTITIES, SPACING = ("bit spin", "wall torque", "top torque", "side force"), 0.02
WORST, LAID = "larger relative L2 error of the bit's spin and the wall's torque", "relative L2 error of the side force"
#: Length of hole (m) over which the side force of the laid string is summed; the kinks are in the middle of one.
STAND = 25.0
#: Contact methods and meshes are compared at this step (s), at which the wall of 1e7 N/m2 does not chatter.
STEP = 2.5e-3
#: The reference in time: this integrator, at the finest step over `FINER`.
FINEST: dict[str, Any] = {"integrator": "generalized-alpha", "rho_infinity": 0.5}
FINER = 4


@dataclass(frozen=True)
class Effort:
    """How much is computed.

    horizon: s. elements: of the panels that refine something else. steps: s, those of the compiled engine; slow_steps:
    of PETSc; dear_steps: of what factorises in every iteration. stiffness: of the wall, N/m2. meshes, laid: elements;
    the last one is the reference. panels: names of those to compute, all if empty.
    """

    horizon: float = 2.0
    elements: int = 200
    steps: tuple[float, ...] = (2e-2, 1e-2, 5e-3, 2.5e-3, 1.25e-3)
    slow_steps: tuple[float, ...] = (2e-2, 1e-2, 5e-3)
    dear_steps: tuple[float, ...] = (2e-2, 1e-2)
    stiffness: tuple[float, ...] = (1e4, 1e5, 1e6, 1e7)
    meshes: tuple[int, ...] = (50, 100, 200, 400)
    laid: tuple[int, ...] = (100, 200, 400, 800)
    panels: tuple[str, ...] = ()
    repeat: int = 1
    quick: bool = False


FULL = Effort()
QUICK = Effort(
    horizon=1.5,
    elements=100,
    steps=(1e-2, 5e-3, 2.5e-3),
    slow_steps=(1e-2,),
    dear_steps=(1e-2,),
    stiffness=(1e5, 1e6),
    meshes=(50, 100),
    laid=(100, 200, 400),
    quick=True,
)


def scene_of(effort: Effort, **keys: Any) -> Scene:
    """The scene with changed keys, ``__`` for a dot."""
    given = {name.replace("__", "."): value for name, value in keys.items()}
    times = {"time.end": effort.horizon, "time.step": STEP, "output.interval": STEP}
    # the sections of an undamped string that carries torque must not turn by themselves, on any mesh
    return load_scene(SCENE, {**DRIVE, **times, "mesh.elements": effort.elements, "mesh.quadrature": "full", **given})


def stepper_of(engine: str) -> type[Marcher]:
    """Who steps."""
    if engine != "compiled":
        return Stepper
    from ..solve.compiled import CompiledStepper

    return CompiledStepper


class Well:
    """A string laid in the well, on one mesh, by one contact method and engine; marched as often as wanted."""

    def __init__(self, effort: Effort, **keys: Any) -> None:
        self.effort, self.scene = effort, scene_of(effort, **keys)
        self.marcher = stepper_of(self.scene.engine)
        self.rod = Rod(self.scene)
        self.marcher.adopt(self.rod)
        self.start = lay(self.rod)
        self.there = self.rod.there()

    def march(self, repeat: int = 1, **keys: Any) -> tuple[dict[str, Array], float]:
        """Histories of `QUANTITIES` and CPU seconds of the stepping, with other keys of the time table."""
        time, rod, made = replace(self.scene.time, **keys), self.rod, []
        times = SPACING * np.arange(1, round(self.effort.horizon / SPACING) + 1)

        def prepare() -> None:
            rod.go_back(self.there)
            made.append(self.marcher(rod, self.start, None, time))

        def run() -> dict[str, Array]:
            stepper, rows = made[-1], []
            for until in times:
                while stepper.now < until * (1 - 1e-12):
                    stepper.step(until)
                torque = rod.top_torque(until)
                rod.set_state(stepper.u, rod.u_dot.x.array)
                wall = rod.wall_row()
                rows.append((stepper.u[rod.bit.spin], wall["wall_torque"], torque, wall["side_force"]))
            return dict(zip(QUANTITIES, np.array(rows).T, strict=True))

        try:
            cpu, found = cpu_seconds(run, repeat, prepare=prepare)
        finally:
            for stepper in made:
                stepper.destroy()
        return found, cpu

    def stands(self) -> Array:
        """Force (n,; N) of the laid string on each `STAND` of hole."""
        rod, contact = self.rod, self.scene.contact
        assert rod.wall is not None and contact is not None
        rod.set_state(self.start, 0 * self.start)
        force = rod.wall.side_force(self.start, contact) * rod.wall.weights
        return np.asarray(np.bincount((rod.wall.arc_length / STAND + 0.5).astype(int), force), np.float64)


def point(
    effort: Effort,
    series: str,
    size: float,
    reference: dict[str, Array],
    well: Well | dict[str, Any],
    default: bool = False,
    **keys: Any,
) -> Point:
    """A run with its errors. well: or what is changed for one of its own. keys: of the time table.

    A run that breaks down has an infinite error, and cost what it did until then.
    """
    settings = {**keys, **({} if isinstance(well, Well) else {k.replace("__", "."): v for k, v in well.items()})}
    began = process_time()
    try:
        well = Well(effort, time__engine="compiled", **well) if isinstance(well, dict) else well
        settings["engine"], began = well.scene.engine, process_time()
        rows, cpu = well.march(effort.repeat, **keys)
    except SimulationError as error:
        return Point(series, size, math.inf, {}, process_time() - began, {**settings, "failure": str(error)})
    errors = {name: relative_l2(rows[name], reference[name]) for name in QUANTITIES}
    return Point(series, size, max(errors[name] for name in QUANTITIES[:2]), errors, cpu, settings, default)


def chart(effort: Effort = FULL, progress: Tell = lambda _: None) -> Chart:
    """Compute the case. ``progress`` is told what is being computed."""
    makers = {"steps": _steps, "contact": _contact, "meshes": _meshes, "laid": _laid}
    normaliser, panels, facts = [normalise()], [], dict[str, Any]()
    for name, make in makers.items():
        if not effort.panels or name in effort.panels:
            panels.append(make(effort, facts, lambda text: progress(f"off-bottom: {text}")))
            normaliser.append(normalise())
    title = "The string of chapter 4 in well A, laid in it and turned, 100 rpm within 0.5 s"
    scene = f"{SCENE}, first {effort.horizon:g} s, mesh.quadrature = 'full'"
    return Chart("off-bottom", title, scene, panels, min(normaliser), effort.quick, facts)


def _steps(effort: Effort, facts: dict[str, Any], tell: Tell) -> Panel:
    """Integrator, engine and Newton strategy over the step."""
    tell("reference in time")
    compiled = Well(effort, time__engine="compiled")
    finest = effort.steps[-1] / FINER
    reference, _ = compiled.march(step=finest, **FINEST)
    twice, _ = compiled.march(step=2 * finest, **FINEST)
    facts["steps: reference against itself at twice its step"] = floor = max(
        relative_l2(twice[q], reference[q]) for q in QUANTITIES[:2]
    )
    petsc, given = Well(effort, time__engine="petsc"), load_scene(SCENE)
    usual = f"{'compiled' if given.engine == 'compiled' else 'PETSc'}, gen-alpha {given.time.rho_infinity:g}"

    def alpha(rho: float) -> dict[str, Any]:
        return {"integrator": "generalized-alpha", "rho_infinity": rho}

    full = {"jacobian": "every-iteration"}
    series: dict[str, tuple[Well, dict[str, Any], Sequence[float]]] = {
        "compiled, gen-alpha 0.9": (compiled, alpha(0.9), effort.steps),
        "compiled, gen-alpha 0.5": (compiled, alpha(0.5), effort.steps),
        "compiled, gen-alpha 0": (compiled, alpha(0.0), effort.steps),
        "compiled, trapezoidal rule": (compiled, {"integrator": "theta"}, effort.steps),
        "compiled, full Newton": (compiled, alpha(0.9) | full, effort.slow_steps),
        "PETSc, gen-alpha 0.9": (petsc, alpha(0.9), effort.slow_steps),
        "PETSc, full Newton": (petsc, alpha(0.9) | full, effort.dear_steps),
        "PETSc, BDF2": (petsc, {"integrator": "bdf", "order": 2}, effort.slow_steps),
        "PETSc, ARKIMEX 3": (petsc, {"integrator": "arkimex", "order": 3}, effort.dear_steps[:1]),
    }
    points = []
    for name, (well, keys, steps) in series.items():
        tell(name)
        for step in steps:
            default = name == usual and step == given.time.step
            points.append(point(effort, name, step, reference, well, default, step=step, **keys))
    cost = {(p.series, p.size): p.cpu for p in points}
    pairs = {
        "PETSc over compiled": ("PETSc, gen-alpha 0.9", "compiled, gen-alpha 0.9"),
        "full Newton over kept Jacobian, compiled": ("compiled, full Newton", "compiled, gen-alpha 0.9"),
        "full Newton over kept Jacobian, PETSc": ("PETSc, full Newton", "PETSc, gen-alpha 0.9"),
    }
    for name, (dear, cheap) in pairs.items():
        ratios = [cost[dear, h] / cost[cheap, h] for h in effort.slow_steps if (dear, h) in cost and (cheap, h) in cost]
        facts |= {f"steps: {name}, CPU, least": min(ratios), f"steps: {name}, CPU, most": max(ratios)}
    return Panel(
        "steps",
        "Integrator, engine and Newton strategy",
        "step",
        "s",
        WORST,
        f"compiled, gen-alpha 0.5, {1e3 * finest:.3g} ms",
        tuple(points),
        floor,
        note=f"{effort.elements} elements",
    )


def _contact(effort: Effort, facts: dict[str, Any], tell: Tell) -> Panel:
    """Contact method over the compliance of the wall, against the wall that does not give."""
    tell("the wall that does not give")
    given = load_scene(SCENE).contact
    assert given is not None
    rigid = {"contact__method": "augmented", "contact__penetration_tolerance": 1e-6}
    reference, _ = Well(effort, time__engine="compiled", **rigid, contact__stiffness=1e7).march()
    methods: dict[str, dict[str, Any]] = {
        "penalty": {},
        "penalty, closest point as a field": {"contact__closest_point": "field"},
        "smooth, 1 mm": {"contact__method": "smooth"},
        "augmented, 0.01 mm": {"contact__method": "augmented"},
    }
    points = []
    for name, keys in methods.items():
        tell(name)
        # the multipliers of a softer wall take many iterations, and gain nothing
        for stiffness in effort.stiffness if "augmented" not in name else effort.stiffness[-2:]:
            default = name == "penalty" and stiffness == given.stiffness
            changed = {**keys, "contact__stiffness": stiffness}
            points.append(point(effort, name, 1 / stiffness, reference, changed, default))
    return Panel(
        "contact",
        "Contact method and stiffness of the wall",
        "compliance",
        "m2/N",
        WORST,
        "augmented Lagrangian, 1e7 N/m2, 0.001 mm",
        tuple(points),
        note=f"{effort.elements} elements, {1e3 * STEP:g} ms",
    )


def _meshes(effort: Effort, facts: dict[str, Any], tell: Tell) -> Panel:
    """Degree, number of elements and integration of the string."""
    tell("reference of the meshes")
    finest, given = effort.meshes[-1], load_scene(SCENE)
    reference, _ = Well(effort, time__engine="compiled", mesh__elements=finest, mesh__degree=3).march()
    kinds = {"degree 2, full": (2, "full"), "degree 3, full": (3, "full"), "degree 3, reduced": (3, "reduced")}
    points = []
    for name, (degree, quadrature) in kinds.items():
        tell(f"elements of {name}")
        for elements in effort.meshes[:-1]:
            mesh = {"mesh__elements": elements, "mesh__degree": degree, "mesh__quadrature": quadrature}
            default = (elements, degree, quadrature) == (given.mesh.elements, given.mesh.degree, given.mesh.quadrature)
            points.append(point(effort, name, given.length / elements, reference, mesh, default))
    return Panel(
        "meshes",
        "Elements of the string",
        "element",
        "m",
        WORST,
        f"{finest} elements of degree 3, full",
        tuple(points),
        note=f"{1e3 * STEP:g} ms, compiled",
    )


def _laid(effort: Effort, facts: dict[str, Any], tell: Tell) -> Panel:
    """The start alone: the string laid in the well, its side force on every stand of the hole."""
    tell("the laid string")
    finest, given = effort.laid[-1], load_scene(SCENE)
    rigid = {"contact__method": "augmented", "contact__stiffness": 1e7, "contact__penetration_tolerance": 1e-6}
    reference = Well(effort, mesh__elements=finest, **rigid).stands()
    methods: dict[str, dict[str, Any]] = {f"penalty {k:.0e} N/m2": {"contact__stiffness": k} for k in effort.stiffness}
    methods["augmented, 0.01 mm"] = {"contact__method": "augmented"}
    points = []
    for name, keys in methods.items():
        tell(f"laid, {name}")
        for elements in effort.laid[:-1]:
            size, began = given.length / elements, process_time()
            try:
                well = Well(effort, mesh__elements=elements, **keys)
                cpu, _ = cpu_seconds(partial(lay, well.rod), 1)  # compiled and loaded by the first
                error = relative_l2(well.stands(), reference)
            except SimulationError as failure:
                points.append(
                    Point(name, size, math.inf, {}, process_time() - began, {**keys, "failure": str(failure)})
                )
                continue
            default = name == "penalty 1e+06 N/m2" and elements == given.mesh.elements
            points.append(Point(name, size, error, {"side force": error}, cpu, keys, default))
    return Panel(
        "laid",
        "The string laid in the well, before anything turns",
        "element",
        "m",
        f"{LAID} on every {STAND:g} m",
        f"augmented Lagrangian, 0.001 mm, {finest} elements",
        tuple(points),
    )
