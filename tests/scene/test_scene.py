"""Scenes hold what they were given, refuse what does not fit together, and have a stable fingerprint."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from tools.commands import printed
from tools.refusals import refuses

import evfem as ev
from evfem.common.digest import digest

FINGER = ev.FingerPad()
PRESS = ev.Press(force=0.05)
PROFILE = ev.VoltageProfile([0.0, 1.0], [0.0, 100.0])


def plain(**changes):
    """A scene without voltage."""
    return ev.Scene(FINGER, **({"surface": ev.Flat(), "motion": [PRESS]} | changes))


def charged(**changes):
    """A scene with a law and a voltage."""
    parts = {"surface": ev.Display(), "law": ev.Kaczmarek(), "voltage": 1000.0, "motion": [PRESS]}
    return ev.Scene(FINGER, **(parts | changes))


class Bent:
    """A user's law."""

    def traction(self, gap, voltage, layers):
        return 1e-12 * voltage**2 / (gap + layers.reduced)


@ev.form
def spring(u, v, w):
    return 2.0e-2 * u * v


def test_scenes_and_their_parts_are_frozen():
    for part in (plain(), PRESS, ev.Slide(1.0), ev.Solver(), ev.Output(), ev.Hover(1.0), ev.VoltageRamp(1.0)):
        with pytest.raises(FrozenInstanceError):
            part.steps = 3


def test_motion_may_be_one_motion_or_any_iterable():
    assert plain(motion=PRESS).motion == plain(motion=iter([PRESS])).motion == (PRESS,)


INERTIAL = ev.Solver(dynamics="inertial")
PENALTY = ev.Solver(contact="penalty", penalty_normal=10.0)
WRONG_SCENES = [
    (lambda: ev.Scene(None, ev.Flat(), motion=[PRESS]), "finger"),
    (lambda: plain(surface=ev.Kaczmarek()), "surface"),
    (lambda: plain(motion=[3]), "motion[0]"),
    (lambda: plain(motion="press"), "motion[0]"),
    (lambda: plain(motion=ev.Press), "motion[0]"),
    (lambda: plain(motion=[PRESS, "slide"]), "motion[1]"),
    (lambda: plain(voltage=100.0), "electrostatics.law"),
    (lambda: plain(voltage=PROFILE), "electrostatics.law"),
    (lambda: plain(law=ev.Kaczmarek()), "surface.insulator"),
    (lambda: plain(motion=[PRESS, ev.VoltageRamp(10.0)]), "motion[1]"),
    (lambda: plain(motion=[ev.Press(force=0.0)]), "motion[0].force"),
    (lambda: charged(law=ev.Kaczmarek), "electrostatics.law"),
    (lambda: charged(law="kaczmarek"), "electrostatics.law"),
    (lambda: charged(voltage=float("nan")), "electrostatics.voltage"),
    (lambda: charged(voltage=PROFILE, motion=[PRESS, ev.VoltageRamp(10.0)]), "motion[1]"),
    (lambda: charged(direction="up"), "electrostatics.direction"),
    (lambda: charged(coupling="weak"), "electrostatics.coupling"),
    (lambda: charged(air_layer=1), "electrostatics.air_layer"),
    (lambda: plain(motion=[ev.Slide(1.0, hold="force")]), "motion[0].hold"),
    (lambda: charged(motion=[ev.VoltageRamp(1.0, hold="force")]), "motion[0].hold"),
    (lambda: plain(motion=[PRESS, ev.Hover(1.0), ev.Slide(1.0, hold="force")]), "motion[2].hold"),
    (lambda: plain(solver=INERTIAL, motion=[PRESS, ev.Slide(1.0)]), "motion[1].speed"),
    (lambda: plain(solver=ev.Solver(dynamics="viscous")), "finger.viscosity"),
    (lambda: plain(solver=PENALTY), "solver.penalty_tangential"),
    (lambda: ev.Solver(penalty_normal=10.0), "penalty_normal"),
    (lambda: plain(solver={"element": "q1"}), "solver"),
    (lambda: plain(output=3), "output"),
    (lambda: plain(name="a/b"), "name"),
    (lambda: plain(forms=(spring,)), "forms"),
]


@pytest.mark.parametrize(("make", "key"), WRONG_SCENES)
def test_scenes_refuse_what_does_not_fit_together(make, key):
    assert refuses("allowed", make).key == key


