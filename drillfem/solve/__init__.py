"""Solvers around a semi-discrete system: SNES statics, TS dynamics, the condensed engine, and whole runs."""

from __future__ import annotations

from importlib import import_module
from typing import Any

_HOME = {"certify": "run", "resume": "run", "simulate": "run", "warm_up": "warm"}


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(f".{_HOME[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
