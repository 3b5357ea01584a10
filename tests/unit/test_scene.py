"""Scenes: reading, units, overrides, derived numbers, and the choice of a model."""

import json
import math
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from drillfem.errors import SceneError
from drillfem.scene import (
    Scene,
    TopDrive,
    builtin_scenes,
    describe,
    dimensionless,
    load_scene,
    torsional_frequency,
)
from drillfem.scene.reference import reference
from drillfem.scene.units import to_si

NAMES = [
    "bend-45", "pendulum", "roll-up", "spin-up", "vertical-c1-cd2", "vertical-c1-cd3", "vertical-c1-cd4",
    "vertical-c1-cd5",
]  # fmt: skip


def test_builtin_scenes_are_there() -> None:
    scenes = builtin_scenes()
    assert set(NAMES) <= set(scenes)
    assert all(scenes.values())


@pytest.mark.parametrize("name", NAMES)
def test_builtin_scene_goes_round_exactly(name: str) -> None:
    scene = load_scene(name)
    assert scene.name == name
    assert Scene.from_dict(scene.to_dict()) == scene
    assert Scene.from_dict(json.loads(json.dumps(scene.to_dict()))) == scene
    assert scene.checked() == scene
    assert all(label and value for label, value in describe(scene))


@pytest.mark.parametrize("name", NAMES)
def test_builtin_scene_opens_with_a_comment(name: str) -> None:
    folder = Path(__file__).parents[2] / "demos" / "scenes"
    lines = (folder / f"{name}.toml").read_text().splitlines()
    comments = [line for line in lines[:4] if line.startswith("#")]
    assert 1 <= len(comments) <= 3


def test_vertical_scene_is_the_thesis_string() -> None:
    s = load_scene("vertical-c1-cd4")
    assert (s.length, s.interfaces) == (1200.0, (0.0, 1000.0, 1200.0))
    assert s.mass == pytest.approx(51967.5, abs=0.1)
    assert s.bit is not None and s.rock is not None
    assert (s.bit.blades, s.bit.radius, s.bit.wear_flat_length) == (6, 0.108, pytest.approx(1.2e-3))
    assert (s.rock.surface.scheme, s.rock.surface.degree, s.rock.surface.elements) == ("dg", 2, 16)
    assert (s.mesh.elements, s.mesh.degree, s.time.step, s.output.interval) == (64, 3, 1e-3, 1e-3)
    assert s.output.fields_interval == 10.0
    assert s.output.checkpoint_interval == 5.0
    assert {load_scene(f"vertical-c1-cd{k}").string[0].retardation_time for k in (2, 3, 4, 5)} == {
        1e-2, 1e-3, 1e-4, 1e-5}  # fmt: skip


# -- derived numbers --------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("weight", "friction", "depth", "speed", "torque"),
    [
        ("45.7 kN", 0.80, 1.26095e-3, 2.89389e-3, 3264.0),
        ("45.7 kN", 3.46, 1.26095e-3, 2.89389e-3, 7955.2),
        ("45.7 kN", 0.40, 1.26095e-3, 2.89389e-3, 2558.6),
        ("68.55 kN", 0.80, 3.47037e-3, 7.96454e-3, 6511.1),
    ],
)
def test_steady_drilling(weight: str, friction: float, depth: float, speed: float, torque: float) -> None:
    over = {"top_drive.weight_on_bit": weight, "bit.friction": friction}
    n = load_scene("vertical-c1-cd4", over).nominal()
    assert n.depth_of_cut == pytest.approx(depth, rel=5e-6)
    assert n.rate_of_penetration == pytest.approx(speed, rel=5e-6)
    assert n.torque_on_bit == pytest.approx(torque, abs=0.06)
    assert n.hook_load == pytest.approx({"45.7 kN": 463.93e3, "68.55 kN": 441.08e3}[weight], abs=6)


def test_hook_load_in_the_place_of_weight_on_bit() -> None:
    by_weight = load_scene("vertical-c1-cd4")
    over = {"top_drive.weight_on_bit": None, "top_drive.hook_load": by_weight.nominal().hook_load}
    n = load_scene("vertical-c1-cd4", over).nominal()
    assert n.weight_on_bit == pytest.approx(45.7e3, rel=1e-12)


