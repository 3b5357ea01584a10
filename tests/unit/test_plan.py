"""Which model a scene needs: the rules of the ladder with their numbers, `auto`, and `drillfem plan`."""

from __future__ import annotations

import json
import math
import time
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import xarray as xr

from drillfem import cli
from drillfem.errors import SceneError
from drillfem.plan import as_text, plan_of
from drillfem.plan.pilot import Pilot, Signal, _laid, deviation
from drillfem.plan.survey import _rung
from drillfem.results import Result
from drillfem.scene import Scene, load_scene
from drillfem.scene.ladder import (
    MODELS,
    Growing,
    axial_rule,
    bend_of,
    buckling_rule,
    critical_weight,
    distance,
    findings,
    giver,
    growing_motions,
    hole_rule,
    inclination_of,
    lowest,
    modes_of,
    obstacle,
    rank,
    side_load_rule,
    tension,
    torsional_rule,
)
from drillfem.scene.tables import GIVES, Hole
from drillfem.stability.loop import DrillingLoop, pitch
from drillfem.stability.transfer import Waves

Over = dict[str, Any]
DEGREE = math.pi / 180


def surveyed(*stations: tuple[float, float, float]) -> Scene:
    """The thesis' string in a surveyed hole: rows of measured depth (m), inclination and azimuth (rad)."""
    scene = load_scene("vertical-c1-cd4")
    return replace(scene, hole=Hole("survey", scene.hole.diameter, survey=stations))


def column(length: float, **ends: str) -> Scene:
    """A hanging rod of EI = w = 1."""
    return Scene.from_dict(
        {
            "string": [
                {
                    "name": "rod",
                    "length": length,
                    "stiffness": {"axial": 1e6, "shear": 1e6, "bending": 1.0, "torsion": 1.0},
                    "mass_per_length": 1.0,
                    "rotary_inertia": 1e-3,
                }
            ],
            "gravity": {"magnitude": 1.0},
            "ends": {"top": "pinned", "bottom": "guided", **ends},
            "initial": {"state": "rest"},
            "time": {"end": 1.0, "step": 0.1},
        }
    )


# -- the hole: trap 1, a "straight" hole with a dogleg ----------------------------------------------------
def test_a_straight_hole_with_a_dogleg_is_not_straight() -> None:
    scene = surveyed((0, 0, 0), (600, 0, 0), (630, 3 * DEGREE, 0), (660, 0, 0), (1300, 0, 0))
    choice = lowest(scene)
    assert choice.name == "spatial"
    assert "bends by 3 deg per 30 m" in choice.reason
    assert all("bends" in obstacle(scene, m) for m in MODELS[:3])
    found = hole_rule(scene)
    assert found.needs == "spatial"
    curvature = 3 * DEGREE / 30
    collars = scene.string[1]
    numbers = found.numbers
    assert numbers["curvature"] == pytest.approx(curvature, rel=1e-8)
    assert numbers["bending_moment"] == pytest.approx(collars.section_stiffness().bending1 * curvature)
    assert numbers["bending_stress"] == pytest.approx(210e9 * 0.0762 * curvature)
    # tension at the middle of the sharpest interval, 615 m (or 645 m): hook load less the weight above
    per_metre = scene.string[0].mass_per_length * 9.80665
    hook = scene.nominal().hook_load
    assert numbers["side_force"] == pytest.approx((hook - 630 * per_metre) * curvature, rel=0.03)
    # capstan: 6 degrees in all, at most the hook load; within 5 m the bend turns over, which takes some off
    assert numbers["friction_torque"] == pytest.approx(0.15 * 0.0762 * hook * (6 - 0.25) * DEGREE, rel=1e-3)


def test_the_same_survey_without_the_dogleg_is_straight() -> None:
    scene = surveyed((0, 0, 0), (600, 0, 0), (1300, 0, 0))
    assert bend_of(scene) is None
    assert lowest(scene) == lowest(load_scene("vertical-c1-cd4"))
    assert hole_rule(scene).needs == "lumped"


