"""The rock surface: all schemes against exact histories, orders, books of volume, backward turns, unequal blades."""

from __future__ import annotations

import numpy as np
import pytest

from drillfem.bitrock import SCHEMES, RockSurface, dg_operators, supg_operators, surface_operators

ACCURATE = ["dg", "profile"]
ANGLES = [0.0, 0.9, 2.1, 3.0, 4.4, 5.3]


def order(sizes, errors):
    return np.polyfit(np.log(sizes), np.log(errors), 1)[0]


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("angles", [None, ANGLES])
def test_rigid_advection_keeps_the_depth_of_cut(scheme, angles):
    d0 = 1.26e-3
    surface = RockSurface(scheme, 6, angles, incline=-d0 / (2 * np.pi))
    u, rng = 0.0, np.random.default_rng(0)
    for turn in rng.uniform(1e-4, 0.08, 2000):
        u1 = u + d0 / (2 * np.pi) * turn
        surface.commit(turn, u, u1)
        u = u1
    assert surface.depth_of_cut(u) == pytest.approx(d0, rel=1e-11)
    assert surface.removed == pytest.approx(2 * np.pi * u, rel=1e-12)


def harmonic_error(scheme, turn, **options):
    """Largest error of the depth of cut against U(phi) - U(phi - width) over two sectors, for a harmonic U."""
    width, wave, rate = np.pi / 3, 5.7, 2e-4
    surface = RockSurface(scheme, 6, **options)

    def depth(phi):
        return rate * phi + 1e-4 * np.sin(wave * phi)

    def slope(phi):
        return rate + 1e-4 * wave * np.cos(wave * phi)

    surface.set_profile([lambda eta: depth(-eta)], knots=max(64, round(width / turn)))
    errors = []
    for k in range(round(3 * width / turn)):
        a, b = k * turn, (k + 1) * turn
        surface.commit(turn, depth(a), depth(b), slope(a), slope(b))
        if a > width:
            errors.append(surface.ahead(0.0)[0][0] - depth(b - width))
    return np.abs(errors).max()


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_order_of_dg(degree):
    cells = np.array({0: [64, 128, 256], 1: [16, 32, 64]}.get(degree, [4, 8, 16]))
    errors = [harmonic_error("dg", 2e-3, degree=degree, elements=n) for n in cells]
    assert -order(cells, errors) > degree + 0.9


def test_order_of_profile():
    turns = np.array([0.16, 0.08, 0.04]) * np.pi / 3
    assert order(turns, [harmonic_error("profile", t) for t in turns]) > 3.5


def test_dg_default_keeps_the_delay():
    # first-order upwinding on 64 cells loses 9 % of the self-excitation; the default must be far better
    assert harmonic_error("dg", 0.0144, degree=2, elements=16) < 2e-3 * 1e-4


def history(steps=6000, seed=5):
    """Turns and depths of a wild bit: drilling, hops off bottom, backward turns."""
    rng = np.random.default_rng(seed)
    t = np.arange(steps + 1) * 1e-3
    phi = 14 * t + 2.6 * np.sin(6 * t) + 0.02 * np.cumsum(rng.normal(size=steps + 1)) * 0.02
    u = 3e-3 * t + 4e-4 * np.sin(25 * t) + 1e-4 * np.sin(61 * t + 1)
    assert np.diff(phi).min() < 0
    return phi, u


class Brute:
    """Fine array of heights over the material angle of the hole bottom; blades deepen the cells they pass."""

    def __init__(self, incline, angles, cells=200_000):
        self.h, self.angles, self.cells = np.full(cells, -np.inf), np.asarray(angles), cells
        gaps = np.roll(self.angles, -1) - self.angles
        gaps[-1] += 2 * np.pi
        # behind blade i + 1 lies the sector that it has just cut, down to blade i
        for i, gap in enumerate(gaps):
            front = self.angles[(i + 1) % len(angles)]
            k = np.arange(int(np.ceil(gap / (2 * np.pi) * cells)))
            self.h[(np.rint(front / (2 * np.pi) * cells).astype(int) - k) % cells] = incline * k * 2 * np.pi / cells

    def position(self, blade, phi):
        return round((phi + self.angles[blade]) / (2 * np.pi) * self.cells)

    def ahead(self, blade, phi):
        return self.h[(self.position(blade, phi) + 1) % self.cells]

    def commit(self, phi0, phi1, u0, u1):
        if phi1 <= phi0:
            return
        for b in range(len(self.angles)):
            i, j = self.position(b, phi0), self.position(b, phi1)
            cells = np.arange(i + 1, j + 1)
            u = u0 + (u1 - u0) * (cells - i) / max(j - i, 1)
            self.h[cells % self.cells] = np.maximum(self.h[cells % self.cells], u)


