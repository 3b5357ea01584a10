"""Files that are either the old or the new version, never half of one."""

from __future__ import annotations

import itertools
import json
import math
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from drillfem.errors import SceneError

_serial = itertools.count()


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a scratch path beside ``path``; move it over ``path`` when the block ends without an exception.

    The move is atomic and comes after an fsync: whoever is killed, at whatever moment, leaves the previous
    version.
    """
    # A fresh name each time: HDF5 refuses a file that an interrupted call may still hold open.
    part = path.with_name(f".{path.name}.{os.getpid()}.{next(_serial)}.part")
    try:
        yield part
        with open(part, "rb+") as file:
            os.fsync(file.fileno())
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def remove_leftovers(folder: Path) -> None:
    """Delete the scratch files of writers that were killed in the middle of a replacement."""
    for part in folder.rglob(".*.part"):
        part.unlink(missing_ok=True)


class Lock:
    """Keeps other processes out of a folder until `release`; goes with this process, however that ends.

    Raises SceneError where another one has it.
    """

    def __init__(self, folder: Path) -> None:
        self._descriptor: int | None = None
        try:
            import fcntl
        except ImportError:  # Windows
            return
        self._descriptor = os.open(folder, os.O_RDONLY)
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.release()
            raise SceneError(f"{folder}: another process is writing to it") from None
        except OSError:  # a file system without locks
            pass

    def release(self) -> None:
        """Let others in."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def plain(value: Any) -> Any:
    """``value`` in the types of JSON: numpy scalars and arrays unpacked, NaN and infinities as ``None``."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def write_json(path: Path, data: Mapping[str, Any]) -> None:
    """Write ``data`` (see `plain`) as indented UTF-8 JSON, atomically."""
    text = json.dumps(plain(data), indent=2, ensure_ascii=False, allow_nan=False)
    with replacing(path) as part:
        part.write_text(text + "\n", encoding="utf-8")


def read_json(path: Path) -> dict[str, Any]:
    """Table in a JSON file. Raises SceneError, with what is missing or wrong."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise SceneError(f"{path.parent}: is not a result folder, it has no {path.name}") from None
    except (OSError, ValueError) as error:
        raise SceneError(f"{path}: cannot be read ({error})") from error
    if not isinstance(data, dict):
        raise SceneError(f"{path}: cannot be read (a table was expected)")
    return data
