"""Mistakes are found before the run, each with one sentence, and what is shipped stays silent."""

import json
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tools.builders import finger
from tools.meshes import block

import evfem as ev
from evfem.cli import main
from evfem.planning.parts import check_components
from evfem.planning.plan import plan, scene_mesh
from evfem.planning.plausibility import implausible, locking
from evfem.scene import file as scenefile
from evfem.scene.motion import Press
from evfem.scene.scene import Scene, default_scene
from evfem.simulation.run import simulate
from evfem.surface.surfaces import Flat, Profile, Sinusoid
from evfem.surface.textures import SelfAffine
from evfem.tissue.splitlaw import split

ROOT = Path(__file__).parents[2]
SKIN = ev.Electrical(stratum_corneum_thickness=0.38)
PRESS = ev.Press(indentation=0.2, steps=2)
HOVER, SLIDE = ev.Hover(gap=0.3), ev.Slide(distance=1.0, steps=2)


def scene(material=None, *motion, **more):
    """A block of one material on a display."""
    law = material or ev.NeoHookean(E=0.1, nu=0.4)
    finger = ev.MeshedFinger(block(sag=0.3), {"tissue": law}, SKIN)
    return ev.Scene(finger, ev.Display(), motion=motion or PRESS, **more)


def whole(*motion, **more):
    """A finger on a display."""
    return ev.Scene(ev.FingerPad(resolution="coarse", ridges=False), ev.Display(), motion=motion, **more)


@pytest.mark.parametrize("E", [60.0, 136.0])
def test_moduli_in_kilopascal_are_doubted(E):
    """60 kPa as 60 MPa, in a mesh and in a layer that is soft; a dry outermost one may be so hard."""
    law = ev.NeoHookean(E=E, nu=0.4)
    (said,) = plan(scene(law)).warnings
    assert said == (
        f"the shear modulus of tissue, {E / 2.8:.3g} MPa, is beyond that of any tissue: moduli are in MPa, "
        "not in Pa or kPa"
    )
    for layer, doubted in (("hypodermis", True), ("dermis", True), ("stratum_corneum", False)):
        pad = ev.FingerPad(resolution="coarse", ridges=False, materials={layer: law})
        found = plan(ev.Scene(pad, ev.Flat(), motion=PRESS)).warnings
        assert [f"of {layer}," in one for one in found] == [True] * doubted


def test_a_mesh_in_centimetres_is_doubted():
    mesh = ev.FingerPad(resolution="coarse", ridges=False).mesh(1)
    soft = dict.fromkeys(mesh.region_names, ev.NeoHookean(E=0.1, nu=0.4))
    for scale, doubted in ((0.1, True), (0.5, False)):
        small = replace(mesh, points=scale * mesh.points)
        asked = ev.Scene(ev.MeshedFinger(small, soft, SKIN), ev.Flat(), motion=PRESS)
        found = [one for one in plan(asked).warnings if "not in cm" in one]
        assert [one[:26] for one in found] == ["the mesh is 1.67 mm across"] * doubted


def test_an_insulator_in_micrometres_is_doubted():
    for thickness, doubted in ((1.0, True), (0.9, False)):
        display = ev.Display(insulator=ev.Layer(thickness, 3.35))
        found = plan(replace(scene(law=ev.Kaczmarek(), voltage=100.0), surface=display)).warnings
        assert [one[:24] for one in found] == ["an insulator of 1 mm is "] * doubted


def test_a_speed_in_metres_a_second_is_doubted():
    for speed, doubted in ((0.02, True), (0.2, True), (0.5, False)):
        found = plan(scene(None, PRESS, ev.Slide(distance=1.0, steps=2, speed=speed))).warnings
        assert [one[:18] for one in found] == ["motion 1 slides at"] * doubted


def test_a_profile_with_heights_in_micrometres_is_doubted():
    x = np.linspace(-10.0, 10.0, 401)
    for height, doubted in ((5.0, True), (5e-3, False)):
        surface = ev.Profile(x, height * np.sin(4.0 * np.pi * x), friction=0.3)
        found = plan(replace(scene(), surface=surface)).warnings
        assert len([one for one in found if "rms slope of 43" in one]) == doubted
    edges = np.arange(-10.0, 10.0, 0.5)[:, None] + [0.0, 0.02]
    walls = ev.Profile(edges.ravel(), np.tile([0.0, 0.3, 0.3, 0.0], 20))
    assert not [one for one in plan(replace(scene(), surface=walls)).warnings if "rms slope" in one]


