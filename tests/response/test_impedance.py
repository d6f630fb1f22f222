"""Impedance about a loaded state: closed forms of bars, masses and springs, the spectrum of branches, slopes
of forces by differences of runs, and a small vibration in time.
"""

from dataclasses import replace

import numpy as np
import pytest
from tools.builders import coarse_pad, small_finger
from tools.meshes import between, block, held
from tools.solids import block as solid

import evfem as ev

SKIN = ((0.8, 0.004), (0.5, 0.07), (0.4, 1.4))
#: real and imaginary part of the modulus of these branches over that at rest, by frequency in Hz
SPECTRUM = {
    1.0: 1.4764460381 + 0.2492524075j,
    10.0: 1.9229016669 + 0.3017572333j,
    40.0: 2.3005047404 + 0.4294602005j,
    100.0: 2.5903999454 + 0.2866214698j,
}
LIGHT = 1e-20  # t/mm3: no inertia
TINY = 1e-6  # mm: a load that changes nothing


def stuck(mesh, laws, motion=None, element="q1", **finger):
    motion = motion or ev.Press(indentation=TINY, steps=1)
    names = dict(zip(mesh.region_names, laws, strict=True))
    finger = ev.MeshedFinger(mesh, names, **finger)
    return ev.Scene(finger, ev.Flat(friction=50.0, y=0.0), motion=motion, solver=ev.Solver(element=element))


def tissue(E=0.034, nu=0.48, density=LIGHT, **more):
    return ev.NeoHookean(E=E, nu=nu, density=density, **more)


def test_a_homogeneous_block_has_the_spectrum_of_its_branches():
    """In the plane and in space, along both axes."""
    law = tissue(relaxation=SKIN, bulk_relaxation=True)
    plane = stuck(block(4, 1, 8.0, 1.0), [law])
    space = stuck(held(solid((2, 1, 2), (8.0, 1.0, 1.0))), [law], element="hex8")
    for scene in (plane, space):
        for axis in ("normal", "tangential"):
            found = ev.impedance(scene, [1e-9, *SPECTRUM], axis)
            over = found.stiffness[1:] / found.stiffness[0].real
            np.testing.assert_allclose(over, list(SPECTRUM.values()), rtol=1e-5)
            np.testing.assert_allclose(found.impedance * 2j * np.pi * found.frequency, found.stiffness)


def pad(element, **more):
    laws = {name: replace(law, density=LIGHT) for name, law in ev.FingerPad().materials.items()}
    finger = ev.FingerPad(resolution="coarse", materials=laws, relaxation=SKIN, bulk_relaxation=True, **more)
    return ev.Scene(
        finger,
        ev.Flat(friction=50.0),
        motion=ev.Press(indentation=1e-4, steps=1),
        solver=ev.Solver(element=element),
    )


@pytest.mark.filterwarnings("ignore:a finger of .* is moved by")
@pytest.mark.parametrize(("element", "miss"), [("q1", 5e-5), ("q2", 5e-5), ("q2p1", 0.01)])
@pytest.mark.parametrize("axis", ["normal", "tangential"])
def test_all_layers_relax_alike(element, miss, axis):
    """Whatever the finger: the elastic stiffness times the spectrum. An element whose pressure is not the
    point's own measures the volume of tissue and branches in two ways: within a per cent.
    """
    found = ev.impedance(pad(element), [1e-9, *SPECTRUM], axis)
    over = found.stiffness[1:] / found.stiffness[0].real
    np.testing.assert_allclose(over, list(SPECTRUM.values()), rtol=miss)


def bar(rows, **more):
    """A bar of 4 mm without contraction, 2 mm wide."""
    return stuck(block(1, rows, 2.0, 4.0), [tissue(nu=0.0, density=1e-9, **more)])


