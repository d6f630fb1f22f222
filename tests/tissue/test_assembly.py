"""The engine of all weak forms: what a user's form may use, and which forms are refused."""

import numpy as np
import pytest
from tools.grids import bend, rectangle

import evfem as ev
from evfem.errors import InputError
from evfem.tensor import ddot, dot, grad
from evfem.tissue.userforms import make_term, tried

MU, LMBDA = 0.7, 1.9


def test_theta_is_refused_where_it_has_no_meaning():
    space = rectangle("q1", (2, 2))
    with pytest.raises(InputError, match="a use of theta where it is not known"):
        make_term(space, ev.form(lambda u, v, w: u.theta * v[0]), "top", True)


def test_a_form_that_changes_what_it_uses_is_refused():
    """Gradients only beyond a displacement that the trial does not reach."""
    space = rectangle("q1", (2, 2))

    @ev.form
    def late(u, v, w):
        return grad(v)[0, 0] if np.max(np.real(u)) > 1.0 else v[0]

    term = make_term(space, late, "lower", False)
    term.forces(np.zeros((9, 2)))
    with pytest.raises(InputError, match="the same parts"):
        term.forces(np.full((9, 2), 2.0))


@pytest.mark.parametrize(
    ("integrand", "on", "grad", "theta", "potential"),
    [
        (lambda u, v, w: 0.3 * v[1], "lower", False, False, True),
        (lambda u, v, w: (1.0 + w.x[0]) * dot(u, v), "lower", False, False, True),
        (lambda u, v, w: u[1] * v[0], "lower", False, False, False),
        (lambda u, v, w: ddot(grad(u), grad(v)), "lower", True, False, True),
        (lambda u, v, w: u.theta * v.theta, "lower", False, True, True),
        (lambda u, v, w: u.theta * v[0], "lower", False, True, False),
        (lambda u, v, w: dot(w.n, u) * dot(w.n, v), "top", False, False, True),
        (lambda u, v, w: dot(w.n, u) * v[0], "top", False, False, False),
    ],
)
def test_trial_finds_what_a_form_uses_and_whether_it_has_a_potential(integrand, on, grad, theta, potential):
    mesh = rectangle("q1", (3, 2), warp=bend).mesh
    trial = tried(mesh, ev.form(integrand), on, boundary=on == "top")
    assert (trial.parts.grad, trial.parts.theta, trial.has_potential) == (grad, theta, potential)


REFUSED = {
    "no v": (lambda u, v, w: 1e-3, "not linear in v"),
    "a constant beside v": (lambda u, v, w: v[1] + 1e-5, "not linear in v"),
    "twice v": (lambda u, v, w: dot(v, v), "not linear in v"),
    "magnitude of v": (lambda u, v, w: np.abs(v[1]), "not linear in v"),
    "vectors for tensors": (lambda u, v, w: ddot(u, v), r"an integrand of shape \(1,\)"),
    "whole v": (lambda u, v, w: 1e-5 * v, "an integrand of shape"),
    "nothing": (lambda u, v, w: None, "no integrand; allowed: a number for every point"),
    "no such place": (lambda u, v, w: w.t * v[1], "that raises AttributeError"),
    "two arguments": (lambda u, v: u[0] * v[0], "that raises TypeError"),
    "infinite at rest": (lambda u, v, w: v[1] / u[1], "infinite or no number"),
    "steep at rest": (lambda u, v, w: np.sqrt(u[1] ** 2 + 0j).real * v[1], "lost in a complex step"),
    "magnitude of u": (lambda u, v, w: np.abs(u[1]) * v[1], "lost in a complex step"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_a_form_that_no_run_could_use_is_refused_with_one_sentence(kind):
    integrand, said = REFUSED[kind]
    with pytest.raises(ev.InputError, match=said) as caught:
        tried(rectangle("q1", (3, 2), warp=bend).mesh, ev.form(integrand), "lower", boundary=False)
    assert str(caught.value).startswith("form <lambda>: given ")
    assert "\n" not in str(caught.value)


def test_trial_sees_places_and_outward_normals():
    """The lid of a unit square: y = 1, normal upwards; the middle of a region lies inside."""
    seen = []

    @ev.form
    def looking(u, v, w):
        seen.append((w.x, w.n))
        return v[0]

    mesh = rectangle("q2", (3, 2)).mesh
    tried(mesh, looking, "top", boundary=True)
    tried(mesh, looking, "lower", boundary=False)
    (x, n), (inside, nowhere) = seen[0], seen[-1]
    np.testing.assert_allclose(x[1], 1.0)
    np.testing.assert_allclose(n[:, :, 0], np.tile([[0.0], [1.0]], 3))
    assert nowhere is None
    assert ((inside > 0.1) & (inside < 0.9)).all()
