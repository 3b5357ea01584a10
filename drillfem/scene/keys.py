"""One reader for all tables of a scene: what a key may be is written beside its dataclass field.

`key(...)` declares a field with its meaning, SI unit and limits; `read(Table, data)` turns a parsed TOML
table into that frozen dataclass; `write(table)` is the way back. Every complaint is a SceneError of one line
that names the key (dotted, as for `--set`), its value as given, and what is allowed.
"""

from __future__ import annotations

import dataclasses
import difflib
import math
import types
import typing
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from functools import cache
from typing import Any, TypeVar

from drillfem.errors import SceneError
from drillfem.scene.units import to_si

T = TypeVar("T")


@dataclasses.dataclass(frozen=True)
class Bound:
    """Limit of a number: the words for it, and the test."""

    text: str
    holds: Callable[[float], bool]


POSITIVE = Bound("> 0", lambda x: x > 0)
NOT_NEGATIVE = Bound(">= 0", lambda x: x >= 0)


def at_least(low: float) -> Bound:
    return Bound(f">= {low:g}", lambda x: x >= low)


def between(low: float, high: float) -> Bound:
    return Bound(f"from {low:g} to {high:g}", lambda x: low <= x <= high)


@dataclasses.dataclass(frozen=True)
class Key:
    """What a field means: `unit` is SI ("1" for a pure number), `count` the length of a list, `name` the TOML
    key where it differs from the attribute, `default_text` says a default that depends on other keys. `named`: the
    entries have names of the user's own, in a tuple of tables (with a `name`) or of (name, number)."""

    doc: str
    unit: str = "1"
    bound: Bound | None = None
    choices: tuple[str, ...] = ()
    count: int | None = None
    name: str = ""
    default_text: str = ""
    named: bool = False


@dataclasses.dataclass(frozen=True)
class Slot:
    """A key of a table, with its type taken from the dataclass."""

    attribute: str
    key: Key
    type: Any
    required: bool
    default: Any

    @property
    def expects(self) -> str:
        """What is allowed, in words: "a number > 0 in m, or text with a unit"."""
        k = self.key
        limit = f" {k.bound.text}" if k.bound else ""
        if self.type is float:
            return f"a number{limit}" if k.unit == "1" else f"a number{limit} in {k.unit}, or text with such a unit"
        if self.type is int:
            return f"a whole number{limit}"
        if self.type is bool:
            return "true or false"
        if self.type is str:
            return "one of " + ", ".join(k.choices) if k.choices else "one line of text, not empty"
        if typing.get_origin(self.type) is tuple:
            item = typing.get_args(self.type)[0]
            if k.named:
                return "a table of tables" if dataclasses.is_dataclass(item) else "a table of numbers"
            if dataclasses.is_dataclass(item):
                return "one or more tables"
            if typing.get_origin(item) is tuple:
                return "a list of rows of numbers"
            if item is str:
                return "a list of any of " + ", ".join(k.choices) if k.choices else "a list of texts"
            many = "numbers" if k.count is None else f"{k.count} numbers"
            return f"a list of {many}{limit}" + ("" if k.unit == "1" else f" in {k.unit}")
        return "a table with " + ", ".join(slots(self.type))


def key(
    doc: str,
    unit: str = "1",
    bound: Bound | None = None,
    *,
    default: Any = dataclasses.MISSING,
    choices: Iterable[str] = (),
    count: int | None = None,
    name: str = "",
    default_text: str = "",
    named: bool = False,
) -> Any:
    """Dataclass field that `read` understands; without a default the key is required."""
    meta = Key(doc, unit, bound, tuple(choices), count, name, default_text, named)
    return dataclasses.field(default=default, metadata={"key": meta})


def slots(table: Any) -> dict[str, Slot]:
    """Keys of a table (a dataclass) by their TOML name, in the order of the dataclass."""
    return _slots(typing.cast(Hashable, table))


@cache
def _slots(table: Any) -> dict[str, Slot]:
    hints = typing.get_type_hints(table)
    found = {}
    for f in dataclasses.fields(table):
        if "key" not in f.metadata:
            continue
        kind = hints[f.name]
        if isinstance(kind, types.UnionType):  # X | None: None only ever means "not given"
            kind = next(a for a in typing.get_args(kind) if a is not types.NoneType)
        meta: Key = f.metadata["key"]
        found[meta.name or f.name] = Slot(f.name, meta, kind, f.default is dataclasses.MISSING, f.default)
    return found


def shown(value: Any) -> str:
    """A value as given, short enough for one line."""
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."


def join(where: str, name: str | int) -> str:
    return f"{where}.{name}" if where else str(name)


def guess(name: str, known: Iterable[str]) -> str:
    """ "did you mean ...?" or the list of what there is."""
    names = list(known)
    close = difflib.get_close_matches(name, names, n=1)
    return f"did you mean {close[0]!r}?" if close else "known are " + ", ".join(names)


