"""What is simulated: frozen dataclasses, read from TOML, units at the edge, SI inside."""

from drillfem.scene.ladder import MODELS, ModelChoice
from drillfem.scene.nominal import Dimensionless, Nominal, describe, dimensionless, torsional_frequency
from drillfem.scene.scene import Scene, builtin_scenes, load_scene
from drillfem.scene.section import (
    Elasticity,
    Material,
    Moduli,
    Section,
    SectionStiffness,
    Stiffness,
    annulus,
    section_stiffness,
)
from drillfem.scene.tables import (
    Bit,
    Contact,
    Ends,
    Gravity,
    Hole,
    Initial,
    Mesh,
    Output,
    Reference,
    Rock,
    Surface,
    Time,
    TopDrive,
)
from drillfem.scene.uncertain import Random

__all__ = [
    "MODELS",
    "Bit",
    "Contact",
    "Dimensionless",
    "Elasticity",
    "Ends",
    "Gravity",
    "Hole",
    "Initial",
    "Material",
    "Mesh",
    "ModelChoice",
    "Moduli",
    "Nominal",
    "Output",
    "Random",
    "Reference",
    "Rock",
    "Scene",
    "Section",
    "SectionStiffness",
    "Stiffness",
    "Surface",
    "Time",
    "TopDrive",
    "annulus",
    "builtin_scenes",
    "describe",
    "dimensionless",
    "load_scene",
    "section_stiffness",
    "torsional_frequency",
]
