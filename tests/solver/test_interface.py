"""Where pad and surface meet: touching nodes rest on the surface, forces follow its normal and tangent."""

from dataclasses import replace

import numpy as np
import pytest
from tools.builders import finger
from tools.meshes import block

from evfem.contact.signorini import FORWARD, OPEN, STICK
from evfem.contact.surfaces import Flat, Sinusoid
from evfem.scene.motion import Press
from evfem.scene.scene import Scene
from evfem.simulation.model import make_model

ROUND = finger(block(8, 3, sag=0.4))
SURFACES = [Flat(y=-0.1), Sinusoid(terms=[[0.02, 2.0, 0.4]], y=-0.1)]
surfaces = pytest.mark.parametrize("surface", SURFACES, ids=["flat", "sinusoid"])


def interface_and_state(surface, statuses):
    """The interface of a pad about 0.1 mm above the surface, and a state whose nodes have these statuses."""
    model = make_model(Scene(ROUND, surface, motion=[Press(indentation=0.1)]))
    state = model.equilibrium.rest(np.zeros(2), 0.0)
    status = np.resize(statuses, state.status.size)
    return model.equilibrium.interface, replace(state, status=status)


@surfaces
def test_touching_nodes_rest_on_the_surface_whatever_their_gap(surface):
    """The attraction of a touching node must not depend on the rounding of its gap."""
    interface, state = interface_and_state(surface, [OPEN, STICK, FORWARD])
    here, rest = interface.positions(state.u), interface.resting(state)
    touching = state.status != OPEN
    np.testing.assert_array_equal(rest[:, 0], here[:, 0])
    np.testing.assert_array_equal(rest[~touching], here[~touching])
    height = surface.y + surface.height(here[:, 0])
    np.testing.assert_allclose(rest[touching, 1], height[touching], atol=1e-15)
    assert (here[touching, 1] > height[touching] + 0.01).all()


@surfaces
def test_contact_forces_keep_their_size_and_press_along_the_normal(surface):
    interface, state = interface_and_state(surface, [STICK])
    force = np.random.default_rng(1).normal(size=state.contact_force.shape)
    found = interface.contact_forces(replace(state, contact_force=force))
    angle = np.arctan(surface.slope(interface.points[:, 0]))
    normal, shear = force.T
    expected = shear * np.array([np.cos(angle), np.sin(angle)]) + normal * np.array(
        [-np.sin(angle), np.cos(angle)]
    )
    np.testing.assert_allclose(found, expected.T, atol=1e-14)
