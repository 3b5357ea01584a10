"""Results: history, fields, checkpoints, manifest, spectra, and the table that says what happened."""

from .checkpoint import read_checkpoint
from .history import STANDARD
from .manifest import check_new_folder, is_result
from .performance import performance
from .result import Result, open_result
from .spectra import Peak, amplitude_spectrum, dominant, dominant_in, spectra_in, windowed_spectrum, windows
from .table import print_summary, statistics, store_statistics, summary_table
from .writer import ResultWriter

__all__ = [
    "STANDARD",
    "Peak",
    "Result",
    "ResultWriter",
    "amplitude_spectrum",
    "check_new_folder",
    "dominant",
    "dominant_in",
    "is_result",
    "open_result",
    "performance",
    "print_summary",
    "read_checkpoint",
    "spectra_in",
    "statistics",
    "store_statistics",
    "summary_table",
    "windowed_spectrum",
    "windows",
]
