"""Pictures of a sweep: performance against what was swept, and depth over time. Reads saved results only."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from drillfem.render import style
from drillfem.sweep import short

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from drillfem.sweep import SweepTable

Array = np.ndarray
MARKERS, LINES = "os", ("-", (0, (2, 2)))

PANELS = (
    # title, unit, factor, (column, words, marked) of every curve, nominal column
    ("Depth drilled", "m", 1.0, (("drilled_depth", ""),), "nominal_drilled_depth"),
    ("Mean rate of penetration", "mm/s", 1e3, (("mean_rate_of_penetration", ""),), "nominal_rate_of_penetration"),
    (
        "Mechanical specific energy",
        "MPa",
        1e-6,
        (("mean_mechanical_specific_energy", "of the bit"), ("mean_specific_energy_input", "of what is put in")),
        "nominal_mechanical_specific_energy",
    ),
    ("Depth per energy put in", "mm/MJ", 1e9, (("mean_drilled_per_energy", ""),), "nominal_drilled_per_energy"),
)


def draw(table: SweepTable, folder: Path) -> list[Path]:
    """sweep.png and depth.png of a sweep that drills, sweep.png of final values of one that does not.

    Nothing where fewer than two runs have numbers.
    """
    rows = [row for row in table.rows if len(row) > len(table.keys) + 3]
    if len(rows) < 2:
        return []
    made = [performance(table, rows, folder / "sweep.png")]
    if any("drilled_depth" in row for row in rows):
        made.append(depths(table, rows, folder / "depth.png"))
    return made


def performance(table: SweepTable, rows: list[dict[str, Any]], path: Path) -> Path:
    """Depth, rate of penetration, specific energy and depth per energy against the first key, a curve per other."""
    panels: tuple[Any, ...] = PANELS
    if not any("drilled_depth" in row for row in rows):
        names = table.changing()[:4]
        words = (n.removeprefix("final_").replace("_", " ").capitalize() for n in names)
        panels = tuple((w, table.units[n], 1.0, ((n, ""),), "") for w, n in zip(words, names, strict=True))
    first, *others = table.keys
    place = Places([row[first] for row in table.rows])
    series: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        series.setdefault(label_of(table, row, others), []).append(row)
    colours = style_of(len(series))
    down = max(1, (len(panels) + 1) // 2)
    with style.page(1600, 170 + 460 * down) as figure:
        height = figure.get_size_inches()[1] * style.DPI
        style.heading(figure, f"{table.scene}: {', '.join(table.keys)}", subtitle(table))
        grid = figure.add_gridspec(
            down, 2, left=0.065, right=0.985, top=1 - 130 / height, bottom=70 / height, hspace=0.3, wspace=0.16
        )
        for k, (title, unit, factor, curves, nominal) in enumerate(panels):
            axes = figure.add_subplot(grid[k // 2, k % 2])
            for (label, members), colour in zip(series.items(), colours, strict=True):
                for n, (column, _) in enumerate(curves):
                    have = [row for row in members if column in row]
                    x, y = [place.of(row[first]) for row in have], [factor * row[column] for row in have]
                    named = label if k == n == 0 else None
                    axes.plot(x, y, ls=LINES[n], marker=MARKERS[n], ms=6 - 1.5 * n, color=colour, label=named or None)
            for n, (_, words) in enumerate(curves):
                if words:
                    axes.plot([], [], ls=LINES[n], marker=MARKERS[n], ms=6 - 1.5 * n, color=style.GREY, label=words)
            dashed: dict[str, Any] = {"ls": (0, (5, 3)), "lw": 1.2, "zorder": 3}
            for label, level in levels(series, place, first, nominal).items():
                colour = colours[list(series).index(label)] if label else style.VERMILION
                axes.plot(list(level), [factor * y for y in level.values()], color=colour, **dashed)
                if k == 0 and not label:
                    axes.plot([], [], color=colour, label="nominal", **dashed)
            failed = [place.of(row[first]) for row in table.rows if row["status"] == "failed"]
            across = axes.get_xaxis_transform()
            axes.plot(failed, [0.02] * len(failed), "x", color=style.VERMILION, ms=8, mew=2, transform=across)
            place.set(axes)
            axes.set_title(title)
            axes.set_ylabel(unit)
            axes.margins(y=0.15)
            if k >= len(panels) - 2:
                axes.set_xlabel(with_unit(first, table.units.get(first, "")))
            if axes.get_legend_handles_labels()[1]:
                axes.legend(loc="best")
        return style.save(figure, path)


def levels(
    series: dict[str, list[dict[str, Any]]], place: Places, first: str, nominal: str
) -> dict[str, dict[float, float]]:
    """What steady drilling would give, over places: of each series, or as "" where it is the same for all."""
    each = {
        label: {place.of(row[first]): row[nominal] for row in members if nominal in row}
        for label, members in series.items()
    }
    joined: dict[float, float] = {}
    for level in each.values():
        if any(joined.get(x, y) != y for x, y in level.items()):
            return {label: level for label, level in each.items() if level}
        joined |= level
    return {"": dict(sorted(joined.items()))} if joined else {}


def depths(table: SweepTable, rows: list[dict[str, Any]], path: Path) -> Path:
    """Depth over time, and its difference to the run that drilled least (figure 6.14 of the thesis)."""
    runs = {
        label_of(table, row, table.keys): read_depth(path.parent / row["folder"])
        for row in rows
        if "drilled_depth" in row
    }
    least = min(runs, key=lambda label: runs[label][1][-1])
    with style.page(1600, 760) as figure:
        style.heading(figure, f"{table.scene}: depth over time", subtitle(table))
        left, right = figure.subplots(
            1, 2, gridspec_kw={"left": 0.06, "right": 0.985, "top": 0.81, "bottom": 0.1, "wspace": 0.15}
        )
        for (label, (time, depth)), colour in zip(runs.items(), style_of(len(runs)), strict=True):
            left.plot(time, depth, color=colour, label=label)
            other = np.interp(time, *runs[least])
            right.plot(time, 1e3 * (depth - other), color=colour, label=label)
        left.set_title("Depth drilled")
        left.set_ylabel("m")
        right.set_title(f"Depth less that of {least}")
        right.set_ylabel("mm")
        for axes in (left, right):
            axes.set_xlabel("time (s)")
            axes.margins(x=0)
        (left if len(runs) <= 12 else right).legend(loc="upper left", ncols=1 + (len(runs) - 1) // 12)
        return style.save(figure, path)


def read_depth(folder: Path, points: int = 2000) -> tuple[Array, Array]:
    """Time (s) and depth drilled (m) of a saved run, at most so many points."""
    import xarray as xr

    with xr.open_dataset(folder / "history.nc", engine="h5netcdf") as history:
        every = max(1, history.sizes["time"] // points)
        part = history[["bit_depth"]].isel(time=slice(None, None, every)).load()
    return np.asarray(part["time"].values, float), np.asarray(part["bit_depth"].values, float)


class Places:
    """Where the values of a key stand on an axis: numbers where they are, logarithmic if they span much; else words."""

    def __init__(self, values: list[Any]) -> None:
        self.words = list(dict.fromkeys(str(v) for v in values))
        self.numbers = all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
        self.logarithmic = self.numbers and min(values) > 0 and max(values) >= 30 * min(values)
        self.values = sorted(set(values)) if self.numbers else []

    def of(self, value: Any) -> float:
        """The place of a value."""
        return float(value) if self.numbers else float(self.words.index(str(value)))

    def set(self, axes: Axes) -> None:
        """Scale and ticks of the axis."""
        if self.logarithmic:
            axes.set_xscale("log")
        elif not self.numbers:
            axes.set_xticks(range(len(self.words)), self.words)
        elif len(self.values) <= 12:
            axes.set_xticks(self.values, [short(v) for v in self.values])


def style_of(count: int) -> list[str]:
    """So many colours: those of the house, or where they do not suffice a sequence from dark to light."""
    house = [style.BLUE, style.ORANGE, style.GREEN, style.PURPLE, style.SKY, style.VERMILION, style.INK]
    if count <= len(house):
        return house[:count]
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return [to_hex(colormaps["viridis"](x)) for x in np.linspace(0.0, 0.92, count)]


def with_unit(key: str, unit: str) -> str:
    return f"{key} ({unit})" if unit else key


def label_of(table: SweepTable, row: dict[str, Any], keys: Sequence[str]) -> str:
    """``blades 5, retardation time 1e-4 s``: the values of some keys, which go by their last words."""
    return ", ".join(
        f"{key.split('.')[-1].replace('_', ' ')} {short(row[key])} {table.units.get(key, '')}".strip() for key in keys
    )


def subtitle(table: SweepTable) -> str:
    """How many runs there are, and what was set."""
    done = sum(row["status"] == "done" for row in table.rows)
    words = [f"{done} of {len(table.rows)} runs"]
    if table.until is not None:
        words.append(f"until {table.until:g} s")
    words += [f"{key} = {value}" for key, value in table.set.items()]
    return "   \u00b7   ".join(words)
