"""The whole pad: its volume and surfaces, cells, ridges, prints from files, and what is refused."""

import numpy as np
import pytest
from tools.refusals import refuses

import evfem as ev
from evfem.errors import InputError
from evfem.finger import fingertip
from evfem.finger.fingerprint import PATTERNS, HeightMap
from evfem.finger.layers import LAYERS
from evfem.mesh.quality import scaled_jacobian
from evfem.surface.skin import make_skin
from evfem.tissue.space import make_space

ELEMENT = {1: "hex8", 2: "hex27p1"}


def tip(**own):
    return ev.Fingertip(**{"ridges": "none", "resolution": "coarse"} | own)


def volume(mesh):
    return float(make_space(mesh, ELEMENT[mesh.order]).weight.sum())


def volume_of(finger):
    """Two half ellipsoids, the bone lifted, and the wedge under the cut between their rims."""
    a, b, c = 0.5 * finger.width, 0.5 * finger.height, 0.5 * finger.length
    d, e, f = 0.5 * finger.bone_width, 0.5 * finger.bone_height, 0.5 * finger.bone_length
    skin = sum(getattr(finger, layer.parameter) for layer in LAYERS if layer.thickness)
    phi = 2.0 * np.pi * np.arange(4000) / 4000
    ring = np.array([np.cos(phi), np.sin(phi)])
    normal = ring / np.array([[a], [c]])
    inside = np.array([[a], [c]]) * ring - skin * normal / np.hypot(*normal)
    bone = np.array([[d], [f]]) * ring
    around = [np.gradient(np.append(x, x[:, :1], axis=1), phi[1], axis=1)[:, :-1] for x in (inside, bone)]
    wedge = 0.0
    for t, weight in ((0.5 * (1 - 0.6**0.5), 5 / 18), (0.5, 8 / 18), (0.5 * (1 + 0.6**0.5), 5 / 18)):
        along = (1 - t) * around[0] + t * around[1]
        area = np.abs(along[0] * (bone - inside)[1] - along[1] * (bone - inside)[0]).sum() * phi[1]
        wedge += weight * t * finger.bone_offset * area
    halves = 2.0 / 3.0 * np.pi * (a * b * c - d * e * f)
    return halves + finger.bone_offset * np.pi * d * f + wedge


@pytest.mark.parametrize("offset", [0.0, 1.0])
def test_volume(offset):
    """Curved cells hold it to fourth order, straight ones to second."""
    fingers = [tip(bone_offset=offset, resolution=name) for name in ("coarse", "medium")]
    exact = volume_of(fingers[0])
    curved, straight = ([abs(volume(one.mesh(order)) / exact - 1.0) for one in fingers] for order in (2, 1))
    assert curved[1] < 0.3 * curved[0]
    assert curved[1] < 2e-4
    assert straight[1] < 0.6 * straight[0]
    assert straight[1] < 6e-3


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("ridges", ["none", "along", "whorl"])
def test_surface_is_pad_bone_and_rim(ridges, order):
    """No cracks: the faces of one cell only are those of the three sets, and every node has a cell."""
    mesh = tip(ridges=ridges).mesh(order)
    faces = [mesh.sides_of(name) for name in ("pad", "bone", "rim")]
    if order == 2:
        assert {len(face) for face in faces[0]} == {9}
    assert sum(len(one) for one in faces[:2]) == len(mesh.outer_sides)
    assert len(faces[2]) > 0
    assert len(np.unique(mesh.cells)) == len(mesh.points)
    free = ev.Fingertip(ridges=ridges, resolution="coarse", rim="free").mesh(order)
    assert len(free.sides_of("bone")) == len(faces[1]) - len(faces[2])
    np.testing.assert_array_equal(free.node_sets["rim"], mesh.node_sets["rim"])


