"""Derivatives of a run by its parameters, through partial and full slip and a reversal, against independent
numbers, identities and differences of runs.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest

import evfem as ev
from evfem.response.parameters import parameter_of

TISSUE = "finger.materials.tissue."
THICKNESS = "electrostatics.insulator_thickness"
X = np.linspace(-3.0, 3.0, 5)
FORCES = ("normal_force", "tangential_force")


def mesh():
    """5 x 4 nodes below a flat top at y = 3, rows evenly spaced above the parabola x^2/16."""
    rows = [np.column_stack([X, X**2 / 16 + (3.0 - X**2 / 16) * j / 3]) for j in range(4)]
    corners = np.array([[5 * j + i + k for k in (0, 1, 6, 5)] for j in range(3) for i in range(4)])
    sets = {"pad": np.arange(5), "bone": np.arange(15, 20)}
    return ev.Mesh(np.vstack(rows), corners, "quad", np.zeros(12, int), {"tissue": 0}, sets)


def block(hold="indentation", law=None, **changed):
    """The run of the table: pressed, slid forth and back; the law of the attraction without a core."""
    law = law or ev.NeoHookean(E=0.05, nu=0.45)
    skin = ev.Electrical(stratum_corneum_thickness=0.3)
    finger = ev.MeshedFinger(mesh(), {"tissue": law}, electrical=skin, viscosity=0.03)
    slides = (ev.Slide(0.8, steps=8, speed=2.0, hold=hold), ev.Slide(-0.4, steps=4, speed=2.0, hold=hold))
    solver = ev.Solver(element="q1_fbar", dynamics="viscous", tolerance=1e-12, core="off")
    scene = ev.Scene(
        finger,
        ev.Display(ev.Layer(0.01, 3.0), friction=0.3, y=0.0),
        ev.StrongTroxel(),
        100.0,
        (ev.Press(indentation=0.3, steps=3, speed=2.0), *slides),
        solver=solver,
    )
    return replace(scene, **changed)


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
FORCE_HELD = {
    TISSUE + "E": [
        (0.69191435876, 0.17884400534),
        (0.68414983868, 0.20524495160),
        (0.68916507900, -4.4816760868e-2),
    ],
    "surface.friction": [(np.nan, 6.2736141896e-3), (np.nan, 5.1878600497e-2)],
    "finger.viscosity": [(np.nan, 5.3773958673e-2), (np.nan, 6.4448639050e-2)],
}
#: forces of the independent code: the voltage's constants differ by 2e-10
SAME = 1.5e-9


@pytest.fixture(scope="module")
def held():
    """The derivatives of both forms of hold."""
    return {hold: ev.sensitivities(block(hold), KEYS) for hold in ("indentation", "force")}


@pytest.mark.parametrize(("hold", "table"), [("indentation", TABLE), ("force", FORCE_HELD)])
def test_derivatives_of_an_independent_code(held, hold, table):
    found = held[hold]
    for key, rows in table.items():
        factor = 3.0 if key == THICKNESS else 1.0
        for step, row in zip((6, 10, 15), rows, strict=False):
            for column, value in zip(FORCES, row, strict=True):
                size = np.abs(found[FORCES[0], key]).max() * factor
                if np.isfinite(value):
                    assert factor * found[column, key][step - 1] == pytest.approx(
                        value, rel=SAME, abs=1e-10 * size
                    )


@pytest.mark.parametrize("hold", ["indentation", "force"])
def test_forces_works_and_energies_are_homogeneous_in_moduli_and_squared_voltage(held, hold):
    found = held[hold]
    smooth = [name for name in found.columns if name.endswith(("_force", "_work", "_energy", "_dissipation"))]
    for name in smooth:
        value = np.asarray(found.result[name])
        by_both = 0.05 * found[name, TISSUE + "E"] + 50.0 * found[name, "electrostatics.voltage"]
        assert by_both == pytest.approx(value, abs=1e-9 * np.abs(value).max() + 1e-18)


def test_friction_has_no_effect_before_the_first_slip_and_speed_is_time(held):
    found = held["indentation"]
    assert np.abs(found["normal_force", "surface.friction"][:3]).max() < 1e-12
    by_speed = ev.sensitivities(block(), "motion.0.speed", ["normal_force"])["normal_force", "motion.0.speed"]
    by_time = found["normal_force", "finger.viscosity"]
    assert 2.0 * by_speed[2] == pytest.approx(0.03 * by_time[2], rel=1e-9)
    assert 0.03 * by_time[2] == pytest.approx(5.8124895294e-3, rel=1e-8)


def test_beyond_valid_to_a_status_changes(held):
    """Before it none does."""
    found, key = held["indentation"], "surface.friction"
    reach = found.valid_to[key][14]
    statuses = []
    for share in (0.0, 0.9, -0.9):
        scene = block(surface=ev.Display(ev.Layer(0.01, 3.0), friction=0.3 + share * reach, y=0.0))
        statuses.append(ev.simulate(scene).frames[-1].contact_status.tolist())
    assert reach > 0.05
    assert statuses[0] == statuses[1] or statuses[0] == statuses[2]


def test_what_counts_has_no_derivative_and_a_reason(held):
    found = held["force"]
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
        J = ev.det(F)
        return 0.5 * self.mu * (ev.ddot(F, F) * J ** (-2 / 3) - 3.0) + 0.5 * self.bulk * np.log(J) ** 2


def differenced(scene, apply, value, step, columns=FORCES):
    """Central difference of fourth order of runs, (columns, steps)."""
    runs = [ev.simulate(apply(scene, value + k * step)) for k in (-2, -1, 1, 2)]
    weights = np.array([1.0, -8.0, 8.0, -1.0]) / 12.0 / step
    return sum(w * np.array([run[name] for name in columns]) for w, run in zip(weights, runs, strict=True))


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
    x, y, z = (np.linspace(*ends) for ends in ((-2.0, 2.0, 5), (0.0, 1.0, 4), (-2.0, 2.0, 4)))
    ids = np.arange(80).reshape(5, 4, 4)
    points = []
    for a in x:
        for b in y:
            for c in z:
                low = (a**2 + 0.8 * c**2) / 12
                points.append([a, low + (2.0 - low) * b, c])
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    cells = [
        [ids[i + a, j + b, k + c] for a, b, c in corners]
        for i in range(4)
        for j in range(3)
        for k in range(3)
    ]
    sets = {"pad": ids[:, 0].ravel(), "bone": ids[:, -1].ravel()}
    mesh = ev.Mesh(np.array(points), np.array(cells), "hexahedron", np.zeros(36, int), {"tissue": 0}, sets)
    skin = ev.Electrical(stratum_corneum_thickness=0.3)
    finger = ev.MeshedFinger(mesh, {"tissue": ev.NeoHookean(E=0.05, nu=0.45)}, electrical=skin)
    slides = (
        ev.Slide(0.5, steps=3, angle=30.0, hold="force"),
        ev.Slide(-0.2, steps=1, angle=30.0, hold="force"),
    )
    motion = (ev.Press(indentation=0.25, steps=2), *slides)
    solver = ev.Solver(tolerance=1e-12, core="off")
    surface = ev.Display(ev.Layer(0.01, 3.0), friction=0.3, y=0.0)
    return ev.Scene(finger, surface, ev.StrongTroxel(), 100.0, motion, solver=solver)


LAYERED = {"insulator": ev.Layer(0.01, 3.0)}
ROUGH = ev.PowerRoughness(gap=0.002, pressure=0.01, exponent=0.3, open_gap=0.004)
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
    "penalty": (
        lambda: block(
            solver=replace(block().solver, contact="penalty", penalty_normal=10.0, penalty_tangential=10.0)
        ),
        "surface.friction",
    ),
    "rate": (lambda: block(friction_law=ev.RateFriction(speed=1.0, ratio=0.7)), "surface.friction_law.ratio"),
    "ageing": (lambda: block(friction_law=ev.AgeingFriction(0.5, 0.3)), "surface.friction_law.time"),
    "sines": (lambda: block(surface=ev.Sinusoid(terms=[[0.05, 0.5, 0.3]], **LAYERED)), "surface.terms.0.0"),
    "normal": (lambda: block(direction="normal"), "electrostatics.voltage"),
    "inertia": (lambda: block(solver=replace(block().solver, dynamics="inertial")), TISSUE + "E"),
    "jump of friction": (
        lambda: block(
            surface=ev.Display(ev.Layer(0.01, 3.0), [[-9.0, 0.2], [0.3, 0.2], [0.3, 0.5], [9.0, 0.5]], 0.0)
        ),
        "surface.friction.2.1",
    ),
    "adhesion": (lambda: block(adhesion=ev.Dugdale(stress=0.002, reach=0.02)), "adhesion.stress"),
    "solid": (solid, "surface.friction"),
}


@pytest.mark.parametrize("case", CASES)
def test_derivatives_are_those_of_differences_of_runs(case):
    make, key = CASES[case]
    scene, columns = make(), (*FORCES, "electrostatic_force", "friction_dissipation")
    found = ev.sensitivities(scene, key, columns)
    value = found.parameters[key]
    size = 2e-4 * min(value, 0.5 - value if key.endswith("nu") else value)
    runs = differenced(scene, lambda s, v: changed(s, key, v), value, size, columns)
    holds = np.cumprod(found.valid_to[key] > 4 * size).astype(bool)
    assert holds[:5].all()
    for name, row in zip(columns, runs, strict=True):
        scale = max(np.abs(row).max(), 1e-3 * np.abs(found.result[name]).max() / value)
        assert found[name, key][holds] == pytest.approx(row[holds], rel=1e-6, abs=1e-6 * scale)


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


def test_an_elastic_surface_is_refused():
    soft = replace(block().surface, elastic=ev.ElasticLayer(E=1.0, nu=0.4, thickness=1.0))
    with pytest.raises(ev.InputError, match="a rigid one: derivatives know no other"):
        ev.sensitivities(block(surface=soft), "surface.friction")


def test_a_voltage_that_follows_a_force_is_not_differentiated_and_said_so():
    scene = block(voltage=ev.FollowForce([0.0, 1.0], [0.005, 0.005], 300.0), motion=block().motion[:2])
    found = ev.sensitivities(scene, TISSUE + "E", ["normal_force"])
    assert np.isfinite(found["normal_force", TISSUE + "E"][:3]).all()
    assert np.isnan(found["normal_force", TISSUE + "E"][3:]).all()
    assert "unknown of the step" in found.reasons[TISSUE + "E"]


@pytest.mark.parametrize("hold", ["indentation", "force"])
def test_the_ridged_finger_is_homogeneous_in_all_its_moduli_and_the_squared_voltage(hold):
    """Ridges, five layers, a core of the attraction, partial slip."""
    pad = ev.FingerPad(resolution="coarse")
    motion = (ev.Press(indentation=0.2, steps=2), ev.Slide(0.1, steps=2, hold=hold))
    scene = ev.Scene(pad, ev.Display(), ev.Kaczmarek(), 500.0, motion, solver=ev.Solver(tolerance=1e-11))
    keys = [f"finger.materials.{name}.E" for name in pad.materials]
    columns = ["normal_force", "tangential_force", "electrostatic_force", "applied_force"]
    found = ev.sensitivities(scene, [*keys, "electrostatics.voltage"], columns)
    for name in columns:
        total = sum(found.parameters[key] * found[name, key] for key in keys)
        total += 250.0 * found[name, "electrostatics.voltage"]
        value = found.result[name]
        assert total == pytest.approx(value, abs=1e-9 * np.abs(value).max())
