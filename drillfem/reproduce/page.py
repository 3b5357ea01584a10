"""The comparison on screen (rich), as a page (Markdown) and as data (JSON)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table as RichTable

from .claims import Claim, Value
from .compare import AGREES, BAD, CASES, GOOD, IMITATION, INFO, Report, Row, Table, judge, ratio

HEADER = ("quantity", "published", "ours", "ratio", "verdict", "reason")
COLOURS = {**dict.fromkeys(GOOD, "green"), **dict.fromkeys(BAD, "red"), INFO: "dim"}


def number(claim: Claim, value: float | None) -> str:
    """A value as printed."""
    return "-" if value is None else f"{value:.{claim.digits}g}"


def published(claim: Claim) -> str:
    """What print has, with its unit."""
    return "stated" if isinstance(claim.published, str) else f"{claim.published:g} {claim.unit}".strip()


def what(claim: Claim) -> str:
    """The quantity, or the statement and the runs that it is about."""
    return f"{claim.what}: {claim.published}" if isinstance(claim.published, str) else claim.what


def ours(claim: Claim, value: Value | None) -> str:
    """Ours, with what else is worth a word; for statements yes or no."""
    if value is None:
        return ""
    if value.number is None:
        return f"- {value.text}".strip()
    if isinstance(claim.published, str):
        return f"{'yes' if value.number else 'no'}: {value.text}" if value.text else "yes" if value.number else "no"
    text = number(claim, value.number)
    return f"{text} ({value.text})" if value.text else text


def _cells(row: Row, imitated: bool) -> list[str]:
    claim = row.claim
    share = "" if row.ratio is None else f"{row.ratio:.3f}"
    reason = row.reason
    if row.scatter is not None:
        low, high = (number(claim, x) for x in row.scatter)
        reason = ". ".join(filter(None, (f"nearby starts: {low} to {high}", reason)))
    cells = [f"{what(claim)} [{claim.source}]", published(claim), ours(claim, row.value), share, row.verdict, reason]
    if imitated:
        mine = row.imitated
        # amplitudes and truths of a second run would only repeat the column
        plain = None if mine is None else Value(mine.number, "")
        cells.insert(5, "" if plain is None else ours(claim, plain))
    return cells


def _header(imitated: bool) -> list[str]:
    header = list(HEADER)
    if imitated:
        header.insert(5, "imitated")
    return header


def count(rows: Iterable[Row]) -> str:
    """How many agree."""
    judged = [row for row in rows if row.verdict != INFO]
    good = sum(row.verdict in GOOD for row in judged)
    exact = sum(row.verdict == AGREES for row in judged)
    return f"{good} of {len(judged)} agree or are as stated, {exact} of them numbers within their tolerance"


def _cell(claim: Claim, value: Value | None) -> str:
    """A cell of an experiment: the value, its ratio to print or whether it is as stated."""
    if value is None:
        return ""
    if value.number is None:
        return value.text.split(",")[0] if value.text.startswith("fails") else "-"
    if isinstance(claim.published, str):
        return f"{'yes' if value.number else 'no'} ({value.text})" if value.text else "yes" if value.number else "no"
    share = ratio(claim, value)
    mark = " ✓" if judge(claim, value) in GOOD else ""
    return f"{number(claim, value.number)} ({share:.3f}){mark}" if share is not None else number(claim, value.number)


# -- Markdown ---------------------------------------------------------------------------------------------------------
def _markdown(header: Sequence[str], rows: Iterable[Sequence[str]], right: Iterable[int] = ()) -> str:
    at = set(right)
    ruler = ["---:" if i in at else "---" for i in range(len(header))]
    lines = [header, ruler, *([cell.replace("|", "\\|") for cell in row] for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _experiment(table: Table) -> str:
    header = ["", *(what(c) for c in table.claims)]
    rows = [["*published*", *(published(c) for c in table.claims)]]
    rows += [[label, *(_cell(c, v) for c, v in zip(table.claims, values, strict=True))] for label, values in table.rows]
    return f"**{table.experiment.title}.** {table.experiment.answer}\n\n" + _markdown(
        header, rows, range(1, len(header))
    )


FINDINGS = """What comes out:

- Six blades, and 1.2 mm of wear flat in all: of 1 to 8 blades no other number gives 8.7 Hz (C2), of 4 to 8 no other
  gives 13.09 Hz (6-C1).
- The spring of tables 5.1 and 6.1 is half of the one that the results have (V1).
- The printed wear-flat torque, without the sign of the spin, runs away (C2) and cannot give the torque that changes
  sign (C1).
- E, which is not printed, is 207 to 210 GPa (6-C1); G_2 was 77 GPa, not 0 (V2).
- With accurate numerics the published main frequencies and mean torques of chapter 5 come out within 1 % (or the last
  printed digit) and 2 %.
- What hangs on the thesis' mesh and backward differences: the strong side lines at 60 to 80 s (V2), that the bit never
  turns back in C2-B, the last 0.03 Hz and 50 N m of C2-A, and the mixture of lines that lasts at 1e-5 s (6-C1). The
  first-order formula, or large steps, would have hidden the thesis' main finding, 7.40 Hz (C1).
- Chapter 4 comes out as stated, with 60 deg for the inclination that is in a figure: rod and soft string agree when
  they swing steadily, if both take the speed of the touching point for their friction (4-startup). The calibration
  returns what is put in (4-contact).