@pytest.mark.parametrize("scheme, limit", [("profile", 2e-6), ("dg", 4e-5)])
@pytest.mark.parametrize("angles", [None, ANGLES])
def test_wild_history_against_a_fine_array(scheme, limit, angles):
    phi, u = history()
    surface = RockSurface(scheme, 6, angles, degree=3, elements=32, incline=-2e-4)
    brute = Brute(-2e-4, np.arange(6) * np.pi / 3 if angles is None else angles)
    errors, off, back = [], 0, 0
    start = surface.integral()
    for k in range(len(phi) - 1):
        surface.commit(phi[k + 1] - phi[k], u[k], u[k + 1])
        brute.commit(phi[k] - phi[0], phi[k + 1] - phi[0], u[k], u[k + 1])
        if k % 7 == 0 and phi[k + 1] > phi[k]:
            heights = surface.ahead(0.0)[0]
            for b in range(len(heights)):
                errors.append(heights[b] - brute.ahead(b, phi[k + 1] - phi[0]))
        off += np.all(u[k + 1] < surface.ahead(0.0)[0])
        back += phi[k + 1] < phi[k]
    assert off > 300 and back > 100
    # steps in the rock are met a cell earlier or later: look at all but the few samples there
    assert np.quantile(np.abs(errors), 0.9) < limit
    assert surface.integral() - start == pytest.approx(surface.removed, rel=1e-11)
    assert surface.removed > 0


@pytest.mark.parametrize("scheme, limit", [("dg", 1e-12), ("supg", 1e-12), ("upwind", 1e-12), ("profile", 1e-12)])
@pytest.mark.parametrize("angles", [None, ANGLES])
def test_rock_removed_is_rock_gone_from_the_profile(scheme, limit, angles):
    """At every moment of a wild history: drilling, hops, turns back; and far from where the bit started."""
    phi, u = history()
    surface = RockSurface(scheme, 6, angles, degree=2, elements=16, incline=-2e-4)
    start, worst = surface.integral(), 0.0
    for k in range(len(phi) - 1):
        surface.commit(phi[k + 1] - phi[k], u[k], u[k + 1])
        worst = max(worst, abs(surface.integral() - start - surface.removed))
    assert surface.removed > 0.05 and worst < limit * surface.removed


def test_what_is_cut_never_comes_back():
    """Rock is removed, not added: in no step of a wild history is the volume booked below zero."""
    phi, u = history()
    for scheme in ("dg", "supg", "upwind"):
        surface = RockSurface(scheme, 6, incline=-2e-4)
        before = 0.0
        for k in range(len(phi) - 1):
            surface.commit(phi[k + 1] - phi[k], u[k], u[k + 1])
            assert surface.removed >= before
            before = surface.removed


def test_schemes_agree_on_the_volume_of_a_wild_history():
    phi, u = history()
    removed = []
    for scheme in ACCURATE:
        surface = RockSurface(scheme, 6, degree=3, elements=32, incline=-2e-4)
        for k in range(len(phi) - 1):
            surface.commit(phi[k + 1] - phi[k], u[k], u[k + 1])
        removed.append(surface.removed)
    assert removed[0] == pytest.approx(removed[1], rel=2e-3)


