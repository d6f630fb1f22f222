"""Fingertips that are pressed and slid: gross area, its change by slip and by a voltage, and the power of the
voltage in attraction and friction.
"""

from dataclasses import replace
from typing import Any

import numpy as np

import evfem as ev

from ..common import area_law, side_by_side, tissue
from .table import Experiment, Row, Sign, spread, together
from .touching import others

LOADS = (0.1, 0.2, 0.5, 1.0, 2.0)  # N
FLATTER = 3.0  # exponent of an outline that is flatter below than the ellipse
LOAD = 0.5  # where meshes are compared and fingers slide
MESHES = ("coarse", "between", "medium")
SOFTER = 0.9  # moduli of a pad whose area tells what 10 % of them do
#: a voltage over a touchscreen whose faces stay apart, in full slip
FRICTION, ROUGH, VOLTS = 0.8, 3e-3, (75.0, 150.0)


class Between(ev.Fingertip):
    """A coarse pad with columns between those of coarse and medium."""

    def _grid(self, outer: Any) -> Any:
        grid = super()._grid(outer)
        across, along = grid.columns
        return replace(grid, columns=(across + 2, along + 2))


def tip(mesh: str, **own: Any) -> ev.Fingertip:
    """A smooth pad of Table 2's sizes."""
    if mesh == "between":
        return Between(resolution="coarse", ridges="none", **own)
    return ev.Fingertip(resolution=mesh, ridges="none", **own)


def press(case: tuple[str, float, float, tuple[float, ...]]) -> list[float]:
    """Areas (mm2) that touch of a smooth pad: its mesh, outline, a factor on all moduli, the loads (N)."""
    mesh, outline, factor, loads = case
    finger = tip(mesh, materials=tissue(factor), outline=outline)
    motion = [ev.Press(force=load, steps=1) for load in loads]
    result = ev.simulate(ev.Scene(finger, ev.Flat(friction=0.0), motion=motion, output=ev.Output(every=100)))
    return [float(one) for one in result.real_contact_area]


def slide(case: tuple[str, float, bool]) -> dict[str, float]:
    """Areas at rest and in slip, attraction and friction of a pad that is pressed and slid until all slips,
    of a mesh, a voltage, and whether the tissue stiffens.
    """
    resolution, voltage, stiffens = case
    own = {"materials": ev.stiffening_skin()} if stiffens else {}
    finger = tip(resolution, **own)
    motion = [ev.Press(force=0.2, steps=1), ev.Press(force=LOAD, steps=1)]
    motion += [ev.Slide(distance=1.8, steps=3, hold="force")]
    more: dict[str, Any] = {"motion": motion, "output": ev.Output(every=100)}
    if voltage:
        more |= {"law": ev.StrongTroxel(), "voltage": voltage, "roughness_gap": ROUGH}
    result = ev.simulate(ev.Scene(finger, ev.Display(ev.TOUCHSCREEN, friction=FRICTION), **more))
    rest, slips = result.real_contact_area[[1, -1]]
    found = {"rest": rest, "slips": slips, "friction": result.tangential_force[-1]}
    return found | {"attraction": result.electrostatic_force[-1] if voltage else 0.0}


def areas(quick: bool) -> tuple[Experiment, list[float]]:
    """Gross areas beside Adams' of the ellipsoid and of a flatter pad, and those of the ellipsoid at `LOAD`
    by mesh.
    """
    loads = (0.2, LOAD) if quick else LOADS
    few = loads[loads.index(LOAD) - 1 : loads.index(LOAD) + 1]
    meshes, outlines = (MESHES[:1], (2.0,)) if quick else (MESHES, (2.0, FLATTER))
    cases = [(mesh, n, 1.0, loads if mesh == meshes[-1] else few) for n in outlines for mesh in meshes]
    cases.append(("coarse", 2.0, SOFTER, few))
    found = dict(zip(cases, side_by_side(press, cases, 1 if quick else 2), strict=True))
    softer = float(np.log(found[cases[-1]][-1] / found[cases[0]][few.index(LOAD)]))
    rows, at = [], {}
    for n in outlines:
        own = found[meshes[-1], n, 1.0, loads]
        at[n] = [*(found[mesh, n, 1.0, few][-1] for mesh in meshes[:-1]), own[loads.index(LOAD)]]
        rows += adams(n, loads, own, spread(at[n]), softer)
    return replace(ADAMS, rows=tuple(rows)), at[2.0]


def adams(n: float, loads: tuple[float, ...], own: list[float], by_mesh: float, softer: float) -> list[Row]:
    """Areas (mm2) of a pad with the outline n at the loads, and the power of the load."""
    law, error = area_law("gross"), together(by_mesh, softer)
    end, said = ("", "the ellipsoid") if n == 2.0 else ("_flatter", f"a pad with the outline {n:g}")
    rows = [
        Row(f"gross_area{end}.{load:g}N", f"gross area of {said}", "mm2", area, error, float(law(load)))
        for load, area in zip(loads, own, strict=True)
    ]
    index = float(np.polyfit(np.log(loads), np.log(own), 1)[0])
    what = f"power of the load in the gross area of {said}"
    return [*rows, Row(f"load_index{end}.gross", what, "1", index, by_mesh, law.m)]


