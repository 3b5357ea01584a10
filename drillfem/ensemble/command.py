"""The command ``drillfem ensemble``: what it shows and says, on the first rank only."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from drillfem.cli import LiveLine, clock
from drillfem.errors import DrillfemError, SceneError, SimulationError

if TYPE_CHECKING:
    import xarray as xr

    from drillfem.ensemble.run import Standing


class EnsembleProgress(LiveLine):
    """Progress over all ranks, to be called with a `Standing`."""

    def __call__(self, now: Standing) -> None:
        """Show how far it is."""
        if self.due():
            self.say(now.stored / now.count, progress_line(now))


def progress_line(now: Standing) -> str:
    """``137 of 1000 members, 2 failed, 3.41 members/s on 2 ranks, 4:13 left``."""
    text = f"{now.stored} of {now.count} members"
    if now.failed:
        text += f", {now.failed} failed"
    if now.computed and now.seconds > 0:
        pace = now.computed / now.seconds
        text += f", {pace:.3g} members/s on {now.ranks} rank{'s' * (now.ranks > 1)}"
        if now.count > now.stored:
            text += f", {clock((now.count - now.stored) / pace)} left"
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
    tolerance: float | None,
    quantity: str | None,
) -> None:
    """The command ``drillfem ensemble``. Raises SceneError, SimulationError (no member is done), KeyboardInterrupt."""
    from drillfem.ensemble.run import ensemble, world

    comm = world()
    if comm is not None and comm.rank:
        _follow(lambda: ensemble(scene, count, out, comm=comm))
        return
    start, ranks = time.perf_counter(), 1 if comm is None else comm.size
    latest: list[Standing] = []
    with EnsembleProgress() as progress:

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
            tolerance=tolerance,
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
