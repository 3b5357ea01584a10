"""Random inputs of a scene: from numbers between 0 and 1 to a scene that can be run.

>>> from drillfem.ensemble.sampling import Sampler
>>> from drillfem.scene import load_scene
>>> inputs = Inputs.of(load_scene("vertical-c1-cd4", {
...     "top_drive.weight_on_bit": None,
...     "random.weight.key": "top_drive.weight_on_bit",
...     "random.weight.distribution": "norm",
...     "random.weight.parameters": {"loc": "45 kN", "scale": "2 kN"},
... }))
>>> inputs.dimension, inputs.names
(1, ('weight',))
>>> inputs.member(Sampler("monte-carlo", 1, seed=0).member(0)).scene.top_drive.weight_on_bit
48159.84...
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from drillfem.ensemble.fields import F8, KarhunenLoeve, Modes, covariance, exact_modes, galerkin_modes
from drillfem.errors import SceneError
from drillfem.scene import Scene
from drillfem.scene.uncertain import FIELDS, Random, number_at, value_at, with_value

STATIC, DYNAMIC = FIELDS["contact.friction"]
#: Share of the variance of a field that its terms have where a scene does not say.
CAPTURED = 0.95


@dataclass(frozen=True)
class Member:
    """One member of an ensemble.

    scene: a plain one, without random inputs. scalars: the random numbers that it has, by name, SI. fields: rows
    (m, 2) of measured depth (m) and value, by name. clips: how many of all these numbers lay beyond their support.
    """

    scene: Scene
    scalars: dict[str, float]
    fields: dict[str, F8]
    clips: int


@dataclass(frozen=True)
class Number:
    """A random number of the scene: what to set, and the inverse of its distribution."""

    random: Random
    proportional: dict[str, float]  # other keys, with their ratio to this one
    whole: bool

    def at(self, u: float) -> tuple[float, int]:
        """Value for a number from 0 to 1, and 1 if it was clipped."""
        value = float(self.random.frozen().ppf(u))
        low, high = self.random.support or (-math.inf, math.inf)
        clipped = min(max(value, low), high)
        return (round(clipped) if self.whole else clipped), int(clipped != value)

    def put(self, data: Any, value: float) -> Any:
        """Raw scene data with this value, and what is proportional to it."""
        for target, ratio in [*((t, 1.0) for t in self.random.targets), *self.proportional.items()]:
            data = with_value(data, target, ratio * value)
        return data


@dataclass(frozen=True)
class Field:
    """A random field on the hole, at the points (m,; m) of the table that a member gets."""

    random: Random
    expansion: KarhunenLoeve
    points: F8
    scaled: F8  # (terms, m)


@dataclass(frozen=True)
class Inputs:
    """All random inputs of a scene. It can be pickled: one process makes the modes, and all have the same.

    ``order``: per number from 0 to 1 the input and, of a field, the term. Numbers come first, then terms by their share
    of the variance, for the first coordinates of a quasi-random set are its best.
    """

    data: Mapping[str, Any]  # the scene at its means, plain
    numbers: dict[str, Number]
    fields: dict[str, Field]
    order: tuple[tuple[str, int], ...]

    @classmethod
    def of(cls, scene: Scene) -> Inputs:
        """Inputs of a scene with [random] tables. Raises SceneError, also for modes that cannot be had."""
        if not scene.random:
            raise SceneError("missing key random: one or more tables [random.NAME] say what is random")
        data = scene.to_dict()
        del data["random"]
        data["model"] = scene.resolved_model().name  # one for all members
        numbers = {r.name: _number(r, data) for r in scene.random if not r.is_field}
        fields = {r.name: _field(r, scene) for r in scene.random if r.is_field}
        terms = [
            (-float(share), name, k)
            for name, field in fields.items()
            for k, share in enumerate(field.expansion.modes.eigenvalues / field.expansion.modes.variance)
        ]
        order = (*((name, 0) for name in numbers), *((name, k) for _, name, k in sorted(terms)))
        return cls(data, numbers, fields, order)

    @property
    def dimension(self) -> int:
        """How many numbers from 0 to 1 make a member."""
        return len(self.order)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of these numbers: that of the input, and for a field the term, counted from 1."""
        return tuple(f"{name}[{k + 1}]" if name in self.fields else name for name, k in self.order)

    @property
    def facts(self) -> dict[str, dict[str, Any]]:
        """What each input is, plain, for a record: of a field its terms, the variance they have, its length."""
        told: dict[str, dict[str, Any]] = {name: {"input": n.random.spoken} for name, n in self.numbers.items()}
        for name, field in self.fields.items():
            expansion = field.expansion
            told[name] = {
                "input": field.random.spoken,
                "terms": expansion.terms,
                "captured_variance": expansion.captured,
                "modes": _method(field.random),
                "length": expansion.modes.length,
                "points": len(field.points),
            }
        return told

    @property
    def middle(self) -> Scene:
        """Scene of the member in the middle of all inputs: one like those of the others."""
        return self.member(np.full(self.dimension, 0.5)).scene

    def member(self, u: npt.ArrayLike) -> Member:
        """Member of numbers u (dimension,), each > 0 and < 1. Raises SceneError where its scene is impossible."""
        from scipy.special import ndtri

        u = np.asarray(u, dtype=np.float64)
        if u.shape != (self.dimension,) or not ((u > 0) & (u < 1)).all():
            raise ValueError(f"u has shape {u.shape}, must be ({self.dimension},), of numbers > 0 and < 1")
        data, clips = self.data, 0
        scalars: dict[str, float] = {}
        normal = {name: np.empty(field.expansion.terms) for name, field in self.fields.items()}
        for (name, k), x in zip(self.order, u, strict=True):
            if name in self.numbers:
                number = self.numbers[name]
                value, clipped = number.at(float(x))
                scalars[name] = value
                clips += clipped
                data = number.put(data, value)
            else:
                normal[name][k] = ndtri(x)
        rows: dict[str, F8] = {}
        for name, field in self.fields.items():
            values, clipped = field.expansion.sum(field.scaled, normal[name])
            rows[name] = np.column_stack([field.points, values])
            clips += clipped
        if rows:
            profile, clipped = self._profile(rows, data)
            data = with_value(data, "contact.friction_profile", profile.tolist())
            clips += clipped
        return Member(Scene.from_dict(data), scalars, rows, clips)

    def _profile(self, rows: Mapping[str, F8], data: Mapping[str, Any]) -> tuple[F8, int]:
        """Rows (m, 3) of measured depth (m) and both coefficients, and how often the dynamic one was cut down."""
        at = np.unique(np.concatenate([table[:, 0] for table in rows.values()]))
        values = {key: np.full(len(at), float(value_at(data, key))) for key in (STATIC, DYNAMIC)}
        for name, table in rows.items():
            for target in self.fields[name].random.targets:
                values[target] = np.interp(at, table[:, 0], table[:, 1])
        over = values[DYNAMIC] > values[STATIC]  # friction at rest is the larger one, by its meaning
        return np.column_stack([at, values[STATIC], np.minimum(values[STATIC], values[DYNAMIC])]), int(over.sum())


