"""Cost of a member, memory, efficiency on 1 and 2 ranks, and what the store and the hand-out take.

Writes docs/scaling.md: seven minutes on two cores that nobody else uses; says so where the cores were shared. The runs
on one rank and on two take turns, because machines drift by more than what is measured.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from common import DOCS, machine, table

from drillfem.ensemble.run import TASK_SECONDS
from drillfem.ensemble.store import Outcome, Store, header_of, read

SCENE = "horizontal-stochastic"
#: Runs on two ranks; one on one rank before, between and after them.
TURNS = 4
#: What docs/scaling.md asks about.
MANY, CORES = 100_000, 1000


def mpirun(ranks: int, *arguments: str) -> float:
    """Wall seconds of a job."""
    environment = {
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "HWLOC_HIDE_ERRORS": "2",
        "OMPI_MCA_btl": "self,sm",
        "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    }
    start = time.perf_counter()
    command = ["mpirun", "-n", str(ranks), sys.executable, *arguments]
    subprocess.run(command, env=os.environ | environment, check=True, stdin=subprocess.DEVNULL)
    return time.perf_counter() - start


def members(folder: Path, ranks: int, count: int, until: float | None) -> tuple[xr.Dataset, dict[str, Any], float]:
    """An ensemble by the command line: what it stored, how the session went, seconds with start and end."""
    more = () if until is None else ("--until", str(until))
    arguments = ("-m", "drillfem.cli", "ensemble", SCENE, "-n", str(count), "--out", str(folder), *more)
    wall = mpirun(ranks, *arguments)
    return read(folder), header_of(folder)["sessions"][-1], wall


def journal(folder: Path, like: xr.Dataset, count: int, batch: int) -> tuple[float, float, float, float]:
    """Members per second that the store takes, bytes of journal and of members.nc per member, seconds of an export."""
    skipped = ("seconds", "wall_seconds", "rank", "memory", "clips", "status", "reason")
    names = [str(n) for n in like.data_vars if n not in skipped and not str(n).startswith("input_")]
    units = {name: str(like[name].attrs["units"]) for name in names}
    header: dict[str, Any] = {"format": 1, "seed": 0, "method": "monte-carlo", "count": count, "scene": ""}
    header |= {"keep": [], "scalars": {}, "kept": {}, "axes": {}}
    values = np.random.default_rng(0).random((count, len(names)))
    with Store(folder, header) as store:
        start = time.perf_counter()
        for first in range(0, count, batch):
            rows = range(first, min(first + batch, count))
            store.append([Outcome(i, "done", "", dict(zip(names, values[i], strict=True)), units) for i in rows])
        taken = time.perf_counter() - start
        start = time.perf_counter()
        store.export()
        export = time.perf_counter() - start
    sizes = [(folder / name).stat().st_size / count for name in ("journal.sqlite", "members.nc")]
    return count / taken, sizes[0], sizes[1], export


#: Tasks that cost nothing, handed out as those of an ensemble: what mpi4py.futures can do.
HAND_OUT = """
import sys, time
import numpy as np
from mpi4py import MPI
from mpi4py.futures import MPICommExecutor
from drillfem.ensemble.run import BACKOFF
from drillfem.ensemble.sampling import Sampler

count, u = int(sys.argv[1]), Sampler("monte-carlo", 100, 0)
with MPICommExecutor(MPI.COMM_WORLD, root=0, backoff=BACKOFF) as executor:
    if executor is not None:
        start = time.perf_counter()
        for _ in executor.map(len, ([(i, u.member(i))] for i in range(count))):
            pass
        print((time.perf_counter() - start) / count)
