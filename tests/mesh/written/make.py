"""Writes the files of this folder, each with the library that its format belongs to.

    python make.py gmsh           # gmsh 4.15.2
    python make.py medcoupling    # medcoupling 9.15.0
    python make.py exodus_helper  # exodus_helper 1.6.0
    python make.py pyvista        # pyvista 0.49.1, vtk 9.7.2
    python make.py dolfinx        # fenics-dolfinx 0.5.2

A folder after that is where the files go instead.
Every file has the body of `tests/mesh/test_written.py`: 8 x 4 mm, in space 3 mm deep, the lower 3 mm `skin`,
the rest `tissue`, `pad` at y = 0 and `bone` at y = 4, with x moved by y^2 / 10 and z by y^2 / 20, which
changes no area and no volume and is in the span of elements of second order. Cells are 2 x 2 (x 1).
"""

import sys
from pathlib import Path

import numpy as np

HERE = Path(sys.argv[2]) if len(sys.argv) > 2 else Path(__file__).parent
X, Y, Z = (0.0, 2.0, 4.0, 6.0, 8.0), (0.0, 1.5, 3.0, 3.5, 4.0), (0.0, 1.5, 3.0)


def bent(points):
    """The body's points, of those of a straight one."""
    points = np.array(points, dtype=float)
    points[:, 0] += points[:, 1] ** 2 / 10.0
    if points.shape[1] == 3 and np.ptp(points[:, 2]) > 0.0:
        points[:, 2] += points[:, 1] ** 2 / 20.0
    return points


def nodes(dim):
    """Points (N, dim) of second order, x fastest."""
    grid = np.meshgrid(*(X, Y, Z)[:dim], indexing="ij")
    return np.column_stack([one.ravel(order="F") for one in grid])


def number(i, j, k=0):
    """Of the node in column i, row j and layer k."""
    return i + len(X) * (j + len(Y) * k)


def cells(places):
    """Nodes of the four cells, lower ones first, by the places (-1, 0, 1) of a cell's nodes."""
    centres = [(i, j) for j in (1, 3) for i in (1, 3)]
    return np.array(
        [[number(i + p[0], j + p[1], *(1 + q for q in p[2:])) for p in places] for i, j in centres]
    )


# -- Gmsh


def gmsh_body(dim, quads, order, two=False):
    """The model, whose nodes are moved once they are there."""
    import gmsh

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    geo = gmsh.model.geo
    corner = [geo.addPoint(x, y, 0) for y in (0, 3, 4) for x in (0, 8)]
    ends = [(0, 1), (1, 3), (3, 2), (2, 0), (3, 5), (5, 4), (4, 2)]
    curve = [geo.addLine(corner[a], corner[b]) for a, b in ends]
    low = geo.addPlaneSurface([geo.addCurveLoop(curve[:4])])
    top = geo.addPlaneSurface([geo.addCurveLoop([-curve[2], *curve[4:]])])
    for one, count in zip(curve, (3, 2, 3, 2, 2, 3, 2), strict=True):
        geo.mesh.setTransfiniteCurve(one, count)
    for one in (low, top):
        geo.mesh.setTransfiniteSurface(one)
        if quads:
            geo.mesh.setRecombine(2, one)
    body = [low, top]
    if dim == 3:
        made = geo.extrude([(2, low), (2, top)], 0, 0, 3, [1], recombine=True)
        body = [tag for d, tag in made if d == 3]
    geo.synchronize()
    name_groups(gmsh.model, dim, body, two)
    for option, value in (("ElementOrder", order), ("SecondOrderLinear", 1)):
        gmsh.option.setNumber(f"Mesh.{option}", value)
    gmsh.model.mesh.generate(dim)
    tags, points, _ = gmsh.model.mesh.getNodes()
    for tag, point in zip(tags, bent(points.reshape(-1, 3)), strict=True):
        gmsh.model.mesh.setNode(tag, point, [])
    return gmsh


