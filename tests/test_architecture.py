"""The floors hold: a module imports only what stands above it, heavy packages load late, files stay small.

A new file of `evfem/` must be given its place in `FLOORS`.
"""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import evfem

PACKAGE = Path(evfem.__file__).parent
TESTS = Path(__file__).parent

#: floor -> what it may import from outside the standard library, and its modules from the top down
FLOORS = {
    "words and algebra": (
        {"numpy", "tqdm"},
        "errors protocols notices views tensor checks values digest storage tables",
    ),
    "laws": (
        {"numpy", "scipy"},
        "moduli splitlaw ogden materials electrostatics forces encoding surfaces ownsurface friction signals "
        "hjif signalfile reference",
    ),
    "discretisation": (
        {"numpy", "scipy", "skfem", "meshio", "numba", "pypardiso"},
        "mesh quality meshcheck meshparts vturead mshread meshioread meshfile outline lattice section "
        "fingerpad lanes kernels viscous assembly forms pad contactedge attraction contact condensed "
        "linear dynamics body strategy state mixing pins interface linearisation findings newton "
        "condensedpad keptcontact padstep",
    ),
    "scenes": (
        {"numpy", "pydantic", "tomli_w", "tqdm", "threadpoolctl"},
        "motion scene scenekeys scenefile result samples sweepfile resolution plan stepping "
        "model ledger resuming simulate rendering training reduced",
    ),
    "edges": (
        {"numpy", "meshio", "matplotlib", "tqdm", "threadpoolctl", "distributed", "pyarrow"},
        "export plotting report runfolder sweepfolder pools sweep cli",
    ),
}
ORDER = [name for _, names in FLOORS.values() for name in names.split()]
#: packages that take long to load, and the modules that are themselves loaded only when they are there
LATE = {"skfem", "meshio", "matplotlib", "numba", "pypardiso", "tqdm", "distributed", "pyarrow"}
COMPILED = {"lanes", "kernels", "viscous"}
LONGEST_FUNCTION, LONGEST_FILE = 60, 450


def modules():
    return sorted(path.stem for path in PACKAGE.glob("*.py") if path.stem != "__init__")


def tree_of(path):
    return ast.parse(path.read_text(encoding="utf-8"), str(path))


def imported(nodes):
    """Full dotted names of what these syntax nodes import, `from evfem import a` as evfem.a."""
    for node in nodes:
        if isinstance(node, ast.ImportFrom) and node.level:
            yield f"evfem.{'.' * node.level}{node.module or ''}"  # no module of that name: on no floor
        elif isinstance(node, ast.ImportFrom):
            names = [alias.name for alias in node.names] if node.module == "evfem" else [None]
            yield from (f"evfem.{name}" if name else str(node.module) for name in names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def ours_and_others(name):
    """Modules of the package and packages from outside that a module imports, wherever in the file."""
    found = set(imported(ast.walk(tree_of(PACKAGE / f"{name}.py"))))
    ours = {full.split(".")[1] for full in found if full.startswith("evfem.")}
    others = {full.split(".")[0] for full in found} - {"evfem"} - set(sys.stdlib_module_names)
    return ours, others


def test_every_module_has_its_place():
    assert sorted(ORDER) == modules()


@pytest.mark.parametrize("name", modules())
def test_a_module_imports_only_what_stands_above_it(name):
    above = ORDER[: ORDER.index(name)]
    ours, _ = ours_and_others(name)
    assert ours <= {*above, "__version__"}, f"{name} imports {sorted(ours - set(above))} from below"


@pytest.mark.parametrize("name", modules())
def test_a_floor_uses_only_its_packages(name):
    (allowed,) = [packages for packages, names in FLOORS.values() if name in names.split()]
    _, others = ours_and_others(name)
    assert others <= allowed


@pytest.mark.parametrize("name", [name for name in modules() if name not in COMPILED])
def test_heavy_packages_are_imported_inside_the_function_that_needs_them(name):
    late = {full.split(".")[0] for full in imported(tree_of(PACKAGE / f"{name}.py").body)} & LATE
    assert not late


@pytest.mark.parametrize("path", sorted(PACKAGE.glob("*.py")), ids=lambda path: path.stem)
def test_files_and_functions_stay_short(path):
    lines = len(path.read_text(encoding="utf-8").splitlines())
    assert lines <= LONGEST_FILE, f"{path.name} has {lines} lines"
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.FunctionDef):
            first = node.body[1] if ast.get_docstring(node) and len(node.body) > 1 else node.body[0]
            length = node.body[-1].end_lineno - first.lineno + 1
            assert length <= LONGEST_FUNCTION, f"{path.name}: {node.name} has {length} lines"


