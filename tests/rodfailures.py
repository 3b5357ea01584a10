"""Where methods fail on a rod: small experiments that tests/stability checks and benchmarks/failure_atlas.py draws."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import Any
from unittest.mock import patch

import numpy as np
from bitlab import C1
from petsc4py import PETSc
from rodlab import Array, bar, dynamic, equilibrium, put, stepped, take

from drillfem.bitrock import BitLaw, solve
from drillfem.bitrock.law import law_forces
from drillfem.errors import SimulationError
from drillfem.forms.ansatz import ansatz
from drillfem.models.initial import initial_state
from drillfem.models.modes import natural_frequencies
from drillfem.models.rod import Rod
from drillfem.scene import Scene, load_scene
from drillfem.solve.dynamics import march


# -- integrators on undamped waves ----------------------------------------------------------------------------------
@cache
def shaft() -> tuple[Rod, float, Array]:
    """An undamped shaft, held at the top: its first angular frequency (rad/s) and shape, exact for its mesh."""
    rod = Rod(bar(1.0, torsion=1.0, inertia=0.5, model="torsional", mesh={"elements": 4}, time=dynamic(1e3, 0.1)))
    mode = natural_frequencies(rod, 1)["torsional"]
    shape = mode.shape[0, :, rod.ansatz.v_names.index("w3")]
    return rod, 2 * math.pi * mode.frequency[0], shape / shape[-1]


def swing(turn: float, steps: int, **integrator: Any) -> Array:
    """Amplitude (steps + 1,) of the shaft's first mode, 1 at the start; ``turn`` = omega h is its phase per step."""
    rod, omega, shape = shaft()
    rows: list[float] = []

    def observe(t: float, u: Array) -> None:
        rows.append(math.hypot(take(rod, u, "phi")[-1], take(rod, u, "w3")[-1] / omega))

    h = turn / omega
    march(rod, put(rod, phi=shape), steps * h, stepped(rod.scene, h, **integrator), observe)
    return np.array(rows)


def growth(turn: float, steps: int = 40, skip: int = 10, **integrator: Any) -> float:
    """Amplitude after a step over that before, once the start-up is over."""
    size = swing(turn, steps, **integrator)
    return float((size[-1] / size[skip]) ** (1 / (steps - skip)))


def pulse(**integrator: Any) -> tuple[Array, Array]:
    """Arc length (n,) and spin (n,) of a torsional pulse on 1000 m of drill pipe, after 4 s of running up and down."""
    data = load_scene("vertical-c1-cd4").to_dict()
    section = data["string"][0]
    scene = Scene.from_dict(
        bar().to_dict()
        | {
            "string": [section],
            "material": data["material"] | {"retardation_time": 0.0},
            "ends": {"top": "free", "bottom": "free"},
            "time": dynamic(4.0, 1e-3, **integrator),
            "mesh": {"elements": 32},
            "model": "torsional",
        }
    )
    rod = Rod(scene)
    s, width, centre = rod.arc_length, 60.0, 500.0
    speed = math.sqrt(data["material"]["shear_modulus"] / data["material"]["density"])
    area = np.array([math.sqrt(math.pi) / 2 * width * math.erf((x - centre) / width) for x in s])
    u0 = put(rod, w3=np.exp(-(((s - centre) / width) ** 2)), phi=-area / speed)
    # whole round trips: the pulse is back where it was
    trips = round(4.0 * speed / 2000.0)
    u = march(rod, u0, trips * 2000.0 / speed)
    return s, take(rod, u, "w3")


# -- locking ----------------------------------------------------------------------------------------------------------
def bending_ratio(size: float, degree: int = 1, quadrature: str = "full", elements: int = 8) -> float:
    """Exact over computed deflection of a cantilever of drill pipe: ``elements`` of ``size`` (m), small end moment."""
    scene = pipe_cantilever(size, degree, quadrature, elements)
    rod = Rod(scene)
    equilibrium(rod)
    moment, length = scene.ends.tip_moment[1], scene.length
    exact = moment * length**2 / (2 * scene.string[0].section_stiffness().bending1)
    return float(exact / take(rod, rod.u.x.array, "r1")[-1])