def test_free_bit_carries_nothing() -> None:
    s = load_scene("vertical-c1-cd4", {"bit.kind": "free", "top_drive.weight_on_bit": 0})
    n = s.nominal()
    assert (n.weight_on_bit, n.torque_on_bit, n.hook_load) == (0, 0, s.weight)
    with pytest.raises(ValueError, match="cutting"):
        dimensionless(s)


@pytest.mark.parametrize(("friction", "beta"), [(0.8, 0.304), (3.46, 1.315), (0.4, 0.152)])
def test_dimensionless_numbers(friction: float, beta: float) -> None:
    d = dimensionless(load_scene("vertical-c1-cd4", {"bit.friction": friction}))
    assert d.torsional_stiffness == pytest.approx(938.10, abs=0.005)
    assert d.inertia == pytest.approx(112.786, abs=5e-4)
    assert d.time == pytest.approx(0.34674, abs=5e-6)
    assert d.length == pytest.approx(6.3831e-4, abs=5e-9)
    assert (d.psi, d.omega_0) == (pytest.approx(50.5, abs=0.05), pytest.approx(5.000, abs=5e-4))
    assert (d.W_0, d.lambda_) == (pytest.approx(6.923, abs=5e-4), pytest.approx(4.947, abs=5e-4))
    assert d.beta == pytest.approx(beta, abs=5e-4)


def test_torsional_frequency_is_the_first_root() -> None:
    s = load_scene("vertical-c1-cd4")
    assert torsional_frequency(s) == pytest.approx(0.4534, abs=5e-5)
    rod = replace(s, string=s.string[:1])
    c = math.sqrt(77e9 / 7800)
    assert torsional_frequency(rod) == pytest.approx(c / 4000, rel=1e-12)  # fixed-free: a quarter wave
    heavy = replace(rod, ends=replace(s.ends, bottom_inertia=1e6))
    assert torsional_frequency(heavy) == pytest.approx(math.sqrt(938.096 / 1e6) / (2 * math.pi), rel=1e-4)


def test_description_carries_units() -> None:
    rows = dict(describe(load_scene("vertical-c1-cd4")))
    assert rows["hook load"] == "463.927 kN"
    assert rows["nominal rate of penetration"].startswith("2.894 mm/s")
    assert rows["first torsional frequency"] == "0.4534 Hz"
    assert rows["drill pipe: wave speeds"] == "axial 5188.7 m/s, torsional 3141.9 m/s"
    assert rows["psi (system)"] == "50.52"
    assert rows["blade passages"] == "13.77 Hz"
    rows = dict(describe(load_scene("roll-up")))
    assert rows["run"] == "10 load steps"
    assert "hook load" not in rows
    rows = dict(describe(load_scene("horizontal-a")))
    assert rows["smallest clearance"] == "10 mm"
    assert rows["push"] == "5.5 kN" and rows["motor"] == "500 N at 1.667 Hz"
    assert rows["friction"].startswith("4.536 kN")


# -- units and overrides ----------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("5 in", "m", 0.127), ("127mm", "m", 0.127), ("-3 mm", "m", -0.003), ("1e3 ft", "m", 304.8),
        ("45.7 kN", "N", 45700), ("0.252 GPa", "Pa", 0.252e9), ("30 Mpsi", "Pa", 206842718795.0508),
        ("120 rpm", "rad/s", 4 * math.pi), ("90 deg/s", "rad/s", math.pi / 2), ("180 deg", "rad", math.pi),
        ("3 deg/30 m", "rad/m", math.radians(0.1)), ("1 ms", "s", 1e-3),
        ("2 min", "s", 120), ("10 %", "1", 0.1),
        ("0.3", "1", 0.3), ("7.8 g/cm3", "kg/m^3", 7800), ("1e4 N/m2", "N/m^2", 1e4), ("2 kN m", "N m", 2000),
        ("10000 lbf", "N", 44482.216152605),
    ],
)  # fmt: skip
def test_units(text: str, unit: str, value: float) -> None:
    assert to_si(text, unit) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "unit"),
    [("2 Hz", "rad/s"), ("5", "rad/s"), ("5 deg", "1"), ("5 %", "rad"), ("5", "m"), ("5 kg", "m"), ("m", "m"),
     ("5 furlings", "m"), ("1,5 m", "m"), ("9**9**9 m", "m"), ("", "m"), ("5 m m", "m")],
)  # fmt: skip
def test_wrong_units(text: str, unit: str) -> None:
    with pytest.raises(ValueError, match=r"is not|wrong unit|unknown unit"):
        to_si(text, unit)


