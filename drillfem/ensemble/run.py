"""Run the members of an ensemble, on one process or over MPI (mpi4py.futures), into a store.

>>> from drillfem.ensemble.run import ensemble
>>> ensemble("horizontal-stochastic", 20, "rock", until=1.0).mean("member")["power_ratio"]      # doctest: +SKIP

Rank 0 hands out members and writes the store; up to `WORKING` ranks it computes members itself. A member is made from
its number alone, so it is the same bit for bit whoever computes it, and when.
"""

from __future__ import annotations

import gc
import os
import queue
import signal
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from drillfem.ensemble import store as stores
from drillfem.ensemble.inputs import Inputs
from drillfem.ensemble.member import Worker, numbers
from drillfem.ensemble.sampling import Sampler
from drillfem.ensemble.store import BROKEN, DONE, Outcome, Store
from drillfem.errors import MissingDependency, SceneError, SimulationError
from drillfem.results import Result
from drillfem.scene import Scene, load_scene

if TYPE_CHECKING:
    import xarray as xr

F8 = npt.NDArray[np.float64]

#: Ranks up to which rank 0 computes members, too; with more it only hands out and writes.
WORKING = 32
#: Seconds of work that a rank is given at a time: many short members in one message, long ones one by one. Where rank 0
#: computes in numba, which keeps the interpreter to itself, others wait for a task about as long as a member takes.
TASK_SECONDS = 2.0
#: Seconds between two looks for messages, at most. More often takes 5 % of a core from the members (measured).
BACKOFF = 0.01
#: Most rows of a history that is kept.
ROWS = 500
#: Seconds between two versions of members.nc while an ensemble runs, at least, and the share of time it may take.
EXPORT_INTERVAL, EXPORT_SHARE = 60.0, 0.02
#: Members that a mean must have before its error is looked at; and how often that is done.
FIRST_LOOK, LOOKS = 32, 1.05


@dataclass(frozen=True)
class Standing:
    """How far an ensemble is: members stored in all, failed ones among them, how many it shall have; computed by this
    call, in how many seconds, on how many ranks; members still running."""

    stored: int
    failed: int
    count: int
    computed: int = 0
    seconds: float = 0.0
    ranks: int = 1
    running: int = 0
    note: str = ""


Show = Callable[[Standing], None]


@dataclass(frozen=True)
class Job:
    """What every rank needs to compute members: sent once."""

    inputs: Inputs
    keep: tuple[str, ...]
    times: F8


class Runner:
    """Computes members on this process, one after the other."""

    def __init__(self, job: Job, rank: int = 0) -> None:
        self.job, self.rank = job, rank
        self.worker = Worker()
        first = self.worker.warm_up(job.inputs.middle)
        #: units by history variable; None where the first run did not tell
        self.history_units: dict[str, str] | None = None
        if first is not None:
            self.history_units = {str(n): str(v.attrs["units"]) for n, v in first.history.data_vars.items()}

    def __call__(self, index: int, u: F8) -> Outcome:
        """Member ``index`` of numbers u (dimension,). What goes wrong with it is in the outcome."""
        wall, cpu = time.perf_counter(), time.thread_time()
        inputs, scene, made = self.job.inputs, None, None
        try:
            made = inputs.member(u)
            scene = made.scene
            result = self.worker.simulate(scene)
            found, status, reason = numbers(result), DONE, ""
            units, kept = units_of(result, found), self._kept(result, made.fields)
        except Exception as error:
            # whatever it is: the other members go on
            text = " ".join(str(error).split())
            known = isinstance(error, SceneError | SimulationError)
            status, reason = BROKEN, text if known and text else f"{type(error).__name__}: {text}"
            found, units, kept = {}, {}, {}
            self.worker = Worker()  # nobody knows what is left in this one
        return Outcome(
            index,
            status,
            reason,
            found,
            units,
            {} if made is None else made.scalars,
            0 if made is None else made.clips,
            time.thread_time() - cpu,
            time.perf_counter() - wall,
            self.rank,
            resident(),
            kept,
            "" if status == DONE else _toml(inputs, u, scene),
        )

    def _kept(self, result: Result, fields: Mapping[str, npt.NDArray[Any]]) -> dict[str, npt.NDArray[np.float32]]:
        kept: dict[str, npt.NDArray[np.float32]] = {}
        for name in self.job.keep:
            if name in fields:
                kept[f"field_{name}"] = fields[name][:, 1].astype(np.float32)
            else:
                history = result.history
                values = np.interp(self.job.times, history["time"].values, history[name].values)
                kept[f"history_{name}"] = values.astype(np.float32)
        return kept


