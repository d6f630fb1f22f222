"""What takes an equilibrium its stability: a point on two springs of known stiffness along every way."""

from dataclasses import replace

import numpy as np
import pytest

from evfem.contact.condensed import Candidates, CondensedTangent, ExtraUnknown, LinearContactStep
from evfem.contact.signorini import BACKWARD, FORWARD, OPEN, STICK
from evfem.contact.stability import ATTRACTION, FALLING, FASTER, SLOPES, stability_ratio
from evfem.surface.pad import SurfaceState

KX, KY, LOAD = 0.4, 1.5, 0.3


def point(status, slope=0.0, curvature=0.0, friction=0.0, friction_slope=0.0, weakening=0.0):
    """A node between springs KX, KY to the bone and a surface that it presses with LOAD."""
    stiffness = np.diag([KX, KY])
    schur = np.block([[stiffness, -stiffness], [-stiffness, stiffness]])
    shear = {FORWARD: -friction, BACKWARD: friction}.get(status, 0.0) * LOAD
    known = Candidates(
        surface=SurfaceState(np.zeros(1), np.array([[slope]]), np.array([[[curvature]]])),
        slip=np.zeros((1, 1)),
        force=np.array([[LOAD, shear]]) * (status != OPEN),
        status=np.array([status]),
        friction=np.array([friction]),
        interface_compliance=np.zeros((1, 2)),
        negative_stiffness=np.array([weakening]),
        gain_on_closing=np.zeros(1),
        friction_slope=np.array([[friction_slope]]),
    )
    return LinearContactStep(CondensedTangent.make(schur, None), known, np.zeros(4), np.zeros(2))


def with_load(step):
    """The same with the load on the bone prescribed instead of its height."""
    return replace(step, unknowns=(ExtraUnknown(-step.body.schur[:, -1], 1, -LOAD),))


@pytest.mark.parametrize("slope", [0.0, 0.7, -0.7])
@pytest.mark.parametrize("loaded", [False, True], ids=["height", "load"])
def test_on_a_crest_the_contact_force_turns_against_the_springs(slope, loaded):
    """Along the tangent the springs hold with kx cos^2 + ky sin^2, with kx cos^2 alone where the
    bone is free to rise; the force turns by h''/(1 + h'^2)^(3/2) per length.
    """
    step = point(FORWARD, slope, curvature=-0.9)
    cos2 = 1.0 / (1.0 + slope**2)
    held = KX * cos2 + (0.0 if loaded else KY * (1.0 - cos2))
    found = stability_ratio(with_load(step) if loaded else step)
    assert found.ratio == pytest.approx(LOAD * 0.9 * cos2**1.5 / held, rel=1e-12)
    assert found.cause == SLOPES


def test_an_interface_that_yields_along_the_tangent_does_not_hold_a_slipping_node_less():
    """Its spring carries the friction, which does not grow with the way; where friction falls with the
    speed of the slip, the spring is in series with the tissue's.
    """
    yields = np.array([[0.0, 2.0 / KX]])
    rigid = point(FORWARD, curvature=-0.9, friction=0.8)
    soft = replace(rigid, candidates=replace(rigid.candidates, interface_compliance=yields))
    assert stability_ratio(soft).ratio == pytest.approx(stability_ratio(rigid).ratio, rel=1e-12)
    falls = replace(point(FORWARD).candidates, slip_stiffness=np.array([-0.1]), interface_compliance=yields)
    assert stability_ratio(replace(rigid, candidates=falls)).ratio == pytest.approx(0.1 * 3.0 / KX, rel=1e-12)


def test_friction_turns_with_the_force_that_it_needs():
    """On level ground of friction mu the normal force grows by mu times what turns into it."""
    for status in (FORWARD, BACKWARD):
        found = stability_ratio(point(status, curvature=-0.9, friction=0.8))
        assert found.ratio == pytest.approx(LOAD * 0.9 * (1.0 + 0.8**2) / KX, rel=1e-12)


def test_in_a_trough_at_rest_and_without_a_surface_nothing_grows():
    assert stability_ratio(point(FORWARD, curvature=0.9)).ratio == 0.0
    assert stability_ratio(point(STICK, curvature=-0.9, friction=0.5)).ratio == 0.0
    assert stability_ratio(point(OPEN, curvature=-0.9)).ratio == 0.0


@pytest.mark.parametrize(("status", "falls"), [(FORWARD, -2.0), (BACKWARD, 2.0)])
def test_friction_that_falls_along_the_way_lets_go(status, falls):
    found = stability_ratio(point(status, friction=0.5, friction_slope=falls))
    assert found.ratio == pytest.approx(LOAD * 2.0 / KX, rel=1e-12)
    assert found.cause == FALLING
    assert stability_ratio(point(status, friction=0.5, friction_slope=-falls)).ratio == 0.0


@pytest.mark.parametrize(("grows", "share"), [(-0.6, 0.6 / KX), (0.6, 0.0)])
def test_friction_that_falls_with_the_speed_lets_go(grows, share):
    step = point(FORWARD, friction=0.5)
    found = stability_ratio(
        replace(step, candidates=replace(step.candidates, slip_stiffness=np.array([grows])))
    )
    assert found.ratio == pytest.approx(share, rel=1e-12)
    assert share == 0.0 or found.cause == FASTER


def test_an_attraction_that_weakens_with_the_gap_is_held_by_the_spring():
    found = stability_ratio(point(OPEN, weakening=1.2))
    assert found.ratio == pytest.approx(1.2 / KY, rel=1e-12)
    assert found.cause == ATTRACTION
