"""Fingerprints under a fingertip: what whorl, loop and arch do to stiffness, onset of sliding and attraction,
and how much that depends on the direction of the slide.

Table 2's pad with the ridges of each pattern, with parallel ones along the finger and with none, is pressed
over the paper's display under 1000 V and slid under the held load across (x) and along the finger (z).
Expected: parallel ridges give way more easily across than along themselves, curved ones have both directions
under the contact and differ little more than the smooth pad, which is longer than wide; once everything
slips, friction is the coefficient times the pressing force for every pattern and direction, so patterns
differ in how sliding begins and in the attraction of their contact, and not in the end.

The pitch is 0.75 mm, half as much again as a finger's, so that a curved pattern has 20k nodes; what pitch,
mesh and steps change stands in the numbers, of parallel ridges.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

import evfem as ev
from evfem.common.arrays import Floats

from .common import Series, Study
from .plots import COLOURS, Figure, panels

COLOUR_OF = {"along": "neutral", "whorl": "kaczmarek", "loop": "strong_troxel", "arch": "fe"}
PATTERNS = {pattern: COLOURS[name] for pattern, name in COLOUR_OF.items()}
DIRECTIONS = {"x": 0.0, "z": 90.0}
PITCH, LOAD, VOLTAGE, FRICTION = 0.75, 0.25, 1000.0, 0.3
#: slides (mm), one after the other; the first, short one tells the stiffness
SLIDES = (0.02, 0.03, 0.05, 0.1, 0.2)
#: share of the friction of full slip from which on a pad counts as sliding
ONSET = 0.9
#: the row of the pressed pad
PRESSED = 1
ASSUMPTIONS = {
    "pitch": "0.75 mm, a finger's is about 0.5; height and profile of the ridges are Table 2's",
    "pad": "coarse, rim held by the nail; a display with the paper's insulator, friction 0.3",
    "stiffness": "force over the first 0.02 mm, which nearly all nodes stick through",
    "onset": f"distance at which friction is {ONSET:g} of the coefficient times the pressing force",
}


@dataclass(frozen=True, eq=False)
class Slid:
    """What a slide in one direction tells: distances (mm) and friction along it over that of full
    slip, from the pressed pad on; stiffness in N/mm, onset in mm, and the run.
    """

    distance: Floats
    share: Floats
    stiffness: float
    result: ev.Result

    @property
    def onset(self) -> float:
        """Distance (mm) at which the pad slides; nan where it does not."""
        return float(np.interp(ONSET, self.share, self.distance, right=np.nan))


def slide(finger: Any, angle: float, slides: tuple[float, ...] = SLIDES, parts: int = 1) -> Slid:
    """Press and slide at an angle, each distance in so many steps."""
    motion: list[Any] = [ev.Press(force=LOAD, steps=2)]
    motion += [ev.Slide(one, steps=parts, angle=angle, hold="force") for one in slides]
    display = ev.Display(friction=FRICTION)
    result = ev.simulate(ev.Scene(finger, display, ev.Kaczmarek(), VOLTAGE, motion))
    force = result.tangential_force[PRESSED:]
    distance = result["position" if angle == 0.0 else "position_z"][PRESSED:]
    at = int(np.argmin(np.abs(distance - slides[0])))
    stiffness = float((force[at] - force[0]) / slides[0])
    return Slid(distance, force / (FRICTION * result.normal_force[PRESSED:]), stiffness, result)


def pad(pattern: str, pitch: float = PITCH, resolution: str = "coarse") -> ev.Fingertip:
    """The pad with this pattern."""
    return ev.Fingertip(ridges=pattern, ridge_width=pitch, resolution=resolution)


def main(quick: bool = False) -> Study:
    """Stiffness, onset and attraction of every pattern in both directions, in numbers and a figure."""
    patterns = ["along"] if quick else list(PATTERNS)
    slides = SLIDES[:3] if quick else SLIDES
    found = {(one, way): slide(pad(one), DIRECTIONS[way], slides) for one in patterns for way in DIRECTIONS}
    smooth = ev.Fingertip(ridges="none", resolution="coarse")
    found |= {("smooth", way): slide(smooth, angle, slides[:1]) for way, angle in DIRECTIONS.items()}
    numbers = pattern_numbers(found, patterns)
    numbers |= {} if quick else error_numbers(found)
    series = [
        Series(f"{one} {way}", slid.distance, slid.share, "1 over mm")
        for (one, way), slid in found.items()
        if one in PATTERNS
    ]
    parameters = {"pitch_mm": PITCH, "load_N": LOAD, "voltage_V": VOLTAGE, "slides_mm": slides}
    return Study("fingerprint", numbers, {}, ASSUMPTIONS, series, lambda: _draw(found, patterns), parameters)


def pattern_numbers(found: dict[tuple[str, str], Slid], patterns: list[str]) -> dict[str, float]:
    """Stiffness and onset each way, areas and attraction of the pressed pad."""
    numbers: dict[str, float] = {}
    for (one, way), slid in found.items():
        result = slid.result
        if way == "x":
            for key in ("electrostatic_force", "real_contact_area", "contact_area", "indentation"):
                unit = {"electrostatic_force": "N", "indentation": "mm"}.get(key, "mm2")
                numbers[f"{one}.{key}_{unit}"] = float(result[key][PRESSED])
            numbers[f"{one}.nodes"] = len(result.mesh.points)
        numbers[f"{one}.{way}.stiffness_N_per_mm"] = slid.stiffness
        if one in PATTERNS:
            numbers[f"{one}.{way}.onset_mm"] = slid.onset
            numbers[f"{one}.{way}.friction_at_the_end_over_full_slip"] = float(slid.share[-1])
    for one in (*patterns, "smooth"):
        ratio = found[one, "z"].stiffness / found[one, "x"].stiffness
        numbers[f"verdict.{one}.stiffness_z_over_x"] = ratio
    for one in patterns:
        numbers[f"verdict.{one}.onset_z_over_x"] = found[one, "z"].onset / found[one, "x"].onset
        pull = numbers[f"{one}.electrostatic_force_N"] / numbers["smooth.electrostatic_force_N"]
        numbers[f"verdict.{one}.attraction_over_smooth"] = pull
    return numbers


def error_numbers(found: dict[tuple[str, str], Slid]) -> dict[str, float]:
    """What steps, mesh and pitch change of parallel ridges slid across, in per cent."""
    base = found["along", "x"]
    others = {
        "steps_doubled": slide(pad("along"), 0.0, SLIDES[:3], parts=2),
        "mesh_medium": slide(pad("along", resolution="medium"), 0.0, SLIDES[:1]),
        "pitch_0.5mm": slide(pad("along", pitch=0.5), 0.0, SLIDES[:1]),
    }
    numbers = {}
    for name, one in others.items():
        pulls = [float(slid.result.electrostatic_force[PRESSED]) for slid in (one, base)]
        changes = {"stiffness": (one.stiffness, base.stiffness), "attraction": pulls}
        if name == "steps_doubled":
            changes["friction_after_0.1mm"] = (float(one.share[-1]), float(base.share[3]))
        numbers |= {f"error.{name}.{key}_percent": 100.0 * (a / b - 1.0) for key, (a, b) in changes.items()}
    return numbers


def _draw(found: dict[tuple[str, str], Slid], patterns: list[str]) -> Figure:
    from evfem.plotting.footprint import footprint

    figure, axes = panels(6.2, 3, 9.5, rows=2)
    figure.get_layout_engine().set(rect=(0.0, 0.0, 0.97, 1.0))  # labels of bars stand beside the panels
    shown = patterns[-3:]
    for ax, one in zip(axes, shown, strict=False):
        footprint(found[one, "x"].result, "contact_pressure", PRESSED, ax, near=(-3.0, 3.0, -4.2, 4.2))
        ax.set_title(one, fontsize="medium")
    for ax in axes[1:3]:
        ax.set_ylabel("")  # as at the first
    for ax in axes[len(shown) : 3]:
        ax.set_visible(False)
    _bars(axes[3], patterns, {way: [found[one, way].onset for one in patterns] for way in DIRECTIONS})
    axes[3].set_ylabel("onset of sliding (mm)")
    bars = ["smooth", *patterns]
    _bars(axes[4], bars, {way: [found[one, way].stiffness for one in bars] for way in DIRECTIONS})
    axes[4].set_ylabel("stiffness (N/mm)")
    smooth = found["smooth", "x"].result.electrostatic_force[PRESSED]
    pull = [found[one, "x"].result.electrostatic_force[PRESSED] / smooth for one in patterns]
    axes[5].bar(patterns, pull, color=[PATTERNS[one] for one in patterns])
    axes[5].set_ylabel("attraction over that of a smooth pad")
    for ax in axes[3:]:
        ax.tick_params(axis="x", labelsize="small", rotation=30)
    return figure


def _bars(ax: Any, names: list[str], values: dict[str, list[float]]) -> None:
    place = np.arange(len(names))
    for shift, (way, heights), hatch in zip((-0.2, 0.2), values.items(), ("", "///"), strict=True):
        colours = [PATTERNS.get(name, COLOURS["measured"]) for name in names]
        ax.bar(place + shift, heights, 0.4, color=colours, hatch=hatch, edgecolor="white", label=way)
    ax.set_xticks(place, names)
    ax.set_xlabel("plain: along x, hatched: along z", fontsize="small")
