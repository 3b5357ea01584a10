"""Pictures of strings in curved holes, from synthetic results: they show where the string is and where it presses."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr

from drillfem.errors import SceneError
from drillfem.render import render_result, style
from drillfem.render.charts import rows_of
from drillfem.render.film import start_up
from drillfem.render.story import Story
from drillfem.render.well import Well, WellBrush
from drillfem.render.well_charts import along_page, clearance_page
from drillfem.render.well_view import Dial, dial_places, facts_at
from drillfem.scene import Scene, load_scene

LENGTH, KICK, SHOE = 400.0, 150.0, 250.0
RIGHT, LOW = 5e-3, 20e-3  # m: where the string lies
FORCE = 300.0  # N/m, from the kick-off on


def scene(**hole: Any) -> Scene:
    """A pipe with a stabiliser in a well that builds to 60 degrees towards the east, cased above."""
    steel = {"youngs_modulus": 210e9, "shear_modulus": 80e9, "density": 7850.0}
    pipe = {"name": "pipe", "length": 390.0, "outer_diameter": 0.127, "inner_diameter": 0.1086}
    tool = {"name": "tool", "length": 10.0, "outer_diameter": 0.165, "inner_diameter": 0.07, "contact_diameter": 0.21}
    build = {
        "kind": "build",
        "kick_off": KICK,
        "radius": 200.0,
        "final_inclination": math.pi / 3,
        "azimuth": math.pi / 2,
        "diameter": 0.22,
        "section": [{"to": SHOE, "diameter": 0.24, "friction_static": 0.2, "friction_dynamic": 0.1}],
    }
    return Scene.from_dict(
        {
            "title": "a well",
            "string": [pipe | {"contact_diameter": 0.168}, tool],
            "material": steel,
            "hole": build | hole,
            "contact": {"stiffness": 1e6, "friction_static": 0.4, "friction_dynamic": 0.3},
            "top_drive": {"kind": "imposed-speed", "speed": 10.0},
            "ends": {"bottom": "free"},
            "initial": {"state": "laid"},
            "time": {"end": 2.0, "step": 0.01},
        }
    )


def result(aside: bool = True, poses: int = 9, nodes: int = 81, **hole: Any) -> Any:
    """The string lies RIGHT and LOW of the axis of its hole and turns, the lower end later."""
    given = scene(**hole)
    s = np.linspace(0, LENGTH, nodes)
    wall = np.linspace(2.0, LENGTH - 2.0, 150)
    when = np.linspace(0, 0.8, poses)
    borehole = given.borehole
    assert borehole is not None
    frame = borehole.frame(s)
    down = np.array([0.0, 0.0, 1.0])
    low = down - frame.tangent[:, 2:] * frame.tangent
    vertical = frame.inclination < 0.02
    low[vertical] = (0.0, -1.0, 0.0)  # of a well that builds to the east
    low /= np.linalg.norm(low, axis=1, keepdims=True)
    right = np.cross(frame.tangent, -low)
    r = frame.position + (RIGHT * right + LOW * low if aside else 0.0)
    phi = 10 * when[:, None] - 0.01 * s
    d1 = np.cos(phi)[..., None] * right + np.sin(phi)[..., None] * low
    force = np.where(wall > KICK, FORCE, 0.0)
    every = np.ones((poses, 1))
    fields = xr.Dataset(
        {
            "position": (("time", "node", "xyz"), np.broadcast_to(r, (poses, nodes, 3)), {"units": "m"}),
            "director1": (("time", "node", "xyz"), d1, {"units": "1"}),
            "director3": (("time", "node", "xyz"), np.broadcast_to(frame.tangent, d1.shape), {"units": "1"}),
            "spin": (("time", "node"), 10 - 4 * s / LENGTH * np.exp(-when)[:, None], {"units": "rad/s"}),
            "torque": (("time", "node"), every * (s - LENGTH), {"units": "N m"}),
            "axial_force": (("time", "node"), every * 300 * (LENGTH - s), {"units": "N"}),
            "wall_arc_length": (("time", "wall"), every * wall, {"units": "m"}),
            "wall_depth": (("time", "wall"), every * wall, {"units": "m"}),
            "wall_gap": (("time", "wall"), every * np.where(wall > KICK, -3e-4, 0.02), {"units": "m"}),
            "wall_side_force": (("time", "wall"), every * force, {"units": "N/m"}),
        },
        coords={"time": ("time", when, {"units": "s"}), "arc_length": ("node", s, {"units": "m"})},
    )
    time = np.linspace(0, 0.8, 161)
    history = {
        "bit_angular_speed": (10 * time, "rad/s"),
        "bit_axial_speed": (1e-3 * np.sin(9 * time), "m/s"),
        "top_angular_speed": (10 + 0 * time, "rad/s"),
        "top_torque": (400 + time, "N m"),
        "side_force": (7e4 + 0 * time, "N"),
        "kinetic_energy": (time, "J"),
    }
    data = {n: ("time", v, {"units": u}) for n, (v, u) in history.items()}
    return SimpleNamespace(
        history=xr.Dataset(data, coords={"time": ("time", time, {"units": "s"})}),
        fields=fields,
        scene=given,
        manifest={},
        summary={"model": "spatial"},
    )


@pytest.fixture(scope="module")
def well() -> Well:
    """The string in its well."""
    return Well(Story(result()))


def test_high_side_and_right(well: Well) -> None:
    high, right = well.sides(np.array([10.0, LENGTH]))
    np.testing.assert_allclose(high[0], [0, 1, 0], atol=1e-6)  # vertical: where the well will build to
    np.testing.assert_allclose(high[1], [0, math.cos(math.pi / 3), -math.sin(math.pi / 3)], atol=1e-6)
    np.testing.assert_allclose(right, [[-1, 0, 0], [-1, 0, 0]], atol=1e-6)  # heading east, the south is to the right


def test_where_the_string_is_in_its_hole(well: Well) -> None:
    np.testing.assert_allclose(well.offset(3), np.broadcast_to([RIGHT, -LOW], (81, 2)), atol=1e-7)
    p, room = well.room(0)
    at = np.interp([200.0, 389.9, 390.1], p, room)
    np.testing.assert_allclose(at, [(0.24 - 0.168) / 2, (0.22 - 0.168) / 2, (0.22 - 0.21) / 2], atol=1e-4)


def test_casing_and_marks(well: Well) -> None:
    assert [(round(a), round(b), cased) for a, b, cased in well.stretches] == [(0, 250, True), (250, 402, False)]
    assert [(m.name, m.depth) for m in well.marks] == [("kick-off", KICK), ("shoe", SHOE)]
    rough_above = Well(Story(result(section=[{"to": SHOE, "diameter": 0.22, "friction_static": 0.9}])))
    assert rough_above.marks[1].name == "change of wall"


def test_the_side_force_colours_the_string(well: Well) -> None:
    story = well.story
    assert story.in_well and story.choose_field(None) == "side_force"
    force = story.values("side_force")[0]
    assert force[story.arc < KICK - 5].max() == 0 and force[story.arc > KICK + 5].min() == pytest.approx(FORCE)
    brush = WellBrush(story, "side_force")
    off, on = brush.cmap(brush.norm(0.0)), brush.cmap(brush.norm(FORCE))
    assert off[2] > off[0] and on[0] > 2 * on[2]  # bluish off the wall, red on it


def test_a_section_is_to_scale_and_turns_with_the_string(well: Well) -> None:
    with style.page(400, 400) as figure:
        dial = Dial(figure.add_axes((0, 0, 1, 1)), well, 300.0, WellBrush(well.story, "side_force"), 0)
        assert dial.body.get_radius() == pytest.approx(63.5, abs=0.1)
        assert dial.joint.get_radius() == pytest.approx(84.0, abs=0.1)
        for index in (0, 5):
            dial.show(index)
            np.testing.assert_allclose(dial.body.center, [1e3 * RIGHT, -1e3 * LOW], atol=0.1)
            # clockwise, as seen down the hole, from the right
            turned = 10 * well.story.times[index] - 3.0
            middle = math.radians((dial.stripe.theta1 + dial.stripe.theta2) / 2)
            assert math.cos(middle + turned) == pytest.approx(1.0, abs=1e-3)
        assert dial.force.get_visible()
        dial = Dial(figure.add_axes((0, 0, 1, 1)), well, 50.0, WellBrush(well.story, "side_force"), 0)
        assert not dial.force.get_visible()
    words = facts_at(well, 0, LENGTH)
    assert words[0] == "400 m, inclined 60\u00b0" and "tension 0 kN" in words and "torque 0 kN m" in words
    places = dial_places(well, 0, 4)
    assert len(places) == 4 and places[-1] == ("Lower end", LENGTH)


def test_rows_and_film_of_a_well(well: Well) -> None:
    rows = {row[0]: row for row in rows_of(well.story)}
    assert rows["bit_angular_speed"][3] == "rpm" and "top_torque" in rows
    assert "side_force" not in rows  # it does not change
    assert start_up(well.story) == list(range(9))


def test_all_pictures_of_a_well(tmp_path: Path) -> None:
    pytest.importorskip("pyvista")
    from PIL import Image

    (tmp_path / "string-true.png").write_bytes(b"of an earlier run")
    made = {p.name: p for p in render_result(result(), tmp_path, time=[0.2, 0.8], film=True)}
    names = {"string.png", "well.png", "clearance.png", "along.png", "directors.png", "time-series.png", "string.gif"}
    assert names <= set(made) and not (tmp_path / "string-true.png").exists()
    for name, path in made.items():
        with Image.open(path) as picture:
            assert np.asarray(picture.convert("RGB")).std() > 10, f"{name} is blank"
    with Image.open(made["string.png"]) as picture:
        view = np.asarray(picture.convert("RGB")).astype(int)[120:1080, 100:1050]
    red = (view[..., 0] > 150) & (view[..., 1] < 60)
    assert red.mean() > 8e-4  # the string on the wall
    assert red[: len(red) // 4].mean() < 0.1 * red.mean()  # above the kick-off it is off the wall


def test_a_string_on_the_axis_has_no_clearance_to_show(tmp_path: Path) -> None:
    story = Story(result(aside=False, poses=3))
    assert clearance_page(story, "side_force", 2, tmp_path / "clearance.png") is None
    assert along_page(story, [0, 2], tmp_path / "along.png").exists()


def test_an_unknown_demo_is_refused(tmp_path: Path) -> None:
    from drillfem.demo import main

    with pytest.raises(SceneError, match="must be one of drilling, well"):
        main(tmp_path, "nothing")


def test_the_scene_of_the_demo_carries_its_survey() -> None:
    """A result needs no file: the rows of the survey are in the scene."""
    given = load_scene("survey-p11-a-02")
    assert given.hole.survey is not None and len(given.hole.survey) == 91
    assert Scene.from_dict(given.to_dict()) == given
