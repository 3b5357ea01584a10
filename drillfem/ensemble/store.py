"""The store of an ensemble: a folder that is whole at every moment, whoever is killed.

``ensemble.json`` says what the members are drawn from. ``journal.sqlite`` takes their results, one committed
transaction per batch; only one process writes it. ``members.nc`` is made from the journal, for whoever reads the
results, and is replaced in one go. ``failed/`` has the scene of every member that failed.
"""

from __future__ import annotations

import json
import sqlite3
import tempfile
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt

from drillfem.errors import SceneError, SimulationError
from drillfem.results.atomic import Lock, read_json, remove_leftovers, replacing, write_json

if TYPE_CHECKING:
    import xarray as xr

HEADER, JOURNAL, TABLE, FAILED = "ensemble.json", "journal.sqlite", "members.nc", "failed"
DONE, BROKEN = "done", "failed"
FORMAT = 1
#: What makes an ensemble the one that it is, in the words of a refusal.
IDENTITY = {"format": "format", "seed": "--seed", "method": "--method", "keep": "--keep"}
#: Members whose histories are copied at a time.
BLOCK = 256

_TABLES = """
CREATE TABLE IF NOT EXISTS names (id INTEGER PRIMARY KEY, content TEXT NOT NULL UNIQUE);
CREATE TABLE IF NOT EXISTS member (
    i INTEGER PRIMARY KEY, status TEXT NOT NULL, reason TEXT NOT NULL, clips INTEGER NOT NULL, seconds REAL NOT NULL,
    wall_seconds REAL NOT NULL, rank INTEGER NOT NULL, memory INTEGER NOT NULL,
    names INTEGER NOT NULL REFERENCES names (id), numbers BLOB NOT NULL, inputs TEXT NOT NULL
);
CREATE TABLE IF NOT EXISTS kept (i INTEGER, name TEXT, content BLOB NOT NULL, PRIMARY KEY (i, name)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS state (id INTEGER PRIMARY KEY CHECK (id = 0), serial INTEGER NOT NULL);
INSERT OR IGNORE INTO state VALUES (0, 0);
"""
_COLUMNS = ("clips", "seconds", "wall_seconds", "rank", "memory")
_UNITS = {"clips": "1", "seconds": "s", "wall_seconds": "s", "rank": "1", "memory": "B"}
_SAID = {
    "clips": "random numbers that lay beyond their support",
    "seconds": "processor time of the member",
    "wall_seconds": "time of the member on the clock",
    "rank": "MPI rank that computed it",
    "memory": "resident memory of that rank after it",
}


@dataclass(frozen=True)
class Outcome:
    """How a member ended.

    index: its number. status: "done" or "failed", with the reason. numbers, units: its summary, SI. inputs: its random
    numbers. clips: how many numbers lay beyond their support. seconds, wall_seconds: processor time and time on the
    clock. rank: who computed it. memory: bytes resident there. kept: ``history_NAME``, ``field_NAME`` (float32).
    scene: TOML text, of a failed one.
    """

    index: int
    status: str
    reason: str = ""
    numbers: Mapping[str, float] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    inputs: Mapping[str, float] = field(default_factory=dict)
    clips: int = 0
    seconds: float = 0.0
    wall_seconds: float = 0.0
    rank: int = 0
    memory: int = 0
    kept: Mapping[str, npt.NDArray[np.float32]] = field(default_factory=dict)
    scene: str = ""


