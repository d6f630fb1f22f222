"""Faces of hexahedra: the thickness of a layer below them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tools.solids import block

from evfem.errors import InputError
from evfem.mesh.faces import layer_thickness
from evfem.mesh.mesh import raised


def shell(order):
    """A cap between spheres of 5 and 4 mm around the origin, the outer half millimetre its skin."""
    mesh = block((6, 4, 6), split=lambda x, y, z: y < 0.5)
    mesh = raised(mesh) if order == 2 else mesh
    p, r, q = mesh.points.T
    way = np.column_stack([p - 0.5, np.full_like(p, -2.0), q - 0.5])
    radius = 5.0 - r
    points = radius[:, None] * way / np.linalg.norm(way, axis=1)[:, None]
    return replace(mesh, points=points)


@pytest.mark.parametrize(("order", "error"), [(1, 4e-3), (2, 2e-5)])
def test_a_spherical_skin_is_as_thick_as_the_radii_differ(order, error):
    mesh = shell(order)
    nodes = mesh.node_sets["bottom"]
    inner = nodes[(np.abs(mesh.points[nodes][:, ::2]) < 0.8).all(axis=1)]
    assert_allclose(layer_thickness(mesh, "upper", inner), 0.5, atol=error)


def test_a_region_that_is_not_there_or_alone_is_refused():
    mesh = block((1, 1, 1))
    with pytest.raises(InputError, match='region: given "bone"'):
        layer_thickness(mesh, "bone", np.array([0]))
    with pytest.raises(InputError, match="another one below"):
        layer_thickness(mesh, "lower", np.array([0]))
