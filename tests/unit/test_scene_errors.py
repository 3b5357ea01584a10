"""Bad input: each ends in one line that names the key, the value as given and what is allowed."""

import os
from pathlib import Path
from typing import Any

import pytest

from drillfem.errors import DrillfemError, SceneError
from drillfem.scene import Scene, load_scene

V, P, S, R, B, E = "vertical-c1-cd4", "pendulum", "spin-up", "roll-up", "bend-45", "vertical-pi"

# scene, overrides, what the line must contain: the key, then the value or what is allowed
BROKEN: list[tuple[str, dict[str, Any], list[str]]] = [
    # unknown keys
    (V, {"bit.radis": 0.1}, ["bit.radis = 0.1", "did you mean 'radius'"]),
    (V, {"tittle": "x"}, ["tittle = 'x'", "did you mean 'title'"]),
    (V, {"string.0.lenght": "5 m"}, ["string.0.lenght = '5 m'", "did you mean 'length'"]),
    (V, {"mesh.zzz": 3}, ["mesh.zzz = 3", "elements, degree, grading, quadrature"]),
    (V, {"rock.surface.order": 3}, ["rock.surface.order = 3", "scheme, degree, elements"]),
    (V, {"bit.line\nbreak": 3}, ["unknown key bit.line break"]),
    # missing keys
    (V, {"bit.blades": None}, ["missing key bit.blades", "a whole number >= 1"]),
    (V, {"string": None}, ["missing key string", "one or more tables"]),
    (V, {"string.0.length": None}, ["missing key string.0.length", "a number > 0 in m"]),
    (V, {"string.0.outer_diameter": None}, ["missing key string.0.outer_diameter", "stiffness"]),
    (V, {"material": None}, ["missing key material", "drill pipe"]),
    (V, {"material.density": None}, ["missing key material.density", "> 0 in kg/m^3"]),
    (V, {"material.shear_modulus": None}, ["missing key material.shear_modulus", "poisson_ratio"]),
    (V, {"material.youngs_modulus": None}, ["missing key material.youngs_modulus", "elasticity"]),
    (V, {"hole.diameter": None}, ["missing key hole.diameter", "in m"]),
    (V, {"top_drive.speed": None}, ["missing key top_drive.speed", "rad/s"]),
    (V, {"top_drive.weight_on_bit": None}, ["missing key top_drive.weight_on_bit", "hook_load"]),
    (V, {"rock": None}, ["missing key rock", "contact_strength"]),
    (V, {"time.end": None}, ["missing key time.end", "later than start = 0 s"]),
    (V, {"time": None}, ["missing key time.end", "later than start = 0 s"]),
    (V, {"time.step": None}, ["missing key time.step", "> 0"]),
    (S, {"top_drive.profile": None}, ["missing key top_drive.profile", "spin-up, c3"]),
    (S, {"string.0.mass_per_length": None}, ["missing key string.0.mass_per_length", "dynamics"]),
    (S, {"ends.bottom": None}, ["missing key ends.bottom", "free, guided, clamped"]),
    (R, {"ends.top": None}, ["missing key ends.top", "clamped, pinned"]),
    (R, {"initial": None}, ["missing key initial.state", "rest, given"]),
    (B, {"reference.radius": None}, ["missing key reference.radius", "in m"]),
    # wrong units
    (V, {"bit.radius": "5 kg"}, ["bit.radius = '5 kg'", "in m", "wrong unit 'kg'"]),
    (V, {"bit.radius": "'108'"}, ["bit.radius = '108'", "a number > 0 in m", "wrong unit ''"]),
    (V, {"bit.radius": 108}, ["bit.radius = 108", "half of hole.diameter = 0.2159 m"]),
    (V, {"bit.radius": "108 milimetres!"}, ["bit.radius = '108 milimetres!'", "in m"]),
    (V, {"bit.radius": "5 furlings"}, ["bit.radius = '5 furlings'", "unknown unit"]),
    (V, {"top_drive.speed": "2 Hz"}, ["top_drive.speed = '2 Hz'", "rad/s"]),
    (V, {"top_drive.weight_on_bit": "45.7 kNm"}, ["top_drive.weight_on_bit = '45.7 kNm'", "in N"]),
    (V, {"bit.friction": "30 deg"}, ["bit.friction = '30 deg'", "a number >= 0"]),
    (B, {"ends.tip_force": '[0, "600 Pa", 0]'}, ["ends.tip_force.1 = '600 Pa'", "in N"]),
    # wrong types
    (V, {"bit.blades": 6.5}, ["bit.blades = 6.5", "a whole number >= 1"]),
    (V, {"bit.blades": "six"}, ["bit.blades = 'six'", "a whole number"]),
    (V, {"bit.blades": "true"}, ["bit.blades = True", "a whole number"]),
    (V, {"bit.radius": "[1, 2]"}, ["bit.radius = [1, 2]", "a number > 0 in m"]),
    (V, {"bit.radius": "2024-01-01"}, ["bit.radius = datetime.date", "a number"]),
    (V, {"title": 5}, ["title = 5", "one line of text"]),
    (V, {"bit": 5}, ["bit = 5", "must be a table with kind, radius"]),
    (V, {"string": "pipe"}, ["string = 'pipe'", "one or more tables"]),
    (V, {"string": "[1]"}, ["string.0 = 1", "must be a table with name, length"]),
    (V, {"string": []}, ["string = []", "one or more tables"]),
    (V, {"contact.projected": 1}, ["contact.projected = 1", "true or false"]),
    (V, {"ends.tip_force": "[1, 2]"}, ["ends.tip_force = [1, 2]", "a list of 3 numbers in N"]),
    (V, {"ends.tip_force": 5}, ["ends.tip_force = 5", "a list of 3 numbers in N"]),
    # impossible values
    (V, {"bit.radius": "-3 mm"}, ["bit.radius = '-3 mm'", "> 0 in m"]),
    (V, {"bit.radius": 0}, ["bit.radius = 0", "> 0 in m"]),
    (V, {"bit.radius": "nan"}, ["bit.radius = nan", "not finite"]),
    (V, {"time.end": "inf"}, ["time.end = inf", "not finite"]),
    (V, {"bit.radius": "1e999 m"}, ["bit.radius = '1e999 m'", "not finite"]),
    (V, {"bit.radius": "1e300 m"}, ["bit.radius = '1e300 m'", "beyond all sizes"]),
    (V, {"time.end": 10**400}, ["time.end = 1000", "too large"]),
    (V, {"string.0.inner_diameter": "127 mm"},
     ["string.0.inner_diameter = '127 mm'", "outer_diameter = 0.127 m"]),
    (V, {"string.1.inner_diameter": "-1 mm"}, ["string.1.inner_diameter = '-1 mm'", ">= 0"]),
    (V, {"material.density": -7800}, ["material.density = -7800", "> 0"]),
    (V, {"material.retardation_time": -1}, ["material.retardation_time = -1", ">= 0"]),
    (V, {"material.poisson_ratio": 0.3}, ["material.poisson_ratio = 0.3", "shear_modulus"]),
    (P, {"material.poisson_ratio": 0.6}, ["material.poisson_ratio = 0.6", "> -1 and <= 0.5"]),
    (V, {"title": ""}, ["title = ''", "not empty"]),
    (V, {"title": "two\nlines"}, [r"title = 'two\nlines'", "one line of text"]),
    (V, {"string.0.name": " "}, ["string.0.name = ' '", "not empty"]),
    (V, {"bit.radius": ""}, ["bit.radius = ''", "> 0 in m"]),
    (V, {"model": ""}, ["model = ''", "one of lumped, torsional"]),
    (V, {"hole.diameter": "150 mm"},
     ["hole.diameter = '150 mm'", "string.1.outer_diameter = 0.1524 m", "collars"]),
    (V, {"hole.kind": "bent"}, ["hole.kind = 'bent'", "one of none, straight, arc"]),
    (V, {"hole.kind": "arc"}, ["missing key hole.radius", "kind = 'arc'"]),
    (V, {"hole.pitch": 100}, ["hole.pitch = 100", "belongs to helix"]),
    (V, {"hole.kind": "survey", "hole.survey": [[0, 0, 0], [10, 0]]}, ["hole.survey", "rows of 3 numbers"]),
    (V, {"hole.kind": "survey", "hole.survey": [[10, 0, 0], [10, 0, 0]]}, ["hole.survey", "increase"]),
    (V, {"hole.kind": "build", "hole.kick_off": 9, "hole.radius": 500, "hole.inclination": 1,
         "hole.final_inclination": 1}, ["hole.final_inclination = 1", "must exceed inclination"]),
    (V, {"hole.kind": "none"}, ["hole.diameter = '215.9 mm'", "left out"]),
    (V, {"contact.friction_dynamic": 0.4}, ["contact.friction_dynamic = 0.4", "friction_static = 0.3"]),
    (V, {"bit.blades": 0}, ["bit.blades = 0", ">= 1"]),
    (V, {"bit.blade_angles": "[0, 1, 2]"}, ["bit.blade_angles = [0, 1, 2]", "6 blades, has 3"]),
    (V, {"bit.blade_angles": "[0, 1, 3, 2, 4, 5]"}, ["bit.blade_angles = [0, 1, 3, 2, 4, 5]", "increasing"]),
    (V, {"bit.blade_angles": "[0, 1, 2, 3, 4, 7]"}, ["bit.blade_angles", "less than 360 deg"]),
    (V, {"bit.kind": "roller"}, ["bit.kind = 'roller'", "one of cutting, free, empirical"]),
    (V, {"bit.kind": "empirical"}, ["rock = ", "must be left out for bit.kind = 'empirical'"]),
    (V, {"bit.wear_flat_length": "2 mm"}, ["weight_on_bit = '45.7 kN'", "54432 N", "wear_flat_length"]),
    (V, {"top_drive.hook_load": "460 kN"}, ["top_drive.hook_load = '460 kN'", "weight_on_bit = 45700 N"]),
    (V, {"top_drive.weight_on_bit": None, "top_drive.hook_load": "600 kN"},
     ["hook_load = '600 kN'", "509627 N"]),
    (V, {"top_drive.weight_on_bit": "600 kN"}, ["weight_on_bit = '600 kN'", "509627 N"]),
    (V, {"top_drive.speed": "-10 rpm"}, ["top_drive.speed = '-10 rpm'", "> 0 rad/s"]),
    (V, {"top_drive.kind": "pid"}, ["top_drive.kind = 'pid'", "imposed-speed"]),
    (V, {"top_drive.kind": "pi"}, ["missing key top_drive.proportional_gain", "N m s/rad"]),
    (V, {"top_drive.torque_limit": 1e4}, ["top_drive.torque_limit = 10000.0", "takes what it needs"]),
    (V, {"top_drive.block_speed": 0.01}, ["top_drive.block_speed = 0.01", "left out"]),
    (V, {"top_drive.kind": "none"}, ["missing key ends.top", "[top_drive]"]),
    (V, {"top_drive.profile": "c3"}, ["top_drive.profile = 'c3'", "left out"]),
    (V, {"top_drive.axis": "[0, 1, 0]"}, ["top_drive.axis = [0, 1, 0]", "[0, 0, 1]"]),
    (V, {"bit.kind": "free"}, ["weight_on_bit = '45.7 kN'", "must be 0"]),
    (V, {"bit": None}, ["missing key ends.bottom", "[bit]"]),
    (V, {"ends.bottom": "free"}, ["ends.bottom = 'free'", "must be 'bit'"]),
    (V, {"ends.top": "clamped"}, ["ends.top = 'clamped'", "must be 'driven'"]),
    (V, {"time.analysis": "static"}, ["time.end = '200 s'", "left out"]),
    (V, {"reference.shape": "arc", "reference.radius": 500}, ["reference.shape = 'arc'", "'straight'"]),
    (V, {"rock.surface.scheme": "weno"}, ["rock.surface.scheme = 'weno'", "one of dg, supg, upwind, profile"]),
    (V, {"rock.surface.degree": 9}, ["rock.surface.degree = 9", "from 0 to 4"]),
    (V, {"initial.state": "given", "initial.seed": -1}, ["initial.seed = -1", ">= 0"]),
    (V, {"initial.velocity": "[0, 0, 1]"}, ["initial.velocity = [0, 0, 1]", "left out"]),
    (S, {"initial.state": "nominal"}, ["initial.state = 'nominal'", "rest, given"]),
    (P, {"gravity.direction": "[1, 1, 0]"}, ["gravity.direction = [1, 1, 0]", "unit vector"]),
    (P, {"contact.stiffness": 1, "contact.friction_static": 1, "contact.friction_dynamic": 1},
     ["missing key hole.kind", "one of straight, arc"]),
    (B, {"reference.bend_towards": "[0, 0, 1]"},
     ["reference.bend_towards = [0, 0, 1]", "unit vector across e3"]),
    (S, {"string.0.material": {"density": 1, "youngs_modulus": 1, "poisson_ratio": 0}},
     ["string.0.material", "left out"]),
    (V, {"string.0.mass_per_length": 5}, ["string.0.mass_per_length = 5", "left out"]),
    # drives, empirical bits, mud
    (V, {"top_drive.kind": "soft-torque"}, ["missing key ends.top_inertia", "> 0 kg m^2"]),
    (V, {"top_drive.rise_time": "2 s"}, ["top_drive.rise_time = '2 s'", "initial.state = 'nominal'"]),
    (V, {"top_drive.weight_on_bit": None, "top_drive.block_speed": 0}, ["initial.state", "rest or laid", "0 m/s"]),
    ("curved-c2", {"hole.inclination": "10 deg"}, ["top_drive.hook_load = '441.08 kN'", "here by 10 deg"]),
    (V, {"model": "lumped", "top_drive.kind": "z-torque"}, ["model = 'lumped'", "turns at a given speed, not by a"]),
    (V, {"model": "torsional", "mud.density": 1200}, ["model = 'torsional'", "it knows no mud"]),
    (V, {"mud.viscosity": 0.1}, ["missing key mud.density", "> 0 in kg/m^3"]),
    (P, {"mud.density": 1000, "mud.viscosity": 0.1}, ["mud.viscosity = 0.1", "left out where hole.kind = 'none'"]),
    (S, {"mud.density": 1000}, ["missing key string.0.outer_diameter", "[mud]"]),
    (E, {"model": "torsional"}, ["model = 'torsional'", "by another law"]),
    (E, {"top_drive.weight_on_bit": "30 kN"}, ["weight_on_bit = '30 kN'", "exceed 34628.8 N, below which"]),
    (E, {"initial.state": "laid"}, ["initial.spin = '70 rpm'", "left out where state = 'laid'"]),
    (E, {"bit.empirical.force": "constant"}, ["bit.empirical.force = 'constant'", "one of reaction, nominal"]),
    (E, {"top_drive.weight_on_bit": "1500 kN"}, ["weight_on_bit = '1500 kN'", "not exceed the string's weight"]),
    # numerics
    (V, {"mesh.degree": 5}, ["mesh.degree = 5", "from 1 to 4"]),
    (V, {"mesh.degree": 0}, ["mesh.degree = 0", "from 1 to 4"]),
    (V, {"mesh.elements": 1}, ["mesh.elements = 1", "2 sections"]),
    (V, {"mesh.elements": 0}, ["mesh.elements = 0", "from 1 to 100000"]),
    (V, {"time.step": 0}, ["time.step = 0", "> 0"]),
    (V, {"time.step": "-1 ms"}, ["time.step = '-1 ms'", "> 0"]),
    (V, {"time.step": "300 s"}, ["time.step = '300 s'", "end - start = 200 s"]),
    (V, {"time.step": "2 ms"}, ["output.interval = '1 ms'", "multiple of time.step = 0.002 s"]),
    (V, {"time.step": "10 ms", "output.interval": "10 ms"}, ["time.step = '10 ms'", "at most 0.0091 s"]),
    (V, {"model": "spatial", "time.engine": "condensed"}, ["time.engine = 'condensed'", "default, petsc"]),
    (V, {"time.engine": "petsc", "time.integrator": "exact"}, ["time.integrator = 'exact'", "one of default, gen"]),
    (V, {"time.engine": "condensed", "time.adaptive": True}, ["time.adaptive = True", "'condensed'"]),
    (V, {"model": "lumped", "time.integrator": "theta"}, ["time.integrator = 'theta'", "exact, trap", "model lumped"]),
    (V, {"model": "torsional", "time.engine": "characteristics"}, ["time.engine = 'characteristics'", "with damping"]),
    (V, {"model": "spatial", "time.integrator": "explicit"}, ["time.integrator = 'explicit'", "only a straight"]),
    (V, {"inertia.distributed": 0}, ["inertia.distributed = 0", "> 0 and <= 1"]),
    (P, {"inertia.distributed": 0.5}, ["inertia.distributed = 0.5", "cutting bit"]),
    (V, {"time.engine": "condensed", "time.integrator": "bdf"}, ["time.integrator = 'bdf'", "default, exact"]),
    (S, {"time.integrator": "exact"}, ["time.integrator = 'exact'", "generalized-alpha"]),
    (S, {"time.order": 6}, ["time.order = 6", "from 2 to 5"]),
    (V, {"output.interval": "1.5 ms"}, ["output.interval = '1.5 ms'", "multiple of time.step = 0.001 s"]),
    (V, {"output.interval": "300 s"}, ["output.interval = '300 s'", "200 s"]),
    (V, {"output.fields_interval": "0.1 ms"}, ["output.fields_interval = '0.1 ms'", "output.interval"]),
    (V, {"output.checkpoint_interval": 1e-6}, ["output.checkpoint_interval = 1e-06", "time.step"]),
    (V, {"time.end": 0}, ["time.end = 0", "later than start = 0 s"]),
    (V, {"time.start": "300 s"}, ["time.end = '200 s'", "later than start = 300 s"]),
    (V, {"time.integrator": "rk4"}, ["time.integrator = 'rk4'", "generalized-alpha"]),
    (V, {"time.rho_infinity": 1.5}, ["time.rho_infinity = 1.5", "from 0 to 1"]),
    (V, {"time.engine": "condensed", "model": "spatial"}, ["time.engine = 'condensed'", "spatial"]),
    (R, {"ends.top": "pinned"}, ["ends.top = 'pinned'", "clamped"]),
    # models
    (S, {"model": "lumped"}, ["model = 'lumped'", "one of planar, spatial, auto", "there is none"]),
    (V, {"model": "soft-string"}, ["model = 'soft-string'", "spatial, auto", "touches no rock"]),
    (V, {"model": "spacial"}, ["model = 'spacial'", "did you mean 'spatial'"]),
    (P, {"model": "torsional"}, ["model = 'torsional'", "planar, spatial, auto", "gravity acts across"]),
    (V, {"model": "planar"}, ["model = 'planar'", "axial-torsional, spatial, auto"]),
    (P, {"model": "axial-torsional"}, ["model = 'axial-torsional'", "planar, spatial", "gravity"]),
    (B, {"model": "planar"}, ["model = 'planar'", "one of spatial, auto"]),
    (V, {"reading": "printed"}, ["reading = 'printed'", "recommended, literal"]),
    # overrides
    (V, {"bit..radius": 1}, ["override 'bit..radius' = 1", "key=value"]),
    (V, {"": 1}, ["override '' = 1", "key=value"]),
    (V, {".bit": 1}, ["override '.bit' = 1", "key=value"]),
    (V, {"string.2.length": 1}, ["string.2", "a number from 0 to 1"]),
    (V, {"string.pipe.length": 1}, ["string.pipe", "a number from 0 to 1"]),
    (V, {"string.-1.length": 1}, ["string.-1", "a number from 0 to 1"]),
    (V, {"bit.radius.x": 1}, ["bit.radius.x = 1", "is no table"]),
    (V, {"bitt.radius": 1}, ["unknown key bitt", "did you mean 'bit'"]),
]  # fmt: skip