def test_a_turn_in_azimuth_alone_is_a_dogleg() -> None:
    bend = bend_of(surveyed((0, 0.5, 0.0), (600, 0.5, 0.0), (630, 0.5, 0.1), (1300, 0.5, 0.1)))
    assert bend is not None
    exact = math.acos(math.cos(0.5) ** 2 + math.sin(0.5) ** 2 * math.cos(0.1))  # minimum curvature
    assert bend.turn == pytest.approx(exact, rel=1e-4)
    assert bend.curvature == pytest.approx(exact / 30, rel=1e-8)


def test_an_inclined_straight_hole_loads_the_string_from_the_side() -> None:
    scene = surveyed((0, 0.2, 0), (1300, 0.2, 0))
    assert bend_of(scene) is None
    assert inclination_of(scene) == pytest.approx(0.2)
    assert lowest(scene).name == "spatial"
    load = side_load_rule(scene)
    assert load.needs == "spatial"
    assert load.numbers["side_load"] == pytest.approx(scene.string[1].mass_per_length * 9.80665 * math.sin(0.2))


#: string, and what it drills in 200 s
REACH = 1200 + 200 * load_scene("vertical-c1-cd4").nominal().rate_of_penetration


@pytest.mark.parametrize(
    "hole, curvature, turn, inclination",
    [
        (Hole("arc", 0.3, radius=2000.0), 1 / 2000, REACH / 2000, REACH / 2000),
        (Hole("build", 0.3, kick_off=300.0, radius=573.0, final_inclination=0.5), 1 / 573, 0.5, 0.5),
        # radius 100 m, 300 m down per turn: curvature r/(r^2 + (pitch/2 pi)^2)
        (Hole("helix", 0.3, radius=100.0, pitch=300.0), 100 / (100**2 + (150 / math.pi) ** 2), None, None),
    ],
)
def test_a_hole_is_what_its_geometry_is(
    hole: Hole, curvature: float, turn: float | None, inclination: float | None
) -> None:
    scene = replace(load_scene("vertical-c1-cd4"), hole=hole)
    bend = bend_of(scene)
    assert bend is not None
    assert bend.curvature == pytest.approx(curvature, rel=1e-6)
    assert scene.gain() == pytest.approx(REACH - 1200, rel=1e-6)
    assert bend.turn == pytest.approx(turn or REACH * curvature, rel=1e-3)
    expected = math.atan(2 * math.pi * 100 / 300) if inclination is None else inclination
    assert inclination_of(scene) == pytest.approx(expected, rel=1e-6)
    assert lowest(scene).name == "spatial"


def test_a_bent_string_in_a_straight_hole_is_noticed() -> None:
    scene = load_scene("bend-45")
    found = hole_rule(scene)
    assert found.needs == "spatial"
    assert found.numbers["curvature"] == pytest.approx(1 / 100)
    assert "the string bends" in found.text


# -- buckling: trap 2 -------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("weight", "model"), [("45.7 kN", "axial-torsional"), ("56.5 kN", "axial-torsional"), ("57.1 kN", "spatial")]
)
def test_a_vertical_string_above_buckling_needs_the_spatial_rung(weight: str, model: str) -> None:
    scene = load_scene("vertical-c1-cd4", {"top_drive.weight_on_bit": weight})
    assert scene.resolved_model().name == model
    found = buckling_rule(scene)
    assert found.numbers["critical"] == pytest.approx(56.81e3, rel=1e-3)
    # the same load on a bit that may tilt would have buckled it
    assert found.numbers["critical_tilting"] < 45.7e3 < found.numbers["critical"]
    assert (found.needs == "spatial") == (found.numbers["compression"] > found.numbers["critical"])


