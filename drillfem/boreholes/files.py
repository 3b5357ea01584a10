"""Surveys, caliper logs and friction profiles from text files: columns by name, units from the header or the numbers.

Separators: comma, semicolon, tab, bar or blanks. Lines that are empty or start with #, //, !, % or ~ are passed over.
Names of columns are those in use; a unit may follow the name (``MD (ft)``, ``INCL_DEG``, ``Depth [m]``) or stand in a
line of its own below the names. Whatever does not fit ends in one SceneError with file, line, column and what is
allowed.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import SceneError
from .table import F8

LENGTH = {
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres", "mtr"), 1.0),
    **dict.fromkeys(("ft", "feet", "foot"), 0.3048),
    **dict.fromkeys(("usft", "ftus"), 1200 / 3937),
    **dict.fromkeys(("in", "inch", "inches"), 0.0254),
    "cm": 0.01,
    "mm": 0.001,
}
ANGLE = {
    **dict.fromkeys(("deg", "degs", "degree", "degrees", "dega", "\N{DEGREE SIGN}"), math.pi / 180),
    **dict.fromkeys(("rad", "rads", "radian", "radians"), 1.0),
}
NUMBER: dict[str, float] = {}
#: What may stand behind a name, or in its brackets, and is no unit: where depth and azimuth are counted from.
_DATUMS = ("rkb", "rt", "kb", "msl", "ahd", "tn", "gn", "mn", "t", "true", "grid", "magnetic")
_WORD = "[^\\W\\d_]+|\N{DEGREE SIGN}"

#: No well is longer, m: a greater depth is in feet.
DEEPEST = 16_000.0
#: A hole is no wider, m: a greater diameter is in inches or millimetres.
WIDEST = 2.0


class Column(NamedTuple):
    """A wanted column: what it is, its names in order of preference (small letters only), and its units."""

    what: str
    names: tuple[str, ...]
    units: dict[str, float]
    needed: bool = True


DEPTH = Column(
    "measured depth",
    ("measureddepth", "md", "mdepth", "measdepth", "depthmd", "mdrkb", "mdrt", "mdkb", "ahd", "depth", "dept"),
    LENGTH,
)
INCLINATION = Column(
    "inclination",
    ("inclination", "inc", "incl", "devi", "deviation", "dev", "hadev", "inclinationangle", "drift", "angle"),
    ANGLE,
)
AZIMUTH = Column("azimuth", ("azimuth", "azi", "azim", "azm", "az", "hazi", "haz", "azit"), ANGLE)
DIAMETER = Column("diameter", ("diameter", "dia", "diam", "caliper", "cali", "cal", "holediameter", "holesize"), LENGTH)
STATIC = Column("static friction", ("frictionstatic", "mus", "friction", "mu", "ff", "frictionfactor"), NUMBER)
DYNAMIC = Column("dynamic friction", ("frictiondynamic", "mud"), NUMBER, needed=False)


class Sheet(NamedTuple):
    """What a file holds: a row per line, in SI units where they are known."""

    name: str  # "survey FILE", for messages
    lines: list[int]  # (n,) number of each row's line in the file
    values: F8  # (n, columns); nan: no such column
    titles: list[str]  # as the file calls them
    units: list[float]  # factor to SI that was applied, 0: none was given

    def refuse(self, row: int, column: int, allowed: str, value: float | None = None) -> SceneError:
        """Error about a number in the file; ``value`` as it stands there."""
        if value is None:
            value = self.values[row, column] / (self.units[column] or 1.0)
        return SceneError(
            f"{self.name}, line {self.lines[row]}, column {self.titles[column]} = {value:.10g}: {allowed}"
        )


def read_sheet(path: Path, what: str, columns: Sequence[Column]) -> Sheet:
    """Columns of a text file, as numbers. Raises SceneError."""
    name = f"{what} {path}"
    try:
        raw = path.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a name that no file can have
        raise SceneError(f"{name}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")  # a degree sign of an older program
    if "\0" in text:
        raise SceneError(f"{name}: is no text file, must be lines of numbers with a header")
    numbered = [(i, line.strip()) for i, line in enumerate(text.splitlines(), 1)]
    numbered = [(i, line) for i, line in numbered if line and not re.match(r"#|//|!|%|~", line)]
    separator = next((mark for mark in "\t;|," if numbered and mark in numbered[0][1]), None)
    if separator is None:  # names may hold single blanks if columns are wider apart
        wide = bool(numbered) and re.search(r"\S {2,}\S", numbered[0][1]) is not None
        cells = [(i, re.split(r" {2,}" if wide and j == 0 else r"\s+", line)) for j, (i, line) in enumerate(numbered)]
    else:
        cells = [(i, [c.strip() for c in next(csv.reader([line], delimiter=separator))]) for i, line in numbered]
    rows = [(i, row) for i, row in cells if any(row)]
    if not rows:
        raise SceneError(f"{name}: is empty, must have a header and lines of numbers")

    def number(text: str) -> float:
        return float(text if separator == "," else text.replace(",", "."))

    def numeric(row: list[str]) -> bool:
        try:
            [number(cell) for cell in row]
        except ValueError:
            return False
        return True

    wanted = [c for c in columns if c.needed]
    if numeric(rows[0][1]):
        if not len(wanted) <= len(rows[0][1]) <= len(columns):
            raise SceneError(
                f"{name}, line {rows[0][0]}: has numbers in {len(rows[0][1])} columns and no header: must name the "
                f"columns {_listed(wanted)}"
            )
        where: list[int | None] = [i if i < len(rows[0][1]) else None for i in range(len(columns))]
        titles, units = [c.what for c in columns], [0.0 for _ in columns]
    else:
        line, header = rows.pop(0)
        below = rows.pop(0)[1] if rows and _is_units(rows[0][1]) else [""] * len(header)
        names = [_name_and_unit(title) for title in header]
        where, titles, units = [], [], []
        for column in columns:
            i = next((i for name in column.names for i, (n, _) in enumerate(names) if n == name), None)
            if i is None and column.needed:
                raise SceneError(
                    f"{name}, line {line}: has no column for the {column.what} (columns: {', '.join(header)}): must be "
                    f"called one of {', '.join(column.names).upper()}"
                )
            where.append(i)
            titles.append(header[i] if i is not None else column.what)
            unit = ("" if i is None else names[i][1]) or (
                _letters(below[i]) if i is not None and i < len(below) else ""
            )
            if unit and unit not in column.units:
                allowed = f"one of {', '.join(column.units)}" if column.units else "left out"
                raise SceneError(f"{name}, line {line}, column {titles[-1]}: unit {unit!r} must be {allowed}")
            units.append(column.units.get(unit, 0.0))
    if not rows:
        raise SceneError(f"{name}: has a header but no lines of numbers below it")
    values = np.full((len(rows), len(columns)), math.nan)
    for r, (line, row) in enumerate(rows):
        for c, i in enumerate(where):
            if i is None:
                continue
            if i >= len(row):
                raise SceneError(f"{name}, line {line}: has {len(row)} columns, must have one for {titles[c]}")
            try:
                values[r, c] = number(row[i]) * (units[c] or 1.0)
            except ValueError:
                values[r, c] = math.nan
            if not math.isfinite(values[r, c]):
                raise SceneError(f"{name}, line {line}, column {titles[c]} = {row[i]!r}: must be a number")
    return Sheet(name, [i for i, _ in rows], values, titles, units)


def _letters(text: str) -> str:
    return "".join(re.findall(_WORD, text)).lower()


def _name_and_unit(title: str) -> tuple[str, str]:
    """Letters of a column's name, and its unit: the first word in brackets, or the last word if it is a known unit."""
    bracket = re.search(r"[(\[{]([^)\]}]*)[)\]}]\s*$", title)
    if bracket and bracket.start():
        unit = next(iter(re.findall(_WORD, bracket[1])), "").lower()
        return _name_and_unit(title[: bracket.start()])[0], "" if unit in _DATUMS else unit
    parts = re.findall(_WORD, title.lower())
    unit = parts.pop() if len(parts) > 1 and parts[-1] in {**LENGTH, **ANGLE} else ""
    return "".join(parts[:1] + [part for part in parts[1:] if part not in _DATUMS]), unit


