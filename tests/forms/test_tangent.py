"""The Jacobian that Newton uses is the derivative of the residual, for every ansatz, and follows its coefficients."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from rodlab import Array, bar, dynamic, put, wave

from drillfem.models.rod import Rod
from drillfem.scene import Scene
from drillfem.solve.statics import Statics

CASES = ["spatial", "planar", "axial-torsional", "torsional", pytest.param("literal", marks=pytest.mark.slow)]
SHIFT = 40.0


@cache
def pipe(case: str) -> Rod:
    """Two sections of damped pipe; where the ansatz can bend, in a hole and loaded at the tip."""
    model = "spatial" if case == "literal" else case
    across = model in ("spatial", "planar")
    section: dict[str, Any] = {"outer_diameter": 0.1, "inner_diameter": 0.08}
    data = bar().to_dict() | {
        "model": model,
        "reading": "literal" if case == "literal" else "recommended",
        "string": [{"name": "a", "length": 6.0} | section, {"name": "b", "length": 4.0, "outer_diameter": 0.12}],
        "material": {"youngs_modulus": 2e6, "poisson_ratio": 0.3, "density": 1200.0, "retardation_time": 1e-2},
        "gravity": {"direction": [1, 0, 0] if across else [0, 0, 1]},
        "ends": {"top": "clamped", "bottom": "free", "bottom_mass": 2.0, "bottom_inertia": 0.3}
        | ({"tip_force": [3.0, 0, 5.0], "tip_moment": [0, 4.0, 0]} if across else {}),
        "mesh": {"elements": 4, "degree": 3},
        "time": dynamic(1.0, 1e-2),
    }
    if across:
        data |= {"hole": {"kind": "straight", "diameter": 0.2}}
        data |= {"contact": {"stiffness": 1e3, "friction_static": 0.3, "friction_dynamic": 0.15}}
    return Rod(Scene.from_dict(data))


def state(rod: Rod, seed: int = 3) -> tuple[Array, Array]:
    """A smooth random motion, in contact all along where there is a wall (first touch is a kink)."""
    rng = np.random.default_rng(seed)
    u = put(rod, **{n: wave(rng, rod.length, 0.3) for n in rod.ansatz.v_names})
    block = u.reshape(-1, rod.ansatz.size)
    for i, name in enumerate(rod.ansatz.x_names):
        block[rod.nodes, i] += wave(rng, rod.length, 0.01 if name.startswith("r") else 0.1)(rod.arc_length)
        if name == "r1":
            block[:, i] += 0.3
    u_dot = put(
        rod, np.zeros(rod.size), **{n: wave(rng, rod.length, 1.0) for n in rod.ansatz.x_names + rod.ansatz.v_names}
    )
    return block.reshape(-1), u_dot


def tangent(rod: Rod, u: Array, u_dot: Array, direction: Array) -> Array:
    matrix = rod.create_matrix()
    rod.jacobian(u, u_dot, SHIFT, matrix)
    x, y = matrix.createVecRight(), matrix.createVecLeft()
    x.setArray(direction)
    matrix.mult(x, y)
    out = y.getArray().copy()
    for item in (matrix, x, y):
        item.destroy()
    return out


def difference(rod: Rod, u: Array, u_dot: Array, direction: Array, h: float = 2e-4) -> Array:
    """dF along (direction, SHIFT direction), central differences of fourth order."""
    total = np.zeros(rod.size)
    for factor, weight in ((1, 8), (-1, -8), (2, -1), (-2, 1)):
        out = np.zeros(rod.size)
        step = factor * h * direction
        rod.residual(0.0, u + step, u_dot + SHIFT * step, out)
        total += weight * out / (12 * h)
    return total


def mismatch(rod: Rod, u: Array, u_dot: Array) -> float:
    """Largest relative error of the tangent over the fields of test functions."""
    direction = np.random.default_rng(7).standard_normal(rod.size)
    a, b = (f(rod, u, u_dot, direction).reshape(-1, rod.ansatz.size) for f in (tangent, difference))
    return float((abs(a - b).max(axis=0) / abs(a).max(axis=0)).max())


@pytest.mark.parametrize("case", CASES)
def test_tangent_is_the_derivative_of_the_residual(case: str) -> None:
    rod = pipe(case)
    assert mismatch(rod, *state(rod)) < 2e-9


def coefficients(rod: Rod) -> dict[str, Any]:
    wall = rod.loads.wall
    found = {"damping": None, "tip moment": rod.tip_moment, "bottom mass": rod.loads.bottom.mass}
    if wall is not None:
        found |= {"contact": wall.stiffness, "velocity scale": wall.velocity_scale}
    return found


@pytest.mark.parametrize("case", ["spatial", "planar"])
@pytest.mark.parametrize("name", ["damping", "tip moment", "bottom mass", "contact", "friction", "velocity scale"])
def test_tangent_moves_with_its_coefficients(case: str, name: str) -> None:
    rod = pipe(case)
    u, u_dot = state(rod)
    direction = np.random.default_rng(7).standard_normal(rod.size)
    before = tangent(rod, u, u_dot, direction)
    if name == "damping":
        array = rod.section.field.x.array
    else:
        array = rod.wall.hole.table.friction if name == "friction" and rod.wall else coefficients(rod)[name].value
    kept = array.copy()
    try:
        if name == "damping":
            array.reshape(-1, 11)[:, 9] *= 1.5
        else:
            array[...] = 1.5 * kept
        if name == "friction" and rod.wall:
            rod.wall.go_to(rod.wall.p)  # what is known of the hole is read again
        after = tangent(rod, u, u_dot, direction)
        assert mismatch(rod, u, u_dot) < 2e-9
    finally:
        array[...] = kept
        if name == "friction" and rod.wall:
            rod.wall.go_to(rod.wall.p)
    planar_moment = case == "planar" and name == "tip moment"  # about a fixed axis its virtual work is linear
    change = abs(after - before).max() / abs(before).max()
    assert (change == 0.0) if planar_moment else (change > 1e-12)


@pytest.mark.parametrize("case", CASES)
def test_tangent_of_statics(case: str) -> None:
    rod = pipe(case)
    problem = Statics(rod)
    n = len(rod.ansatz.x_names)
    x = state(rod)[0].reshape(-1, rod.ansatz.size)[:, :n].reshape(-1)
    direction = np.random.default_rng(7).standard_normal(x.size)
    problem.x.x.array[:] = x
    A = problem.jacobian.dense() @ direction
    B, h, out = np.zeros(x.size), 2e-4, np.zeros(x.size)
    for factor, weight in ((1, 8), (-1, -8), (2, -1), (-2, 1)):
        problem.x.x.array[:] = x + factor * h * direction
        B += weight * problem.residual(out) / (12 * h)
    assert abs(A - B).max() < 2e-9 * abs(A).max()