def test_text_units_and_numbers_give_the_same_scene() -> None:
    a = load_scene("vertical-c1-cd4", {"string.0.length": "1 km", "top_drive.speed": "120 rpm"})
    b = load_scene("vertical-c1-cd4", {"string.0.length": 1000, "top_drive.speed": 4 * math.pi})
    assert a == replace(b, top_drive=a.top_drive)
    assert a.top_drive.speed == pytest.approx(4 * math.pi, rel=1e-15)


def test_overrides() -> None:
    over = {
        "bit.blades": "4", "string.1.length": "150 m", "model": "spatial", "material.density": 7850,
        "time.step": "0.5 ms",
        "time.adaptive": "true", "rock.surface.scheme": "profile", "ends.bottom_inertia": "394 kg m^2",
        "gravity.magnitude": 9.81, "bit.blade_angles": '[0, "80 deg", 3.0, "5 rad"]',
    }  # fmt: skip
    s = load_scene("vertical-c1-cd4", over)
    assert s.bit is not None and s.rock is not None
    assert (s.bit.blades, s.string[1].length, s.model, s.time.step) == (4, 150.0, "spatial", 5e-4)
    assert (s.string[0].mass_per_length, s.time.adaptive) == (pytest.approx(7850 * s.string[0].area), True)
    assert (s.rock.surface.scheme, s.ends.bottom_inertia, s.gravity.magnitude) == ("profile", 394, 9.81)
    assert s.bit.blade_angles == pytest.approx((0, math.radians(80), 3, 5))
    assert Scene.from_dict(s.to_dict()) == s


def test_section_material_replaces_the_common_one() -> None:
    data = load_scene("vertical-c1-cd4").to_dict()
    data["string"][1]["material"] = {"density": 8000, "youngs_modulus": "200 GPa", "poisson_ratio": 0.3}
    s = Scene.from_dict(data)
    assert s.string[0].material == s.material
    assert (s.string[1].mass_per_length, s.string[1].retardation_time) == (
        pytest.approx(8000 * s.string[1].area),
        0,
    )
    again = s.to_dict()
    assert "material" not in again["string"][0] and "material" in again["string"][1]
    assert Scene.from_dict(again) == s


def test_defaults_that_depend_on_other_keys() -> None:
    s = load_scene("roll-up")
    assert (s.time.start, s.time.end, s.time.step, s.output.interval) == (0, 1, 0.1, 0.1)
    data = load_scene("pendulum").to_dict()
    for key in ("name", "title", "output"):
        del data[key]
    s = Scene.from_dict(data)
    assert (s.name, s.title, s.output.interval, s.output.fields_interval) == ("scene", "scene", 1e-3, 0.1)


def test_a_file_is_a_scene(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "demos" / "scenes" / "pendulum.toml").read_text()
    file = tmp_path / "my rod.toml"
    file.write_text(text, encoding="utf-8-sig")
    assert load_scene(file).name == "my rod"
    assert replace(load_scene(str(file)), name="pendulum") == load_scene("pendulum")


# -- models -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("name", "model", "why"),
    [
        ("vertical-c1-cd4", "axial-torsional", "nothing bends it"),
        ("pendulum", "planar", "gravity acts across"),
        ("spin-up", "planar", "about the string's axis"),
        ("roll-up", "planar", "load at the tip bends"),
        ("bend-45", "spatial", "out of the plane"),
    ],
)
def test_auto_takes_the_poorest_model_that_can(name: str, model: str, why: str) -> None:
    choice = load_scene(name).resolved_model()
    assert choice.name == model
    assert why in choice.reason
    assert load_scene(name, {"model": "spatial"}).resolved_model() == ("spatial", "asked for by the scene")


