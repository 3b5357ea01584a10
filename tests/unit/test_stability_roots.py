"""Transfer functions of string and rock, characteristic roots, and the count that vouches for them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import drillfem.stability.command as command
from drillfem.bitrock import surface_operators
from drillfem.errors import SceneError
from drillfem.models.straight import wave_matrices
from drillfem.scene import Scene, load_scene
from drillfem.stability import DrillingLoop, Oscillator, Waves, phase_crossings, pitch, surface_delay

HZ = 2 * np.pi
OWN = np.array([14.42])


def scene(**overrides: Any) -> Scene:
    """Chapter 6, C1; ``__`` in a keyword stands for a dot."""
    return load_scene("vertical-c1-cd4", {key.replace("__", "."): value for key, value in overrides.items()})


def damped(time: str, **overrides: Any) -> Scene:
    return scene(material__retardation_time=time, **overrides)


def dimensionless(blades: int = 4, scheme: str = "profile", degree: int = 0, elements: int = 1) -> DrillingLoop:
    """M1 in the units of Appendix C.2, psi = 50."""
    sectors = (2 * np.pi / blades,) * blades
    delay = surface_delay(scheme, degree, elements)
    return DrillingLoop(Oscillator(1 / 50), Oscillator(1.0, 1.0), 1.0, 1.0, sectors, delay)


RHO = np.array([2 / (2 * np.pi)])  # W_0 = 7, lambda = 5
OMEGA = np.array([5.0])


# -- the lumped model -------------------------------------------------------------------------------------------------
def test_roots_of_the_lumped_model() -> None:
    """field.md 3.5: n = 4, psi = 50, rho = v_0/omega_0 at lambda = 5, W_0 = 7, omega_0 = 5."""
    found = dimensionless().roots(OMEGA, RHO, -0.1)
    assert found.values[0, 0] == pytest.approx(2.79763 + 14.66778j, abs=6e-6)
    assert found.values[0, 1] == pytest.approx(5e-5 + 1.0032j, abs=1e-4) and found.values[0, 1].real > 0
    assert list(found.torsional[0, :2]) == [False, True]
    assert found.unstable[0] == found.listed[0] == 4
    s = found.values[0, :2]
    echo = 4 * (1 - np.exp(-s * 2 * np.pi / (4 * 5)))
    residual = (s**2 + 50 * echo) * (s**2 + 1) - RHO * echo * s**2
    np.testing.assert_allclose(np.abs(residual), 0, atol=1e-8)


def test_a_scene_given_by_numbers_has_the_same_roots(tmp_path: Path) -> None:
    path = tmp_path / "numbers.toml"
    numbers = "psi = 50\nbeta = 0.3\nlambda = 5\nomega_0 = 5\nW_0 = 7\nblades = 4\ntime = 0.4\nlength = 1e-3"
    path.write_text(f"[dimensionless]\n{numbers}\n[time]\nend = 1\nstep = 1e-3\n")
    given = load_scene(path)
    loop = DrillingLoop.from_scene(given)
    found = loop.roots(np.array([given.top_drive.speed]), pitch(given, given.nominal().weight_on_bit))
    assert found.values[0, 0] * 0.4 == pytest.approx(2.79763 + 14.66778j, abs=1e-5)


@pytest.mark.parametrize(
    ("surface", "growth"),
    [
        (("upwind", 0, 16), 1.910),
        (("upwind", 0, 64), 2.554),
        (("upwind", 0, 256), 2.735),
        (("dg", 1, 8), 2.7838),
        (("dg", 1, 16), 2.7957),
        (("dg", 2, 8), 2.7976),
    ],
)
def test_what_a_discretised_surface_makes_of_the_growth(surface: tuple[str, int, int], growth: float) -> None:
    """field.md 4, "upwind advection eats the delay"."""
    digits = 5e-4 if surface[0] == "upwind" else 6e-5
    assert dimensionless(4, *surface).roots(OMEGA, RHO).growth[0] == pytest.approx(growth, abs=digits)


@pytest.mark.parametrize(
    "surface", [("dg", 0, 7), ("dg", 1, 5), ("dg", 3, 2), ("upwind", 0, 16), ("supg", 0, 2), ("supg", 0, 9)]
)
def test_transfer_function_of_a_surface_is_that_of_its_operators(surface: tuple[str, int, int]) -> None:
    operators = surface_operators(*surface, 1.1)
    p = np.array([1 + 3j, 0.2 + 20j, 2 - 9j])
    rate, source = operators.rate()
    expected = [operators.right @ np.linalg.solve(q * np.eye(len(source)) - rate, source) for q in p]
    np.testing.assert_allclose(surface_delay(*surface)(p, 1.1), expected, atol=1e-13)


# -- strings with waves -----------------------------------------------------------------------------------------------
def test_natural_frequencies() -> None:
    """spec 8.5 and 9.7."""
    loop = DrillingLoop.from_scene(scene())
    assert isinstance(loop.axial, Waves) and isinstance(loop.torsion, Waves)
    axial = [1.69, 4.02, 6.49, 8.96, 11.28, 12.97, 14.66, 16.99]
    np.testing.assert_allclose(loop.axial.frequencies(17.5 * HZ) / HZ, axial, atol=0.006)
    torsion = [0.4534, 1.7108, 3.1781, 4.6768, 6.1440, 7.4014, 8.3083, 9.5657, 11.0329, 12.5316]
    np.testing.assert_allclose(loop.torsion.frequencies(13 * HZ) / HZ, torsion, atol=6e-5)


@pytest.mark.parametrize("model", ["torsional", "axial-torsional"])
def test_receptances_are_those_of_the_finite_elements(model: str) -> None:
    lumps = {"ends__bottom_inertia": 70.0, "ends__bottom_mass": 3e3, "ends__top_mass": 2e4, "inertia__distributed": 0.6}
    given = damped("2e-3", model=model, mesh__elements=96, **lumps)
    loop, (axial, torsion) = DrillingLoop.from_scene(given), wave_matrices(given)
    s = np.array([0.4 + 3j, -0.2 + 25j, 1.5 + 90j])
    for motion, matrices, held in ((loop.axial, axial, 0), (loop.torsion, torsion, 1)):
        if matrices is None:
            np.testing.assert_allclose(np.divide(*motion.parts(s)), 1 / (27614.4 * s**2), rtol=1e-6)
            continue
        mass, damping, stiffness = (m[held:, held:] for m in (matrices.mass, matrices.damping, matrices.stiffness))
        push = np.zeros(len(mass))
        push[-1] = 1
        expected = [np.linalg.solve(x**2 * mass + x * damping + stiffness, push)[-1] for x in s]
        np.testing.assert_allclose(np.divide(*motion.parts(s)), expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("damping", "modulus", "expected"),
    [
        ("1e-2", "210 GPa", []),
        ("1e-3", "210 GPa", [(13.20, 0.51)]),
        ("1e-4", "210 GPa", [(13.34, 1.87), (11.64, None), (9.20, None)]),
        ("1e-3", "200.2 GPa", [(13.09, 1.05)]),
    ],
)
def test_chatter_of_the_vertical_string(damping: str, modulus: str, expected: list[tuple[float, float | None]]) -> None:
    """spec 9.7; it looks below 20 Hz and leaves out what grows by less than 1e-3 1/s."""
    given = damped(damping, material__youngs_modulus=modulus)
    found = DrillingLoop.from_scene(given).roots(OWN, pitch(given, 45.7e3))
    chatter = [r for r in found.values[0] if r.real > 1e-3 and r.imag < 20 * HZ]
    assert len(chatter) == len(expected)
    for root, (frequency, growth) in zip(chatter, expected, strict=True):
        assert root.imag / HZ == pytest.approx(frequency, abs=6e-3)
        assert growth is None or root.real == pytest.approx(growth, abs=1e-2)


CASES: list[dict[str, Any]] = [
    {"model": "lumped"},
    {"model": "lumped", "material__retardation_time": "0"},
    {"model": "torsional"},
    {"model": "torsional", "material__retardation_time": "0"},
    {"material__retardation_time": "0"},
    {"material__retardation_time": "1e-5"},
    {"material__retardation_time": "1e-3", "inertia__distributed": 0.05},
    {"bit__blades": 3, "bit__blade_angles": [0.0, 1.8, 4.3]},
    {"bit__blades": 1, "ends__top_mass": 2e4},
    {"rock__surface__scheme": "upwind", "rock__surface__elements": 16},
    {"rock__surface__scheme": "supg"},
]


@pytest.mark.parametrize("overrides", CASES, ids=[",".join(map(str, c.values())) for c in CASES])
def test_count_and_list_agree(overrides: dict[str, Any]) -> None:
    given = scene(**overrides)
    loop = DrillingLoop.from_scene(given, "scene")
    draw = np.random.default_rng(1)
    speed, rho = draw.uniform(4, 32, 12), pitch(given, draw.uniform(33e3, 90e3, 12))
    found = loop.roots(speed, rho)
    np.testing.assert_array_equal(found.listed, found.unstable)
    assert found.unstable.max() > 0
    # every listed root solves the equation; and the count follows the list at any other growth
    listed = np.isfinite(found.values)
    rows = np.nonzero(listed)[0]
    z, h = found.values[listed], 1e-6 * np.abs(found.values[listed])
    at = (speed[rows], rho[rows])
    slope = (loop.characteristic(z + h, *at) - loop.characteristic(z - h, *at)) / (2 * h)
    assert np.max(np.abs(loop.characteristic(z, *at) / slope) / np.abs(z)) < 1e-8
    level = 0.6 * float(found.growth.max())
    more = ((found.values.real > level) * np.where(found.values.imag > 0, 2, 1)).sum(axis=1)
    np.testing.assert_array_equal(loop.count(speed, rho, level), more)


def test_no_root_lies_right_of_the_rightmost() -> None:
    given = damped("1e-3")
    loop = DrillingLoop.from_scene(given)
    speed, rho = np.array([12.5, 26.0]), pitch(given, np.array([50e3, 40e3]))
    found = loop.roots(speed, rho)
    assert np.all(found.unstable == 0) and np.all((-0.005 < found.growth) & (found.growth < 0))
    # the equation without poles turns around a box once for every root in it: none from there on, one just left of it
    for w, r, root in zip(speed, rho, found.values[:, 0], strict=True):
        near = np.geomspace(1e-5, 1, 3000)
        up = np.sort(np.concatenate([np.linspace(0.01, 200, 60_000), root.imag + near, root.imag - near]))
        for left, inside in ((0.8 * root.real, 0), (1.1 * root.real, 1)):
            right = np.linspace(left, 0.5, 4000)
            path = np.concatenate([right + 0.01j, 0.5 + 1j * up, right[::-1] + 200j, left + 1j * up[::-1]])
            turn = np.diff(np.unwrap(np.angle(loop.characteristic(path, np.array([w]), np.array([r])))))
            assert np.abs(turn).max() < 1 and round(turn.sum() / (2 * np.pi)) == inside


# -- the closed form --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("model", ["lumped", "torsional", "axial-torsional"])
def test_closed_form_of_the_boundary(model: str) -> None:
    given = damped("1e-3", model=model)
    loop = DrillingLoop.from_scene(given)
    omega = np.linspace(2, 100, 4000)
    speed, rho = loop.boundary(omega, lobes=3)
    seen = np.isfinite(speed) & (speed > 5) & (speed < 40) & (rho < pitch(given, 90e3))
    assert seen.sum() > 20
    w, r = speed[seen], rho[seen]
    s = 1j * np.broadcast_to(omega, speed.shape)[seen]
    np.testing.assert_allclose(np.abs(1 + loop.gain(s, w, r)), 0, atol=1e-7)
    # one pair of roots crosses there: across the line the count changes by two
    some = np.linspace(0, len(w) - 1, 12).astype(int)
    before, after = (loop.count(w[some], r[some] * (1 + e)) for e in (-1e-4, 1e-4))
    either, other = (loop.count(w[some] * (1 + e), r[some]) for e in (-1e-4, 1e-4))
    assert np.mean((np.abs(before - after) == 2) | (np.abs(either - other) == 2)) > 0.9


def test_closed_form_is_for_equal_blades() -> None:
    uneven = DrillingLoop.from_scene(scene(bit__blades=3, bit__blade_angles=[0.0, 1.8, 4.3]))
    with pytest.raises(ValueError, match="equal blades"):
        uneven.boundary(np.array([10.0]))


def test_equal_blades_may_be_given_by_their_angles() -> None:
    angles = [2 * np.pi * k / 3 for k in range(3)]
    one, other = (scene(bit__blades=3), scene(bit__blades=3, bit__blade_angles=angles))
    roots = [DrillingLoop.from_scene(x).roots(OWN, pitch(x, 45.7e3)).values[0, :5] for x in (one, other)]
    np.testing.assert_allclose(roots[0], roots[1], rtol=1e-9)


# -- a loop of the literature -----------------------------------------------------------------------------------------
@pytest.mark.parametrize(("delay", "gain", "omega"), [(1.0, 5.782, 3.682), (0.5, 7.455, 7.983), (0.25, 4.719, 17.833)])
def test_largest_gain_in_opposite_phase(delay: float, gain: float, omega: float) -> None:
    """Aarsnes & van de Wouw, distributed axial cutting, K_a = 10 (field.md 3.6)."""

    def loop(s: np.ndarray) -> np.ndarray:
        damping = np.sqrt(1 - np.log(0.7) / s)
        return 10 * np.tanh(s / 1.6 * damping) / damping * (1 - np.exp(-delay * s)) / s

    found = phase_crossings(loop, np.linspace(0.01, 100, 20_000))
    assert found[0].gain == pytest.approx(gain, abs=6e-4) and found[0].omega == pytest.approx(omega, abs=6e-4)
    double = phase_crossings(lambda s: 2 * loop(s), np.linspace(0.01, 100, 20_000))
    assert double[0].gain == pytest.approx(2 * found[0].gain)


# -- what is refused, and the command ---------------------------------------------------------------------------------
def test_a_bit_that_does_not_cut_has_no_map() -> None:
    with pytest.raises(SceneError, match="cutting"):
        DrillingLoop.from_scene(load_scene("pendulum"))
    with pytest.raises(SceneError, match="nothing is cut"):
        DrillingLoop.from_scene(scene(initial__state="rest", top_drive__weight_on_bit="30 kN"))


@pytest.mark.parametrize("text", ["5", "30..5", "-1..5", "5..30 kg", "a..b", "..", "5 rad/s..6 m"])
def test_ranges_are_complained_about(text: str) -> None:
    with pytest.raises(SceneError, match=r"--speeds .* must be FROM\.\.TO in rad/s"):
        command.interval(text, "rad/s", "--speeds")


def test_ranges_may_carry_units() -> None:
    assert command.interval("5..30", "rad/s", "") == (5, 30)
    assert command.interval("60..120 rpm", "rad/s", "") == pytest.approx((2 * np.pi, 4 * np.pi))
    assert command.interval("35 kN..8e4 N", "N", "") == pytest.approx((35e3, 80e3))


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(command, "SHAPE", (16, 8))
    chart = command.run(damped("1e-3"), tmp_path / "new", "8..26", "30..70 kN", runs=False)
    said = capsys.readouterr().out
    assert "13.200 Hz" in said and "+0.5118 1/s" in said and "32.66 kN" in said
    assert (tmp_path / "new" / "stability.png").read_bytes()[:4] == b"\x89PNG"
    stored = json.loads((tmp_path / "new" / "stability.json").read_text())
    assert stored["own"]["unstable_roots"] == 2 and stored["speeds"][0] == 8
    # below what the wear flats carry nothing is cut
    growth = np.array(stored["growth"], float)
    weights = np.array(stored["weights"])
    np.testing.assert_array_equal(np.isfinite(growth[:, 0]), weights >= chart.least_weight)
    with pytest.raises(SceneError, match="not empty"):
        command.run(damped("1e-3"), tmp_path / "new", runs=False)
