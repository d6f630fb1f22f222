r"""Textures with parameters: a sine and its second harmonic, felt by a smooth or a ridged finger.

The profile of the database, the paper's eq. (25) in general::

    h(x) = a (sin(q x) + c sin(2 q x) + d cos(2 q x)),   q = 2 pi / wavelength,   s = q a

`slope` s is the slope of the first sine; `in_phase` c and `in_quadrature` d are the fractions of the
second harmonic. Once the whole contact slips, the friction force of such a slide repeats with the
wavelength, whatever ridges the finger has, because they move with it.

A point of the database is (ln wavelength, ln slope, c, d, friction, ln load), each from 0 to 1 over
its range in `RANGES`. What is interpolated is ``(mu(x) - friction) / slope``: for small heights the
change of friction is proportional to the slope.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import Checked, Within, between, number, yes_or_no
from evfem.finger.fingerpad import FingerPad
from evfem.scene.motion import Press, Slide
from evfem.scene.scene import Scene, Solver
from evfem.surface.surfaces import Sinusoid

#: name -> smallest and largest value of the database, and whether its logarithm is interpolated
RANGES = {
    "wavelength": (1.0, 4.0, True),
    "slope": (0.02, 0.2, True),
    "in_phase": (-0.4, 0.4, False),
    "in_quadrature": (-0.4, 0.4, False),
    "friction": (0.1, 0.6, False),
    "load": (0.02, 0.1, True),
}
#: samples of a period, steps before it, speed (mm/s) and relaxation time of the tissue (s)
SAMPLES, STEPS_BEFORE, SPEED, VISCOSITY = 24, 12, 20.0, 1e-3
#: slide in mm per N/mm of friction force after which the whole contact slips, twice what was seen
SLIP_PER_FORCE = 130.0


def _up_to(high: float, unit: str = "") -> dict[str, Any]:
    return number(f"above 0, up to {high:g} {unit}".rstrip(), Within(0.0, high, above=True), unit)


@dataclass(frozen=True)
class Parametric(Checked):
    """A texture with parameters, the load, and the finger.

    >>> texture = Parametric(wavelength=2.0, slope=0.1, in_phase=0.2)
    >>> f"{texture.amplitude:.4f} mm", texture.beyond()
    ('0.0318 mm', {})
    """

    wavelength: Annotated[float, _up_to(100.0, "mm"), "of a wave"] = 2.0
    slope: Annotated[float, _up_to(10.0), "of the first sine"] = 0.1
    in_phase: Annotated[float, between(-10.0, 10.0), "second harmonic over the first, in phase"] = 0.0
    in_quadrature: Annotated[float, between(-10.0, 10.0), "the same, in quadrature"] = 0.0
    friction: Annotated[float, _up_to(10.0), "of the material"] = 0.3
    load: Annotated[float, _up_to(10.0, "N/mm"), "on the finger"] = 0.05
    ridged: Annotated[bool, yes_or_no(), "whether the finger has ridges"] = True

    @property
    def amplitude(self) -> float:
        """Amplitude (mm) of the first sine."""
        return self.slope * self.wavelength / (2.0 * np.pi)

    def surface(self) -> Sinusoid:
        """The profile as the rigid surface of a scene."""
        q, a, c, d = 2.0 * np.pi / self.wavelength, self.amplitude, self.in_phase, self.in_quadrature
        rows = [[a, q, 0.0], [a * c, 2.0 * q, 0.0], [a * d, 2.0 * q, 0.5 * np.pi]]
        return Sinusoid(friction=self.friction, terms=[row for row in rows if row[0]])

    def beyond(self) -> dict[str, tuple[float, float]]:
        """Parameters outside the database, with what it has: {} where it has all of them."""
        ends = {name: (low - 1e-9, high + 1e-9) for name, (low, high, _) in RANGES.items()}
        wrong = [name for name, (low, high) in ends.items() if not low <= getattr(self, name) <= high]
        return {name: RANGES[name][:2] for name in wrong}

    def point(self) -> Floats:
        """Its normalised coordinates (6,) in the database, 0 to 1 along each axis if inside."""
        ends = np.array([(getattr(self, name), low, high) for name, (low, high, _) in RANGES.items()]).T
        logarithmic = [logarithmic for _, _, logarithmic in RANGES.values()]
        ends[:, logarithmic] = np.log(ends[:, logarithmic])
        return (ends[0] - ends[1]) / (ends[2] - ends[1])


def at(point: Floats, ridged: bool) -> Parametric:
    """The texture at normalised coordinates (6,) of the database.

    >>> at(Parametric(wavelength=3.0, load=0.03).point(), True).wavelength
    3.0
    """
    values = {}
    for fraction, (name, (low, high, logarithmic)) in zip(point.tolist(), RANGES.items(), strict=True):
        value = low * (high / low) ** fraction if logarithmic else low + fraction * (high - low)
        values[name] = float(f"{value:.6g}")  # what stands in the shipped file is what was computed
    return Parametric(**values, ridged=ridged)


def scene(texture: Parametric) -> Scene:
    """Viscous sliding of the coarse pad over the texture at a held load: a second slide of one
    period in `SAMPLES` steps, after a first one over whole periods until everything slips.
    """
    periods = float(np.ceil(SLIP_PER_FORCE * texture.friction * texture.load / texture.wavelength))
    slides = [(periods * texture.wavelength, STEPS_BEFORE), (texture.wavelength, SAMPLES)]
    return sliding(texture.surface(), texture, slides, name="texture")


def sliding(
    surface: Any, finger: Any, slides: list[tuple[float, int]], speed: float = SPEED, **more: Any
) -> Scene:
    """The coarse viscous pad is pressed to a `finger`'s `load` and slid at it: lengths in mm and steps."""
    return Scene(
        FingerPad(resolution="coarse", ridges=finger.ridged, viscosity=VISCOSITY),
        surface,
        solver=Solver(dynamics="viscous", threads=1),
        motion=(
            Press(force=finger.load, steps=4),
            *(Slide(length, steps=steps, speed=speed, hold="force") for length, steps in slides),
        ),
        **more,
    )