def _is_units(row: list[str]) -> bool:
    """Whether a line below the header says the units."""
    return any(row) and all(not cell or _letters(cell) in {**LENGTH, **ANGLE} for cell in row)


def _listed(columns: Sequence[Column]) -> str:
    return ", ".join(column.what for column in columns)


def _check_depths(sheet: Sheet) -> None:
    p = sheet.values[:, 0]
    for i in range(len(p)):
        if p[i] < 0:
            raise sheet.refuse(i, 0, "must not be negative")
        if i and p[i] <= p[i - 1]:
            above = p[i - 1] / (sheet.units[0] or 1.0)
            raise sheet.refuse(i, 0, f"must be more than {above:.10g} of the line above")
        if p[i] > DEEPEST:
            hint = "" if sheet.units[0] else ", or name the unit in the header, such as 'MD (ft)'"
            raise sheet.refuse(i, 0, f"must be at most {DEEPEST:g} m{hint}")


def read_survey(path: str | Path) -> F8:
    """Stations (n, 3) of a survey file: measured depth (m), inclination and azimuth (rad), from the surface down.

    Depths without a unit are metres. Angles without a unit are degrees if one of them is too large for radians; if none
    is, the header has to say. A first station below the surface must be vertical: the hole is vertical above it.

    Raises SceneError: file, line, column and what is allowed.
    """
    sheet = read_sheet(Path(path), "survey", (DEPTH, INCLINATION, AZIMUTH))
    _check_depths(sheet)
    p, inclination, azimuth = sheet.values.T
    if not sheet.units[1] and not sheet.units[2]:
        degrees = inclination.max() > math.pi or np.abs(azimuth).max() > 2 * math.pi
        if not degrees and inclination.any():
            raise SceneError(
                f"{sheet.name}: columns {sheet.titles[1]} (up to {inclination.max():.4g}) and {sheet.titles[2]} (up to "
                f"{np.abs(azimuth).max():.4g}) may be degrees or radians: must name the unit in the header, such as "
                "'INC (deg)'"
            )
        unit = math.pi / 180
    else:
        unit = sheet.units[1] or sheet.units[2]  # one says it for both
    for column in (1, 2):
        sheet.values[:, column] *= 1.0 if sheet.units[column] else unit
        sheet.units[column] = sheet.units[column] or unit
    name = "deg" if unit != 1 else "rad"
    for i in range(len(p)):
        if not 0 <= inclination[i] < math.pi:
            raise sheet.refuse(i, 1, f"must be >= 0 and < {math.pi / unit:.4g} {name}")
        if not abs(azimuth[i]) <= 2 * math.pi + 1e-9:
            raise sheet.refuse(i, 2, f"must be from {-2 * math.pi / unit:.4g} to {2 * math.pi / unit:.4g} {name}")
    rows = sheet.values
    if p[0] > 0:
        if inclination[0] > 0:
            raise SceneError(
                f"{sheet.name}, line {sheet.lines[0]}: the first station is at {p[0]:.6g} m and inclined by "
                f"{math.degrees(inclination[0]):.4g} deg: must be at depth 0, or vertical (how the hole gets there is "
                "not known)"
            )
        rows = np.vstack([[0.0, 0.0, azimuth[0]], rows])
    if len(rows) < 2:
        raise SceneError(f"{sheet.name}: has one station, must have two or more")
    return rows


