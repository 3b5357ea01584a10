"""The thesis' numbers beside ours: claims as data, verdicts from tolerances, reasons by experiment."""

from .compare import CASES, Report, compare, find_cases, judge, reproduce
from .imitation import Numerics, imitate

__all__ = ["CASES", "Numerics", "Report", "compare", "find_cases", "imitate", "judge", "reproduce"]
