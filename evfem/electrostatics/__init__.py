"""Electrostatic attraction and voltage signals: force laws, dielectrics, closed forms, encoding,
files.
"""

from evfem.electrostatics.alternating import (
    alternating_pressure,
    complex_length,
    corner_frequencies,
    square_wave_pressure,
    step_pressure,
    step_rates,
)
from evfem.electrostatics.dielectrics import SKINS, Dielectric, DielectricTable
from evfem.electrostatics.laws import Kaczmarek, Layer, Layers, StrongTroxel, eps_0
from evfem.electrostatics.rigid import FieldSolution, rigid_field

__all__ = [
    "SKINS",
    "Dielectric",
    "DielectricTable",
    "FieldSolution",
    "Kaczmarek",
    "Layer",
    "Layers",
    "StrongTroxel",
    "alternating_pressure",
    "complex_length",
    "corner_frequencies",
    "eps_0",
    "rigid_field",
    "square_wave_pressure",
    "step_pressure",
    "step_rates",
]
