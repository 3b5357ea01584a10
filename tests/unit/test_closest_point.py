"""The closest point of a hole: against exact ones, its derivative, what kernels tell of the wall, getting lost."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from drillfem.boreholes import WALL, Projection, arc, build, closest, helix, project, spline, straight, survey, wall
from drillfem.boreholes.closest import PRESSURE
from drillfem.errors import SimulationError

WIDE = {"diameter": 0.2159}
HOLES = {
    "straight": straight(900, 0.4, 0.7, **WIDE),
    "arc": arc(500, 300, 0.1, 0.7, **WIDE),
    "build": build(1200, 300, 400, 1.2, transition=30, **WIDE),
    "helix": helix(600, 20, 100, 0.3, **WIDE),
    "spline": spline([[0, 0, 0], [0, 0, 500], [100, 50, 900], [400, 100, 1100]], **WIDE),
    "survey": survey([[0, 0, 0], [300, 0, 0], [330, 0.05, 1], [360, 0.16, 1.4], [450, 0.3, 1.2]], **WIDE),
}


def beside(hole, p, away, seed=0):
    """Points (n, 3) at a distance (m) across the hole from measured depths p."""
    frame, n = hole.frame(p), np.random.default_rng(seed).normal(size=(len(p), 3))
    n -= np.einsum("ic,ic->i", n, frame.tangent)[:, None] * frame.tangent
    return frame.position + away * n / np.linalg.norm(n, axis=1)[:, None]


@pytest.fixture(params=HOLES, scope="module")
def hole(request):
    return HOLES[request.param]


# -- exact ----------------------------------------------------------------------------------------------------------


def test_a_line_projects_exactly():
    r = np.random.default_rng(0).uniform(-50, 50, (100, 3))
    hole = HOLES["straight"]
    p = np.zeros(100)
    assert closest(hole.table, r, p) == 0
    assert np.abs(p - r @ hole.frame(0.0).tangent[0]).max() < 1e-9


def test_an_arc_projects_onto_the_radius_through_the_point():
    hole, rng = HOLES["arc"], np.random.default_rng(1)
    level, down = np.array([math.cos(0.7), math.sin(0.7), 0]), np.array([0, 0, 1.0])
    across = np.cross(down, level)
    centre = 300 * (math.cos(0.1) * level - math.sin(0.1) * down)
    angle = rng.uniform(0.15, 1.7, 200)
    out = rng.uniform(200, 400, 200)[:, None] * (-np.cos(angle)[:, None] * level + np.sin(angle)[:, None] * down)
    r = centre + out + rng.uniform(-30, 30, 200)[:, None] * across
    p = 300 * (angle - 0.1) + rng.uniform(-15, 15, 200)
    assert closest(hole.table, r, p) == 0
    assert np.abs(p - 300 * (angle - 0.1)).max() < 2e-8  # 100 m away, the table's tangent counts: 1e-10


def test_a_helix_projects_where_its_transcendental_equation_says():
    hole, psi = HOLES["helix"], math.atan2(2 * math.pi * 20, 100)
    rate, rng = math.sin(psi) / 20, np.random.default_rng(2)
    axis = np.array([-20 * math.sin(0.3), 20 * math.cos(0.3)])

    def slope(p, r):  # of half the squared distance
        phi = 0.3 + rate * p
        x, y = axis + 20 * np.array([math.sin(phi), -math.cos(phi)])
        level = math.sin(psi) * ((x - r[0]) * math.cos(phi) + (y - r[1]) * math.sin(phi))
        return level + math.cos(psi) * (p * math.cos(psi) - r[2])

    start = rng.uniform(10, 590, 60)
    r = beside(hole, start, 3.0) + rng.normal(scale=0.5, size=(60, 3))
    exact = [brentq(slope, q - 5, q + 5, args=(x,), xtol=1e-13) for q, x in zip(start, r, strict=True)]
    p = start.copy()
    assert closest(hole.table, r, p) == 0
    assert np.abs(p - exact).max() < 3e-9


def test_points_across_the_hole_come_back(hole):
    p = np.random.default_rng(3).uniform(0, hole.length, 300)
    r = beside(hole, p, 0.3)
    assert np.abs(hole.nearest(r) - p).max() < 3e-9
    q = np.clip(p + np.random.default_rng(4).uniform(-15, 15, 300), 0, hole.length)
    assert closest(hole.table, r, q) == 0
    assert np.abs(q - p).max() < 3e-9


def test_points_beyond_the_ends_lie_beside_the_straight_on(hole):
    p = np.array([-12.0, -0.5, hole.length + 0.5, hole.length + 12.0])
    r = beside(hole, p, 0.1)
    assert np.abs(hole.nearest(r) - p).max() < 3e-9


def test_the_derivative_that_the_forms_use(hole):
    """delta p = (delta r . t)/(t.t - k.(r - c)), against differences of the closest point."""
    p = np.random.default_rng(5).uniform(5, hole.length - 5, 40)
    r, h = beside(hole, p, 2.0), 1e-4
    frame = hole.frame(p)
    out = np.einsum("ic,ic->i", frame.curvature, r - frame.position)
    for e in np.eye(3):
        ends = []
        for sign in (1, -1):
            q = p.copy()
            assert closest(hole.table, r + sign * h * e, q) == 0
            ends.append(q)
        expected = (frame.tangent @ e) / (1 - out)
        # where pieces meet the curvature has a kink: the difference is of first order there
        assert np.allclose((ends[0] - ends[1]) / (2 * h), expected, atol=5e-5)


# -- the wall -------------------------------------------------------------------------------------------------------


def string(hole, cells=7, order=3, size=5, away=0.03, upto=200.0):
    """Unknowns, cell nodes and shape functions of a string beside a hole."""
    s = np.linspace(0, upto, cells * order + 1)
    u = np.random.default_rng(0).normal(size=(len(s), size))
    u[:, :3] = beside(hole, s, away)
    nodes = (np.arange(cells)[:, None] * order + np.arange(order + 1)).astype(np.int32)
    x, on = np.array([0.1, 0.5, 0.9]), np.linspace(0, 1, order + 1)
    basis = np.array(
        [
            [np.prod([(a - on[k]) / (on[j] - on[k]) for k in range(order + 1) if k != j]) for j in range(order + 1)]
            for a in x
        ]
    )
    return u, nodes, basis, ((np.arange(cells)[:, None] + x) * upto / cells).ravel()


def test_the_wall_at_the_points_of_a_string():
    hole = HOLES["helix"].with_friction(0.3, 0.15, [(100, 0.2, 0.1), (200, None, None)]).with_diameters(0.3)
    u, nodes, basis, p = string(hole)
    radius = np.linspace(0.05, 0.07, 7)
    out = np.full((21, WALL), np.nan)
    out[:, PRESSURE] = 5.0
    found = project(u.ravel(), 5, nodes, basis, radius, hole.table, p, out)
    r = np.einsum("qn,cnk->cqk", basis, u[nodes][:, :, :3]).reshape(-1, 3)
    frame = hole.frame(hole.nearest(r))
    assert np.abs(p - hole.nearest(r)).max() < 3e-9
    assert np.allclose(out[:, :3], frame.position, atol=3e-9)
    assert np.allclose(out[:, 3:6], frame.tangent, atol=1e-9)
    assert np.allclose(out[:, 6:9], frame.curvature, atol=1e-9)
    assert np.allclose(out[:, 9], frame.radius)
    assert np.allclose(out[:, 10], 0)
    assert np.allclose(out[:, 11], np.where(p < 100, 0.2, 0.3))
    assert np.allclose(out[:, 12], np.where(p < 100, 0.1, 0.15))
    assert np.all(out[:, PRESSURE] == 5.0)
    gap = frame.radius - np.repeat(radius, 3) - np.linalg.norm(r - frame.position, axis=1)
    assert isinstance(found, Projection)
    assert found.gap == pytest.approx(gap.min(), abs=1e-12)
    assert found.narrow == gap.argmin()
    assert (found.lost, found.first) == (0, -1)
    assert (found.low, found.high) == (p.min(), p.max())
    again = np.zeros_like(out)
    wall(hole.table, p, again)
    assert np.array_equal(again[:, :PRESSURE], out[:, :PRESSURE])


def test_slope_of_the_radius_where_the_hole_narrows():
    hole = straight(100, **WIDE).with_diameters(0.2, [(50, 0.3), (60, None)])
    p = np.array([10.0, 49.5, 60.0, -5.0, 150.0])
    out = np.zeros((5, WALL))
    wall(hole.table, p, out)
    assert out[:, 9] == pytest.approx([0.15, 0.125, 0.1, 0.15, 0.1])
    assert out[:, 10] == pytest.approx([0, -0.05, 0, 0, 0], abs=1e-12)


def test_without_friction_of_its_own_a_hole_leaves_that_of_the_scene():
    hole = HOLES["arc"]
    u, nodes, basis, p = string(hole)
    out = np.full((21, WALL), 0.7)
    project(u.ravel(), 5, nodes, basis, np.full(7, 0.05), hole.table, p, out)
    assert np.all(out[:, 11:] == 0.7)


# -- lost -----------------------------------------------------------------------------------------------------------


def test_the_centre_of_curvature_has_no_closest_point():
    hole = HOLES["arc"]
    frame = hole.frame(200.0)
    centre = frame.position + 300**2 * frame.curvature
    p = np.array([200.0])
    assert closest(hole.table, centre, p) == 1
    assert p[0] == 200.0
    with pytest.raises(
        SimulationError, match=r"1 of 1 points .* lost the hole: the first is 300 m away .* smaller time"
    ):
        hole.nearest(centre)


def test_a_lost_point_keeps_what_it_had_and_says_where():
    hole = HOLES["arc"].with_friction(0.3, 0.15)
    u, nodes, basis, p = string(hole)
    out, before = np.full((21, WALL), 7.0), p.copy()
    u[9:13, :3] = np.nan
    found = project(u.ravel(), 5, nodes, basis, np.full(7, 0.05), hole.table, p, out)
    r = np.einsum("qn,cnk->cqk", basis, u[nodes][:, :, :3]).reshape(-1, 3)
    lost = np.isnan(r[:, 0])
    assert found.lost == lost.sum() > 3
    assert found.first == lost.argmax()
    assert np.all(out[lost] == 7.0) and np.array_equal(p[lost], before[lost])
    assert math.isfinite(found.gap)
    assert f"the string is nowhere: point {found.first}" in hole.complaint(found, r, p)


def test_a_string_beyond_the_hole_is_told_so():
    hole = HOLES["spline"]
    u, nodes, basis, p = string(hole, upto=hole.length + 60)
    found = project(u.ravel(), 5, nodes, basis, np.full(7, 0.05), hole.table, p, np.zeros((21, WALL)))
    r = np.einsum("qn,cnk->cqk", basis, u[nodes][:, :, :3]).reshape(-1, 3)
    assert "beyond the end of the spline" in hole.complaint(found, r, p)
    found = found._replace(high=hole.length)
    assert hole.complaint(found, r, p) == ""


# -- rows that are kept ---------------------------------------------------------------------------------------------


def test_rows_are_kept_next_to_their_point_and_renewed_beyond():
    hole = HOLES["helix"].with_diameters(0.3, [(100, 0.32), (200, None)])
    u, nodes, basis, p = string(hole)
    radius, out = np.full(7, 0.05), np.zeros((21, WALL))
    project(u.ravel(), 5, nodes, basis, radius, hole.table, p, out)
    for move, kept in ((3e-5, True), (0.02, False)):
        before, start = out.copy(), p.copy()
        u[:, :3] += move * hole.frame(150.0).tangent[0] + [0, 0.3 * move, 0]
        found = project(u.ravel(), 5, nodes, basis, radius, hole.table, p, out)
        assert np.array_equal(out, before) == np.array_equal(p, start) == kept
        r = np.einsum("qn,cnk->cqk", basis, u[nodes][:, :, :3]).reshape(-1, 3)
        frame = hole.frame(hole.nearest(r))
        gap = frame.radius - 0.05 - np.linalg.norm(r - frame.position, axis=1)
        assert found.gap == pytest.approx(gap.min(), abs=1e-12)
        assert found.narrow == gap.argmin()
