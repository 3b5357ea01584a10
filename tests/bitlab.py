"""The bit and the rock of the thesis (tables 5.1 and 6.1), for tests that need no scene."""

from __future__ import annotations

C1 = {
    "specific_energy": 0.252e9,
    "contact_strength": 0.252e9,
    "contact_strength_stalled": 0.504e9,
    "radius": 0.108,
    "wear_flat_length": 1.2e-3,
    "inclination": 0.38,
    "friction": 0.8,
    "blades": 6,
}
