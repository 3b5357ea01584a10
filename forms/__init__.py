"""The weak forms of drillfem, in UFL only: no mesh, no solver, no I/O.

Reading order: :mod:`kinematics` (configuration, strains), :mod:`constitutive` (Kelvin-Voigt section law),
:mod:`ansatz` (which fields are unknown), :mod:`virtual_work` (the balance of Appendix D), :mod:`surface` (the rock).
"""
