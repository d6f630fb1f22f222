"""Scans that evfem reads itself: x3p with heights as text, profiles, lists of points; tmd.

The structure of the x3p is that of the samples of the openGPS library (`ISO5436-sample1` to `sample4`, in
aschet/x3p, commit 71b6817), whose text and binary twins are read alike; their heights are in metres, as the
schema says, and refused as beyond 10 mm. The tmd of GelSight's `writetmd.py` has an empty comment.
"""

import struct
import zipfile

import numpy as np
import pytest
from tools.refusals import refuses

from evfem.textures.importers import Scan, importer_of

SOURCE = {"licence": "CC0-1.0", "level": "none"}
#: heights in um, rows along x
ROWS = np.array([[0.0, 4.0, 1.0, 3.0, 2.0], [5.0, 6.0, 7.0, 9.0, 8.0]])
AXIS = "<{0}><AxisType>{1}</AxisType><DataType>{2}</DataType>{3}</{0}>"
STEP = "<Increment>2e-5</Increment><Offset>0.1</Offset>"


def x3p(path, record3, kind="SUR", z=("D", ""), x=("I", STEP), size=(5, 2, 1), head="", **parts):
    """A container with this `Record3`, lengths in metres."""
    axes = AXIS.format("CX", x[0], "D", x[1]) + AXIS.format("CY", "I", "D", STEP) + AXIS.format("CZ", "A", *z)
    sizes = "".join(f"<Size{n}>{count}</Size{n}>" for n, count in zip("XYZ", size, strict=True))
    dimension = (
        f"<MatrixDimension>{sizes}</MatrixDimension>"
        if kind != "PCL"
        else "<ListDimension>10</ListDimension>"
    )
    record = f"<Record1><FeatureType>{kind}</FeatureType><Axes>{axes}</Axes></Record1>"
    root = '<p:ISO5436_2 xmlns:p="http://www.opengps.eu/2008/ISO5436_2">'
    with zipfile.ZipFile(path, "w") as file:
        file.writestr(
            "main.xml", f"{head}{root}{record}<Record3>{dimension}{record3}</Record3></p:ISO5436_2>"
        )
        for name, content in parts.items():
            file.writestr(f"bindata/{name}.bin", content)
    return path


def datums(texts):
    return (
        "<DataList>"
        + "".join(f"<Datum>{text}</Datum>" if text else "<Datum/>" for text in texts)
        + "</DataList>"
    )


def heights(path, row=0.0):
    texture = Scan(**SOURCE, row=row)(path)
    return 1e3 * texture.values, texture


@pytest.mark.parametrize("row", [0.0, 1.0])
def test_heights_as_text_are_in_metres(tmp_path, row):
    path = x3p(tmp_path / "a.x3p", datums(f"{h:.4E}" for h in 1e-6 * ROWS.ravel()))
    found, texture = heights(path, row)
    np.testing.assert_allclose(found, ROWS[int(row)], atol=1e-9)
    np.testing.assert_allclose(texture.x, 0.02 * np.arange(5))
    assert f"Line {int(row) + 1} of 2 along x." in texture.provenance


def test_whole_numbers_have_an_increment_and_an_offset_and_gaps_are_empty(tmp_path):
    texts = [f"{h:g}" for h in ROWS.ravel() * 10.0]
    texts[2] = ""
    integer = "I", "<Increment>1e-7</Increment><Offset>-2e-6</Offset>"
    found, texture = heights(x3p(tmp_path / "a.x3p", datums(texts), z=integer))
    np.testing.assert_allclose(found, [-2.0, 2.0, 1.5, 1.0, 0.0], atol=1e-9)  # straight through the gap
    assert "1 of 5 values missing, filled by straight lines." in texture.provenance


def test_other_axes_may_stand_beside_the_height(tmp_path):
    """As in sample 3: y, then z."""
    texts = [f"{1 + i // 5};{h:.4E}" for i, h in enumerate(1e-6 * ROWS.ravel())]
    np.testing.assert_allclose(heights(x3p(tmp_path / "a.x3p", datums(texts)), 1.0)[0], ROWS[1], atol=1e-9)


