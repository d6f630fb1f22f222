"""Which law, and why: electrostatics says Strong-Troxel, the measured forces of this paper say Kaczmarek.

Fact 1, theory. The skin's permittivity is so high that its surface is as good as a conductor. For a
conducting cylinder (radius 8.34 mm, half of Table 2's width) over an electrode under a dielectric slab (0.09
mm, 3.35) the field can be computed to 2e-6 or better (line charges with their images in the slab). Expected:
Strong-Troxel's law, integrated over the curved pad, is its parallel-plate limit and within a few per cent;
Kaczmarek's is about half as large. Without a slab the closed form gives 0.906597 mN/mm at 0.25 mm and 2000 V.

Fact 2, measurement. Over the eleven participants of Table 1 Kaczmarek's law is within about 10 % of the
medians and Strong-Troxel's 1.4 to 1.9 times above. Where skin touches, the two differ most: 24.1 kPa against
1.39 kPa at 2000 V.
"""

from functools import partial
from typing import Any

import numpy as np

from evfem.electrostatics.forces import EllipsoidalPad, pad_force_per_depth
from evfem.electrostatics.laws import Layer, eps_0
from evfem.reference import cylinder_force

from .common import CASES, LAWS, Series, Study, by_participant, paper_display, participants, table2_layers
from .hovering_people import comparison, participant_forces
from .plots import COLOURS, LABELS, Figure, draw_box, law_line, note, panels

VOLTAGE, GAP, RADIUS = 2000.0, 0.25, 8.34
IMAGES, CHARGES = 70, 48
ASSUMPTIONS = {
    "electrostatics": "conducting cylinder over an electrode under a slab; the real skin adds 0.23 um",
    "laws": "vertical traction on the projected lower half of the cylinder, layers of Table 2",
    "measured": "participants as in Fig. 5",
    "what decides": "the measurements include all that the finger does electrically (losses, leakage); "
    "agreement of a law with them is no derivation of it",
}


def main(quick: bool = False) -> Study:
    """Both facts in numbers, and a figure that shows them side by side."""
    gaps = np.geomspace(0.02, 1.0, 9 if quick else 33)
    exact = np.array([cylinder_over_slab(gap) for gap in gaps])
    pads = EllipsoidalPad(2 * RADIUS, 2 * RADIUS, 1.0)
    layers = table2_layers()
    by_law = {law: pad_force_per_depth(LAWS[law], pads, gaps, VOLTAGE, layers) for law in LAWS}
    forces = participant_forces()
    pressure = {law: force_law.traction(gaps, VOLTAGE, layers) for law, force_law in LAWS.items()}
    numbers = _cylinder_numbers(pads) | comparison(forces)
    for law, force_law in LAWS.items():
        numbers[f"contact_pressure_kPa.{law}"] = 1e3 * force_law.traction(0.0, VOLTAGE, layers)
        ratios = [numbers[f"verdict.{law}.median_over_measured.{case}"] for case in CASES]
        numbers[f"verdict.{law}.median_over_measured.mean"] = np.exp(np.mean(np.log(ratios)))
    series = [Series("electrostatics cylinder", gaps, 1e3 * exact, "mN/mm over mm")]
    series += [Series(f"{law} cylinder", gaps, 1e3 * y, "mN/mm over mm") for law, y in by_law.items()]
    series += [Series(f"{law} pressure", gaps, 1e3 * y, "kPa over mm") for law, y in pressure.items()]
    series += [
        by_participant(f"{law} over measured {case}", values / participants()[case], "1")
        for (law, case), values in forces.items()
    ]
    parameters = {"U_V": VOLTAGE, "gap_mm": GAP, "radius_mm": RADIUS}
    picture = partial(_draw, gaps, exact, by_law, forces)
    return Study("laws", numbers, {}, ASSUMPTIONS, series, picture, parameters)


def _cylinder_numbers(pads: EllipsoidalPad) -> dict[str, float]:
    exact = cylinder_over_slab(GAP)
    found = {
        "cylinder.electrostatics_mN_per_mm": 1e3 * exact,
        "cylinder.no_slab_closed_form_mN_per_mm": 1e3 * float(cylinder_force(GAP, RADIUS, VOLTAGE)),
    }
    for law, force_law in LAWS.items():
        force = pad_force_per_depth(force_law, pads, GAP, VOLTAGE, table2_layers())
        found[f"cylinder.{law}_mN_per_mm"] = 1e3 * force
        found[f"verdict.{law}.over_electrostatics"] = force / exact
    return found


