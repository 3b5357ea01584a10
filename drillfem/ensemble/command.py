"""The command ``drillfem ensemble``: what it shows and says, on the first rank only."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from rich.console import Console

from drillfem.errors import DrillfemError, SceneError, SimulationError

if TYPE_CHECKING:
    import xarray as xr
    from rich.progress import Progress

    from drillfem.ensemble.run import Standing


class EnsembleProgress:
    """Progress over all ranks, to be called with a `Standing`: a bar on a terminal, elsewhere a line now and then."""

    def __init__(self, console: Console, interval: float) -> None:
        """interval: seconds between two lines where there is no terminal."""
        self._console, self._interval = console, interval
        self._bar: Progress | None = None
        self._task: Any = None
        self._shown = time.perf_counter()

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            from rich.progress import BarColumn, Progress, TextColumn

            text = TextColumn("{task.fields[text]}", markup=False)
            self._bar = Progress(BarColumn(), text, console=self._console, transient=True)
            self._task = self._bar.add_task("", total=1.0, text="", visible=False)
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def __call__(self, now: Standing) -> None:
        """Show how far it is."""
        if self._bar is not None:
            self._bar.update(self._task, total=now.count, completed=now.stored, text=progress_line(now), visible=True)
        elif time.perf_counter() - self._shown > self._interval:
            self._shown = time.perf_counter()
            self._console.print(progress_line(now), markup=False, soft_wrap=True)


def progress_line(now: Standing) -> str:
    """``137 of 1000 members, 2 failed, 3.41 members/s on 2 ranks, 4:13 left``."""
    from drillfem.cli import _clock

    text = f"{now.stored} of {now.count} members"
    if now.failed:
        text += f", {now.failed} failed"
    if now.computed and now.seconds > 0:
        pace = now.computed / now.seconds
        text += f", {pace:.3g} members/s on {now.ranks} rank{'s' * (now.ranks > 1)}"
        if now.count > now.stored:
            text += f", {_clock((now.count - now.stored) / pace)} left"
    return text


def main(
    scene: str,
    count: int,
    out: Path,
    seed: int,
    method: str,
    overrides: Mapping[str, str],
    until: float | None,
    keep: Sequence[str],
    retry_failed: bool,
    tolerance: str | None,
    quantity: str | None,
) -> None:
    """The command ``drillfem ensemble``. Raises SceneError, SimulationError (no member is done), KeyboardInterrupt."""
    from drillfem.cli import PLAIN_INTERVAL, stderr
    from drillfem.ensemble.run import ensemble, world

    comm = world()
    if comm is not None and comm.rank:
        _follow(lambda: ensemble(scene, count, out, comm=comm))
        return
    start, ranks = time.perf_counter(), 1 if comm is None else comm.size
    latest: list[Standing] = []
    with EnsembleProgress(stderr, PLAIN_INTERVAL) as progress:

        def show(now: Standing) -> None:
            latest[:] = [now]
            progress(now)

        found = ensemble(
            scene,
            count,
            out,
            seed=seed,
            method=method,
            overrides=overrides,
            until=until,
            keep=keep,
            retry_failed=retry_failed,
            tolerance=None if tolerance is None else _share(tolerance),
            quantity=quantity,
            show=show,
            comm=comm,
        )
    assert found is not None
    now = latest[-1]
    how = f"{now.computed} of them now, in {time.perf_counter() - start:.1f} s on {ranks} rank{'s' * (ranks > 1)}"
    print(f"{now.stored} of {now.count} members: {how if now.computed else 'all of them there already'}")
    if now.note:
        print(now.note)
    _report(found, out, quantity)


def _follow(work: Callable[[], object]) -> None:
    """What other ranks do; rank 0 speaks for all, they only end with the same exit code."""
    import typer

    try:
        work()
    except KeyboardInterrupt:
        raise typer.Exit(130) from None
    except DrillfemError as error:
        raise typer.Exit(2 if isinstance(error, SceneError) else 1) from None


def _report(found: xr.Dataset, out: Path, quantity: str | None) -> None:
    from drillfem.ensemble.statistics import mean
    from drillfem.ensemble.store import BROKEN, DONE, TABLE, failed_scene

    status = found["status"].values
    if quantity is not None and quantity in found:
        values = found[quantity].values[status == DONE]
        estimate = mean(values[np.isfinite(values)])
        print(f"{quantity}: mean {estimate.value:.6g}, 95 % band {estimate.low:.6g} to {estimate.high:.6g}")
    broken = found["member"].values[status == BROKEN]
    if len(broken):
        reasons = Counter(map(str, found["reason"].values[status == BROKEN]))
        (reason, times), *others = reasons.most_common()
        print(f"{len(broken)} failed ({times} times: {reason}{'; others for other reasons' if others else ''})")
        print(f"scenes of these: {failed_scene(out, int(broken[0]))} ...; --retry-failed computes them again")
    clips = int(found["clips"].sum())
    if clips:
        print(f"{clips} random numbers lay beyond their support and were clipped")
    print(f"results: {out / TABLE}")
    if not (status == DONE).any():
        raise SimulationError("no member could be computed")


def _share(text: str) -> float:
    """``0.01`` or ``1%``."""
    number = text.strip()
    try:
        return float(number.removesuffix("%")) / (100 if number.endswith("%") else 1)
    except ValueError:
        raise SceneError(f"--tolerance {text!r}: must be a share of the mean, such as 0.01 or 1%") from None
