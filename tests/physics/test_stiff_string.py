"""Stiff-string torque and drag: the sliding rod against closed forms, and beside the soft string."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drillfem.cli import main
from drillfem.errors import SceneError, SimulationError
from drillfem.models.rod import Rod
from drillfem.models.soft_string import line_of
from drillfem.scene import Scene, load_scene
from drillfem.solve.laid import lay
from drillfem.torque_drag import OPERATIONS, Operation, soft_string
from drillfem.torque_drag.command import study
from drillfem.torque_drag.operation import operations_of
from drillfem.torque_drag.stiff import Sliding, stiff_string

MU, RADIUS = 0.3, 0.07


def scene(
    length: float,
    hole: dict[str, Any],
    mass: float = 30.0,
    bending: float = 1e5,
    clearance: float = 0.01,
    elements: int = 60,
    stiffness: float = 1e7,
    **tables: Any,
) -> Scene:
    """A uniform string, 140 mm wide, in a hole with friction."""
    k = {"axial": 1e9, "shear": 3e8, "bending": bending, "torsion": 1e6}
    section = {
        "name": "s",
        "length": length,
        "outer_diameter": 2 * RADIUS,
        "mass_per_length": mass,
        "rotary_inertia": 1.0,
    }
    data: dict[str, Any] = {
        "string": [section | {"stiffness": k}],
        "hole": hole | {"diameter": 2 * (RADIUS + clearance)},
        "contact": {"stiffness": stiffness, "friction_static": 1.2 * MU, "friction_dynamic": MU},
        "gravity": {"magnitude": 10.0},
        "ends": {"top": "hung", "bottom": "free"},
        "initial": {"state": "laid"},
        "mesh": {"elements": elements},
        "time": {"end": 1, "step": 0.1},
    }
    return Scene.from_dict(data | tables)


@pytest.fixture(scope="module")
def inclined() -> Sliding:
    """600 m at 60 degrees."""
    hole = {"kind": "straight", "inclination": math.pi / 3, "azimuth": 0.5}
    return Sliding(Rod(replace(scene(600.0, hole, stiffness=1e5), model="spatial")))


def test_straight_inclined_hole(inclined: Sliding) -> None:
    """Side force w sin(i), hook load w cos(i) +- mu of it; turning it climbs, and presses less by sqrt(1 + mu^2)."""
    laid = lay(inclined.rod)
    across, along = 300.0 * math.sin(math.pi / 3), 300.0 * math.cos(math.pi / 3)
    climbs = math.sqrt(1 + MU**2)
    expected = {
        "tripping-out": (across, along + MU * across, 0.0),
        "tripping-in": (across, along - MU * across, 0.0),
        "rotating": (across / climbs, along, MU * RADIUS * across / climbs),
    }
    for name, (side, slope, twist) in expected.items():
        found = inclined.operate(laid, OPERATIONS[name])
        s = found.measured_depth
        inside = (s > 60) & (s < 540)
        np.testing.assert_allclose(found.side_force[inside], side, rtol=1e-3)
        # tension and torque fall at these rates; at the ends, the string leaves the wall a little
        assert -np.polyfit(s[inside], found.tension[inside], 1)[0] == pytest.approx(slope, rel=1e-3)
        assert -np.polyfit(s[inside], found.torque[inside], 1)[0] == pytest.approx(twist, rel=1e-3, abs=1e-6)
        assert found.hook_load == pytest.approx(600 * slope, rel=1e-2)
        assert found.surface_torque == pytest.approx(600 * twist, rel=1e-2, abs=1e-3)
        # what the top carries is what acts below it: forces along the hole, all of them
        rubbed = np.trapezoid(found.side_force, s)
        share = {"tripping-out": MU, "tripping-in": -MU, "rotating": 0.0}[name]
        assert found.hook_load == pytest.approx(600 * along + share * rubbed, rel=2e-3)
        assert found.touching[1:-1].mean() > 0.9 and found.gap.min() < 0 < found.bending_moment.max()


def test_rotation_frees_the_string_axially(inclined: Sliding) -> None:
    """Friction points against the motion: turned fast, the string hardly drags."""
    laid = lay(inclined.rod)
    free, out = (inclined.operate(laid, OPERATIONS[k]).hook_load for k in ("rotating", "tripping-out"))
    both = inclined.operate(laid, Operation("reaming", "back-reaming", speed=-0.1, spin=10.0))
    share = 0.1 / math.hypot(0.1, 10.0 * RADIUS)
    # turning, the side force is less by the climbing
    assert (both.hook_load - free) / (out - free) == pytest.approx(share, rel=0.06)
    static = Sliding(inclined.rod, "static")
    assert static.operate(laid, OPERATIONS["tripping-out"]).hook_load - free == pytest.approx(
        1.2 * (out - free), rel=1e-3
    )


def test_torque_that_winds_the_string_up_many_times_is_found() -> None:
    hole = {"kind": "straight", "inclination": 1.5}
    sliding = Sliding(Rod(replace(scene(900.0, hole, mass=60.0, elements=40), model="spatial")))
    load = replace(OPERATIONS["drilling"], weight_on_bit=2e4, torque_on_bit=3e3)
    found = sliding.operate(lay(sliding.rod), load)
    rate = MU * RADIUS * 600 * math.sin(1.5) / math.sqrt(1 + MU**2)
    assert found.surface_torque == pytest.approx(3e3 + rate * 900, rel=0.01)
    assert found.torque[-1] == 3e3 and found.tension[-1] == -2e4
    twist = (3e3 + rate * 450) * 900 / 1e6
    assert twist > 2 * math.pi  # more than once round


def test_capstan() -> None:
    """A light string pulled round a bend: the tension changes by exp(mu theta) within 0.3 %."""
    radius, turn, pull = 200.0, math.pi / 2, 1e6
    # gravity towards the inside of the bend, where the pull will hold the string
    gravity = {"magnitude": 10.0, "direction": [math.sqrt(0.5), 0.0, -math.sqrt(0.5)]}
    case = scene(radius * turn, {"kind": "arc", "radius": radius}, 0.03, 1e4, 1e-3, 60, gravity=gravity)
    sliding = Sliding(Rod(replace(case, model="spatial")))
    laid = lay(sliding.rod)
    for name, sign in (("tripping-out", 1), ("tripping-in", -1)):
        found = sliding.operate(laid, replace(OPERATIONS[name], weight_on_bit=-pull))
        assert found.hook_load / pull == pytest.approx(math.exp(sign * MU * turn), rel=3e-3)
    turning = sliding.operate(laid, replace(OPERATIONS["rotating"], weight_on_bit=-pull))
    assert turning.surface_torque == pytest.approx(MU * RADIUS * pull * turn / math.sqrt(1 + MU**2), rel=5e-3)
    assert turning.hook_load == pytest.approx(pull, rel=1e-3)


def test_well_a_beside_the_soft_string() -> None:
    """A smooth well: the rod's hook load is the soft string's but for its stretch, its torque but for the climbing."""
    case = load_scene("off-bottom", {"mesh.elements": 100})
    operations = operations_of(case, ["tripping-in", "drilling"], 50e3, 3e3)
    line = line_of(case)
    for found in stiff_string(case, operations):
        soft = soft_string(line, found.operation, buckled=False)
        assert found.hook_load == pytest.approx(soft.hook_load, rel=1e-3)
        rubbed = soft.surface_torque - found.operation.torque_on_bit
        climbs = math.sqrt(1 + case.contact.friction_dynamic**2) if case.contact else 1.0
        if found.operation.spin:
            torque = found.operation.torque_on_bit + rubbed / climbs
            assert found.surface_torque == pytest.approx(torque, rel=3e-3)
        else:
            assert abs(found.surface_torque) < 10.0
        # bent to the hole: EI/R
        stiffness = case.string[0].section_stiffness().bending1
        assert found.bending_moment.max() == pytest.approx(stiffness / 572.96, rel=0.15)


def test_command_puts_it_beside_the_soft_string(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "td"
    arguments = ["torque-drag", "off-bottom", "--out", str(out), "--method", "soft", "--method", "stiff"]
    assert main([*arguments, "--operation", "tripping-out", "--set", "mesh.elements=40"]) == 0
    soft, stiff = json.loads((out / "torque-drag.json").read_text())["operations"]
    assert (soft["method"], stiff["method"]) == ("soft", "stiff")
    assert stiff["hook_load"] == pytest.approx(soft["hook_load"], rel=2e-3)
    assert "stiff" in capsys.readouterr().out


def test_says_that_the_mesh_cannot_see_buckling() -> None:
    """A level string pushed beyond its snaking load (370 kN), on elements of 20 m and on ones of 4 m."""
    hole = {"kind": "straight", "inclination": math.pi / 2}
    for elements, blind in ((3, True), (15, False)):
        case = scene(60.0, hole, 26.83, 1.279e6, elements=elements)
        for weight in (3e5, 5e5):
            notes = study(case, ["sliding"], ["stiff"], weight).notes
            assert any("cannot see the string buckle" in note for note in notes) == (blind and weight > 4e5)


def test_says_how_far_it_got(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: Any) -> None:
    solve = Sliding.solve

    def gives_up(self: Sliding, x: np.ndarray, at: np.ndarray, *arguments: Any, **more: Any) -> Any:
        if at[-1] > 0.7 and self.speed.value < 0:
            raise SimulationError("no")
        return solve(self, x, at, *arguments, **more)

    monkeypatch.setattr(Sliding, "solve", gives_up)
    arguments = ["torque-drag", "off-bottom", "--out", str(tmp_path / "td"), "--method", "stiff"]
    trips = ["--operation", "tripping-out", "--operation", "tripping-in"]
    assert main([*arguments, *trips, "--set", "mesh.elements=40"]) == 0
    out, into = json.loads((tmp_path / "td" / "torque-drag.json").read_text())["operations"]
    assert out["hook_load"] is None and into["hook_load"] > 7e5
    printed = capsys.readouterr().out
    share = re.search(r"stiff string, tripping out: no equilibrium found beyond (\S+) % of loads", printed)
    assert share and 69 < float(share[1]) <= 70


def test_needs_a_hole() -> None:
    with pytest.raises(SceneError, match="needs a hole"):
        stiff_string(load_scene("pendulum"), [OPERATIONS["rotating"]])


@pytest.mark.verify
def test_hook_load_and_torque_converge() -> None:
    """Against four times the elements, P11-A-02: the error falls, and is below 1e-3 from 300 elements on."""
    errors = {}
    operations = [OPERATIONS["tripping-out"], OPERATIONS["rotating"]]

    def numbers(elements: int) -> np.ndarray:
        out, turned = stiff_string(load_scene("survey-p11-a-02", {"mesh.elements": elements}), operations)
        return np.array([out.hook_load, turned.surface_torque])

    exact = numbers(1200)
    for elements in (150, 300, 600):
        errors[elements] = np.abs(numbers(elements) / exact - 1).max()
    assert errors[300] < 2e-3
    assert errors[600] < 0.6 * errors[150]
