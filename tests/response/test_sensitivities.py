"""Derivatives of a run by its parameters, through partial and full slip and a reversal, against independent
numbers, identities and differences of runs.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from tools.builders import finger
from tools.domes import Dome, dome, dome_scene
from tools.meshes import block as meshed

import evfem as ev
from evfem.response.lines import differentiable, is_work
from evfem.response.parameters import parameter_of
from evfem.tensor import ddot, det

TISSUE = "finger.materials.tissue."
THICKNESS = "electrostatics.insulator_thickness"
X = np.linspace(-3.0, 3.0, 5)
#: 5 x 4 nodes below a flat top at y = 3, rows evenly spaced above the parabola x^2/16
MESH = meshed(4, 3, 6.0, 3.0, 9.0 / 16.0)
FORCES = ("normal_force", "tangential_force")


DISPLAY = ev.Display(ev.Layer(0.01, 3.0), friction=0.3, y=0.0)
ATTRACTED = {"surface": DISPLAY, "law": ev.StrongTroxel(), "voltage": 100.0}


#: steps of press, slide and slide back: some, with statuses that change near by, and those of the table
FEW, NEAR, TABLED = (1, 3, 1), (2, 4, 2), (3, 8, 4)


def block(hold="indentation", law=None, steps=FEW, **changed):
    """Pressed, slid forth until all slips, and back; the law of the attraction without a core."""
    law = law or ev.NeoHookean(E=0.05, nu=0.45)
    skin = ev.Electrical(stratum_corneum_thickness=0.3)
    finger = ev.MeshedFinger(MESH, {"tissue": law}, electrical=skin, viscosity=0.03)
    press, forth, back = steps
    slides = (
        ev.Slide(0.8, steps=forth, speed=2.0, hold=hold),
        ev.Slide(-0.4, steps=back, speed=2.0, hold=hold),
    )
    solver = ev.Solver(element="q1_fbar", dynamics="viscous", tolerance=1e-12, core="off")
    motion = (ev.Press(indentation=0.3, steps=press, speed=2.0), *slides)
    return replace(ev.Scene(finger, motion=motion, solver=solver, **ATTRACTED), **changed)


ROWS = np.repeat(np.arange(4.0), 5)[:, None] / 3
TALLER = ev.ShapeChange("taller", ROWS * [0.0, 1.0])
FLATTER = ev.ShapeChange("flatter", -(1.0 - ROWS) * np.tile(X**2, 4)[:, None] / 128 * [0.0, 1.0])
KEYS = [
    TISSUE + "E",
    TISSUE + "nu",
    "surface.friction",
    "finger.viscosity",
    "electrostatics.voltage",
    THICKNESS,
    TALLER,
    FLATTER,
]
#: of a code of its own, in double precision with complex steps: steps 6, 10, 15; the thickness over eps_r
TABLE = {
    TISSUE + "E": [
        (5.4942114070e-1, 1.7676907749e-1),
        (5.4651655274e-1, 1.6395496582e-1),
        (5.4521402722e-1, -8.6146018027e-2),
    ],
    TISSUE + "nu": [(1.1910928204e-1, -3.6484312451e-3), (1.0264959468e-1, 3.0794878403e-2)],
    "surface.friction": [
        (4.0066392150e-3, 5.4431586200e-3),
        (3.6509418934e-4, 4.4077133401e-2),
        (1.5709716127e-3, 4.3261723834e-2),
    ],
    "finger.viscosity": [(-4.3985255861e-3, 5.0221057064e-2), (-2.0722740556e-3, -6.2168221669e-4)],
    "electrostatics.voltage": [
        (3.3865532412e-4, 1.3062144481e-5),
        (3.3283555014e-4, 9.9850665041e-5),
        (3.3552775116e-4, 9.8238866780e-5),
    ],
    THICKNESS: [(-9.6338586545, -0.37327867090), (-9.4694294726, -2.8408288418)],
    "taller": [
        (-1.2837340029e-2, -3.7765014726e-3),
        (-1.2518293725e-2, -3.7554881175e-3),
        (-1.1958688541e-2, 1.7921689645e-3),
    ],
    "flatter": [(1.3443210543e-3, 1.0519192832e-5), (1.2938076645e-3, 3.8814229936e-4)],
}
#: forces of the independent code: the voltage's constants differ by 2e-10
SAME = 1.5e-9


@pytest.fixture(scope="module")
def tabled():
    """The derivatives of the run of the table."""
    return ev.sensitivities(block(steps=TABLED), KEYS)


@pytest.fixture(scope="module")
def under_a_force():
    """Those of slides under a held force."""
    return ev.sensitivities(block("force"), [TISSUE + "E", "electrostatics.voltage"])


def test_derivatives_of_an_independent_code(tabled):
    found = tabled
    for key, rows in TABLE.items():
        factor = 3.0 if key == THICKNESS else 1.0
        for step, row in zip((6, 10, 15), rows, strict=False):
            for column, value in zip(FORCES, row, strict=True):
                size = np.abs(found[FORCES[0], key]).max() * factor
                expected = pytest.approx(value, rel=SAME, abs=1e-10 * size)
                assert factor * found[column, key][step - 1] == expected


@pytest.mark.parametrize("run", ["tabled", "under_a_force"])
def test_forces_works_and_energies_are_homogeneous_in_moduli_and_squared_voltage(run, request):
    found = request.getfixturevalue(run)
    smooth = [name for name in found.columns if name.endswith(("_force", "_work", "_energy", "_dissipation"))]
    for name in smooth:
        value = np.asarray(found.result[name])
        by_both = 0.05 * found[name, TISSUE + "E"] + 50.0 * found[name, "electrostatics.voltage"]
        assert by_both == pytest.approx(value, abs=1e-9 * np.abs(value).max() + 1e-18)


def test_friction_has_no_effect_before_the_first_slip_and_speed_is_time(tabled):
    assert np.abs(tabled["normal_force", "surface.friction"][:3]).max() < 1e-12
    press, key = block(steps=TABLED).motion[:1], "motion.0.speed"
    by_speed = ev.sensitivities(block(motion=press), key, ["normal_force"])["normal_force", key]
    by_time = tabled["normal_force", "finger.viscosity"]
    assert 2.0 * by_speed[2] == pytest.approx(0.03 * by_time[2], rel=1e-9)
    assert 0.03 * by_time[2] == pytest.approx(5.8124895294e-3, rel=1e-8)


def statuses(scene, step):
    """Of all nodes in a step, counted from 0."""
    return ev.simulate(scene).frames[step].contact_status.tolist()


@pytest.mark.parametrize("key", ["surface.friction", THICKNESS])
def test_a_status_changes_where_valid_to_says_and_not_before(key):
    """In the step with the shortest reach: what is left is asked for again and again on the way there."""
    scene = block(steps=NEAR)
    found = ev.sensitivities(scene, key, FORCES)
    reaches = found.valid_to[key]
    step, left, change = int(np.argmin(reaches)), reaches.min(), 0.0
    here = lambda change: changed(scene, key, found.parameters[key] + change)  # noqa: E731
    before = statuses(scene, step)
    way = 1.0 if statuses(here(1.5 * left), step) != before else -1.0
    for _ in range(4):
        change += 0.9 * way * left
        left = ev.sensitivities(here(change), key, FORCES).valid_to[key][step]
    assert left < 1e-3 * reaches.min()
    assert abs(change) == pytest.approx(reaches.min(), rel=0.5)  # which is of first order
    for share, stays in ((0.99, True), (1.01, False)):
        assert (statuses(here(change + share * way * left), step) == before) is stays


def test_what_counts_has_no_derivative_and_a_reason(under_a_force):
    found = under_a_force
    assert np.isnan(found["substeps", TISSUE + "E"]).all()
    assert "whole nodes" in found.reasons["contact_width"]
    assert found.elasticity["normal_force", TISSUE + "E"][0] == pytest.approx(
        0.05 * found["normal_force", TISSUE + "E"][0] / found.result.normal_force[0]
    )
    table = found.table()
    names = table.columns if hasattr(table, "columns") else table.dtype.names  # pandas, or not
    assert f"normal_force by {TISSUE}E" in names


@dataclass(frozen=True)
class Own:
    """A law of one's own."""

    mu: float
    bulk: float

    def psi(self, F):
        J = det(F)
        return 0.5 * self.mu * (ddot(F, F) * J ** (-2 / 3) - 3.0) + 0.5 * self.bulk * np.log(J) ** 2


