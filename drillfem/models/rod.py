"""The semi-discrete rod F(t, u, u-dot) = 0 of a scene, for every ansatz of the one weak form."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import dolfinx
import numpy as np
import numpy.typing as npt
import ufl
from mpi4py import MPI
from petsc4py import PETSc

from ..bitrock.jit import kernel
from ..boreholes import Borehole
from ..boreholes.closest import piece
from ..compat import (
    Array,
    MatrixForm,
    ScalarForm,
    VectorForm,
    compile_expression,
    discontinuous,
    gauss_points,
    lagrange,
    reference_nodes,
)
from ..forms import virtual_work as vw
from ..forms.ansatz import Ansatz, Spatial, ansatz
from ..forms.bit import Saturating
from ..forms.constitutive import SECTION, Section, elastic_resultants, viscous_resultants
from ..forms.kinematics import Twist
from ..forms.mud import MUD, Mud
from ..forms.wall import Hole, Wall, friction, wall_energy
from ..meshes.string import BOTTOM, TOP, StringMesh, string_mesh
from ..scene import Scene
from ..scene.mud import mud_properties
from ..scene.nominal import lumped_at_bit
from ..scene.tables import E3
from .drive import law_of
from .steady import outer_diameter
from .top_drive import TopTorque
from .wall import WallPoints

#: Velocity components that an end condition holds; the spin of a driven top is imposed by the drive instead.
_HELD = {
    "free": (),
    "pinned": ("v1", "v2", "v3"),
    "clamped": ("v1", "v2", "v3", "w1", "w2", "w3"),
    "hung": ("v1", "v2", "v3", "w1", "w2"),
    "sliding": ("v1", "v2", "w1", "w2", "w3"),
    "guided": ("v1", "v2"),
    "bit": ("v1", "v2", "w1", "w2"),
}


def section_table(scene: Scene) -> Array:
    """Properties of every section, shape (sections, len(SECTION)), SI."""
    rows = []
    share = scene.inertia.distributed
    of_mass = share if scene.resolved_model().name != "torsional" else 1.0
    for section in scene.string:
        k = section.section_stiffness()
        rows.append(
            [
                k.shear1,
                k.shear2,
                k.axial,
                k.bending1,
                k.bending2,
                k.torsion,
                section.mass_per_length * of_mass,
                section.rotary_inertia * share,
                section.rotary_inertia * share,
                section.retardation_time,
                section.contact_radius,
            ]
        )
    return np.array(rows)


def section_field(scene: Scene, mesh: StringMesh) -> dolfinx.fem.Function:
    """Piecewise constant field of the section properties, components ordered as SECTION."""
    field = dolfinx.fem.Function(discontinuous(mesh.mesh, 0, len(SECTION)))
    _fill(field, scene, mesh)
    return field


def _fill(field: dolfinx.fem.Function, scene: Scene, mesh: StringMesh) -> None:
    values = field.x.array.reshape(-1, len(SECTION))
    cells = field.function_space.dofmap.list[mesh.cells.indices, 0]
    values[cells] = section_table(scene)[mesh.cells.values]


def structure(scene: Scene) -> Hashable:
    """What the forms, kernels and matrices of a scene's rod depend on: scenes where it is equal differ by numbers only,
    and :meth:`Rod.take` leads from one to the other. None: no other scene's rod will do."""
    drive, contact, bit, hole = scene.top_drive, scene.contact, scene.bit, scene.hole
    if drive.follows or scene.mud is not None or scene.inertia.distributed != 1 or hole.bends:
        return None
    wall: Hashable = None
    if contact is not None:
        if contact.method == "augmented" or contact.closest_point == "field":
            return None
        wall = contact.method, contact.projected, contact.normal_force, contact.retardation_time
    return (
        (scene.resolved_model().name, scene.reading, scene.engine, scene.time.analysis, scene.mesh, scene.reference),
        tuple(s.length for s in scene.string),
        (hole.kind, wall, scene.motor is None, bit and bit.kind),
        (scene.ends.top, scene.ends.bottom, scene.hangs, drive.kind, drive.axis, drive.block_speed),
    )


def measures(mesh: StringMesh, degree: int, reduced: bool = True, wall_degree: int = 0) -> vw.Measures:
    """Integration rules for fields of this degree; ``wall_degree``: degree of the rule of contact, 0 for that of mass.

    Internal work: ``degree`` Gauss points, exact for the products of strains that can be exact without locking
    (fully integrated P1 is 1458 times too stiff in bending on 12.5 m of drill pipe). Kinematics: Gauss-Lobatto points,
    which are the nodes of the element, so that r-dot = v holds at every node.
    """
    ds = ufl.Measure("ds", mesh.mesh, subdomain_data=mesh.ends)
    rules: list[dict[str, Any]] = [
        {"quadrature_degree": 2 * degree - 1 if reduced else 2 * degree},
        {"quadrature_degree": 2 * degree},
        {"quadrature_rule": "GLL", "quadrature_degree": 2 * degree - 1},
        {"quadrature_degree": wall_degree or 2 * degree},
    ]
    if degree == 1 or wall_degree == 1:
        # a kernel of its own for each rule: FFCx 0.9 takes fields at the single point of one rule for their values at
        # the points of the other rules in the same kernel
        every = np.arange(mesh.cells.values.size, dtype=np.int32)
        dx = ufl.Measure("dx", mesh.mesh, subdomain_data=[(k, every) for k in range(4)])
        internal, full, nodal, wall = (dx(k, metadata=rule) for k, rule in enumerate(rules))
    else:
        dx = ufl.Measure("dx", mesh.mesh)
        internal, full, nodal, wall = (dx(metadata=rule) for rule in rules)
    return vw.Measures(internal, full, nodal, wall, ds(TOP), ds(BOTTOM))