def pipe_cantilever(size: float, degree: int, quadrature: str, elements: int = 8) -> Scene:
    """The thesis' drill pipe, clamped at the top and bent a little by a moment at the tip; weightless."""
    data = load_scene("vertical-c1-cd4").to_dict()
    length = elements * size
    stiffness = 1.2792e6
    return Scene.from_dict(
        {
            "string": [data["string"][0] | {"length": length}],
            "material": data["material"] | {"shear_correction": 0.53},
            "model": "planar",
            "gravity": {"magnitude": 0},
            "initial": {"state": "rest"},
            "ends": {"top": "clamped", "bottom": "free", "tip_moment": [0, 1e-4 * stiffness / length, 0]},
            "time": {"analysis": "static", "load_steps": 1},
            "mesh": {"elements": elements, "degree": degree, "quadrature": quadrature},
        }
    )


# -- quaternions ------------------------------------------------------------------------------------------------------
def spinning(step: float, steps: int, correction: float, speed: float = 100 * math.pi / 30, **integrator: Any) -> Array:
    """|q|^2 (steps + 1,) at the tip of a rod that spins about its axis, with q-dot = ... + correction (1 - q.q) q."""
    scene = spinning_scene(step, steps, speed, **integrator)
    with patch("drillfem.models.rod.ansatz", lambda *a, **k: replace(ansatz(*a, **k), correction=correction)):
        rod = Rod(scene)
    rows: list[float] = []

    def observe(t: float, u: Array) -> None:
        q = take(rod, u, "q_a", "q_b", "q_c", "q_d")[-1]
        rows.append(float(q @ q))

    march(rod, initial_state(rod), steps * step, observe=observe)
    return np.array(rows)


def spinning_scene(step: float, steps: int, speed: float = 100 * math.pi / 30, **integrator: Any) -> Scene:
    """A short free rod that spins about its axis (rad/s) and does nothing else."""
    return bar(
        1.0,
        inertia=0.05,
        ends={"top": "free", "bottom": "free"},
        initial={"state": "given", "angular_velocity": [0, 0, speed]},
        model="spatial",
        mesh={"elements": 1, "degree": 2},
        time=dynamic(step * steps, step, **integrator),
    )


# -- Newton's method at the bit ---------------------------------------------------------------------------------------
#: What the end of the thesis' string yields in a step: force over its impedance (m/s per N, rad/s per N m).
STEP = 1e-3
SOFT_AXIAL, SOFT_SPIN = 1 / (7800 * 5189 * 1.577846e-2), 1 / (7800 * 3141.94 * 5.19935e-5)
LAW = BitLaw(**C1)


def bit_states(count: int, seed: int = 0) -> Array:
    """Random states of a cutting bit (count, 5): free axial speed, free spin, gap under the bit, axial speed, spin."""
    low, high = np.array([-0.02, -2, 1e-4, -0.03, 0.5]), np.array([0.12, 40, 4e-4, 0.03, 30])
    return low + (high - low) * np.random.default_rng(seed).random((count, 5))


def bit_residual(x: Array, state: Array) -> Array:
    """What is missing at the end of the step (2,; m/s, rad/s): speeds less free speeds plus compliance times load."""
    v, w = x
    v_free, w_free, gap = state[:3]
    edge = gap - STEP / 2 * (v_free - v)
    weight, torque = law_forces(LAW.array, v, w, 6 * max(edge, 0.0), float(edge >= 0))[:2]
    return np.array([v - v_free + SOFT_AXIAL * weight, w - w_free + SOFT_SPIN * torque])


def bit_tangent(x: Array, state: Array) -> Array:
    """Jacobian (2, 2) of `bit_residual`, by differences far below the widths of the law's ramps."""
    steps = np.diag([1e-10, 1e-8])
    columns = [(bit_residual(x + d, state) - bit_residual(x - d, state)) / (2 * d.sum()) for d in steps]
    return np.stack(columns, axis=1)


