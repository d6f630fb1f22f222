"""The whole finger pad in newtons: depth and contact areas over the load beside Adams' power laws, what could
explain their difference, hovering pads of eleven participants, and where plane strain stands.

Press. Table 2's pad, smooth and with ridges along the finger, is pressed without friction; areas are read off
the footprint. Found: the pad touches 0.3 to 0.6 of Adams' gross area and, from 0.1 to 0.5 N, 0.5 to 0.65 of
his ridge area; ridge over gross area is 0.5 to 0.6, where his rises from 0.36 to 0.59. It takes twelve cells
across a ridge to see that: six leave the next node beside the crest, or the one after it, and with them 0.46
at every load. Single changes of the pad at 0.5 N say what the difference takes: its axes, its moduli, how it
is held, friction, the ridges' crests. None does it alone; half the moduli go farthest.

Hover. Rigid pads of Table 1's sizes, both laws, three cases, untilted with a shortened axis as in the paper,
and (`held`) whole and held at 30 degrees as they were. Expected: the smooth untilted ones a few per cent
below (24), which is not an ellipsoid; ridges take another 2 to 3 % away; neither brings Strong and Troxel's
law near the measured forces, the posture does: .9 to 1.3 of the medians, where Kaczmarek's falls to .6 to .7.

Plane strain. The width over which a cross-section has the force of the whole pad at the same depth. Expected:
it grows with the load from 5 to 8 mm, so that no single width joins the two.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

import evfem as ev
from evfem.common.arrays import Floats
from evfem.finger.solid import Ellipsoid, Grid
from evfem.planning.core import Closing
from evfem.simulation.model import make_attraction, placed
from evfem.surface.skin import Skin, make_skin

from .common import CASES, LAWS, Series, Study, area_law, by_participant, participants, tissue
from .fingertip_panels import draw
from .hovering_people import POSTURE, participant_forces, tilted_forces

LOADS, QUICK_LOADS = (0.05, 0.1, 0.25, 0.5, 1.0), (0.1, 0.5)
#: where pads and meshes are compared (N), and the way of ridged ones there: what may touch within a
#: step is a candidate, so that a long one costs more than three
LOAD = 0.5
WAY = (0.1, 0.25, LOAD)
ASSUMPTIONS = {
    "pad": "Table 2's axes and moduli; 22.5 mm long (26 mm seen at 30 degrees); the bone's axes are assumed",
    "areas": "gross: convex hull of what touches; its uncertainty, under `error`, is by how much that "
    "differs from the hull of the touching nodes; ridge (and smooth pads): all that touches",
    "press": "no friction, no voltage, rim held by the nail; one variant has friction 0.3",
    "held": "medium mesh, 1.7 % above the columns below the ellipsoid at .25 mm; a coarse one 7 %, as "
    "the lowest point lies where its cells are large",
    "hover": "rigid, local thickness of the stratum corneum; fingers of Table 1 as Fingertip.participant",
    "ridges": "twelve cells across each; the error of the mesh is that of six",
    "variants": "one change each of the coarse smooth pad; crests of the ridged one",
}


#: what is changed of the coarse smooth pad, one thing each
VARIANTS: dict[str, dict[str, Any]] = {
    "width x 1.15": {"width": 1.15 * 16.68},
    "height x 1.15": {"height": 1.15 * 12.79},
    "length x 1.15": {"length": 1.15 * 22.5},
    "bone x 0.7": {"bone_width": 4.2, "bone_height": 3.5, "bone_length": 11.9},
    "free rim": {"rim": "free"},
    "held at 30 degrees": {"posture": 30.0},
    "all moduli x 0.5": {"materials": tissue(0.5)},
    "hypodermis x 0.5": {"materials": tissue(hypodermis=0.5 * 0.034)},
    "stratum corneum x 0.3": {"materials": tissue(stratum_corneum=0.3)},
    "friction 0.3": {},
}
#: rigid hovering pads; whole ones that are held as they were have their own length
HOVERED: dict[str, dict[str, Any]] = {
    "smooth": {"ridges": "none", "resolution": "coarse"},
    "ridged": {"ridges": "along", "resolution": "coarse"},
    # rigid: the dermis, which in the longest does not fit, adds nothing
    "held": {"ridges": "none", "resolution": "medium", "posture": POSTURE, "dermis_thickness": 0.6},
}
#: crests of the ridged pad: a flat share, and the exponent of the walls
CRESTS: dict[str, dict[str, Any]] = {
    "flat crests 0.4": {"ridge_crest": 0.4},
    "exponent 4": {"ridge_exponent": 4},
}


def tip(resolution: str = "coarse", ridges: str = "none", **own: Any) -> ev.Fingertip:
    """A pad that differs from Table 2's by `own`."""
    return ev.Fingertip(resolution=resolution, ridges=ridges, **own)


class Resolved(ev.Fingertip):
    """A pad with twice its resolution's columns across: twelve cells a pitch tell how much touches."""

    def _grid(self, outer: Ellipsoid) -> Grid:
        grid = super()._grid(outer)
        across, along = grid.columns
        return replace(grid, columns=(2 * across, along))


