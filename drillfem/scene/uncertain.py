"""Random inputs of a scene: which numbers are not known, and how they are distributed.

A scene with random inputs stands for its means until `drillfem.ensemble` draws members from it.
"""

from __future__ import annotations

import dataclasses
import math
import re
import typing
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from drillfem.errors import SceneError
from drillfem.scene.keys import POSITIVE, Bound, Slot, at_least, guess, key, read, shown, slots
from drillfem.scene.units import to_si

#: What may vary along the hole, and the keys that it stands for.
FIELDS: dict[str, tuple[str, ...]] = {
    "contact.friction": ("contact.friction_static", "contact.friction_dynamic"),
    "contact.friction_static": ("contact.friction_static",),
    "contact.friction_dynamic": ("contact.friction_dynamic",),
}
#: Covariances by name; any other is the user's own, "module:function".
COVARIANCES = ("exponential", "squared-exponential", "matern")
_OWN = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*")
_OF_A_FIELD = (
    "mean", "standard_deviation", "covariance", "correlation_length", "smoothness", "terms", "captured_variance",
    "modes", "length",
)  # fmt: skip
_FEW = "norm, uniform, truncnorm, lognorm, triang, beta, gamma, weibull_min"


@dataclass(frozen=True)
class Random:
    """A random input, independent of the others: a number of the scene, or a Gaussian field along the hole.

    The numbers of `mean`, `standard_deviation`, `support` and of loc and scale have the unit of `key`. The scene itself
    runs at the means.
    """

    target: str = key(
        "what is random: the dotted key of a number of the scene (`top_drive.weight_on_bit`), or `contact.friction`: "
        "both coefficients. Those of [contact] may vary along the hole",
        name="key",
    )
    distribution: str | None = key(
        "a name of scipy.stats; without it the input is a field", default=None, default_text="a field"
    )
    parameters: tuple[tuple[str, float], ...] | None = key(
        "parameters of the distribution as scipy.stats calls them",
        default=None,
        default_text="those of scipy.stats",
        named=True,
    )
    support: tuple[float, ...] | None = key(
        "least and largest value: what is beyond is clipped to them, and counted",
        count=2,
        default=None,
        default_text="no limits",
    )
    proportional: tuple[str, ...] | None = key(
        "keys of other numbers of the scene that keep their ratio to this one", default=None, default_text="none"
    )
    mean: float | None = key("field: mean", default=None, default_text="required for a field")
    standard_deviation: float | None = key(
        "field: standard deviation", "1", POSITIVE, default=None, default_text="required for a field"
    )
    covariance: str | None = key(
        "field: 'exponential', 'squared-exponential', 'matern', or your own 'module:function' of the distance, or of "
        "two depths (m), over standard_deviation squared",
        default=None,
        default_text="exponential",
    )
    correlation_length: float | None = key(
        "field: b in exp(-d/b), exp(-d^2/(2 b^2)), and in Matern's covariance of d/b",
        "m",
        POSITIVE,
        default=None,
        default_text="required unless the covariance is your own",
    )
    smoothness: float | None = key(
        "matern: nu; 0.5 is exponential, infinity squared-exponential",
        "1",
        POSITIVE,
        default=None,
        default_text="required for matern",
    )
    terms: int | None = key(
        "field: terms of the Karhunen-Loeve expansion",
        bound=at_least(1),
        default=None,
        default_text="by captured_variance",
    )
    captured_variance: float | None = key(
        "field: share of the variance that the terms must have",
        "1",
        Bound("> 0 and < 1", lambda x: 0 < x < 1),
        default=None,
        default_text="0.95 without terms",
    )
    modes: str | None = key(
        "field: 'exact' eigenpairs (exponential), or by 'galerkin' on a mesh",
        choices=("exact", "galerkin"),
        default=None,
        default_text="exact where it can be",
    )
    length: float | None = key(
        "field: length of hole that it covers, from the top; as at its end below that",
        "m",
        POSITIVE,
        default=None,
        default_text="the string, and what it can drill",
    )
    name: str = ""

    def check(self) -> Iterator[tuple[str, str]]:
        if self.support is not None and not self.support[0] < self.support[1]:
            yield "support", "must be a least and a larger number"
        if self.distribution is None:
            yield from self._field_problems()
            return
        for name in _OF_A_FIELD:
            if getattr(self, name) is not None:
                yield (
                    name,
                    f"must be left out where distribution = {self.distribution!r} is given: it belongs to a field",
                )
        yield from self._distribution_problems(self.distribution)
        mean = float(self.frozen().mean())
        if not math.isfinite(mean):
            yield "distribution", "must have a mean, which the scene itself stands for"
        elif self.proportional and self.centre == 0:
            yield "proportional", "must be left out where the mean is 0"

    def _field_problems(self) -> Iterator[tuple[str, str]]:
        if self.target not in FIELDS:
            yield "distribution", f"must be a name of scipy.stats ({_FEW} ...): only {', '.join(FIELDS)} may be fields"
        if self.parameters is not None:
            yield "parameters", "must be left out where there is no distribution"
        if self.proportional is not None:
            yield "proportional", "must be left out of a field"
        for name in ("mean", "standard_deviation"):
            if getattr(self, name) is None:
                yield name, "must be a number for a field (or give a distribution)"
        kind = self.kernel
        own = kind not in COVARIANCES
        if own and not _OWN.fullmatch(kind):
            yield "covariance", f"must be one of {', '.join(COVARIANCES)}, or your own 'module:function'"
        if own and self.correlation_length is not None:
            yield "correlation_length", "must be left out where the covariance is your own"
        if not own and self.correlation_length is None:
            yield (
                "correlation_length",
                f"must be a number > 0 in m, or text with such a unit, for covariance = {kind!r}",
            )
        if (kind == "matern") != (self.smoothness is not None):
            yield (
                "smoothness",
                f"must be {'a number > 0' if kind == 'matern' else 'left out'} for covariance = {kind!r}",
            )
        if self.terms is not None and self.captured_variance is not None:
            yield "captured_variance", f"must be left out where terms = {self.terms} is given"
        if self.modes == "exact" and kind != "exponential":
            yield "modes", f"must be 'galerkin' for covariance = {kind!r}: only the exponential one has exact modes"
        low, high = self.support or (-math.inf, math.inf)
        if self.mean is not None and not low <= self.mean <= high:
            yield "mean", f"must be from {low:g} to {high:g}, within the support"

    def _distribution_problems(self, name: str) -> Iterator[tuple[str, str]]:
        from scipy import stats

        family = getattr(stats, name, None)
        if not isinstance(family, stats.rv_continuous | stats.rv_discrete):
            known = [n for n in dir(stats) if isinstance(getattr(stats, n), stats.rv_continuous | stats.rv_discrete)]
            close = guess(name, known)
            yield (
                "distribution",
                f"must be a name of scipy.stats, such as {_FEW}" + (f" ({close})" if close.startswith("did") else ""),
            )
            return
        shapes = [s.strip() for s in (family.shapes or "").split(",") if s.strip()]
        allowed = [*shapes, "loc", *(["scale"] if isinstance(family, stats.rv_continuous) else [])]
        given = dict(self.parameters or ())
        for parameter in given:
            if parameter not in allowed:
                yield f"parameters.{parameter}", f"must be one of {', '.join(allowed)} for distribution = {name!r}"
                return
        for parameter in shapes:
            if parameter not in given:
                yield f"parameters.{parameter}", f"must be a number for distribution = {name!r}"
                return
        if not math.isfinite(float(family(**given).ppf(0.5))):
            yield "parameters", f"must be such that distribution = {name!r} exists (scale > 0, and its shapes in range)"

    @property
    def is_field(self) -> bool:
        """Whether the input varies along the hole."""
        return self.distribution is None

    @property
    def kernel(self) -> str:
        """Covariance of a field, by name."""
        return self.covariance or "exponential"

    @property
    def targets(self) -> tuple[str, ...]:
        """The keys that the input sets."""
        return FIELDS.get(self.target, (self.target,))

    def frozen(self) -> Any:
        """The distribution of a number, of scipy.stats."""
        from scipy import stats

        return getattr(stats, self.distribution or "")(**dict(self.parameters or ()))

    @property
    def centre(self) -> float:
        """Value that the scene itself has: the mean, which the support may limit."""
        mean = self.mean if self.is_field else float(self.frozen().mean())
        low, high = self.support or (-math.inf, math.inf)
        return min(max(mean or 0.0, low), high)

    @property
    def spoken(self) -> str:
        """What is random, in a line."""
        if not self.is_field:
            given = ", ".join(f"{name} {value:g}" for name, value in self.parameters or ())
            return f"{self.target}: {self.distribution}" + (f" with {given}" if given else "")
        length = f" over {self.correlation_length:g} m" if self.correlation_length else ""
        deviation = f"mean {self.mean:g}, standard deviation {self.standard_deviation:g}"
        return f"{self.target} along the hole: {deviation}, covariance {self.kernel}{length}"


