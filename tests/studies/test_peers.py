"""evfem beside its peers: the quick comparison with and without them, and how runs become numbers."""

import sys

import numpy as np
import pytest

from evfem import studies
from evfem.studies.peers import apart, hosts, problem, shown
from evfem.studies.peers import evaluation as numbers
from evfem.studies.peers import study as peers

PRESENT = [name for name in numbers.PEERS if hosts.host(name)]
FORCES = ("Fn_at_0.5", "Fn_at_1.0", "Fn_at_1.5")


def run(package, element, cpu=1.0, factor=1.0, level=0, way=problem.GIVEN):
    """A run of scene A that took `cpu` seconds and found the reference's forces times `factor`."""
    depths = 1.5 * np.arange(1, way.press + 1) / way.press
    forces = [factor * problem.REFERENCE["A"].get(f"Fn_at_{depth:.1f}", 1.0) for depth in depths]
    cost = dict.fromkeys(numbers.MEASURED, cpu) | {"history": [[force, 0.0, 0.0] for force in forces]}
    return numbers.Run(package, element, "A", level, cost, way)


@pytest.mark.slow
def test_quick_comparison_without_peers(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(hosts, "host", lambda name: sys.executable if name == "evfem" else None)
    result = studies.run("peers", quick=True, out=tmp_path)
    said = capsys.readouterr().err
    assert "felupe is not installed (pip install evfem[peers])" in said
    assert "getfem is not installed (apt install python3-getfem)" in said
    assert "fenicsx is not installed (pip install dolfinx-solver-real)" in said
    assert "ngsolve is not installed (pip install ngsolve mkl)" in said
    assert result["assumptions"]["missing"] == list(numbers.PEERS)
    assert result["assumptions"]["failed"] == {}
    found = result["numbers"]
    assert not [key for key in found if any(name in key for name in numbers.PEERS)]
    # the benchmark's own words: Q1 on L0 is 3.4 % too stiff, quadratic cells are within 0.3 %
    assert found["A.L0.evfem_q1.error_percent.Fn_at_1.5"] == pytest.approx(3.4, abs=0.3)
    assert abs(found["A.L0.evfem_q2p1.error_percent.Fn_at_1.5"]) < 0.3
    # 15 steps of an exact contact
    assert 15 <= found["A.L0.evfem_q1.iterations"] <= 120
    assert "## Runs" in (tmp_path / "peers.md").read_text()
    assert (tmp_path / "peers.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.peers
def test_quick_comparison_with_what_is_installed(tmp_path):
    assert PRESENT, "there is nothing to compare with; FElupe at least: pip install evfem[peers]"
    result = studies.run("peers", quick=True, out=tmp_path)
    found, said = result["numbers"], result["assumptions"]
    assert said["missing"] == [name for name in numbers.PEERS if name not in PRESENT]
    assert said["failed"] == {}
    assert all(type(value) is float and np.isfinite(value) for value in found.values())
    assert len(said["tables"]["Runs"]) == 4 + 2 * len(PRESENT)
    for name in PRESENT:
        # one mesh, one energy, exact contact and a stiff penalty: 0.54 N/mm on about 20 nodes, 1000 N/mm per
        # mm, so that 3e-5 mm of 1.5 mm are lost, and the force grows with the power 1.9 of the indentation
        for key in FORCES:
            own = found[f"A.L0.evfem_q1.{key}"]
            assert found[f"A.L0.{name}_q1.{key}"] == pytest.approx(own, rel=2e-4)
        # plain Newton on the same 15 steps; a wrong tangent needs far more
        assert 15 <= found[f"A.L0.{name}_q1.iterations"] <= 75
        assert abs(found[f"A.L0.{name}_q2.error_percent.Fn_at_1.5"]) < 1.0
    # the peers solve the same discrete problem with either element
    assert found.get("A.L0.apart_percent.q2", 0.0) < 1e-5


@pytest.mark.peers
@pytest.mark.parametrize("scene", ["B", "C"])
def test_friction_and_attraction_are_the_same_problem_for_all(scene, tmp_path):
    # several codes, one problem: a stiff penalty (as above), an elastic slip of 2e-5 mm in the first 0.1 mm
    own = problem.quantities(scene, hosts.run_once("evfem", "q1", scene, 0)["history"])
    assert PRESENT
    for name in PRESENT:
        peer = hosts.run_once(name, "q1", scene, 0, tmp_path)
        assert problem.quantities(scene, peer["history"]) == pytest.approx(own, rel=5e-4)
        assert peer["iterations"] <= 5 * len(problem.path(scene))  # C with a wrong sign in its tangent: 81


def test_the_problem_as_a_file(tmp_path):
    problem.write(tmp_path / "c.npz", "C", "q2", 0)
    read = apart.read(str(tmp_path / "c.npz"))
    assert read.order == 2
    assert read.points.shape == (793, 2)
    assert read.cells.shape == (180, 9)
    # E / (2 (1 + nu)) and E nu / ((1 + nu) (1 - 2 nu)) of tissue and skin; ten of twelve layers are tissue
    assert np.unique(read.mu) == pytest.approx([0.05 / 2.96, 1.0 / 2.6])
    assert np.unique(read.lmbda) == pytest.approx([0.05 * 0.48 / (1.48 * 0.04), 0.3 / (1.3 * 0.4)])
    assert np.sum(read.mu < 0.1) == 150
    assert len(read.free_pad) == 59
    # both lengths of Kaczmarek's law by hand, and eps_0 U^2 / 2
    assert read.layers == pytest.approx([0.38 / 1650 + 0.09 / 3.35, 0.47])
    assert read.pull == pytest.approx(8.854e-12 * 1e6 / 2, rel=1e-4)


def test_penalty_contact_by_hand():
    # two nodes at the plane y = 0, 1000 N/mm per mm, friction 0.3: pressed 1e-3 mm deep and moved sideways
    contact = apart.PenaltyContact(np.zeros(2), 0.0, 0.3)
    contact.update(np.array([1e-4, 1e-4]), np.array([-1e-3, 1e-3]))
    assert contact.forces == pytest.approx((1.0, 0.1))  # the first sticks, the second is open
    assert contact.sticking.tolist() == [True, False]
    contact.update(np.array([5e-4, 0.0]), np.array([-1e-3, 1e-3]))
    assert contact.forces == pytest.approx((1.0, 0.3))
    assert contact.sliding.tolist() == [1.0, 0.0]
    contact.keep()
    assert contact.reference == pytest.approx([2e-4, 0.0])  # an open node's spring starts where it is
    # back beyond the limit: it sticks first, and the state says that it is not final
    contact.update(np.array([-5e-4, 0.0]), np.array([-1e-3, 1e-3]))
    assert contact.forces == pytest.approx((1.0, -0.7))
    assert contact.turning.tolist() == [True, False]
    contact.update(np.array([-5e-4, 0.0]), np.array([-1e-3, 1e-3]))
    assert contact.forces == pytest.approx((1.0, -0.3))
    assert not contact.turning.any()


def test_a_failing_run_is_reported_and_the_others_go_on(monkeypatch):
    def run_once(package, element, scene, level, compiled, way):
        if element == "q2":
            return {"failed": "NewtonConvergenceError: no"}
        return dict(run(package, element).measured)

    monkeypatch.setattr(peers, "run_once", run_once)
    who = [one for one in numbers.CONTENDERS if one[0] in ("evfem", "felupe")]
    runs, failed = peers.compete({0: ("A", 2)}, who)
    assert failed == {"A.L0.felupe_q2": "NewtonConvergenceError: no"}
    assert [one.key for one in runs] == ["A.L0.evfem_q1", "A.L0.felupe_q1", "A.L0.evfem_q2p1"]
    line = "| A | L0 | felupe | q2 | not done: NewtonConvergenceError: no | - | - | - | - | - | - |"
    assert shown.tables(runs, failed, {})["Runs"][-1] == line


def test_the_last_words_of_a_process_that_fails():
    assert "element" in hosts.run_once("evfem", "q7", "A", 0)["failed"]


def test_packages_take_turns_and_the_fastest_round_counts(monkeypatch):
    order, seconds = [], iter([3.0, 9.0, 2.0, 8.0, 4.0, 7.0])

    def run_once(*who):
        order.append(who[0])
        return dict(run(*who[:2]).measured) | {"cpu_s": next(seconds)}

    monkeypatch.setattr(peers, "run_once", run_once)
    runs, _ = peers.compete({0: ("A", 3)}, numbers.CONTENDERS[:2])
    assert order == ["evfem", "felupe"] * 3
    assert [(one.measured["cpu_s"], one.measured["slowest_cpu_s"]) for one in runs] == [
        (2.0, 4.0),
        (7.0, 9.0),
    ]


def test_errors_and_ratios_by_hand():
    runs = [
        run("evfem", "q1", cpu=2.0, factor=1.02),
        run("felupe", "q1", cpu=10.0, factor=1.02),
        run("getfem", "q1", cpu=8.0, factor=1.008),
        run("evfem", "q2p1", cpu=4.0, factor=1.002),
        run("felupe", "q2", cpu=30.0, factor=0.998),
    ]
    found = numbers.numbers(runs, {"A.L0.fenicsx_q1": {"cold_cpu_s": 3.0}})
    assert found["A.L0.evfem_q1.error_percent.Fn_at_1.0"] == pytest.approx(2.0)
    assert found["A.L0.felupe_q2.error_percent.Fn_at_0.5"] == pytest.approx(-0.2)
    assert runs[4].error() == pytest.approx(0.2)
    assert found["A.L0.felupe_over_evfem.q1.cpu_s"] == 5.0
    assert found["A.L0.fastest_over_evfem.q1.cpu_s"] == 4.0
    assert found["A.L0.felupe_over_evfem.q2p1.cpu_s"] == 7.5
    assert found["A.L0.apart_percent.q1"] == pytest.approx(100 * 0.012 / (3.048 / 3))
    assert "A.L0.apart_percent.q2" not in found  # one package alone
    assert found["A.L0.fenicsx_q1.cold_cpu_s"] == 3.0
    assert found["A.Fn_to_0.3_percent.felupe_over_evfem.cpu_s"] == 7.5
    assert found["A.Fn_to_1.0_percent.felupe_over_evfem.cpu_s"] == 7.5
    assert found["A.Fn_to_1.0_percent.fastest_over_evfem.cpu_s"] == 2.0
    assert found["A.Fn_to_0.3_percent.fastest_over_evfem.cpu_s"] == 7.5  # GetFEM's runs are not that good
    assert not [key for key in found if "to_0.1_percent" in key]  # nobody is that good
    names = [one.name for one in numbers.series(runs)]
    assert names == ["A evfem q1", "A felupe q1", "A getfem q1", "A evfem q2p1", "A felupe q2"]
    # eleven values, of which the last is 0.1564 instead of 0.1473
    slide = [[1.0, 0.1473, 0.0]] * 44 + [[0.5214, 0.1564, 0.0]]
    found = problem.quantities("B", slide)
    assert found["Ft_mean_2_to_3"] == pytest.approx((10 * 0.1473 + 0.1564) / 11.0, rel=1e-12)
    assert found["Fn_after_3.0"] == 0.5214


def raced(package, element, way, costs, errors):
    """Runs on the levels 0, 1, ...: CPU seconds, and how far off the forces are (%)."""
    found = enumerate(zip(costs, errors, strict=True))
    return [run(package, element, cpu, 1.0 + 0.01 * error, level, way) for level, (cpu, error) in found]


def test_in_the_race_each_has_its_best_number_of_steps():
    """evfem gets to 0.1 % between its levels, at the middle of the logarithms of 1 % and 0.01 %;
    the peer is there on its first level with few steps, and never with many.
    """
    few, given = problem.Way(3, 6, 1e-6), problem.GIVEN
    runs = [
        *raced("evfem", "q2p1", given, (1.0, 4.0), (1.0, 0.01)),
        *raced("evfem", "q2p1", few, (0.25, 1.0), (1.0, 0.01)),
        *raced("getfem", "q2", given, (3.0, 9.0), (2.0, 1.0)),
        *raced("getfem", "q2", few, (5.0,), (0.1,)),
    ]
    found = numbers.race(runs)
    assert found["race.A.15+30_steps.evfem.cpu_s"] == pytest.approx(2.0)
    assert "race.A.15+30_steps.getfem.cpu_s" not in found
    assert found["race.A.best.evfem.cpu_s"] == pytest.approx(0.5)
    assert found["race.A.best.evfem.press_steps"] == 3
    assert found["race.A.best.fastest_over_evfem.cpu_s"] == pytest.approx(10.0)
    # runs with other steps are no part of the comparison on the same nodes
    assert "A.L0.fastest_over_evfem.q2p1.cpu_s" in numbers.numbers(runs, {})
    assert numbers.numbers(runs, {})["A.L0.fastest_over_evfem.q2p1.cpu_s"] == pytest.approx(3.0)


def test_few_steps_end_where_many_do():
    """Without friction nothing depends on the path."""
    many = problem.quantities("A", hosts.run_once("evfem", "q1", "A", 0)["history"])
    few = problem.Way(3, 6, 1e-6)
    found = hosts.run_once("evfem", "q1", "A", 0, way=few)
    assert len(found["history"]) == 3
    assert problem.quantities("A", found["history"], few) == pytest.approx(many, rel=1e-5)
