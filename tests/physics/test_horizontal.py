"""Chapter 7, deterministic: a horizontal string that is pushed, shaken by a motor, and resisted by its bit."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

pytest.importorskip("dolfinx")

import drillfem
from drillfem.compat import Array
from drillfem.ensemble.member import Worker, numbers
from drillfem.errors import SceneError, SimulationError
from drillfem.models.rod import Rod, structure
from drillfem.results import Result
from drillfem.scene import Scene, load_scene
from drillfem.solve.compiled import CompiledStepper
from drillfem.solve.direct import DirectRun
from drillfem.solve.laid import start_of

WEIGHT = 7850 * math.pi / 4 * (0.15**2 - 0.10**2) * 9.81  # N/m
PUSH, STRENGTH, RATE, V_0 = 5500.0, 1400.0, 400.0, 2e-4


def scene(name: str, until: float, **keys: Any) -> Scene:
    changed = {"time.end": until, "output.interval": 0.01, "output.fields_interval": 10.0}
    return load_scene(f"horizontal-{name}", changed | {k.replace("__", "."): v for k, v in keys.items()})


def run(name: str, until: float, **keys: Any) -> Result:
    return drillfem.simulate(scene(name, until, **keys), warn=False)


def last(result: Result, name: str) -> float:
    return float(result.history[name].values[-1])


# -- the bit and the motor --------------------------------------------------------------------------------------------
def test_law_of_the_bit_by_number_and_by_form() -> None:
    for reading, sign in (("recommended", 1.0), ("literal", -1.0)):
        rod = Rod(scene("b", 0.1, reading=reading, mesh__elements=2))
        bit, u, form = rod.dof(-1, "v3"), start_of(rod), rod.vector_form(rod.terms["resistance"])
        for v in (-10.0, -0.01, 0.0, 1e-4, 2.5e-3, 10.0):
            u[bit] = v
            rod.set_state(u, np.zeros(rod.size))
            force = form(np.zeros(rod.size))
            assert rod.resistance(v) == pytest.approx(sign * STRENGTH * (1 - math.exp(-RATE * max(0.0, v))), rel=1e-13)
            assert force[bit] == pytest.approx(rod.resistance(v), rel=1e-12) and np.count_nonzero(force) <= 1


def test_motor_pushes_with_its_sine() -> None:
    rod = Rod(scene("b", 0.1, mesh__elements=2))
    bit, form = rod.dof(-1, "v3"), rod.vector_form(rod.terms["push"])
    for t in (0.0, 0.05, 0.15, 0.4):
        rod.at(t)
        force = form(np.zeros(rod.size))
        assert -force[bit] == pytest.approx(500 * math.sin(100 * math.pi / 30 * t)) and np.count_nonzero(force) <= 1


def test_mass_of_the_bit_is_accelerated_with_the_string() -> None:
    """Without friction and resistance all of it moves as one, but for the stretch by waves: F t^2/(2 (m + m_bit))."""
    free = {"contact__friction_static": 0, "contact__friction_dynamic": 0, "bit__saturating__strength": 0}
    for lump in (20.0, 2000.0):
        result = run("b", 1.0, motor__force=0, ends__bottom_mass=lump, mesh__elements=6, **free)
        assert last(result, "bit_depth") == pytest.approx(PUSH / (2 * (WEIGHT / 9.81 * 60 + lump)), rel=5e-4)


# -- case B -----------------------------------------------------------------------------------------------------------
def test_steady_speed_of_case_b() -> None:
    """Without the motor: 5500 N = 0.1 W v/sqrt(v^2 + v_0^2) + 1400 (1 - exp(-400 v)), 2.9 mm/s (spec 10.5)."""
    result = run("b", 1.0, motor__force=0)

    def left(v: float) -> float:
        return PUSH - 0.1 * WEIGHT * 60 * v / math.hypot(v, V_0) - STRENGTH * (1 - math.exp(-RATE * v))

    assert last(result, "bit_axial_speed") == pytest.approx(float(brentq(left, 1e-4, 1e-2)), rel=1e-3)
    assert last(result, "side_force") == pytest.approx(WEIGHT * 60, rel=1e-12)
    assert last(result, "tip_x") == pytest.approx(0.0, abs=1e-3)


def bar(until: float, cells: int) -> float:
    """Displacement (m) of the bit of case B by an elastic bar of point masses, stepped by central differences."""
    h, mass = 60 / cells, WEIGHT / 9.81
    stiff = 210e9 * math.pi / 4 * (0.15**2 - 0.10**2) / h
    share: Array = np.full(cells + 1, h)
    share[[0, -1]] = h / 2
    m = mass * share
    m[-1] += 20
    friction = 0.1 * WEIGHT * share
    u, v, dt = np.zeros(cells + 1), np.zeros(cells + 1), 0.5 * h / 5200
    for k in range(round(until / dt)):
        pull = stiff * np.diff(u)
        force = np.zeros(cells + 1)
        force[:-1] += pull
        force[1:] -= pull
        force[0] += PUSH
        force[-1] += 500 * math.sin(100 * math.pi / 30 * k * dt)
        # what resists is taken at the new speed, found by Newton's method
        new = v.copy()
        for _ in range(4):
            root = np.sqrt(new**2 + V_0**2)
            resists, slope = friction * new / root, friction * V_0**2 / root**3
            ahead = max(new[-1], 0.0)
            resists[-1] += STRENGTH * (1 - math.exp(-RATE * ahead))
            slope[-1] += STRENGTH * RATE * math.exp(-RATE * ahead) * (new[-1] > 0)
            new -= (m * (new - v) / dt - force + resists) / (m / dt + slope)
        v = new
        u += dt * v
    return float(u[-1])


def test_case_b_is_a_bar_with_friction() -> None:
    """The planar rod with its weight for the normal force moves as the bar of Ritto et al. (2013) does."""
    oracle = 2 * bar(0.2, 160) - bar(0.2, 80)  # first order
    assert last(run("b", 0.2, time__step="0.1 ms"), "bit_depth") == pytest.approx(oracle, rel=4e-3)


def test_weight_as_normal_force_is_that_across_the_hole() -> None:
    """Along a hole that gravity meets at an angle, the wall carries the part across it; it needs no penetration."""
    rod = Rod(scene("b", 0.1, gravity__direction=[0.6, 0, 0.8]))
    rod.set_state(start_of(rod), np.zeros(rod.size))
    assert rod.wall_row()["side_force"] == pytest.approx(0.6 * WEIGHT * 60, rel=1e-9)
    f = rod.vector_form(rod.terms["contact"] + rod.terms["gravity"])(np.zeros(rod.size))
    lateral = f.reshape(-1, rod.ansatz.size)[rod.nodes, rod.ansatz.index("v1")]
    assert np.abs(lateral[:-1]).max() < 1e-9 * WEIGHT
    assert lateral[-1] == pytest.approx(-0.6 * 20 * 9.81)  # of the bit, which the springs carry


# -- case A -----------------------------------------------------------------------------------------------------------
def test_string_on_its_wall_leaves_two_thirds_of_the_sag_to_the_clamp() -> None:
    for gap, friction in ((5e-3, 4199), (10e-3, 4136), (50e-3, 3937)):
        rod = Rod(scene("a", 0.1, initial__state="laid", hole__diameter=0.15 + 2 * gap, contact__stiffness=1e8))
        rod.set_state(start_of(rod), np.zeros(rod.size))
        # the bit, which the formula leaves out, weighs too
        assert 0.1 * (rod.wall_row()["side_force"] - 20 * 9.81) == pytest.approx(friction, rel=1e-3)


def test_engines_take_the_same_steps() -> None:
    """PETSc, the compiled engine with Newton's method in Python, and with all of it in C, through the first contact."""
    ends = []
    for engine, in_c in (("petsc", False), ("compiled", False), ("compiled", True)):
        one = DirectRun(Rod(scene("a", 1.0, time__engine=engine, mesh__elements=6)))
        if isinstance(one.stepper, CompiledStepper) and not in_c:
            one.stepper.system.plain = False
        one.restart()
        for _ in range(60):
            one.step(np.inf)
        ends.append((one.stepper.u.copy(), one.audit.works["work_friction"], one.stepper.newton.iterations))
    (u, friction, iterations), *others = ends
    assert friction > 1.0
    for v, w, n in others:
        assert np.abs(v - u).max() < 1e-9 * np.abs(u).max()
        assert w == pytest.approx(friction, rel=1e-8)
        assert abs(n - iterations) <= 3
    assert ends[1][2] == ends[2][2]


