"""Pictures of buckled strings: the string in its hole, drawn much too wide, and what it does along the hole."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..render import style
from .follow import Step

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection

F8 = npt.NDArray[np.float64]

#: How the hole is looked at: from the side, a little from above and along it. What lies aside by its radius is drawn so
#: much higher, and so much further along the page (of a twentieth of its length).
_ABOVE, _ALONG = 0.4, 0.15
#: Colours of the side force.
MAP = "viridis"


def tube(axes: Axes, step: Step, radius: float) -> LineCollection:
    """Draw a string in its hole, seen from the side and a little along it; up is up.

    ``radius``: way that the string's axis has in the hole (clearance), m. Returns the lines, for a colour bar of the
    side force (N/m): its brightest colour stands for the 95th percentile where it touches.
    """
    from matplotlib.collections import LineCollection

    s = step.arc_length
    first, last = float(s[0]), float(s[-1])
    slant, up = _ALONG * (last - first) / 20, np.sqrt(1 - _ABOVE**2)
    fine = np.linspace(first, last, 3000)
    low, aside = (np.interp(fine, s, step.position[:, i]) / radius for i in (0, 1))
    x, y = fine + slant * aside, _ABOVE * aside - up * low
    force = np.interp(fine, step.side[:, 0], step.side[:, 1])
    turn = np.linspace(0, 2 * np.pi, 200)
    mouth = slant * np.sin(turn), _ABOVE * np.sin(turn) + up * np.cos(turn)
    for at in (first, last):
        axes.fill(at + mouth[0], mouth[1], color=style.FAINT, alpha=0.35, lw=0, zorder=1)
        axes.plot(at + mouth[0], mouth[1], color=style.GREY, lw=0.9, zorder=1)
    for edge, side in ((1.0, _ABOVE), (-1.0, -_ABOVE)):
        axes.plot(np.array([first, last]) + slant * side, 2 * [edge], color=style.GREY, lw=0.9, zorder=1)
    points = np.stack([x, y], axis=1)
    pieces = np.stack([points[:-1], points[1:]], axis=1)
    # what is near covers what is far: aside points away from the eye
    order = np.argsort(aside[:-1])[::-1]
    lines = LineCollection(list(pieces[order]), cmap=MAP, zorder=3, capstyle="round")
    lines.set_array(force[:-1][order])
    lines.set_linewidth(list(3.2 - 1.0 * aside[:-1][order]))
    # the points on which ends and crests bear would leave all others dark
    lines.set_clim(0.0, float(np.quantile(force[force > 0], 0.95)) if force.any() else 1.0)
    axes.add_collection(lines)
    axes.set_xlim(first - 3 * slant, last + 3 * slant)
    axes.set_ylim(-1.12, 1.12)
    axes.set_yticks([])
    axes.grid(False)
    axes.spines["left"].set_visible(False)
    return lines


def mouth(axes: Axes, step: Step, radius: float) -> None:
    """Draw a string seen along its hole, from the top."""
    turn = np.linspace(0, 2 * np.pi, 200)
    axes.plot(np.sin(turn), np.cos(turn), color=style.GREY, lw=0.9)
    axes.plot(step.position[:, 1] / radius, -step.position[:, 0] / radius, color=style.INK, lw=1.1)
    axes.set_aspect("equal")
    style.panel(axes)
    for spine in axes.spines.values():
        spine.set_visible(False)


def shapes(steps: Sequence[Step], names: Sequence[str], radius: float, title: str, subtitle: str, path: Path) -> Path:
    """Strings one under the other, from the end and from the side, coloured by their side force."""
    head, row, foot = 110, 175, 45
    height = head + row * len(steps) + foot
    with style.page(1600, height) as figure:
        style.heading(figure, title, subtitle)
        for i, (step, name) in enumerate(zip(steps, names, strict=True)):
            low = (foot + row * (len(steps) - 1 - i) + 12) / height
            high = (row - 55) / height
            mouth(figure.add_axes((0.015, low, 0.08, high)), step, radius)
            axes = figure.add_axes((0.105, low, 0.80, high))
            axes.set_title(name, pad=5)
            lines = tube(axes, step, radius)
            bar = figure.colorbar(lines, cax=figure.add_axes((0.925, low, 0.01, high)), extend="max")
            bar.set_label("N/m")
            bar.outline.set_visible(False)
            if i < len(steps) - 1:
                axes.set_xticklabels([])
            else:
                axes.set_xlabel("arc length (m)")
        return style.save(figure, path)
