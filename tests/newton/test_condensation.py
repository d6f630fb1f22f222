"""Condensing factorisations against dense algebra; both back ends on the same problems."""

from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
from tools.commands import printed

from evfem.common.arrays import mkl_library
from evfem.newton.condensation import Cholesky, Pardiso, Singular, SuperLU
from evfem.tissue.kernels.blocks import sparse_cholesky
from evfem.tissue.pattern import Pattern

#: Cholesky is compiled
WITH_PARDISO = [pytest.param(Pardiso, marks=pytest.mark.pardiso)]
BACK_ENDS = [*WITH_PARDISO, *([Cholesky] if sparse_cholesky() else []), SuperLU]
every_back_end = pytest.mark.parametrize("back_end", BACK_ENDS)
KEPT = np.array([17, 3, 39, 0, 22, 8])  # in no order, first and last unknown among them


@dataclass
class Problem:
    """Cell matrices (E, d, d) on unknowns (E, d) and the same matrix dense."""

    unknowns: np.ndarray
    cells: np.ndarray
    size: int

    @property
    def dense(self):
        A = np.zeros((self.size, self.size))
        for unknowns, cell in zip(self.unknowns, self.cells, strict=True):
            A[np.ix_(unknowns, unknowns)] += cell
        return A

    def condensed(self, kept, b):
        """S and g by dense elimination."""
        A = self.dense
        i = np.setdiff1d(np.arange(self.size), kept)
        X = np.linalg.solve(A[np.ix_(i, i)], np.column_stack([A[np.ix_(i, kept)], b[i]]))
        return A[np.ix_(kept, kept)] - A[np.ix_(kept, i)] @ X[:, :-1], b[kept] - A[np.ix_(kept, i)] @ X[:, -1]


def random_problem(signs=1.0, seed=4, size=40, count=70):
    """Random positive definite cells of five unknowns, each times its sign."""
    rng = np.random.default_rng(seed)
    unknowns = np.array([rng.choice(size, 5, replace=False) for _ in range(count)])
    roots = rng.normal(size=(count, 5, 5))
    return Problem(
        unknowns, np.broadcast_to(signs, (count,))[:, None, None] * (roots @ roots.swapaxes(1, 2)), size
    )


def indefinite_problem():
    """Every fourth cell negative: the interior has eigenvalues of both signs, safely away from zero."""
    problem = random_problem(np.where(np.arange(70) % 4, 1.0, -1.0))
    i = np.setdiff1d(np.arange(40), KEPT)
    values = np.linalg.eigvalsh(problem.dense[np.ix_(i, i)])
    assert values[0] < -0.1 and values[-1] > 0.1 and np.abs(values).min() > 1e-3  # noqa: PT018
    return problem


def compare(factor, problem, kept, rtol):
    """Schur complement, both halves of a solve and the whole of it against dense elimination."""
    b = np.random.default_rng(9).normal(size=problem.size)
    S, g = problem.condensed(kept, b)
    given = b.copy()
    np.testing.assert_allclose(factor.schur, S, atol=rtol * np.abs(S).max())
    state, condensed = factor.forward(b)
    np.testing.assert_allclose(condensed, g, atol=rtol * np.abs(g).max())
    np.testing.assert_array_equal(b, given)
    x = factor.backward(state, np.linalg.solve(S, g))
    exact = np.linalg.solve(problem.dense, b)
    np.testing.assert_allclose(x, exact, atol=rtol * np.abs(exact).max())
    # the second half for kept unknowns that something else decides, as contact does
    state, _ = factor.forward(b)
    forced = np.linspace(-1.0, 2.0, kept.size)
    x = factor.backward(state, forced)
    np.testing.assert_allclose(x[kept], forced, atol=rtol)
    i = np.setdiff1d(np.arange(problem.size), kept)
    np.testing.assert_allclose((problem.dense @ x)[i], b[i], atol=rtol * np.abs(problem.dense).max())


def entries(pattern, cells):
    """Upper triangle from cell matrices."""
    data = pattern.zeros()
    pattern.add(cells, np.arange(len(cells)), data)
    return pattern.finish(data)


@every_back_end
@pytest.mark.parametrize("kept", [KEPT, np.sort(KEPT), KEPT[:1]], ids=["any order", "sorted", "one"])
def test_condensation_equals_dense_elimination(back_end, kept):
    problem = random_problem()
    pattern = Pattern(problem.unknowns, 1)
    factor = back_end(pattern, kept)
    factor.factorise(entries(pattern, problem.cells))
    compare(factor, problem, kept, 1e-12)