def name_groups(model, dim, body, two):
    """Physical groups 1 to 4; with `two`, all of the body and the pad are in a second one."""
    sides = [tag for _, tag in model.getEntities(dim - 1)]
    level = {tag: model.getBoundingBox(dim - 1, tag)[1::3] for tag in sides}
    pad, bone = ([tag for tag in sides if np.allclose(level[tag], y, atol=1e-3)] for y in (0.0, 4.0))
    for group, name, d, tags in (
        (1, "skin", dim, body[:1]),
        (2, "tissue", dim, body[1:]),
        (3, "pad", dim - 1, pad),
        (4, "bone", dim - 1, bone),
        *(((5, "all", dim, body), (6, "low", dim - 1, pad)) if two else ()),
    ):
        model.addPhysicalGroup(d, tags, group, name)


def write_gmsh():
    """.msh, .med, .su2, .inp, .bdf, .vtk, .mesh and .unv."""
    for dim, quads, order, name in (
        (2, False, 2, "triangle6"),
        (2, True, 1, "quad"),
        (2, True, 2, "quad9"),
        (3, True, 1, "hexahedron"),
        (3, True, 2, "hexahedron27"),
    ):
        gmsh = gmsh_body(dim, quads, order)
        gmsh.option.setNumber("Mesh.SaveElementTagType", 2)
        for version in (2.2, 4.1):
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.write(f"{HERE}/gmsh_{name}_{version}.msh")
        for ending in ("med", "su2", "inp", "bdf", "vtk", "mesh", "unv"):
            gmsh.write(f"{HERE}/gmsh_{name}.{ending}")
        gmsh.finalize()
    for name, two, option in (("two", True, 0), ("all", False, 1)):
        gmsh = gmsh_body(2, True, 1, two)
        gmsh.option.setNumber("Mesh.SaveAll", option)
        for version in (2.2, 4.1):
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.write(f"{HERE}/gmsh_{name}_{version}.msh")
        gmsh.finalize()


# -- MEDCoupling


def write_medcoupling():
    """.med as Salome writes it: linear cells that it makes quadratic, groups of cells, sides and nodes."""
    import medcoupling

    def group(name, members):
        found = medcoupling.DataArrayInt([int(one) for one in members])
        found.setName(name)
        return found

    for dim, unit, scale, name in (
        (2, "", 1.0, "quad9"),
        (2, "m", 1e-3, "metres"),
        (3, "", 1.0, "hexahedron27"),
    ):
        grid = medcoupling.MEDCouplingCMesh()
        grid.setCoords(*(medcoupling.DataArrayDouble(list(axis[::2])) for axis in (X, Y, Z)[:dim]))
        mesh = grid.buildUnstructured()
        mesh.convertLinearCellsToQuadratic(1)
        mesh.setCoords(medcoupling.DataArrayDouble(scale * bent(mesh.getCoords().toNumPyArray())))
        if unit:
            mesh.getCoords().setInfoOnComponents([f"{axis} [{unit}]" for axis in "xyz"[:dim]])
        sides, y = mesh.computeSkin(), mesh.getCoords().toNumPyArray()[:, 1] / scale
        for one in (mesh, sides):
            one.setName("finger")
        file = medcoupling.MEDFileUMesh.New()
        for level, one in ((0, mesh), (-1, sides)):
            file.setMeshAtLevel(level, one)
        at = {
            one: [y[one.getNodeIdsOfCell(k)] for k in range(one.getNumberOfCells())] for one in (mesh, sides)
        }
        file.setGroupsAtLevel(
            0,
            [
                group("skin", [k for k, of in enumerate(at[mesh]) if of.mean() < 3.0]),
                group("tissue", [k for k, of in enumerate(at[mesh]) if of.mean() > 3.0]),
            ],
        )
        file.setGroupsAtLevel(
            -1,
            [
                group("pad", [k for k, of in enumerate(at[sides]) if (of == 0.0).all()]),
                group("bone", [k for k, of in enumerate(at[sides]) if (of == 4.0).all()]),
            ],
        )
        file.setGroupsAtLevel(1, [group("middle", np.flatnonzero(y == 3.0))])
        file.write(f"{HERE}/medcoupling_{name}.med", 2)