def differenced(scene, apply, value, step, columns=FORCES):
    """Central difference of runs, (columns, steps)."""
    ends = [ev.simulate(apply(scene, value + way)) for way in (-step, step)]
    return [(ends[1][name] - ends[0][name]) / (2.0 * step) for name in columns]


def largest(result, name):
    """The largest number of a column's unit in a run, of forces a thousandth of it."""
    alike = [one for one, unit in result.units.items() if unit == result.units[name] and one != "motion"]
    found = max(np.abs(np.nan_to_num(result[one])).max() for one in alike)
    return 1e-3 * found if name.endswith("_force") else found


def changed(scene, key, value):
    """The scene with another number."""
    one = parameter_of(scene, key)
    return one.applied(scene, value - one.value)


def soft(**finger):
    """The block without viscosity but with what relaxes otherwise."""
    scene = block()
    return replace(scene, finger=replace(scene.finger, viscosity=0.0, **finger))


def solid():
    """A finger in three dimensions, slid obliquely and back."""
    way = {"angle": 30.0, "hold": "force"}
    motion = [ev.Press(indentation=0.25, steps=2), ev.Slide(0.5, steps=3, **way)]
    finger = Dome(dome((4, 3, 3), (4.0, 2.0, 3.6)))
    solver = ev.Solver(tolerance=1e-12, core="off")
    return dome_scene(*motion, ev.Slide(-0.2, steps=1, **way), finger=finger, solver=solver, **ATTRACTED)


