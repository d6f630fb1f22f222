"""Hostile input: damaged files of every format, and files made to take all memory or time, get a sentence."""

import io
import json
import struct
import tracemalloc
import warnings
import zipfile
from contextlib import contextmanager, suppress
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image as Picture
from scipy.io import savemat
from tools import hostile
from tools.commands import called, contents
from tools.fakes import fake_result
from tools.meshes import square_mesh
from tools.refusals import refuses

import evfem as ev
from evfem.common import foreign, tables
from evfem.mesh import file as meshfile
from evfem.mesh.mesh import Mesh
from evfem.mesh.quality import check
from evfem.scene.file import load, loads
from evfem.studio import page

#: damaged files of a format in the default tests; in the slow ones `--damaged`, drawn by `--hypothesis-seed`
FEW = 30
SCENE = "version = 1\n[surface]\nkind = 'flat'\n[[motion]]\nkind = 'press'\nforce = 0.05\n"


@pytest.mark.parametrize("more", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", hostile.FORMATS)
def test_damaged_files_are_read_or_refused_with_one_sentence(kind, more, pytestconfig):
    statuses = set()

    @settings(
        max_examples=pytestconfig.getoption("damaged") if more else FEW,
        deadline=60_000,
        derandomize=pytestconfig.getoption("hypothesis_seed") is None,
        database=None,
        suppress_health_check=HealthCheck,
    )
    @given(st.randoms(use_true_random=False))
    def check(rng):
        with TemporaryDirectory() as name:
            folder = Path(name)
            words = hostile.damaged(kind, folder, rng)
            before = contents(folder)
            status, error = loaded(folder / words[1]) if words[0] == "load" else called(folder, *words)[::2]
            statuses.add(status)
            assert status in (0, 2, 3), error
            assert not (folder / "owned").exists()  # a pickled object would have made it
            assert "Traceback" not in error
            assert "Warning" not in error
            if status == 2:
                assert error.count("\n") == 1
                assert len(error) < 2000
                assert contents(folder) == before

    check()
    assert 2 in statuses


def loaded(path):
    """Exit status and message that loading a file would give."""
    try:
        ev.load(path)
    except ev.InputError as error:
        return 2, f"{error}\n"
    return 0, ""


@contextmanager
def little_memory(megabytes):
    """Fails when the block needs more than that."""
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < megabytes * 2**20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("text", "key"),
    [
        (SCENE + "steps = 1000000000\n", r"motion\[0\].steps"),
        (SCENE + "steps = 0x" + "f" * 100_000 + "\n", r"motion\[0\].steps"),
        (SCENE.replace("0.05", "9" * 4000), r"motion\[0\].force"),
        (SCENE + "steps = 600000\n" + SCENE[SCENE.index("[[m") :] + "steps = 600000\n", "1200000 steps in"),
        (SCENE.replace("force", "f" * 10**6), "an unknown key"),
        (SCENE.replace("'press'", "'" + "p" * 10**6 + "'"), r"motion\[0\].kind"),
        (SCENE.replace("'press'", '"two\\nlines"'), r'given "two\\nlines"'),
        (SCENE.replace("'flat'", "'profile'\nfile = \"a\\u0000b\""), "surface.file"),
        (SCENE.replace("'flat'", "'profile'\nfile = '" + "long/" * 2000 + "'"), "surface.file"),
        (SCENE + "[finger" + ".a" * 3000 + "]\n", "finger"),
        (SCENE + "[finger]\nwidth = " + "[" * 2000 + "]" * 2000, "finger.width|TOML"),
        (SCENE + "[finger.materials.dermis]\nlaw = 'neo_hookean'\nE = 0x" + "f" * 9999 + "\nnu = 0.3", "E"),
    ],
)
def test_scenes_beyond_the_limits_are_one_short_line(text, key):
    with little_memory(60), pytest.raises(ev.InputError, match=key) as caught:
        loads(text)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 1500


