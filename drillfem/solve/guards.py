"""What is known to fail, computed before a run, and the one failure that is watched for during it.

Every guard answers with a sentence that holds the number it computed and what to do instead. They cost
milliseconds: scalar recurrences of the integrators, exact waves of the string, the linear stability of the cut, and
the soft string in its hole (`drillfem.solve.wall_guards`).
docs/failure-atlas.md shows each failure; tests/stability holds the page to it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import SceneError
from ..meshes.points import distribute
from ..scene import Scene
from ..scene.frequencies import straight_frequencies
from ..scene.tables import Surface
from ..stability.loop import DrillingLoop
from ..stability.transfer import surface_delay
from . import wall_guards
from .integrators import Method, method_of

__all__ = [
    "CORRECTION",
    "GUARDS",
    "PASSAGE",
    "RUNAWAY",
    "TOLERATED",
    "Method",
    "Waves",
    "boundary",
    "locking_factor",
    "method_of",
    "quaternion_norm",
    "refuse",
    "runaway",
    "self_excitation",
    "warnings",
    "waves",
    "wear_flat_feed",
]

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

#: steps between two blades below which an engine distorts the self-excitation
PASSAGE = {"petsc": 64, "compiled": 64, "condensed": 16}
#: spin of the bit over that of the top at which a run has run away
RUNAWAY = 20.0
#: share of an amplitude that an integrator may take per period, and of a growth rate that a surface may take
TOLERATED = 0.01
#: k in q-dot = ... + k (1 - q.q) q, forms.ansatz.Spatial.correction
CORRECTION = 1.0


# -- the string's own waves ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Waves:
    """Vibrations that a scene's mesh carries: kind, angular frequency (n,; rad/s), ratio to critical damping (n,)."""

    kind: tuple[str, ...]
    omega: Array
    damping: Array

    def exponents(self, step: float) -> Complex:
        """lambda h of every vibration (n,)."""
        zeta = self.damping.astype(np.complex128)
        return np.asarray(step * self.omega * (-zeta + np.sqrt(zeta**2 - 1)))


def waves(scene: Scene, most: float = math.inf) -> Waves:
    """The vibrations of a scene up to what its mesh carries, two steps per period, and ``most`` half waves.

    Torsional and axial ones are exact. Bending is estimated: Euler-Bernoulli up to where shear is slower.
    """
    model = scene.resolved_model().name
    count = min(most, scene.mesh.elements * scene.mesh.degree)
    stiff, mass = [s.section_stiffness() for s in scene.string], scene.mass / scene.length
    speed = math.sqrt(max(k.axial for k in stiff) / mass)
    upto = min(count * speed / (2 * scene.length), 1 / scene.time.step)
    found = {kind: 2 * math.pi * np.array(f) for kind, f in straight_frequencies(scene, upto).items()}
    if model == "planar":
        found.pop("torsional")
    if model in ("planar", "spatial"):
        k = (np.arange(min(count, 2000.0)) + 0.5) * math.pi / scene.length
        bend, shear = (float(np.mean([getattr(s, n) for s in stiff])) for n in ("bending1", "shear1"))
        found["bending"] = np.minimum(k**2 * math.sqrt(bend / mass), k * math.sqrt(shear / mass))
    omega = np.concatenate(list(found.values()))
    damping = min(s.retardation_time for s in scene.string) * omega / 2
    return Waves(tuple(kind for kind, some in found.items() for _ in some), omega, damping)


# -- before a run -----------------------------------------------------------------------------------------------------


def growing_waves(scene: Scene) -> Iterator[str]:
    """Waves that the integrator amplifies: BDF from order 3 on (TSBDF)."""
    method, h = method_of(scene), scene.time.step
    if method is None or method.kind != "bdf" or method.order < 3:
        return
    found = waves(scene)
    growth = method.amplification(found.exponents(h))
    i = int(np.argmax(growth)) if len(growth) else 0
    powers = math.log10(growth[i]) * (scene.time.end - scene.time.start) / h if len(growth) else 0.0
    if powers > math.log10(1 + TOLERATED):
        times = f"10^{powers:.0f}" if powers > 3 else f"{10**powers:.3g}"
        yield (
            f"time.integrator = {method} makes waves grow: at time.step = {h:g} s the {found.kind[i]} wave of "
            f"{found.omega[i] / (2 * math.pi):.4g} Hz by {100 * (growth[i] - 1):.3g} % per step, {times} "
            "times in the run; take the default, or order = 2"
        )


