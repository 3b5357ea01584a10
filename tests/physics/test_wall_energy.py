"""Contact in time: energy that bounces back, steps too long for the wall, what ends chattering, the balance."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from drillfem.errors import SceneError, SimulationError
from drillfem.models.rod import Rod
from drillfem.scene import Scene
from drillfem.solve import newton
from drillfem.solve.direct import DirectRun

STEEL = {"youngs_modulus": 210e9, "shear_modulus": 77e9, "density": 7850.0}
PIPE = {"name": "pipe", "outer_diameter": 0.127, "inner_diameter": 0.108}
CLEARANCE, LENGTH, STIFFNESS = 0.0365, 5.0, 1e6
ALPHA = {"integrator": "generalized-alpha"}


def falling(step: float, end: float, method: str = "penalty", retardation: float = 0.0, **time: Any) -> Scene:
    """A pipe on the axis of a smooth hole, let fall onto its wall: one point that bounces."""
    return Scene.from_dict(
        {
            "model": "spatial",
            "string": [PIPE | {"length": LENGTH}],
            "material": STEEL,
            "gravity": {"direction": [1, 0, 0]},
            "hole": {"kind": "straight", "diameter": 0.127 + 2 * CLEARANCE},
            "contact": {
                "method": method,
                "stiffness": STIFFNESS,
                "friction_static": 0.0,
                "friction_dynamic": 0.0,
                "retardation_time": retardation,
            },
            "initial": {"state": "rest"},
            "ends": {"top": "free", "bottom": "free"},
            "mesh": {"elements": 1, "degree": 1},
            "time": {"end": end, "step": step} | time,
        }
    )


#: Of the pipe on the spring of the wall, 2 pi sqrt(rho A/k_s) (s).
PERIOD = 2 * math.pi * math.sqrt(falling(1e-3, 1.0).string[0].mass_per_length / STIFFNESS)


def bounced(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Energy (steps,) in fallen clearances, with that stored in the wall, and penetration (steps,; m)."""
    rod = Rod(scene)
    run, energy, deep = DirectRun(rod), [], []
    weight, t = scene.mass * scene.gravity.magnitude, 0.0
    while t < scene.time.end - 1e-9:
        t = run.step(scene.time.end)
        u = run.stepper.u
        rod.set_state(u, np.zeros_like(u))
        fallen = float(u.reshape(-1, rod.ansatz.size)[:, 0].mean())
        energy.append(sum(rod.energies()) + rod.contact_energy() - weight * fallen)
        assert rod.wall is not None
        deep.append(-rod.wall.gap)
    run.destroy()
    return np.array(energy) / (weight * CLEARANCE), np.array(deep)


# -- a point that bounces ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("steps", "time", "most"),
    [
        (40, ALPHA, 0.01),
        (20, ALPHA | {"rho_infinity": 0.5}, 0.06),
        (40, {"integrator": "theta"}, 0.03),
    ],
)
def test_what_falls_bounces_back(steps: int, time: dict[str, Any], most: float) -> None:
    """With ``steps`` in the period of the wall's spring a pipe that has bounced fifteen times has its energy."""
    energy, deep = bounced(falling(PERIOD / steps, 3.0, **time))
    assert np.abs(energy).max() < most
    # m g (c + d) = k d^2/2 per length
    weight = STEEL["density"] * math.pi / 4 * (0.127**2 - 0.108**2) * 9.80665
    lowest = (weight + math.sqrt(weight**2 + 2 * STIFFNESS * weight * CLEARANCE)) / STIFFNESS
    assert deep.max() == pytest.approx(lowest, rel=0.04)


def test_steps_too_long_for_the_wall_feed_it() -> None:
    """At two steps per period every bounce adds energy: the fall is soon repeated from many times the height."""
    for time in ({"integrator": "theta"}, ALPHA):
        energy, _ = bounced(falling(PERIOD / 2, 2.0, **time))
        assert energy.max() > 10.0


@pytest.mark.parametrize("rho", [0.9, 0.5])
@pytest.mark.parametrize("steps", [0.5, 2, 10])
def test_retardation_of_a_step_ends_the_chattering(steps: float, rho: float) -> None:
    """The rate of penetration, counted for one step, takes energy at any step length: none is ever gained."""
    step = PERIOD / steps
    energy, _ = bounced(falling(step, 2.0, retardation=step, rho_infinity=rho, **ALPHA))
    assert energy.max() < 1e-3
    assert energy[-1] == pytest.approx(-1.0, abs=0.02)  # it lies


@pytest.mark.parametrize("steps", [2, 8, pytest.param(40, marks=pytest.mark.slow)])
@pytest.mark.parametrize("time", [ALPHA, ALPHA | {"rho_infinity": 0.5}, {"integrator": "theta"}])
def test_multipliers_hold_what_falls(steps: float, time: dict[str, Any]) -> None:
    """An augmented Lagrangian lets nothing through by more than its tolerance, and gives no more than it got."""
    energy, deep = bounced(falling(PERIOD / steps, 1.5, "augmented", **time))
    assert energy.max() < 1e-3
    assert deep.max() < 1.5e-5
    assert energy[-1] == pytest.approx(-1.0, abs=1e-3)


