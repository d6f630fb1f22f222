"""The study of stability: its quick cases end as they should, and a judge that lets nothing pass unseen."""

import numpy as np
import pytest

from evfem.scene.motion import Press, Slide
from evfem.studies.stability import case, figure, scenes
from evfem.studies.stability import study as stability
from evfem.surface.surfaces import Flat, Sinusoid


@pytest.mark.slow
def test_every_quick_case_ends_as_it_should(study):
    result, _ = study("stability")
    cases = result["assumptions"]["cases"]
    assert not {key: one for key, one in cases.items() if one["outcome"] != "passed"}
    assert result["numbers"]["good"] == result["numbers"]["cases"] >= 15


@pytest.mark.slow
def test_forces_balance_in_every_step_of_the_quick_cases(numbers_of):
    numbers = numbers_of("stability")
    errors = {key: value for key, value in numbers.items() if key.endswith("force_error")}
    assert len(errors) >= 15
    assert max(errors.values()) < 1e-6  # of forces down to 1e-6 N/mm


def test_every_group_of_the_study_has_a_quick_case():
    assert all(any(one.quick for one in group.cases) for group in stability.GROUPS)
    assert len(stability.CASES) == sum(len(group.cases) for group in stability.GROUPS)  # no name twice


def judged(function):
    return case.judge(case.Case("a group", "a case", "an expectation", function))


def steep():
    """Half a millimetre in one part over walls that no step can follow."""
    body, walls = scenes.finger(scenes.block()), Sinusoid(terms=[[5.0, 400.0, 0.0]], friction=2.0)
    return scenes.scene(body, walls, Press(indentation=1.9, steps=1), Slide(50.0, steps=1))


def test_outcomes_of_a_judge():
    assert judged(lambda log: (True, "as expected")).outcome == "passed"
    assert judged(lambda log: (False, "not as expected")).outcome == "wrong"
    found = judged(lambda log: log.simulate(steep()))
    assert (found.outcome, found.good) == ("not converged", False)
    assert "did not converge" in found.said
    assert found.cuts > 0  # what it cost is kept
    found = judged(lambda log: 1 / 0)
    assert (found.outcome, found.said) == ("error", "ZeroDivisionError: division by zero")


def test_balances_see_a_force_and_an_energy_that_are_missing():
    body = scenes.finger(scenes.block(sag=0.4))
    motion = Press(indentation=0.4, steps=4), Slide(0.5, steps=4)
    result = case.Log().simulate(scenes.scene(body, Flat(friction=0.3), *motion))
    assert case.out_of_balance(result).max() < 1e-7
    assert case.lost_energy(result) < 1e-7
    result.normal_force[2] *= 1.001
    assert case.out_of_balance(result).max() == pytest.approx(1e-3, rel=0.01)
    result.friction_dissipation[-1] = 0.0
    assert case.lost_energy(result) > 0.01


def test_scenes_are_alike_that_end_in_the_same_row():
    """Without friction in two steps or one; a tenth deeper is another end."""
    body, flat = scenes.finger(scenes.block(sag=0.4)), Flat(friction=0.0)
    ways = ((0.4, 1), (0.4, 2), (0.44, 1))
    once, twice, deeper = (scenes.scene(body, flat, Press(indentation=d, steps=n)) for d, n in ways)
    assert case.alike(case.Log(), (once, twice), "normal_force stored_energy", 1e-6)[0]
    assert not case.alike(case.Log(), (once, deeper), "normal_force", 0.05)[0]


def test_other_images_of_a_mesh_are_the_same_body():
    mesh = scenes.shaken(scenes.block(sag=0.4), 0.3)
    area = area_of(mesh)
    for other, factor in (
        (scenes.mirrored(mesh), 1.0),
        (scenes.renumbered(mesh), 1.0),
        (scenes.scaled(mesh, 3.0), 9.0),
    ):
        assert area_of(other).sum() == pytest.approx(factor * area.sum(), rel=1e-13)
        assert (area_of(other) > 0.0).all()
        assert np.ptp(other.points[other.node_sets["bone"], 1]) < 1e-12
    assert not np.array_equal(scenes.renumbered(mesh).cells, mesh.cells)


def area_of(mesh):
    x, y = mesh.points[mesh.cells].transpose(2, 0, 1)
    return 0.5 * np.sum(x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y, axis=1)


def test_the_picture_counts_what_passed_by_groups():
    def found(group, n, outcome="passed"):
        about = {"group": group, "expected": "", "outcome": outcome, "said": "", "cpu_s": 1.0}
        return [case.Found(4, 4, 0, 9, key=f"{group}.{i}", name=f"{i}", **about) for i in range(n)]

    everything = found("one", 20) + found("two", 18, "wrong") + found("three", 5)
    texts = [text.get_text() for ax in figure.draw(everything).axes for text in ax.texts]
    assert {"one: 20 of 20", "two: 0 of 18", "three: 5 of 5"} <= set(texts)