@pytest.mark.parametrize(
    ("begin", "end", "way", "ends"),
    [
        (-6.0, 6.0, 3.0, ""),
        (0.0, 6.0, 3.0, "x = 0 mm below the finger, whose middle is over x = 0 to 3 mm"),
        (-6.0, 3.5, 3.0, "x = 3.5"),
        (-2.0, 6.0, -3.0, "x = -2"),
    ],
)
def test_a_profile_that_ends_below_the_finger_is_doubted(begin, end, way, ends):
    x = np.linspace(begin, end, 401)
    asked = scene(None, ev.Press(force=0.03), ev.Slide(distance=way, steps=3))
    for height, doubted in (
        (1e-3 * np.sin(9.0 * x), bool(ends)),
        (1e-3 * np.exp(-25.0 * (x - 1.5) ** 2), False),
    ):
        found = plan(replace(asked, surface=ev.Profile(x, height))).warnings
        said = [one for one in found if f"the profile ends at {ends}" in one]
        assert len(said) == doubted, found


def test_bone_in_a_mesh_of_softer_parts_is_taken():
    moduli = {"tissue": 0.04, "bone": 6.5e3}
    asked = scene()
    mesh, _ = scene_mesh(asked)
    assert implausible(asked, mesh, moduli) == ()
    assert "of bone, 6.5e+04 MPa" in implausible(asked, mesh, moduli | {"bone": 6.5e4})[0]


def test_a_field_that_breaks_solids_down_is_doubted():
    """U / (eps_r s): 1000 V across 0.09 mm are 11 V/um, across the same in m 1160 V/um."""
    charged = scene(law=ev.Kaczmarek(), voltage=1000.0)
    assert plan(charged).warnings == ()
    thin = replace(charged, surface=ev.Display(insulator=ev.Layer(0.09e-3, 3.35)))
    (said,) = plan(thin).warnings
    field = 1e-3 * 1000.0 / (0.09e-3 + 3.35 * 0.38 / 1650.0)
    assert f"1000 V make a field of {field:.3g} V/um in the insulator" in said
    edge = 300.0 / 1e-3 * 3.35 * (0.09 / 3.35 + 0.38 / 1650.0)
    assert plan(replace(charged, voltage=0.999 * edge)).warnings == ()
    assert "a field of 300 V/um in the insulator" in plan(replace(charged, voltage=1.001 * edge)).warnings[0]


PER_MM = "forces are in N/mm, a load in N over the depth in mm"


@pytest.mark.parametrize(
    ("press", "said"),
    [
        (ev.Press(indentation=6.0), "motion 0 presses 6 mm deep, but the bone is 4.9 mm above the skin"),
        (ev.Press(indentation=4.8), None),
        (
            ev.Press(force=50.0),
            f"motion 0 presses with 50 N/mm, 3 MPa over the whole finger: {PER_MM}",
        ),
        (
            ev.Press(force=5.0),
            f"motion 0 presses with 5 N/mm, 0.3 MPa over the whole finger: {PER_MM}",
        ),
        (ev.Press(force=3.0), None),
    ],
)
def test_a_press_that_no_finger_bears_is_doubted(press, said):
    """Table 2: the bone is 2.5 mm high in the middle of 12.79 mm, 1 mm above it; shear of the softest tissue
    0.0115 MPa.
    """
    found = plan(whole(press)).warnings
    assert found == (() if said is None else (said,))


def test_a_fingertip_is_doubted_like_a_pad():
    soft = {"hypodermis": ev.NeoHookean(E=34e3, nu=0.48)}
    tip = ev.Fingertip(ridges=False, resolution="coarse", materials=soft)
    said = plan(ev.Scene(tip, ev.Display(), motion=ev.Press(indentation=0.0015))).warnings
    assert [sentence.split(",")[0] for sentence in said if "not in" in sentence] == [
        "the shear modulus of hypodermis",
        "a finger of 16.68 mm is moved by 0.0015 mm at most: lengths are in mm",
    ]


