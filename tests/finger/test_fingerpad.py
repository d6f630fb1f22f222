"""The finger by parameters: outline and ridges on their formula, offset layers, counts, symmetry, quality."""

import numpy as np
import pytest
from tools.refusals import refuses

import evfem as ev
from evfem import data
from evfem.common.checks import Within, keys_of
from evfem.errors import InputError, readable
from evfem.finger.fingerpad import RESOLUTIONS, FingerPad, MeshedFinger
from evfem.finger.fingertip import Fingertip
from evfem.finger.layers import LAYERS, NAIL, TABLE_2
from evfem.mesh.faces import layer_thickness
from evfem.mesh.quality import scaled_jacobian
from evfem.tissue.laws import NeoHookean

A, B = 8.34, 6.395
#: lowest and highest value of each number, and its unit
RANGES = {
    key.name: (key.rule["test"].low, key.rule["test"].high, key.rule["unit"])
    for key in keys_of(FingerPad)
    if isinstance(key.rule.get("test"), Within) and "unit" in key.rule
}
UNITS = {"ridge_crest": "of the pitch", "ridge_groove": "of the pitch"}


def green_area(mesh):
    """Area of the region inside the outer edges, exactly also for parabolas (Simpson), mm^2."""
    p = mesh.points[mesh.outer_sides]
    a, b = p[:, 0], p[:, 1]
    chord = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    if mesh.order == 1:
        return chord.sum()
    # a parabola bulges out by 2/3 of chord times height: twice the triangle start, end, middle, times 2/3
    m = p[:, 2]
    triangle = 0.5 * ((b - a)[:, 0] * (m - a)[:, 1] - (b - a)[:, 1] * (m - a)[:, 0])
    return chord.sum() - 4.0 / 3.0 * triangle.sum()


def from_ellipse(pad, points):
    """Abscissa of the nearest point of the outer ellipse, and distance from it, below y = 0
    (Newton's method).
    """
    x, y = points.T
    a, b = 0.5 * pad.width, 0.5 * pad.height
    theta = np.arctan2(a * y, b * x)
    for _ in range(60):
        c, s = np.cos(theta), np.sin(theta)
        slope = (x - a * c) * a * s - (y - b * s) * b * c
        bend = (x - a * c) * a * c + (y - b * s) * b * s + a * a * s * s + b * b * c * c
        theta = theta - slope / bend
    return a * np.cos(theta), np.hypot(x - a * np.cos(theta), y - b * np.sin(theta))


def outline_ridges(pad, mesh):
    """Abscissa of the foot on the ellipse, and depth below it, of every pad node."""
    return from_ellipse(pad, mesh.points[mesh.node_sets["pad"]])


@pytest.mark.parametrize("order", [1, 2])
def test_area_of_the_smooth_section_is_ellipse_minus_bone(order):
    # pi a b of the outline minus that of the bone; chords lose O(h^2), parabolas O(h^4); h is a third in
    # "fine"
    exact = np.pi * (A * B - 3.0 * 2.5)
    errors = []
    for resolution in ("coarse", "fine"):
        mesh = FingerPad(ridges=False, resolution=resolution).mesh(order)
        errors.append(abs(green_area(mesh) - exact) / exact)
    assert errors[1] < (3e-4 if order == 1 else 1e-7)
    assert errors[0] / errors[1] > (3.0**1.9 if order == 1 else 3.0**3.5)


@pytest.mark.parametrize(
    ("resolution", "nodes"), [("coarse", 3000), ("medium", 10000), ("paper", 22500), ("fine", 50000)]
)
@pytest.mark.parametrize("ridges", [True, False])
def test_presets_have_the_promised_number_of_nodes_for_both_orders(resolution, nodes, ridges):
    counts = [len(FingerPad(resolution=resolution, ridges=ridges).mesh(order).points) for order in (1, 2)]
    assert counts == pytest.approx([nodes, nodes], rel=0.13)
    assert counts[0] == pytest.approx(counts[1], rel=0.09)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("phase", [0.0, 0.5])
