"""What all tests share. ``rodlab`` (beside this file) holds the tools for tests of the rod."""

from __future__ import annotations

import gc
import signal
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

# a shell starts jobs in the background (`make test &`) deaf to Ctrl-C, and so would be those that tests interrupt
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

#: Folders and files whose modules need DOLFINx to be read.
_ROD = ("forms/", "convergence/", "physics/test_rod", "stability/test_rod", "stability/test_contact_rod")
collect_ignore_glob = [] if find_spec("dolfinx") else [f"{folder}*" for folder in _ROD]


@pytest.fixture(autouse=True, scope="module")
def _free_petsc() -> Iterator[None]:
    """PETSc objects in reference cycles go when the module is done, not in the middle of another test."""
    yield
    gc.collect()