def test_lubinskis_number() -> None:
    """field.md 3.3: 1.937 w m at L/m = 8, pinned at both ends."""
    assert critical_weight(column(8.0)) == pytest.approx(1.937, abs=5e-4)


@pytest.mark.parametrize(
    ("ends", "factor"),
    [
        ({"top": "pinned", "bottom": "guided"}, math.pi**2),
        ({"top": "clamped", "bottom": "clamped"}, 4 * math.pi**2),
        ({"top": "pinned", "bottom": "clamped"}, 20.1907),
        ({"top": "clamped", "bottom": "free"}, math.pi**2 / 4),
    ],
)
def test_without_weight_the_column_is_eulers(ends: dict[str, str], factor: float) -> None:
    scene = column(2.0, **ends)
    scene = replace(scene, gravity=replace(scene.gravity, magnitude=0.0))
    assert critical_weight(scene) == pytest.approx(factor / 4, rel=1e-4)


def test_a_standing_column_buckles_under_itself_at_greenhills_length() -> None:
    """Clamped at the bottom, free at the top: w L^3 / EI = 7.8373."""
    greenhill = 7.8373 ** (1 / 3)
    short, tall = (column(f * greenhill, top="free", bottom="free") for f in (0.99, 1.01))
    # hung upside down: clamped above, with the weight pushing
    for scene, stands in ((short, True), (tall, False)):
        upside_down = replace(
            scene,
            ends=replace(scene.ends, top="clamped", bottom="free"),
            gravity=replace(scene.gravity, direction=(0.0, 0.0, -1.0)),
        )
        assert (critical_weight(upside_down) > 0) == stands


def test_pulled_pipe_hangs_and_does_not_buckle() -> None:
    scene = column(8.0, top="clamped", bottom="free")
    found = buckling_rule(scene)
    assert found.needs == "lumped"
    assert found.numbers["tension"] == 0.0
    pull = tension(scene)
    assert pull is not None
    assert pull[1].tolist() == pytest.approx([8.0, 0.0])
    pushed = replace(scene, ends=replace(scene.ends, bottom="guided", tip_force=(0.0, 0.0, -5.0)))
    assert buckling_rule(pushed).needs == "planar"  # no hole, no bit: it bows in a plane
    assert lowest(pushed).name == "planar"


def test_a_string_between_two_clamps_shares_its_weight() -> None:
    pull = tension(column(8.0, top="clamped", bottom="clamped"))
    assert pull is not None
    assert pull[1].tolist() == pytest.approx([4.0, -4.0])


# -- wanted outputs: trap 3 -------------------------------------------------------------------------------
def test_wanted_bending_stress_needs_a_rung_that_bends() -> None:
    scene = load_scene("vertical-c1-cd4", {"output.wanted": '["bit_torque", "bending_stress"]'})
    choice = scene.resolved_model()
    assert choice.name == "spatial"
    assert "bending_stress" in choice.reason
    assert load_scene("vertical-c1-cd4").resolved_model().name == "axial-torsional"


@pytest.mark.parametrize("name", [name for names in GIVES.values() for name in names])
def test_auto_gives_what_is_wanted(name: str) -> None:
    scene = load_scene("vertical-v1", {"model": "auto", "output.wanted": [name]})
    chosen = scene.resolved_model().name
    assert rank(chosen) >= rank(giver(name))
    assert not obstacle(scene, chosen)
    below = MODELS[: rank(giver(name))]
    assert all(name in obstacle(scene, m) for m in below)


def test_an_explicit_model_must_give_what_is_wanted() -> None:
    with pytest.raises(SceneError, match=r"model = 'torsional': must be one of spatial, auto .*bending_stress"):
        load_scene("vertical-c1-cd4", {"model": "torsional", "output.wanted": '["bending_stress"]'})


def test_wanted_outputs_have_known_names() -> None:
    with pytest.raises(SceneError, match="did you mean 'bending_stress'"):
        load_scene("vertical-c1-cd4", {"output.wanted": '["bending_stres"]'})
    with pytest.raises(SceneError, match=r"output\.tolerance"):
        load_scene("vertical-c1-cd4", {"output.tolerance": 1.5})