def test_lengths_in_metres_are_doubted():
    skin = ev.Electrical(stratum_corneum_thickness=0.38e-3)
    finger = ev.MeshedFinger(block(sag=0.3), {"tissue": ev.NeoHookean(E=0.1, nu=0.4)}, skin)
    (said,) = plan(ev.Scene(finger, ev.Flat(), motion=PRESS)).warnings
    assert said == "a stratum corneum of 0.00038 mm is thinner than any: lengths are in mm, not in m"
    (said,) = plan(whole(ev.Press(indentation=1.5e-3), ev.Slide(distance=-5e-3))).warnings
    assert said == "a finger of 16.68 mm is moved by 0.005 mm at most: lengths are in mm, not in m"
    x = np.linspace(-0.01, 0.01, 50)
    scan = ev.Profile(x, 1e-6 * np.sin(3e3 * x))
    said = plan(ev.Scene(ev.FingerPad(resolution="coarse"), scan, motion=PRESS)).warnings
    assert "the profile is 0.02 mm long: lengths are in mm, not in m" in said
    assert plan(whole(ev.Press(force=0.05), ev.Slide(distance=0.05))).warnings == ()
    assert plan(whole(ev.Press(force=0.05))).warnings == ()


def test_branches_that_no_time_loads_are_doubted():
    finger = ev.FingerPad(resolution="coarse", ridges=False, relaxation=[(0.8, 0.04)])
    rest = ev.Scene(finger, ev.Flat(), motion=[PRESS, ev.Wait(1.0, steps=2)])
    assert plan(rest).warning.endswith("alone: here its branches do nothing")
    assert plan(replace(rest, motion=PRESS)).warnings == ()  # as for an impedance
    held = replace(rest, solver=ev.Solver(dynamics="viscous"))
    (relaxed,) = said_of(held)
    assert relaxed.startswith("motion 1 waits after motions without a speed, which end relaxed")
    assert not said_of(replace(held, motion=[ev.Press(indentation=0.1, speed=10.0), *rest.motion[1:]]))
    thick = replace(rest, finger=replace(finger, relaxation=(), viscosity=0.01))
    assert plan(thick).warning.endswith("alone: here its viscosity does nothing")


# -- slides that never touch -----------------------------------------------------------------------------


WEAK = {"law": ev.Kaczmarek(), "voltage": 100.0}
SLIDES = [
    ((SLIDE,), {}, "motion 0, a slide at first touch, never touches: press before it"),
    ((HOVER, SLIDE), {}, "motion 1, a slide 0.3 mm above first touch, never touches: press before it"),
    ((HOVER, SLIDE), WEAK, None),  # only a run knows how far it comes down
    ((PRESS, HOVER, SLIDE), {}, "motion 2, a slide 0.3 mm above first touch"),
    ((PRESS, ev.Press(indentation=-0.1), SLIDE), {}, "motion 2, a slide 0.1 mm above first touch"),
    ((SLIDE,), WEAK, None),  # pulled down where it touches
    ((PRESS, SLIDE), {}, None),
    ((ev.Press(force=0.01), SLIDE, SLIDE), {}, None),
    ((HOVER, SLIDE, PRESS), {}, None),  # on its way to where it presses
    ((PRESS, HOVER), {}, None),
]


@pytest.mark.parametrize(("motion", "more", "said"), SLIDES)
def test_a_slide_that_never_touches_is_doubted(motion, more, said):
    found = plan(scene(None, *motion, **more)).warnings
    assert [sentence[: len(said)] for sentence in found] == [said] if said else found == ()


def sentences(shipped):
    mesh, _ = scene_mesh(shipped)
    check_components(shipped, mesh.dim)
    moduli = {name: split(law, mesh.dim).shear_modulus for name, law in shipped.finger.materials.items()}
    return implausible(shipped, mesh, moduli)


def test_the_built_in_scene_and_those_of_the_pages_stay_silent():
    """What the pages compute in Python is computed by the tests of the pages, where a warning is an error."""
    scenes = [default_scene()]
    for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]:
        for text in re.findall(r"^```toml\n(.*?)^```$", page.read_text(encoding="utf-8"), re.M | re.S):
            if "\n[[motion]]" in text and "\nmesh = " not in text:
                scenes.append(scenefile.loads(text))
    assert len(scenes) >= 3
    said = [sentence for shipped in scenes for sentence in sentences(shipped)]
    assert {re.sub("at .* V touching skin.*", "attracted", sentence) for sentence in said} == {"attracted"}


