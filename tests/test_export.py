"""What ParaView, xarray and TouchSim get, results and the full field: read back by readers of others."""

import sys
from dataclasses import replace
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
from tools.fakes import fake_frame, fake_result, fake_row
from tools.meshes import KINDS, square_mesh
from tools.refusals import refuses
from tools.solids import block

import evfem as ev
from evfem import export, fieldfiles
from evfem.export import (
    TAGS,
    FieldFiles,
    ParaViewSeries,
    frame_in,
    frame_size,
    instants,
    paraview,
    skin_of,
    write_frame,
)
from evfem.mesh.mesh import raised
from evfem.simulation.model import make_model
from evfem.simulation.result import CELL_FIELDS, POINT_FIELDS
from evfem.sweeps.table import SweepResult

POINT_DATA = ("displacement", "gap", "contact_pressure", "shear_traction")
POINT_DATA += ("electrostatic_traction", "contact_status")
CELL_DATA = ("region", "von_mises", "cauchy_stress", "J")


def entries(path):
    """(instant, file name) of each entry of a .pvd file."""
    root = ElementTree.parse(path).getroot()
    assert root.attrib["type"] == "Collection"
    return [(float(e.attrib["timestep"]), e.attrib["file"]) for e in root.iter("DataSet")]


def test_the_index_names_files_of_any_name(tmp_path):
    """Also those of which XML would take a character for its own."""
    path = paraview(fake_result(), tmp_path / """a & b's "best" <1>.pvd""")
    names = [name for _, name in entries(path)]
    assert names == [f"{path.stem}_0000{step}.vtu" for step in (2, 4)]
    assert all((tmp_path / name).exists() for name in names)


@pytest.mark.parametrize("kind", KINDS)
def test_each_frame_is_read_back_with_all_its_fields(kind, tmp_path):
    result = fake_result(kind)
    paraview(result, tmp_path / "slide.pvd")
    assert [name for _, name in entries(tmp_path / "slide.pvd")] == ["slide_00002.vtu", "slide_00004.vtu"]
    for frame in result.frames:
        file = tmp_path / f"slide_{frame.step:05d}.vtu"
        read = meshio.read(file)
        assert set(read.point_data) == set(POINT_DATA)
        assert set(read.cell_data) == set(CELL_DATA)
        assert [block.type for block in read.cells] == [kind]
        np.testing.assert_array_equal(read.cells[0].data, result.mesh.cells)
        np.testing.assert_array_equal(read.points, np.pad(result.mesh.points, ((0, 0), (0, 1))))
        displacement = np.pad(frame.displacement, ((0, 0), (0, 1)))
        np.testing.assert_array_equal(read.point_data["displacement"], displacement)
        for name in POINT_DATA[1:]:
            np.testing.assert_array_equal(read.point_data[name], getattr(frame, name))
        np.testing.assert_array_equal(read.cell_data["region"][0], result.mesh.region)
        for name in CELL_DATA[1:]:
            np.testing.assert_array_equal(read.cell_data[name][0], getattr(frame, name))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("compressed", [False, True])
def test_single_precision_and_compression_keep_what_is_seen(kind, compressed, tmp_path):
    """Coordinates to 1e-7 of the size, whole numbers exactly, the same arrays and names."""
    mesh = square_mesh(kind)
    frame = fake_frame(mesh, 3)
    write_frame(mesh, frame, tmp_path / "one.vtu", single=True, compressed=compressed)
    read = meshio.read(tmp_path / "one.vtu")
    assert set(read.point_data) == set(POINT_DATA)
    np.testing.assert_allclose(read.points[:, :2], mesh.points, rtol=1e-7, atol=1e-7)
    np.testing.assert_array_equal(read.point_data["contact_status"], frame.contact_status)
    np.testing.assert_array_equal(read.cells[0].data, mesh.cells)
    np.testing.assert_array_equal(read.cell_data["region"][0], mesh.region)
    for name in ("gap", "contact_pressure", "shear_traction", "electrostatic_traction"):
        assert read.point_data[name].dtype == np.float32
        np.testing.assert_allclose(read.point_data[name], getattr(frame, name), rtol=1e-7)
    np.testing.assert_allclose(read.cell_data["cauchy_stress"][0], frame.cauchy_stress, rtol=1e-7)


