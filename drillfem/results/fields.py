"""The string's shape over time for ParaView: VTKHDF, a temporal polyline, written with h5py alone."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np
import xarray as xr

from .atomic import replacing
from .history import Variable

ALIASES = {"s": "arc_length", "r": "position", "d1": "director1", "d2": "director2", "d3": "director3"}
"""Short names that are accepted."""

STATIC = ("arc_length", "outer_diameter", "inner_diameter")
"""Fields that do not change: stored once, from the first call."""

STANDARD_FIELDS: dict[str, Variable] = {
    "arc_length": Variable("m", long_name="arc length from the top"),
    "outer_diameter": Variable("m", long_name="outer diameter"),
    "inner_diameter": Variable("m", long_name="inner diameter"),
    "position": Variable("m", long_name="position of the centre line, e3 down"),
    "director1": Variable("1", long_name="first director: turns with the cross-section"),
    "director2": Variable("1", long_name="second director: turns with the cross-section"),
    "director3": Variable("1", long_name="third director: normal of the cross-section"),
    "spin": Variable("rad/s", long_name="angular speed about the string's axis"),
    "rotation": Variable("rad", long_name="angle turned about the string's axis"),
    "twist": Variable("rad", long_name="angle by which the section lags behind the top drive"),
    "twist_rate": Variable("rad/m", long_name="angle of twist per length"),
    "axial_strain": Variable("1", long_name="axial strain"),
    "axial_speed": Variable("m/s", long_name="axial speed, positive down"),
    "axial_displacement": Variable("m", long_name="axial displacement, positive down"),
    "speed": Variable("m/s", long_name="speed of the centre line"),
    "torque": Variable("N m", long_name="torque"),
    "axial_force": Variable("N", long_name="axial force, positive in tension"),
    "shear_force": Variable("N", long_name="shear force"),
    "bending_moment": Variable("N m", long_name="bending moment"),
    "curvature": Variable("1/m", long_name="curvature"),
    "contact_force": Variable("N/m", long_name="contact force per length"),
    "wall_arc_length": Variable("m", long_name="arc length of a point that may touch the wall"),
    "wall_depth": Variable("m", long_name="measured depth of the closest point of the hole"),
    "wall_gap": Variable("m", long_name="gap to the wall, negative in contact"),
    "wall_side_force": Variable("N/m", long_name="normal force of the wall per length"),
    "rock_angle": Variable("rad", long_name="angle behind the blade"),
    "rock_height": Variable("m", long_name="depth of the rock surface, positive down"),
}
"""Fields known by name. Any other is dimensionless unless its units are given."""


def field_variables(values: Mapping[str, np.ndarray], units: Mapping[str, str]) -> dict[str, Variable]:
    """How ``values`` are stored: ``rock_*`` (m,) over ``rock``, ``wall_*`` (w,) over ``wall``, others (n,) or (n, 3)
    over ``node``.

    ``units`` by name go before the standard ones.
    """
    variables = {}
    for name, value in values.items():
        known = STANDARD_FIELDS.get(name, Variable("1"))
        prefix = name.split("_")[0]
        over = prefix if prefix in ("rock", "wall") else "node"
        dims = (over,) if value.ndim == 1 else (over, "xyz")
        variables[name] = Variable(units.get(name, known.units), dims, known.long_name)
    return variables


def write_vtkhdf(path: Path, fields: xr.Dataset) -> None:
    """Write ``fields`` (those of ``fields.nc``) as one polyline that changes with time.

    VTK HDF file format 2.x, type PolyData. The topology is stored once: every step points to the same part.

    Args:
        path: the file to replace.
        fields: ``position`` (time, node, xyz) in m, and others (node), (time, node) or (time, node, xyz).
    """
    steps, nodes = fields.sizes["time"], fields.sizes["node"]
    starts = nodes * np.arange(steps)
    zeros = np.zeros(steps, dtype=np.int64)
    with replacing(path) as part, h5py.File(part, "w") as file:
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = np.array([2, 0], dtype=np.int64)
        root.attrs.create("Type", b"PolyData", dtype=h5py.string_dtype("ascii", 8))
        root["NumberOfPoints"] = np.array([nodes], dtype=np.int64)
        root["Points"] = fields["position"].values.reshape(steps * nodes, 3)
        for name in ("Vertices", "Lines", "Polygons", "Strips"):
            count = nodes if name == "Lines" else 0
            cells = root.create_group(name)
            cells["NumberOfConnectivityIds"] = np.array([count], dtype=np.int64)
            cells["NumberOfCells"] = np.array([min(count, 1)], dtype=np.int64)
            cells["Offsets"] = np.array([0, count] if count else [0], dtype=np.int64)
            cells["Connectivity"] = np.arange(count, dtype=np.int64)
        time = root.create_group("Steps")
        time.attrs["NSteps"] = np.int64(steps)
        time["Values"] = fields["time"].values
        time["NumberOfParts"] = zeros + 1
        time["PartOffsets"] = zeros
        time["PointOffsets"] = starts
        time["CellOffsets"] = np.zeros((steps, 4), dtype=np.int64)
        time["ConnectivityIdOffsets"] = np.zeros((steps, 4), dtype=np.int64)
        data, offsets = root.create_group("PointData"), time.create_group("PointDataOffsets")
        for name in map(str, fields.data_vars):
            dims, values = fields[name].dims, fields[name].values
            if name == "position" or "node" not in dims:
                continue
            if dims[0] == "time":
                data[name], offsets[name] = values.reshape(steps * nodes, *values.shape[2:]), starts
            else:
                data[name], offsets[name] = values, zeros