def test_wanted_outputs_go_round() -> None:
    scene = load_scene("vertical-c1-cd4", {"output.wanted": '["side_force"]', "output.tolerance": 0.02})
    assert Scene.from_dict(json.loads(json.dumps(scene.to_dict()))) == scene


def test_a_shaft_that_only_twists_is_torsional_where_only_twist_is_wanted() -> None:
    over = {"top_drive.axis": "[0, 0, 1]"}
    assert load_scene("spin-up", over).resolved_model().name == "axial-torsional"
    assert load_scene("spin-up", over | {"output.wanted": '["torque"]'}).resolved_model().name == "torsional"
    assert load_scene("spin-up", over | {"output.wanted": '["axial_force"]'}).resolved_model().name == "axial-torsional"


# -- waves ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("scene", "published"),
    [  # spec 9.7, E = 210 GPa
        ("vertical-c1-cd2", []),
        ("vertical-c1-cd3", [Growing(13.20, 0.51)]),
        ("vertical-c1-cd4", [Growing(13.34, 1.87), Growing(11.64, 0.39)]),
    ],
)
def test_axial_self_excitation_of_the_thesis_string(scene: str, published: list[Growing]) -> None:
    loaded = load_scene(scene)
    whole = growing_motions(loaded, axial_waves=True)
    assert len(whole) == len(published)
    for found, expected in zip(whole, published, strict=True):
        assert found.frequency == pytest.approx(expected.frequency, abs=0.01)
        assert found.growth == pytest.approx(expected.growth, abs=0.01)
    rigid = growing_motions(loaded, axial_waves=False)
    assert [g.frequency for g in rigid] == pytest.approx([9.10], abs=0.01)
    rule = axial_rule(loaded)
    assert rule.needs == "axial-torsional"
    assert rule.error == distance(rigid, whole) > 0.3


@pytest.mark.parametrize("alpha", [0.4, 0.05])
@pytest.mark.parametrize("cd", ["1e-3", "1e-4"])
def test_the_quick_search_finds_the_certified_roots(alpha: float, cd: str) -> None:
    """Against `DrillingLoop.roots`, whose list is vouched for by the argument principle."""
    over = {"material.retardation_time": cd, "inertia.distributed": alpha, "model": "axial-torsional"}
    scene = load_scene("vertical-c1-cd4", over)
    loop = DrillingLoop.from_scene(scene)
    rho = pitch(scene, np.array([scene.nominal().weight_on_bit]))
    certified = loop.roots(np.array([14.42]), rho).values[0]
    limit = 1.5 / scene.blade_passage
    certified = certified[(certified.real > 0) & (certified.imag < 2 * np.pi * limit)]
    least = max(0.05 * certified.real.max(), 1 / 200)
    expected = sorted((z.imag / (2 * np.pi), z.real) for z in certified if z.real > least)
    found = sorted(growing_motions(scene, axial_waves=True))
    # torsion is lumped in the quick search: its waves move a root by a per cent of its frequency at most
    assert len(found) == len(expected)
    for one, (frequency, growth) in zip(found, expected, strict=True):
        assert one.frequency == pytest.approx(frequency, rel=0.01)
        assert one.growth == pytest.approx(growth, abs=0.01 * 2 * np.pi * frequency)


def test_compliance_of_a_uniform_rod_in_its_modes() -> None:
    """Held at the top: every mode is sin((k - 1/2) pi s/L), of compliance 2/(inertia L) at the end."""
    rod = Waves((50.0,), (8e6,), (0.5,), (1e-3,), held=True)
    modes = modes_of(rod, 300.0)
    speed = math.sqrt(8e6 / 0.5)
    assert [m.frequency for m in modes] == pytest.approx([(k - 0.5) * speed / 100 for k in range(1, len(modes) + 1)])
    assert [m.compliance for m in modes] == pytest.approx([2 / (0.5 * 50)] * len(modes), rel=1e-6)
    assert modes[2].damping == pytest.approx(1e-3 * math.pi * modes[2].frequency)