def test_a_list_of_points_is_a_line_or_a_grid(tmp_path):
    places = [(1e-5 * (i % 5), 1e-5 * (i // 5)) for i in range(10)]
    order = np.random.default_rng(1).permutation(10)
    texts = [f"{places[i][0]:.6E};{places[i][1]:.6E};{1e-6 * ROWS.ravel()[i]:.6E}" for i in order]
    found, texture = heights(
        x3p(tmp_path / "a.x3p", datums(texts), "PCL", x=("A", "<Increment>2</Increment>")), 1.0
    )
    np.testing.assert_allclose(found, ROWS[1], atol=1e-9)
    np.testing.assert_allclose(texture.x, 0.02 * np.arange(5), atol=1e-9)


def test_a_profile_whose_x_are_absolute_is_that_of_its_points(tmp_path):
    """ISO 25178-72: of an axis of type A each datum has its own x."""
    texts = [
        f"{x:.6E};0;{1e-6 * height:.6E}"
        for x, height in zip((0.0, 1e-5, 2e-5, 4e-5), (0, 2, 1, 3), strict=True)
    ]
    path = x3p(tmp_path / "a.x3p", datums(texts), "PRF", x=("A", ""), size=(4, 1, 1))
    _, texture = heights(path, 0.0)
    assert np.ptp(texture.x) == pytest.approx(0.04)


def test_a_profile_in_a_part_of_its_own_knows_its_valid_points(tmp_path):
    link = "<DataLink><PointDataLink>bindata/data.bin</PointDataLink>{}</DataLink>"
    data = {"data": (ROWS[0] * 1e3).astype("<i4").tobytes()}
    integer = "L", "<Increment>1e-9</Increment>"
    path = x3p(tmp_path / "a.x3p", link.format(""), "PRF", integer, size=(5, 1, 1), **data)
    np.testing.assert_allclose(heights(path)[0], ROWS[0], atol=1e-9)
    valid = "<ValidPointsLink>bindata/valid.bin</ValidPointsLink>"
    bits = {"valid": bytes([0b11101])}
    path = x3p(tmp_path / "b.x3p", link.format(valid), "PRF", integer, size=(5, 1, 1), **data, **bits)
    np.testing.assert_allclose(heights(path)[0], [0.0, 0.5, 1.0, 3.0, 2.0], atol=1e-9)


@pytest.mark.parametrize(
    ("data", "more"),
    [
        ("<DataList><Datum>1</Datum></DataList>", {}),
        (datums(["1"] * 9 + ["much"]), {}),
        (datums(["1"] * 10), {"x": ("A", "")}),
        (datums(["1"] * 10), {"size": (5, 1, 2)}),
        ("<DataLink><PointDataLink>bindata/none.bin</PointDataLink></DataLink>", {"kind": "PRF"}),
        (datums(["1e-6"] * 10), {"head": "<!DOCTYPE x []>"}),
        ("<DataList>", {}),
    ],
)
def test_a_damaged_container_is_refused(tmp_path, data, more):
    refuses(
        "file: given a.x3p, damaged or of another kind", Scan(**SOURCE), x3p(tmp_path / "a.x3p", data, **more)
    )


def tmd(path, comment, heights=ROWS * 1e-3):
    rows, columns = heights.shape
    head = struct.pack("<IIffff", columns, rows, 0.1, 0.04, 0.0, 0.0)
    path.write_bytes(
        b"Binary TrueMap Data File v2.0\r\n\0" + comment + head + heights.astype("<f4").tobytes()
    )
    return path


@pytest.mark.parametrize("comment", [b"\0", b"Created by TrueMap v6\r\n\0", b"Mini 2023\0"])
def test_a_tmd_may_have_any_comment(tmp_path, comment):
    path = tmd(tmp_path / "a.tmd", comment)
    assert importer_of(path)[0] == "scan"
    found, texture = heights(path, 1.0)
    np.testing.assert_allclose(found, ROWS[1], rtol=1e-6)
    np.testing.assert_allclose(texture.x, 0.02 * np.arange(5), rtol=1e-6)
    path.write_bytes(path.read_bytes()[:-4] + b"\1\0\xa0\x7f")  # a number that signals that it is none
    assert "1 missing values at the ends cut off." in heights(path, 1.0)[1].provenance
    path.write_bytes(path.read_bytes()[:-4])
    refuses("file: given a.tmd, damaged or of another kind", Scan(**SOURCE), path)


@pytest.mark.scans
@pytest.mark.filterwarnings("ignore::ImportWarning")
@pytest.mark.parametrize("row", [0.0, 0.5, 1.0])
def test_a_tmd_of_truemap_is_that_of_surfacetopography(tmp_path, row):
    """SurfaceTopography 1.27 reads a comment of 24 bytes."""
    import SurfaceTopography

    path = tmd(tmp_path / "a.tmd", b"Created by TrueMap v6\r\n\0", np.arange(15.0).reshape(3, 5) ** 2 * 1e-3)
    theirs = SurfaceTopography.open_topography(str(path)).topography()
    found, texture = heights(path, row)
    np.testing.assert_allclose(found, 1e3 * theirs.heights()[:, round(2 * row)], rtol=1e-6)
    assert texture.length == pytest.approx(theirs.physical_sizes[0] * 4 / 5)
