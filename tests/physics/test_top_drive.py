"""Top drives on the rod, and what the hook does: against closed forms, in every ansatz, integrator and engine."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

pytest.importorskip("dolfinx", reason="the string is assembled with DOLFINx")

import drillfem
from drillfem.models.drive import DriveLaw, law_of
from drillfem.models.initial import initial_state
from drillfem.models.modes import linearise
from drillfem.models.rod import Rod
from drillfem.results import Result
from drillfem.scene import Scene
from drillfem.solve.dynamics import Stepper

Array = npt.NDArray[np.float64]

PI = {"kind": "pi", "speed": 10.0, "proportional_gain": 500.0, "integral_gain": 200.0}
SOFT = {"kind": "soft-torque", "speed": 10.0}
Z = {"kind": "z-torque", "speed": 10.0}


def scene(drive: dict[str, Any], length: float = 1000.0, **tables: Any) -> Scene:
    """A drill pipe in a vertical hole that nothing touches, driven by a torque."""
    data: dict[str, Any] = {
        "model": "axial-torsional",
        "string": [{"name": "pipe", "length": length, "outer_diameter": 0.127, "inner_diameter": 0.108}],
        "material": {"youngs_modulus": 210e9, "shear_modulus": 77e9, "density": 7800},
        "hole": {"kind": "straight", "diameter": 0.2159},
        "top_drive": drive,
        "ends": {"bottom": "free", "top_inertia": 1000.0},
        "initial": {"state": "laid"},
        "mesh": {"elements": 8},
        "time": {"end": 8.0, "step": 0.01},
        "output": {"interval": 0.05},
    }
    for name, table in tables.items():
        data[name] = {**data.get(name, {}), **table} if isinstance(table, dict) else table
    return Scene.from_dict(data)


def run(*arguments: Any, **keywords: Any) -> Result:
    return drillfem.simulate(scene(*arguments, **keywords), warn=False)


# -- the drive -----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("model", "integrator"),
    [
        ("axial-torsional", "theta"),
        ("axial-torsional", "generalized-alpha"),
        ("axial-torsional", "bdf"),
        ("axial-torsional", "arkimex"),
        ("torsional", "default"),
        ("spatial", "theta"),
    ],
)
def test_a_rigid_string_under_pi_follows_its_oscillator(model: str, integrator: str) -> None:
    """J e'' + k_p e' + k_i e = 0 for the missing angle e: over many turns, and to the order of the step.

    10 m of pipe lag behind by less than 0.1 mrad. The quaternion of the spatial rod knows its angle modulo 4 pi only.
    """
    s = scene(PI, length=10.0, model=model, mesh={"elements": 1}, time={"integrator": integrator})
    inertia = 1000.0 + 2 * s.string[0].rotary_inertia * 10.0
    history = drillfem.simulate(s, warn=False).history
    t = history["time"].values
    decay = PI["proportional_gain"] / (2 * inertia)
    omega = np.sqrt(PI["integral_gain"] / inertia - decay**2)
    missing = 10.0 / omega * np.exp(-decay * t) * np.sin(omega * t)
    rate = 10.0 * np.exp(-decay * t) * (np.cos(omega * t) - decay / omega * np.sin(omega * t))
    assert history["top_angular_speed"].values == pytest.approx(10.0 - rate, abs=5e-3)
    torque = PI["proportional_gain"] * rate + PI["integral_gain"] * missing
    assert history["top_torque"].values == pytest.approx(torque, abs=5.0)
    assert torque.max() == 5000 and (10 * t - missing)[-1] > 10 * 2 * np.pi
    if model != "torsional":
        assert history["bit_angle"].values == pytest.approx(10 * t - missing, abs=2e-2)


def poles(law: DriveLaw, zeta: float, delay: float, guess: complex) -> complex:
    """Root of Z_drive(s) + zeta tanh(s tau) = 0 near a guess: a string with a free end on its drive."""

    def f(s: complex) -> complex:
        drive = (1 - law.masks) * law.inertia * s + law.proportional + law.integral / s
        return drive * np.cosh(s * delay) + zeta * np.sinh(s * delay)

    s = guess
    for _ in range(60):
        slope = (f(s * (1 + 1e-7)) - f(s * (1 - 1e-7))) / (2e-7 * s)
        s -= f(s) / slope
    assert abs(f(s)) < 1e-6 * zeta
    return s


@pytest.mark.parametrize("drive", (PI, SOFT, {**SOFT, "tuning_frequency": 0.3}, Z), ids=lambda d: d["kind"])
def test_the_tangent_has_the_waves_of_the_string_on_its_drive(drive: dict[str, Any]) -> None:
    """Eigenvalues of the assembled rod against the exact waves: gains, integral, masked inertia are in the Jacobian."""
    s = scene(drive, mesh={"elements": 10})
    rod = Rod(s)
    u = initial_state(rod)
    rod.begin(u)
    rod.drive.at(0.0)  # type: ignore[union-attr]
    K, C, M = linearise(rod, u)
    free = [i for i in range(K.shape[0]) if i % 2 == rod.ansatz.v_names.index("w3")]
    K, C, M = (x[free][:, free].toarray() for x in (K, C, M))
    if drive is Z:  # no inertia is left at the top: that of the element is
        assert M.max() < 20
    n = len(K)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    found = np.linalg.eigvals(A)
    found = found[(found.imag > 0.05) & (found.imag < 12)]
    law, pipe = law_of(s), s.string[0]
    assert law is not None and len(found) >= (0 if drive is Z else 2)
    inertia, stiffness = 2 * pipe.rotary_inertia, pipe.section_stiffness().torsion
    for value in found:
        exact = poles(law, np.sqrt(stiffness * inertia), 1000.0 * np.sqrt(inertia / stiffness), value)
        assert value == pytest.approx(exact, rel=1e-4)


def test_z_torque_swallows_a_wave() -> None:
    """The wave that starts the string comes back from its free end once, and the drive takes it.

    Exact: spin = a(t - x/c) + a(t - (2L - x)/c), and at the top 2 a = Omega(t) + (k_i/zeta) e, e' = Omega - spin.
    """
    rise, end = 0.2, 1.2
    s = scene({**Z, "rise_time": rise}, mesh={"elements": 20}, output={"fields_interval": 0.1},
              time={"end": end, "step": 0.005, "integrator": "theta"})  # fmt: skip
    law, pipe = law_of(s), s.string[0]
    assert law is not None
    travel = 1000.0 / np.sqrt(pipe.section_stiffness().torsion / (2 * pipe.rotary_inertia))
    time = np.linspace(0.0, end, 12001)
    leaving, error, slow = np.zeros_like(time), 0.0, law.integral / law.proportional
    for i, t in enumerate(time):
        wanted = 10.0 * min(1.0, t / rise)
        leaving[i] = (wanted + slow * error) / 2
        error += (wanted - leaving[i] - np.interp(t - 2 * travel, time, leaving, left=0.0)) * time[1]
    fields = drillfem.simulate(s, warn=False).fields
    place = travel * np.ravel(fields["arc_length"].values)[:61] / 1000.0
    assert end > 3 * travel
    for t, spin in zip(fields["time"].values, fields["spin"].values, strict=True):
        exact = np.interp([t - place, t - 2 * travel + place], time, leaving, left=0.0).sum(axis=0)
        assert spin == pytest.approx(exact, abs=0.15)


DRIVES = {"pi": PI, "soft-torque": SOFT, "z-torque": Z}


@cache
def limited(kind: str, integrator: str) -> Result:
    """A start-up in which the motor is at its limit for a while."""
    drive = {**DRIVES[kind], "rise_time": 2.0, "torque_limit": 3000.0}
    return run(drive, time={"integrator": integrator, "end": 5.0})


@pytest.mark.parametrize("integrator", ("theta", "generalized-alpha"))
@pytest.mark.parametrize("kind", DRIVES)
def test_the_motor_gives_no_more_than_its_limit_and_the_balance_closes(kind: str, integrator: str) -> None:
    result = limited(kind, integrator)
    torque, speed = (result.history[name].values for name in ("top_torque", "top_angular_speed"))
    assert torque.max() == pytest.approx(3000, abs=1e-6) and np.sum(torque > 2999) > 10
    assert result.history["top_power"].values == pytest.approx(torque * speed)
    assert result.summary["energy_balance_error"] < 2e-4


def test_the_integral_waits_while_the_motor_is_at_its_limit() -> None:
    """Anti-windup: with a limit of 1500 N m the speed overshoots by less than the unlimited drive does, not by more."""
    free, limited = (run(d, time={"step": 0.025}).history for d in (PI, {**PI, "torque_limit": 1500.0}))
    assert free["top_angular_speed"].max() > 12.5
    assert limited["top_torque"].max() == 1500
    assert limited["top_angular_speed"].max() < free["top_angular_speed"].max()
    assert limited["top_angular_speed"].values[-20:] == pytest.approx(10, abs=1.5)


def test_z_torque_with_a_limit_is_the_same_by_both_integrators() -> None:
    """The limit holds for the mean torque of a step of the trapezoidal rule, whose start knows no acceleration."""
    theta, alpha = (limited("z-torque", k).history for k in ("theta", "generalized-alpha"))
    for name, size in (("top_angular_speed", 0.05), ("bit_angular_speed", 0.1), ("bit_angle", 0.1)):
        assert theta[name].values == pytest.approx(alpha[name].values, abs=size)


def test_a_run_goes_on_as_if_it_had_not_stopped(tmp_path: Path) -> None:
    """Turns counted, what the integral left out, acceleration, and the bottom of the hole are in the checkpoint."""
    drive = {**Z, "torque_limit": 2000.0, "weight_on_bit": 1e5}
    output = {"checkpoint_interval": 0.5, "interval": 0.1, "fields_interval": 1.0}
    s = scene(drive, bit={"kind": "empirical"}, ends={"bottom": "bit"}, time={"end": 1.0}, output=output)
    whole = drillfem.simulate(s, warn=False)
    drillfem.simulate(s, tmp_path / "parts", until=0.5, warn=False)
    parts = drillfem.resume(tmp_path / "parts", until=1.0)
    assert whole.history["bit_torque"].max() > 100
    for name in whole.history.data_vars:
        assert np.array_equal(whole.history[name].values, parts.history[name].values), name


def test_the_compiled_engine_takes_the_same_steps() -> None:
    s = scene({**Z, "torque_limit": 2000.0}, model="axial-torsional", time={"end": 1.0, "integrator": "theta"})
    one, other = (
        drillfem.simulate(replace(s, time=replace(s.time, engine=e)), warn=False).history for e in ("petsc", "compiled")
    )
    for name in ("top_torque", "top_angular_speed", "bit_angular_speed", "work_top_drive"):
        assert other[name].values == pytest.approx(one[name].values, rel=1e-9, abs=1e-8)


# -- the hook ------------------------------------------------------------------------------------------------------
def test_a_string_with_a_travelling_block_hangs_still_on_its_weight() -> None:
    """Lumped masses at both ends: hook load = weight of all, and nothing moves; the string carries what is below."""
    s = scene(
        {"kind": "imposed-speed", "speed": 5.0, "rise_time": 1.0},
        ends={"top_mass": 20000.0, "bottom_mass": 3000.0},
        time={"end": 1.0},
    )
    weight = 9.80665 * (s.string[0].mass_per_length * 1000.0 + 23000.0)
    held = drillfem.simulate(s, warn=False)
    assert held.history["hook_load"].values == pytest.approx(weight, rel=1e-6)
    assert s.weight == pytest.approx(weight)
    hung = replace(s, top_drive=replace(s.top_drive, hook_load=weight)).checked()
    assert hung.hangs and not s.hangs
    result = drillfem.simulate(hung, warn=False)
    assert np.abs(result.history["bit_axial_speed"].values).max() < 1e-7
    pull = result.fields["axial_force"].values[-1]
    assert pull[0] == pytest.approx(weight - 20000 * 9.80665, rel=1e-3)
    assert pull[-1] == pytest.approx(3000 * 9.80665, rel=2e-2)


def test_too_light_a_hook_lets_the_string_fall() -> None:
    """Missing hook load over all mass is the acceleration of the block, once waves have gone to and fro."""
    drive = {"kind": "imposed-speed", "speed": 0.0, "hook_load": 300000.0}
    s = scene(drive, length=100.0, ends={"top_mass": 30000.0},
              time={"end": 1.0, "integrator": "theta"})  # fmt: skip
    mass = 30000.0 + s.string[0].mass_per_length * 100.0
    result = drillfem.simulate(s, warn=False)
    speed = result.history["bit_axial_speed"].values[-1]
    assert speed == pytest.approx((mass * 9.80665 - 300000.0) / mass * 1.0, rel=0.05)
    works = result.history
    assert works["work_hook_load"].values[-1] == pytest.approx(-300000.0 * speed / 2, rel=0.1)
    assert result.summary["energy_balance_error"] < 1e-3


DRILL = {
    "bit": {"kind": "cutting", "radius": 0.108, "blades": 6, "wear_flat_length": 1.2e-3, "friction": 0.8,
            "inclination": 0.38},
    "rock": {"intrinsic_specific_energy": 0.252e9, "contact_strength": 0.252e9, "contact_strength_stalled": 0.504e9,
             "surface": {"scheme": "profile"}},
    "string": [{"name": "collars", "length": 150.0, "outer_diameter": 0.1524, "inner_diameter": 0.056}],
    "material": {"youngs_modulus": 210e9, "shear_modulus": 77e9, "density": 7800, "retardation_time": 1e-2},
    "contact": {"stiffness": 1e6, "friction_static": 0.0, "friction_dynamic": 0.0},
    "initial": {"state": "nominal", "spin_perturbation": 0.0},
    "mesh": {"elements": 15},
}  # fmt: skip
BENT = {"model": "spatial", "hole": {"kind": "arc", "radius": 300.0, "diameter": 0.2159}}
IMPOSED = {"kind": "imposed-speed", "speed": 14.42, "weight_on_bit": 45.7e3}


def drilling(drive: dict[str, Any] = IMPOSED, inertia: float = 0.0, **tables: Any) -> Scene:
    base = DRILL | {"ends": {"bottom": "bit", "top_inertia": inertia}, "time": {"end": 2.0, "step": 0.004}}
    base["output"] = {"interval": 0.02, "fields_interval": 1.0}
    base["time"]["engine"] = "petsc"
    if "bit" in tables:
        base["bit"] = None
    for name, table in tables.items():
        base[name] = {**(base.get(name) or {}), **table} if isinstance(table, dict) else table
    return scene(drive, **{name: table for name, table in base.items() if table is not None})


def test_a_block_that_goes_down_drills_as_fast() -> None:
    """Steady drilling follows from the speed of the block; hook load and its power are those of the reaction."""
    block = {"kind": "imposed-speed", "speed": 14.42, "block_speed": 3e-3}
    s = drilling(block)
    steady = s.nominal()
    assert steady.rate_of_penetration == pytest.approx(3e-3)
    result = drillfem.simulate(s, warn=False)
    history = result.history
    assert result.summary["drilled_depth"] == pytest.approx(6e-3, rel=1e-6)
    assert history["bit_weight"].values == pytest.approx(steady.weight_on_bit, rel=1e-4)
    assert history["hook_load"].values == pytest.approx(s.weight - steady.weight_on_bit, rel=1e-4)
    assert history["work_hook_load"].values[-1] == pytest.approx(-6e-3 * steady.hook_load, rel=1e-4)
    assert result.summary["energy_balance_error"] < 1e-9


@pytest.mark.parametrize("kind", ("pi", "soft-torque", "z-torque"))
def test_a_drive_starts_in_steady_drilling(kind: str) -> None:
    """The integral carries the torque of the bit from the first step on: nothing moves."""
    drive = {"kind": kind, "speed": 14.42, "weight_on_bit": 45.7e3}
    if kind == "pi":
        drive |= {"proportional_gain": 2000.0, "integral_gain": 1000.0}
    s = drilling(drive, inertia=1500.0, time={"end": 1.0})
    result = drillfem.simulate(s, warn=False)
    history = result.history
    assert history["top_torque"].values == pytest.approx(s.nominal().torque_on_bit, rel=1e-6)
    assert history["bit_angular_speed"].values == pytest.approx(14.42, rel=1e-6)
    assert history["top_angular_speed"].values == pytest.approx(14.42, rel=1e-6)
    assert result.summary["energy_balance_error"] < 1e-9


# -- bits in holes -------------------------------------------------------------------------------------------------
def test_a_bit_drills_along_a_curved_hole_as_along_a_straight_one() -> None:
    """Spec 9.4: weight along the hole, torque about the bit, on the centreline; only friction and bending take some."""
    straight = drillfem.simulate(drilling(), warn=False)
    s = drilling(**BENT)
    bent = drillfem.simulate(s, warn=False)
    rubbing = {"friction_static": 0.3, "friction_dynamic": 0.15}
    rough = drillfem.simulate(drilling(**BENT, contact=rubbing, ends={"top_mass": 5000.0}), warn=False)
    hook = rough.history["hook_load"].values
    assert hook == pytest.approx(s.hanging_weight + 5000 * 9.80665 - 45.7e3)
    depth = [r.summary["drilled_depth"] for r in (straight, bent, rough)]
    assert depth[0] == pytest.approx(2 * s.nominal().rate_of_penetration, rel=1e-9)
    # 0.3 % of the weight stays in the bent string (EI kappa^2/2 and the low side): 1 % of what cuts
    assert bent.history["bit_weight"].mean() == pytest.approx(45.7e3, rel=4e-3)
    assert depth[1] == pytest.approx(depth[0], rel=0.015)
    # rotary friction leaves only the part along the hole: v/(w r) of it
    lost = depth[1] - depth[2]
    slip = float(depth[1] / 2 / (14.42 * 0.0762))
    most = 0.3 * float(rough.history["side_force"].max()) * slip
    assert lost < 0.02 * depth[1] + most / 45.7e3 * depth[1]
    assert float(rough.history["wall_torque"].mean()) > 300
    for result in (bent, rough):
        assert result.summary["energy_balance_error"] < 1e-4
        # it goes where the hole goes
        end = result.fields["position"].values[-1, -1]
        hole = s.borehole
        assert hole is not None
        place = hole.frame(np.array([150.0 + result.summary["drilled_depth"]])).position[0]
        assert np.linalg.norm(end - place) < 5e-3


def test_a_free_bit_turns_in_a_curved_hole_under_pi() -> None:
    """Off bottom, from rest: the string winds up, breaks loose and turns, and all its energy is accounted for."""
    drive = {"kind": "pi", "speed": 14.42, "proportional_gain": 2000.0, "integral_gain": 2000.0}
    free = {"bit": {"kind": "free"}, "rock": None, "initial": {"state": "laid"}}
    contact = {"friction_static": 0.3, "friction_dynamic": 0.15}
    s = drilling(drive, inertia=500.0, **(BENT | free | {"contact": contact, "time": {"end": 4.0, "step": 0.005}}))
    result = drillfem.simulate(s, warn=False)
    history = result.history
    assert "bit_torque" not in history
    assert history["bit_angular_speed"].values[0] == 0.0
    assert history["bit_angular_speed"].values[-1] == pytest.approx(14.42, abs=1.5)
    assert history["top_torque"].values[-1] == pytest.approx(float(history["wall_torque"].values[-1]) + 1300, abs=800)
    assert history["hook_load"].values == pytest.approx(s.hanging_weight, rel=0.01)
    assert result.summary["energy_balance_error"] < 1e-3


def test_a_hung_string_is_lowered_into_the_curve() -> None:
    """From the vertical part into a bend, turning: it lies on the wall, and the hook carries what the hole does not."""
    found = scene(
        {"kind": "imposed-speed", "speed": 6.0, "block_speed": 0.5},
        80.0,
        model="auto",
        hole={"kind": "build", "kick_off": 82.0, "radius": 60.0, "final_inclination": np.pi / 2},
        contact={"stiffness": 1e6, "friction_static": 0.0, "friction_dynamic": 0.0},
        material={"retardation_time": 1e-3},
        ends={"top_inertia": 0.0},
        mesh={"elements": 16},
        time={"end": 80.0, "step": 0.01},
        output={"interval": 0.5, "fields_interval": 80.0},
    )
    assert found.resolved_model().name == "spatial"  # the rungs know that it will bend
    result = drillfem.simulate(found, warn=False)
    h, hole = result.history, found.borehole
    assert hole is not None and result.fields is not None
    last = result.fields.isel(time=-1)
    # the lower end is 40 m farther down the hole, on its wall
    reached = float(hole.nearest(last["position"].values[-1:])[0])
    assert reached == pytest.approx(120.0, abs=0.1)
    assert float(last["wall_gap"].min()) == pytest.approx(0.0, abs=5e-3)
    # without friction the hook carries the weight of the depth that the string hangs through (and its bending)
    weight = found.weight / found.length
    depth = float(last["position"].values[-1, 2]) - 40.0
    carried = float(h["hook_load"].values[-40:].mean())
    assert carried == pytest.approx(weight * depth, rel=0.02)
    assert carried < 0.98 * found.weight


def test_steps_alone_renew_the_reference() -> None:
    """A stepper without a run around it counts the turns too."""
    s = scene(PI, length=10.0, mesh={"elements": 1})
    rod = Rod(s)
    stepper = Stepper(rod, initial_state(rod))
    while stepper.now < 3.0:
        stepper.step(3.0)
    assert rod.drive is not None and rod.drive.counted > 3 * np.pi
    assert rod.drive.counted == pytest.approx(float(stepper.u[rod.dof(0, "phi")]), rel=1e-9)
    stepper.destroy()