def test_the_sixth_torsional_mode_is_what_the_lumped_model_lacks() -> None:
    """cutting-c1: M1 swings at 0.45 Hz, M2 at 7.40 Hz, its sixth mode, in which the bit is as compliant."""
    scene = load_scene("cutting-c1", {"model": "torsional"})
    rule = torsional_rule(scene)
    assert rule.needs == "torsional"
    assert rule.error == pytest.approx(1.0, abs=0.01)
    loop = DrillingLoop.from_scene(scene)
    assert isinstance(loop.torsion, Waves)
    modes = modes_of(loop.torsion, 10.0)
    assert modes[5].frequency == pytest.approx(7.40, abs=0.01)
    assert modes[5].compliance == pytest.approx(modes[0].compliance, rel=0.01)
    assert all(m.compliance < 0.3 * modes[0].compliance for m in modes[1:5])


@pytest.mark.parametrize(
    ("alpha", "model"), [(1.0, "axial-torsional"), (0.4, "axial-torsional"), (0.05, "lumped"), (0.001, "lumped")]
)
def test_inertia_moved_to_the_bit_makes_the_lumped_model_right(alpha: float, model: str) -> None:
    scene = load_scene("vertical-v1", {"model": "auto", "inertia.distributed": alpha})
    assert scene.resolved_model().name == model


def test_the_estimate_falls_to_the_shift_of_the_fundamental() -> None:
    """alpha -> 0: what stays is the collars' own flexibility, 938.1 against 914 N m/rad or 2.3 % of 0.449 Hz."""
    errors = []
    for alpha in (0.4, 0.2, 0.1, 0.001):
        scene = load_scene("vertical-v1", {"model": "auto", "inertia.distributed": alpha})
        axial, torsion = (rule(scene).error for rule in (axial_rule, torsional_rule))
        assert axial is not None
        assert torsion is not None
        errors.append((axial, torsion))
    assert all(a > b for (a, _), (b, _) in pairwise(errors))
    assert errors[-1][0] < 1e-3
    pipes, collars = (s.length / s.section_stiffness().torsion for s in load_scene("vertical-v1").string)
    assert errors[-1][1] == pytest.approx(math.sqrt((pipes + collars) / pipes) - 1, rel=0.02)


def test_a_heavy_bit_needs_torsional_waves_only() -> None:
    """A rigid mass that dwarfs the string is all there is axially; twist keeps its waves."""
    over = {"ends.bottom_mass": 2e6, "top_drive.hook_load": "20.0772 MN"}
    scene = load_scene("vertical-c1-cd4", over | {"top_drive.weight_on_bit": None})
    found = {f.rule: f for f in findings(scene)}
    assert found["buckling"].needs == "lumped"
    assert found["axial waves"].needs == "lumped", found["axial waves"].text
    assert found["torsional waves"].needs == "torsional"
    assert scene.resolved_model().name == "torsional"


def test_tolerance_moves_the_choice() -> None:
    over: Over = {"model": "auto", "inertia.distributed": 0.4}
    assert load_scene("vertical-v1", over | {"output.tolerance": 0.25}).resolved_model().name == "axial-torsional"
    assert load_scene("vertical-v1", over | {"output.tolerance": 0.35}).resolved_model().name == "lumped"


def test_distance_counts_what_has_no_partner() -> None:
    one, other = Growing(10.0, 1.0), Growing(10.1, 1.0)
    assert distance([one], [other]) == pytest.approx(0.01, rel=0.02)
    assert distance([one], [other, Growing(13.0, 0.5)]) == pytest.approx(3 / 13, rel=0.01)
    assert distance([one], []) == 1.0
    assert distance([], []) == 0.0


