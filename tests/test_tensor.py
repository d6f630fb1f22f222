"""Powers of symmetric tensors: their derivatives where eigenvalues meet, and the plane beside space."""

import numpy as np
import pytest

from evfem import tensor

rng = np.random.default_rng(1)


def field(n, shape=(4, 3)):
    """Well-conditioned random matrices (n, n, *shape)."""
    return np.eye(n).reshape(n, n, *[1] * len(shape)) * 2.0 + rng.uniform(-0.5, 0.5, (n, n, *shape))


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
