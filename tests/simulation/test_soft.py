"""A finger on an elastic surface: two elastic bodies in contact, limits, books, and a run that goes on."""

import re

import numpy as np
import pytest
from tools.builders import coarse_pad, left_over, pad_state, small_finger, unbalanced
from tools.domes import Dome, dome, dome_scene
from tools.meshes import both_sides, contact_block, graded, parabola

import evfem as ev
from evfem.reference import BondedLayer, CattaneoMindlin, HertzLine, plane_modulus, pull_in_strong_troxel

SOFT = ev.ElasticLayer(E=0.2, nu=0.48, thickness=2.0)
PAD = small_finger(40, 3)


def press(mesh, law, surface, *motion, **solver):
    finger = ev.MeshedFinger(mesh, {"tissue": law})
    return ev.simulate(ev.Scene(finger, surface, motion=motion, solver=ev.Solver(**solver)))


def test_two_layers_under_a_cylinder_are_one_softer_layer():
    """A finger of E 0.08 and a surface of E 0.2 MPa, both 2 mm thick with nu 0.48, R = 10: as one layer with
    E1 E2/(E1 + E2), of load .0071945671 N/mm at a half width of 1 mm. Loads and depths go with 1/R.
    """
    radius, k, nu = 1e4, 0.01, 0.48
    layer = BondedLayer(1.0, 2.0, radius, 0.08 * 0.2 / 0.28, nu)
    assert layer.load * radius / 10.0 == pytest.approx(0.0071945671, rel=1e-7)
    terms = [[1.0 / (radius * k**2), k, np.pi / 2]]
    cylinder = ev.Sinusoid(0.0, terms, elastic=ev.ElasticLayer(0.2, nu, 2.0))
    mesh = contact_block(
        both_sides(graded(1.25, 1 / 32, 14.0, 1.3)), 2.0 * np.linspace(0.0, 1.0, 13) ** 1.3, pad=4.0
    )
    result = press(
        mesh, ev.LinearElastic(0.08, nu), cylinder, ev.Press(indentation=layer.indentation, steps=1)
    )
    assert result.normal_force[-1] == pytest.approx(layer.load, rel=2e-3)
    assert result.contact_width[-1] == pytest.approx(2.0, rel=0.01)
    assert pad_state(result)[2]["contact_pressure"].max() == pytest.approx(
        float(layer.pressure(0.0)), rel=2e-3
    )


@pytest.mark.parametrize(("E", "nu", "modulus"), [(0.2, 0.48, 0.0742500743), (1.0, 0.3, 0.0949667616)])
def test_two_elastic_bodies_of_hertz(E, nu, modulus):
    """Half-planes of E 0.08, nu 0.48 and another one; the layers are sixty half widths thick."""
    radius = 1e3
    x = both_sides(graded(1.125, 1 / 40, 60.0, 1.5))
    mesh = contact_block(x, graded(0.1, 1 / 40, 60.0, 1.5), pad=1.125, lower=parabola(radius))
    both = 1.0 / (1.0 / plane_modulus(0.08, 0.48) + 1.0 / plane_modulus(E, nu))
    assert both == pytest.approx(modulus, rel=1e-8)
    hertz = HertzLine.from_half_width(1.0, radius, both)
    motion = (ev.Press(indentation=1e-5, steps=1), ev.Press(force=hertz.load, steps=1))
    surface = ev.Flat(friction=0.0, elastic=ev.ElasticLayer(E, nu, 60.0))
    result = press(mesh, ev.LinearElastic(0.08, 0.48), surface, *motion)
    x, _, field = pad_state(result)
    assert field["contact_pressure"].max() == pytest.approx(hertz.peak_pressure, rel=0.005)
    assert result.contact_width[-1] == pytest.approx(2.0 * hertz.half_width, rel=0.01)
    inside = np.abs(x) < 0.9
    error = np.abs(field["contact_pressure"] - hertz.pressure(x))[inside].max()
    assert error < 0.006 * hertz.peak_pressure


