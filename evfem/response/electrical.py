"""What an amplifier sees of a finger about a loaded state: the electrical impedance versus frequency.

The state is the last one of a scene. The nodes of the pad are in parallel, each a stack of skin, gap and
insulator over its own gap and tributary area (`evfem.electrostatics.alternating`), with the separation of
rough faces, whatever the law of the attraction, and a `parallel_capacitance` of the voltage is in parallel
with them, as in the columns `charge`, `current_rms` and `power`. Voltages are small, or slow beside the
finger: it does not move.
"""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from evfem.circuit.load import PER_MM, admittance_of
from evfem.common.arrays import Floats, blas_limits
from evfem.common.checks import Values, to_python
from evfem.common.storage import write_text
from evfem.common.tables import csv_text
from evfem.errors import InputError
from evfem.response.impedance import checked_frequencies
from evfem.response.parameters import scene_of
from evfem.scene.scene import Scene
from evfem.simulation.model import make_attraction
from evfem.simulation.result import Result
from evfem.simulation.run import Run


@dataclass(frozen=True, eq=False)
class ElectricalImpedance:
    """Impedance of a finger versus frequency, arrays (n,).

    `frequency` in Hz; `impedance`, complex, in `unit`: ohm, of a plane finger without a depth ohm mm.
    """

    frequency: Floats
    impedance: Any
    unit: str

    def current_rms(self, voltage: Values) -> Values:
        """Effective current (n,) in A under a sine of the effective `voltage` (V); without a depth A/mm."""
        return to_python(np.abs(np.asarray(voltage) / self.impedance))

    def power(self, voltage: Values) -> Values:
        """Mean power (n,) in W under a sine of the effective `voltage` (V); without a depth W/mm."""
        return to_python(np.asarray(voltage) ** 2 * np.real(1.0 / self.impedance))

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write the table, a row for each frequency; whole or not at all."""
        names = ("frequency (Hz)", f"impedance real ({self.unit})", f"impedance imaginary ({self.unit})")
        columns = (self.frequency, self.impedance.real, self.impedance.imag)
        write_text(Path(path), csv_text([names, *np.transpose(columns).tolist()]))

    def __repr__(self) -> str:
        """Impedance at each frequency, of more than five at the first and the last."""
        count = len(self.frequency)
        told = [
            f"{abs(self.impedance[i]):.4g} {self.unit} at {np.degrees(np.angle(self.impedance[i])):.3g} "
            f"degrees at {self.frequency[i]:g} Hz"
            for i in (range(count) if count <= 5 else (0, count - 1))
        ]
        return "Electrical impedance: " + ", ".join(told)


def electrical_impedance(
    scene: Scene | Result | str | PathLike[str], frequencies: Any
) -> ElectricalImpedance:
    """Electrical impedance of the finger in the state at the end of a scene.

    Parameters
    ----------
    scene
        A `Scene` with a law, the path of a scene file, or a result, whose scene is run again. Its
        `drive` says what skin and gap conduct; the voltage only loads the finger, and may be 0, but
        its `parallel_capacitance` (cable, amplifier) counts.
    frequencies
        In Hz, larger than 0.

    Returns
    -------
    ElectricalImpedance
        Arrays over the frequencies: in ohm, of a plane finger without a depth in ohm mm.

    Raises
    ------
    InputError
        Another frequency; a scene without a law, which has no electrode; a result of a loop, or from a file
        that does not hold its scene.
    NotConverged
        A step of the scene has no solution.

    Examples
    --------
    >>> import evfem as ev
    >>> finger = ev.FingerPad(ridges=False, resolution="coarse")
    >>> scene = ev.Scene(finger, ev.Display(insulator=ev.TOUCHSCREEN), ev.StrongTroxel(), depth=10.0,
    ...                  motion=ev.Press(force=0.05, steps=1), roughness_gap=0.002)
    >>> found = ev.electrical_impedance(scene, [100.0, 1000.0])
    >>> print(round(abs(found.impedance[0] / found.impedance[1]), 6))          # a capacitor
    10.0
    """
    frequency, scene = checked_frequencies(frequencies), scene_of(scene)
    if not scene.has_voltage:
        raise InputError("scene", "no electrostatic law", "a scene with a law and an insulator")
    with blas_limits():
        run = Run(scene, None)
        for request in run.requests():
            run.advance(request)
    model = run.model
    attraction = make_attraction(model.closing, model.pad, model.surface)
    pad = model.equilibrium.pad_state(run.state)
    beside = 2j * np.pi * PER_MM * model.closing.electrics.parallel
    each = [admittance_of(model, attraction, pad, float(one)) + beside * one for one in frequency]
    in_space = model.mesh.dim == 3
    whole = 1.0 if in_space or scene.depth is None else scene.depth
    unit = "ohm" if in_space or scene.depth is not None else "ohm mm"
    return ElectricalImpedance(frequency, 1.0 / (whole * np.array(each)), unit)
