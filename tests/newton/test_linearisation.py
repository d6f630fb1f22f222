"""The tangent as a step uses it: candidates, the condensed body against dense algebra, when it is renewed."""

from dataclasses import replace

import numpy as np
import pytest
from tools.builders import INSULATOR, finger
from tools.meshes import block

from evfem.common import constants
from evfem.common.arrays import mkl
from evfem.common.constants import STABLE
from evfem.contact.signorini import OPEN, STICK
from evfem.electrostatics.laws import Kaczmarek, Layer, StrongTroxel
from evfem.electrostatics.roughness import PowerRoughness
from evfem.newton import condensation
from evfem.newton.condensation import Singular
from evfem.newton.linearisation import no_progress, too_old
from evfem.newton.state import StepFailed
from evfem.scene.motion import Press
from evfem.scene.scene import Scene, Solver
from evfem.simulation.model import make_model
from evfem.surface.surfaces import Display, Sinusoid
from evfem.terms.traction import Entries, PadTraction
from evfem.tissue.kernels.blocks import loops

#: voltages that no insulator stands, to see far attractions from near
pytestmark = pytest.mark.filterwarnings("ignore:.* V make a field")

SAG = 0.4
ROUND = finger(block(8, 3, sag=SAG))
#: with so many nodes that candidates are only some of them
FINE = finger(block(40, 2, sag=SAG))


def made(surface=None, voltage=0.0, law=None, body=ROUND, **options):
    """A linearisation at rest, its model and its state."""
    surface = Display(y=-0.1, insulator=INSULATOR) if surface is None else surface
    law = Kaczmarek() if voltage and law is None else law
    options = {"solver": Solver(core="off")} | options  # the law itself
    model = make_model(Scene(body, surface, law, voltage, motion=[Press(force=0.1)], **options))
    state = model.equilibrium.rest(np.zeros(2), voltage)
    model.equilibrium.body.linearisation.begin(state)
    return model.equilibrium.body.linearisation, model, state


def gaps(model, surface_y=-0.1):
    """Gaps of the pad at rest: a parabola at the corners of cells, straight between them."""
    corner = np.unique(model.mesh.points[model.mesh.cells[:, :4], 0])
    x = model.mesh.points[model.pad.nodes, 0]
    return np.interp(x, corner, SAG * (0.5 * corner) ** 2) - surface_y


@pytest.mark.parametrize("reach", [0.12, 0.2, 0.6])
def test_every_node_within_reach_is_a_candidate(reach):
    linear, model, state = made(body=FINE)
    linear.choose_candidates(state, reach)
    assert set(np.flatnonzero(gaps(model) <= reach)) <= set(linear.candidates)
    # the others are farther than any
    others = np.setdiff1d(np.arange(model.pad.nodes.size), linear.candidates)
    assert gaps(model)[others].min(initial=np.inf) >= gaps(model)[linear.candidates].max()


def test_the_nearest_node_is_a_candidate_where_none_is_within_reach():
    linear, model, state = made(Display(y=-5.0), body=FINE)
    linear.choose_candidates(state, 0.1)
    assert np.argmin(gaps(model)) in linear.candidates
    assert gaps(model)[linear.candidates].max() < gaps(model).min() + 0.01


def test_touching_nodes_and_steep_attractions_are_candidates_at_any_gap():
    linear, model, state = made(Display(y=-5.0), body=FINE)
    far = int(np.argmax(gaps(model)))
    touching = replace(state, status=np.where(np.arange(state.status.size) == far, STICK, OPEN))
    linear.choose_candidates(touching, 0.1)
    assert far in linear.candidates
    # 5e5 V pull from 2.5 mm as hard as a kilovolt from 5 um
    linear, model, state = made(Display(y=-2.5, insulator=INSULATOR), voltage=5e5, body=FINE)
    linear.choose_candidates(state, 0.1)
    inner = model.pad.length(model.mesh.points[model.pad.nodes, 0]) > 0.0
    assert set(np.flatnonzero(inner)) <= set(linear.candidates)


