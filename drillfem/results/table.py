"""What a run says in numbers: one table, each number beside its refinements and its scatter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from .atomic import read_json, write_json
from .history import STANDARD
from .performance import nominal_performance, performance
from .result import Result
from .spectra import dominant_in

Statistics = dict[str, float | None]

WINDOW = 20.0
"""Length (s) of the end of a run that frequencies, fractions and means are taken from."""


@dataclass(frozen=True)
class Row:
    """A line of the table: which statistic, its name, how to print it (the SI value times ``scale``)."""

    key: str
    label: str
    unit: str
    scale: float = 1.0
    digits: int = 4

    def text(self, numbers: Mapping[str, float | None]) -> str:
        """The statistic as printed; a dash where there is none."""
        value = numbers.get(self.key)
        return "-" if value is None else f"{value * self.scale:.{self.digits}g}"

    def range(self, many: list[Statistics]) -> str:
        """Least and greatest of the statistic in ``many`` runs."""
        values = [value for numbers in many if (value := numbers.get(self.key)) is not None]
        ends = [self.text({self.key: value}) for value in (min(values), max(values))] if values else ["-"]
        return " to ".join(dict.fromkeys(ends))


def _wave(kind: str, unit: str, scale: float) -> tuple[Row, ...]:
    return (
        Row(f"{kind}_frequency_1", f"{kind} oscillation, strongest wave", "Hz"),
        Row(f"{kind}_amplitude_1", "  its amplitude", unit, scale, 3),
        Row(f"{kind}_frequency_2", "  second wave", "Hz"),
        Row(f"{kind}_amplitude_2", "  its amplitude", unit, scale, 3),
    )


def _performance(prefix: str = "", word: str = "") -> tuple[Row, ...]:
    return (
        Row(f"{prefix}rate_of_penetration", f"{word}rate of penetration", "mm/s", 1e3),
        Row(f"{prefix}mechanical_specific_energy", "mechanical specific energy, of the bit", "MPa", 1e-6),
        Row(f"{prefix}specific_energy_input", "  of what is put in", "MPa", 1e-6),
        Row(f"{prefix}drilled_per_energy", "depth per energy put in", "mm/MJ", 1e9),
    )


WHOLE = (
    Row("drilled_depth", "depth drilled", "m"),
    *_performance("mean_", "mean "),
    Row("power_in", "mean power put in at the ends", "W"),
    Row("power_out", "  taken out by the rock", "W"),
    Row("power_ratio", "  ratio", "1"),
)
LATE = (
    *_performance(),
    *_wave("torsional", "rad/s", 1.0),
    *_wave("axial", "mm/s", 1e3),
    Row("torsional_stick_fraction", "bit does not turn", "% of time", 100, 3),
    Row("axial_stick_fraction", "bit does not advance", "% of time", 100, 3),
    Row("off_bottom_fraction", "bit off bottom", "% of time", 100, 3),
    Row("mean_bit_torque", "mean torque on bit", "N m"),
    Row("mean_bit_weight", "mean weight on bit", "kN", 1e-3),
)
RUN = (
    Row("energy_balance_error", "energy balance error", "", 1.0, 2),
    Row("simulated_per_wall", "speed, simulated per wall time", "s/s", 1.0, 3),
)


def late_window(result: Result) -> tuple[float, float]:
    """The times (s) that frequencies, fractions and means are taken from: the last 20 s or the last half."""
    start, end = (float(result.history["time"].values[i]) for i in (0, -1))
    return end - min(WINDOW, (end - start) / 2), end


def statistics(result: Result, window: tuple[float, float] | None = None) -> Statistics:
    """The numbers of the table, in SI units, by name; what a scene does not have is left out or ``None``.

    Args:
        result: a run.
        window: times (s) that frequencies, fractions and means are taken from; `late_window` by default.

    Sticking is told by the regularisation speeds of the bit law: the bit does not turn below c2 (0.1 rad/s)
    and does not advance below c1 (1e-5 m/s), both in magnitude. It is off bottom where it carries nothing.
    """
    history, summary = result.history, result.summary
    time = history["time"].values
    window = window or late_window(result)
    late = (time >= window[0] - 1e-9) & (time <= window[1] + 1e-9)
    numbers: Statistics = {}
    if "bit_depth" in history and len(time) > 1:
        depth = history["bit_depth"].values
        numbers["drilled_depth"] = float(depth[-1])
        radius = getattr(getattr(result.scene, "bit", None), "radius", 0.0)
        whole = performance(history, radius, (float(time[0]), float(time[-1])))
        numbers |= {f"mean_{name}": value for name, value in whole.items()} | performance(history, radius, window)
    for kind, name in (("torsional", "bit_angular_speed"), ("axial", "bit_axial_speed")):
        if name in history:
            for rank, peak in enumerate(dominant_in(history, name, window, 2), start=1):
                numbers[f"{kind}_frequency_{rank}"], numbers[f"{kind}_amplitude_{rank}"] = peak
    if "bit_torque" in history:
        bit = getattr(result.scene, "bit", None)
        turning = getattr(bit, "torsional_regularisation", 0.1)
        advancing = getattr(bit, "axial_regularisation", 1e-5)
        share = _weights(time[late])
        values = {name: history[name].values[late] for name in STANDARD if name.startswith("bit_")}
        numbers["torsional_stick_fraction"] = float(share @ (np.abs(values["bit_angular_speed"]) < turning))
        numbers["axial_stick_fraction"] = float(share @ (np.abs(values["bit_axial_speed"]) < advancing))
        numbers["off_bottom_fraction"] = float(share @ (values["bit_weight"] <= 0))
        numbers["mean_bit_torque"] = float(share @ values["bit_torque"])
        numbers["mean_bit_weight"] = float(share @ values["bit_weight"])
    numbers |= {name: summary[name] for name in ("power_in", "power_out", "power_ratio") if name in summary}
    numbers["energy_balance_error"] = summary.get("energy_balance_error")
    if wall := summary.get("wall_seconds"):
        numbers["simulated_per_wall"] = summary["simulated_seconds"] / wall
    return numbers


def nominal_statistics(result: Result) -> Statistics:
    """What steady cutting at the scene's top speed and weight on bit would give."""
    scene = result.scene
    if not getattr(scene, "bites", False) or "bit_depth" not in result.history:
        return {}
    nominal = scene.nominal()
    if nominal is None:
        return {}
    time = result.history["time"].values
    steady = nominal_performance(scene)
    return {
        "drilled_depth": float(nominal.rate_of_penetration * (time[-1] - time[0])),
        **{f"mean_{name}": value for name, value in steady.items()},
        **steady,
        "mean_bit_torque": float(nominal.torque_on_bit),
        "mean_bit_weight": float(nominal.weight_on_bit),
    }