def one_line(error: DrillfemError, parts: list[str]) -> None:
    text = str(error)
    assert len(text.splitlines()) == 1 and text.isprintable()
    assert len(text) < 400
    for part in parts:
        assert part in text, text


@pytest.mark.parametrize(("name", "over", "parts"), BROKEN, ids=[f"{n}-{list(o)}" for n, o, _ in BROKEN])
def test_broken_scene(name: str, over: dict[str, Any], parts: list[str]) -> None:
    with pytest.raises(SceneError) as caught:
        load_scene(name, over)
    one_line(caught.value, [f"scene {name}: ", *parts])


def test_there_are_many_broken_scenes() -> None:
    assert len(BROKEN) >= 60


FILES: list[tuple[str, bytes | None, list[str]]] = [
    ("gone.toml", None, ["gone.toml", "no such file"]),
    ("a.toml", b'title = "x"\n[bit\nradius = 1\n', ["not valid TOML", "line 2"]),
    ("a.toml", b"a = 1\na = 2\n", ["not valid TOML", "line 2"]),
    ("a.toml", b"[" * 100000, ["not valid TOML"]),
    ("a.toml", b"title = " + b"[" * 100000, ["not valid TOML"]),
    ("a.toml", b"time.end = " + b"9" * 5000, ["not valid TOML"]),
    ("a.toml", b'title = "caf\xe9"\n', ["not UTF-8", "byte 12"]),
    ("a.toml", b"\x00\x01\x02", ["not valid TOML"]),
    ("a.toml", b"", ["missing key string"]),
    ("a.toml", b'title = "nothing else"\n', ["missing key string"]),
]


