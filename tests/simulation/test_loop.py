"""Steps at will: the rows are those of `simulate`, mistakes are told, and a failed step leaves no trace."""

import pickle
import weakref
from dataclasses import fields, replace

import numpy as np
import pytest
from tools.domes import dome_scene
from tools.refusals import refuses

import evfem as ev
from evfem.simulation.result import Frame

FIELDS = [spec.name for spec in fields(Frame)]
PAD = ev.FingerPad(resolution="coarse", ridges=False)
VISCOUS = ev.Solver(dynamics="viscous")


def plane(*motion, voltage=500.0, **options):
    return ev.Scene(PAD, ev.Display(friction=0.3), ev.Kaczmarek(), voltage, motion, **options)


def same(found, wanted, error=1e-12, but=("motion", "motion_index", "seconds")):
    """Every column of two results (`but` names and wall time), relative to its largest value."""
    for name in wanted.columns:
        if name not in but:
            assert np.isnan(found[name]).tolist() == np.isnan(wanted[name]).tolist(), name
            scale = max(np.nanmax(np.abs(wanted[name]), initial=0.0), 1e-6)
            assert np.nanmax(np.abs(found[name] - wanted[name]), initial=0.0) <= error * scale, name


def test_the_rows_are_those_of_the_scene_with_the_same_steps():
    """Press, slide under the load, ramp, hover: the same problem, to rounding."""
    motion = (
        ev.Press(force=0.05, steps=2),
        ev.Slide(distance=0.5, steps=4, hold="force"),
        ev.VoltageRamp(voltage=900.0, steps=2),
        ev.Hover(gap=0.1),
    )
    wanted = ev.simulate(plane(*motion))
    loop = ev.loop(plane(), largest_voltage=900.0)
    rows = [loop.step(force=0.025), loop.step(force=0.05)]
    rows += [loop.step(position=0.125 * k) for k in range(1, 5)]
    rows += [loop.step(voltage=700.0, indentation=rows[-1].indentation), loop.step(voltage=900.0)]
    rows += [loop.step(indentation=-0.1)]
    same(loop.result(), wanted)
    assert [row.step for row in rows] == list(range(1, 10))
    assert [row.normal_force for row in rows] == loop.result().normal_force.tolist()
    assert rows[-2].position == 0.5
    assert set(vars(rows[-1])) == set(wanted.columns)


def test_in_time_too_and_the_scenes_own_motion_comes_first():
    motion = (
        ev.Press(indentation=0.5, steps=3),
        ev.Slide(distance=0.5, steps=4, speed=20.0),
        ev.Wait(0.01, steps=2),
    )
    finger = replace(PAD, viscosity=1e-3)
    scene = ev.Scene(finger, ev.Display(friction=0.3), motion=motion, solver=VISCOUS)
    loop = ev.loop(replace(scene, motion=motion[:1]))
    for k in range(1, 5):
        loop.step(position=0.125 * k, duration=0.125 / 20.0)
    loop.step(duration=0.005)
    row = loop.step(duration=0.005)
    same(loop.result(), ev.simulate(scene), 1e-10)
    assert row.time == pytest.approx(0.035, rel=1e-12)
    assert loop.result().motion.tolist() == ["press"] * 3 + ["step"] * 6


def test_in_space_a_way_along_z_is_a_slide_at_a_right_angle():
    motion = (
        ev.Press(indentation=0.2, steps=1),
        ev.Slide(distance=-0.1, angle=90.0, steps=1),
        ev.Slide(distance=-0.1, steps=1),
    )
    scene = dome_scene(*motion)
    loop = ev.loop(replace(scene, motion=()))
    loop.step(indentation=0.2)
    across = loop.step(position_z=-0.1)
    along = loop.step(position=-0.1)
    wanted = ev.simulate(scene)
    same(loop.result(), wanted)
    assert across.position_z == along.position_z == -0.1
    assert across.tangential_force == across.tangential_force_z < 0.0
    assert along.tangential_force == along.tangential_force_x < 0.0