def test_a_scene_of_numbers_is_lumped() -> None:
    numbers = {"psi": 50, "beta": 0.3, "lambda": 5, "omega_0": 5, "W_0": 7}
    data = {"dimensionless": numbers, "model": "auto", "time": {"end": 10.0, "step": 1e-3}}
    assert Scene.from_dict(data).resolved_model().name == "lumped"
    with pytest.raises(SceneError, match=r"output\.wanted.*no model"):
        Scene.from_dict(data | {"output": {"wanted": ["bending_stress"]}})


# -- the plan ---------------------------------------------------------------------------------------------
def test_plan_says_choice_reason_and_what_is_lost() -> None:
    plan = plan_of(load_scene("vertical-c1-cd4"), pilot=False)
    text = as_text(plan)
    assert plan.chosen == plan.runs_with == "axial-torsional"
    assert plan.lower == "torsional"
    assert text.startswith("vertical-c1-cd4: axial-torsional\nbecause the string is straight")
    lost = "\n".join(plan.lost)
    assert all(name in lost for name in GIVES["axial-torsional"])
    assert "24.6 t in the place of a string of 52 t" in lost
    assert "13.3 Hz" in lost
    assert plan.pilot is None
    assert all(r.speed is None and r.off is None for r in plan.rungs)
    assert plan.rung("lumped").by_rules == 1.0
    assert "27.76 kN if it could tilt" in text


def test_plan_of_a_buckled_string_asks_for_a_mesh_that_sees_it() -> None:
    plan = plan_of(load_scene("vertical-c1-cd4", {"top_drive.weight_on_bit": "70 kN"}), pilot=False)
    assert plan.chosen == "spatial"
    assert plan.lower == "axial-torsional"
    meshes = [note for note in plan.notes if note.startswith("mesh:")]
    assert len(meshes) == 2
    assert "4.76 m; take 2 m or less (500" in meshes[0]
    assert any("nothing disturbs it" in note for note in plan.notes)
    bare = plan_of(load_scene("vertical-c1-cd4", {"top_drive.weight_on_bit": "70 kN", "contact": None}), pilot=False)
    assert any("no [contact]" in note for note in bare.notes)
    fine = load_scene("vertical-c1-cd4", {"top_drive.weight_on_bit": "70 kN", "mesh.elements": 620})
    assert not any(note.startswith("mesh:") for note in plan_of(fine, pilot=False).notes)


def test_a_curved_hole_has_the_soft_string_beside_the_ladder() -> None:
    scene = load_scene("off-bottom")
    plan = plan_of(scene, pilot=False)
    assert plan.chosen == "spatial" and [r.model for r in plan.beside] == ["soft-string"]
    text = as_text(plan)
    assert "soft-string" in text and "beside the ladder" in text and "bending stiffness" in text
    assert [r["model"] for r in json.loads(json.dumps(plan.to_dict()))["beside"]] == ["soft-string"]
    # a bit in rock is more than it can do; a vertical hole needs no such friction
    assert plan_of(load_scene("curved-c2"), pilot=False).beside == ()
    assert plan_of(load_scene("vertical-pi"), pilot=False).beside == ()


def test_the_soft_string_is_measured_by_its_side_force() -> None:
    """Of the inclination alone: the formula's sum is 0.8 % less (and the rod's with it)."""

    def at_start(model: str, side_force: float) -> dict[str, Any]:
        history = xr.Dataset({"side_force": ("time", [side_force, 0.0])}, {"time": [0.0, 1.0]})
        return {model: Result(history, {})}

    laid = _laid(at_start("soft-string", 242.0), at_start("spatial", 240.0))
    assert laid == {"soft-string": pytest.approx(2 / 240)}
    assert _laid(at_start("soft-string", 242.0), {}) == {} and _laid({}, at_start("spatial", 240.0)) == {}
    pilot = Pilot(1.0, laid=laid, speed={"soft-string": 10.0})
    rung = _rung(load_scene("off-bottom"), "soft-string", (), pilot)
    assert rung.off == pytest.approx(2 / 240) and rung.wall == pytest.approx(10.0)


