"""The compiled engine against DOLFINx and PETSc: assembled numbers, linear algebra, single steps, failures."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import ufl
from rodlab import Array, bar, dynamic, put, wave

import drillfem
from drillfem.compat import ScalarForm, VectorForm
from drillfem.errors import SceneError, SimulationError
from drillfem.forms import virtual_work as vw
from drillfem.models.initial import initial_state
from drillfem.models.rod import Rod
from drillfem.scene import Scene, Time
from drillfem.solve import native
from drillfem.solve.compiled import CompiledStepper
from drillfem.solve.dynamics import Marcher, Stepper
from drillfem.solve.lanes import kernel_names, with_lanes
from drillfem.solve.native import NativeScalar, NativeSolver, NativeVector
from drillfem.solve.newton import Outcome

WALL = {
    "hole": {"kind": "straight", "diameter": 0.3},
    "contact": {"stiffness": 1e3, "friction_static": 0.3, "friction_dynamic": 0.2},
}


def scene(model: str, degree: int, elements: int, **keys: Any) -> Scene:
    """A damped bar that is loaded as its model allows."""
    across, along = model in ("planar", "spatial"), model != "torsional"
    section = {
        "name": "bar",
        "length": 1.0,
        "outer_diameter": 0.1,
        "stiffness": {"axial": 1e4, "shear": 1e4, "bending": 1e2, "torsion": 1e2},
        "mass_per_length": 1.0,
        "rotary_inertia": 1e-3,
        "retardation_time": 0.1,
    }
    tables: dict[str, Any] = {
        "string": [section],
        "ends": {
            "top": "clamped",
            "bottom": "free",
            "tip_force": [0, 0, 2.0 * along],
            "tip_moment": [0, 2.0 * across, 0],
        },
        "mesh": {"elements": elements, "degree": degree},
        "time": dynamic(1.0, 0.01),
        "gravity": {"magnitude": 9.81 * along, "direction": [1, 0, 0] if across else [0, 0, 1]},
    }
    return bar(model=model, **(tables | keys))


def shaken(rod: Rod, size: float = 0.2, seed: int = 5) -> tuple[Array, Array]:
    """A smooth state and its rate, nowhere at rest."""
    rng = np.random.default_rng(seed)
    names = rod.ansatz.x_names + rod.ansatz.v_names
    u = put(rod) + put(rod, np.zeros(rod.size), **{n: wave(rng, rod.length, size) for n in names})
    u_dot = put(rod, np.zeros(rod.size), **{n: wave(rng, rod.length, 1.0) for n in names})
    return u, u_dot


# -- what is assembled ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("lanes", [True, False])
@pytest.mark.parametrize(
    ("model", "degree", "tables"),
    [("spatial", 3, WALL), ("planar", 1, {}), ("axial-torsional", 3, {}), ("torsional", 2, {})],
)
def test_loops_assemble_what_dolfinx_assembles(
    model: str, degree: int, tables: dict[str, Any], lanes: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not lanes:
        monkeypatch.setattr(native, "_kernels_with_lanes", lambda *_: ([], None))
    rod = Rod(scene(model, degree, elements=11, **tables))  # neither fewer nor a multiple of what lanes take
    rod.set_state(*shaken(rod))
    whole = vw.total(rod.terms)
    form = NativeVector(whole, rod)
    assert form.c.n_lanes == (0 if not lanes else 1 if degree > 1 else 3)
    expected = VectorForm(whole)(np.zeros(rod.size))
    size = np.abs(expected).max()
    np.testing.assert_allclose(form(np.full(rod.size, 7.0)), expected, atol=1e-11 * size)
    # a coefficient that changes, and a constant
    rod.set_state(*shaken(rod, seed=6))
    rod.loads.g.value *= 2
    again = VectorForm(whole)(np.zeros(rod.size))
    assert np.abs(again - expected).max() > 0.01 * size
    np.testing.assert_allclose(form(np.zeros(rod.size)), again, atol=1e-11 * np.abs(again).max())
    ends = form.at_ends(np.zeros(rod.size))
    np.testing.assert_allclose(ends[rod.constrained], again[rod.constrained], atol=1e-11 * size)
    for functional in (
        vw.kinetic_energy(rod.ansatz, rod.u, rod.s, rod.section, rod.loads, rod.on),
        vw.powers(rod.ansatz, rod.u, rod.u_dot, rod.s, rod.section, rod.loads, rod.on)["damping"],
    ):
        assert NativeScalar(functional, rod)() == pytest.approx(ScalarForm(functional)(), rel=1e-11)


def test_kernels_that_are_not_understood_are_called_one_by_one() -> None:
    rod = Rod(scene("torsional", 2, 3))
    form = NativeVector(vw.total(rod.terms), rod)
    code = native.source_of(form.form).read_text()
    names = kernel_names(code)
    assert with_lanes(code, names[:1]).count("vec *restrict A") == 1
    body = code.index("{", code.index(f"void {names[0]}(")) + 1
    for line in ("while (1);", "double a = erf(J_c0);", "double b = c[0] > 0 && c[1] > 0 ? 1 : 2;"):
        with pytest.raises(ValueError, match="unknown"):
            with_lanes(f"{code[:body]}\n{line}\n{code[body:]}", names[:1])
    with pytest.raises(ValueError, match="no kernel"):
        with_lanes(code, ["tabulate_tensor_nothing"])


def test_the_library_is_compiled_once(monkeypatch: pytest.MonkeyPatch) -> None:
    first = native.library()
    native.library.cache_clear()
    monkeypatch.setattr(native.cffi.FFI, "compile", lambda *_, **__: pytest.fail("compiled again"))
    assert native.library().__file__ == first.__file__


# -- linear algebra -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("model", "degree"), [("spatial", 3), ("planar", 1), ("planar", 3), ("planar", 4), ("axial-torsional", 3)]
)
def test_solver_inverts_the_jacobian(model: str, degree: int) -> None:
    rod = Rod(scene(model, degree, elements=9))
    u, u_dot = shaken(rod, 0.05)
    shift = 173.0
    matrix = rod.create_matrix()
    rod.jacobian(u, u_dot, shift, matrix)
    dense = matrix.convert("dense").getDenseArray()
    solver = NativeSolver(rod.tangent, rod)
    solver.factorise()
    x = np.random.default_rng(1).standard_normal(rod.size)
    found = solver.solve(dense @ x).copy()
    reference = np.linalg.solve(dense, dense @ x)
    error = np.abs(reference - x).max()
    assert np.abs(found - x).max() < max(1e-9, 100 * error)
    # the unit rows
    b = np.zeros(rod.size)
    b[rod.constrained] = 1.0
    np.testing.assert_allclose(solver.solve(b)[rod.constrained], 1.0, rtol=1e-12)
    matrix.destroy()


def test_solver_refuses_what_it_cannot_eliminate() -> None:
    rod = Rod(scene("planar", 3, 3))
    inner = int(rod.nodes[1]) * rod.ansatz.size + 3
    held, rod.constrained = rod.constrained, np.array([inner], dtype=np.int32)
    with pytest.raises(ValueError, match="at the ends only"):
        NativeSolver(rod.tangent, rod)
    rod.constrained = held
    # kinematics that are not collocated at the nodes
    test, trial = ufl.TestFunction(rod.V), ufl.TrialFunction(rod.V)
    solver = NativeSolver(ufl.inner(trial, test) * rod.on.mass, rod)
    with pytest.raises(ValueError, match="beyond their nodes"):
        solver.factorise()


def test_a_singular_jacobian_gives_no_numbers() -> None:
    rod = Rod(scene("planar", 3, 3))
    solver = NativeSolver(0.0 * rod.tangent, rod)
    solver.factorise()
    assert not np.isfinite(solver.solve(np.ones(rod.size))).all()


# -- steps ----------------------------------------------------------------------------------------------------------


def pair(of: Scene, time: Time | None = None) -> tuple[Stepper, CompiledStepper]:
    """The same rod with both engines."""
    made: list[Any] = []
    for engine in (Stepper, CompiledStepper):
        rod = Rod(of)
        engine.adopt(rod)
        made.append(engine(rod, initial_state(rod), None, time))
    return made[0], made[1]


def apart(one: Marcher, other: Marcher, of: str) -> float:
    """Largest difference of the components whose names begin like this."""
    a = one.rod.ansatz
    columns = [i for i, name in enumerate(a.x_names + a.v_names) if name[0] in of]
    return float(np.abs((one.u - other.u).reshape(-1, a.size)[:, columns]).max())


@pytest.mark.parametrize(
    "keys",
    [
        {"integrator": "theta"},
        {"integrator": "theta", "theta": 1.0},
        {"integrator": "theta", "theta": 0.7, "jacobian": "every-iteration"},
        {"integrator": "generalized-alpha"},
        {"integrator": "generalized-alpha", "rho_infinity": 0.5},
    ],
)
@pytest.mark.parametrize("model", ["planar", "spatial"])
def test_steps_are_those_of_petsc(model: str, keys: dict[str, Any]) -> None:
    of = drillfem.load_scene("pendulum", {"model": model, "mesh.elements": 6})
    petsc, compiled = pair(of, replace(of.time, step=2e-3, **keys))
    for k in range(25):
        until = 0.0211 if k < 11 else 1.0  # a step of another length on the way
        done, same = petsc.step(until), compiled.step(until)
        assert (same.time, same.step, same.stage_time) == pytest.approx((done.time, done.step, done.stage_time))
        assert apart(petsc, compiled, "rqt") < 1e-10
        assert apart(petsc, compiled, "vw") < 1e-10 * 2 / done.step
    assert np.abs(petsc.u).max() > 1  # it has moved: v is m/s of a 1 m cord
    assert petsc.newton.iterations == compiled.newton.iterations
    assert petsc.newton.factorisations == compiled.newton.factorisations
    np.testing.assert_allclose(compiled.rod.reaction, petsc.rod.reaction, atol=1e-8)
    assert compiled.rod.energies() == pytest.approx(petsc.rod.energies(), rel=1e-9)
    petsc.destroy()
    compiled.destroy()


def fails(times: int) -> Callable[[Marcher], None]:
    """Have the next solves of an engine find no solution."""

    def sabotage(stepper: Marcher) -> None:
        solve, left = stepper.newton.solve, [times]

        def broken(system: Any, x: Array) -> Outcome:
            left[0] -= 1
            if left[0] >= 0:
                stepper.newton.forget()
                return Outcome.SLOW
            return solve(system, x)

        stepper.newton.solve = broken  # type: ignore[method-assign]

    return sabotage


@pytest.mark.parametrize("integrator", ["theta", "generalized-alpha"])
def test_refused_steps_are_made_shorter_as_petsc_does(integrator: str) -> None:
    of = drillfem.load_scene("pendulum", {"mesh.elements": 4})
    steppers = pair(of, replace(of.time, integrator=integrator))
    for stepper in steppers:
        stepper.step(1.0)
        fails(2)(stepper)
    reports = [stepper.step(1.0) for stepper in steppers]
    assert reports[1].step == pytest.approx(reports[0].step) == pytest.approx(of.time.step / 16)
    assert [stepper.rejected for stepper in steppers] == [2, 2]
    assert apart(*steppers, "rt") < 1e-12
    for stepper in steppers:  # and back to the scene's step
        assert stepper.step(1.0).step == pytest.approx(of.time.step)
        fails(1000)(stepper)
        with pytest.raises(SimulationError, match=r"no time step succeeds at t = 0.0020\d+ s .* smaller time.step"):
            stepper.step(1.0)
        stepper.destroy()
    assert steppers[0].rejected == steppers[1].rejected


def test_numbers_that_are_none_are_noticed() -> None:
    of = drillfem.load_scene("pendulum", {"mesh.elements": 4})
    _, stepper = pair(of)
    stepper.step(1.0)
    stepper.rod.loads.g.value[0] = math.nan
    with pytest.raises(SimulationError, match="no time step succeeds"):
        stepper.step(1.0)


def test_integrators_of_petsc_alone_are_refused() -> None:
    of = drillfem.load_scene("pendulum", {"mesh.elements": 4})
    rod = Rod(of)
    with pytest.raises(ValueError, match="is not one of the compiled engine"):
        CompiledStepper(rod, initial_state(rod), None, replace(of.time, integrator="arkimex"))
    with pytest.raises(SceneError, match=r"time\.integrator"):
        drillfem.load_scene("pendulum", {"time.engine": "compiled", "time.integrator": "bdf"})


def test_engines_in_one_process_leave_each_other_alone() -> None:
    short, long = (drillfem.load_scene("pendulum", {"mesh.elements": n}) for n in (4, 6))
    _, alone = pair(short)
    for _ in range(5):
        alone.step(1.0)
    (_, one), (_, other) = pair(short), pair(long)
    for _ in range(5):
        one.step(1.0)
        other.step(1.0)
    assert np.array_equal(one.u, alone.u)
