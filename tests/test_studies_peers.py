"""evfem beside FElupe: the quick comparison with and without the peer, and how runs become numbers."""

import importlib
import importlib.util
import json
import types

import numpy as np
import pytest

studies = importlib.import_module("evfem.studies" if importlib.util.find_spec("evfem.studies") else "studies")
peers, problem, run_module = (
    importlib.import_module(f"{studies.__name__}.{name}") for name in ("peers", "peers_problem", "peers_run")
)
INSTALLED = not peers.missing()
FORCES = ("Fn_at_0.5", "Fn_at_1.0", "Fn_at_1.5")


def without_felupe(monkeypatch):
    def found(name):
        return None if name == "felupe" else importlib.util.find_spec(name)

    monkeypatch.setattr(peers, "find_spec", found)


def run(package, element, scene="A", level=0, cpu=1.0, factor=1.0):
    """A run that took `cpu` seconds and found the reference's forces times `factor`."""
    normal = np.full(45 if scene == "B" else 15, 1.0)
    tangential = np.zeros_like(normal)
    reference = problem.REFERENCE[scene]
    for place, depth in ((4, 0.5), (9, 1.0), (14, 1.5)):
        normal[place] = factor * reference[f"Fn_at_{depth}"]
    if scene == "B":
        tangential[15:] = factor * reference["Ft_mean_2_to_3"]
        for place, distance in ((15, 0.1), (19, 0.5), (44, 3.0)):
            tangential[place] = factor * reference[f"Ft_after_{distance}"]
        normal[44] = factor * reference["Fn_after_3.0"]
    history = np.column_stack([normal, tangential, 0 * normal]).tolist()
    cost = dict.fromkeys(peers.MEASURED, cpu) | {"iterations": 10, "factorisations": 5}
    return peers.Run(package, element, scene, level, cost | {"history": history})


def test_quick_comparison_without_the_peer(monkeypatch, tmp_path, capsys):
    without_felupe(monkeypatch)
    result = studies.run("peers", quick=True, out=tmp_path)
    assert "felupe is not installed" in capsys.readouterr().err
    assert result["assumptions"]["missing"] == ["felupe"]
    assert result["assumptions"]["failed"] == {}
    numbers = result["numbers"]
    assert not [key for key in numbers if "felupe" in key]
    # the benchmark's own words: Q1 on L0 is 3.4 % too stiff, quadratic cells are within 0.3 %
    assert numbers["A.L0.evfem_q1.error_percent.Fn_at_1.5"] == pytest.approx(3.4, abs=0.3)
    assert abs(numbers["A.L0.evfem_q2p1.error_percent.Fn_at_1.5"]) < 0.3
    # 15 steps of an exact contact
    assert 15 <= numbers["A.L0.evfem_q1.iterations"] <= 120
    files = sorted(path.name for path in tmp_path.iterdir())
    assert files == ["peers.csv", "peers.json", "peers.md", "peers.png"]
    assert json.loads((tmp_path / "peers.json").read_text()) == json.loads(json.dumps(result))
    assert "Missing: felupe." in (tmp_path / "peers.md").read_text()
    assert (tmp_path / "peers.png").read_bytes().startswith(b"\x89PNG")


def test_quick_comparison_with_what_is_installed(tmp_path):
    result = studies.run("peers", quick=True, out=tmp_path)
    numbers, said = result["numbers"], result["assumptions"]
    assert said["missing"] == ([] if INSTALLED else ["felupe"])
    assert said["failed"] == {}
    assert all(type(value) is float and np.isfinite(value) for value in numbers.values())
    assert ("A.L0.felupe_q1.cpu_s" in numbers) == INSTALLED
    assert len(said["table"]) == (6 if INSTALLED else 4)
    # one mesh, one energy, exact contact and a stiff penalty: 0.54 N/mm on about 20 nodes, 1000 N/mm per mm,
    # so that 3e-5 mm of 1.5 mm are lost, and the force grows with the power 1.9 of the indentation
    peer = {key: numbers.get(f"A.L0.felupe_q1.{key}", numbers[f"A.L0.evfem_q1.{key}"]) for key in FORCES}
    for key, force in peer.items():
        assert force == pytest.approx(numbers[f"A.L0.evfem_q1.{key}"], rel=2e-4)


@pytest.mark.parametrize("scene", ["B", "C"])
def test_friction_and_attraction_are_the_same_problem_for_both(scene):
    # two codes, one problem: a stiff penalty (as above) and an elastic slip of 2e-5 mm in the first 0.1 mm
    peer = peers.run_once("felupe", "q1", scene, 0)
    if not INSTALLED:
        assert "felupe" in peer["failed"]
        return
    theirs, own = (
        problem.quantities(scene, found["history"])
        for found in (peer, peers.run_once("evfem", "q1", scene, 0))
    )
    assert theirs == pytest.approx(own, rel=5e-4)
    assert peer["iterations"] <= 5 * len(problem.path(scene))  # C with a wrong sign in its tangent: 81


