"""The compiled Kelvin-Voigt loops against derivatives of their potential, written from the
formula.

With E0 given, F S = dPhi/dF of Phi = sum of r (E - E0):(E - E0): forces are the potential's
complex-step derivative, tangents central differences of them.
"""

import numpy as np
import pytest
from tools.grids import assembled, rectangle

from evfem.tissue.elements import ELEMENTS
from evfem.tissue.kernels import viscous
from evfem.tissue.kernels.lanes import LANES, blocked

every_element = pytest.mark.parametrize("element", list(ELEMENTS))
RANDOM = np.random.default_rng(2)


def bend(x, y):
    return x + 0.06 * np.sin(2.0 * y + x), y + 0.08 * np.sin(2.5 * x)


def green(space, u):
    """Green strain (E, Q, 2, 2), real or complex."""
    F = np.einsum("eni,eqnj->eqij", u[space.nodes], space.gradient) + np.eye(2)
    return 0.5 * (np.swapaxes(F, -1, -2) @ F - np.eye(2))


def potential(space, u, rate, before):
    change = green(space, u) - before
    return np.einsum("e,eq,eqij,eqij->", rate, space.weight, change, change)


def plain_forces(space, u, rate, before):
    """Complex-step derivative of the potential (N, 2)."""
    z, out = u.astype(complex), np.empty(u.shape)
    for index in np.ndindex(u.shape):
        z[index] += 1e-30j
        out[index] = potential(space, z, rate, before).imag / 1e-30
        z[index] = u[index]
    return out


def problem(element, divisions=(2, 1)):
    """Space, displacements, rates per cell (the first none) and the displacements before."""
    space = rectangle(element, divisions, warp=bend)
    rate = np.linspace(0.0, 2.0, len(space.nodes))
    u, before = 0.1 * RANDOM.normal(size=(2, space.size, 2))
    return space, u, rate, before


def in_blocks(strain):
    """(E, Q, 2, 2) as the loops keep it."""
    return blocked(np.stack([strain[..., 0, 0], strain[..., 1, 1], strain[..., 0, 1]], axis=-1))


@every_element
def test_strains_are_greens(element):
    space, u, _, _ = problem(element, (6, 3))
    found = viscous.strains(u, space.cells)
    expected = in_blocks(green(space, u))
    cells = len(space.nodes)
    assert len(found) > 1  # more than one block, the last not full
    for e in range(cells):
        block, lane = divmod(e, LANES)
        np.testing.assert_allclose(found[block, ..., lane], expected[block, ..., lane], atol=1e-14)


@every_element
def test_forces_are_the_derivative_of_the_potential(element):
    space, u, rate, before = problem(element)
    found = viscous.forces(u, blocked(rate), space.cells, viscous.strains(before, space.cells))
    expected = plain_forces(space, u, rate, green(space, before))
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


@every_element
def test_tangents_are_central_differences_and_are_added(element):
    space, u, rate, before = problem(element, (1, 1))
    rate = rate + 0.7
    held = green(space, before)
    cells = np.ones((len(space.nodes), 2 * space.nodes.shape[1], 2 * space.nodes.shape[1]))
    viscous.add_tangent(u, blocked(rate), space.cells, viscous.strains(before, space.cells), cells)
    found = assembled(space, cells - 1.0).toarray()
    columns = []
    for unit in np.eye(u.size):
        step = 1e-6 * unit.reshape(u.shape)
        ahead, behind = (plain_forces(space, u + s, rate, held) for s in (step, -step))
        columns.append((ahead - behind).ravel() / 2e-6)
    expected = np.array(columns).T
    np.testing.assert_allclose(found, expected, atol=1e-8 * np.abs(expected).max())


def test_blocks_without_viscosity_have_no_part():
    """18 cells, the last two alone in a block: rates there move only their nodes, rates elsewhere
    only the others'."""
    space, u, _, before = problem("q1", (6, 3))
    strain0 = viscous.strains(before, space.cells)
    for chosen in (np.arange(18) < LANES, np.arange(18) >= LANES):
        rate = np.where(chosen, 1.5, 0.0)
        forces = viscous.forces(u, blocked(rate), space.cells, strain0)
        touched = np.zeros(space.size, dtype=bool)
        touched[space.nodes[chosen]] = True
        assert np.abs(forces[touched]).max(axis=1).min() > 0.0
        assert not forces[~touched].any()
        cells = np.zeros((18, 8, 8))
        viscous.add_tangent(u, blocked(rate), space.cells, strain0, cells)
        np.testing.assert_array_equal(cells.any(axis=(1, 2)), chosen)