def test_files_beyond_the_limits_are_not_read(tmp_path):
    scene, table = tmp_path / "scene.toml", tmp_path / "scan.csv"
    with open(scene, "wb") as file:
        file.truncate(5 * 2**20)
    with little_memory(2), pytest.raises(ev.InputError, match="at most 4 MB"):
        load(scene)
    with open(table, "wb") as file:
        file.truncate(100 * 2**20)
    scene.write_text(SCENE.replace("'flat'", "'profile'\nfile = 'scan.csv'"))
    with little_memory(2), pytest.raises(ev.InputError, match="at most 64 MB"):
        load(scene)
    mesh = SCENE + "[finger]\nmesh = 'm.vtu'\n[finger.materials.a]\nlaw = 'neo_hookean'\nE = 1.0\nnu = 0.3\n"
    scene.write_text(mesh)
    with open(tmp_path / "m.vtu", "wb") as file:
        file.truncate(200 * 2**20)
    with little_memory(2), pytest.raises(ev.InputError, match="at most 128 MB"):
        load(scene)
    with little_memory(2), pytest.raises(ev.InputError, match="more than 128 MB"):
        meshfile.read(tmp_path / "m.vtu")


def test_rows_beyond_the_limit_are_refused(tmp_path, monkeypatch):
    assert tables.MOST_ROWS == 1_000_000
    monkeypatch.setattr(tables, "MOST_ROWS", 1000)
    path = tmp_path / "signal.csv"
    path.write_text("position,voltage\n" + "0,1\n" * 1000)
    assert len(ev.VoltageProfile.from_csv(path).position) == 1000
    path.write_text("position,voltage\n" + "0,1\n" * 1001 + "not reached\n")
    refuses("at most 1000 rows", ev.VoltageProfile.from_csv, path)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: ev.Sinusoid(terms=[[0.1, 1.0, 0.0]] * 1001), "1000 rows"),
        (lambda: ev.Sinusoid(terms=[[1e300, 1.0, 0.0]]), "within 1e3 mm"),
        (lambda: ev.Sinusoid(terms=[[0.1, [1.0, 2.0], 0.0]]), "surface.terms: given"),
        (lambda: ev.Flat(friction=1e300), "0 to 100"),
        (lambda: ev.Flat(friction=10**400), "0 to 100"),
        (lambda: ev.Flat(friction=[[0.0, 0.1]] * 10_001), "10000 rows"),
        (lambda: ev.Flat(y=1e300), "within 1e3 mm"),
        (lambda: ev.Profile([0.0, 1e-12], [0.0, 1.0]), "1e-09 mm apart"),
        (lambda: ev.Profile([0.0, 1.0], [0.0, 1e300]), "within 1000 mm"),
        (lambda: ev.Profile(np.arange(1_000_002.0), np.zeros(1_000_002)), "at most 1000000"),
        (lambda: ev.VoltageProfile([0.0, 1.0], [0.0, 1e300]), "within 1e[+]06 V"),
        (lambda: ev.VoltageProfile(np.zeros(1_000_002), np.zeros(1_000_002)), "at most 1000000"),
    ],
)
def test_numbers_beyond_the_limits_are_refused(make, words):
    refuses(words, make)


def test_heights_next_to_nothing_make_a_level_profile():
    profile = ev.Profile([0.0, 1.0, 2.0, 3.0], [0.0, 5e-324, 1.0, 1.0])
    assert np.isfinite(profile.slope(np.linspace(0.0, 3.0, 31))).all()
    assert profile.height(1.0) == 5e-324


