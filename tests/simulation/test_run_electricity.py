"""Scenes with a voltage: couplings, hovering, ramps and profiles."""

import numpy as np
import pytest
from tools.builders import INSULATOR, balance, benchmark_finger, finger
from tools.meshes import block

from evfem.electrostatics.laws import Kaczmarek, Layer, Layers
from evfem.electrostatics.signals import VoltageProfile
from evfem.scene.motion import Hover, Press, Slide
from evfem.scene.scene import Scene
from evfem.simulation.run import simulate
from evfem.surface.surfaces import Display

ROUND = finger(block(8, 3, sag=0.4))
PRESS_AND_SLIDE = (Press(indentation=0.3, steps=3), Slide(0.4, steps=4))


def run(surface, *motion, body=ROUND, law=None, voltage=0.0, **options):
    return simulate(Scene(body, surface, law, voltage, motion or PRESS_AND_SLIDE, **options))


def columns(result, *names):
    return np.array([getattr(result, name) for name in names])


@pytest.mark.parametrize("direction", ["vertical", "normal"])
def test_staggered_iterations_end_where_the_monolithic_ones_do(direction):
    names = ("applied_force", "normal_force", "tangential_force", "electrostatic_force", "stored_energy")
    found = {}
    for coupling in ("monolithic", "staggered", "staggered_once"):
        result = run(Display(), law=Kaczmarek(), voltage=2500.0, direction=direction, coupling=coupling)
        assert balance(result).max() < 1e-7
        found[coupling] = columns(result, *names)
    largest = np.abs(found["monolithic"]).max(axis=1, keepdims=True)
    apart = {name: np.abs(values - found["monolithic"]) / largest for name, values in found.items()}
    assert apart["staggered"].max() < 1e-6
    # once per step: the attraction of the state before, so the first press is far off
    assert apart["staggered_once"][3, 0] > 0.05


def direct_force(mesh, displacement, gap_to, voltage):
    """Quadrature of (8b) over the deformed outline: vertical traction per projected length, edge by edge."""
    s, weight = np.polynomial.legendre.leggauss(12)
    shape = np.array([0.5 * s * (s - 1.0), 0.5 * s * (s + 1.0), 1.0 - s**2])
    slope = np.array([s - 0.5, s + 0.5, -2.0 * s])
    edges = mesh.sides_of("pad")
    place = (mesh.points + displacement)[edges]
    x_s, y = np.einsum("nq,kn->kq", slope, place[..., 0]), np.einsum("nq,kn->kq", shape, place[..., 1])
    gap, reduced, whole = y - gap_to, 0.38 / 1650.0 + 0.09 / 3.35, 0.47
    pressure = 0.5 * 8.8541878128e-12 * voltage**2 / ((gap + reduced) * (gap + whole))
    return float(np.sum(pressure * np.maximum(x_s, 0.0) * weight))


@pytest.mark.parametrize(("gap", "rise"), [(0.25, 0.0084), (0.5, 0.0019)])
def test_hover_force_is_the_integral_over_the_deformed_outline(gap, rise):
    result = run(Display(), Hover(gap), body=benchmark_finger(1), law=Kaczmarek(), voltage=2000.0)
    deformed = direct_force(result.mesh, result.frames[0].displacement, -6.395, 2000.0)
    raised = np.broadcast_to([0.0, gap], result.mesh.points.shape)
    rigid = direct_force(result.mesh, raised, -6.395, 2000.0)
    assert result.electrostatic_force[0] == pytest.approx(deformed, rel=1e-3)
    # exact for the ellipse: 0.40356 and 0.19761 mN/mm; the rise by the tissue giving way: linear elasticity
    assert rigid == pytest.approx({0.25: 0.40356e-3, 0.5: 0.19761e-3}[gap], rel=2e-3)
    assert deformed / rigid - 1.0 == pytest.approx(rise, rel=0.15)
    assert result.normal_force[0] == 0.0
    assert result.applied_force[0] == pytest.approx(-result.electrostatic_force[0], rel=1e-7)
    assert 0.9 * gap < result.min_gap[0] < gap
    assert result.indentation[0] == -gap


def test_without_air_layer_only_the_contact_attracts():
    full = run(Display(), law=Kaczmarek(), voltage=2000.0)
    contact = run(Display(), law=Kaczmarek(), voltage=2000.0, air_layer=False)
    assert (contact.electrostatic_force < full.electrostatic_force).all()
    assert contact.electrostatic_force[0] == 0.0  # nothing touched before the first step
    # eq. (10) with the nodes that touched in the row before, at their present lengths
    assert contact.substeps.tolist() == [1] * 7
    pressure = Kaczmarek().traction(0.0, 2000.0, Layers.of(Layer(0.38, 1650.0), INSULATOR))
    for before, frame, force in zip(
        contact.frames, contact.frames[1:], contact.electrostatic_force[1:], strict=False
    ):
        touching = before.contact_status > 0
        gap = np.maximum(frame.gap[touching], 0.0)
        length = tributary(contact.mesh, frame.displacement)[touching]
        expected = np.sum(
            length * Kaczmarek().traction(gap, 2000.0, Layers.of(Layer(0.38, 1650.0), INSULATOR))
        )
        assert force == pytest.approx(expected, rel=1e-7)
        assert force == pytest.approx(pressure * length.sum(), rel=0.1)
    hover = run(Display(), Hover(0.1), law=Kaczmarek(), voltage=2000.0, air_layer=False)
    assert hover.electrostatic_force[0] == 0.0


def tributary(mesh, displacement):
    x = (mesh.points + displacement)[:, 0]
    length = np.zeros(len(x))
    for start, end, middle in mesh.sides_of("pad"):
        length[[start, end, middle]] += max(x[end] - x[start], 0.0) * np.array([1.0, 1.0, 4.0]) / 6.0
    return length


def test_a_voltage_profile_follows_the_bone():
    profile = VoltageProfile([0.0, 0.2, 0.2, 0.4], [0.0, 1000.0, 2000.0, 2000.0])
    result = run(Display(), law=Kaczmarek(), voltage=profile)
    np.testing.assert_allclose(result.voltage, [0.0, 0.0, 0.0, 500.0, 2000.0, 2000.0, 2000.0], rtol=1e-12)
    assert result.electrostatic_force[:3].tolist() == [0.0, 0.0, 0.0]
    constant = run(Display(), law=Kaczmarek(), voltage=2000.0)
    assert result.electrostatic_force[-1] == pytest.approx(constant.electrostatic_force[-1], rel=0.05)
