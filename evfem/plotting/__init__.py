"""Pictures of results, meshes, sweeps and fits with matplotlib: functions that return the Axes they drew on,
or the axes of several panels; their `figure` is saved by `forces(result).figure.savefig("forces.png")`.
"""

from evfem.plotting.curves import (
    compare,
    contact_area,
    contact_pressure,
    energies,
    force_indentation,
    forces,
    friction,
    history,
    probes,
    residuals,
    signal,
    spectrum,
)
from evfem.plotting.fields import FIELDS
from evfem.plotting.finger import deformed, side_by_side
from evfem.plotting.footprint import footprint
from evfem.plotting.meshes import regions
from evfem.plotting.movie import animate
from evfem.plotting.response import impedance, tornado
from evfem.plotting.sweeps import sweep, sweep_histogram, sweep_map, sweep_scatter

__all__ = [
    "FIELDS", "animate", "compare", "contact_area", "contact_pressure", "deformed", "energies", "footprint",
    "force_indentation", "forces", "friction", "history", "impedance", "probes", "regions", "residuals",
    "side_by_side", "signal", "spectrum", "sweep", "sweep_histogram", "sweep_map", "sweep_scatter",
    "tornado",
]  # fmt: skip
