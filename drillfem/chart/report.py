"""Charts as tables: orders, what an accuracy costs, who is on the Pareto front."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.table import Table

from ..errors import SceneError
from .points import Chart, Panel, Point, reach

#: Accuracies whose cost is stated.
TARGETS = (1e-1, 1e-2, 1e-3, 1e-4)


def size_text(size: float, unit: str) -> str:
    """A step, element or cell with its unit: 0.0005, "s" -> "0.5 ms"."""
    return f"{1e3 * size:.3g} ms" if unit == "s" else f"{size:.3g} {unit}"


def cost_text(cost: float) -> str:
    """A cost with three figures, without exponent."""
    return f"{cost:.0f}" if cost >= 100 else f"{cost:.3g}"


def header(panel: Panel) -> list[str]:
    """Column titles of `rows`."""
    return ["", f"order in the {panel.refined}", *(f"error {target:.0e}" for target in TARGETS), "on the front"]


def rows(chart: Chart, panel: Panel) -> list[list[str]]:
    """One line for each series: order; cost and size at each of `TARGETS`; points on the Pareto front."""
    fits, front, lines = panel.fits, {id(p) for p in panel.front}, []
    for name, points in panel.series.items():
        cells = [name, f"{fits[name].order:.2f}" if name in fits else "–"]
        for target in TARGETS:
            found = reach(points, target)
            text = (
                "" if found is None else f"{cost_text(found[0] / chart.normaliser)} ({size_text(found[1], panel.unit)})"
            )
            # the coarsest one computed is more accurate than asked for: a coarser one might do
            cells.append(("≤ " if found and found[1] == points[0].size else "") + (text or "–"))
        best = sum(id(p) in front for p in points)
        lines.append([*cells, f"{best} of {len(points)}" if best else "never"])
    return lines


def cheapest(panel: Panel, error: float) -> Point | None:
    """The cheapest computed point with at most this error."""
    able = [p for p in panel.points if p.error <= error]
    return min(able, key=lambda p: p.cpu, default=None)


def never(panel: Panel) -> list[str]:
    """Series without a point on the Pareto front."""
    front = {p.series for p in panel.front}
    return [name for name in panel.series if name not in front]


def main(cases: list[str], out: Path, quick: bool = False) -> None:
    """Compute cases (all if none is named); write ``chart-CASE.png`` and ``.json`` into ``out``; print their tables.

    Raises SceneError for a case that does not exist, before anything is computed.
    """
    from . import CASES, compute
    from .draw import draw

    for case in cases:
        if case not in CASES:
            raise SceneError(f"chart {case!r}: must be one of {', '.join(CASES)}")
    out.mkdir(parents=True, exist_ok=True)
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = 160  # a file has room for the tables
    for case in dict.fromkeys(cases or CASES):
        with console.status(case, spinner="line") as status:
            chart = compute(case, quick, status.update)
        print_tables(chart, console)
        for path in (draw(chart, out / f"chart-{case}.png"), chart.write(out / f"chart-{case}.json")):
            console.print(str(path), markup=False, soft_wrap=True)


def print_tables(chart: Chart, console: Console) -> None:
    """Print the tables of a chart."""
    console.print(f"[bold]{chart.case}[/bold]: {chart.title}. {chart.scene}.")
    console.print(f"Cost: CPU seconds over {chart.normaliser:.3g} s, those of the normaliser in this run.")
    for panel in chart.panels:
        table = Table(title=f"{panel.title}; {panel.quantity}; reference: {panel.reference}", title_justify="left")
        for k, title in enumerate(header(panel)):
            table.add_column(title, justify="left" if k == 0 else "right")
        for line in rows(chart, panel):
            table.add_row(*line)
        console.print(table)