def test_two_elastic_bodies_of_cattaneo_and_mindlin():
    """Bodies of one material do not couple normal and shear forces: c/a = sqrt(1 - Q/(mu P))."""
    half_width, radius, mu, nu = 0.1, 20.0, 0.3, 0.499
    x = both_sides(graded(1.125 * half_width, half_width / 32, 40.0, 1.5))
    y = graded(0.1 * half_width, half_width / 32, 40.0, 1.5)
    mesh = contact_block(x, y, pad=1.125 * half_width, lower=parabola(radius, flat=3.0))
    hertz = HertzLine.from_half_width(half_width, radius, modulus=0.5)
    slide = ev.Slide(distance=1.05 * half_width**2 / radius, steps=3, hold="force")
    surface = ev.Flat(friction=mu, elastic=ev.ElasticLayer(1.0 - nu**2, nu, 40.0))
    motion = (ev.Press(indentation=5e-4, steps=1), ev.Press(force=hertz.load, steps=1), slide)
    result = press(mesh, ev.NeoHookean(E=1.0 - nu**2, nu=nu), surface, *motion)
    for k in (2, 3, 4):
        mindlin = CattaneoMindlin(hertz, mu, result.tangential_force[k])
        _, length, field = pad_state(result, k)
        stick = length[field["contact_status"] == 1].sum() / 2.0
        assert stick == pytest.approx(mindlin.stick_half_width, rel=0.04)


DOME = Dome(dome((5, 3, 5)))
IN_SPACE = [ev.Press(indentation=0.15, steps=2), ev.Slide(0.2, steps=2)]
IN_PLANE = [ev.Press(indentation=0.6, steps=2), ev.Slide(1.0, steps=4)]


def on_pad(surface, motion=IN_PLANE, **more):
    return ev.simulate(ev.Scene(PAD, surface, motion=motion, **more))


def on_dome(surface, motion=IN_SPACE, **more):
    return ev.simulate(
        dome_scene(*motion, finger=DOME, surface=surface, **{"law": None, "voltage": 0.0} | more)
    )


def test_the_width_of_contact_is_that_of_the_deformed_face():
    """That between the outermost nodes that touch, to their distance from the next; the undeformed length of
    the face below them, which is drawn together, is 5 % less.
    """
    soft = ev.Flat(friction=0.8, elastic=ev.ElasticLayer(E=0.03, nu=0.45, thickness=4.0))
    result = ev.simulate(ev.Scene(coarse_pad(), soft, motion=[ev.Press(indentation=1.5, steps=3)]))
    mesh, frame = result.mesh, result.frames[-1]
    pad = mesh.node_sets["pad"]
    x = (mesh.points + frame.displacement)[pad, 0]
    order = np.argsort(x)
    touching = np.flatnonzero((frame.contact_pressure[pad] > 0.0)[order])
    inner, outer = (np.ptp(x[order][[touching[0] - k, touching[-1] + k]]) for k in (0, 1))
    assert result.contact_width[-1] == pytest.approx(inner, abs=0.5 * (outer - inner))


@pytest.mark.parametrize(("slid", "contact"), [(on_pad, "contact_width"), (on_dome, "contact_area")])
def test_a_hard_surface_is_the_rigid_one(slid, contact):
    rigid, hard = (slid(ev.Flat(elastic=one)) for one in (None, ev.ElasticLayer(1e12, 0.3, 1.0)))
    for name in ("normal_force", "tangential_force", contact):
        np.testing.assert_allclose(hard[name], rigid[name], rtol=1e-10, atol=1e-14)
    assert not rigid.surface_sink.any()
    assert 0.0 < hard.surface_sink[-1] < 1e-10


ATTRACTED = {"law": ev.StrongTroxel(), "voltage": 1000.0}
LOADED = [ev.Press(force=0.05, steps=2), ev.Slide(1.0, steps=5, hold="force")]
BALANCED = {
    "in space": (on_dome, ev.Flat(friction=0.3, elastic=SOFT), {}),
    "waves": (on_dome, ev.Sinusoid(0.01, [[0.02, 2.0, 0.3]], elastic=SOFT, angle=30.0), {}),
    "attracted": (on_dome, ev.Display(friction=0.3, elastic=SOFT), ATTRACTED),
    "Maxwell": (on_dome, ev.Display(friction=0.3, elastic=SOFT), ATTRACTED | {"direction": "normal"}),
    "adhesion": (on_dome, ev.Flat(friction=0.3, elastic=SOFT), {"adhesion": ev.Dugdale(1e-3, 0.02)}),
    "plane": (on_pad, ev.Display(friction=0.3, elastic=SOFT), {"motion": LOADED}),
    "plane, Maxwell": (on_pad, ev.Display(elastic=SOFT), ATTRACTED | {"direction": "normal"}),
}