def test_a_candidate_stays_one_when_it_has_let_go():
    linear, model, state = made(body=finger(block(40, 2, sag=1.2)))
    far = int(np.argmax(model.mesh.points[model.pad.nodes, 1]))
    status = np.where(np.arange(state.status.size) == far, STICK, OPEN)
    linear.choose_candidates(replace(state, status=status), 0.11)
    known = len(linear.candidates)
    linear.choose_candidates(state, 0.5)
    assert len(linear.candidates) > known
    assert far in linear.candidates


def test_a_singular_tangent_is_a_failed_step():
    linear, _, state = made()
    linear.choose_candidates(state, 0.2)
    linear.factorise(state)

    def refuse(upper):
        raise Singular("as told")

    linear.factor.factorise = refuse
    with pytest.raises(StepFailed, match="singular \\(as told\\)"):
        linear.factorise(state)


THIN = Layer(1e-3, 3.35)
attracted = pytest.mark.parametrize("law", [Kaczmarek(), StrongTroxel()], ids=["kaczmarek", "strong_troxel"])


@attracted
@pytest.mark.parametrize(
    "surface", [Display(THIN, y=-0.1), Sinusoid(terms=[[0.02, 2.0, 0.4]], y=-0.1, insulator=THIN)]
)
def test_fall_and_closing_are_those_of_the_law(law, surface):
    """Per node: -dp/dg A by central differences, and (p(0) - p(g)) A; touching nodes have neither."""
    linear, model, state = made(surface, voltage=500.0, law=law)
    state = replace(state, status=np.where(np.arange(state.status.size) % 4 == 1, STICK, OPEN))
    x, y = model.mesh.points[model.pad.nodes].T
    gap, A, layers = y - surface.y - surface.height(x), model.pad.length(x), model.attraction.layers

    def pull(g):
        return law.traction(g, 500.0, layers) * A

    free = state.status == OPEN
    fall, closing = linear.weakening(state), linear.gain_on_closing(state)
    np.testing.assert_allclose(fall[free], -((pull(gap + 1e-5) - pull(gap - 1e-5)) / 2e-5)[free], rtol=1e-6)
    np.testing.assert_allclose(closing[free], (pull(0.0 * gap) - pull(gap))[free], rtol=1e-12)
    assert closing[free].max() > 10.0 * pull(gap).max()
    assert not fall[~free].any()
    assert np.abs(closing[~free]).max() < 1e-9 * closing.max()


@pytest.mark.parametrize("distribution", ["none", "exponential", "gaussian"])
@pytest.mark.parametrize(("direction", "neighbours"), [("vertical", 1e-6), ("normal", 5e-3)])
def test_between_rough_faces_the_attraction_grows_with_what_presses_along_both_axes(
    direction, neighbours, distribution
):
    """The change of the force on a sloped surface per contact force, by central differences, turned into
    the frames of the nodes; and what is lost with the contact force. Along the normal of the surface
    a potential also pushes the neighbours apart, which is left out.
    """
    rough = PowerRoughness(0.001, pressure=0.01, exponent=0.5, open_gap=0.006, distribution=distribution)
    wave = Sinusoid(terms=[[0.15, 2.0, 0.4]], y=-0.2, insulator=THIN)
    linear, model, state = made(
        wave, voltage=60.0, law=StrongTroxel(), direction=direction, roughness_gap=rough
    )
    pressing = 0.002 + 0.001 * np.arange(state.status.size)
    force = np.column_stack([pressing, np.zeros_like(pressing)])
    state = replace(state, status=np.full_like(state.status, STICK), contact_force=force)
    pad, surface = linear.pad_state(state), linear.interface.surface_at(state)
    slope = surface.slope[:, 0]

    def pull(pressed):
        x, y = model.attraction.forces(replace(pad, pressing=pressed)).T
        along_normal, along_tangent = y - slope * x, x + slope * y
        return np.stack([along_normal, along_tangent], axis=1) / surface.stretch[:, None]

    found, h = linear.by_force(state), 1e-6
    assert np.abs(slope).max() > 0.1
    gain = -(pull(pressing + h) - pull(pressing - h)) / (2.0 * h)
    np.testing.assert_allclose(found.gain, gain, atol=neighbours * gain.max())
    loss = pull(0.0 * pressing) - pull(pressing)
    np.testing.assert_allclose(found.on_opening, loss, atol=neighbours * loss.max())
    np.testing.assert_array_equal(found.present, pressing)
    assert 0.01 < found.gain.max() < STABLE


