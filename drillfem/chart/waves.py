"""Case ``waves``: a torsional pulse in the thesis' string of pipe and collars, against its exact solution."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from ..bitrock.jit import kernel
from ..compat import Array
from ..errors import SimulationError
from ..models.modes import linearise
from ..models.rod import Rod
from ..scene import Scene, load_scene
from ..solve.dynamics import Stepper
from .exact import ExactWave, Pulse
from .points import Chart, Level, Panel, Point, cpu_seconds, normalise, relative_l2

log = logging.getLogger("drillfem")

SCENE = "vertical-c1-cd4"
#: Where the pulse starts, and its half width (m): clear of both ends of the pipes.
PULSE = Pulse(500.0, 80.0)
#: The pulse meets joint, bit and top several times; both fields are compared at so many times.
HORIZON, SAMPLES = 1.0, 40
QUANTITY = "relative L2 error of the spin over length and time"
#: What the program takes for a rod without rock when it is not told otherwise.
DEFAULT, DEFAULT_STEP = "generalised-alpha, 0.9", HORIZON / SAMPLES / 25
#: Series of PETSc TS: (name, time table, coarsest and finest division of the sampling interval as powers of two).
INTEGRATORS: tuple[tuple[str, dict[str, Any], int, int], ...] = (
    ("generalised-alpha, 0.9", {"integrator": "generalized-alpha", "rho_infinity": 0.9}, 2, 8),
    ("generalised-alpha, 0.6", {"integrator": "generalized-alpha", "rho_infinity": 0.6}, 2, 8),
    ("theta, trapezoidal", {"integrator": "theta", "theta": 0.5}, 2, 8),
    ("theta, backward Euler", {"integrator": "theta", "theta": 1.0}, 4, 10),
    ("BDF, order 2", {"integrator": "bdf", "order": 2}, 3, 8),
    ("BDF, order 3", {"integrator": "bdf", "order": 3}, 3, 8),
    ("BDF, order 4", {"integrator": "bdf", "order": 4}, 3, 8),
    ("ARKIMEX, order 3", {"integrator": "arkimex", "order": 3}, 1, 6),
    ("ARKIMEX, order 4", {"integrator": "arkimex", "order": 4}, 1, 6),
)


@dataclass(frozen=True)
class Effort:
    """How much is computed: (elements, degree) for the integrators, meshes by degree, series, refinements, repeats."""

    mesh: tuple[int, int] = (96, 4)
    elements: tuple[int, ...] = (8, 16, 32, 64, 128, 256)
    most_nodes: int = 600
    series: tuple[str, ...] = ()
    coarser: int = 0
    repeat: int = 3


FULL = Effort()
QUICK = Effort(mesh=(48, 4), most_nodes=200, coarser=3, repeat=1)


def wave_scene(elements: int, degree: int, name: str = SCENE) -> Scene:
    """The string of a built-in scene, undamped, held at the top and free at the bottom, for the torsional model."""
    given = load_scene(name).to_dict()
    data = {
        "string": given["string"],
        "material": {**given["material"], "retardation_time": 0.0},
        "model": "torsional",
        "gravity": {"magnitude": 0.0},
        "initial": {"state": "rest"},
        "ends": {"top": "clamped", "bottom": "free"},
        "mesh": {"elements": elements, "degree": degree},
        "time": {"end": HORIZON, "step": HORIZON / SAMPLES},
    }
    for section in data["string"]:
        if "material" in section:
            section["material"] = {**section["material"], "retardation_time": 0.0}
    return Scene.from_dict(data)


def exact_wave(scene: Scene, pulse: Pulse = PULSE) -> ExactWave:
    """The exact torsional wave of a scene's two sections."""
    first, second = scene.string
    stiffness = [s.section_stiffness().torsion for s in (first, second)]
    speeds = [math.sqrt(k / (2 * s.rotary_inertia)) for k, s in zip(stiffness, (first, second), strict=True)]
    return ExactWave(
        (first.length, second.length),
        (speeds[0], speeds[1]),
        (stiffness[0] / speeds[0], stiffness[1] / speeds[1]),
        pulse,
    )


