"""Natural frequencies of a straight string along and about its axis: exact, without finite elements."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from drillfem.scene.nominal import lumped_at_bit, lumps

if TYPE_CHECKING:
    from drillfem.scene.scene import Scene


class Uniform(NamedTuple):
    """A uniform piece of a string: length (m), stiffness (EA in N or GJ in N m2), inertia per length (kg/m or kg m)."""

    length: float
    stiffness: float
    inertia: float


class End(NamedTuple):
    """An end: held, or free with an inertia (kg or kg m2) attached to it."""

    held: bool
    inertia: float = 0.0


def standing_waves(pieces: Sequence[Uniform], top: End, bottom: End, upto: float) -> list[float]:
    """Natural frequencies (Hz) up to ``upto`` (Hz) of pieces joined from the top down; a rigid motion is left out.

    In a piece the motion is A cos(psi), the force -Z omega A sin(psi), Z = sqrt(stiffness inertia): the phase psi grows
    by omega length/speed, and at a joint tan(psi) changes by the ratio of Z, within its quadrant. So the phase that is
    left over at the bottom grows with omega, and every multiple of pi that it passes is a natural frequency: none can
    be missed, however close two of them lie (J_1 cot k L_1 = J_2 tan k L_2 for the thesis' string).
    """
    impedance = [math.sqrt(p.stiffness * p.inertia) for p in pieces]
    delay = [p.length * math.sqrt(p.inertia / p.stiffness) for p in pieces]

    def left_over(omega: float) -> float:
        phase = -math.pi / 2 if top.held else math.atan(top.inertia * omega / impedance[0])
        before = impedance[0]
        for z, seconds in zip(impedance, delay, strict=True):
            turns = round(phase / math.pi)
            phase = turns * math.pi + math.atan(before / z * math.tan(phase - turns * math.pi)) + omega * seconds
            before = z
        return phase - math.pi / 2 if bottom.held else phase + math.atan(bottom.inertia * omega / before)

    highest = left_over(2 * math.pi * upto)
    low, found = 0.0, []
    # held at neither end: the phase starts at 0, which is the rigid motion
    n = 0 if top.held or bottom.held else 1
    while n * math.pi <= highest:
        high = 2 * math.pi * upto
        while high - low > 1e-15 * high:
            middle = (low + high) / 2
            if middle in (low, high):
                break
            low, high = (middle, high) if left_over(middle) < n * math.pi else (low, middle)
        found.append(high / (2 * math.pi))
        n += 1
    return found


def _ends(scene: Scene) -> Iterator[tuple[str, End, End]]:
    """Kind of motion, top and bottom: what `[ends]` holds, and what is lumped there."""
    ends = scene.ends
    mass, inertia = lumped_at_bit(scene) if scene.inertia.distributed != 1 else (0.0, 0.0)
    # a string that drills hangs on a constant load
    hangs = ends.top in ("free", "sliding") or scene.hangs
    clamped = ends.bottom == "clamped"
    yield "axial", End(not hangs, ends.top_mass), End(clamped, ends.bottom_mass + mass)
    yield (
        "torsional",
        End(ends.top in ("driven", "clamped", "sliding"), ends.top_inertia),
        End(clamped, ends.bottom_inertia + inertia),
    )


def straight_frequencies(scene: Scene, upto: float = 40.0) -> dict[str, list[float]]:
    """Axial and torsional natural frequencies (Hz) of a straight string up to ``upto`` (Hz), free of the rock.

    The lumped model has a single torsional one and the torsional model only those; damping, tension and speed of
    turning change none of them. The thesis' string has 0.453 Hz and its 6th torsional one at 7.40 Hz (5.5.4).
    """
    model = scene.resolved_model().name
    if model == "lumped":
        lumped = lumps(scene)
        only = math.sqrt(lumped.stiffness / lumped.inertia) / (2 * math.pi)
        return {"torsional": [only] if only <= upto else []}
    share = scene.inertia.distributed
    found = {}
    for kind, top, bottom in _ends(scene):
        if kind == "axial" and model in ("torsional", "soft-string"):
            continue
        pieces = []
        for s in scene.string:
            k = s.section_stiffness()
            stiffness, inertia = (k.axial, s.mass_per_length) if kind == "axial" else (k.torsion, 2 * s.rotary_inertia)
            pieces.append(Uniform(s.length, stiffness, share * inertia))
        found[kind] = standing_waves(pieces, top, bottom, upto)
    return found
