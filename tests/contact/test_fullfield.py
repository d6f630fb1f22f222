"""The pad's attraction by the full field: forces, limits, bounds, runs."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tools.meshes import arc
from tools.pads import seen
from tools.refusals import refuses

import evfem as ev
from evfem.errors import Unresolved
from evfem.simulation.model import make_model
from evfem.terms import fullfield
from evfem.terms.attraction import Attraction
from evfem.terms.fullfield import STEEP, FieldAttraction, certificate, facing, in_line, in_sight


def attractions(pad, points, surface, skin_thickness=0.38):
    """By columns and by the full field."""
    skin = ev.Layer(np.full(len(points), skin_thickness), 1650.0)
    layers = ev.Layers.of(skin, surface.insulator)
    local = (ev.StrongTroxel(), layers, pad, surface, "normal")
    return Attraction(*local), FieldAttraction(*local, edges=facing(pad, points), skin=skin)


def test_the_full_field_of_a_flat_outline_is_the_law():
    """And it approaches the law with the square of the slopes."""
    surface = ev.Display(y=0.0)
    differences = []
    for radius in (4.0, 8.0, 16.0):
        pad, points = arc(60, radius, 2.0)
        points[:, 1] *= 0.5
        points[:, 1] += 0.1
        local, full = (a.forces(seen(a, points, 500.0)) for a in attractions(pad, points, surface, 0.0))
        differences.append(full[:, 1].sum() / local[:, 1].sum() - 1.0)
    assert 0.0 < differences[2] < 1e-3
    rates = np.log2(np.divide(differences[:-1], differences[1:]))
    assert np.all((rates > 1.5) & (rates < 2.5)), rates


def test_nodal_forces_are_known_to_what_counts_as_rounding():
    """Above a thin insulator, where cells are thin too; moves far below the solver's change them."""
    pad, points = arc(24, 3.0, 2.0)
    surface = ev.Display(insulator=ev.Layer(0.0066, 7.9), y=0.0)
    points[:, 1] = np.maximum(points[:, 1] - 0.005, 0.0)
    _, full = attractions(pad, points, surface)
    touching, rng = points[:, 1] <= 0.0, np.random.default_rng(5)
    forces = full.forces(seen(full, points, 361.0, touching))
    moved = [points + 1e-15 * rng.normal(size=points.shape) for _ in range(5)]
    noise = max(np.abs(full.forces(seen(full, there, 361.0, touching)) - forces).max() for there in moved)
    assert 1e-14 < noise / np.abs(forces).max() < full.rounding


@pytest.mark.parametrize("quadratic", [True, False])
def test_nodal_forces_are_the_derivative_of_the_energy(quadratic):
    """In both directions, over a textured insulator, some nodes nearly touching."""
    pad, points = arc(12, 3.0, 2.0, quadratic)
    rng = np.random.default_rng(3)
    surface = ev.Sinusoid(terms=[[0.02, 6.0, 0.3]], insulator=ev.FILM, y=0.0)
    points[:, 1] += 0.05 + rng.uniform(0.0, 0.01, len(points))
    _, full = attractions(pad, points, surface)
    way = rng.normal(size=points.shape)
    step = 2e-5

    def energy(s):
        return 0.5 * full.solve(points + s * way).value

    quotients = [energy(k * step) - energy(-k * step) for k in (1, 2, 3)]
    slope = (45.0 * quotients[0] - 9.0 * quotients[1] + quotients[2]) / (60.0 * step)
    assert np.sum(full.forces(seen(full, points, 1.0)) * way) == pytest.approx(slope, rel=1e-7)


