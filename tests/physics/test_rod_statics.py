"""Equilibria with known answers: appendix B.3, chapter 3, the 45-degree bend, the hanging string, a helix, locking."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rodexact import cantilever, helix
from rodlab import Array, bar, equilibrium, put, take
from scipy.spatial.transform import Rotation

from drillfem.models.initial import stretch_and_twist
from drillfem.models.rod import Rod
from drillfem.scene import Scene, load_scene

TURN = 2 * math.pi


def rolled(turns: float, model: str = "planar", degree: int = 3, elements: int = 16) -> Rod:
    """The strip of appendix B.3 under the moment that rolls it up so many times."""
    scene = load_scene(
        "roll-up",
        {"model": model, "mesh.degree": degree, "mesh.elements": elements, "ends.tip_moment.1": turns * TURN * 10},
    )
    rod = Rod(scene)
    equilibrium(rod, np.linspace(0, 1, max(2, round(10 * turns)) + 1)[1:])
    return rod


@pytest.mark.parametrize("model", ["planar", "spatial"])
@pytest.mark.parametrize("turns", [1 / 8, 1.0, 2.0])
def test_roll_up_is_an_exact_circle(model: str, turns: float) -> None:
    rod = rolled(turns, model, elements=32)
    r, R = rod.shape()
    angle = TURN * turns * rod.arc_length / rod.length
    radius = rod.length / (TURN * turns)
    circle = radius * np.stack([1 - np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
    np.testing.assert_allclose(r, circle, atol=5e-6 * rod.length)
    np.testing.assert_allclose(r[-1], circle[-1], atol=2e-9 * rod.length)  # the tip converges twice as fast
    exact = Rotation.from_rotvec(np.outer(angle, (0, 1, 0))).as_matrix()
    np.testing.assert_allclose(R[-1], exact[-1], atol=1e-8)
    assert np.ptp(r[:, 0]) == pytest.approx(2 * radius if turns >= 1 else circle[-1, 0], rel=1e-3)
    if turns == 1.0:
        assert np.linalg.norm(r[-1]) < 1e-9  # closed


@pytest.mark.parametrize("moment", [1.0, math.pi, 2 * math.pi, 10.0, 4 * math.pi])
def test_chord_of_the_rolled_rod(moment: float) -> None:
    # appendix B.3: EI/L = 2 N m, closed at 4 pi = 12.566 N m
    scene = bar(10.0, bending=20.0, ends={"top": "clamped", "bottom": "free", "tip_moment": [0, moment, 0]})
    rod = Rod(scene)
    equilibrium(rod, np.linspace(0.1, 1, 10))
    chord = np.linalg.norm(rod.shape()[0][-1]) / rod.length
    assert chord == pytest.approx(abs(math.sin(moment / 4)) / (moment / 4), abs=1e-9)


BEND = {300: (22.1152, 40.4748, 58.5405), 450: (18.3720, 48.7010, 51.9748), 600: (15.5603, 53.6049, 46.8968)}
STIFFER = {300: (22.2447, 40.1924, 58.7789), 450: (18.5081, 48.5035, 52.2383), 600: (15.6847, 53.4755, 47.1501)}


@pytest.mark.parametrize(
    ("tips", "stiffness"), [(BEND, {}), (STIFFER, {"torsion": 8.33333333333e5, "shear": 4.16666666667e6})]
)
def test_45_degree_bend(tips: dict[int, tuple[float, ...]], stiffness: dict[str, float]) -> None:
    scene = load_scene("bend-45", {f"string.0.stiffness.{k}": v for k, v in stiffness.items()})
    rod = Rod(scene)
    found = {}

    def on_step(factor: float, x: Array) -> None:
        found[round(600 * factor)] = x.reshape(-1, 7)[rod.nodes[-1], :3]

    equilibrium(rod, np.arange(1, 9) / 8, on_step=on_step)
    for force, tip in tips.items():
        np.testing.assert_allclose(found[force], tip, atol=7e-5)  # printed to 1e-4


def test_equilibrium_does_not_depend_on_the_path() -> None:
    rod = Rod(load_scene("bend-45"))
    paths: list[Any] = [[1 / 3, 2 / 3, 1], [0.5, 0.75, 1], [0.5, 1.2, -0.3, 0.4, 1]]
    paths += [np.arange(1, n + 1) / n for n in (6, 8, 10)]
    tips = [equilibrium(rod, path).x[rod.nodes[-1]] for path in paths]
    for tip in tips[1:]:
        np.testing.assert_allclose(tip, tips[0], atol=1e-9)


def test_equilibrium_is_a_rest_of_the_dynamics() -> None:
    rod = Rod(load_scene("bend-45"))
    equilibrium(rod, np.arange(1, 9) / 8)
    out = np.zeros(rod.size)
    rod.residual(0.0, rod.u.x.array.copy(), np.zeros(rod.size), out)
    assert abs(out).max() < 1e-8 * abs(rod.reaction).max()
    assert rod.reaction[0:3] == pytest.approx([0, -600, 0], abs=1e-6)  # held r1, r2, r3: the load comes back


# -- chapter 3: cantilever under a dead force at its tip ----------------------------------------
@pytest.mark.parametrize(("load", "deflection"), [(1, 0.3017), (2, 0.4935), (5, 0.7138), (10, 0.8106)])
def test_elastica(load: float, deflection: float) -> None:
    scene = bar(axial=1e7, shear=1e7, bending=1.0, ends={"top": "clamped", "bottom": "free", "tip_force": [load, 0, 0]})
    rod = Rod(scene)
    equilibrium(rod, np.linspace(0.1, 1, 10))
    assert rod.shape()[0][-1, 0] == pytest.approx(deflection, abs=1e-4)
    assert rod.shape()[0][-1, 0] == pytest.approx(cantilever(load)(1.0)[2], abs=5e-6)


def test_cantilever_that_shears_and_stretches_is_cr3() -> None:
    load, EI, EA, GA = 5.0, 1.0, 60.0, 25.0
    scene = bar(axial=EA, shear=GA, bending=EI, ends={"top": "clamped", "bottom": "free", "tip_force": [load, 0, 0]})
    rod = Rod(scene)
    equilibrium(rod, np.linspace(0.1, 1, 10))
    exact = cantilever(load, EI, EA, GA)(rod.arc_length)
    r, _ = rod.shape()
    np.testing.assert_allclose(r[:, 0], exact[2], atol=1e-7)
    np.testing.assert_allclose(r[:, 2], exact[3], atol=1e-7)
    _, m = rod.resultants()
    np.testing.assert_allclose(m[:, 1], exact[1], atol=2e-3)
    # CR2 with its small-rotation lever arm is another beam
    assert abs(r[-1, 0] - 0.7411) > 0.02


# -- a helix: bending and twist together ----------------------------------------
def test_helix() -> None:
    rod, place, turn = helix(2.5, 3.0)
    r, R = rod.shape()
    np.testing.assert_allclose(r, place(rod.arc_length), atol=2e-5)
    np.testing.assert_allclose(R, turn(rod.arc_length), atol=2e-4)
    np.testing.assert_allclose(r[-1], place(1.0)[0], atol=1e-9)
    np.testing.assert_allclose(R[-1], turn(1.0)[0], atol=1e-9)


def test_literal_law_fails_on_the_helix() -> None:
    rod, place, _ = helix(2.5, 3.0, literal=True)
    assert np.linalg.norm(rod.shape()[0][-1] - place(1.0)[0]) > 0.05


# -- the string at rest ----------------------------------------
@pytest.mark.parametrize("model", ["axial-torsional", "spatial"])
def test_hanging_string_of_the_thesis(model: str) -> None:
    scene = load_scene("vertical-c1-cd4", {"model": model, "top_drive.weight_on_bit": 68550})
    nominal = scene.nominal()
    assert nominal.hook_load == pytest.approx(441.08e3, abs=10)
    rod = Rod(scene)

    def load(f: float) -> None:
        rod.set_bit_load(f * nominal.weight_on_bit, f * nominal.torque_on_bit)

    straight = {"phi": 0.0} if model != "spatial" else {"q_a": 1.0, "q_d": 0.0}
    equilibrium(rod, np.linspace(0, 1, 11), load, start=put(rod, r3=rod.arc_length, **straight))
    f, psi = stretch_and_twist(scene, rod.arc_length)
    assert f[-1] == pytest.approx(0.420, abs=5e-4)  # spec 9.2
    np.testing.assert_allclose(rod.shape()[0][:, 2] - rod.arc_length, f, atol=1e-9)
    _, R = rod.shape()
    np.testing.assert_allclose(R[:, 0, 0], np.cos(psi), atol=1e-6)
    n, m = rod.resultants()
    tension = nominal.hook_load - np.interp(rod.arc_length, *_weight_above(scene))
    np.testing.assert_allclose(n[:, 2], tension, rtol=1e-6, atol=1.0)
    assert n[0, 2] == pytest.approx(nominal.hook_load, rel=1e-6)
    assert n[-1, 2] == pytest.approx(-nominal.weight_on_bit, rel=1e-6)
    np.testing.assert_allclose(m[:, 2], -nominal.torque_on_bit, rtol=1e-6)


def _weight_above(scene: Scene) -> tuple[Array, Array]:
    weights = [s.mass_per_length * s.length * scene.gravity.magnitude for s in scene.string]
    return np.array(scene.interfaces), np.cumsum([0.0, *weights])


# -- locking ----------------------------------------
def bending_stiffness(degree: int, quadrature: str) -> float:
    """EI felt by a tip moment, relative to EI, of the thesis' drill pipe in elements of 12.5 m."""
    scene = load_scene("vertical-c1-cd4")
    material = replace(scene.string[0].material, shear_correction=0.53)
    data = bar(mesh={"elements": 8, "degree": degree, "quadrature": quadrature}).to_dict()
    data["string"] = [{"name": "pipe", "length": 100.0, "outer_diameter": 0.127, "inner_diameter": 0.108}]
    data["material"] = {
        "youngs_modulus": material.youngs_modulus,
        "shear_modulus": material.shear_modulus,
        "density": material.density,
        "shear_correction": 0.53,
    }
    data["ends"]["tip_moment"] = [0, 1.0, 0]
    rod = Rod(Scene.from_dict(data))
    equilibrium(rod)
    EI = rod.scene.string[0].section_stiffness().bending1
    return 1.0 * rod.length / take(rod, rod.u.x.array, "theta")[-1] / EI