def slips(quick: bool) -> list[Experiment]:
    """What slip and what a voltage do to the area, and the powers of the voltage."""
    meshes = MESHES[:1] if quick else MESHES
    cases = [(mesh, volt, False) for mesh in meshes for volt in (0.0, *VOLTS)]
    cases += [] if quick else [("coarse", 0.0, True)]
    found = dict(zip(cases, side_by_side(slide, cases, 1 if quick else 2), strict=True))
    off, on, more = ([found[mesh, volt, False] for mesh in meshes] for volt in (0.0, *VOLTS))
    by_slip = [change("area_in_slip", "area in full slip over that at rest", "falls", in_slip(off))]
    if not quick:
        what = "the same of `ev.stiffening_skin()`"
        by_slip.append(change("area_in_slip.stiffening", what, "falls", in_slip([found[cases[-1]]])))
    ratios = [a["slips"] / b["slips"] - 1.0 for a, b in zip(on, off, strict=True)]
    what = f"area in full slip at {VOLTS[0]:g} V over that without a voltage"
    under = change("area_under_voltage", what, "smaller", ratios)
    rows = tuple(powers(name, off, on, more) for name in ("attraction", "friction"))
    return [
        replace(DELHAYE, signs=tuple(by_slip)),
        replace(SIRIN, signs=(under,)),
        replace(IMAGING, rows=rows),
    ]


def in_slip(runs: list[dict[str, float]]) -> list[float]:
    """Relative change of the area from rest to full slip."""
    return [one["slips"] / one["rest"] - 1.0 for one in runs]


def powers(name: str, off: list[Any], on: list[Any], more: list[Any]) -> Row:
    """Power of the voltage in what it adds to attraction or friction, by mesh."""
    gains = [(b[name] - a[name], c[name] - a[name]) for a, b, c in zip(off, on, more, strict=True)]
    found = [float(np.log(b / a) / np.log(VOLTS[1] / VOLTS[0])) for a, b in gains]
    what, published = f"power of the voltage in the {name}", others(f"exponent_{name}")
    return Row(f"voltage_power.{name}", what, "1", found[-1], spread(found), law="strong_troxel", **published)


def change(name: str, what: str, measured: str, values: list[float]) -> Sign:
    """A relative change on the finest mesh, and by how much the meshes differ."""
    return Sign(name, what, float(values[-1]), float(np.ptp(values)), measured)


ADAMS = Experiment(
    title="Gross contact area",
    source="Adams et al. (2013), fits in the paper's Fig. 6",
    doi="10.1098/rsif.2012.0467",
    read="the abstract, and the fits that the paper prints",
    conditions="Fingers on glass; 107.6 mm2 at 1 N, growing with the load to the power 0.52.",
    assumed="Table 2's pad, smooth, untilted, pressed without friction; the error has the mesh and 10 % of "
    "all moduli. The flatter pad has the same axes and an outline with the exponent 3.",
    fitted="nothing in the rows of the ellipsoid. The exponent 3 was chosen with these areas in sight: its "
    "rows say what a shape does, and are no prediction.",
    reason="The ellipsoid touches half of the area and too little at small loads: a fingertip is flatter "
    "below than an ellipsoid of its axes. Shape, not stiffness, sets the power of the load.",
    sceptic="Nobody knows how Adams' fingers were held, nor whose they were.",
    answer="Held at 30 degrees this pad would touch less still, and the outline would hardly matter: these "
    "rows are of fingers that lie flat. Softer tissue hardly changes the power of the load.",
)
DELHAYE = Experiment(
    title="Area as a finger begins to slide",
    source="Delhaye, Lefèvre and Thonnard (2014)",
    doi="10.1098/rsif.2014.0698",
    read="the abstract",
    conditions="Glass, four directions, several loads and speeds; the area falls as the tangential force "
    "rises, which the authors put down to skin that stiffens.",
    assumed="0.5 N, friction 0.8, across the finger, smooth.",
    fitted="nothing in the first row; the second has an exponent and moduli chosen for this sign.",
    reason="Neo-Hookean tissue does not stiffen. Its area changes by less than the meshes differ (3.9 %): "
    "the sign is not resolved. The row that stiffens is of the coarse mesh alone.",
    sceptic="Then the material of the package is the wrong one for slip.",
    answer="It shows no fall, where fingers have one. The law can be chosen; which exponent a finger has is "
    "not known from a force.",
)
SIRIN = Experiment(
    title="Area under a voltage",
    source="Sirin et al. (2019)",
    doi="10.1098/rsif.2019.0166",
    read="what others say of it; the article was not opened",
    conditions="A robot slides the finger, a camera below; the voltage changes friction in full slip only, "
    "and the apparent area then is smaller than without.",
    assumed="75 V effective, film of 1 um / 3.9, faces 3 um apart, 0.5 N, friction 0.8.",
    fitted="nothing.",
    reason="An attraction presses the pad on and widens the contact, in slip as at rest; measured, the shear "
    "force that it adds takes area away.",
    sceptic="A wrong sign is a refutation.",
    answer="Of neo-Hookean tissue under a voltage, yes: meshes differ by less than the change. That friction "
    "at rest does not change needs a friction that slip renews, for which no number is read here.",
)
IMAGING = Experiment(
    title="Powers of the voltage",
    source="Data set of EuroHaptics 2026, 4TU.ResearchData",
    doi="10.4121/08aa3d2d-1761-4e67-a993-0eff1c870c37",
    read="the record of the data set",
    conditions="75 to 150 V, 30 to 230 Hz; real area, attraction and friction are quadratic in the voltage.",
    assumed="0.5 N, friction 0.8, faces 3 um apart whatever the pressure, 75 and 150 V.",
    fitted="nothing.",
    reason="The law is quadratic at a given gap; the attraction that closes gaps beside the contact adds "
    "little.",
    sceptic="That a quadratic law is quadratic is no prediction.",
    answer="The test is whether the pad's own deformation spoils the square: it changes the power by 0.03 "
    "only, less than meshes differ (0.05). The real area of rough faces is not predicted, for which a law of "
    "roughness would be needed.",
)