class Problem:
    """The pulse on one mesh: rod, matrices, start, and errors of the fields at the sampling times."""

    def __init__(self, elements: int, degree: int) -> None:
        self.scene = wave_scene(elements, degree)
        self.rod = Rod(self.scene)
        self.exact = exact_wave(self.scene)
        self.times = HORIZON / SAMPLES * np.arange(1, SAMPLES + 1)
        self.elements, self.degree = elements, degree
        angle, spin = self.exact.start(self.rod.arc_length)
        u = np.zeros((len(self.rod.nodes), 2))
        u[self.rod.nodes] = np.stack([angle, spin], axis=1)
        self.start: Array = u.reshape(-1)

    @cached_property
    def _points(self) -> tuple[Array, Array, Array, Array]:
        """Gauss points (m,), roots of their weights (m,), and the maps of nodal values to values and slopes there."""
        p, s = self.degree, self.rod.arc_length
        cells = np.arange(self.elements)[:, None] * p + np.arange(p + 1)
        x, w = np.polynomial.legendre.leggauss(p + 3)
        local = np.polynomial.legendre.legvander(2 * (s[cells[0]] - s[0]) / (s[p] - s[0]) - 1, p)
        value = np.polynomial.legendre.legvander(x, p) @ np.linalg.inv(local)
        rise = np.polynomial.legendre.legval(x, np.polynomial.legendre.legder(np.eye(p + 1))).T @ np.linalg.inv(local)
        size = s[cells[:, -1]] - s[cells[:, 0]]
        points = s[cells[:, 0], None] + size[:, None] * (x + 1) / 2
        values, slopes = np.zeros((2, points.size, len(s)))
        for k, cell in enumerate(cells):
            rows = slice(k * len(x), (k + 1) * len(x))
            values[rows, cell], slopes[rows, cell] = value, rise * 2 / size[k]
        return points.reshape(-1), np.sqrt(size[:, None] * w / 2).reshape(-1), values, slopes

    @cached_property
    def _exact_fields(self) -> tuple[Array, Array]:
        s, root, _, _ = self._points
        spin = np.array([root * self.exact.speed(s, t) for t in self.times])
        torque = np.array([root * self.exact.resultant(s, t) for t in self.times])
        return spin, torque

    def errors(self, angle: Array, spin: Array) -> dict[str, float]:
        """Relative L2 errors in space and time of spin and torque; nodal fields (samples, nodes), from the top down."""
        s, root, values, slopes = self._points
        first, second = (x.section_stiffness().torsion for x in self.scene.string)
        stiffness = np.where(s <= self.exact.lengths[0], first, second)
        with np.errstate(all="ignore"):
            found = root * (spin @ values.T), root * stiffness * (angle @ slopes.T)
        names = ("spin", "torque")
        return {n: relative_l2(f, e) for n, f, e in zip(names, found, self._exact_fields, strict=True)}

    # -- PETSc TS on the weak form -------------------------------------------------------------------------------------
    def petsc(self, step: float, keys: dict[str, Any], repeat: int) -> tuple[dict[str, float], float]:
        """Errors and CPU seconds of an integrator of PETSc TS with this step; infinite errors if it breaks down."""
        time = replace(self.scene.time, step=step, **keys)
        made: list[Stepper] = []

        def prepare() -> None:
            made.append(Stepper(self.rod, self.start, None, time))

        def run() -> Array | None:
            stepper, rows = made[-1], []
            try:
                for t in self.times:
                    while stepper.ts.getTime() < t * (1 - 1e-12):
                        stepper.step(t)
                    rows.append(stepper.u.copy())
            except SimulationError:
                return None
            return np.array(rows).reshape(len(rows), -1, 2)[:, self.rod.nodes]

        cpu, fields = cpu_seconds(run, repeat, prepare=prepare)
        for stepper in made:
            stepper.destroy()
        if fields is None:
            return {"spin": math.inf, "torque": math.inf}, cpu
        return self.errors(fields[..., 0], fields[..., 1]), cpu

    # -- the same matrices in modal coordinates ------------------------------------------------------------------------
    @cached_property
    def _modes(self) -> tuple[Array, Array, Array, NDArray[np.int64]]:
        """Squares of the frequencies (n,), shapes (free nodes, n), their inverse, free nodes from the top down."""
        stiffness, _, mass = linearise(self.rod, self.start)
        free = self.rod.nodes[1:]
        k, m = stiffness.toarray()[np.ix_(free, free)], mass.toarray()[np.ix_(free, free)]
        square, shapes = eigh((k + k.T) / 2, (m + m.T) / 2)
        return square, shapes, shapes.T @ m, free

    @property
    def explicit_limit(self) -> float:
        """Largest step (s) of central differences on this mesh: 2 over its fastest angular frequency."""
        return 2 / math.sqrt(self._modes[0][-1])

    def modal(self, step: float, method: str, repeat: int) -> tuple[dict[str, float], float]:
        """Errors and CPU seconds in modal coordinates: ``exact``, ``trapezoidal`` or ``explicit``."""
        square, shapes, inverse, free = self._modes
        start = self.start.reshape(-1, 2)[free]
        x0, v0 = inverse @ start[:, 0], inverse @ start[:, 1]
        table = step_matrices(square, step, method)
        every = round(HORIZON / SAMPLES / step)

        def run() -> tuple[Array, Array]:
            return _march(table, x0, v0, every, SAMPLES)

        cpu, (x, v) = cpu_seconds(run, repeat)
        zero = np.zeros((SAMPLES, 1))
        with np.errstate(all="ignore"):
            fields = (np.hstack([zero, modes @ shapes.T]) for modes in (x, v))
            return self.errors(*fields), cpu