@pytest.mark.parametrize(
    ("element", "nu", "said"), [("q2", 0.4999999, True), ("q2p1", 0.4999999, False), ("q2", 0.4999, False)]
)
def test_an_element_that_locks_in_incompressible_tissue_is_doubted(element, nu, said):
    found = [*locking(element, {"tissue": ev.NeoHookean(E=0.1, nu=nu)}, 2)]
    assert found == (["tissue is almost incompressible, and q2 cells lock: use q2p1 or q1_fbar"] * said)


@pytest.mark.parametrize(("insulator", "ratio"), [(ev.FILM, 17.345), (ev.TOUCHSCREEN, 782.9)])
def test_a_plan_tells_what_the_other_law_says(insulator, ratio):
    """In contact the two are D/s apart: 0.47 / (0.38/1650 + 0.09/3.35) or 0.381 / (0.38/1650 + 0.001/3.9)."""
    told = {}
    for law in (ev.StrongTroxel(), ev.Kaczmarek()):
        scene = ev.Scene(
            ev.FingerPad(resolution="coarse"), ev.Display(insulator), law, 100.0, [ev.Press(force=0.05)]
        )
        (reason,) = [term.reason for term in plan(scene).terms if term.name == "electrostatics"]
        own, name, other = re.search(
            r"at most (\S+) MPa on touching skin \((\w+): (\S+) MPa, see", reason
        ).groups()
        told[type(law).__name__] = float(own)
        told[f"other {name}"] = float(other)
        assert (Path(__file__).parents[2] / "docs/howto/which-law.md").exists()
    assert told["StrongTroxel"] / told["Kaczmarek"] == pytest.approx(ratio, rel=0.05)  # two digits
    assert told["other StrongTroxel"] == told["StrongTroxel"]
    assert told["other Kaczmarek"] == told["Kaczmarek"]


def test_an_attraction_beyond_the_load_is_told_by_plan_run_and_sweep(tmp_path, capsys):
    """Strong and Troxel's law on a touchscreen: eps_0 U^2 / (2 s^2) at 140 V is 0.37 MPa, and the load 0.05
    N/mm; Kaczmarek's law has a thousandth of it.
    """
    finger, press = ev.FingerPad(ridges=False, resolution="coarse"), [ev.Press(force=0.05, steps=2)]
    asked = ev.Scene(finger, ev.Display(ev.TOUCHSCREEN), ev.StrongTroxel(), 140.0, press)
    traction = 8.8541878188e-12 * 140.0**2 / (2.0 * (0.38 / 1650.0 + 0.001 / 3.9) ** 2)
    (said,) = plan(asked).warnings
    assert f"attracted with {traction:.3g} MPa" in said
    assert f"at most {traction:.2g} MPa on touching skin" in str(plan(asked)).replace("\n" + " " * 19, " ")
    (tmp_path / "pad.toml").write_text(scenefile.dump(asked))
    assert main(["run", str(tmp_path / "pad.toml"), "--out", str(tmp_path / "out"), "--no-fields"]) == 0
    result = ev.load(tmp_path / "out")
    pull = result.electrostatic_force
    told = f"is {pull.max() / 0.05:.3g} times the load"
    (warning,) = [one for one in result.warnings if "the attraction" in one]
    assert told in warning
    assert told in capsys.readouterr().out
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["warnings"] == result.warnings
    tables, grid = (
        tomllib.loads(scenefile.dump(asked)),
        {"electrostatics.law": ["strong_troxel", "kaczmarek"]},
    )
    with pytest.warns(UserWarning, match="touching skin"):
        points = ev.sweep(ev.Sweep(tables, grid), workers=1).rows
    assert [(row["status"], told in row["message"]) for row in points] == [("done", True), ("done", False)]
    assert points[1]["message"] == ""


