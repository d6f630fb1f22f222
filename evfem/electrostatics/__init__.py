"""Electrostatic attraction and voltage signals: force laws, closed forms, encoding, files."""

from evfem.electrostatics.laws import Kaczmarek, Layer, Layers, StrongTroxel, eps_0

__all__ = ["Kaczmarek", "Layer", "Layers", "StrongTroxel", "eps_0"]