@pytest.mark.parametrize("single", [False, True])
def test_the_size_of_a_file_is_known_before(single, tmp_path):
    mesh = ev.FingerPad(resolution="coarse").mesh(2)
    write_frame(mesh, fake_frame(mesh, 1), tmp_path / "one.vtu", single=single)
    size = (tmp_path / "one.vtu").stat().st_size
    assert abs(frame_size(mesh, single) - size) < 4_000
    write_frame(mesh, fake_frame(mesh, 1), tmp_path / "small.vtu", single=single, compressed=True)
    assert (tmp_path / "small.vtu").stat().st_size < frame_size(mesh, single, compressed=True) < size


def scene_of(presses, slides, **output):
    motion = [ev.Press(force=0.05, steps=presses), ev.Slide(1.0, steps=slides)]
    return ev.Scene(ev.FingerPad(), ev.Flat(), motion=motion, output=ev.Output(**output))


def test_a_run_writes_what_fits_and_the_end_of_each_motion():
    """Medium mesh: 1.53 MB a step in double precision, 0.86 MB in single."""
    mesh = ev.FingerPad().mesh(2)
    sizes = {}
    for presses, slides in ((5, 10), (5, 20), (10, 100), (7, 1000)):
        files = FieldFiles.of(scene_of(presses, slides), mesh)
        sizes[slides] = files.every, files.single
        written = [step for step in range(1, presses + slides + 1) if files.wants(step)]
        assert len(written) == files.number
        assert {presses, presses + slides} <= set(written)
        assert files.size == files.number * frame_size(mesh, files.single) <= 25_000_000
        more = replace(files, every=files.every - 1) if files.every > 1 else None
        if more:
            count = sum(map(more.wants, range(1, presses + slides + 1)))
            assert count * frame_size(mesh, single=True) > 25_000_000
    assert sizes == {10: (1, False), 20: (1, True), 100: (4, True), 1000: (36, True)}  # 29 files fit


def test_what_a_scene_says_of_its_output_is_done():
    mesh = ev.FingerPad().mesh(2)
    one = FieldFiles.of(scene_of(10, 100, every=1, precision="double", compression=True), mesh)
    assert (one.every, one.single, one.compressed, one.number) == (1, False, True, 110)
    size = 110 * frame_size(mesh, compressed=True) / 1e6
    assert str(one) == f"fields of every step, double precision: 110 files, compressed, at most {size:.0f} MB"
    third = FieldFiles.of(scene_of(10, 100, every=3), mesh)
    assert (third.every, third.single) == (3, True)
    assert [step for step in range(1, 111) if third.wants(step)] == [*range(3, 111, 3), 110]
    assert str(third).startswith("fields of every 3rd step and the last one, single precision: 37 files")


def test_instants_are_the_position_on_a_slide_and_always_increase(tmp_path):
    rows = [fake_row(step) for step in range(1, 6)]
    values = instants(rows)
    assert values == [0.0, 1e-9, *(row["position"] for row in rows[2:])]


def test_the_index_is_complete_after_every_step(tmp_path):
    mesh = square_mesh("quad")
    series = ParaViewSeries(tmp_path / "fields.pvd")
    series.started(mesh, None, 4)
    for step in range(1, 5):
        frame = fake_frame(mesh, step) if step % 2 == 0 else None
        series.step(fake_row(step), frame)
        if step > 1:
            named = [name for _, name in entries(tmp_path / "fields.pvd")]
            on_disk = sorted(path.name for path in tmp_path.glob("*.vtu"))
            assert named == on_disk == [f"fields_{s:05d}.vtu" for s in range(2, step + 1, 2)]
    assert not list(tmp_path.glob(".*"))


def test_wrong_ending_and_missing_folder_get_a_sentence(tmp_path):
    refuses(r"ends in \.pvd", paraview, fake_result(), tmp_path / "slide.vtk")
    with pytest.raises(ev.StorageError, match="cannot write"):
        paraview(fake_result(), tmp_path / "nowhere" / "slide.pvd")
    assert not list(tmp_path.iterdir())