def test_the_fields_stiffness_is_the_derivative_of_its_forces(monkeypatch):
    """Closed nodes move along the surface. Moved one by one it is exact; every eighth at once, what
    reaches farther than four nodes is counted with another one.
    """
    pad, points = arc(24, 3.0, 2.0)
    surface = ev.Sinusoid(terms=[[0.02, 6.0, 0.3]], insulator=ev.FILM, y=0.0)
    points[:, 1] = surface.height(points[:, 0]) + np.maximum(0.05 * points[:, 0] ** 2 - 2e-3, 0.0)
    _, full = attractions(pad, points, surface)
    closed = np.abs(points[:, 0]) < 0.2
    slope = surface.slope(points[:, 0])
    volts, step, size = 300.0, 1e-6, len(points)
    exact = np.zeros((2 * size, 2 * size))
    for node in range(size):
        for axis in range(2):
            way = np.zeros((size, 2))
            way[node, axis] = 1.0
            if closed[node]:
                way[node] = [1.0, slope[node]] if axis == 0 else 0.0
            # one-sided: the insulator is on one side of it
            ends = [full.forces(seen(full, points + k * step * way, volts)).ravel() for k in (0, 1, 2)]
            exact[:, 2 * node + axis] = (4.0 * ends[1] - ends[2] - 3.0 * ends[0]) / (2.0 * step)
    largest = np.abs(exact).max()
    far = full.full_stiffness(seen(full, points, volts)).toarray()
    assert np.abs(far - exact).max() < 0.03 * largest
    monkeypatch.setattr(fullfield, "APART", size)
    one_by_one = full.full_stiffness(seen(full, points, volts)).toarray()
    assert np.abs(one_by_one - exact).max() < 1e-4 * largest


def test_touching_nodes_are_pulled_as_by_the_law():
    """Where all of the outline touches, the field is that of insulator and skin in series."""
    pad, points = arc(10, 3.0, 2.0)
    points[:, 1] = 0.0
    local, full = (a.forces(seen(a, points, 300.0)) for a in attractions(pad, points, ev.Display(y=0.0)))
    assert full[:, 1].sum() == pytest.approx(local[:, 1].sum(), rel=1e-3)
    assert full[3:-3, 1] == pytest.approx(local[3:-3, 1], rel=0.13)  # four chords share out an edge


def test_flanks_keep_the_law_and_ridges_do_not_cut_the_chain():
    finger = ev.FingerPad(resolution="coarse")
    model = make_model(scene("local", finger, [ev.Hover(gap=0.1)]))
    points = model.mesh.points[model.pad.nodes]
    line = in_line(model.pad, facing(model.pad, points))
    assert np.all(np.diff(points[line, 0]) > 0.0)
    x = points[line, 0]
    # an ellipse of half axes a, b: |n_y| = .3 at x = a s, s / sqrt(1 - s^2) b / a = tan
    a, b = 8.34, 6.395
    steep = np.sqrt(1.0 - 0.3**2) / 0.3 * a / b
    assert x[-1] == pytest.approx(a * steep / np.hypot(1.0, steep), abs=0.3)


def test_what_is_behind_an_overhang_has_no_column():
    pad, points = arc(4, 3.0, 2.0, quadratic=False)
    _, full = attractions(pad, points, ev.Display(y=-0.1))
    points[5] = points[4] + [-0.1, 0.3]
    assert full.visible(points).shape == (8, 9)
    assert 5 not in full.visible(points).indices
    assert full.forces(seen(full, points, 1.0))[5] == pytest.approx([0.0, 0.0])


@pytest.mark.parametrize(
    ("slope", "seen"), [(0.0, [0, 1, 2, 3]), (0.99 * STEEP, [0, 1, 2, 3]), (1.01 * STEEP, [0, 1, 3])]
)
def test_the_higher_end_of_a_steep_wall_has_no_column(slope, seen):
    wall = np.array([[0.0, 0.0], [1.0, 0.0], [1.1, 0.1 * slope], [2.0, 0.1 * slope + 0.1]])
    assert in_sight(wall).tolist() == seen
    assert in_sight(wall[::-1] * [-1.0, 1.0]).tolist() == sorted(3 - k for k in seen)


@pytest.mark.parametrize("beyond", [-0.01, 0.01])
def test_a_capacitance_outside_its_bounds_is_an_error(monkeypatch, beyond):
    """By a hundredth it is wrong, by a ten-thousandth it may be the mesh."""
    pad, points = arc(4, 3.0, 2.0)
    points[:, 1] += 0.1
    _, full = attractions(pad, points, ev.Display(y=0.0))
    bounds = full.bounds(*full.outline(full.bare(points), full.visible(points)))
    edge = bounds.lower if beyond < 0.0 else bounds.upper
    found = SimpleNamespace(value=edge * (1.0 + 0.01 * beyond))
    monkeypatch.setattr(type(full), "solve", lambda *_: found)
    full.check(points)
    found.value = edge * (1.0 + beyond)
    with pytest.raises(ev.EvfemError, match="not between its bounds"):
        full.check(points)


def scene(field, finger, motion, **options):
    options = {"voltage": 1000.0, "direction": "normal"} | options
    return ev.Scene(finger, ev.Display(), ev.StrongTroxel(), motion=motion, field=field, **options)