- C2 of chapter 6 drills 1.3 % less than print, which lies above the nominal rate for no reason that we found; all else
  is as stated, but only with a mud that drags on the string: without it the string whirls and nothing is drilled
  (6-C2-stages, 6-C2).
- "100 times" of chapter 7 is what a clearance of about 30 mm gives, with friction as printed; the clearance is not
  printed, and between 2 and 100 mm any ratio from 2 to 200 can be had. With the printed sign of the bit's force in A
  alone it is 700 and more (7).
- What hangs on chance, so that print is one of several outcomes: which line leads at alpha = 0.8 (V2), and which
  vibration wins at 1e-5 s (6-C1)."""


def markdown(reports: Sequence[Report], imitated: bool, command: str) -> str:
    """The page docs/reproduction.md."""
    rows = [row for report in reports for row in report.rows]
    about = f"""# The thesis' numbers beside ours

Written by `{command}`.

Every number and statement that H. Goicoechea Manuel's thesis prints about chapter 4 (CR the rod, R the soft string),
chapter 5 (lumped model M1 or A, torsional model M2 or B), chapter 6 (M3), chapter 7 (its deterministic part) and
appendix B.1.4, with ours, computed as the scenes are shipped. {count(rows)}.

*Agrees*: within 1 % (frequencies), 2 % (torques, depths, dimensionless numbers), 10 % (amplitudes). *Within
resolution*: within half a line of the spectrum that print was read from. *Within scatter*: print lies in the range of
four starts that differ by a thousandth. For what differs, the reason names the experiments below that give
the printed value: they are run by the same command. Lines are tops of Hann-windowed, padded spectra. Where the source
is a formula, print is what the thesis' own equations come to."""
    if imitated:
        about += (
            f" *Imitated*: the same runs with numerics like the thesis': BDF2 for string and rock (here at "
            f"{1e3 * IMITATION.step:g} ms; its steps are not printed), {IMITATION.elements} linear SUPG elements for "
            "the rock, and in chapter 5 its 64 quadratic elements for the string; straight strings only."
        )
    parts = [about, FINDINGS] if len(reports) >= len(CASES) else [about]
    for report in reports:
        table = _markdown(_header(imitated), (_cells(row, imitated) for row in report.rows), (1, 3))
        parts.append(f"## {report.case.title}\n\n{report.case.text}\n\n{table}\n\n{count(report.rows)}.")
        if report.tables:
            parts.append("In the experiments, brackets hold the ratio to print; ✓ marks what agrees with it.")
        parts += [_experiment(t) for t in report.tables]
    return "\n\n".join(parts) + "\n"


# -- screen -----------------------------------------------------------------------------------------------------------
def show(report: Report, imitated: bool, console: Console | None = None) -> None:
    """Print a case."""
    console = console or Console(highlight=False)
    if not console.is_terminal:
        console = Console(file=console.file, highlight=False, width=200, color_system=None)
    title = f"{report.case.title} ({report.seconds:.0f} s)"
    table = RichTable(title=escape(title), title_justify="left", title_style="bold", box=box.SIMPLE, pad_edge=False)
    for i, name in enumerate(_header(imitated)):
        table.add_column(name, justify="right" if name in ("published", "ratio") else "left", no_wrap=i == 3)
    for row in report.rows:
        cells = [escape(cell) for cell in _cells(row, imitated)]
        cells[4] = f"[{COLOURS[row.verdict]}]{cells[4]}[/]"
        table.add_row(*cells)
    console.print(table)
    console.print(count(report.rows))
    for found in report.tables:
        heading = RichTable(
            title=escape(found.experiment.title),
            title_justify="left",
            title_style="bold",
            box=box.SIMPLE,
            pad_edge=False,
        )
        for name in ("", *(what(c) for c in found.claims)):
            heading.add_column(escape(name), justify="right" if name else "left")
        heading.add_row("published", *(escape(published(c)) for c in found.claims))
        for label, values in found.rows:
            heading.add_row(escape(label), *(escape(_cell(c, v)) for c, v in zip(found.claims, values, strict=True)))
        console.print(heading)
        console.print(found.experiment.answer, markup=False, soft_wrap=True)
        console.print()


# -- JSON -------------------------------------------------------------------------------------------------------------
def to_json(reports: Sequence[Report]) -> dict[str, Any]:
    """Everything, as plain data."""

    def of(value: Value | None) -> dict[str, Any] | None:
        return None if value is None else {"number": value.number, "text": value.text}

    def case(report: Report) -> dict[str, Any]:
        rows = [
            {
                "key": row.claim.key,
                "quantity": row.claim.what,
                "source": row.claim.source,
                "published": row.claim.published,
                "unit": row.claim.unit,
                "ours": of(row.value),
                "ratio": row.ratio,
                "tolerance": row.claim.tolerance,
                "resolution": row.claim.resolution,
                "verdict": row.verdict,
                "scatter": row.scatter,
                "reason": row.reason,
                "imitated": of(row.imitated),
            }
            for row in report.rows
        ]
        tables = [
            {
                "title": t.experiment.title,
                "answer": t.experiment.answer,
                "claims": [c.key for c in t.claims],
                "rows": [{"variation": label, "values": [of(v) for v in values]} for label, values in t.rows],
            }
            for t in report.tables
        ]
        return {"title": report.case.title, "seconds": report.seconds, "claims": rows, "experiments": tables}

    return {report.case.name: case(report) for report in reports}
