"""The compiled loops against what they stand for: strains and volumes written from their
formulae, logarithms with 60 digits, and refusals of what would read beyond an array.

Elastic forces and tangents are compared with the weak forms in `test_weakform`, viscous tangents in
`test_dynamics`.
"""

from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np
import pytest
from tools.grids import CELLS, bend, rectangle
from tools.solids import box

from evfem.tissue.dynamics import Dynamics
from evfem.tissue.kernels.blocks import LANES, blocked, loops, padded
from evfem.tissue.pattern import Pattern

every_element = pytest.mark.parametrize("element", list(CELLS))
RANDOM = np.random.default_rng(2)
STEP = 1e-2


@pytest.mark.parametrize("count", [1, LANES, LANES + 5])
def test_blocks_hold_every_cell_and_the_last_again(count):
    values = 1.0 + RANDOM.random((count, 3, 2))
    blocks, numbers = blocked(values), padded(values[:, 0, 0])
    assert blocks.shape == (-(-count // LANES), 3, 2, LANES)
    for cell in range(len(blocks) * LANES):
        block, lane = divmod(cell, LANES)
        np.testing.assert_array_equal(blocks[block, ..., lane], values[min(cell, count - 1)])
        assert numbers[block, lane] == (values[cell, 0, 0] if cell < count else 0.0)
    assert blocked(np.arange(count)).dtype == np.arange(count).dtype


@pytest.mark.parametrize(("dim", "nodes", "kind"), [(2, 5, 0), (3, 20, 1)])
def test_arrays_that_do_not_fit_are_refused(dim, nodes, kind):
    space = rectangle("q1", (3, 3)) if dim == 2 else box("hex8", (2, 1, 1))
    u = np.zeros((space.size, dim))
    for wrong in (u[:-1], u.astype(np.float32), u.astype(np.int64)):
        with pytest.raises(ValueError, match=f"expected {u.size}, format d"):
            loops(dim).smallest_J(space.cells, wrong)
    with pytest.raises(ValueError, match=r"kind|do not know"):
        loops(dim).smallest_J(space.cells._replace(sizes=(space.size, 2, nodes, 4, 0, kind)), u)
    assert loops(dim).smallest_J(space.cells, u) == 1.0
    moduli = padded(np.ones(len(space.nodes)))
    for places, out, many in ((3, 2, 3), (0, 1, 0), (2**15, 2**15, "too many places")):
        told = many if many == "too many places" else f"expected {many}, format d"
        with pytest.raises(ValueError, match=told):
            loops(dim).energies(space.cells, u, u, moduli, moduli, np.zeros(places), np.zeros(out))


def exact_log_J(H):
    """ln det(1 + H) of the very numbers in H, to 60 digits, rounded once."""
    a, b, c, d = (Fraction(float(h)) for h in H)
    J = (1 + a) * (1 + d) - b * c
    with localcontext() as context:
        context.prec = 60
        return float((Decimal(J.numerator) / Decimal(J.denominator)).ln())


def volume_energies(H, lmbda=2.0):
    """lmbda (ln J)^2 / 2 of one unit cell of F = 1 + H with mu = 0, found by the loops."""
    space = rectangle("q1", (1, 1))
    u = space.mesh.points @ np.reshape(H, (2, 2)).T
    energy, J = loops().forces(space.cells, u, padded(np.zeros(1)), padded(np.array([lmbda])), 0.0 * u)
    return energy, J


@pytest.mark.parametrize("size", [1e-9, 1e-6, 1e-2, 0.1, 0.6])
def test_the_logarithm_of_the_volume_keeps_its_digits(size):
    for _ in range(5):
        H = size * RANDOM.uniform(-1.0, 1.0, 4)
        energy, J = volume_energies(H)
        exact = exact_log_J(H)
        assert np.sqrt(energy) == pytest.approx(abs(exact), rel=1e-14, abs=4e-15 * size)
        assert pytest.approx(np.exp(exact), rel=1e-14) == J


def green(space, u):
    """Green strain (E, Q, 2, 2), real or complex."""
    F = np.einsum("eni,eqnj->eqij", u[space.nodes], space.gradient) + np.eye(2)
    return 0.5 * (np.swapaxes(F, -1, -2) @ F - np.eye(2))


def problem(element, divisions=(2, 1), least=0.0):
    """Space, displacements, rates per cell (the first least) and the displacements before."""
    space = rectangle(element, divisions, warp=bend)
    rate = np.linspace(least, least + 2.0, len(space.nodes))
    u, before = 0.1 * RANDOM.normal(size=(2, space.size, 2))
    return space, u, rate, before


def damping(space, rate, before):
    """The term with these rates, in a step that begins at `before`."""
    term = Dynamics(space, rate * STEP, None)
    term.begin_from(before, 0.0 * before, STEP)
    return term


@every_element
def test_strains_are_greens(element):
    space, u, rate, before = problem(element, (6, 3))
    found, strain = damping(space, rate, before)._strain(u), green(space, u)
    assert len(found) > 1  # more than one block, the last not full
    for e in range(len(space.nodes)):
        block, lane = divmod(e, LANES)
        for component, (i, j) in enumerate(((0, 0), (1, 1), (0, 1))):
            np.testing.assert_allclose(found[block, :, component, lane], strain[e, :, i, j], atol=1e-14)


@pytest.mark.parametrize(("element", "dim"), [("q1", 2), ("q2p1", 2), ("hex8", 3), ("hex27p1", 3)])
@pytest.mark.parametrize("number", [2_000_000_000, 50_000_000, -50_000_000, -1])
def test_numbers_that_lead_out_of_an_array_are_refused(element, dim, number):
    """Where they are checked, and where they are used with a shorter array than they were checked for."""
    space = rectangle(element, (3, 3)) if dim == 2 else box(element, (2, 1, 1))
    _, B, n, *_ = space.cells.sizes
    u, ones = np.zeros((space.size, dim)), np.ones((B, LANES))
    places = np.zeros((B, n * (n + 1) // 2, dim * dim, LANES), np.int32)
    for shape, end in (((B, n, LANES), space.size), (places.shape, 5)):
        numbers = np.zeros(shape, np.int32)
        numbers.flat[-1] = number
        with pytest.raises(IndexError, match=f"a number outside 0 to {end - 1}"):
            loops(dim).bounded(numbers, end)
    longer = space.cells._replace(nodes=loops(dim).bounded(np.zeros((B, n, LANES), np.int32), space.size + 1))
    with pytest.raises(IndexError, match=f"numbers up to {space.size} lead out of an array of {space.size}"):
        loops(dim).smallest_J(longer, u)
    with pytest.raises(IndexError, match="numbers up to 5 lead out of an array of 5"):
        loops(dim).add_tangent(space.cells, u, ones, ones, None, loops(dim).bounded(places, 6), np.zeros(5))


def test_numbers_that_nobody_checked_are_refused():
    space = rectangle("q1", (3, 3))
    u, ones, pattern = np.zeros((space.size, 2)), np.ones((2, LANES)), Pattern(space.nodes, 2)
    checked = loops().bounded(numbers := blocked(pattern.places), pattern.zeros().size)
    data = pattern.zeros()
    loops().add_tangent(space.cells, u, ones, ones, None, checked, data)
    numbers[:] = 2_000_000_000  # what was checked is a copy
    loops().add_tangent(space.cells, u, ones, ones, None, checked, again := pattern.zeros())
    np.testing.assert_array_equal(again, data)
    for wrong in (numbers, None, checked.__class__):
        with pytest.raises(ValueError, match="invalid PyCapsule"):
            loops().add_tangent(space.cells, u, ones, ones, None, wrong, data)
    fewer = loops().bounded(np.zeros(3, np.int32), 1)
    with pytest.raises(ValueError, match="3 numbers; expected 640"):
        loops().add_tangent(space.cells, u, ones, ones, None, fewer, data)


@pytest.mark.parametrize(
    "sizes", [(9, -1, 4, 4, 0, 0), (9, 1, 4, -1, 0, 0), (9, 1, 4, 4, -1, 0), (9, 2**61, 4, 4, 0, 0)]
)
def test_counts_that_no_space_has_are_refused(sizes):
    """2^61 blocks have as many bytes as none."""
    space = rectangle("q1", (2, 2))
    with pytest.raises(ValueError, match="do not know"):
        loops().smallest_J(space.cells._replace(sizes=sizes), np.zeros((space.size, 2)))