def test_mesh_is_symmetric_and_has_nodes_on_crests_and_grooves(order, phase):
    pad = FingerPad(resolution="coarse", ridge_phase=phase)
    mesh = pad.mesh(order)
    points = mesh.points
    mirrored = points * [-1.0, 1.0]
    order_of = [np.lexsort(np.round(p, 9).T) for p in (points, mirrored)]
    np.testing.assert_allclose(points[order_of[0]], mirrored[order_of[1]], atol=1e-12)
    foot, _ = outline_ridges(pad, mesh)
    for position in np.arange(-6, 6.1, 0.25):  # crests and grooves alternate every half pitch
        assert np.abs(foot - position).min() < 1e-9


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("exponent", [3.0, 7.0])
def test_outline_nodes_lie_on_the_ridge_formula(order, exponent):
    pad = FingerPad(ridge_exponent=exponent, ridge_phase=0.5, ridge_width=0.6, ridge_height=0.12)
    foot, depth = outline_ridges(pad, pad.mesh(order))
    crest = 0.6 * (np.round(foot / 0.6 - 0.5) + 0.5)
    t = np.abs(foot - crest) / 0.3
    ridged, smooth = np.abs(foot) <= 0.72 * A, np.abs(foot) >= 0.79 * A
    np.testing.assert_allclose(depth[ridged], 0.12 * t[ridged] ** exponent, atol=1e-11)
    np.testing.assert_allclose(depth[smooth], 0.0, atol=1e-12)
    assert (depth <= 0.12 + 1e-12).all()
    assert ridged.sum() > 300


@pytest.mark.parametrize("order", [1, 2])
def test_stratum_corneum_is_as_thick_as_asked_for(order):
    smooth = FingerPad(ridges=False, stratum_corneum_thickness=0.31).mesh(order)
    nodes = smooth.node_sets["pad"]
    # normal offset of the ellipse: every node of the outline has its partner at exactly that distance
    np.testing.assert_allclose(layer_thickness(smooth, "stratum_corneum", nodes), 0.31, rtol=1e-5)
    pad = FingerPad()
    mesh = pad.mesh(order)
    _, depth = outline_ridges(pad, mesh)
    thickness = layer_thickness(mesh, "stratum_corneum", mesh.node_sets["pad"])
    np.testing.assert_allclose(thickness, 0.38 - depth, rtol=1e-5)
    assert thickness.min() == pytest.approx(0.23, rel=1e-6)


@pytest.mark.parametrize("order", [1, 2])
def test_layers_below_are_offsets_of_the_smooth_ellipse_despite_the_ridges(order):
    pad = FingerPad(resolution="coarse", epidermis_thickness=0.4, dermis_thickness=0.9)
    mesh = pad.mesh(order)
    layers = ["stratum_corneum", "epidermis", "dermis", "hypodermis"]
    for upper, lower, depth in zip(layers[:-1], layers[1:], np.cumsum([0.38, 0.4, 0.9]), strict=True):
        shared = np.intersect1d(mesh.cells[mesh.cells_of(upper)], mesh.cells[mesh.cells_of(lower)])
        points = mesh.points[shared]
        _, distance = from_ellipse(pad, points[points[:, 1] < -0.5])
        assert len(distance) > 40
        np.testing.assert_allclose(distance, depth, rtol=1e-9)


def test_table_2_is_that_of_the_paper():
    table, signs = data.load("table2"), ("sc", "ed", "d", "hd", "n")
    names = [table["name"][table["symbol"].index(f"E_{s}")].split(" of ")[1].replace(" ", "_") for s in signs]
    printed = [(table.value(f"E_{s}"), table.value(f"nu_{s}")) for s in signs]
    assert dict(zip(names, printed, strict=True)) == TABLE_2
    used = {layer.name: layer.moduli for layer in (*LAYERS, NAIL)}
    assert {name: used[name] for name in names} == TABLE_2


def test_sets_are_the_lower_outline_the_nail_and_the_bone():
    pad = FingerPad()
    mesh = pad.mesh(1)
    lower = mesh.points[mesh.node_sets["pad"]]
    assert lower[:, 1].max() == 0.0
    np.testing.assert_allclose([lower[:, 0].min(), lower[:, 0].max()], [-A, A], rtol=1e-14)
    assert lower[:, 1].min() == -B
    nail = mesh.points[mesh.node_sets["nail"]]
    assert np.abs(nail[:, 0]).max() == pytest.approx(5.5)
    np.testing.assert_allclose((nail[:, 0] / A) ** 2 + (nail[:, 1] / B) ** 2, 1.0)
    edges = [len(mesh.sides_of(name)) for name in ("pad", "nail", "bone")]
    assert edges[0] == len(lower) - 1
    assert edges[1] == len(nail) - 1
    assert edges[2] == len(mesh.node_sets["bone"])


EXTREMES = [
    {"dermis_thickness": 0.5, "ridge_width": 0.75},
    {"epidermis_thickness": 0.15, "ridge_width": 0.75, "nail_thickness": 0.45},
    {"width": 12.0, "height": 14.4, "ridge_width": 0.54, "nail_width": 9.6, "ridge_phase": 0.25},
    {"width": 24.0, "height": 12.0, "ridge_width": 0.8, "ridge_phase": 0.75, "dermis_thickness": 0.5},
    {"stratum_corneum_thickness": 0.1, "ridges": False, "nail_thickness": 0.2, "bone_offset": 2.0},
    {
        "stratum_corneum_thickness": 0.8,
        "dermis_thickness": 1.5,
        "ridge_width": 0.3,
        "ridge_height": 0.1,
        "bone_height": 2.0,
    },
    {"ridge_crest": 0.55, "ridge_groove": 0.15},
    {"bone_width": 12.0, "bone_height": 2.0, "bone_offset": 0.0},
    {"bone_width": 2.0, "bone_height": 8.0, "bone_offset": 0.2},
]