class Suction(PadTraction):
    """Pulls with a share of what presses."""

    name, share = "suction", 0.3

    def forces(self, pad):
        found = np.zeros_like(pad.position)
        found[:, 1] = -self.share * pad.pressed
        return found

    def gain_on_pressing(self, pad):
        return np.full(len(pad.position), self.share)


def test_contact_knows_of_a_pull_by_contact_forces_whatever_it_comes_from():
    """Of a room of one's own on a flat surface: 0.3 of the normal force, all of it lost as the node opens."""
    linear, _, state = made(rooms=[Suction()])
    pressing = 0.002 + 0.001 * np.arange(state.status.size)
    force = np.column_stack([pressing, np.zeros_like(pressing)])
    found = linear.by_force(replace(state, status=np.full_like(state.status, STICK), contact_force=force))
    assert found.acts
    np.testing.assert_allclose(found.gain, [[0.3, 0.0]] * pressing.size, rtol=1e-12)
    np.testing.assert_allclose(found.on_opening, 0.3 * force, rtol=1e-12)


def test_on_slopes_a_node_beyond_a_fold_is_not_pulled_sideways_by_what_presses_it():
    """The same wave at twenty times the voltage: most gains are above 0.9 now."""
    rough = PowerRoughness(gap=0.001, pressure=0.01, exponent=0.5, open_gap=0.006)
    wave = Sinusoid(terms=[[0.15, 2.0, 0.4]], y=-0.2, insulator=THIN)
    linear, _, state = made(wave, voltage=1200.0, law=StrongTroxel(), roughness_gap=rough)
    pressing = 0.002 + 0.001 * np.arange(state.status.size)
    force = np.column_stack([pressing, np.zeros_like(pressing)])
    state = replace(state, status=np.full_like(state.status, STICK), contact_force=force)
    slope = linear.interface.surface_at(state).slope[:, 0]
    whole = linear.attraction.gain_on_pressing(linear.pad_state(state))
    normal, tangent = linear.by_force(state).gain.T
    folded = whole > STABLE * np.hypot(1.0, slope)
    assert folded.any()
    assert (slope[folded] != 0.0).all()
    assert (normal[folded] <= 0.99 + 1e-12).all()
    np.testing.assert_array_equal(tangent[folded], 0.0)
    held = ~folded & (whole > 0.0)
    np.testing.assert_allclose(tangent[held], slope[held] * normal[held], rtol=1e-12)


#: a voltage whose coupling is not faint
VOLTS = 4000.0
#: residuals that gain nothing
VAIN = [0.5, 0.02, 0.01, 0.03, 0.02, 0.03, 0.02, 0.03, 0.02]


def test_iterations_in_vain_are_known_from_the_residuals():
    assert no_progress(VAIN, False)
    assert not no_progress(VAIN[:8], False)
    assert not no_progress([*VAIN, 9e-3], False)
    assert not no_progress([*VAIN, 2.0], False)  # the bone is still on its way


def test_a_faint_coupling_is_known_without_its_dense_matrix(monkeypatch):
    """It is refused where no row of it is a hundredth of the tissue's stiffness, by what adds up there."""
    linear, _, state = made(voltage=VOLTS, law=StrongTroxel(), body=FINE)
    linear.choose_candidates(state, 0.5)
    linear.refactorise_if_needed(state, [])
    monkeypatch.setattr(constants, "SMALLEST_STIFFENING", 0.0)
    found = linear._coupling(state)
    row = (np.abs(found).sum(axis=1) / np.diagonal(linear.factor.schur)[:-2]).max()
    monkeypatch.setattr(Entries, "toarray", None)
    monkeypatch.setattr(constants, "SMALLEST_STIFFENING", (1.0 + 1e-9) * row)
    assert linear._coupling(state) is None
    monkeypatch.setattr(constants, "SMALLEST_STIFFENING", (1.0 - 1e-9) * row)
    with pytest.raises(TypeError):
        linear._coupling(state)