def wet():
    """A finger on a touchscreen with water around its contact."""
    pad = ev.FingerPad(resolution="coarse", ridges=False)
    motion = (ev.Press(force=0.05, steps=1), ev.Slide(1.5, steps=2, hold="force"))
    display = ev.Display(ev.TOUCHSCREEN, friction=0.4)
    water = {"roughness_gap": 0.005, "adhesion": ev.Capillary(0.0728, 40.0, 0.02)}
    return ev.Scene(pad, display, ev.StrongTroxel(), 60.0, motion, solver=ev.Solver(tolerance=1e-11), **water)


def full_field():
    """A round block pressed and moved over the field of its electrode."""
    pad = finger(meshed(12, 4, 4.0, 2.0, 0.3), E=0.05)
    motion = (ev.Press(indentation=0.15, steps=2), ev.Slide(0.2, steps=1))
    scene = ev.Scene(pad, ev.Display(), ev.StrongTroxel(), 1000.0, motion, field="full")
    return replace(scene, solver=ev.Solver(tolerance=1e-11))


def yielding(hold, **more):
    """The block on an elastic surface, of a Poisson's ratio unlike the finger's."""
    return block(hold, surface=replace(DISPLAY, elastic=ev.ElasticLayer(0.1, 0.4, 1.0)), **more)


