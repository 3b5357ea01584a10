"""Where the vertices of a string's mesh lie. NumPy only: small models have no DOLFINx."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt


def distribute(lengths: Sequence[float], elements: int) -> list[int]:
    """Elements of each section: at least one, in proportion to length (largest remainder).

    Raises ValueError if there are fewer elements than sections.
    """
    if elements < len(lengths):
        raise ValueError(f"{elements} elements for {len(lengths)} sections: at least one each")
    ideal = np.asarray(lengths) / np.sum(lengths) * elements
    count = np.maximum(1, np.floor(ideal).astype(int))
    while count.sum() < elements:
        count[np.argmax(ideal - count)] += 1
    while count.sum() > elements:
        count[np.argmax(np.where(count > 1, count - ideal, -np.inf))] -= 1
    return [int(n) for n in count]


def nodes(lengths: Sequence[float], elements: int, grading: float = 1.0) -> npt.NDArray[np.float64]:
    """Vertices (elements + 1, m). ``grading``: last over first element length inside the last section (geometric)."""
    counts = distribute(lengths, elements)
    points = [0.0]
    for i, (length, n) in enumerate(zip(lengths, counts, strict=True)):
        ratio = grading if i == len(lengths) - 1 else 1.0
        size = ratio ** (np.arange(n) / max(1, n - 1))
        points.extend(points[-1] + length * np.cumsum(size) / size.sum())
    points[-1] = float(np.sum(lengths))
    return np.array(points)