def number_at(root: type, dotted: str) -> Slot:
    """The number of a scene (tables from ``root`` down) that a dotted key names. Raises SceneError."""
    kind: Any = root
    slot: Slot | None = None
    for part in dotted.split("."):
        if dataclasses.is_dataclass(kind) and isinstance(kind, type):
            known = slots(kind)
            if part not in known:
                raise SceneError(f"must be the key of a number of the scene: {part!r} is none; {guess(part, known)}")
            slot = known[part]
            kind = slot.type
        elif typing.get_origin(kind) is tuple and part.isdecimal():
            kind = typing.get_args(kind)[0]
        else:
            break
    else:
        if slot is not None and kind in (float, int):
            return slot
    raise SceneError("must be the key of a number of the scene, such as top_drive.weight_on_bit or string.0.length")


def value_at(data: Any, dotted: str) -> Any:
    """What raw scene data holds at a dotted key; None where there is nothing."""
    for part in dotted.split("."):
        if isinstance(data, Mapping):
            data = data.get(part)
        elif isinstance(data, list | tuple) and part.isdecimal() and int(part) < len(data):
            data = data[int(part)]
        else:
            return None
    return data


def with_value(data: Any, dotted: str, value: Any) -> Any:
    """Raw scene data with another value at a dotted key; what is not on the way there is shared. Raises SceneError."""
    part, _, rest = dotted.partition(".")
    if isinstance(data, list | tuple):
        if not (part.isdecimal() and int(part) < len(data)):
            raise SceneError(f"there is no entry {part} of {len(data)}")
        i = int(part)
        return [*data[:i], with_value(data[i], rest, value) if rest else value, *data[i + 1 :]]
    if data is not None and not isinstance(data, Mapping):
        raise SceneError(f"{shown(data)} is no table")
    inside = with_value((data or {}).get(part), rest, value) if rest else value
    return {**(data or {}), part: inside}


