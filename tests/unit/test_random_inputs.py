"""Random inputs of a scene: what a scene file may say, members that can be saved and run, samples known by number."""

from __future__ import annotations

import doctest
import logging
import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

import drillfem
from drillfem.cli import main
from drillfem.ensemble import fields, inputs, sampling
from drillfem.ensemble.inputs import Inputs
from drillfem.ensemble.sampling import METHODS, Sampler
from drillfem.errors import SceneError
from drillfem.scene import Scene, load_scene
from drillfem.scene.uncertain import with_value

C1, C2 = "vertical-c1-cd4", "curved-c2"
WEIGHT = {"key": "top_drive.weight_on_bit", "distribution": "norm", "parameters": {"loc": "45 kN", "scale": 2e3}}
FRICTION = {
    "key": "contact.friction",
    "mean": 0.12,
    "standard_deviation": 0.012,
    "support": [0.0, 0.6],
    "correlation_length": "10 m",
    "terms": 20,
    "length": "60 m",
}


_GIVEN = {
    "friction": ("contact.friction_static", "contact.friction_dynamic"),
    "weight": ("top_drive.weight_on_bit",),
    "rock": ("rock.intrinsic_specific_energy",),
}


def _scene(**changes: Any) -> Scene:
    """C1 with random friction, weight on bit and rock; ``friction__mean`` changes a key of one, None removes it."""
    data: dict[str, Any] = {
        "friction": dict(FRICTION),
        "weight": dict(WEIGHT),
        "rock": {
            "key": "rock.intrinsic_specific_energy",
            "distribution": "lognorm",
            "parameters": {"s": 0.1, "scale": "0.25 GPa"},
            "proportional": ["rock.contact_strength", "rock.contact_strength_stalled"],
        },
    }
    removed: dict[str, Any] = {"model": "lumped", "hole.kind": "straight", "hole.diameter": 0.2159}
    for name, value in changes.items():
        table, _, key = name.partition("__")
        if key and value is None:
            data[table].pop(key, None)
        else:
            data = with_value(data, name.replace("__", "."), value)
    data = {name: table for name, table in data.items() if table}
    for name, keys in _GIVEN.items():
        removed |= dict.fromkeys(keys if name in data else (), None)
    return load_scene(C1, {**removed, "random": data})


def _bare(overrides: dict[str, Any]) -> Scene:
    return load_scene(C1, overrides)


# -- the scene ------------------------------------------------------------------------------------------------------
def test_a_scene_stands_at_its_means_and_survives_writing() -> None:
    scene = _scene()
    assert scene.contact is not None and scene.rock is not None
    assert scene.top_drive.weight_on_bit == 45e3
    assert (scene.contact.friction_static, scene.contact.friction_dynamic) == (0.12, 0.12)
    assert scene.rock.intrinsic_specific_energy == pytest.approx(0.25e9 * math.exp(0.005))
    assert [r.name for r in scene.random] == ["friction", "weight", "rock"]
    assert Scene.from_dict(scene.to_dict()) == scene == scene.checked()
    assert hash(scene) == hash(scene.checked())
    clipped = _scene(weight__support=["46 kN", "50 kN"])
    assert clipped.top_drive.weight_on_bit == 46e3


def test_a_scene_as_toml_is_the_same_scene(tmp_path: Path) -> None:
    for scene in (_scene(), load_scene("pendulum"), load_scene("vertical-pi")):
        path = tmp_path / f"{scene.name}.toml"
        path.write_text(scene.to_toml())
        assert load_scene(path).to_dict() == scene.to_dict()
    odd = load_scene(C1, {"title": 'quote " and \\ and €', "bit.blade_angles": [0, 1, 2, 3, 4, 5]})
    (tmp_path / f"{odd.name}.toml").write_text(odd.to_toml(), encoding="utf-8")
    assert load_scene(tmp_path / f"{odd.name}.toml") == odd


