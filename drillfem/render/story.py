"""What the pictures need to know about a saved result, gathered once; nothing here draws."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from drillfem.errors import SceneError

if TYPE_CHECKING:
    import xarray as xr

# the field a viewer wants to see first, if it is there
FIRST_CHOICE = ("spin", "axial_force", "torque", "bending_moment", "curvature", "axial_speed")
# what is saved at the points that may touch the wall, and is shown along the string under a name of its own
AT_WALL = {"side_force": "wall_side_force", "gap": "wall_gap"}
# names that a result may use for the same thing
ALIASES = {"arc_length": ("s",), "position": ("r",), "director1": ("d1",), "director3": ("d3",)}
# factor and label of fields of a string in a well; its torque is that handed down, positive when drilling
SHOWN = {
    "spin": (30 / math.pi, "spin (rpm)"),
    "torque": (-1e-3, "torque (kN m)"),
    "axial_force": (1e-3, "tension (kN)"),
    "side_force": (1e-3, "side force (kN/m)"),
    "bending_moment": (1e-3, "bending moment (kN m)"),
}
NOT_COLOURS = {"arc_length", "outer_diameter", "inner_diameter"}
LATERAL = 0.02  # of the length: a string that leaves its line by more is shown by its true shape


def attribute(thing: Any, *names: str, default: Any = None) -> Any:
    """`thing.a.b` through objects and mappings alike; default where any link is missing or None."""
    for name in names:
        thing = thing.get(name) if isinstance(thing, Mapping) else getattr(thing, name, None)
        if thing is None:
            return default
    return thing


@dataclass(frozen=True)
class Part:
    """A section of the string: arc lengths of its ends and diameters in m (0 where the scene gives none)."""

    name: str
    top: float
    bottom: float
    outer: float
    inner: float


@dataclass(frozen=True)
class Pose:
    """The string at one saved time: positions and directors (n, 3), time in s."""

    time: float
    arc: np.ndarray
    position: np.ndarray
    director1: np.ndarray
    director3: np.ndarray


@dataclass(frozen=True)
class Nominal:
    """The steady state that the run is compared with, SI; None where the scene has none."""

    speed: float | None = None
    depth_of_cut: float | None = None
    penetration: float | None = None
    torque: float | None = None
    weight: float | None = None


class Story:
    """A result seen by its painters. `result`: .history, .fields (or None), .scene, .manifest, .summary."""

    def __init__(self, result: Any) -> None:
        self.history: xr.Dataset = result.history
        fields: xr.Dataset | None = result.fields
        if fields is not None and (fields.sizes.get("time", 0) == 0 or fields.sizes.get("node", 0) < 2):
            fields = None
        if fields is not None:
            there = set(map(str, fields.variables))
            fields = fields.rename(
                {a: n for n, others in ALIASES.items() for a in others if a in there and n not in there}
            )
        self.fields = fields
        self.scene = getattr(result, "scene", None)
        manifest = getattr(result, "manifest", None) or {}
        self.title = str(
            attribute(self.scene, "title")
            or attribute(manifest, "scene", "title")
            or attribute(self.scene, "name")
            or "drillfem"
        )
        self.model = str(attribute(getattr(result, "summary", None), "model", default="") or "")
        self.nominal = self._nominal()
        # Hz, by kind, slowest first; noted by the run
        found = attribute(getattr(result, "summary", None), "natural_frequencies", default={})
        self.natural_frequencies: dict[str, list[float]] = {str(kind): list(found[kind]) for kind in found}
        self.bit_radius = float(attribute(self.scene, "bit", "radius", default=0.0))
        self.drilling = "depth_of_cut" in self.history
        self.blades = self._blades()
        if fields is not None:
            # "fields" may keep arc_length as a coordinate or as a variable: both are node arrays
            self.arc = np.asarray(fields["arc_length"].values, dtype=float)
            self.times = np.asarray(fields["time"].values, dtype=float)
            self.position = np.asarray(fields["position"].values, dtype=float)
            self.length = float(self.arc[-1] - self.arc[0])
            self.parts = self._parts()
            self.sideways = self._sideways()
            self._along_wall: dict[str, np.ndarray] = {}

    @property
    def in_well(self) -> bool:
        """Whether the string lies in a hole that leaves the vertical."""
        if self.fields is None or not attribute(self.scene, "hole", "bends", default=False):
            return False
        return "wall_depth" in self.fields and attribute(self.scene, "borehole") is not None

    # -- what the scene says -----------------------------------------------------------------------------
    def _nominal(self) -> Nominal:
        speed = attribute(self.scene, "top_drive", "speed")
        values: dict[str, float | None] = {"speed": float(speed) if speed else None}
        compute = getattr(self.scene, "nominal", None)
        if attribute(self.scene, "bit", "kind") == "cutting" and callable(compute):
            try:
                state = compute()
            except (ValueError, SceneError):
                return Nominal(**values)
            names = {"depth_of_cut": "depth_of_cut", "penetration": "rate_of_penetration"}
            names |= {"torque": "torque_on_bit", "weight": "weight_on_bit"}
            for ours, theirs in names.items():
                found = attribute(state, theirs)
                values[ours] = None if found is None else float(found)
        return Nominal(**values)

    @property
    def blade_passing(self) -> float | None:
        """Blades per turn times turns per second at the drive's speed, Hz; None without a bit that cuts."""
        if not self.nominal.speed or self.nominal.depth_of_cut is None or not len(self.blades):
            return None
        return len(self.blades) * abs(self.nominal.speed) / (2 * math.pi)

    def _blades(self) -> np.ndarray:
        """Angles of the blades on the bit, rad, seen along e3 from the first."""
        angles = attribute(self.scene, "bit", "blade_angles")
        if angles is not None and len(angles):
            return np.asarray(angles, dtype=float)
        count = int(attribute(self.scene, "bit", "blades", default=0) or 0)
        return 2 * math.pi * np.arange(count) / max(count, 1)

    def _parts(self) -> tuple[Part, ...]:
        sections = attribute(self.scene, "string", default=())
        parts, s = [], float(self.arc[0])
        for section in sections:
            bottom = s + float(attribute(section, "length"))
            outer = float(attribute(section, "outer_diameter", default=0.0))
            inner = float(attribute(section, "inner_diameter", default=0.0))
            parts.append(Part(str(attribute(section, "name", default="section")), s, bottom, outer, inner))
            s = bottom
        if parts and math.isclose(s - float(self.arc[0]), self.length, rel_tol=1e-6):
            return tuple(parts)
        assert self.fields is not None
        if "outer_diameter" not in self.fields:
            return (Part("string", float(self.arc[0]), float(self.arc[-1]), 0.0, 0.0),)
        outer_nodes = np.asarray(self.fields["outer_diameter"].values, dtype=float)
        outer_nodes = np.where(np.isfinite(outer_nodes), outer_nodes, 0.0)
        cuts = np.flatnonzero(np.abs(np.diff(outer_nodes)) > 1e-9)
        edges = [float(self.arc[0]), *(float(self.arc[c]) for c in cuts), float(self.arc[-1])]
        firsts = [0, *(int(c) + 1 for c in cuts)]
        return tuple(
            Part(f"section {k + 1}", edges[k], edges[k + 1], float(outer_nodes[first]), 0.0)
            for k, first in enumerate(firsts)
        )

    def _sideways(self) -> bool:
        """Whether the string leaves the line r = (0, 0, s), so that its true shape is the news."""
        aside = np.abs(self.position[:, :, :2]).max()
        upright = (self.position[:, -1, 2] - self.position[:, 0, 2]).min()
        return bool(aside > LATERAL * self.length or upright < (1 - LATERAL) * self.length)

    # -- what the run says -------------------------------------------------------------------------------
    @property
    def colour_fields(self) -> list[str]:
        """Scalar fields that the string can be coloured by."""
        if self.fields is None:
            return []
        names = [
            str(n) for n, v in self.fields.data_vars.items() if v.dims == ("time", "node") and n not in NOT_COLOURS
        ]
        return sorted([*names, *(n for n, saved in AT_WALL.items() if saved in self.fields)])

    def choose_field(self, wanted: str | None) -> str | None:
        """The wanted field, or the first that says something; SceneError that lists what is there."""
        names = self.colour_fields
        if wanted is not None:
            if wanted not in names:
                there = ", ".join(names) if names else "none"
                raise SceneError(f"no field '{wanted}' in this result; fields to colour by: {there}")
            return wanted
        usable = [n for n in names if np.isfinite(self.values(n)).any()]
        telling = [n for n in usable if np.ptp(self.values(n)) > 1e-9 * (1 + np.abs(self.values(n)).max())]
        bent = ("bending_moment", "curvature")
        choice = (*bent, *FIRST_CHOICE) if self.sideways else FIRST_CHOICE
        choice = ("side_force", *choice) if self.in_well else choice
        for pool in (telling, usable):
            for name in choice:
                if name in pool:
                    return name
            if pool:
                return pool[0]
        return None

    @property
    def still(self) -> bool:
        """A static analysis: time is the load factor."""
        return str(attribute(self.scene, "time", "analysis", default="dynamic")) == "static"

    def choose_time(self, wanted: float | None) -> int:
        """Index of the saved pose next to `wanted` (s); the last one by default."""
        if wanted is None:
            return len(self.times) - 1
        first, last = float(self.times[0]), float(self.times[-1])
        room = 1e-6 + 1e-9 * abs(last)
        if not (first - room <= wanted <= last + room):
            raise SceneError(f"no picture at time {wanted:g} s: the saved poses go from {first:g} s to {last:g} s")
        return int(np.argmin(np.abs(self.times - wanted)))

    def values(self, name: str) -> np.ndarray:
        """A scalar field, (time, node)."""
        assert self.fields is not None
        if name in AT_WALL and name not in self.fields:
            if name not in self._along_wall:
                at, values = self.at_wall("wall_arc_length"), self.at_wall(AT_WALL[name])
                rows = [np.interp(self.arc, s, row) for s, row in zip(at, values, strict=True)]
                self._along_wall[name] = np.array(rows)
            return self._along_wall[name]
        return np.asarray(self.fields[name].values, dtype=float)

    def at_wall(self, name: str) -> np.ndarray:
        """A field of the points that may touch the wall, (time, wall), from the top down."""
        assert self.fields is not None
        return np.asarray(self.fields[name].values, dtype=float)

    def units(self, name: str) -> str:
        """The field's units as saved."""
        assert self.fields is not None
        saved = name if name in self.fields else AT_WALL[name]
        return str(self.fields[saved].attrs.get("units", ""))

    def label(self, name: str) -> str:
        """'axial force (N)': a name with its units, for an axis."""
        words, units = name.replace("_", " "), self.units(name)
        return f"{words} ({units})" if units and units != "1" else words

    def pose(self, index: int) -> Pose:
        """Positions and orthonormal directors at a saved time."""
        assert self.fields is not None
        r = self.position[index]
        d3 = self._director("director3", index, np.gradient(r, self.arc, axis=0))
        d1 = self._director("director1", index, np.broadcast_to([1.0, 0.0, 0.0], r.shape))
        d1 = d1 - np.sum(d1 * d3, axis=1, keepdims=True) * d3
        size = np.linalg.norm(d1, axis=1, keepdims=True)
        spare = np.cross(d3, [0.0, 1.0, 0.0])
        d1 = np.where(size > 1e-6, d1 / np.maximum(size, 1e-6), spare)
        return Pose(float(self.times[index]), self.arc, r, d1, d3)

    def _director(self, name: str, index: int, instead: np.ndarray) -> np.ndarray:
        assert self.fields is not None
        vectors = np.asarray(self.fields[name].values[index], dtype=float) if name in self.fields else instead
        return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)

    def diameter_at(self, arc: np.ndarray) -> np.ndarray:
        """Outer diameter in m at arc lengths (any shape); 0 where none is given."""
        out = np.full(np.shape(arc), self.parts[-1].outer)
        for part in reversed(self.parts):
            out = np.where(arc <= part.bottom, part.outer, out)
        return out

    def rock(self, index: int) -> tuple[np.ndarray, np.ndarray] | None:
        """Angles behind the blade (rad, from 0) and depths of the rock surface (m, positive down), or None.

        As saved with the fields, else from the bit's path in the history.
        """
        if self.fields is None or "rock_height" not in self.fields or "rock_angle" not in self.fields:
            return self._rock_from_path(float(self.times[index])) if self.fields is not None else None
        variable = self.fields["rock_height"]
        angle = np.asarray(self.fields["rock_angle"].values, dtype=float)
        angle = angle[index] if angle.ndim == 2 else angle
        sign = -1.0 if variable.attrs.get("positive", "down") == "up" else 1.0
        depth = sign * np.asarray(variable.values[index], dtype=float)
        good = np.isfinite(angle) & np.isfinite(depth)
        if good.sum() < 2:
            return None
        angle, depth = angle[good], depth[good]
        count = len(self.blades)
        if count > 1 and angle.max() > 2 * math.pi / count * 1.01 and len(angle) % count == 0:
            # unequal blades: one sector behind each, in the order of the blades; here all behind the first
            each = len(angle) // count
            sectors = angle.reshape(count, each) - angle[::each, None]
            inside = np.clip(sectors, 1e-5, sectors[:, -1:] - 1e-5)
            angle = ((inside - self.blades[:, None]) % (2 * math.pi)).ravel()
        order = np.argsort(angle, kind="stable")
        return angle[order], depth[order]

    def _rock_from_path(self, time: float) -> tuple[np.ndarray, np.ndarray] | None:
        """What the blades left: at each angle the greatest depth of any of them when it passed there."""
        if not len(self.blades) or "bit_angle" not in self.history or "bit_depth" not in self.history:
            return None
        past = self.history["time"].values <= time + 1e-9
        turned = np.maximum.accumulate(np.asarray(self.history["bit_angle"].values, dtype=float)[past])
        depth = np.maximum.accumulate(np.asarray(self.history["bit_depth"].values, dtype=float)[past])
        if len(turned) < 2:
            return None
        gaps = np.diff(np.append(self.blades, self.blades[0] + 2 * math.pi))
        sector = float(gaps[0]) if np.ptp(gaps) < 1e-9 else 2 * math.pi
        behind = np.linspace(0.0, sector, 97)
        passed = float(turned[-1]) - (behind[:, None] + self.blades[None, :]) % (2 * math.pi)
        found = np.interp(passed, turned, depth)
        # before the run the bit drilled steadily
        slope = (self.nominal.depth_of_cut or 0.0) / (2 * math.pi)
        found = np.where(passed < turned[0], depth[0] - slope * (turned[0] - passed), found)
        surface = found.max(axis=1)
        if sector < 2 * math.pi:  # the last point is what the next blade meets: it has not cut there yet
            others = (behind[-1] + self.blades) % (2 * math.pi) > 1e-9
            surface[-1] = found[-1, others].max()
        return behind, surface

    def at(self, name: str, time: float) -> float | None:
        """A history value at a time, linear between its neighbours; None if there is no such name."""
        if name not in self.history:
            return None
        return float(np.interp(time, self.history["time"].values, self.history[name].values))

    def clock(self, time: float) -> str:
        """'t = 12.3 s', or the load factor of a static analysis."""
        return f"load factor {time:.3g}" if self.still else f"t = {time:.6g} s"