# -- Exodus

#: places of the nodes of HEX27: those of HEX8, middles of the edges of the bottom, upright and of the top,
#: the centre, and of the faces -z, +z, -x, +x, -y, +y; as the sides in exodus_helper.CONNECTIVITY_SIDES are
_RING = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
_EDGES = [(0, -1), (1, 0), (0, 1), (-1, 0)]
HEX27 = [
    *((*p, z) for z in (-1, 1) for p in _RING),
    *((*p, -1) for p in _EDGES), *((*p, 0) for p in _RING), *((*p, 1) for p in _EDGES),
    (0, 0, 0), (0, 0, -1), (0, 0, 1), (-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0),
]  # fmt: skip
QUAD9 = [*_RING, *_EDGES, (0, 0)]


def write_exodus_helper():
    """.exo with the numbers 20 and 10 of the lower and upper block, side sets and a node set."""
    import exodus_helper

    for name, dim, kind, places, named, sides in (
        ("triangle6", 2, "TRI6", QUAD9, True, (1, 2)),
        ("trishell6", 2, "TRISHELL6", QUAD9, True, (3, 4)),
        ("quad9", 2, "QUAD9", QUAD9, True, (1, 3)),
        ("shell9", 2, "SHELL9", QUAD9, True, (3, 5)),
        ("hexahedron27", 3, "HEX27", HEX27, True, (1, 3)),
        ("unnamed", 3, "HEX27", HEX27, False, (1, 3)),
    ):
        connect, points = 1 + cells(places), bent(nodes(dim))
        if kind.startswith("TRI"):
            connect = connect[:, [[0, 1, 2, 4, 5, 8], [0, 2, 3, 8, 6, 7]]].reshape(8, 6)
        half, middle = len(connect) // 2, 1 + np.flatnonzero(points[:, 1] == 3.0)
        file = exodus_helper.Exodus(
            f"{HERE}/exodus_{name}.exo", mode="w", numDims=dim, num_dims=dim, numNodes=len(points),
            numElems=len(connect), numBlocks=2, numNodeSets=1, numSideSets=2, time_step=1,
        )  # fmt: skip
        file.put_coords(*points.T, *[np.zeros(len(points))] * (3 - dim))
        file.dataset.variables["eb_prop1"][:] = [20, 10]
        for block, label, rows in ((20, "skin", connect[:half]), (10, "tissue", connect[half:])):
            file.put_elem_blk_info(block, kind, *rows.shape, 0)
            file.put_elem_connectivity(block, rows.ravel())
            if named:
                file.put_elem_blk_name(block, label)
        file.put_node_set_params(7, len(middle))
        file.put_node_set(7, middle)
        low, top = 1 + np.arange(2) * half // 2, half + np.arange(1, 3) * half // 2
        for side_set, elements, side in ((7, low, sides[0]), (8, top, sides[1])):
            file.put_side_set_params(side_set, 2)
            file.put_side_set(side_set, elements, [side, side])
        for status in ("eb_status", "ns_status", "ss_status"):
            file.dataset.variables[status][:] = 1  # it writes 0, which says that there is none
        if named:
            file.put_node_set_name(7, "middle")
            file.put_side_set_name(7, "pad")
            file.put_side_set_name(8, "bone")
        file.close()


# -- PyVista


