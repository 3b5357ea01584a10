"""Radius of the hole, and friction on its wall, along measured depth: piecewise linear."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .table import F8

Rows = Sequence[Sequence[float | None]] | F8

#: Steepest change of radius per length of hole. A step of the wall (casing shoe, edge of a wash-out) is a slope of this
#: grade, cut into the wider side: what is in a wider hole must be able to slide out of it.
STEEPEST = 0.05
#: Length over which friction steps from one section to the next, m.
STEP = 1e-3


def stairs(length: float, ends: Sequence[float], values: Sequence[Sequence[float]]) -> tuple[F8, F8]:
    """Steps at the ends of sections but the last: depths (2n,), each step twice, and values (2n, columns)."""
    inner = [end for end in ends[:-1] if end < length]
    at = np.repeat([0.0, *inner, max(length, *ends[-1:], 1.0)], 2)[1:-1]
    return at, np.repeat(np.array(values, dtype=np.float64)[: len(inner) + 1], 2, axis=0)


def limited(at: F8, value: F8, slope: float = STEEPEST) -> tuple[F8, F8]:
    """The greatest piecewise linear function below another that is nowhere steeper than ``slope``.

    at (n,) does not decrease; where a depth stands twice, the function steps. Returns depths that increase, and values.
    """
    for _ in range(2):  # what rises, then, mirrored, what falls
        points = [(float(at[0]), float(value[0]))]
        for a, b, up, v in zip(at[:-1], at[1:], value[:-1], value[1:], strict=True):
            now = points[-1][1]
            if a == b:
                reached = min(now, v)
            else:
                reached = min(v, now + slope * (b - a))
                grade = (v - up) / (b - a)
                if now < up and reached == v and grade != slope:  # the slope meets the given line on the way
                    meet = (up - now) / (slope - grade)
                    if 0 < meet < b - a:
                        points.append((float(a + meet), float(now + slope * meet)))
            if a == b and reached == now:
                continue
            points.append((float(b), float(reached)))
        at, value = (np.array(column) for column in zip(*points, strict=True))
        at, value = -at[::-1], value[::-1]
    keep = np.append(np.diff(at) > 0, True)
    return np.ascontiguousarray(at[keep]), np.ascontiguousarray(value[keep])


def radius_profile(length: float, diameter: float, sections: Rows = (), caliper: Rows = ()) -> tuple[F8, F8]:
    """Depths (n,) and radii (n,) in m of a hole of ``length`` m.

    sections: rows (measured depth of the lower end, diameter or None for ``diameter``) from the top down; below the
    last one it is ``diameter``. caliper: rows (measured depth, diameter), in the place of the sections where it
    reaches. Changes are no steeper than `STEEPEST`.
    """
    rows = [(float(row[0] or 0.0), float(row[1] or diameter)) for row in sections]
    rows.append((max(length, *(end for end, _ in rows[-1:]), 1.0), diameter))
    at, d = stairs(length, [end for end, _ in rows], [[wide] for _, wide in rows])
    value = d[:, 0] / 2
    if len(caliper):
        measured = np.asarray(caliper, dtype=np.float64)
        top, bottom = measured[0, 0], measured[-1, 0]
        above, below = at < top, at > bottom
        # the sections' radius just outside the caliper's range: the step is there twice
        ends = [value[above][-1:] if above.any() else [], value[below][:1] if below.any() else []]
        at = np.concatenate([at[above], [top] * len(ends[0]), measured[:, 0], [bottom] * len(ends[1]), at[below]])
        value = np.concatenate([value[above], ends[0], measured[:, 1] / 2, ends[1], value[below]])
    if len(at) == 1:
        at, value = np.array([0.0, max(length, 1.0)]), np.repeat(value, 2)
    return limited(at, value)


def friction_profile(
    length: float, static: float, dynamic: float, sections: Rows = (), profile: Rows = ()
) -> tuple[F8, F8]:
    """Depths (n,; m) and static and dynamic coefficients (n, 2) along a hole of ``length`` m.

    sections: rows (measured depth of the lower end, mu_s, mu_d; None for ``static``, ``dynamic``) from the top down;
    below the last one they are ``static``, ``dynamic``. profile: rows (measured depth, mu_s, mu_d), in the place of
    the sections, linear between.
    """
    if len(profile):
        rows = np.asarray(profile, dtype=np.float64)
        if len(rows) == 1:
            rows = np.vstack([rows, rows + [1.0, 0.0, 0.0]])
        return np.ascontiguousarray(rows[:, 0]), np.ascontiguousarray(rows[:, 1:])
    given = [(float(end or 0.0), s, d) for end, s, d in sections]
    given.append((max(length, *(end for end, _, _ in given[-1:]), 1.0), None, None))
    values = [[static if s is None else float(s), dynamic if d is None else float(d)] for _, s, d in given]
    at, value = stairs(length, [end for end, _, _ in given], values)
    at[1:-1] += STEP / 2 * np.where(np.arange(len(at) - 2) % 2, 1.0, -1.0)
    return at, value
