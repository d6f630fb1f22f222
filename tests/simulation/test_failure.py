"""What a failed step says: which force wins and where, and only what can help that scene."""

import traceback
from dataclasses import replace

import pytest
from tools.builders import coarse_pad, finger
from tools.meshes import block

import evfem as ev
from evfem.contact.stability import SLOPES, StabilityRatio
from evfem.newton.control import Target
from evfem.newton.state import Collapsed, Folded, LiftedOff, StepFailed
from evfem.simulation.doubtful import advice
from evfem.simulation.run import Run


def said(
    share=1.2, duration=0.0, released=False, unstable=False, failure=StepFailed, electric=None, **solver
):
    """What is said of a step from a pressed finger whose loss is at `share`."""
    timed = solver.get("dynamics", "quasistatic") != "quasistatic"
    body = finger(block(4, 2), viscosity=1e-3 * timed)
    motion = [ev.Press(indentation=0.1, steps=1), ev.Slide(0.1, steps=1, speed=1.0)]
    surface = ev.Flat(friction=0.3, insulator=ev.Layer(0.05, 3.0))
    going = Run(ev.Scene(body, surface, motion=motion, solver=ev.Solver(**solver), **(electric or {})), None)
    going.advance(next(going.requests()))
    failed = failure("nodes keep changing", [1.0])
    failed.findings, failed.released, failed.unstable = "out of balance: 1 N/mm", released, unstable
    failed.last = going.state, replace(Target.held(going.state.bone, 0.0), duration=duration)
    going.model.equilibrium.body.stability_ratio = lambda state, target: StabilityRatio(share, SLOPES)
    return advice(going.scene, going.model, failed).split("; ")


def test_the_sentence_names_the_force_its_amount_and_the_place():
    lost, way_out, findings = said()
    assert lost.startswith(f"there is no equilibrium at rest near here: {SLOPES}, 1.2 times as hard as its")
    assert "at position 0 mm, indentation 0.1 mm, 0.0" in lost
    assert lost.endswith("N/mm and 0 V, and harder beyond")
    assert findings == "out of balance: 1 N/mm"
    assert "dynamics = viscous" in way_out
    assert "relaxation" not in way_out
    assert said(released=True)[0].endswith("released there it does not come to rest")
    off = ev.Strategy(relaxation=False)
    assert "relaxation of the strategy switched on" in said(strategy=off)[1]


class NoPotential:
    """A law whose attraction cannot be along the normal."""

    @staticmethod
    def traction(gap, voltage, layers):
        return ev.Kaczmarek().traction(gap, voltage, layers)


@pytest.mark.parametrize(
    ("released", "law", "options", "advised"),
    [
        (True, ev.Kaczmarek(), {}, True),
        (False, ev.Kaczmarek(), {}, False),
        (True, ev.Kaczmarek(), {"direction": "normal"}, False),
        (True, NoPotential(), {}, False),
        (True, ev.StrongTroxel(), {"field": "full"}, False),
    ],
)
def test_an_attraction_with_an_energy_is_advised_where_it_may_be_had(released, law, options, advised):
    surface = ev.Flat(insulator=ev.Layer(0.05, 3.0))
    scene = ev.Scene(coarse_pad(), surface, law, 100.0, ev.Press(indentation=0.5, steps=1), **options)
    failed = StepFailed("nodes keep changing", [1.0])
    failed.released = released
    assert ("direction = normal" in advice(scene, None, failed)) == advised


def test_nothing_is_claimed_of_an_equilibrium_that_is_held():
    assert said(share=0.5)[0] == "nodes keep changing"
    assert said(share=0.5, unstable=True)[0].startswith("there is no equilibrium at rest")
    assert not said(share=1e-4, unstable=True)[0].startswith("there is no equilibrium at rest")
    assert said(share=0.89)[0] == "nodes keep changing"


@pytest.mark.parametrize("dynamics", ["viscous", "inertial"])
def test_who_has_time_already_is_not_told_to_take_it(dynamics):
    lost, way_out, _ = said(duration=1e-4, dynamics=dynamics)
    assert lost.startswith("there is no equilibrium within a time step as short as this near here")
    still = said(dynamics=dynamics)
    assert still[0].startswith("there is no equilibrium at rest near here")
    assert "a motion with a speed" in still[1]
    assert "a motion with a speed" not in way_out
    for text in (lost, way_out, *still):
        assert "dynamics" not in text


def test_a_fold_is_told_as_it_is():
    found = said(failure=Folded)
    assert found[0] == "nodes keep changing"
    assert found[1] == "try smaller steps, less friction or a finer mesh"
    electric = {"law": ev.Kaczmarek(), "voltage": 100.0}
    assert "less voltage, a thicker insulator" in said(failure=Folded, electric=electric)[1]


def test_a_load_that_cells_do_not_bear_is_told_to_be_smaller():
    """Not to be given an energy, or time, even where a release was tried."""
    failed = Collapsed("cells would collapse", [1.0])
    failed.released = True
    surface = ev.Flat(insulator=ev.Layer(0.05, 3.0))
    scene = ev.Scene(coarse_pad(), surface, ev.Kaczmarek(), 100.0, ev.Press(force=50.0, steps=1))
    _, why = advice(scene, None, failed).split("; ")
    assert why.startswith(
        "the load is too large for the mesh, or the step too long: try a smaller load, less"
    )


def test_where_friction_falls_with_the_speed_only_mass_helps():
    """Stribeck's law falls from mu to half of it; one that rises does not, and with mass it is followed."""
    motion = [ev.Press(indentation=0.1, steps=1), ev.Slide(0.1, steps=1, speed=1.0)]

    def told(law, **solver):
        body = finger(block(4, 2), viscosity=1e-3)
        scene = ev.Scene(
            body, ev.Flat(friction=0.3), motion=motion, friction_law=law, solver=ev.Solver(**solver)
        )
        told = advice(scene, None, StepFailed("nodes keep changing", [1.0]))
        known = next(term.reason for term in ev.plan(scene).terms if term.name == "friction")
        return "try dynamics = inertial" in told, "dynamics = inertial resolves it" in known

    falling, rising = ev.RateFriction(speed=5.0, ratio=0.5), ev.RateFriction(speed=5.0, exponent=0.5)
    assert told(falling, dynamics="viscous") == (True, True)
    assert told(falling) == (True, True)
    assert told(falling, dynamics="inertial") == told(rising, dynamics="viscous") == (False, False)


def test_a_finger_that_was_pulled_off_is_told_as_it_is_and_from_where():
    lost = said(failure=LiftedOff)[:2]
    assert lost[0] == "nodes keep changing"
    assert lost[1].startswith("it was lost at position 0 mm, indentation 0.1 mm, 0.0")


def test_a_plain_failure_keeps_its_reason():
    hopeless = ev.Solver(strategy=ev.Strategy(iterations=2, smallest_part=1.0))
    with pytest.raises(
        ev.NotConverged, match=r"no equilibrium in 2 iterations; try smaller steps.*; out of balance"
    ) as caught:
        ev.simulate(
            ev.Scene(coarse_pad(), ev.Flat(), motion=ev.Press(indentation=0.5, steps=1), solver=hopeless)
        )
    assert "".join(traceback.format_exception(caught.value)).count("Traceback") == 1