def _number(random: Random, data: Mapping[str, Any]) -> Number:
    proportional = {target: value_at(data, target) / random.centre for target in random.proportional or ()}
    return Number(random, proportional, number_at(Scene, random.targets[0]).type is int)


def _method(random: Random) -> str:
    return random.modes or ("exact" if random.kernel == "exponential" else "galerkin")


def _field(random: Random, scene: Scene) -> Field:
    length = random.length or reach(scene)
    terms = random.terms
    captured = None if terms is not None else random.captured_variance or CAPTURED
    deviation, span = random.standard_deviation or 0.0, random.correlation_length
    modes: Modes
    try:
        if _method(random) == "exact":
            modes = exact_modes(length, deviation, span or 0.0, terms, captured)
        else:
            kernel = covariance(random.kernel, deviation, span, random.smoothness)
            modes = galerkin_modes(kernel, length, terms, captured)
    except SceneError as error:
        raise SceneError(f"random.{random.name}.{error}") from None
    low, high = random.support or (-math.inf, math.inf)
    expansion = KarhunenLoeve(random.mean or 0.0, modes, (low, high))
    points = np.linspace(0.0, length, 1 + max(1, math.ceil(length / expansion.spacing)))
    return Field(random, expansion, points, expansion.scaled(points))


def reach(scene: Scene) -> float:
    """Length of hole (m) that a field covers unless told: the string, and twice what it gains in the run.

    It gains what its block speed, or steady drilling, takes it. How far a string slides that is pushed by a force is
    not known beforehand: a field on such a hole ends with the string, and goes on as it ends.
    """
    return scene.length + 2 * scene.gain()