def test_steps_longer_than_the_period_of_hand_or_tissue_are_told():
    """The hand's 2 pi sqrt(m / k), of a tissue 2 mm thick 4 h sqrt(rho / G); beyond critical damping neither
    swings, and where no mass moves the tissue does not.
    """
    stiffness, mass, modulus = 0.01, 1e-6, 0.1 / 2.8
    periods = {"hand": 2.0 * np.pi * np.sqrt(mass / stiffness), "tissue": 4.0 * 2.0 * np.sqrt(1e-9 / modulus)}

    def told(step, damping=0.0, viscosity=0.0, dynamics="inertial"):
        law = ev.NeoHookean(E=0.1, nu=0.4, viscosity=viscosity)
        hand = ev.Hand(stiffness, damping, mass)
        motion = [PRESS, ev.Slide(1.0, steps=2, speed=0.5 / step)]
        asked = scene(law, *motion, hand=hand, solver=ev.Solver(dynamics=dynamics))
        return [one for one in plan(asked).warnings if "by itself swings" in one]

    assert told(0.99 * periods["tissue"]) == []
    (said,) = told(1.01 * periods["tissue"])
    assert f"the tissue by itself swings with a period of {periods['tissue']:.3g} s" in said
    both = told(1.01 * periods["hand"])
    assert f"the hand by itself swings with a period of {periods['hand']:.3g} s" in both[0]
    assert len(both) == 2
    assert told(1.0, damping=2.01 * np.sqrt(stiffness * mass), viscosity=1e-3) == []
    assert len(told(1.0, viscosity=1e-9, dynamics="viscous")) == 1


X = np.arange(-5.0, 5.001, 0.05)
#: grooves 0.05 mm deep, 0.1 mm wide, 0.5 mm apart
GROOVES = Profile(X, np.where(np.round(X / 0.05) % 10 < 2, -0.05, 0.0), friction=0.0)


def rubbed(surface, cells=8):
    return Scene(finger(block(cells, 3)), surface, motion=Press(indentation=0.02, steps=1))


def test_grooves_between_the_nodes_are_warned_of():
    found = plan(rubbed(GROOVES))
    assert "sharper than the node spacing of the pad (0.25 mm)" in found.warning
    assert "up to 0.05 of its 0.05 mm" in found.warning
    assert " ".join(str(found).split()).endswith(f"Warning: {found.warning}")
    with pytest.warns(UserWarning, match="sharper than the node spacing") as caught:
        simulate(rubbed(GROOVES))
    assert [Path(one.filename).name for one in caught] == ["test_plausibility.py"]


STRIPES = Flat(friction=np.column_stack([X, 0.3 + 0.1 * np.sin(2.0 * np.pi * X)]).tolist())
WAVES = Sinusoid(terms=[[0.02, 2.0 * np.pi, 0.0], [0.004, 4.0 * np.pi, 0.0]], friction=0.3)


@pytest.mark.parametrize(("what", "surface"), [("height", WAVES), ("friction", STRIPES)])
def test_waves_with_fewer_than_two_rows_are_warned_of(what, surface):
    """Waves of 1 mm, with a weak second harmonic: as fine as the rows of the finest slide allow."""

    def told(*slides):
        pressed = Scene(finger(block(40, 3)), surface, motion=[Press(indentation=0.02, steps=1), *slides])
        return [one for one in plan(pressed).warnings if "rows" in one]

    (said,) = told(ev.Slide(distance=-12.0, steps=20))
    pattern = rf"slides have rows 0.6 mm apart or more, and the surface's {what} waves of (\S+) mm: .*"
    wave, steps = re.fullmatch(pattern + r"take more than (\d+) steps in motion 1", said).groups()
    assert float(wave) == pytest.approx(1.0, rel=0.1)
    assert int(steps) == pytest.approx(24, rel=0.1)
    assert not told(ev.Slide(distance=-12.0, steps=27))
    assert not told(ev.Slide(distance=-12.0, steps=20), ev.Slide(distance=1.0, steps=4))
    assert not told(ev.Slide(distance=-12.0, steps=1))  # its end alone is asked for


@pytest.mark.parametrize("surface", [Flat(friction=0.0), Sinusoid(terms=[[0.05, 1.0, 0.0]], friction=0.0)])
def test_what_the_nodes_can_feel_is_not(surface):
    assert plan(rubbed(surface)).warning is None


def test_how_much_of_the_slope_is_too_fine():
    long, short = 2.0 * np.pi / 4.0, 2.0 * np.pi * 3.0  # whole waves along the pad
    fine = Sinusoid(terms=[[0.05, long, 0.0], [3e-3, short, 0.0]], friction=0.0)
    found = plan(rubbed(fine, cells=6)).warning
    assert "(0.33 mm)" in found
    # a wave as long as the spacing has no slope from node to node; the squares of the slopes add up
    share = 3e-3 * short / np.hypot(3e-3 * short, 0.05 * long)
    assert float(re.search(r"(\d+)%", found)[1]) == pytest.approx(100.0 * share, abs=1.0)