"""


def hand_out(count: int) -> float:
    """Seconds that rank 0 needs for a task of one member, with nothing to compute."""
    environment = os.environ | {"OMPI_MCA_btl": "self,sm", "OMPI_ALLOW_RUN_AS_ROOT": "1"}
    environment |= {"OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe"}
    command = ["mpirun", "-n", "2", sys.executable, "-c", HAND_OUT, str(count)]
    done = subprocess.run(command, env=environment, check=True, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE)
    return float(done.stdout)


def compile_seconds(scratch: Path) -> tuple[float, float]:
    """Seconds of one member of 0.1 s with an empty cache of kernels, and with a full one."""
    cache = {"DRILLFEM_CACHE": str(scratch / "cache"), "NUMBA_CACHE_DIR": str(scratch / "numba")}
    os.environ.update(cache)
    try:
        first = mpirun(
            1, "-m", "drillfem.cli", "ensemble", SCENE, "-n", "1", "--until", "0.1", "--out", str(scratch / "a")
        )
        again = mpirun(
            1, "-m", "drillfem.cli", "ensemble", SCENE, "-n", "1", "--until", "0.1", "--out", str(scratch / "b")
        )
    finally:
        for name in cache:
            del os.environ[name]
    return first, again


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", "--members", type=int, default=200)
    parser.add_argument("--until", type=float, help="shorter members, to try this out")
    parser.add_argument("--long", type=int, default=1000, help="members for memory (of 0.1 s)")
    parser.add_argument("--page", type=Path, default=DOCS / "scaling.md")
    options = parser.parse_args()
    scratch = Path(tempfile.mkdtemp(prefix="scaling-"))
    try:
        options.page.write_text(page(scratch, options.members, options.until, options.long), encoding="utf-8")
    finally:
        shutil.rmtree(scratch)


def turns(
    scratch: Path, count: int, until: float | None
) -> tuple[xr.Dataset, list[tuple[dict[str, Any], float]], list[tuple[xr.Dataset, dict[str, Any], float]]]:
    """The same members on one rank, in parts, and on two, whole, by turns: members, session and seconds of each."""
    singles, pairs = [], []
    for part in range(TURNS + 1):
        upto = round(count * (part + 1) / (TURNS + 1))
        alone, session, wall = members(scratch / "one", 1, upto, until)
        singles.append((session, wall))
        if part < TURNS:
            pairs.append(members(scratch / f"two{part}", 2, count, until))
    for name in alone.data_vars:
        if name not in ("seconds", "wall_seconds", "rank", "memory"):
            assert all(alone[name].equals(data[name]) for data, _, _ in pairs), name
    return alone, singles, pairs


def _row(ranks: int, data: xr.Dataset, seconds: float, cost: float, rest: float) -> list[str]:
    count, clock, cpu = len(data["member"]), float(data["wall_seconds"].sum()), float(data["seconds"].sum())
    return [
        str(ranks),
        f"{seconds:.1f}",
        f"{count / seconds:.3g}",
        f"{100 * count * cost / (ranks * seconds):.1f} %",
        f"{100 * clock / (ranks * seconds):.1f} %",
        f"{1e3 * cpu / count:.0f}",
        f"{1e3 * clock / count:.0f}",
        f"{rest:.1f}",
    ]


def page(scratch: Path, count: int, until: float | None, many: int) -> str:
    """docs/scaling.md."""
    alone, singles, pairs = turns(scratch, count, until)
    clock = float(alone["wall_seconds"].sum())
    cost = clock / count
    rows, shared = [], 1 - float(alone["seconds"].sum()) / clock
    waited = 1 - sum(float(p["seconds"].sum()) for p, *_ in pairs) / sum(
        float(p["wall_seconds"].sum()) for p, *_ in pairs
    )
    alone_seconds = sum(session["seconds"] for session, _ in singles)
    start_end = sum(wall - session["seconds"] for session, wall in singles) / len(singles)
    rows.append(_row(1, alone, alone_seconds, cost, start_end))
    for data, session, wall in pairs:
        rows.append(_row(2, data, session["seconds"], cost, wall - session["seconds"]))
    two = sum(session["seconds"] for _, session, _ in pairs)
    drift = [float(part.mean()) for part in np.array_split(alone["wall_seconds"].values, len(singles))]
    spread = float(alone["seconds"].std() / alone["seconds"].mean())
    long = members(scratch / "long", 1, many, 0.1)[0]["memory"].values / 1e6
    memory = np.concatenate([data["memory"].values for data in (alone, *(p[0] for p in pairs))]) / 1e6
    first, again = compile_seconds(scratch)
    task = hand_out(5000)
    rates = {batch: journal(scratch / f"j{batch}", alone, 20 * max(batch, 10), batch) for batch in (1, 10, 100, 1000)}
    big = journal(scratch / "big", alone, MANY, 1000)
    pace = (CORES - 1) / cost
    whole = MANY / pace
    per_task = max(1.0, TASK_SECONDS / cost)
    share = {
        "handing out": task * pace / per_task,
        "the journal": pace / big[0],
        "members.nc, at most": 0.02,
    }
    worst = max(share, key=lambda k: share[k])
    tail = float(alone["wall_seconds"].max()) / 2
    quiet = (
        "The cores were free."
        if shared < 0.02
        else f"**The cores were shared with other work**: members waited {100 * shared:.0f} % of their time."
    )
    return TEXT.format(
        scene=SCENE,
        count=count,
        horizon="10 s" if until is None else f"{until:g} s",
        machine="; ".join(f"{name}: {1e3 * value:.1f} ms" for name, value in machine().items()),
        quiet=quiet,
        turns=TURNS,
        waited=100 * waited,
        waited_alone=100 * shared,
        overall=100 * TURNS * clock / (2 * two),
        drift=100 * (max(drift) / min(drift) - 1),
        efficiency=table(
            ["ranks", "seconds", "members / s", "efficiency", "busy", "CPU, ms", "clock, ms", "start and end, s"], rows
        ),
        cpu=float(alone["seconds"].mean()),
        spread=100 * spread,
        memory=memory.max(),
        many=many,
        m100=long[min(100, many - 1)],
        mlast=long[-1],
        growth=1e3 * (long[-1] - long[min(100, many - 1)]) / max(many - 100, 1),
        first=first,
        again=again,
        task=1e3 * task,
        tasks=1 / task,
        journal=table(
            ["members in a transaction", "members / s"], [[str(b), f"{rate:.0f}"] for b, (rate, *_) in rates.items()]
        ),
        jbytes=big[1],
        nbytes=big[2],
        export=big[3],
        jtotal=big[1] * MANY / 1e6,
        ntotal=big[2] * MANY / 1e6,
        whole=whole,
        pace=pace,
        cost=cost,
        shares=table(["", "share of rank 0"], [[k, f"{100 * v:.1f} %"] for k, v in share.items()]),
        worst=worst,
        limit=int((CORES - 1) / share[worst]) if share[worst] > 0 else 0,
        tail=tail,
        tail_share=100 * tail / (whole + tail),
        start_share=100 * again / (whole + again),
        start=again,
        history=4 * 500 * MANY / 1e6,
    )


TEXT = """# Scaling of ensembles