LAUGHS = '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;">]><a>&b;</a>'
MSH = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n1 0 0 0\n$EndNodes\n$Elements\n{}\n$EndElements\n"
HOSTILE = {
    "entities.vtu": (LAUGHS.encode(), "document type"),
    "utf-16.vtu": (LAUGHS.encode("utf-16"), "document type"),
    "nodes.msh": (MSH.format(10**12, "1\n1 15 2 1 1 1"), "declares more nodes"),
    "elements.msh": (MSH.format(1, f"{10**12}\n1 15 2 1 1 1"), "declares more nodes"),
    "nodes.vtk": (
        b"# vtk DataFile Version 4.2\nx\nBINARY\nDATASET POLYDATA\nPOINTS 100000000 double\n",
        "declares",
    ),
    "tag.msh": (MSH.format(1, f"1\n1 15 2 1 1 {2**62}"), "out of bounds|too large"),
    "absent.msh": (MSH.format("2\n3 1 0 0", "1\n1 1 2 1 1 1 2"), "nodes that do not exist"),
    "none.msh": (MSH.format(0, "0"), "."),
    "cut.msh": (
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n1 0 0 0\n1 0 0 0 0\n"
        "$Nodes\n1 1 1 1\n2 1 0 1\n1\n0 0 0\n$EndNodes\n",
        r"cut\.msh \(\$Entities not closed by \$EndEntities\.",
    ),
    "words.msh": (MSH.replace("0 0 0", "0 0 x").format(1, "1\n1 15 2 1 1 1"), "could not be read|reshape"),
}


def of_hdf5(path):
    """The arrays `points` and `cells` of 100 million rows, of which nothing was written."""
    import h5py

    with h5py.File(path, "w") as file:
        file.create_dataset("points", (10**8, 2), "f8", chunks=(10**6, 2))
        file.create_dataset("ENS_MAA/m/MAI/QU4/NOD", (4 * 10**8,), "i4", chunks=(10**6,))


def of_xdmf(path):
    of_hdf5(path.parent / "heavy.h5")
    item = '<DataItem Dimensions="100000000 2" Format="HDF">heavy.h5:/points</DataItem>'
    body = f'<Grid GridType="Uniform"><Geometry GeometryType="XY">{item}</Geometry></Grid>'
    path.write_text(f"<Xdmf><Domain>{body}</Domain></Xdmf>")


def of_netcdf(path):
    import netCDF4

    with netCDF4.Dataset(path, "w") as file:
        file.createDimension("num_nodes", 10**8)
        for axis in "xy":
            file.createVariable(f"coord{axis}", "f8", ("num_nodes",), chunksizes=(10**6,))


@pytest.mark.parametrize(("name", "make"), [("a.med", of_hdf5), ("a.xdmf", of_xdmf), ("a.e", of_netcdf)])
def test_arrays_that_nobody_wrote_are_not_read(name, make, tmp_path):
    """HDF5 and netCDF take room for chunks that are written alone, and fill the others when they are read."""
    make(tmp_path / name)
    assert sum(path.stat().st_size for path in tmp_path.iterdir()) < 50_000
    with little_memory(20):
        refuses(r"declares (1.6|3.2) GB of numbers", meshfile.read, tmp_path / name)


@pytest.mark.parametrize("at", [12, 16])
def test_counts_in_the_header_of_a_mesh_are_compared_with_its_length(at, tmp_path):
    """netCDF took 5 GB and 20 s for dimensions that a file of 3 kB declares, or for the name of the first."""
    content = bytearray((hostile.WRITTEN / "exodus_quad9.exo").read_bytes())
    content[at : at + 4] = (2**27).to_bytes(4, "big")
    (tmp_path / "a.exo").write_bytes(content)
    refuses(r"a\.exo \(it declares more than it has bytes\)", meshfile.read, tmp_path / "a.exo")


def of_matlab(path):
    savemat(path, {"x": np.zeros(2 * 10**5), "height": np.zeros(2 * 10**5)}, do_compression=True)


def of_excel(path):
    from openpyxl import Workbook

    book = Workbook()
    book.active.append(["x", "height"])
    for k in range(300):
        book.active.append([k, " " * 10_000])
    book.save(path)