def cylinder_over_slab(
    gap: float, slab: Layer | None = None, radius: float = RADIUS, voltage: float = VOLTAGE
) -> float:
    """Attraction in N/mm of a conducting cylinder `gap` mm above a dielectric `slab` on an electrode.

    Line charges inside the cylinder, on a circle around the focus of the nearly equivalent bipolar
    coordinates, with their images: a charge at height h over a slab of thickness d and permittivity e on a
    grounded plane has the images b, and -(1 - b^2) b^(n-1) at depth h + 2 n d, n = 1, 2, ..., b = (1 - e)/(1
    + e) (W. R. Smythe, Static and Dynamic Electricity, 1968, chapter 4, by matching D and potential at the
    slab). Their strengths follow from the potential on the cylinder; the force is that of all images on all
    charges.
    """
    slab = slab or paper_display(0.0).insulator
    plane = slab.thickness / slab.eps_r  # electrode this far below the surface, without a slab
    centre = radius + gap
    focus = np.sqrt((centre + plane) ** 2 - radius**2)
    angle = np.arccosh((centre + plane) / radius)
    surface = _apollonian(focus, angle, 4 * CHARGES) - 1j * plane
    charges = _apollonian(focus, 2.0 * angle, CHARGES) - 1j * plane
    depth, strength = _images(slab)
    images = charges.conj()[:, None] - 1j * depth  # of each charge
    potential = np.log(np.abs(surface[:, None] - charges))
    potential += np.sum(strength * np.log(np.abs(surface[:, None, None] - images)), axis=-1)
    scale = -voltage * 2.0 * np.pi * eps_0
    charge = np.linalg.lstsq(potential, np.full(surface.size, scale), rcond=1e-14)[0]
    field = np.sum(strength / (charges[:, None, None] - images), axis=-1) @ charge  # (E_x - i E_y) 2 pi eps_0
    return float(np.sum(charge * field.imag) / (2.0 * np.pi * eps_0))


def _apollonian(focus: float, level: float, points: int) -> Any:
    """Points (complex) on the circle around i `focus` on which the bipolar coordinate is `level`."""
    sigma = 2.0 * np.pi * (np.arange(points) + 0.5) / points
    return 1j * focus * (1.0 + np.exp(-level + 1j * sigma)) / (1.0 - np.exp(-level + 1j * sigma))


def _images(slab: Layer) -> tuple[Any, Any]:
    b = (1.0 - slab.eps_r) / (1.0 + slab.eps_r)
    n = np.arange(1, IMAGES)
    strength = -(1.0 - b**2) * np.asarray(b, dtype=float) ** (n - 1)
    return 2.0 * slab.thickness * np.arange(IMAGES), np.concatenate([[b], strength])


def _draw(gaps: Any, exact: Any, by_law: dict[str, Any], forces: dict[Any, Any]) -> Figure:
    figure, axes = panels(3.6, 3)
    axes[0].plot(gaps, 1e3 * exact, "k.", markersize=4, label="electrostatics")
    for law, y in by_law.items():
        law_line(axes[0], law, gaps, 1e3 * y, label=LABELS[law])
    axes[0].set(xscale="log", yscale="log", xlabel="gap (mm)", ylabel="cylinder: force (mN/mm)")
    axes[0].legend(fontsize="small")
    axes[1].axhline(1.0, color=COLOURS["measured"], linewidth=1.2)
    for place, case in enumerate(CASES):
        for law, shift in (("strong_troxel", -0.18), ("kaczmarek", 0.18)):
            draw_box(axes[1], place + shift, forces[law, case] / participants()[case], 0.28, COLOURS[law])
    axes[1].set_xticks(range(len(CASES)), list(CASES))
    axes[1].set(ylabel="computed / measured force", ylim=(0, None), xlim=(-0.5, 2.5))
    near = np.concatenate([[1e-4], np.geomspace(1e-3, 0.5, 120)])
    for law, force_law in LAWS.items():
        law_line(axes[2], law, near, 1e3 * force_law.traction(near, VOLTAGE, table2_layers()))
        touching = 1e3 * force_law.traction(0.0, VOLTAGE, table2_layers())
        note(axes[2], f"{touching:.3g} kPa", (1.2e-3, 0.55 * touching), (0, -12))
    axes[2].set(xscale="log", yscale="log", xlabel="gap (mm)", xlim=(1e-3, 0.5))
    axes[2].set_ylabel("pressure at 2000 V (kPa)")
    return figure