def test_surfaces_are_the_ellipsoids():
    """Nodes of the pad on the finger's, those of the free bone on the bone's; interfaces at their
    depths along the normal below the lowest point.
    """
    finger = tip(rim="free")
    mesh = finger.mesh()
    pad, bone = mesh.points[mesh.node_sets["pad"]], mesh.points[mesh.node_sets["bone"]]
    np.testing.assert_allclose(np.sum((pad / [8.34, 6.395, 11.25]) ** 2, axis=1), 1.0, rtol=1e-12)
    away = (bone - [0.0, 1.0, 0.0]) / [3.0, 2.5, 8.5]
    np.testing.assert_allclose(np.sum(away**2, axis=1), 1.0, rtol=1e-12)
    assert pad[:, 1].max() == 0.0
    assert bone[:, 1].max() == 1.0
    middle = np.hypot(mesh.points[:, 0], mesh.points[:, 2]) < 1e-9
    heights = np.sort(mesh.points[middle, 1])
    for depth in np.cumsum([0.0, 0.38, 0.47, 1.0]):
        assert np.abs(heights + 6.395 - depth).min() < 1e-12


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("ridges", ["none", "along"])
def test_with_a_nail_the_finger_is_whole(ridges, order):
    """Between two ellipsoids; below, the surface of the half without; no cracks; the nail of its thickness on
    top, as wide as given to a column, ending at 0.64 of the half length.
    """
    finger = tip(rim="nail", ridges=ridges)
    mesh, lower = finger.mesh(order), tip(ridges=ridges).mesh(order)
    assert scaled_jacobian(mesh).min() > 0.3
    pad = [one.points[one.node_sets["pad"]] for one in (mesh, lower)]
    np.testing.assert_array_equal(*pad)
    outer = [len(one.sides_of("pad")) for one in (mesh, lower)]
    assert len(mesh.outer_sides) == 2 * outer[0] + len(mesh.sides_of("bone"))
    assert outer[0] == outer[1]
    if ridges == "none" and order == 2:
        whole = np.prod([16.68, 12.79, 22.5]) - np.prod([6.0, 5.0, 17.0])
        assert volume(mesh) == pytest.approx(np.pi / 6.0 * whole, rel=2e-3)
    nail = mesh.points[mesh.node_sets["nail"]]
    assert nail[:, 1].min() > 0.0
    assert np.ptp(nail[:, 0]) == pytest.approx(11.0, abs=1.5)
    assert nail[:, 2].max() == pytest.approx(0.64 * 11.25, abs=1e-9)
    inner = np.unique(mesh.cells[mesh.region == mesh.region_names["nail"]])
    top = mesh.points[inner][np.hypot(*mesh.points[inner][:, ::2].T) < 1e-9, 1]
    assert np.ptp(top) == pytest.approx(0.45)


@pytest.mark.slow
def test_a_nail_holds_the_finger_less_than_a_fixed_rim_and_more_than_none():
    """And its material counts: a hundred times softer it holds no more than the skin."""
    soft = {"nail": ev.NeoHookean(E=0.17, nu=0.3)}
    fingers = [tip(rim="free"), tip(rim="nail", materials=soft), tip(rim="nail"), tip(rim="fixed")]
    solver, press = ev.Solver(element="hex8"), ev.Press(indentation=0.4, steps=1)
    scenes = (ev.Scene(one, ev.Flat(friction=0.3), motion=press, solver=solver) for one in fingers)
    forces = [ev.simulate(scene).normal_force[-1] for scene in scenes]
    assert (np.diff(forces) > 0.0).all(), forces


