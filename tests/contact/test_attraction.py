"""Electrostatic forces on the outline: directions, derivatives, energy, and the exact hover force."""

from types import SimpleNamespace

import numpy as np
import pytest
from tools.grids import assembled
from tools.pads import seen

from evfem.electrostatics.laws import Kaczmarek, Layer, Layers, StrongTroxel
from evfem.finger.fingerpad import FingerPad
from evfem.surface.pad import Pad, make_pad
from evfem.surface.surfaces import Flat, Sinusoid
from evfem.terms.attraction import Attraction, attraction
from evfem.tissue.assembly import Integral
from evfem.tissue.forms import Parts
from evfem.tissue.space import make_space
from evfem.tissue.userforms import facet_points

LAYERS = Layers.of(Layer(0.38, 1650.0), Layer(0.09, 3.35))
SURFACES = [Flat(y=-1.0), Sinusoid(terms=[[0.05, 4.0, 0.3]], y=-1.0)]
surfaces = pytest.mark.parametrize("surface", SURFACES, ids=["flat", "sinusoid"])
orders = pytest.mark.parametrize("order", [1, 2])
directions = pytest.mark.parametrize("direction", ["vertical", "normal"])


class TractionOnly:
    """A user's law with the one method it must have."""

    def traction(self, gap, voltage, layers):
        return 3e-9 * voltage**2 * np.exp(-gap / (0.1 + layers.thickness))


LAWS = {"kaczmarek": Kaczmarek(), "strong_troxel": StrongTroxel()}
laws = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)


def outline(order, size=9):
    """An irregular open outline whose last edge turns back, and positions that all hover."""
    s = np.arange(size)
    x = 0.3 * s + 0.04 * np.sin(5.0 * s)
    x[-1] = x[-1 - order] - 0.1
    y = -0.9 + 0.3 * np.cos(s) ** 2 + 0.1 * s / size
    edges = np.column_stack([s[:-1], s[1:]])
    if order == 2:
        edges = np.column_stack([s[:-2:2], s[2::2], s[1::2]])
    return Pad(s, edges, np.ones(size, dtype=bool)), np.column_stack([x, y])


def make(law, surface, order, direction="vertical", air_layer=True):
    pad, position = outline(order)
    thickness = np.linspace(0.3, 0.5, pad.nodes.size)
    layers = Layers.of(Layer(thickness, 1650.0), Layer(0.09, 3.35))
    return Attraction(law, layers, pad, surface, direction, air_layer), position


def everyone(attraction):
    return np.ones(attraction.pad.nodes.size, dtype=bool)


def differences(attraction, position, touching, h=1e-6):
    """Central differences of the forces, (2 P, 2 P)."""
    columns = []
    for unit in np.eye(position.size):
        step = h * unit.reshape(position.shape)
        ahead, behind = (
            attraction.forces(seen(attraction, position + s, 800.0, touching)) for s in (step, -step)
        )
        columns.append((ahead - behind).ravel() / (2 * h))
    return np.array(columns).T


@orders
@laws
@surfaces
def test_vertical_forces_are_pressure_times_projected_length(law, surface, order):
    attraction, position = make(law, surface, order)
    forces = attraction.forces(seen(attraction, position, 800.0, everyone(attraction)))
    gap = position[:, 1] + 1.0 - surface.height(position[:, 0])
    assert (gap > 0).all()
    length = attraction.pad.length(position[:, 0])
    assert forces[:, 0].tolist() == [0.0] * len(forces)
    np.testing.assert_allclose(-forces[:, 1], law.traction(gap, 800.0, attraction.layers) * length)
    assert length[-1] == 0.0  # the last node faces up
    assert length[1] > 0.0


@directions
@surfaces
def test_forces_along_a_way_are_those_at_each_of_its_places(surface, direction):
    attraction, position = make(StrongTroxel(), surface, 2, direction)
    ways, voltages = np.array([0.0, 0.02, 0.05]), np.array([300.0, 0.0, 900.0])
    touching = np.arange(len(position)) == 2
    positions = position + ways[:, None, None] * np.array([1.0, -0.5])
    along = attraction.forces_along(seen(attraction, positions, voltages, touching))
    for found, where, voltage in zip(along, positions, voltages, strict=True):
        np.testing.assert_array_equal(found, attraction.forces(seen(attraction, where, voltage, touching)))


@directions
def test_without_air_layer_only_touching_nodes_carry_force(direction):
    surface = SURFACES[1]
    with_air, position = make(Kaczmarek(), surface, 1, direction)
    without, _ = make(Kaczmarek(), surface, 1, direction, air_layer=False)
    nobody = np.zeros(9, dtype=bool)
    assert not without.forces(seen(without, position, 800.0, nobody)).any()
    np.testing.assert_array_equal(
        without.forces(seen(without, position, 800.0, everyone(without))),
        with_air.forces(seen(with_air, position, 800.0, nobody)),
    )
    one = np.arange(9) == 3
    downward = without.forces(seen(without, position, 800.0, one))[:, 1]
    assert np.flatnonzero(downward).tolist() == [3]
    assert downward[3] == with_air.forces(seen(with_air, position, 800.0, one))[3, 1]


