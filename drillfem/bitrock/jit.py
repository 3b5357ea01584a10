"""The compiler of the kernels: numba with a cache on disk that notices every change.

Numba keys its cache on the file of the compiled function alone, so a change in a function that it calls, in another
file, would go unnoticed.  Here the cache lies in a folder named after the contents of all kernels.
"""

from __future__ import annotations

import hashlib
import inspect
import logging
import os
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any, TypeVar

import numba
import numpy as np
from numba.core.options import DefaultOptions
from numpy.typing import NDArray

F = TypeVar("F", bound=Callable[..., Any])

#: The user's folder, or numba's own setting (NUMBA_CACHE_DIR).
_BASE = numba.config.CACHE_DIR or os.path.join(
    os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "drillfem", "numba"
)


#: Without numba's memory management, where the installed version can do without.
_LEAN: dict[str, Any] = {"_nrt": False} if hasattr(DefaultOptions, "_nrt") else {}

#: Cache folders of the kernels that are loaded.
_folders: set[str] = set()


def announce() -> None:
    """Tell the user, through the logger ``drillfem``, when the next calls will compile: once, it takes a while."""
    if any(not any(Path(folder).rglob("*.nbi")) for folder in _folders):
        logging.getLogger("drillfem").info("compiling kernels, once")
        _folders.clear()  # said of these


@cache
def _digest(path: str) -> str:
    """Hash of all kernels of this package and of the file at ``path``."""
    files = sorted({*Path(__file__).parent.glob("*.py"), Path(path)})
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:16]


def kernel(*fastmath: str, lean: bool = False) -> Callable[[F], F]:
    """Decorator: compile on first call and keep on disk.  ``fastmath``: LLVM flags that are allowed.

    ``lean``: the function allocates nothing (no new arrays, no copies of slices), so its arrays need no reference
    counts; counting those of a surface with its twenty arrays takes longer than a step of a small string.
    """
    options: dict[str, Any] = {"fastmath": set(fastmath) or False} | (_LEAN if lean else {})

    def compiled(function: F) -> F:
        return _on_disk(function, numba.njit, options)

    return compiled


def callback(signature: str) -> Callable[[Callable[..., None]], Any]:
    """Decorator: compile for C to call, by the attribute ``address``, and keep on disk. ``signature``: numba's."""

    def compiled(function: Callable[..., None]) -> Any:
        return _on_disk(function, partial(numba.cfunc, signature), {})

    return compiled


def _on_disk(function: Any, compiler: Callable[..., Any], options: dict[str, Any]) -> Any:
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = os.path.join(_BASE, _digest(inspect.getfile(function)))
    _folders.add(numba.config.CACHE_DIR)
    try:
        return compiler(cache=True, **options)(function)
    except RuntimeError:  # no folder can be written: compile in each process
        return compiler(**options)(function)
    finally:
        numba.config.CACHE_DIR = before


@kernel(lean=True)
def least(values: NDArray[np.float64]) -> float:
    """Smallest entry."""
    smallest = values[0]
    for i in range(1, values.size):
        smallest = min(smallest, values[i])
    return smallest