def test_entries_add_up():
    many = Entries(3, np.array([0, 2, 0, 2]), np.array([1, 2, 1, 0]), np.array([1.0, 2.0, -4.0, 8.0]))
    one = many.summed()
    assert one.row.tolist() == [0, 2, 2]
    assert one.column.tolist() == [1, 0, 2]
    assert one.value.tolist() == [-3.0, 8.0, 2.0]
    np.testing.assert_array_equal(one.toarray(), many.toarray())


@pytest.mark.parametrize(
    ("residuals", "last", "mean"),
    [
        ([1.0], False, False),
        ([1.0, 0.2], True, True),  # above 0.1
        ([1.0, 1e-2], False, False),
        ([1.0, 0.02, 0.012], True, False),  # one iteration stalls: 0.11 each in the mean of two
        ([1e-2, 1e-4, 3e-5, 1e-5], False, False),
        ([1.0, 1e-4, 6e-5, 3.9e-5], True, True),  # the first fall is no rate
        ([1e-2, 1e-4, 8e-5, 4.1e-5, 1.5e-5], False, True),  # 17 to go at 0.53
        ([1.0, 0.3, 0.03, 2e-2, 2e-3], False, False),
        ([1e-3, 1e-8, 1e-8], True, False),
        ([0.0, 0.2], True, True),  # nothing acted before
        ([0.0, 0.0], False, False),
        ([1e-2, 0.0], False, False),
    ],
)
def test_a_tangent_is_renewed_by_the_last_rate_or_by_the_mean_one(residuals, last, mean):
    found = [too_old(residuals, 1e-8, 8.0, over) for over in (1, 3)]
    assert found == [last, mean]


@pytest.fixture
def under_the_field():
    """A linearisation under the full field, its model, and a state 0.1 mm above the display."""
    linear, model, state = made(voltage=VOLTS, law=StrongTroxel(), field="full", direction="normal")
    linear.choose_candidates(state, 0.5)
    linear.refactorise_if_needed(state, [])
    return linear, model, state


def coupled(linear, state):
    """The factorised tangent's compliance."""
    linear.refactorise_if_needed(state, VAIN)
    return linear.tangent.compliance


def test_in_vain_the_tangent_is_that_of_the_field(under_the_field):
    """But for what weakens with a node's own gap: that belongs to the contact problem."""
    linear, model, state = under_the_field
    found = coupled(linear, state)
    assert linear.fringes
    unknowns = (2 * linear.candidates[:, None] + np.arange(2)).ravel()
    attraction, pad = model.equilibrium.attraction, linear.pad_state(state)
    field = attraction.full_stiffness(pad).toarray()
    own = np.zeros_like(unknowns, dtype=float)
    own[1::2] = linear.weakening(state)[linear.candidates]
    coupling = field[np.ix_(unknowns, unknowns)] - np.diag(own)
    inner = slice(4, -4)  # nodes outside move along with the outermost candidates
    known = (linear.tangent.schur[:-2, :-2] - np.linalg.inv(found))[inner, inner]
    np.testing.assert_allclose(known, coupling[inner, inner], atol=1e-6 * np.abs(coupling).max())
    by_columns = attraction.stiffness(pad).toarray()[np.ix_(unknowns, unknowns)]
    assert np.abs(field[np.ix_(unknowns, unknowns)] - by_columns).max() > 0.01 * np.abs(coupling).max()


# SuperLU has no factors of single precision
@pytest.mark.parametrize(("bound", "refused"), [(0.0, True), (np.inf, False)] if mkl() or loops() else [])
def test_a_precision_that_was_not_accurate_is_not_tried_again(bound, refused, monkeypatch):
    """Nor by a run that is resumed, whose steps must be those of the whole run."""
    monkeypatch.setattr(constants, "LARGE_BODY", 1)
    monkeypatch.setattr(condensation, "ACCURATE", bound)
    linear, model, state = made()
    linear.choose_candidates(state, 0.1)
    linear.factorise(state)
    assert (linear.factor.schur.dtype == np.float64) is refused
    again = made()[1].equilibrium.body
    again.resume(replace(model.equilibrium.body.reusable(), tangent_point=None))
    monkeypatch.setattr(condensation, "ACCURATE", np.inf)  # it would do now
    for later in (linear, again.linearisation):
        later.factor = None
        later.factorise(state)
        assert (later.factor.schur.dtype == np.float64) is refused
