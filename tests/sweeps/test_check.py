"""How accurate a number is: the errors that `ev.check` states, against runs that are much more accurate, and
`ev.accurate`, which keeps to an error asked for.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from tools.meshes import block

import evfem as ev
from evfem import cli
from evfem.sweeps.check import Variant, _row, more_steps, remeshed

FORCES = ["normal_force", "tangential_force"]


def pad(resolution="coarse", **more):
    return ev.FingerPad(**{"ridges": False, "resolution": resolution} | more)


def pressed(finger=None, **more):
    usual = {"motion": ev.Press(indentation=0.8, steps=2)} | more
    return ev.Scene(finger or pad(), ev.Flat(friction=0.0), **usual)


def stuck(steps=2, **more):
    """A block that sticks and slips: of first order in the steps."""
    finger = ev.MeshedFinger(block(8, 3, sag=0.2), {"tissue": ev.NeoHookean(E=0.05, nu=0.4)})
    motion = [ev.Press(indentation=0.3, steps=steps), ev.Slide(0.15, steps=steps)]
    return ev.Scene(finger, ev.Flat(friction=0.3), motion=motion, **more)


def off(found, reference):
    """How far each output is from the end of another run, as a share of it."""
    exact = ev.simulate(reference)
    return [abs(exact[one.output][-1] / one.value - 1.0) for one in found.outputs]


def ways(found):
    return [row["way"] for row in found.rows]


PRESS, SLIDE = ev.Press, ev.Slide
SOFT = {"relaxation": ((0.8, 0.04), (0.5, 0.7))}
HELD = [PRESS(force=0.05, steps=3), SLIDE(0.6, steps=4)]
DEEP = [PRESS(indentation=0.6, steps=3), SLIDE(1.0, steps=6)]
RELAXES = [PRESS(indentation=0.6, steps=4, speed=5.0), ev.Wait(0.1, steps=4)]
SLOW = ev.Solver(dynamics="viscous")
SECOND = ev.FingerPad.participant("ii", resolution="coarse")
#: of many kinds, on the coarse mesh
SCENES = {
    "press": pressed(),
    "stick": ev.Scene(pad(), ev.Flat(friction=0.5), motion=[HELD[0], SLIDE(0.2, steps=2)]),
    "slip": ev.Scene(pad(), ev.Flat(friction=0.3), motion=DEEP),
    "ridges": ev.Scene(pad(ridges=True), ev.Flat(friction=0.0), motion=PRESS(force=0.05, steps=2)),
    "ridges slip": ev.Scene(pad(ridges=True), ev.Flat(friction=0.4), motion=HELD),
    "sine": ev.Scene(pad(), ev.Sinusoid(0.3, [[0.05, 3.14, 0.0]]), motion=DEEP),
    "hover": ev.Scene(pad(), ev.Display(), ev.Kaczmarek(), 100.0, ev.Hover(gap=0.1, steps=1)),
    "voltage": ev.Scene(pad(), ev.Display(friction=0.3), ev.Kaczmarek(), 100.0, HELD),
    "relaxation": ev.Scene(pad(**SOFT), ev.Flat(friction=0.3), motion=RELAXES, solver=SLOW),
    "participant": ev.Scene(SECOND, ev.Flat(friction=0.2), motion=[PRESS(force=0.03, steps=3), HELD[1]]),
}
OUTPUTS = [*FORCES, "electrostatic_force", "indentation", "contact_width", "peak_contact_pressure"]


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_stated_errors_hold(name):
    """Against the finest mesh in four times the steps; an output that is held or 0 has none to rounding."""
    scene = SCENES[name]
    found = ev.check(scene, [*OUTPUTS, "real_contact_width"])
    assert found.agrees
    exact = ev.simulate(more_steps(remeshed(scene, "fine"), 4))
    least = 1e-3 * max(abs(exact[force]).max() for force in (*FORCES, "electrostatic_force"))
    for one in found.outputs:
        there = abs(exact[one.output][-1] - one.value) / max(abs(one.value), least)
        print(f"{name:12} {one.output:22} {100 * there:8.2g} % stated {100 * one.sum:8.2g} %")
        assert there <= one.sum + 1e-7


def test_the_error_of_the_mesh_is_that_against_a_much_finer_one():
    """From a coarse mesh and the next one: no less than there is, and less than ten times it."""
    scene, names = pressed(), ("normal_force", "contact_width")
    found = ev.check(scene, names)
    assert "a finer (medium) mesh" in ways(found)
    for one, there in zip(found.outputs, off(found, pressed(pad("fine"))), strict=True):
        assert there < one.mesh < 10.0 * there
        assert one.mesh > 100.0 * max(one.steps, one.tolerance, one.path)  # nothing depends on the path
        assert found.error[one.output] == pytest.approx(one.mesh, rel=0.01)


@pytest.mark.slow
def test_a_mesh_between_two_has_an_order_of_its_own():
    """Three meshes leave less doubt than two: the medium one's error is above that against the finest."""
    scene = pressed(pad("medium"))
    found = ev.check(scene, "normal_force")
    assert {"a finer (fine) mesh", "a coarser (coarse) mesh"} < set(ways(found))
    (there,) = off(found, pressed(pad("fine")))
    assert there < found.outputs[0].mesh < 3.0 * there


def test_the_error_of_the_steps_is_that_against_many():
    found = ev.check(stuck(), "tangential_force")
    (there,) = off(found, stuck(32))
    assert 1e-3 < there < 1.5 * found.outputs[0].steps < 4.0 * there