@kernel(lean=True)
def _hold(rows: npt.NDArray[np.int32], u: Array, imposed: Array, out: Array, reaction: Array) -> None:
    """Put u (n,) less what is imposed into some rows of out (n,), what stood there into reaction."""
    for k in range(rows.size):
        reaction[k] = out[rows[k]]
        out[rows[k]] = u[rows[k]] - imposed[k]


@kernel()
def rotations(q: Array) -> Array:
    """Rotation matrices (n, 3, 3) of quaternions (n, 4) of any length (2-18)."""
    R = np.empty((len(q), 3, 3))
    for i in range(len(q)):
        a, b, c, d = q[i]
        n = a * a + b * b + c * c + d * d
        R[i, 0] = (a * a + b * b - c * c - d * d) / n, 2 * (b * c - a * d) / n, 2 * (a * c + b * d) / n
        R[i, 1] = 2 * (a * d + b * c) / n, (a * a - b * b + c * c - d * d) / n, 2 * (c * d - a * b) / n
        R[i, 2] = 2 * (b * d - a * c) / n, 2 * (a * b + c * d) / n, (a * a - b * b - c * c + d * d) / n
    return R


@dataclass(frozen=True)
class BitDofs:
    """Where the bit's motion stands in the vector of unknowns."""

    depth: int
    speed: int
    spin: int
    rotation: slice | int  # quaternion (4 entries) or angle