def solid_result(order):
    """A block of hexahedra, pressed a little, with fields that tell nodes and cells apart."""
    mesh = block((2, 2, 3), (2.0, 2.0, 3.0))
    sets = {"pad": mesh.node_sets["bottom"], "bone": mesh.node_sets["top"]}
    mesh = raised(replace(mesh, node_sets=sets)) if order == 2 else replace(mesh, node_sets=sets)
    N, E = len(mesh.points), len(mesh.cells)
    fields = dict.fromkeys(POINT_FIELDS, np.arange(N, dtype=float)) | {"J": np.arange(E, dtype=float)}
    fields["contact_status"] = np.arange(N) % 3
    stress = np.arange(6.0 * E).reshape(E, 6)
    return mesh, ev.result.Frame(
        3, 0.0, 0.5, 0.1 * mesh.points, **fields, von_mises=np.arange(E) + 0.5, cauchy_stress=stress
    )


@pytest.mark.parametrize("order", [1, 2])
def test_a_solid_is_read_back_with_all_its_fields(order, tmp_path):
    mesh, frame = solid_result(order)
    write_frame(mesh, frame, tmp_path / "solid.vtu")
    read = meshio.read(tmp_path / "solid.vtu")
    assert [one.type for one in read.cells] == [mesh.kind]
    np.testing.assert_array_equal(read.points, mesh.points)
    np.testing.assert_array_equal(read.point_data["displacement"], frame.displacement)
    np.testing.assert_array_equal(read.cell_data["cauchy_stress"][0], frame.cauchy_stress)
    again = frame_in(tmp_path / "solid.vtu", {"step": 3, "time": 0.0, "position": 0.5}, mesh)
    np.testing.assert_array_equal(again.displacement, frame.displacement)
    size = (tmp_path / "solid.vtu").stat().st_size
    assert frame_size(mesh) == pytest.approx(size, abs=TAGS)


@pytest.mark.parametrize("order", [1, 2])
def test_the_skin_has_its_nodes_and_the_cells_behind_its_faces(order, tmp_path):
    mesh, frame = solid_result(order)
    series = ParaViewSeries(tmp_path / "skin.pvd", skin=True)
    series.add({"step": 3, "time": 0.0, "position": 0.5}, frame, mesh)
    read = meshio.read(tmp_path / "skin_00003.vtu")
    assert [one.type for one in read.cells] == [{1: "quad", 2: "quad9"}[order]]
    assert len(read.cells[0].data) == 6
    np.testing.assert_array_equal(read.points[:, 1], 0.0)
    np.testing.assert_array_equal(read.point_data["displacement"], 0.1 * read.points)
    nodes = read.point_data["gap"].astype(int)
    np.testing.assert_array_equal(mesh.points[nodes], read.points)
    middles = read.points[read.cells[0].data[:, :4]].mean(axis=1)
    above = mesh.points[mesh.cells[read.cell_data["J"][0].astype(int)][:, :8]].mean(axis=1)
    np.testing.assert_allclose(above - middles, np.broadcast_to([0.0, 0.5, 0.0], above.shape), atol=1e-12)
    refuses("three dimensions", skin_of, square_mesh("quad"))


@pytest.mark.parametrize("kind", KINDS)
def test_smooth_stresses_are_means_within_a_region_and_jump_where_layers_meet(kind, tmp_path):
    """Of a field that is one number in each region the means are these numbers, on both sides of a border."""
    result = fake_result(kind)
    stepped = replace(result.frames[-1], von_mises=2.0 + 3.0 * result.mesh.region)
    path = paraview(replace(result, frames=(stepped,)), tmp_path / "smooth.pvd", smooth=True)
    read = meshio.read(next(path.parent.glob("*.vtu")))
    (cells,), region = read.cells, read.cell_data["region"][0]
    value = np.broadcast_to(read.cell_data["von_mises"][0][:, None], cells.data.shape)
    np.testing.assert_allclose(read.point_data["nodal_von_mises"][cells.data], value, rtol=1e-14)
    owners = [set(cells.data[region == one].ravel()) for one in np.unique(region)]
    assert len(owners) == 2
    assert not owners[0] & owners[1]
    places = [set(map(tuple, read.points[sorted(own)].round(12))) for own in owners]
    shared = [node for node in range(len(result.mesh.points)) if len(regions_of(result.mesh, node)) == 2]
    assert {tuple(place[:2]) for place in places[0] & places[1]} == set(
        map(tuple, result.mesh.points[shared].round(12))
    )
    moved = dict(zip(map(tuple, result.mesh.points), stepped.displacement, strict=True))
    wanted = [moved[tuple(point[:2])] for point in read.points]
    np.testing.assert_array_equal(read.point_data["displacement"][:, :2], wanted)


