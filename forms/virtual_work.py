"""The weak form of Appendix D as a dictionary of named virtual-work terms.

Sign: every term is on the left of ``sum of the terms = 0``, so inertia and internal work are positive and
loads are negative. A term along the actual twist instead of a virtual one is its power: the energy audit
evaluates the very terms that are solved.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import ufl
from ufl.core.expr import Expr

from .ansatz import Ansatz
from .bit import Saturating, push, resisted
from .constitutive import Section, elastic_resultants, viscous_resultants
from .drive import Motor, motor
from .kinematics import E3, Configuration, Twist, strain_rates, strains
from .mud import Mud, added_energy, added_inertia, buoyancy, drag
from .wall import Hole, Wall, closest_point, contact, friction

Terms = dict[str, ufl.Form]


@dataclass(frozen=True)
class Measures:
    """Where the terms are integrated.

    ``internal``: elastic and viscous work, reduced rule so that slender elements do not lock.
    ``mass``: inertia and distributed loads. ``nodal``: the kinematic relations, collocated at the nodes.
    ``wall``: contact. ``top``, ``bottom``: the two ends.
    """

    internal: ufl.Measure
    mass: ufl.Measure
    nodal: ufl.Measure
    wall: ufl.Measure
    top: ufl.Measure
    bottom: ufl.Measure


@dataclass(frozen=True)
class EndLoad:
    """Load on an end: force (3, N) and moment (3, N m), spatial components; what is attached there.

    ``mass`` (kg) and rotary ``inertia`` about the string's axis (kg m2).
    """

    force: Expr
    moment: Expr
    mass: Expr
    inertia: Expr

    @property
    def Theta(self) -> Expr:
        """Moments of inertia of what is attached (3x3, kg m2)."""
        return ufl.diag(ufl.as_vector((0, 0, self.inertia)))


@dataclass(frozen=True)
class BitLoad:
    """Load of the rock on the bit: ``weight`` (N) against the hole's direction, ``torque`` (N m) against the spin.

    ``hole``: piece of a hole that bends, on whose centreline a spring ``guide`` (N/m) holds the bit; None: along e3.
    """

    weight: Expr
    torque: Expr
    hole: Hole | None = None
    guide: Expr | None = None


def spin_rate(Theta: Expr, twist: Twist, rate: Twist) -> Expr:
    """Rate of the angular momentum in material components, Theta w-dot + w x Theta w (2-61); Theta is 3x3."""
    return Theta * rate.w + ufl.cross(twist.w, Theta * twist.w)


def inertia(twist: Twist, rate: Twist, virtual: Twist, section: Section) -> Expr:
    """rho A v-dot . dr + (Theta w-dot + w x Theta w) . dtheta (2-51), (2-61), per length."""
    return section["mass"] * ufl.dot(rate.v, virtual.v) + ufl.dot(spin_rate(section.Theta, twist, rate), virtual.w)


def end_load(x: Configuration, twist: Twist, rate: Twist, virtual: Twist, load: EndLoad) -> Expr:
    """Virtual work at an end: applied load and the inertia of what is attached there."""
    applied = ufl.dot(load.force, virtual.v) + ufl.dot(load.moment, x.R * virtual.w)
    turning = ufl.dot(spin_rate(load.Theta, twist, rate), virtual.w)
    return load.mass * ufl.dot(rate.v, virtual.v) + turning - applied


def bit_load(x: Configuration, virtual: Twist, bit: BitLoad) -> Expr:
    """Virtual work of the rock on the bit: force -W t along the hole, moment -T d3 about the bit (errata 49, 50).

    The torque is about the bit's own axis, whose spin d3 . w the law takes (7.1).
    """
    work = bit.torque * virtual.w[2]
    if bit.hole is None or bit.guide is None:
        return work + bit.weight * ufl.dot(E3, virtual.v)
    force = bit.weight * bit.hole.tangent(x.r) + bit.guide * bit.hole.offset(x.r)
    return work + ufl.dot(force, virtual.v)


@dataclass(frozen=True)
class Lump:
    """Inertia taken from the rod and put at its lower end (5.5.4): ``share`` of what gravity pulls is left."""

    share: Expr
    attached: EndLoad


@dataclass(frozen=True)
class Loads:
    """What acts on the rod besides itself; absent parts are None.

    ``centreline``: the hole at the nodes, where its measured depth is an unknown. ``resistance``, ``push`` (N): rock
    that saturates, and a force along e3, at the lower end.
    """

    g: Expr
    u0: Expr
    top: EndLoad
    bottom: EndLoad
    bit: BitLoad | None = None
    wall: Wall | None = None
    lump: Lump | None = None
    motor: Motor | None = None
    mud: Mud | None = None
    centreline: Hole | None = None
    resistance: Saturating | None = None
    push: Expr | None = None


def virtual_work(
    x: Configuration,
    twist: Twist,
    rate: Twist,
    virtual: Twist,
    section: Section,
    loads: Loads,
    on: Measures,
    literal: bool = False,
) -> Terms:
    """Every term of the balance of momentum and moment of momentum (D-2), (D-3), by name.

    x, twist, rate: configuration, velocity and acceleration. ``virtual``: test motion, or the twist itself for power.
    """
    dv, du = strain_rates(x, virtual)
    n, m = elastic_resultants(x, section, loads.u0, literal)
    n_v, m_v = viscous_resultants(x, twist, section)
    weighed = section["mass"] / loads.lump.share if loads.lump else section["mass"]
    terms: Terms = {
        "inertia": inertia(twist, rate, virtual, section) * on.mass,
        "internal force": ufl.dot(n, dv) * on.internal,
        "internal moment": ufl.dot(m, du) * on.internal,
        "damping": (ufl.dot(n_v, dv) + ufl.dot(m_v, du)) * on.internal,
        "gravity": -weighed * ufl.dot(loads.g, virtual.v) * on.mass
        - loads.top.mass * ufl.dot(loads.g, virtual.v) * on.top
        - loads.bottom.mass * ufl.dot(loads.g, virtual.v) * on.bottom,
        "top drive": end_load(x, twist, rate, virtual, loads.top) * on.top,
        "tip load": end_load(x, twist, rate, virtual, loads.bottom) * on.bottom,
    }
    if loads.lump is not None:
        terms["lumped inertia"] = end_load(x, twist, rate, virtual, loads.lump.attached) * on.bottom
    if loads.wall is not None:
        radius = section["contact_radius"]
        terms["contact"] = contact(x, twist, virtual, radius, loads.wall) * on.wall
        terms["friction"] = friction(x, twist, virtual, radius, loads.wall) * on.wall
    if loads.bit is not None:
        terms["bit"] = bit_load(x, virtual, loads.bit) * on.bottom
    if loads.resistance is not None:
        terms["resistance"] = resisted(twist, virtual, loads.resistance) * on.bottom
    if loads.push is not None:
        terms["push"] = push(virtual, loads.push) * on.bottom
    if loads.motor is not None:
        terms["motor"] = motor(x, twist, rate, virtual, loads.motor) * on.top
    if loads.mud is not None:
        terms["buoyancy"] = buoyancy(virtual, loads.mud, loads.g) * on.mass
        if loads.mud.moves:
            terms["mud inertia"] = added_inertia(x, twist, rate, virtual, loads.mud) * on.mass
        if loads.mud.drags:
            terms["mud drag"] = drag(x, twist, virtual, loads.mud) * on.mass
    return terms


def dynamic_terms(
    a: Ansatz,
    u: Expr,
    u_dot: Expr,
    test: Expr,
    s: Expr,
    section: Section,
    loads: Loads,
    on: Measures,
    literal: bool = False,
) -> Terms:
    """Semi-discrete system F(t, u, u-dot) = 0 of an ansatz: virtual work and kinematic relations (D-2)-(D-4).

    u, u_dot, test: fields of shape (a.size,). Returns the named terms; their sum is F.
    """
    (x, v), (x_dot, v_dot), (test_x, test_v) = a.split(u), a.split(u_dot), a.split(test)
    at = a.configuration(x, s)
    terms = virtual_work(at, a.twist(v, at), a.twist(v_dot, at), a.twist(test_v, at), section, loads, on, literal)
    rates = a.rate(x, v)
    tested, found = (ufl.as_vector([f[i] for i in range(len(rates))]) for f in (test_x, x_dot))
    terms["kinematics"] = ufl.dot(tested, found - rates) * on.nodal
    if loads.centreline is not None:
        terms["closest point"] = closest_point(at, a.depth(test_x), loads.centreline) * on.nodal
    return terms


def powers(
    a: Ansatz, u: Expr, u_dot: Expr, s: Expr, section: Section, loads: Loads, on: Measures, literal: bool = False
) -> Terms:
    """Power of every term (W): the same virtual work along the actual twist; their sum vanishes."""
    (x, v), (_, v_dot) = a.split(u), a.split(u_dot)
    at = a.configuration(x, s)
    twist = a.twist(v, at)
    return virtual_work(at, twist, a.twist(v_dot, at), twist, section, loads, on, literal)


def static_terms(
    a: Ansatz,
    x: Expr,
    test: Expr,
    s: Expr,
    section: Section,
    loads: Loads,
    on: Measures,
    literal: bool = False,
    support: Expr | None = None,
) -> Terms:
    """Equilibrium in the configuration fields alone; x, test of shape (len(a.x_names),).

    The ansatz' constraint (|q| = 1 at every node) closes the system; its rows carry the torsional stiffness, to have
    the size of the others. It is no penalty: where |q| may differ between nodes, the rotation between them swerves.
    ``support`` (N/m2): springs to the hole's centreline, for a solver that lets them go step by step.
    """
    at = a.configuration(x, s)
    still = Twist(0 * at.r, 0 * at.u_m)
    loads = replace(loads, motor=None, mud=replace(loads.mud, moves=False, drags=False) if loads.mud else None)
    terms = virtual_work(at, still, still, a.virtual(test), section, loads, on, literal)
    g = a.constraint(x, test)
    if support is not None and loads.wall is not None:
        terms["support"] = support * ufl.dot(loads.wall.offset(at.r), a.virtual(test).v) * on.wall
    if g is not None:
        terms["constraint"] = section["torsion"] * g * on.nodal
    return terms


def kinetic_energy(a: Ansatz, u: Expr, s: Expr, section: Section, loads: Loads, on: Measures) -> ufl.Form:
    """Kinetic energy of rod and attached masses (J)."""
    x, v = a.split(u)
    at = a.configuration(x, s)
    t = a.twist(v, at)

    def at_end(load: EndLoad) -> Expr:
        return (load.mass * ufl.dot(t.v, t.v) + ufl.dot(t.w, load.Theta * t.w)) / 2

    density = section["mass"] * ufl.dot(t.v, t.v) + ufl.dot(t.w, section.Theta * t.w)
    energy = density / 2 * on.mass + at_end(loads.top) * on.top + at_end(loads.bottom) * on.bottom
    if loads.mud is not None and loads.mud.moves:
        energy += added_energy(at, t, loads.mud) * on.mass
    return energy + at_end(loads.lump.attached) * on.bottom if loads.lump else energy


def strain_energy(a: Ansatz, x: Expr, s: Expr, section: Section, loads: Loads, on: Measures) -> ufl.Form:
    """Elastic energy (J) in the configuration fields ``x``; the wall's penalty energy is not part of it."""
    at = a.configuration(x, s)
    v_m, u_m = strains(at)
    n, m = elastic_resultants(at, section, loads.u0)
    return (ufl.dot(n, v_m - ufl.as_vector((0, 0, 1))) + ufl.dot(m, u_m - loads.u0)) / 2 * on.internal


def total(terms: Mapping[str, ufl.Form]) -> ufl.Form:
    """Sum of the named terms."""
    return sum(terms.values(), start=ufl.Form([]))
