"""The straight string: one set of matrices from the weak form and from NumPy, and rungs that agree."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest

import drillfem
from drillfem.models.straight import StraightString, wave_matrices
from drillfem.scene.nominal import dimensionless, lumps

C1 = "vertical-c1-cd4"
LOADED = {"ends.bottom_mass": 100.0, "ends.top_inertia": 3.0, "mesh.elements": 9, "mesh.grading": 2.0}


@pytest.mark.skipif(find_spec("dolfinx") is None, reason="needs DOLFINx")
@pytest.mark.parametrize("degree", [1, 2, 3, 4])
@pytest.mark.parametrize(("model", "alpha"), [("torsional", 1), ("torsional", 0.3), ("axial-torsional", 0.05)])
def test_matrices_are_those_of_the_weak_form(model: str, alpha: float, degree: int) -> None:
    from drillfem.models.straight_forms import matrices_of

    scene = drillfem.load_scene(C1, {"model": model, "inertia.distributed": alpha, "mesh.degree": degree, **LOADED})
    for weak, plain in zip(matrices_of(scene), wave_matrices(scene), strict=True):
        if plain is None:
            assert weak is None and model == "torsional"
            continue
        assert weak is not None
        for name in ("mass", "damping", "stiffness", "weight"):
            one, other = getattr(weak, name), getattr(plain, name)
            np.testing.assert_allclose(one, other, atol=1e-13 * max(np.abs(other).max(), 1e-30), err_msg=name)


@pytest.mark.parametrize("model", ["torsional", "axial-torsional"])
def test_lumping_keeps_inertia_and_weight(model: str) -> None:
    """alpha of the string's own inertia stays, (1 - alpha) of the lumped model's goes to the bit; weight stays."""
    scene = drillfem.load_scene(C1, {"model": model, "inertia.distributed": 0.25})
    whole = drillfem.load_scene(C1, {"model": model})
    part, full, lumped = StraightString(scene), StraightString(whole), lumps(scene)
    inertia = 0.25 * full.torsion.mass.sum() + 0.75 * lumped.inertia
    assert part.torsion.mass.sum() == pytest.approx(inertia, rel=1e-12)
    assert part.axial.load is not None and full.axial.load is not None
    assert part.axial.load.sum() == pytest.approx(full.axial.load.sum(), rel=1e-12)
    if model == "axial-torsional":
        assert part.axial.mass.sum() == pytest.approx(0.25 * whole.mass + 0.75 * lumped.mass, rel=1e-12)
    else:
        assert part.axial.mass.sum() == pytest.approx(lumped.mass, rel=1e-12)


@pytest.mark.parametrize("model", ["lumped", "torsional", "axial-torsional"])
def test_steady_drilling_stays_steady(model: str) -> None:
    """Without a perturbation, every rung starts in equilibrium and goes on drilling at the nominal rate."""
    scene = drillfem.load_scene(C1, {"model": model, "initial.spin_perturbation": 0.0, "mesh.elements": 12})
    result = drillfem.simulate(scene, until=0.5)
    nominal, last = scene.nominal(), result.history.isel(time=-1)
    assert float(last["bit_depth"]) == pytest.approx(0.5 * nominal.rate_of_penetration, rel=1e-6)
    assert float(last["bit_torque"]) == pytest.approx(nominal.torque_on_bit, rel=1e-6)
    assert float(last["bit_angular_speed"]) == pytest.approx(14.42, rel=1e-6)
    assert float(last["hook_load"]) == pytest.approx(nominal.hook_load)
    assert result.summary["model"] == model and result.summary["engine"] == "condensed"
    fields = result.fields.isel(time=-1)
    # the string carries the torque, and hangs on the hook load
    np.testing.assert_allclose(fields["torque"], -nominal.torque_on_bit, rtol=1e-6)
    assert float(fields["axial_force"][0]) == pytest.approx(nominal.hook_load, rel=1e-6)
    assert float(fields["axial_force"][-1]) == pytest.approx(-nominal.weight_on_bit, rel=1e-6)


def test_lumped_model_has_the_numbers_of_the_thesis() -> None:
    """(5-39) and table 5.1, with C = G J1/L1 (the table prints half of it); spec 8.4."""
    lumped = lumps(drillfem.load_scene(C1))
    assert lumped.stiffness == pytest.approx(938.096, rel=1e-6)
    assert lumped.inertia == pytest.approx(112.786, rel=1e-5)
    assert lumped.mass == pytest.approx(24614.4, rel=1e-6)
    line = StraightString(drillfem.load_scene(C1, {"model": "lumped"}))
    assert line.axial.mass.item() == lumped.mass and line.torsion.mass[1, 1] == lumped.inertia
    np.testing.assert_allclose(line.torsion.damping, 1e-4 * line.torsion.stiffness)


def test_fields_along_the_lumped_string() -> None:
    """The pipes are the spring, so the twist falls along them; the collars turn as one body."""
    scene = drillfem.load_scene(C1, {"model": "lumped", "string.0.length": "400 m"})
    fields = drillfem.simulate(scene, until=0.1).fields.isel(time=0)
    np.testing.assert_allclose(fields["arc_length"], [0, 400, 600])
    assert float(fields["spin"][0]) == pytest.approx(14.42)
    np.testing.assert_allclose(fields["spin"][1:], 1.1 * 14.42)


@pytest.mark.parametrize("blades", [4, 6])
def test_scene_given_by_numbers(blades: int) -> None:
    """Appendix C.2 backwards: the lumped scene that has these numbers; the thesis' own are its defaults' scales."""
    numbers = {"psi": 50.0, "beta": 0.3, "lambda": 5.0, "omega_0": 5.0, "W_0": 7.0, "blades": blades}
    scene = drillfem.Scene.from_dict({"dimensionless": numbers, "time": {"end": 20.0, "step": 1e-3}})
    found = dimensionless(scene)
    assert scene.model == "lumped" and scene.bit is not None and scene.bit.blades == blades
    got = (found.psi, found.beta, found.lambda_, found.omega_0, found.W_0, found.time, found.length)
    assert got == pytest.approx((50, 0.3, 5, 5, 7, 0.34674, 6.3831e-4), rel=1e-9)
    assert drillfem.Scene.from_dict(scene.to_dict()) == scene


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"dimensionless": {"psi": 50.0}}, "missing key dimensionless.beta"),
        ({"bit": {"blades": 4}}, "bit: must be left out"),
        ({"model": "spatial"}, "model = 'spatial'"),
        ({"rock": {"contact_strength": 1.0}}, "rock.contact_strength"),
    ],
)
def test_numbers_take_the_place_of_the_string(change: dict[str, object], part: str) -> None:
    numbers = {"psi": 50.0, "beta": 0.3, "lambda": 5.0, "omega_0": 5.0, "W_0": 7.0}
    data = {"dimensionless": numbers, "time": {"end": 20.0, "step": 1e-3}, **change}
    with pytest.raises(drillfem.errors.SceneError, match=part):
        drillfem.Scene.from_dict(data)


def test_a_scene_of_numbers_has_no_richer_model() -> None:
    numbers = {"psi": 50.0, "beta": 0.3, "lambda": 5.0, "omega_0": 5.0, "W_0": 7.0}
    data = drillfem.Scene.from_dict({"dimensionless": numbers, "time": {"end": 1.0, "step": 1e-3}}).to_dict()
    with pytest.raises(drillfem.errors.SceneError, match="has no string"):
        drillfem.Scene.from_dict({**data, "model": "axial-torsional"})