def regions_of(mesh, node):
    return set(mesh.region[(mesh.cells == node).any(axis=1)].tolist())


def test_a_smooth_stress_between_two_cells_is_their_mean(tmp_path):
    mesh, frame = solid_result(1)
    series = ParaViewSeries(tmp_path / "solid.pvd", smooth=True)
    series.add({"step": 3, "time": 0.0, "position": 0.5}, frame, mesh)
    read = meshio.read(tmp_path / "solid_00003.vtu")
    found = read.point_data["nodal_cauchy_stress"]
    for node, place in enumerate(read.points):
        around = (np.abs(mesh.points[mesh.cells] - place).max(axis=2) < 1e-12).any(axis=1)
        same = around & (mesh.region == mesh.region[np.flatnonzero(around)[0]])
        np.testing.assert_allclose(found[node], frame.cauchy_stress[same].mean(axis=0), rtol=1e-12)
    refuses("skin=True or smooth=True", paraview, fake_result(), tmp_path / "a.pvd", skin=True, smooth=True)


def pressed(**more):
    motion = [
        ev.Press(indentation=0.4, speed=4.0, steps=4),
        ev.Wait(0.05, steps=2),
        ev.Press(indentation=0.2, speed=4.0, steps=2),
    ]
    return ev.simulate(ev.Scene(ev.FingerPad(ridges=False, resolution="coarse"), ev.Flat(), motion=motion))


@pytest.fixture(scope="module")
def result():
    return pressed()


def test_a_pin_is_as_deep_as_the_plate_stands_in_undeformed_skin(result):
    """Exactly: indentation less the height of the node above the lowest one, where that is positive."""
    found = export.touchsim(result, sample_rate=1000.0)
    x, points = found["location"][:, 0], result.mesh.points
    pad = points[result.mesh.node_sets["pad"]]
    height = np.array([pad[np.argmin(np.abs(pad[:, 0] - each)), 1] for each in x]) - pad[:, 1].min()
    # 0.1 s to 0.4 mm, held for 0.05 s, 0.05 s back to 0.2 mm
    time = np.arange(201) / 1000.0
    depth = np.interp(time, [0.0, 0.1, 0.15, 0.2], [0.0, 0.4, 0.4, 0.2])
    assert found["trace"].shape == (x.size, 201)  # class Stimulus of hsaal/touchsim: "trace (NxT array)"
    for k in (25, 50, 75, 100, 140, 200):  # of steps, where nothing is interpolated
        np.testing.assert_allclose(found["trace"][:, k], np.maximum(depth[k] - height, 0.0), atol=1e-9)
    assert (found["trace"].max(axis=1) > 0.0).all()
    assert (found["location"][:, 1] == 0.0).all()
    assert found["fs"] == 1000.0
    assert export.touchsim(result, pin_radius=0.2)["pin_radius"] == 0.2


def test_pins_do_not_overlap():
    """Nodes of ridges are unevenly spaced: two pins touch, and none are closer."""
    press = ev.Press(indentation=0.4, speed=4.0, steps=2)
    found = export.touchsim(ev.simulate(ev.Scene(ev.FingerPad(resolution="coarse"), ev.Flat(), motion=press)))
    distance = np.diff(np.sort(found["location"][:, 0]))
    assert distance.min() < 0.6 * distance.mean()
    assert 2.0 * found["pin_radius"] == pytest.approx(distance.min(), rel=1e-12)


def test_refused(result):
    still = ev.Scene(
        ev.FingerPad(ridges=False, resolution="coarse"), ev.Flat(), motion=ev.Press(indentation=0.1, steps=1)
    )
    refuses("no time passes", export.touchsim, ev.simulate(still))
    refuses("sample_rate", export.touchsim, result, sample_rate=0.0)
    refuses("pin_radius", export.touchsim, result, pin_radius=-1.0)


SMOOTH = ev.FingerPad(resolution="coarse", ridges=False)


