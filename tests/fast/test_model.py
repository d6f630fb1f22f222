"""The fast model of a finger: what it remembers is exact, what it says of its error holds, and it
refuses what it cannot do.
"""

import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from tools.builders import balance, finger, layered_finger
from tools.meshes import block, half_finger

import evfem as ev
from evfem.contact.signorini import (
    BACKWARD,
    FORWARD,
    OPEN,
    STICK,
    AttractionStiffness,
    ContactProblem,
    ExtraUnknowns,
)
from evfem.fast.memory import CondensedPad, sums
from evfem.fast.model import FastModel
from evfem.fast.step import RememberedPad
from evfem.fast.woodbury import Factors, KeptProblem
from evfem.simulation.run import Run
from evfem.solver.control import Target
from evfem.solver.equilibrium import Equilibrium
from evfem.solver.interface import Interface
from evfem.solver.state import Limits, StepFailed

INSULATOR = ev.Layer(thickness=0.09, eps_r=3.35)
HALF_FINGER = layered_finger(half_finger(80, 5, 1, free_ends=True))
PRESS = ev.Press(force=0.05, steps=5)
PRESS_AND_SLIDE = (PRESS, ev.Slide(1.5, steps=15))


def display(friction):
    return ev.Display(insulator=INSULATOR, friction=friction)


def pad_scene(friction=0.5, voltage=1000.0, motion=PRESS_AND_SLIDE, **more):
    law = ev.Kaczmarek()
    output = ev.Output(every=1000)
    return ev.Scene(
        HALF_FINGER, display(friction), law=law, voltage=voltage, motion=motion, output=output, **more
    )


@pytest.fixture(scope="module")
def trained():
    """A run in full, its states, and the fast model of the same scene."""
    scene = pad_scene()
    run = Run(scene, None)
    states = [run.state]
    for request in run.requests():
        run.advance(request)
        states.append(run.state)
    return run, states, ev.reduce(scene)


def off(fast, full, name, motion="slide"):
    """Relative L2 difference of a column over a kind of motion."""
    where = [kind == motion for kind in full.motion]
    a, b = getattr(fast, name)[where], getattr(full, name)[where]
    return np.linalg.norm(a - b) / np.linalg.norm(b)


# -- what is remembered


def test_the_pad_is_exact_at_the_equilibria_it_remembers(trained):
    pad = trained[2].memory.pad
    for moved, force in zip(pad.moved, pad.force, strict=True):
        assert np.abs(pad.under(force) - moved).max() < 1e-11


def alone_pad(model):
    """The pad of a model by itself: its nodes are numbered from 0."""
    return replace(model.pad, nodes=np.arange(model.pad.nodes.size))


def fast_solver(model, pad, attraction, strategy=None):
    """The solver of a remembered pad."""
    limits = Limits(1e-8, strategy or ev.Strategy())
    points = model.mesh.points[model.pad.nodes]
    interface = Interface(alone_pad(model), points, model.surface, limits.tolerance)
    return Equilibrium(RememberedPad(pad, interface, attraction, limits), interface, attraction, limits)


def test_remembered_displacements_are_those_relative_to_the_bone(trained):
    run, states, fast = trained
    nodes = run.model.pad.nodes
    forces = [run.model.equilibrium.contact_forces(state) + state.attraction for state in states]
    forces[0] = np.zeros_like(forces[0])
    memory = fast.memory
    for moved, whole, force in zip(memory.pad.moved, memory.whole, memory.pad.force, strict=True):
        state = states[int(np.argmin([np.abs(other - force).max() for other in forces]))]
        np.testing.assert_allclose(whole, state.u - state.bone, atol=1e-6)
        np.testing.assert_array_equal(moved, whole[nodes])


def test_a_step_between_remembered_equilibria_is_that_of_the_full_model(trained):
    run, states, fast = trained
    model, pad = run.model, fast.memory.pad
    nodes = model.pad.nodes
    attraction = replace(model.attraction, pad=alone_pad(model))
    solver = fast_solver(model, pad, attraction)
    # the run it remembers is another one: BLAS threads round otherwise, and both stop at the solver's
    # tolerance; equilibria that are not remembered are a tenth of the largest force away, steady sliding less
    same = 100.0 * run.scene.solver.tolerance
    found = 0
    for old, new in pairwise(states[6:]):
        force = model.equilibrium.contact_forces(new) + new.attraction
        if np.abs(pad.force - force).max(axis=(1, 2)).min() > same * np.abs(force).max():
            continue
        small = replace(old, u=old.u[nodes])
        got = solver.step(small, Target.held(new.bone, new.voltage))
        assert np.abs(got.reaction - new.reaction).max() < 3e-5 * np.abs(new.reaction).max()
        assert np.abs(got.contact_force - new.contact_force).max() < 1e-3 * new.contact_force.max()
        found += 1
    assert found >= pad.slide.size - 1  # the first one ends the press


