"""Decks of Abaqus and CalculiX (.inp): one body, written in many ways."""

import numpy as np
import pytest
from tools.refusals import refuses

import evfem as ev
from evfem.mesh.faces import shape_functions
from evfem.mesh.file import parts, read
from evfem.mesh.mesh import raised

NX, NY = 8, 3
PAD, BONE = list(range(1, NX + 2)), list(range(NY * (NX + 1) + 1, (NY + 1) * (NX + 1) + 1))
LAW = ev.NeoHookean(E=0.05, nu=0.3)
MOVED = (0.5, 0.25, 0.0)  # mm
ANGLE = 20.0


def grid():
    """Nodes of a block of 12 x 4 mm with a curved pad, and its quads."""
    x, y = np.meshgrid(np.linspace(-6.0, 6.0, NX + 1), np.linspace(0.0, 4.0, NY + 1))
    y = y + (1.0 - y / 4.0) * x**2 / 30.0
    low = (np.arange(NY)[:, None] * (NX + 1) + np.arange(NX)).ravel()
    return np.column_stack([x.ravel(), y.ravel()]), np.column_stack(
        [low, low + 1, low + NX + 2, low + NX + 1]
    )


POINTS, CELLS = grid()


def numbered(rows, first=1, form="{:.12f}"):
    """Lines of data."""
    return [f"{n}, {', '.join(map(form.format, row))}\n" for n, row in enumerate(rows, first)]


def elements(name, cells, kind="CPE4", first=1):
    return f"*ELEMENT, TYPE={kind}, ELSET={name}\n" + "".join(numbered(np.add(cells, 1), first, "{}"))


def nset(name, ids, more=""):
    return f"*NSET, NSET={name}{more}\n{', '.join(map(str, ids))}\n"


NODES = numbered(POINTS)
SETS = nset("pad", PAD) + nset("bone", BONE)
BODY = elements("tissue", CELLS)
#: the edges of the bone as trusses
TOP = elements("top", np.column_stack([BONE[:-1], BONE[1:]]) - 1, "T3D2", 100)


def deck(sets=SETS, body=BODY, points=POINTS, head="*NODE\n"):
    return head + "".join(numbered(points)) + body + sets


def turned(points):
    """The points shifted, then turned around (1, 2)."""
    c, s = np.cos(np.radians(ANGLE)), np.sin(np.radians(ANGLE))
    return (points + MOVED[:2] - [1.0, 2.0]) @ np.array([[c, s], [-s, c]]) + [1.0, 2.0]


def instance(part, more="", data="", name="F1"):
    return (
        f"*PART, NAME=F\n{part}*END PART\n*ASSEMBLY, NAME=A\n*INSTANCE, NAME={name}, PART=F\n{data}"
        f"*END INSTANCE\n{more}*END ASSEMBLY\n"
    )


def force(path, text):
    """What the finger in a deck is pressed with, in N/mm."""
    path.write_text(text)
    finger = ev.MeshedFinger(path, {"tissue": LAW}, regions={"tissue": "tissue"})
    motion = [ev.Press(indentation=0.3, steps=2)]
    return ev.simulate(ev.Scene(finger, ev.Flat(friction=0.3), motion=motion)).normal_force[-1]


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """The force without a file."""
    sets = {"pad": np.array(PAD) - 1, "bone": np.array(BONE) - 1}
    mesh = ev.Mesh(POINTS, CELLS, "quad", np.zeros(len(CELLS), int), {"tissue": 0}, sets)
    motion = [ev.Press(indentation=0.3, steps=2)]
    finger = ev.MeshedFinger(mesh, {"tissue": LAW})
    return ev.simulate(ev.Scene(finger, ev.Flat(friction=0.3), motion=motion)).normal_force[-1]