@pytest.mark.parametrize("scheme, elements, limit", [("profile", 0, 1e-6), ("dg", 24, 1e-6), ("supg", 96, 1e-6)])
@pytest.mark.parametrize("angles", [None, ANGLES])
def test_off_bottom_and_backwards_leave_the_rock_alone(scheme, elements, limit, angles):
    """A smooth hole bottom passes under the blades, forwards and backwards, round more than once, and stays itself."""
    blades = np.array([0.0]) if angles is None else np.array(angles)
    waves = 6 if angles is None else 5

    def bottom(angle):
        return 1e-4 * np.sin(waves * angle) ** 2

    surface = RockSurface(scheme, 6, angles, degree=3, elements=max(elements, 1))
    surface.set_profile([lambda eta, a=a: bottom(a - eta) for a in blades], knots=256)
    above, phi = -1.0, 0.0
    for turn in [*np.resize([0.03, -0.02, 0.05, -0.08], 200), -0.4, 0.7, -5.0, 2 * np.pi]:
        surface.commit(turn, above, above)
        phi += turn
    assert surface.removed == pytest.approx(0.0, abs=1e-15)
    for a, (eta, height) in zip(blades, surface.profile(), strict=True):
        np.testing.assert_allclose(height, bottom(a + phi - eta), atol=limit)


@pytest.mark.parametrize("scheme", ["dg", "supg", "profile"])
@pytest.mark.parametrize("turn", [0.0, 0.004, 0.02, 0.07, 0.4, -0.004, -0.02, -0.3])
@pytest.mark.parametrize("angles", [None, ANGLES])
def test_height_ahead_is_what_a_turn_meets(scheme, turn, angles):
    widths = RockSurface(scheme, 6, angles).data.width
    surface = RockSurface(scheme, 6, angles, degree=3, elements=256 if scheme == "supg" else 32)
    shapes = [lambda eta, i=i: 1e-4 * np.sin(6 * eta + i) for i in range(len(widths))]
    surface.set_profile(shapes, knots=512)
    height, slope = surface.ahead(turn)
    for b in range(len(widths)):
        sector = (b + 1) % len(widths) if turn >= 0 else b
        eta = widths[sector] - turn if turn >= 0 else -turn
        assert height[b] == pytest.approx(shapes[sector](eta), abs=3e-8)
        assert slope[b] == pytest.approx(-6e-4 * np.cos(6 * eta + sector), abs=2e-5)
    deep = -1.0
    before = surface.state_dict()
    surface.commit(turn, deep, deep)
    if turn >= 0:
        np.testing.assert_allclose(surface.ahead(0.0)[0], height, atol=5e-9)
    surface.load(before)
    np.testing.assert_array_equal(surface.ahead(turn)[0], height)


def test_stalled_bit_does_not_fill_the_profile():
    surface = RockSurface("profile", 6, incline=-2e-4)
    rng = np.random.default_rng(0)
    u, start = 0.0, surface.integral()
    for _ in range(40_000):
        turn = rng.normal(1e-6, 3e-5)
        u1 = u + abs(rng.normal(0, 1e-8))
        surface.commit(turn, u, u1, rng.normal(), rng.normal())
        u = u1
    assert surface.data.profile.number[1, 0] < 4200
    assert surface.integral() - start == pytest.approx(surface.removed, abs=1e-12)
    eta, height = surface.profile()[0]
    assert height.max() <= u + 1e-12 and np.all(np.diff(eta) >= 0)


def test_steep_pieces_do_not_overshoot():
    # slopes of a bit that has nearly stopped are huge: what it leaves must stay within the depths it had
    surface = RockSurface("profile", 6, incline=-2e-4)
    surface.commit(1e-9, 0.0, 1e-7)
    surface.commit(4e-4, 1e-7, 2e-7, 5e-4, 5e-4)
    surface.commit(np.pi / 3 - 1e-3, 2e-7, 2e-6)
    heights = [surface.ahead(t)[0][0] for t in np.linspace(0, 2e-3, 201)]
    assert -1e-6 - 2e-4 * 2e-3 < min(heights) and max(heights) < 1e-6


def test_checkpoint_restores_to_the_bit():
    phi, u = history(2000)
    for scheme in SCHEMES:
        for angles in (None, ANGLES):
            whole, resumed = (RockSurface(scheme, 6, angles, incline=-2e-4) for _ in range(2))
            for k in range(2000):
                whole.commit(phi[k + 1] - phi[k], u[k], u[k + 1])
                if k == 999:
                    resumed.load(whole.state_dict())
                if k > 999:
                    resumed.commit(phi[k + 1] - phi[k], u[k], u[k + 1])
            for name, array in whole.state_dict().items():
                np.testing.assert_array_equal(array, resumed.state_dict()[name])