@pytest.mark.parametrize(
    ("name", "make", "megabytes"),
    [("a.mat", of_matlab, 10), pytest.param("a.xlsx", of_excel, 2, marks=pytest.mark.others)],
)
def test_tables_longer_than_what_is_read_of_them_are_not_read(name, make, megabytes, tmp_path, monkeypatch):
    """scipy inflates 128 kB of a variable to see its shape."""
    make(tmp_path / name)
    table = tables.csv_rows(tmp_path / name, "file", "a table")
    assert len(table) > 300
    monkeypatch.setattr(foreign, "MOST_DECLARED", 3 * 10**6)
    with little_memory(megabytes):
        refuses(
            "declares 0.003.* GB of numbers or texts", tables.csv_rows, tmp_path / name, "file", "a table"
        )


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_meshes_get_a_sentence(name, tmp_path):
    content, words = HOSTILE[name]
    (tmp_path / name).write_bytes(content.encode() if isinstance(content, str) else content)
    caught = refuses(words, meshfile.read, tmp_path / name, {"a": 0})
    assert caught.key == "finger.mesh"
    assert "\n" not in str(caught)


@pytest.mark.parametrize("regions", [None, {"a": 0}, {"a" * 5000: "b" * 5000}])
def test_names_of_groups_are_cut_in_messages(regions, tmp_path):
    text = (hostile.WRITTEN / "gmsh_quad9.inp").read_text().replace("tissue", "f" * 5000)
    (tmp_path / "a.inp").write_text(text)
    assert (
        len(str(refuses("same cells|groups that occur", meshfile.read, tmp_path / "a.inp", regions))) < 1000
    )


def test_what_meshio_says_is_not_searched_for_words_to_colour(tmp_path, monkeypatch):
    """Rich's patterns take time of the message's length squared."""
    path = tmp_path / "open.msh"
    path.write_text(MSH.format(1, "1\n1 15 2 1 1 1") + "$Comments\nnever closed\n")
    searched = []
    monkeypatch.setattr(
        "rich.highlighter.ReprHighlighter.highlight", lambda self, text: searched.append(text)
    )
    refuses(".", meshfile.read, path, {"a": 0})
    assert not searched


def test_many_nodes_in_one_place_are_found_without_looking_at_all_pairs():
    n = 60_000
    points = np.zeros((n, 2))
    points[1] = 10.0, 0.0
    points[2] = 0.0, 10.0
    cells = np.column_stack([np.zeros(n - 2, int), np.ones(n - 2, int), np.arange(2, n)])
    mesh = Mesh(points, cells, "triangle", np.zeros(n - 2, int), {"a": 0}, {})
    with little_memory(60), pytest.raises(ev.InputError, match="nodes at the same position"):
        check(mesh)


def test_an_outline_of_many_short_and_many_long_edges_is_refused():
    n = 6000  # a fan of needles: edges as long as the finger beside each other
    angle = np.linspace(0.0, 1.0, n)
    rim = 10.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    rim[1::2] *= 0.5
    points = np.vstack([[0.0, 0.0], rim])
    cells = np.column_stack([np.zeros(n - 1, int), np.arange(1, n), np.arange(2, n + 1)])
    sets = {"pad": np.array([1, 2]), "bone": np.array([0, n])}
    mesh = Mesh(points, cells, "triangle", np.zeros(n - 1, int), {"a": 0}, sets)
    with little_memory(1500), pytest.raises(ev.InputError, match="too close for their lengths"):
        check(mesh)


def archive(path, members, compression=zipfile.ZIP_STORED):
    with zipfile.ZipFile(path, "w", compression) as file:
        for name, content in members.items():
            file.writestr(name, content)


def npy(array):
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def header(shape, descr="<f8"):
    text = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


FORM = npy(np.array(ev.result.RESULT_FORMAT))
ARCHIVES = {
    "huge shape": {"a.npy": header("(1000000000000,)") + bytes(8)},
    "huge product": {"a.npy": header("(4294967296, 4294967296)") + bytes(8)},
    "huge text": {"a.npy": header("()", "<U999999999") + bytes(8)},
    "objects": {"a.npy": npy(hostile.objects())},
    "records": {"a.npy": npy(np.zeros(2, dtype=[("a", "f8"), ("b", "i4")]))},
    "times": {"a.npy": npy(np.zeros(2, dtype="M8[s]"))},
    "code": {"a.npy": header("__import__('os').system('touch owned')")},
    "too long": {"a.npy": npy(np.zeros(3)) + bytes(8)},
    "no array": {"a.npy": b"mine"},
    "many members": {f"{k}.npy": b"" for k in range(10_001)},
}