def test_the_error_of_the_tolerance_is_that_against_the_finest():
    found = ev.check(stuck(solver=ev.Solver(tolerance=1e-3)), FORCES)
    exact = stuck(solver=ev.Solver(tolerance=1e-12))
    for one, there in zip(found.outputs, off(found, exact), strict=True):
        assert one.tolerance == pytest.approx(there, rel=0.05, abs=1e-9)
    assert max(one.tolerance for one in found.outputs) > 1e-7
    assert ev.check(stuck(), FORCES).outputs[1].tolerance < 1e-7


def test_a_finger_with_one_mesh_says_that_its_error_is_not_known():
    found = ev.check(stuck(), "normal_force")
    assert np.isnan(found.outputs[0].mesh)
    assert not [way for way in ways(found) if "mesh" in way]
    assert "not known" in str(found)
    assert "a sum is without what is not known" in str(found)


def test_meshes_have_no_part_in_whether_the_ends_agree():
    """Ridges on a coarse mesh: the depth changes by 1.2e-3 with the mesh, and by less with the path."""
    motion = [ev.Press(force=0.05, steps=3), ev.Slide(0.3, steps=3)]
    scene = ev.Scene(pad(ridges=True), ev.Flat(friction=0.3), motion=motion)
    found = ev.check(scene, "real_contact_width.max.0")
    by = {row["way"]: row["difference"] for row in found.rows}
    assert by["a finer (medium) mesh"] > 1e-3
    assert found.agrees
    assert found.error["real_contact_width.max.0"] > 0.05
    assert not [way for way in ways(ev.check(scene, mesh=False)) if "mesh" in way]


def test_the_ends_of_a_finger_that_ends_free_agree():
    """Its forces there are 1e-15 N/mm, rounding, of which runs had 3e-3 as their difference."""
    motion = [ev.Press(indentation=0.2, steps=2), ev.Press(indentation=-0.1, steps=2)]
    found = ev.check(ev.Scene(pad(), ev.Flat(friction=0.0), motion=motion), mesh=False)
    assert 0.0 < max(abs(row["applied_force"]) for row in found.rows) < 1e-12
    assert max(row["difference"] for row in found.rows) < 1e-8
    assert str(found).splitlines()[-1] == "the ends agree (allowed: 0.001)"


@pytest.mark.parametrize(
    ("end", "other", "difference"),
    [
        (1e-15, 3e-15, 5e-11),  # free, to rounding
        (0.0, 4e-5, 1.0),  # 1e-3 of the largest force of the run is still borne
        (0.0, 4e-7, 1e-2),
        (1e-3, 1.002e-3, 2e-3),  # relative to the end, as any that is more
        (0.03, 0.0303, 1e-2),
    ],
)
def test_ends_differ_relative_to_their_forces_or_a_share_of_the_largest_of_the_run(end, other, difference):
    def ended(last):
        forces = dict.fromkeys(("applied_force", "normal_force"), np.array([0.02, 0.04, last]))
        nothing = dict.fromkeys(("tangential_force", "electrostatic_force"), np.zeros(3))
        return SimpleNamespace(**forces, **nothing, indentation=np.array([0.2, 0.4, -0.1]))

    row = _row(Variant("steps", "twice the steps", pressed), ended(other), ended(end))
    assert row["difference"] == pytest.approx(difference, rel=1e-9)


def test_outputs_that_are_none():
    for given in ("tangential", "normal_force.median", "normal_force.max.3", []):
        with pytest.raises(ev.InputError, match="outputs"):
            ev.check(pressed(), given)


def test_the_command_prints_errors(tmp_path, capsys):
    path = tmp_path / "scene.toml"
    path.write_text(ev.scenefile.dump(pressed()))
    outputs = ["normal_force", "contact_width.max.0"]
    assert cli.main(["check", str(path), "--no-mesh", "--outputs", *outputs]) == 0
    told = capsys.readouterr().out
    lines = [line.split() for line in told.splitlines() if line]
    assert ["output", "value", "mesh", "steps", "tolerance", "path", "sum"] in lines
    assert [line[0] for line in lines[-4:-2]] == outputs
    assert told.splitlines()[-1].startswith("the ends agree")
    assert "finer" not in told


@pytest.mark.slow
def test_the_cheapest_mesh_that_is_accurate_enough():
    """1 % on the coarse mesh, 0.3 % on the medium one; both hold against the finest."""
    scene = pressed(pad("fine"))
    for error, mesh in ((0.01, "coarse"), (0.003, "medium")):
        found = ev.accurate(scene, error, "normal_force")
        assert found.reached
        assert found.scene.finger.resolution == mesh
        assert found.error["normal_force"] <= error
        assert off(found.chosen.checked, scene)[0] <= found.error["normal_force"]
        assert found.result.normal_force[-1] == ev.simulate(found.scene).normal_force[-1]
        assert found.seconds > 0.0
        assert mesh in found.table()


def test_steps_are_taken_until_they_are_enough():
    """A mesh in memory stays, and its error is said to be missing; the steps become as many as are needed."""
    with pytest.warns(UserWarning, match="the mesh where a finger has one alone"):
        found = ev.accurate(stuck(), 2e-3, "tangential_force")
    assert found.scene.total_steps > 4
    assert found.error["tangential_force"] <= 2e-3
    assert off(found.chosen.checked, stuck(64))[0] < 2e-3
    assert not found.reached


def test_refused_errors():
    for given in (0.0, -0.1, 0.6, "small"):
        with pytest.raises(ev.InputError, match="error: given"):
            ev.accurate(pressed(), given)