def test_the_means_are_said_and_described(caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]) -> None:
    scene = _scene(friction=None, rock=None)
    with caplog.at_level(logging.INFO, "drillfem"):
        drillfem.simulate(scene, until=0.01)
    assert "random inputs at their means: top_drive.weight_on_bit 45000" in caplog.text
    command = ["info", C1, "--set", "top_drive.weight_on_bit=45 kN"]
    for name, value in {"key": '"top_drive.weight_on_bit"', "distribution": "norm", "parameters": "{loc=45e3}"}.items():
        command += ["--set", f"random.weight.{name}={value}"]
    assert main(command) == 0
    assert "top_drive.weight_on_bit: norm with loc 45000" in capsys.readouterr().out


# table.key = value (None: left out), what the line must say
NONE: dict[str, Any] = {"weight__parameters": {}}
BROKEN: list[tuple[dict[str, Any], list[str]]] = [
    ({"weight__key": None}, ["missing key random.weight.key"]),
    ({"weight__key": "top_drive.weight"}, ["random.weight.key = 'top_drive.weight'", "weight_on_bit"]),
    ({"weight__key": "title"}, ["random.weight.key = 'title'", "key of a number"]),
    ({**NONE, "weight__key": "string.7.length"}, ["random.weight.key = 'string.7.length'", "no entry 7 of 2"]),
    ({"weight__key": "material.density.x"}, ["random.weight.key = 'material.density.x'", "key of a number"]),
    ({"weight__keys": "x"}, ["unknown key random.weight.keys", "did you mean 'key'"]),
    ({"weight": {**WEIGHT, "key": "rock.contact_strength", "parameters": {"loc": 0.252e9}}}, ["that of random.weight"]),
    ({"weight__distribution": "normal"}, ["random.weight.distribution = 'normal'", "name of scipy.stats", "norm"]),
    ({"weight__distribution": "kstest"}, ["random.weight.distribution = 'kstest'", "name of scipy.stats"]),
    ({"weight__distribution": None}, ["missing key random.weight.distribution", "contact.friction"]),
    ({"weight__distribution": "cauchy"}, ["random.weight.distribution = 'cauchy'", "must have a mean"]),
    ({"weight__distribution": "gamma"}, ["missing key random.weight.parameters.a", "a number"]),
    ({"weight__parameters": {"mean": 3}}, ["random.weight.parameters.mean = 3", "one of loc, scale"]),
    ({"weight__parameters": {"scale": -3}}, ["random.weight.parameters = {'scale': -3", "scale > 0"]),
    ({"weight__parameters": {"scale": "3 kg"}}, ["random.weight.parameters.scale = '3 kg'", "in N", "wrong unit"]),
    ({"weight__parameters": [3]}, ["random.weight.parameters = [3]", "a table of numbers"]),
    ({"weight__support": [5, 3]}, ["random.weight.support = [5, 3]", "a least and a larger"]),
    ({"weight__support": [3]}, ["random.weight.support = [3]", "2 numbers"]),
    ({"weight__support": [-1, 3]}, ["random.weight.support.0 = -1", ">= 0", "top_drive.weight_on_bit"]),
    ({"weight__mean": 3}, ["random.weight.mean = 3", "left out", "belongs to a field"]),
    ({**NONE, "weight__key": "bit.blades"}, ["random.weight.distribution = 'norm'", "discrete", "bit.blades"]),
    ({"rock__proportional": ["rock.x"]}, ["random.rock.proportional.0 = 'rock.x'", "known are"]),
    ({"rock__proportional": ["bit.empirical.a1"]}, ["random.rock.proportional.0", "a key that the scene gives"]),
    ({"friction__mean": None}, ["missing key random.friction.mean", "a number"]),
    ({"friction__mean": 0.7}, ["random.friction.mean = 0.7", "from 0 to 0.6"]),
    ({"friction__standard_deviation": 0}, ["random.friction.standard_deviation = 0", "> 0"]),
    ({"friction__correlation_length": None}, ["missing key random.friction.correlation_length", "in m"]),
    ({"friction__correlation_length": "10 kg"}, ["random.friction.correlation_length = '10 kg'", "in m"]),
    ({"friction__covariance": "gauss"}, ["random.friction.covariance = 'gauss'", "matern", "module:function"]),
    ({"friction__covariance": "my:own"}, ["random.friction.correlation_length = '10 m'", "left out"]),
    ({"friction__covariance": "matern"}, ["missing key random.friction.smoothness", "> 0"]),
    ({"friction__smoothness": 1.5}, ["random.friction.smoothness = 1.5", "left out"]),
    ({"friction__terms": 0}, ["random.friction.terms = 0", ">= 1"]),
    ({"friction__captured_variance": 0.9}, ["random.friction.captured_variance = 0.9", "terms = 20"]),
    (
        {"friction__covariance": "squared-exponential", "friction__modes": "exact"},
        ["random.friction.modes = 'exact'", "'galerkin'"],
    ),
    ({"friction__modes": "svd"}, ["random.friction.modes = 'svd'", "exact, galerkin"]),
    ({"friction__length": 0}, ["random.friction.length = 0", "> 0 in m"]),
    ({"friction": 3}, ["random.friction = 3", "must be a table with key"]),
    ({"a b": {}}, []),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "said"), BROKEN, ids=[str(i) for i in range(len(BROKEN))])