def newton_path(state: Array, iterations: int = 12) -> Array:
    """Iterates (iterations + 1, 2) of plain Newton from the previous state of the bit."""
    path = [state[3:].copy()]
    for _ in range(iterations):
        path.append(path[-1] - np.linalg.solve(bit_tangent(path[-1], state), bit_residual(path[-1], state)))
    return np.array(path)


def snes_iterations(states: Array, line_search: str, most: int = 50) -> Array:
    """Iterations (n,) that PETSc's Newton needs for each state; 0 where it has not converged after ``most``."""
    units = np.array([1.0, 1e-3])  # a spin of 1 rad/s weighs as much as 1 mm/s
    prefix, options = f"rodfailures_{line_search}_", PETSc.Options()
    options[prefix + "snes_linesearch_type"] = line_search
    snes = PETSc.SNES().create(PETSc.COMM_SELF)
    snes.setOptionsPrefix(prefix)
    f, matrix = PETSc.Vec().createSeq(2), PETSc.Mat().createDense((2, 2), comm=PETSc.COMM_SELF)
    matrix.setUp()
    now = states[0]

    def function(_: Any, x: Any, out: Any) -> None:
        out.setArray(units * bit_residual(x.getArray(readonly=1), now))

    def jacobian(_: Any, x: Any, A: Any, B: Any) -> None:
        B.setValues([0, 1], [0, 1], (units[:, None] * bit_tangent(x.getArray(readonly=1), now)).ravel())
        B.assemble()

    snes.setFunction(function, f)
    snes.setJacobian(jacobian, matrix, matrix)
    snes.setTolerances(rtol=0, atol=1e-10, stol=0, max_it=most)
    snes.getKSP().setType("preonly")
    snes.getKSP().getPC().setType("lu")
    snes.setFromOptions()
    options.delValue(prefix + "snes_linesearch_type")
    x, taken = PETSc.Vec().createSeq(2), []
    for state in states:
        now = state
        x.setArray(state[3:])
        snes.solve(None, x)
        taken.append(snes.getIterationNumber() if snes.getConvergedReason() > 0 else 0)
    for item in (snes, f, matrix, x):
        item.destroy()
    return np.array(taken)


def bracketed(states: Array) -> tuple[Array, Array]:
    """The product's solver on the same states: evaluations of the law (n,), end speeds (n, 2)."""
    count, found = [], []
    at_spin = solve._at_spin
    calls = 0

    def counting(*args: Any) -> Any:
        nonlocal calls
        calls += 1
        return at_spin(*args)

    with patch.object(solve, "_at_spin", counting):
        for v_free, w_free, gap, _, w in states:
            calls = 0
            height = np.full((2, 1), -gap)
            rock = (np.zeros(2), height, 0 * height)
            string = (v_free, SOFT_AXIAL, 0.0, SOFT_AXIAL * STEP / 2, w_free, SOFT_SPIN, 1.0, STEP / 2)
            end = solve.solve_bit.py_func(LAW.array, np.array([6.0]), *string, *rock, w, np.empty(1))
            count.append(calls)
            found.append(end[6:])
    return np.array(count), np.array(found)


# -- the trapezoidal rule in large rotation ---------------------------------------------------------------------------
def spin_up(integrator: str, step: float = 0.02, end: float = 15.0) -> tuple[Array, str]:
    """Rows (t, lag of the tip behind the drive in m, energy in J) of the spin-up (B.1.2), and how it broke down."""
    keys = {"time.end": end, "mesh.elements": 4, "time.integrator": integrator}
    scene = load_scene("spin-up", keys | {"time.step": step, "output.interval": step})
    rod = Rod(scene)
    rows: list[tuple[float, float, float]] = []

    def observe(t: float, u: Array) -> None:
        angle = scene.top_drive.motion(t)[0]
        x, z = (take(rod, u, name)[-1] for name in ("r1", "r3"))
        rod.set_state(u, 0 * u)
        rows.append((t, math.cos(angle) * x - math.sin(angle) * z, sum(rod.energies())))

    try:
        march(rod, initial_state(rod), end, observe=observe)
    except SimulationError as error:
        return np.array(rows), str(error)
    return np.array(rows), ""