LAYERED = {"insulator": ev.Layer(0.01, 3.0)}
ROUGH = ev.PowerRoughness(gap=0.002, pressure=0.01, exponent=0.3, open_gap=0.004)
LOCAL = replace(ROUGH, distribution="exponential")
CASES = {
    "own law": (lambda: block(law=Own(0.017, 0.1)), TISSUE + "bulk"),
    "indentation": (block, "motion.0.indentation"),
    "distance": (block, "motion.1.distance"),
    "table of friction": (
        lambda: block(surface=ev.Display(ev.Layer(0.01, 3.0), friction=[[-9.0, 0.2], [9.0, 0.4]], y=0.0)),
        "surface.friction.1.1",
    ),
    "core": (lambda: block(solver=replace(block().solver, core="auto")), THICKNESS),
    "profile of voltages": (
        lambda: block(voltage=ev.VoltageProfile([0.0, 0.4, 0.8], [100.0, 150.0, 80.0])),
        "electrostatics.voltage_profile.1.1",
    ),
    "branch": (lambda: soft(relaxation=((0.3, 0.1), (0.2, 0.01))), "finger.relaxation.0.1"),
    "bulk": (lambda: soft(relaxation=((0.3, 0.1),), bulk_relaxation=True), TISSUE + "nu"),
    "hand": (lambda: block(hand=ev.Hand(stiffness=0.02, damping=1e-3)), "hand.stiffness"),
    "charges": (lambda: block(drive=ev.Drive(resolved=True, gap_conductivity=1e-9)), TISSUE + "E"),
    "rough faces": (lambda: block(roughness_gap=ROUGH), "electrostatics.roughness_gap.gap"),
    "local gaps": (lambda: block(roughness_gap=LOCAL), "electrostatics.roughness_gap.exponent"),
    "layers below them": (lambda: block(roughness_gap=LOCAL), THICKNESS),
    "penalty": (
        lambda: block(
            solver=replace(block().solver, contact="penalty", penalty_normal=10.0, penalty_tangential=10.0)
        ),
        "surface.friction",
    ),
    "rate": (lambda: block(friction_law=ev.RateFriction(speed=1.0, ratio=0.7)), "surface.friction_law.ratio"),
    "ageing": (lambda: block(friction_law=ev.AgeingFriction(0.5, 0.3)), "surface.friction_law.time"),
    "slip memory": (
        lambda: block(friction_law=ev.SlipMemory(ev.LoadIndexFriction(0.01, 0.7), 0.2, 0.5)),
        "surface.friction_law.length",
    ),
    "law in a slip memory": (
        lambda: block(friction_law=ev.SlipMemory(ev.LoadIndexFriction(0.01, 0.7), 0.2)),
        "surface.friction_law.friction.index",
    ),
    "time of a slip memory": (
        lambda: block(friction_law=ev.SlipMemory(0.3, 0.5, 0.5)),
        "surface.friction_law.time",
    ),
    "coefficient of a slip memory": (
        lambda: block(friction_law=ev.SlipMemory(0.3)),
        "surface.friction_law.friction",
    ),
    "sines": (lambda: block(surface=ev.Sinusoid(terms=[[0.05, 0.5, 0.3]], **LAYERED)), "surface.terms.0.0"),
    "normal": (lambda: block(direction="normal"), "electrostatics.voltage"),
    "inertia": (lambda: block(solver=replace(block().solver, dynamics="inertial")), TISSUE + "E"),
    "jump of friction": (
        lambda: block(
            steps=NEAR,
            surface=ev.Display(ev.Layer(0.01, 3.0), [[-9.0, 0.2], [0.3, 0.2], [0.3, 0.5], [9.0, 0.5]], 0.0),
        ),
        "surface.friction.2.1",
    ),
    "adhesion beside a voltage": (wet, "surface.friction"),
    "power": (
        lambda: block(
            voltage=ev.Sine(0.5, 100.0), drive=ev.Drive(resolved=True, gap_conductivity=1e-9), steps=NEAR
        ),
        "electrostatics.signal.amplitude",
    ),
    "adhesion": (lambda: block(adhesion=ev.Dugdale(stress=0.002, reach=0.02)), "adhesion.stress"),
    "solid": (solid, "surface.friction"),
    "profile": (
        lambda: block(surface=ev.Profile([-9.0, -3.0, 3.0, 9.0], [0.0, 0.03, 0.01, 0.0], **LAYERED)),
        "surface.points.1.1",
    ),
    "friction on a profile": (
        lambda: block(surface=ev.Profile([-9.0, 0.0, 9.0], [0.0, 0.02, 0.0], friction=0.3, **LAYERED)),
        "surface.friction",
    ),
    "full field": (full_field, "electrostatics.insulator_thickness"),
    "elastic surface": (lambda: yielding("force"), "surface.elastic.E"),
    "its ratio": (lambda: yielding("indentation"), "surface.elastic.nu"),
    "its thickness": (lambda: yielding("indentation", direction="normal"), "surface.elastic.thickness"),
    "friction on it": (lambda: yielding("force"), "surface.friction"),
}


PLACES = np.linspace(-5.0, 5.0, 21)
FILM = {"friction": 0.3, "insulator": ev.Layer(0.09, 3.35)}


@pytest.mark.filterwarnings("ignore:friction falls with the speed", "ignore:5 um of air")
@pytest.mark.parametrize("case", CASES)
def test_derivatives_are_those_of_differences_of_runs(case):
    make, key = CASES[case]
    scene = make()
    found = ev.sensitivities(scene, key)
    columns = [name for name in found.columns if differentiable(name)]
    value = found.parameters[key]
    size = 1e-4 * min(value, 0.5 - value if key.endswith("nu") else value)
    parts, *runs = differenced(scene, lambda s, v: changed(s, key, v), value, size, ["substeps", *columns])
    holds = np.cumprod(found.valid_to[key] > 4 * size).astype(bool)
    assert holds[: min(5, len(holds))].all()
    for name, row in zip(columns, runs, strict=True):
        # works depend on the parts of a step; but for forces 1e-6 is of the largest number of the unit
        same = holds & ~(is_work(name) & (np.cumsum(np.abs(parts)) > 0.0))
        size = largest(found.result, name)
        scale = max(np.abs(row).max(), size / value)
        assert found[name, key][same] == pytest.approx(row[same], rel=1e-6, abs=1e-6 * scale), name


RELIEFS = {
    "sinusoid": (ev.Sinusoid(terms=[[0.02, 2.0, 30.0]], **FILM), ("surface.terms.0.0", "surface.terms.0.2")),
    "profile": (ev.Profile(PLACES, 0.02 * np.sin(2.0 * PLACES), **FILM), ("surface.points.11.1",)),
    "grating": (
        ev.Grating(period=2.0, groove_depth=0.02, groove_width=0.8, wall_width=0.3, **FILM),
        ("surface.period",),
    ),
}


