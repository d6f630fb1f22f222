"""Scans through SurfaceTopography (evfem[scans]): units, lines, gaps."""

import struct

import numpy as np
import pytest
from tools.refusals import refuses

from evfem.errors import InputError
from evfem.textures.importers import Scan, Table

pytestmark = [pytest.mark.scans, pytest.mark.filterwarnings("ignore::ImportWarning")]
SOURCE = {"licence": "CC0-1.0"}
X = (np.arange(64) + 0.5) * 2.0 / 64
HEIGHT = 0.01 * np.sin(2.0 * np.pi * X)  # mm


def write_scan(path, unit, scale):
    from SurfaceTopography import Topography

    lines = HEIGHT[:, None] * np.array([1.0, 2.0, 3.0]) / scale
    topography = Topography(lines, physical_sizes=(2.0 / scale, 0.1 / scale), unit=unit)
    getattr(topography, "to_x3p" if path.suffix == ".x3p" else "to_netcdf")(str(path))


@pytest.mark.parametrize(("name", "unit", "scale"), [("a.nc", "µm", 1e-3), ("a.x3p", "m", 1e3)])
@pytest.mark.parametrize(("row", "factor"), [(0.0, 1.0), (0.5, 2.0), (1.0, 3.0)])
def test_a_line_of_a_scan_is_in_millimetres(tmp_path, name, unit, scale, row, factor):
    write_scan(tmp_path / name, unit, scale)
    texture = Scan(**SOURCE, row=row, level="none")(tmp_path / name)
    np.testing.assert_allclose(texture.values, factor * HEIGHT, atol=1e-8)
    np.testing.assert_allclose(texture.x, X - X[0], atol=1e-9)
    assert f"Line {round(row * 2) + 1} of 3" in texture.provenance[1]


@pytest.mark.parametrize(("unit", "size"), [("pm", 1e-9), ("Å", 1e-7), ("µm", 1e-3)])
def test_units_are_those_of_surfacetopography(tmp_path, unit, size):
    """By definition; Keyence's files are in pm."""
    write_scan(tmp_path / "a.nc", unit, size)
    texture = Scan(**SOURCE, unit="cm", row=0.0, level="none")(tmp_path / "a.nc")  # the file's own counts
    np.testing.assert_allclose(texture.values, HEIGHT, rtol=1e-6, atol=1e-9)
    assert texture.length == pytest.approx(X[-1] - X[0], rel=1e-6)


def test_where_the_unit_of_a_file_is_unknown_the_one_that_is_said_counts(tmp_path):
    write_scan(tmp_path / "a.nc", "pixels", 0.1)
    refuses("unit: given a.nc, in pixels; allowed: one of mm", Scan(**SOURCE), tmp_path / "a.nc")
    texture = Scan(**SOURCE, unit="um", row=0.0, level="none")(tmp_path / "a.nc")
    np.testing.assert_allclose(texture.values, HEIGHT / 0.1 * 1e-3, rtol=1e-6, atol=1e-9)


def test_a_lacking_point_of_an_sdf_is_filled(tmp_path):
    """ISO 25178-71 in doubles, with the smallest one where a point is lacking, as surfalize writes it."""
    heights = np.tile(np.arange(6.0), (3, 1))  # um
    heights[1, 2] = -np.finfo(float).max
    head = struct.pack(
        "<8s10s12s12sHHddddBBB", b"bISO-1.0", b"test", b"0", b"0", 6, 3, 1e-4, 1e-4, 1e-6, -1.0, 0, 7, 0
    )
    (tmp_path / "a.sdf").write_bytes(head + heights.astype("<f8").tobytes())
    texture = Scan(**SOURCE, level="none")(tmp_path / "a.sdf")
    np.testing.assert_allclose(texture.values, 1e-3 * np.arange(6.0), atol=1e-12)
    assert "1 of 6 values missing, filled by straight lines." in texture.provenance


def test_a_file_without_a_unit_needs_one(tmp_path):
    np.savetxt(tmp_path / "a.xyz", np.column_stack([X, HEIGHT]))
    refuses(r"unit: given .*without a unit", Scan(**SOURCE), tmp_path / "a.xyz")
    texture = Scan(**SOURCE, unit="mm", level="none")(tmp_path / "a.xyz")
    np.testing.assert_allclose(texture.values, HEIGHT, atol=1e-9)


@pytest.mark.parametrize("name", ["a.x3p", "a.sur", "a.xyz"])
def test_a_damaged_file_is_refused(tmp_path, name):
    (tmp_path / name).write_bytes(b"PK\x03\x04 nothing of that kind")
    refuses("file: given", Scan(**SOURCE), tmp_path / name)


def test_a_foreign_csv_is_left_to_surfacetopography(tmp_path):
    """A matrix as Gwyddion exports it, in um below comments, called .csv; not columns with other names."""
    lines = "\n".join("\t".join(f"{1e3 * h:.6f}" for h in factor * HEIGHT) for factor in (1.0, 2.0, 3.0))
    (tmp_path / "a.csv").write_text(f"# Width: 2 mm\n# Height: 0.1 mm\n# Value units: um\n{lines}\n")
    texture = Table(**SOURCE, level="none")(tmp_path / "a.csv")
    np.testing.assert_allclose(texture.values, 2.0 * HEIGHT, atol=1e-8)
    assert texture.kind == "scan"
    (tmp_path / "b.csv").write_text("a,b\n1,2\n3,4\n")
    with pytest.raises(InputError, match=r"b\.csv, which starts with 'a,b'; allowed: x,height \| x,friction"):
        Table(**SOURCE)(tmp_path / "b.csv")
    (tmp_path / "c.csv").write_text("nothing\n")
    refuses(r"c\.csv without a line of numbers", Table(**SOURCE), tmp_path / "c.csv")
