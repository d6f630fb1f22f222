"""Scenes that stopped earlier versions: steep friction, snapping pads, thin insulators, big steps. Each ends
in a converged state whose physics is known; most are cases of the study of stability, beside its quick ones.
"""

from dataclasses import replace

import numpy as np
import pytest
from tools.builders import coarse_pad

import evfem as ev
from evfem.simulation.run import Run
from evfem.studies.campaign.invariants import broken
from evfem.studies.stability.case import judge
from evfem.studies.stability.study import CASES

HARD = (
    "friction.jump_steep",
    "friction.jump_down",
    "pull-in.hover_kaczmarek",
    "thin_insulators.50_nm_kaczmarek",
    "voltage.attraction_alone_holds",
    "voltage.3000_V_from_the_first_step",
)
#: each has a cheaper neighbour above, or among the quick ones
SLOW = (
    "friction.jump_up",
    "friction.stop_and_go",
    "motion.full_unloading",
    "voltage.3000_V_in_one_step",
    "texture.wavelength_of_the_ridges_viscous",
)


@pytest.mark.parametrize("key", [*HARD, *(pytest.param(key, marks=pytest.mark.slow) for key in SLOW)])
def test_a_hard_case_of_the_study_ends_as_it_should(key):
    """The expectation is the case's own: `expected` says it in words."""
    found = judge(CASES[key])
    assert found.outcome == "passed", f"{found.expected}: {found.said}"
    assert found.force_error < 1e-7


@pytest.mark.filterwarnings("ignore:at .* V touching skin")
def test_a_thin_insulator_by_strong_troxels_law():
    """200 nm at 140 V: up to 1 MPa that falls within a fraction of a micrometre, so nodes snap one by one.
    Touching nodes are on the surface to the last digit; the rounding of their gaps would be a force.
    """
    surface = ev.Display(ev.Layer(2e-4, 3.35), friction=0.3)
    voltage = {"law": ev.StrongTroxel(), "voltage": 140.0}
    motion = [ev.Press(force=0.05, steps=5), ev.Slide(0.6, steps=3)]
    result = ev.simulate(
        ev.Scene(coarse_pad(), surface, motion=motion, output=ev.Output(every=100), **voltage)
    )
    assert result.electrostatic_force[4] > 20.0 * 0.05
    np.testing.assert_allclose(result.applied_force[:5], 0.01 * np.arange(1, 6), rtol=1e-6)
    balance = result.normal_force - result.electrostatic_force - result.applied_force
    assert np.abs(balance).max() < 1e-7 * result.normal_force.max()


def test_penalised_friction_obeys_the_return_map():
    """The penalty variant is a compliance of the interface; pointwise it is the return map of
    Coulomb's law with an elastic stick (Wriggers, Computational Contact Mechanics, 2nd ed., 2006,
    doi:10.1007/978-3-540-32609-0).
    """
    solver = ev.Solver(contact="penalty", penalty_normal=50.0, penalty_tangential=20.0)
    motion = [ev.Press(indentation=0.3, steps=1), ev.Slide(0.05, steps=2)]
    going = Run(ev.Scene(coarse_pad(), ev.Flat(friction=0.3), motion=motion, solver=solver), None)
    equilibrium = going.model.equilibrium
    for request in going.requests():
        old = going.state
        going.advance(request)
        new = going.state
        before, after = (
            equilibrium.interface.positions(old.u)[:, 0],
            equilibrium.interface.positions(new.u)[:, 0],
        )
        length = going.model.pad.length(before)
        touching = new.status > 0
        shear, pressure, past = (
            values[touching] / length[touching]
            for values in (new.contact_force[:, 1], new.contact_force[:, 0], old.contact_force[:, 1])
        )
        # the stick carries what it carried: its history is where its traction would be zero
        history = before[touching] + past / 20.0
        trial, limit = -20.0 * (after[touching] - history), 0.3 * pressure
        np.testing.assert_allclose(np.clip(trial, -limit, limit), shear, atol=1e-7)


