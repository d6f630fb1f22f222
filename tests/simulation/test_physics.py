"""Simulations through the public API against closed forms of contact mechanics and of finite elasticity."""

import numpy as np
import pytest
from tools.builders import pad_state
from tools.meshes import both_sides, contact_block, graded, parabola

import evfem as ev
from evfem.reference import BondedLayer, CattaneoMindlin, HertzLine, plane_modulus, sliding_force_ratio


def press(mesh, law, surface, *motion, element=None):
    """Result of motions of a body of one material."""
    finger = ev.MeshedFinger(mesh, {"tissue": law})
    return ev.simulate(ev.Scene(finger, surface, motion=motion, solver=ev.Solver(element=element)))


@pytest.mark.parametrize(
    ("law", "nu"), [(ev.LinearElastic, 0.3), (ev.NeoHookean, 0.3), (ev.NeoHookean, 0.4999999)]
)
def test_hertz_line_contact(law, nu):
    """A body with a parabolic lower side, sixty half widths large, pressed on a plane by a force.

    Its size changes the contact by terms of order (1/60)^2, its finite strain by p0/E* = 1/2000.
    """
    E, radius = 0.91, 1e3
    x = both_sides(graded(1.125, 1 / 40, 60.0, 1.5))
    mesh = contact_block(x, graded(0.1, 1 / 40, 60.0, 1.5), pad=1.125, lower=parabola(radius))
    largest = HertzLine.from_half_width(1.0, radius, plane_modulus(E, nu))
    motion = (ev.Press(indentation=1e-5, steps=1), ev.Press(force=largest.load, steps=2))
    result = press(mesh, law(E, nu), ev.Flat(friction=0.0), *motion)
    assert result.applied_force[2] == pytest.approx(largest.load, rel=1e-7)
    for k in (1, 2):
        hertz = HertzLine(float(result.applied_force[k]), radius, plane_modulus(E, nu))
        x, _, field = pad_state(result, k)
        assert result.normal_force[k] == pytest.approx(hertz.load, rel=1e-7)
        assert field["contact_pressure"].max() == pytest.approx(hertz.peak_pressure, rel=0.005)
        assert result.contact_width[k] == pytest.approx(2.0 * hertz.half_width, rel=0.01)
        inside = np.abs(x) < 0.9 * hertz.half_width
        error = np.abs(field["contact_pressure"] - hertz.pressure(x))[inside].max()
        assert error < 0.005 * hertz.peak_pressure


@pytest.mark.parametrize("element", ["q2p1", "q1_fbar"])
def test_hertz_width_between_the_nodes(element):
    """The edge of contact at sixty loads, as its place between the nodes changes: to a tenth of their
    distance (whole nodes alone leave half of it), and no load widens contact less than a third of Hertz.
    """
    E, nu, radius, spacing = 0.91, 0.48, 1e3, 1 / 8
    cell = spacing * (2 if element == "q2p1" else 1)
    x = both_sides(graded(1.5, cell, 60.0, 1.4))
    mesh = contact_block(x, graded(0.3, cell, 60.0, 1.4), 1.5, parabola(radius), element == "q2p1")
    largest = HertzLine.from_half_width(1.2, radius, plane_modulus(E, nu)).load
    motion = (ev.Press(indentation=1e-5, steps=1), ev.Press(force=largest, steps=60))
    result = press(mesh, ev.LinearElastic(E, nu), ev.Flat(friction=0.0), *motion, element=element)
    hertz = [2.0 * HertzLine(load, radius, plane_modulus(E, nu)).half_width for load in result.applied_force]
    np.testing.assert_allclose(result.contact_width[12:], hertz[12:], atol=2.0 * 0.1 * spacing)
    np.testing.assert_allclose(result.contact_width, result.real_contact_width, rtol=1e-12)
    growth = np.diff(result.contact_width[12:]) / np.diff(hertz[12:])
    assert growth.min() > 1 / 3