@pytest.mark.parametrize(
    ("name", "over", "model"),
    [
        ("pendulum", {"gravity.direction": "[0, 1, 0]"}, "spatial"),
        ("pendulum", {"gravity.magnitude": 0}, "axial-torsional"),
        ("roll-up", {"ends.tip_moment": "[0, 0, 5]"}, "axial-torsional"),
        ("roll-up", {"ends.tip_moment": "[5, 0, 0]"}, "spatial"),
        ("spin-up", {"top_drive.axis": "[0, 0, 1]"}, "axial-torsional"),
        ("spin-up", {"top_drive.axis": "[1, 0, 0]"}, "spatial"),
        ("bend-45", {"ends.tip_force": "[600, 0, 0]"}, "planar"),
        ("bend-45", {"ends.tip_force": "[600, 0, 0]", "reference.bend_towards": "[0, 1, 0]"}, "spatial"),
        ("pendulum", {"initial.state": "given", "initial.angular_velocity": "[0, 0, 1]"}, "spatial"),
    ],
)
def test_auto_follows_the_loads(name: str, over: dict[str, str], model: str) -> None:
    assert load_scene(name, over).resolved_model().name == model


def test_a_top_that_only_turns_may_be_torsional() -> None:
    over = {"top_drive.axis": "[0, 0, 1]", "model": "torsional"}
    assert load_scene("spin-up", over).resolved_model().name == "torsional"


# -- motion of the top ------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "drive",
    [
        TopDrive("imposed-speed", 14.42),
        TopDrive("imposed-angle", 6.0, "spin-up"),
        TopDrive("imposed-angle", 14.42, "c3"),
        TopDrive("none"),
    ],
)
@pytest.mark.parametrize("t", [0.3, 1.7, 3.1, 14.9, 17.0])
def test_motion_is_consistent(drive: TopDrive, t: float) -> None:
    h = 1e-4
    before, now, after = drive.motion(t - h), drive.motion(t), drive.motion(t + h)
    assert (after[0] - before[0]) / (2 * h) == pytest.approx(now[1], rel=1e-6, abs=1e-6)
    assert (after[1] - before[1]) / (2 * h) == pytest.approx(now[2], rel=1e-5, abs=1e-5)


def test_spin_up_profile_is_that_of_the_thesis() -> None:
    drive = TopDrive("imposed-angle", 6.0, "spin-up")
    t = 4.2
    psi = 6 / 15 * (t**2 / 2 + (15 / (2 * math.pi)) ** 2 * (math.cos(2 * math.pi * t / 15) - 1))
    assert drive.motion(t)[0] == pytest.approx(psi, rel=1e-14)
    assert drive.motion(15.0) == pytest.approx((45, 6, 0), abs=1e-12)
    assert drive.motion(20.0) == (75, 6, 0)


def test_c3_profile_is_continuous_with_a_jump_of_acceleration() -> None:
    drive = TopDrive("imposed-angle", 14.42, "c3")
    a, b = drive.motion(2.0), drive.motion(2.0 + 1e-9)
    assert b[:2] == pytest.approx(a[:2], abs=1e-6)
    assert b[2] - a[2] == pytest.approx(-24, abs=1e-6)


# -- documentation ----------------------------------------------------------------------------------------
def test_reference_page_is_up_to_date() -> None:
    page = Path(__file__).parents[2] / "docs" / "scene-format.md"
    assert page.read_text() == reference(), "python -m drillfem.scene.reference > docs/scene-format.md"


def test_every_builtin_scene_file_is_valid_toml_without_inherited_keys() -> None:
    folder = Path(__file__).parents[2] / "demos" / "scenes"
    for file in folder.glob("*.toml"):
        assert "title" in tomllib.loads(file.read_text()), file
        assert load_scene(file).name == file.stem


def test_scene_error_is_the_only_error_of_a_bad_name() -> None:
    with pytest.raises(SceneError, match="did you mean 'pendulum'"):
        load_scene("pendulm")
