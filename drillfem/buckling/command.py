"""`drillfem buckling`: push a scene's string into its hole, and see where it goes."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from ..errors import SceneError, SimulationError
from ..models.rod import Rod
from ..models.soft_string import Line, line_of
from ..render import style
from ..results.atomic import write_json
from ..results.manifest import check_new_folder
from ..solve.laid import lay
from ..torque_drag.command import coarse, load_of
from ..torque_drag.limits import Limits, limits
from .column import Column
from .drawing import MAP
from .follow import Step, follow, record

if TYPE_CHECKING:
    from ..scene import Scene

log = logging.getLogger("drillfem")
STEPS = 10


def compression(line: Line, step: Step) -> np.ndarray:
    """Compression (nodes,), N, of a string without friction under a step's load."""
    return step.load - line.hanging(step.arc_length)


def turned(step: Step, laid: Step) -> float:
    """How far the string winds about the hole's axis (turns) compared with the one laid there without a push."""
    return float(np.ptp(step.angle - laid.angle) / (2 * np.pi))


def run(
    scene: Scene, out: Path, weight_on_bit: str, steps: int = STEPS, console: Console | None = None
) -> tuple[list[Step], Limits]:
    """Push with up to ``weight_on_bit`` in equal steps; print a table, write ``buckling.png`` and ``.json`` to ``out``.

    Raises SceneError; SimulationError where not even the first step finds an equilibrium.
    """
    check_new_folder(out)
    weight = load_of(weight_on_bit, "N", "--weight-on-bit")
    if not weight:
        raise SceneError(f"--weight-on-bit {weight_on_bit!r}: must be > 0 N")
    if steps < 1:
        raise SceneError(f"--steps {steps}: must be >= 1")
    line = line_of(scene)
    rod = Rod(replace(scene, model="spatial"))
    column = Column(rod)
    laid = column.at(column.start(lay(rod)))
    found, notes = [record(column, laid)], coarse(scene, line, weight)
    for note in notes:
        log.warning(note)
    try:
        found.extend(follow(column, laid, np.linspace(0.0, weight, steps + 1)[1:]))
    except SimulationError as error:
        if len(found) == 1:
            raise
        log.warning(str(error))
        notes.append(str(error))
    limit = limits(line, found[0].arc_length)
    out.mkdir(parents=True, exist_ok=True)
    rows = [_row(line, limit, step, found[0]) for step in found[1:]]
    _print(rows, console)
    draw(scene.title, line, limit, found, out / "buckling.png")
    write_json(out / "buckling.json", {"scene": scene.to_dict(), "notes": notes, "steps": rows})
    print(out / "buckling.png")
    return found, limit


def _row(line: Line, limit: Limits, step: Step, laid: Step) -> dict[str, float]:
    """What the table says of a step."""
    share = compression(line, step) / limit.sinusoidal
    worst, bent = int(share.argmax()), int(step.bending_moment.argmax())
    return {
        "weight_on_bit": step.load,
        "compression_over_limit": float(share[worst]),
        "compression_over_limit_at": float(step.arc_length[worst]),
        "turns": turned(step, laid),
        "bending_moment": float(step.bending_moment[bent]),
        "bending_moment_at": float(step.arc_length[bent]),
        "largest_side_force": float(step.side[:, 1].max()),
    }


def _print(rows: list[dict[str, float]], console: Console | None) -> None:
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    heads = ("weight on bit\nkN", "compression over\nsnaking limit", "at\nm", "winds by\nturns")
    for head in (*heads, "bending moment\nup to kN m", "at\nm", "side force\nup to kN/m"):
        table.add_column(head, justify="right", no_wrap=True)
    for row in rows:
        table.add_row(
            f"{row['weight_on_bit'] / 1e3:.1f}",
            f"{row['compression_over_limit']:.2f}",
            f"{row['compression_over_limit_at']:.0f}",
            f"{row['turns']:.2f}",
            f"{row['bending_moment'] / 1e3:.2f}",
            f"{row['bending_moment_at']:.0f}",
            f"{row['largest_side_force'] / 1e3:.2f}",
        )
    console = console or Console(width=None if Console().is_terminal else 100)
    console.print(table)


def draw(title: str, line: Line, limit: Limits, found: list[Step], path: Path) -> Path:
    """Compression against the formulas, angle about the hole's axis and bending moment along the hole, per load."""
    from matplotlib import colormaps, colors
    from matplotlib.cm import ScalarMappable

    with style.page(1700, 1000) as figure:
        words = f"{line.length:.0f} m of string pushed into its hole, without friction"
        style.heading(figure, f"{title}: buckling", words)
        push, angle, bend = (figure.add_axes((0.06 + 0.3 * i, 0.08, 0.255, 0.76)) for i in range(3))
        shade = colors.Normalize(0.0, found[-1].load / 1e3)
        for step in found:
            look: dict[str, Any] = {"color": colormaps[MAP](shade(step.load / 1e3)), "lw": 1.3}
            push.plot(compression(line, step) / 1e3, step.arc_length, **look)
            angle.plot(step.angle / (2 * np.pi), step.arc_length, **look)
            bend.plot(step.bending_moment / 1e3, step.arc_length, **look)
        for load, colour, name in (
            (limit.sinusoidal, style.VERMILION, "snakes"),
            (limit.helical, style.PURPLE, "winds"),
        ):
            push.plot(
                load / 1e3, limit.measured_depth, color=colour, lw=1.6, ls=(0, (4, 2)), label=f"{name}, by formula"
            )
        high = max(float(compression(line, found[-1]).max()), float(limit.sinusoidal.min()))
        push.set_xlim(-0.5 * high / 1e3, 1.6 * high / 1e3)
        figure.legend(*push.get_legend_handles_labels(), loc="upper left", bbox_to_anchor=(0.052, 0.925), ncols=2)
        for axes, name, label in (
            (push, "Compression", "kN"),
            (angle, "Angle about the hole's axis", "turns, from the low side"),
            (bend, "Bending moment", "kN m"),
        ):
            axes.set_title(name, pad=8)
            axes.set_xlabel(label)
            axes.set_ylim(line.length, 0.0)
        push.set_ylabel("measured depth (m)")
        bar = figure.colorbar(ScalarMappable(shade, colormaps[MAP]), cax=figure.add_axes((0.945, 0.08, 0.009, 0.76)))
        bar.set_label("weight on bit (kN)")
        return style.save(figure, path)