_pad, _HALF = nset("pad", PAD), len(CELLS) // 2
SAME = {
    "plain": deck(),
    "a set in two cards, in another case": deck(_pad + nset("bone", BONE[:4]) + nset("BONE", BONE[4:])),
    "numbers and a set": deck(_pad + nset("right", BONE[4:]) + nset("bone", [*BONE[:4], "Right"])),
    "sets of sets": deck(_pad + nset("l", BONE[:4]) + nset("r", BONE[4:]) + nset("bone", ["l", "r"])),
    "nodes of elements": deck(_pad + TOP + "*NSET, NSET=bone, ELSET=top\n"),
    "ranges without a step": deck(nset("bone", BONE) + "*NSET, NSET=pad, GENERATE\n1, 4\n5, 9, 1\n"),
    "a range beyond the nodes": deck(_pad + "*NSET, NSET=bone, GEN\n28, 999999999999\n"),
    "two blocks of nodes": "".join(["*NODE\n", *NODES[:7], "*NODE, NSET=x\n", *NODES[7:], BODY, SETS]),
    "two blocks of elements": deck(body=elements("tissue", CELLS[:_HALF])
                                   + elements("tissue", CELLS[_HALF:], first=_HALF + 1)),
    "a set of elements in two cards": deck(
        SETS + f"*ELSET, ELSET=tissue, GENERATE\n1, {_HALF}\n"
        + f"*ELSET, ELSET=tissue, GENERATE\n{_HALF + 1}, 24\n",
        BODY.replace(", ELSET=tissue", "")),
    "two sets of elements in a line": deck(
        SETS + "*ELSET, ELSET=tissue\nl, r\n",
        elements("l", CELLS[:_HALF]) + elements("r", CELLS[_HALF:], first=_HALF + 1)),
    "surfaces": deck("*ELSET, ELSET=low, GENERATE\n1, 8\n*SURFACE, NAME=pad\nlow, S1\n"
                     + "*SURFACE, TYPE=ELEMENT, NAME=bone\n" + "".join(f"{n}, S3\n" for n in range(17, 25))),
    "a surface of nodes": deck(_pad + nset("top", BONE) + "*SURFACE, TYPE=NODE, NAME=bone\ntop, 1.0\n"),
    "a node of no element": deck(SETS + "*NODE, NSET=RP\n999, 0., 90., 7.\n"),
    "comments, steps, and a keyword on two lines": deck(
        "** bone\n*nset,\n nset=bone\n" + ",\n".join(map(str, BONE)) + ",\n\n" + _pad
        + "*MATERIAL, NAME=pad\n*ELASTIC\n1., .3\n*STEP\n*STATIC\n*NSET, NSET=pad\n10\n*END STEP\n"),
    "numbers of Fortran": deck().replace(f"{POINTS[0, 0]:.12f}", "-0.6D+1"),
    "one instance": instance(deck()),
    "two parts, one with elements": "*PART, NAME=PLATE\n*NODE\n1, 0., -1.\n*END PART\n" + instance(
        deck(), "*INSTANCE, NAME=P1, PART=PLATE\n1., 1.\n*END INSTANCE\n"),
    "a point of the assembly": instance(deck(), "*NODE\n1, 0., 9.\n*NSET, NSET=RP\n1\n"),
    "sets of the assembly": instance(deck("", BODY), nset("pad", PAD, ", INSTANCE=f1")
                                     + nset("bone", [f"F1.{n}" for n in BONE])),
    "axes, and no axes again": "*SYSTEM\n1., 2., 0., 1., 3., 0.\n*NODE\n"
        + "".join(numbered((POINTS - [1.0, 2.0]) @ [[0.0, -1.0], [1.0, 0.0]])[:9]) + "*SYSTEM\n*NODE\n"
        + "".join(NODES[9:]) + BODY + SETS,
    "shifted axes": deck(head="*SYSTEM\n0.5, 0.25\n*NODE\n", points=POINTS - MOVED[:2]),
}  # fmt: skip


@pytest.mark.parametrize("way", SAME)
def test_one_body_written_in_many_ways_gives_one_force(way, plain, tmp_path):
    assert force(tmp_path / "block.inp", SAME[way]) == pytest.approx(plain, rel=1e-9)
    mesh = read(tmp_path / "block.inp", {"tissue": "tissue"})
    np.testing.assert_allclose(mesh.points, POINTS, rtol=0, atol=1e-9)
    assert [(mesh.node_sets[name] + 1).tolist() for name in ("pad", "bone")] == [PAD, BONE]


def test_sets_of_sets_do_not_grow_beyond_their_members(tmp_path):
    sets = "".join(nset(f"s{k + 1}", [f"s{k}", f"s{k}"]) for k in range(60))  # 2^60 if each were kept twice
    (tmp_path / "sets.inp").write_text(deck(_pad + nset("s0", BONE) + sets + nset("bone", ["s60"])))
    assert (read(tmp_path / "sets.inp").node_sets["bone"] + 1).tolist() == BONE


def test_an_instance_is_shifted_and_then_turned(plain, tmp_path):
    data = f"{MOVED[0]}, {MOVED[1]}, 0.\n1., 2., 0., 1., 2., 1., {ANGLE}\n"
    found = force(tmp_path / "instance.inp", instance(deck(), data=data))
    assert found == pytest.approx(force(tmp_path / "plain.inp", deck(points=turned(POINTS))), rel=1e-9)
    np.testing.assert_allclose(read(tmp_path / "instance.inp").points, turned(POINTS), rtol=0, atol=1e-9)
    assert abs(found / plain - 1.0) > 0.05
    assert force(tmp_path / "shift.inp", instance(deck(), data="3., 1.\n")) == pytest.approx(plain, rel=1e-9)


