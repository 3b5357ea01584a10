"""Pictures from synthetic results: they exist, show what they should, and need no display."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr

from drillfem.errors import MissingDependency, SceneError
from drillfem.render import charts, render_all, render_result, style
from drillfem.render.story import Story

HISTORY_UNITS = {
    "bit_angular_speed": "rad/s",
    "bit_axial_speed": "m/s",
    "bit_angle": "rad",
    "bit_depth": "m",
    "bit_torque": "N m",
    "bit_weight": "N",
    "depth_of_cut": "m",
    "top_torque": "N m",
    "top_angular_speed": "rad/s",
    "hook_load": "N",
    "top_power": "W",
    "kinetic_energy": "J",
    "strain_energy": "J",
}
OMEGA, RADIUS, BLADES, CUT = 14.42, 0.108, 6, 1.261e-3


@dataclass
class FakeResult:
    """What render asks of a result."""

    history: xr.Dataset
    fields: xr.Dataset | None
    scene: Any
    manifest: dict[str, Any] = field(default_factory=dict)
    summary: dict[str, Any] = field(default_factory=dict)


def drilling(end: float = 12.0, nodes: int = 97, step: float = 0.01, fields_step: float = 0.05) -> FakeResult:
    """A 1200 m string with torsional and axial waves and a rock cut in six sectors."""
    length, first = 1200.0, 1000.0
    modes = ((0.453, 0.8), (3.18, 0.25), (4.68, 0.14), (7.40, 0.05))
    arc = np.linspace(0, length, nodes)
    time = np.arange(0, end + step / 2, step)
    when = np.arange(0, end + 1e-9, fields_step)

    def angle(s: np.ndarray, t: np.ndarray) -> np.ndarray:
        steady = -3.48 * np.minimum(s, first) / first - 0.16 * np.maximum(s - first, 0) / (length - first)
        phi = OMEGA * t + steady
        for k, (f, a) in enumerate(modes):
            phi = phi + a * np.sin((2 * [1, 3, 4, 6][k] - 1) * np.pi * s / 2 / length) * np.sin(2 * np.pi * f * t + k)
        return phi

    def spin(s: np.ndarray, t: np.ndarray) -> np.ndarray:
        return (angle(s, t + 1e-4) - angle(s, t - 1e-4)) / 2e-4

    def dip(t: np.ndarray) -> np.ndarray:
        return 2.894e-3 * t + 6e-5 * np.sin(2 * np.pi * 13.1 * t) + 1e-4 * np.sin(2 * np.pi * 0.45 * t)

    bit_spin = spin(np.array(length), time)
    cut = np.maximum(BLADES * (dip(time) - dip(time - 2 * np.pi / BLADES / OMEGA)), 0)
    torque = 3264 * (0.4 + 0.6 * cut / CUT)
    history = {
        "bit_angular_speed": np.maximum(bit_spin, 0),
        "bit_axial_speed": np.gradient(dip(time), time),
        "bit_angle": angle(np.array(length), time),
        "bit_depth": np.maximum.accumulate(dip(time)),
        "bit_torque": torque,
        "bit_weight": 32.66e3 + 1.034e7 * cut,
        "depth_of_cut": cut,
        "top_torque": np.full_like(time, 3264.0),
        "top_angular_speed": np.full_like(time, OMEGA),
        "hook_load": np.full_like(time, 415e3),
        "top_power": np.full_like(time, 47.1e3),
        "kinetic_energy": 1.5e4 + 50 * np.sin(time),
        "strain_energy": 6e3 + 40 * np.cos(time),
    }
    s, t = arc[None, :], when[:, None]
    phi = angle(s, t)
    zero = np.zeros_like(phi)
    z = s + 0.4 * s / length + dip(t)
    eta = np.linspace(0, 2 * np.pi / BLADES, 40)
    past = when[:, None] - eta[None, :] / OMEGA
    fields = xr.Dataset(
        {
            "position": (("time", "node", "xyz"), np.stack([zero, zero, z], axis=2), {"units": "m"}),
            "director1": (
                ("time", "node", "xyz"),
                np.stack([np.cos(phi), np.sin(phi), zero], axis=2),
                {"units": "1"},
            ),
            "director3": (("time", "node", "xyz"), np.stack([zero, zero, zero + 1], axis=2), {"units": "1"}),
            "spin": (("time", "node"), spin(s, t), {"units": "rad/s"}),
            "axial_speed": (
                ("time", "node"),
                2.894e-3 + 0.005 * np.cos(3 * np.pi * s / length) * np.cos(40 * t),
                {"units": "m/s"},
            ),
            "axial_force": (("time", "node"), 415e3 - 384 * s + 0 * t, {"units": "N"}),
            "outer_diameter": ("node", np.where(arc <= first, 0.127, 0.1524), {"units": "m"}),
            "rock_angle": (("time", "rock_node"), np.broadcast_to(eta, past.shape), {"units": "rad"}),
            "rock_height": (("time", "rock_node"), dip(past), {"units": "m"}),
        },
        coords={"time": ("time", when, {"units": "s"}), "arc_length": ("node", arc, {"units": "m"})},
    )
    string = (
        SimpleNamespace(name="drill pipe", length=first, outer_diameter=0.127, inner_diameter=0.108),
        SimpleNamespace(name="collars", length=length - first, outer_diameter=0.1524, inner_diameter=0.056),
    )
    nominal = SimpleNamespace(
        depth_of_cut=CUT,
        rate_of_penetration=2.894e-3,
        torque_on_bit=3264.0,
        hook_load=415e3,
        weight_on_bit=45.7e3,
    )
    scene = SimpleNamespace(
        title="Chapter 6, C1, c_d = 1e-4 s",
        name="vertical-c1-cd4",
        string=string,
        hole=SimpleNamespace(kind="straight", diameter=0.2159),
        bit=SimpleNamespace(kind="cutting", radius=RADIUS, blades=BLADES, blade_angles=None),
        top_drive=SimpleNamespace(kind="imposed-speed", speed=OMEGA),
        time=SimpleNamespace(analysis="dynamic"),
        material=SimpleNamespace(shear_modulus=77e9, youngs_modulus=210e9, density=7800.0),
        nominal=lambda: nominal,
    )
    data = {n: ("time", v, {"units": HISTORY_UNITS[n]}) for n, v in history.items()}
    return FakeResult(
        xr.Dataset(data, coords={"time": ("time", time, {"units": "s"})}),
        fields,
        scene,
        {},
        {"model": "axial-torsional"},
    )


def bending(kind: str = "pendulum", nodes: int = 33, poses: int = 21) -> FakeResult:
    """A rod of 1 m that swings and bends in the plane x-z, or an arc that is pulled out of its plane."""
    length, arc = 1.0, np.linspace(0, 1.0, nodes)
    when = np.linspace(0, 2.0, poses) if kind == "pendulum" else np.linspace(0, 1.0, poses)
    position, d1, d3 = (np.zeros((poses, nodes, 3)) for _ in range(3))
    curvature = np.zeros((poses, nodes))
    for i, t in enumerate(when):
        if kind == "pendulum":
            angle = 0.5 * np.pi * (1 - np.cos(2.6 * t)) / 1.2 + 0.9 * np.sin(5 * t) * arc**2
            d3[i] = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
            d1[i] = np.stack([np.cos(angle), 0 * angle, -np.sin(angle)], axis=1)
        else:
            turn, rise = 0.25 * np.pi * arc, 1.1 * t * arc
            d3[i] = np.stack([np.sin(turn) * np.cos(rise), np.sin(rise), np.cos(turn) * np.cos(rise)], axis=1)
            d1[i] = np.stack([np.cos(turn), 0 * turn, -np.sin(turn)], axis=1)
        mid = 0.5 * (d3[i, 1:] + d3[i, :-1]) * np.diff(arc)[:, None]
        position[i, 1:] = np.cumsum(mid, axis=0)
        curvature[i] = np.linalg.norm(np.gradient(d3[i], arc, axis=0), axis=1)
    time = np.linspace(when[0], when[-1], 201)
    history = {"kinetic_energy": np.sin(time) ** 2, "strain_energy": np.cos(time) ** 2}
    fields = xr.Dataset(
        {
            "position": (("time", "node", "xyz"), position, {"units": "m"}),
            "director1": (("time", "node", "xyz"), d1, {"units": "1"}),
            "director3": (("time", "node", "xyz"), d3, {"units": "1"}),
            "bending_moment": (("time", "node"), 0.6 * curvature, {"units": "N m"}),
        },
        coords={"time": ("time", when, {"units": "s"}), "arc_length": ("node", arc, {"units": "m"})},
    )
    planar = kind == "pendulum"
    scene = SimpleNamespace(
        title="Appendix B.1, flexible pendulum" if planar else "45-degree bend",
        name=kind,
        bit=None,
        top_drive=None,
        hole=None,
        string=(
            SimpleNamespace(name="cord", length=length, outer_diameter=0.04 if planar else None, inner_diameter=0.0),
        ),
        gravity=SimpleNamespace(direction=(1.0, 0.0, 0.0), magnitude=9.81 if planar else 0.0),
        time=SimpleNamespace(analysis="dynamic" if planar else "static"),
        material=None,
    )
    data = {n: ("time", v, {"units": "J"}) for n, v in history.items()}
    return FakeResult(
        xr.Dataset(data, coords={"time": ("time", time, {"units": "s"})}),
        fields,
        scene,
        {},
        {"model": "planar"},
    )


def pixels(path: Path) -> np.ndarray:
    """A picture as (height, width, 3) integers."""
    from PIL import Image

    with Image.open(path) as picture:
        return np.asarray(picture.convert("RGB")).astype(int)


def share(picture: np.ndarray, colour: tuple[int, int, int], within: int = 12) -> float:
    """Share of the pixels that have about this colour."""
    return float((np.abs(picture - np.array(colour)).max(axis=2) <= within).mean())


@pytest.fixture(scope="module")
def drilled(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """All pictures and the film of a short drilling run."""
    pytest.importorskip("pyvista")
    folder = tmp_path_factory.mktemp("drilled")
    made = render_result(drilling(end=2.0, nodes=49, fields_step=0.05), folder / "pictures", time=1.23, film=True)
    return {path.name: path for path in made}


def test_all_pictures_are_made(drilled: dict[str, Path]) -> None:
    assert set(drilled) == {
        "time-series.png",
        "spectra.png",
        "space-time.png",
        "rock.png",
        "string.png",
        "string-true.png",
        "string.gif",
    }
    for name, path in drilled.items():
        picture = pixels(path)
        assert min(picture.shape[:2]) > 500, name
        assert picture.std() > 12, f"{name} is blank"


def test_the_string_shows_field_stripe_rock_and_arrows(drilled: dict[str, Path]) -> None:
    picture = pixels(drilled["string.png"])
    whole = picture[170:1080, 150:300]  # the stretched string in its hole
    assert share(whole, (24, 26, 30), 30) > 0.005  # the black line or the stripe's edges
    assert len(np.unique(whole.reshape(-1, 3) // 16, axis=0)) > 60  # coloured by a field, shaded
    bit = picture[640:1100, 870:1300]
    assert share(bit, (201, 161, 71), 50) > 0.01  # brass blades
    assert share(picture[120:1100, 870:1300], (213, 94, 0), 40) > 0.002  # arrows


def test_a_turned_string_is_painted_differently(tmp_path: Path) -> None:
    pytest.importorskip("pyvista")
    from drillfem.render.straight import Brush, stretched_view
    from drillfem.render.studio import Studio

    story = Story(drilling(end=0.5, nodes=49, fields_step=0.1))
    assert story.fields is not None
    with Studio() as studio:
        shots = []
        for turned in (0.0, np.pi):
            phi = np.full((len(story.times), len(story.arc)), np.pi / 2 + turned)
            d1 = np.stack([np.cos(phi), np.sin(phi), 0 * phi], axis=2)
            story.fields["director1"].values[:] = d1
            shots.append(stretched_view(studio, story, Brush(story, "spin"), 0, 120, 400, -60.0, 1240.0, 0.3))
    white = [float(((s[..., :3].min(axis=2) > 200) & (s[..., 3] > 200))[100:300].mean()) for s in shots]
    assert white[0] > 0.03 and white[1] < 0.2 * white[0]  # the stripe faces us, then is behind


def test_same_result_same_picture(tmp_path: Path) -> None:
    story = Story(drilling(end=2.0, nodes=33, fields_step=0.1))
    first = charts.spectra(story, tmp_path / "a.png")
    again = charts.spectra(story, tmp_path / "b.png")
    assert first is not None and again is not None
    assert first.read_bytes() == again.read_bytes()


def test_unknown_field_is_one_line_that_lists_what_is_there(tmp_path: Path) -> None:
    with pytest.raises(SceneError) as caught:
        render_result(drilling(end=0.5, nodes=9), tmp_path / "pictures", field="temperature")
    message = str(caught.value)
    assert "\n" not in message and "'temperature'" in message
    assert "axial_force, axial_speed, spin" in message
    assert not (tmp_path / "pictures").exists()


def test_a_time_outside_the_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"from 0 s to 0\.5 s"):
        render_result(drilling(end=0.5, nodes=9), tmp_path / "pictures", time=7.0)
    assert not (tmp_path / "pictures").exists()


def test_too_few_poses_are_no_film_and_no_waves(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="fields_interval"):
        render_result(drilling(end=2.0, nodes=9, fields_step=0.5), tmp_path / "pictures", film=True)
    assert not (tmp_path / "pictures").exists()
    coarse = Story(drilling(end=20.0, nodes=9, fields_step=0.5))
    assert charts.space_time(coarse, tmp_path / "space-time.png") is None


def test_no_result_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError):
        render_all(tmp_path / "nothing")


def test_without_pyvista_the_charts_are_made_and_one_line_says_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(MissingDependency, match="pip install pyvista") as caught:
        render_result(drilling(end=1.0, nodes=17, fields_step=0.1), tmp_path)
    assert "\n" not in str(caught.value)
    assert (tmp_path / "time-series.png").exists() and (tmp_path / "rock.png").exists()


@pytest.mark.parametrize("kind", ["pendulum", "bend"])
def test_a_string_that_bends_is_shown_by_its_true_shape(kind: str, tmp_path: Path) -> None:
    pytest.importorskip("pyvista")
    result = bending(kind, nodes=17, poses=6)
    assert Story(result).sideways and Story(result).still == (kind == "bend")
    made = {p.name: p for p in render_result(result, tmp_path)}
    assert {"string.png", "string-true.png", "time-series.png"} <= set(made)
    assert "rock.png" not in made
    for path in made.values():
        assert pixels(path).std() > 12


def test_scales_of_a_plane_view_are_coordinates() -> None:
    from drillfem.render.poses import find_view

    result = bending(nodes=9, poses=13)
    result.scene.gravity.magnitude = 0.0
    assert result.fields is not None
    turn = np.linspace(0, 5.5, 13)[:, None] * np.ones(9)
    s = result.fields["arc_length"].values
    r = np.stack([np.sin(turn) * s, 0 * turn, np.cos(turn) * s], axis=2)
    result.fields["position"].values[:] = r
    view, _ = find_view(Story(result), 900, 900, 0.1)
    assert view.flat
    for direction in (view.right, view.up, view.near):
        assert np.abs(direction).max() == pytest.approx(1.0)


def test_the_rock_from_the_bits_path_is_the_saved_one() -> None:
    story = Story(drilling(end=3.0, nodes=9, step=1e-3, fields_step=0.5))
    assert story.fields is not None
    saved = story.rock(4)
    story.fields = story.fields.drop_vars(["rock_angle", "rock_height"])
    # a bit that turns evenly leaves L(eta) = U(t - eta / omega), as the generator saves it
    turned = OMEGA * story.history["time"].values
    story.history["bit_angle"].values[:] = turned
    story.history["bit_depth"].values[:] = 2.894e-3 * story.history["time"].values
    found = story.rock(4)
    assert saved is not None and found is not None
    angle, depth = found
    assert angle[-1] == pytest.approx(2 * math.pi / BLADES)
    assert depth[:-1] == pytest.approx(2.894e-3 * (2.0 - angle[:-1] / OMEGA), abs=1e-9)
    assert (depth[0] - depth[-1]) * BLADES == pytest.approx(CUT, rel=1e-3)


def test_stick_intervals() -> None:
    time = np.linspace(0, 10, 1001)
    spin = np.where((time > 2) & (time < 3) | (time > 9), 0.0, 14.0)
    intervals = charts.stuck(time, spin, 0.1)
    np.testing.assert_allclose(intervals, [(2.01, 3.0), (9.01, 10.0)])


def test_natural_and_blade_frequencies_are_marked_on_the_spectra(tmp_path: Path) -> None:
    """Where the run noted them; read from the saved summary alone."""

    def lines(result: FakeResult) -> dict[str, list[float]]:
        """Frequencies of the vertical lines and of the ticks above the first panel, by colour."""
        found: dict[str, list[float]] = {}
        story = Story(result)
        with style.page(600, 400) as figure:
            axes = figure.add_subplot()
            axes.set_xlim(0, 25)
            charts.natural_marks(axes, story, "torsional")
            charts.passing_mark(axes, story, True)
            for line in axes.lines:
                x = line.get_xdata()
                assert x[0] == x[1]
                found.setdefault(str(line.get_color()), []).append(float(x[0]))
        return {colour: sorted(set(x)) for colour, x in found.items()}

    run = drilling(end=2.0, nodes=9)
    passing = BLADES * OMEGA / (2 * math.pi)
    assert lines(run) == {style.VERMILION: [pytest.approx(passing)]}
    run.summary["natural_frequencies"] = {"torsional": [0.453, 1.711, 40.0], "axial": [1.688]}
    marked = lines(run)
    assert marked[style.BLUE] == [0.453, 1.711]  # those within the picture
    assert marked[style.GREEN] == [1.688]
    plain = charts.spectra(Story(drilling(end=2.0, nodes=9)), tmp_path / "plain.png")
    with_marks = charts.spectra(Story(run), tmp_path / "marked.png")
    assert plain is not None and with_marks is not None
    assert plain.read_bytes() != with_marks.read_bytes()


def test_windows_can_be_chosen(tmp_path: Path) -> None:
    story = Story(drilling(end=12.0, nodes=9))
    one = charts.spectra(story, tmp_path / "one.png", [(2.0, 8.0)])
    two = charts.spectra(story, tmp_path / "two.png")
    assert one is not None and two is not None
    assert pixels(one).shape[0] < pixels(two).shape[0]  # one row of panels, not two
    with pytest.raises(SceneError, match="from 0 s to 12 s"):
        charts.spectra(story, tmp_path / "none.png", [(11.0, 13.0)])


def test_space_time_takes_the_finest_part() -> None:
    times = np.concatenate([np.arange(0, 200, 10.0), np.arange(194, 200.01, 0.02) + 1e-4])
    part = charts.finest_window(np.unique(times), 6.0)
    assert np.unique(times)[part][0] > 193.9
    assert charts.finest_window(np.arange(0, 201, 10.0), 6.0) == slice(0, 21)