def ridged(**own: Any) -> Resolved:
    """Such a pad with ridges along the finger that differs from Table 2's by `own`."""
    return Resolved(resolution="coarse", ridges="along", **own)


def press(finger: Any, loads: Sequence[float], friction: float = 0.0, steps: int = 1) -> ev.Result:
    """Pressed to the loads (N), each in so many steps."""
    motion = [ev.Press(force=load, steps=steps) for load in loads]
    return ev.simulate(ev.Scene(finger, ev.Flat(friction=friction), motion=motion))


def gross_area(result: ev.Result, frame: int) -> tuple[float, float]:
    """Gross contact area (mm2), and by how much it differs from the hull of the touching nodes."""
    from scipy.spatial import ConvexHull

    skin, shown = make_skin(result.mesh), result.frames[frame]
    position = (result.mesh.points + shown.displacement)[skin.nodes]
    inner = float(ConvexHull(position[shown.contact_status[skin.nodes] > 0][:, ::2]).volume)
    gross = float(result.contact_area[frame])
    return gross, abs(gross - inner)


def pressed(name: str, result: ev.Result, loads: Sequence[float]) -> dict[str, list[float]]:
    """Depth (mm), gross and real area (mm2) and the gross area's uncertainty at the loads."""
    rows = [int(np.argmin(np.abs(result.applied_force - load))) for load in loads]
    gross = [gross_area(result, row) for row in rows]
    smooth = name.startswith("smooth")
    return {
        "depth_mm": result.indentation[rows].tolist(),
        "gross_mm2": result.real_contact_area[rows].tolist() if smooth else [g for g, _ in gross],
        "real_mm2": result.real_contact_area[rows].tolist(),
        "uncertain_mm2": [u for _, u in gross],
    }


def effective_width(depth: Sequence[float], loads: Sequence[float], ridges: bool) -> Floats:
    """Loads (N) over what the cross-section bears at the same depths (N/mm), in mm."""
    pad = ev.FingerPad(resolution="coarse", ridges=ridges)
    motion = [ev.Press(indentation=one, steps=2) for one in depth]
    result = ev.simulate(ev.Scene(pad, ev.Flat(friction=0.0), motion=motion))
    return np.asarray(loads) / result.applied_force[1::2]


def variants(quick: bool) -> dict[str, dict[str, float]]:
    """Depth and areas at `LOAD` of pads with one change each, relative to the one without."""
    loads = (0.25, LOAD)
    chosen = dict(list(VARIANTS.items())[6:7]) if quick else VARIANTS
    found = {"smooth": press(tip(), loads)}
    for name, own in chosen.items():
        friction = 0.3 if name.startswith("friction") else 0.0
        found[name] = press(tip(**own), loads, friction, steps=3 if friction else 1)
    unchanged = found["smooth"].real_contact_area[-1]
    ends = {name: (one.indentation[-1], one.real_contact_area[-1]) for name, one in found.items()}
    return {
        name: {"depth_mm": depth, "area_mm2": area, "area_over_unchanged": area / unchanged}
        for name, (depth, area) in ends.items()
    }


def hovering(quick: bool) -> dict[tuple[str, str, str], Floats]:
    """(kind of pad, law, case) -> force in mN of every participant's rigid pad."""
    names = participants()["participant"][: 3 if quick else None]
    found: dict[tuple[str, str, str], list[float]] = {}
    for kind, own in HOVERED.items():
        for number, name in enumerate(names):
            if "posture" in own:
                own = own | {"length": float(participants()["c"][number])}
            finger = ev.Fingertip.participant(name, **own)
            mesh = finger.mesh()
            skin = make_skin(mesh)
            for law in LAWS:
                for case, (voltage, gap) in CASES.items():
                    force = force_on(finger, mesh, skin, LAWS[law], voltage, gap)
                    found.setdefault((kind, law, case), []).append(force)
    return {key: np.array(values) for key, values in found.items()}


def force_on(finger: Any, mesh: Any, skin: Skin, law: Any, voltage: float, gap: float) -> float:
    """Attraction (mN) of a rigid pad at a gap over the paper's display."""
    scene = ev.Scene(finger, ev.Display(friction=0.0), law, voltage, [ev.Hover(gap=gap)])
    points = mesh.points[skin.nodes]
    surface, _ = placed(scene.ground, points)
    attraction = make_attraction(Closing(scene, mesh), skin, surface)
    forces = attraction.forces(attraction.state(points + np.array([0.0, gap, 0.0]), voltage))
    return float(-1e3 * forces[:, 1].sum())