def write_pyvista():
    """.vtu and .vtk with bool arrays, and .vtu by LZ4; texts beside them."""
    import pyvista

    for name, dim, places, kind in (("quad9", 2, QUAD9, 28), ("hexahedron", 3, HEX27[:8], 12)):
        connect, points = cells(places), nodes(dim)
        used, connect = np.unique(connect, return_inverse=True)
        connect, straight = connect.reshape(4, -1), points[used]
        points = np.column_stack([bent(straight), np.zeros((len(used), 3 - dim))])
        rows = np.column_stack([np.full(4, connect.shape[1]), connect])
        grid = pyvista.UnstructuredGrid(rows.ravel(), np.full(4, kind, np.uint8), points)
        grid.point_data["pad"] = points[:, 1] == 0.0
        grid.point_data["bone"] = points[:, 1] == 4.0
        grid.cell_data["region"] = [1, 1, 2, 2]
        grid.cell_data["material"] = ["skin", "skin", "tissue", "tissue"]
        grid.save(HERE / f"pyvista_{name}.vtu")
        grid.save(HERE / f"pyvista_{name}.vtk")
        grid.save(HERE / f"pyvista_{name}_ascii.vtk", binary=False)
        grid.save(HERE / f"pyvista_{name}_lz4.vtu", compression="lz4")


# -- FEniCSx


def write_dolfinx():
    """.xdmf with tags of cells and facets, or with functions."""
    import dolfinx
    import ufl
    from dolfinx import fem, io, mesh
    from mpi4py import MPI

    for name, dim, places, cell in (
        ("quad9", 2, QUAD9, "quadrilateral"),
        ("hexahedron27", 3, HEX27, "hexahedron"),
    ):
        element = ufl.VectorElement("Lagrange", ufl.Cell(cell, geometric_dimension=dim), 2)
        kind = getattr(mesh.CellType, cell)
        order = dolfinx.cpp.io.perm_vtk(kind, len(places))
        vtk = [(*p[:2], *q) for p in QUAD9 for q in [()]] if dim == 2 else VTK27
        body = mesh.create_mesh(MPI.COMM_SELF, cells(vtk)[:, order], bent(nodes(dim)), ufl.Mesh(element))
        for d in (0, dim):
            body.topology.create_connectivity(dim - 1, d)
        middle = mesh.compute_midpoints(body, dim, np.arange(4, dtype=np.int32))
        regions = np.where(middle[:, 1] < 3.0, 1, 2).astype(np.int32)
        found = [
            mesh.locate_entities_boundary(body, dim - 1, lambda x, y=y: np.isclose(x[1], y)) for y in (0, 4)
        ]
        facets, order = np.unique(np.concatenate(found), return_index=True)
        numbers = np.repeat([3, 4], [len(one) for one in found]).astype(np.int32)[order]
        tags = [mesh.meshtags(body, dim, np.arange(4, dtype=np.int32), regions),
                mesh.meshtags(body, dim - 1, facets.astype(np.int32), numbers)]  # fmt: skip
        with io.XDMFFile(MPI.COMM_SELF, f"{HERE}/dolfinx_{name}.xdmf", "w") as file:
            file.write_mesh(body)
            for one, label in zip(tags, ("cells", "facets"), strict=True):
                one.name = label
                file.write_meshtags(one)
    body = mesh.create_rectangle(MPI.COMM_SELF, [[0, 0], [8, 4]], [2, 4], mesh.CellType.quadrilateral)
    body.geometry.x[:, 0] += body.geometry.x[:, 1] ** 2 / 10.0
    with io.XDMFFile(MPI.COMM_SELF, f"{HERE}/dolfinx_functions.xdmf", "w") as file:
        file.write_mesh(body)
        for name, space, value in (
            ("region", ("DG", 0), lambda x: 1.0 + (x[1] > 3.0)),
            ("pad", ("CG", 1), lambda x: 1.0 * np.isclose(x[1], 0.0)),
            ("bone", ("CG", 1), lambda x: 1.0 * np.isclose(x[1], 4.0)),
        ):
            function = fem.Function(fem.FunctionSpace(body, space))
            function.name = name
            function.interpolate(value)
            file.write_function(function)


#: places of VTK's 27 nodes: middles of the edges of the bottom, the top and upright, of the faces -x ... +z
VTK27 = [*HEX27[:12], *HEX27[16:20], *HEX27[12:16], *HEX27[23:27], *HEX27[21:23], HEX27[20]]

if __name__ == "__main__":
    globals()[f"write_{sys.argv[1]}"]()
