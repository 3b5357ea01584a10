"""Speed against accuracy: error over cost of every method, measured, fitted and drawn (`drillfem chart`)."""

from __future__ import annotations

from collections.abc import Callable

from .points import Chart

CASES = ("waves", "lumped", "torsional", "axial-torsional", "off-bottom")


def compute(case: str, quick: bool = False, progress: Callable[[str], None] = lambda _: None) -> Chart:
    """Compute a case of `CASES`: minutes, or seconds if ``quick``. ``progress`` is told what is being computed."""
    if case == "waves":
        from . import waves

        return waves.chart(waves.QUICK if quick else waves.FULL, progress)
    if case == "off-bottom":
        from . import off_bottom

        return off_bottom.chart(off_bottom.QUICK if quick else off_bottom.FULL, progress)
    from . import drilling

    return drilling.chart(case, (drilling.QUICK if quick else drilling.FULL)[case], progress)


__all__ = ["CASES", "Chart", "compute"]
