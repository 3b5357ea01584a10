"""Ensembles on one process and over MPI: the same members bit for bit, whoever is killed, stopped, or fails."""

from __future__ import annotations

import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from drillfem.ensemble import run
from drillfem.ensemble.run import Standing, ensemble
from drillfem.ensemble.store import read
from drillfem.errors import SceneError, SimulationError
from drillfem.results import Result
from drillfem.scene import Scene, load_scene

#: A lumped string, 15 ms a member. What is random: its rock.
ROCK: dict[str, Any] = {
    "model": "lumped",
    "time.end": "0.3 s",
    "rock.intrinsic_specific_energy": None,
    "random.rock.key": "rock.intrinsic_specific_energy",
    "random.rock.distribution": "norm",
    "random.rock.parameters": {"loc": "0.252 GPa", "scale": "0.02 GPa"},
}
#: What depends on who computed a member, and when.
ONCE = ("seconds", "wall_seconds", "rank", "memory")
mpi = pytest.mark.skipif(shutil.which("mpirun") is None, reason="needs mpirun")


def rock() -> Scene:
    return load_scene("cutting-c1", ROCK)


def same(a: xr.Dataset, b: xr.Dataset) -> None:
    """Equal bit for bit, as far as they do not tell who computed it."""
    assert set(a.variables) == set(b.variables)
    for name in set(a.variables) - set(ONCE):
        x, y = a[name].values, b[name].values
        assert x.dtype.kind == y.dtype.kind
        assert x.tobytes() == y.tobytes() if x.dtype.kind == "f" else x.tolist() == y.tolist(), name