def test_posture_turns_the_tip_down():
    """About x, by its angle: a rigid turn, after which the tip is lower than the finger's other end."""
    level, turned = (tip(posture=angle).mesh().points for angle in (0.0, 30.0))
    c, s = np.cos(np.pi / 6), 0.5
    np.testing.assert_allclose(turned[:, 1], c * level[:, 1] - s * level[:, 2], atol=1e-12)
    np.testing.assert_allclose(turned[:, 2], s * level[:, 1] + c * level[:, 2], atol=1e-12)
    assert turned[level[:, 2].argmax(), 1] < turned[level[:, 2].argmin(), 1]


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("ridges", ["none", *PATTERNS])
def test_shape_of_the_cells(ridges, order):
    """The prototype of this mesh had .43 smooth, .22 merged and .33 with a whorl."""
    least = {"none": 0.39, "along": 0.36, "across": 0.27}.get(ridges, 0.26)
    assert scaled_jacobian(tip(ridges=ridges).mesh(order)).min() > least


def depth_of(finger):
    """x and z of the feet, depth along the normal (by Newton's method), of the nodes near the middle."""
    mesh, axes = finger.mesh(), 0.5 * np.array([finger.width, finger.height, finger.length])
    points = mesh.points[mesh.node_sets["pad"]]
    points = points[(np.abs(points[:, 0]) < 4.0) & (np.abs(points[:, 2]) < 4.0)]
    foot = points / np.linalg.norm(points / axes, axis=1)[:, None]
    for _ in range(40):
        normal = foot / axes**2
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        depth = ((foot - points) * normal).sum(axis=1)
        foot = points + depth[:, None] * normal
        foot /= np.linalg.norm(foot / axes, axis=1)[:, None]
    return foot[:, 0], foot[:, 2], depth


@pytest.mark.parametrize("ridges", list(PATTERNS))
def test_ridges_have_the_profile_of_the_cross_section(ridges):
    """Depth h t^7 over the distance from the nearest crest; parallel ridges have nodes on crests
    and in grooves.
    """
    finger = tip(ridges=ridges, ridge_phase=0.2)
    x, z, depth = depth_of(finger)
    t = 2.0 * np.abs((PATTERNS[ridges](x, z) / 0.5 - 0.2 + 0.5) % 1.0 - 0.5)
    np.testing.assert_allclose(depth, 0.15 * t**7, atol=1e-6)
    if ridges in ("along", "across"):
        assert {0.0, 1.0} <= set(np.round(t, 6).tolist())


def test_patterns_are_one_pitch_from_crest_to_crest():
    """The phase's slope is 1 (along an arch's flanks up to its bend); a loop turns round its core."""
    x, z = np.random.default_rng(2).uniform(-4.0, 4.0, (2, 200))
    h = 1e-6
    for name, phase in PATTERNS.items():
        slope = np.hypot(phase(x + h, z) - phase(x - h, z), phase(x, z + h) - phase(x, z - h)) / (2 * h)
        np.testing.assert_allclose(slope, 1.0, atol=0.07 if name == "arch" else 1e-6)
    assert PATTERNS["loop"](0.0, 2.0) == pytest.approx(2.0)
    assert PATTERNS["loop"](np.sin(np.pi / 9), -np.cos(np.pi / 9)) == pytest.approx(0.0, abs=1e-12)


