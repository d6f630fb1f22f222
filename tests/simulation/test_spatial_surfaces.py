"""In three dimensions: surfaces and friction over x and z, beside their turned and mirrored twins,
and long cylinders beside the plane.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tools.builders import left_over
from tools.domes import LINEAR, Dome, cylinder, dome_scene
from tools.meshes import block as plane_block

import evfem as ev
from evfem.contact.signorini import SLIP
from evfem.simulation.run import simulate

PRESS = ev.Press(indentation=0.3, steps=2, speed=1.0)
FILM, THIN = ev.Layer(thickness=0.09, eps_r=3.35), ev.Layer(thickness=0.005, eps_r=3.35)
#: gentle waves, both of which the dome's nodes see
WAVES = ([0.02, 2.0, 0.3], [0.015, 1.5, 1.0])
GRID = np.linspace(-4.0, 4.0, 81)
HEIGHT = 0.02 * np.sin(2.0 * GRID + 0.3) + 0.015 * np.sin(1.5 * GRID[:, None] + 1.0)
ENDS = np.array([-9.0, 0.3, 0.3, 9.0])
#: coefficients in four quarters
QUARTERS = np.array([[0.2, 0.2, 0.5, 0.5]] * 2 + [[0.4, 0.4, 0.3, 0.3]] * 2)
#: without a core: the law itself
ITSELF = replace(LINEAR, core="off")
ROUGH = ev.PowerRoughness(gap=0.001, pressure=0.01, exponent=0.5, open_gap=0.006)
COLUMNS = ("applied_force", "normal_force", "tangential_force", "electrostatic_force", "friction_dissipation")


def eggs(first, second):
    """Both waves, along these angles."""
    return ev.Sinusoid(terms=[[*WAVES[0], first], [*WAVES[1], second]], insulator=FILM)


def tiles(x, z, coefficients):
    return ev.Flat(friction=ev.FrictionMap(x, z, coefficients), insulator=FILM)


#: both waves, the same with x and z exchanged, the same mirrored in x
EGGS = (eggs(0.0, 90.0), eggs(90.0, 0.0), eggs(180.0, 90.0))


def slid(surface, angle, **other):
    return simulate(
        dome_scene(PRESS, ev.Slide(0.6, steps=3, angle=angle, speed=10.0), surface=surface, **other)
    )


def exponential(speed, **settings):
    return {"friction_law": ev.RateFriction(speed=speed, **settings)}


#: name -> surface, the same with x and z exchanged, the same mirrored in x; further settings
TWINS = {
    "sinusoids": (*EGGS, {}),
    "relief": (
        ev.Relief(GRID, GRID, HEIGHT, insulator=FILM),
        ev.Relief(GRID, GRID, HEIGHT.T, insulator=FILM),
        ev.Relief(GRID, GRID, HEIGHT[:, ::-1], insulator=FILM),
        {},
    ),
    "jumps": (
        tiles(ENDS, ENDS, QUARTERS),
        tiles(ENDS, ENDS, QUARTERS.T),
        tiles(-ENDS[::-1], ENDS, QUARTERS[:, ::-1]),
        {},
    ),
    "rate": (*EGGS, exponential(5.0, exponent=0.5)),
    "normal": (*EGGS, {"direction": "normal", "voltage": 3000.0, "solver": ITSELF}),
    "rough": (
        *(replace(each, insulator=THIN) for each in EGGS),
        {"law": ev.StrongTroxel(), "voltage": 150.0, "roughness_gap": ROUGH, "solver": ITSELF},
    ),
    "adhesion": (*EGGS, {"law": None, "voltage": 0.0, "adhesion": ev.Dugdale(stress=0.005, reach=0.05)}),
    "hand": (*EGGS, {"hand": ev.Hand(0.1, 1e-3, 1e-6)}),
}


@pytest.mark.parametrize("name", TWINS)
def test_a_turned_and_a_mirrored_scene_have_turned_and_mirrored_numbers(name):
    """The dome is the same along x and z: at 30 and 60 degrees they change places, at 150 x its sign.
    Tangential forces are along the slide from its first step on, before along x.
    """
    surface, turned, mirrored, given = TWINS[name]
    first, second, third = (
        slid(one, angle, **given) for one, angle in ((surface, 30.0), (turned, 60.0), (mirrored, 150.0))
    )
    for column in COLUMNS:
        scale, slide = np.abs(first[column]).max(), slice(2 if "tangential" in column else 0, None)
        for other in (second, third):
            assert_allclose(other[column][slide], first[column][slide], atol=3e-6 * scale)
    for kind in ("tangential_force", "applied_tangential_force"):
        x, z = first[f"{kind}_x"], first[f"{kind}_z"]
        scale = np.abs(x).max()
        assert_allclose(second[f"{kind}_x"], z, atol=3e-6 * scale)
        assert_allclose(second[f"{kind}_z"], x, atol=3e-6 * scale)
        assert_allclose(third[f"{kind}_x"], -x, atol=3e-6 * scale)
        assert_allclose(third[f"{kind}_z"], z, atol=3e-6 * scale)
        along = x * np.cos(np.pi / 6) + z * np.sin(np.pi / 6)
        assert_allclose(first[kind][2:], along[2:], atol=1e-12)
    assert np.abs(second["tangential_force_x"] - first["tangential_force_x"]).max() > 1e-3
    for result in (first, second, third):
        assert left_over(result) < 1e-6


def test_sliding_nodes_have_the_friction_of_their_place():
    """On a map that rises along z and jumps along x every slipping node bears its coefficient."""
    table = ev.FrictionMap(ENDS, [-3.0, 3.0], [[0.1, 0.1, 0.3, 0.3], [0.3, 0.3, 0.5, 0.5]])
    result = slid(ev.Flat(friction=table, insulator=FILM), 60.0)
    frame = result.frames[-1]
    slips = frame.contact_status == SLIP
    assert slips.sum() > 8
    place = (result.mesh.points + frame.displacement)[slips][:, ::2]
    expected = table.at(place) * frame.contact_pressure[slips]
    assert_allclose(frame.shear_traction[slips], expected, rtol=1e-5)
    assert np.ptp(table.at(place)) > 0.15


def test_the_work_on_waves_falls_to_nothing_without_friction():
    """Over a whole wave in both directions a frictionless slide gives back what it took: the mean
    force on the bone is the normal force's, and the books say that nothing is lost but by the press.
    """
    lost = []
    for steps in (4, 16):
        motion = [PRESS, ev.Slide(0.5, steps=steps, angle=40.0), ev.Slide(-0.5, steps=steps, angle=40.0)]
        result = simulate(
            dome_scene(*motion, surface=replace(eggs(0.0, 90.0), friction=0.0), law=None, voltage=0.0)
        )
        assert left_over(result) < 1e-6
        given = result.external_work[-1] - result.external_work[1]
        assert_allclose(given, 0.0, atol=0.02 * result.stored_energy[1])
        lost.append(abs(given))
        for axis in "xz":
            back = result[f"applied_tangential_force_{axis}"]
            assert_allclose(back[-1], back[1], atol=1e-7)
    assert lost[1] < 0.3 * lost[0]


SOFT = ev.NeoHookean(E=0.1, nu=0.45)
LIMITS = {
    "normal, waves": (
        ev.Sinusoid(terms=[[0.03, 3.0, 0.3]], insulator=FILM),
        {"direction": "normal", "voltage": 1500.0},
    ),
    "jump": (ev.Display(FILM, friction=[[-9.0, 0.2], [0.1, 0.2], [0.1, 0.6]]), {}),
    "rate": (ev.Display(FILM), exponential(5.0, exponent=0.5)),
    "rough": (ev.Display(THIN), {"law": ev.StrongTroxel(), "voltage": 150.0, "roughness_gap": ROUGH}),
}


@pytest.mark.parametrize("name", LIMITS)
def test_what_a_cylinder_gains_with_its_length_is_the_plane_s(name):
    """Its ends bulge, which does not depend on the length: 16 mm less 8 mm are 8 mm of plane strain,
    to what is left of the ends' decay and of two millimetres from face to face.
    """
    surface, given = LIMITS[name]
    motion = [PRESS, ev.Slide(0.6, steps=3, speed=10.0)]
    forces = []
    for shape, element in (
        (plane_block(8, 2, sag=1.0 / 3.0), "q2p1"),
        (cylinder(8.0, 4), "hex27p1"),
        (cylinder(16.0, 8), "hex27p1"),
    ):
        finger = Dome(law=SOFT, shape=shape, region=next(iter(shape.region_names)))
        scene = dome_scene(
            *motion, finger=finger, surface=surface, solver=ev.Solver(element=element), **given
        )
        forces.append(simulate(scene))
    plane, short, long = forces
    for column in ("applied_force", "applied_tangential_force", "tangential_force"):
        found = (long[column] - short[column]) / 8.0
        assert_allclose(found, plane[column], atol=0.015 * np.abs(plane[column]).max())
    pulled = (long.electrostatic_force - short.electrostatic_force) / 8.0
    assert_allclose(pulled, plane.electrostatic_force, atol=0.06 * plane.electrostatic_force.max())
