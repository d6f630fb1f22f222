"""Branches in compiled loops against the form in numpy."""

from types import SimpleNamespace

import numpy as np
import pytest
from tools.grids import rectangle, tangent_of
from tools.solids import box

import evfem as ev
from evfem.tissue.branches import Branches, LoopedBranches, branches_of, make_branches

SKIN = ((0.8, 0.004), (0.5, 0.07), (0.4, 1.4))
TWINS = ("q1", "q1_fbar", "q2", "q2p1", "p2", "hex8", "hex27p1")


@pytest.mark.parametrize("element", TWINS)
def test_compiled_loops_are_the_twins_of_the_form(element):
    """Through three steps of very different lengths, with a region that has no branches: forces, tangent,
    what is kept, energy, loss, potential.
    """
    if element.startswith("hex"):
        space = box(element, (2, 1, 2))
        laws = {name: ev.NeoHookean(E=1.0, nu=0.4, relaxation=SKIN) for name in space.mesh.region_names}
    else:
        space = rectangle(element, (2, 5), split=lambda x, y: y > 0.5, jitter=0.2)
        laws = {"lower": ev.Yeoh(c1=0.2, nu=0.4, relaxation=SKIN), "upper": ev.NeoHookean(E=3.0, nu=0.3)}
    rows = branches_of(space, laws, SimpleNamespace())
    form, compiled = Branches(space, rows), make_branches(space, rows)
    assert isinstance(compiled, LoopedBranches)
    X, kept, begin = space.mesh.points, form.at_rest, np.zeros((space.size, space.dim))
    np.testing.assert_array_equal(compiled.at_rest, kept)
    for k, seconds in enumerate((0.01, 1e-6, 30.0)):
        phase = 0.3 * k + np.arange(space.dim)
        u = 5.0 + 0.03 * (k + 1) * np.sin(X @ np.arange(2.0, 2.0 + space.dim)[:, None] + phase)
        for one in (form, compiled):
            one.begin(begin, kept, seconds)
        for found, expected in (
            (compiled.forces(u), form.forces(u)),
            (tangent_of(space, u, compiled).toarray(), tangent_of(space, u, form).toarray()),
            (compiled.inner(u), form.inner(u)),
        ):
            np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max(), rtol=0.0)
        for name in ("energy", "dissipation", "potential"):
            assert getattr(compiled, name)(u) == pytest.approx(getattr(form, name)(u), rel=1e-9)
        kept, begin = form.inner(u), u
    for one in (form, compiled):
        one.begin(begin, kept, 0.0)
    assert compiled.dissipation(begin) == pytest.approx(form.dissipation(begin), rel=1e-12)
    np.testing.assert_array_equal(compiled.inner(begin), form.inner(begin))


def test_loops_refuse_arrays_of_other_cells():
    space = rectangle("q1", (2, 2))
    compiled = make_branches(
        space, branches_of(space, {"lower": ev.NeoHookean(E=0.1, nu=0.4, relaxation=SKIN)}, SimpleNamespace())
    )
    u = np.zeros((space.size, 2))
    compiled.begin(u, compiled.at_rest, 0.1)
    loops, cells, modulus, before = compiled.loops, space.cells, compiled._modulus, compiled._before
    for wrong in (
        (modulus[:, :2], before),
        (modulus, before[..., :4, :].copy()),
        (modulus[:, :, :3], before),
    ):
        with pytest.raises((ValueError, BufferError)):
            loops.relaxing(cells, u, *(np.ascontiguousarray(one) for one in wrong), np.zeros_like(u))