@pytest.mark.parametrize("name", BALANCED)
def test_forces_and_works_balance(name):
    slid, surface, more = BALANCED[name]
    result = slid(surface, **more)
    np.testing.assert_allclose(unbalanced(result), 0.0, atol=1e-8)
    assert left_over(result) < 1e-5
    assert result.surface_sink[-1] > 0.01


def test_slides_in_space_along_x_and_along_z_are_one_and_push_nothing_aside():
    along, across = (
        on_dome(ev.Flat(friction=0.3, elastic=SOFT), [IN_SPACE[0], ev.Slide(0.2, steps=2, angle=angle)])
        for angle in (0.0, 90.0)
    )
    np.testing.assert_allclose(along.normal_force, across.normal_force, rtol=1e-8)
    np.testing.assert_allclose(along.tangential_force, across.tangential_force_z, atol=1e-10)
    np.testing.assert_allclose(along.tangential_force_z, 0.0, atol=1e-10)


def test_what_a_press_loses_by_its_steps_falls_with_their_square():
    presses = ([ev.Press(indentation=0.6, steps=steps)] for steps in (4, 8))
    lost = [on_pad(ev.Flat(elastic=SOFT), press).integrator_dissipation[-1] for press in presses]
    assert lost[0] / lost[1] == pytest.approx(4.0, rel=0.1)


def test_steady_sliding_loses_nothing_but_friction():
    """The last steps of a long slide, whose contact moves along as it is."""
    motion = [ev.Press(indentation=0.4, steps=2), ev.Slide(3.0, steps=6)]
    result = on_pad(ev.Flat(friction=0.3, elastic=SOFT), motion)
    rubbed, lost = (np.diff(result[name])[-1] for name in ("friction_dissipation", "integrator_dissipation"))
    assert rubbed == pytest.approx(0.5 * result.applied_tangential_force[-1], rel=1e-7)
    assert abs(lost) < 1e-8 * rubbed


def test_a_frictionless_surface_does_not_hold_back():
    """Its slopes push the finger to both sides alike, also where the finger is not symmetric."""
    finger = ev.FingerPad(resolution="coarse", ridge_phase=0.2)
    surface = ev.Flat(friction=0.0, elastic=SOFT)
    result = ev.simulate(ev.Scene(finger, surface, motion=[ev.Press(indentation=0.6, steps=2)]))
    assert abs(result.tangential_force[-1]) < 1e-8 * result.normal_force[-1]
    # ridges that roll freely: strips that followed every iterate took 1934, and releases
    assert result.newton_iterations.sum() < 100
    assert not result.jumps.any()


def test_a_result_keeps_how_the_surface_has_sunk(tmp_path):
    result = on_pad(ev.Flat(elastic=SOFT), [ev.Press(indentation=0.5, steps=1)])
    result.save(tmp_path / "soft.npz")
    sunk = ev.result.load(tmp_path / "soft.npz").frames[-1].surface_sink
    assert sunk.max() == pytest.approx(result.surface_sink[-1])
    assert sunk.min() < 0.0  # it bulges beside the contact


@pytest.mark.parametrize(
    ("surface", "more", "message"),
    [
        (ev.Display(elastic=SOFT), {"law": ev.StrongTroxel(), "voltage": 100.0, "field": "full"}, "elastic"),
        (
            ev.Display(elastic=ev.ElasticLayer(0.2, 0.48, 0.05)),
            {"finger": ev.Fingertip(resolution="coarse")},
            "at least as thick",
        ),
    ],
)
def test_what_goes_with_no_elastic_surface_is_refused(surface, more, message):
    finger = more.pop("finger", PAD)
    with pytest.raises(ev.InputError, match=message):
        ev.plan(ev.Scene(finger, surface, motion=[ev.Press(indentation=0.1)], **more))


def test_a_surface_that_is_strained_too_much_is_told():
    result = on_pad(ev.Flat(elastic=ev.ElasticLayer(0.05, 0.48, 5.0)), [ev.Press(force=0.05, steps=2)])
    (said,) = (one for one in result.warnings if "strained" in one)
    assert re.search(r"strained by about \d+%", said)