def test_prints_from_a_table_and_from_an_image(tmp_path):
    """The same relief as an object, in a csv file and in an image of 16 bits, whose top is the tip."""
    x, z = np.linspace(-4.0, 4.0, 81), np.linspace(-5.0, 5.0, 101)
    height = 0.1 * np.exp(-((x - 1.0) ** 2 + (z[:, None] - 2.0) ** 2))
    own = tip(ridges=HeightMap(x, z, height), ridge_width=0.7)
    rows = [f"{a},{b},{h}" for b, line in zip(z, height, strict=True) for a, h in zip(x, line, strict=True)]
    (tmp_path / "print.csv").write_text("x,z,height\n" + "\n".join(rows[::-1]) + "\n")
    read = tip(ridges=tmp_path / "print.csv", ridge_width=0.7)
    np.testing.assert_allclose(read.mesh().points, own.mesh().points, atol=1e-12)
    from PIL import Image

    grey = np.round(65535 * (height - height.min()) / np.ptp(height)).astype(np.uint16)
    Image.fromarray(grey[::-1]).save(tmp_path / "print.png")
    Image.fromarray(65535 - grey[::-1]).save(tmp_path / "ink.png")
    picture = {"ridge_pixel": 0.1, "ridge_height": float(np.ptp(height)), "ridge_width": 0.7}
    for name, dark in (("print.png", "grooves"), ("ink.png", "ridges")):
        drawn = tip(ridges=str(tmp_path / name), ridge_dark=dark, **picture)
        np.testing.assert_allclose(drawn.mesh().points, own.mesh().points, atol=2e-6)
    with pytest.raises(InputError, match=r"ridge_dark: given nothing for .*ridges \| grooves"):
        tip(ridges=str(tmp_path / "ink.png"), **picture)
    fx, fz, depth = depth_of(own)
    assert depth.max() == pytest.approx(0.1, abs=1e-4)
    near = np.argmin(np.hypot(fx - 1.0, fz - 2.0))
    assert depth[near] < 0.01


def test_materials_are_those_of_the_cross_section():
    finger = tip(materials={"dermis": ev.NeoHookean(E=0.2, nu=0.45)})
    assert finger.materials["dermis"].E == 0.2
    usual = ev.FingerPad().materials
    assert {name: law for name, law in finger.materials.items() if name != "dermis"} == {
        name: law for name, law in usual.items() if name not in ("dermis", "nail")
    }
    assert sorted(finger.mesh().region_names) == sorted(finger.materials)
    refuses("nail", tip, materials={"nail": ev.NeoHookean(E=17.0, nu=0.3)})


@pytest.mark.parametrize("name", ["i", "ii", "iii", "iv", "v", "vi", "vii", "viii", "ix", "x", "xi"])
def test_participants_can_be_meshed(name):
    finger = ev.Fingertip.participant(name, "coarse", ridges=False)
    pad = ev.FingerPad.participant(name)
    for shared in ("width", "height", "bone_width", "bone_height", "bone_offset", "dermis_thickness"):
        assert getattr(finger, shared) == getattr(pad, shared)
    assert finger.bone_length / finger.length == pytest.approx(17.0 / 22.5)
    assert scaled_jacobian(finger.mesh()).min() > 0.3


WRONG = [
    ({"width": 5.0}, "finger.width"),
    ({"length": 40.0}, "finger.length"),
    ({"rim": "loose"}, "finger.rim"),
    ({"ridges": "spiral"}, "finger.ridges"),
    ({"ridges": 3}, "finger.ridges"),
    ({"ridges": "missing.csv"}, "finger.ridges"),
    ({"ridges": "missing.png"}, "finger.ridges"),
    ({"resolution": "paper"}, "finger.resolution"),
    ({"posture": 60.0}, "finger.posture"),
    ({"rim": "nail", "nail_width": 12.0}, "finger.nail_width"),
    ({"rim": "nail", "nail_thickness": 0.8}, "finger.nail_thickness"),
    ({"materials": {"nail": ev.NeoHookean(E=1.0, nu=0.3)}}, "finger.materials.nail"),
    ({"bone_length": 20.0}, "finger.bone_length"),
    ({"ridges": "along", "ridge_exponent": 16.0}, "finger.ridge_height"),
    ({"ridges": "along", "ridge_height": 0.3}, "finger.ridge_height"),
    ({"ridges": "along", "ridge_width": 0.8}, "finger.ridge_width"),
    ({"ridges": "along", "ridge_crest": 0.6, "ridge_groove": 0.4}, "finger.ridge_crest"),
    ({"dermis_thickness": 2.0, "epidermis_thickness": 0.9}, "finger.dermis_thickness"),
]


@pytest.mark.parametrize(("own", "key"), WRONG)
def test_what_cannot_be_is_refused(own, key):
    assert refuses("allowed", tip, **own).key == key