def units_of(result: Result, found: Mapping[str, float]) -> dict[str, str]:
    """Units of the numbers of a member, where they are known."""
    from drillfem.results.history import STANDARD

    units = {name: STANDARD[name].units for name in found if name in STANDARD}
    units |= {str(name): str(v.attrs["units"]) for name, v in result.history.data_vars.items() if name in found}
    return units | {k: u for k, u in {"simulated_seconds": "s", "drilled_depth": "m"}.items() if k in found}


def resident() -> int:
    """Bytes of memory that this process has now; 0 where the system does not say."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError):
        return 0


def _toml(inputs: Inputs, u: F8, scene: Scene | None) -> str:
    """The scene of a member as a file; of one that is impossible, what was asked for."""
    from drillfem.scene.toml import dumps

    if scene is not None:
        return scene.to_toml()
    data: Any = inputs.data
    for (name, _), x in zip(inputs.order, u, strict=True):
        if name in inputs.numbers:
            number = inputs.numbers[name]
            data = number.put(data, number.at(float(x))[0])
    return dumps(data)


# -- the whole --------------------------------------------------------------------------------------------------------
def ensemble(
    scene: str | Path | Scene,
    count: int,
    out: str | Path,
    *,
    seed: int = 0,
    method: str = "monte-carlo",
    overrides: Mapping[str, Any] | None = None,
    until: float | None = None,
    keep: Sequence[str] = (),
    retry_failed: bool = False,
    tolerance: float | None = None,
    quantity: str | None = None,
    show: Show | None = None,
    comm: Any = None,
) -> xr.Dataset | None:
    """Compute the members of a scene with random inputs into a folder; what is there already is not repeated.

    Args:
        scene: built-in name, TOML file, or a scene.
        count: how many members there shall be.
        out: folder, new or with a part of the same ensemble.
        seed, method: see `drillfem.ensemble.sampling.Sampler`.
        overrides: changes of the scene by dotted key.
        until: stop members at this simulated time (s).
        keep: names of history variables and of random fields that are kept of every member, thinned to 500 times.
        retry_failed: compute failed members again.
        tolerance, quantity: stop earlier, when the 95 % band of the mean of this summary quantity is narrower than
            this to both sides, relative to the mean. It is looked at for the first members by number, so that where it
            stops does not depend on who was fast; others that were running are stored as well.
        show: called with the standing as members come in, on rank 0, from another thread.
        comm: mpi4py communicator, all of whose ranks make this call; that of the program by default.

    Returns what `drillfem.ensemble.store.read` gives, on rank 0; None on the others. A failed member has its reason.

    SIGUSR1 lets running members end, SIGINT (Ctrl-C) and SIGTERM give them up; either way what is done is stored, and
    KeyboardInterrupt raised.

    Raises SceneError (bad input, or ``out`` holds something else: nothing is written) and SimulationError (``out``
    cannot be written).
    """
    prepare = partial(
        _Prepared.of, scene, count, out, seed, method, overrides, until, keep, retry_failed, tolerance, quantity
    )
    comm = world() if comm is None else comm
    if comm is not None and comm.size > 1:
        _on_ranks(comm, prepare, show)
        return stores.read(out) if comm.rank == 0 else None
    prepared = prepare()
    with prepared.store, _Signals() as signals:
        _lead(prepared, None, 1, signals, show)
    return stores.read(out)


def world() -> Any:
    """The program's communicator; None without mpi4py. Before DOLFINx: only so may threads talk over MPI."""
    try:
        from mpi4py import MPI
    except ImportError:
        return None
    return MPI.COMM_WORLD


def _on_ranks(comm: Any, prepare: Callable[[], _Prepared], show: Show | None) -> None:
    """`ensemble` on several ranks: rank 0 prepares and compiles, then one rank of each node, then the others."""
    # PETSc and SLEPc start, and end, on all ranks at once
    with suppress(MissingDependency, ImportError):
        import drillfem.compat  # noqa: F401, I001
        import slepc4py.SLEPc  # noqa: F401

    with _Signals() as signals:
        prepared: _Prepared | None = None
        error: BaseException | None = None
        if comm.rank == 0:
            try:
                with signals.breakable():
                    prepared = prepare()
            except BaseException as raised:
                error = raised
        _wait(comm)
        job, told = comm.bcast((prepared and prepared.job, error and _told(error)), root=0)
        if told is not None:
            raise error or told
        try:
            if prepared is None:
                _follow(comm, job)
            else:
                with prepared.store:
                    error = _leading(comm, prepared, signals, show)
        except BaseException:
            # no rank can be left waiting for this one
            traceback.print_exc()
            comm.Abort(1)
        told = comm.bcast(error and _told(error), root=0)
        if told is not None:
            raise error or told