def called(node):
    """Dotted name of what a call calls, as far as it is plain."""
    return ast.unparse(node.func) if isinstance(node, ast.Call) else ""


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: path.stem)
def test_nothing_is_evaluated_or_unpickled(path):
    tree = tree_of(path)
    names = {called(node) for node in ast.walk(tree)}
    assert not names & {"eval", "exec", "os.system", "__import__"}
    assert not {full.split(".")[0] for full in imported(ast.walk(tree))} & {
        "pickle",
        "shelve",
        "dill",
        "joblib",
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.keyword) and node.arg in ("allow_pickle", "shell"):
            assert getattr(node.value, "value", True) is False, f"{node.arg} in line {node.value.lineno}"


@pytest.mark.parametrize("path", sorted(TESTS.glob("test_*.py")), ids=lambda path: path.stem)
def test_no_test_is_skipped_or_expected_to_fail(path):
    words = {"skip", "skipif", "xfail", "importorskip"}
    for node in ast.walk(tree_of(path)):
        assert not (isinstance(node, ast.Attribute) and node.attr in words), f"line {node.lineno}"


def fresh_process(code):
    """What a new interpreter prints that finds the same packages."""
    words = [sys.executable, "-c", f"import sys\nsys.path[:0] = {sys.path!r}\n{code}"]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_the_laws_load_neither_scikit_fem_nor_matplotlib():
    code = (
        "import evfem as ev\n"
        "layers = ev.Layers.of(ev.Layer(0.09, 3.35))\n"
        "ev.Kaczmarek().traction(0.1, 100.0, layers), ev.StrongTroxel(), ev.eps_0\n"
        "ev.NeoHookean(E=1.0, nu=0.3), ev.Sinusoid(), ev.VoltageProfile([0.0], [1.0])\n"
        "ev.Scene(ev.FingerPad(), ev.Display(), motion=[ev.Press(force=0.1)])\n"
        "heavy = {'skfem', 'matplotlib', 'scipy.optimize', 'scipy.integrate', 'meshio', 'pydantic'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    assert fresh_process(code) == "[]"


def test_importing_the_package_loads_nothing_else():
    code = "import evfem\nprint([m for m in sys.modules if m.startswith(('numpy', 'scipy', 'evfem.'))])"
    assert fresh_process(code) == "[]"


def test_functions_keep_their_names_beside_modules_of_the_same_name():
    code = (
        "import evfem.simulate, evfem.plan\n"
        "import evfem as ev\n"
        "from evfem.simulate import simulate\n"
        "assert ev.simulate is simulate and callable(ev.plan) and callable(ev.simulate)\n"
        "from evfem import export, plotting\n"
        "print(export.__name__, plotting.__name__, ev.reference.__name__)"
    )
    assert fresh_process(code) == "evfem.export evfem.plotting evfem.reference"


def test_every_public_name_can_be_loaded_and_is_listed():
    assert sorted(set(evfem.__all__)) == sorted(evfem.__all__)
    for name in evfem.__all__:
        assert getattr(evfem, name) is not None
    assert set(evfem.__all__) <= set(dir(evfem))
    with pytest.raises(AttributeError, match="no attribute 'finger'"):
        evfem.finger  # noqa: B018
