"""Units at the edge: text such as "5 in" or "120 rpm" becomes a plain SI number here, and nowhere else."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Any

_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*$", re.DOTALL)
_PER_LENGTH = re.compile(r"/\s*(\d+(?:\.\d+)?)\s*([A-Za-z]+)$")  # the drillers' "3 deg/30 m"
_POWER = re.compile(r"(?<=[A-Za-z])(\d)")  # "kg/m3" as in a data sheet
_ANGLES = {
    "radian",
    "degree",
    "turn",
    "revolution",
    "revolutions_per_minute",
    "arcminute",
    "arcsecond",
    "gradian",
    "revolutions_per_second",
}


@lru_cache(maxsize=1)
def _registry() -> Any:
    import pint  # slow to import, and only needed once a scene carries text units

    return pint.UnitRegistry()


def to_si(text: str, unit: str) -> float:
    """Number in `unit` (SI, "1" for a pure number) that `text` such as "45.7 kN" stands for.

    Angles are kept apart from pure numbers and from frequencies: "2 Hz" is no angular speed, although
    its dimension is the same. Raises ValueError with a short reason.
    """
    match = _NUMBER.match(text)
    if match is None:
        raise ValueError("is not a number with a unit")
    number, unit_text = float(match[1]), match[2]
    per = _PER_LENGTH.search(unit_text)
    if per is not None:
        number /= float(per[1])
        unit_text = unit_text[: per.start()] + "/" + per[2]
    registry = _registry()
    try:
        given = registry.parse_units(_POWER.sub(r"**\1", unit_text))
        value = registry.Quantity(number, given).to(registry.parse_units(unit if unit != "1" else "")).magnitude
    except Exception as error:  # pint, its tokenizer and Python's arithmetic each raise their own kinds here
        if "not defined" in str(error):
            raise ValueError(f"has an unknown unit {unit_text!r}") from None
        raise ValueError(f"has the wrong unit {unit_text!r}") from None
    has_angle = any(name in _ANGLES for name in given._units)
    if has_angle != ("rad" in unit) and unit in {"1", "rad", "rad/s"}:
        raise ValueError(f"has the wrong unit {unit_text!r}")
    return float(value)
