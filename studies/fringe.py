"""What the column law misses: fringes below ridges, spreading inside the skin, whole fingers.

Ridges. The force of one ridge, t^7 as the finger's and a sinusoid of the same pitch, over the paper's film
and over a touchscreen, column by column and by the full field, for gaps from 1 mm to contact. Expected: 4 to
12 % too small over the film for the finger's ridges, most in contact; over the touchscreen, whose field stays
in narrow gaps, nothing in contact. The bands are the bounds of the energy, which cost no solution.

Skin. On a touchscreen half of the voltage falls across the stratum corneum, 0.38 mm thick, wider than a
ridge: the field spreads in it from the contact on. Grooves of 0.1 mm, 30 % of the surface in contact, smooth
and with gaps of 1 and 5 um between rough faces; the layer follows the grooves, or fills the ridges and ends
flat. Expected: far more than the columns' pull where the faces are smooth, a few per cent where they are
rough.

Fingers. The hovering finger of Table 1 and the pressed one of Fig. 11, with and without ridges. Expected: the
ridged finger gains more than the smooth one, so the share of its ridges rises, and so does the share of the
attraction that acts through the air beside the contact.

Participants. The closed force (8a) of the eleven hovering fingers, times what the full field below their
rigid, ridged cross-section has over the column law below the smooth one, beside the measured forces.
Expected: next to nothing at 0.25 and 0.5 mm, where ridges weaken the pull and their fringes give part of it
back, so the factor of two between (8a) and the measurement remains. For fingers held at 30 degrees, as they
were (`tilted`), the columns below the whole ellipsoid are multiplied by the gains of two plane sections, the
ridged one across and the smooth, tilted one along the finger; a field in space is not solved. Expected: the
section along gives 2 to 5 % more (four times the points: 3 to 6).

Electrodes. A smooth rigid finger hovers over the edge of an electrode, and over stripes of either sign with
gaps of a tenth of their pitch. Expected: half of the pull at the edge, and a force back to the electrode;
over stripes as much for a grounded as for a floating finger, less for finer ones.
"""

from collections import OrderedDict
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

import evfem as ev
from evfem.field.columns import Columns
from evfem.field.outlines import graded
from evfem.field.rigid import rigid_field
from evfem.simulation.model import Model, make_model

from .common import CASES, Series, Study, participants
from .hovering_people import POSTURE, participant_forces, tilted_forces
from .plots import COLOURS, Figure, panels

PITCH, HEIGHT = 0.5, 0.15
INSULATORS = {"film": ev.FILM, "touchscreen": ev.TOUCHSCREEN}
SKIN = ev.Layer(0.38, 1650.0)
GAPS = (1.0, 0.5, 0.25, 0.1, 0.05, 0.02, 0.01, 0.001, 0.0)
#: grooves between ridges for the spreading in the skin: depth (mm), slope of their walls, share in contact
GROOVE, WALL, CONTACT = 0.1, 5.0, 0.3
ROUGH = {"smooth": 0.0, "1um": 1e-3, "5um": 5e-3}
LOAD = 0.05
ASSUMPTIONS = {
    "ridges": "conducting, rigid, endless; the law is Strong and Troxel's, the columns' exact limit",
    "skin": "a layer of constant thickness over living tissue at ground, walls of slope 5; filled: a layer "
    "that ends flat, thicker by the depth of the grooves between them",
    "participants": "rigid; cross-section held horizontally, the ridges of Table 2 on every finger",
    "tilted": "columns below ellipsoids turned by 30 degrees, times the full field over the columns of the "
    "ridged cross-section, times that of the smooth tilted section along the finger",
    "air share": "of the nodes that do not touch, in the total attraction; Strong and Troxel's law, whose "
    "share is smaller than that of Kaczmarek's in Fig. 11",
    "fingers": "plane strain, Strong and Troxel's law, direction normal, deformable, flanks by the law",
}