SMOOTH = ev.FingerPad(ridges=False, resolution="coarse")


def test_a_run_whose_field_the_mesh_does_not_resolve_keeps_what_it_has(monkeypatch):
    deep = []

    def check(attraction, points):
        deep.append(points)
        if len(deep) > 1:
            raise Unresolved("a finer mesh of the finger resolves it")

    monkeypatch.setattr(FieldAttraction, "check", check)
    with pytest.raises(ev.NotConverged, match=r"step 2 did not converge; a finer mesh") as failed:
        ev.simulate(scene("full", SMOOTH, [ev.Hover(gap=0.1, steps=2)]))
    assert len(failed.value.result.step) == 1


def test_a_hovering_pad_feels_the_field_of_its_outline():
    """The same points in `rigid_field`, which takes the curve; its ends are planes of symmetry."""
    pad, points = arc(80, 3.0, 1.0, quadratic=False)
    points[:, 1] += 0.04 * (1.0 - np.cos(8.0 * np.pi * points[:, 0])) + 0.02
    local, full = (a.forces(seen(a, points, 100.0)) for a in attractions(pad, points, ev.Display(y=0.0), 0.0))
    x = np.append(points[:, 0], 1.0 + points[1:, 0])
    height = np.append(points[:, 1], points[-2::-1, 1])
    rigid = ev.electrostatics.rigid_field(x, height, slab=ev.FILM, voltage=100.0)
    assert -2.0 * full[:, 1].sum() == pytest.approx(rigid.force, rel=2e-3)
    assert -2.0 * local[:, 1].sum() < 0.95 * rigid.force


@pytest.mark.slow
def test_the_energy_of_a_moving_run_is_balanced():
    """What the steps lose falls with their square, as it does with the law."""
    lost = []
    for steps in (2, 4):
        motion = [ev.Press(indentation=0.1), ev.Press(indentation=0.3, steps=steps)]
        result = ev.simulate(scene("full", SMOOTH, motion))
        energy = result.external_work + result.electrostatic_work - result.stored_energy
        energy = energy - result.friction_dissipation - result.snap_dissipation
        assert energy == pytest.approx(result.integrator_dissipation, abs=1e-9)
        lost.append(np.ptp(result.integrator_dissipation[[0, -1]]))
    assert lost[1] < 0.35 * lost[0]


def test_the_plan_chooses_by_the_bounds():
    ridged = ev.FingerPad(resolution="coarse")
    motion = [ev.Hover(gap=2.0)]
    far = ev.plan(scene("auto", SMOOTH, motion))
    near = ev.plan(scene("auto", ridged, [ev.Press(force=0.05)]))
    asked = ev.plan(scene("full", SMOOTH, motion))
    lifted = ev.plan(scene("auto", SMOOTH, [ev.Press(force=0.05), ev.Press(indentation=-2.0)]))
    assert lifted.terms == ev.plan(scene("auto", SMOOTH, [ev.Press(force=0.05), *motion])).terms
    assert "at a gap of 2 mm" in " ".join(str(lifted).split())
    assert (near.has("full field"), asked.has("full field")) == (True, True)
    assert "at first touch the column law's energy is at most" in " ".join(str(near).split())
    assert "at a gap of 2 mm" in " ".join(str(far).split())
    model = make_model(scene("auto", ridged, [ev.Press(force=0.05)]))
    assert isinstance(model.attraction, FieldAttraction)
    law = ev.Scene(ridged, ev.Display(), ev.Kaczmarek(), 100.0, [ev.Press(force=0.05)], field="auto")
    assert not ev.plan(law).has("full field")


WAIT = ev.Wait(duration=0.1)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"field": "whole"}, "local | full | auto"),
        ({"field": "full", "law": ev.Kaczmarek()}, "Kaczmarek"),
        ({"field": "full", "air_layer": False}, "air_layer"),
        ({"field": "full", "drive": ev.Drive(resolved=True, frequency=50.0), "motion": [WAIT]}, "resolved"),
        ({"field": "full", "drive": ev.Drive(), "voltage": ev.Sine(50.0, 9.0, bias=9.0)}, "direct"),
    ],
)
def test_what_has_no_full_field_is_refused(options, said):
    options = {"law": ev.StrongTroxel(), "voltage": 10.0, "motion": [ev.Press(force=0.05)]} | options
    assert said in str(refuses(r"electrostatics\.field", ev.Scene, SMOOTH, ev.Display(), **options))


