"""A straight drill-string: linear but for its bit, and no more than matrices. NumPy only.

Three rungs of the ladder: lumped (M1: one mass, one inertia, one spring), torsional (M2: waves of twist, the collars a
rigid mass along the axis) and axial-torsional. The matrices of the waves come from the weak form where DOLFINx is
installed; else they are assembled here, from the same elements, and agree to round-off.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec

import numpy as np
import numpy.typing as npt

from ..meshes.points import distribute, nodes
from ..scene import Scene
from ..scene.nominal import lumped_at_bit, lumps
from .steady import outer_diameter, start_of_drilling, stretch_and_twist

F8 = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Matrices:
    """Mass, damping, stiffness (n, n) and nodal weights (n,) of one kind of motion, nodes from the top down."""

    mass: F8
    damping: F8
    stiffness: F8
    weight: F8


@dataclass(frozen=True)
class Channel:
    """One direction of the string, as assembled: dense symmetric matrices over nodal degrees of freedom.

    mass, damping, stiffness : (n, n).  bit, top : indices of the end degrees of freedom.
    load : (n,) constant load (gravity), N; None for none.
    A uniform motion must be a vector of ones with stiffness @ 1 = damping @ 1 = 0 (no foundation).
    """

    mass: F8
    damping: F8
    stiffness: F8
    bit: int
    top: int
    load: F8 | None = None

    def __post_init__(self) -> None:
        for name in ("damping", "stiffness"):
            matrix = getattr(self, name)
            if np.abs(matrix.sum(axis=1)).max() > 1e-8 * max(np.abs(matrix).max(), 1e-300):
                raise ValueError(f"condensed string: {name} resists a uniform motion")


class Elements:
    """Lagrange elements of a scene's mesh along the string: nodes at Gauss-Lobatto points, as basix has them."""

    def __init__(self, scene: Scene) -> None:
        degree, lengths = scene.mesh.degree, [s.length for s in scene.string]
        legendre = np.polynomial.legendre.Legendre
        inner = np.sort(np.real(legendre.basis(degree).deriv().roots())) if degree > 1 else np.zeros(0)
        points = np.array([-1.0, *inner, 1.0])
        self.degree, self.vertices = degree, nodes(lengths, scene.mesh.elements, scene.mesh.grading)
        self.size = np.diff(self.vertices)
        #: section of every element
        self.section = np.repeat(np.arange(len(lengths)), distribute(lengths, scene.mesh.elements))
        self.dofs = degree * np.arange(len(self.size))[:, None] + np.arange(degree + 1)
        self.arc_length: F8 = np.zeros(degree * len(self.size) + 1)
        self.arc_length[self.dofs] = self.vertices[:-1, None] + self.size[:, None] * (1 + points) / 2
        to_legendre = np.linalg.inv(np.polynomial.legendre.legvander(points, degree))

        def tabulate(count: int) -> tuple[F8, F8, F8]:
            x, w = np.polynomial.legendre.leggauss(count)
            slopes = [legendre.basis(i).deriv()(x) if i else 0 * x for i in range(degree + 1)]
            value = np.polynomial.legendre.legvander(x, degree) @ to_legendre
            return w, value, np.stack(slopes, axis=1).astype(np.float64) @ to_legendre

        weight, value, _ = tabulate(degree + 1)
        self._mass = value.T @ (weight[:, None] * value) / 2
        self._share = value.T @ weight / 2
        weight, _, self._slope = tabulate(degree)
        self._stiffness = self._slope.T @ (weight[:, None] * self._slope) * 2
        # from the integration points, where slopes are accurate, to the nodes
        x, vander = np.polynomial.legendre.leggauss(degree)[0], np.polynomial.legendre.legvander
        self._to_nodes = vander(points, degree - 1) @ np.linalg.inv(vander(x, degree - 1))

    def _assemble(self, element: F8, factor: F8) -> F8:
        n = len(self.arc_length)
        out = np.zeros((n, n))
        np.add.at(out, (self.dofs[:, :, None], self.dofs[:, None, :]), factor[:, None, None] * element)
        return out

    def mass(self, density: F8) -> F8:
        """Mass matrix (n, n) of densities per section."""
        return self._assemble(self._mass, self.size * density[self.section])

    def stiffness(self, modulus: F8) -> F8:
        """Stiffness matrix (n, n) of moduli per section."""
        return self._assemble(self._stiffness, modulus[self.section] / self.size)

    def load(self, density: F8) -> F8:
        """Nodal loads (n,) of a load per length in every section."""
        out = np.zeros(len(self.arc_length))
        np.add.at(out, self.dofs, (self.size * density[self.section])[:, None] * self._share)
        return out

    def slope(self, values: F8, factor: F8) -> F8:
        """Nodal values (n,) of ``factor`` (per section) times the slope of nodal ``values``, means between elements."""
        inside = (2 / self.size * factor[self.section])[:, None] * (values[self.dofs] @ self._slope.T)
        total, count = np.zeros(len(self.arc_length)), np.zeros(len(self.arc_length))
        np.add.at(total, self.dofs, inside @ self._to_nodes.T)
        np.add.at(count, self.dofs, 1.0)
        return total / count