def dying_waves(scene: Scene) -> Iterator[str]:
    """Waves that the integrator kills: backward Euler (BDF of order 1, theta = 1) above all."""
    method, h = method_of(scene), scene.time.step
    if method is None:
        return
    watched = {"its slowest wave": float(waves(scene, 3).omega.min(initial=math.inf))}
    if math.isfinite(period := scene.blade_passage):
        watched["the passage of the blades"] = 2 * math.pi / period
    left = {}
    for name, omega in watched.items():
        if math.isfinite(omega):
            rho = float(method.amplification(1j * omega * h))
            left[name] = omega, rho, rho ** (2 * math.pi / (omega * h))
    if not left or min(amplitude for _, _, amplitude in left.values()) > 1 - TOLERATED:
        return
    parts = [
        f"{100 * a:.3g} % after one period of {name} ({w / (2 * math.pi):.4g} Hz)" for name, (w, _, a) in left.items()
    ]
    omega, rho, _ = min(left.values(), key=lambda item: item[2])
    yield (
        f"time.integrator = {method} kills waves: at time.step = {h:g} s it leaves {' and '.join(parts)} of an "
        f"amplitude, as a retardation time of {-2 * math.log(rho) / (omega**2 * h):.3g} s would; take the default, "
        "or a smaller step"
    )


def coarse_steps(scene: Scene) -> Iterator[str]:
    """Steps too long for the time between two blades."""
    period, h = scene.blade_passage, scene.time.step
    wanted = PASSAGE.get(scene.engine)
    if wanted is not None and h > period / wanted * (1 + 1e-9):
        yield (
            f"time.step = {h:g} s leaves {period / h:.3g} steps between two blades ({period:.4g} s), the "
            f"{scene.engine} engine wants {wanted}: take at most {period / wanted:.2g} s"
        )


def locking_factor(scene: Scene) -> float:
    """Bending stiffness over the true one of linear elements under full integration: 1 + kGA h^2/(12 EI), the worst.

    1458 for the thesis' drill pipe on elements of 12.5 m, with a shear correction of 0.53.
    """
    counts = distribute([s.length for s in scene.string], scene.mesh.elements)
    factors = []
    for section, n in zip(scene.string, counts, strict=True):
        k = section.section_stiffness()
        factors.append(1 + k.shear1 * (section.length / n) ** 2 / (12 * k.bending1))
    return max(factors)


def locking(scene: Scene) -> Iterator[str]:
    """Linear elements under full integration, which cannot bend without shearing."""
    bends = scene.resolved_model().name in ("planar", "spatial")
    if bends and scene.mesh.degree == 1 and scene.mesh.quadrature == "full":
        yield (
            f"mesh.quadrature = 'full' with mesh.degree = 1 locks: this mesh is {locking_factor(scene):.4g} "
            "times too stiff in bending; take quadrature = 'reduced', or degree 2 or more"
        )


def large_rotation(scene: Scene) -> Iterator[str]:
    """The trapezoidal rule where a rod turns as a whole: it has no damping for what it cannot resolve."""
    method = method_of(scene)
    if scene.resolved_model().name not in ("planar", "spatial") or scene.bites:
        return
    if method is None or method.kind != "theta" or method.theta != 0.5:
        return
    time, initial = scene.time, scene.initial
    turn = scene.top_drive.motion(time.end)[0] - scene.top_drive.motion(time.start)[0]
    turn = max(abs(turn), math.hypot(*initial.angular_velocity) * (time.end - time.start))
    fastest = float(waves(scene).omega.max(initial=0.0)) * time.step
    if turn > 1 and fastest > 1:
        yield (
            f"time.integrator = 'theta' with theta = 0.5 can break down in large rotation: the rod turns by {turn:.3g} "
            f"rad, and its fastest wave by {fastest:.3g} rad per step, which nothing damps; take 'generalized-alpha' "
            "or 'arkimex'"
        )


def quaternion_norm(scene: Scene) -> float:
    """|q|^2 at which an integrator's drift and the correction k(1 - q.q) q balance, at the speed of the drive.

    q turns at half the spin: it keeps its norm where the amplification at (k(1 - |q|^2) + i omega/2) h is 1; backward
    Euler gives k h (1 - |q|^2) = 1 - sqrt(1 - (omega h/2)^2). Not above 0: q dies out.
    """
    method, initial = method_of(scene), scene.initial
    speed = max(abs(scene.top_drive.speed or 0.0), math.hypot(*initial.angular_velocity))
    if method is None or scene.resolved_model().name != "spatial" or speed == 0.0:
        return 1.0
    h = scene.time.step
    sign = 1.0 if float(method.amplification(0.5j * speed * h)) <= 1 else -1.0
    feed = sign * np.concatenate([[0.0], np.geomspace(1e-12, 1.0, 400)])
    growth = sign * np.log(method.amplification(np.asarray(feed + 0.5j * speed * h, np.complex128)))
    balanced = np.flatnonzero(growth >= 0)
    if len(balanced) == 0:
        return -math.inf
    at = int(balanced[0])
    if at == 0:
        return 1.0
    part = growth[at - 1] / (growth[at - 1] - growth[at])
    return float(1 - (feed[at - 1] + part * (feed[at] - feed[at - 1])) / (CORRECTION * h))