@pytest.mark.slow
def test_space_agrees_with_the_plane() -> None:
    """The rung above, on a scene that both can have, through the first contact."""
    plane, space = (run("a", 0.08, model=model, mesh__elements=4) for model in ("planar", "spatial"))
    assert last(plane, "work_friction") > 1.0
    for name in ("tip_x", "bit_depth", "work_friction", "work_bit", "side_force", "strain_energy"):
        one, other = (r.history[name].values for r in (plane, space))
        assert np.abs(one - other).max() < 1e-6 * np.abs(one).max(), name


def test_a_string_that_leaves_its_hole_stops() -> None:
    result = scene("a", 1.0, ends__top_force=[0, 0, -5e5], motor__force=0, time__step="10 ms", mesh__elements=4)
    with pytest.raises(SimulationError, match="no time step succeeds"):
        drillfem.simulate(replace(result, time=replace(result.time, end=5.0)).checked(), warn=False)


def test_energy_closes_with_the_step() -> None:
    """What end force and motor put in is stored, cut, rubbed or pressed: second order in the step, and B closes."""
    errors = [run("a", 0.3, time__step=h).summary["energy_balance_error"] for h in (2e-3, 5e-4)]
    assert errors[0] < 1e-2 and errors[1] < errors[0] / 10
    assert run("b", 1.0).summary["energy_balance_error"] < 3e-4


