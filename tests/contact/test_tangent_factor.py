"""The full field between rough faces and beside electrodes that end: what the tangent makes of the
column law's derivatives.
"""

from dataclasses import replace

import numpy as np
import pytest
from tools.meshes import arc
from tools.pads import seen

import evfem as ev
from evfem.contact.signorini import STICK
from evfem.electrostatics.roughness import ExponentialRoughness
from evfem.simulation.model import make_model
from evfem.terms.attraction import Attraction
from evfem.terms.fullfield import FieldAttraction, facing

ROUGH = ExponentialRoughness(decay=5e-4, pressure=4.0, open_gap=4e-3)


def between(pad, points, surface, roughness):
    """The attraction by columns and by the full field."""
    skin = ev.Layer(np.full(len(points), 0.38), 1650.0)
    layers = ev.Layers.of(skin, surface.insulator)
    of = (ev.StrongTroxel(), layers, pad, surface, "vertical", True, roughness)
    return Attraction(*of), FieldAttraction(*of, edges=facing(pad, points), skin=skin)


@pytest.mark.parametrize("roughness", [None, ROUGH])
def test_without_an_electrode_below_no_attraction_is_gained(roughness):
    pad, points = arc(40, 40.0, 4.0)
    points[:, 1] += 0.05
    surface = ev.Display(y=0.0, electrodes=[[-20.0, 0.0, 1.0]])
    _, full = between(pad, points, surface, roughness)
    left, right = points[:, 0] < -0.8, points[:, 0] > 0.8
    factor = full.tangent_factor(seen(full, points, 300.0))
    assert factor[left] == pytest.approx(1.0, abs=0.1)
    assert factor[right] == pytest.approx(0.0, abs=0.01)
    weakening = full.weakening(seen(full, points, 300.0))
    assert weakening[right].max() < 0.01 * weakening[left].min()


@pytest.mark.parametrize("curvature", [1.0, 4.0, 10.0])
def test_on_a_summit_the_attraction_gains_less_than_the_columns(curvature):
    """A middle node touches, or stands 2 um off, and its neighbours farther."""
    pad, points = arc(24, 3.0, 2.0)
    summit, volts = 25, 300.0
    points[:, 1] = curvature * (points[:, 0] - points[summit, 0]) ** 2
    surface = ev.Display(insulator=ev.TOUCHSCREEN, y=0.0)
    columns, full = between(pad, points, surface, ROUGH)
    pressing, more = np.zeros((2, len(points)))
    pressing[summit], more[summit] = 4e-3, 1e-6

    forces = [full.forces(seen(full, points, volts, None, pressing + k * more))[summit, 1] for k in (-1, 1)]
    gain = (forces[0] - forces[1]) / 2e-6
    known = [a.gain_on_pressing(seen(a, points, volts, None, pressing))[summit] for a in (columns, full)]
    assert known[0] > 2.0 * gain
    assert 0.9 * gain < known[1] < gain + 0.35 * (known[0] - gain)

    points[:, 1] += 2e-3
    apart = np.zeros_like(points)
    apart[summit, 1] = 1e-6
    forces = [full.forces(seen(full, points + k * apart, volts))[summit, 1] for k in (-1, 1)]
    weakening = (forces[1] - forces[0]) / 2e-6
    known = [a.weakening(seen(a, points, volts))[summit] for a in (columns, full)]
    assert abs(known[1] - weakening) < 0.7 * abs(known[0] - weakening)


def ridged():
    """A scene of a ridged finger on a wave; its ridges touch with one node each."""
    finger = ev.FingerPad(
        resolution="coarse", ridge_width=0.475, ridge_height=0.0664, ridge_exponent=3.8, ridge_phase=-0.31
    )
    surface = ev.Sinusoid(friction=0.3, insulator=ev.Layer(0.0093, 18.0))
    motion, drive = [ev.Press(force=0.074, steps=2)], {"voltage": 380.0, "field": "full"}
    return ev.Scene(finger, surface, ev.StrongTroxel(), motion=motion, roughness_gap=ROUGH, **drive)


@pytest.mark.filterwarnings("ignore:at .* V touching skin")
def test_what_a_summit_gains_on_closing_and_loses_on_opening_is_the_fields():
    """One node closes, then is pressed: the error of the contact step beside that of the columns."""
    model = make_model(ridged())
    rest, linear = model.equilibrium.rest, model.equilibrium.body.linearisation
    lowest = linear.interface.surface_at(rest(np.zeros(2), 380.0)).gap
    summit = int(np.argmin(lowest))
    state = rest(np.array([0.0, 2e-3 - lowest[summit]]), 380.0)
    linear.begin(state)
    status, force = state.status.copy(), state.contact_force.copy()
    status[summit], force[summit, 0] = STICK, 2e-3
    closed = replace(state, status=status)
    pressed = replace(closed, contact_force=force)

    def pulled(by, at):
        return by(linear.pad_state(at))[summit, 1]

    field, columns = model.attraction.forces, model.attraction.column_law.forces
    for start, end, known in (
        (state, closed, linear.gain_on_closing(state)[summit]),
        (closed, pressed, linear.by_force(pressed).on_opening[summit, 0]),
    ):
        true, wrong = (pulled(by, start) - pulled(by, end) for by in (field, columns))
        assert true > 0.0
        assert abs(known - true) < 0.7 * abs(wrong - true)


@pytest.mark.filterwarnings("ignore:at .* V touching skin")
def test_ridges_that_touch_with_one_node_are_pressed_between_rough_faces():
    """Seed 1801122, scene 752: with the columns' tangent such a node closed and opened by turns."""
    found = ev.simulate(ridged())
    assert found.provenance["solver"]["cuts"] == 0
    assert found.newton_iterations.sum() < 20 * found.substeps.sum()