@directions
def test_forces_grow_with_the_square_of_the_voltage_whatever_its_sign(direction):
    attraction, position = make(Kaczmarek(), SURFACES[1], 2, direction)
    forces = [
        attraction.forces(seen(attraction, position, voltage, everyone(attraction)))
        for voltage in (0.0, 500.0, -1000.0)
    ]
    assert not forces[0].any()
    np.testing.assert_allclose(forces[2], 4.0 * forces[1], rtol=1e-14)


@pytest.mark.parametrize("air_layer", [True, False])
@orders
@surfaces
@pytest.mark.parametrize(
    ("law", "direction"),
    [*((law, way) for law in LAWS.values() for way in ("vertical", "normal")), (TractionOnly(), "vertical")],
)
def test_stiffness_by_central_differences(law, direction, surface, order, air_layer):
    attraction, position = make(law, surface, order, direction, air_layer)
    touching = np.arange(9) % 3 != 1
    stiffness = attraction.stiffness(seen(attraction, position, 800.0, touching)).toarray()
    expected = differences(attraction, position, touching)
    np.testing.assert_allclose(stiffness, expected, atol=2e-8 * np.abs(expected).max())


@orders
@laws
@surfaces
def test_normal_forces_are_minus_the_derivative_of_the_energy(law, surface, order):
    attraction, position = make(law, surface, order, "normal")

    def energy(where):
        gap = where[:, 1] + 1.0 - surface.height(where[:, 0])
        return np.sum(law.potential(gap, 800.0, attraction.layers) * attraction.pad.length(where[:, 0]))

    h, expected = 1e-6, np.zeros(position.size)
    for i, unit in enumerate(np.eye(position.size)):
        step = h * unit.reshape(position.shape)
        expected[i] = -(energy(position + step) - energy(position - step)) / (2 * h)
    forces = attraction.forces(seen(attraction, position, 800.0, everyone(attraction))).ravel()
    np.testing.assert_allclose(forces, expected, atol=1e-8 * np.abs(expected).max())
    assert np.abs(forces[::2]).max() > 0.1 * np.abs(forces[1::2]).max()  # the sideways part is there


def test_trial_states_that_penetrate_count_as_touching():
    attraction, position = make(Kaczmarek(), SURFACES[0], 1)
    sunk, touching = position.copy(), position.copy()
    sunk[3, 1], touching[3, 1] = -1.2, -1.0
    np.testing.assert_array_equal(
        attraction.forces(seen(attraction, sunk, 800.0, everyone(attraction))),
        attraction.forces(seen(attraction, touching, 800.0, everyone(attraction))),
    )


@pytest.mark.parametrize(("order", "total"), [(1, 1e-14), (2, 3e-3)])
@surfaces
def test_nodal_rule_is_the_weak_form_with_its_points_at_the_nodes(order, total, surface):
    """Exactly, tangent too, on linear edges; on quadratic ones it projects chords (sum 1.9e-3 apart)."""
    mesh = FingerPad(resolution="coarse").mesh(order)
    space, pad = make_space(mesh, {1: "q1", 2: "q2p1"}[order]), make_pad(mesh)
    surface = surface.shifted(mesh.points[:, 1].min() - 0.2)
    x, y = mesh.points.T
    u = 0.02 * np.column_stack([np.sin(x) * (2.0 - y), np.cos(2.0 * x)])
    position = (mesh.points + u)[pad.nodes]
    rule = Attraction(Kaczmarek(), LAYERS, pad, surface)
    weights = {1: [1 / 2, 1 / 2], 2: [1 / 6, 4 / 6, 1 / 6]}[order]
    places = (np.linspace(0.0, 1.0, order + 1)[:, None], np.array(weights))
    points = facet_points(space, "pad", places)
    w = SimpleNamespace(
        x=points.x, n=points.normal, law=rule.law, layers=LAYERS, voltage=800.0, surface=surface
    )
    form = Integral(attraction, points, Parts(2, value=True, grad=True), w)
    forces = rule.forces(seen(rule, position, 800.0))
    found = -form.forces(u)[pad.nodes]
    assert found[:, 1].sum() == pytest.approx(forces[:, 1].sum(), rel=total)
    if order == 2:
        assert abs(found[:, 1].sum() / forces[:, 1].sum() - 1.0) > 1e-3
    else:
        np.testing.assert_allclose(found, forces, atol=2e-14 * np.abs(forces).max())
        unknown = (2 * pad.nodes[:, None] + [0, 1]).ravel()
        K = -assembled(space, form.cell_tangents(u), points.cells)[unknown][:, unknown]
        np.testing.assert_allclose(
            K.toarray(), rule.stiffness(seen(rule, position, 800.0)).toarray(), atol=1e-12 * np.abs(K).max()
        )
