"""Steady drilling, the numbers of Appendix C.2, and what `drillfem info` says about a scene."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from drillfem.scene.scene import Scene


@dataclass(frozen=True)
class Nominal:
    """Steady drilling without oscillation (5-25)-(5-28), or by the empirical law (B-2)-(B-5); SI units."""

    depth_of_cut: float  # d_0 in m per turn, sum over the blades
    rate_of_penetration: float  # V_0 in m/s
    torque_on_bit: float  # T_0 in N m
    hook_load: float  # H_0 in N
    weight_on_bit: float  # W_0 in N


def nominal(scene: Scene, spin: float | None = None, weight: float | None = None) -> Nominal:
    """Steady drilling (5-26)-(5-28), totals over the blades.

    spin: in the place of the drive's speed (rad/s). weight: in the place of what hangs in the hole (N).

    d_0 = (W0 - sigma_1 a l)/(eps_1 a zeta), V_0 = d_0 Omega_0/(2 pi),
    T_0 = (eps_1 d_0 + mu gamma sigma_1 l) a^2/2.

    The weight on the bit is given, or what the hook does not carry, or what drills as fast as the block comes down.
    Without a bit on rock: no drilling, and all weight on the hook.
    """
    drive, bit, rock = scene.top_drive, scene.bit, scene.rock
    weight = scene.hanging_weight if weight is None else weight
    speed = (drive.speed or 0.0) if spin is None else spin
    if bit is None or not scene.bites or (bit.kind == "cutting" and rock is None):
        return Nominal(0.0, 0.0, 0.0, weight if drive.hook_load is None else drive.hook_load, 0.0)
    load = drive.weight_on_bit
    if load is None and drive.hook_load is not None:
        load = weight - drive.hook_load
    block = drive.block_speed or 0.0
    if bit.kind == "empirical" or rock is None:
        # beside the laws of the rock, which this room does not know: imported only where a scene asks for it
        from drillfem.bitrock.empirical import EmpiricalLaw

        law = EmpiricalLaw(**{k: v for k, v in vars(bit.empirical).items() if k != "force"})
        load = law.weight(block, speed) if load is None else load
        rate = law.rate_of_penetration(load, speed)
        depth = 2 * math.pi * rate / abs(speed) if speed else 0.0
        return Nominal(depth, rate, law.torque(load, speed), weight - load, load)
    flat = rock.contact_strength * bit.radius * bit.wear_flat_length
    stiffness = rock.intrinsic_specific_energy * bit.radius * bit.inclination
    if load is None:
        load = flat + stiffness * 2 * math.pi * block / speed if block > 0 and speed > 0 else 0.0
    flat = min(load, flat)
    depth = (load - flat) / stiffness
    torque = (rock.intrinsic_specific_energy * bit.radius * depth + bit.friction * bit.geometry * flat) * bit.radius / 2
    return Nominal(depth, depth * speed / (2 * math.pi), torque, weight - load, load)


class Lumps(NamedTuple):
    """The lumped model of a string; SI units."""

    stiffness: float  # C in N m/rad: polar, 938.1 for the thesis' string (its table prints half)
    inertia: float  # I in kg m2
    mass: float  # M in kg: the collars
    retardation: float  # Kelvin-Voigt time of the spring in s


def lumps(scene: Scene) -> Lumps:
    """Lumped model (5-39): the pipes are the spring, the last section (collars) and a third of the pipes' rotary
    inertia the mass, besides what the scene lumps at the bottom."""
    *pipes, collars = scene.string
    alone = not pipes
    pipes = pipes or [collars]  # a string of one section is its own spring
    compliances = [s.length / s.section_stiffness().torsion for s in pipes]
    inertia = scene.ends.bottom_inertia + math.fsum(2 * s.rotary_inertia * s.length / 3 for s in pipes)
    inertia += 0 if alone else 2 * collars.rotary_inertia * collars.length
    late = math.fsum(c * s.retardation_time for c, s in zip(compliances, pipes, strict=True))
    return Lumps(
        1 / math.fsum(compliances),
        inertia,
        scene.ends.bottom_mass + collars.mass_per_length * collars.length,
        late / math.fsum(compliances),
    )


def lumped_at_bit(scene: Scene) -> tuple[float, float]:
    """Mass (kg) and rotary inertia (kg m2) that ``inertia.distributed`` = alpha moves from the string to the bit.

    (1 - alpha) of the lumped model's (5-39), so that alpha -> 0 is that model (5.5.4; spec 9.5).
    """
    whole, rest = lumps(scene), 1 - scene.inertia.distributed
    return rest * (whole.mass - scene.ends.bottom_mass), rest * (whole.inertia - scene.ends.bottom_inertia)


@dataclass(frozen=True)
class Dimensionless:
    """The lumped model (`lumps`) and its numbers, Appendix C.2."""

    torsional_stiffness: float  # C in N m/rad: polar, 938.1 for the thesis' string (its table prints half)
    inertia: float  # I in kg m2
    mass: float  # M in kg: the collars
    time: float  # t* in s
    length: float  # L* in m
    psi: float  # system number
    beta: float  # bit-rock interaction number
    lambda_: float  # bluntness number
    omega_0: float  # spin of the top
    W_0: float  # weight on bit


def dimensionless(scene: Scene) -> Dimensionless:
    """Numbers of Appendix C.2 (C-1)-(C-7). Raises ValueError without a cutting bit."""
    bit, rock = scene.bit, scene.rock
    if bit is None or rock is None or bit.kind != "cutting":
        raise ValueError("only a cutting bit has the numbers of Appendix C.2")
    stiffness, inertia, mass, _ = lumps(scene)
    energy, a, zeta = rock.intrinsic_specific_energy, bit.radius, bit.inclination
    t, x = math.sqrt(inertia / stiffness), 2 * stiffness / (energy * a**2)
    return Dimensionless(
        stiffness,
        inertia,
        mass,
        t,
        x,
        psi=zeta * energy * a * inertia / (mass * stiffness),
        beta=bit.friction * bit.geometry * zeta,
        lambda_=rock.contact_strength * bit.wear_flat_length / (zeta * energy * x),
        omega_0=(scene.top_drive.speed or 0.0) * t,
        W_0=scene.nominal().weight_on_bit / (zeta * energy * a * x),
    )


def torsional_frequency(scene: Scene) -> float:
    """Lowest torsional natural frequency in Hz of the string, top held, bottom free to spin; exact.

    The thesis' string has 0.453 Hz (its 5.5.4). All of them: `drillfem.scene.frequencies`.
    """
    from drillfem.scene.frequencies import End, Uniform, standing_waves

    pieces = [Uniform(s.length, s.section_stiffness().torsion, 2 * s.rotary_inertia) for s in scene.string]
    # that of a uniform string needs four times the travel; a stepped one may be faster
    upto = 0.5 / math.fsum(p.length * math.sqrt(p.inertia / p.stiffness) for p in pieces)
    while not (found := standing_waves(pieces, End(True), End(False, scene.ends.bottom_inertia), upto)):
        upto *= 2
    return found[0]


def quantity(value: float, unit: str) -> str:
    """Value with four figures and a metric prefix on its unit: 45700, "N" -> "45.7 kN"."""
    size = abs(value)
    for factor, prefix in ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ")):
        if size >= factor and unit[0] not in "kr":
            return f"{value / factor:.4g} {prefix}{unit}"
    return f"{value:.4g} {unit}"


def _describe_hole(scene: Scene) -> list[tuple[str, str]]:
    """What `describe` says of a hole, and of the contact with it."""
    contact, diameter = scene.contact, scene.hole.diameter
    if contact is None or scene.hole.kind == "none" or diameter is None:
        return []
    rows, narrowest = [("hole", "straight, along the string")], diameter / 2
    geometry = scene.borehole if scene.hole.bends or scene.hole.caliper or scene.hole.section else None
    if geometry is not None:
        narrowest = float(geometry.table.radius.min())
    if geometry is not None and scene.hole.bends:
        sharpest, at = geometry.sharpest()
        end = geometry.frame(scene.length)
        north, east, down = end.position[0]
        where = f"{north:.5g} m north, {east:.5g} m east, {down:.6g} m down"
        inclined = f"inclined by {math.degrees(end.inclination[0]):.4g} deg"
        bend = f"{math.degrees(sharpest) * 30:.3g} deg per 30 m at {at:.5g} m (radius {1 / sharpest:.4g} m)"
        rows = [("hole", f"{scene.hole.kind}: at {scene.length:g} m {inclined}, {where}"), ("sharpest bend", bend)]
    widest = max(s.contact_radius for s in scene.string)
    rows.append(("smallest clearance", quantity(narrowest - widest, "m")))
    if scene.hole.bends or any(scene.gravity.direction[:2]):
        heaviest = max(scene.string, key=lambda s: s.mass_per_length)
        depth = heaviest.mass_per_length * scene.gravity.magnitude / contact.stiffness
        layers = [(4 * s.section_stiffness().bending1 / contact.stiffness) ** 0.25 for s in scene.string]
        between = " to ".join(dict.fromkeys(f"{x:.3g}" for x in (min(layers), max(layers))))
        period = 2 * math.pi * math.sqrt(heaviest.mass_per_length / contact.stiffness)
        under = f"{quantity(depth, 'm')} deep under the weight of the {heaviest.name}"
        rows.append(("contact", f"{under}, boundary layer {between} m, period {quantity(period, 's')}"))
    return rows


def _describe_push(scene: Scene) -> list[tuple[str, str]]:
    """What `describe` says of a string that slides along its hole: what drives it, and what resists (chapter 7)."""
    rows, contact, bit, motor = [], scene.contact, scene.bit, scene.motor
    if scene.ends.top == "sliding" and any(scene.ends.top_force):
        rows.append(("push", quantity(scene.ends.top_force[2], "N")))
    if motor is not None:
        rows.append(("motor", f"{quantity(motor.force, 'N')} at {motor.frequency / (2 * math.pi):.4g} Hz"))
    if bit is not None and scene.resists:
        most, over = quantity(bit.saturating.strength, "N"), quantity(1 / bit.saturating.rate, "m/s")
        rows.append(("bit", f"resists with up to {most}, which builds up over {over}"))
    if rows and contact is not None and not scene.hole.bends:
        mass = sum(s.mass_per_length * s.length for s in scene.string)  # lumped masses at the ends touch nothing
        across = mass * scene.gravity.magnitude * math.hypot(*scene.gravity.direction[:2])
        text = f"{quantity(contact.friction_static * across, 'N')} with all of the string's weight on the wall"
        rows.append(("friction", text))
    return rows


def describe(scene: Scene) -> list[tuple[str, str]]:
    """What follows from a scene, as (label, value with unit), for `drillfem info`."""
    model, reason = scene.resolved_model()
    n, q = scene.nominal(), quantity
    time = scene.time
    run = (
        f"{time.load_steps} load steps"
        if time.analysis == "static"
        else f"{time.start:g} to {time.end:g} s in steps of {q(time.step, 's')}"
    )
    rows = [
        ("model", f"{model} ({reason})"),
        ("reading", scene.reading),
        ("run", run),
        ("mesh", f"{scene.mesh.elements} elements of degree {scene.mesh.degree}"),
        ("length", f"{scene.length:.6g} m"),
    ]
    if scene.mass > 0:
        rows.append(("mass", f"{scene.mass:.6g} kg"))
    if scene.weight > 0:
        rows.append(("weight", f"{scene.weight / 1e3:.6g} kN"))
    if scene.mud is not None and scene.mass > 0:
        carried = 1 - scene.weight / (scene.mass * scene.gravity.magnitude * scene.gravity.direction[2] or 1.0)
        rows.append(("mud", f"carries {100 * carried:.3g} % of the weight"))
    rows += _describe_hole(scene)
    for s in scene.string:
        k = s.section_stiffness()
        label = f"{s.name}: "
        rows.append(
            (
                label + "stiffness",
                f"EA {q(k.axial, 'N')}, GA {q(k.shear1, 'N')}, EI {q(k.bending1, 'N m²')}, GJ {q(k.torsion, 'N m²')}",
            )
        )
        if s.mass_per_length > 0 and s.rotary_inertia > 0:
            rows.append(
                (
                    label + "wave speeds",
                    f"axial {math.sqrt(k.axial / s.mass_per_length):.1f} m/s, torsional "
                    f"{math.sqrt(k.torsion / (2 * s.rotary_inertia)):.1f} m/s",
                )
            )
        if s.retardation_time > 0:
            rows.append((label + "retardation time", q(s.retardation_time, "s")))
    if scene.ends.top in ("driven", "clamped") and all(s.rotary_inertia > 0 for s in scene.string):
        rows.append(("first torsional frequency", f"{torsional_frequency(scene):.4g} Hz"))
    if scene.bit is not None and not scene.resists:
        rows += [("hook load", f"{n.hook_load / 1e3:.6g} kN"), ("weight on bit", q(n.weight_on_bit, "N"))]
    rows += _describe_push(scene)
    if scene.bites and not scene.drills:
        rows += [
            (
                "nominal rate of penetration",
                f"{q(n.rate_of_penetration, 'm/s')} ({n.rate_of_penetration * 3600:.4g} m/h)",
            ),
            ("nominal torque on bit", q(n.torque_on_bit, "N m")),
        ]
    if scene.bit is not None and scene.drills:
        d = dimensionless(scene)
        rows += [
            ("nominal depth of cut", f"{q(n.depth_of_cut, 'm')} per turn, all {scene.bit.blades} blades"),
            (
                "nominal rate of penetration",
                f"{q(n.rate_of_penetration, 'm/s')} ({n.rate_of_penetration * 3600:.4g} m/h)",
            ),
            ("nominal torque on bit", q(n.torque_on_bit, "N m")),
            ("nominal power", q(n.torque_on_bit * (scene.top_drive.speed or 0.0), "W")),
            ("blade passages", f"{1 / scene.blade_passage:.4g} Hz"),
            (
                "two-degree-of-freedom equivalent",
                f"C {d.torsional_stiffness:.2f} N m/rad, I {d.inertia:.2f} kg m², "
                f"M {d.mass:.1f} kg, {1 / (2 * math.pi * d.time):.4g} Hz",
            ),
            ("scales t*, L*", f"{d.time:.4g} s, {q(d.length, 'm')}"),
            ("psi (system)", f"{d.psi:.4g}"),
            ("beta (bit-rock)", f"{d.beta:.4g}"),
            ("lambda (bluntness)", f"{d.lambda_:.4g}"),
            ("omega_0 (speed)", f"{d.omega_0:.4g}"),
            ("W_0 (weight on bit)", f"{d.W_0:.4g}"),
        ]
    rows += [(f"random: {r.name}", r.spoken) for r in scene.random]
    return rows
