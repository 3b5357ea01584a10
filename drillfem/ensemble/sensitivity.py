"""Which random input the spread of an answer comes from: Sobol' indices, by SALib.

First order: share of the variance that would go if the input were known. Total: share that would be left if all others
were known. Their difference is what the input does only together with others.

>>> import numpy as np
>>> found = sensitivity(lambda u: 2 * u[:, 0] + u[:, 1], ("rock", "weight"), count=256)
>>> print(found.first["rock"], "|", found.total["weight"])
0.8 (0.672 to 0.928) | 0.2 (0.168 to 0.232)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from drillfem.ensemble.sampling import opened
from drillfem.ensemble.statistics import CONFIDENCE, Estimate
from drillfem.errors import MissingDependency, SceneError

F8 = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Indices:
    """Indices by name of the input, each with its 95 % interval.

    evaluations: how many members were run. failed: of these. blocks: base points that counted; one of whose members
    failed does not.
    """

    first: dict[str, Estimate]
    total: dict[str, Estimate]
    mean: float
    variance: float
    evaluations: int
    failed: int
    blocks: int

    @property
    def together(self) -> float:
        """Share of the variance that comes from inputs together, at least 0: what first orders leave of 1."""
        return max(0.0, 1 - sum(x.value for x in self.first.values()))

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON."""
        return {
            "first": {name: vars(x) for name, x in self.first.items()},
            "total": {name: vars(x) for name, x in self.total.items()},
            "mean": self.mean,
            "variance": self.variance,
            "evaluations": self.evaluations,
            "failed": self.failed,
            "blocks": self.blocks,
        }


def sensitivity(
    function: Callable[[F8], F8],
    names: Sequence[str],
    count: int,
    seed: int = 0,
    groups: Sequence[str] | None = None,
) -> Indices:
    """Indices of ``function``, of points (n, dimension) between 0 and 1 to values (n,), nan where a member failed.

    names (dimension,): of the numbers. count: of base points, best a power of two; there are count x (inputs + 2)
    members. groups (dimension,): input that each number belongs to, such as the field of a term; indices are then those
    of the inputs, and cost no more for a field of many terms than for a number.

    Intervals come from resampling base points. Raises SceneError: nothing varies, or too many members failed.
    """
    try:
        from SALib.analyze import sobol as analysis
        from SALib.sample import sobol as sampling
    except ModuleNotFoundError as error:
        raise MissingDependency("sensitivities need SALib: pip install SALib") from error
    if count < 4:
        raise SceneError(f"count = {count}: must be at least 4 base points")
    problem: dict[str, Any] = {"num_vars": len(names), "names": list(names), "bounds": [[0.0, 1.0]] * len(names)}
    inputs = list(dict.fromkeys(groups if groups is not None else names))
    if groups is not None:
        problem["groups"] = list(groups)
    # SALib warns where the count is no power of two, and skips a first point that scrambling has made as good as others
    base = 2 ** math.ceil(math.log2(count))
    points = sampling.sample(problem, base, calc_second_order=False, scramble=True, skip_values=0, seed=seed)
    block = len(inputs) + 2
    values = np.asarray(function(opened(points[: count * block])), dtype=np.float64).reshape(count, block)
    good = np.isfinite(values).all(axis=1)
    failed = int((~np.isfinite(values)).sum())
    if good.sum() < 4:
        raise SceneError(f"{failed} of {values.size} members failed: too many to compute indices from the others")
    kept = values[good]
    if np.ptp(kept) <= 1e-12 * np.abs(kept).max():
        raise SceneError("the answer does not vary: no input has any influence on it")
    found = analysis.analyze(
        problem,
        # indices do not depend on the mean; their errors do
        (kept - kept.mean()).reshape(-1),
        calc_second_order=False,
        num_resamples=1000,
        conf_level=CONFIDENCE,
        seed=seed,
    )
    from scipy.stats import norm

    z = float(norm.ppf((1 + CONFIDENCE) / 2))

    def estimates(kind: str) -> dict[str, Estimate]:
        pairs = zip(inputs, found[kind], found[f"{kind}_conf"], strict=True)
        return {name: Estimate(float(x), float(x - half), float(x + half), float(half) / z) for name, x, half in pairs}

    plain = kept[:, [0, -1]]
    return Indices(
        estimates("S1"),
        estimates("ST"),
        float(plain.mean()),
        float(plain.var(ddof=1)),
        values.size,
        failed,
        int(good.sum()),
    )
