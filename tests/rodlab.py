"""Tools for the rod's tests: forms evaluated at a point, uniform rods, equilibria, errors in L2, fitted orders."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from scipy.spatial.transform import Rotation
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.algorithms.apply_derivatives import apply_derivatives

from drillfem.models.initial import initial_state
from drillfem.models.rod import Rod
from drillfem.scene import Scene, Time
from drillfem.solve.statics import Equilibrium, Statics

Array = npt.NDArray[np.float64]

# -- UFL at a point, without compiling: a plane whose coordinates are arc length and time ---------------------------
_PLANE = ufl.Mesh(basix.ufl.element("Lagrange", "triangle", 1, shape=(2,)))
S, T = ufl.SpatialCoordinate(_PLANE)


def at(expression: Any, s: float = 0.3, t: float = 0.7) -> Array:
    """Value of a UFL expression in S and T. ``.dx(0)`` is the derivative along the rod, ``.dx(1)`` that in time."""
    e = apply_derivatives(apply_algebra_lowering(ufl.as_ufl(expression)))
    values = [e[i]((s, t)) if e.ufl_shape else e((s, t)) for i in np.ndindex(*e.ufl_shape)]
    return np.array(values, dtype=float).reshape(e.ufl_shape)


def vec(*components: Any) -> Any:
    return ufl.as_vector(components)


def hamilton(p: Any, q: Any) -> Any:
    """Product of two UFL quaternions."""
    a, b, c, d = (p[i] for i in range(4))
    e, f, g, h = (q[i] for i in range(4))
    return vec(
        a * e - b * f - c * g - d * h,
        a * f + b * e + c * h - d * g,
        a * g - b * h + c * e + d * f,
        a * h + b * g - c * f + d * e,
    )


# -- scenes ----------------------------------------
def bar(
    length: float = 1.0,
    axial: float = 1e4,
    shear: float = 1e4,
    bending: float = 1e2,
    torsion: float = 1e2,
    mass: float = 1.0,
    inertia: float = 1e-3,
    retardation: float = 0.0,
    **tables: Any,
) -> Scene:
    """A weightless uniform rod, clamped at the top, at rest. ``tables`` replace the default ones."""
    section = {
        "name": "bar",
        "length": length,
        "stiffness": {"axial": axial, "shear": shear, "bending": bending, "torsion": torsion},
        "mass_per_length": mass,
        "rotary_inertia": inertia,
        "retardation_time": retardation,
    }
    data = {
        "string": [section],
        "gravity": {"magnitude": 0},
        "initial": {"state": "rest"},
        "ends": {"top": "clamped", "bottom": "free"},
        "time": {"analysis": "static"},
    }
    return Scene.from_dict(data | tables)


def dynamic(end: float, step: float, **keys: Any) -> dict[str, Any]:
    return {"end": end, "step": step, **keys}


def stepped(scene: Scene, step: float, integrator: str = "default", **keys: Any) -> Time:
    """The scene's time table with another step, another integrator and other keys."""
    return replace(scene.time, step=step, integrator=integrator, **keys)


# -- states ----------------------------------------
def put(rod: Rod, u: Array | None = None, **components: Any) -> Array:
    """Unknowns with named components set to nodal values (top down) or functions of s; rest from ``u`` or the start."""
    block = (initial_state(rod) if u is None else u).reshape(-1, rod.ansatz.size).copy()
    for name, value in components.items():
        block[rod.nodes, rod.ansatz.index(name)] = value(rod.arc_length) if callable(value) else value
    return block.reshape(-1)


def take(rod: Rod, u: Array, *names: str) -> Array:
    """Nodal values from the top down, shape (nodes,) for one name, (nodes, names) for more."""
    block = u.reshape(-1, rod.ansatz.size)[rod.nodes]
    values = block[:, [rod.ansatz.index(name) for name in names]]
    return values[:, 0] if len(names) == 1 else values


def wave(rng: np.random.Generator, length: float, size: float, terms: int = 3) -> Callable[[Array], Array]:
    """A smooth random function along the rod."""
    a, b = rng.standard_normal((2, terms)) * size
    k = np.arange(1, terms + 1) * 2 / length
    return lambda s: np.cos(np.outer(s, k)) @ a + np.sin(np.outer(s, k)) @ b


def quaternions(R: Array) -> Array:
    """(n, 3, 3) -> (n, 4) scalar first, continuous along n."""
    q = Rotation.from_matrix(R).as_quat()[:, [3, 0, 1, 2]]
    for i in range(1, len(q)):
        q[i] *= np.sign(q[i] @ q[i - 1])
    return q


# -- statics ----------------------------------------
def equilibrium(
    rod: Rod,
    factors: Sequence[float] | Array = (1.0,),
    load: Callable[[float], None] | None = None,
    on_step: Callable[[float, Array], None] | None = None,
    start: Array | None = None,
) -> Equilibrium:
    """Follow ``load`` (default: the scene's tip loads) through ``factors``; the result stays in ``rod.u``, at rest."""
    force, moment = rod.tip_force.value.copy(), rod.tip_moment.value.copy()

    def proportional(factor: float) -> None:
        rod.tip_force.value, rod.tip_moment.value = factor * force, factor * moment

    problem = Statics(rod)
    first = initial_state(rod) if start is None else start
    try:
        result = problem.solve(problem.start(first), np.asarray(factors), load or proportional, on_step)
    finally:
        proportional(1.0)
    state = np.zeros((len(rod.nodes), rod.ansatz.size))
    state[:, : len(rod.ansatz.x_names)] = result.x
    rod.set_state(state.reshape(-1), np.zeros(rod.size))
    return result


# -- errors ----------------------------------------
def gauss(rod: Rod, n: int = 6, derivative: bool = False) -> tuple[Array, Array, Callable[[Array], Array]]:
    """Gauss points (m,) and weights (m,) of the mesh; the map from nodal values (top down) to values, slopes there."""
    p = rod.scene.mesh.degree
    cells = np.arange(rod.scene.mesh.elements)[:, None] * p + np.arange(p + 1)
    x, w = np.polynomial.legendre.leggauss(n)
    nodes = rod.arc_length[cells]
    start, size = nodes[:, :1], nodes[:, -1:] - nodes[:, :1]
    local = 2 * (nodes[0] - start[0]) / size[0] - 1
    powers = np.vander(x, p + 1)
    if derivative:
        powers = np.hstack([powers[:, 1:] * np.arange(p, 0, -1), np.zeros((n, 1))])
    basis = np.linalg.solve(np.vander(local, p + 1).T, powers.T)  # (p + 1, n)

    def interpolate(nodal: Array) -> Array:
        values = np.einsum("an,ca...->cn...", basis, nodal[cells])
        if derivative:
            values = values * (2 / size).reshape(-1, *([1] * (values.ndim - 1)))
        return values.reshape(-1, *nodal.shape[1:])

    return (start + size * (x + 1) / 2).reshape(-1), (size * w / 2).reshape(-1), interpolate


def l2(rod: Rod, nodal: Array, exact: Callable[[Array], Array]) -> float:
    """||f_h - f|| in L2 over the rod, of a nodal field (nodes, ...) against f(s)."""
    s, w, interpolate = gauss(rod)
    difference = (interpolate(nodal) - exact(s)).reshape(len(s), -1)
    return float(np.sqrt(w @ (difference**2).sum(axis=1)))


def order(h: Sequence[float], error: Sequence[float]) -> float:
    """Slope of error against h in logarithms (least squares)."""
    return float(np.polyfit(np.log(h), np.log(error), 1)[0])
