"""Friction on the wall: a rope in a bend, a turning pipe that climbs, rotation that frees, friction along the hole."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from rodlab import Array

from drillfem.models.rod import Rod
from drillfem.scene import Scene
from drillfem.solve.direct import DirectRun
from drillfem.solve.laid import lay
from drillfem.torque_drag.operation import Operation
from drillfem.torque_drag.stiff import Sliding

STEEL = {"youngs_modulus": 210e9, "shear_modulus": 77e9, "density": 7850.0}
PIPE = {"name": "pipe", "length": 100.0, "outer_diameter": 0.127, "inner_diameter": 0.108}
INCLINATION, SPEED, MU = 1.0, 5.0, 0.3


def slid(rod: Rod, speed: float, spin: float) -> tuple[float, float]:
    """Hook load (N) and torque (N m) at the top of a string that slides steadily; its state stays in ``rod``."""
    sliding = Sliding(rod)
    profile = sliding.operate(lay(rod), Operation("", "", speed=speed, spin=spin))
    return profile.hook_load, profile.surface_torque


# -- a rope in a bend -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("towards", [-1.0, 1.0])
def test_capstan(towards: float) -> None:
    """A limp rope pulled out of an arc, or let down it: the tension goes with exp(+-mu theta)."""
    angle, radius, pull = 1.2, 100.0, 1e5
    section = {
        "name": "rope",
        "length": angle * radius,
        "outer_diameter": 0.02,
        "stiffness": {"axial": 6.6e7, "shear": 2.5e7, "bending": 50.0, "torsion": 50.0},
        "mass_per_length": 2.5,
        "rotary_inertia": 1e-4,
    }
    rod = Rod(
        Scene.from_dict(
            {
                "model": "spatial",
                "string": [section],
                "gravity": {"magnitude": 0},
                "hole": {"kind": "arc", "radius": radius, "diameter": 0.03},
                "contact": {"stiffness": 1e8, "friction_static": MU, "friction_dynamic": MU},
                "ends": {
                    "top": "hung",
                    "bottom": "free",
                    "tip_force": [pull * math.sin(angle), 0.0, pull * math.cos(angle)],
                },
                "initial": {"state": "laid"},
                "mesh": {"elements": 120, "degree": 3},
                "time": {"end": 1.0, "step": 0.01},
            }
        )
    )
    hook_load, _ = slid(rod, towards, 0.0)
    whole = hook_load / pull / math.exp(-towards * MU * angle)
    # the ends come off the wall: the rope touches over sqrt(2 c/R) = 0.01 rad less
    assert whole == pytest.approx(math.exp(towards * MU * 0.01), rel=5e-4)
    assert whole == pytest.approx(1.0, rel=5e-3)
    tension, d3, s = (rod.fields()[name] for name in ("axial_force", "director3", "arc_length"))
    a, b = np.searchsorted(s, [0.1 * rod.length, 0.9 * rod.length])
    between = math.acos(d3[a] @ d3[b])
    assert tension[a] / tension[b] == pytest.approx(math.exp(-towards * MU * between), rel=5e-4)


# -- a pipe in an inclined hole ---------------------------------------------------------------------------------------


def pipe(**tables: Any) -> Scene:
    """A pipe in a straight, inclined hole, its top on the axis."""
    data: dict[str, Any] = {
        "model": "spatial",
        "string": [PIPE],
        "material": STEEL,
        "hole": {"kind": "straight", "inclination": INCLINATION, "diameter": 0.2},
        "contact": {"stiffness": 1e6, "friction_static": MU, "friction_dynamic": MU},
        "ends": {"top": "hung", "bottom": "free"},
        "initial": {"state": "laid"},
        "mesh": {"elements": 40, "degree": 3},
        "time": {"end": 1.0, "step": 5e-3},
    }
    return Scene.from_dict({k: data.get(k, {}) | v if isinstance(v, dict) else v for k, v in (data | tables).items()})


@cache
def lying() -> tuple[Rod, Array]:
    rod = Rod(pipe())
    return rod, lay(rod)


def weight(scene: Scene) -> float:
    """Across the hole, per length (N/m)."""
    return scene.string[0].mass_per_length * scene.gravity.magnitude * math.sin(INCLINATION)


@pytest.mark.parametrize(("speed", "spin"), [(0.0, SPEED), (1.0, 0.0), (0.1, SPEED), (-1.0, SPEED)])
def test_a_sliding_pipe(speed: float, spin: float) -> None:
    """It climbs until weight and friction across the hole balance, N = w sin(i) cos(a) with tan(a) = mu by rotation;
    axial friction is mu N v/|v_c|: rotation frees the string, by exactly this share."""
    rod, laid = lying()
    scene = rod.scene
    radius, w = scene.string[0].contact_radius, weight(scene)
    Sliding(rod).operate(laid, Operation("", "", speed=speed, spin=spin))
    about = spin * radius
    share_along, share_about = speed / math.hypot(speed, about), about / math.hypot(speed, about)
    climbs = math.atan(MU * share_about)
    N = w * math.cos(climbs)
    assert rod.wall is not None and scene.contact is not None
    s, force = rod.wall.arc_length, rod.wall.side_force(rod.u.x.array, scene.contact)
    middle = (s > 30) & (s < 70)
    assert force[middle] == pytest.approx(N, rel=1e-3)
    f = rod.fields()
    a, b = np.searchsorted(f["arc_length"], [30.0, 70.0])
    length = f["arc_length"][b] - f["arc_length"][a]
    torque = (f["torque"][b] - f["torque"][a]) / length
    assert torque == pytest.approx(MU * N * radius * share_about, rel=1e-3, abs=1e-6 * w)
    drag = w / math.tan(INCLINATION) - (f["axial_force"][a] - f["axial_force"][b]) / length
    assert drag == pytest.approx(MU * N * share_along, rel=1e-3, abs=1e-4 * w)
    # it lies where friction has pushed it, against the velocity t x down of what touches
    place = f["position"][(a + b) // 2]
    frame = rod.wall.hole.frame(rod.wall.hole.nearest(place[None]))
    offset, t = place - frame.position[0], frame.tangent[0]
    down = np.array([0.0, 0.0, 1.0]) - t[2] * t
    down /= np.linalg.norm(down)
    assert math.atan2(-offset @ np.cross(t, down), offset @ down) == pytest.approx(climbs, abs=1e-3)


def test_break_off_torque() -> None:
    """A string that is about to turn in well A: mu_s r times the soft string's side forces, less 1/sqrt(1 + mu_s^2) for
    it climbs before it slips."""
    length, radius, kick_off, final = 2500.0, 573.0, 1500.0, math.pi / 3
    case = pipe(
        string=[PIPE | {"length": length}],
        hole={"kind": "build", "kick_off": kick_off, "radius": radius, "final_inclination": final, "inclination": 0.0},
        contact={"friction_dynamic": MU / 2},
        mesh={"elements": 200},
    )
    rod = Rod(case)
    found = Sliding(rod, "static").operate(lay(rod), Operation("", "", spin=1.0)).surface_torque
    s = np.linspace(0, length, 100_001)
    w, end = case.string[0].mass_per_length * case.gravity.magnitude, kick_off + radius * final
    i = np.clip((s - kick_off) / radius, 0, final)
    F = w * (length - end) * math.cos(final) + w * radius * (math.sin(final) - np.sin(i))
    side = np.abs(w * np.sin(i) - F * ((s > kick_off) & (s < end)) / radius)
    soft = MU * case.string[0].contact_radius * float(np.trapezoid(side, s))
    assert found == pytest.approx(soft / math.hypot(1, MU), rel=5e-3)


# -- in time ----------------------------------------------------------------------------------------------------------


def turned(scene: Scene) -> dict[str, Array]:
    """Fields at the end of a run."""
    run, t = DirectRun(Rod(scene)), 0.0
    while t < scene.time.end - 1e-9:
        t = run.step(scene.time.end)
    fields = run.fields()
    run.destroy()
    return fields


def slope(fields: dict[str, Array], name: str, top: float, bottom: float) -> float:
    """How much a field changes per metre between two places on the string."""
    a, b = np.searchsorted(fields["arc_length"], [top, bottom])
    f, s = fields[name], fields["arc_length"]
    return float((f[b] - f[a]) / (s[b] - s[a]))


def test_torque_grows_where_the_hole_is_rough() -> None:
    """A pipe turns in a hole that is cased down to 50 m: the torque per metre is that of each stretch."""
    scene = pipe(
        material=STEEL | {"retardation_time": 0.02},
        hole={"section": [{"to": 50.0, "friction_static": 0.1, "friction_dynamic": 0.1}]},
        contact={"friction_velocity_scale": 100.0},
        top_drive={"kind": "imposed-speed", "speed": SPEED, "rise_time": 0.5},
        ends={"top": "driven"},
        mesh={"elements": 20},
        time={"end": 3.0},
    )
    fields, w, radius = turned(scene), weight(scene), scene.string[0].contact_radius
    for mu, top, bottom in ((0.1, 15.0, 40.0), (MU, 60.0, 85.0)):
        expected = mu * w * radius / math.hypot(1, mu)
        assert slope(fields, "torque", top, bottom) == pytest.approx(expected, rel=0.03)