ENDED = ev.Display(electrodes=[[-20.0, -0.1, 1.0], [0.1, 20.0, 0.0]])


def test_a_floating_finger_on_two_electrodes_feels_a_quarter():
    """Half of the voltage falls over each half of the pad; one electrode alone does not pull it."""
    motion = [ev.Hover(gap=0.1)]
    pulls = []
    for display, grounded in ((ENDED, False), (ev.Display(), True), (ev.Display(), False)):
        options = {"field": "full", "grounded": grounded, "direction": "normal"}
        one = ev.Scene(SMOOTH, display, ev.StrongTroxel(), 300.0, motion, **options)
        pulls.append(ev.simulate(one).electrostatic_force[0])
    assert pulls[0] / pulls[1] == pytest.approx(0.25, rel=0.15)
    assert abs(pulls[2]) < 1e-3 * pulls[1]


def test_electrodes_that_end_need_the_full_field():
    options = {"law": ev.StrongTroxel(), "voltage": 10.0, "motion": [ev.Press(force=0.05)]}
    refuses(
        "electrodes that end; allowed: full, .* in the plane only: in space there is",
        ev.Scene,
        SMOOTH,
        ENDED,
        **options,
    )
    tip, circle = ev.Fingertip(resolution="coarse"), "allowed: .*in space there is only one electrode"
    for field in ("local", "auto"):
        refuses(circle, ev.Scene, tip, ENDED, field=field, **options)
    refuses(circle, ev.plan, ev.Scene(tip, ENDED, field="full", **options))
    refuses("not grounded", ev.Scene, SMOOTH, ev.Display(), grounded=False, **options)
    for rows in ([[0.0, 1.0, 2.0]], [[1.0, 0.0, 1.0]], [[0.0, 1.0, 1.0], [1.0, 2.0, -1.0]]):
        refuses(r"surface\.electrodes", ev.Display, electrodes=rows)


def test_a_pad_beside_the_electrode_is_pulled_towards_it():
    """Past the edge hardly anything attracts; across it the pull goes back to the electrode."""
    pad, points = arc(40, 40.0, 4.0)
    points[:, 1] += 0.05
    forces = []
    for end in (9.0, 0.013, -9.0):
        surface = ev.Display(y=0.0, electrodes=[[-20.0, end, 1.0]])
        _, full = attractions(pad, points, surface)
        forces.append(full.forces(seen(full, points, 300.0)).sum(axis=0))
    on, across, beside = forces
    assert across[1] == pytest.approx(0.5 * on[1], rel=0.1)
    assert abs(beside[1]) < 1e-3 * abs(on[1])
    # energy per width of a plate, which the electrode's edge gives up
    plate = 0.5 * ev.eps_0 * 300.0**2 / (0.05 + 0.09 / 3.35 + 0.38 / 1650.0)
    assert across[0] == pytest.approx(-plate, rel=0.2)


def test_the_force_does_not_waver_when_nodes_pass_an_edge():
    """A flat pad: all the same wherever the edge is between two columns 0.025 mm apart."""
    pad, points = arc(40, 40.0, 4.0)
    points[:, 1] = 0.1
    forces = []
    for end in np.linspace(0.0, 0.025, 6):
        _, full = attractions(pad, points, ev.Display(y=0.0, electrodes=[[-20.0, end, 1.0]]))
        forces.append(full.forces(seen(full, points, 300.0)).sum(axis=0)[0])
    assert np.ptp(forces) < 0.01 * abs(np.mean(forces))


def test_rough_faces_keep_the_field_as_far_apart_as_a_higher_finger():
    finger = ev.FingerPad(resolution="coarse", ridges=False)

    def pulled(gap, rough):
        scene = ev.Scene(
            finger,
            ev.Display(ev.FILM),
            ev.StrongTroxel(),
            500.0,
            ev.Hover(gap),
            field="full",
            roughness_gap=rough,
        )
        return ev.simulate(scene).electrostatic_force[-1]

    rough = pulled(0.1, 0.002)
    assert rough == pytest.approx(pulled(0.102, 0.0), rel=1e-3)
    assert rough < 0.99 * pulled(0.1, 0.0)


