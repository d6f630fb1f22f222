"""Answers of a finger over the frequency."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from evfem.errors import InputError
from evfem.plotting.figures import Panels, curves, new_panels, styled
from evfem.response.impedance import Impedance


def impedance(found: Impedance | Mapping[str, Impedance]) -> Panels:
    """Magnitude and phase of the stiffness over the frequency, of one finger or of several by their names.

    The phase is positive where the force is ahead of the displacement.

    Raises
    ------
    InputError
        Nothing to draw, or stiffnesses of different units.
    """
    named = {"": found} if isinstance(found, Impedance) else dict(found)
    units = {one.unit for one in named.values()}
    if len(units) != 1:
        given = "no impedance" if not units else "some of the plane, some in space"
        raise InputError("found", given, "one impedance, or {name: impedance, ...} of one unit")
    upper, lower = new_panels(2, 6.0)
    sizes, phases = [], []
    for one, look in styled(named):
        sizes.append((one.frequency, np.abs(one.stiffness), look))
        phases.append((one.frequency, np.degrees(np.angle(one.stiffness)), look))
    curves(upper, sizes, "", f"magnitude ({units.pop()})")
    curves(lower, phases, "frequency (Hz)", "phase (degrees)")
    upper.set(xscale="log", yscale="log")
    lower.set_yticks(np.arange(-180, 181, 45))
    degrees = np.concatenate([y for _, y, _ in phases])
    lower.set_ylim(max(-185.0, degrees.min() - 10.0), min(185.0, degrees.max() + 10.0))
    if (legend := lower.get_legend()) is not None:
        legend.remove()
    return Panels((upper, lower))