class Rod:
    """A scene's rod: fields, named terms, residual and Jacobian of F(t, u, u-dot) = 0 on one process.

    Unknowns ``u`` have one block of ``ansatz.size`` entries per node; ``nodes`` lists the nodes from the top down.
    ``weight`` and ``torque`` (the rock's load on the bit) are set by whoever solves: the law is not part of the form.
    ``vector_form``, ``scalar_form``: who assembles; to be set before the first evaluation.
    """

    vector_form: Callable[[ufl.Form], Any] = VectorForm
    scalar_form: Callable[[ufl.Form], Any] = ScalarForm

    def __init__(self, scene: Scene, comm: MPI.Comm = MPI.COMM_SELF) -> None:
        if comm.size > 1:
            raise ValueError("a rod lives on one process: give it COMM_SELF (ensembles run one string per process)")
        self.scene = scene
        self.literal = scene.reading == "literal"
        self.model = scene.resolved_model()[0]
        self.ansatz: Ansatz = ansatz(self.model, literal=self.literal, depth=self._solves_depth())
        self.string = string_mesh(comm, [s.length for s in scene.string], scene.mesh.elements, scene.mesh.grading)
        self.mesh = self.string.mesh
        self.V = lagrange(self.mesh, scene.mesh.degree, self.ansatz.size)
        self.u, self.u_dot = dolfinx.fem.Function(self.V), dolfinx.fem.Function(self.V)
        self._u, self._u_dot = self.u.x.array, self.u_dot.x.array
        s = self.V.tabulate_dof_coordinates()[:, 0]
        self.nodes = np.argsort(s)
        self._last = int(self.nodes[-1])
        self.arc_length: Array = s[self.nodes]
        self.length = float(sum(section.length for section in scene.string))
        self._loading: list[dolfinx.fem.Constant] = []
        self._present: Iterator[dolfinx.fem.Constant] | None = None
        #: what an engine keeps for the next run on this rod
        self.kept: dict[str, Any] = {}
        self.on = measures(self.string, scene.mesh.degree, scene.mesh.quadrature == "reduced", self.wall_degree)
        self.section = Section(section_field(scene, self.string))
        self.s = ufl.SpatialCoordinate(self.mesh)[0]
        self.weight, self.torque = self.constant(0.0), self.constant(0.0)
        self._weight_value, self._torque_value = self.weight.value, self.torque.value
        #: load of the rock on the bit: weight (N), torque (N m); change it by :meth:`set_bit_load`
        self.bit_load: Array = np.zeros(2)
        self.wall = self._wall()
        #: piece of the hole's centreline at the bit, where the hole bends; unit tangent of the hole there (3,)
        self.bit_hole = self.constant(np.zeros(9))
        self._bit_piece: Array = self.bit_hole.value
        self.bit_tangent: Array = self._bit_piece[3:6]
        self.bit_tangent[:] = 0.0, 0.0, 1.0
        self.bit_measured_depth = self.length
        self.tip_force = self.constant(scene.ends.tip_force)
        self.tip_moment = self.constant(scene.ends.tip_moment)
        self.shift = self.constant(1.0)
        law = law_of(scene)
        #: the drive, where it is a torque that follows the top
        self.drive = TopTorque(scene, law, self.constant) if law is not None else None
        #: force of a mud motor at the lower end (N), and the speed that it works on
        self.push = self.constant(0.0)
        self._push_value = self.push.value
        self._advancing = self.dof(-1, "v3") if "v3" in self.ansatz.v_names else None
        self.loads = self._loads()
        self.terms = vw.dynamic_terms(
            self.ansatz,
            self.u,
            self.u_dot,
            ufl.TestFunction(self.V),
            self.s,
            self.section,
            self.loads,
            self.on,
            self.literal,
        )
        self.held, self.driven = self._conditions()
        #: axial speed of the top of a string that no constant load holds (m/s), and its dof
        self.block_speed = scene.top_drive.block_speed or 0.0
        axial = self.dof(0, "v3") if "v3" in self.ansatz.v_names else None
        self.lowered = axial if scene.ends.top == "driven" and axial in self.held else None
        self.constrained = np.array(sorted([*self.held, *self.driven]), dtype=np.int32)
        #: the driven dof that turns about the string's axis, and the inertia lumped there
        self.driven_spin = self.dof(0, "w3") if "w3" in self.ansatz.v_names else None
        #: raw residual at the constrained dofs: the reactions of the last evaluation
        self.reaction: Array = np.zeros(len(self.constrained))
        #: speeds that are imposed on them (m/s, rad/s), see :meth:`at`
        self.imposed: Array = np.zeros(len(self.constrained))
        self._driven_at = [(int(np.searchsorted(self.constrained, row)), share) for row, share in self.driven.items()]
        if self.lowered is not None:
            self.imposed[np.searchsorted(self.constrained, self.lowered)] = self.block_speed
        self._work: Array = np.zeros(self.size)
        #: whether the wall may act on the present state; None: that has not been asked yet
        self.near_wall: bool | None = None

    # -- what acts ---------------------------------------------------------------------------------------------------

    def constant(self, value: Any) -> dolfinx.fem.Constant:
        """A coefficient that can be changed without compiling again."""
        return dolfinx.fem.Constant(self.mesh, np.asarray(value, dtype=np.float64))

    def _load(self, value: Any) -> dolfinx.fem.Constant:
        """A coefficient of :meth:`_loads`: a new one, or the next of those that are there."""
        if self._present is None:
            self._loading.append(self.constant(value))
            return self._loading[-1]
        found = next(self._present)
        found.value = np.asarray(value, dtype=np.float64)
        return found

    def take(self, scene: Scene) -> None:
        """Go on with another scene, as if this rod had been made of it; both must be equal in :func:`structure`."""
        self.scene = scene
        for name in ("_end_forces", "_tip_moves", "_weight_vector", "_mass_at_wall", "_damped", "outer_diameter"):
            self.__dict__.pop(name, None)
        _fill(self.section.field, scene, self.string)
        if self.wall is not None:
            self.wall.begin(*self._hole_and_radius())
        self.bit_measured_depth = self.length
        self.tip_force.value, self.tip_moment.value = scene.ends.tip_force, scene.ends.tip_moment
        self._present = iter(self._loading)
        self.loads = self._loads()
        self._present = None
        self.set_bit_load(0.0, 0.0)

    def _loads(self) -> vw.Loads:
        scene, ends, c = self.scene, self.scene.ends, self._load
        g = c(np.asarray(scene.gravity.direction) * scene.gravity.magnitude)
        hook_load = scene.nominal().hook_load if scene.hangs else 0.0
        wall = None
        if self.wall is not None and scene.contact is not None:
            k = scene.contact
            wall = Wall(
                self.wall.field,
                stiffness=c(k.stiffness),
                smoothing=c(k.smoothing),
                velocity_scale=c(k.friction_velocity_scale),
                regularisation=c(k.friction_regularisation),
                method=k.method,
                projected=k.projected and not self.literal,
                retardation=c(self.wall.retardation) if self.wall.retardation else None,
                load=self.section["mass"] * g if k.normal_force == "weight" else None,
            )
        bit = None
        if self.has_bit:
            bit = vw.BitLoad(self.weight, self.torque)
            if self.bends and scene.bit is not None:
                bit = replace(bit, hole=Hole(self.bit_hole), guide=c(scene.bit.guide_stiffness))
        return vw.Loads(
            g=g,
            u0=c(self._stress_free_curvature()),
            top=vw.EndLoad(
                c(np.asarray(ends.top_force) - (0.0, 0.0, hook_load)),
                c((0.0, 0.0, 0.0)),
                c(ends.top_mass),
                c(ends.top_inertia),
            ),
            bottom=vw.EndLoad(self.tip_force, self.tip_moment, c(ends.bottom_mass), c(ends.bottom_inertia)),
            bit=bit,
            wall=wall,
            lump=self._lump(),
            motor=self.drive.motor if self.drive is not None else None,
            mud=self._mud(),
            centreline=None if self.wall is None or self.wall.at_nodes is None else Hole(self.wall.at_nodes),
            resistance=self._resistance(),
            push=self.push if scene.motor is not None else None,
        )

    def _resistance(self) -> Saturating | None:
        strength, rate = self._saturating
        return Saturating(self._load(strength), self._load(rate)) if self.scene.resists else None

    def resistance(self, speed: float) -> float:
        """Force (N) of rock that saturates, against a lower end that advances with ``speed`` (m/s); 0 without it."""
        strength, rate = self._saturating
        return -strength * math.expm1(-rate * max(0.0, speed))

    @property
    def _saturating(self) -> tuple[float, float]:
        bit = self.scene.bit
        if bit is None or not self.scene.resists:
            return 0.0, 0.0
        # (7-5) and (7-6) as printed push the bit forward
        return (-1.0 if self.literal else 1.0) * bit.saturating.strength, bit.saturating.rate

    def _lump(self) -> vw.Lump | None:
        alpha, c = self.scene.inertia.distributed, self._load
        if alpha == 1.0:
            return None
        mass, inertia = lumped_at_bit(self.scene)
        at_bit = vw.EndLoad(c((0.0, 0.0, 0.0)), c((0.0, 0.0, 0.0)), c(mass), c(inertia))
        return vw.Lump(c(alpha), at_bit)

    def _mud(self) -> Mud | None:
        mud = self.scene.mud
        if mud is None:
            return None
        V = discontinuous(self.mesh, 0, len(MUD))
        field = dolfinx.fem.Function(V)
        cells = V.dofmap.list[self.string.cells.indices, 0]
        middle = self.string.mesh.geometry.x[self.mesh.geometry.dofmap[self.string.cells.indices], 0].mean(axis=1)
        field.x.array.reshape(-1, len(MUD))[cells] = mud_properties(self.scene, self.string.cells.values, middle)
        return Mud(field, moves=mud.added_mass, drags=mud.viscosity > 0)

    @property
    def _touches(self) -> bool:
        """Whether there is a wall, and the model knows where the string is in its hole."""
        scene = self.scene
        return scene.hole.kind != "none" and scene.contact is not None and self.model in ("spatial", "planar")

    def _solves_depth(self) -> bool:
        """Whether the measured depth of the closest point is an unknown (D-6)."""
        contact = self.scene.contact
        return self._touches and contact is not None and contact.closest_point == "field"

    def _wall(self) -> WallPoints | None:
        scene, contact = self.scene, self.scene.contact
        if scene.borehole is None or contact is None or not self._touches:
            return None
        found = WallPoints(self.V, *self._hole_and_radius(), self.wall_degree, self.ansatz)
        if scene.time.analysis == "dynamic":
            # multipliers that hold a point by its place alone throw it back with more than it brought
            least = scene.time.step if contact.method == "augmented" else 0.0
            found.retardation = max(contact.retardation_time, least)
        return found

    def _hole_and_radius(self) -> tuple[Borehole, Array, Array]:
        """Hole; what touches it (cells,), m; coefficients of friction (2,) where the hole has none of its own."""
        hole, contact = self.scene.borehole, self.scene.contact
        assert hole is not None and contact is not None
        radius = section_table(self.scene)[:, SECTION.index("contact_radius")][self.string.cells.values]
        by_cell = np.empty_like(radius)
        by_cell[self.string.cells.indices] = radius
        return hole, by_cell, np.array([contact.friction_static, contact.friction_dynamic])

    @property
    def wall_degree(self) -> int:
        """Degree of the rule that integrates contact: that of the mass matrix; of an augmented Lagrangian the one of
        the fewest points that spread an even load as the fields do.

        More of them would hold the string at more points than it has unknowns to follow: their multipliers zigzag (on
        elements of 25 m by 54 % of the weight, with this rule by 1 %; docs/contact.md). So does a penalty that is too
        stiff for the mesh; a soft one gains from the finer rule.
        """
        degree, contact = self.scene.mesh.degree, self.scene.contact
        return degree | 1 if contact is not None and contact.method == "augmented" else 2 * degree

    @cached_property
    def bends(self) -> bool:
        """Whether the string lies in a hole that leaves the axis e3."""
        return self.wall is not None and self.scene.hole.bends

    @cached_property
    def has_bit(self) -> bool:
        """Whether rock loads the lower end."""
        return self.scene.bites

    def _stress_free_curvature(self) -> tuple[float, float, float]:
        reference = self.scene.reference
        if reference.shape == "straight":
            return (0.0, 0.0, 0.0)
        # the axis about which e3 turns towards the bend is e3 x b
        b = np.asarray(reference.bend_towards)
        axis = np.cross((0.0, 0.0, 1.0), b) / reference.radius
        return (float(axis[0]), float(axis[1]), float(axis[2]))

    # -- end conditions ----------------------------------------------------------------------------------------------

    def dof(self, node: int, name: str) -> int:
        """Index of a named component at a node (0 = top, -1 = bottom)."""
        return int(self.nodes[node]) * self.ansatz.size + self.ansatz.index(name)

    def _conditions(self) -> tuple[list[int], dict[int, float]]:
        """Dofs held at zero speed, and driven ones with their share of the drive's speed (component of its axis)."""
        scene, ends, names = self.scene, self.scene.ends, self.ansatz.v_names
        held: list[int] = []
        driven: dict[int, float] = {}
        for node, kind in ((0, ends.top), (-1, ends.bottom)):
            if kind == "driven":
                # about a fixed axis that is also a material one, R(0) = 1 at the top
                turning = {f"w{k + 1}": x for k, x in enumerate(scene.top_drive.axis) if x != 0.0}
                fixed = ["v1", "v2", "w1", "w2", "w3"] + ([] if scene.hangs else ["v3"])
                held += [self.dof(node, n) for n in fixed if n in names and n not in turning]
                if self.drive is None:
                    driven |= {self.dof(node, n): x for n, x in turning.items() if n in names}
            elif not (kind == "bit" and self.bends):  # there the hole guides it
                held += [self.dof(node, n) for n in _HELD[kind] if n in names]
        return held, driven

    @property
    def turns(self) -> bool:
        """Whether the lower end has a spin of its own to follow: it carries a bit, hangs in a hole, or is turned."""
        drive = self.scene.top_drive
        able = "r3" in self.ansatz.x_names and "w3" in self.ansatz.v_names
        turned = drive.kind != "none" and drive.axis == E3
        return able and (turned or self.scene.bit is not None or self.wall is not None)

    def end_motion(self, u: Array) -> tuple[float, float, float]:
        """Measured depth (m), speed along the hole (m/s) and spin (rad/s) of the lower end in a state.

        The depth is that of the last :meth:`find_hole` where the hole bends, else the end's coordinate.
        """
        at = self.bit
        if not self.bends:
            return float(u[at.depth]), float(u[at.speed]), float(u[at.spin])
        first = at.speed - 2
        return self.bit_measured_depth, float(u[first : first + 3] @ self.bit_tangent), float(u[at.spin])

    @cached_property
    def bit(self) -> BitDofs:
        """Where the motion of the lower end stands in u (ansätze that turn about the axis)."""
        if "q_a" in self.ansatz.x_names:
            first = self.dof(-1, "q_a")
            rotation: slice | int = slice(first, first + 4)
        else:
            rotation = self.dof(-1, "phi")
        return BitDofs(self.dof(-1, "r3"), self.dof(-1, "v3"), self.dof(-1, "w3"), rotation)

    # -- residual and Jacobian -----------------------------------------------------------------------------------------

    @cached_property
    def _residual(self) -> VectorForm:
        return self.vector_form(vw.total(self.terms))

    @cached_property
    def _residual_off_wall(self) -> VectorForm:
        """The residual without contact and friction: the same numbers, off the wall, for half of the work."""
        return self.vector_form(vw.total({k: v for k, v in self.terms.items() if k not in ("contact", "friction")}))

    @cached_property
    def _jacobian(self) -> MatrixForm:
        return MatrixForm(self.tangent)

    @property
    def tangent(self) -> ufl.Form:
        """dF/du + shift dF/du-dot, without end conditions."""
        F, trial = vw.total(self.terms), ufl.TrialFunction(self.V)
        return ufl.derivative(F, self.u, trial) + self.shift * ufl.derivative(F, self.u_dot, trial)

    def create_matrix(self) -> PETSc.Mat:
        """Matrix for :meth:`jacobian`."""
        return self._jacobian.create()

    def set_state(self, u: Array, u_dot: Array) -> None:
        """Copy a state into the coefficients of the forms, and find the hole around it."""
        self._u[:] = u
        self._u_dot[:] = u_dot
        self.near_wall = None
        self.find_hole(self._u)

    def find_hole(self, u: Array, size: int = 0) -> None:
        """Closest points of the hole to a state: ``size`` entries per node, position first (default: unknowns)."""
        if self.wall is None:
            return
        self.wall.update(u, size)
        self.find_bit(u, size)

    def find_bit(self, u: Array, size: int = 0) -> None:
        """Closest point of the hole to the lower end alone, see :meth:`find_hole`."""
        if self.wall is None or not self.bends:
            return
        at = self._last * (size or self.ansatz.size)
        here = u[at : at + 3]
        self.bit_measured_depth = piece(self.wall.hole.table, here, self.bit_measured_depth, self._bit_piece)

    def set_bit_load(self, weight: float, torque: float) -> None:
        """Load of the rock on the bit: ``weight`` (N, up), ``torque`` (N m, against the drilling direction)."""
        self.bit_load[0], self.bit_load[1] = weight, torque
        self._weight_value[...], self._torque_value[...] = weight, torque

    def residual(self, t: float, u: Array, u_dot: Array, out: Array) -> None:
        """F(t, u, u-dot), shape (dofs,); end conditions replace the momentum rows of their dofs."""
        self.set_state(u, u_dot)
        self.at(t)
        self._present_residual(out)
        if self.wall is not None and self.wall.trouble:
            out[:] = np.nan  # no step ends here
        _hold(self.constrained, u, self.imposed, out, self.reaction)

    def at(self, t: float) -> None:
        """Loads and imposed speeds (:attr:`imposed`) of time t (s)."""
        if self.drive is not None:
            self.drive.at(t)
        if (motor := self.scene.motor) is not None:
            self._push_value[...] = motor.force * math.sin(motor.frequency * t)
        if self.driven:
            _, speed, _ = self.scene.top_drive.motion(t)
            for place, share in self._driven_at:
                self.imposed[place] = share * speed

    @property
    def _present_residual(self) -> VectorForm:
        by_wall, off_wall = self.residual_forms
        self.near_wall = self._near_wall()
        return by_wall if self.near_wall else off_wall

    @property
    def residual_forms(self) -> tuple[VectorForm, VectorForm]:
        """The residual, by the wall and off it."""
        return self._residual, self._residual_off_wall

    def observe(self, u: Array, u_dot: Array) -> None:
        """Take a state and its reactions, as :meth:`residual` does, without the residual."""
        self.set_state(u, u_dot)
        self._present_residual.at_ends(self._work)
        self.reaction[:] = self._work[self.constrained]

    def jacobian(self, u: Array, u_dot: Array, shift: float, matrix: PETSc.Mat) -> None:
        """dF/du + shift dF/du-dot at a state, with unit rows at the end conditions."""
        self.set_state(u, u_dot)
        self.shift.value = shift
        self._jacobian(matrix)
        matrix.zeroRows(self.constrained, diag=1.0)

    @cached_property
    def _bit_term(self) -> VectorForm:
        return self.vector_form(self.terms["bit"])

    def bit_load_vectors(self) -> Array:
        """dF/d(weight) and dF/d(torque) at the present state, shape (2, dofs): the bit's term is linear in its load,
        but for the force that guides it."""
        load, vectors = self.bit_load.copy(), np.zeros((2, self.size))
        for unit, vector in zip(np.eye(2), vectors, strict=True):
            self.set_bit_load(*unit)
            self._bit_term(vector)
        self.set_bit_load(0.0, 0.0)
        vectors -= self._bit_term(np.zeros(self.size))
        self.set_bit_load(*load)
        vectors[:, self.constrained] = 0.0
        return vectors

    def seek_hole(self, u: Array) -> None:
        """Closest points of a state that may be far from the last one."""
        if self.wall is None:
            return
        self.wall.seek(u)
        first = self.dof(-1, "r1")
        self.bit_measured_depth = float(self.wall.hole.nearest(u[None, first : first + 3])[0])
        self.find_hole(u)

    @property
    def size(self) -> int:
        """Number of scalar unknowns."""
        return len(self.u.x.array)

    def _reaction(self, dof: int) -> float:
        """Reaction at a constrained dof (N or N m) at the last residual."""
        return float(self.reaction[np.searchsorted(self.constrained, dof)])

    def top_torque(self, t: float) -> float:
        """Torque (N m) that an imposed motion of the top takes at time t (s), at the last residual.

        The rate of an integrator is a mean, and that of the trapezoidal rule is none at all: what is lumped at the top
        takes the acceleration that is imposed on it.
        """
        inertia, acceleration = self.scene.ends.top_inertia, self.scene.top_drive.motion(t)[2]
        torque = 0.0
        for dof, x in self.driven.items():
            torque += x * self._reaction(dof)
            if dof == self.driven_spin:
                torque += inertia * x * (x * acceleration - float(self._u_dot[dof]))
        return torque

    def hook_load(self) -> float:
        """Load on the hook (N, up): the constant one, or what holds the top at the last residual."""
        if self.lowered is not None and self.scene.top_drive.axis == E3:
            return -self._reaction(self.lowered)
        return -float(self.loads.top.force.value[2])

    def top_motion(self, u: Array) -> tuple[Array, float]:
        """Rotation (3, 3) and spin (rad/s) of the top in a state."""
        node = u.reshape(-1, self.ansatz.size)[self.nodes[:1]]
        return self._rotations(node)[0], float(node[0, self.ansatz.index("w3")])

    def begin(self, u: Array, share: float = 1.0) -> None:
        """A run starts here; ``share`` of the end of a step in its mean, of integrators that take one of start and end.

        A drive in steady drilling carries its torque from the start: the bit's.
        """
        if self.drive is None:
            return
        steady = self.has_bit and self.scene.initial.state == "nominal"
        self.drive.share = share
        self.drive.begin(*self.top_motion(u), self.scene.nominal().torque_on_bit if steady else None)

    def accept(self, t: float, u: Array) -> None:
        """A step has ended at time t (s) in the state u."""
        if self.drive is not None:
            self.drive.accept(t, *self.top_motion(u))

    def end_power(self) -> float:
        """Power (W) that the hook load and the loads at the tip put into the string at the present state."""
        total = 0.0
        if self.lowered is not None and self.block_speed:
            total += self._reaction(self.lowered) * self.block_speed
        for force, dof in self._end_forces:
            total += force * self._u[dof]
        total += self.push_power()
        if self._tip_moves:
            names = self.ansatz.v_names
            w = [self._u[self.dof(-1, n)] if n in names else 0.0 for n in ("w1", "w2", "w3")]
            total += self.tip_moment.value @ (self.shape()[1][-1] @ w)
        return float(total)

    def push_power(self) -> float:
        """Power (W) that a mud motor puts into the string at the present state."""
        return 0.0 if self._advancing is None else float(self._push_value[()] * self._u[self._advancing])

    def tip(self) -> Array:
        """Where the lower end is in the present state (3,), m."""
        found = np.array([0.0, 0.0, self.length])
        for k, name in enumerate(("r1", "r2", "r3")):
            if name in self.ansatz.x_names:
                found[k] = self._u[self.dof(-1, name)]
        return found

    def end_speed(self, u: Array) -> float:
        """Speed (m/s) of the lower end along e3 in a state; 0 of a model that does not stretch."""
        return 0.0 if self._advancing is None else float(u[self._advancing])

    @cached_property
    def _tip_moves(self) -> bool:
        """Whether there is a moment at the tip."""
        return bool(np.any(self.tip_moment.value))

    @cached_property
    def _end_forces(self) -> list[tuple[float, int]]:
        """Constant forces at the ends, with the speed that each works on."""
        found = []
        for node, load in ((0, self.loads.top), (-1, self.loads.bottom)):
            for k, name in enumerate(("v1", "v2", "v3")):
                if load.force.value[k] != 0.0 and name in self.ansatz.v_names:
                    found.append((float(load.force.value[k]), self.dof(node, name)))
        return found

    # -- audits ------------------------------------------------------------------------------------------------------

    @cached_property
    def _powers(self) -> dict[str, ScalarForm]:
        terms = vw.powers(self.ansatz, self.u, self.u_dot, self.s, self.section, self.loads, self.on, self.literal)
        lost = terms["damping"] + terms["mud drag"] if "mud drag" in terms else terms["damping"]
        power = {"damping": self.scalar_form(lost)}
        if self.loads.wall is not None:
            power |= {name: self.scalar_form(terms[name]) for name in ("contact", "friction")}
        return power

    def gravity_vector(self) -> Array:
        """Virtual work of gravity and buoyancy in every dof (dofs,), on the left-hand side: minus the nodal weights."""
        weight = vw.total({k: v for k, v in self.terms.items() if k in ("gravity", "buoyancy")})
        out: Array = np.zeros(self.size)
        moves = any(name.startswith("v") for name in self.ansatz.v_names)
        return self.vector_form(weight)(out) if moves else out

    @cached_property
    def _weight_vector(self) -> Array:
        return self.gravity_vector()

    def powers(self) -> dict[str, float]:
        """Power (W) of damping (also of mud), gravity, contact and friction at the present state; positive takes energy
        from the string. Contact and friction are left out where the string is off the wall."""
        near = self._near_wall() if self.near_wall is None else self.near_wall
        wanted = {"damping": self._damped, "contact": near, "friction": near}
        power = {name: form() for name, form in self._powers.items() if wanted[name]}
        power.setdefault("damping", 0.0)
        power["gravity"] = float(self._weight_vector @ self._u)
        return power

    @cached_property
    def _damped(self) -> bool:
        """Whether anything but the wall takes energy from a string in motion."""
        return self.scene.mud is not None or any(s.retardation_time for s in self.scene.string)

    def augment(self, shift: float) -> bool:
        """Move the multipliers of the augmented Lagrangian to the present state; False where they may stay.

        shift: d(u-dot)/du of a time step (1/s): a correction of the string's place must also overcome its inertia, and
        the multipliers may move by as much more.
        """
        wall, contact = self.wall, self.scene.contact
        if wall is None or contact is None or contact.method != "augmented":
            return False
        inertia = shift**2 / (1 + wall.retardation * shift) * self._mass_at_wall
        limit = contact.penetration_tolerance
        return wall.augment(self._u, contact.stiffness, limit, inertia) > limit

    def there(self) -> tuple[Array, Array, float] | None:
        """Where the hole was found last, and how the wall's multipliers stood: for :meth:`go_back`."""
        wall = self.wall
        return None if wall is None else (wall.p.copy(), wall.multipliers.copy(), self.bit_measured_depth)

    def go_back(self, there: tuple[Array, Array, float] | None) -> None:
        """Take the hole up again where it was found then."""
        if self.wall is not None and there is not None:
            p, self.wall.multipliers[:], self.bit_measured_depth = there
            self.wall.go_to(p)

    @cached_property
    def _mass_at_wall(self) -> Array:
        """Mass per length (points,; kg/m) at the points of the wall."""
        assert self.wall is not None
        V = self.section.field.function_space
        mass = self.section.field.x.array.reshape(-1, len(SECTION))[V.dofmap.list[:, 0], SECTION.index("mass")]
        return np.repeat(mass, len(self.wall.basis))

    @property
    def wall_reach(self) -> float:
        """Distance (m) from which on the wall acts on a string at rest; infinite where it always does."""
        contact = self.scene.contact
        if contact is None or contact.normal_force == "weight":
            return math.inf
        return contact.smoothing if contact.method == "smooth" else 0.0

    def _near_wall(self) -> bool:
        """Whether the wall may act on any point of the present state (also where one has lost the hole)."""
        wall, contact = self.wall, self.scene.contact
        if wall is None or contact is None:
            return False
        reach = self.wall_reach
        if wall.retardation:
            at = self.ansatz.index("v1")
            reach += wall.retardation * float(np.abs(self._u.reshape(-1, self.ansatz.size)[:, at : at + 3]).max()) * 2
        return not wall.gap > reach or (contact.method == "augmented" and bool(wall.multipliers.any()))

    @cached_property
    def _kinetic(self) -> ScalarForm:
        return self.scalar_form(vw.kinetic_energy(self.ansatz, self.u, self.s, self.section, self.loads, self.on))

    @cached_property
    def _strain(self) -> ScalarForm:
        x, _ = self.ansatz.split(self.u)
        return self.scalar_form(vw.strain_energy(self.ansatz, x, self.s, self.section, self.loads, self.on))

    def energies(self) -> tuple[float, float]:
        """Kinetic and strain energy (J) of the present state."""
        return self._kinetic(), self._strain()

    @cached_property
    def _contact_energy(self) -> ScalarForm:
        assert self.loads.wall is not None
        x, _ = self.ansatz.split(self.u)
        at = self.ansatz.configuration(x, self.s)
        return self.scalar_form(wall_energy(at, self.section["contact_radius"], self.loads.wall) * self.on.wall)

    def contact_energy(self) -> float:
        """Energy (J) stored in the contact of the present state: what its normal force gives back. 0 of an augmented
        Lagrangian, which lets nothing through."""
        contact = self.scene.contact
        stores = contact is not None and contact.method != "augmented"
        return self._contact_energy() if stores and self._near_wall() else 0.0

    @cached_property
    def _wall_torque(self) -> ScalarForm:
        assert self.loads.wall is not None
        x, v = self.ansatz.split(self.u)
        at = self.ansatz.configuration(x, self.s)
        about = Twist(0 * at.r, ufl.as_vector((0, 0, 1)))
        torque = friction(at, self.ansatz.twist(v, at), about, self.section["contact_radius"], self.loads.wall)
        return self.scalar_form(torque * self.on.wall)

    def _side_force(self) -> Array:
        """Normal force per length (points,), N/m, of the present state."""
        wall, contact = self.wall, self.scene.contact
        assert wall is not None and contact is not None
        if contact.normal_force == "wall":
            return wall.side_force(self._u, contact)
        t = wall.data[:, 3:6] / np.linalg.norm(wall.data[:, 3:6], axis=1)[:, None]
        g = self.loads.g.value
        return self._mass_at_wall * np.asarray(np.linalg.norm(g - (t @ g)[:, None] * t, axis=1), dtype=np.float64)

    def wall_row(self) -> dict[str, float]:
        """What the wall does to the present state: side force (N, its size summed along the string), friction torque
        about the string's axis (N m, against its spin), deepest penetration (m)."""
        assert self.wall is not None and self.scene.contact is not None
        force = self._side_force()
        torque = self._wall_torque if "w3" in self.ansatz.v_names else None
        return {
            "side_force": float(force @ self.wall.weights),
            "wall_torque": torque() if torque is not None and self._near_wall() else 0.0,
            "penetration": max(0.0, -float(self.wall.gap)),
        }

    # -- fields for pictures -------------------------------------------------------------------------------------------

    @cached_property
    def _resultants(self) -> dolfinx.fem.Expression:
        x, v = self.ansatz.split(self.u)
        at = self.ansatz.configuration(x, self.s)
        n, m = elastic_resultants(at, self.section, self.loads.u0, self.literal)
        n_v, m_v = viscous_resultants(at, self.ansatz.twist(v, at), self.section)
        both = ufl.as_vector([*(n + n_v), *(m + m_v)])
        return compile_expression(both, gauss_points(self.scene.mesh.degree), self.mesh.comm)

    def resultants(self) -> tuple[Array, Array]:
        """Internal force (nodes, 3; N) and moment (nodes, 3; N m), material components.

        Taken at the integration points, where they are accurate (at the nodes of a slender element they zigzag),
        carried to the nodes by the polynomial through them, and averaged between elements.
        """
        cells = np.arange(self.mesh.topology.index_map(1).size_local, dtype=np.int32)
        values = self._resultants.eval(self.mesh, cells).reshape(len(cells), -1, 6)
        total, count = np.zeros((len(self.nodes), 6)), np.zeros(len(self.nodes))
        np.add.at(total, self.V.dofmap.list, np.einsum("ng,cgk->cnk", self._to_nodes, values))
        np.add.at(count, self.V.dofmap.list, 1.0)
        mean = (total / count[:, None])[self.nodes]
        return mean[:, :3], mean[:, 3:]

    @cached_property
    def _to_nodes(self) -> Array:
        """Values at the integration points to values at the nodes of an element, shape (nodes, points)."""
        points, nodes = gauss_points(self.scene.mesh.degree)[:, 0], reference_nodes(self.V)[:, 0]
        vander = np.polynomial.legendre.legvander
        n = len(points) - 1
        return vander(2 * nodes - 1, n) @ np.linalg.inv(vander(2 * points - 1, n))

    def shape(self) -> tuple[Array, Array]:
        """Centreline (nodes, 3; m) and rotation matrices (nodes, 3, 3) of the present state, from the top down."""
        block = self.u.x.array.reshape(-1, self.ansatz.size)[self.nodes]
        get = {name: block[:, i] for i, name in enumerate(self.ansatz.x_names)}
        zero = np.zeros(len(block))
        r = np.stack([get.get("r1", zero), get.get("r2", zero), get.get("r3", self.arc_length)], axis=1)
        return r, self._rotations(block)

    def _rotations(self, block: Array) -> Array:
        """Rotation matrices (nodes, 3, 3) of nodes with these unknowns (nodes, fields)."""
        names, half = self.ansatz.x_names, np.zeros((len(block), 4))
        if isinstance(self.ansatz, Spatial):
            first = names.index("q_a")
            half[:] = block[:, first : first + 4]
        else:
            name, axis = ("theta", 2) if "theta" in names else ("phi", 3)
            angle = block[:, names.index(name)] / 2
            half[:, 0], half[:, axis] = np.cos(angle), np.sin(angle)
        return rotations(half)

    def fields(self) -> dict[str, Array]:
        """What a picture needs, per node from the top down: position, directors, speeds, resultants, diameters."""
        r, R = self.shape()
        n, m = self.resultants()
        block = self.u.x.array.reshape(-1, self.ansatz.size)[self.nodes]
        out: dict[str, Array] = {
            "arc_length": self.arc_length,
            "outer_diameter": self.outer_diameter,
            "position": r,
            "director1": R[:, :, 0],
            "director3": R[:, :, 2],
            "axial_force": n[:, 2],
            "shear_force": np.hypot(n[:, 0], n[:, 1]),
            "torque": m[:, 2],
            "bending_moment": np.hypot(m[:, 0], m[:, 1]),
        }
        if self.wall is not None and self.scene.contact is not None:
            wall, o = self.wall, np.argsort(self.wall.arc_length)
            out |= {
                "wall_arc_length": wall.arc_length[o],
                "wall_depth": wall.p[o],
                "wall_gap": wall.gaps(self._u)[o],
                "wall_side_force": self._side_force()[o],
            }
        named = {"w3": "spin", "v3": "axial_speed", "phi": "angle"}
        for component, name in named.items():
            if component in self.ansatz.x_names + self.ansatz.v_names:
                out[name] = block[:, self.ansatz.index(component)].copy()
        return out

    @cached_property
    def outer_diameter(self) -> Array:
        """Outer diameter at the nodes (m)."""
        return outer_diameter(self.scene, self.arc_length)
