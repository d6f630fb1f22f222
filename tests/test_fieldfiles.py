"""The full field as files for ParaView."""

import meshio
import numpy as np
import pytest

import evfem as ev
from evfem import fieldfiles
from evfem.simulation.model import make_model

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
    with pytest.raises(ev.InputError, match=r"ends in \.vtu"):
        fieldfiles.full_field(plates, tmp_path / "plates.msh")
    scene = ev.Scene(SMOOTH, ev.Display(), ev.StrongTroxel(), 10.0, [ev.Hover(gap=0.5)])
    result = ev.simulate(scene)
    with pytest.raises(ev.InputError, match="with the full field"):
        fieldfiles.full_field_of_step(scene, result, tmp_path / "finger.vtu")
    with pytest.raises(ev.InputError, match="whose fields are kept: 1"):
        fieldfiles.full_field_of_step(scene, result, tmp_path / "finger.vtu", 7)
    assert not list(tmp_path.iterdir())