def test_linear_elements_lock_unless_integrated_with_one_point() -> None:
    k = load_scene("vertical-c1-cd4").string[0].section_stiffness()
    locked = 1 + 0.53 * k.shear1 * 12.5**2 / (12 * k.bending1)
    assert locked == pytest.approx(1458, rel=1e-3)
    assert bending_stiffness(1, "full") == pytest.approx(locked, rel=1e-3)
    assert bending_stiffness(1, "reduced") == pytest.approx(1.0, rel=1e-6)
    assert bending_stiffness(3, "reduced") == pytest.approx(1.0, rel=1e-6)
    assert bending_stiffness(3, "full") == pytest.approx(1.0, rel=1e-6)


# -- sections that tell their directions apart ----------------------------------------
def test_orthotropic_cantilever_bends_and_shears_by_its_own_moduli() -> None:
    wood = {"C11": 12e9, "C12": 5e9, "C13": 6e9, "C22": 9e9, "C23": 4e9, "C33": 40e9, "C44": 0.3e9, "C55": 0.6e9}
    data = bar().to_dict() | {"model": "spatial", "material": {"density": 500, "elasticity": wood}}
    data["string"] = [{"name": "wood", "length": 1.0, "outer_diameter": 0.2}]
    data["ends"]["tip_force"] = [0.01, 0.01, 0.1]
    data["ends"]["tip_moment"] = [0, 0, 0.01]
    rod = Rod(Scene.from_dict(data))
    equilibrium(rod)
    k = rod.scene.string[0].section_stiffness()
    assert k.shear1 == pytest.approx(2 * k.shear2)
    (x, y, z), R = rod.shape()[0][-1], rod.shape()[1][-1]
    EI = k.bending1
    assert x == pytest.approx(0.01 / (3 * EI) + 0.01 / k.shear1, rel=1e-5)
    assert y == pytest.approx(0.01 / (3 * EI) + 0.01 / k.shear2, rel=1e-5)
    assert z - 1 == pytest.approx(0.1 / k.axial, rel=1e-6)
    assert R[1, 0] == pytest.approx(0.01 / k.torsion, rel=1e-5)