def test_elements_follow_the_cells_of_the_mesh():
    assert ev.Solver().element_on(4) == "q2p1"
    assert ev.Solver().element_on(3) == ev.Solver(element="p2").element_on(3) == "p2"
    assert [ev.Solver(element=e).element_on(4) for e in ("q1", "q1_fbar", "q2", "q2p1")] == [
        "q1",
        "q1_fbar",
        "q2",
        "q2p1",
    ]
    for element, corners in (("p2", 4), ("q1", 3), ("q2p1", 3)):
        refuses(r"solver\.element", ev.Solver(element=element).element_on, corners)


def test_a_term_is_added_to_a_copy():
    scene = plain()
    more = scene.with_term(spring, on=ev.Boundary("nail")).with_term(spring, on=ev.Region("dermis"))
    assert scene.forms == ()
    assert [(term.form.name, term.on) for term in more.forms] == [
        ("spring", ev.Boundary("nail")),
        ("spring", ev.Region("dermis")),
    ]
    assert spring(2.0, 3.0, None) == pytest.approx(0.12)
    refuses(r"@evfem\.form", scene.with_term, lambda u, v, w: u, on=ev.Boundary("nail"))
    refuses("Boundary", scene.with_term, spring, on="nail")


def test_the_fingerprint_follows_the_content_and_not_the_name():
    assert plain().digest() == plain(name="other").digest() == plain(motion=(PRESS,)).digest()
    scenes = [
        plain(),
        plain(motion=[ev.Press(force=0.06)]),
        plain(motion=[ev.Press(force=0.05, steps=11)]),
        plain(motion=[PRESS, PRESS]),
        plain(surface=ev.Flat(friction=0.2)),
        plain(surface=ev.Flat(friction=[[0.0, 0.3], [1.0, 0.2]])),
        plain(solver=ev.Solver(tolerance=1e-9)),
        plain(output=ev.Output(every=2)),
        plain().with_term(spring, on=ev.Boundary("nail")),
        plain().with_term(spring, on=ev.Boundary("bone")),
        charged(),
        charged(law=ev.StrongTroxel()),
        charged(law=Bent()),
        charged(voltage=PROFILE),
        charged(voltage=ev.VoltageProfile([0.0, 1.0], [0.0, 101.0])),
        ev.Scene(ev.FingerPad(width=16.0), ev.Flat(), motion=[PRESS]),
    ]
    assert len({scene.digest() for scene in scenes}) == len(scenes)


def test_the_fingerprint_of_user_code_follows_the_code():
    def make(factor):
        def traction(gap, voltage, layers):
            return factor * voltage**2

        return traction

    def other(gap, voltage, layers):
        return 2.0 * voltage**3

    assert digest(make(2.0)) == digest(make(2.0)) != digest(make(3.0))
    assert digest(other) != digest(make(2.0))
    assert digest(lambda x: 2.0 * x) == digest(lambda x: 2.0 * x) != digest(lambda x: 3.0 * x)
    assert digest(lambda x: np.sin(x)) != digest(lambda x: np.cos(x))


def test_the_fingerprint_is_the_same_in_another_process():
    code = "import evfem; print(evfem.default_scene().digest())"
    assert {printed(code, PYTHONHASHSEED=seed) for seed in "12"} == {ev.default_scene().digest()}


def test_the_fingerprint_of_a_path_is_that_of_the_file(tmp_path):
    (tmp_path / "a").write_text("one")
    (tmp_path / "b").write_text("one")
    assert digest(tmp_path / "a") == digest(tmp_path / "b")
    (tmp_path / "b").write_text("two")
    assert digest(tmp_path / "a") != digest(tmp_path / "b")


def test_arrays_count_by_content_shape_and_kind():
    a = np.arange(6.0)
    assert digest(a) == digest(np.arange(6.0)) == digest(np.arange(12.0)[::2] / 2)
    assert len({digest(x) for x in (a, a.reshape(2, 3), a.astype(int), a + 1e-15)}) == 4
    assert digest(np.bool_(True)) == digest(True) != digest(1.0)


def test_an_object_that_contains_itself_has_a_fingerprint():
    law = Bent()
    law.me = law
    assert len(digest(law)) == 64