def wave_matrices(scene: Scene) -> tuple[Matrices | None, Matrices]:
    """Axial (None for the torsional model) and torsional matrices of a scene, assembled with NumPy."""
    elements, ends, g = Elements(scene), scene.ends, scene.gravity.magnitude * scene.gravity.direction[2]
    alpha, (mass, inertia) = scene.inertia.distributed, lumped_at_bit(scene)
    late = np.array([s.retardation_time for s in scene.string])

    def motion(stiff: list[float], density: list[float], at: tuple[float, float], extra: float, g: float) -> Matrices:
        k, rho = np.array(stiff), np.array(density)
        m, weight = elements.mass(alpha * rho), g * elements.load(rho)
        m[0, 0] += at[0]
        m[-1, -1] += at[1] + extra
        weight[[0, -1]] += g * np.array(at)
        return Matrices(m, elements.stiffness(late * k), elements.stiffness(k), weight)

    polar = [2 * s.rotary_inertia for s in scene.string]
    torsion = [s.section_stiffness().torsion for s in scene.string]
    turning = motion(torsion, polar, (ends.top_inertia, ends.bottom_inertia), inertia, 0.0)
    if scene.resolved_model().name == "torsional":
        return None, turning
    axial, per_length = [s.section_stiffness().axial for s in scene.string], [s.mass_per_length for s in scene.string]
    return motion(axial, per_length, (ends.top_mass, ends.bottom_mass), mass, g), turning


def have_forms() -> bool:
    """Whether forms can be compiled and assembled here: DOLFINx and PETSc are installed."""
    return find_spec("dolfinx") is not None and find_spec("petsc4py") is not None


def _assembly() -> Callable[[Scene], tuple[Matrices | None, Matrices]]:
    """The assembly from the weak form where it can be had, else NumPy's."""
    if not have_forms():
        return wave_matrices
    from .straight_forms import matrices_of

    return matrices_of