@pytest.mark.parametrize("scheme, degree", [("dg", 0), ("dg", 1), ("dg", 2), ("dg", 3), ("supg", 1), ("upwind", 0)])
def test_operators(scheme, degree):
    op = surface_operators(scheme, degree, 5, 2.0)
    one = np.ones(op.nodes.size)
    assert one @ op.mass @ one == pytest.approx(2.0)
    # conservation: what enters minus what leaves
    np.testing.assert_allclose(one @ op.forward, -op.right, atol=1e-13)
    np.testing.assert_allclose(one @ op.backward, -op.left, atol=1e-13)
    assert one @ op.left == pytest.approx(1.0) and one @ op.right == pytest.approx(1.0)
    # a straight profile moves without change of shape
    if degree:
        (forward, left), (backward, right) = op.rate(True), op.rate(False)
        np.testing.assert_allclose(forward @ op.nodes + left * 0.0, -1.0, atol=1e-11)
        np.testing.assert_allclose(backward @ op.nodes + right * 2.0, 1.0, atol=1e-11)


def test_streamline_operators_mirror_and_lose_no_rock():
    op = supg_operators(9, 1.7)
    assert op.mass_backward is not None
    flip = np.arange(9, -1, -1)
    np.testing.assert_allclose(op.mass_backward, op.mass[np.ix_(flip, flip)], atol=1e-16)
    np.testing.assert_allclose(op.backward, op.forward[np.ix_(flip, flip)], atol=1e-15)
    # both masses weigh the profile in the same way: turning back changes no volume
    np.testing.assert_allclose(op.mass.sum(axis=0), op.mass_backward.sum(axis=0), atol=1e-16)
    # without the streamline part the mass is symmetric, with it it is not
    assert np.abs(op.mass - op.mass.T).max() > 0.01
    plain = supg_operators(9, 1.7, 0.0)
    np.testing.assert_array_equal(plain.mass, plain.mass.T)
    np.testing.assert_array_equal(plain.mass, plain.mass_backward)


def test_order_of_streamline_elements():
    cells = np.array([16, 32, 64])
    assert -order(cells, [harmonic_error("supg", 2e-3, elements=n) for n in cells]) > 2.7


def test_upwinding_is_discontinuous_galerkin_of_degree_zero():
    phi, u = history(1500)
    surfaces = [
        RockSurface("upwind", 6, elements=24, incline=-2e-4),
        RockSurface("dg", 6, degree=0, elements=24, incline=-2e-4),
    ]
    for k in range(1500):
        for surface in surfaces:
            surface.commit(phi[k + 1] - phi[k], u[k], u[k + 1])
    np.testing.assert_array_equal(surfaces[0].profile()[0][1], surfaces[1].profile()[0][1])


@pytest.mark.parametrize("scheme", ["dg", "supg", "upwind"])
@pytest.mark.parametrize("elements", [1, 2, 3, 8])
def test_few_elements_see_what_the_step_will_do(scheme, elements):
    """Where the outflow feels the inflow within a step, what is met is still what the step lets out: a level stays."""
    surface = RockSurface(scheme, 6, degree=2, elements=elements)
    surface.set_profile([lambda eta: 0.0 * eta + 7.0])
    for turn in (1e-3, 0.1, 0.9, -0.4):
        assert surface.ahead(turn)[0][0] == pytest.approx(7.0, abs=1e-12)
        assert surface.ahead(turn)[1][0] == pytest.approx(0.0, abs=1e-11)
        surface.commit(turn, 7.0, 7.0)
    np.testing.assert_allclose(surface.profile()[0][1], 7.0, atol=1e-12)


@pytest.mark.parametrize("scheme", ["dg", "supg", "upwind"])
@pytest.mark.parametrize("turn, limit", [(0.013, 1e-9), (0.05, 5e-5), (0.21, 3e-4), (0.33, 3e-4), (-0.05, 5e-5)])
def test_prediction_is_the_step(scheme, turn, limit):
    """The height ahead is what the Runge-Kutta steps of the commit then let out, nearly whatever enters meanwhile."""
    surface = RockSurface(scheme, 6, degree=2, elements=24)
    surface.set_profile([lambda eta: np.sin(5 * eta) - 2 * eta])
    predicted = surface.ahead(turn)[0][0]
    slope = (surface.ahead(turn + 1e-6)[0][0] - surface.ahead(turn - 1e-6)[0][0]) / 2e-6
    assert surface.ahead(turn)[1][0] == pytest.approx(slope, abs=1e-5)
    before = surface.state_dict()
    surface.commit(turn, 0.0, 0.3 * turn)
    height = surface.profile()[0][1]
    if turn > 0:
        assert surface.ahead(0.0)[0][0] == pytest.approx(predicted, abs=limit)
    elif scheme != "upwind":  # what came back under the blade is now at its foot
        assert height[0] == pytest.approx(predicted, abs=limit)
    surface.load(before)
    assert surface.ahead(turn)[0][0] == predicted