def test_a_failing_run_is_reported_and_the_others_go_on(monkeypatch):
    def run_once(package, element, scene, level):
        if element == "q2":
            return {"failed": "NewtonConvergenceError: no"}
        return dict(run(package, element, scene, level).measured)

    monkeypatch.setattr(peers, "run_once", run_once)
    runs, failed = peers.compete({0: ("A", 2)}, peers.CONTENDERS)
    assert failed == {"A.L0.felupe_q2": "NewtonConvergenceError: no"}
    assert [one.key for one in runs] == ["A.L0.evfem_q1", "A.L0.felupe_q1", "A.L0.evfem_q2p1"]


def test_the_last_words_of_a_process_that_fails():
    assert "element" in peers.run_once("evfem", "q7", "A", 0)["failed"]


def test_packages_take_turns_and_the_fastest_round_counts(monkeypatch):
    order, seconds = [], iter([3.0, 9.0, 2.0, 8.0, 4.0, 7.0])

    def run_once(*who):
        order.append(who[0])
        return dict(run(*who).measured) | {"cpu_s": next(seconds)}

    monkeypatch.setattr(peers, "run_once", run_once)
    runs, _ = peers.compete({0: ("A", 3)}, peers.CONTENDERS[:2])
    assert order == ["evfem", "felupe"] * 3
    assert [(one.measured["cpu_s"], one.measured["slowest_cpu_s"]) for one in runs] == [
        (2.0, 4.0),
        (7.0, 9.0),
    ]


def test_errors_and_ratios_by_hand():
    runs = [
        run("evfem", "q1", cpu=2.0, factor=1.02),
        run("felupe", "q1", cpu=10.0, factor=1.02),
        run("evfem", "q2p1", cpu=4.0, factor=1.002),
        run("felupe", "q2", cpu=30.0, factor=0.998),
    ]
    numbers = peers.numbers(runs)
    assert numbers["A.L0.evfem_q1.error_percent.Fn_at_1.0"] == pytest.approx(2.0)
    assert numbers["A.L0.felupe_q2.error_percent.Fn_at_0.5"] == pytest.approx(-0.2)
    assert runs[3].error() == pytest.approx(0.2)
    assert numbers["A.L0.felupe_over_evfem.q1.cpu_s"] == 5.0
    assert numbers["A.L0.felupe_over_evfem.q2p1.cpu_s"] == 7.5
    assert numbers["A.Fn_to_0.3_percent.felupe_over_evfem.cpu_s"] == 7.5
    assert not [key for key in numbers if "to_0.1_percent" in key]  # nobody is that good
    names = [one.name for one in peers.series(runs)]
    assert names == ["A evfem q1", "A felupe q1", "A evfem q2p1", "A felupe q2"]
    # eleven values, of which the last is 0.1564 instead of 0.1473
    slide = run("evfem", "q1", "B").forces
    assert slide["Ft_mean_2_to_3"] == pytest.approx((10 * 0.1473 + 0.1564) / 11.0, rel=1e-12)
    assert slide["Fn_after_3.0"] == 0.5214


def test_cost_of_an_error_between_levels():
    # error falls with the square of the cost: 4 % at 1 s, 0.04 % at 10 s, so 0.4 % at sqrt(10) s
    curve = [(1.0, 4.0), (10.0, 0.04)]
    assert peers.cost_of(0.4, curve) == pytest.approx(10.0**0.5)
    assert peers.cost_of(5.0, curve) == 1.0  # the coarsest level is better than asked for
    assert peers.cost_of(0.01, curve) is None  # nothing is extrapolated
    assert peers.cost_of(0.4, []) is None


def test_path_of_the_bone():
    press, slide = problem.path("A"), problem.path("B")
    assert press.shape == (15, 2)
    assert np.allclose(press[[0, -1]], [[0.0, 0.1], [0.0, 1.5]])
    assert np.allclose(slide[[15, -1]], [[0.1, 1.5], [3.0, 1.5]])


def test_memory_is_that_of_this_process():
    before = run_module.resident_MB()
    block = np.ones(40_000_000)  # 320 MB
    assert block.nbytes / 2**20 > 300
    assert run_module.resident_MB() >= max(before, 300.0)


def test_all_leaves_peers_out(monkeypatch, capsys):
    cli = importlib.import_module("evfem.cli")
    called = []
    fake = types.SimpleNamespace(NAMES=studies.NAMES, run=lambda name, **_: called.append(name))
    monkeypatch.setattr(cli, "_studies", lambda: fake)
    assert cli.main(["study", "all"]) == 0
    assert "peers" in studies.NAMES
    assert called == [name for name in studies.NAMES if name != "peers"]