@pytest.mark.parametrize("values", EXTREMES)
def test_scaled_jacobian_at_the_ends_of_the_range(values):
    for resolution in RESOLUTIONS:
        for order in (1, 2):
            mesh = FingerPad(resolution=resolution, **values).mesh(order)
            assert scaled_jacobian(mesh).min() > 0.2, (resolution, order)


@pytest.mark.parametrize(
    ("values", "key"),
    [
        ({"width": 3.0}, "finger.width"),
        ({"width": float("nan")}, "finger.width"),
        ({"height": "12"}, "finger.height"),
        ({"height": 19.0, "width": 13.0}, "finger.height"),
        ({"ridges": 1}, "finger.ridges"),
        ({"ridge_height": -0.1}, "finger.ridge_height"),
        ({"ridge_height": 0.3}, "finger.ridge_height"),
        ({"ridge_exponent": 9.0}, "finger.ridge_height"),
        ({"ridge_width": 0.76}, "finger.ridge_width"),
        ({"ridge_crest": 0.8, "ridge_groove": 0.3}, "finger.ridge_crest"),
        ({"ridge_crest": 0.85}, "finger.ridge_height"),
        ({"stratum_corneum_thickness": 0.2}, "finger.ridge_height"),
        ({"dermis_thickness": 2.0, "width": 20.0, "height": 10.0}, "finger.dermis_thickness"),
        ({"nail_thickness": 0.9}, "finger.nail_thickness"),
        ({"nail_width": 14.0}, "finger.nail_width"),
        ({"bone_height": 9.0}, "finger.bone_height"),
        ({"bone_offset": 2.2}, "finger.bone_height"),
        ({"resolution": "ultra"}, "finger.resolution"),
        ({"materials": {"skin": NeoHookean(E=1.0, nu=0.3)}}, "finger.materials.skin"),
        ({"viscosity": -1.0}, "finger.viscosity"),
    ],
)
def test_geometry_that_cannot_exist_gets_a_sentence(values, key):
    caught = refuses("allowed", FingerPad, **values)
    assert caught.key == key
    assert "allowed" in str(caught)


def test_every_number_of_the_finger_has_a_range():
    assert set(RANGES) == {key.name for key in keys_of(FingerPad) if key.annotation is float}


@pytest.mark.parametrize("name", RANGES)
def test_a_wrong_number_gets_the_sentence_of_its_parameter(name):
    low, high, unit = RANGES[name]
    for value in ("abc", None, True, low - 0.3, high + 0.3, float("nan"), float("-inf")):
        caught = refuses("allowed", FingerPad, **{name: value})
        of_what = "a number, " if value == "abc" else ""
        expected = f"finger.{name}: given {readable(value)}; allowed: {of_what}{low:g} to {high:g} {unit}"
        assert str(caught) == expected.rstrip().replace("pitches", UNITS.get(name, "pitches"))


def test_meshed_finger_raises_its_mesh_and_wants_every_material():
    linear = FingerPad(resolution="coarse").mesh(1)
    laws = FingerPad().materials
    finger = MeshedFinger(linear, laws)
    assert finger.mesh(1).kind == "quad"
    assert finger.mesh(2).kind == "quad9"
    assert len(finger.mesh(2).node_sets["pad"]) == 2 * len(linear.node_sets["pad"]) - 1
    with pytest.raises(InputError, match=r"finger\.materials\.nail"):
        MeshedFinger(linear, {name: law for name, law in laws.items() if name != "nail"})
    refuses(r"no such region; allowed: nail\? \(", MeshedFinger, linear, {**laws, "Nail": laws["nail"]})
    refuses("no such region", MeshedFinger, linear, {**laws, "skin": laws["nail"]})
    refuses(r"solver\.element", MeshedFinger(FingerPad(resolution="coarse").mesh(2), laws).mesh, 1)


