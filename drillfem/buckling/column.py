"""A string pushed into its hole: equilibria, their stiffness, and how it creeps away from one that is not stable."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
import ufl

from ..compat import Array, ScalarForm, quadrature_field
from ..errors import SimulationError
from ..forms import virtual_work as vw
from ..forms.wall import Hole, wall_energy
from ..models.modes import eigenpairs
from ..models.rod import Rod
from ..models.soft_string import line_of
from ..scene import Scene
from ..scene.tables import Bit
from ..solve.statics import Statics
from .theory import Pipe

#: Stiffness (N/m) with which the rock holds a bit on the axis of a hole that bends, where the scene has no bit.
_GUIDE = Bit("free").guide_stiffness
#: A step of creeping: greatest way aside, and what is rest (clearances); first drag and least (of F^2/4EI).
_REACH, _REST, _DRAG = 0.15, 1e-6, (4.0, 1e-4)
#: Most steps, and most times an equilibrium that is not stable is left.
_STEPS, _ESCAPES = 2000, 30
#: Least product of quaternions next to each other: less, and a turn has slipped between two nodes.
_NEIGHBOURS = 0.9


def pipe_scene(
    length: float,
    inclination: float = math.pi / 2,
    clearance: float = 0.01,
    spacing: float = 2.0,
    degree: int = 3,
    stiffness: float = 1e8,
    outer_diameter: float = 0.127,
    inner_diameter: float = 0.108,
) -> Scene:
    """A steel pipe (the thesis' drill pipe) in a straight hole: the experiment of the theories of buckling.

    The hole lies along e3 and gravity is inclined to it instead, so that both ends can be held across the hole. Lengths
    in m, inclination in rad, stiffness of the wall in N/m2; spacing: length of an element.
    """
    return Scene.from_dict(
        {
            "string": [
                {"name": "pipe", "length": length, "outer_diameter": outer_diameter, "inner_diameter": inner_diameter}
            ],
            "material": {"youngs_modulus": 210e9, "shear_modulus": 77e9, "density": 7800},
            "hole": {"kind": "straight", "diameter": outer_diameter + 2 * clearance},
            "contact": {"stiffness": stiffness, "friction_static": 0.0, "friction_dynamic": 0.0},
            "gravity": {"magnitude": 9.81, "direction": [math.sin(inclination), 0.0, math.cos(inclination)]},
            "ends": {"top": "hung", "bottom": "guided"},
            "initial": {"state": "laid"},
            "model": "spatial",
            "mesh": {"elements": max(2, round(length / spacing)), "degree": degree},
            "time": {"end": 1.0, "step": 0.1},
        }
    )


def pipe_of(scene: Scene) -> Pipe:
    """The theory's pipe of a scene: its lowest section, and the hole there. The wall gives way as its penalty does."""
    line, stiffness = line_of(scene), scene.string[-1].section_stiffness()
    here, contact = line.at(np.array([line.length])), scene.contact
    across = float(np.linalg.norm(here.across[0]))
    soft = across / contact.stiffness if contact is not None and contact.method == "penalty" else 0.0
    return Pipe(
        stiffness.bending1,
        float(here.clearance[0]) + soft,
        across,
        float(here.along[0]),
        stiffness.shear1,
        stiffness.axial,
    )


class Column(Statics):
    """Statics, without friction, of a string that is pushed at its lower end along the hole by `push` (N).

    ``pinned``: both ends bend freely and stay across the hole where the first state has them (of a hole along e3), and
    the top does not turn about the hole. Else the top is held as the scene says, the lower end on the hole's axis.
    """

    def __init__(self, rod: Rod, pinned: bool = False) -> None:
        c, bit = rod.constant, rod.scene.bit
        load = vw.BitLoad(rod.weight, rod.torque)
        if rod.bends:
            load = replace(load, hole=Hole(rod.bit_hole), guide=c(bit.guide_stiffness if bit is not None else _GUIDE))
        rod.loads = replace(rod.loads, bit=load)
        self.drag = c(0.0)
        assert rod.wall is not None
        self.before, _ = quadrature_field(rod.mesh, rod.wall_degree, 3)
        super().__init__(rod)
        self.load = 0.0
        if pinned:
            names = rod.ansatz.bare.x_names
            ends = {0: ("r1", "r2", "r3", "q_d"), -1: ("r1", "r2")}
            held = [int(rod.nodes[i]) * self.fields + names.index(k) for i, kept in ends.items() for k in kept]
            self.held = np.array(sorted(held), dtype=np.int32)
        line = line_of(rod.scene)
        self._clearance = line.at(rod.wall.arc_length).clearance
        self.clearance = float(np.median(self._clearance))
        self._weight = float(line.pieces.weight.max())
        self._bending = float(line.pieces.bending.min())
        self._matrix = self.jacobian.create()

    def terms(self) -> vw.Terms:
        """Equilibrium, and a drag on the way across the hole from ``before``: an implicit step of a string that creeps,
        massless, in a thick fluid."""
        rod, a = self.rod, self.rod.ansatz.bare
        at, virtual = a.configuration(self.x, rod.s), a.virtual(ufl.TestFunction(self.V))
        assert rod.loads.wall is not None
        way = rod.loads.wall.offset(at.r) - self.before
        return super().terms() | {"drag": self.drag * ufl.dot(way, virtual.v) * rod.on.wall}

    # -- states ------------------------------------------------------------------------------------------------------
    def push(self, load: float) -> None:
        """Force (N) on the lower end, up the hole."""
        self.load = load
        self.rod.set_bit_load(load, 0.0)

    def lying(self) -> Array:
        """The straight string on the low side of a hole along e3, where the wall carries its weight; on the axis of a
        vertical one. A state (nodes * fields)."""
        rod, pipe = self.rod, pipe_of(self.rod.scene)
        gravity = np.asarray(rod.scene.gravity.direction)[:2]
        x = np.zeros((len(rod.nodes), self.fields))
        if pipe.across > 1e-9 * self._weight:
            x[:, :2] = pipe.clearance * gravity / np.linalg.norm(gravity)
        x[rod.nodes, 2] = rod.arc_length
        x[:, 3] = 1.0
        return self.at(x.reshape(-1))

    def hanging(self) -> Array:
        """The straight string on the axis of a hole along e3. A state (nodes * fields)."""
        x = self.lying().reshape(-1, self.fields)
        x[:, :2] = 0.0
        return self.at(x.reshape(-1))

    def at(self, x: Array) -> Array:
        """A state, with the hole found around it."""
        self.rod.seek_hole(self.state(x))
        return x

    def equilibrium(self, x: Array, load: float) -> Array:
        """Equilibrium at a load by Newton's iteration from one at the present load: stable or not. Raises
        SimulationError."""
        start, self.drag.value = self.load, 0.0
        return self.solve(x, np.ones(1), lambda part: self.push(start + part * (load - start))).x.reshape(-1)

    def offset(self, x: Array) -> Array:
        """Where a state is in the hole (points of the wall, 3), m: from the closest points of its axis."""
        self._set(x)
        wall = self.rod.wall
        assert wall is not None
        return wall.offset(x, self.fields)[0]

    def settle(self, x: Array, load: float, nudge: float = 0.01) -> Array:
        """The stable equilibrium to which the string creeps from a state under a load.

        It is let go of every equilibrium that is not stable: nudged along its softest motion by ``nudge`` clearances.
        Raises SimulationError.
        """
        self.push(load)
        growth = 0.0
        for _ in range(_ESCAPES):
            x = self._creep(x, growth)
            softest, shape = self.softest(x)
            if softest > -1e-5 * self._stiffness:
                return x
            growth = -softest
            aside = shape[:, :2] / np.abs(shape[:, :2]).max()
            x = x.copy().reshape(-1, self.fields)
            x[:, :2] += nudge * self.clearance * aside
            x = x.reshape(-1)
        raise SimulationError(
            f"buckling: the string finds no stable equilibrium under {load / 1e3:.4g} kN: try more mesh.elements"
        )

    @property
    def _stiffness(self) -> float:
        """Lateral stiffness per length (N/m2) that compression takes away at most, F^2/4EI; of the weight, if more."""
        return max(self.load**2 / (4 * self._bending), 1e-3 * self._weight / self.clearance)

    def _creep(self, x: Array, growth: float) -> Array:
        """Follow the creeping string until it rests: steps grow while Newton's iteration is quick.

        A motion that grows, by -``growth`` (N/m2) of stiffness at first, would die out in longer steps than its own.
        """
        rod, unit = self.rod, self._stiffness
        offset, last = self.offset(x), 0.0
        drag, least = (part * unit for part in _DRAG)
        if growth:
            drag = 4 * growth
        for _ in range(_STEPS):
            self.before.x.array[:] = offset.reshape(-1)
            self.drag.value = drag
            there = rod.there()
            try:
                found = self.solve(x, np.array([self.load]), self.push, least=np.inf)
                after = self.offset(found.x.reshape(-1))
                moved = float((np.linalg.norm(after - offset, axis=1) / self._clearance).max())
                q = found.x[rod.nodes, 3:]
                good = moved < _REACH and np.einsum("ij,ij->i", q[1:], q[:-1]).min() > _NEIGHBOURS
            except SimulationError:
                good = False
            if not good:
                rod.go_back(there)
                drag *= 3
                if drag > 1e9 * unit:
                    break
                continue
            x, offset = found.x.reshape(-1), after
            if moved < _REST and drag <= least:
                self.drag.value = 0.0
                return x
            if found.newton_iterations <= 6:
                grows = growth > 0 and moved > 1.1 * max(last, _REST)
                drag = max(drag * max(moved / (0.7 * _REACH), 0.1), 2 * growth if grows else least)
            last = moved
        self.drag.value = 0.0
        raise SimulationError(
            f"buckling: under {self.load / 1e3:.4g} kN the string does not come to rest: try more mesh.elements or a "
            "smaller contact.stiffness"
        )

    # -- stiffness ---------------------------------------------------------------------------------------------------
    @cached_property
    def _free(self) -> npt.NDArray[np.int64]:
        """Displacements and rotations that no end condition holds, among six per node."""
        # a quaternion's first component has no motion of its own, the others go with the rotations
        node, component = self.held // self.fields, self.held % self.fields
        keep = component != 3
        motion = np.where(component < 3, component, component - 1)
        free = np.ones(6 * len(self.rod.nodes), dtype=bool)
        free[(6 * node + motion)[keep]] = False
        return np.flatnonzero(free)

    def tangent(self, x: Array) -> sp.csr_matrix:
        """Stiffness at a state by displacements (m) and material rotations (rad) of the nodes, as many as are free."""
        self._set(x)
        self.jacobian(self._matrix)
        start, column, value = self._matrix.getValuesCSR()
        full = sp.csr_matrix((value, column, start), shape=self._matrix.getSize())
        n = len(self.rod.nodes)
        a, b, c, d = x.reshape(n, -1)[:, 3:].T / 2
        motion = np.zeros((n, self.fields, 6))
        motion[:, :3, :3] = np.eye(3)
        # dq = q (0, dtheta)/2
        motion[:, 3:, 3:] = np.moveaxis(np.array([[-b, -c, -d], [a, -d, c], [d, a, -b], [-c, b, a]]), 2, 0)
        moves = sp.bsr_matrix((motion, np.arange(n), np.arange(n + 1)), shape=(self.fields * n, 6 * n))
        rows = np.flatnonzero(np.arange(self.fields * n) % self.fields != 3)  # that of the quaternion's length is none
        return (full @ moves)[rows][self._free][:, self._free].tocsr()

    def motion(self, vector: Array) -> Array:
        """Displacements and rotations (nodes, 6) of the free ones, in the order of the unknowns."""
        out = np.zeros(6 * len(self.rod.nodes))
        out[self._free] = vector
        # the solver's sign is no one's: the largest displacement across points along its axis
        shape = out.reshape(-1, 6)
        largest = shape[:, :2].flat[np.abs(shape[:, :2]).argmax()]
        return shape * (math.copysign(1.0, largest) if largest else 1.0)

    def softest(self, x: Array) -> tuple[float, Array]:
        """Least stiffness per length (N/m2) of an equilibrium and its motion (nodes, 6): negative, if not stable."""
        share = np.empty(len(self.rod.nodes))
        share[self.rod.nodes] = np.gradient(self.rod.arc_length)
        # rotations weigh as those of a thin rod do
        weight = np.repeat(share[:, None], 6, axis=1) * ([1.0] * 3 + [1e-4] * 3)
        mass = sp.diags(weight.reshape(-1)[self._free]).tocsr()
        values, vectors = eigenpairs(self.tangent(x), mass, 2, -1.2 * self._stiffness)
        i = int(values.real.argmin())
        return float(values.real[i]), self.motion(vectors[:, i].real)

    # -- energy ------------------------------------------------------------------------------------------------------
    @cached_property
    def _potential(self) -> ScalarForm:
        rod = self.rod
        loads, section = rod.loads, rod.section
        assert loads.wall is not None
        at = rod.ansatz.bare.configuration(self.x, rod.s)
        weight = section["mass"] - (loads.mud["displaced"] if loads.mud is not None else 0.0)
        wall = wall_energy(at, section["contact_radius"], loads.wall)
        strain = vw.strain_energy(rod.ansatz.bare, self.x, rod.s, section, loads, rod.on)
        return ScalarForm(strain + wall * rod.on.wall - weight * ufl.dot(loads.g, at.r) * rod.on.mass)

    def energy(self, x: Array) -> float:
        """Potential (J) of string, wall, weight and load, of a hole along e3."""
        self._set(x)
        return self._potential() + self.load * float(x.reshape(len(self.rod.nodes), -1)[self.rod.nodes[-1], 2])
