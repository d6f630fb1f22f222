"""The house stands: a module imports only what stands before it, heavy packages load late, files stay small.

A new file of `evfem/` must be given its place in `ROOMS`.
"""

import ast
import sys
import tomllib
from graphlib import TopologicalSorter
from importlib import import_module
from importlib.util import find_spec, resolve_name
from pathlib import Path

import pytest
from tools.commands import printed

import evfem

PACKAGE = Path(evfem.__file__).parent
TESTS = Path(__file__).parent

#: rooms from the ground up: the packages from outside that they may import, and their files in order
ROOMS = {
    "common": (
        {
            "numpy",
            "scipy",
            "PIL",
            "openpyxl",
            "tqdm",
            "threadpoolctl",
            "pandas",
            "distributed",
            "xarray",
            "pypardiso",
        },
        "constants arrays rooms notices units checks views pools digest storage foreign tables",
    ),
    "mesh": (
        {"numpy", "scipy", "meshio", "netCDF4", "h5py", "vtkmodules"},
        "hexahedron mesh split archive faces solids quality groups places formats.deck formats.abaqus "
        "formats.classic formats.exodus formats.gmsh formats.med formats.medit formats.nastran formats.su2 "
        "formats.vtk formats.xdmf file memory",
    ),
    "tissue": (
        {"numpy", "scipy", "skfem"},
        "forms splitlaw ogden laws kernels.blocks space pattern assembly weakform userforms branches "
        "dynamics body",
    ),
    "finger": (
        {"numpy", "PIL"},
        "outline lattice layers crosssection sizes scan section fingerpad blocks fingerprint solid fingertip",
    ),
    "electrostatics": (
        {"numpy", "scipy"},
        "laws dielectrics breakdown relaxation alternating persson roughness localgaps forces wav "
        "timesignals drive",
    ),
    "circuit": ({"numpy", "scipy", "PIL"}, "signals encoding signalfile load"),
    "field": (
        {"numpy", "scipy", "skfem"},
        "outlines bounds curves fieldmesh poisson rigid columncells columns meanattraction",
    ),
    "surface": (
        {"numpy", "scipy"},
        "ways friction adhesion patches elastic surfaces relief textures usersurface pad skin spread",
    ),
    "contact": ({"numpy", "scipy"}, "below byforce signorini statuses solve follower condensed stability"),
    "terms": (
        {"numpy", "scipy"},
        "traction tractions charging attraction fullfield drivenfield foundation slipping "
        "friction hand sources columns",
    ),
    "newton": (
        {"numpy", "scipy"},
        "strategy state search control condensation interface linearisation pressure anderson travel "
        "factorised equilibrium",
    ),
    "solver": ({"numpy"}, "relaxation hold path stepping linearbody"),
    "scene": (
        {"numpy", "tomli_w"},
        "motion terms electrics keys probes options scene serialiser format schema file spatial",
    ),
    "planning": (
        {"numpy"},
        "rooms resolution loaddrift parts attracted plausibility fieldchoice core timescales cost plan "
        "swings",
    ),
    "simulation": (
        {"numpy", "scipy"},
        "provenance history result spectrum model doubtful works barrier ledger checkpoint run loop",
    ),
    "sweeps": (
        {"numpy", "tomli_w", "tqdm", "pyarrow"},
        "manifest samples keyunits file folder table means run accuracy check accurate",
    ),
    "response": (
        {"numpy", "scipy"},
        "parameters parts tangent differences beside lines sensitivities file uncertainty design impedance "
        "electrical",
    ),
    "calibration": ({"numpy", "scipy", "tomli_w"}, "measured parameters runs confidence result fit"),
    "textures": (
        {"numpy", "scipy", "PIL", "SurfaceTopography"},
        "texture generate library importing scans importers",
    ),
    "estimate": (
        {"numpy", "scipy"},
        "rendering parametric touch pressed sliding correction estimators database estimate display commands",
    ),
    "plotting": (
        {"numpy", "scipy", "matplotlib", "PIL"},
        "labels figures fields meshes solid finger footprint waveform curves sweeps movie response",
    ),
    "reporting": ({"numpy"}, "log watch page"),
    "studio": ({"numpy"}, "state page runs server"),
}
#: modules outside the rooms: below all of them, after one of them, and above all of them
GROUND, MIDDLE, EDGES = (
    ("errors", "protocols", "tensor"),
    {"electrostatics": ("reference",)},
    ("export", "fieldfiles", "runfolder", "loading", "templates", "arguments", "cli", "__main__"),
)
EDGE_PACKAGES = {"numpy", "scipy", "meshio", "matplotlib", "threadpoolctl"}
#: packages beside the rooms; an installed evfem has studies and meshes in its folder
NO_ROOMS = ("data", "meshes", "studies")
#: packages that take long to load
LATE = {"skfem", "meshio", "matplotlib", "PIL", "pypardiso", "tqdm"}
LATE |= {"distributed", "pyarrow", "pandas", "xarray", "SurfaceTopography", "netCDF4", "h5py", "vtkmodules"}
LATE |= {"openpyxl"}
#: compiled from C, without imports
BUILT = {f"evfem.tissue.kernels.{name}" for name in ("loops", "solids", "contact", "cholesky")}
LONGEST_FUNCTION, LONGEST_FILE = 60, 450
#: files of a folder beside its `__init__`, and lines
MOST_FILES, MOST_LINES = 12, 3600


