"""`drillfem statistics`, `drillfem multilevel`, `drillfem sensitivity`: tables, pictures and numbers."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from drillfem.ensemble.inputs import Inputs
from drillfem.ensemble.member import Worker
from drillfem.ensemble.multilevel import REFINED, Multilevel, level_scenes
from drillfem.ensemble.multilevel import multilevel as run_levels
from drillfem.ensemble.sensitivity import Indices
from drillfem.ensemble.sensitivity import sensitivity as find_indices
from drillfem.ensemble.statistics import FIRST, Estimate, Statistics, needed, of, quantities, replicated
from drillfem.errors import SceneError, SimulationError
from drillfem.scene import Scene

F8 = npt.NDArray[np.float64]
log = logging.getLogger("drillfem.ensemble")

#: Named failures in a table; the rest is in the JSON.
_NAMED = 5
#: Tolerances that a table says the numbers of members for.
_TOLERANCES = (0.05, 0.01)


# -- running members --------------------------------------------------------------------------------------------------
class Members:
    """Runs members of some scenes that have the same random inputs, such as the levels of one, and takes a number.

    quantity: of `drillfem.ensemble.member.numbers`. jobs: how many members at a time, each in a process of its own (the
    calling script must then be guarded by ``if __name__ == "__main__"``). A context manager.
    """

    def __init__(self, scenes: Sequence[Scene], quantity: str, jobs: int = 1) -> None:
        if jobs < 1:
            raise SceneError(f"jobs = {jobs}: must be a whole number >= 1")
        self.inputs = [Inputs.of(scene) for scene in scenes]
        self.quantity, self.jobs = quantity, jobs
        self.reasons: list[str] = []

    @contextmanager
    def ready(self) -> Iterator[Members]:
        """Set up, compile, and start processes; they end with the block."""
        self._local = _Local(self.inputs, self.quantity)
        self._pool = None
        if self.jobs == 1:
            yield self
            return
        from concurrent.futures import ProcessPoolExecutor
        from multiprocessing import get_context

        from drillfem.sweep import single_threaded

        with (
            single_threaded(),
            ProcessPoolExecutor(self.jobs, get_context("spawn"), _prepare, (self.inputs, self.quantity)) as pool,
        ):
            self._pool = pool
            yield self

    def __call__(self, level: int, points: F8) -> tuple[F8, F8]:
        """Values (n,) of points (n, dimension), nan of what failed, and processor seconds (n,). Raises SceneError.

        That is where all of them fail: the first reason says why.
        """
        if self._pool is None:
            found = [self._local.run(level, u) for u in points]
        else:
            found = list(self._pool.map(_run, [level] * len(points), points))
        reasons = [reason for _, _, reason in found if reason]
        self.reasons += reasons
        if len(points) and len(reasons) == len(points):
            raise SceneError(f"all of {len(points)} members failed; the first: {reasons[0]}")
        return np.array([value for value, _, _ in found]), np.array([seconds for _, seconds, _ in found])


class _Local:
    """What runs members in this process."""

    def __init__(self, inputs: Sequence[Inputs], quantity: str) -> None:
        self.inputs, self.quantity = inputs, quantity
        self.workers: dict[int, Worker] = {}

    def run(self, level: int, u: F8) -> tuple[float, float, str]:
        if level not in self.workers:
            # kernels are compiled before the clock starts
            self.workers[level] = Worker(self.inputs[level].middle)
        start = time.process_time()
        try:
            numbers = self.workers[level].run(self.inputs[level].member(u).scene)
        except (SceneError, SimulationError) as error:
            return math.nan, time.process_time() - start, " ".join(str(error).split())
        value, reason = numbers.get(self.quantity, math.nan), ""
        if math.isnan(value):
            reason = f"quantity {self.quantity!r}: must be one of {', '.join(numbers)}"
        return value, time.process_time() - start, reason


_here: _Local


def _prepare(inputs: Sequence[Inputs], quantity: str) -> None:
    global _here
    _here = _Local(inputs, quantity)


def _run(level: int, u: F8) -> tuple[float, float, str]:
    return _here.run(level, u)


def default_quantity(scene: Scene) -> str:
    """What an ensemble of a scene is about unless told: power ratio, or drilled depth. Raises SceneError."""
    kind = None if scene.bit is None else scene.bit.kind
    if kind not in ("saturating", "cutting"):
        raise SceneError("--quantity: must be given for a scene that does not drill, such as bit_angle")
    return FIRST if kind == "saturating" else "drilled_depth"


# -- statistics -------------------------------------------------------------------------------------------------------
def statistics(folders: Sequence[Path], names: Sequence[str] = ()) -> list[Statistics]:
    """Tables of quantities of an ensemble, and pictures and statistics.json into its folder. Raises SceneError.

    folders: more than one are ensembles of one scene and one way of sampling that differ in their seed: the error of
    the mean is then taken from the differences between them, and the rest from the first.
    """
    from drillfem.ensemble import drawing
    from drillfem.ensemble.store import read
    from drillfem.results.atomic import write_json

    sets = [read(folder) for folder in folders]
    data, folder = sets[0], folders[0]
    _check_replicas(sets, folders)
    if not data.sizes["member"]:
        raise SceneError(f"{folder}: no member has ended yet")
    known = quantities(data)
    chosen = list(names) or [next((n for n in (FIRST, "drilled_depth") if n in known), *known[:1])]
    found = [of(data, name) for name in chosen]
    told: dict[str, Any] = {}
    pictures = []
    for one in found:
        means = [of(other, one.name).mean.value for other in sets] if len(sets) > 1 else []
        rows = table(one)
        told[one.name] = one.to_dict()
        if means:
            both = replicated(means)
            rows.append((f"mean of {len(means)} randomisations", f"{both} {_unit(one.unit)}".rstrip()))
            told[one.name]["randomisations"] = {"means": means} | vars(both)
        _print(rows)
        if len(one.values) > 1:
            pictures.append(drawing.convergence(folder / f"{one.name}-convergence.png", one))
        if one.density is not None:
            pictures.append(drawing.pdf(folder / f"{one.name}-density.png", one))
    for variable in data.data_vars.values():
        name = str(variable.name)
        if name.startswith(("history_", "field_")) and np.isfinite(variable.values).any():
            axis = variable.dims[1]
            values = variable.values[np.isfinite(variable.values).any(axis=1)].astype(np.float64)
            across = "time, s" if axis == "time" else "measured depth, m"
            what, unit = name.partition("_")[2], str(variable.attrs.get("units", "1"))
            where = folder / f"{name}-realisations.png"
            pictures.append(drawing.realisations(where, data[axis].values, values, what, unit, across))
    write_json(folder / "statistics.json", told)
    for path in (*pictures, folder / "statistics.json"):
        print(path)
    return found


def table(found: Statistics) -> list[tuple[str, str]]:
    """What an ensemble says about a quantity, as (label, text)."""
    from drillfem.ensemble.drawing import words

    unit = _unit(found.unit)

    def said(x: Estimate) -> str:
        return str(x).replace(" (", f" {unit} (" if unit else " (")

    n, gone = len(found.values), len(found.failed)
    rows = [(words(found.name), "with 95 % intervals")]
    rows.append(("members", f"{n} of {n + gone}{f', {gone} failed' if gone else ''}; sampling: {found.method}"))
    if found.awaited:
        rows.append(("", f"{found.awaited} more have ended, but not all before them: they do not count yet"))
    for i, reason in list(found.failed.items())[:_NAMED]:
        rows.append((f"  member {i}", reason))
    if gone > _NAMED:
        rows.append(("", f"and {gone - _NAMED} more"))
    rows.append(("mean", f"{said(found.mean)}, standard error {found.mean.error:.2g}"))
    rows.append(("standard deviation", said(found.standard_deviation)))
    rows += [(f"{100 * p:g} % quantile", said(q)) for p, q in found.quantiles.items()]
    if found.density is not None:
        rows.append(("bandwidth of the density", f"{found.density.bandwidth:.3g} {unit}".rstrip()))
    if found.heavy_tailed:
        rows.append(("heavy tail", "a few members make the spread: the intervals of mean and standard deviation hold"))
        rows.append(("", "less often than in 95 %; those of quantiles hold"))
    if gone:
        share = f"{100 * found.failed_share:.2g} %"
        rows.append(("failed members", f"{share} of all: they may have had any value, which the quantiles allow for;"))
        rows.append(("", "mean, standard deviation and density are those of the others"))
    if n > 1 and found.mean.value:
        counts = "; ".join(f"{100 * t:g} %: {needed(found.values, t)} members" for t in _TOLERANCES)
        rows.append(("enough for the mean within", counts))
    if found.method != "monte-carlo":
        rows.append(
            ("", f"{found.method}: members are more even than chance, so the interval of the mean is too wide;")
        )
        rows.append(("", "name folders with other seeds as well, and it is taken from their differences"))
    return rows


def share(text: str | None, option: str = "--tolerance") -> float | None:
    """A tolerance such as ``0.05`` or ``5%``. Raises SceneError."""
    if text is None:
        return None
    try:
        value = float(text.strip().removesuffix("%")) * (0.01 if text.strip().endswith("%") else 1.0)
    except ValueError:
        value = math.nan
    if not 0 < value < 1:
        raise SceneError(f"{option} {text!r}: must be more than 0 and less than 1, such as 0.05 or 5%")
    return value


def _check_replicas(sets: Sequence[Any], folders: Sequence[Path]) -> None:
    for other, folder in zip(sets[1:], folders[1:], strict=True):
        for key in ("scene", "method"):
            if other.attrs[key] != sets[0].attrs[key]:
                raise SceneError(f"{folder}: has another {key} than {folders[0]}")
        if other.sizes["member"] != sets[0].sizes["member"]:
            raise SceneError(f"{folder}: has {other.sizes['member']} members, {folders[0]} {sets[0].sizes['member']}")
    if len({one.attrs["seed"] for one in sets}) < len(sets):
        raise SceneError("two of the folders have the same seed: they are no independent randomisations")


# -- levels -----------------------------------------------------------------------------------------------------------
def multilevel(
    scene: Scene,
    out: Path,
    levels: int = 4,
    pilot: int = 40,
    tolerance: float | None = None,
    quantity: str | None = None,
    refined: Sequence[str] = (),
    seed: int = 0,
    jobs: int = 1,
) -> Multilevel:
    """Levels of a scene, their slopes and a verdict, into the new folder ``out``. Raises SceneError."""
    from drillfem.ensemble import drawing
    from drillfem.ensemble.drawing import words
    from drillfem.results import check_new_folder
    from drillfem.results.atomic import write_json

    check_new_folder(out)
    name = quantity or default_quantity(scene)
    scenes = level_scenes(scene, levels, refined or REFINED)
    members = Members(scenes, name, jobs)
    with members.ready() as run:
        found = run_levels(run, members.inputs[0].dimension, levels, seed, pilot, tolerance)
    verdict = found.verdict(tolerance or _TOLERANCES[-1])
    _print(level_table(found, name) + _reasons(members))
    print(f"verdict: {verdict}")
    out.mkdir(parents=True, exist_ok=True)
    facts: dict[str, Any] = {"quantity": name, "seed": seed, "tolerance": tolerance, "verdict": verdict}
    write_json(out / "multilevel.json", facts | found.to_dict() | {"failures": members.reasons})
    (out / "scene.toml").write_text(scene.to_toml(), encoding="utf-8")
    print(drawing.levels(out / "multilevel.png", found, words(name), verdict))
    print(out / "multilevel.json")
    return found


def level_table(found: Multilevel, name: str) -> list[tuple[str, str]]:
    """What the levels say, as (label, text)."""
    from drillfem.ensemble.drawing import words

    rows = [(words(name), "pairs     mean of difference   variance of it   correlation   seconds   departure")]
    for k, p in enumerate(found.pairs):
        extra = (
            f"{found.correlations[k - 1]:11.4f} {found.costs[k]:9.3g} {found.departures[k - 1]:+9.2f}"
            if k
            else f"{'':11} {found.costs[k]:9.3g}"
        )
        failed = f"  {p.failed} failed" if p.failed else ""
        rows.append(
            (f"level {k}", f"{len(p.fine):5d} {found.means[k]:20.5g} {found.variances[k]:16.3g}   {extra}{failed}")
        )
    for label, slope in (("alpha", found.alpha), ("beta", found.beta), ("gamma", found.gamma), ("gain", found.gain)):
        rows.append((label, f"{slope.value:.2f} ({slope.low:.2f} to {slope.high:.2f})"))
    rows.append(("mean on the finest level", f"{found.mean}, what finer ones would add: {found.bias:.2g}"))
    return rows


# -- sensitivity ------------------------------------------------------------------------------------------------------
def sensitivity(
    scene: Scene,
    out: Path,
    count: int = 64,
    quantity: str | None = None,
    terms: bool = False,
    seed: int = 0,
    jobs: int = 1,
) -> Indices:
    """Sobol' indices of the random inputs of a scene, into the new folder ``out``. Raises SceneError.

    terms: an index for every term of a field, rather than one for the field.
    """
    from drillfem.ensemble import drawing
    from drillfem.ensemble.drawing import words
    from drillfem.results import check_new_folder
    from drillfem.results.atomic import write_json

    check_new_folder(out)
    name = quantity or default_quantity(scene)
    members = Members([scene], name, jobs)
    inputs = members.inputs[0]
    groups = None if terms else [key for key, _ in inputs.order]
    with members.ready() as run:

        def values(points: F8) -> F8:
            log.info("%d members", len(points))
            return run(0, points)[0]

        found = find_indices(values, inputs.names, count, seed, groups)
    rows = [(words(name), f"{found.evaluations} members, {found.failed} failed; mean {found.mean:.4g}")]
    rows += [(key, f"first order {found.first[key]}, total {x}") for key, x in found.total.items()]
    rows.append(("together", f"{100 * found.together:.0f} % of the variance is of no input alone"))
    _print(rows + _reasons(members))
    out.mkdir(parents=True, exist_ok=True)
    facts = {"quantity": name, "seed": seed, "inputs": inputs.facts}
    write_json(out / "sensitivity.json", facts | found.to_dict() | {"failures": members.reasons})
    (out / "scene.toml").write_text(scene.to_toml(), encoding="utf-8")
    print(drawing.sensitivities(out / "sensitivity.png", found, name))
    print(out / "sensitivity.json")
    return found


def _reasons(members: Members) -> list[tuple[str, str]]:
    rows = [("failed" if k == 0 else "", reason) for k, reason in enumerate(members.reasons[:_NAMED])]
    more = len(members.reasons) - _NAMED
    return [*rows, *([("", f"and {more} more")] if more > 0 else [])]


def _print(rows: Sequence[tuple[str, str]]) -> None:
    width = max(len(label) for label, _ in rows)
    for label, text in rows:
        print(f"{label:{width}}  {text}".rstrip())


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit
