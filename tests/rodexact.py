"""Exact equilibria: the cantilever of chapter 3 under a dead force, and a helix under a wrench."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from rodlab import Array, bar, equilibrium
from scipy.integrate import solve_ivp
from scipy.optimize import root
from scipy.spatial.transform import Rotation

from drillfem.models.rod import Rod


def cantilever(load: float, EI: float = 1.0, EA: float = math.inf, GA: float = math.inf) -> Any:
    """Shooting solution of EI th'' = -F z', z' = (1+N/EA) cos th - (V/GA) sin th, N = F sin th, V = F cos th; length 1.

    Returns a function of arc length with values (theta, M, x, z).
    """

    def right(_: float, y: Array) -> list[float]:
        sine, cosine = np.sin(y[0]), np.cos(y[0])
        stretch, shear = 1 + load * sine / EA, load * cosine / GA
        dz = stretch * cosine - shear * sine
        return [y[1] / EI, -load * dz, stretch * sine + shear * cosine, dz]

    def shoot(moment: float) -> Any:
        return solve_ivp(right, (0, 1), [0, moment, 0, 0], rtol=1e-12, atol=1e-13, dense_output=True, method="DOP853")

    moment = root(lambda m: shoot(m[0]).y[1, -1], [load / (1 + load / 8)], tol=1e-13).x[0]
    return shoot(moment).sol


def helix(bend: float, twist: float, literal: bool = False, **mesh: int) -> tuple[Rod, Any, Any]:
    """Rod under the wrench that makes its material strains constant, u = (bend, 0, twist), with EI != GJ.

    n_m = a u with a (1 + a twist (1/EA - 1/GA)) = (GJ - EI) twist, m_m = K u: a tension along the axis for GJ > EI.
    Returns rod, exact position and rotation.
    """
    EA, GA, EI, GJ = 400.0, 150.0, 2.0, 2.8
    u = np.array([bend, 0, twist])

    def wrench(f: float) -> float:
        c = f * twist * (1 / EA - 1 / GA)
        return (math.sqrt(1 + 4 * c * (GJ - EI) * f * twist) - 1) / (2 * c)

    a = wrench(1.0)
    v = np.array([a * bend / GA, 0, 1 + a * twist / EA])

    def turn(s: Any, f: float = 1.0) -> Array:
        return Rotation.from_rotvec(np.outer(np.atleast_1d(s), f * u)).as_matrix()

    def place(s: Any) -> Array:
        # int_0^s exp(x [u]) v dx
        s, size = np.atleast_1d(s)[:, None], np.linalg.norm(u)
        axis = u / size
        across, along = np.cross(axis, v), (axis @ v) * axis
        return s * along + np.sin(size * s) / size * (v - along) + (1 - np.cos(size * s)) / size * across

    scene = bar(
        1.0,
        EA,
        GA,
        EI,
        GJ,
        model="spatial",
        reading="literal" if literal else "recommended",
        mesh={"elements": 16} | mesh,
    )
    rod = Rod(scene)

    def load(f: float) -> None:
        # through helices: under the final wrench scaled down the rod would take other shapes
        a = wrench(f)
        rod.tip_force.value = a * f * u
        rod.tip_moment.value = turn(1.0, f)[0] @ (np.array([EI, EI, GJ]) * f * u)

    equilibrium(rod, np.linspace(0, 1, 21)[1:], load)
    return rod, place, turn
