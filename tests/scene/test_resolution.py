"""Warnings of a surface that the pad's nodes cannot feel."""

import re
from pathlib import Path

import numpy as np
import pytest
from tools.builders import finger
from tools.meshes import block

from evfem.planning.plan import plan
from evfem.scene.motion import Press
from evfem.scene.scene import Scene
from evfem.simulation.run import simulate
from evfem.surface.surfaces import Flat, Profile, Sinusoid
from evfem.surface.textures import SelfAffine

X = np.arange(-5.0, 5.001, 0.05)
#: grooves 0.05 mm deep, 0.1 mm wide, 0.5 mm apart
GROOVES = Profile(X, np.where(np.round(X / 0.05) % 10 < 2, -0.05, 0.0), friction=0.0)


def scene(surface, cells=8):
    return Scene(finger(block(cells, 3)), surface, motion=Press(indentation=0.02, steps=1))


def test_grooves_between_the_nodes_are_warned_of():
    found = plan(scene(GROOVES))
    assert "sharper than the node spacing of the pad (0.25 mm)" in found.warning
    assert "up to 0.05 of its 0.05 mm" in found.warning
    assert " ".join(str(found).split()).endswith(f"Warning: {found.warning}")
    with pytest.warns(UserWarning, match="sharper than the node spacing") as caught:
        simulate(scene(GROOVES))
    assert [Path(one.filename).name for one in caught] == ["test_resolution.py"]


@pytest.mark.parametrize("surface", [Flat(friction=0.0), Sinusoid(terms=[[0.05, 1.0, 0.0]], friction=0.0)])
def test_what_the_nodes_can_feel_is_not(surface):
    assert plan(scene(surface)).warning is None


def test_how_much_of_the_slope_is_too_fine():
    long, short = 2.0 * np.pi / 4.0, 2.0 * np.pi * 3.0  # whole waves along the pad
    fine = Sinusoid(terms=[[0.05, long, 0.0], [3e-3, short, 0.0]], friction=0.0)
    found = plan(scene(fine, cells=6)).warning
    assert "(0.33 mm)" in found
    # a wave as long as the spacing has no slope from node to node; the squares of the slopes add up
    share = 3e-3 * short / np.hypot(3e-3 * short, 0.05 * long)
    assert float(re.search(r"(\d+)%", found)[1]) == pytest.approx(100.0 * share, abs=1.0)


def test_the_shortest_waves_of_roughness_need_five_nodes_each():
    """Nodes 1/24 mm apart: 0.2083 mm."""
    for shortest, enough in ((0.21, True), (0.2, False)):
        rough = SelfAffine(hurst=0.9, rms=0.01, shortest=shortest, friction=0.0)
        found = plan(scene(rough, cells=48)).warning
        assert (found is None) == enough
    assert "(0.2 mm) have fewer than 5 nodes of the pad each, which are 0.042 mm apart" in found
    assert found.endswith("a shortest wave of 0.21 mm")
