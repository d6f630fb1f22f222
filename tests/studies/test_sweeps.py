"""The two studies that are sweeps: participants by finite elements, and what Fig. 5's inputs do to it."""

import numpy as np
import pytest

from evfem.scene import file as scenefile
from evfem.simulation.run import simulate
from evfem.studies import common, hovering_people, uncertainty
from evfem.studies import participants as people

pytestmark = pytest.mark.slow


def test_every_participant_law_and_case_is_a_scene(numbers_of):
    assert (numbers_of("participants")["points"], numbers_of("participants")["done"]) == (18.0, 18.0)
    plan = people.plan(common.participants()["participant"])
    points = plan.points()
    assert len(points) == 2 * 3 * 11
    for point in points:
        scene = scenefile.loads(point.text)
        row = common.participants()["participant"].index(point.parameters["finger.participant"])
        assert (scene.finger.width, scene.finger.height) == (
            common.participants()["a"][row], common.participants()["b"][row]
        )  # fmt: skip
        assert (scene.voltage, scene.motion[0].gap) == common.CASES[point.labels["case"]]
        assert type(scene.law) is type(common.LAWS[point.parameters["electrostatics.law"]])


def test_a_participants_force_is_that_of_a_single_run(numbers_of):
    """Force per depth of one scene, times the width over which the rigid ellipsoid has its own force."""
    names = common.participants()["participant"][:3]
    (point,) = [
        p
        for p in people.plan(names).points()
        if p.labels == {"case": "HVLD"}
        and p.parameters["finger.participant"] == "ii"
        and p.parameters["electrostatics.law"] == "kaczmarek"
    ]
    per_depth = simulate(scenefile.loads(point.text)).electrostatic_force[-1]
    a, b, c = (common.participants()[key][1] for key in "abc")
    # the rigid forces by midpoint rules in angles, x = a sin t / 2: over the rectangle and over its width
    t = (np.arange(1500) + 0.5) / 1500 * np.pi / 2
    cos, step = np.cos(t), np.pi / 3000
    pull = lambda gap: 1.0 / ((gap + 0.38 / 1650 + 0.09 / 3.35) * (gap + 0.47))  # noqa: E731
    line = np.sum(a * cos * step * pull(0.25 + b / 2 * (1 - cos)))
    weight = a * c * np.cos(np.pi / 6) * cos[:, None] * cos * step**2
    area = np.sum(weight * pull(0.25 + b / 2 * (2 - cos[:, None] - cos)))
    assert numbers_of("participants")["kaczmarek.ii.HVLD_mN"] == pytest.approx(
        1e3 * per_depth * area / line, rel=1e-5
    )


def test_ridges_take_away_more_than_deformation_adds(numbers_of):
    """Gaps in the grooves are up to 0.15 mm wider; the paper's Fig. 5 has the same two per mm of width."""
    for law in common.LAWS:
        for case in common.CASES:
            key = f"verdict.change_from_closed_form_{{}}.{law}.{case}"
            low, high = (numbers_of("participants")[key.format(end)] for end in ("lowest", "highest"))
            assert -0.07 < low <= high < 0.0


def test_samples_without_spread_are_fig05():
    """With every input at Table 2's value the closed forms give Fig. 5's own forces."""
    exact = {
        "gap_error": 0.0, "voltage_factor": 1.0, "stratum_corneum": 0.38, "stratum_corneum_eps_r": 1650.0,
        "insulator": 0.09, "insulator_eps_r": 3.35, "width_error": 0.0, "height_error": 0.0,
        "length_error": 0.0, "inclination": 30.0,
    }  # fmt: skip
    assert set(exact) == set(uncertainty.INPUTS)
    drawn = {name: np.array([value]) for name, value in exact.items()}
    for (law, case), expected in hovering_people.participant_forces().items():
        np.testing.assert_allclose(uncertainty.forces(drawn, law, case)[0], expected, rtol=1e-12)


def test_spread_follows_the_derivatives(numbers_of):
    """To first order the variance is the sum of squared slopes times input variances (delta method)."""
    numbers = numbers_of("uncertainty")
    middle = {
        name: np.array([float(one.quantile(np.array([0.5]))[0])]) for name, one in uncertainty.INPUTS.items()
    }
    rest = np.median(uncertainty.forces(middle, "kaczmarek", "HVHD"))
    variance = 0.0
    for name, one in uncertainty.INPUTS.items():
        shares = (np.arange(2000) + 0.5) / 2000
        sd = one.quantile(shares).std()
        ahead = [{**middle, name: middle[name] + side * 0.1 * sd} for side in (1, -1)]
        up, down = (np.median(uncertainty.forces(one, "kaczmarek", "HVHD")) for one in ahead)
        variance += ((up - down) / (0.2 * sd) * sd) ** 2
    assert numbers["kaczmarek.relative_sd.HVHD"] == pytest.approx(np.sqrt(variance) / rest, rel=0.15)
    assert numbers["kaczmarek.p50_mN.HVHD"] == pytest.approx(rest, rel=0.02)


def test_the_gap_matters_most(numbers_of):
    numbers = numbers_of("uncertainty")
    for law in common.LAWS:
        for case in common.CASES:
            ranks = {name: numbers[f"rank.{law}.{case}.{name}"] for name in uncertainty.INPUTS}
            assert min(ranks, key=ranks.get) == "gap_error"
            assert ranks["gap_error"] < -0.6