def written(path):
    """Points (n, 2), cells (m, 4), potential (n,), field (m, 2), layer (m,)."""
    parts = meshio.read(path)
    cells, data = parts.cells_dict["quad"], parts.cell_data
    field = np.asarray(data["electric_field"][0])
    assert not field[:, 2].any()
    return parts.points[:, :2], cells, parts.point_data["potential"], field[:, :2], data["layer"][0]


def energy(points, cells, field, eps_r):
    """Energy of cells in N mm per mm of depth."""
    a, b = (points[cells[:, k + 2]] - points[cells[:, k]] for k in (0, 1))
    area = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    return 0.5 * ev.eps_0 * float(np.sum(eps_r * area * np.sum(field**2, axis=1)))


def test_the_field_of_plates(tmp_path):
    solved = ev.electrostatics.rigid_field([0.0, 0.4, 1.0], [0.05] * 3, slab=ev.FILM, voltage=100.0)
    path = fieldfiles.full_field(solved, tmp_path / "plates.vtu")
    points, cells, potential, field, layer = written(path)
    distance = 0.05 + 0.09 / 3.35
    strength = np.where(layer == 1, 1.0, 1.0 / 3.35) * 100.0 / distance
    assert field[:, 1] == pytest.approx(strength, rel=1e-9)
    assert np.all((points[cells].mean(axis=1)[:, 1] > 0.0) == (layer == 1))
    assert potential[points[:, 1] == -0.09] == pytest.approx(100.0)
    whole = 0.5 * 1e3 * solved.capacitance * 100.0**2
    assert energy(points, cells, field, np.where(layer == 1, 1.0, 3.35)) == pytest.approx(whole, rel=1e-9)


def test_the_field_below_a_finger_has_its_energy(tmp_path):
    """In the deformed state, insulator, air and skin; the midpoint rule misses a little."""
    motion = [ev.Press(force=0.02, steps=2)]
    scene = ev.Scene(SMOOTH, ev.Display(), ev.StrongTroxel(), 300.0, motion, field="full")
    result = ev.simulate(scene)
    path = fieldfiles.full_field_of_step(scene, result, tmp_path / "finger.vtu")
    points, cells, potential, field, layer = written(path)
    model = make_model(scene)
    position = model.mesh.points[model.pad.nodes] + result.frames[-1].displacement[model.pad.nodes]
    whole = 0.5 * model.attraction.solve(position).value * 300.0**2
    eps_r = np.array([3.35, 1.0, 1650.0])[layer]
    assert energy(points, cells, field, eps_r) == pytest.approx(whole, rel=0.01)
    assert potential.max() == pytest.approx(300.0)


def test_what_has_no_file_is_refused(tmp_path):
    plates = ev.electrostatics.rigid_field([0.0, 1.0], [0.1, 0.1])
    refuses(r"ends in \.vtu", fieldfiles.full_field, plates, tmp_path / "plates.msh")
    scene = ev.Scene(SMOOTH, ev.Display(), ev.StrongTroxel(), 10.0, [ev.Hover(gap=0.5)])
    result = ev.simulate(scene)
    refuses("with the full field", fieldfiles.full_field_of_step, scene, result, tmp_path / "finger.vtu")
    with pytest.raises(ev.InputError, match="whose fields are kept: 1"):
        fieldfiles.full_field_of_step(scene, result, tmp_path / "finger.vtu", 7)
    assert not list(tmp_path.iterdir())


@pytest.mark.xarray
def test_a_data_set_has_every_column_and_field_with_its_unit():
    result = fake_result()
    found = result.to_xarray()
    assert {name for name in result.columns if name != "step"} <= set(found.data_vars)
    for name in result.columns[1:]:
        np.testing.assert_array_equal(found[name], result[name])
        assert found[name].dims == ("step",)
        assert found[name].attrs["units"] == result.units[name]
    assert found.step.values.tolist() == result.step.tolist()
    last = found.sel(frame=result.frames[-1].step)
    for name in (*POINT_FIELDS, *CELL_FIELDS, "displacement"):
        found_as = f"{name}_of_nodes" if name in result.columns else name
        np.testing.assert_array_equal(last[found_as], getattr(result.frames[-1], name))
    np.testing.assert_array_equal(last.displacement.sel(axis="y"), result.frames[-1].displacement[:, 1])
    np.testing.assert_array_equal(last.cauchy_stress.sel(stress="xy"), result.frames[-1].cauchy_stress[:, 3])
    assert (found.gap.attrs["units"], found.contact_pressure.attrs["units"]) == ("mm", "MPa")
    np.testing.assert_array_equal(found.y, result.mesh.points[:, 1])