def start(ranks: int, *arguments: str, **environment: str) -> subprocess.Popen[str]:
    """`drillfem ensemble` under mpirun; not as a rank of the tests' own job."""
    own = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMIX_", "PRTE_", "PMI_"))}
    own |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_btl": "self,sm"}
    own |= {"PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe", "OMP_NUM_THREADS": "1", "HWLOC_HIDE_ERRORS": "2"}
    command = ["mpirun", "-n", str(ranks), sys.executable, "-m", "drillfem.cli", "ensemble", *arguments]
    return subprocess.Popen(
        command,
        env=own | environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finish(process: subprocess.Popen[str], timeout: float = 120) -> tuple[int, str, str]:
    out, err = process.communicate(timeout=timeout)
    return process.returncode, out, err


def stored(folder: Path) -> dict[int, bytes]:
    """What the journal has of each member, its times included."""
    if not (folder / "journal.sqlite").exists():
        return {}
    journal = sqlite3.connect(folder / "journal.sqlite", timeout=10)
    try:
        return {row[0]: repr(row).encode() for row in journal.execute("SELECT * FROM member")}
    except sqlite3.OperationalError:  # no table yet
        return {}
    finally:
        journal.close()


def ranks_of(folder: Path) -> dict[int, int]:
    """Process of each rank that works on a folder."""
    found = {}
    for path in Path("/proc").glob("[0-9]*"):
        try:
            command, status = (path / "cmdline").read_text(), (path / "environ").read_bytes()
        except OSError:
            continue
        if command.startswith(sys.executable) and str(folder) in command.split("\0"):
            rank = [v for v in status.split(b"\0") if v.startswith(b"OMPI_COMM_WORLD_RANK=")]
            found[int(rank[0].partition(b"=")[2])] = int(path.name)
    return found


@mpi
def test_a_killed_rank_costs_no_stored_member_and_the_rerun_is_as_if_nothing_had_been(tmp_path: Path) -> None:
    scene, folder = tmp_path / "rock.toml", tmp_path / "mpi"
    scene.write_text(rock().to_toml())
    arguments = (str(scene), "-n", "24", "--seed", "3", "--keep", "bit_axial_speed", "--out", str(folder))
    process = start(2, *arguments)
    deadline = time.monotonic() + 100
    while len(stored(folder)) < 4 and time.monotonic() < deadline and process.poll() is None:
        time.sleep(0.02)
    os.kill(ranks_of(folder)[1], signal.SIGKILL)
    code, _, _ = finish(process)
    assert code != 0
    before = stored(folder)
    assert 4 <= len(before) < 24
    assert set(read(folder)["member"].values) == set(before)

    code, out, err = finish(start(2, *arguments))
    assert code == 0, err
    assert f"24 of 24 members: {24 - len(before)} of them now" in out
    after = stored(folder)
    assert {i: after[i] for i in before} == before
    both = read(folder)
    assert set(both["rank"].values) == {0, 1}
    alone = ensemble(scene, 24, tmp_path / "alone", seed=3, keep=["bit_axial_speed"])
    assert alone is not None
    same(both, alone)
    assert len(set(alone["input_rock"].values)) == 24 and np.isfinite(alone["history_bit_axial_speed"].values).all()


# -- with a simulation in place that is over at once ------------------------------------------------------------------
@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Strengths of the rock of the members that were run; ``fake.meddle(number of runs)`` may do anything."""

    class Runs(list):  # type: ignore[type-arg]
        meddle: Callable[[int], None] = staticmethod(lambda n: None)

    runs = Runs()

    class Worker:
        def __init__(self, scene: Scene | None = None) -> None:
            pass

        def warm_up(self, scene: Scene) -> Result:
            return made(scene, 0.0)

        def simulate(self, scene: Scene) -> Result:
            assert scene.rock is not None
            runs.append(scene.rock.intrinsic_specific_energy)
            runs.meddle(len(runs))
            return made(scene, runs[-1])

    def made(scene: Scene, x: float) -> Result:
        t = np.linspace(0, 0.3, 301)
        history = xr.Dataset({"depth": ("time", x * t, {"units": "m"})}, {"time": t})
        return Result(history, {"power_ratio": x, "converged": True, "reason": "", "drilled_depth": None})

    monkeypatch.setattr(run, "Worker", Worker)
    return runs


def run_of(folder: Path, count: int, **options: Any) -> xr.Dataset:
    made = ensemble(rock(), count, folder, **options)
    assert made is not None
    return made


def test_finished_members_are_not_repeated_and_more_extend(tmp_path: Path, fake: Any) -> None:
    for method in ("monte-carlo", "sobol"):
        del fake[:]
        run_of(tmp_path / method, 8, method=method)
        assert len(fake) == 8
        run_of(tmp_path / method, 8, method=method)
        assert len(fake) == 8
        grown = run_of(tmp_path / method, 20, method=method)
        assert len(fake) == 20
        same(grown.drop_attrs(), run_of(tmp_path / f"{method}-at-once", 20, method=method).drop_attrs())
        assert read(tmp_path / method).equals(run_of(tmp_path / method, 5, method=method))


def test_a_failing_member_is_recorded_and_the_others_go_on(tmp_path: Path, fake: Any) -> None:
    def meddle(n: int) -> None:
        if n == 3:
            raise SimulationError("diverged at t = 0.1 s")
        if n == 5:
            raise ZeroDivisionError("float division")

    fake.meddle = meddle
    data = run_of(tmp_path / "e", 8)
    assert data["status"].values.tolist() == [*["done"] * 2, "failed", "done", "failed", *["done"] * 3]
    assert data["reason"].values[2] == "diverged at t = 0.1 s"
    assert data["reason"].values[4] == "ZeroDivisionError: float division"
    assert np.isnan(data["power_ratio"].values[[2, 4]]).all()
    again = load_scene(tmp_path / "e" / "failed" / "000002.toml")
    assert again.rock is not None and again.rock.intrinsic_specific_energy == fake[2] == data["input_rock"].values[2]

    run_of(tmp_path / "e", 8)
    assert len(fake) == 8  # not again by itself
    data = run_of(tmp_path / "e", 8, retry_failed=True)
    assert fake[8:] == [fake[2], fake[4]]
    assert data["power_ratio"].values.tolist() == fake[:8]
    assert not list((tmp_path / "e" / "failed").iterdir())


def test_an_impossible_member_is_recorded_with_what_it_asked_for(tmp_path: Path, fake: Any) -> None:
    scene = load_scene("cutting-c1", ROCK | {"random.rock.parameters": {"loc": 1e8, "scale": 1e8}})  # some are negative
    data = ensemble(scene, 20, tmp_path / "e")
    assert data is not None
    failed = data["status"].values == "failed"
    assert failed.any() and not failed.all()
    assert all("rock.intrinsic_specific_energy = -" in str(r) for r in data["reason"].values[failed])
    first = int(data["member"].values[failed][0])
    assert "intrinsic_specific_energy = -" in (tmp_path / "e" / "failed" / f"{first:06d}.toml").read_text()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGUSR1])
def test_signals_store_what_is_done(tmp_path: Path, fake: Any, number: signal.Signals) -> None:
    fake.meddle = lambda n: os.kill(os.getpid(), number) if n == 4 else None
    with pytest.raises(KeyboardInterrupt, match="of 9 members; the same command goes on"):
        run_of(tmp_path / "e", 9)
    done = 4 if number == signal.SIGUSR1 else 3  # Slurm's warning lets the running member end
    assert read(tmp_path / "e")["member"].values.tolist() == list(range(done))
    assert (tmp_path / "e" / "members.nc").exists()
    fake.meddle = lambda n: None
    assert run_of(tmp_path / "e", 9)["power_ratio"].values.tolist() == [*fake[:done], *fake[4:]]


def test_a_tolerance_ends_it_where_the_first_members_tell(tmp_path: Path, fake: Any) -> None:
    shown: list[Standing] = []
    data = run_of(tmp_path / "e", 10_000, tolerance=0.02, quantity="power_ratio", show=shown.append)
    assert "power_ratio known to 0.02 after" in shown[-1].note
    size = int(shown[-1].note.split()[-2])
    values = data["power_ratio"].values[:size]
    assert 1.96 * values.std(ddof=1) / np.sqrt(size) < 0.0201 * values.mean()
    assert run.FIRST_LOOK < size <= len(data["member"]) < 10_000
    n = len(fake)
    run_of(tmp_path / "e", 10_000, tolerance=0.02, quantity="power_ratio")
    assert len(fake) == n
    with pytest.raises(SceneError, match=r"--quantity power: must be one of power_ratio"):
        run_of(tmp_path / "e", 10_000, tolerance=0.02, quantity="power")


def test_bad_input_writes_nothing(tmp_path: Path, fake: Any) -> None:
    for options, said in (
        ({"count": 0}, "-n 0: must be"),
        ({"seed": -1}, "--seed -1: must be"),
        ({"tolerance": 0.1}, "give both or none"),
        ({"tolerance": 2.0, "quantity": "x"}, "--tolerance 2: must be"),
        ({"keep": ["speed"]}, "--keep speed: must be one of depth"),
        ({"method": "lottery"}, "lottery"),
        ({"until": -1.0}, "--until -1: must be later"),
    ):
        with pytest.raises(SceneError, match=said):
            ensemble(rock(), options.pop("count", 4), tmp_path / "e", **options)  # type: ignore[attr-defined, arg-type]
    with pytest.raises(SceneError, match="missing key random"):
        ensemble("cutting-c1", 4, tmp_path / "e")
    assert not (tmp_path / "e").exists() and not fake


# -- minutes ----------------------------------------------------------------------------------------------------------
@mpi
@pytest.mark.verify
@pytest.mark.parametrize("modes", ["exact", "galerkin"])
def test_random_friction_on_two_ranks_is_that_of_one(tmp_path: Path, modes: str) -> None:
    changes = {"random.friction.modes": modes, "random.friction.terms": 40}
    arguments = ("horizontal-stochastic", "-n", "8", "--until", "0.5", "--keep", "friction")
    arguments += tuple(word for key, value in changes.items() for word in ("--set", f"{key}={value}"))
    code, _, err = finish(start(2, *arguments, "--out", str(tmp_path / "two")), 300)
    assert code == 0, err
    alone = ensemble("horizontal-stochastic", 8, tmp_path / "one", overrides=changes, until=0.5, keep=["friction"])
    assert alone is not None
    same(read(tmp_path / "two"), alone)


@mpi
@pytest.mark.verify
def test_bad_input_is_one_line_from_one_rank(tmp_path: Path, fake: Any) -> None:
    run_of(tmp_path / "e", 2)
    (tmp_path / "rock.toml").write_text(rock().to_toml())
    arguments = (str(tmp_path / "rock.toml"), "-n", "2", "--seed", "4", "--out", str(tmp_path / "e"))
    code, out, err = finish(start(2, *arguments))
    assert code == 2 and out == ""
    assert [line for line in err.splitlines() if line.startswith("error")] == [
        f"error: {tmp_path / 'e'}: holds another ensemble: --seed is 0 there, not 4"
    ]


@mpi
def test_a_bad_option_ends_all_ranks(tmp_path: Path) -> None:
    out = tmp_path / "e"
    code, told, err = finish(start(2, "horizontal-stochastic", "-n", "2", "--tolerance", "few", "--out", str(out)))
    assert code == 2 and told == "" and not out.exists()
    assert [line for line in err.splitlines() if line.startswith("error")] == [
        "error: --tolerance 'few': must be more than 0 and less than 1, such as 0.05 or 5%"
    ]


@mpi
@pytest.mark.verify
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGUSR1])
def test_a_signal_to_one_rank_ends_all_cleanly(tmp_path: Path, number: signal.Signals) -> None:
    folder = tmp_path / "e"
    process = start(2, "horizontal-stochastic", "-n", "200", "--until", "2", "--out", str(folder))
    deadline = time.monotonic() + 200
    while len(stored(folder)) < 3 and time.monotonic() < deadline:
        time.sleep(0.05)
    os.kill(ranks_of(folder)[0], number)
    code, _, err = finish(process)
    assert code == 130
    assert f"interrupted: {folder} holds {len(stored(folder))} of 200 members; the same command goes on" in err
    assert (folder / "members.nc").exists()


@mpi
@pytest.mark.verify
def test_kernels_are_compiled_once_before_the_ranks_start(tmp_path: Path) -> None:
    cache = {"DRILLFEM_CACHE": str(tmp_path / "cache"), "NUMBA_CACHE_DIR": str(tmp_path / "numba")}
    arguments = ("horizontal-stochastic", "-n", "4", "--until", "0.1", "--out", str(tmp_path / "e"))
    code, _, err = finish(start(2, *arguments, **cache), 600)
    assert code == 0, err
    said = [line for line in err.splitlines() if "compiling" in line]
    assert len(said) == len(set(said))
    libraries = {p.name.split(".")[0]: p.stat().st_ctime for p in (tmp_path / "cache").rglob("*.so")}
    assert libraries
    # a second job finds all of it
    arguments = (*arguments[:-1], str(tmp_path / "f"))
    code, _, err = finish(start(2, *arguments, **cache), 600)
    assert code == 0, err
    assert {p.name.split(".")[0]: p.stat().st_ctime for p in (tmp_path / "cache").rglob("*.so")} == libraries


@pytest.mark.verify
@pytest.mark.parametrize("kind", ["rod", "lumped"])
def test_memory_is_bounded_over_a_thousand_members(tmp_path: Path, kind: str) -> None:
    """Resident memory after 1000 members is within 5 MB of that after 100."""
    scene = rock()
    if kind == "rod":
        scene = load_scene("horizontal-stochastic", {"time.end": "0.1 s", "output.interval": "20 ms"})
    scene = replace(scene, time=replace(scene.time, end=0.1)).checked()
    data = ensemble(scene, 1000, tmp_path / "e")
    assert data is not None
    memory = data["memory"].values / 1e6
    assert memory[900:].max() - memory[100:200].max() < 5.0
