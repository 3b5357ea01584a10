"""What a top drive does to the string: speed control by torque, written once for every model.

The drive of inertia J turns with the speed w and is asked for the speed Omega. With the error of the speed
e' = Omega - w and of the angle e (its integral), the law asks for the torque

    T = k_p e' + k_i e                                                          (4-1), (B-1)

so that J w' = T - (torque into the string). Seen from the string it is the impedance Z(s) = J s + k_p + k_i/s, and
waves of torque come back as (Z - zeta)/(Z + zeta), waves of spin as the negative of that, with zeta = sqrt(GJ rhoJ) of
the pipe below (`reflection`).

* ``pi``: gains as given. A stiff drive, k_p >> zeta, reflects nearly all.
* ``soft-torque``: k_p = zeta, k_i = (2 pi f)^2 J. At the tuning frequency f inertia and integral cancel, Z = zeta, and
  nothing comes back; far from f, the inertia reflects again. (Kyllingstad and Nessjoen, SPE/IADC 119660, 2009.)
* ``z-torque``: the motor also makes the torque J w' that its own inertia takes, which hides it from the string: Z =
  k_p + k_i/s with k_p = zeta at all frequencies. A weak integral holds the mean speed. (Dwars, SPE/IADC 173037, 2015:
  there from the torque measured at the top of the string; here with an ideal sensor.)

The motor gives at most the torque limit. While it is at the limit and the error would drive it further, the integral
waits (anti-windup by clamping): e is then no longer the angle that is missing; the difference, `slip`, is state.

The functions are compiled; they are pure, and as good from Python as from other kernels.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..bitrock.jit import kernel
from ..scene.frequencies import End, Uniform, standing_waves

if TYPE_CHECKING:
    from ..scene import Scene

C16 = NDArray[np.complex128]

SLOW = 0.1
"""z-torque: where its integral is as strong as its damping, over the lowest frequency of the string."""


class DriveLaw(NamedTuple):
    """A drive; all numbers are floats, so that kernels can take it."""

    proportional: float  # k_p, N m s/rad
    integral: float  # k_i, N m/rad
    limit: float  # largest torque of the motor, N m; inf: none
    inertia: float  # J, kg m2
    masks: float  # 1: the motor makes up for the inertia (z-torque); else 0


@kernel(lean=True)
def wanted(law: DriveLaw, angle_error: float, speed_error: float, acceleration: float) -> float:
    """Torque (N m) that the law asks for; errors (rad, rad/s) are wanted less actual, acceleration (rad/s2) is w'."""
    return law.integral * angle_error + law.proportional * speed_error + law.masks * law.inertia * acceleration


@kernel(lean=True)
def response(law: DriveLaw, angle_error: float, speed_error: float, acceleration: float):  # type: ignore[no-untyped-def]
    """Torque of the motor (N m), and its derivatives by angle, speed and acceleration of the top.

    ``angle_error`` is the angle wanted less that of the top less `slip`.
    """
    torque = wanted(law, angle_error, speed_error, acceleration)
    if torque > law.limit:
        return law.limit, 0.0, 0.0, 0.0
    if torque < -law.limit:
        return -law.limit, 0.0, 0.0, 0.0
    return torque, -law.integral, -law.proportional, law.masks * law.inertia


@kernel(lean=True)
def slip(law: DriveLaw, angle_error: float, speed_error: float, acceleration: float, step: float) -> float:
    """Angle (rad) that the integral leaves out in a step (s): all of it at the limit, if it would push further."""
    torque = wanted(law, angle_error, speed_error, acceleration)
    if (torque > law.limit and speed_error > 0.0) or (torque < -law.limit and speed_error < 0.0):
        return step * speed_error
    return 0.0


def impedance(law: DriveLaw, omega: C16) -> C16:
    """Z = torque over spin of the drive (N m s) at angular frequencies ``omega`` (rad/s, any shape)."""
    s = 1j * omega
    return np.asarray((1 - law.masks) * law.inertia * s + law.proportional + law.integral / s)


def reflection(law: DriveLaw, omega: C16, zeta: float) -> C16:
    """What comes back of a wave of torque, (Z - zeta)/(Z + zeta); waves of spin: the negative. zeta in N m s."""
    z = impedance(law, omega)
    return np.asarray((z - zeta) / (z + zeta))


def lowest_frequency(scene: Scene) -> float:
    """The string's lowest torsional frequency (Hz) with its top held."""
    pieces = [Uniform(s.length, s.section_stiffness().torsion, 2 * s.rotary_inertia) for s in scene.string]
    bottom = End(scene.ends.bottom == "clamped", scene.ends.bottom_inertia)
    delay = math.fsum(p.length * math.sqrt(p.inertia / p.stiffness) for p in pieces)
    return standing_waves(pieces, End(True), bottom, 1 / delay)[0]


def law_of(scene: Scene) -> DriveLaw | None:
    """The drive of a scene, None for an imposed motion or where nothing turns the top."""
    drive = scene.top_drive
    inertia, limit = scene.ends.top_inertia, drive.torque_limit or math.inf
    if drive.kind == "pi":
        return DriveLaw(drive.proportional_gain or 0.0, drive.integral_gain or 0.0, limit, inertia, 0.0)
    pipe = scene.string[0]
    zeta = math.sqrt(pipe.section_stiffness().torsion * 2 * pipe.rotary_inertia)
    if drive.kind == "soft-torque":
        tuned = 2 * math.pi * (drive.tuning_frequency or lowest_frequency(scene))
        return DriveLaw(zeta, tuned**2 * inertia, limit, inertia, 0.0)
    if drive.kind == "z-torque":
        return DriveLaw(zeta, SLOW * 2 * math.pi * lowest_frequency(scene) * zeta, limit, inertia, 1.0)
    return None
