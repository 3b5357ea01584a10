"""The store of an ensemble: what was committed is there, whatever happens; what is another ensemble is refused."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drillfem.ensemble import store as stores
from drillfem.ensemble.store import Outcome, Store, read
from drillfem.errors import SceneError, SimulationError

SCENE = 'title = "x"\n\n[contact]\nstiffness = 1000000.0\n'


def header(**changes: Any) -> dict[str, Any]:
    plain: dict[str, Any] = {
        "format": stores.FORMAT,
        "seed": 7,
        "method": "monte-carlo",
        "count": 10,
        "keep": [],
        "scalars": {"weight": "N"},
        "scene": SCENE,
        "kept": {},
        "axes": {},
    }
    return plain | changes


def outcome(i: int, **changes: Any) -> Outcome:
    numbers = {"power_ratio": 1 / (3 + i), "work": np.pi * i}
    plain: dict[str, Any] = {"numbers": numbers, "units": {"work": "J"}, "inputs": {"weight": 0.1 * i}, "clips": i}
    return Outcome(i, **({"status": "done", "seconds": 0.5, "rank": i % 2, "memory": 10**9} | plain | changes))


def test_values_come_back_to_the_last_bit_by_number_of_member(tmp_path: Path) -> None:
    with Store(tmp_path / "s", header()) as store:
        store.append([outcome(5), outcome(2)])
        store.append([outcome(0)])
        assert store.values("work") == {0: 0.0, 2: np.pi * 2, 5: np.pi * 5}
        before = read(tmp_path / "s")  # members.nc is not there yet
        store.export()
    after = read(tmp_path / "s")
    assert (tmp_path / "s" / "members.nc").exists()
    for data in (before, after):
        assert data["member"].values.tolist() == [0, 2, 5]
        assert data["power_ratio"].values.tolist() == [1 / 3, 1 / 5, 1 / 8]
        assert data["work"].values.tolist() == [0.0, np.pi * 2, np.pi * 5]
        assert data["work"].attrs["units"] == "J" and data["power_ratio"].attrs["units"] == "1"
        assert data["input_weight"].values.tolist() == [0.0, 0.2, 0.5]
        assert data["input_weight"].attrs["units"] == "N"
        assert data["status"].values.tolist() == ["done"] * 3
        assert data["clips"].values.tolist() == [0, 2, 5]
        assert data["memory"].values[0] == 10**9
        assert data.attrs["seed"] == 7


def test_what_is_newer_in_the_journal_is_read(tmp_path: Path) -> None:
    with Store(tmp_path, header()) as store:
        store.append([outcome(0)])
        store.export()
        store.append([outcome(1)])
    assert read(tmp_path)["member"].values.tolist() == [0, 1]


def test_members_may_have_different_numbers(tmp_path: Path) -> None:
    with Store(tmp_path, header()) as store:
        store.append([outcome(0), outcome(1, numbers={"depth": 2.0}, units={"depth": "m"})])
    data = read(tmp_path)
    assert np.isnan(data["work"].values[1]) and np.isnan(data["depth"].values[0])
    assert data["depth"].values[1] == 2.0


def test_failed_member_has_reason_and_scene_until_it_succeeds(tmp_path: Path) -> None:
    failed = Outcome(3, "failed", "diverged at t = 1 s", scene=SCENE)
    with Store(tmp_path, header()) as store:
        store.append([outcome(0), failed])
        assert list(stores.missing(store.status, 5, retry=False)) == [1, 2, 4]
        assert list(stores.missing(store.status, 5, retry=True)) == [1, 2, 3, 4]
        data, scene = read(tmp_path), stores.failed_scene(tmp_path, 3)
        assert data["status"].values.tolist() == ["done", "failed"]
        assert data["reason"].values.tolist() == ["", "diverged at t = 1 s"]
        assert np.isnan(data["work"].values[1])
        assert scene.read_text() == f"# member 3 failed: diverged at t = 1 s\n{SCENE}"
        store.append([outcome(3)])
    assert not scene.exists()
    assert read(tmp_path)["status"].values.tolist() == ["done", "done"]


def test_histories_are_kept_in_blocks(tmp_path: Path) -> None:
    n, rows = 2 * stores.BLOCK + 10, 7
    kept = {"history_speed": ["time", "m/s"], "field_friction": ["depth", "1"]}
    axes = {"time": [0.0, 3.0, rows], "depth": [0.0, 60.0, 3]}
    want = np.random.default_rng(0).random((n, rows)).astype(np.float32)
    with Store(tmp_path, header(keep=["friction", "speed"], kept=kept, axes=axes)) as store:
        everyone = [
            outcome(i, kept={"history_speed": want[i], "field_friction": np.full(3, i, np.float32)})
            for i in range(n)
            if i != 300
        ]
        store.append([*everyone, Outcome(300, "failed", "so")])
        store.export()
    data = read(tmp_path)
    assert np.isnan(data["history_speed"].values[300]).all()
    others = np.arange(n) != 300
    assert np.array_equal(data["history_speed"].values[others], want[others])
    assert data["field_friction"].values[:, 2][others].tolist() == np.arange(n)[others].tolist()
    assert data["time"].values.tolist() == np.linspace(0, 3, rows).tolist()
    assert data["history_speed"].attrs["units"] == "m/s" and data["history_speed"].dtype == np.float32


def test_a_writer_that_is_killed_loses_only_what_was_not_committed(tmp_path: Path) -> None:
    script = """
        import os, signal, sys
        sys.path.insert(0, sys.argv[2])
        from test_ensemble_store import header, outcome
        from drillfem.ensemble.store import Store
        store = Store(sys.argv[1], header())
        store.append([outcome(0), outcome(1)])
        store.export()
        store.append([outcome(2)])
        store._journal.execute("PRAGMA cache_spill = ON")
        store._journal.execute("BEGIN IMMEDIATE")
        for i in range(3, 200):
            store._insert(outcome(i))
        open(store.folder / ".members.nc.1.0.part", "w").close()
        os.kill(os.getpid(), signal.SIGKILL)
    """
    command = [sys.executable, "-c", textwrap.dedent(script), str(tmp_path / "s"), str(Path(__file__).parent)]
    assert subprocess.run(command, env=os.environ).returncode == -9
    assert read(tmp_path / "s")["member"].values.tolist() == [0, 1, 2]
    with Store(tmp_path / "s", header()) as store:
        assert store.status == dict.fromkeys(range(3), "done")
        store.append([outcome(3)])
    assert read(tmp_path / "s")["member"].values.tolist() == [0, 1, 2, 3]
    assert not list((tmp_path / "s").glob(".*.part"))


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"seed": 8}, "--seed is 7 there, not 8"),
        ({"method": "sobol"}, "--method is monte-carlo there, not sobol"),
        ({"keep": ["speed"]}, r'--keep is none there, not \["speed"\]'),
        ({"scene": SCENE.replace("1000000.0", "2.0")}, r"contact.stiffness is 1000000.0 there, not 2.0"),
        ({"scene": f"{SCENE}[motor]\nforce = 1\n"}, r'motor is not given there, not \{"force": 1\}'),
    ],
)
def test_another_ensemble_is_refused_with_what_differs(tmp_path: Path, other: dict[str, Any], said: str) -> None:
    with Store(tmp_path, header()) as store:
        store.append([outcome(0)])
    with pytest.raises(SceneError, match=said):
        Store(tmp_path, header(**other))
    assert read(tmp_path)["member"].values.tolist() == [0]


def test_ensembles_grow_but_a_latin_hypercube(tmp_path: Path) -> None:
    for count, known in ((10, 10), (20, 20), (5, 20)):
        with Store(tmp_path / "sobol", header(method="sobol", count=count)) as store:
            assert store.header["count"] == known
    with Store(tmp_path / "cube", header(method="latin-hypercube")):
        pass
    with pytest.raises(SceneError, match="Latin hypercube of 10 members, which cannot become one of 20"):
        Store(tmp_path / "cube", header(method="latin-hypercube", count=20))


def test_foreign_folders_and_second_writers_are_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(SceneError, match="is not empty"):
        Store(tmp_path, header())
    with pytest.raises(SceneError, match="not the folder of an ensemble"):
        read(tmp_path)
    with Store(tmp_path / "s", header()), pytest.raises(SceneError, match="another process is writing"):
        Store(tmp_path / "s", header())


def test_a_folder_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    with Store(tmp_path, header()) as store:
        store.append([outcome(0)])
        store._journal.execute("PRAGMA query_only = ON")  # as on a full disk, in the middle of a transaction
        with pytest.raises(SimulationError, match="cannot be written"):
            store.append([outcome(1)])
        store._journal.execute("PRAGMA query_only = OFF")
        store.append([outcome(2)])
    assert read(tmp_path)["member"].values.tolist() == [0, 2]