# -- objectivity ----------------------------------------
def strained(degree: int, q: Array, place: Array) -> Array:
    """Strains (v - e3, u) at the nodes of one element, from nodal quaternions and positions; all stiffnesses are 1."""
    rod = Rod(
        bar(axial=1.0, shear=1.0, bending=1.0, torsion=1.0, model="spatial", mesh={"elements": 1, "degree": degree})
    )
    u = put(rod, **{f"q_{c}": q[:, i] for i, c in enumerate("abcd")}, **{f"r{i + 1}": place[:, i] for i in range(3)})
    rod.set_state(u, 0 * u)
    return np.hstack(rod.resultants())


def left(p: Array) -> Array:
    """Matrix of the quaternion product q -> p q."""
    a, b, c, d = p
    return np.array([[a, -b, -c, -d], [b, a, -d, c], [c, d, a, -b], [d, -c, b, a]])


@pytest.mark.parametrize("degree", [1, 3])
def test_strains_do_not_feel_a_rigid_motion(degree: int) -> None:
    rng = np.random.default_rng(0)
    # Crisfield and Jelenic's rotations at the nodes of a linear element; random ones, not of unit norm, in a cubic one
    q = Rotation.from_rotvec([[1, -0.5, 0.25], [-0.4, 0.7, 0.1]]).as_quat()[:, [3, 0, 1, 2]]
    q = q if degree == 1 else np.array([1.0, 0, 0, 0]) + 0.3 * rng.standard_normal((4, 4))
    place = rng.standard_normal((degree + 1, 3))
    before = strained(degree, q, place)
    assert abs(before).max() > 0.5
    for superposed in ([0.2, 1.2, -0.5], [3.0, -2.0, 1.0]):
        turn = Rotation.from_rotvec(superposed)
        moved = q @ left(turn.as_quat()[[3, 0, 1, 2]]).T
        after = strained(degree, moved, turn.apply(place) + [3.0, -1.0, 2.0])
        np.testing.assert_allclose(after, before, atol=2e-14 * abs(before).max())
