"""Mud around and inside the string: coefficients against the flows they stand for, terms against rigid motions."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import quad

pytest.importorskip("dolfinx", reason="the string is assembled with DOLFINx")

from rodlab import put, wave

import drillfem
from drillfem.forms import virtual_work as vw
from drillfem.models.modes import natural_frequencies
from drillfem.models.rod import Rod
from drillfem.scene import Scene, load_scene
from drillfem.scene.mud import added_mass, crossing_drag, sliding_drag, turning_drag
from drillfem.solve.laid import start_of

Array = npt.NDArray[np.float64]

MU, RHO = 0.04, 1300.0
R_IN, R_OUT, HOLE = 0.054, 0.0635, 0.10795
FULL = {"density": RHO, "viscosity": MU, "added_mass": True}


def scene(mud: dict[str, Any] | None = FULL, model: str = "axial-torsional", **tables: Any) -> Scene:
    data: dict[str, Any] = {
        "model": model,
        "string": [{"name": "pipe", "length": 200.0, "outer_diameter": 2 * R_OUT, "inner_diameter": 2 * R_IN}],
        "material": {"youngs_modulus": 210e9, "shear_modulus": 77e9, "density": 7800, "retardation_time": 1e-3},
        "hole": {"kind": "straight", "diameter": 2 * HOLE},
        "top_drive": {"kind": "imposed-speed", "speed": 12.0, "rise_time": 1.0},
        "ends": {"bottom": "free"},
        "initial": {"state": "laid"},
        "mesh": {"elements": 4},
        "time": {"end": 4.0, "step": 0.01},
        "output": {"interval": 0.1},
    }
    if mud:
        data["mud"] = mud
    for name, table in tables.items():
        data[name] = {**data.get(name, {}), **table} if isinstance(table, dict) else table
    return Scene.from_dict({name: table for name, table in data.items() if table is not None})


# -- closed forms against the equations of the flow ----------------------------------------------------------------
def test_couette_flow() -> None:
    """u(r) = a r + b/r with u = w r at the pipe and 0 at the wall; torque 2 pi r^2 mu (r d(u/r)/dr)."""
    w, r, R = 3.0, R_OUT, HOLE
    a, b = np.linalg.solve([[r, 1 / r], [R, 1 / R]], [w * r, 0.0])
    assert a * R + b / R == pytest.approx(0, abs=1e-15)
    shear = MU * r * (-2 * b / r**3)
    assert turning_drag(MU, r, R) * w == pytest.approx(-2 * np.pi * r**2 * shear)
    assert turning_drag(MU, r, 1e6) == pytest.approx(4 * np.pi * MU * r**2)


def test_flow_along_an_annulus() -> None:
    """u(r) = v ln(R/r)/ln(R/r_o) without a pressure gradient."""
    v, h = 0.7, 1e-6

    def u(r: float) -> float:
        return v * np.log(HOLE / r) / np.log(HOLE / R_OUT)

    shear = MU * (u(R_OUT + h) - u(R_OUT)) / h
    assert sliding_drag(MU, R_OUT, HOLE) * v == pytest.approx(-2 * np.pi * R_OUT * shear, rel=1e-4)


def test_stokes_flow_across_an_annulus() -> None:
    """psi = f(rho) sin theta, f = A rho^3 + B rho ln rho + C rho + D/rho: no slip at both walls; the drag is 4 pi mu B.

    Against the viscous power: twice mu times the strain rate squared, integrated over the annulus.
    """
    v = 0.3

    def terms(r: float, order: int) -> list[float]:
        return [
            [r**3, r * np.log(r), r, 1 / r],
            [3 * r**2, np.log(r) + 1, 1.0, -1 / r**2],
            [6 * r, 1 / r, 0.0, 2 / r**3],
        ][order]

    rows = [terms(R_OUT, 0), terms(R_OUT, 1), terms(HOLE, 0), terms(HOLE, 1)]
    k = np.linalg.solve(rows, [v * R_OUT, v, 0.0, 0.0])

    def dissipated(r: float) -> float:
        f, df, ddf = (float(k @ terms(r, i)) for i in range(3))
        e_rr = (df - f / r) / r  # times cos theta, also minus e_tt
        e_rt = (-ddf + df / r - f / r**2) / 2  # times sin theta
        return 2 * MU * (2 * e_rr**2 + 2 * e_rt**2) * np.pi * r

    power = quad(dissipated, R_OUT, HOLE)[0]
    assert crossing_drag(MU, R_OUT, HOLE) * v**2 == pytest.approx(power, rel=1e-9)
    assert crossing_drag(MU, R_OUT, HOLE) * v == pytest.approx(abs(4 * np.pi * MU * k[1]), rel=1e-9)


def test_potential_flow_around_a_moving_pipe() -> None:
    """phi = (a r + b/r) cos theta: its kinetic energy is that of the added mass, with the mud inside the pipe."""
    r, R = R_OUT, HOLE
    a, b = np.linalg.solve([[1.0, -1 / r**2], [1.0, -1 / R**2]], [1.0, 0.0])

    def speed_squared(x: float) -> float:
        return float((a - b / x**2) ** 2 + (a + b / x**2) ** 2) * np.pi * x

    outside = RHO * quad(speed_squared, r, R)[0]
    assert added_mass(RHO, r, R_IN, R) == pytest.approx(outside + RHO * np.pi * R_IN**2)
    assert added_mass(RHO, r, 0.0, 1e6) == pytest.approx(RHO * np.pi * r**2)


# -- the terms -----------------------------------------------------------------------------------------------------
def test_drag_on_a_rigid_motion_is_that_of_the_closed_forms() -> None:
    """A spatial string that turns, slides and moves across as a whole: power of the drag, energy of the added mass."""
    s = scene(model="spatial")
    rod = Rod(s)
    w, along, across = 3.0, 0.2, np.array([0.3, -0.4])
    u = put(rod, w3=w, v3=along, v1=across[0], v2=across[1])
    rod.set_state(u, np.zeros(rod.size))
    terms = vw.powers(rod.ansatz, rod.u, rod.u_dot, rod.s, rod.section, rod.loads, rod.on)
    drag = turning_drag(MU, R_OUT, HOLE) * w**2 + sliding_drag(MU, R_OUT, HOLE) * along**2
    drag += crossing_drag(MU, R_OUT, HOLE) * (across @ across)
    assert rod.scalar_form(terms["mud drag"])() == pytest.approx(200 * drag, rel=1e-9)
    assert rod.powers()["damping"] == pytest.approx(200 * drag, rel=1e-9)
    pipe = s.string[0]
    moving = (pipe.mass_per_length + added_mass(RHO, R_OUT, R_IN, HOLE)) * (across @ across)
    moving += pipe.mass_per_length * along**2 + 2 * pipe.rotary_inertia * w**2
    assert rod.energies()[0] == pytest.approx(200 * moving / 2, rel=1e-9)
    # what gravity does on the way down is less by the mud that the steel displaces
    assert rod.powers()["gravity"] == pytest.approx(-(7800 - RHO) * pipe.area * 200 * 9.80665 * along, rel=1e-9)


def test_the_added_mass_gives_back_what_it_takes() -> None:
    """Power of its inertia = rate of its kinetic energy along any motion, however the sections turn."""
    rod = Rod(scene(model="spatial"))
    rng = np.random.default_rng(3)
    names = rod.ansatz.x_names + rod.ansatz.v_names
    base = put(rod, **{n: wave(rng, 200.0, 0.3 if n[0] == "q" else 1.0) for n in names})
    rate = put(rod, **{n: wave(rng, 200.0, 1.0) for n in names if n[0] in "vw"})
    # the configuration moves as its velocities say
    block, move = base.reshape(-1, 13), rate.reshape(-1, 13)
    q, w = block[:, 3:7], block[:, 10:13]
    E = np.array([[-q[:, 1], q[:, 0], q[:, 3], -q[:, 2]], [-q[:, 2], -q[:, 3], q[:, 0], q[:, 1]],
                  [-q[:, 3], q[:, 2], -q[:, 1], q[:, 0]]])  # fmt: skip
    move[:, :3], move[:, 3:7] = block[:, 7:10], np.einsum("kjn,nk->nj", E, w) / 2
    at = rod.ansatz.configuration(rod.ansatz.split(rod.u)[0], rod.s)
    twist = rod.ansatz.twist(rod.ansatz.split(rod.u)[1], at)
    assert rod.loads.mud is not None
    energy = rod.scalar_form(vw.added_energy(at, twist, rod.loads.mud) * rod.on.mass)
    terms = vw.powers(rod.ansatz, rod.u, rod.u_dot, rod.s, rod.section, rod.loads, rod.on)
    power = rod.scalar_form(terms["mud inertia"])

    def stored(t: float) -> float:
        rod.set_state(base + t * rate, rate)
        return energy()

    rod.set_state(base, rate)
    taken, h = power(), 1e-5
    # the fields are interpolated between the nodes, where alone the kinematics hold: small elements' worth of error
    assert taken == pytest.approx((stored(h) - stored(-h)) / (2 * h), rel=2e-2)
    # and without its gyroscopic part it would be far off
    still = put(rod, base, w1=0.0, w2=0.0, w3=0.0)
    rod.set_state(still, rate)
    assert abs(power() - taken) > 0.05 * abs(taken)


# -- strings -------------------------------------------------------------------------------------------------------
def test_turning_takes_the_torque_of_the_annulus() -> None:
    """Steady: torque = drag per length times length times spin, all of it dissipated; without mud none is needed."""
    result = drillfem.simulate(scene({"density": RHO, "viscosity": 1.0}, time={"step": 0.02}))
    torque = turning_drag(1.0, R_OUT, HOLE) * 12.0 * 200.0
    history = result.history
    assert torque == pytest.approx(186, abs=0.5)
    late = history["time"].values > 2.5
    assert history["top_torque"].values[late].mean() == pytest.approx(torque, rel=0.02)
    lost = np.polyfit(history["time"].values[late], history["dissipated"].values[late], 1)[0]
    assert lost == pytest.approx(torque * 12.0, rel=0.02)
    assert result.summary["energy_balance_error"] < 2e-3


def test_mud_carries_part_of_the_weight() -> None:
    """(1 - rho_mud/rho_steel) of it hangs on the hook, still; the axial force is the effective tension."""
    dry, wet = scene(None), scene({"density": RHO})
    assert wet.weight == pytest.approx(dry.weight * (1 - RHO / 7800))
    result = drillfem.simulate(wet, until=0.5)
    assert result.history["hook_load"].values == pytest.approx(wet.weight, rel=1e-6)
    pull = result.fields["axial_force"].values[-1]
    s = result.fields["arc_length"].values.reshape(-1, len(pull))[0]
    assert pull == pytest.approx(wet.weight * (1 - s / 200), rel=1e-3, abs=20)
    assert not np.any(np.abs(result.history["bit_axial_speed"].values) > 1e-7)


def test_a_string_on_the_low_side_presses_with_its_buoyed_weight() -> None:
    tables: dict[str, Any] = {
        "hole": {"kind": "straight", "diameter": 2 * HOLE, "inclination": 1.0},
        "contact": {"stiffness": 1e5, "friction_static": 0.2, "friction_dynamic": 0.1},
        "mesh": {"elements": 10},
    }
    rod = Rod(scene({"density": RHO}, "spatial", **tables))
    u = start_of(rod)
    rod.set_state(u, np.zeros(rod.size))
    assert rod.wall is not None and rod.scene.contact is not None
    middle = (rod.wall.arc_length > 80) & (rod.wall.arc_length < 120)
    side = rod.wall.side_force(u, rod.scene.contact)[middle]
    buoyed = (7800 - RHO) * rod.scene.string[0].area * 9.80665
    assert side == pytest.approx(buoyed * np.sin(1.0), rel=1e-3)


def test_added_mass_slows_bending_and_nothing_else() -> None:
    dry, wet = (
        natural_frequencies(Rod(scene(mud, "spatial", gravity={"magnitude": 0}, mesh={"elements": 2})), 2)
        for mud in (None, FULL)
    )
    pipe = scene().string[0]
    ratio = np.sqrt(pipe.mass_per_length / (pipe.mass_per_length + added_mass(RHO, R_OUT, R_IN, HOLE)))
    assert ratio == pytest.approx(0.65, abs=0.05)
    assert wet["bending"].frequency == pytest.approx(ratio * dry["bending"].frequency, rel=1e-4)
    for family in ("axial", "torsional"):
        assert wet[family].frequency == pytest.approx(dry[family].frequency, rel=1e-6)


def test_drilling_in_mud_needs_its_buoyed_weight_on_the_hook() -> None:
    """Steady drilling stays steady: hook load, stretch and twist of the start know the mud."""
    s = load_scene(
        "vertical-c1-cd3",
        {"model": "axial-torsional", "mud.density": RHO, "initial.spin_perturbation": 0.0, "time.step": 0.005,
         "time.end": 1.0, "output.interval": 0.05, "mesh.elements": 12, "rock.surface.scheme": "profile"},
    )  # fmt: skip
    assert s.engine == "petsc" and not s.obstacle("axial-torsional")
    assert "mud" in s.obstacle("lumped") and "mud" in s.obstacle("torsional")
    assert s.nominal().hook_load == pytest.approx(s.weight - 45.7e3)
    result = drillfem.simulate(s, warn=False)
    assert result.history["bit_angular_speed"].values == pytest.approx(14.42, rel=1e-6)
    assert result.history["bit_weight"].values == pytest.approx(45.7e3, rel=1e-5)
    assert result.summary["energy_balance_error"] < 1e-9


def test_a_string_swings_slower_and_less_in_mud() -> None:
    """A pendulum of 30 m in its mud: buoyancy and added mass stretch its period, drag takes the rest of its energy."""
    string = [{"name": "pipe", "length": 30.0, "outer_diameter": 2 * R_OUT, "inner_diameter": 2 * R_IN}]
    s = scene(
        {"density": RHO, "viscosity": 0.2, "added_mass": True},
        "spatial",
        string=string,
        top_drive=None,
        ends={"top": "pinned"},
        initial={"state": "given", "angular_velocity": [0.0, 0.05, 0.0]},
        mesh={"elements": 2},
        time={"end": 6.0, "step": 0.02},
    )
    result = drillfem.simulate(s, warn=False)
    history, pipe = result.history, s.string[0]
    whole = pipe.mass_per_length + added_mass(RHO, R_OUT, R_IN, HOLE)
    period = 2 * np.pi * np.sqrt(2 * 30.0 / (3 * 9.80665) * whole / (pipe.mass_per_length - RHO * pipe.area))
    decay = crossing_drag(0.2, R_OUT, HOLE) / (2 * whole)
    t = history["time"].values
    omega = np.sqrt((2 * np.pi / period) ** 2 - decay**2)
    exact = 30.0 * 0.05 / omega * np.exp(-decay * t) * np.sin(omega * t)
    assert decay * 6 > 0.05
    assert history["tip_x"].values == pytest.approx(exact, abs=0.02 * abs(exact).max())
    assert history["dissipated"].values[-1] > 0.05 * history["kinetic_energy"].values[0]
    assert result.summary["energy_balance_error"] < 5e-3


def test_there_is_no_mud_unless_it_is_given() -> None:
    rod = Rod(scene(None))
    assert rod.loads.mud is None and not {"buoyancy", "mud drag", "mud inertia"} & set(rod.terms)
    rod = Rod(scene({"density": RHO}))
    assert set(rod.terms) & {"buoyancy", "mud drag", "mud inertia"} == {"buoyancy"}
