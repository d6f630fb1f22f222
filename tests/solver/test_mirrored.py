"""A symmetric finger from its right half: the same numbers as from the whole."""

from dataclasses import replace

import numpy as np
import pytest
from tools.builders import finger
from tools.meshes import block

import evfem as ev
from evfem.mesh.mesh import raised
from evfem.mesh.symmetry import right_half
from evfem.scene.plan import plan
from evfem.scene.symmetry import unsymmetric
from evfem.simulation.history import COLUMNS
from evfem.simulation.model import make_model
from evfem.simulation.result import Saved
from evfem.simulation.run import simulate
from evfem.solver.state import StepFailed

pytestmark = pytest.mark.solver
BLOCK = block(8, 3, sag=0.4)
HALVED = ev.Solver(symmetry=True)
MOTION = [
    ev.Press(indentation=0.2, steps=2),
    ev.Press(force=0.01, steps=2),
    ev.VoltageRamp(3000.0, 2, hold="force"),
]
#: columns of what is computed (COLUMNS has the costs too)
COMPARED = [name for name in COLUMNS if name not in ("newton_iterations", "seconds", "motion", "substeps")]


def scene(mesh=BLOCK, motion=MOTION, friction=0.0, **changed):
    """A curved block on a display, pressed by hand and by a voltage."""
    display = ev.Display(friction=friction)
    changed = {"motion": motion, "output": ev.Output(every=1)} | changed
    return ev.Scene(finger(mesh), display, ev.Kaczmarek(), **changed)


def assert_alike(one, other):
    """Every column and every field to the solver's tolerance."""
    for name in COMPARED:
        np.testing.assert_allclose(
            getattr(other, name), getattr(one, name), rtol=1e-6, atol=1e-9, err_msg=name
        )
    for before, after in zip(one.frames, other.frames, strict=True):
        for name in ("displacement", "gap", "contact_pressure", "electrostatic_traction", "von_mises", "J"):
            expected = getattr(before, name)
            size = np.nanmax(np.abs(expected))
            np.testing.assert_allclose(getattr(after, name), expected, rtol=0.0, atol=1e-6 * size + 1e-12)
        np.testing.assert_array_equal(before.contact_status, after.contact_status)


@pytest.mark.parametrize(
    ("element", "coupling"), [("q1", "monolithic"), ("q2p1", "monolithic"), ("q1", "staggered")]
)
def test_the_half_gives_the_numbers_of_the_whole(element, coupling):
    """Force, works, widths and fields of a press to a depth, to a force and under a voltage; the
    half has other unknowns, so equal to the tolerance of both.
    """
    mesh = BLOCK if element == "q1" else raised(BLOCK)
    given = scene(mesh, coupling=coupling, solver=ev.Solver(element=element))
    whole = simulate(given)
    half = simulate(replace(given, solver=ev.Solver(element=element, symmetry=True)))
    assert half.provenance["solver"]["halved"]
    assert half.provenance["solver"]["unsettled"] == 0
    assert_alike(whole, half)
    assert whole.electrostatic_force[-1] > 0.05 * whole.applied_force[-1]


def test_where_the_half_finds_nothing_the_whole_goes_on(monkeypatch):
    """Half steps fail from the third on: the rest of the run is the whole body's."""
    given, whole = scene(), simulate(scene())
    found = []

    def make(scene):
        model = make_model(scene)
        step = model.equilibrium.half.step

        def failing(*arguments):
            found.append(len(found))
            if len(found) > 2:
                raise StepFailed("lost", [1.0])
            return step(*arguments)

        model.equilibrium.half.step = failing
        return model

    monkeypatch.setattr("evfem.simulation.run.make_model", make)
    result = simulate(replace(given, solver=HALVED))
    assert len(found) == 3
    assert result.provenance["solver"]["cuts"] == 0
    assert not result.provenance["solver"]["halved"]
    assert_alike(whole, result)


def test_a_run_by_halves_goes_on_from_its_checkpoint_to_the_same_bits():
    class Keeper:
        def __init__(self):
            self.saved = []

        def step(self, row, frame, checkpoint):
            self.saved.append((dict(row), checkpoint()))

    keeper, given = Keeper(), scene(solver=HALVED)
    whole = simulate(given, observers=[keeper])
    rows = [row for row, _ in keeper.saved[:3]]
    again = simulate(given, resume=Saved(keeper.saved[2][1], rows))
    for name in ("normal_force", "indentation", "electrostatic_force", "stored_energy"):
        np.testing.assert_array_equal(getattr(again, name), getattr(whole, name))
    assert again.newton_iterations.tolist() == whole.newton_iterations.tolist()


def test_meshes_without_a_mirror_image_have_no_half():
    moved = BLOCK.points.copy()
    moved[5, 0] += 1e-3
    assert right_half(replace(BLOCK, points=moved)) is None
    assert right_half(replace(BLOCK, node_sets=BLOCK.node_sets | {"nail": np.array([0])})) is None
    assert right_half(block(7, 3)) is None  # cells across the middle
    left = np.where(BLOCK.centres[:, 0] < 0.0, 1, 0)
    assert right_half(replace(BLOCK, region=left, region_names={"right": 0, "left": 1})) is None
    half = right_half(ev.FingerPad(resolution="coarse").mesh(2))
    assert half.middle.any()
    assert 2 * half.nodes.size - half.middle.sum() == len(ev.FingerPad(resolution="coarse").mesh(2).points)


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({}, ""),
        ({"friction": 0.1}, "friction"),
        ({"motion": [ev.Press(indentation=0.1), ev.Slide(0.1)]}, "a slide"),
        ({"direction": "normal"}, "traction along the outline's normal"),
    ],
)
def test_the_plan_says_whether_half_of_the_mesh_will_do(changed, reason):
    given = scene(**changed, solver=HALVED)
    assert unsymmetric(given) == reason
    (term,) = (term for term in plan(given).terms if term.name == "symmetry")
    assert term.needed is not bool(reason)
    assert term.reason.startswith(f"the whole mesh: {reason}" if reason else "the right half of the mesh")
    assert not any(term.name == "symmetry" for term in plan(scene(**changed)).terms)
