"""Where a run starts: the reference rod, or the nominal drilling state with a perturbed spin (spec 9.2, 9.3)."""

from __future__ import annotations

import numpy as np

from ..compat import Array
from ..forms.ansatz import DEPTH, Spatial
from ..scene.nominal import Nominal
from .rod import Rod
from .steady import start_of_drilling, stretch_and_twist


def initial_state(rod: Rod) -> Array:
    """Vector of unknowns at the start, shape (dofs,)."""
    scene, a, s = rod.scene, rod.ansatz, rod.arc_length
    state: dict[str, Array] = {name: np.zeros(len(s)) for name in a.x_names + a.v_names}
    state |= {"r1": np.zeros(len(s)), "r2": np.zeros(len(s)), "r3": s.copy()}
    bend: Array = np.zeros(len(s))  # rotation about the axis that turns e3 into the bend
    reference = scene.reference
    b = np.asarray(reference.bend_towards)
    if reference.radius is not None:
        bend = np.asarray(s / reference.radius, dtype=np.float64)
        offset = reference.radius * (1 - np.cos(bend))
        state["r1"], state["r2"] = offset * b[0], offset * b[1]
        state["r3"] = reference.radius * np.sin(bend)
    turn: Array = np.zeros(len(s))
    if scene.initial.state == "laid":
        hanging = Nominal(0.0, 0.0, 0.0, scene.weight, 0.0)
        state["r3"] = s + stretch_and_twist(scene, s, hanging)[0]
    elif rod.has_bit:
        f, psi = stretch_and_twist(scene, s)
        state["r3"] = s + f
        if scene.initial.state != "literal":
            turn = psi
        if scene.initial.state != "rest":
            state["v3"][:], state["w3"] = start_of_drilling(scene, s)
    if scene.initial.state == "given":
        # a rigid motion of the unstressed string: v = v_0 + w x r, and w in the axes of the sections
        w = np.asarray(scene.initial.angular_velocity)
        r = np.stack([state[k] for k in ("r1", "r2", "r3")], axis=1)
        v = np.asarray(scene.initial.velocity) + np.cross(w, r)
        along = w @ b * np.ones(len(s))
        across = w @ np.cross((0.0, 0.0, 1.0), b) * np.ones(len(s))
        towards = np.cos(bend) * along - np.sin(bend) * w[2]
        w_m = np.outer(towards, b) + np.outer(across, np.cross((0.0, 0.0, 1.0), b))
        w_m[:, 2] = np.sin(bend) * along + np.cos(bend) * w[2]
        state |= {f"v{k + 1}": v[:, k] for k in range(3)} | {f"w{k + 1}": w_m[:, k] for k in range(3)}
    state["phi"] = turn
    state["theta"] = bend
    state[DEPTH] = state["r3"]  # of a hole along e3
    if isinstance(a, Spatial):
        axis = np.cross((0.0, 0.0, 1.0), b)
        c, d = np.cos(bend / 2), np.sin(bend / 2)
        ct, st = np.cos(turn / 2), np.sin(turn / 2)
        # bend after turn about the material d3: q = q_bend q_turn
        state["q_a"], state["q_d"] = c * ct, c * st
        state["q_b"] = d * (axis[0] * ct + axis[1] * st)
        state["q_c"] = d * (axis[1] * ct - axis[0] * st)
    u = np.empty((len(s), a.size))
    for i, name in enumerate(a.x_names + a.v_names):
        u[rod.nodes, i] = state[name]
    return u.reshape(-1)