@pytest.mark.parametrize("back_end", WITH_PARDISO)
def test_values_of_double_precision_are_not_copied(back_end):
    problem = random_problem()
    pattern = Pattern(problem.unknowns, 1)
    factor, upper = back_end(pattern, KEPT), entries(pattern, problem.cells)
    factor.factorise(upper)
    assert np.shares_memory(factor._values, upper)
    compare(factor, problem, KEPT, 1e-12)


@every_back_end
def test_one_analysis_many_factorisations(back_end):
    """Definite, indefinite and definite again: each answer belongs to the last matrix given."""
    definite, other = random_problem(), indefinite_problem()
    pattern = Pattern(definite.unknowns, 1)
    factor = back_end(pattern, KEPT)
    for scale, problem in ((1.0, definite), (1.0, other), (2.5, definite), (1e-6, other)):
        scaled = Problem(problem.unknowns, scale * problem.cells, problem.size)
        factor.factorise(entries(pattern, scaled.cells))
        compare(factor, scaled, KEPT, 1e-10)


@pytest.mark.parametrize("back_end", BACK_ENDS[:-1])
@pytest.mark.parametrize(("stiff", "real", "rtol"), [(1.0, np.float32, 1e-5), (1e9, np.float64, 1e-7)])
def test_single_precision_is_taken_where_it_moves_the_interior_alike(back_end, stiff, real, rtol):
    """A stiff chain on soft springs to the kept unknowns: as a whole it moves by what its pivots cancel, of
    1e9 all seven digits, and in double precision all but seven.
    """
    inner = np.setdiff1d(np.arange(40), KEPT)
    chain, springs = np.stack([inner[:-1], inner[1:]], axis=1), np.stack([inner, np.resize(KEPT, 34)], axis=1)
    cells = [stiff * np.array([[1.0, -1.0], [-1.0, 1.0]])] * 33 + [np.array([[2.0, 1.0], [1.0, 2.0]])] * 34
    soft = Problem(np.concatenate([chain, springs]), np.array(cells), 40)
    pattern = Pattern(soft.unknowns, 1)
    factor = back_end(pattern, KEPT, single=True)
    factor.factorise(entries(pattern, soft.cells))
    assert factor.real is factor.schur.dtype.type is real
    compare(factor, soft, KEPT, rtol)