@pytest.mark.parametrize("case", ARCHIVES)
def test_archives_made_to_take_memory_or_to_run_code_get_a_sentence(case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    archive("run.npz", {"format.npy": FORM} | ARCHIVES[case])
    with little_memory(60), pytest.raises(ev.InputError, match="cut off or of another kind"):
        ev.result.load("run.npz")
    assert [path.name for path in tmp_path.iterdir()] == ["run.npz"]


def test_compressed_archives_are_refused_before_they_are_inflated(tmp_path):
    archive(tmp_path / "run.npz", {"format.npy": FORM, "a.npy": npy(np.zeros(10**7))}, zipfile.ZIP_DEFLATED)
    with little_memory(5), pytest.raises(ev.InputError, match="another kind"):
        ev.result.load(tmp_path / "run.npz")


def test_an_archive_keeps_its_order_of_bytes_and_of_axes(tmp_path):
    fake_result().save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz") as file:
        arrays = {name: file[name] for name in file.files}
    arrays["mesh/points"] = np.asfortranarray(arrays["mesh/points"]).astype(">f8")
    with open(tmp_path / "other.npz", "wb") as file:
        np.savez(file, **arrays)
    read = ev.result.load(tmp_path / "other.npz")
    np.testing.assert_array_equal(read.mesh.points, square_mesh().points)
    assert read.mesh.points.dtype == float


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("mesh/cells", np.full((4, 4), 99)),
        ("mesh/cells", np.zeros((4, 3), int)),
        ("mesh/cells", np.zeros((4, 4))),
        ("mesh/points", np.zeros(9)),
        ("mesh/points", None),
        ("mesh/region", np.zeros(3, int)),
        ("mesh/region_names", np.array("[1]")),
        ("mesh/region_names", np.array("[" * 99_999)),
        ("mesh/set/pad", np.array([-1])),
        ("history/motion", np.zeros(4)),
        ("history/voltage", np.array(["a"] * 4)),
        ("history/voltage", np.zeros((4, 1))),
        ("provenance", np.array("[]")),
        ("provenance", np.array('{"versions": []}')),
        ("provenance", np.array('{"scene": {"depth": "5"}}')),
        ("provenance", np.array('{"parameters": "\\ud800"}')),
        ("frames/gap", np.zeros(3)),
        ("format", np.array([ev.result.RESULT_FORMAT])),
    ],
)
def test_results_whose_arrays_do_not_fit_get_a_sentence(name, value, tmp_path):
    fake_result().save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz") as file:
        arrays = {key: file[key] for key in file.files} | {name: value}
    with open(tmp_path / "run.npz", "wb") as file:
        np.savez(file, **{key: array for key, array in arrays.items() if array is not None})
    assert "\n" not in str(refuses(r"damaged|another format", ev.result.load, tmp_path / "run.npz"))


@pytest.mark.parametrize("compressed", [False, True])
def test_types_of_parts_of_a_file_of_matlab_are_known_before_it_is_read(compressed, tmp_path, monkeypatch):
    """Of a sound file, where doubles are none of the types that there are."""
    columns = {"position": np.arange(9.0) + 0.1, "voltage": np.arange(9.0) + 0.1}
    savemat(tmp_path / "a.mat", columns, do_compression=compressed)
    assert ev.load(tmp_path / "a.mat").voltage[-1] == 8.1
    monkeypatch.setattr(foreign, "PLAIN", foreign.PLAIN - {9})
    refuses(r"a\.mat \(damaged or of another kind\)", ev.load, tmp_path / "a.mat")