def main(quick: bool = False) -> Study:
    """Depth, areas, variants, hovering forces, widths and errors, in numbers and a figure."""
    loads = QUICK_LOADS if quick else LOADS
    pads = {"smooth": tip("coarse" if quick else "medium")} | ({} if quick else {"ridged": ridged()})
    runs = {name: press(finger, loads) for name, finger in pads.items()}
    table = {name: pressed(name, result, loads) for name, result in runs.items()}
    width = {name: effective_width(one["depth_mm"], loads, name == "ridged") for name, one in table.items()}
    changed, forces = variants(quick), hovering(quick)
    crests = {} if quick else {name: press(ridged(**own), WAY) for name, own in CRESTS.items()}
    numbers = press_numbers(table, loads) | variant_numbers(changed) | hover_numbers(forces)
    for name, one in crests.items():
        gross, _ = gross_area(one, -1)
        numbers |= {f"crest.{name}.gross_mm2": gross, f"crest.{name}.real_mm2": one.real_contact_area[-1]}
    for name, one in width.items():
        numbers |= {f"width_mm.{name}.{load:g}N": value for load, value in zip(loads, one, strict=True)}
    numbers |= errors(table, runs, quick)
    series = [
        Series(f"{name} {key}", loads, values, f"{key.split('_')[-1]} over N")
        for name, one in table.items()
        for key, values in one.items()
    ]
    series += [Series(f"width {name}", loads, values, "mm over N") for name, values in width.items()]
    series += [by_participant(" ".join(key), values) for key, values in forces.items()]
    parameters = {"loads_N": loads, "variants_at_N": LOAD, "resolution": pads["smooth"].resolution}
    picture = partial(draw, series, changed, forces)
    return Study("fingertip", numbers, {}, ASSUMPTIONS, series, picture, parameters)


def press_numbers(table: dict[str, dict[str, list[float]]], loads: Sequence[float]) -> dict[str, float]:
    """Depths and areas, and the areas over Adams'."""
    numbers: dict[str, float] = {}
    adams = {name: area_law(name) for name in ("gross", "ridge")}
    for name, one in table.items():
        for key, values in one.items():
            numbers |= {f"{name}.{key}.{load:g}N": value for load, value in zip(loads, values, strict=True)}
        for i, load in enumerate(loads):
            key = f"verdict.{name}.gross_over_adams.{load:g}N"
            numbers[key] = one["gross_mm2"][i] / float(adams["gross"](load))
            if name == "ridged":
                key = f"verdict.{name}.ridge_over_adams.{load:g}N"
                numbers[key] = one["real_mm2"][i] / float(adams["ridge"](load))
                ratio = one["real_mm2"][i] / one["gross_mm2"][i]
                numbers[f"verdict.{name}.ridge_over_gross.{load:g}N"] = ratio
                ratio = float(adams["ridge"](load) / adams["gross"](load))
                numbers[f"adams.ridge_over_gross.{load:g}N"] = ratio
    return numbers


def variant_numbers(changed: dict[str, dict[str, float]]) -> dict[str, float]:
    """Depth and area of every variant, and the area that Adams' law would want of it."""
    wanted = float(area_law("gross")(LOAD))
    numbers = {"variant.wanted_over_unchanged": wanted / changed["smooth"]["area_mm2"]}
    for name, one in changed.items():
        numbers |= {f"variant.{name}.{key}": value for key, value in one.items()}
    return numbers


def hover_numbers(forces: dict[tuple[str, str, str], Floats]) -> dict[str, float]:
    """Forces of all participants, their medians over those measured, and over the closed form (24)."""
    names = participants()["participant"]
    numbers: dict[str, float] = {}
    for (kind, law, case), values in forces.items():
        key, count = f"{kind}.{law}", len(values)
        closed = tilted_forces() if kind == "held" else participant_forces()
        numbers |= {f"{key}.{name}.{case}_mN": v for name, v in zip(names, values, strict=False)}
        numbers[f"{key}.median_mN.{case}"] = float(np.median(values))
        measured = float(np.median(participants()[case][:count]))
        numbers[f"verdict.{key}.median_over_measured.{case}"] = float(np.median(values)) / measured
        ratio = np.median(values / closed[law, case][:count])
        numbers[f"verdict.{key}.over_closed_form.{case}"] = float(ratio)
    return numbers


def errors(
    table: dict[str, dict[str, list[float]]], runs: dict[str, ev.Result], quick: bool
) -> dict[str, float]:
    """What mesh and steps change of depth and area at `LOAD`, in per cent of the finer one."""
    if quick:
        return {}
    found = {}
    coarse, wider = press(tip(), (0.25, LOAD)), press(tip(ridges="along"), WAY)
    at = LOADS.index(LOAD)
    ends = {
        "smooth.mesh": (coarse, table["smooth"], len(coarse.mesh.points), len(runs["smooth"].mesh.points)),
        "ridged.mesh": (wider, table["ridged"], len(wider.mesh.points), len(runs["ridged"].mesh.points)),
    }
    for name, (other, kept, *nodes) in ends.items():
        found |= {f"error.{name}.nodes_{way}": n for way, n in zip(("other", "kept"), nodes, strict=True)}
        pairs = {"depth": (other.indentation[-1], kept["depth_mm"][at])}
        pairs["area"] = (other.real_contact_area[-1], kept["real_mm2"][at])
        found |= {f"error.{name}.{key}_percent": 100.0 * (a / b - 1.0) for key, (a, b) in pairs.items()}
    few, many = (press(tip(), (0.25, LOAD), 0.3, steps).indentation[-1] for steps in (3, 6))
    return found | {"error.smooth.friction_steps.depth_percent": 100.0 * (few / many - 1.0)}