def step_matrices(square: Array, step: float, method: str) -> Array:
    """One step of x'' = -omega^2 x for every mode, (x, v) -> (e0 x + e1 v, e2 x + e3 v): (4, n).

    ``exact``; ``trapezoidal`` (the rule applied to the assembled matrices does this to each mode);
    ``explicit``: central differences, stable while omega step < 2.
    """
    omega = np.sqrt(square)
    if method == "exact":
        c, s = np.cos(omega * step), np.sin(omega * step)
        return np.stack([c, s / omega, -s * omega, c])
    q = square * step**2 / 4
    if method == "trapezoidal":
        return np.stack([1 - q, np.full_like(q, step), -square * step, 1 - q]) / (1 + q)
    return np.stack([1 - 2 * q, np.full_like(q, step), -square * step * (1 - q), 1 - 2 * q])


@kernel("reassoc", "contract", "nsz")
def _march(table: Array, x0: Array, v0: Array, every: int, samples: int) -> tuple[Array, Array]:
    n = x0.size
    x, v = x0.copy(), v0.copy()
    xs, vs = np.empty((samples, n)), np.empty((samples, n))
    e0, e1, e2, e3 = table[0], table[1], table[2], table[3]
    for k in range(samples):
        for _ in range(every):
            for j in range(n):
                x[j], v[j] = e0[j] * x[j] + e1[j] * v[j], e2[j] * x[j] + e3[j] * v[j]
        xs[k], vs[k] = x, v
    return xs, vs