def order():
    """Every module in the order in which it may be imported."""
    names = list(GROUND)
    for room, (_, files) in ROOMS.items():
        names += [f"{room}.{file}" for file in files.split()]
        names += MIDDLE.get(room, ())
    return [*names, *EDGES]


ORDER = order()


def source_of(name):
    return PACKAGE / f"{name.replace('.', '/')}.py"


def modules():
    """Every module but the packages' own files and the data."""
    found = (path.relative_to(PACKAGE).with_suffix("") for path in PACKAGE.rglob("*.py"))
    return sorted(
        ".".join(path.parts) for path in found if path.name != "__init__" and path.parts[0] not in NO_ROOMS
    )


def tree_of(path):
    return ast.parse(path.read_text(encoding="utf-8"), str(path))


def imported(nodes):
    """Full dotted names of what these nodes import; what is given to `import_module` as a string counts."""
    for node in nodes:
        if isinstance(node, ast.ImportFrom) and node.level:
            yield f"evfem.{'.' * node.level}{node.module or ''}"  # no module of that name: in no room
        elif isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif called(node).endswith("import_module"):
            yield from _spelled(node.args[0])


def _spelled(argument):
    """Modules that a string can name: a constant, or one with a hole for the last part."""
    if isinstance(argument, ast.Constant):
        yield argument.value
    elif isinstance(argument, ast.JoinedStr) and isinstance(argument.values[0], ast.Constant):
        prefix = argument.values[0].value
        yield from (f"evfem.{name}" for name in ORDER if f"evfem.{name}".startswith(prefix))


def ours_and_others(name):
    """Modules of the package and packages from outside that a module imports, wherever in the file."""
    found = set(imported(ast.walk(tree_of(source_of(name)))))
    ours = {_module(full) for full in found if full.startswith("evfem.")} - {None}
    others = {full.split(".")[0] for full in found} - {"evfem"} - set(sys.stdlib_module_names)
    return ours, others


def _module(full):
    """The module that a full dotted name lies in: itself, or what it is a name of; None for front doors."""
    parts = full.split(".")[1:]
    for end in range(len(parts), 0, -1):
        if ".".join(parts[:end]) in ORDER:
            return ".".join(parts[:end])
    front = parts[0] in ("__version__", "studies", "data", "") or parts[:-1] == []
    return None if front else full


def test_every_module_has_its_place():
    assert sorted(ORDER) == modules()


def test_every_folder_with_code_is_installed():
    """`packages` is a list by hand: a folder that it lacks is in no wheel."""
    project = tomllib.loads((TESTS.parent / "pyproject.toml").read_text(encoding="utf-8"))
    listed = {name.split(".", 1)[-1] for name in project["tool"]["setuptools"]["packages"]} - {"evfem"}
    folders = (path.parent.relative_to(PACKAGE).parts for path in PACKAGE.rglob("__init__.py"))
    found = {".".join(parts) for parts in folders if parts and parts[0] not in NO_ROOMS}
    for name in ("studies", "meshes"):  # beside the package in a checkout
        inner = (
            path.parent.relative_to(TESTS.parent).parts for path in (TESTS.parent / name).rglob("__init__.py")
        )
        found |= {".".join(parts) for parts in inner}
    assert found == listed - {"data"}