def test_prints_that_are_none_are_refused(tmp_path, monkeypatch):
    (tmp_path / "few.csv").write_text("x,z,height\n0,0,1\n1,0,1\n0,1,1\n")
    refuses("every pair", tip, ridges=tmp_path / "few.csv")
    (tmp_path / "no.png").write_bytes(b"no image")
    refuses("grey image", tip, ridges=tmp_path / "no.png")
    line = np.linspace(-3.0, 3.0, 61)
    noise = np.random.default_rng(1).uniform(0.0, 0.2, (61, 61))
    rough = tip(ridges=HeightMap(line, line, noise), ridge_width=0.7)
    shape = scaled_jacobian(rough.mesh()).min()
    monkeypatch.setattr(fingertip, "SMALLEST_SHAPE", shape)
    refuses("scaled Jacobian", rough.mesh)


def test_it_shows_what_differs():
    assert repr(ev.Fingertip()) == "Fingertip()"
    assert repr(ev.Fingertip(ridges=False, posture=10)) == "Fingertip(ridges='none', posture=10.0)"
    assert "16.68 x 12.79 x 22.5 mm" in ev.Fingertip()._repr_html_()


def test_stiffening_skin_has_the_stress_of_its_term_of_ogden():
    """Pure shear at constant volume: sigma_1 - sigma_2 = mu (l^alpha - l^-alpha), modulus mu alpha/2."""
    law, stretch = ev.stiffening_skin(12.0, 0.7)["epidermis"], 1.3
    mu = 2.0 / 12.0 * 0.7 * 0.136 / (2.0 * 1.3)
    stress = law.P(np.diag([stretch, 1.0 / stretch, 1.0])) @ np.diag([stretch, 1.0 / stretch, 1.0])
    assert stress[0, 0] - stress[1, 1] == pytest.approx(mu * (stretch**12 - stretch**-12), rel=1e-12)


@pytest.mark.slow
def test_the_contact_area_falls_in_slip_where_skin_stiffens_and_grows_where_it_does_not():
    """The sign that Delhaye et al. 2014 measured, doi:10.1098/rsif.2014.0698, and the default's wrong one."""
    change = {}
    for name, materials in {"stiff": ev.stiffening_skin(), "default": {}}.items():
        tip = ev.Fingertip(ridges="none", resolution="coarse", materials=materials)
        motion = [ev.Press(force=0.5, steps=3), ev.Slide(distance=4.0, steps=6, hold="force")]
        area = ev.simulate(ev.Scene(tip, ev.Flat(friction=0.8), motion=motion)).real_contact_area
        change[name] = area[-1] / area[2] - 1.0
    assert change["stiff"] < -0.02
    assert change["default"] > 0.01


@pytest.mark.parametrize(("posture", "error"), [(10.0, 0.01), (30.0, 0.15)])
def test_a_plan_says_what_a_posture_costs(posture, error):
    """Columns of a rigid tip 0.25 mm above the film against those of the whole ellipsoid."""
    layers, law = ev.Layers.of(ev.Layer(0.38, 1650.0), ev.FILM), ev.StrongTroxel()
    tip = ev.Fingertip(ridges="none", resolution="coarse", posture=posture)
    skin = make_skin(mesh := tip.mesh())
    points = mesh.points[skin.nodes]
    gap = 0.25 + points[:, 1] - points[:, 1].min()
    found = np.sum(skin.tributary(points) * law.traction(gap, 2000.0, layers))
    axes = tip.width, tip.height, tip.length
    exact = ev.forces.outline_force(law, *axes, 0.25, 2000.0, layers, tilt=posture)
    assert found / exact - 1.0 == pytest.approx(error, abs=0.015)
    scene = ev.Scene(tip, ev.Display(), law, 100.0, [ev.Hover(gap=0.25)])
    said = "an error of up to 26 % at 0.25 mm" in " ".join(str(ev.plan(scene)).split())
    assert said == (posture > 20.0)
