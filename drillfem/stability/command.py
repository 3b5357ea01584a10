"""`drillfem stability`: the map of a scene as picture, numbers and a short table."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from drillfem.errors import SceneError
from drillfem.results import check_new_folder
from drillfem.scene.units import to_si
from drillfem.stability.drawing import draw_map
from drillfem.stability.maps import SHAPE, StabilityMap, confirm, default_ranges, stability_map

if TYPE_CHECKING:
    from drillfem.scene import Scene

_RPM = 30 / np.pi


def interval(text: str, unit: str, option: str) -> tuple[float, float]:
    """Two numbers in ``unit`` from text such as ``5..30`` or ``50..250 rpm``.  Raises SceneError."""
    first, dots, second = (part.strip() for part in text.partition(".."))
    try:
        if not dots:
            raise ValueError
        # "50..250 rpm": a unit at the end counts for both
        tail = second.lstrip("+-.0123456789eE")
        low, high = (_number(part if not _bare(part) else f"{part} {tail}", unit) for part in (first, second))
        if not 0 < low < high:
            raise ValueError
    except ValueError as error:
        why = f" ({error})" if str(error) else ""
        raise SceneError(
            f"{option} {text!r}: must be FROM..TO in {unit}, 0 < FROM < TO, or with units, such as "
            f"{'50..250 rpm' if unit == 'rad/s' else '35..80 kN'}{why}"
        ) from None
    return low, high


def _bare(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _number(text: str, unit: str) -> float:
    text = text.strip()
    return float(text) if _bare(text) else to_si(text, unit)


def run(
    scene: Scene,
    out: Path,
    speeds: str | None = None,
    weights: str | None = None,
    runs: bool = True,
    surface: str = "exact",
) -> StabilityMap:
    """Compute the map of a scene into the new folder ``out`` (stability.png, stability.json) and print its table.

    speeds, weights : see `interval`; by default around the scene's own point.  runs : confirm by short runs.
    surface : "exact" or "scene" (its discretised rock surface).  Raises SceneError, SimulationError.
    """
    if surface not in ("exact", "scene"):
        raise SceneError(f"--surface {surface!r}: must be one of exact, scene")
    around = default_ranges(scene) if scene.bit is not None and scene.rock is not None else ((1.0, 2.0), (1.0, 2.0))
    x = interval(speeds, "rad/s", "--speeds") if speeds is not None else around[0]
    y = interval(weights, "N", "--weights") if weights is not None else around[1]
    check_new_folder(out)
    chart = stability_map(scene, np.linspace(*x, SHAPE[0]), np.linspace(*y, SHAPE[1]), surface)
    if runs:
        confirm(chart)
    out.mkdir(parents=True, exist_ok=True)
    picture = draw_map(chart, out / "stability.png")
    numbers = chart.save(out / "stability.json")
    rows = table(chart)
    width = max(len(label) for label, _ in rows)
    for label, text in rows:
        print(f"{label:{width}}  {text}".rstrip())
    print(picture)
    print(numbers)
    return chart


def table(chart: StabilityMap) -> list[tuple[str, str]]:
    """What a map says, as (label, text)."""
    speed, weight = chart.own_point
    roots = chart.own.values[0][np.isfinite(chart.own.values[0])]
    growing = roots[roots.real > 0]
    rows = [
        ("model", chart.model),
        ("scene", f"{speed:.4g} rad/s ({speed * _RPM:.4g} rpm), {weight / 1e3:.4g} kN on the bit"),
        ("unstable roots there", f"{len(growing)} of frequency > 0" if len(growing) else "none"),
    ]
    shown = growing if len(growing) else roots[:1]
    for k, root in enumerate(shown[:8]):
        kind = "torsion" if chart.own.torsional[0, k] else "axial"
        rows.append(("", f"{root.imag / (2 * np.pi):8.3f} Hz  {root.real:+9.4f} 1/s  {kind}"))
    if len(shown) > 8:
        rows.append(("", f"and {len(shown) - 8} more that grow more slowly"))
    beyond = "there can be none beyond" if chart.complete else "an undamped string has more beyond"
    rows.append(("roots looked for", f"up to {chart.band:.4g} Hz; {beyond}"))
    windows = ", ".join(f"{a:.4g} to {b:.4g}" for a, b in chart.stable_speeds(weight)) or "none"
    rows.append((f"stable speeds at {weight / 1e3:.4g} kN", f"{windows}{' rad/s' if windows != 'none' else ''}"))
    cuts = np.isfinite(chart.growth)
    share = float(np.mean(chart.unstable[cuts] == 0))
    rows.append(("share of the map that is stable", f"{100 * share:.0f} %"))
    rows.append(("nothing is cut up to", f"{chart.least_weight / 1e3:.4g} kN"))
    if chart.points:
        agree, of = chart.agreement
        off = max(abs(p.growth - p.predicted_growth) for p in chart.points)
        rows.append(("runs that do what the roots say", f"{agree} of {of}; growth differs by at most {off:.2g} 1/s"))
    return rows