def test_printed_sign_pushes_the_bit() -> None:
    ours, printed = run("b", 0.2), run("b", 0.2, reading="literal")
    assert last(printed, "bit_depth") > 2 * last(ours, "bit_depth")
    assert last(printed, "bit_weight") < 0 < last(ours, "bit_weight")
    works = {k: last(printed, k) for k in ("work_motor", "work_bit", "bit_axial_speed")}
    taken = works["work_motor"] - works["work_bit"] - 20 * works["bit_axial_speed"] ** 2 / 2
    assert printed.summary["power_out"] == pytest.approx(taken / 0.2, rel=1e-9)
    assert 0 < ours.summary["power_ratio"] < 1
    assert ours.summary["power_out"] == pytest.approx(last(ours, "work_bit") / 0.2, rel=1e-12)
    assert ours.summary["power_in"] == pytest.approx(last(ours, "work_hook_load") / 0.2, rel=1e-12)


def test_a_run_goes_on_where_it_stopped(tmp_path: Path) -> None:
    given = scene("a", 0.2, mesh__elements=4, output__checkpoint_interval=0.05)
    whole = drillfem.simulate(given, warn=False)
    drillfem.simulate(given, tmp_path / "a", until=0.12, warn=False)
    resumed = drillfem.resume(tmp_path / "a")
    for name in whole.history.data_vars:
        assert np.array_equal(resumed.history[name].values, whole.history[name].values), name
    assert resumed.summary["power_ratio"] == whole.summary["power_ratio"]