def test_bad_input_is_one_line(changes: dict[str, Any], said: list[str]) -> None:
    if not said:
        with pytest.raises(SceneError, match=r"random\.a b = .*letters, digits"):
            _bare({"random": {"a b": {"key": "x"}}})
        return
    with pytest.raises(SceneError) as error:
        _scene(**changes)
    line = str(error.value)
    assert "\n" not in line and all(part in line for part in said), line


def test_a_number_is_not_given_twice() -> None:
    with pytest.raises(SceneError, match=r"top_drive.weight_on_bit = .*must be left out, or be the mean 45000"):
        _bare({"random": {"weight": WEIGHT}, "top_drive.weight_on_bit": "46 kN"})
    assert _bare({"random": {"weight": WEIGHT}, "top_drive.weight_on_bit": "45 kN"}).random
    friction = {"random": {"friction": FRICTION}, "contact.friction_static": None, "contact.friction_dynamic": None}
    with pytest.raises(SceneError, match=r"contact.friction_profile = .*left out where \[random.friction\]"):
        _bare({**friction, "contact.friction_profile": [[0, 0.2, 0.1], [9, 0.2, 0.1]]})
    with pytest.raises(SceneError, match=r"hole.section.0.friction_static = .*left out where \[random.friction\]"):
        _bare({**friction, "hole.section": [{"to": 9, "friction_static": 0.2, "friction_dynamic": 0.1}]})
    with pytest.raises(SceneError, match=r"random = 3: must be a table of tables"):
        _bare({"random": 3})


# -- members --------------------------------------------------------------------------------------------------------
def test_members_are_plain_scenes_that_can_be_saved_and_run(tmp_path: Path) -> None:
    made = Inputs.of(_scene())
    assert made.dimension == 22
    assert made.names[:4] == ("weight", "rock", "friction[1]", "friction[2]")
    member = made.member(Sampler("monte-carlo", 22, seed=1).member(4))
    scene = member.scene
    assert scene.random == () and scene.contact is not None and scene.rock is not None
    assert scene.top_drive.weight_on_bit == member.scalars["weight"] != 45e3
    rows = np.array(scene.contact.friction_profile)
    assert (rows[:, :2] == member.fields["friction"]).all() and (rows[:, 1] == rows[:, 2]).all()
    assert (rows[0, 0], rows[-1, 0], len(rows)) == (0.0, 60.0, 321)
    ratio = scene.rock.contact_strength / scene.rock.intrinsic_specific_energy
    base = _scene().rock
    assert base is not None and ratio == pytest.approx(base.contact_strength / base.intrinsic_specific_energy)
    path = tmp_path / f"{scene.name}.toml"
    path.write_text(scene.to_toml())
    assert load_scene(path) == scene
    assert main(["run", str(path), "--until", "0.01", "--out", str(tmp_path / "run"), "--no-certify"]) == 0
    assert drillfem.open_result(tmp_path / "run").scene == scene


def test_members_have_the_same_bits_in_another_process_and_order() -> None:
    made = Inputs.of(_scene())
    copy = pickle.loads(pickle.dumps(made))
    sampler = Sampler("monte-carlo", made.dimension, seed=7)
    forward = {i: made.member(sampler.member(i)).scene for i in range(4)}
    backward = {i: copy.member(Sampler("monte-carlo", 22, seed=7).member(i)).scene for i in reversed(range(4))}
    assert forward == backward and len(set(forward.values())) == 4


def test_numbers_follow_their_distributions() -> None:
    made = Inputs.of(_scene(friction=None, weight__support=["42 kN", "48 kN"]))
    sampler = Sampler("monte-carlo", 2, seed=0)
    numbers = made.numbers
    drawn = np.array([[n.at(x) for n, x in zip(numbers.values(), sampler.member(i), strict=True)] for i in range(400)])
    weight, clips = drawn[:, 0].T
    inside = (weight > 42e3) & (weight < 48e3)
    assert (clips == ~inside).all() and 0 < clips.sum() < 120
    assert stats.kstest(drawn[:, 1, 0], stats.lognorm(0.1, scale=0.25e9).cdf).pvalue > 1e-3
    assert made.member([0.5, 0.5]).scalars == pytest.approx({"weight": 45e3, "rock": 0.25e9})
    assert made.member([0.001, 0.5]).clips == 1
    blades = {"key": "bit.blades", "distribution": "randint", "parameters": {"low": 3, "high": 8}}
    whole = Inputs.of(load_scene(C1, {"bit.blades": None, "random.blades": blades}))
    assert [whole.member([u]).scene.bit.blades for u in (0.01, 0.5, 0.99)] == [3, 5, 7]  # type: ignore[union-attr]
    with pytest.raises(ValueError, match=r"must be \(2,\)"):
        made.member([0.5])
    with pytest.raises(ValueError, match="> 0 and < 1"):
        made.member([0.5, 1.0])
    with pytest.raises(SceneError, match=r"top_drive.weight_on_bit = -\d"):
        Inputs.of(_scene(friction=None, rock=None, weight__parameters={"loc": 45e3, "scale": 20e3})).member([0.001])


def test_static_and_dynamic_friction_may_be_fields_of_their_own() -> None:
    field = {**FRICTION, "terms": 5, "standard_deviation": 0.03}
    tables = {
        "rest": {**field, "key": "contact.friction_static", "mean": 0.3},
        "slip": {**field, "key": "contact.friction_dynamic", "mean": 0.29, "length": "30 m", "correlation_length": 5.0},
    }
    nothing = {"contact.friction_static": None, "contact.friction_dynamic": None}
    made = Inputs.of(_bare({**nothing, "random": tables}))
    assert made.dimension == 10
    assert set(made.names) == {f"{name}[{k}]" for name in tables for k in range(1, 6)}
    assert [n for n in made.names if n.startswith("rest")] == [f"rest[{k}]" for k in range(1, 6)]
    member = made.member(Sampler("monte-carlo", 10, seed=3).member(0))
    assert member.scene.contact is not None
    rows = np.array(member.scene.contact.friction_profile)
    assert (rows[:, 2] <= rows[:, 1]).all() and member.clips == (rows[:, 2] == rows[:, 1]).sum() > 0
    assert (rows[rows[:, 0] > 30, 2] == np.minimum(rows[rows[:, 0] > 30, 1], member.fields["slip"][-1, 1])).all()
    alone = Inputs.of(_bare({"contact.friction_static": None, "random": {"rest": tables["rest"]}}))
    member = alone.member(np.full(5, 0.5))
    assert member.scene.contact is not None and member.clips == 0
    assert member.scene.contact.friction_profile[0] == (0.0, 0.3, 0.15)  # type: ignore[index]
    both = {"key": "contact.friction", "distribution": "uniform", "parameters": {"loc": 0.1, "scale": 0.2}}
    same = Inputs.of(_bare({**nothing, "random": {"all": both}})).member([0.25]).scene.contact
    assert same is not None and same.friction_profile is None
    assert (same.friction_static, same.friction_dynamic) == pytest.approx((0.15, 0.15))


def test_the_field_covers_what_the_run_can_reach() -> None:
    length = {name: Inputs.of(s).facts["friction"]["length"] for name, s in {
        "given": _scene(),
        "drilled": _scene(friction__length=None, friction__terms=None, friction__captured_variance=0.2),
    }.items()}  # fmt: skip
    scene = _scene()
    drilled = (scene.time.end - scene.time.start) * scene.nominal().rate_of_penetration
    assert length == pytest.approx({"given": 60.0, "drilled": scene.length + 2 * drilled})
    facts = Inputs.of(_scene(friction__terms=None)).facts["friction"]
    assert (facts["terms"], facts["modes"]) == (25, "exact") and facts["captured_variance"] > 0.95