@pytest.mark.parametrize(("share", "closed"), [(0.999, False), (1.001, True)])
def test_a_plate_snaps_onto_a_surface_on_springs(share, closed):
    """Springs of 0.1 N/mm above and 0.3 N/mm below are one of 0.075 N/mm in a row: 730.743 V."""

    class Springs:
        def compliance(self, x, lengths):
            own = np.diag(1.0 / (3e-3 * np.asarray(lengths)))
            return np.block([[own, 0.0 * own], [0.0 * own, own]])

    x, y = np.meshgrid(np.linspace(0.0, 2.0, 3), [0.0, 2.0])
    cells, sets = np.array([[0, 1, 4, 3], [1, 2, 5, 4]]), {"pad": np.arange(3), "bone": np.arange(3, 6)}
    mesh = ev.Mesh(
        np.column_stack([x.ravel(), y.ravel()]), cells, "quad", np.zeros(2, int), {"plate": 0}, sets
    )
    plate = {"plate": ev.LinearElastic(E=2e-3, nu=0.0)}  # over 2 mm: 0.1 N/mm for each 100 mm2
    finger = ev.MeshedFinger(mesh, plate, electrical=ev.Electrical(0.38, 1650.0))
    layers = ev.Layers.of(ev.Layer(0.38, 1650.0), ev.FILM)
    volts = pull_in_strong_troxel(0.075, 0.25, 100.0, layers).voltage
    assert volts == pytest.approx(730.743048331, rel=1e-7)
    surface, motion = ev.Display(ev.FILM, friction=0.0, elastic=Springs()), [ev.Hover(0.25)]
    motion.append(ev.VoltageRamp(share * volts, steps=6))
    result = ev.simulate(ev.Scene(finger, surface, ev.StrongTroxel(), 0.0, motion))
    assert (result.contact_width[-1] > 0.0) == closed


def test_a_clutch_of_two_strips():
    """Strips of EA 0.5 and 0.3 N per mm of width, 12 mm long, drawn apart under a drag t = mu p: both slip
    from their loaded ends over F EA2/((EA1 + EA2) t) and F EA1/((EA1 + EA2) t), and all slip at F = t L.
    """
    first, second, length, number, drag = 0.5, 0.3, 12.0, 32, 0.3 * 0.005

    class Strip:
        def compliance(self, x, lengths):
            n, place = len(x), np.asarray(x) + 0.5 * length
            none, stretch = np.zeros((n, n)), np.minimum.outer(place, place) / second
            return np.block([[none, none], [none, stretch]])

    x, y = np.meshgrid(np.linspace(-0.5 * length, 0.5 * length, number + 1), [0.0, 0.1])
    low = np.arange(number)
    cells = np.stack([low, low + 1, low + number + 2, low + number + 1], axis=1)
    sets = {"pad": low, "bone": np.array([number, 2 * number + 1])}
    points = np.column_stack([x.ravel(), y.ravel()])
    mesh = ev.Mesh(points, cells, "quad", np.zeros(number, dtype=int), {"strip": 0}, sets)
    law = {"strip": ev.LinearElastic(E=10.0 * first, nu=0.0)}
    strip = ev.MeshedFinger(mesh, law, electrical=ev.Electrical(0.01, 1.0))
    voltage = 0.06 * np.sqrt(2.0 * 0.005 / ev.eps_0)  # 0.005 MPa across 0.06 mm
    surface = ev.Display(ev.Layer(0.05, 1.0), friction=0.3, elastic=Strip())
    motion = [ev.Press(indentation=1e-6, steps=1), ev.Slide(0.25, steps=2), ev.Slide(1.0, steps=1)]
    result = ev.simulate(ev.Scene(strip, surface, ev.StrongTroxel(), voltage, motion))
    drag *= 1.0 - 1.0 / number  # the edge at the held end carries no drag
    force, slid = result.applied_tangential_force[2], result.position[2]
    both = first + second
    ways = second**2 / first + first**2 / second
    travel = force * length / both + force**2 / (2.0 * both**2 * drag) * ways
    assert slid == pytest.approx(travel, rel=0.02)
    sticks = np.flatnonzero(result.frames[2].contact_status[sets["pad"]] == 1) * length / number
    assert length - sticks[-1] == pytest.approx(force * second / (both * drag), abs=0.4)
    assert sticks[0] == pytest.approx(force * first / (both * drag), abs=0.4)
    assert result.applied_tangential_force[-1] == pytest.approx(drag * length, rel=0.02)