def test_distributions_in_too_many_tables_are_refused(tmp_path):
    tables = "a" + ".a" * 3000
    text = f"version = 1\nscene = 's.toml'\n[samples]\ncount = 2\n[samples.parameters]\n{tables} = 1\n"
    (tmp_path / "s.toml").write_text(SCENE)
    (tmp_path / "w.toml").write_text(text)
    refuses("given tables in tables; allowed: keys of at most 20 names", ev.load, tmp_path / "w.toml")


@pytest.mark.parametrize(
    "change",
    [
        {"measured": 1.0},
        {"measured": [1.0] * 4},
        {"errors": [1.0, 2.0]},
        {"errors": [10**400]},
        {"values": {}},
        {"provenance": 1},
    ],
)
def test_a_fit_whose_parts_do_not_fit_is_refused(change, tmp_path):
    hostile.damaged("scene", tmp_path, Random(0))
    path = tmp_path / "fit.json"
    assert ev.load(path).values
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    refuses(r"fit: given .*fit\.json, damaged", ev.load, path)


def test_haptics_whose_places_overflow_are_refused(tmp_path):
    hostile.damaged("scene", tmp_path, Random(0))
    path = tmp_path / "signal.hjif"
    assert ev.load(path).voltage.max() == pytest.approx(100.0, rel=1e-6)
    whole = json.loads(path.read_text())
    frames = whole["perceptions"][0]["channels"][0]["bands"][0]["effects"][0]["keyframes"]
    frames[-1]["relative_position"] = 1e308
    whole["perceptions"][0]["unit_exponent"] = 3
    path.write_text(json.dumps(whole))
    refuses("a curve of two or more keyframes", ev.load, path)


def test_a_texture_has_one_period(tmp_path):
    hostile.damaged("scene", tmp_path, Random(0))
    path = tmp_path / "wave.json"
    path.write_text(path.read_text().replace('"period": 0.3', '"period": [0.3, 0.3]'))
    refuses("period: given", ev.load, path)


def of_tiff(tag, count):
    """A grey picture whose header says that one of its tags has so many values."""
    file = io.BytesIO()
    Picture.fromarray(np.arange(1200, dtype="u1").reshape(30, 40)).save(file, "TIFF")
    entry = file.getvalue().index(struct.pack("<H", tag), 8)
    content = bytearray(file.getvalue())
    content[entry + 4 : entry + 8] = struct.pack("<I", count)
    return bytes(content)


TOLD = {
    "twice.csv": (b"x,height\n0,1\n1,2\n1,3\n2,2\n3,0\n", "rising numbers"),
    "swing.csv": (
        b"time,height\n" + b"".join(b"%d,%de200\n" % (k, k % 3) for k in range(40)),
        "whose squares",
    ),
}


@pytest.mark.parametrize("name", TOLD)
def test_damage_in_heights_is_one_sentence_without_warnings(name):
    """numpy warns, which `pytest` makes an error here."""
    content, words = TOLD[name]
    options = {"licence": "CC0-1.0", "speed": "20", "longest": "1000"}
    refuses(words, page.uploaded, content, name, options)


@pytest.mark.parametrize("tag", [256, 257, 258, 259, 273])
def test_damage_in_tags_of_a_picture_gives_no_warnings(tag):
    """Pillow tells which tags it skips."""
    with warnings.catch_warnings(record=True) as told, suppress(ev.InputError):
        warnings.simplefilter("always")
        page.uploaded(of_tiff(tag, 10**6), "a.tif", {"licence": "CC0-1.0", "pixel": "0.1", "depth": "0.1"})
    assert not told


@pytest.mark.parametrize(
    ("text", "read"),
    [
        (
            "frequency [kHz],eps_r,conductivity\n1e307,10,1\n1e308,9,1\n",
            ev.electrostatics.DielectricTable.from_csv,
        ),
        (
            "indentation,normal_force,sd\n0.1,1,1e300\n0.1,1,1\n",
            lambda path: ev.MeasuredCurve.from_csv(path, 0),
        ),
    ],
)
def test_numbers_that_overflow_are_refused_without_warnings(text, read, tmp_path):
    (tmp_path / "a.csv").write_text(text)
    refuses("finite|positive|above", read, tmp_path / "a.csv")