@pytest.mark.parametrize("kind", RELIEFS)
def test_derivatives_by_a_relief_are_those_of_runs_beside_it(kind):
    """Nodes that nearly touch, and edges near nodes, are closer than a thousandth of amplitude or period: the
    attraction's derivative had the wrong sign, and the friction's was half as large again.
    """
    surface, keys = RELIEFS[kind]
    pad, motion = ev.FingerPad(ridges=False, resolution="coarse"), [ev.Press(indentation=0.3, steps=2)]
    motion.append(ev.Slide(0.4, steps=2))
    scene = ev.Scene(pad, surface, ev.Kaczmarek(), 800.0, motion, solver=ev.Solver(tolerance=1e-11))
    found = ev.sensitivities(scene, keys)
    for key in keys:
        step = 3e-6 * found.parameters[key]
        runs = differenced(scene, lambda s, v, key=key: changed(s, key, v), found.parameters[key], step)
        holds = found.valid_to[key] > 2.0 * step
        assert holds.sum() >= 3
        for name, row in zip(FORCES, runs, strict=True):
            scale = 1e-5 * np.abs(row).max()
            assert found[name, key][holds] == pytest.approx(row[holds], rel=1e-5, abs=scale), (key, name)


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("finger.materials.dermis.E", "tissue"),
        ("surface.y", "a number other than 0"),
        ("steps", "TABLE.KEY"),
        ("motion.7.steps", "numbers from 0 to 2"),
        (ev.ShapeChange("odd", np.zeros((3, 2))), "(20, 2)"),
        (3.0, "dotted keys"),
    ],
)
def test_what_is_no_parameter_is_refused_in_a_sentence(key, said):
    with pytest.raises(ev.InputError, match=said.replace("(", r"\(").replace(")", r"\)")):
        ev.sensitivities(block(), [key])


def test_what_a_finger_computes_is_no_parameter():
    with pytest.raises(ev.InputError, match="materials, which Dome computes; allowed: what is given to it"):
        ev.sensitivities(dome_scene(ev.Press(indentation=0.1, steps=1)), "finger.materials.lower.E")


def test_where_a_force_is_held_shapes_change_normal_force_and_attraction_alike():
    """What rounds are the nail's forces, which are large: with as small changes of the whole shape as the
    attraction needs, the difference would be 6e-9.
    """
    press, solver = ev.Press(force=0.03, steps=1), ev.Solver(tolerance=1e-11)
    pad = ev.FingerPad(resolution="coarse")
    scene = ev.Scene(pad, ev.Display(), ev.Kaczmarek(), 500.0, press, solver=solver)
    keys = ("finger.ridge_width", "finger.width")
    found = ev.sensitivities(scene, keys, ("normal_force", "electrostatic_force"))
    for key in keys:
        normal, pull = (found[name, key][0] for name in ("normal_force", "electrostatic_force"))
        assert abs(pull) > 1e-6
        assert normal == pytest.approx(pull, abs=2e-9)


def test_a_shape_whose_first_touch_passes_to_another_node_is_differentiated_before_that():
    """Two low nodes of the tip: .04 degrees on, the other one is the lowest."""
    tip = ev.Fingertip(resolution="coarse", ridges="none", width=16.4521, height=12.7766, length=23.8991)
    tip = replace(tip, bone_length=17.9243, posture=21.9299)
    press, key = ev.Press(indentation=0.05, steps=1), "finger.posture"
    scene = ev.Scene(tip, ev.Flat(friction=0.0), motion=press, solver=ev.Solver(tolerance=1e-11))
    found = ev.sensitivities(scene, key, "normal_force")
    one, way = parameter_of(scene, key), 2e-3
    ends = [ev.simulate(one.applied(scene, sign * way)).normal_force[0] for sign in (1.0, -1.0)]
    assert found["normal_force", key][0] == pytest.approx((ends[0] - ends[1]) / (2.0 * way), rel=1e-4)


def test_where_two_crests_touch_first_together_the_phase_has_no_derivative_and_the_others_have():
    pad, solver = ev.FingerPad(resolution="coarse", ridge_phase=0.5), ev.Solver(tolerance=1e-11)
    scene = ev.Scene(pad, ev.Flat(friction=0.0), motion=ev.Press(indentation=0.1, steps=1), solver=solver)
    found = ev.sensitivities(scene, ("finger.ridge_phase", "finger.height"), "normal_force")
    assert np.isnan(found["normal_force", "finger.ridge_phase"]).all()
    assert "touch the surface first" in found.reasons["finger.ridge_phase"]
    assert np.isfinite(found["normal_force", "finger.height"]).all()