def summary_table(result: Result, companions: Mapping[str, Result] | None = None) -> Table:
    """The table of a run.

    Args:
        result: the run.
        companions: the same run otherwise: "half step", "double mesh", and "start 1", "start 2", ... from
            nearby initial states. The starts share one column, least to greatest.
    """
    companions = companions or {}
    own, nominal = statistics(result), nominal_statistics(result)
    single = {name: statistics(other) for name, other in companions.items() if not name.startswith("start ")}
    starts = [statistics(other) for name, other in companions.items() if name.startswith("start ")]
    window, summary = late_window(result), result.summary
    end = float(result.history["time"].values[-1])
    title = f"{summary['model']}, {summary['dofs']} unknowns, {summary['simulated_seconds']:g} s"
    if not summary["converged"]:
        title += f" ({summary['reason']})"
    table = Table(title=escape(title), title_justify="left", title_style="bold", box=box.SIMPLE, pad_edge=False)
    table.add_column("", no_wrap=True)
    table.add_column("", no_wrap=True)
    columns = ["this run", *(["nominal"] if nominal else []), *single]
    for name in columns + ([f"{len(starts)} nearby starts"] if starts else []):
        table.add_column(name, justify="right")

    def section(heading: str, rows: tuple[Row, ...]) -> None:
        shown = [row for row in rows if own.get(row.key) is not None]
        if shown and heading:
            table.add_row(f"[italic]{heading}[/italic]")
        for row in shown:
            cells = [row.text(own)]
            if nominal:
                cells.append(row.text(nominal) if row.key in nominal else "")
            cells += [row.text(numbers) for numbers in single.values()]
            if starts:
                cells.append(row.range(starts))
            table.add_row(row.label, row.unit, *cells)

    def last_values(heading: str) -> None:
        """Without a bit: how the run ended, for what the scene adds to the history."""
        names = [str(name) for name in result.history.data_vars if name not in STANDARD]
        if names:
            table.add_row(f"[italic]{heading}[/italic]")
        for name in names:
            runs = [result, *(companions[other] for other in single)]
            cells = [f"{float(run.history[name].values[-1]):.6g}" for run in runs]
            table.add_row(escape(name.replace("_", " ")), result.history[name].attrs["units"], *cells)

    section("", WHOLE)
    section(f"from {window[0]:g} to {window[1]:g} s", LATE)
    if "bit_torque" not in result.history:
        last_values(f"at {end:g} s")
    section("the run", RUN)
    return table


def print_summary(
    result: Result, companions: Mapping[str, Result] | None = None, console: Console | None = None
) -> None:
    """Print `summary_table`; where the output is no terminal, as aligned text that is never wrapped."""
    console = console or Console(highlight=False)
    table = summary_table(result, companions)
    if not console.is_terminal:
        console = Console(file=console.file, highlight=False, width=240, color_system=None)
        table.box = None
        table.padding = (0, 2, 0, 0)
    console.print(table)


def store_statistics(result: Result, companions: Mapping[str, Result] | None = None) -> None:
    """Put the numbers of the table, in SI units, into summary.json as ``statistics``."""
    named = {"this run": result, **(companions or {})}
    stored: dict[str, Any] = {"window": list(late_window(result)), "nominal": nominal_statistics(result)}
    result.summary["statistics"] = stored | {name: statistics(other) for name, other in named.items()}
    if result.folder is not None:
        path = Path(result.folder) / "summary.json"
        write_json(path, read_json(path) | {"statistics": result.summary["statistics"]})


def _weights(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of the time that each sample stands for; they add up to 1, whatever the spacing."""
    if len(time) < 2:
        return np.ones(len(time)) / max(len(time), 1)
    steps = np.diff(time, prepend=time[0], append=time[-1])
    return (steps[1:] + steps[:-1]) / (2 * (time[-1] - time[0]))