class Store:
    """The folder of an ensemble, open for writing by this process alone; a context manager.

    folder: new, empty, or holding a part of the same ensemble. header: what `ensemble.json` says; see `check`.
    ``status`` has "done" or "failed" of every member stored. Raises SceneError where the folder holds something else,
    SimulationError where it cannot be written.
    """

    def __init__(self, folder: str | Path, header: Mapping[str, Any]) -> None:
        self.folder = Path(folder)
        self._known_names: dict[tuple[tuple[str, str], ...], int] = {}
        stored = check(self.folder, header)
        with _writing(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
            self._lock = Lock(self.folder)
        try:
            # another process may have been faster
            stored = check(self.folder, header)
            with _writing(self.folder):
                remove_leftovers(self.folder)
                self._journal = _connect(self.folder / JOURNAL)
                self._journal.executescript(_TABLES)
                self.header = {**header, "sessions": []} if stored is None else dict(stored)
                self.header["count"] = max(header["count"], self.header["count"])
                write_json(self.folder / HEADER, self.header)
                self.status: dict[int, str] = dict(self._journal.execute("SELECT i, status FROM member"))
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def append(self, outcomes: Sequence[Outcome]) -> None:
        """Store outcomes, all of them or none; they are on disk when this returns. An earlier one gives way."""
        with _writing(self.folder):
            for outcome in outcomes:
                self._keep_scene(outcome)
            self._journal.execute("BEGIN IMMEDIATE")
            try:
                for outcome in outcomes:
                    self._insert(outcome)
                self._journal.execute("UPDATE state SET serial = serial + 1")
                self._journal.execute("COMMIT")
            except BaseException:
                self._known_names.clear()
                with suppress(sqlite3.Error):
                    self._journal.execute("ROLLBACK")
                raise
        self.status |= {outcome.index: outcome.status for outcome in outcomes}

    def values(self, quantity: str) -> dict[int, float]:
        """A summary quantity of all members that are done and have it, by member."""
        found: dict[int, float] = {}
        places = {key: names.index(quantity) for key, (names, _) in _names(self._journal).items() if quantity in names}
        for i, key, numbers in self._journal.execute("SELECT i, names, numbers FROM member WHERE status = 'done'"):
            if key in places:
                found[i] = float(np.frombuffer(numbers, "<f8")[places[key]])
        return found

    def quantities(self) -> list[str]:
        """Names of all summary quantities stored."""
        return list(dict.fromkeys(name for names, _ in _names(self._journal).values() for name in names))

    def export(self) -> None:
        """Bring members.nc up to date."""
        with _writing(self.folder), replacing(self.folder / TABLE) as part:
            _export(self._journal, self.header, part)

    def note(self, **facts: Any) -> None:
        """Set entries of ensemble.json."""
        self.header |= facts
        with _writing(self.folder):
            write_json(self.folder / HEADER, self.header)

    def close(self) -> None:
        """Let go of the folder."""
        with suppress(AttributeError):
            self._journal.close()
        self._lock.release()

    def _insert(self, outcome: Outcome) -> None:
        names = tuple((name, outcome.units.get(name, "1")) for name in outcome.numbers)
        if (key := self._known_names.get(names)) is None:
            content = json.dumps([[name for name, _ in names], [unit for _, unit in names]])
            self._journal.execute("INSERT OR IGNORE INTO names (content) VALUES (?)", (content,))
            (key,) = self._journal.execute("SELECT id FROM names WHERE content = ?", (content,)).fetchone()
            self._known_names[names] = key
        numbers = np.array(list(outcome.numbers.values()), "<f8").tobytes()
        row = (
            *(outcome.index, outcome.status, outcome.reason, outcome.clips, outcome.seconds, outcome.wall_seconds),
            *(outcome.rank, outcome.memory, key, numbers, json.dumps(dict(outcome.inputs))),
        )
        self._journal.execute("INSERT OR REPLACE INTO member VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", row)
        self._journal.execute("DELETE FROM kept WHERE i = ?", (outcome.index,))
        for name, array in outcome.kept.items():
            rows = np.asarray(array, "<f4").tobytes()
            self._journal.execute("INSERT INTO kept VALUES (?, ?, ?)", (outcome.index, name, rows))

    def _keep_scene(self, outcome: Outcome) -> None:
        """Put the scene of a failed member where it can be run, or take away that of an earlier attempt."""
        path = failed_scene(self.folder, outcome.index)
        if outcome.status == DONE:
            if self.status.get(outcome.index) == BROKEN:
                path.unlink(missing_ok=True)
            return
        path.parent.mkdir(exist_ok=True)
        with replacing(path) as part:
            part.write_text(f"# member {outcome.index} failed: {outcome.reason}\n{outcome.scene}", encoding="utf-8")


def failed_scene(folder: Path, index: int) -> Path:
    """Where the scene of a failed member is."""
    return folder / FAILED / f"{index:06d}.toml"


def header_of(folder: str | Path) -> dict[str, Any]:
    """What ensemble.json says. Raises SceneError where there is none."""
    path = Path(folder)
    if not (path / HEADER).is_file():
        raise SceneError(f"{folder}: is not the folder of an ensemble, it has no {HEADER}")
    return read_json(path / HEADER)


def check(folder: Path, header: Mapping[str, Any]) -> dict[str, Any] | None:
    """What ensemble.json says in a folder that may take members of an ensemble; None if it is new.

    Raises SceneError, with what differs, where it holds another ensemble, or something else.
    """
    from drillfem.results import check_new_folder

    if not (folder / HEADER).is_file():
        # what a process leaves that was killed before it had written the header
        left = [JOURNAL, f"{JOURNAL}-journal"]
        if not folder.is_dir() or any(p.name not in left and p.suffix != ".part" for p in folder.iterdir()):
            check_new_folder(folder)
        return None
    stored = header_of(folder)
    other = f"{folder}: holds another ensemble"
    for key, option in IDENTITY.items():
        if stored.get(key) != header[key]:
            raise SceneError(f"{other}: {option} is {_said(stored.get(key))} there, not {_said(header[key])}")
    if stored["scene"] != header["scene"]:
        key, there, here = _difference(tomllib.loads(stored["scene"]), tomllib.loads(header["scene"]))
        raise SceneError(f"{other}: {key} is {_said(there)} there, not {_said(here)}; choose another folder")
    if header["method"] == "latin-hypercube" and stored["count"] != header["count"]:
        raise SceneError(
            f"{folder}: holds a Latin hypercube of {stored['count']} members, which cannot become one of "
            f"{header['count']}: choose another folder, or --method sobol, which can"
        )
    return stored


def read(folder: str | Path) -> xr.Dataset:
    """Members of an ensemble, also of one that goes on or was killed: what the journal has.

    Dimension ``member``: the members stored, by number. Variables: every number of their summaries (float64, with
    units), ``status`` ("done", "failed"), ``reason``, ``input_NAME``, ``clips``, ``seconds`` (of the processor),
    ``wall_seconds``, ``rank``, ``memory`` (bytes); of what was kept ``history_NAME`` (member, time) and ``field_NAME``
    (member, depth), float32. What a member does not have is NaN. Raises SceneError.
    """
    import xarray as xr

    path = Path(folder)
    header = header_of(path)
    try:
        ready = xr.load_dataset(path / TABLE, engine="h5netcdf") if (path / TABLE).exists() else None
        if not (path / JOURNAL).exists():
            if ready is None:
                raise SceneError(f"{folder}: has neither {JOURNAL} nor {TABLE}")
            return ready
        journal = _connect(path / JOURNAL)
        try:
            journal.execute("BEGIN")
            if ready is not None and ready.attrs["serial"] == _serial(journal):
                return ready
            with tempfile.TemporaryDirectory() as scratch:
                _export(journal, header, Path(scratch) / TABLE)
                return xr.load_dataset(Path(scratch) / TABLE, engine="h5netcdf")
        finally:
            journal.close()
    except (OSError, ValueError, KeyError, sqlite3.Error) as error:
        raise SceneError(f"{folder}: cannot be read ({' '.join(str(error).split())})") from error


# -- the journal ------------------------------------------------------------------------------------------------------
def _connect(path: Path) -> sqlite3.Connection:
    # the writer of a run is a thread of its own; nobody else uses its connection meanwhile
    journal = sqlite3.connect(path, timeout=30.0, isolation_level=None, check_same_thread=False)
    journal.execute("PRAGMA synchronous = FULL")
    return journal


def _serial(journal: sqlite3.Connection) -> int:
    try:
        row = journal.execute("SELECT serial FROM state").fetchone()
    except sqlite3.OperationalError:  # killed before it had any table
        return -1
    return -1 if row is None else int(row[0])


def _names(journal: sqlite3.Connection) -> dict[int, tuple[list[str], list[str]]]:
    """Names and units of the numbers that a member may have."""
    return {key: tuple(json.loads(content)) for key, content in journal.execute("SELECT id, content FROM names")}


def _export(journal: sqlite3.Connection, header: Mapping[str, Any], path: Path) -> None:
    """Write everything in the journal as NetCDF."""
    import xarray as xr

    serial = _serial(journal)
    rows = [] if serial < 0 else journal.execute("SELECT * FROM member ORDER BY i").fetchall()
    columns = ("i", "status", "reason", *_COLUMNS, "names", "numbers", "inputs")
    of = {name: [row[k] for row in rows] for k, name in enumerate(columns)}
    known = _names(journal) if rows else {}
    units = {name: unit for names, all_units in known.values() for name, unit in zip(names, all_units, strict=True)}
    numbers = {name: np.full(len(rows), np.nan) for name in units}
    for k, (key, blob) in enumerate(zip(of["names"], of["numbers"], strict=True)):
        for name, value in zip(known[key][0], np.frombuffer(blob, "<f8"), strict=True):
            numbers[name][k] = value
    inputs = [json.loads(text) for text in of["inputs"]]
    given = {name: np.array([row.get(name, np.nan) for row in inputs]) for name in header["scalars"]}
    data: dict[str, Any] = {name: ("member", values, {"units": units[name]}) for name, values in numbers.items()}
    data |= {f"input_{name}": ("member", x, {"units": header["scalars"][name]}) for name, x in given.items()}
    for name in _COLUMNS:
        kind = float if "seconds" in name else np.int64
        data[name] = "member", np.array(of[name], kind), {"units": _UNITS[name], "long_name": _SAID[name]}
    for name in ("status", "reason"):
        data[name] = "member", np.array(of[name], object if rows else "U1")
    members = np.array(of["i"], np.int64)
    attributes = {k: header[k] for k in ("scene", "seed", "method", "count")} | {"serial": serial}
    made = xr.Dataset(data, {"member": members}, attributes)
    for dimension, axis in header["axes"].items():
        unit = "s" if dimension == "time" else "m"
        made = made.assign_coords(
            {dimension: (dimension, np.linspace(axis[0], axis[1], int(axis[2])), {"units": unit})}
        )
    made.to_netcdf(path, engine="h5netcdf", format="NETCDF4")
    if header["keep"]:
        _export_kept(journal, header, members, path)


def _export_kept(
    journal: sqlite3.Connection, header: Mapping[str, Any], members: npt.NDArray[np.int64], path: Path
) -> None:
    """Add what was kept, some members at a time: all of it may not fit into memory."""
    import h5netcdf

    place = {int(i): k for k, i in enumerate(members)}
    with h5netcdf.File(path, "a") as file:
        for name, (dimension, unit) in header["kept"].items():
            size = int(header["axes"][dimension][2])
            chunks = (min(BLOCK, max(1, len(members))), size)
            variable = file.create_variable(
                name, ("member", dimension), "f4", chunks=chunks, fillvalue=np.float32(np.nan), compression="gzip"
            )
            variable.attrs["units"] = unit
            rows = journal.execute("SELECT i, content FROM kept WHERE name = ? ORDER BY i", (name,))
            block = np.full((len(members), size) if len(members) <= BLOCK else chunks, np.nan, np.float32)
            at = 0
            for i, content in rows:
                k = place[i]
                while k >= at + len(block):
                    variable[at : at + len(block)] = block
                    block[:] = np.nan
                    at += len(block)
                block[k - at] = np.frombuffer(content, "<f4")
            if len(members):
                variable[at : at + len(block)] = block[: len(members) - at]


# -- the folder -------------------------------------------------------------------------------------------------------
@contextmanager
def _writing(folder: Path) -> Iterator[None]:
    """What keeps a folder from being written, in one line."""
    try:
        yield
    except (OSError, sqlite3.Error) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise SimulationError(f"{folder}: cannot be written ({why}); what was stored before is kept") from error


def _said(value: Any) -> str:
    if value is None:
        return "not given"
    text = json.dumps(value) if isinstance(value, Mapping | list) else str(value)
    text = (text or "none") if not isinstance(value, list) or value else "none"
    return text if len(text) <= 60 else f"{text[:57]}..."


def _difference(there: Any, here: Any, path: str = "") -> tuple[str, Any, Any]:
    """The first key at which two scenes differ, and what each has."""
    if isinstance(there, Mapping) and isinstance(here, Mapping):
        for key in dict.fromkeys((*there, *here)):
            if there.get(key) != here.get(key):
                return _difference(there.get(key), here.get(key), f"{path}.{key}" if path else key)
    if isinstance(there, list) and isinstance(here, list) and len(there) == len(here):
        for k, (a, b) in enumerate(zip(there, here, strict=True)):
            if a != b:
                return _difference(a, b, f"{path}.{k}")
    return path or "the scene", there, here


def missing(status: Mapping[int, str], count: int, retry: bool) -> Iterable[int]:
    """Members below ``count`` that are still to be computed, failed ones too with ``retry``."""
    return (i for i in range(count) if i not in status or (retry and status[i] == BROKEN))
