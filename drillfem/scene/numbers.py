"""A scene given by the numbers of Appendix C.2: the lumped model that has them, in SI units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from drillfem.errors import SceneError
from drillfem.scene.keys import read
from drillfem.scene.tables import Numbers

#: Name of the section that is nothing but the spring of a lumped model.
SPRING = "spring"

#: Radius (m), inclination and specific energy (Pa) of the thesis' bit and rock: with them, and the two scales, the
#: numbers fix all else.
_RADIUS, _INCLINATION, _ENERGY = 0.108, 0.38, 0.252e9
#: Lengths of the spring and of the body (m) that carry the lumps, and what a massless section has per metre.
_SPRING, _BODY, _NOTHING = 1000.0, 200.0, 1e-12
_REPLACED = ("string", "material", "hole", "contact", "top_drive", "bit", "ends", "inertia")


def expanded(data: Mapping[str, Any]) -> Mapping[str, Any]:
    """Raw scene data with a table ``[dimensionless]`` replaced by string, drive, bit and rock (C-1)-(C-7).

    t* = sqrt(I/C), L* = 2C/(eps a^2), psi = zeta eps a I/(M C), beta = mu gamma zeta, lambda = sigma l/(zeta eps L*),
    W_0 = W0/(zeta eps a L*), omega_0 = Omega_0 t*. Raises SceneError.
    """
    if "dimensionless" not in data:
        return data
    data = dict(data)
    n = read(Numbers, data.pop("dimensionless"), "dimensionless")
    for key in _REPLACED:
        if key in data:
            raise SceneError(f"{key}: must be left out where there is [dimensionless], which stands for it")
    if data.setdefault("model", "lumped") not in ("lumped", "auto"):
        raise SceneError(f"model = {data['model']!r}: must be one of lumped, auto where there is [dimensionless]")
    if unknown := set(data.get("rock", {})) - {"surface"}:
        raise SceneError(f"rock.{min(unknown)}: must be left out where there is [dimensionless], which stands for it")
    spring = n.length * _ENERGY * _RADIUS**2 / 2
    inertia = spring * n.time**2
    force = _INCLINATION * _ENERGY * _RADIUS * n.length  # unit of weight
    mass = _INCLINATION * _ENERGY * _RADIUS * inertia / (n.psi * spring)
    stiff = {"axial": 1e12, "shear": 1e12, "bending": 1e12}
    data["string"] = [
        {
            "name": SPRING,
            "length": _SPRING,
            "stiffness": {**stiff, "torsion": spring * _SPRING},
            "mass_per_length": _NOTHING,
            "rotary_inertia": _NOTHING,
        },
        {
            "name": "body",
            "length": _BODY,
            "stiffness": {**stiff, "torsion": 1e12},
            "mass_per_length": mass / _BODY,
            "rotary_inertia": inertia / (2 * _BODY),
        },
    ]
    data["top_drive"] = {"kind": "imposed-speed", "speed": n.omega_0 / n.time, "weight_on_bit": n.W_0 * force}
    # heavy enough to hang on the hook: only the difference, the weight on bit, acts
    data.setdefault("gravity", {"magnitude": max(9.80665, 2 * n.W_0 * force / mass)})
    data["bit"] = {
        "kind": "cutting",
        "radius": _RADIUS,
        "blades": n.blades,
        "wear_flat_length": n.lambda_ * _INCLINATION * n.length,
        "friction": n.beta / _INCLINATION,
        "inclination": _INCLINATION,
    }
    data["rock"] = {
        "intrinsic_specific_energy": _ENERGY,
        "contact_strength": _ENERGY,
        "contact_strength_stalled": 2 * _ENERGY,
        **data.get("rock", {}),
    }
    return data
