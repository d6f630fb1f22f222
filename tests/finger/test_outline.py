"""Fingers that are no ellipses: superellipses and measured cross-sections, in the plane and in space."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree
from tools.refusals import refuses

import evfem as ev
from evfem.finger.crosssection import CrossSection
from evfem.finger.outline import Ellipse, Superellipse
from evfem.finger.scan import RidgeScan
from evfem.finger.solid import Body, Ellipsoid
from evfem.mesh.faces import layer_thickness
from evfem.mesh.quality import scaled_jacobian
from evfem.scene import file as scenefile

A, B, C = 8.34, 6.395, 11.25
TURN = np.linspace(0.0, 2.0 * np.pi, 101)
OVAL = np.column_stack([A * np.cos(TURN), B * np.sin(TURN)])
SHIFTED = OVAL[:49:-1] + np.array([3.0, -2.0])
LEVEL = {"resolution": "coarse", "ridges": False}
AREAS = {0.1: 24.96, 0.5: 56.93, 1.0: 82.59}


def gauge(points, n):
    """abs(x/a)^n + abs(y/b)^n (+ abs(z/c)^n)."""
    return np.sum(np.abs(points / [A, B, C][: points.shape[1]]) ** n, axis=1)


def pressed(finger, *motion, **more):
    return ev.simulate(ev.Scene(finger, ev.Flat(friction=0.0), motion=motion, **more))


# -- the curves


def test_exponent_2_is_the_ellipse_to_the_last_digit():
    theta = np.linspace(-np.pi, np.pi, 50)
    for made in (ev.FingerPad(outline=2), ev.FingerPad()):
        assert type(made.outer) is Ellipse
        np.testing.assert_array_equal(
            made.outer.point(theta), np.column_stack([A * np.cos(theta), B * np.sin(theta)])
        )
    for finger in (ev.FingerPad, ev.Fingertip):
        one, other = (finger(resolution="coarse", **more).mesh() for more in ({}, {"outline": 2}))
        np.testing.assert_array_equal(one.points, other.points)
    mesh = ev.Fingertip(**LEVEL, outline=2.0).mesh()
    middle = mesh.points[mesh.node_sets["pad"]][:, 2] == 0.0
    x, y, _ = mesh.points[mesh.node_sets["pad"]][middle].T
    p = x[np.abs(x) < 0.6 * A] / A
    np.testing.assert_array_equal(y[np.abs(x) < 0.6 * A], -B * np.sqrt(1.0 - p * p - 0.0))


def test_a_superellipse_tends_to_the_ellipse():
    theta = np.linspace(-3.1, 3.1, 41)
    near, oval = Superellipse(A, B, exponent=2.0), Ellipse(A, B)
    for name in ("point", "tangent", "bend", "normal", "curvature"):
        np.testing.assert_allclose(getattr(near, name)(theta), getattr(oval, name)(theta), atol=1e-13)
    x = np.linspace(-0.99, 0.99, 21) * A
    for upper in (False, True):
        np.testing.assert_allclose(near.angle_at(x, upper), oval.angle_at(x, upper), atol=1e-13)
    assert near.smallest_radius == pytest.approx(oval.smallest_radius)
    body, ball = Body(A, B, C, section=Superellipse(1.0, 1.0, exponent=2.0)), Ellipsoid(A, B, C)
    assert body.smallest_radius == pytest.approx(ball.smallest_radius, rel=2e-3)


@pytest.mark.parametrize("n", [2.3, 3.0, 4.0])
def test_a_superellipse_obeys_its_equation_and_its_gradient(n):
    """Normals by the gradient of the equation; derivatives and curvature by differences."""
    curve, theta, h = Superellipse(A, B, exponent=n), np.linspace(-3.0, 3.0, 34), 1e-6
    p = curve.point(theta)
    np.testing.assert_allclose(gauge(p, n), 1.0, rtol=1e-12)
    slope = np.sign(p) * np.abs(p / [A, B]) ** (n - 1.0) / [A, B]
    np.testing.assert_allclose(curve.normal(theta), slope / np.hypot(*slope.T)[:, None], atol=1e-9)
    ends = curve.point(theta + h) - curve.point(theta - h)
    np.testing.assert_allclose(curve.tangent(theta), ends / (2.0 * h), atol=1e-7)
    bend = (curve.tangent(theta + h) - curve.tangent(theta - h)) / (2.0 * h)
    np.testing.assert_allclose(curve.bend(theta), bend, atol=1e-6)
    assert abs(curve.curvature(np.array([-0.5 * np.pi]))[0]) < 1e-5  # none at the apex


def test_the_smallest_radius_of_a_body_is_that_of_its_equation():
    """By the second derivatives of abs(x/a)^3 + ..., on a grid of the lower half."""
    n, axes = 3.0, np.array([A, B, C])
    angle = np.linspace(0.01, 0.5 * np.pi - 0.01, 91)
    s, t = (one.ravel() for one in np.meshgrid(angle, angle))
    ray = np.column_stack([np.sin(t) * np.cos(s), np.sin(t) * np.sin(s), np.cos(t)])
    unit = ray / (np.sum(ray**n, axis=1) ** (1.0 / n))[:, None]
    slope, second = n * unit ** (n - 1.0) / axes, n * (n - 1.0) * unit ** (n - 2.0) / axes**2
    size = np.linalg.norm(slope, axis=1)
    normal = slope / size[:, None]
    across = np.eye(3) - normal[:, :, None] * normal[:, None, :]
    shape = across @ (second[:, :, None] * across) / size[:, None, None]
    radius = 1.0 / np.linalg.eigvalsh(shape)[:, -1].max()
    found = ev.Fingertip(**LEVEL, outline=n)._shape.outer.smallest_radius
    assert found == pytest.approx(radius, rel=5e-3)


# -- meshes


@pytest.mark.parametrize("n", [2.5, 4.0])
@pytest.mark.parametrize("order", [1, 2])
def test_nodes_lie_on_the_superellipse_and_layers_keep_their_thickness(n, order):
    pad = ev.FingerPad(**LEVEL, outline=n)
    mesh = pad.mesh(order)
    outline = mesh.points[np.unique(mesh.outer_sides)]
    outer = outline[gauge(outline, n) > 0.9]
    assert len(outer) > 100
    np.testing.assert_allclose(gauge(outer, n), 1.0, rtol=1e-12)
    bone = mesh.points[mesh.node_sets["bone"]]
    np.testing.assert_allclose(np.sum(((bone - [0.0, 1.0]) / [3.0, 2.5]) ** 2, axis=1), 1.0, rtol=1e-12)
    shared = np.intersect1d(
        mesh.cells[mesh.cells_of("epidermis")], mesh.cells[mesh.cells_of("stratum_corneum")]
    )
    below = mesh.points[shared]
    fine = pad.outer.point(np.linspace(-np.pi, 0.0, 400_001))
    near, _ = cKDTree(fine).query(below[below[:, 1] < -0.5])
    np.testing.assert_allclose(near, 0.38, rtol=1e-7)


@pytest.mark.parametrize("n", [2.5, 4.0])
@pytest.mark.parametrize("posture", [0.0, 25.0])
def test_nodes_lie_on_the_superellipsoid_and_layers_keep_their_thickness(n, posture):
    tip = ev.Fingertip(**LEVEL, outline=n, posture=posture, rim="free")
    mesh = tip.mesh()
    pad = mesh.points[mesh.node_sets["pad"]]
    c, s = np.cos(np.radians(posture)), np.sin(np.radians(posture))
    level = pad @ np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    np.testing.assert_allclose(gauge(level, n), 1.0, rtol=1e-12)
    if posture == 0.0:
        bone = (mesh.points[mesh.node_sets["bone"]] - [0.0, 1.0, 0.0]) / [3.0, 2.5, 8.5]
        np.testing.assert_allclose(np.linalg.norm(bone, axis=1), 1.0, rtol=1e-12)
    thick = layer_thickness(mesh, "stratum_corneum", mesh.node_sets["pad"])
    np.testing.assert_allclose(thick, 0.38, rtol=2e-2)
    if posture == 0.0:
        inner = tip._shape._points(ray := tip._shape.outer.on(_rays()), np.ones(len(ray)))
        foot = tip._shape.outer.point(ray)
        slope = np.sign(foot) * np.abs(foot / [A, B, C]) ** (n - 1.0) / [A, B, C]
        away = foot - 0.38 * slope / np.linalg.norm(slope, axis=1)[:, None]
        np.testing.assert_allclose(inner, away, atol=1e-12)


def _rays():
    rays = np.random.default_rng(3).normal(size=(200, 3))
    rays[:, 1] = -np.abs(rays[:, 1])
    return rays / np.linalg.norm(rays, axis=1)[:, None]


@pytest.mark.parametrize("n", [2.001, 3.0, 4.0])
@pytest.mark.parametrize("resolution", ["coarse", "medium"])
def test_cells_keep_their_shape(n, resolution):
    for ridges in (False, True):
        for order in (1, 2):
            mesh = ev.FingerPad(outline=n, resolution=resolution, ridges=ridges).mesh(order)
            assert scaled_jacobian(mesh).min() > 0.2
    if resolution == "medium":
        return
    for more in ({"ridges": "along"}, {"ridges": "none", "rim": "nail", "posture": 30.0}):
        mesh = ev.Fingertip(outline=n, resolution=resolution, **more).mesh()
        assert scaled_jacobian(mesh).min() > 0.25
    assert scaled_jacobian(ev.Fingertip(outline=n, resolution="coarse", ridges="whorl").mesh()).min() > 0.1


@pytest.mark.parametrize("name", ["i", "ii", "iii", "iv", "v", "vi", "vii", "viii", "ix", "x", "xi"])
def test_participants_can_be_flatter(name):
    for finger in (ev.FingerPad, ev.Fingertip):
        flat = finger.participant(name, "coarse", ridges=False, outline=3.0)
        assert scaled_jacobian(flat.mesh()).min() > 0.3
        assert flat.width == finger.participant(name).width


def test_ridges_are_cut_along_the_normals_of_the_outline():
    pad = ev.FingerPad(resolution="coarse", outline=3.0)
    mesh = pad.mesh()
    points = mesh.points[mesh.node_sets["pad"]]
    points = points[np.abs(points[:, 0]) < 5.5]
    fine = np.linspace(-np.pi, 0.0, 400_001)
    curve = pad.outer.point(fine)
    nearest = [int(np.argmin(np.hypot(*(curve - one).T))) for one in points]
    depth = np.hypot(*(curve[nearest] - points).T)
    t = 2.0 * np.abs((curve[nearest, 0] / 0.5 + 0.5) % 1.0 - 0.5)
    np.testing.assert_allclose(depth, 0.15 * t**7, atol=2e-4)
    assert depth.max() == pytest.approx(0.15, abs=1e-6)


def test_scanned_ridges_are_measured_from_the_outline():
    outer = Superellipse(A, B, exponent=3.0)
    x = np.arange(-4.0, 4.001, 0.02)
    deep = 0.1 * np.sin(np.pi * x / 0.5) ** 2
    angle = outer.angle_at(x)
    points = outer.point(angle) - deep[:, None] * outer.normal(angle)
    feet, below = RidgeScan(points[:, 0], y=points[:, 1] - 1.0).depths(outer)
    np.testing.assert_allclose(feet, x, atol=1e-9)
    np.testing.assert_allclose(below, deep, atol=1e-9)


# -- measured cross-sections


@pytest.mark.parametrize("points", [OVAL, OVAL[:-1], OVAL[::-1], OVAL[50:], SHIFTED])
def test_points_of_an_ellipse_are_the_ellipse(points):
    """All around or the pad alone, in both ways, anywhere: the nodes of the ellipse, and its forces."""
    for finger in (ev.FingerPad, ev.Fingertip):
        scanned, usual = finger(**LEVEL, outline=points), finger(**LEVEL)
        np.testing.assert_allclose(scanned.mesh().points, usual.mesh().points, atol=1e-11)
    assert scanned.width == pytest.approx(16.68, abs=1e-12)


def test_points_of_an_ellipse_have_its_forces():
    scanned, usual = (ev.FingerPad(**LEVEL, **more) for more in ({"outline": OVAL}, {}))
    forces = [pressed(one, ev.Press(indentation=0.4, steps=2)).normal_force for one in (scanned, usual)]
    np.testing.assert_allclose(*forces, rtol=1e-8)


def test_a_measured_outline_may_have_unlike_sides():
    """An egg: its nodes on the curve through its points, its lower side as it was given."""
    x = A * np.cos(TURN) * (1.0 + 0.05 * np.sin(TURN)) + 0.2 * np.sin(TURN) ** 2
    y = B * np.sin(TURN) * (1.0 + 0.08 * np.cos(TURN))
    given = np.column_stack([x, y])
    for finger in (ev.FingerPad, ev.Fingertip):
        mesh = finger(**LEVEL, outline=given).mesh()
        assert scaled_jacobian(mesh).min() > 0.3
    section = CrossSection.of(given)
    mesh = ev.FingerPad(**LEVEL, outline=section).mesh()
    pad = mesh.points[mesh.node_sets["pad"]]
    fine = np.linspace(0.0, 2.0 * np.pi, 200_001)
    egg = np.column_stack(
        [
            A * np.cos(fine) * (1.0 + 0.05 * np.sin(fine)) + 0.2 * np.sin(fine) ** 2,
            B * np.sin(fine) * (1.0 + 0.08 * np.cos(fine)),
        ]
    )
    egg -= 0.5 * (egg.min(axis=0) + egg.max(axis=0))
    far = [np.hypot(*(egg - one).T).min() for one in pad[::7]]
    assert max(far) < 2e-4
    assert section.width == pytest.approx(np.ptp(egg[:, 0]), abs=1e-4)


def test_noise_of_a_scan_averages_out():
    noisy = OVAL[50:] + np.random.default_rng(5).normal(scale=0.02, size=(51, 2))
    noisy[[0, -1]] = OVAL[[50, 100]]
    mesh = ev.FingerPad(**LEVEL, outline=noisy).mesh()
    assert np.abs(mesh.points - ev.FingerPad(**LEVEL).mesh().points).max() < 0.06
    assert scaled_jacobian(mesh).min() > 0.4


def moved(change):
    points = OVAL[:-1].copy()
    return change(points)


def _swapped(points):
    points[[10, 12]] = points[[12, 10]]
    return points


def _twice(points):
    points[8] = points[7]
    return points


WRONG = [
    (1.9, r"given 1.9; allowed: 2 to 4, or a measured cross-section: a csv file with the header x,y"),
    (4.1, "given 4.1; allowed: 2 to 4"),
    (float("nan"), "allowed: 2 to 4"),
    (True, "allowed: 2 to 4"),
    (None, "allowed: 2 to 4"),
    ([1.0, 2.0, 3.0], r"given an array of shape \(3,\)"),
    ([[1.0], [1.0, 2.0]], "allowed: 2 to 4"),
    (OVAL.T, r"given an array of shape \(2, 101\)"),
    (OVAL[:5], "given 5 x and 5 y; allowed: 12 to 100000 points"),
    (0.1 * OVAL, "given an outline 1.668 mm wide and 1.279 mm high; allowed: 12 to 24 mm wide.*header"),
    (1e3 * OVAL, "given an outline 1.668e.04 mm wide"),
    (moved(_swapped), "which go back, seen from the middle; allowed: points in their order"),
    (moved(_twice), r"given points 8 and 9 at the same place .*; allowed: each point once"),
    (moved(lambda p: np.vstack([p[20:], p[:15]]))[:80], "degrees apart|ends level and highest"),
    (moved(lambda p: p[::9]), "given neighbours 3.* degrees apart"),
    (moved(lambda p: p * np.where(np.arange(100)[:, None] == 75, 0.9, 1.0)), "point 76 is 0.* mm away"),
    (OVAL[:51], "allowed: a closed outline, or the pad from one side to the other, its ends level"),
    (OVAL[58:], "ends level and highest"),
    ("none.csv", "none.csv"),
    ({"x": [1.0]}, "allowed: 2 to 4"),
]


@pytest.mark.parametrize(("outline", "sentence"), WRONG)
def test_outlines_that_cannot_be_are_refused_with_one_sentence(outline, sentence):
    for finger in (ev.FingerPad, ev.Fingertip):
        refuses(rf"finger\.outline: .*{sentence}", finger, **LEVEL, outline=outline)


def test_sizes_beside_a_measured_outline_are_refused():
    refuses(r"finger\.width: given 17.0 beside a measured outline", ev.FingerPad, outline=OVAL, width=17.0)
    refuses(r"finger\.height: given 14.0 beside", ev.Fingertip, outline=OVAL, height=14.0)
    pad = ev.FingerPad(**LEVEL, outline=OVAL)
    assert replace(pad, ridge_phase=0.5).outline is pad.outline


def test_an_ellipse_takes_the_walls_that_it_took_before_other_outlines():
    """Slope .15 x 8 / .25 = 4.8, by the curvature of the apex 4.87 of 4.88; a flatter outline bends more."""
    assert ev.FingerPad(ridge_exponent=8.0).mesh(2).cells.size
    refuses("slope of 4.95", ev.FingerPad, ridge_exponent=8.0, outline=3.0)


def test_skin_that_is_too_thick_for_the_sharpest_place_is_refused():
    thick = {"epidermis_thickness": 0.8, "dermis_thickness": 1.3}
    for finger in (ev.FingerPad, ev.Fingertip):
        finger(**LEVEL, **thick)
        refuses(r"finger\.dermis_thickness.*smallest radius", finger, **LEVEL, **thick, outline=4.0)


# -- scene files


TEXT = """version = 1
[finger]
KIND
resolution = "coarse"
ridges = false
outline = OUTLINE
[surface]
kind = "flat"
[[motion]]
kind = "press"
force = 0.02
"""


@pytest.mark.parametrize("kind", ["", 'kind = "fingertip"'])
@pytest.mark.parametrize(
    ("head", "factor"), [("x,y", 1.0), ("x [cm],y [cm]", 0.1), ("x_um;y_um", 1e3)], ids=["mm", "cm", "um"]
)
def test_a_scene_file_has_an_outline(tmp_path, kind, head, factor):
    sign = ";" if ";" in head else ","
    lines = "\n".join(f"{x!r}{sign}{y!r}" for x, y in (factor * OVAL).tolist())
    (tmp_path / "section.csv").write_text(f"{head}\n{lines}\n")
    for given in ("2.5", '"section.csv"'):
        text = TEXT.replace("KIND", kind).replace("OUTLINE", given)
        scene = scenefile.loads(text, tmp_path)
        again = scenefile.loads(scenefile.dump(scene), tmp_path / "elsewhere")
        assert again.digest() == scene.digest()
        np.testing.assert_array_equal(again.finger.mesh().points, scene.finger.mesh().points)
    assert scene.finger.outline.x == pytest.approx(OVAL[:, 0])
    assert repr(ev.FingerPad(outline=2.5)) == "FingerPad(outline=2.5)"


def test_files_that_hold_no_outline_are_refused(tmp_path):
    for name, text, sentence in (
        ("a.csv", "x,height\n0,1\n1,1\n", "a.csv with the header 'x,height'"),
        ("b.csv", "x,y\n0,1\n1,up\n", "line 3"),
        ("c.csv", "x [V],y\n0,1\n1,2\n", "V"),
    ):
        (tmp_path / name).write_text(text)
        refuses(rf"finger\.outline: .*{sentence}", ev.FingerPad, outline=tmp_path / name)
        with pytest.raises(ev.InputError, match=r"finger\.outline"):
            scenefile.loads(TEXT.replace("KIND", "").replace("OUTLINE", f'"{name}"'), tmp_path)
