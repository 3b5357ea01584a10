"""Boreholes: centreline, radius and friction along measured depth, and the closest point of a hole to a string."""

from .borehole import BEYOND, Borehole, Frame
from .closest import WALL, Projection, closest, project, wall
from .curves import arc, build, helix, spline, straight
from .files import builtin_surveys, find, read_caliper, read_friction, read_survey, with_files
from .of_scene import hole_of
from .survey import departure, minimum_curvature, survey
from .table import Table

__all__ = [
    "BEYOND",
    "WALL",
    "Borehole",
    "Frame",
    "Projection",
    "Table",
    "arc",
    "build",
    "builtin_surveys",
    "closest",
    "departure",
    "find",
    "helix",
    "hole_of",
    "minimum_curvature",
    "project",
    "read_caliper",
    "read_friction",
    "read_survey",
    "spline",
    "straight",
    "survey",
    "wall",
    "with_files",
]