def drifting_quaternions(scene: Scene) -> Iterator[str]:
    """Quaternions that the integrator shrinks or blows up faster than the correction brings them back."""
    norm = quaternion_norm(scene)
    if abs(norm - 1) > 0.5:
        end = "they die out, and the rotation with them" if norm <= 0 else f"their square settles at {norm:.3g}"
        yield (
            f"time.integrator = {method_of(scene)} lets the norm of the quaternions drift: at time.step = "
            f"{scene.time.step:g} s {end}; take the default, or a smaller step"
        )


def wear_flat_feed(scene: Scene) -> tuple[float, float]:
    """Literal reading: torque (N m) of the wear flats on a bit that turns backwards, and that which brakes it forwards.

    The printed torque keeps its sign (errata 31). Backwards the flats carry the stalled strength: (a/2) mu gamma
    sigma_2 a l; forwards the bit is braked by the nominal torque.
    """
    bit, rock = scene.bit, scene.rock
    assert bit is not None and rock is not None
    flat = rock.contact_strength_stalled * bit.radius * bit.wear_flat_length
    return 0.5 * bit.radius * bit.friction * bit.geometry * flat, scene.nominal().torque_on_bit


def literal_torque(scene: Scene) -> Iterator[str]:
    """The wear-flat torque as printed."""
    if scene.reading != "literal" or not scene.drills:
        return
    push, brake = wear_flat_feed(scene)
    speed = abs(scene.top_drive.speed or 0.0)
    runs_away = f", more than the {brake:.4g} N m that brake it forwards: the spin can run away" if push > brake else ""
    yield (
        f"reading = 'literal' keeps the sign of the wear flats' torque: turning backwards as fast as the top "
        f"({speed:g} rad/s) the bit is fed {push * speed / 1e3:.4g} kW by {push:.4g} N m{runs_away}; take reading = "
        "'recommended'"
    )


def self_excitation(scene: Scene, speed: Array, surface: Surface | None = None) -> Array:
    """Growth (n,; 1/s) of the fastest axial motion of bit and rock at speeds of the top (n,; rad/s).

    surface: the discretised one; None for the rock as it is. Minus infinity where no motion decays slower than 2 1/s.
    """
    loop = DrillingLoop.from_scene(scene)
    if surface is not None:
        loop = replace(loop, delay=surface_delay(surface.scheme, surface.degree, surface.elements))
    roots = loop.roots(speed, np.full_like(speed, scene.nominal().depth_of_cut / (2 * math.pi)))
    axial = ~roots.torsional & np.isfinite(roots.values)
    return np.asarray(np.where(axial, roots.values.real, -math.inf).max(axis=1))


def boundary(scene: Scene, surface: Surface | None = None) -> float:
    """Speed of the top (rad/s) above which the self-excitation dies out; 0 if it always does.

    surface: the discretised one; None for the rock as it is. Looked for up to ten times the speed of the scene.
    """
    low = 0.0
    grid: Array = np.geomspace(0.1, 10, 40) * abs(scene.top_drive.speed or 0.0)
    for _ in range(3):
        growing = np.flatnonzero(self_excitation(scene, grid, surface) > 0)
        if len(growing) == 0:
            break
        last = int(growing[-1])
        low, high = float(grid[last]), float(grid[min(last + 1, len(grid) - 1)])
        grid = np.asarray(np.linspace(low, high, 8), np.float64)
    return low


def _keeps_delay(surface: Surface) -> bool:
    """Whether a rock surface hands on the lowest waves of a sector as they are, so that nothing need be computed."""
    theta = np.linspace(0.1, 4, 40) * 1j * math.pi
    delay = surface_delay(surface.scheme, surface.degree, surface.elements)
    return float(np.abs(delay(theta, 1.0) - np.exp(-theta)).max()) < 1e-3