def test_a_run_goes_on_from_its_multipliers() -> None:
    """What is saved of a run with an augmented Lagrangian is all that a continuation needs, to the last bit."""
    case = falling(PERIOD / 8, 1.0, "augmented", **ALPHA)
    first, t = DirectRun(Rod(case)), 0.0
    while t < 0.5 - 1e-9:
        t = first.step(0.5)
    state = first.save()
    assert state["multipliers"].max() > 0.0
    second = DirectRun(Rod(case))
    second.load(t, state)
    for run in (first, second):
        run.restart()
        t = 0.5
        while t < 1.0 - 1e-9:
            t = run.step(1.0)
    assert np.array_equal(first.stepper.u, second.stepper.u)
    for run in (first, second):
        run.destroy()


def test_multipliers_that_do_not_settle(monkeypatch: pytest.MonkeyPatch) -> None:
    """A step without end says whose fault it is, and what to change; steps that adapt are refused at once."""
    monkeypatch.setattr(newton, "_MOST_UPDATES", 1)
    run, t = DirectRun(Rod(falling(PERIOD / 8, 1.0, "augmented", **ALPHA))), 0.0
    with pytest.raises(SimulationError, match=r"no time step succeeds .*'augmented' is not content after 1 updates"):
        while t < 1.0 - 1e-9:
            t = run.step(1.0)
    assert t > 0.08  # the fall
    run.destroy()
    with pytest.raises(SceneError, match=r"time\.adaptive.*must be false where contact\.method = 'augmented'"):
        falling(1e-3, 1.0, "augmented", adaptive=True)


# -- a string ---------------------------------------------------------------------------------------------------------


def thrown(method: str, **keys: Any) -> Scene:
    """A string in an inclined hole whose top is spun up within a quarter of a second: it climbs and jumps."""
    return Scene.from_dict(
        {
            "model": "spatial",
            "string": [PIPE | {"length": 60.0}],
            "material": STEEL,
            "hole": {"kind": "straight", "inclination": 1.0, "diameter": 0.2},
            "contact": {"method": method, "stiffness": 1e6, "friction_static": 0.3, "friction_dynamic": 0.15},
            "top_drive": {"kind": "imposed-speed", "speed": 12.0, "rise_time": 0.25},
            "initial": {"state": "laid"},
            "ends": {"bottom": "free"},
            "mesh": {"elements": 12, "degree": 3},
            "time": {"end": 1.0, "step": 2e-3} | keys,
        }
    )


@pytest.mark.parametrize("method", ["penalty", pytest.param("augmented", marks=pytest.mark.slow)])
def test_the_balance_of_a_string_on_its_wall(method: str) -> None:
    """What the drive puts in is found again: within 1 %; what the wall keeps, and friction takes, are told apart."""
    scene = thrown(method)
    rod = Rod(scene)
    run, t = DirectRun(rod), 0.0
    at_start = rod.contact_energy()
    while t < 1.0 - 1e-9:
        t = run.step(1.0)
    row = run.row(t)
    summary = run.summary()
    run.destroy()
    assert summary["energy_balance_error"] < 0.01
    assert row["work_friction"] > 0.3 * row["work_top_drive"] > 0.0
    if method == "penalty":
        stored = row["work_wall"] - row["work_friction"]
        assert stored == pytest.approx(rod.contact_energy() - at_start, abs=2e-3 * row["work_friction"])
    else:
        assert row["penetration"] < 3e-5


@pytest.mark.verify
@pytest.mark.parametrize(
    ("method", "keys"), [("penalty", {}), ("penalty", {"retardation_time": 5e-3}), ("augmented", {"stiffness": 1e7})]
)
def test_the_balance_of_an_off_bottom_start_up(method: str, keys: dict[str, Any]) -> None:
    """2500 m in a build-and-hold well, 100 rpm within 10 s, 100 s: the balance closes within 1 %."""
    scene = Scene.from_dict(
        {
            "string": [PIPE | {"length": 2500.0, "outer_diameter": 0.146528, "inner_diameter": 0.123024}],
            "material": STEEL | {"shear_modulus": 69e9},
            "gravity": {"magnitude": 9.81},
            "hole": {
                "kind": "build",
                "kick_off": 1500.0,
                "radius": 572.9578,
                "final_inclination": math.pi / 3,
                "diameter": 0.166528,
            },
            "contact": {
                "method": method,
                "stiffness": 1e6,
                "friction_static": 0.3,
                "friction_dynamic": 0.15,
                "friction_velocity_scale": 5.0,
            }
            | keys,
            "top_drive": {"kind": "imposed-speed", "speed": "100 rpm", "rise_time": 10.0},
            "ends": {"bottom": "free"},
            "initial": {"state": "laid"},
            "mesh": {"elements": 200, "degree": 3},
            "time": {"end": 100.0, "step": 5e-3, "engine": "compiled"},
        }
    )
    run, t, worst = DirectRun(Rod(scene)), 0.0, 0.0
    while t < 100.0 - 1e-9:
        t = run.step(100.0)
        if run.steps % 100 == 0:
            run.row(t)
            worst = max(worst, run.summary()["energy_balance_error"])
    row = run.row(t)
    assert worst < 0.01
    assert run.summary()["rejected_steps"] < 10
    # the drive feeds friction
    assert row["work_friction"] == pytest.approx(row["work_top_drive"], rel=0.15)
    assert row["bit_angular_speed"] > 0.0