def test_sets_with_a_card_are_numbered_before_those_of_elements(tmp_path):
    """As meshio numbered them up to 0.3, for `regions = {tissue = 1}`."""
    (tmp_path / "numbers.inp").write_text(SAME["two sets of elements in a line"])
    assert (read(tmp_path / "numbers.inp", {"tissue": 1}).region == 1).all()
    assert read(tmp_path / "numbers.inp", {"left": 2, "right": 3}).region.tolist() == [2] * 12 + [3] * 12


def test_axes_in_space_turn_the_nodes(tmp_path):
    # x' = y, y' = z, z' = x, by a third point that is not at a right angle to the second
    points = np.add(np.multiply(CUBE, 2.0), [1.0, 2.0, 3.0])
    local = np.array(CUBE)[:, [1, 2, 0]]  # `cube` makes it 2 mm wide
    text = "*SYSTEM\n1., 2., 3., 1., 4., 3.\n1., 7., 8.\n" + cube(local)
    np.testing.assert_allclose(mesh_of(tmp_path, text).points, points, rtol=0, atol=1e-12)
    # without a third point z remains, and x' is taken in the plane: x' = y, y' = -x
    local = np.array(CUBE)[:, [1, 0, 2]] * [1, -1, 1]
    text = "*SYSTEM\n1., 2., 3., 1., 4., 9.\n" + cube(local)
    np.testing.assert_allclose(mesh_of(tmp_path, text).points, points, rtol=0, atol=1e-12)


def test_sets_of_parts_and_assemblies_of_one_name_are_told_apart(tmp_path):
    """As Abaqus/CAE writes them: Set-1 twice, and a set that it makes for a surface."""
    part = deck(nset("Set-1", [1, 2]), BODY.replace(", ELSET=tissue", ""))
    part += "*Elset, elset=Set-1, generate\n  1,  24,  1\n"
    more = (
        "*Nset, nset=Set-1, instance=F1, generate\n 28,  36,  1\n"
        "*Elset, elset=_low_S1, internal, instance=F1, generate\n 1,  8,  1\n"
        "*Surface, type=ELEMENT, name=low\n_low_S1, S1\n"
    )
    (tmp_path / "cae.inp").write_text(instance(part, more))
    mesh = read(tmp_path / "cae.inp", None, {"pad": "low", "bone": "Set-1"})
    assert list(mesh.region_names) == ["Set-1"]  # and not _low_S1
    sets = {name: (nodes + 1).tolist() for name, nodes in mesh.node_sets.items()}
    assert sets == {"pad": PAD, "low": PAD, "bone": BONE, "Set-1": BONE, "F1.Set-1": [1, 2]}


def test_a_region_and_a_boundary_may_have_one_name(tmp_path):
    """As Gmsh writes both, whose nodes it saves as one set."""
    text = deck(SETS + TOP.replace("top", "nail") + nset("nail", range(1, len(POINTS) + 1)))
    (tmp_path / "nail.inp").write_text(text.replace("ELSET=tissue", "ELSET=nail"))
    mesh = read(tmp_path / "nail.inp")
    assert list(mesh.region_names) == ["nail"]
    assert (mesh.node_sets["nail"] + 1).tolist() == BONE


CUBE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
TRIANGLE = [(0, 0), (1, 0), (0, 1), (0.5, 0), (0.5, 0.5), (0, 0.5)]
EIGHT = [(0, 0), (1, 0), (1, 1), (0, 1), (0.5, 0), (1, 0.5), (0.5, 1), (0, 0.5)]
#: nodes that CalculiX 2.20 loads by a pressure on the faces P1, P2 ... of one element (those that move where
#: all others are held)
LOADED = {
    "C3D8": (CUBE, ["1234", "5678", "1256", "2367", "3478", "1458"]),
    "CPE4": ([(x, y) for x, y, _ in CUBE[:4]], ["12", "23", "34", "14"]),
    "CPE6": (TRIANGLE, ["124", "235", "136"]),
}


def cube(points, kind="C3D8", sets="*SURFACE, NAME=pad\n1, S1\n*SURFACE, NAME=bone\n1, S2\n"):
    return deck(sets, elements("tissue", [range(len(points))], kind), np.multiply(points, 2.0))


