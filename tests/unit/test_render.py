"""Pictures from synthetic results: they exist, show what they should, and need no display."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import xarray as xr

HISTORY_UNITS = {
    "bit_angular_speed": "rad/s", "bit_axial_speed": "m/s", "bit_angle": "rad", "bit_depth": "m", "bit_torque": "N m",
    "bit_weight": "N", "depth_of_cut": "m", "top_torque": "N m", "top_angular_speed": "rad/s", "hook_load": "N",
    "top_power": "W", "kinetic_energy": "J", "strain_energy": "J",
}  # fmt: skip
OMEGA, RADIUS, BLADES, CUT = 14.42, 0.108, 6, 1.261e-3


@dataclass
class FakeResult:
    """What render asks of a result."""

    history: xr.Dataset
    fields: xr.Dataset | None
    scene: Any
    manifest: dict[str, Any] = field(default_factory=dict)
    summary: dict[str, Any] = field(default_factory=dict)


def drilling(end: float = 12.0, nodes: int = 97, step: float = 0.01, fields_step: float = 0.05) -> FakeResult:
    """A 1200 m string with torsional and axial waves and a rock cut in six sectors."""
    length, first = 1200.0, 1000.0
    modes = ((0.453, 0.8), (3.18, 0.25), (4.68, 0.14), (7.40, 0.05))
    arc = np.linspace(0, length, nodes)
    time = np.arange(0, end + step / 2, step)
    when = np.arange(0, end + 1e-9, fields_step)

    def angle(s: np.ndarray, t: np.ndarray) -> np.ndarray:
        steady = -3.48 * np.minimum(s, first) / first - 0.16 * np.maximum(s - first, 0) / (length - first)
        phi = OMEGA * t + steady
        for k, (f, a) in enumerate(modes):
            phi = phi + a * np.sin((2 * [1, 3, 4, 6][k] - 1) * np.pi * s / 2 / length) * np.sin(2 * np.pi * f * t + k)
        return phi

    def spin(s: np.ndarray, t: np.ndarray) -> np.ndarray:
        return (angle(s, t + 1e-4) - angle(s, t - 1e-4)) / 2e-4

    def dip(t: np.ndarray) -> np.ndarray:
        return 2.894e-3 * t + 6e-5 * np.sin(2 * np.pi * 13.1 * t) + 1e-4 * np.sin(2 * np.pi * 0.45 * t)

    bit_spin = spin(np.array(length), time)
    cut = np.maximum(BLADES * (dip(time) - dip(time - 2 * np.pi / BLADES / OMEGA)), 0)
    torque = 3264 * (0.4 + 0.6 * cut / CUT)
    history = {
        "bit_angular_speed": np.maximum(bit_spin, 0), "bit_axial_speed": np.gradient(dip(time), time),
        "bit_angle": angle(np.array(length), time), "bit_depth": np.maximum.accumulate(dip(time)),
        "bit_torque": torque, "bit_weight": 32.66e3 + 1.034e7 * cut, "depth_of_cut": cut,
        "top_torque": np.full_like(time, 3264.0), "top_angular_speed": np.full_like(time, OMEGA),
        "hook_load": np.full_like(time, 415e3), "top_power": np.full_like(time, 47.1e3),
        "kinetic_energy": 1.5e4 + 50 * np.sin(time), "strain_energy": 6e3 + 40 * np.cos(time),
    }  # fmt: skip
    s, t = arc[None, :], when[:, None]
    phi = angle(s, t)
    zero = np.zeros_like(phi)
    z = s + 0.4 * s / length + dip(t)
    eta = np.linspace(0, 2 * np.pi / BLADES, 40)
    past = when[:, None] - eta[None, :] / OMEGA
    fields = xr.Dataset(
        {
            "position": (("time", "node", "xyz"), np.stack([zero, zero, z], axis=2), {"units": "m"}),
            "director1": (("time", "node", "xyz"), np.stack([np.cos(phi), np.sin(phi), zero], axis=2), {"units": "1"}),
            "director3": (("time", "node", "xyz"), np.stack([zero, zero, zero + 1], axis=2), {"units": "1"}),
            "spin": (("time", "node"), spin(s, t), {"units": "rad/s"}),
            "axial_speed": (("time", "node"), 2.894e-3 + 0.005 * np.cos(3 * np.pi * s / length) * np.cos(40 * t), {"units": "m/s"}),
            "axial_force": (("time", "node"), 415e3 - 384 * s + 0 * t, {"units": "N"}),
            "outer_diameter": ("node", np.where(arc <= first, 0.127, 0.1524), {"units": "m"}),
            "rock_angle": (("time", "rock_node"), np.broadcast_to(eta, past.shape), {"units": "rad"}),
            "rock_height": (("time", "rock_node"), dip(past), {"units": "m"}),
        },
        coords={"time": ("time", when, {"units": "s"}), "arc_length": ("node", arc, {"units": "m"})},
    )  # fmt: skip
    string = (
        SimpleNamespace(name="drill pipe", length=first, outer_diameter=0.127, inner_diameter=0.108),
        SimpleNamespace(name="collars", length=length - first, outer_diameter=0.1524, inner_diameter=0.056),
    )
    nominal = SimpleNamespace(
        depth_of_cut=CUT, rate_of_penetration=2.894e-3, torque_on_bit=3264.0, hook_load=415e3, weight_on_bit=45.7e3
    )
    scene = SimpleNamespace(
        title="Chapter 6, C1, c_d = 1e-4 s", name="vertical-c1-cd4", string=string, hole=SimpleNamespace(kind="straight", diameter=0.2159),
        bit=SimpleNamespace(kind="cutting", radius=RADIUS, blades=BLADES, blade_angles=None),
        top_drive=SimpleNamespace(kind="imposed-speed", speed=OMEGA), time=SimpleNamespace(analysis="dynamic"),
        material=SimpleNamespace(shear_modulus=77e9, youngs_modulus=210e9, density=7800.0), nominal=lambda: nominal,
    )  # fmt: skip
    data = {n: ("time", v, {"units": HISTORY_UNITS[n]}) for n, v in history.items()}
    return FakeResult(
        xr.Dataset(data, coords={"time": ("time", time, {"units": "s"})}), fields, scene, {}, {"model": "axial-torsional"}
    )  # fmt: skip


def bending(kind: str = "pendulum", nodes: int = 33, poses: int = 21) -> FakeResult:
    """A rod of 1 m that swings and bends in the plane x-z, or an arc in space that is pulled out of its plane."""
    length, arc = 1.0, np.linspace(0, 1.0, nodes)
    when = np.linspace(0, 2.0, poses) if kind == "pendulum" else np.linspace(0, 1.0, poses)
    position, d1, d3 = (np.zeros((poses, nodes, 3)) for _ in range(3))
    curvature = np.zeros((poses, nodes))
    for i, t in enumerate(when):
        if kind == "pendulum":
            angle = 0.5 * np.pi * (1 - np.cos(2.6 * t)) / 1.2 + 0.9 * np.sin(5 * t) * arc**2
            d3[i] = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
            d1[i] = np.stack([np.cos(angle), 0 * angle, -np.sin(angle)], axis=1)
        else:
            turn, rise = 0.25 * np.pi * arc, 1.1 * t * arc
            d3[i] = np.stack([np.sin(turn) * np.cos(rise), np.sin(rise), np.cos(turn) * np.cos(rise)], axis=1)
            d1[i] = np.stack([np.cos(turn), 0 * turn, -np.sin(turn)], axis=1)
        mid = 0.5 * (d3[i, 1:] + d3[i, :-1]) * np.diff(arc)[:, None]
        position[i, 1:] = np.cumsum(mid, axis=0)
        curvature[i] = np.linalg.norm(np.gradient(d3[i], arc, axis=0), axis=1)
    time = np.linspace(when[0], when[-1], 201)
    history = {"kinetic_energy": np.sin(time) ** 2, "strain_energy": np.cos(time) ** 2}
    fields = xr.Dataset(
        {
            "position": (("time", "node", "xyz"), position, {"units": "m"}),
            "director1": (("time", "node", "xyz"), d1, {"units": "1"}),
            "director3": (("time", "node", "xyz"), d3, {"units": "1"}),
            "bending_moment": (("time", "node"), 0.6 * curvature, {"units": "N m"}),
        },
        coords={"time": ("time", when, {"units": "s"}), "arc_length": ("node", arc, {"units": "m"})},
    )
    planar = kind == "pendulum"
    scene = SimpleNamespace(
        title="Appendix B.1, flexible pendulum" if planar else "45-degree bend", name=kind, bit=None, top_drive=None, hole=None,
        string=(SimpleNamespace(name="cord", length=length, outer_diameter=0.04 if planar else None, inner_diameter=0.0),),
        gravity=SimpleNamespace(direction=(1.0, 0.0, 0.0), magnitude=9.81 if planar else 0.0),
        time=SimpleNamespace(analysis="dynamic" if planar else "static"), material=None,
    )  # fmt: skip
    data = {n: ("time", v, {"units": "J"}) for n, v in history.items()}
    return FakeResult(xr.Dataset(data, coords={"time": ("time", time, {"units": "s"})}), fields, scene, {}, {"model": "planar"})
