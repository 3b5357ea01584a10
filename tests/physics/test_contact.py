"""Contact: what a wall carries of a string at rest, by every method; multipliers; the closest point as an unknown."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from rodlab import Array, order

from drillfem.errors import SimulationError
from drillfem.models.rod import Rod
from drillfem.scene import Scene
from drillfem.solve import statics
from drillfem.solve.direct import DirectRun
from drillfem.solve.laid import lay

METHODS = ("penalty", "smooth", "augmented")
STEEL = {"youngs_modulus": 210e9, "shear_modulus": 77e9, "density": 7850.0}
PIPE = {"name": "pipe", "outer_diameter": 0.127, "inner_diameter": 0.108}
FRICTION = {"friction_static": 0.3, "friction_dynamic": 0.15}


def scene(length: float, elements: int, hole: dict[str, Any], method: str = "penalty", **tables: Any) -> Scene:
    data: dict[str, Any] = {
        "model": "spatial",
        "string": [PIPE | {"length": length}],
        "material": STEEL,
        "hole": {"diameter": 0.2} | hole,
        "contact": {"method": method, "stiffness": 1e6} | FRICTION,
        "ends": {"top": "hung", "bottom": "free"},
        "initial": {"state": "laid"},
        "mesh": {"elements": elements, "degree": 3},
        "time": {"end": 1.0, "step": 5e-3},
    }
    return Scene.from_dict({k: data.get(k, {}) | v if isinstance(v, dict) else v for k, v in (data | tables).items()})


def laid(case: Scene) -> tuple[Rod, Array]:
    """A string at rest in its hole, and the normal force per length (points,; N/m) on it."""
    rod = Rod(case)
    u = lay(rod)
    rod.set_state(u, np.zeros_like(u))
    assert rod.wall is not None and case.contact is not None
    return rod, rod.wall.side_force(u, case.contact)


# -- at rest ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
def test_the_wall_carries_the_weight_across_the_hole(method: str) -> None:
    """Where a string lies straight in an inclined hole the side force is w sin(i)."""
    case = scene(100.0, 40, {"kind": "straight", "inclination": 1.0}, method)
    rod, force = laid(case)
    assert rod.wall is not None
    middle = (rod.wall.arc_length > 30) & (rod.wall.arc_length < 70)
    w = case.string[0].mass_per_length * case.gravity.magnitude
    assert force[middle] == pytest.approx(w * math.sin(1.0), rel=1e-3)
    # all of it, but for what the ends hold across the hole: the top bears the rest
    assert 0.9 < force @ rod.wall.weights / (100.0 * w * math.sin(1.0)) < 1.0


@pytest.mark.parametrize("method", ["penalty", "augmented"])
def test_the_side_force_in_a_bend(method: str) -> None:
    """Build and hold: |w sin(i) - F kappa| in the bend (spec 6), with F the weight that hangs below, and w sin(i) below
    the bend; away from the kinks of the curvature, and from where the string changes sides."""
    radius, kick_off, final = 573.0, 1500.0, math.pi / 3
    hole = {"kind": "build", "kick_off": kick_off, "radius": radius, "final_inclination": final}
    case = scene(2500.0, 200, hole, method)
    rod, force = laid(case)
    assert rod.wall is not None
    s, w = rod.wall.arc_length, case.string[0].mass_per_length * case.gravity.magnitude
    end = kick_off + radius * final
    i = np.clip((s - kick_off) / radius, 0, final)
    below = w * (2500.0 - end) * math.cos(final)
    F = np.where(s < end, below + w * radius * (math.sin(final) - np.sin(i)), 0.0)
    side = w * np.sin(i) - F * (s < end) / radius
    crossing = s[(s > kick_off) & (s < end)][np.abs(side[(s > kick_off) & (s < end)]).argmin()]
    off = np.minimum(np.abs(s - kick_off), np.abs(s - end))
    fair = (s > kick_off) & (s < 2450.0) & (off > 60) & (np.abs(s - crossing) > 80)
    assert np.abs(force - np.abs(side))[fair].max() < 1e-2 * w
    assert force[s < kick_off - 60].max() == 0.0


def test_multipliers_need_no_stiff_wall() -> None:
    """The penetration is below its tolerance and the forces are the same whatever the stiffness."""
    found = []
    for stiffness in (1e5, 1e6, 1e8):
        contact = {"stiffness": stiffness, "penetration_tolerance": 1e-6}
        rod, force = laid(scene(100.0, 10, {"kind": "straight", "inclination": 1.0}, "augmented", contact=contact))
        assert rod.wall is not None and -1e-6 <= rod.wall.gap < 0.0
        found.append(force)
    assert np.abs(np.diff(found, axis=0)).max() < 0.02 * found[0].max()


def test_multipliers_that_do_not_get_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(statics, "MOST_UPDATES", 3)
    case = scene(100.0, 10, {"kind": "straight", "inclination": 1.0}, "augmented", contact={"stiffness": 1e4})
    with pytest.raises(SimulationError, match=r"leaves a penetration of .* after 3 updates.*larger contact.stiffness"):
        lay(Rod(case))


# -- in time ----------------------------------------------------------------------------------------------------------


def spun_up(method: str, elements: int = 12, step: float = 5e-3, **contact: Any) -> Scene:
    """A string in a bend, its top spun up."""
    hole = {"kind": "build", "kick_off": 30.0, "radius": 80.0, "final_inclination": 0.9}
    return scene(
        140.0,
        elements,
        hole,
        method,
        contact=contact,
        top_drive={"kind": "imposed-speed", "speed": SPIN, "rise_time": 0.2},
        ends={"top": "driven"},
        time={"step": step},
    )


SPIN = 8.0


def advance(run: DirectRun, t: float, end: float) -> float:
    while t < end - 1e-9:
        t = run.step(end)
    return t


@pytest.mark.slow
def test_a_run_goes_on_from_its_multipliers_and_depths() -> None:
    """Augmented, closest point unknown: what is saved is all that a continuation needs, to the last bit."""
    case = spun_up("augmented", closest_point="field")
    first = DirectRun(Rod(case))
    t = advance(first, 0.0, 0.1)
    state = first.save()
    first.restart()
    second = DirectRun(Rod(case))
    second.load(t, state)
    second.restart()
    for run in (first, second):
        advance(run, t, 0.2)
    assert np.array_equal(first.stepper.u, second.stepper.u)
    assert first.rod.wall is not None and first.rod.wall.multipliers.max() > 0
    assert first.row(0.2)["penetration"] < 3e-5
    for run in (first, second):
        run.destroy()


@pytest.mark.slow
def test_the_closest_point_as_an_unknown() -> None:
    """(D-6): exact at the nodes, between them off by what its interpolation is off. The same motion as by local
    projection, the nearer the finer the mesh."""
    sizes, errors, motions = (8, 16, 32), [], []
    for elements in sizes:
        runs = {kind: DirectRun(Rod(spun_up("penalty", elements, closest_point=kind))) for kind in ("newton", "field")}
        for run in runs.values():
            advance(run, 0.0, 0.2)
        rod = runs["field"].rod
        assert rod.wall is not None
        u = runs["field"].stepper.u
        block = u.reshape(-1, rod.ansatz.size)
        exact = rod.wall.hole.nearest(block[:, :3])
        assert np.abs(block[:, rod.ansatz.index("hole_depth")] - exact).max() < 1e-5
        rod.set_state(u, np.zeros_like(u))
        errors.append(np.abs(rod.wall.p - rod.wall.hole.nearest(rod.wall.position(u))).max())
        r = [run.stepper.u.reshape(-1, run.rod.ansatz.size)[:, :3] for run in runs.values()]
        motions.append(np.abs(r[0] - r[1]).max())
        assert runs["field"].stepper.newton.iterations < 1.1 * runs["newton"].stepper.newton.iterations
        for run in runs.values():
            run.destroy()
    # where the curvature jumps the interpolation of p has no more than that order, if any
    assert errors[-1] < 1e-4 and errors[-1] < errors[0] / 10
    assert motions[-1] < 1e-6 and order([1 / n for n in sizes], motions) > 2.5