def test_bonded_layer_under_a_cylinder():
    """nu = 0.3, a = h: P'R/(E* a^2) = 1.221797, delta R/a^2 = 0.653997.

    The finger is the layer, bonded to the bone, and the surface a cylinder: the crest of a long
    cosine, 1/(R k^2) (cos kx - 1), with (k a)^2/12 = 1e-5 off the parabola. The layer ends at 7 h,
    where the contact is no longer felt; a/R = 1e-4 keeps the strain small.
    """
    E, nu, radius, k = 0.91, 0.3, 1e4, 0.01
    layer = BondedLayer(half_width=1.0, thickness=1.0, radius=radius, E=E, nu=nu)
    cylinder = ev.Sinusoid(friction=0.0, terms=[[1.0 / (radius * k**2), k, np.pi / 2]])
    mesh = contact_block(
        both_sides(graded(1.25, 1 / 32, 7.0, 1.3)), np.linspace(0.0, 1.0, 13) ** 1.3, pad=1.25
    )
    motion = ev.Press(indentation=layer.indentation, steps=1)
    result = press(mesh, ev.LinearElastic(E, nu), cylinder, motion)
    assert result.normal_force[-1] * radius / plane_modulus(E, nu) == pytest.approx(1.221797, rel=1e-3)
    assert result.contact_width[-1] == pytest.approx(2.0, rel=0.01)
    _, _, field = pad_state(result)
    assert field["contact_pressure"].max() == pytest.approx(float(layer.pressure(0.0)), rel=1e-3)


def test_cattaneo_mindlin_stick_zone():
    """A nearly incompressible body of four hundred half widths: then pressing leaves next to no shear behind.

    (The far sides widen the loaded surface by a strain of order p0/E* a/L, which sticking turns into shear.)
    """
    half_width, radius, mu, nu = 0.1, 20.0, 0.3, 0.499
    x = both_sides(graded(1.125 * half_width, half_width / 32, 40.0, 1.5))
    y = graded(0.1 * half_width, half_width / 32, 40.0, 1.5)
    mesh = contact_block(x, y, pad=1.125 * half_width, lower=parabola(radius, flat=3.0))
    hertz = HertzLine.from_half_width(half_width, radius, modulus=1.0)
    slide = ev.Slide(distance=1.05 * half_width**2 / radius, steps=3, hold="force")
    law = ev.NeoHookean(E=1.0 - nu**2, nu=nu)  # E* = 1
    motion = (ev.Press(indentation=5e-4, steps=1), ev.Press(force=hertz.load, steps=1), slide)
    result = press(mesh, law, ev.Flat(friction=mu), *motion)
    for k, share in ((2, 0.247), (3, 0.490), (4, 0.727)):
        ratio = result.tangential_force[k] / (mu * hertz.load)
        assert ratio == pytest.approx(share, abs=0.02)  # the stages the tolerances below are meant for
        mindlin = CattaneoMindlin(hertz, mu, result.tangential_force[k])
        x, length, field = pad_state(result, k)
        stick = length[field["contact_status"] == 1].sum() / 2.0
        assert stick == pytest.approx(mindlin.stick_half_width, rel=0.03)
        middle = (
            np.sum(x * field["contact_pressure"] * length) / hertz.load
        )  # tilting moves the contact by 0.5 %
        difference = -field["shear_traction"] - mindlin.shear(x - middle)
        norm = np.sqrt(np.sum((mu * field["contact_pressure"]) ** 2 * length))
        assert np.sqrt(np.sum(difference**2 * length)) < 0.015 * norm


@pytest.mark.parametrize("direction", [1, -1])
def test_point_sliding_on_a_profile(direction):
    """A wedge touches a sinusoid with its tip only: F_t/F_n = (mu + y')/(1 - mu y')."""
    mu = 0.4
    wedge = contact_block(
        np.linspace(-1.0, 1.0, 9), np.linspace(0.0, 1.0, 5), pad=1.0, lower=lambda x: 0.4 * np.abs(x)
    )
    wave = ev.Sinusoid(friction=mu, terms=[[0.05, 3.0, 0.5]])
    slide = ev.Slide(distance=direction * 2.0, steps=20, hold="force")
    law = ev.NeoHookean(E=1.0, nu=0.3)
    motion = (ev.Press(indentation=1e-4, steps=1), ev.Press(force=0.01, steps=1), slide)
    result = press(wedge, law, wave, *motion)
    slipping = 0
    for k in range(4, 22):
        frame = result.frames[k]
        touching = np.flatnonzero(frame.contact_status > 0)
        assert touching.size == 1
        if frame.contact_status[touching[0]] == 2:
            x = result.mesh.points[touching[0], 0] + frame.displacement[touching[0], 0]
            ratio = sliding_force_ratio(0.15 * np.cos(3.0 * x + 0.5), mu, direction)
            assert result.tangential_force[k] / result.normal_force[k] == pytest.approx(ratio, rel=1e-6)
            slipping += 1
    assert slipping > 12