@pytest.mark.parametrize("scheme", ["dg", "supg", "upwind"])
def test_checkpoint_in_the_middle_of_predictions(scheme):
    """What is kept between commits is forgotten with the state it came from."""
    phi, u = history(1000)
    whole, resumed = (RockSurface(scheme, 6, incline=-2e-4) for _ in range(2))
    for k in range(60):
        whole.ahead(0.001 * (k % 7))
        if k == 30:
            resumed.ahead(0.2)
            resumed.load(whole.state_dict())
        turn = phi[k + 1] - phi[k]
        if k >= 30:
            np.testing.assert_array_equal(whole.ahead(turn), resumed.ahead(turn))
            resumed.commit(turn, u[k], u[k + 1])
        whole.commit(turn, u[k], u[k + 1])


def test_operators_from_elsewhere_are_rescaled_and_may_be_renumbered():
    op = dg_operators(2, 16, 3.7)
    rng = np.random.default_rng(0)
    p = rng.permutation(op.nodes.size)
    other = type(op)(
        op.mass[np.ix_(p, p)],
        op.forward[np.ix_(p, p)],
        op.backward[np.ix_(p, p)],
        op.left[p],
        op.right[p],
        op.nodes[p],
        3.7,
    )
    phi, u = history(1500)
    own, foreign = RockSurface("dg", 6, incline=-2e-4), RockSurface("dg", 6, incline=-2e-4, operators=other)
    for k in range(1500):
        own.commit(phi[k + 1] - phi[k], u[k], u[k + 1])
        foreign.commit(phi[k + 1] - phi[k], u[k], u[k + 1])
    assert foreign.ahead(0.01)[0][0] == pytest.approx(own.ahead(0.01)[0][0], abs=1e-15)
    np.testing.assert_allclose(np.sort(foreign.profile()[0][1]), np.sort(own.profile()[0][1]), atol=1e-15)


@pytest.mark.dolfinx
def test_streamline_operators_are_those_of_the_ufl_forms():
    pytest.importorskip("dolfinx")
    from drillfem.models.rock import advection_operators

    own, form = surface_operators("supg", 1, 7, 1.1), advection_operators(1, 7, 1.1, "supg")
    for name in ("mass", "mass_backward", "forward", "backward", "left", "right", "nodes"):
        np.testing.assert_allclose(getattr(own, name), getattr(form, name), rtol=0, atol=1e-12, err_msg=name)


@pytest.mark.dolfinx
@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_operators_agree_with_the_ufl_forms(degree):
    pytest.importorskip("dolfinx")
    from drillfem.models.rock import advection_operators

    phi, u = history(1500)
    heights = []
    for operators in (None, advection_operators(degree, 16, np.pi / 3)):
        surface = RockSurface("dg", 6, degree=degree, elements=16, incline=-2e-4, operators=operators)
        for k in range(1500):
            surface.commit(phi[k + 1] - phi[k], u[k], u[k + 1])
        heights.append([surface.ahead(t)[0][0] for t in (0.0, 0.01, 0.1, -0.01)] + [surface.removed])
    np.testing.assert_allclose(heights[0], heights[1], atol=1e-13)


@pytest.mark.parametrize(
    "bad",
    [
        {"scheme": "central"},
        {"blade_angles": [0.0, 1.0]},
        {"blade_angles": [0, 2, 1, 3, 4, 5]},
        {"degree": -1},
        {"elements": 0},
    ],
)
def test_bad_input_is_refused(bad):
    with pytest.raises(ValueError, match="surface:"):
        RockSurface(**{"blades": 6} | bad)