@pytest.mark.parametrize("filling", [1.0, 3.8])
def test_bounds_know_what_fills_the_gap(filling):
    """Above a flat outline both are the capacitance of a plate; above a curved one the field's is
    between them.
    """
    film = ev.Layer(0.001, 3.9)
    x = np.linspace(0.0, 2.0, 5)
    levels = np.stack([np.zeros(5), np.full(5, 0.009)])
    flat = certificate(x, levels, film, np.zeros(5), filling)
    plate = ev.eps_0 * 2.0 / (0.009 / filling + 0.001 / 3.9)
    assert [flat.lower, flat.upper] == pytest.approx([plate, plate], rel=1e-12)
    pad, points = arc(30, 8.0, 2.0)
    points[:, 1] += 0.009
    surface, law = ev.Display(insulator=film, y=0.0), ev.StrongTroxel(filling)
    skin = ev.Layer(np.full(len(points), 0.38), 1650.0)
    layers = ev.Layers.of(skin, film)
    full = FieldAttraction(law, layers, pad, surface, "normal", edges=facing(pad, points), skin=skin)
    full.check(points)


def test_bounds_know_how_uneven_the_display_is():
    """Between tilted plates, a layer of air alone, both follow from the distance along the normal; over
    steep waves the field's capacitance is below the upper one.
    """
    x = np.linspace(0.0, 2.0, 5)
    tilted = certificate(x, np.stack([0.5 * x, 0.5 * x + 0.01]), ev.Layer(0.0, 1.0), np.zeros(5))
    assert tilted.upper == pytest.approx(ev.eps_0 * 2.0 / 0.01 * (1.0 + 0.5**2), rel=1e-12)
    assert tilted.lower == pytest.approx(ev.eps_0 * 2.0 / 0.01, rel=1e-12)
    pad, points = arc(60, 3.0, 2.0)
    surface = ev.Sinusoid(terms=[[0.05, 8.0, 0.3]], insulator=ev.Layer(0.02, 4.0), y=0.0)
    points[:, 1] = surface.height(points[:, 0]) + 0.01 + 0.1 * points[:, 0] ** 2
    _, full = attractions(pad, points, surface, 0.0)
    bounds = full.bounds(*full.outline(full.bare(points), full.visible(points)))
    value = full.solve(points).value
    assert bounds.lower < value < bounds.upper
    flat = certificate(
        points[:, 0],
        np.stack([0.0 * points[:, 0], points[:, 1] - surface.height(points[:, 0])]),
        surface.insulator,
        np.zeros(len(points)),
    )
    assert value > flat.upper  # the bound that took the display for flat


DRY = ev.Drive(frequency=250.0, skin="gabriel_dry", gap_conductivity=1e-8)


def driven(field, drive, motion, voltage=50.0, insulator=ev.TOUCHSCREEN):
    given = {"direction": "normal", "field": field, "drive": drive, "solver": ev.Solver(core="off")}
    display = ev.Display(insulator, friction=0.3)
    return ev.Scene(SMOOTH, display, ev.StrongTroxel(), voltage, motion, **given)


def test_a_driven_pad_feels_the_field_of_layers_that_conduct():
    """Far from contact both are near the law; what loses nothing has the energy's forces to the bit."""
    hover = [ev.Hover(gap=0.02)]
    pulls = {
        (field, drive is DRY): ev.simulate(driven(field, drive, hover)).electrostatic_force[0]
        for field in ("local", "full")
        for drive in (DRY, ev.Drive(frequency=250.0), None)
    }
    assert pulls["full", True] == pytest.approx(pulls["local", True], rel=5e-3)
    assert pulls["full", True] != pytest.approx(pulls["full", False], rel=1e-4)
    same = [ev.simulate(driven("full", drive, hover)) for drive in (ev.Drive(frequency=250.0), None)]
    assert same[0].electrostatic_force[0] == same[1].electrostatic_force[0]


def test_harmonics_of_a_square_wave_add_up():
    """A pad over the whole spectrum is pulled by the sum over its harmonics' sines."""
    square = replace(DRY, waveform="square")  # a skin whose permittivity falls with the frequency
    hover = [ev.Hover(gap=0.02)]
    attraction = make_model(driven("full", square, hover)).attraction
    assert sum(one.weight for one in attraction.harmonics) == pytest.approx(1.0)
    local = make_model(driven("local", square, hover)).attraction
    pad, points = arc(12, 3.0, 2.0)
    points[:, 1] = 0.0003
    skin = ev.Layer(np.full(len(points), 0.38), 1650.0)
    of = (local.law, ev.Layers(local.layers.reduced[:, :1], 0.381, local.layers.loss[:, :1]))
    surface = ev.Display(ev.TOUCHSCREEN, y=0.0)
    given = {"edges": facing(pad, points), "skin": skin, "harmonics": attraction.harmonics}
    flat = type(attraction)(*of, pad, surface, "normal", **given)
    pulls = [one.forces(seen(flat, points, 50.0))[:, 1].sum() for one in (flat, flat.column_law)]
    assert pulls[0] == pytest.approx(pulls[1], rel=1e-3)


