"""Pointwise algebra against numpy.linalg on single points, and the complex step against known
derivatives.
"""

import numpy as np
import pytest

from evfem import tensor

rng = np.random.default_rng(1)


def field(n, shape=(4, 3)):
    """Well-conditioned random matrices (n, n, *shape)."""
    return np.eye(n).reshape(n, n, *[1] * len(shape)) * 2.0 + rng.uniform(-0.5, 0.5, (n, n, *shape))


def last(A):
    """(n, n, ...) as numpy.linalg wants it, (..., n, n)."""
    return np.moveaxis(A, (0, 1), (-2, -1))


@pytest.mark.parametrize("n", [2, 3])
@pytest.mark.parametrize("shape", [(), (5,), (4, 3)])
def test_det_and_inverse_are_those_of_numpy(n, shape):
    A = field(n, shape)
    np.testing.assert_allclose(tensor.det(A), np.linalg.det(last(A)), rtol=1e-13)
    np.testing.assert_allclose(last(tensor.inv(A)), np.linalg.inv(last(A)), rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("n", [2, 3])
def test_cofactor_is_the_derivative_of_det(n):
    A = field(n)
    np.testing.assert_allclose(tensor.complex_step(tensor.det, A, rank=2), tensor.cofactor(A), rtol=1e-13)


def test_cofactor_exists_where_the_inverse_does_not():
    # the matrix of ones has rank 1: all 2x2 minors vanish
    assert not tensor.cofactor(np.ones((3, 3))).any()


def test_products_are_those_of_numpy():
    A, B, v = field(3), field(3), rng.standard_normal((3, 4, 3))
    np.testing.assert_allclose(last(tensor.mul(A, B)), last(A) @ last(B), rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(
        np.moveaxis(tensor.mul(A, v), 0, -1)[..., None],
        last(A) @ np.moveaxis(v, 0, -1)[..., None],
        rtol=1e-13,
        atol=1e-14,
    )
    np.testing.assert_allclose(
        tensor.ddot(A, B), np.trace(last(tensor.mul(tensor.transpose(A), B)), axis1=-2, axis2=-1)
    )
    np.testing.assert_allclose(tensor.trace(A), np.trace(last(A), axis1=-2, axis2=-1))
    outer = tensor.outer(A, B)
    assert outer.shape == (3, 3, 3, 3, 4, 3)
    assert outer[0, 1, 2, 0, 3, 2] == A[0, 1, 3, 2] * B[2, 0, 3, 2]


def test_products_do_not_conjugate():
    # the length of (1, i) without conjugation is 0, with it 2
    v = np.array([1.0, 1.0j])
    assert tensor.dot(v, v) == 0.0
    A = np.array([[1.0, 1.0j], [0.0, 0.0]])
    assert tensor.ddot(A, A) == 0.0


@pytest.mark.parametrize("exponent", [0.5, -1.0, 1.7, 3.0])
def test_symmetric_power_of_three_gives_the_product(exponent):
    # C^e C^-e = I, and C^1/2 C^1/2 = C, C^3 = C C C, C^-1 = inverse by numpy
    A = field(3)
    C = tensor.mul(tensor.transpose(A), A)
    power, back = tensor.symmetric_power(C, exponent), tensor.symmetric_power(C, -exponent)
    np.testing.assert_allclose(tensor.mul(power, back) - tensor.identity(3, 2), 0.0, atol=1e-12)
    known = {0.5: lambda: (tensor.mul(power, power), C), -1.0: lambda: (last(power), np.linalg.inv(last(C)))}
    if exponent in known:
        np.testing.assert_allclose(*known[exponent](), rtol=1e-11, atol=1e-12)
    if exponent == 3.0:
        np.testing.assert_allclose(power, tensor.mul(C, tensor.mul(C, C)), rtol=1e-11)


@pytest.mark.parametrize("spread", [0.5, 1e-9, 0.0])
def test_derivative_of_a_power_stays_exact_for_equal_eigenvalues(spread):
    # d(C^3) = dC C C + C dC C + C C dC, whatever the eigenvalues
    C = np.diag([2.0, 2.0 + spread, 2.0 + 2.0 * spread])
    dC = rng.standard_normal((3, 3))
    dC = dC + dC.T
    change = np.imag(tensor.symmetric_power(C + 1e-30j * dC, 3.0)) / 1e-30
    np.testing.assert_allclose(change, dC @ C @ C + C @ dC @ C + C @ C @ dC, rtol=1e-13)


@pytest.mark.parametrize("exponent", [0.5, -3.0, 7.3])
@pytest.mark.parametrize("spread", [1.0, 1e-9, 0.0])
def test_symmetric_power_in_the_plane_is_that_of_the_solver_in_space(exponent, spread):
    # the twin: the same C beside a third stretch, by eigenvectors; derivatives of all directions too
    A, dA = spread * field(2), field(2)
    C = tensor.mul(tensor.transpose(A), A) + 2.0 * tensor.identity(2, 2)
    C = C + 1e-30j * (dA + tensor.transpose(dA))
    inside = np.zeros((3, 3, *C.shape[2:]), dtype=complex)
    inside[:2, :2], inside[2, 2] = C, 0.7
    power, expected = tensor.symmetric_power(C, exponent), tensor.symmetric_power(inside, exponent)[:2, :2]
    np.testing.assert_allclose(power.real, expected.real, rtol=1e-13, atol=1e-13 * abs(expected).max())
    change = abs(expected.imag).max()
    np.testing.assert_allclose(power.imag, expected.imag, rtol=1e-12, atol=1e-12 * change)


def test_complex_step_orders_the_axes_as_documented():
    # f_ij = A_ij^2 x_k-free: derivative (i, j, k, l, ...) is 2 A_ij d_ik d_jl
    A = field(2)
    D = tensor.complex_step(lambda A: A * A, A, rank=2)
    assert D.shape == (2, 2, 2, 2, 4, 3)
    expected = np.zeros_like(D)
    for i in range(2):
        for j in range(2):
            expected[i, j, i, j] = 2.0 * A[i, j]
    np.testing.assert_allclose(D, expected, rtol=1e-15)


def test_complex_step_of_a_scalar_law_and_of_a_gradient():
    x = np.linspace(0.5, 2.0, 7)
    np.testing.assert_allclose(tensor.complex_step(lambda x, n: x**n, x, 3), 3.0 * x**2, rtol=1e-15)
    F = field(2)
    gradient = tensor.complex_step(lambda F: tensor.ddot(F, F), F, rank=2)
    np.testing.assert_allclose(gradient, 2.0 * F, rtol=1e-15)


def test_complex_step_leaves_its_argument_alone():
    x = np.array([1.0, 2.0])
    tensor.complex_step(np.exp, x)
    assert x.tolist() == [1.0, 2.0]


def test_positive_part_has_the_slopes_of_max():
    x = np.array([-2.0, -1e-9, 1e-9, 3.0])
    assert tensor.positive_part(x).tolist() == [0.0, 0.0, 1e-9, 3.0]
    assert tensor.complex_step(tensor.positive_part, x).tolist() == [0.0, 0.0, 1.0, 1.0]