def at_means(root: type, data: Mapping[str, Any]) -> Mapping[str, Any]:
    """Raw scene data with the means of its random inputs in their places, and these inputs in SI units.

    Raises SceneError for inputs that are wrong, and for a number that is given beside its random input.
    """
    tables = data.get("random")
    if not isinstance(tables, Mapping):
        return data
    plain, owner = {}, dict[str, str]()
    made = dict(data)
    for name, table in tables.items():
        here = f"random.{name}"
        if not re.fullmatch(r"[\w-]+", name):
            raise SceneError(f"{here} = {shown(table)}: a name must be of letters, digits, - and _")
        dotted = table.get("key") if isinstance(table, Mapping) else None
        targets = FIELDS.get(dotted, (dotted,)) if isinstance(dotted, str) else ()
        others = table.get("proportional") if isinstance(table, Mapping) else None
        others = [k for k in others if isinstance(k, str)] if isinstance(others, list | tuple) else []
        found = [_number(root, f"{here}.key", target) for target in targets]
        plain[name] = _in_si(table, found[0].key.unit, here) if found else table
        random = read(Random, plain[name], here)
        for target in [*targets, *others]:
            if target in owner:
                raise SceneError(f"{here}.key = {dotted!r}: {target} is that of random.{owner[target]} already")
            owner[target] = name
        for target, slot in zip(targets, found, strict=True):
            made = _put(made, target, slot, random, here)
        for i, other in enumerate(others):
            _number(root, f"{here}.proportional.{i}", other)
            if value_at(made, other) is None:
                raise SceneError(f"{here}.proportional.{i} = {other!r}: must be a key that the scene gives")
    return {**made, "random": plain}


def _number(root: type, where: str, dotted: str) -> Slot:
    try:
        return number_at(root, dotted)
    except SceneError as error:
        raise SceneError(f"{where} = {shown(dotted)}: {error}") from None


def _put(data: dict[str, Any], target: str, slot: Slot, random: Random, here: str) -> dict[str, Any]:
    """The data with the mean of a random input at its key."""
    mean: float = random.centre
    if slot.type is int:
        if not hasattr(random.frozen(), "pmf"):
            raise SceneError(
                f"{here}.distribution = {random.distribution!r}: must be a discrete one, such as randint or binom, for "
                f"the whole number {target}"
            )
        mean = round(mean)
    limit = slot.key.bound
    for i, end in enumerate(random.support or ()):
        if limit is not None and not limit.holds(end):
            raise SceneError(f"{here}.support.{i} = {end:g}: must be a number {limit.text}, as {target} is")
    given = value_at(data, target)
    if isinstance(given, str):
        given = _si(given, slot.key.unit, target)
    if given is not None and not (isinstance(given, int | float) and math.isclose(given, mean, rel_tol=1e-9)):
        raise SceneError(
            f"{target} = {shown(given)}: must be left out, or be the mean {mean:.10g}, where [{here}] makes it random"
        )
    try:
        return typing.cast(dict[str, Any], with_value(data, target, mean))
    except SceneError as error:
        raise SceneError(f"{here}.key = {shown(target)}: {error}") from None


def _in_si(table: Mapping[str, Any], unit: str, here: str) -> dict[str, Any]:
    """A random input with plain numbers in the place of text that has a unit, which is that of the key."""

    def plain(value: Any, path: str) -> Any:
        return _si(value, unit, path) if isinstance(value, str) else value

    made = dict(table)
    for name in ("mean", "standard_deviation"):
        if name in made:
            made[name] = plain(made[name], f"{here}.{name}")
    if isinstance(ends := made.get("support"), Sequence) and not isinstance(ends, str):
        made["support"] = [plain(x, f"{here}.support.{i}") for i, x in enumerate(ends)]
    if isinstance(given := made.get("parameters"), Mapping):
        made["parameters"] = {
            name: plain(x, f"{here}.parameters.{name}") if name in ("loc", "scale") else x for name, x in given.items()
        }
    return made


def _si(text: str, unit: str, where: str) -> float:
    try:
        return to_si(text, unit)
    except ValueError as error:
        of = "" if unit == "1" else f" in {unit}, or text with such a unit"
        raise SceneError(f"{where} = {text!r}: must be a number{of} ({text!r} {error})") from None