def test_a_step_is_tried_as_hard_as_the_strategy_says(trained):
    run, _, fast = trained
    model, pad = run.model, fast.memory.pad
    asked = Target.held(model.bone(0.0, 0.1), 0.0)
    patient = fast_solver(model, pad, None)
    patient.step(patient.rest(model.bone(0.0, 0.0), 0.0), asked)
    hasty = fast_solver(model, pad, None, ev.Strategy(iterations=patient.record.iterations))
    with pytest.raises(StepFailed):
        hasty.step(hasty.rest(model.bone(0.0, 0.0), 0.0), asked)
    assert hasty.record.iterations == patient.record.iterations > 1


def test_one_equilibrium_alone_errs_quadratically_with_the_distance_and_several_far_less(trained):
    run, states, fast = trained
    pad, nodes = fast.memory.pad, run.model.pad.nodes
    one = np.zeros(1, dtype=np.int64)
    k = int(pad.press[-1])
    alone = CondensedPad(pad.kept, pad.moved[[k]], pad.force[[k]], pad.compliance[[k]], one, one)

    def error(which, state):
        force = run.model.equilibrium.contact_forces(state) + state.attraction
        # the others are interpolated along the outline
        return np.abs(which.under(force) - (state.u[nodes] - state.bone))[pad.kept.near].max()

    errors = np.array([error(alone, states[5 + step]) for step in (1, 2, 4)])
    assert (np.diff(np.log2(errors)) > 1.7).all()
    assert (np.diff(np.log2(errors)) < 2.3).all()
    # the T of the eighth step lies between those of two remembered ones
    assert error(pad, states[13]) < 0.01 * error(alone, states[13])


def test_slides_either_way_are_remembered():
    motion = (PRESS, ev.Slide(0.6, steps=6), ev.Slide(-1.2, steps=12))
    pad = ev.reduce(pad_scene(friction=0.3, motion=motion), slide=3).memory.pad
    T = pad.sums[pad.slide, 1]
    assert T[0] < -0.01
    assert T[-1] > 0.01
    assert (np.diff(T) > 0.0).all()
    assert abs(pad.sums[pad.press[-1], 1]) < 1e-9


def test_far_nodes_hand_their_forces_to_knots_and_keep_sum_and_work(trained):
    kept = trained[2].memory.pad.kept
    rng = np.random.default_rng(1)
    force, moved = rng.normal(size=(kept.low.size, 2)), rng.normal(size=2 * kept.size)
    gathered = kept.gather(force)
    assert np.allclose(gathered.reshape(2, -1).sum(axis=1)[::-1], force.sum(axis=0))
    assert np.isclose(gathered @ moved, np.sum(force * kept.spread(moved)))


def test_it_says_in_one_line_what_it_was_made_for(trained):
    run, _, fast = trained
    N, T = run.rows[4]["applied_force"], max(row["tangential_force"] for row in run.rows)
    shown = repr(fast)
    assert shown.startswith(f"FastModel of 'scene': {len(fast.memory.pad.force)} equilibria, to ")
    load, shear = (float(text) for text in re.findall(r"([\d.]+) N/mm", shown))
    assert load >= N
    assert shear == pytest.approx(T, rel=1e-3)
    assert len(shown) < 120


def test_making_one_shows_how_far_it_is(capsys):
    motion = (ev.Press(force=0.01, steps=1), ev.Slide(0.1, steps=2))
    ev.reduce(pad_scene(motion=motion))
    assert capsys.readouterr().err == ""
    ev.reduce(pad_scene(motion=motion), progress=True)
    assert "3/3" in capsys.readouterr().err


# -- against the full model


@pytest.mark.parametrize(
    ("friction", "voltage", "hold"),
    [(0.5, 2000.0, "indentation"), (0.2, 0.0, "indentation"), (0.4, 1500.0, "force")],
)
def test_other_voltages_and_frictions_are_right(trained, friction, voltage, hold):
    motion = (PRESS, ev.Slide(1.5, steps=15, hold=hold))
    scene = pad_scene(friction, voltage, motion)
    fast, full = trained[2].simulate(scene, checks=2), ev.simulate(scene)
    assert not fast.provenance["fast"]["fallback"]
    names = ["normal_force", "tangential_force", "friction_dissipation"]
    for name in names + ["electrostatic_force"] * (voltage > 0.0):
        # work of friction: a step that begins to slip all at once counts
        assert off(fast, full, name) < (1.5e-2 if name == "friction_dissipation" else 1e-3)
    assert np.abs(fast.normal_force - full.normal_force)[:5].max() < 1e-3 * full.normal_force.max()
    assert balance(fast).max() < 1e-5
    assert (fast.substeps == 1).all()
    assert np.isnan(fast.stored_energy).all()
    assert fast.frames == []