def ridge(shape: str, number: int) -> tuple[Any, Any]:
    """One period (N,), (N,) of a ridge, its crest in the middle."""
    x = np.linspace(0.0, PITCH, number)
    t = np.abs(2.0 * x / PITCH - 1.0)
    return x, HEIGHT * (t**7 if shape == "t7" else 0.5 * (1.0 - np.cos(np.pi * t)))


def ridge_error(shape: str, insulator: str, gap: float, number: int) -> dict[str, float]:
    """Force of a ridge at 1 V (N/mm), what the column law lacks of it and the bounds of its energy."""
    x, height = ridge(shape, number)
    slab = INSULATORS[insulator]
    full = rigid_field(x, gap + height, slab=slab)
    layers = ev.Layers.of(slab)
    _, fine = ridge(shape, 20001)
    columns = PITCH * np.mean(ev.StrongTroxel().traction(gap + fine, 1.0, layers)[1:])
    low, high = (100.0 * (bound / full.capacitance - 1.0) for bound in full.bounds)
    error = 100.0 * (columns / full.force - 1.0)
    return {"force_N_per_mm": full.force, "columns_percent": error, "low_percent": low, "high_percent": high}


def spreading(rough: float, filled: bool = False) -> float:
    """Pull of the full field over that of the columns, skin with grooves on a touchscreen; the layer
    follows the grooves, or, `filled`, is that much thicker between them and ends flat.
    """
    half = 0.5 * CONTACT * PITCH
    end, smallest = half + GROOVE / WALL, 1e-5
    pieces = ((0.0, half, np.inf, smallest), (half, end, smallest, np.inf), (end, PITCH / 2.0, 2e-3, np.inf))
    x = np.unique(np.concatenate([graded(a, b, (p, q), 0.3, 0.01, 4) for a, b, p, q in pieces]))
    insulator = ev.TOUCHSCREEN
    reduced = insulator.thickness / insulator.eps_r
    gap = np.interp(x, [half, end], [0.0, GROOVE]) + max(rough, 1e-4 * reduced)
    rows = np.linspace(0.0, 1.0, 5)
    skin = np.append(0.0, np.geomspace(1e-3, 1.0, 12))
    columns = Columns((insulator.eps_r, 1.0, SKIN.eps_r), (rows, rows, skin))
    level = 0.0 * x
    skin_thickness = SKIN.thickness + (gap.max() - gap if filled else level)
    found = columns.solve(x, np.stack([level - insulator.thickness, level, gap, gap + skin_thickness]))
    pull = -0.5 * float(found.by_level[2:].sum())
    distance = gap + reduced + skin_thickness / SKIN.eps_r
    return pull / (0.5 * ev.eps_0 * float(np.sum(np.diff(x) / (distance[1:] * distance[:-1]))))


def finger_scenes(quick: bool) -> dict[str, ev.Scene]:
    """The fingers of Table 1's cases and Fig. 11's load, with and without ridges."""
    scenes = {}
    for ridges in (True, False):
        finger = ev.FingerPad(resolution="coarse" if quick else "medium", ridges=ridges)
        name = "ridged" if ridges else "smooth"
        for case, (voltage, gap) in CASES.items():
            scenes[f"{name}.{case}"] = _scene(finger, voltage, ev.Hover(gap=gap))
        scenes[f"{name}.pressed"] = _scene(finger, 1000.0, ev.Press(force=LOAD, steps=3 if quick else 8))
    return scenes


def _scene(finger: ev.FingerPad, voltage: float, motion: Any) -> ev.Scene:
    display = ev.Display(friction=0.0)
    return ev.Scene(finger, display, ev.StrongTroxel(), voltage, [motion], direction="normal", field="full")