def chart(effort: Effort = FULL, progress: Callable[[str], None] = lambda _: None) -> Chart:
    """Compute the case. ``progress`` is told what is being computed."""
    normaliser = [normalise()]
    problem = Problem(*effort.mesh)
    Problem(8, 1).petsc(HORIZON / SAMPLES, {}, 1)  # compiles and loads
    problem.modal(HORIZON / SAMPLES, "exact", 1)
    panels = [_integrators(problem, effort, progress)]
    normaliser.append(normalise())
    panels += [_modes(problem, effort, progress), _meshes(effort, progress)]
    exact = problem.exact
    facts = {
        "torque reflected at the joint": -exact.reflection,
        "torque transmitted at the joint": exact.resultant_transmission,
        "wave speed (m/s)": exact.wave_speeds[0],
        "explicit limit of the step (s)": problem.explicit_limit,
    }
    title = "A torsional pulse in pipe and collars, held at the top, free at the bottom"
    scene = f"string of {SCENE} without rock and damping, {HORIZON:g} s"
    return Chart("waves", title, scene, panels, min(*normaliser, normalise()), effort is not FULL, facts)


def _integrators(problem: Problem, effort: Effort, progress: Callable[[str], None]) -> Panel:
    """Integrators of PETSc TS on the weak form, over the step."""
    interval, points = HORIZON / SAMPLES, []
    for series, keys, coarse, fine in INTEGRATORS:
        if effort.series and series not in effort.series:
            continue
        progress(f"waves: {series}")
        divisions = {2**k for k in range(coarse, fine + 1 - effort.coarser)}
        divisions |= {round(interval / DEFAULT_STEP)} if series == DEFAULT else set()
        for n in sorted(divisions):
            step = interval / n
            errors, cpu = problem.petsc(step, keys, effort.repeat)
            default = series == DEFAULT and math.isclose(step, DEFAULT_STEP)
            points.append(Point(series, step, errors["spin"], errors, cpu, {"step": step, **keys}, default))
    return _over_steps("integrators", "Integrator and step, PETSc TS on the weak form", problem, effort, points)


def _modes(problem: Problem, effort: Effort, progress: Callable[[str], None]) -> Panel:
    """The same matrices in modal coordinates, over the step."""
    progress("waves: modal coordinates")
    points = []
    for method in ("exact", "trapezoidal", "explicit"):
        for n in (2**k for k in range(2, 11 - effort.coarser)):
            step = HORIZON / SAMPLES / n
            errors, cpu = problem.modal(step, method, 2 * effort.repeat)
            points.append(Point(f"{method} modes", step, errors["spin"], errors, cpu, {"step": step}))
    return _over_steps("modes", "Integrator and step, the same matrices in modal coordinates", problem, effort, points)


def _over_steps(name: str, title: str, problem: Problem, effort: Effort, points: list[Point]) -> Panel:
    """A panel of integrators; what the mesh leaves is drawn as a level."""
    elements, degree = effort.mesh
    errors, _ = problem.modal(HORIZON / SAMPLES, "exact", 1)
    level = Level(f"{elements} elements of degree {degree}", errors["spin"])
    return Panel(name, title, "step", "s", QUANTITY, "exact travelling wave", tuple(points), errors["spin"], (level,))


def _meshes(effort: Effort, progress: Callable[[str], None]) -> Panel:
    points = []
    for degree in (1, 2, 3, 4):
        progress(f"waves: elements of degree {degree}")
        for elements in effort.elements:
            if elements * degree > effort.most_nodes:
                continue
            problem = Problem(elements, degree)
            errors, cpu = problem.modal(DEFAULT_STEP, "exact", 2 * effort.repeat)
            settings = {"elements": elements, "degree": degree, "dofs": problem.rod.size, "step": DEFAULT_STEP}
            mesh = problem.scene.mesh
            default = (elements, degree) == (type(mesh)().elements, type(mesh)().degree)
            size = problem.scene.length / elements
            points.append(Point(f"degree {degree}", size, errors["spin"], errors, cpu, settings, default))
    return Panel(
        "meshes",
        "Degree and number of elements",
        "element",
        "m",
        QUANTITY,
        "exact travelling wave",
        tuple(points),
        note=f"modal coordinates, exact in time, steps of {1e3 * DEFAULT_STEP:g} ms",
    )