def test_profiles_ramps_tables_laws_and_way_back_are_right(trained):
    profile = ev.VoltageProfile([0.0, 0.4, 0.8, 1.0], [0.0, 1500.0, 1500.0, 300.0])
    table = [[-9.0, 0.2], [0.0, 0.5], [0.9, 0.3], [9.0, 0.4]]
    scenes = [
        pad_scene(table, profile, (PRESS, ev.Slide(1.2, steps=24))),
        pad_scene(0.4, 0.0, (PRESS, ev.Slide(0.6, steps=6), ev.VoltageRamp(1200.0, steps=4))),
        replace(pad_scene(0.3, 400.0), law=ev.StrongTroxel(), air_layer=False),
        pad_scene(0.2, 800.0, (PRESS, ev.Slide(0.8, steps=8), ev.Slide(-0.3, steps=6))),
    ]
    for scene in scenes:
        fast, full = trained[2].simulate(scene, checks=0), ev.simulate(scene)
        for name in ("normal_force", "tangential_force", "electrostatic_force", "voltage"):
            a, b = getattr(fast, name), getattr(full, name)
            assert np.linalg.norm(a - b) < 2e-3 * np.linalg.norm(b)


def test_the_stated_error_is_what_the_full_model_finds_and_grows_beyond_the_training(trained):
    inside = trained[2].simulate(pad_scene(0.4, 1500.0), checks=3).provenance["fast"]
    assert max(inside["error"].values()) < 1e-3
    assert inside["outside"] < 0.01
    assert len(inside["checked"]) == 3
    scene = pad_scene(0.7, 1000.0, (PRESS, ev.Slide(2.0, steps=20)))
    beyond = trained[2].simulate(scene, checks=3, tolerance=10.0)
    stated = beyond.provenance["fast"]
    truth = ev.simulate(scene)
    errors = np.abs(beyond.tangential_force - truth.tangential_force).max() / truth.tangential_force.max()
    assert stated["outside"] > 0.1
    assert 0.5 * errors < stated["error"]["tangential_force"] < 2.0 * errors
    assert errors > 0.002


# -- when it will not do


def test_too_large_an_error_makes_it_fall_back_to_the_full_model_and_say_so(trained):
    scene = pad_scene(0.4, 500.0)
    with pytest.warns(UserWarning, match="running the full model: the fast model differs") as caught:
        result = trained[2].simulate(scene, tolerance=1e-12)
    assert [Path(one.filename).name for one in caught] == ["test_model.py"]  # the user's line
    assert result.provenance["fast"]["fallback"] is True
    assert max(result.provenance["fast"]["error"].values()) > 0.0
    assert np.array_equal(result.tangential_force, ev.simulate(scene).tangential_force)


def test_scenes_it_cannot_stand_for_are_refused_with_a_sentence(trained):
    fast, scene = trained[2], pad_scene()
    wavy = ev.Sinusoid(friction=0.1, insulator=INSULATOR)
    viscous = replace(scene.finger, viscosity=1e-3)
    timed = (PRESS, ev.Slide(1.0, speed=10.0))
    stiff = ev.Solver(contact="penalty", penalty_normal=1e3, penalty_tangential=1e3)
    refused = {
        "surface": replace(scene, surface=wavy),
        "finger": replace(scene, finger=ev.FingerPad(resolution="coarse", ridges=True)),
        "solver.element": replace(scene, solver=ev.Solver(element="q2")),
        "solver.contact": replace(scene, solver=stiff),
        "solver.dynamics": replace(scene, finger=viscous, motion=timed, solver=ev.Solver(dynamics="viscous")),
        "forms": scene.with_term(ev.form(lambda u, v, w: u * v), ev.Region("dermis")),
        "voltage": replace(scene, voltage=ev.signals.FollowForce([0.0], [0.01])),
        "scene": "scene.toml",
    }
    for key, other in refused.items():
        with pytest.raises(ev.InputError) as caught:
            fast.simulate(other)
        assert caught.value.key == key