def main(quick: bool = False) -> Study:
    """Errors of the column law in numbers and a figure."""
    gaps = GAPS[2::3] if quick else GAPS
    numbers, series = {}, []
    for insulator in INSULATORS:
        for shape in ("t7", "sinus"):
            found = [ridge_error(shape, insulator, gap, 101 if quick else 401) for gap in gaps]
            for gap, one in zip(gaps, found, strict=True):
                numbers |= {f"ridge.{shape}.{insulator}.{gap:g}mm.{key}": value for key, value in one.items()}
            for key in ("columns_percent", "low_percent", "high_percent"):
                name = f"{shape} {insulator} {key.removesuffix('_percent')}"
                series.append(Series(name, gaps, [one[key] for one in found], "% over mm"))
    numbers |= {f"spreading.{name}": spreading(rough) for name, rough in ROUGH.items()}
    numbers |= {f"spreading.filled.{name}": spreading(rough, True) for name, rough in ROUGH.items()}
    numbers |= finger_numbers(quick) | participant_numbers(quick)
    on_electrodes, over_edge = electrode_numbers(quick)
    numbers, series = numbers | on_electrodes, series + over_edge
    parameters = {"pitch_mm": PITCH, "height_mm": HEIGHT, "load_N_per_mm": LOAD}
    return Study("fringe", numbers, {}, ASSUMPTIONS, series, lambda: _draw(series, numbers), parameters)


def finger_numbers(quick: bool) -> dict[str, float]:
    """Forces of whole fingers in mN/mm, column by column and by the full field, and their ratios; of
    the pressed ones the share that acts on open nodes.
    """
    numbers: dict[str, float] = {}
    for name, scene in finger_scenes(quick).items():
        force = {}
        for kind in ("local", "full"):
            one = replace(scene, field=kind)
            result = ev.simulate(one)
            force[kind] = 1e3 * float(result.electrostatic_force[-1])
            if name.endswith("pressed"):
                numbers[f"finger.{name}.{kind}_air_share"] = air_share(one, result)
        numbers |= {f"finger.{name}.{kind}_mN_per_mm": value for kind, value in force.items()}
        numbers[f"finger.{name}.full_over_local"] = force["full"] / force["local"]
    return numbers


def air_share(scene: ev.Scene, result: ev.Result) -> float:
    """Share of the attraction in a run's last state that acts on nodes that do not touch."""
    model, frame = make_model(scene), result.frames[-1]
    pad = model.pad.nodes
    position = model.mesh.points[pad] + frame.displacement[pad]
    touching = frame.contact_status[pad] > 0
    assert model.attraction is not None
    attraction = model.attraction
    pull = attraction.forces(attraction.state(position, float(result.voltage[-1]), touching))[:, 1]
    return float(pull[~touching].sum() / pull.sum())


def participant_numbers(quick: bool) -> dict[str, float]:
    """Medians in mN of the measured forces, of (8a) and of (8a) with ridges and full field."""
    table, closed, tilted = participants(), participant_forces(), tilted_forces()
    names = table["participant"][: 1 if quick else None]
    numbers = {}
    for case, (_, gap) in CASES.items():
        measured = table[case][: len(names)]
        law = closed["strong_troxel", case][: len(names)]
        gain = np.array([full_over_columns(str(name), gap) for name in names])
        numbers |= {
            f"participants.{key}_median_mN.{case}": float(np.median(values))
            for key, values in (("measured", measured), ("law", law), ("full", law * gain))
        }
        numbers[f"participants.gain_median.{case}"] = float(np.median(gain))
        numbers[f"participants.full_over_measured.{case}"] = float(np.median(law * gain / measured))
        sizes = zip(table["b"][: len(names)], table["c"][: len(names)], strict=True)
        sections = np.array([along_over_columns(height, length, gap) for height, length in sizes])
        held = tilted["strong_troxel", case][: len(names)]
        full = held * gain * sections
        numbers |= {
            f"participants.tilted_law_median_mN.{case}": float(np.median(held)),
            f"participants.tilted_full_median_mN.{case}": float(np.median(full)),
            f"participants.tilted_along_gain_median.{case}": float(np.median(sections)),
            f"participants.tilted_full_over_measured.{case}": float(np.median(full / measured)),
            f"participants.tilted_full_median_over_measured.{case}": float(
                np.median(full) / np.median(measured)
            ),
        }
    return numbers