def read_caliper(path: str | Path) -> F8:
    """Rows (n, 2) of a caliper log: measured depth and diameter of the hole, m. Raises SceneError."""
    sheet = read_sheet(Path(path), "caliper", (DEPTH, DIAMETER))
    _check_depths(sheet)
    for i, wide in enumerate(sheet.values[:, 1]):
        if not 0 < wide <= WIDEST:
            hint = "" if sheet.units[1] else "; the header may name the unit, such as 'CALI (in)'"
            raise sheet.refuse(i, 1, f"must be > 0 and at most {WIDEST:g} m{hint}")
    return sheet.values


def read_friction(path: str | Path, ratio: float = 1.0) -> F8:
    """Rows (n, 3) of a friction profile: measured depth (m), static and dynamic coefficient.

    ratio: dynamic over static coefficient where the file has none of the former. Raises SceneError.
    """
    sheet = read_sheet(Path(path), "friction profile", (DEPTH, STATIC, DYNAMIC))
    _check_depths(sheet)
    rows = sheet.values
    missing = np.isnan(rows[:, 2])
    rows[missing, 2] = ratio * rows[missing, 1]
    for i, (_, static, dynamic) in enumerate(rows):
        if static < 0:
            raise sheet.refuse(i, 1, "must not be negative")
        if not 0 <= dynamic <= static:
            raise sheet.refuse(i, 2, f"must be from 0 to the static coefficient {static:g}")
    return rows


def folder() -> Path:
    """Where the built-in surveys are."""
    package = Path(__file__).resolve().parents[1]
    shipped = package / "surveys"
    return shipped if shipped.is_dir() else package.parent / "demos" / "surveys"


def builtin_surveys() -> list[str]:
    """Names of the built-in surveys."""
    return sorted(path.stem for path in folder().glob("*.csv"))


def find(name_or_path: str, beside: Path | None = None) -> Path:
    """File of a built-in survey, or of a path, which is taken from the folder ``beside`` (that of the scene)."""
    if name_or_path.lower() in builtin_surveys():
        return folder() / f"{name_or_path.lower()}.csv"
    return (beside or Path()) / name_or_path


def with_files(data: Mapping[str, Any], beside: Path | None = None) -> dict[str, Any]:
    """Raw scene data with rows of numbers in the place of the names of files.

    These are hole.survey, hole.caliper and contact.friction_profile; ``beside``: the folder of the scene file. A
    friction profile without a dynamic coefficient takes the ratio of those of [contact]. Raises SceneError.
    """
    made = dict(data)
    given = data.get("contact")
    contact: Mapping[str, Any] = given if isinstance(given, Mapping) else {}
    static, dynamic = contact.get("friction_static"), contact.get("friction_dynamic")
    ratio = 1.0
    if isinstance(static, int | float) and isinstance(dynamic, int | float) and static > 0:
        ratio = min(1.0, dynamic / static)
    for table, name, read in (
        ("hole", "survey", read_survey),
        ("hole", "caliper", read_caliper),
        ("contact", "friction_profile", lambda path: read_friction(path, ratio)),
    ):
        if isinstance(made.get(table), Mapping) and isinstance(file := made[table].get(name), str):
            path = find(file, beside)
            if name == "survey" and not path.is_file() and Path(file).name == file and not path.suffix:
                known_as = ", ".join(builtin_surveys())
                raise SceneError(f"hole.survey = {file!r}: no such file, and no built-in survey: one of {known_as}")
            made[table] = {**made[table], name: read(path).tolist()}
    return made
