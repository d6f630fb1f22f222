"""Electrostatic attraction and voltage signals: force laws, closed forms, encoding, files."""

from evfem.electrostatics.laws import Kaczmarek, Layer, Layers, StrongTroxel, eps_0
from evfem.electrostatics.rigid import FieldSolution, rigid_field

__all__ = [
    "FieldSolution",
    "Kaczmarek",
    "Layer",
    "Layers",
    "StrongTroxel",
    "eps_0",
    "rigid_field",
]
