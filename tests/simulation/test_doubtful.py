"""`Result.warnings`: what a run shows that its numbers may not be worth."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tools.builders import coarse_pad, finger, resumed
from tools.domes import dome_scene
from tools.meshes import block

import evfem as ev
from evfem.simulation.run import Run

BLOCK = block(8, 3, sag=0.1)


def narrow(mesh, half):
    """The mesh with no more of its pad than within `half` mm of the middle."""
    pad = mesh.node_sets["pad"]
    inner = pad[np.abs(mesh.points[pad, 0]) <= half + 1e-9]
    return replace(mesh, node_sets={**mesh.node_sets, "pad": inner})


def scene_2d(half):
    return ev.Scene(finger(narrow(BLOCK, half)), ev.Flat(), motion=ev.Press(indentation=0.2, steps=2))


def scene_3d(half):
    whole = dome_scene(ev.Press(indentation=0.2, steps=2), law=None, voltage=0.0)
    mesh = narrow(whole.finger.mesh(1), half)
    own = ev.MeshedFinger(mesh, whole.finger.materials, electrical=whole.finger.electrical)
    return replace(whole, finger=own)


@pytest.mark.parametrize("scene", [scene_2d, scene_3d])
def test_a_boundary_outside_the_pad_that_passes_the_glass_is_told_with_its_place(scene):
    assert ev.simulate(scene(10.0)).warnings == []
    result = ev.simulate(scene(0.5))
    mesh, frame = result.mesh, result.frames[-1]
    facets = mesh.outer_sides
    nodes = np.setdiff1d(facets, mesh.node_sets["pad"])
    glass = mesh.points[mesh.node_sets["pad"], 1].min()
    depth = glass - (mesh.points + frame.displacement)[nodes, 1]
    place = ", ".join(f"{x + 0.0:.4g}" for x in mesh.points[nodes[depth.argmax()]])
    (said,) = result.warnings
    assert f"passed through the surface, by {depth.max():.3g} mm at ({place})" in said


@pytest.mark.parametrize("depths", [(0.05, 0.2), (0.15, 0.2, 0.05), (0.18, 0.2, 0.19), (0.2, 0.1, 0.15)])
def test_of_many_steps_the_deepest_is_told(depths):
    motion = [ev.Press(indentation=depth, steps=1) for depth in depths]
    result = ev.simulate(replace(scene_2d(0.5), motion=motion))
    nodes = np.setdiff1d(result.mesh.outer_sides, result.mesh.node_sets["pad"])
    glass = result.mesh.points[result.mesh.node_sets["pad"], 1].min()
    deepest = max(glass - (result.mesh.points + one.displacement)[nodes, 1].min() for one in result.frames)
    assert any(f"passed through the surface, by {deepest:.3g} mm" in said for said in result.warnings)


def test_a_resumed_run_knows_what_passed_before(tmp_path):
    scene = replace(
        scene_2d(0.5), motion=[ev.Press(indentation=0.2, steps=1), ev.Press(indentation=0.01, steps=1)]
    )
    whole, again = resumed(scene, 1, folder=tmp_path)
    assert any("passed through the surface" in said for said in whole.warnings)
    assert again.warnings == whole.warnings


def test_a_finger_that_hovers_without_any_force_has_nothing_from_nowhere():
    held = ev.Scene(coarse_pad(), ev.Flat(), motion=[ev.Hover(gap=0.5)])
    assert ev.simulate(held).warnings == []


@pytest.mark.parametrize("ridges", [False, True])
def test_a_finger_that_nothing_touches_does_not_snap(ridges):
    """Rounding of a body that moves as a whole is no energy set free."""
    pad = ev.FingerPad(resolution="coarse", ridges=ridges)
    motion = [ev.Press(indentation=0.1, steps=1), ev.Hover(gap=0.3, steps=3)]
    result = ev.simulate(ev.Scene(pad, ev.Flat(), motion=motion))
    assert not result.jumps.any()
    assert not result.snap_dissipation.any()


def test_energy_from_nowhere_is_what_the_ends_of_a_step_do_not_leave_open():
    """A press that is let go in one step: half the lost force times the way is not known from its ends. Up a
    slope in one step, from level to level, without friction: no tangential force at either end, and the
    stored energy of the deeper press comes from nowhere.
    """
    pad = coarse_pad()
    let_go = ev.Scene(pad, ev.Flat(), motion=[ev.Press(indentation=0.1, steps=1), ev.Hover(gap=0.3)])
    result = ev.simulate(let_go)
    assert -np.diff(result.integrator_dissipation)[-1] > result.stored_energy.max()
    assert result.warnings == []

    slope = ev.Profile([-60.0, 5.0, 15.0, 60.0], [0.0, 0.0, 0.05, 0.05], friction=0.0)
    rises = [ev.Press(indentation=0.1, steps=4), ev.Slide(20.0, steps=1)]
    result = ev.simulate(ev.Scene(pad, slope, motion=rises))
    (said,) = [one for one in result.warnings if "energy error" in one]
    assert "in step 5 " in said
    freed = float(said.split("error of ")[1].split()[0])
    assert freed == pytest.approx(np.diff(result.stored_energy)[-1], rel=0.05)


def test_a_slide_that_touches_nothing_is_told():
    """An attracted one, of which no plan knows how far it comes down."""
    slide = [ev.Hover(gap=0.3), ev.Slide(distance=0.2, steps=1)]
    up = replace(scene_2d(10.0), surface=ev.Display(), law=ev.Kaczmarek(), voltage=10.0, motion=slide)
    assert ev.simulate(up).warnings == ["motion 1, a slide, never touched"]
    pressed = ev.simulate(replace(up, motion=[*slide, ev.Press(indentation=0.05, steps=1)])).warnings
    assert not any("never touched" in said for said in pressed)


def test_steps_in_time_that_dissipate_by_themselves_are_told():
    """A hand let go swings; backward Euler of n steps a period damps each by exp(-2 pi^2 / n)."""

    def told(steps):
        hand = ev.Hand(stiffness=0.01, mass=1e-6)  # a period of 0.063 s
        motion = [
            ev.Press(indentation=0.01, steps=1),
            ev.Slide(0.05, steps=1, speed=5e3),
            ev.Wait(0.015, steps=steps),
        ]
        return ev.simulate(
            replace(scene_2d(10.0), hand=hand, surface=ev.Flat(friction=0.0), motion=motion)
        ).warnings

    (said,) = told(5)
    assert "dissipate" in said
    assert told(100) == []


def folding(F):
    """Energy that resists below a squared stretch of 0.35 across the display, its derivative lost there."""
    short = 0.35 - F[0, 1] ** 2 - F[1, 1] ** 2
    return ev.NeoHookean(E=0.1, nu=0.3).psi(F) + 0.1 * (0.5 * (short + np.abs(short))) ** 2


@pytest.mark.parametrize(("depth", "lost"), [(0.2, False), (0.45, True)])
def test_a_derivative_that_is_lost_deep_in_a_run_is_told(depth, lost):
    """No strain that is tried before the run is so short."""
    own = SimpleNamespace(psi=folding)
    body = ev.MeshedFinger(block(4, 4, width=2.0, height=1.0), {"tissue": own})
    motion = ev.Press(indentation=depth, steps=4)
    result = ev.simulate(ev.Scene(body, ev.Flat(friction=0.0), motion=motion))
    assert any("loses its derivative in a complex step" in said for said in result.warnings) is lost


def test_a_law_that_raises_where_its_derivative_is_tried_is_told():
    """Just beyond the strains of the run: squared stretches across the display below its `least`."""

    class Own:
        least = 0.0

        def psi(self, F):
            if (F[0, 1] ** 2 + F[1, 1] ** 2).real.min() < self.least:
                raise ValueError("no such stretch")
            return ev.NeoHookean(E=0.1, nu=0.3).psi(F)

    own, motion = Own(), [ev.Press(indentation=0.2, steps=2)]
    body = ev.MeshedFinger(block(4, 4, width=2.0, height=1.0), {"tissue": own})
    run = Run(ev.Scene(body, ev.Flat(friction=0.0), motion=motion), None)
    for request in run.requests():
        run.advance(request)
    own.least = 0.9
    (said,) = run.result().warnings
    assert re.fullmatch(
        r"psi\(F\) of Own raises ValueError near the largest strain of the run, [23]\d%, "
        "where its derivative was tried: no such stretch",
        said,
    )


def test_a_constant_in_an_energy_is_no_energy_from_nowhere():
    plain = SimpleNamespace(psi=lambda F: ev.NeoHookean(E=0.1, nu=0.3).psi(F))
    own = SimpleNamespace(psi=lambda F: plain.psi(F) + 5.0)
    motion = ev.Press(indentation=0.1, steps=2)
    found = []
    for law in (own, plain):
        body = ev.MeshedFinger(block(4, 4, width=2.0, height=1.0), {"tissue": law})
        found.append(ev.simulate(ev.Scene(body, ev.Flat(friction=0.0), motion=motion)))
    assert found[0].warnings == []
    np.testing.assert_allclose(found[0].stored_energy, found[1].stored_energy, rtol=1e-9)


def test_a_snap_is_told_with_its_share():
    """A block that pulls in from a hair's breadth above a thin insulator."""
    mesh = block(8, 3)
    skin = ev.Electrical(stratum_corneum_thickness=0.01, stratum_corneum_eps_r=1e3)
    own = ev.MeshedFinger(mesh, {"tissue": ev.LinearElastic(E=0.1, nu=0.3)}, electrical=skin)
    motion = [ev.Hover(0.05, steps=1), ev.VoltageRamp(3000.0, steps=2)]
    scene = ev.Scene(own, ev.Display(ev.Layer(0.01, 3.0)), ev.StrongTroxel(), 0.0, motion)
    found = ev.simulate(scene)
    assert found.jumps.sum() > 0
    assert any("the finger snaps and loses" in said for said in found.warnings)
