"""Bit-rock law, its solution at the bit, and the rock surface the bit cuts.  Needs numpy and numba only."""

from drillfem.bitrock.dg import DGOperators, dg_operators
from drillfem.bitrock.law import BitForces, BitLaw
from drillfem.bitrock.solve import bit_step, solve_bit
from drillfem.bitrock.surface import RockSurface

__all__ = ["BitForces", "BitLaw", "DGOperators", "RockSurface", "bit_step", "dg_operators", "solve_bit"]