def complaint(root: Mapping[str, Any], path: str, message: str, where: str = "") -> SceneError:
    """Error about the key at `path` in the raw data `root` (itself at `where`), with its value if given."""
    value: Any = root
    for part in path.split("."):
        if isinstance(value, Mapping) and part in value:
            value = value[part]
        elif isinstance(value, list | tuple) and part.isdigit() and int(part) < len(value):
            value = value[int(part)]
        else:
            return SceneError(f"missing key {join(where, path)}: {message}")
    return SceneError(f"{join(where, path)} = {shown(value)}: {message}")


def read(table: type[T], raw: Any, where: str = "") -> T:
    """Frozen dataclass `table` from parsed TOML (or JSON) data; `where` is the dotted path of the table.

    A table may define `check()`, yielding (key, message) for values that do not fit together, and `lacking(raw)`:
    keys that those given make a duty.
    Raises SceneError.
    """
    known = slots(table)
    if not isinstance(raw, Mapping):
        raise SceneError(f"{where} = {shown(raw)}: must be a table with {', '.join(known)}")
    for name, value in raw.items():
        if name not in known:
            raise SceneError(f"unknown key {join(where, name)} = {shown(value)}: {guess(name, known)}")
    values = {}
    for name, slot in known.items():
        path = join(where, name)
        if name in raw:
            values[slot.attribute] = _convert(slot, raw[name], path)
        elif slot.required:
            raise SceneError(f"missing key {path}: must be {slot.expects} ({slot.key.doc})")
    made = table(**values)
    lacking: Callable[[Mapping[str, Any]], Iterable[str]] = getattr(made, "lacking", lambda _: ())
    for name in lacking(raw):
        slot = known[name]
        raise SceneError(f"missing key {join(where, name)}: must be {slot.expects} ({slot.key.doc})")
    problems: Iterator[tuple[str, str]] = getattr(made, "check", lambda: iter(()))()
    for name, message in problems:
        raise complaint(raw, name, message, where)
    return made


def _convert(slot: Slot, value: Any, path: str) -> Any:
    kind = slot.type
    if dataclasses.is_dataclass(kind):
        return read(typing.cast(type, kind), value, path)
    if slot.key.named:
        return _named(slot, value, path)
    if typing.get_origin(kind) is not tuple:
        return _scalar(slot, value, path)
    item = typing.get_args(kind)[0]
    wanted = slot.key.count
    if not isinstance(value, list | tuple) or not value or (wanted is not None and len(value) != wanted):
        raise SceneError(f"{path} = {shown(value)}: must be {slot.expects}")
    entry = dataclasses.replace(slot, type=item)
    return tuple(_convert(entry, v, join(path, i)) for i, v in enumerate(value))


def _named(slot: Slot, value: Any, path: str) -> Any:
    """Tuple of tables that carry their names, or of (name, number)."""
    if not isinstance(value, Mapping):
        raise SceneError(f"{path} = {shown(value)}: must be {slot.expects}")
    item = typing.get_args(slot.type)[0]
    if dataclasses.is_dataclass(item):
        made: dict[str, Any] = {}
        for name, raw in value.items():
            made[name] = dataclasses.replace(read(typing.cast(Any, item), raw, join(path, name)), name=name)
        return tuple(made.values())
    entry = dataclasses.replace(slot, type=typing.get_args(item)[1], key=dataclasses.replace(slot.key, named=False))
    return tuple((name, _convert(entry, number, join(path, name))) for name, number in value.items())


def _scalar(slot: Slot, value: Any, path: str) -> Any:
    k, reason = slot.key, ""
    if slot.type is bool and isinstance(value, bool):
        return value
    if slot.type is str and isinstance(value, str):
        if k.choices:
            if value in k.choices:
                return value
            close = difflib.get_close_matches(value, k.choices, n=1)
            reason = f" (did you mean {close[0]!r}?)" if close else ""
        elif value.strip() and value.isprintable():
            return value
    if slot.type in (int, float) and not isinstance(value, bool):
        try:
            number = to_si(value, k.unit) if isinstance(value, str) and slot.type is float else value
            if isinstance(number, int | float):
                if not math.isfinite(number):
                    raise ValueError("is not finite")
                if number and not 1e-30 < abs(number) < 1e30:  # keeps products of some of them finite
                    raise ValueError("is beyond all sizes that can be meant")
                if (slot.type is float or float(number).is_integer()) and (k.bound is None or k.bound.holds(number)):
                    return slot.type(number)
        except (ValueError, OverflowError) as error:
            reason = f" ({shown(value)} {error})" if isinstance(error, ValueError) else " (too large)"
    raise SceneError(f"{path} = {shown(value)}: must be {slot.expects}{reason}")


def write(table: Any) -> dict[str, Any]:
    """Nested plain data (dict, list and SI numbers) of a table; what was not given (None, nan) is left out."""
    plain: dict[str, Any] = {}
    for name, slot in slots(type(table)).items():
        value = getattr(table, slot.attribute)
        if value is None or value != value or (slot.key.named and not value):
            continue
        if slot.key.named:
            plain[name] = {x.name: write(x) for x in value} if dataclasses.is_dataclass(value[0]) else dict(value)
        else:
            plain[name] = _plain(value)
    return plain


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return write(value)
    return [_plain(v) for v in value] if isinstance(value, tuple) else value
