"""Buckling of a string in its hole, found from the rod itself (docs/buckling.md)."""

from .column import Column, pipe_of, pipe_scene
from .follow import Step, follow, record, wound
from .onset import Onset, find_onset
from .theory import Pipe, Wave, equal_energy, helix, onset, pinned_onset, snake

__all__ = [
    "Column",
    "Onset",
    "Pipe",
    "Step",
    "Wave",
    "equal_energy",
    "find_onset",
    "follow",
    "helix",
    "onset",
    "pinned_onset",
    "pipe_of",
    "pipe_scene",
    "record",
    "snake",
    "wound",
]