`{scene}`, {count} members of {horizon}, by `mpirun -n P drillfem ensemble`; written by
`benchmarks/ensemble_scaling.py`. {quiet}

This machine: {machine}.

## One and two ranks

{efficiency}

**Efficiency on two ranks: {overall:.1f} %**, over {turns} runs: the cost of the members on one rank, over ranks times
seconds. The members of one rank were computed in parts before, between and after the runs on two ranks, because this
machine drifts: a member of the slowest part took {drift:.0f} % longer than one of the fastest. The single runs scatter
by as much. Busy is the share of the time in which the ranks had a member at work, and does not depend on that: what it
lacks is what handing out, storing and waiting for the last member take. During a member two ranks wait
{waited:.1f} % of the time for a processor, one rank {waited_alone:.1f} %: rank 0 takes messages and writes as well.
Seconds are from the first member to the last one stored. Start and end: MPI, imports, kernels from the cache,
members.nc. All runs stored the same members, bit for bit.

A member takes {cpu:.3f} s of a core; the standard deviation between members is {spread:.0f} % of that.

## Memory

A rank of these runs had at most {memory:.0f} MB. One rank, {many} members of 0.1 s one after the other:
{m100:.1f} MB after 100, {mlast:.1f} MB after the last; {growth:.2f} kB per member. Every member's `memory` is in the
store: that of an ensemble of your own can be looked at.

## What does not scale

Compiling: {first:.0f} s with an empty cache, {again:.1f} s with a full one (one rank, one short member). It is done by
rank 0 before the others begin, and by one rank of each node where the cache is not common.

Handing out: rank 0 needs {task:.2f} ms for a task without work ({tasks:.0f} per s), one worker. A task is two seconds
of members, so that short members do not cost more.

The store, one process, a disk as here; every transaction is on disk before the next begins:

{journal}

Transactions grow by themselves: what arrives during one goes into the next. A member takes {jbytes:.0f} bytes of
journal and {nbytes:.0f} bytes of members.nc, which takes {export:.1f} s for 10^5 members, and is made so seldom that it
takes no more than 2 % of the time.

## 10^5 members on 1000 cores

Computed from the numbers above, not run: 999 ranks compute, rank 0 hands out and writes. {pace:.0f} members/s, so
{whole:.0f} s, and

{shares}

The bottleneck is {worst}: it would be full at {limit} cores. Beside it the start ({start:.1f} s, {start_share:.0f} % of
the whole; a thousand ranks that import Python from one file system take longer, by as much as that file system takes)
and the end, when the last members run alone: {tail:.1f} s, {tail_share:.1f} %.

Written: {jtotal:.0f} MB of journal and {ntotal:.0f} MB of members.nc; with a history kept (500 times) {history:.0f} MB
more in each.

With Slurm: see [ensembles](ensembles.md).
"""

if __name__ == "__main__":
    main()