@pytest.fixture(scope="module")
def probed():
    probes = {"a 1": [[0.0, -5.2], [0.3, -5.2], [0.5, -5.0]], "contact": [[0.1, -5.1]]}
    output = ev.Output(probes=probes)
    return ev.simulate(ev.Scene(SMOOTH, ev.Display(), motion=[ev.Press(0.05, steps=2)], output=output))


def test_a_probe_has_a_table(probed):
    """As `probes.csv` has it, without time and name."""
    probe = probed.probes["a 1"]
    table = probe.table()
    of_second = np.asarray(table["step"]) == 2
    assert np.asarray(table["point"])[of_second].tolist() == [0, 1, 2]
    np.testing.assert_array_equal(np.asarray(table["y"])[of_second], probe.position[:, 1])
    np.testing.assert_array_equal(
        np.asarray(table["cauchy_stress_xy"])[of_second], probe.cauchy_stress[1, :, 0, 1]
    )
    np.testing.assert_array_equal(table["von_mises"], probe.von_mises.ravel())


@pytest.mark.xarray
def test_a_data_set_has_the_histories_of_probes(probed):
    found = probed.to_xarray()
    for name, probe in probed.probes.items():
        assert found[f"probe_{name}_displacement"].dims == ("step", f"probe_{name}_point", "axis")
        for quantity in ("position", "cauchy_stress", "principal_stretches", "von_mises"):
            np.testing.assert_array_equal(found[f"probe_{name}_{quantity}"], getattr(probe, quantity))
    stress = found["probe_a 1_cauchy_stress"].sel(row="y", column="y")
    np.testing.assert_array_equal(stress, probed.probes["a 1"].component("cauchy_stress_yy"))
    assert {stress.units, found["probe_a 1_displacement"].units} == {"MPa", "mm"}
    np.testing.assert_array_equal(found.contact_pressure.sel(frame=2), probed.frames[-1].contact_pressure)


def written_and_read(data, path, engine):
    """A data set from the file or folder that this engine of xarray makes of it."""
    import xarray

    if engine == "zarr":  # which has no consolidated metadata in its third format, and warns of them
        data.to_zarr(path, consolidated=False)
    else:
        data.to_netcdf(path, engine=engine)
    return xarray.load_dataset(path, engine=engine, **({"consolidated": False} if engine == "zarr" else {}))


@pytest.mark.xarray
@pytest.mark.parametrize("engine", ["netcdf4", "h5netcdf", "scipy", "zarr"])
def test_files_of_data_sets_hold_all_of_them(tmp_path, engine, probed):
    """Without frames too, and the table of a sweep of words, truth values and a point without a number."""
    from xarray.testing import assert_identical

    names = ("electrostatics.law", "finger.ridges", "min_gap.last", "status", "seconds", "message")
    values = [("kaczmarek", True, 0.1, "done", 1.0, ""), ("kaczmarek", False, None, "failed", 0.5, "µm?")]
    rows = [{"point": i, **dict(zip(names, row, strict=True))} for i, row in enumerate(values)]
    grid = {"electrostatics.law": ["kaczmarek"], "finger.ridges": [True, False]}
    swept = SweepResult(("point", *names), rows, {"grid": grid, "points": {"requested": 2}})
    for i, one in enumerate((fake_result(), replace(fake_result(), frames=[]), probed, swept)):
        data = one.to_xarray()
        found = written_and_read(data, tmp_path / str(i), engine)
        assert_identical(found, data)
        kinds = {name: found[name].dtype.kind for name in data.variables}
        assert [n for n, kind in kinds.items() if kind != data[n].dtype.kind and kind not in "OUT"] == []


def test_without_xarray_a_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    refuses(r"no xarray; allowed: pip install 'evfem\[xarray\]', or table\(\)", fake_result().to_xarray)
