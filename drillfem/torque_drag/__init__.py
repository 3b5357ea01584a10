"""Static torque and drag of a string in its hole: hook load, torque and side force per operation."""

from .limits import Limits, limits
from .operation import OPERATIONS, Operation, Profile, operations_of
from .soft import greatest_weight, hook_loads, johancsik, lock_up_depth, soft_string, stations

__all__ = [
    "OPERATIONS",
    "Limits",
    "Operation",
    "Profile",
    "greatest_weight",
    "hook_loads",
    "johancsik",
    "limits",
    "lock_up_depth",
    "operations_of",
    "soft_string",
    "stations",
]
