"""The look of every picture: one ink, one grey, colours that the colour-blind can tell apart, no jet."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK = "#22262b"
GREY = "#6b7178"
FAINT = "#d5d8dc"
PAPER = "#fcfcfa"
# Okabe and Ito's set: distinguishable with any common colour-vision deficiency
BLUE, VERMILION, GREEN, ORANGE, SKY, PURPLE = "#0072B2", "#D55E00", "#009E73", "#E69F00", "#56B4E9", "#CC79A7"

DPI = 100
RC: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 11,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.titlesize": 12,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.titlecolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "axes.facecolor": "white",
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-3, 5),
    "axes.formatter.use_mathtext": True,
    "grid.color": "#e9ebee",
    "grid.linewidth": 0.8,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "text.color": INK,
    "figure.facecolor": PAPER,
    "figure.dpi": DPI,
    "savefig.dpi": DPI,
    "legend.frameon": False,
    "legend.fontsize": 10,
    "lines.linewidth": 1.4,
    "lines.solid_capstyle": "round",
    "agg.path.chunksize": 20000,
}


@contextmanager
def page(width: int, height: int) -> Iterator[Figure]:
    """A figure of width x height pixels in the house style; no pyplot, so nothing global is left behind."""
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with matplotlib.rc_context(cast(Any, RC)):
        figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
        FigureCanvasAgg(figure)
        yield figure


def save(figure: Figure, path: Path) -> Path:
    """Write a PNG without date or program version in it: the same result gives the same bytes."""
    figure.savefig(path, metadata={"Software": None})
    return path


def heading(figure: Figure, title: str, subtitle: str) -> None:
    """Title and a grey line under it, at the top left of the page; a title that is too long is shortened."""
    width, height = figure.get_size_inches()
    room = int(width * 7.2)
    if len(title) > room:
        title = title[: room - 1].rstrip() + "\u2026"
    figure.text(0.28 / width, 1 - 0.30 / height, title, fontsize=17, weight="bold", va="center")
    figure.text(0.28 / width, 1 - 0.61 / height, subtitle, fontsize=11.5, color=GREY, va="center")


def panel(axes: Axes) -> None:
    """Strip an axes to a bare picture frame."""
    axes.set_xticks([])
    axes.set_yticks([])
    axes.grid(False)


def band(values: np.ndarray, least: float = 1e-9) -> tuple[float, float]:
    """Colour limits that hold the values without the rarest 0.5 % at either end, and never coincide."""
    finite = np.asarray(values, dtype=float)
    finite = finite[np.isfinite(finite)]
    if finite.size == 0:
        return 0.0, 1.0
    low, high = (float(v) for v in np.percentile(finite, [0.5, 99.5]))
    room = max(1e-3 * max(abs(low), abs(high)), least)
    if high - low < room:
        low, high = low - room, high + room
    return low, high


def number(value: float, digits: int = 3) -> str:
    """A number as a person writes it: three digits, thin spaces, a true minus sign."""
    if value == 0 or not np.isfinite(value):
        return f"{value:g}"
    text = f"{value:.{digits}g}"
    if "e" in text:
        mantissa, exponent = text.split("e")
        text = f"{float(text):,.0f}".replace(",", "\u2009") if 0 < int(exponent) < 7 else f"{mantissa}e{int(exponent)}"
    return text.replace("-", "\u2212")
