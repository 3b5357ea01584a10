"""Run the cases, judge every claim, find by experiment what explains a difference."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from drillfem.errors import DrillfemError, SceneError
from drillfem.scene import Scene, load_scene

from . import appendix_b, chapter4, chapter5, chapter6, chapter7
from .claims import Case, Claim, Experiment, Run, Value, Variation
from .imitation import Numerics, imitate
from .signals import Signals

if TYPE_CHECKING:
    import xarray as xr

CASES: tuple[Case, ...] = (
    *chapter4.CASES,
    *chapter5.CASES,
    *chapter6.CASES,
    *chapter7.CASES,
    *appendix_b.CASES,
)
"""What is compared if nothing is named, in the order of the thesis."""

LONG: tuple[Case, ...] = chapter6.LONG
"""What is compared by name, or with ``all``, only."""

IMITATION = Numerics()
"""What the column *imitated* is computed with: BDF2 at 1 ms, 64 linear SUPG elements for the rock."""

AGREES, RESOLUTION, SCATTER, DIFFERS = "agrees", "agrees within resolution", "agrees within scatter", "differs"
MISSING, TRUE, FALSE, INFO = "not found", "as stated", "not as stated", "for information"
GOOD = (AGREES, RESOLUTION, SCATTER, TRUE)
BAD = (DIFFERS, MISSING, FALSE)

Progress = Callable[[str], None]


def judge(claim: Claim, value: Value, scatter: tuple[float, float] | None = None) -> str:
    """The verdict on one of our values: by tolerance, by what print resolves, by what nearby starts give."""
    if not claim.verdict:
        return INFO
    if value.number is None:
        return MISSING
    if isinstance(claim.published, str):
        return TRUE if value.number else FALSE
    apart = abs(value.number - claim.published)
    if apart <= claim.tolerance * abs(claim.published):
        return AGREES
    if apart <= claim.resolution:
        return RESOLUTION
    if scatter is not None and scatter[0] - claim.resolution <= claim.published <= scatter[1] + claim.resolution:
        return SCATTER
    return DIFFERS


@dataclass(frozen=True)
class Row:
    """A claim with ours. ``scatter``: what nearby starts give, where it was asked. ``reason``: of a difference."""

    claim: Claim
    value: Value
    verdict: str
    reason: str = ""
    scatter: tuple[float, float] | None = None
    imitated: Value | None = None

    @property
    def ratio(self) -> float | None:
        """Ours over print."""
        return ratio(self.claim, self.value)


@dataclass(frozen=True)
class Table:
    """An experiment: its claims, and for each variation (label, values; None where it is not applied, verdicts)."""

    experiment: Experiment
    claims: tuple[Claim, ...]
    rows: tuple[tuple[str, tuple[Value | None, ...]], ...]


@dataclass(frozen=True)
class Report:
    """A case compared."""

    case: Case
    rows: tuple[Row, ...]
    tables: tuple[Table, ...]
    seconds: float


def ratio(claim: Claim, value: Value) -> float | None:
    """Ours over print; None for statements and where there is nothing."""
    if value.number is None or isinstance(claim.published, str) or not claim.published:
        return None
    return value.number / claim.published


class Studio:
    """Simulates what is asked for, once. ``out``: where the histories of the runs as shipped are kept."""

    def __init__(self, out: Path | None = None, tell: Progress | None = None) -> None:
        self.out, self.tell = out, tell or (lambda text: None)
        self._done: dict[Any, Signals] = {}

    def forget(self) -> None:
        """Drop what was simulated."""
        self._done.clear()

    def signals(self, run: Run, variation: Variation | None, folder: str) -> Signals:
        """The signals of a run, under a variation if there is one. Raises DrillfemError."""
        v = variation or Variation("")
        changes = {**run.changes, **v.changes}
        until = v.until or run.until
        key = (run.scene, repr(sorted(changes.items())), until, v.numerics)
        if key not in self._done:
            self.tell(f"{folder}: {v.label}" if v.label else folder)
            scene = load_scene(run.scene, changes)
            start = time.perf_counter()
            out = self.out / folder if self.out and variation is None else None
            # what is changed may be made to be wrong; a scene as shipped may well be warned about
            history, fields = self._run(scene, v, until, out, warn=variation is None and not run.changes)
            self._done[key] = Signals.of(scene, history, time.perf_counter() - start, fields)
        return self._done[key].read_as(v.reading)

    def _run(
        self, scene: Scene, variation: Variation, until: float | None, out: Path | None, warn: bool
    ) -> tuple[xr.Dataset, xr.Dataset | None]:
        if variation.numerics is not None:
            return imitate(scene, variation.numerics, until), None
        from drillfem.solve import simulate

        result = simulate(scene, out=out, until=until, warn=warn)
        return result.history, result.fields


class Family:
    """The runs of a case under a variation, simulated when they are looked up."""

    def __init__(self, case: Case, studio: Studio, variation: Variation | None = None) -> None:
        self.case, self.studio, self.variation = case, studio, variation
        self._read: dict[str, Signals] = {}

    def varies(self, name: str) -> bool:
        """Whether the variation is applied to a run."""
        return self.variation is None or not self.variation.runs or name in self.variation.runs

    def __getitem__(self, name: str) -> Signals:
        if name not in self._read:
            variation = self.variation if self.varies(name) else None
            folder = f"{self.case.name}/{name}".replace(", ", "-").replace(" ", "")
            self._read[name] = self.studio.signals(self.case.runs[name], variation, folder)
        return self._read[name]

    def scene(self, name: str) -> Scene:
        """The scene of a run."""
        run, varied = self.case.runs[name], self.variation if self.varies(name) else None
        return load_scene(run.scene, {**run.changes, **(varied.changes if varied else {})})

    def value(self, claim: Claim) -> Value | None:
        """Ours; None where the variation is not applied to what the claim needs. A run that fails is no value."""
        if claim.needs and not any(self.varies(name) for name in claim.needs):
            return None
        try:
            return claim.measure(self)
        except DrillfemError as error:
            return Value(None, f"fails: {error}")


def find_cases(names: Iterable[str]) -> list[Case]:
    """Cases by their names or those of their scenes, in small letters or capitals; `CASES` if none is named.

    ``all``: with the `LONG` ones. Raises SceneError.
    """
    every = (*CASES, *LONG)
    by_name = {name.lower(): case for case in every for name in (case.name, *case.aliases)}
    found: list[Case] = []
    for name in names:
        if name.lower() not in (*by_name, "all"):
            known = ", ".join(f"{case.name} ({case.aliases[0]})" for case in every)
            raise SceneError(f"case {name!r}: must be one of {known}, all")
        for case in every if name.lower() == "all" else (by_name[name.lower()],):
            if case not in found:
                found.append(case)
    return found or list(CASES)


def compare(case: Case, studio: Studio, imitated: bool = False, brief: bool = False) -> Report:
    """Compare a case with print.

    imitated: compute the runs a second time with the thesis' numerics. brief: leave the experiments out. Raises
    DrillfemError where a run as shipped fails.
    """
    start = time.perf_counter()
    shipped = Family(case, studio)
    # the runs of 1000 s would take a minute and tell nothing that the others do not
    short = tuple(
        name for name, run in case.runs.items() if (run.until or 0.0) < 500.0 and shipped.scene(name).condensable
    )
    imitation = Variation("imitated", _thesis_mesh(case), IMITATION, runs=short)
    as_printed = Family(case, studio, imitation) if imitated and short else None
    values = [claim.measure(shipped) for claim in case.claims]
    other = [as_printed.value(claim) if as_printed and claim.needs else None for claim in case.claims]
    nearby = [] if brief else [Family(case, studio, Variation(f"start {i}", c)) for i, c in enumerate(case.nearby, 1)]
    trials = [
        (variation, Family(case, studio, variation))
        for experiment in ([] if brief else case.experiments)
        for variation in experiment.variations
        if experiment.explains
    ]
    rows = []
    for claim, value, mine in zip(case.claims, values, other, strict=True):
        verdict, scatter, reason = judge(claim, value), None, claim.because
        if verdict in BAD and claim.needs:
            if isinstance(claim.published, float):
                numbers = [v.number for f in nearby if (v := f.value(claim)) is not None and v.number is not None]
                if numbers:
                    all_of_them = [*numbers, *([value.number] if value.number is not None else [])]
                    scatter = min(all_of_them), max(all_of_them)
                    verdict = judge(claim, value, scatter)
            else:
                truths = [bool(v.number) for f in nearby if (v := f.value(claim)) is not None and v.number is not None]
                if any(truths):
                    verdict, reason = SCATTER, f"{sum(truths)} of {len(truths)} nearby starts: as stated"
            if verdict in BAD:
                # a statement about the whole run is not to be rescued by looking at less of it
                tried = [(v, f) for v, f in trials if isinstance(claim.published, float) or v.reading.window is None]
                # the mildest explanation first: the same run, read in another way
                tried.sort(key=lambda pair: bool(pair[0].changes or pair[0].numerics))
                found = [(v.label, x) for v, f in tried if (x := f.value(claim)) is not None]
                reason = ". ".join(filter(None, (reason, _explanation(claim, value, found))))
        rows.append(Row(claim, value, verdict, reason, scatter, mine))
    tables = [] if brief else [_table(case, experiment, studio) for experiment in case.experiments]
    return Report(case, tuple(rows), tuple(tables), time.perf_counter() - start)


def _explanation(claim: Claim, value: Value, found: list[tuple[str, Value]]) -> str:
    """Which variations give the printed value; else the one that comes clearly nearer, or the one beyond print."""
    agreeing = dict.fromkeys(label for label, x in found if judge(claim, x) in GOOD)
    if agreeing:
        return "as printed with: " + "; ".join(agreeing)

    def far(x: Value) -> float:
        share = ratio(claim, x)
        return math.inf if share is None or share <= 0 else abs(math.log(share))

    label, best = min(found, key=lambda pair: far(pair[1]), default=("", value))
    if far(best) < 0.8 * far(value):
        return f"nearest with {label}: ratio {ratio(claim, best):.2f}"
    ours = ratio(claim, value)
    across = [
        (label, x)
        for label, x in found
        if ours and (share := ratio(claim, x)) and 0 < share and (ours > 1) != (share > 1)
    ]
    label, other = min(across, key=lambda pair: far(pair[1]), default=("", value))
    return f"between ours and that with {label}: ratio {ratio(claim, other):.2f}" if across else ""


def _table(case: Case, experiment: Experiment, studio: Studio) -> Table:
    by_key = {claim.key: claim for claim in case.claims}
    claims = tuple(by_key[key] for key in experiment.show)
    rows: list[tuple[str, tuple[Value | None, ...]]] = [
        ("as shipped", tuple(Family(case, studio).value(c) for c in claims))
    ]
    for variation in experiment.variations:
        family = Family(case, studio, variation)
        rows.append((variation.label, tuple(family.value(claim) for claim in claims)))
    return Table(experiment, claims, tuple(rows))


def _thesis_mesh(case: Case) -> dict[str, Any]:
    """64 quadratic elements in chapter 5, cubic ones in chapter 6, which is what the scenes have."""
    return {} if case.name.startswith("6-") else dict(chapter5.THESIS_MESH)


def reproduce(
    names: Iterable[str] = (),
    out: Path | None = None,
    imitated: bool = False,
    brief: bool = False,
    progress: Progress | None = None,
) -> list[Report]:
    """Compare cases (all by default) with print; with ``out``, a new folder, keep histories and ``reproduction.json``.

    Raises SceneError for an unknown case or a folder that is not empty.
    """
    from .page import to_json

    cases = find_cases(names)
    if out is not None:
        if out.exists() and (not out.is_dir() or any(out.iterdir())):
            raise SceneError(f"--out {out}: must be a new or an empty folder")
        out.mkdir(parents=True, exist_ok=True)
    reports = []
    for case in cases:
        studio = Studio(out, progress)
        reports.append(compare(case, studio, imitated, brief))
        studio.forget()
    if out is not None:
        from drillfem.results.atomic import write_json

        write_json(out / "reproduction.json", to_json(reports))
    return reports