@pytest.mark.dolfinx
def test_galerkin_fields_in_a_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    exact, galerkin = Inputs.of(_scene()), Inputs.of(_scene(friction__modes="galerkin"))
    u = Sampler("monte-carlo", 22, seed=2).member(0)
    one, two = (made.member(u).fields["friction"] for made in (exact, galerkin))
    assert np.abs(one - two).max() < 1e-6 * 0.012
    smooth = _scene(friction__covariance="squared-exponential", friction__terms=60)
    with pytest.raises(SceneError, match=r"random.friction.terms = 60: must be at most \d+: .*round-off"):
        Inputs.of(smooth)
    (tmp_path / "layered_rock.py").write_text("import numpy as np\ndef layers(d): return np.exp(-d / 8) * np.cos(d)\n")
    monkeypatch.chdir(tmp_path)
    own = {"friction__covariance": "layered_rock:layers", "friction__correlation_length": None}
    assert Inputs.of(_scene(**own)).facts["friction"]["modes"] == "galerkin"
    with pytest.raises(SceneError, match=r"random.friction.covariance = 'layered_rock:x': layered_rock has no x"):
        Inputs.of(_scene(**{**own, "friction__covariance": "layered_rock:x"}))
    with pytest.raises(SceneError, match="missing key random"):
        Inputs.of(load_scene(C1))


# -- samples --------------------------------------------------------------------------------------------------------
def test_a_member_is_known_by_its_number() -> None:
    sampler = Sampler("monte-carlo", 3, seed=11)
    alone = np.random.Generator(np.random.PCG64(np.random.SeedSequence(11, spawn_key=(5,)))).random(3)
    assert (sampler.member(5) == alone).all()
    assert (Sampler("monte-carlo", 3, seed=11, count=9).member(5) == alone).all()
    assert (Sampler("monte-carlo", 3, seed=11, stream=(1,)).member(5) != alone).all()
    # a longer member begins with the same numbers: a term more does not change the others
    assert (Sampler("monte-carlo", 8, seed=11).member(5)[:3] == alone).all()
    points = np.array([sampler.member(i) for i in range(2000)])
    assert stats.kstest(points.ravel(), "uniform").pvalue > 1e-3
    assert np.abs(np.corrcoef(points.T) - np.eye(3)).max() < 4 / math.sqrt(2000)


@pytest.mark.parametrize("method", METHODS)
def test_sets_are_fixed_by_their_seed(method: str) -> None:
    one, two = Sampler(method, 4, 3, 32), Sampler(method, 4, 3, 32)
    assert all((one.member(i) == two.member(i)).all() for i in reversed(range(32)))
    assert (Sampler(method, 4, 4, 32).member(0) != one.member(0)).all()
    points = np.array([one.member(i) for i in range(32)])
    assert ((points > 0) & (points < 1)).all()
    if method != "monte-carlo":  # one point in each of 32 slices, along every axis
        assert (np.sort((points * 32).astype(int), axis=0) == np.arange(32)[:, None]).all()
        with pytest.raises(IndexError):
            one.member(32)
        with pytest.raises(SceneError, match=f"sampling = '{method}': needs the number"):
            Sampler(method, 4, 3)
    if method == "sobol":
        assert (Sampler(method, 4, 3, 100).member(7) == one.member(7)).all()
        assert len({tuple(Sampler(method, 4, 3, 100).member(i)) for i in range(100)}) == 100
    with pytest.raises(SceneError, match="sampling = 'halton': must be one of monte-carlo, sobol, latin-hypercube"):
        Sampler("halton", 4, 3)
    with pytest.raises(SceneError, match="must be at most 21201"):
        Sampler("sobol", 30_000, 3, 8)


@pytest.mark.parametrize("module", [fields, inputs, sampling])
def test_examples_in_the_docstrings(module: Any) -> None:
    found = doctest.testmod(module, optionflags=doctest.ELLIPSIS)
    assert found.attempted > 0 and found.failed == 0
