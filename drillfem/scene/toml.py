"""Plain data as TOML text, to be read by tomllib: tables, lists, texts and numbers."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any


def dumps(data: Mapping[str, Any], path: str = "") -> str:
    """TOML text of nested plain data: numbers to the last bit, one line per row of a list of lists."""
    tables = {name: value for name, value in data.items() if isinstance(value, Mapping) or _is_tables(value)}
    lines = [f"{_name(name)} = {_value(value)}" for name, value in data.items() if name not in tables]
    text = "".join(f"{line}\n" for line in lines)
    for name, value in tables.items():
        inside = f"{path}.{_name(name)}" if path else _name(name)
        if isinstance(value, Mapping):
            text += f"\n[{inside}]\n{dumps(value, inside)}"
        else:
            text += "".join(f"\n[[{inside}]]\n{dumps(entry, inside)}" for entry in value)
    return text


def _is_tables(value: Any) -> bool:
    return isinstance(value, list | tuple) and bool(value) and all(isinstance(x, Mapping) for x in value)


def _name(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _text(name)


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, list | tuple):
        rows = bool(value) and all(isinstance(x, list | tuple) for x in value)
        inside = (",\n  " if rows else ", ").join(map(_value, value))
        return f"[\n  {inside},\n]" if rows else f"[{inside}]"
    return repr(value)