def test_the_shortest_waves_of_roughness_need_five_nodes_each():
    """Nodes 1/24 mm apart: 0.2083 mm."""
    for shortest, enough in ((0.21, True), (0.2, False)):
        rough = SelfAffine(hurst=0.9, rms=0.01, shortest=shortest, friction=0.0)
        found = plan(rubbed(rough, cells=48)).warning
        assert (found is None) == enough
    assert "(0.2 mm) have fewer than 5 nodes of the pad each, which are 0.042 mm apart" in found
    assert found.endswith("a shortest wave of 0.21 mm")


def said_of(asked):
    return plan(asked).warnings


def pad(*motion, **more):
    """A pad that touches a display, with time."""
    finger = ev.FingerPad(resolution="coarse", ridges=False, viscosity=more.pop("viscosity", 0.0))
    return ev.Scene(finger, ev.Display(friction=0.3), motion=motion or [ev.Press(force=0.05)], **more)


def test_seconds_hertz_and_depths_in_other_units_are_doubted():
    """Each just beyond and just within what is doubted: 1 s, 20 Hz, 1 mm."""
    for viscosity, doubted in ((5.0, 1), (0.9, 0)):
        assert (
            sum("relaxation times are in s, not in ms" in s for s in said_of(pad(viscosity=viscosity)))
            == doubted
        )
    for depth, doubted in ((0.01, 1), (1.0, 0)):
        assert sum("a depth of 0.01 mm" in s for s in said_of(pad(depth=depth))) == doubted
    driven = {"law": ev.Kaczmarek(), "voltage": 100.0}
    for frequency, doubted in ((5.0, 1), (20.0, 0)):
        found = said_of(pad(drive=ev.Drive(frequency=frequency), **driven))
        assert sum("frequencies are in Hz, not in kHz" in s for s in found) == doubted


def test_loads_of_a_fingertip_that_no_hand_presses_with_are_doubted_and_huge_ones_refused():
    tip = ev.Fingertip(ridges=False, resolution="coarse")
    for force, doubted in ((400.0, 1), (20.0, 0)):
        found = said_of(ev.Scene(tip, ev.Display(), motion=[ev.Press(force=force)]))
        assert sum("over the whole finger: forces are in N" in s for s in found) == doubted
    with pytest.raises(ev.InputError, match=r"given 1000000\.0; allowed: a force in N/mm"):
        ev.Press(force=1e6)


def test_attractions_that_are_exactly_nothing_are_told():
    """Menisci of 1 um between faces that are 2 um apart; nodes in the air without an air layer."""
    water = ev.Capillary(surface_tension=0.0728, contact_angle=0.0, film=1e-3)
    for gap, told in ((2e-3, 1), (5e-4, 0)):
        found = said_of(pad(adhesion=water, roughness_gap=gap))
        assert sum("Capillary has no traction" in s for s in found) == told
    charged = {"law": ev.Kaczmarek(), "voltage": 100.0, "air_layer": False}
    for motion, told in ((ev.Hover(gap=0.2), 1), (ev.Press(force=0.05), 0)):
        assert sum("nothing is attracted" in s for s in said_of(pad(motion, **charged))) == told


def test_friction_that_falls_with_the_speed_is_doubted_where_nothing_has_mass():
    slide = [ev.Press(force=0.05), ev.Slide(1.0, speed=5.0)]
    falling, rising = ev.RateFriction(speed=5.0, ratio=0.5), ev.RateFriction(speed=5.0, exponent=0.5)

    def doubted(law, dynamics="viscous", **more):
        solver = ev.Solver(dynamics=dynamics)
        asked = pad(*slide, friction_law=law, solver=solver, viscosity=1e-3, **more)
        return any("friction falls with the speed" in one for one in said_of(asked))

    assert doubted(falling)
    assert doubted(falling, "quasistatic")
    assert not doubted(rising)
    assert not doubted(falling, "inertial")
    assert not doubted(falling, "quasistatic", hand=ev.Hand(stiffness=0.01, mass=1e-6))