def test_a_held_force_stays_until_another_and_a_signal_goes_on():
    """In full slip friction is 0.3 times the normal force (Coulomb); the load is what was asked for."""
    loop = ev.loop(plane(ev.Press(force=0.05, steps=2)))
    for k in range(1, 4):
        row = loop.step(position=0.4 * k)
        assert row.applied_force == pytest.approx(0.05, rel=1e-7)
    assert row.tangential_force == pytest.approx(0.3 * row.normal_force, rel=1e-6)
    held = loop.step(indentation=row.indentation)
    assert loop.step(position=1.6).indentation == held.indentation
    sine = ev.Sine(amplitude=500.0, frequency=50.0)
    over_time = ev.loop(plane(voltage=sine))
    over_time.step(force=0.05, duration=0.0)
    assert over_time.step(duration=0.005).voltage == pytest.approx(500.0, rel=1e-12)  # a quarter period


def test_a_voltage_beyond_the_largest_makes_the_model_anew():
    """Raised from nothing it ends where a scene ends that knows of it: friction and attraction of both."""
    loop = ev.loop(plane(ev.Press(force=0.05, steps=2), voltage=0.0))
    loop.step(voltage=400.0)
    row = loop.step(voltage=800.0)
    motion = (ev.Press(force=0.05, steps=2), ev.VoltageRamp(voltage=800.0, steps=2, hold="force"))
    wanted = ev.simulate(plane(*motion, voltage=0.0))
    assert row.electrostatic_force == pytest.approx(wanted.electrostatic_force[-1], rel=1e-6)
    assert len(loop.result().frames) == 4


def test_a_failed_step_leaves_the_loop_where_it_was():
    """Pressed down to the bone there is no equilibrium; the next step is as if that had not been asked."""
    solver = ev.Solver(strategy=ev.Strategy(smallest_part=0.25, relaxation=False))
    calm, tried = (ev.loop(plane(ev.Press(force=0.05, steps=2), solver=solver)) for _ in range(2))
    with pytest.raises(ev.NotConverged) as failed:
        tried.step(indentation=5.0)
    assert len(failed.value.result.rows) == 2
    calm.step(position=0.3)
    tried.step(position=0.3)
    # the books too have nothing of what was tried, only a tangent made there may cost iterations
    same(tried.result(), calm.result(), 1e-7, ("motion", "seconds", "newton_iterations"))
    assert tried.result().summary()["complete"]


def test_observers_are_told_and_may_stop():
    class Watch:
        def __init__(self):
            self.told = []

        def started(self, mesh, scene, total_steps):
            self.told.append(total_steps)

        def step(self, row, frame, checkpoint):
            self.told.append((row["step"], frame is not None, len(checkpoint()) > 5))
            if row["position"] > 0.1:
                raise ev.StopRun("far enough")

        def finished(self, result):
            self.told.append(len(result.rows))

    watch = Watch()
    loop = ev.loop(plane(ev.Press(force=0.05, steps=1), output=ev.Output(every=2)), observers=[watch])
    loop.step(position=0.1)
    with pytest.raises(ev.StopRun, match="far enough"):
        loop.step(position=0.2)
    found = loop.result()
    assert watch.told == [1, (1, True, True), (2, True, True), (3, False, True), 3]
    assert found.provenance["stopped"] == "far enough"
    assert [frame.step for frame in found.frames] == [1, 2, 3]
    refuses(r"observers: given .*; allowed: a list of observers", ev.loop, plane(), observers=watch)
    refuses(r"observers\[0\]", ev.loop, plane(), observers=[3])


@pytest.mark.parametrize("largest", [-1, "-2 kV", 1.1e6, float("nan"), "high"])
def test_a_largest_voltage_is_a_magnitude(largest):
    sentence = r"^largest_voltage: given .*; allowed: .*the largest magnitude in V .*, from 0 to 1e6$"
    refuses(sentence, ev.loop, plane(), largest_voltage=largest)


