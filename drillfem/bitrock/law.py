"""The bit-rock law: forces on the bit from its speeds and its depth of cut.

Equations (5-5)-(5-19) of the thesis with totals over the blades: ``depth`` is the sum of the blades'
depths of cut and ``l`` the sum of their wear flats.  Signs: depth, ``v`` and the weight ``W`` are
positive down (W pushes the bit up), the spin ``w`` and the torque ``T`` are positive when drilling (T
brakes it).  The torque of the wear flats follows a regularised sign of the spin; ``literal=True`` keeps
the printed law, whose torque does not change sign and so feeds a bit that turns backwards.

Everything numerical is compiled and works on one flat array of parameters, so that the same code serves
a Python time step and a compiled loop.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drillfem.bitrock.jit import kernel

if TYPE_CHECKING:
    from drillfem.scene import Scene

EPS1, SIGMA1, SIGMA2, RADIUS, FLAT, ZETA, MU, GAMMA, C1, C2, C3, BLADES, LITERAL = range(13)


class BitForces(NamedTuple):
    """Forces of the rock on the bit: weights in N (up), torques in N m (braking)."""

    weight: float
    torque: float
    cutting_weight: float
    wear_weight: float
    cutting_torque: float
    wear_torque: float


@kernel(lean=True)
def ramp(x: float, width: float) -> float:
    """0 for x <= 0, 1 for x >= width, linear between; the unit step (0 at 0) for width = 0."""
    if x <= 0.0:
        return 0.0
    if x >= width:
        return 1.0
    return x / width


@kernel(lean=True)
def specific_energy(par: NDArray[np.float64], w: float) -> float:
    """Intrinsic specific energy at spin w, Pa (5-7)."""
    return par[EPS1] * ramp(w, par[C3])


@kernel(lean=True)
def strength(par: NDArray[np.float64], w: float) -> float:
    """Contact strength under the wear flats at spin w, Pa (5-6): sigma_2 when stalled, sigma_1 when turning."""
    return par[SIGMA2] + (par[SIGMA1] - par[SIGMA2]) * ramp(w, par[C2])


@kernel(lean=True)
def sign_of_spin(par: NDArray[np.float64], w: float) -> float:
    """Direction of the wear-flat torque: clip(w / c3, -1, 1); 1 in the literal law."""
    if par[LITERAL] != 0.0:
        return 1.0
    return ramp(w, par[C3]) - ramp(-w, par[C3])


@kernel(lean=True)
def wear_fraction(par: NDArray[np.float64], v: float) -> float:
    """Fraction of the contact strength that acts at axial speed v (5-5): nothing while the bit rises."""
    return ramp(v, par[C1])


@kernel(lean=True)
def law_forces(
    par: NDArray[np.float64], v: float, w: float, depth: float, contact: float
) -> tuple[float, float, float, float, float, float]:
    """Forces (W, T, Wc, Wf, Tc, Tf) at speeds v, w, total depth of cut, share [0, 1] of the wear flats in contact."""
    wc = specific_energy(par, w) * par[ZETA] * par[RADIUS] * max(depth, 0.0)
    wf = strength(par, w) * wear_fraction(par, v) * par[RADIUS] * par[FLAT] * contact
    tc = 0.5 * par[RADIUS] / par[ZETA] * wc
    tf = 0.5 * par[RADIUS] * par[MU] * par[GAMMA] * sign_of_spin(par, w) * wf
    return wc + wf, tc + tf, wc, wf, tc, tf


@dataclass(frozen=True, kw_only=True)
class BitLaw:
    """Parameters of bit and rock, SI units.

    ``wear_flat_length`` is the total over the blades.  ``axial_regularisation`` c1 (m/s),
    ``torsional_regularisation`` c2 and ``cutting_regularisation`` c3 (rad/s) may be 0: the law is then set-valued.
    """

    specific_energy: float
    contact_strength: float
    contact_strength_stalled: float
    radius: float
    wear_flat_length: float
    inclination: float
    friction: float
    geometry: float = 1.0
    axial_regularisation: float = 1e-5
    torsional_regularisation: float = 1e-1
    cutting_regularisation: float = 1e-3
    blades: int = 1
    literal: bool = False

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not np.isfinite(value) or value < 0:
                raise ValueError(f"bit law: {field.name} = {value}: must be finite and not negative")
        for name in ("radius", "inclination", "blades"):
            if getattr(self, name) <= 0:
                raise ValueError(f"bit law: {name} = {getattr(self, name)}: must be > 0")

    @classmethod
    def from_scene(cls, scene: Scene) -> BitLaw:
        """The law of a scene with a cutting bit."""
        bit, rock = scene.bit, scene.rock
        if bit is None or rock is None:
            raise ValueError("bit law: the scene has no bit or no rock")
        return cls(
            specific_energy=rock.intrinsic_specific_energy,
            contact_strength=rock.contact_strength,
            contact_strength_stalled=rock.contact_strength_stalled,
            radius=bit.radius,
            wear_flat_length=bit.wear_flat_length,
            inclination=bit.inclination,
            friction=bit.friction,
            geometry=bit.geometry,
            axial_regularisation=bit.axial_regularisation,
            torsional_regularisation=bit.torsional_regularisation,
            cutting_regularisation=bit.cutting_regularisation,
            blades=bit.blades,
            literal=scene.reading == "literal",
        )

    @property
    def array(self) -> NDArray[np.float64]:
        """The flat array the compiled functions take (fields in order, EPS1 ... LITERAL)."""
        return np.array([float(getattr(self, field.name)) for field in fields(self)])

    def forces(self, v: float, w: float, d_raw: float) -> BitForces:
        """Forces at axial speed v (m/s), spin w (rad/s) and signed total depth of cut d_raw (m, < 0 off bottom)."""
        return BitForces(*law_forces(self.array, v, w, d_raw, 1.0 if d_raw >= 0 else 0.0))

    def depth_of_cut(self, weight: float) -> float:
        """Total depth of cut (m) that carries ``weight`` (N) in steady drilling, d_0 of (5-35)."""
        wear = self.contact_strength * self.radius * self.wear_flat_length
        return (weight - wear) / (self.specific_energy * self.radius * self.inclination)

    def torque(self, depth: float) -> float:
        """Torque (N m) of steady drilling at total depth of cut ``depth`` (m), T_0 of (5-36)."""
        wear = self.friction * self.geometry * self.contact_strength * self.wear_flat_length
        return 0.5 * (self.specific_energy * depth + wear) * self.radius**2