def test_a_module_imports_only_what_stands_before_it():
    edges = []
    for place, name in enumerate(ORDER):
        ours, _ = ours_and_others(name)
        edges += [f"{name} -> {other}" for other in sorted(ours - set(ORDER[:place]) - BUILT)]
    assert not edges


def executed(node):
    """What stands below a node, but for what type checkers alone read."""
    for child in ast.iter_child_nodes(node):
        if not (isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING"):
            yield child
            yield from executed(child)


def test_a_front_door_hands_on_nothing_from_above():
    """`electrostatics.rigid_field`, which the field makes, comes through the door of the package."""
    arrows, rooms = [], list(ROOMS)
    for place, room in enumerate(rooms):
        above = {f"evfem.{name}" for name in rooms[place + 1 :]}
        for path in (PACKAGE / room).rglob("__init__.py"):
            found = {".".join(full.split(".")[:2]) for full in imported(executed(tree_of(path)))}
            arrows += [f"{room} -> {other}" for other in sorted(found & above)]
    assert not arrows


def beside(folder):
    """Modules of `evfem.studies` or `evfem.meshes` but for front doors, with the names that each imports."""
    root, edges = Path(import_module(f"evfem.{folder}").__file__).parent, {}
    for path in sorted(root.rglob("*.py")):
        name = ".".join(("evfem", folder, *path.relative_to(root).with_suffix("").parts))
        nodes = list(ast.walk(tree_of(path)))
        found = {full for full in imported(nodes) if not full.startswith("evfem..")}
        for node in nodes:
            if isinstance(node, ast.ImportFrom) and node.level:
                home = resolve_name("." * node.level + (node.module or ""), name.rpartition(".")[0])
                found |= {f"{home}.{alias.name}" for alias in node.names}
        if path.name != "__init__.py":
            edges[name] = found
    return edges


def test_studies_take_meshes_and_each_other_in_no_circle():
    meshes, studies = beside("meshes"), beside("studies")
    assert "evfem.studies.common" in studies
    back = {name for name, found in meshes.items() if any(one.startswith("evfem.studies") for one in found)}
    assert not back
    known = meshes | studies
    edges = {
        name: {other for other in known if any(f"{one}.".startswith(f"{other}.") for one in found)}
        for name, found in known.items()
    }
    assert "evfem.meshes.benchmark" in edges["evfem.studies.peers.problem"]
    TopologicalSorter(edges).prepare()  # a CycleError names the circle


def test_a_room_uses_only_its_packages():
    beyond = []
    for name in ORDER:
        allowed = ROOMS[name.split(".")[0]][0] if "." in name else EDGE_PACKAGES
        _, others = ours_and_others(name)
        beyond += [f"{name} -> {package}" for package in sorted(others - allowed)]
    assert not beyond


def test_heavy_packages_are_imported_inside_the_function_that_needs_them():
    for name in ORDER:
        late = {full.split(".")[0] for full in imported(tree_of(source_of(name)).body)} & LATE
        assert not late, f"{name} loads {late}"


def test_files_and_functions_stay_short():
    for name in ORDER:
        path = source_of(name)
        lines = len(path.read_text(encoding="utf-8").splitlines())
        assert lines <= LONGEST_FILE, f"{name} has {lines} lines"
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.FunctionDef):
                first = node.body[1] if ast.get_docstring(node) and len(node.body) > 1 else node.body[0]
                length = node.body[-1].end_lineno - first.lineno + 1
                assert length <= LONGEST_FUNCTION, f"{name}: {node.name} has {length} lines"


def folder_sizes():
    """Files and lines of every folder with code, by its name below the package."""
    sizes = {}
    for path in PACKAGE.rglob("*"):
        folder = path.parent.relative_to(PACKAGE).as_posix()
        if path.suffix in (".py", ".pyi", ".c", ".h") and folder.split("/")[0] not in NO_ROOMS:
            files, lines = sizes.get(folder, (0, 0))
            counted = path.suffix != ".pyi" and path.name != "__init__.py"
            sizes[folder] = files + counted, lines + len(path.read_text(encoding="utf-8").splitlines())
    return sizes


def test_folders_stay_small():
    for folder, (files, lines) in folder_sizes().items():
        assert files <= MOST_FILES, f"{folder} has {files} files"
        assert lines <= MOST_LINES, f"{folder} has {lines} lines"


def called(node):
    """Dotted name of what a call calls, as far as it is plain."""
    return ast.unparse(node.func) if isinstance(node, ast.Call) else ""