class StraightString:
    """The linear part of a straight drilling string, its start, and its fields along the string.

    ``axial``, ``torsion``: the channels; ``arc_length`` (n,): the nodes of the fields, in m.
    """

    def __init__(self, scene: Scene) -> None:
        if not scene.condensable:
            raise ValueError(f"scene {scene.name}: only a straight drilling string is a pair of channels")
        self.scene, self.model = scene, scene.resolved_model().name
        lumped, weight = lumps(scene), scene.weight
        #: the collars as a rigid mass along the axis (5-1); what hangs on the hook is the whole string
        rigid = Channel(np.full((1, 1), lumped.mass), np.zeros((1, 1)), np.zeros((1, 1)), 0, 0, np.array([weight]))
        if self.model == "lumped":
            spring = lumped.stiffness * np.array([[1.0, -1.0], [-1.0, 1.0]])
            body = np.diag([scene.ends.top_inertia, lumped.inertia])
            self.axial, self.torsion = rigid, Channel(body, lumped.retardation * spring, spring, 1, 0)
            self.arc_length: F8 = np.array(scene.interfaces)
            return
        axial, torsion = _assembly()(scene)
        self.arc_length = self._elements.arc_length
        last = len(self.arc_length) - 1
        self.torsion = Channel(torsion.mass, torsion.damping, torsion.stiffness, last, 0)
        if axial is None:
            self.axial = rigid
        else:
            self.axial = Channel(axial.mass, axial.damping, axial.stiffness, last, 0, axial.weight)

    @cached_property
    def _elements(self) -> Elements:
        return Elements(self.scene)

    @property
    def dofs(self) -> int:
        """Positions and speeds of both channels."""
        return 2 * (len(self.axial.mass) + len(self.torsion.mass))

    def start(self) -> tuple[F8, F8, F8, F8]:
        """Displacement (m), axial speed (m/s), angle (rad), spin (rad/s) at the start, as the channels number them."""
        scene, nominal = self.scene, self.scene.nominal()
        lumped = self.model == "lumped"
        s = np.array([0.0, scene.length]) if lumped else self.arc_length
        displacement, twist = stretch_and_twist(scene, s)
        if len(self.axial.mass) == 1:
            displacement = np.zeros(1)
        if lumped:
            twist = np.array([0.0, -nominal.torque_on_bit / lumps(scene).stiffness])
        if scene.initial.state == "literal":
            twist = np.zeros_like(twist)
        speed, spin = np.zeros_like(displacement), np.zeros_like(twist)
        if scene.initial.state != "rest":
            speed[:], spin = start_of_drilling(scene, s)
        return displacement, speed, twist, spin

    def fields(self, displacement: F8, axial_speed: F8, angle: F8, angular_speed: F8) -> dict[str, F8]:
        """What a picture needs, per node from the top down, from nodal values in the numbering of the channels."""
        scene, s, one, spin = self.scene, self.arc_length, np.ones(len(self.arc_length)), angular_speed
        tension = scene.nominal().hook_load - self._weight_above
        if len(displacement) == 1:
            displacement, axial_speed = displacement * one, axial_speed * one
        else:
            axial = np.array([x.section_stiffness().axial for x in scene.string])
            late = np.array([x.retardation_time for x in scene.string])
            tension = self._elements.slope(displacement, axial) + self._elements.slope(axial_speed, late * axial)
        if self.model == "lumped":
            moment = (self.torsion.stiffness @ angle + self.torsion.damping @ angular_speed)[1] * one
            share = np.interp(s, scene.interfaces, self._spring_share)
            angle, spin = (x[0] + share * (x[1] - x[0]) for x in (angle, angular_speed))
        else:
            stiff = np.array([x.section_stiffness().torsion for x in scene.string])
            late = np.array([x.retardation_time for x in scene.string])
            moment = self._elements.slope(angle, stiff) + self._elements.slope(angular_speed, late * stiff)
        zero = np.zeros(len(s))
        return {
            "arc_length": s,
            "outer_diameter": self.outer_diameter,
            "position": np.stack([zero, zero, s + displacement], axis=1),
            "director1": np.stack([np.cos(angle), np.sin(angle), zero], axis=1),
            "director3": np.stack([zero, zero, one], axis=1),
            "axial_force": tension,
            "torque": moment,
            "bending_moment": zero,
            "spin": spin,
            "axial_speed": axial_speed,
            "angle": angle,
        }

    @cached_property
    def _weight_above(self) -> F8:
        """Weight (N) of the string above the nodes."""
        g = self.scene.gravity.magnitude * self.scene.gravity.direction[2]
        ends = np.array(self.scene.interfaces)
        carried = np.cumsum([self.scene.ends.top_mass, *(x.mass_per_length * x.length for x in self.scene.string)])
        return g * np.interp(self.arc_length, ends, carried)

    @cached_property
    def _spring_share(self) -> F8:
        """Share of the lumped model's twist at the ends of the sections: the pipes are the spring."""
        *pipes, collars = self.scene.string
        compliance = [x.length / x.section_stiffness().torsion for x in (pipes or [collars])]
        share = np.concatenate([[0.0], np.cumsum(compliance) / np.sum(compliance)])
        return np.append(share, 1.0) if pipes else share

    @cached_property
    def outer_diameter(self) -> F8:
        """Outer diameter at the nodes (m)."""
        return outer_diameter(self.scene, self.arc_length)
