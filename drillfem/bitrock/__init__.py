"""Bit-rock law, its solution at the bit, and the rock surface the bit cuts.  Needs numpy, scipy and numba only."""

from drillfem.bitrock.dg import DGOperators, dg_operators, supg_operators, surface_operators
from drillfem.bitrock.law import BitForces, BitLaw
from drillfem.bitrock.linear import characteristic_root, growth_rate
from drillfem.bitrock.solve import bit_step, solve_bit
from drillfem.bitrock.surface import SCHEMES, RockSurface

__all__ = [
    "SCHEMES",
    "BitForces",
    "BitLaw",
    "DGOperators",
    "RockSurface",
    "bit_step",
    "characteristic_root",
    "dg_operators",
    "growth_rate",
    "solve_bit",
    "supg_operators",
    "surface_operators",
]
