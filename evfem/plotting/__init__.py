"""Pictures of results, meshes, sweeps and fits with matplotlib: functions that return the Axes they drew
on, or the axes of several panels; their `figure` is saved by
`forces(result).figure.savefig("forces.png")`.
"""

from evfem.plotting.beside import side_by_side
from evfem.plotting.curves import compare, energies, forces, history
from evfem.plotting.fields import FIELDS
from evfem.plotting.finger import deformed
from evfem.plotting.fits import residuals
from evfem.plotting.footprint import footprint
from evfem.plotting.meshes import regions
from evfem.plotting.movie import animate
from evfem.plotting.pressing import contact_area, force_indentation, friction, signal
from evfem.plotting.spectra import spectrum
from evfem.plotting.sweeps import sweep, sweep_map
from evfem.plotting.tractions import contact_pressure

__all__ = [
    "FIELDS",
    "animate",
    "compare",
    "contact_area",
    "contact_pressure",
    "deformed",
    "energies",
    "footprint",
    "force_indentation",
    "forces",
    "friction",
    "history",
    "regions",
    "residuals",
    "side_by_side",
    "signal",
    "spectrum",
    "sweep",
    "sweep_map",
]