# -- members ----------------------------------------------------------------------------------------------------------
def members() -> list[Scene]:
    base = scene("a", 0.1, mesh__elements=4)
    assert base.contact is not None and base.motor is not None and base.bit is not None
    rough = ((0.0, 0.2, 0.2), (30.0, 0.05, 0.05), (80.0, 0.1, 0.1))
    found = [
        base,
        replace(base, contact=replace(base.contact, friction_profile=rough)),
        replace(base, motor=replace(base.motor, force=2000.0), ends=replace(base.ends, top_force=(0.0, 0.0, 9e3))),
        replace(base, hole=replace(base.hole, diameter=0.16), contact=replace(base.contact, stiffness=3e6)),
        replace(base, string=(replace(base.string[0], inner_diameter=0.05),)),
        replace(base, bit=replace(base.bit, saturating=replace(base.bit.saturating, strength=100.0))),
        replace(base, time=replace(base.time, step=1e-3)),
        replace(base, mesh=replace(base.mesh, elements=3)),  # another structure: set up anew
        scene("b", 0.1, mesh__elements=4),
        base,
    ]
    return [s.checked() for s in found]


def test_a_worker_gives_what_a_fresh_run_gives_bit_for_bit() -> None:
    worker, seen = Worker(members()[0]), set()
    for member in members():
        result, fresh = worker.simulate(member), drillfem.simulate(member, warn=False)
        for name in fresh.history.data_vars:
            assert np.array_equal(result.history[name].values, fresh.history[name].values), name
        assert numbers(result) == numbers(fresh)
        seen.add(numbers(result)["bit_depth"])
    assert len(seen) == len(members()) - 1


def test_a_worker_keeps_its_rod_and_survives_failures() -> None:
    base = members()[0]
    worker = Worker(base)
    kept = worker._rod
    first = worker.run(base)
    bad = replace(base, ends=replace(base.ends, top_force=(0.0, 0.0, -5e6)), time=replace(base.time, end=1.0))
    with pytest.raises(SimulationError):
        worker.run(bad.checked())
    assert worker.run(base) == first
    assert worker._rod is kept
    assert structure(load_scene("curved-c2")) is None


def test_a_worker_runs_what_steps_no_rod() -> None:
    drilling = load_scene(
        "vertical-c1-cd4", {"time.end": 0.05, "output.interval": 0.01, "output.fields_interval": 0.05}
    )
    assert Worker(drilling).run(drilling)["bit_depth"] > 0


def test_friction_along_the_hole_is_met_where_it_is() -> None:
    """A profile of one value is that value. A rough start holds back most: the top is pushed."""
    worker = Worker()
    plain = scene("b", 0.1, mesh__elements=8, motor__force=0)
    assert plain.contact is not None

    def depth(*rows: tuple[float, float, float]) -> float:
        return worker.run(replace(plain, contact=replace(plain.contact, friction_profile=rows)).checked())["bit_depth"]

    assert depth((0.0, 0.1, 0.1), (70.0, 0.1, 0.1)) == pytest.approx(worker.run(plain)["bit_depth"], rel=1e-9)
    assert depth((0.0, 0.15, 0.15), (60.0, 0.05, 0.05)) < 0.9 * depth((0.0, 0.05, 0.05), (60.0, 0.15, 0.15))


@pytest.mark.verify
def test_a_member_takes_a_second_at_most() -> None:
    """10 s of case A as shipped, on one core, history off the disk: the least of three is what the machine can do."""
    member = load_scene("horizontal-a")
    worker, spent = Worker(member), []
    for _ in range(3):
        start = time.process_time()
        worker.run(member)
        spent.append(time.process_time() - start)
    assert min(spent) < 1.0


# -- what does not fit ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"contact.normal_force": "none"}, "one of wall, weight"),
        ({"contact.normal_force": "weight", "contact.method": "smooth"}, "contact.method"),
        ({"hole.inclination": "10 deg", "initial.state": "laid", "model": "spatial"}, "along e3"),
        ({"ends.top": "driven", "top_drive.kind": "imposed-speed", "top_drive.speed": 1.0}, "ends.top_force"),
        ({"model": "axial-torsional"}, "must be one of planar, spatial"),
        ({"top_drive.weight_on_bit": 1e3}, "top_drive.weight_on_bit"),
        ({"motor.force": -1}, "motor.force"),
    ],
)
def test_what_does_not_fit_is_refused(keys: dict[str, Any], says: str) -> None:
    with pytest.raises(SceneError, match=says):
        load_scene("horizontal-a", keys)
