"""Points in the unit cube: what a member of an ensemble is made from, known by its number alone.

>>> Sampler("monte-carlo", dimension=2, seed=7).member(3)
array([0.9823228 , 0.06095135])
"""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from drillfem.errors import SceneError

F8 = npt.NDArray[np.float64]

METHODS = ("monte-carlo", "sobol", "latin-hypercube")


@dataclass(frozen=True)
class Sampler:
    """Members' points in the open unit cube of ``dimension``.

    method: "monte-carlo": member i has a stream of its own, `SeedSequence(seed, spawn_key=(*stream, i))`: the same bits
    whoever computes it, after and beside whatever others, of however many. "sobol" (scrambled; best with a power of
    two) and "latin-hypercube" (needs ``count``): row i of a set that follows from the seed, and for the latter from the
    count; a Sobol' set with more members begins with the same ones. stream: another set of the same seed, such as the
    level of a multilevel ensemble.

    Raises SceneError for an unknown method, and for a set without a count.
    """

    method: str
    dimension: int
    seed: int
    count: int | None = None
    stream: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise SceneError(f"sampling = {self.method!r}: must be one of {', '.join(METHODS)}")
        if self.method != "monte-carlo" and not self.count:
            raise SceneError(f"sampling = {self.method!r}: needs the number of members beforehand")
        if self.method == "sobol" and self.dimension > _most_dimensions():
            raise SceneError(
                f"sampling = 'sobol': there are {self.dimension} random numbers, must be at most {_most_dimensions()}"
            )

    def member(self, i: int) -> F8:
        """Point (dimension,) of member i, each number > 0 and < 1. Raises IndexError beyond the count of a set."""
        if self.method == "monte-carlo":
            sequence = np.random.SeedSequence(self.seed, spawn_key=(*self.stream, i))
            return opened(np.random.Generator(np.random.PCG64(sequence)).random(self.dimension))
        if not 0 <= i < (self.count or 0):
            raise IndexError(f"member {i}: must be from 0 to {(self.count or 0) - 1}")
        return np.array(self._set[i])

    @cached_property
    def _set(self) -> F8:
        from scipy.stats import qmc

        family = qmc.Sobol if self.method == "sobol" else qmc.LatinHypercube
        # SciPy is renaming the argument
        name = "rng" if "rng" in inspect.signature(family.__init__).parameters else "seed"
        sequence = np.random.SeedSequence(self.seed, spawn_key=self.stream)
        options: dict[str, Any] = {name: np.random.Generator(np.random.PCG64(sequence))}
        engine = family(self.dimension, **options)
        count = self.count or 1
        if self.method == "sobol":
            return opened(engine.random_base2((count - 1).bit_length())[:count])
        return opened(engine.random(count))


def opened(u: F8) -> F8:
    """Numbers from 0 to 1 without the ends, which an unbounded distribution has at infinity."""
    return np.clip(u, 2.0**-64, 1 - 2.0**-53)


def _most_dimensions() -> int:
    from scipy.stats import qmc

    return int(qmc.Sobol.MAXDIM)