def mesh_of(folder, text):
    (folder / "one.inp").write_text(text)
    return read(folder / "one.inp")


@pytest.mark.parametrize("kind", LOADED)
def test_faces_of_elements_are_those_of_calculix(kind, tmp_path):
    points, faces = LOADED[kind]
    sets = nset("pad", faces[0]) + nset("bone", {"C3D8": faces[1], "CPE4": faces[2], "CPE6": "36"}[kind])
    sets += "".join(f"*SURFACE, NAME=s{k}\ntissue, S{k}\n" for k in range(1, 1 + len(faces)))
    found = mesh_of(tmp_path, cube(points, kind, sets)).node_sets
    assert [(found[f"s{k}"] + 1).tolist() for k in range(1, 1 + len(faces))] == [
        [int(node) for node in face] for face in faces
    ]


def test_a_surface_without_faces_is_what_is_exposed_of_its_elements(tmp_path):
    low = "*ELSET, ELSET=low, GENERATE\n1, 8\n"
    (tmp_path / "block.inp").write_text(deck(SETS + low + "*SURFACE, NAME=around\nlow\n"))
    found = read(tmp_path / "block.inp", {"tissue": "tissue"}).node_sets["around"] + 1
    assert found.tolist() == [*PAD, NX + 2, 2 * NX + 2]  # the ends of the first row are outside too


#: places of the 27 nodes of an element in the order in which Gmsh 4.8 writes C3D27
# fmt: off
GMSH = [
    "-++", "--+", "---", "-+-", "+++", "+-+", "+--", "++-", "-0+", "--0", "-0-", "-+0", "+0+", "+-0", "+0-",
    "++0", "0++", "0-+", "0--", "0+-", "000", "-00", "+00", "00+", "0-0", "00-", "0+0",
]
# fmt: on
GMSH_LOW, GMSH_HIGH = ([n for n, one in enumerate(GMSH, 1) if one[1] == side] for side in "-+")


def test_hexahedra_of_gmsh_keep_their_volume(tmp_path):
    """x + y^2 z / 5, y + z^2 / 7, z moves no volume, and is in the span of the 27 shape functions."""
    x, y, z = np.array([["-0+".index(one) - 1.0 for one in place] for place in GMSH]).T
    points = np.column_stack([x + 0.2 * y**2 * z, y + z**2 / 7.0, z])
    skin = f"*ELEMENT, TYPE=M3D9, ELSET=skin\n9, {', '.join(map(str, GMSH_LOW))}\n*SURFACE, NAME=pad\nskin\n"
    mesh = mesh_of(tmp_path, cube(points, "C3D27", skin + nset("bone", GMSH_HIGH)))
    assert (mesh.node_sets["pad"] + 1).tolist() == GMSH_LOW
    at, weight = np.polynomial.legendre.leggauss(4)
    places = np.stack(np.meshgrid(at, at, at), axis=-1).reshape(-1, 3)
    _, slope = shape_functions(27, places)
    volume = np.linalg.det(np.einsum("pnk,nc->pkc", slope, mesh.points[mesh.cells[0]]))
    weights = np.prod(np.meshgrid(weight, weight, weight), axis=0).ravel()
    assert mesh.kind == "hexahedron27"
    np.testing.assert_allclose(volume, 8.0, rtol=1e-12)  # everywhere: each side is twice as long
    assert volume @ weights == pytest.approx(64.0, rel=1e-12)


def test_quads_of_gmsh_with_nine_nodes_and_their_edges_are_read(tmp_path):
    mesh = ev.Mesh(POINTS, CELLS, "quad", np.zeros(24, int), {"tissue": 0}, {"pad": np.array(PAD) - 1})
    fine = raised(mesh)
    edges = fine.sides_of("pad")[:, [0, 2, 1]]  # T3D3 and B32 have their middle between the ends
    body = elements("tissue", fine.cells, "M3D9") + elements("pad", edges, "T3D3", 100)
    text = deck(nset("bone", BONE), body, fine.points)
    found = mesh_of(tmp_path, text)
    assert found.kind == "quad9"
    np.testing.assert_array_equal(found.cells, fine.cells)
    np.testing.assert_array_equal(found.node_sets["pad"], fine.node_sets["pad"])
    lines = next(one for one in parts(tmp_path / "one.inp").cells if one.type == "line3")
    np.testing.assert_array_equal(lines.data, fine.sides_of("pad"))


