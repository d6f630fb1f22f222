"""Electrostatic attraction: force laws, dielectrics, closed forms of plates and fingers, voltages in time.

The full field of rigid bodies is loaded when it is first asked for: the closed forms need numpy alone.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from evfem.electrostatics.alternating import (
    alternating_pressure,
    complex_length,
    contact_impedance,
    corner_frequencies,
    square_wave_pressure,
    step_pressure,
    step_rates,
)
from evfem.electrostatics.breakdown import breakdown_voltage, inception_voltage
from evfem.electrostatics.dielectrics import SKINS, Dielectric, DielectricTable
from evfem.electrostatics.laws import Kaczmarek, Layer, Layers, StrongTroxel, eps_0
from evfem.electrostatics.localgaps import equivalent_gap

if TYPE_CHECKING:
    from evfem.field.rigid import FieldSolution, rigid_field

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
    "breakdown_voltage",
    "complex_length",
    "contact_impedance",
    "corner_frequencies",
    "eps_0",
    "equivalent_gap",
    "inception_voltage",
    "rigid_field",
    "square_wave_pressure",
    "step_pressure",
    "step_rates",
]


def __getattr__(name: str) -> Any:
    """PEP 562: what needs scipy and scikit-fem."""
    return import_module("evfem")._from_above(__name__, name)