@cache
def along_over_columns(height: float, length: float, gap: float, points: int = 101) -> float:
    """Pull of the full field below the tilted section along a smooth finger over that of the columns."""
    tilt, semi = np.radians(POSTURE), np.array([height, length]) / 2.0
    up, along = np.array([np.cos(tilt), np.sin(tilt)]), np.array([-np.sin(tilt), np.cos(tilt)])
    first = np.arctan2(up[0] * semi[0], -up[1] * semi[1])  # a silhouette: the tangent there is vertical

    def section(count: int) -> tuple[Any, Any]:
        turn = np.linspace(first, first + np.pi, count)
        place = semi * np.column_stack([np.cos(turn), np.sin(turn)])
        order = np.argsort(place @ along)
        return (place @ along)[order], (place @ up)[order] + float(np.hypot(*(semi * up))) + gap

    slab = INSULATORS["film"]
    x, rise = section(20001)
    columns = np.trapezoid(ev.StrongTroxel().traction(rise, 1.0, ev.Layers.of(slab)), x)
    return float(rigid_field(*section(points), slab=slab, periodic=False).force / columns)


@cache
def full_over_columns(participant: str, gap: float) -> float:
    """Pull of the full field below the ridged finger over that of the column law below the smooth one."""
    pull = {}
    for ridges in (True, False):
        finger = replace(ev.FingerPad.participant(participant, resolution="coarse"), ridges=ridges)
        model, position = rigid_pad(finger, gap)
        attraction = model.attraction
        forces = attraction.forces if ridges else attraction.column_law.forces
        pull[ridges] = forces(attraction.state(position, 1.0))[:, 1].sum()
    return float(pull[True] / pull[False])


def rigid_pad(finger: ev.FingerPad, gap: float) -> tuple[Model, Any]:
    """A finger under the full field, and its undeformed pad (P, 2) at `gap` mm above the display."""
    model = make_model(_scene(finger, 1000.0, ev.Hover(gap=gap)))
    return model, model.mesh.points[model.pad.nodes] + model.bone(0.0, -gap)


def electrode_numbers(quick: bool) -> tuple[dict[str, float], list[Series]]:
    """A hovering outline over an electrode's edge and over stripes, relative to one without end."""
    finger = ev.FingerPad(ridges=False, resolution="coarse" if quick else "medium")
    model, points = rigid_pad(finger, 0.1)

    def force(rows: Any, floating: bool = False) -> Any:
        surface = replace(model.surface, electrodes=rows)
        own = {"surface": surface, "floating": floating, "solved": OrderedDict()}
        attraction = replace(model.attraction, **own)
        return attraction.forces(attraction.state(points, 1000.0)).sum(axis=0)

    whole = -force(None)[1]
    places = np.linspace(-6.0, 6.0, 7 if quick else 25)
    over = np.array([force([[-30.0, place, 1.0]]) for place in places]) / whole
    numbers = {"edge.normal_in_the_middle_over_whole": float(np.interp(0.0, places, -over[:, 1]))}
    numbers["edge.largest_x_over_whole"] = float(np.abs(over[:, 0]).max())
    for pitch in (4.0, 1.0):
        ends = np.arange(-12.0, 12.0, pitch)
        rows = [[a + 0.05 * pitch, a + 0.95 * pitch, (-1.0) ** k] for k, a in enumerate(ends)]
        for floating in (False, True):
            name = f"stripes.{pitch:g}mm.{'floating' if floating else 'grounded'}_over_whole"
            numbers[name] = float(-force(rows, floating)[1] / whole)
    ways = {"normal": -over[:, 1], "x": over[:, 0]}
    return numbers, [Series(f"edge {name}", places, y, "1 over mm") for name, y in ways.items()]


