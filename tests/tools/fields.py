"""Closed forms of the field between outlines and an electrode, and their outlines."""

import numpy as np

from evfem import Layer
from evfem.electrostatics import eps_0

FILM = Layer(0.09, 3.35)


def carter(pitch, groove, gap):
    """C / eps_0 and F / (eps_0 U^2) of one pitch of deep rectangular grooves (Carter 1926)."""
    half = groove / (2.0 * gap)
    capacitance = pitch / gap - 4.0 / np.pi * (half * np.arctan(half) - np.log1p(half**2) / 2.0)
    return capacitance, (pitch - 2.0 * groove / np.pi * np.arctan(half)) / (2.0 * gap**2)


def grooves(pitch, groove, gap):
    land = (pitch - groove) / 2.0
    deep = gap + 4.0 * groove
    return [0.0, land, land, pitch - land, pitch - land, pitch], [gap, gap, deep, deep, gap, gap]


def cylinder(radius, gap):
    """C / eps_0 and F / (eps_0 U^2) of a cylinder over a plane."""
    angle = np.arccosh(1.0 + gap / radius)
    return 2.0 * np.pi / angle, np.pi / (angle**2 * np.sqrt((radius + gap) ** 2 - radius**2))


def wave(gap, points=801):
    x = np.linspace(0.0, 0.5, points)
    return x, gap + 0.075 * (1.0 - np.cos(4.0 * np.pi * x))


def ridges(gap, points=401):
    x = np.linspace(0.0, 0.5, points)
    return x, gap + 0.15 * np.abs(x / 0.25 - 1.0) ** 7


def numbers(solution):
    return solution.capacitance / (1e-3 * eps_0), solution.force / eps_0
