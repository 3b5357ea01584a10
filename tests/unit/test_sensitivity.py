"""Sobol' indices against Ishigami's exact ones; groups; failed members; a scene from the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("SALib")

from drillfem.ensemble import drawing
from drillfem.ensemble.sensitivity import sensitivity
from drillfem.errors import SceneError

A, B = 7.0, 0.1
#: Exact indices of Ishigami's function (T. Homma, A. Saltelli, Reliability Engineering & System Safety 52 (1996)).
VARIANCE = A**2 / 8 + B * np.pi**4 / 5 + B**2 * np.pi**8 / 18 + 0.5
FIRST = np.array([(1 + B * np.pi**4 / 5) ** 2 / 2, A**2 / 8, 0.0]) / VARIANCE
TOTAL = FIRST + np.array([1, 0, 1]) * 8 * B**2 * np.pi**8 / 225 / VARIANCE


def ishigami(u: np.ndarray) -> np.ndarray:
    x = np.pi * (2 * u - 1)
    return np.asarray(np.sin(x[:, 0]) + A * np.sin(x[:, 1]) ** 2 + B * x[:, 2] ** 4 * np.sin(x[:, 0]))


def test_ishigami() -> None:
    found = sensitivity(ishigami, ("a", "b", "c"), 2048)
    assert found.variance == pytest.approx(VARIANCE, rel=0.05) and found.mean == pytest.approx(A / 2, rel=0.02)
    for name, first, total in zip("abc", FIRST, TOTAL, strict=True):
        # intervals are 95 %: with half as much again all six hold
        for index, exact in ((found.first[name], first), (found.total[name], total)):
            assert abs(index.value - exact) < 1.5 * (index.high - index.value)
            assert abs(index.value - exact) < 0.06
    assert found.evaluations == 2048 * 5 and found.failed == 0
    assert found.together == pytest.approx(1 - FIRST.sum(), abs=0.1)


def test_a_group_has_the_index_of_what_is_in_it() -> None:
    found = sensitivity(ishigami, ("a", "b", "c"), 1024, groups=("x", "y", "x"))
    assert list(found.first) == ["x", "y"] and found.evaluations == 1024 * 4
    # a and c together: all that is not b's
    assert found.first["x"].value == pytest.approx(1 - FIRST[1], abs=0.08)
    assert found.total["y"].value == pytest.approx(TOTAL[1], abs=0.05)


def test_failed_members_take_their_base_point_with_them() -> None:
    def failing(u: np.ndarray) -> np.ndarray:
        values = ishigami(u)
        values[[7, 8, 700]] = np.nan
        return values

    found = sensitivity(failing, ("a", "b", "c"), 256)
    assert (found.failed, found.blocks) == (3, 254)
    assert found.total["b"].value == pytest.approx(TOTAL[1], abs=0.15)
    with pytest.raises(SceneError, match="failed"):
        sensitivity(lambda u: np.full(len(u), np.nan), ("a",), 8)


def test_what_does_not_vary_has_no_indices() -> None:
    with pytest.raises(SceneError, match="does not vary"):
        sensitivity(lambda u: np.full(len(u), 3.0), ("a", "b"), 8)
    with pytest.raises(SceneError, match="count = 2"):
        sensitivity(ishigami, ("a", "b", "c"), 2)


def test_a_count_that_is_no_power_of_two() -> None:
    found = sensitivity(lambda u: 2 * u[:, 0] + u[:, 1], ("rock", "weight"), 100)
    assert found.evaluations == 400
    assert found.first["rock"].low < 0.8 < found.first["rock"].high


def test_picture(tmp_path: Path) -> None:
    found = sensitivity(ishigami, ("a", "b", "c"), 64)
    assert drawing.sensitivities(tmp_path / "s.png", found, "drilled_depth").stat().st_size > 10_000
    assert json.dumps(found.to_dict(), allow_nan=False)


@pytest.mark.dolfinx
def test_commands_run_members_of_a_scene(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("dolfinx")
    from drillfem.cli import main

    scene = tmp_path / "scene.toml"
    base = Path(__file__).parents[2] / "demos" / "scenes" / "vertical-c1-cd4.toml"
    text = "\n".join(line for line in base.read_text().splitlines() if not line.startswith("wear_flat_length"))
    scene.write_text(
        text + '\n[random.wear]\nkey = "bit.wear_flat_length"\ndistribution = "uniform"\n'
        'parameters = { loc = "1 mm", scale = "0.4 mm" }\n'
    )
    options = [
        "model=lumped",
        "time.end=0.4 s",
        "time.step=2 ms",
        "output.interval=2 ms",
        "rock.surface.scheme=profile",
    ]
    given = [part for option in options for part in ("--set", option)]
    out = tmp_path / "levels"
    asked = ["--levels", "3", "--pilot", "4", "--refine", "time.step"]
    assert main(["multilevel", str(scene), "--out", str(out), *asked, *given]) == 0
    told = json.loads((out / "multilevel.json").read_text())
    assert told["quantity"] == "drilled_depth" and [level["pairs"] for level in told["levels"]] == [4, 4, 4]
    assert (out / "multilevel.png").exists() and "verdict: " in capsys.readouterr().out
    out = tmp_path / "indices"
    assert main(["sensitivity", str(scene), "--out", str(out), "-n", "4", *given]) == 0
    # one input: the depth is its function alone
    told = json.loads((out / "sensitivity.json").read_text())
    assert told["evaluations"] == 12 and told["total"]["wear"]["value"] == pytest.approx(1, abs=0.6)
    assert (
        main(["sensitivity", str(scene), "--out", str(tmp_path / "no"), "--quantity", "nonsense", "-n", "4", *given])
        == 2
    )