@pytest.mark.parametrize(("name", "content", "parts"), FILES)
def test_broken_file(tmp_path: Path, name: str, content: bytes | None, parts: list[str]) -> None:
    file = tmp_path / name
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(SceneError) as caught:
        load_scene(file)
    one_line(caught.value, parts)


def test_a_folder_is_no_scene(tmp_path: Path) -> None:
    with pytest.raises(SceneError) as caught:
        load_scene(tmp_path)
    one_line(caught.value, [str(tmp_path), "is a folder"])


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_unreadable_file(tmp_path: Path) -> None:
    file = tmp_path / "a.toml"
    file.write_text("")
    file.chmod(0)
    with pytest.raises(SceneError, match="cannot be read"):
        load_scene(file)


@pytest.mark.parametrize("name", ["", ".", "vertical-c1", "x\0y", "n" * 5000, "../scenes", "no/such/place.toml"])
def test_unknown_name(name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SceneError) as caught:
        load_scene(name)
    assert len(str(caught.value).splitlines()) == 1


def test_unknown_name_lists_or_suggests() -> None:
    with pytest.raises(SceneError, match="did you mean 'vertical-c1-cd"):
        load_scene("vertical-c1-cd7")
    with pytest.raises(SceneError, match=r"known are bend-45, .*pendulum"):
        load_scene("zzz")


def test_a_scene_changed_in_python_is_checked_on_demand() -> None:
    data = load_scene(V).to_dict()
    data["bit"]["blades"] = 0
    with pytest.raises(SceneError, match=r"^bit.blades = 0: must be a whole number >= 1$"):
        Scene.from_dict(data)