def _told(error: BaseException) -> BaseException:
    """What other ranks are told of an exception: it can be sent."""
    if isinstance(error, SceneError | SimulationError | KeyboardInterrupt):
        return type(error)(str(error))
    return SimulationError(f"{type(error).__name__}: {error}")


def _in_turn(comm: Any, job: Job) -> Runner | None:
    """Set up, the first rank of each node before the others: kernels may have to be compiled for it."""
    from mpi4py import MPI

    node = comm.Split_type(MPI.COMM_TYPE_SHARED)
    runner = Runner(job, comm.rank) if comm.rank and not node.rank else None
    _wait(comm)
    if comm.rank and node.rank:
        runner = Runner(job, comm.rank)
    node.Free()
    _wait(comm)
    return runner


def _follow(comm: Any, job: Job) -> None:
    """What the other ranks do: compute what they are sent."""
    from mpi4py.futures import MPICommExecutor

    global _runner
    _runner = _in_turn(comm, job)
    _settle()
    with MPICommExecutor(comm, root=0, backoff=BACKOFF):
        pass  # on these ranks entering it is the work


def _leading(comm: Any, prepared: _Prepared, signals: _Signals, show: Show | None) -> BaseException | None:
    """What rank 0 does; and how it ended, if not well."""
    from mpi4py.futures import MPICommExecutor

    _in_turn(comm, prepared.job)
    try:
        with MPICommExecutor(comm, root=0, backoff=BACKOFF) as executor:
            _lead(prepared, executor, comm.size, signals, show)
    except BaseException as error:
        return error
    return None


def _settle() -> None:
    """What is there now stays: the search for garbage, after each task, need not look at it."""
    gc.collect()
    gc.freeze()


def _wait(comm: Any) -> None:
    """A barrier that leaves the processor to who is still at work."""
    request = comm.Ibarrier()
    while not request.Test():
        time.sleep(0.01)


_runner: Runner | None = None


def _compute(tasks: Sequence[tuple[int, F8]]) -> list[Outcome]:
    """Members, on the rank that this is called on; fewer if a signal came."""
    assert _runner is not None
    done: list[Outcome] = []
    signals = _Signals.here
    for index, u in tasks:
        if done and signals and signals.draining:
            break
        try:
            with signals.breakable() if signals else nullcontext():
                done.append(_runner(index, u))
        except KeyboardInterrupt:
            if signals:
                signals.stopped = True
            break
    gc.collect()  # PETSc objects in cycles do not weigh on Python's own count
    return done


@dataclass
class _Prepared:
    """What rank 0 has before the first member: kernels are compiled, the folder is there."""

    job: Job
    runner: Runner
    store: Store
    sampler: Sampler
    todo: deque[int]
    count: int
    tolerance: float | None
    quantity: str | None
    seconds: float

    @classmethod
    def of(
        cls,
        given: str | Path | Scene,
        count: int,
        out: str | Path,
        seed: int,
        method: str,
        overrides: Mapping[str, Any] | None,
        until: float | None,
        keep: Sequence[str],
        retry: bool,
        tolerance: float | None,
        quantity: str | None,
    ) -> _Prepared:
        global _runner
        began = time.perf_counter()
        if count < 1:
            raise SceneError(f"-n {count}: must be a whole number >= 1")
        if seed < 0:
            raise SceneError(f"--seed {seed}: must be a whole number >= 0")
        if (tolerance is None) != (quantity is None):
            raise SceneError("--tolerance and --quantity: one says how exact, the other what: give both or none")
        if tolerance is not None and not 0 < tolerance < 1:
            raise SceneError(f"--tolerance {tolerance:g}: must be > 0 and < 1, a share of the mean")
        scene = given if isinstance(given, Scene) else load_scene(given, dict(overrides or {}))
        if until is not None:
            if not until > scene.time.start:
                raise SceneError(f"--until {until:g}: must be later than the start, {scene.time.start:g} s")
            scene = replace(scene, time=replace(scene.time, end=until)).checked()
        from drillfem.solve import guards

        guards.refuse(scene)
        inputs = Inputs.of(scene)
        sampler = Sampler(method, inputs.dimension, seed, count)
        keep = sorted(set(keep))
        header = _header(scene, inputs, count, seed, method, keep)
        known = stores.check(Path(out), header)
        if known is not None and known["count"] > count:
            sampler = Sampler(method, inputs.dimension, seed, known["count"])
        sampler.member(0)  # a set is made once, before there are threads
        job = Job(inputs, tuple(keep), _times(scene))
        _runner = runner = Runner(job)
        _check_kept(runner, keep)
        header["kept"], header["axes"] = _shapes(job, runner)
        store = Store(out, header)
        todo = deque(stores.missing(store.status, count, retry))
        return cls(job, runner, store, sampler, todo, count, tolerance, quantity, time.perf_counter() - began)