@pytest.mark.parametrize("words", [{"checks": -1}, {"checks": 1000}, {"tolerance": 0.0}])
def test_numbers_out_of_range_are_refused(trained, words):
    with pytest.raises(ev.InputError):
        trained[2].simulate(pad_scene(), **words)


def test_a_scene_without_press_and_slide_teaches_nothing():
    with pytest.raises(ev.InputError, match="a press and then a slide"):
        ev.reduce(pad_scene(motion=(PRESS,)))
    with pytest.raises(ev.InputError, match="equilibria"):
        ev.reduce(pad_scene(), slide=0)


# -- files


def test_a_saved_model_is_the_same_to_the_last_bit(trained, tmp_path):
    fast = trained[2]
    fast.save(tmp_path / "pad.npz")
    again = FastModel.load(tmp_path / "pad.npz")
    assert np.array_equal(again.memory.pad.compliance, fast.memory.pad.compliance)
    assert again.identity == fast.identity
    assert again.provenance == fast.provenance
    scene = pad_scene(0.3, 700.0)
    one, two = (model.simulate(scene, checks=1) for model in (fast, again))
    assert np.array_equal(one.tangential_force, two.tangential_force)
    assert np.array_equal(one.external_work, two.external_work)
    assert one.provenance["fast"] == two.provenance["fast"]


def test_damaged_and_foreign_files_are_refused(trained, tmp_path):
    path = tmp_path / "pad.npz"
    trained[2].save(path)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(ev.InputError, match="cut off"):
        FastModel.load(path)
    from evfem.common.storage import load_arrays, save_arrays

    path.write_bytes(data)
    arrays = load_arrays(path, "reduced", "evfem-reduced-1")
    for name, value in (("kept/low", arrays["kept/low"] + 10_000), ("pad/press", arrays["pad/press"] * 1.5)):
        save_arrays(path, arrays | {name: value})
        with pytest.raises(ev.InputError, match="damaged"):
            FastModel.load(path)
    made = str(arrays["provenance"]).replace('"name": "scene"', '"name": 7')
    save_arrays(path, arrays | {"provenance": np.array(made)})
    with pytest.raises(ev.InputError, match="damaged"):
        FastModel.load(path)


# -- the kept contact problem


def random_problem(rng, k):
    half = rng.normal(size=(2 * k, 2 * k))
    compliance = half @ half.T + 2.0 * k * np.eye(2 * k)
    lift = np.repeat([1.0, 0.0], k)
    extra_unknowns = ExtraUnknowns(lift[:, None], lift[None].copy(), np.array([[-0.1]]), np.array([3.0]))
    pull = AttractionStiffness(np.where(rng.random(k) < 0.5, 1e-3, 0.0), rng.random(k), 0.1 * rng.random(k))
    return rng.normal(size=2 * k), compliance, rng.random(k), extra_unknowns, pull


def test_exchanged_rows_give_the_same_solution_as_a_new_factorisation():
    rng = np.random.default_rng(3)
    k = 30
    start, compliance, friction, extra_unknowns, pull = random_problem(rng, k)
    factors = Factors()
    status = rng.integers(OPEN, BACKWARD + 1, size=k)
    for _ in range(12):
        status[rng.integers(k, size=2)] = rng.choice([OPEN, STICK, FORWARD, BACKWARD], size=2)
        start = rng.normal(size=2 * k)
        plain = ContactProblem(start, compliance, friction, extra_unknowns, pull)
        kept = KeptProblem(start, compliance, friction, extra_unknowns, pull, factors)
        for a, b in zip(kept.solved(status), plain.solved(status), strict=True):
            assert np.allclose(a, b, rtol=1e-10, atol=1e-12)


def test_a_block_whose_end_nodes_belong_to_the_bone_keeps_them_there():
    mesh = block(columns=16, rows=4, sag=0.3)
    ends = [0, 16]
    mesh.node_sets["bone"] = np.union1d(mesh.node_sets["bone"], ends)
    scene = ev.Scene(
        finger(mesh),
        display(0.4),
        law=ev.Kaczmarek(),
        voltage=500.0,
        motion=[ev.Press(indentation=0.1, steps=4), ev.Slide(0.4, steps=8)],
    )
    fast = ev.reduce(scene)
    assert np.abs(fast.memory.pad.moved[:, ends]).max() < 1e-12  # the bone's step is added up in parts
    result, full = fast.simulate(scene, checks=1), ev.simulate(scene)
    assert off(result, full, "tangential_force") < 2e-3
    assert np.allclose(sums(fast.memory.pad.force[0]), 0.0)
