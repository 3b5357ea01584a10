"""The geometry of holes: closed forms, smoothness, order of the table, radius and friction along the hole, refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drillfem.boreholes import BEYOND, arc, build, helix, hole_of, spline, straight, survey
from drillfem.boreholes.profile import STEEPEST, friction_profile, limited, radius_profile
from drillfem.boreholes.table import hermite
from drillfem.errors import SceneError
from drillfem.scene import Scene

WIDE = {"diameter": 0.2159}
POINTS = [[0, 0, 0], [0, 0, 500], [100, 50, 900], [400, 100, 1100], [800, 300, 1150]]
STATIONS = [[0, 0, 0], [300, 0, 0], [330, 0.05, 1.0], [360, 0.16, 1.4], [450, 0.3, 1.2]]
HOLES = {
    "straight": straight(900, 0.4, 0.7, **WIDE),
    "arc": arc(900, 573, 0.1, 0.7, **WIDE),
    "sharp arc": arc(40, 10, 0.1, 0.7, **WIDE),
    "well A": build(2500, 1500, 572.96, math.pi / 3, **WIDE),
    "ramps": build(2500, 1500, 572.96, math.pi / 3, transition=60, **WIDE),
    "drop": build(900, 300, 400, 0.1, inclination=0.8, azimuth=2, transition=20, **WIDE),
    "helix": helix(600, 20, 100, 0.3, **WIDE),
    "spline": spline(POINTS, **WIDE),
    "survey": survey(STATIONS, **WIDE),
}
JUMPS = {"well A": 2}


@pytest.fixture(params=HOLES, scope="module")
def named(request):
    return request.param, HOLES[request.param]


def test_depth_is_arc_length_and_curvature_lies_across_the_tangent(named):
    _, hole = named
    frame = hole.frame(np.linspace(0, hole.length, 20_001))
    assert np.abs(np.linalg.norm(frame.tangent, axis=1) - 1).max() < 1e-9
    assert np.abs(np.einsum("ic,ic->i", frame.curvature, frame.tangent)).max() < 1e-9
    assert np.abs(frame.position[0]).max() == 0


def test_tangent_and_curvature_are_derivatives_of_position(named):
    _, hole = named
    p = np.random.default_rng(1).uniform(1, hole.length - 1, 200)
    frame, h = hole.frame(p), 1e-3
    before, after = hole.frame(p - h), hole.frame(p + h)
    assert np.allclose((after.position - before.position) / (2 * h), frame.tangent, atol=1e-8)
    assert np.allclose((after.tangent - before.tangent) / (2 * h), frame.curvature, atol=1e-7)


def test_pieces_meet_in_position_direction_and_curvature(named):
    name, hole = named
    knots, a = hole.table.knots, hole.table.coefficients
    h = np.diff(knots)[:-1, None]
    powers = np.stack([h**j for j in range(6)], axis=1)
    j = np.arange(6)[:, None]
    ends = [(a[:-1] * powers).sum(1)]
    ends.append((a[:-1, 1:] * j[1:] * powers[:, :-1]).sum(1))
    ends.append((a[:-1, 2:] * (j * (j - 1))[2:] * powers[:, :-2]).sum(1))
    assert np.allclose(ends[0], a[1:, 0], rtol=0, atol=1e-11)
    assert np.allclose(ends[1], a[1:, 1], rtol=0, atol=1e-12)
    jump = np.abs(ends[2] - 2 * a[1:, 2]).max(axis=1)
    assert (jump > 1e-9).sum() == JUMPS.get(name, 0)


def test_a_hole_goes_on_straight_beyond_its_ends(named):
    _, hole = named
    inside, outside = hole.frame([0.0, hole.length]), hole.frame([-7.0, hole.length + 7.0])
    assert np.allclose(outside.position, inside.position + [[-7.0], [7.0]] * inside.tangent, atol=1e-12)
    assert np.allclose(outside.tangent, inside.tangent, atol=1e-15)
    assert np.abs(outside.curvature).max() == 0
    assert np.array_equal(outside.radius, inside.radius)


def test_closed_forms():
    p = np.linspace(0, 600, 301)
    level = np.array([math.cos(0.7), math.sin(0.7), 0])
    frame = straight(600, 0.4, 0.7, **WIDE).frame(p)
    assert np.allclose(frame.position, p[:, None] * (math.sin(0.4) * level + [0, 0, math.cos(0.4)]), atol=1e-11)
    assert np.allclose(frame.inclination, 0.4, atol=1e-14)
    assert np.allclose(frame.azimuth, 0.7, atol=1e-14)
    frame, angle = HOLES["arc"].frame(p), 0.1 + p / 573
    out = 573 * (math.cos(0.1) - np.cos(angle))[:, None] * level
    out[:, 2] = 573 * (np.sin(angle) - math.sin(0.1))
    assert np.abs(frame.position - out).max() < 1e-9
    assert np.allclose(frame.dogleg_severity, 1 / 573, rtol=1e-8)
    frame = HOLES["helix"].frame(p)
    inclination = math.atan2(2 * math.pi * 20, 100)
    turned = 0.3 + p * math.sin(inclination) / 20
    out = np.stack([20 * (np.sin(turned) - math.sin(0.3)), 20 * (math.cos(0.3) - np.cos(turned))], axis=1)
    assert np.abs(frame.position[:, :2] - out).max() < 1e-9
    assert np.abs(frame.position[:, 2] - p * math.cos(inclination)).max() < 1e-9
    assert np.allclose(frame.dogleg_severity, math.sin(inclination) ** 2 / 20, rtol=1e-8)


def test_well_a():
    """1500 m vertical, 600 m to 60 deg at 3 deg per 30 m, 400 m straight (spec 11, field.md 3.7)."""
    hole = HOLES["well A"]
    frame = hole.frame([0, 1499, 1501, 1800, 2099, 2101, 2500])
    assert np.allclose(np.degrees(frame.dogleg_severity) * 30, [0, 0, 3, 3, 3, 0, 0], atol=1e-4)
    assert np.allclose(np.degrees(frame.inclination), [0, 0, 0.1, 30, 59.9, 60, 60], atol=2e-3)
    R = 572.96
    end = [R * 0.5 + (1000 - R * math.pi / 3) * math.sin(math.pi / 3), 0, 1500 + R * math.sin(math.pi / 3)]
    end[2] += (1000 - R * math.pi / 3) / 2
    assert np.allclose(frame.position[-1], end, atol=1e-9)


def test_a_transition_keeps_turn_length_and_place():
    plain, ramps = HOLES["well A"], HOLES["ramps"]
    p = np.linspace(1400, 2200, 8001)
    a, b = plain.frame(p), ramps.frame(p)
    assert b.inclination[-1] == pytest.approx(math.pi / 3, abs=1e-12)
    assert b.dogleg_severity.max() <= 1 / 572.96 * (1 + 1e-7)
    # a corner of curvature kappa that is cut by a ramp of length l: kappa l^2/24, twice
    most = 60**2 / 24 / 572.96
    away = np.linalg.norm(a.position - b.position, axis=1).max()
    assert 0.9 * most < away < 2 * most
    rises = np.abs(np.diff(b.dogleg_severity)) / np.diff(p)
    assert rises.max() == pytest.approx(1 / 572.96 / 60, rel=1e-3)
    with pytest.raises(SceneError, match=r"hole\.transition = 700: must be at most 600\.002"):
        build(2500, 1500, 572.96, math.pi / 3, transition=700, **WIDE)


def test_a_spline_goes_through_its_points_without_a_jump_of_curvature():
    hole = HOLES["spline"]
    points = np.array(POINTS, float)
    frame = hole.frame(hole.nearest(points))
    assert np.abs(frame.position - points).max() < 1e-9
    assert hole.frame([0.0, hole.length]).dogleg_severity.max() < 1e-10


@pytest.mark.parametrize(
    "points, said",
    [
        ([[0, 0, 0]], "must be two or more rows"),
        ([[0, 0, 1], [0, 0, 2]], r"hole\.points\.0 = \[0\.0, 0\.0, 1\.0\]: must be the origin"),
        ([[0, 0, 0], [0, 0, 5], [0, 0, 5]], r"hole\.points\.2 .* must differ from the point above"),
    ],
)
def test_points_that_make_no_hole(points, said):
    with pytest.raises(SceneError, match=said):
        spline(points, **WIDE)


def test_the_table_is_of_sixth_order():
    """A helix on even pieces: position falls with the sixth power of their length, curvature with the fourth."""
    psi, rate = 0.6, 0.05

    def exact(p):
        c, s = np.cos(rate * p), np.sin(rate * p)
        level = math.sin(psi) * np.ones_like(p)
        r = np.stack([level * s / rate, -level * c / rate, math.cos(psi) * p], axis=1)
        t = np.stack([level * c, level * s, np.full_like(p, math.cos(psi))], axis=1)
        return r, t, rate * np.stack([-level * s, level * c, 0 * p], axis=1)

    sizes, errors = np.array([4, 8, 16, 32]), []
    for n in sizes:
        knots = np.linspace(0, 200, n + 1)
        r, t, k = exact(knots)
        a = hermite(knots, r, t, np.stack([k[:-1], k[1:]], axis=1))
        x = np.linspace(0, 200 / n, 20)
        at, straight_on = (knots[:-1, None] + x).ravel(), x[None, :, None]
        found = sum(a[:, None, j] * straight_on**j for j in range(6)).reshape(-1, 3)
        bend = sum(j * (j - 1) * a[:, None, j] * straight_on ** (j - 2) for j in range(2, 6)).reshape(-1, 3)
        errors.append([np.abs(found - exact(at)[0]).max(), np.abs(bend - exact(at)[2]).max()])
    orders = np.polyfit(np.log(sizes[1:]), np.log(np.array(errors)[1:]), 1)[0]
    assert orders == pytest.approx([-6, -4], abs=0.15)


# -- the wall -------------------------------------------------------------------------------------------------------


def envelope(at, value, p, slope):
    """Least of all cones that stand on a piecewise linear function (with steps), by brute force."""
    fine = np.unique(np.concatenate([np.linspace(at[0], at[-1], 4001), at]))
    over = np.interp(fine, at, value)
    for q in at:  # both sides of a step
        over[fine == q] = min(value[at == q])
    return (over + slope * np.abs(p[:, None] - fine)).min(axis=1)


def test_slopes_are_limited_and_the_hole_is_nowhere_wider_than_measured():
    rng = np.random.default_rng(3)
    for _ in range(30):
        at = np.sort(rng.uniform(0, 20, 12))
        at[5] = at[4]  # a step
        value = rng.uniform(0.1, 0.4, 12)
        x, y = limited(at, value, 0.05)
        assert np.all(np.diff(x) > 0)
        assert np.abs(np.diff(y) / np.diff(x)).max() < 0.05 * (1 + 1e-6)
        p = np.linspace(at[0], at[-1], 500)
        assert np.allclose(np.interp(p, x, y), envelope(at, value, p, 0.05), atol=3e-4)
        assert np.all(np.interp(at, x, y) <= value + 1e-12)


def test_a_gentle_profile_stays_as_it_is():
    at, value = np.array([0.0, 10.0, 30.0]), np.array([0.1, 0.12, 0.11])
    x, y = limited(at, value)
    assert np.allclose(np.interp(np.linspace(0, 30, 99), x, y), np.interp(np.linspace(0, 30, 99), at, value))


def test_sections_and_caliper():
    at, radius = radius_profile(
        1000, 0.2, [(400, 0.3), (700, None), (900, 0.24)], [(650, 0.22), (660, 0.5), (680, 0.22)]
    )

    def wide(p):
        return 2 * np.interp(p, at, radius)

    depths = np.array([0, 399, 400, 401, 649, 655, 660, 680, 690, 700, 700.4, 850, 2000])
    assert wide(depths) == pytest.approx([0.3, 0.3, 0.2, 0.2, 0.2, 0.36, 0.5, 0.2, 0.2, 0.2, 0.24, 0.24, 0.2], abs=1e-9)
    # a step is cut into the wider side
    assert np.abs(np.diff(radius) / np.diff(at)).max() <= STEEPEST * (1 + 1e-9)
    assert wide(399.5) == pytest.approx(0.2 + 2 * STEEPEST * 0.5)


def test_one_diameter_everywhere():
    at, radius = radius_profile(100, 0.2)
    assert len(at) == 2
    assert np.all(radius == 0.1)


def test_friction_by_section_and_by_depth():
    at, mu = friction_profile(1000, 0.3, 0.2, [(400, 0.2, 0.1), (700, None, None), (800, 0.5, 0.4)])
    for p, expected in (
        (0, 0.2),
        (399.99, 0.2),
        (400.01, 0.3),
        (699, 0.3),
        (701, 0.5),
        (799, 0.5),
        (801, 0.3),
        (5000, 0.3),
    ):
        assert np.interp(p, at, mu[:, 0]) == pytest.approx(expected, abs=1e-12)
    assert np.all(np.diff(at) > 0)
    assert np.interp(500, at, mu[:, 1]) == pytest.approx(0.2)
    at, mu = friction_profile(1000, 0.3, 0.2, [(400, 0.2, 0.1)], [(100, 0.1, 0.05), (200, 0.3, 0.15)])
    assert np.interp([0, 150, 900], at, mu[:, 0]) == pytest.approx([0.1, 0.2, 0.3])
    at, mu = friction_profile(1000, 0.3, 0.2)
    assert len(at) >= 2 and np.all(mu == [0.3, 0.2])


# -- refusals -------------------------------------------------------------------------------------------------------


def test_sharp_bends_are_refused_with_numbers_and_place():
    tight = spline([[0, 0, 0], [0, 0, 1], [0.05, 0, 1.05], [1, 0, 1.05]], diameter=1.2)
    bend, at = tight.sharpest()
    assert 0.55 > 1 / bend
    text = tight.sharp_bend(0.05)
    assert f"at a measured depth of {at:.6g} m" in text
    assert f"radius of curvature is {1 / bend:.4g} m" in text and "clearance of the string, 0.55 m" in text
    assert tight.sharp_bend(0.6 - 0.9 / bend) == ""
    assert HOLES["sharp arc"].sharp_bend() == ""


def test_the_sharpest_bend_is_found_beside_a_jump():
    bend, at = HOLES["well A"].sharpest()
    assert bend == pytest.approx(1 / 572.96, rel=1e-8)
    assert 1500 <= at <= 2100


def test_leaving_the_hole_is_said_where_it_is_not_known():
    hole = HOLES["survey"]
    assert hole.outside(-1.0, hole.length + BEYOND - 1) == ""
    text = hole.outside(0, hole.length + BEYOND + 5)
    assert f"{BEYOND + 5:g} m beyond the end of the survey at {hole.length:g} m" in text
    assert "above the top of the hole" in hole.outside(-BEYOND - 1, 10)
    assert HOLES["well A"].outside(0, 99_999) == ""  # known to be straight


# -- scenes ---------------------------------------------------------------------------------------------------------


def scene(hole, contact=True, **more):
    data = {
        "string": [{"name": "pipe", "length": 400, "outer_diameter": 0.127, "inner_diameter": 0.108}],
        "material": {"youngs_modulus": 210e9, "shear_modulus": 77e9, "density": 7800},
        "hole": hole,
        "bit": {"kind": "free", "radius": 0.108},
        "top_drive": {"kind": "imposed-speed", "speed": 10.0},
        "initial": {"state": "laid"},
        "time": {"end": 1.0, "step": 0.01},
        **more,
    }
    if contact:
        data["contact"] = {"stiffness": 1e6, "friction_static": 0.3, "friction_dynamic": 0.15}
    return Scene.from_dict(data)


@pytest.mark.parametrize(
    "table",
    [
        {"kind": "straight", "inclination": 0.5},
        {"kind": "arc", "radius": 400, "azimuth": 1},
        {"kind": "build", "kick_off": 100, "radius": 300, "final_inclination": 0.9, "transition": 10},
        {"kind": "helix", "radius": 5, "pitch": 100},
        {"kind": "spline", "points": [[0, 0, 0], [0, 0, 300], [50, 10, 500]]},
        {"kind": "survey", "survey": [[0, 0, 0], [200, 0, 0], [300, 0.1, 0.2], [500, 0.4, 0.3]]},
    ],
    ids=lambda table: table["kind"],
)
def test_every_kind_from_a_scene(table):
    hole = hole_of(scene({"diameter": 0.2159, **table}))
    assert hole.kind == table["kind"]
    assert hole.length >= 400
    assert hole.frame(300).radius == pytest.approx(0.2159 / 2)
    assert np.all(hole.table.friction == [0.3, 0.15])
    for array in hole.table:
        assert array.dtype == np.float64 and array.flags.c_contiguous


def test_no_hole_and_the_sections_of_a_scene():
    assert hole_of(scene({"kind": "none"}, contact=False, initial={"state": "rest"})) is None
    wall = [{"to": 200, "diameter": 0.25, "friction_static": 0.2, "friction_dynamic": 0.2}, {"to": 300}]
    hole = hole_of(scene({"kind": "arc", "radius": 400, "diameter": 0.21, "section": wall}))
    assert hole.frame([100, 250]).radius == pytest.approx([0.125, 0.105])
    at, mu = hole.table.friction_at, hole.table.friction
    assert np.interp([100, 250], at, mu[:, 0]) == pytest.approx([0.2, 0.3])
    assert np.interp([100, 250], at, mu[:, 1]) == pytest.approx([0.2, 0.15])


@pytest.mark.parametrize(
    "table, said",
    [
        (
            {"kind": "survey", "survey": [[0, 0, 0], [200, 0.1, 0], [390, 0.2, 0]]},
            "hole.survey: ends at .* of 390 m, must",
        ),
        ({"kind": "spline", "points": [[0, 0, 0], [0, 10, 200]]}, "hole.points: ends at a measured depth of 200.25 m"),
        ({"kind": "arc", "radius": 0.07}, "bends too sharply at .* must exceed the clearance of the string, 0.1365 m"),
        ({"kind": "arc", "radius": 90, "caliper": [[30, 0.2], [31, 0.1], [32, 0.2]]}, "is 0.1 m wide at .* of 31 m"),
    ],
)
def test_holes_that_a_string_does_not_fit(table, said):
    with pytest.raises(SceneError, match=said):
        hole_of(scene({"diameter": 0.4, **table}))