@pytest.mark.slow
def test_works_of_a_driven_run_know_the_fringes():
    """Without them, or with the columns' alone, what the steps lose would not fall with their square."""
    lost = []
    for steps in (4, 8):
        motion = [ev.Press(indentation=0.1), ev.Press(indentation=0.3, steps=steps)]
        result = ev.simulate(driven("full", DRY, motion, 800.0, ev.FILM))
        lost.append(np.ptp(result.integrator_dissipation[[0, -1]]))
    assert lost[1] < 0.3 * lost[0]


@pytest.mark.slow
def test_the_exact_encoding_drives_the_full_field():
    """A wished friction force is met with the field of layers that conduct."""
    motion = [ev.Press(force=0.05, steps=2), ev.Slide(distance=1.5, steps=4)]
    wished = ev.FollowForce([0.0, 1.5], [0.016, 0.016], 3000.0)
    result = ev.simulate(driven("full", DRY, motion, wished, ev.FILM))
    assert result.applied_tangential_force[-2:] == pytest.approx([0.016] * 2, rel=1e-6)
    left = result.normal_force - result.electrostatic_force
    assert result.applied_force == pytest.approx(left, rel=1e-6)


def test_the_stiffness_under_an_electrode_that_ends(monkeypatch):
    """One column against differences of forces."""
    pad, points = arc(12, 3.0, 1.0)
    points[:, 1] += 0.01
    _, full = attractions(pad, points, ev.Display(y=0.0, electrodes=[[-20.0, 0.13, 1.0]]))
    monkeypatch.setattr(fullfield, "APART", len(points))
    found = full.full_stiffness(seen(full, points, 300.0)).toarray()
    node, step = len(points) // 2, 1e-6
    way = np.zeros_like(points)
    way[node, 1] = step
    ends = [full.forces(seen(full, points + sign * way, 300.0)).ravel() for sign in (1.0, -1.0)]
    exact = (ends[0] - ends[1]) / (2.0 * step)
    assert found[:, 2 * node + 1] == pytest.approx(exact, abs=1e-4 * np.abs(exact).max())


@pytest.mark.parametrize("element", ["q2p1", "q1_fbar"])
def test_traction_below_a_smooth_pad_is_smooth_and_normal(element):
    """A hovering conductor: by the lengths of the edges its traction zigzags by a fifth on quadratic ones."""
    pad, above = ev.FingerPad(ridges=False, resolution="coarse"), ev.Hover(gap=0.05)
    film, solver = ev.Display(friction=0.0), ev.Solver(element=element)
    scene = ev.Scene(pad, film, ev.StrongTroxel(), 300.0, above, field="full", solver=solver)
    result = ev.simulate(scene)
    frame, model = result.frames[-1], make_model(scene)
    place = (model.mesh.points + frame.displacement)[model.pad.nodes]
    order = np.argsort(place[:, 0])
    middle = order[np.abs(place[order, 0]) < 1.5]
    traction = frame.electrostatic_traction[model.pad.nodes][middle]
    np.testing.assert_allclose(traction[1:-1], 0.5 * (traction[2:] + traction[:-2]), rtol=0.006)
    above = seen(model.attraction, place, 300.0)
    forces, weights = model.attraction.forces(above), model.attraction.weights(above)
    np.testing.assert_allclose(np.hypot(*forces[middle].T), traction * weights[middle], rtol=1e-6)
    along = place[middle[2:]] - place[middle[:-2]]
    pulled = forces[middle[1:-1]]
    tangential = np.sum(along * pulled, axis=1) / np.linalg.norm(along, axis=1)
    assert np.abs(tangential).max() < 0.01 * np.linalg.norm(pulled, axis=1).max()
    np.testing.assert_allclose(weights.sum(), model.pad.tributary(place).sum(), rtol=1e-3)