def test_nothing_is_evaluated_or_unpickled():
    for path in sorted(PACKAGE.rglob("*.py")):
        tree = tree_of(path)
        names = {called(node) for node in ast.walk(tree)}
        assert not names & {"eval", "exec", "os.system", "__import__"}, path
        packages = {full.split(".")[0] for full in imported(ast.walk(tree))}
        assert not packages & {"pickle", "shelve", "dill", "joblib"}, path
        for node in ast.walk(tree):
            if isinstance(node, ast.keyword) and node.arg in ("allow_pickle", "shell"):
                place = f"{path}: {node.arg} in line {node.value.lineno}"
                assert getattr(node.value, "value", True) is False, place


def test_no_test_is_skipped_or_expected_to_fail():
    words = {"skip", "skipif", "xfail", "importorskip"}
    for path in sorted(TESTS.rglob("test_*.py")):
        for node in ast.walk(tree_of(path)):
            assert not (isinstance(node, ast.Attribute) and node.attr in words), f"{path}, line {node.lineno}"


def test_the_laws_load_neither_scikit_fem_nor_matplotlib():
    code = (
        "import evfem as ev\n"
        "layers = ev.Layers.of(ev.Layer(0.09, 3.35))\n"
        "ev.Kaczmarek().traction(0.1, 100.0, layers), ev.StrongTroxel(), ev.eps_0\n"
        "ev.NeoHookean(E=1.0, nu=0.3), ev.Sinusoid(), ev.VoltageProfile([0.0], [1.0])\n"
        "ev.Scene(ev.FingerPad(), ev.Display(), motion=[ev.Press(force=0.1)])\n"
        "heavy = {'skfem', 'matplotlib', 'scipy.optimize', 'scipy.integrate', 'meshio'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    assert printed(code) == "[]"


def test_a_press_loads_no_package_that_it_has_no_use_for(tmp_path):
    """Of scipy a press needs BLAS alone, where nothing is compiled SuperLU; a mesh's file takes meshio."""
    heavy = ["skfem", "tqdm", "matplotlib", "evfem.common.pools", "evfem.response", "evfem.field"]
    heavy += ["scipy.spatial", "scipy.optimize", "pypardiso"]
    heavy += ["scipy.sparse", "scipy.linalg"] if find_spec("evfem.tissue.kernels.cholesky") else []
    code = (
        "import evfem as ev\n"
        "def press(finger):\n"
        "    ev.simulate(ev.Scene(finger, ev.Flat(), motion=[ev.Press(indentation=0.05, steps=1)]))\n"
        f"    print(sorted({{*{heavy!r}}} & sys.modules.keys()), 'meshio' in sys.modules)\n"
        "pad = ev.FingerPad(ridges=False, resolution='coarse')\n"
        "press(pad)\n"
        f"ev.meshfile.write(pad.mesh(), {str(tmp_path / 'pad.vtu')!r})\n"
        f"press(ev.MeshedFinger({str(tmp_path / 'pad.vtu')!r}, pad.materials))"
    )
    assert printed(code).splitlines() == ["[] False", "[] True"]


def test_importing_the_package_loads_nothing_else():
    code = "import evfem\nprint([m for m in sys.modules if m.startswith(('numpy', 'scipy', 'evfem.'))])"
    assert printed(code) == "[]"


def test_public_modules_are_found_by_their_public_names():
    code = (
        "import evfem.plotting, evfem.export\n"
        "import evfem as ev\n"
        "from evfem import export, meshfile, plotting, scenefile\n"
        "assert ev.electrostatics.Kaczmarek is ev.Kaczmarek\n"
        "print(export.__name__, plotting.__name__, meshfile.__name__)"
    )
    assert printed(code) == "evfem.export evfem.plotting evfem.mesh.file"


def test_every_public_name_can_be_loaded_and_is_listed():
    assert sorted(set(evfem.__all__)) == sorted(evfem.__all__)
    for name in evfem.__all__:
        assert getattr(evfem, name) is not None
    assert set(evfem.__all__) <= set(dir(evfem))
    with pytest.raises(AttributeError, match=r"no attribute 'pinger'"):
        evfem.pinger  # noqa: B018
    with pytest.raises(AttributeError, match=r"no attribute 'FingerPd'; did you mean FingerPad\?"):
        evfem.FingerPd  # noqa: B018