@every_back_end
@pytest.mark.parametrize("case", ["rigid", "empty", "nan"])
def test_singular_interior_is_reported_and_survived(back_end, case):
    """An interior without an answer raises, and the next good matrix is factorised as if nothing had been."""
    unknowns = np.array([[0, 1, 2], [2, 3, 4]])
    cell = {
        "rigid": np.array([[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        "empty": np.zeros((3, 3)),
        "nan": np.full((3, 3), np.nan),
    }[case]
    pattern = Pattern(unknowns, 1)
    factor = back_end(pattern, np.array([4, 3]))
    with pytest.raises(Singular):
        factor.factorise(entries(pattern, np.array([cell, np.eye(3)])))
    good = Problem(unknowns, np.array([np.eye(3) + 1.0, 2.0 * np.eye(3) - 0.5]), 5)
    factor.factorise(entries(pattern, good.cells))
    compare(factor, good, np.array([4, 3]), 1e-12)


@every_back_end
def test_zero_pivots_give_no_wrong_answer(back_end):
    """Zeros on the interior's diagonal need pivots from elsewhere: the right answer or `Singular`."""
    unknowns = np.array([[0, 1, 4], [2, 3, 5], [1, 2, 4], [0, 3, 5]])
    cells = np.zeros((4, 3, 3))
    cells[0] = [[0.0, 1.0, 0.5], [1.0, 0.0, 3.0], [0.5, 3.0, 9.0]]
    cells[1] = [[0.0, 2.0, 0.2], [2.0, 0.0, 7.0], [0.2, 7.0, 8.0]]
    cells[2, 0, 1] = cells[2, 1, 0] = 0.3
    cells[3, 0, 1] = cells[3, 1, 0] = 0.1
    problem, kept = Problem(unknowns, cells, 6), np.array([5, 4])
    pattern = Pattern(unknowns, 1)
    factor = back_end(pattern, kept)
    try:
        factor.factorise(entries(pattern, cells))
    except Singular:
        return
    compare(factor, problem, kept, 1e-10)


def test_the_library_is_the_first_runtime_that_is_there(monkeypatch, tmp_path):
    """Of the files that a package lists: no import library, nothing that is not on the disk."""
    listed = ["mkl/mkl_rt.h.txt", "lib/libmkl_core.so.2", "lib/mkl_rt.lib", "lib/mkl_rt.2.lib"]
    listed += ["lib/libmkl_rt.so.9", "lib/libmkl_rt.so.2", "lib/libmkl_rt.so"]
    for name in listed[1:4] + listed[5:]:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"")
    files = [metadata.PackagePath(name) for name in listed]
    for file in files:
        file.dist = metadata.PathDistribution(tmp_path / "mkl-1.0.dist-info")
    monkeypatch.setattr(metadata, "files", lambda package: {"mkl": files}[package])
    assert mkl_library() == str(tmp_path / "lib/libmkl_rt.so.2")
    monkeypatch.setattr(metadata, "files", lambda package: None)  # installed without a list of files
    assert mkl_library() is None

    def missing(package):
        raise metadata.PackageNotFoundError(package)

    monkeypatch.setattr(metadata, "files", missing)
    assert mkl_library() is None


def test_the_library_of_this_installation_is_found_where_its_package_is():
    installed = any(True for _ in metadata.distributions(name="mkl"))
    place = mkl_library()
    assert (place is not None) == installed
    assert place is None or Path(place).is_file()


#: a factorisation is collected while numpy's error state is set back, in a context that holds other
#: variables too, as those of pytest and Jupyter do
COLLECTED = """
import contextvars, gc
import numpy as np
from evfem.newton.condensation import Pardiso
from evfem.tissue.kernels.blocks import sparse_cholesky
from evfem.tissue.pattern import Pattern

others = [contextvars.ContextVar(str(k)) for k in range(3)]
for other in others:
    other.set(0)
pattern = Pattern(np.arange(4)[None], 1)
upper = np.zeros(pattern.indices.size)
upper[pattern.diagonal] = 2.0
for allocations in range(30):
    gc.set_threshold(10**6)
    factor = Pardiso(pattern, np.array([3]))
    factor.factorise(upper)
    factor.itself = factor
    errors = np.errstate(invalid="ignore")
    errors.__enter__()
    del factor
    gc.set_threshold(allocations)
    errors.__exit__(None, None, None)
    gc.set_threshold(10**6)
    others_in_its_memory = [[allocations] * 5 for k in range(9)]
    np.isfinite(np.ones(4))
"""


@every_back_end
def test_a_factorisation_may_be_collected_while_numpy_changes_its_error_state(back_end):
    """CPython keeps a context variable that is read just then after it is freed."""
    assert printed(COLLECTED.replace("Pardiso", back_end.__name__)) == ""


@pytest.mark.parametrize("back_end", WITH_PARDISO)
def test_a_call_to_the_library_asks_nothing_in_python(back_end):
    """What is interrupted while ctypes asks for an argument ends as an error of ctypes."""
    called = []
    pattern = Pattern(np.arange(4)[None], 1)
    factor = back_end(pattern, np.array([3]))
    library = factor._call_pardiso
    factor._call_pardiso = lambda *given: called.append(given) or library(*given)
    upper = np.zeros(pattern.indices.size)
    upper[pattern.diagonal] = 2.0
    factor.factorise(upper)
    factor.forward(np.ones(4))
    assert len(called) == 3
    for given in called:
        assert not [one for one in given if hasattr(one, "_as_parameter_")]
        assert {type(one) for one in given[6:7] + given[13:15]} == {int}


def test_where_all_unknowns_are_kept_memory_that_nobody_wrote_is_not_read():
    """PARDISO ends the process, if its memory is not 0 by chance."""
    program = """
import numpy as np
from evfem.newton.condensation import make_condensation
from evfem.tissue.kernels.blocks import sparse_cholesky
from evfem.tissue.pattern import Pattern

pattern = Pattern(np.arange(6)[None], 2)
upper = np.zeros(pattern.indices.size)
upper[pattern.diagonal] = 2.0
factor = make_condensation(pattern, np.arange(12))
factor.factorise(upper)
assert np.allclose(factor.schur, 2.0 * np.eye(12))
"""
    assert printed(program, MALLOC_PERTURB_="165") == ""