def diffusive_surface(scene: Scene) -> Iterator[str]:
    """A rock surface whose numerical diffusion eats the delay, and the self-excitation with it."""
    rock, speed = scene.rock, scene.top_drive.speed or 0.0
    if rock is None or not scene.drills or speed <= 0 or scene.nominal().depth_of_cut <= 0:
        return
    scheme = rock.surface.scheme
    if _keeps_delay(rock.surface):
        return
    exact, found = (float(self_excitation(scene, np.array([speed]), kind)[0]) for kind in (None, rock.surface))
    if max(exact, found) <= 0 or abs(found - exact) <= TOLERATED * abs(exact):
        return
    name = f"{scheme!r}" + (f" of degree {rock.surface.degree}" if scheme == "dg" else "")
    grows = f"grows by {found:.4g} 1/s" if found > 0 else "dies out"
    true, moved = (boundary(scene, kind) * 30 / math.pi for kind in (None, rock.surface))
    moves = f"dies out above {moved:.4g} rpm instead of {true:.4g} rpm" if moved > 0 else "never grows at any speed"
    yield (
        f"rock.surface.scheme = {name} with {rock.surface.elements} elements smears the cut: the self-excitation "
        f"{grows} instead of growing by {exact:.4g} 1/s, and {moves}; take 'dg' with degree = 2 and elements = 16, "
        "or 'profile'"
    )


def digging_bit(scene: Scene) -> Iterator[str]:
    """A weight on bit above what the wear flats carry at rest: the law (5-5)-(5-7) lets a stalled bit sink freely."""
    bit, rock = scene.bit, scene.rock
    if not scene.drills or bit is None or rock is None:
        return
    carried = rock.contact_strength_stalled * bit.radius * bit.wear_flat_length
    weight = scene.nominal().weight_on_bit
    if weight > carried:
        yield (
            f"top_drive.weight_on_bit = {weight:.4g} N is more than the {carried:.4g} N that the wear flats carry on a "
            "bit that does not turn: where it stalls it digs in until the string breaks it loose, and nothing in the "
            "law bounds that; take less weight, or enough damping that it never stalls"
        )


GUARDS: tuple[Callable[[Scene], Iterator[str]], ...] = (
    growing_waves,
    dying_waves,
    coarse_steps,
    diffusive_surface,
    locking,
    large_rotation,
    drifting_quaternions,
    literal_torque,
    digging_bit,
    *wall_guards.GUARDS,
)


def warnings(scene: Scene) -> list[str]:
    """What is known to go wrong with a scene: a sentence each, with the number computed and what to do instead."""
    return [text for guard in GUARDS for text in guard(scene)]


def refuse(scene: Scene) -> None:
    """Raise SceneError where a run could only fail: explicit steps that are unstable on the scene's mesh."""
    if scene.time.integrator != "explicit" or not scene.condensable:
        return
    from ..models.straight import StraightString
    from .condensed import stable_step

    line = StraightString(scene)
    limit = stable_step(line.axial, line.torsion)
    if scene.time.step > limit:
        growth = Method("central differences").amplification(2j * scene.time.step / limit)
        raise SceneError(
            f"time.step = {scene.time.step:g}: must be at most {limit:.4g} s where time.integrator = 'explicit': the "
            f"fastest wave of this mesh ({1 / (math.pi * limit):.4g} Hz) would grow {float(growth):.3g} times per step"
        )


# -- during a run -----------------------------------------------------------------------------------------------------


def runaway(rows: Mapping[str, Any], scene: Scene) -> str:
    """Why a run has to stop, from rows of its history (``time``, ``bit_angular_speed``); empty while all is well.

    Where a guard knows of something that feeds the string, a bit that spins more than RUNAWAY times as fast as the top
    is fed by it; elsewhere only a spin that is no number stops a run.
    """
    if "bit_angular_speed" not in rows:
        return ""
    spin = np.atleast_1d(np.asarray(rows["bit_angular_speed"], dtype=np.float64))
    limit = RUNAWAY * abs(scene.top_drive.speed or 0.0)
    if np.all(np.abs(spin) <= (limit or np.inf)):
        return ""
    cause = next(iter([*literal_torque(scene), *growing_waves(scene)]), "")
    bad = np.flatnonzero(~(np.abs(spin) <= limit) if cause and limit else ~np.isfinite(spin))
    if len(bad) == 0:
        return ""
    cause = cause or "try a smaller time.step"
    t, w = float(np.atleast_1d(rows["time"])[bad[0]]), float(spin[bad[0]])
    return f"the bit spins at {w:.4g} rad/s at t = {t:.4g} s, more than {RUNAWAY:g} times as fast as the top: {cause}"