def test_participants_are_as_wide_and_high_as_measured_and_scaled():
    measured, usual = data.load("table1"), FingerPad()
    for i, name in enumerate(measured["participant"]):
        finger = FingerPad.participant(name, "coarse")
        points = finger.mesh(1).points
        assert np.ptp(points[:, 0]) == pytest.approx(measured["a"][i], abs=1e-12)
        assert np.ptp(points[:, 1]) == pytest.approx(measured["b"][i], abs=1e-12)
        # the shares that bone and layers have of Table 2's finger
        for key in ("bone_width", "nail_width", "dermis_thickness"):
            share = getattr(finger, key) / finger.width
            assert share == pytest.approx(getattr(usual, key) / usual.width, rel=1e-12)
        assert finger.bone_height / finger.height == pytest.approx(usual.bone_height / usual.height)
        assert (finger.ridge_height, finger.stratum_corneum_thickness) == (0.15, 0.38)
        assert (finger.materials, finger.resolution) == (usual.materials, "coarse")


def test_an_unknown_participant_is_refused():
    for name in ("xii", 3):
        refuses(r"finger\.participant: given .*; allowed: i \| ii \| iii", FingerPad.participant, name)


@pytest.mark.parametrize(("finger", "cells"), [(FingerPad, 20), (Fingertip, 8)])
def test_cells_per_ridge_are_distances_of_nodes_from_crest_to_crest(finger, cells):
    pad = finger(resolution="coarse", ridge_width=0.6, cells_per_ridge=cells)
    mesh = pad.mesh()
    points = mesh.points[mesh.node_sets["pad"]]
    middle = points[np.abs(points[:, 2:]).sum(axis=1) < 1e-9, 0]
    # three ridges and half a distance on both sides
    assert np.count_nonzero(np.abs(middle) < 0.9 + 0.3 / cells) == 3 * cells + 1
    assert len(finger(resolution="coarse", cells_per_ridge=2 * cells).mesh().points) > len(mesh.points)


@pytest.mark.parametrize("cells", [5, 2, 98, 6.5, "many"])
def test_cells_per_ridge_that_no_mesh_has_are_refused(cells):
    for finger in (FingerPad, Fingertip):
        with pytest.raises(
            InputError, match=r"finger.cells_per_ridge: given .*an even whole number from 4 to 96"
        ):
            finger(cells_per_ridge=cells)
        refuses("8 without ridges; allowed: a pad with ridges", finger, ridges=False, cells_per_ridge=8)


def test_the_plan_says_errors_of_area_and_peak_pressure_that_hold():
    def pressed(cells):
        pad = FingerPad(resolution="coarse", cells_per_ridge=cells)
        motion = [ev.Press(force=0.02, steps=1), ev.Press(force=0.05, steps=1)]
        scene = ev.Scene(pad, ev.Flat(friction=0.0), motion=motion)
        result = ev.simulate(scene)
        return scene, result.real_contact_width, result.peak_contact_pressure

    _, fine, peaks = pressed(48)
    for cells, error in ((6, 0.36), (12, 0.09)):
        scene, found, peak = pressed(cells)
        told = f"with {cells} cells per ridge the real contact area has an error of {100 * error:.2g} %"
        assert told in " ".join(str(ev.plan(scene)).split())
        np.testing.assert_allclose(found, fine, rtol=error)
        assert f"{told}, the peak pressure one of {350 / cells:.2g} %" in " ".join(
            str(ev.plan(scene)).split()
        )
        np.testing.assert_allclose(peak, peaks, rtol=3.5 / cells)


def test_the_plan_says_an_error_of_a_smooth_pads_peak_that_holds():
    def pressed(resolution):
        pad = FingerPad(resolution=resolution, ridges=False)
        scene = ev.Scene(pad, ev.Flat(friction=0.0), motion=[ev.Press(force=f, steps=1) for f in (0.02, 0.1)])
        return scene, ev.simulate(scene).peak_contact_pressure

    fine = pressed("fine")[1]
    for resolution, error in (("coarse", 0.1), ("medium", 0.06)):
        scene, found = pressed(resolution)
        assert f"the peak pressure has an error of {100 * error:g} %" in " ".join(str(ev.plan(scene)).split())
        np.testing.assert_allclose(found, fine, rtol=error, err_msg=resolution)


def test_cells_per_ridge_of_a_file():
    text = (
        "[finger]\ncells_per_ridge = 20\n[surface]\nkind = 'flat'\n[[motion]]\nkind = 'press'\nforce = 0.02\n"
    )
    assert ev.scenefile.loads("version = 1\n" + text).finger.cells_per_ridge == 20


@pytest.mark.parametrize("ridges", [True, False])
def test_every_resolution_states_an_error_of_the_pressure(ridges):
    """None that is larger than that of a coarser one; "paper" has the surface of "medium"."""
    errors = [FingerPad(ridges=ridges, resolution=one).pressure_error for one in RESOLUTIONS]
    assert errors == sorted(errors, reverse=True)
    assert 0.0 < errors[-1] < errors[0] < 1.0
