"""Pictures of solids: what is left of a mesh that is cut open, and what of it is seen."""

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from tools.solids import block

from evfem.mesh.mesh import raised
from evfem.plotting.figures import REGIONS
from evfem.plotting.meshes import DIMMEST, EYE, regions

SIZE = (2.0, 3.0, 4.0)


def solid(order):
    mesh = block((2, 3, 4), SIZE, split=lambda x, y, z: y > 1.0)
    return raised(mesh) if order == 2 else mesh


@pytest.mark.parametrize("order", [1, 2])
def test_faces_towards_the_eye_are_drawn(order):
    """Three sides of the block, as wide as they look from there, shaded colours of the regions."""
    ax = regions(solid(order))
    polygons, *_ = ax.collections
    paths = [path.vertices[:-1] for path in polygons.get_paths()]
    assert len(paths) == 2 * 3 + 2 * 2 + 3 * 2
    assert {len(path) for path in paths} == {4 if order == 1 else 8}
    x, y = (np.array([path[:, i] for path in paths]) for i in (0, 1))
    drawn = 0.5 * np.abs((x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1)).sum()
    towards = np.abs(EYE / np.linalg.norm(EYE))
    assert drawn == pytest.approx(towards @ [3.0 * 2.0, 2.0 * 2.0, 2.0 * 3.0])
    plain = np.array([to_rgb(colour) for colour in REGIONS[:2]])
    colours = polygons.get_facecolors()[:, None, :3]
    factor = (colours * plain).sum(axis=2) / (plain**2).sum(axis=1)
    own = np.abs(colours - factor[..., None] * plain).max(axis=2) < 1e-12
    assert own.any(axis=0).all()
    assert (own.sum(axis=1) == 1).all()
    assert ((factor[own] >= DIMMEST) & (factor[own] <= 1.0)).all()
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["lower", "upper"]
