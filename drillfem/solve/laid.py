"""A string laid in a hole: equilibrium on its wall, without friction and without the story of how it came there."""

from __future__ import annotations

import logging

import numpy as np

from ..compat import Array
from ..errors import SimulationError
from ..forms.ansatz import Spatial
from ..models.initial import initial_state
from ..models.rod import Rod
from ..models.steady import start_of_drilling, stretch_and_twist
from .statics import Statics

log = logging.getLogger("drillfem")

#: Springs to the centreline that are let go one after the other, as multiples of the heaviest section's weight per
#: length (with what a pull at the tip presses in a bend) and metre of clearance: the first hold the string off the
#: wall, the last ones no longer count.
_SUPPORTS = (3e1, 3e0, 1e0, 3e-1, 1e-1, 3e-2, 1e-2, 1e-3, 1e-4, 0.0)


def along_hole(rod: Rod) -> Array:
    """Configuration (nodes * fields, flat) of the string on the hole's centreline: stretched and, by the torque at its
    bit, twisted as a straight one would be."""
    hole = rod.scene.borehole
    assert hole is not None
    stretch, twist = stretch_and_twist(rod.scene, rod.arc_length)
    frame = hole.frame(rod.arc_length + stretch)
    a, b, c, d = transported(frame.tangent).T
    cos, sin = np.cos(twist / 2), np.sin(twist / 2)
    q = np.stack([a * cos - d * sin, b * cos + c * sin, c * cos - b * sin, d * cos + a * sin], axis=1)
    x = np.empty((len(rod.nodes), 7))
    x[rod.nodes] = np.hstack([frame.position, q])
    return x.reshape(-1)


def _straight(rod: Rod) -> Array:
    """Configuration (nodes * fields, flat) of the unstressed string, in a hole along it."""
    a = rod.ansatz
    return np.ascontiguousarray(initial_state(rod).reshape(-1, a.size)[:, : len(a.x_names)]).reshape(-1)


def transported(tangent: Array) -> Array:
    """Quaternions (n, 4) that turn e3 into the tangents (n, 3) without twist: each the last, turned the short way."""
    q = np.empty((len(tangent), 4))
    last, before = np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    for i, t in enumerate(tangent):
        # the rotation that takes `before` to t about their common normal
        turn = np.array([1.0 + before @ t, *np.cross(before, t)])
        turn /= np.linalg.norm(turn)
        a, v = turn[0], turn[1:]
        b, w = last[0], last[1:]
        last = np.array([a * b - v @ w, *(a * w + b * v + np.cross(v, w))])
        q[i], before = last, t
    return q


def lay(rod: Rod) -> Array:
    """Unknowns (dofs,) of the string at rest in its hole, in equilibrium without friction.

    The load on the bit is what ``rod.set_bit_load`` was told last. Raises SimulationError if no equilibrium is found.
    """
    scene, statics = rod.scene, Statics(rod)
    assert rod.wall is not None
    x = along_hole(rod) if isinstance(rod.ansatz, Spatial) else _straight(rod)
    u = statics.state(x)
    rod.wall.seek(u)
    rod.find_hole(u)
    weight = max(s.mass_per_length for s in scene.string) * scene.gravity.magnitude
    # in a bend what pulls presses too
    weight += float(np.linalg.norm(rod.tip_force.value)) * rod.wall.hole.sharpest()[0]
    clearance = max(float(rod.wall.gap), 1e-4)
    for support in _SUPPORTS:
        statics.support.value = support * weight / clearance
        try:
            found = statics.solve(x, np.ones(1), lambda _: None)
        except SimulationError as error:
            raise SimulationError(
                f"the string finds no equilibrium in the hole ({error}): try more mesh.elements, a smaller "
                "contact.stiffness or contact.method = 'smooth'"
            ) from None
        x = found.x.reshape(-1)
        log.debug("laid: support %.3g, %d iterations, gap %.3g m", support, found.newton_iterations, rod.wall.gap)
    return statics.state(x)


def start_of(rod: Rod) -> Array:
    """Unknowns (dofs,) at the start of a run."""
    scene = rod.scene
    if rod.wall is None or (scene.initial.state != "laid" and not rod.bends):
        return initial_state(rod)
    nominal, a = scene.nominal(), rod.ansatz
    drilling = scene.initial.state == "nominal" and rod.has_bit
    if drilling:
        rod.set_bit_load(nominal.weight_on_bit, nominal.torque_on_bit)
    u = lay(rod).reshape(-1, a.size)
    if drilling:
        assert rod.wall is not None
        r = u[:, :3]
        tangent = rod.wall.hole.frame(rod.wall.hole.nearest(r)).tangent
        speed, spin = start_of_drilling(scene, rod.arc_length)
        u[:, [a.index(k) for k in ("v1", "v2", "v3")]] = speed * tangent
        u[rod.nodes, a.index("w3")] = spin
    return u.reshape(-1)