SPEEDED = ev.Scene(replace(PAD, viscosity=1e-3), ev.Flat(friction=0.3), solver=VISCOUS)
MISTAKES = [
    (plane(), {"indentation": 0.1, "force": 0.1}, "force: given indentation and force; allowed: one of"),
    (plane(), {"force": -1.0}, "force: given -1"),
    (plane(), {"position": "far"}, 'position: given "far"'),
    (plane(), {"position_z": 1.0}, "position_z: given a displacement across x; allowed: 0 with a finger in"),
    (plane(), {"duration": -1.0}, "duration: given -1.0; allowed: a time in s, not negative"),
    (ev.Scene(PAD, ev.Flat()), {"voltage": 1.0}, "voltage: given a voltage without a law"),
    (ev.Scene(PAD, ev.Flat()), {"force": 0.0}, "force: given 0.0; allowed: larger than 0 when nothing else"),
    (SPEEDED, {"position": 1.0}, "duration: missing; allowed: a time in s, needed with dynamics"),
    (SPEEDED, {"position": 1.0, "duration": 0.0}, "duration: given 0.0; allowed: larger than 0 where"),
    (
        plane(voltage=ev.VoltageProfile([0.0, 1.0], [0.0, 100.0])),
        {"voltage": 1.0},
        "voltage: given 1 beside the VoltageProfile of the scene; allowed: one of the two",
    ),
]


def test_mistakes_are_one_sentence_and_change_nothing():
    for scene, asked, sentence in MISTAKES:
        loop = ev.loop(scene)
        before = len(loop.result().rows)
        told = refuses("allowed", loop.step, **asked)
        assert str(told).startswith(sentence), str(told)
        assert "\n" not in str(told)
        assert len(loop.result().rows) == before


def test_a_scene_without_motion_is_for_loops_alone(tmp_path):
    for use in (ev.simulate, ev.plan):
        refuses("motion: missing; allowed: at least one of Press", use, plane())
    assert "0 steps" in repr(ev.loop(plane()))


#: scenes whose fields are made in different ways: attraction, elastic surface, full field, rough faces, time
SHOWN = {
    "display": plane(),
    "elastic": ev.Scene(PAD, ev.Flat(friction=0.3, elastic=ev.ElasticLayer(0.1, 0.4, 1.0))),
    "full field": ev.Scene(
        PAD, ev.Display(friction=0.3), ev.StrongTroxel(), 100.0, field="full", roughness_gap=0.005
    ),
    "penalty": plane(solver=ev.Solver(contact="penalty", penalty_normal=10.0, penalty_tangential=5.0)),
    "time": ev.Scene(replace(PAD, viscosity=1e-3), ev.Flat(friction=0.3), solver=VISCOUS),
    "space": dome_scene(law=ev.Kaczmarek(), voltage=200.0),
}


class Reader:
    """Copies of the fields of every step, made at once."""

    def __init__(self):
        self.frames = []

    def step(self, row, frame, checkpoint):
        self.frames.append({name: np.copy(getattr(frame, name)) for name in FIELDS})


@pytest.mark.parametrize(
    ("name", "linearised"), [*((name, False) for name in SHOWN), *((name, True) for name in [*SHOWN][:4])]
)
def test_fields_that_are_read_later_are_those_of_their_step(name, linearised):
    """A frame is made when it is read: after other steps to the last bit the same."""
    read = Reader()
    loops = [ev.loop(SHOWN[name], linearised=linearised, observers=each) for each in ([read], [])]
    for loop in loops:
        loop.step(indentation=0.1, duration=0.0)
        for x in (0.05, 0.1):
            loop.step(position=x, duration=0.01)
    copied = pickle.loads(pickle.dumps(later := loops[1].result())).frames
    assert linearised or len(copied) == 3
    assert linearised or [sorted(vars(one)) for one in later.frames] == [sorted(FIELDS)] * 3
    for field in FIELDS:
        for k, frame in enumerate(read.frames):
            np.testing.assert_array_equal(getattr(later.frames[k], field), frame[field], err_msg=field)
            np.testing.assert_array_equal(getattr(copied[k], field), frame[field], err_msg=field)


def test_frames_that_nobody_reads_hold_no_stresses_and_no_factors():
    loop = ev.loop(plane())
    loop.step(indentation=0.3)
    model, frame = loop._run.model, loop.result().frames[0]
    large = [weakref.ref(one) for one in (model.equilibrium, model.body)]
    del loop, model
    assert [one() for one in large] == [None, None]
    assert set(vars(frame)) == {"step", "time", "position", "_make"}
    assert frame.von_mises.max() > 0.0
    assert set(vars(frame)) == set(FIELDS)
    with pytest.raises(AttributeError, match="'Frame' object has no attribute 'stress'"):
        frame.stress  # noqa: B018
