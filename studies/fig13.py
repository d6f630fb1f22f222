"""Fig. 13: the pad on the texture and on the display that renders it, at the instant of the largest voltage.

The slide of Fig. 12 [b]: von Mises stress of the deformed pad with ridges on the sinusoid (25) and, at the
same position, on the display under (20a). Expected (the paper): 1911.12 V in the instant shown. Beside the
figure the fields of both go to ParaView: fig13_reference.pvd and fig13_display.pvd.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import evfem as ev
from evfem.common.arrays import Floats
from evfem.estimate.rendering import Recording, replay
from evfem.export import paraview
from evfem.plotting import side_by_side

from . import rendered
from .common import Series, Study
from .plots import Figure
from .printed import Printed

PAPER = {
    "voltage_V": Printed(
        "1911.12",
        "voltage of the instant shown",
        "V",
        "caption",
        "the instant shown here is that of the largest voltage",
    )
}
NEAR = 1.0  # mm from the contact
#: half width of the close-ups, depth below and height above the contact that they show (mm)
HALF, BELOW, ABOVE = 1.6, 0.25, 1.2
TITLES = {"reference": "on the sinusoid", "display": "on the display"}


@dataclass(frozen=True, eq=False)
class Instant:
    """One step of a run: a result with that step's fields alone."""

    result: ev.Result

    @property
    def frame(self) -> ev.result.Frame:
        """The fields."""
        return self.result.frames[0]

    @property
    def position(self) -> Floats:
        """Current positions of all nodes (N, 2) in mm."""
        return self.result.mesh.points + self.frame.displacement

    @property
    def touching(self) -> Floats:
        """Current positions of the nodes in contact (C, 2) in mm."""
        return self.position[self.frame.contact_status > 0]

    def near(self) -> Any:
        """Which cells lie, with their middle, within 1 mm of the nearest touching node."""
        middle = self.position[self.result.mesh.cells].mean(axis=1)
        distance = np.hypot(*(middle[:, None] - self.touching[None]).transpose(2, 0, 1))
        return distance.min(axis=1) <= NEAR


def _instant(recording: Recording, step: int) -> Instant:
    """The state of a recording after `step` steps, which must be one of its frames."""
    (frame,) = (frame for frame in recording.result.frames if frame.step == step)
    return Instant(replace(recording.result, frames=[frame]))


def instants(case: rendered.Case) -> dict[str, Instant]:
    """Reference and display in the step of the slide with the largest voltage by (20a)."""
    reference, _, _, (_, friction), signal = rendered.felt_on(case, every=1)
    press, slide = reference.scene.motion
    assert isinstance(slide, ev.Slide)
    ends = np.linspace(*signal.profile.position[[0, -1]], slide.steps + 1)
    number = int(np.argmax(signal.profile(ends[1:]))) + 1
    short = replace(slide, distance=slide.distance * number / slide.steps, steps=number)
    scene = replace(reference.scene, motion=(press, short), output=ev.Output(every=1_000_000))
    short_reference, surface = replace(reference, scene=scene), ev.Display(friction=friction)
    display = replay(short_reference, surface, ev.Kaczmarek(), signal.profile)
    step = press.steps + number
    return {"reference": _instant(reference, step), "display": _instant(display, step)}


def main(quick: bool = False) -> Study:
    """Both pads in the instant of the largest voltage, their stresses, the figure, the fields."""
    found = instants(rendered.QUICK_TEXTURE if quick else rendered.TEXTURE)
    numbers = _numbers(found)

    def files(folder: Path) -> None:
        for name, instant in found.items():
            paraview(instant.result, folder / f"fig13_{name}.pvd")

    parts = PAPER, rendered.ASSUMPTIONS, _series(found), lambda: draw(found, numbers)
    return Study("fig13", numbers, *parts, files=files)


def _numbers(found: dict[str, Instant]) -> dict[str, float]:
    row = found["display"].frame.step - 1
    numbers = {"voltage_V": float(found["display"].result.voltage[row])}
    for name, instant in found.items():
        stress, result = instant.frame.von_mises[instant.near()], instant.result
        numbers[f"{name}.von_mises_max_MPa"] = float(stress.max())
        numbers[f"{name}.von_mises_mean_MPa"] = float(stress.mean())
        numbers[f"{name}.tangential_force_N_per_mm"] = float(result.applied_tangential_force[row])
        numbers[f"{name}.load_N_per_mm"] = float(result.applied_force[row])
        numbers[f"{name}.real_contact_width_mm"] = float(result.real_contact_width[row])
    return numbers | {"position_mm": found["display"].frame.position}


def _series(found: dict[str, Instant]) -> list[Series]:
    """Contact pressure and largest stress in the skin along x, as far as the pad touches."""
    series = []
    for name, instant in found.items():
        touching = instant.frame.contact_status > 0
        order = np.argsort(instant.touching[:, 0])
        x = instant.touching[order, 0]
        for quantity in ("contact_pressure", "shear_traction"):
            y = getattr(instant.frame, quantity)[touching][order]
            series.append(Series(f"{name}.{quantity}", x, y, "MPa"))
    return series


def draw(found: dict[str, Instant], numbers: dict[str, float]) -> Figure:
    """Whole pads above, close-ups of the contact below, one scale of stress for all."""
    x, y = found["reference"].touching.mean(axis=0)
    panels = side_by_side(
        {TITLES[name]: instant.result for name, instant in found.items()},
        near=(x - HALF, x + HALF, y - BELOW, y + ABOVE),
        vmax=max(numbers[f"{name}.von_mises_max_MPa"] for name in found),
    )
    place = f"bone at x = {numbers['position_mm']:.2f} mm"
    panels[2].set_title(place, fontsize="medium")
    panels[3].set_title(
        f"{numbers['voltage_V']:.0f} V (paper {PAPER['voltage_V'].digits} V)", fontsize="medium"
    )
    for ax, letter in zip((panels[0], panels[2], panels[3]), "abc", strict=True):
        ax.annotate(f"[{letter}]", (0.0, 1.02), xycoords="axes fraction", ha="left", va="bottom")
    return panels.figure