@pytest.mark.parametrize(("law", "voltage"), [(ev.Kaczmarek(), 1500.0), (ev.StrongTroxel(), 500.0)])
@pytest.mark.parametrize("ridges", [False, True])
def test_a_hovering_pad_falls_onto_the_display_under_a_small_force(law, voltage, ridges):
    """No equilibrium with that force is near: the attraction grows faster on the way down than the finger
    stiffens. The bone flies to the surface and a little beyond, not as far as it may, and where the linear
    problem has no travel that settles the force, the one that lacks least is taken.
    """
    surface = ev.Display(ev.Layer(0.05, 3.35), friction=0.3)
    motion = [ev.Hover(gap=0.1, steps=1), ev.Press(force=0.002, steps=2)]
    result = ev.simulate(ev.Scene(replace(coarse_pad(), ridges=ridges), surface, law, voltage, motion))
    assert result.min_gap[0] > 0.05
    assert result.contact_width[1] > 0.1
    asked = [0.5 * (result.applied_force[0] + 0.002), 0.002]  # from what the hovering bone carries
    np.testing.assert_allclose(result.applied_force[1:], asked, rtol=1e-7)
    balance = result.normal_force - result.electrostatic_force - result.applied_force
    assert np.abs(balance).max() < 1e-7 * result.normal_force.max()
    assert result.substeps.tolist() == [1, 1, 1]


def test_a_bone_lacks_nothing_at_the_travel_that_settles_its_force():
    """`lacking` is the balance of the bone, computed from displacements instead of compliances."""
    going = Run(ev.Scene(coarse_pad(), ev.Flat(friction=0.3), motion=[ev.Press(force=0.02, steps=1)]), None)
    body, seen = going.model.equilibrium.body, []
    solve = body._solve
    body._solve = lambda step: seen.append((step, solve(step))) or seen[-1][1]
    going.advance(next(going.requests()))
    step, found = next(pair for pair in reversed(seen) if pair[0].unknowns)
    travel = float(found.extra[0])
    given = replace(step, bone=step.bone + np.array([0.0, travel]), unknowns=()).solve()
    assert abs(step.lacking(given, travel)) < 1e-12
    higher = replace(step, bone=step.bone + np.array([0.0, travel + 1e-3]), unknowns=()).solve()
    assert step.lacking(higher, travel + 1e-3) < -1e-6  # pulled up, it lacks a downward force


def test_friction_that_falls_within_a_nodes_motion_is_passed_in_one_substep():
    """From 1.2 to 0.2 over 0.02 mm: at the ramp friction falls faster than the tissue stiffens, so
    that a node has no equilibrium there and snaps forward to the lower coefficient.
    """
    surface = ev.Flat(friction=[[-5.0, 1.2], [0.5, 1.2], [0.52, 0.2], [5.0, 0.2]])
    motion = [ev.Press(force=0.05, steps=3), ev.Slide(2.0, steps=10, hold="force")]
    result = ev.simulate(ev.Scene(replace(coarse_pad(), ridges=True), surface, motion=motion))
    assert result.substeps.sum() <= 15
    x = result.mesh.points[:, 0] + result.frames[-1].displacement[:, 0]
    frame = result.frames[-1]
    slipping = (frame.contact_status == 2) & (frame.contact_pressure > 1e-3 * frame.contact_pressure.max())
    ratio = np.abs(frame.shear_traction / np.where(slipping, frame.contact_pressure, 1.0))[slipping]
    np.testing.assert_allclose(ratio, surface.friction_coefficient(x[slipping]), rtol=1e-6)


STEEP = ev.Sinusoid(terms=[[0.05, 9.7, 0.4]], friction=0.1)


def test_a_finger_pushed_aside_by_a_steep_texture_goes_on_to_where_it_is_held():
    """With 0.05 mm of amplitude the contact forces of the wave push a loaded finger aside harder
    than its tissue holds it. Before, each step was cut to its smallest part there, and gave up.

    In the second step a node that is not a candidate sinks in: the balance that was found without it is
    refused, and what it adds to the residual is no reason to give up.
    """
    motion = [ev.Press(force=0.1, steps=2), ev.Slide(0.5, steps=2)]
    scene = ev.Scene(coarse_pad(), STEEP, motion=motion)
    result = ev.simulate(scene)
    assert result.substeps[:3].max() <= 2
    assert result.substeps[3] <= 16
    assert broken(scene, result) == []


def test_a_finger_that_is_not_held_on_a_steep_texture_is_released():
    """The finger comes to rest by itself; and if it must
    not be released, the sentence says what pushes it aside.
    """
    motion = [ev.Press(force=0.1, steps=2), ev.Slide(0.42, steps=2)]
    scene = ev.Scene(coarse_pad(), STEEP, motion=motion)
    held = ev.Solver(strategy=ev.Strategy(relaxation=False))
    with pytest.raises(ev.NotConverged, match=r"no equilibrium at rest near here: on the slopes.*relaxation"):
        ev.simulate(replace(scene, solver=held))
    result = ev.simulate(scene)
    assert result.relaxations.any()
    assert broken(scene, result) == []