def _header(scene: Scene, inputs: Inputs, count: int, seed: int, method: str, keep: Sequence[str]) -> dict[str, Any]:
    from drillfem.results.manifest import versions
    from drillfem.scene.uncertain import number_at

    scalars = {name: number_at(Scene, n.random.targets[0]).key.unit for name, n in inputs.numbers.items()}
    return {
        "format": stores.FORMAT,
        "seed": seed,
        "method": method,
        "count": count,
        "keep": list(keep),
        "dimension": inputs.dimension,
        "input_names": list(inputs.names),
        "inputs": inputs.facts,
        "scalars": scalars,
        "versions": versions(),
        "scene": scene.to_toml(),
        "kept": {},
        "axes": {},
    }


def _times(scene: Scene) -> F8:
    """Times (s) at which histories are kept: rows of the history itself, every so many."""
    span, step = scene.time.end - scene.time.start, scene.output.interval
    rows = max(1, round(span / step)) if step else ROWS - 1
    every = -(-rows // (ROWS - 1))
    last = scene.time.start + rows // every * every * span / rows
    return np.linspace(scene.time.start, last, rows // every + 1, dtype=np.float64)


def _check_kept(runner: Runner, keep: Sequence[str]) -> None:
    """See that what is to be kept exists."""
    if runner.history_units is None:
        return
    names = [*runner.job.inputs.fields, *runner.history_units]
    for name in keep:
        if name not in names:
            raise SceneError(f"--keep {name}: must be one of {', '.join(names)}")


def _shapes(job: Job, runner: Runner) -> tuple[dict[str, list[str]], dict[str, list[float]]]:
    """Of each variable that is kept its dimension and unit; of these dimensions first and last value, and how many."""
    kept: dict[str, list[str]] = {}
    axes: dict[str, list[float]] = {}
    for name in job.keep:
        if name in job.inputs.fields:
            points: Any = job.inputs.fields[name].points
            axis = [float(points[0]), float(points[-1]), len(points)]
            dimension = next((d for d, a in axes.items() if d.startswith("depth") and a == axis), "")
            dimension = dimension or (f"depth_{name}" if "depth" in axes else "depth")
            kept[f"field_{name}"], axes[dimension] = [dimension, "1"], axis
        else:
            kept[f"history_{name}"] = ["time", (runner.history_units or {}).get(name, "1")]
            axes["time"] = [float(job.times[0]), float(job.times[-1]), len(job.times)]
    return kept, axes


# -- rank 0 -----------------------------------------------------------------------------------------------------------
class _Dispatch:
    """Members that nobody has yet, handed out in pieces that take about as long; used by several threads."""

    def __init__(self, prepared: _Prepared, workers: int) -> None:
        self._todo, self._sampler, self.workers = deque(prepared.todo), prepared.sampler, workers
        self._mean = 0.0
        self._lock = threading.Lock()
        self.changed = threading.Condition()
        self.running = 0
        self.error: BaseException | None = None

    def take(self) -> list[tuple[int, F8]]:
        """The next members with their numbers; none left: an empty list."""
        with self._lock:
            size = int(TASK_SECONDS / self._mean) if self._mean else 1
            # towards the end in ever smaller pieces, so that all end together
            size = max(1, min(size, len(self._todo) // (2 * self.workers)))
            taken = [self._todo.popleft() for _ in range(min(size, len(self._todo)))]
        return [(i, self._sampler.member(i)) for i in taken]

    def learn(self, outcomes: Sequence[Outcome]) -> None:
        """How long members take, newer ones counting more."""
        with self._lock:
            for outcome in outcomes:
                seconds = max(outcome.wall_seconds, 1e-6)
                self._mean = seconds if not self._mean else 0.9 * self._mean + 0.1 * seconds

    def end(self) -> None:
        """Hand out no more."""
        with self._lock:
            self._todo.clear()


class _Recorder(threading.Thread):
    """Takes outcomes, and stores those that have come together, as often as it does not cost much."""

    def __init__(
        self, prepared: _Prepared, dispatch: _Dispatch, ranks: int, signals: _Signals, show: Show | None
    ) -> None:
        super().__init__(name="drillfem-store", daemon=True)
        self.prepared, self.dispatch, self.ranks = prepared, dispatch, ranks
        self.signals, self.show = signals, show
        self.error: BaseException | None = None
        self.computed, self.note = 0, ""
        self.began = time.perf_counter()
        self.busy = 0.0
        self._queue: queue.SimpleQueue[list[Outcome] | None] = queue.SimpleQueue()
        self._first, self._next_look = 0, FIRST_LOOK
        self._values: dict[int, float] = {}
        status = prepared.store.status
        self._failed = sum(s == BROKEN for s in status.values())

    def put(self, outcomes: list[Outcome]) -> None:
        """Store these soon."""
        self._queue.put(outcomes)

    def close(self) -> None:
        """Store what has come, and end. Raises what has gone wrong."""
        self._queue.put(None)
        self.join()
        if self.error is not None:
            raise self.error

    def run(self) -> None:
        try:
            self._record()
        except BaseException as error:
            self.error = error
            self.dispatch.end()
            with self.dispatch.changed:
                self.dispatch.changed.notify_all()

    def _record(self) -> None:
        store, open_ = self.prepared.store, True
        exported, pause = time.perf_counter(), EXPORT_INTERVAL
        while open_:
            batch: list[Outcome] = []
            with suppress(queue.Empty):
                item = self._queue.get(timeout=0.5)
                while True:
                    if item is None:
                        open_ = False
                    else:
                        batch += item
                    item = self._queue.get_nowait()
            if batch:
                start = time.perf_counter()
                store.append(batch)
                spent = time.perf_counter() - start
                self.busy += spent
                self.computed += len(batch)
                self._failed = sum(s == BROKEN for s in store.status.values())
                if (name := self.prepared.quantity) is not None:
                    self.look({o.index: o.numbers[name] for o in batch if name in o.numbers})
            if self.show is not None:
                self.show(self.standing())
            if open_ and time.perf_counter() - exported > pause:
                start = time.perf_counter()
                store.export()
                exported = time.perf_counter()
                pause = max(EXPORT_INTERVAL, (exported - start) / EXPORT_SHARE)
            if batch:
                # who comes meanwhile shares the next transaction; but mpirun leaves 0.2 s from SIGTERM to SIGKILL
                until = time.perf_counter() + min(10 * spent, 1.0)
                while open_ and time.perf_counter() < until and not self.signals.stopped:
                    time.sleep(0.01)

    def standing(self) -> Standing:
        """How far it is now."""
        status, count = self.prepared.store.status, self.prepared.count
        seconds = time.perf_counter() - self.began
        running = self.dispatch.running
        return Standing(
            len(status), self._failed, max(count, len(status)), self.computed, seconds, self.ranks, running, self.note
        )

    def look(self, values: Mapping[int, float]) -> None:
        """End the ensemble if the mean of the first members is exact enough."""
        from drillfem.ensemble.statistics import converged

        tolerance, name, status = self.prepared.tolerance, self.prepared.quantity, self.prepared.store.status
        if tolerance is None or name is None:
            return
        if DONE in status.values() and name not in (known := self.prepared.store.quantities()):
            raise SceneError(f"--quantity {name}: must be one of {', '.join(known)}")
        self._values |= values
        while self._first in status:
            self._first += 1
        while self._next_look <= self._first and not self.note:
            size = self._next_look
            if converged(np.array([self._values[i] for i in range(size) if i in self._values]), tolerance):
                self.note = f"{name} known to {tolerance:g} after {size} members"
                self.dispatch.end()
            self._next_look = max(size + 1, round(size * LOOKS))


def _lead(prepared: _Prepared, executor: Any, ranks: int, signals: _Signals, show: Show | None) -> None:
    """Have all members computed and stored. Raises KeyboardInterrupt, SimulationError."""
    works = executor is None or (ranks <= WORKING and _threads_may_talk())
    dispatch = _Dispatch(prepared, ranks if works else ranks - 1)
    recorder = _Recorder(prepared, dispatch, ranks, signals, show)
    if prepared.quantity is not None:
        recorder.look(prepared.store.values(prepared.quantity))
    _settle()
    recorder.start()

    def submit() -> None:
        assert executor is not None
        if tasks := dispatch.take():
            with dispatch.changed:
                dispatch.running += len(tasks)
            executor.submit(_compute, tasks).add_done_callback(lambda f: collect(f, len(tasks)))

    def collect(future: Any, size: int) -> None:
        try:
            outcomes = future.result()
            dispatch.learn(outcomes)
            recorder.put(outcomes)
            if len(outcomes) < size:  # that rank was told to stop
                dispatch.end()
                signals.stopped = True
            submit()
        except BaseException as error:
            dispatch.error = error
            dispatch.end()
        finally:
            with dispatch.changed:
                dispatch.running -= size
                dispatch.changed.notify_all()

    def idle() -> bool:
        return not dispatch.running

    try:
        for _ in range(ranks - 1):
            submit()
        while works and not signals.ending and (tasks := dispatch.take()):
            with dispatch.changed:
                dispatch.running += len(tasks)
            outcomes = _compute(tasks)
            with dispatch.changed:
                dispatch.running -= len(tasks)
            dispatch.learn(outcomes)
            recorder.put(outcomes)
        while True:
            if signals.ending:
                dispatch.end()
            with dispatch.changed:
                if dispatch.changed.wait_for(idle, timeout=0.1):
                    break
    finally:
        dispatch.end()
        gc.unfreeze()
        recorder.close()
        _sum_up(prepared, recorder)
    if dispatch.error is not None:
        raise SimulationError(f"{type(dispatch.error).__name__}: {dispatch.error}") from dispatch.error
    left = len(list(stores.missing(prepared.store.status, prepared.count, False)))
    if signals.ending and left:
        out = prepared.store.folder
        raise KeyboardInterrupt(
            f"interrupted: {out} holds {prepared.count - left} of {prepared.count} members; the same command goes on"
        )


def _sum_up(prepared: _Prepared, recorder: _Recorder) -> None:
    """Bring the folder up to date, and note what this call did."""
    import socket

    store = prepared.store
    standing = recorder.standing()
    start = time.perf_counter()
    store.export()
    session = {
        "ranks": recorder.ranks,
        "members": recorder.computed,
        "set_up_seconds": prepared.seconds,
        "seconds": standing.seconds,
        "journal_seconds": recorder.busy,
        "export_seconds": time.perf_counter() - start,
        "host": socket.gethostname(),
        "note": recorder.note,
    }
    store.note(sessions=[*store.header["sessions"], session] if recorder.computed else store.header["sessions"])
    if recorder.show is not None:
        recorder.show(replace(recorder.standing(), running=0))


def _threads_may_talk() -> bool:
    from mpi4py import MPI

    return bool(MPI.Query_thread() == MPI.THREAD_MULTIPLE)


# -- signals ----------------------------------------------------------------------------------------------------------
class _Signals:
    """While entered: SIGINT and SIGTERM end the member that is computed, SIGUSR1 (of Slurm) lets it end; after either
    no other begins. A second SIGINT or SIGTERM does not wait for other ranks."""

    here: _Signals | None = None

    def __init__(self) -> None:
        self.stopped = self.draining = False
        self._breakable = False
        self._before: dict[int, Any] = {}

    @property
    def ending(self) -> bool:
        """Whether no other member shall begin."""
        return self.stopped or self.draining

    def __enter__(self) -> _Signals:
        if threading.current_thread() is threading.main_thread():
            wanted = {signal.SIGINT: self._stop, signal.SIGTERM: self._stop}
            if hasattr(signal, "SIGUSR1"):
                wanted[signal.SIGUSR1] = self._drain
            self._before = {number: signal.signal(number, handler) for number, handler in wanted.items()}
        _Signals.here = self
        return self

    def __exit__(self, *_: object) -> None:
        _Signals.here = None
        for number, handler in self._before.items():
            signal.signal(number, handler)

    @contextmanager
    def breakable(self) -> Iterator[None]:
        """While entered a signal raises KeyboardInterrupt."""
        if self.stopped:
            raise KeyboardInterrupt
        self._breakable = True
        try:
            yield
        finally:
            self._breakable = False

    def _stop(self, number: int, frame: FrameType | None) -> None:
        again, self.stopped = self.stopped, True
        if self._breakable:
            self._breakable = False
            raise KeyboardInterrupt
        if again:
            os._exit(130)  # the journal is whole at every moment

    def _drain(self, number: int, frame: FrameType | None) -> None:
        self.draining = True