def _draw(series: list[Series], numbers: dict[str, float]) -> Figure:
    figure, axes = panels(3.6, 5, 12.0, width_ratios=(1.0, 1.0, 1.2, 1.0, 1.0))
    _draw_errors(axes[:2], series)
    _draw_gains(axes[2], numbers)
    ways = (("towards the display", "kaczmarek"), ("along x", "strong_troxel"))
    for one, (label, colour) in zip(series[-2:], ways, strict=True):
        axes[3].plot(one.x, one.y, color=COLOURS[colour], label=label)
    axes[3].set(xlabel="electrode's edge (mm)", ylabel="pull over that without edge")
    axes[3].set_ylim(top=1.3)
    axes[3].legend(fontsize=7, loc="upper left")
    kinds = (
        ("measured", "measured", "measured"),
        ("law", "(8a)", "strong_troxel"),
        ("full", "full field", "fe"),
    )
    for k, (key, label, colour) in enumerate(kinds):
        heights = [numbers[f"participants.{key}_median_mN.{case}"] for case in CASES]
        places = np.arange(len(CASES)) + 0.27 * (k - 1)
        axes[4].bar(places, heights, 0.25, color=COLOURS[colour], label=label)
    axes[4].set_xticks(range(len(CASES)), list(CASES))
    axes[4].set_ylabel("participants' median (mN)")
    axes[4].margins(y=0.4)
    axes[4].legend(fontsize=7, loc="upper right")
    return figure


def _draw_errors(axes: Any, series: list[Series]) -> None:
    """The column law's errors over the gap, for each insulator."""
    from matplotlib.patches import Patch

    shapes = (("t7", "kaczmarek", "finger's ridges"), ("sinus", "strong_troxel", "sinusoid"))
    for axis, insulator in zip(axes, INSULATORS, strict=True):
        for shape, name, label in shapes:
            colour = COLOURS[name]
            own = {s.name.split()[-1]: s for s in series if s.name.startswith(f"{shape} {insulator} ")}
            x = np.maximum(own["columns"].x, 3e-4)
            axis.semilogx(x, own["columns"].y, "o-", color=colour, markersize=3, label=label)
            axis.fill_between(x, own["low"].y, own["high"].y, color=colour, alpha=0.15, linewidth=0)
        axis.axhline(0.0, color="0.6", linewidth=0.8)
        axis.set_xlabel("gap (mm), leftmost 0")
        axis.set_title(insulator, fontsize=9)
    axes[0].set_ylabel("column law's error (%)")
    axes[0].legend(fontsize=7)
    axes[1].legend(handles=[Patch(color="0.85", label="bounds of the energy")], fontsize=7, loc="upper left")


def _draw_gains(axis: Any, numbers: dict[str, float]) -> None:
    """What the full field adds to the pull of fingers and of skin."""
    keys = [key for key in numbers if key.startswith("finger.") and key.endswith("full_over_local")]
    bars = [100.0 * (numbers[key] - 1.0) for key in keys]
    labels = [" ".join(key.split(".")[1:3]) for key in keys]
    colours = [COLOURS["kaczmarek"]] * len(keys)
    for kind, skin, name in (("", "grooved", "fe"), ("filled.", "filled", "strong_troxel")):
        labels += [f"{skin} skin, {1e3 * gap:g} um gap" for gap in ROUGH.values()]
        bars += [100.0 * (numbers[f"spreading.{kind}{rough}"] - 1.0) for rough in ROUGH]
        colours += [COLOURS[name]] * len(ROUGH)
    axis.barh(labels, bars, color=colours)
    axis.invert_yaxis()
    axis.tick_params(axis="y", labelsize=7)
    axis.set_xlabel("full field, more pull (%)")
