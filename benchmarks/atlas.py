"""What the pages of the failure atlas are made of: entries in Markdown, pictures, commands."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from common import DOCS, table

from drillfem.render import style

RPM = math.pi / 30
COLOURS = (style.INK, style.BLUE, style.VERMILION, style.GREEN, style.ORANGE, style.PURPLE)


def wrapped(text: str) -> str:
    """A paragraph of the page."""
    return textwrap.fill(text, 120, break_long_words=False, break_on_hyphens=False)


@dataclass(frozen=True)
class Entry:
    """One failure: what the page says about it. ``rows``: (quantity, measured, theory)."""

    title: str
    picture: str
    what: str
    rows: Sequence[tuple[str, str, str]]
    does: str
    says: Sequence[str]
    command: str

    def text(self) -> str:
        """The entry in Markdown."""
        said = "\n".join(f"> {line}" for line in self.says)
        quote = f"\n\n{said}" if said else ""
        return "\n\n".join(
            [
                f"## {self.title}",
                wrapped(self.what),
                f"![{self.title}](img/failure-{self.picture}.png)",
                table(["", "measured", "theory"], self.rows),
                wrapped(f"**What drillfem does.** {self.does}") + quote,
                f"```\n{self.command}\n```",
            ]
        )


def picture(name: str, title: str, subtitle: str, panels: int, draw: Callable[[Sequence[Any]], None]) -> None:
    """A page with ``panels`` axes side by side, drawn by ``draw``, saved as failure-<name>.png."""
    with style.page(1000, 460) as figure:
        style.heading(figure, title, subtitle)
        grid = figure.add_gridspec(
            1, panels, left=0.085, right=0.97, bottom=0.14, top=0.8 if panels == 1 else 0.75, wspace=0.26
        )
        axes = [figure.add_subplot(grid[0, i]) for i in range(panels)]
        draw(axes)
        for each in axes if panels > 1 else ():  # titles side by side
            each.set_title(each.get_title(loc="left"), loc="left", fontsize=9)
        style.save(figure, DOCS / "img" / f"failure-{name}.png")


def run(name: str, *keys: str, until: str = "") -> str:
    """The command that shows a failure."""
    sets = "".join(f" \\\n    --set {key}" for key in keys)
    return f"./run drillfem run {name} --out failure{sets}" + (f" --until {until}" if until else "")


def number(value: float, digits: int = 4) -> str:
    """A number for a table."""
    return f"{value:.{digits}g}"
