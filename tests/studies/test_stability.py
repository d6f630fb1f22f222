"""The study of stability: its quick cases end as they should, and a judge that lets nothing pass
unseen.
"""

import importlib
import importlib.util
import json

import numpy as np
import pytest

from evfem.errors import InputError
from evfem.scene.motion import Press, Slide
from evfem.surface.surfaces import Flat, Sinusoid

studies = importlib.import_module("evfem.studies" if importlib.util.find_spec("evfem.studies") else "studies")
stability, case, scenes, figure = (
    importlib.import_module(f"{studies.__name__}.stability.{name}")
    for name in ("study", "case", "scenes", "figure")
)


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stability")
    return studies.run("stability", quick=True, out=folder), folder


@pytest.mark.slow
def test_every_quick_case_ends_as_it_should(quick):
    result, _ = quick
    bad = {
        key: one for key, one in result["assumptions"]["cases"].items() if one["outcome"] not in case.PASSED
    }
    assert not bad
    assert result["numbers"]["good"] == result["numbers"]["cases"] >= 15


@pytest.mark.slow
def test_forces_balance_in_every_step_of_the_quick_cases(quick):
    numbers = quick[0]["numbers"]
    errors = {key: value for key, value in numbers.items() if key.endswith("force_error")}
    assert len(errors) >= 15
    assert max(errors.values()) < 1e-6  # of forces down to 1e-6 N/mm


@pytest.mark.slow
def test_study_leaves_table_numbers_and_picture(quick):
    result, folder = quick
    assert sorted(p.name for p in folder.iterdir()) == [
        f"stability.{end}" for end in ("csv", "json", "md", "png")
    ]
    assert json.loads((folder / "stability.json").read_text()) == json.loads(json.dumps(result))
    page = (folder / "stability.md").read_text()
    assert all(line in page for lines in result["assumptions"]["tables"].values() for line in lines)
    assert all(line.count(",") == 3 for line in (folder / "stability.csv").read_text().splitlines())
    assert (folder / "stability.png").read_bytes().startswith(b"\x89PNG")


def test_every_group_of_the_study_has_a_quick_case():
    assert all(any(one.quick for one in group.cases) for group in stability.GROUPS)
    assert len(stability.CASES) == sum(len(group.cases) for group in stability.GROUPS)  # no name twice


def judged(function):
    return case.judge(case.Case("a group", "a case", "an expectation", function))


def impossible(log):
    """Half a millimetre in one part, at a tolerance that cannot be met."""
    body, steep = scenes.finger(scenes.block()), Sinusoid(terms=[[5.0, 400.0, 0.0]], friction=2.0)
    return log.simulate(scenes.scene(body, steep, Press(indentation=1.9, steps=1), Slide(50.0, steps=1)))


def refuse(log):
    return "refused" in log.refusal(lambda: refuse_it()), "said"


def refuse_it():
    raise InputError("key", "refused", "other things")


def broken(log):
    raise ZeroDivisionError("by zero")


def test_outcomes_of_a_judge():
    assert judged(lambda log: (True, "as expected")).outcome == "passed"
    assert judged(lambda log: (False, "not as expected")).outcome == "wrong"
    assert judged(refuse).outcome == "refused"
    assert judged(lambda log: (True, log.refusal(lambda: None))).outcome == "wrong"
    found = judged(impossible)
    assert (found.outcome, found.good) == ("not converged", False)
    assert "did not converge" in found.said
    found = judged(broken)
    assert (found.outcome, found.said) == ("error", "ZeroDivisionError: by zero")


def test_a_stop_that_is_expected_passes_and_keeps_its_costs():
    def stops(log):
        with pytest.raises(AssertionError, match="finished"):
            log.stop(scenes.scene(scenes.finger(scenes.block()), Flat(friction=0.0), Press(indentation=0.1)))
        return True, str(log.stop(log_scene()))

    def log_scene():
        body, steep = scenes.finger(scenes.block()), Sinusoid(terms=[[5.0, 400.0, 0.0]], friction=2.0)
        return scenes.scene(body, steep, Press(indentation=1.9, steps=1), Slide(50.0, steps=1))

    found = judged(stops)
    assert found.outcome == "stopped"
    assert found.steps >= 10
    assert found.cuts > 0


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


@pytest.mark.slow
def test_picture_splits_groups_between_columns_and_marks_what_failed(quick):
    def found(group, n, outcome="passed"):
        return [
            case.Found(
                4,
                4,
                0,
                9,
                key=f"{group}.{i}",
                group=group,
                name=f"{i}",
                expected="",
                outcome=outcome,
                said="",
                cpu_s=1.0,
            )
            for i in range(n)
        ]

    everything = found("one", 20) + found("two", 18, "wrong") + found("three", 5, "refused")
    columns = figure._columns(everything)
    assert [sorted({one.group for one in column}) for column in columns] == [["one"], ["three", "two"]]
    texts = [text.get_text() for ax in figure.draw(everything).axes for text in ax.texts]
    assert {"one: 20 of 20", "two: 0 of 18", "three: 5 of 5"} <= set(texts)