def test_waves_in_a_bar():
    """E A k cot(k L) of a damped bar, k = w sqrt(rho/(E (1 + i w tau))); of second order in the cells."""
    E, L, A, tau, frequency = 0.034, 4.0, 2.0, 2e-4, np.array([100.0, 300.0, 700.0])
    w = 2.0 * np.pi * frequency
    modulus = E * (1.0 + 1j * w * tau)
    k = w * np.sqrt(1e-9 / modulus)
    exact = modulus * A * k / np.tan(k * L)
    errors = [
        np.abs(ev.impedance(bar(n, viscosity=tau), frequency).stiffness / exact - 1.0).max() for n in (16, 32)
    ]
    assert errors[1] < 4e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


def stacked(heavy_above, motion=None):
    """A light spring and a heavy rigid mass of 2 mm each, 4 mm wide."""
    x, y = np.meshgrid(np.linspace(-2.0, 2.0, 5), np.linspace(0.0, 4.0, 5))
    mesh = between(x, y)
    upper = (np.arange(len(mesh.cells)) >= len(mesh.cells) // 2).astype(int)
    mesh = held(mesh, region=upper if heavy_above else 1 - upper, names={"spring": 0, "mass": 1})
    laws = [tissue(nu=0.3), tissue(E=1e3, nu=0.3, density=1e-6)]
    return stuck(mesh, laws, motion)


def test_a_mass_on_a_spring():
    """k - w^2 m where the mass is on the bone; m k w^2/(w^2 m - k) where it hangs below a spring."""
    frequency, m = np.array([5.0, 20.0, 60.0]), 1e-6 * 4.0 * 2.0
    inertia = (2.0 * np.pi * frequency) ** 2 * m
    found = ev.impedance(stacked(True), [1e-9, *frequency]).stiffness
    np.testing.assert_allclose(found[1:], found[0].real - inertia, rtol=3e-4)
    hangs = ev.impedance(stacked(False, ev.Hover(gap=0.1)), frequency).stiffness
    # the spring alone between two rigid faces is that of the first case
    k = found[0].real
    np.testing.assert_allclose(hangs, k * inertia / (inertia - k), rtol=1e-3)


PRESSED, SLID = ev.Press(indentation=0.5, steps=3), ev.Slide(2.0, steps=5)
DISPLAY = ev.Display(insulator=ev.Layer(thickness=0.09, eps_r=3.35), friction=0.3)


def sliding(surface=DISPLAY, law=None, voltage=0.0, **more):
    return ev.Scene(
        small_finger(), surface, law, voltage, [PRESSED, SLID], solver=ev.Solver(tolerance=1e-10), **more
    )


def slope(scene, axis, h=1e-5):
    """Change of the force at the end by the indentation, or by the way slid, by central differences."""
    press, slide = scene.motion
    ends = []
    for change in (-h, h):
        motion = [replace(press, indentation=press.indentation + change), slide]
        column = "applied_force"
        if axis == "tangential":
            motion, column = (
                [press, replace(slide, distance=slide.distance + change)],
                f"applied_{axis}_force",
            )
        ends.append(ev.simulate(replace(scene, motion=motion))[column][-1])
    return (ends[1] - ends[0]) / (2.0 * h)


ROUGH = ev.PowerRoughness(gap=0.002, pressure=0.01, exponent=0.3, open_gap=0.01)
SCENES = {
    "friction": (sliding(), "normal"),
    "waves": (sliding(ev.Sinusoid(friction=0.3, terms=[[0.004, 6.0, 0.0]])), "normal"),
    "waves along": (sliding(ev.Sinusoid(friction=0.3, terms=[[0.004, 6.0, 0.0]])), "tangential"),
    "friction of the place": (sliding(ev.Flat(friction=[[-3.0, 0.1], [6.0, 0.4]])), "tangential"),
    "load index": (sliding(friction_law=ev.LoadIndexFriction(pressure=0.01, index=1.2)), "normal"),
    "attraction": (sliding(law=ev.Kaczmarek(), voltage=1000.0), "normal"),
    "Maxwell stress": (sliding(law=ev.Kaczmarek(), voltage=1000.0, direction="normal"), "normal"),
    "adhesion": (sliding(adhesion=ev.Dugdale(stress=0.002, reach=0.05)), "normal"),
    "rough": (
        replace(sliding(law=ev.Kaczmarek(), voltage=1000.0, roughness_gap=ROUGH), finger=coarse_pad()),
        "normal",
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_slow_stiffness_of_a_sliding_finger_is_the_slope_of_its_force(name):
    """All nodes slip; their law of friction, slopes of the ground and attraction act along."""
    scene, axis = SCENES[name]
    found = ev.impedance(scene, 1e-9, axis).stiffness[0]
    assert found.real == pytest.approx(slope(scene, axis), rel=1e-6)


def slipping_in_space(surface, distance, angle=30.0):
    """A block whose nodes all slip askew."""
    mesh = held(solid((4, 2, 3), (2.0, 1.0, 1.0)))
    motion = [ev.Press(indentation=0.05, steps=2), ev.Slide(distance, steps=2, angle=angle)]
    scene = stuck(mesh, [tissue(nu=0.4)], motion, element="hex8")
    return replace(scene, surface=surface, solver=replace(scene.solver, tolerance=1e-11))


@pytest.mark.parametrize(
    ("surface", "axis"),
    [
        (ev.Flat(friction=0.2, y=0.0), "normal"),
        (ev.Flat(friction=[[-9.0, 0.1], [40.0, 0.3]], y=0.0), "tangential"),
    ],
)
def test_slow_stiffness_of_a_finger_that_slips_in_space_is_the_slope_of_its_force(surface, axis):
    """But for how far friction turns as the finger is pressed, which is less the farther it slides."""
    misses = []
    for distance in (3.0, 30.0):
        scene = slipping_in_space(surface, distance)
        assert (ev.simulate(scene).frames[-1].contact_status[scene.finger.mesh(1).node_sets["pad"]] > 1).all()
        misses.append(abs(ev.impedance(scene, 1e-9, axis).stiffness[0].real / slope(scene, axis) - 1.0))
    assert misses[1] < 1e-5
    assert misses[1] < 0.1 * misses[0] or misses[0] < 1e-6


@pytest.mark.parametrize("axis", ["normal", "tangential"])
def test_slow_stiffness_of_a_finger_that_sticks(axis):
    scene = replace(sliding(ev.Flat(friction=5.0)), motion=[PRESSED, ev.Slide(1e-4, steps=1)])
    found = ev.impedance(scene, 1e-9, axis).stiffness[0]
    step, ends = 1e-5, []
    for change in (-step, step):
        last = ev.Press(indentation=0.5 + change, steps=1)
        column = "applied_force"
        if axis == "tangential":
            last, column = ev.Slide(1e-4 + change, steps=1), "applied_tangential_force"
        ends.append(ev.simulate(replace(scene, motion=[PRESSED, last]))[column][-1])
    assert found.real == pytest.approx((ends[1] - ends[0]) / (2.0 * step), rel=1e-4)


def test_penalties_give_way_under_a_finger_that_sticks_and_one_that_slips():
    """The limit of large penalties is exact contact; the springs add up as those of a block do."""
    law, width, p = tissue(nu=0.0), 8.0, 0.5
    rigid = stuck(block(4, 1, width, 1.0), [law])
    soft = ev.Solver(element="q1", contact="penalty", penalty_normal=p, penalty_tangential=0.2 * p)
    found = ev.impedance(replace(rigid, solver=soft), 1e-9).stiffness[0].real
    assert found == pytest.approx(width / (1.0 / 0.034 + 1.0 / p), rel=1e-4)
    stiff = replace(
        sliding(), solver=ev.Solver(contact="penalty", penalty_normal=1e6, penalty_tangential=1e6)
    )
    assert ev.impedance(stiff, 1e-9).stiffness[0].real == pytest.approx(
        ev.impedance(sliding(), 1e-9).stiffness[0].real, rel=1e-4
    )


def test_friction_that_grows_with_the_speed_damps():
    """Of a block that slips as a whole: the derivative of its friction force by the speed."""
    law, speed, exponent = tissue(nu=0.0, E=1.0), 10.0, 0.4
    friction = ev.RateFriction(speed=speed, exponent=exponent, ratio=1.0)
    motion = [ev.Press(indentation=0.1, steps=2), ev.Slide(2.0, speed=speed, steps=4)]
    scene = replace(stuck(block(4, 1, 8.0, 1.0), [law], motion), friction_law=friction)
    scene = replace(scene, surface=ev.Flat(friction=0.05, y=0.0))
    load = ev.simulate(scene).normal_force[-1]
    found = ev.impedance(scene, 0.01, "tangential")
    # the block shears by little: its own stiffness is far above that of the dashpot
    assert found.impedance[0].real == pytest.approx(0.05 * load * exponent / speed, rel=0.01)


@pytest.mark.filterwarnings("ignore:motion .* slides at")
def test_a_small_vibration_in_time():
    """The bone goes to and fro along a sampled sine: amplitude and phase of the force in the last period, of
    second order in the step.
    """
    law = tissue(relaxation=((0.8, 0.004), (0.5, 0.07)), bulk_relaxation=True)
    amplitude, frequency = 1e-3, 20.0
    scene = stuck(block(3, 3, 3.0, 2.0), [law], ev.Press(indentation=0.1, steps=2))
    exact = ev.impedance(scene, frequency, "tangential").stiffness[0]
    errors = []
    for n in (10, 20):
        x = amplitude * np.sin(2.0 * np.pi * np.arange(6 * n + 1) / n)
        slides = [ev.Slide(d, speed=abs(d) * frequency * n, steps=1) for d in np.diff(x)]
        run = replace(
            scene, motion=[*scene.motion, *slides], solver=replace(scene.solver, dynamics="viscous")
        )
        force = ev.simulate(run).applied_tangential_force[-n:]
        turned = np.exp(-2j * np.pi * np.arange(1, n + 1) / n)
        errors.append(abs(2j * (turned @ force) / n / amplitude / exact - 1.0))
    assert errors[1] < 0.01
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.2)


def test_a_result_is_run_again():
    scene = replace(sliding(), motion=[ev.Press(indentation=0.2, steps=1)])
    again = ev.impedance(ev.simulate(scene), [1.0, 100.0])
    np.testing.assert_array_equal(again.stiffness, ev.impedance(scene, [1.0, 100.0]).stiffness)
    assert repr(again).startswith("Impedance, normal: ")


def test_a_result_keeps_a_scene_that_no_file_holds(tmp_path):
    """A mesh in memory has the impedance of its scene, and a force linear in its only modulus. A file
    does not hold it, and no scene repeats the steps of a loop.
    """
    scene = stuck(block(4, 1, 8.0, 1.0), [tissue()])
    result = ev.simulate(scene)
    assert result.scene is scene
    found, expected = ev.impedance(result, 10.0).stiffness, ev.impedance(scene, 10.0).stiffness
    np.testing.assert_allclose(found, expected, rtol=1e-10)
    key = f"finger.materials.{next(iter(scene.finger.materials))}.E"
    by = ev.sensitivities(result, key, "normal_force").elasticity["normal_force", key]
    np.testing.assert_allclose(by, 1.0, atol=1e-6)  # linear in the one modulus of the scene
    result.save(tmp_path / "result.npz")
    with pytest.raises(ev.InputError, match="no file holds"):
        ev.impedance(ev.load(tmp_path / "result.npz"), 10.0)
    stepped = ev.loop(scene)
    stepped.step(indentation=2.0 * TINY)
    with pytest.raises(ev.InputError, match="no file holds"):
        ev.impedance(stepped.result(), 10.0)


@pytest.mark.parametrize("given", [0.0, -1.0, [], [[1.0]], "fast", [np.nan]])
def test_refused_frequencies(given):
    with pytest.raises(ev.InputError, match="frequencies: given"):
        ev.impedance(sliding(), given)


def test_refused():
    with pytest.raises(ev.InputError, match="axis"):
        ev.impedance(sliding(), 1.0, "sideways")
    with pytest.raises(ev.InputError, match="a Scene"):
        ev.impedance(1.0, 1.0)
    soft = ev.Flat(elastic=ev.ElasticLayer(E=1.0, nu=0.3, thickness=1.0))
    with pytest.raises(ev.InputError, match="a rigid surface"):
        ev.impedance(replace(sliding(), surface=soft), 1.0)