TWO = instance(deck(), "*INSTANCE, NAME=F2, PART=F\n9., 0.\n*END INSTANCE\n")
WRONG = {
    "generated nodes": (deck("*NGEN, NSET=x\n1, 9\n"), r"\*NGEN, which is not read: write the nodes"),
    "filled nodes": (deck("*NFILL\nx, y, 3\n"), r"\*NFILL, which is not read"),
    "copied nodes": (deck("*NCOPY, CHANGE NUMBER=9, OLD SET=x\n"), r"\*NCOPY, which is not read"),
    "generated elements": (deck("*ELGEN\n1, 8\n"), r"\*ELGEN, which is not read"),
    "another file": (deck("*INCLUDE, INPUT=a.inp\n"), r"\*INCLUDE, which .* into one file"),
    "nodes of another file": (deck(head="*NODE, INPUT=a.txt\n"), r"\*NODE, INPUT=, which .* one file"),
    "moved nodes": (deck("*IMPERFECTION, FILE=a\n1, .1\n"), r"\*IMPERFECTION, which .* come to lie"),
    "radii and angles": (deck(head="*NODE, SYSTEM=C\n"), r"\*NODE, SYSTEM=C, .*give x, y and z"),
    "two instances": (TWO, r"\*INSTANCE with elements, F1 and F2: flatten the assembly"),
    "an old instance": (instance(deck()).replace("PART=F\n*END I", "\n*END I"), "INSTANCE without PART="),
    "a wrong turn": (instance(deck(), data="0., 0., 0., 90.\n"), r"no shift \(3 numbers\) and turn \(7\)"),
    "a turn around no axis": (instance(deck(), data="0, 0, 0, 0, 0, 0, 9\n"), "two points in one place"),
    "axes of one line": (
        deck(head="*SYSTEM\n0, 0, 0, 1, 0, 0, 0, 1, 0\n*NODE\n"),
        r"\*SYSTEM with other data",
    ),
    "axes on one line": (
        deck(head="*SYSTEM\n0, 0, 0, 0, 0, 1\n*NODE\n"),
        r"\*SYSTEM with points on one line",
    ),
    "axial symmetry": (deck().replace("CPE4", "CAX4"), "elements CAX4, which are axisymmetric"),
    "unknown elements": (deck().replace("CPE4", "DC2D4"), "elements DC2D4, which the reader does not know"),
    "no middle nodes": (deck().replace("CPE4", "CPE8"), "CPE8 with 120 numbers: 9 a line"),
    "half a line": (deck(body=BODY + "25, 1, 2\n"), "CPE4 with 123 numbers: 5 a line"),
    "an element of no node": (deck(body=BODY + "25, 1, 2, 99, 98\n"), r"\*ELEMENT: node 98, which is used"),
    "two of one number": (deck(body=BODY + "24, 1, 2, 12, 11\n"), "two elements 24: number them apart"),
    "a set of no node": (deck(SETS + nset("x", [1, 99])), r"NSET x: number 99, which is used and not"),
    "a set of no set": (deck(SETS + nset("x", [1, "Right"])), r"a set of Right, which no \*NSET"),
    "no whole number": (deck(body=BODY + "25, 1, 2, 3.5, 4\n"), r"\*ELEMENT with data that are no whole"),
    "no number": (deck(head="*NODE\n1, one, 2.\n"), r"\*NODE with data that are no numbers"),
    "no face": (deck(SETS + "*SURFACE, NAME=s\ntissue, S5\n"), r"\*SURFACE s with the face S5 of a quad"),
    "no body": ("*HEADING\nnothing\n", r"no \*ELEMENT that is part of a body"),
}


@pytest.mark.parametrize("way", WRONG)
def test_what_is_not_read_is_refused_by_its_name(way, tmp_path):
    text, said = WRONG[way]
    (tmp_path / "block.inp").write_text(text)
    caught = refuses(rf"given block\.inp \(.*{said}", read, tmp_path / "block.inp")
    assert "\n" not in str(caught)


@pytest.mark.parametrize(
    ("kind", "points", "said"),
    [
        ("CPE8", EIGHT, "quad8 cells; .*quad8 has no middle node: export quad9 or quad"),
        (
            "C3D20R",
            [*CUBE, *(np.random.default_rng(0).random((12, 3)))],
            "hexahedron20 cells; .*a pressure pulls",
        ),
        ("C3D4H", CUBE[:4], "tetra cells; .*From tetrahedra"),
    ],
)
def test_elements_of_which_no_finger_is_made_have_a_true_reason(kind, points, said, tmp_path):
    text = cube(
        points, kind, nset("bone", [3, 4]) + "*SURFACE, NAME=pad\ntissue, S1\n*SURFACE, NAME=all\ntissue\n"
    )
    refuses(said, mesh_of, tmp_path, text)