def test_plan_of_an_asked_model_says_what_auto_would_take() -> None:
    plan = plan_of(load_scene("cutting-c1"), pilot=False)
    assert (plan.runs_with, plan.chosen) == ("torsional", "axial-torsional")
    assert any("model = 'torsional' is asked for; 'auto' would take axial-torsional" in n for n in plan.notes)


@pytest.mark.parametrize("name", ["pendulum", "roll-up", "bend-45", "vertical-v1"])
def test_plans_of_all_kinds_can_be_printed(name: str) -> None:
    plan = plan_of(load_scene(name), pilot=False)
    assert plan.chosen in as_text(plan).splitlines()[0]
    assert plan.lost
    assert json.loads(json.dumps(plan.to_dict(), allow_nan=False))["model"] == plan.chosen


def test_rules_cost_little() -> None:
    load_scene("vertical-c1-cd4")  # imports
    start = time.perf_counter()
    for k in range(4):
        load_scene("vertical-c1-cd4", {"top_drive.weight_on_bit": 40e3 + k}).resolved_model()
    assert time.perf_counter() - start < 4 * 0.5


def test_deviation_of_signals() -> None:
    steady = Signal(10.0, 0.0, ())
    assert deviation(Signal(11.0, 0.0, ()), steady) == pytest.approx(0.1)
    swings = Signal(10.0, 5.0, ((2.0, 7.0), (6.0, 1.0)))
    assert swings.main == 2.0
    assert deviation(Signal(10.0, 5.0, ((2.2, 7.0),)), swings) == pytest.approx(0.1)
    assert deviation(Signal(10.0, 5.0, ((3.0, 7.0), (2.0, 6.0))), swings) == 0.0  # a strong second wave will do
    assert deviation(Signal(10.0, 5.0, ((3.0, 7.0), (2.0, 1.0))), swings) == pytest.approx(0.5)
    noise = Signal(10.0, 5.0, ((2.0, 1.0),))
    assert noise.main is None
    assert deviation(swings, noise) == 0.0


# -- command line -----------------------------------------------------------------------------------------
Capture = pytest.CaptureFixture[str]


def test_command_prints_a_plan(capsys: Capture) -> None:
    assert cli.main(["plan", "vertical-c1-cd4", "--no-pilot", "--outputs", "bit_torque, bending_stress"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("vertical-c1-cd4: spatial\n")
    assert "wanted: bit_torque, bending_stress, to 5 %" in out


def test_command_prints_json(capsys: Capture) -> None:
    arguments = ["plan", "vertical-v1", "--set", "model=auto", "--set", "inertia.distributed=0.4"]
    assert cli.main([*arguments, "--no-pilot", "--json", "--tolerance", "35%"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["model"] == "lumped"
    assert data["tolerance"] == 0.35
    assert {r["rule"] for r in data["rules"]} >= {"hole", "buckling", "axial waves", "torsional waves"}


@pytest.mark.parametrize("bad", [["--outputs", "bending"], ["--tolerance", "7"], ["--tolerance", "much"]])
def test_bad_wishes_are_one_line(bad: list[str], capsys: Capture) -> None:
    assert cli.main(["plan", "vertical-c1-cd4", "--no-pilot", *bad]) == 2
    out, error = capsys.readouterr()
    assert not out
    assert error.startswith("error: output.")


def test_outputs_may_be_wished_for_that_the_asked_model_lacks(capsys: Capture) -> None:
    assert cli.main(["plan", "cutting-c1", "--no-pilot", "--outputs", "bending_stress"]) == 0
    out = capsys.readouterr().out
    assert "model = 'torsional' is asked for: it does not give bending_stress; 'auto' would take spatial" in out
