"""Files of others: units, levelling, gaps, spectra, grey values, and what was done said."""

import re
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated
from unittest.mock import patch

import numpy as np
import pytest
from PIL import Image as Picture
from tools.refusals import refuses

from evfem import cli
from evfem.common.checks import Within, number
from evfem.errors import InputError
from evfem.studio import page
from evfem.textures import importers
from evfem.textures.importers import Image, Recording, Scan, Table, friction_profile, importer_of
from evfem.textures.importing import IMPORTERS, Heights
from evfem.textures.texture import Texture, read

SOURCE = {"licence": "CC0-1.0", "name": "mine", "note": "From my table."}


def csv(path, header, *columns):
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="")
    return path


def wav(path, samples, rate):
    data = np.rint(samples * 32767).astype("<i2").tobytes()
    form = struct.pack("<HHIIHH", 1, 1, rate, 2 * rate, 2, 16)
    body = b"WAVEfmt " + struct.pack("<I", 16) + form + b"data" + struct.pack("<I", len(data)) + data
    path.write_bytes(b"RIFF" + struct.pack("<I", len(body)) + body)
    return path


def test_heights_in_micrometres_are_levelled_and_both_is_said(tmp_path):
    x = np.arange(0.0, 4000.0, 10.0)
    wave = 5.0 * np.sin(2.0 * np.pi * x / 1000.0)
    texture = Table(**SOURCE, unit="um")(csv(tmp_path / "a.csv", "x,height", x, wave + 0.02 * x + 7.0))
    line = np.polynomial.Polynomial.fit(x, wave, 1)(x)
    np.testing.assert_allclose(texture.values, (wave - line) * 1e-3, atol=1e-9)
    assert texture.length == pytest.approx(3.99)
    assert texture.provenance == (
        "From a.csv.",
        "From my table.",
        "Lengths were in um.",
        "Levelled: line taken off.",
    )


HEADS = {
    "brackets": "X [mm]\tZ [um]",
    "parentheses": "x (mm);height (µm)",
    "slash": "x/mm\tz/um",
    "comma": "x, mm\theight, um",
    "quoted": '"x, mm","height, um"',
    "underscore": "x_mm,height_um",
    "blanks": "x [mm] z [um]",
    "line": "Position,Height\nmm,um",
    "nanometres": "x [um],z [nm]",
    "comment": "# x [mm],z [um]\n# taken on Tuesday",
}


@pytest.mark.parametrize("name", HEADS)
@pytest.mark.parametrize("coding", ["utf-8", "latin-1", "utf-16"])
def test_each_column_has_the_unit_that_the_header_says(tmp_path, name, coding):
    head = HEADS[name]
    x, z = np.arange(50) * 0.02, 2e-3 * np.cos(np.arange(50.0))  # mm
    larger = 1e3 if name == "nanometres" else 1.0
    first = head.split("\n")[0]
    separator = next((one for one in "\t;" if one in first), " " if name == "blanks" else ",")
    lines = [f"{larger * a:.9g}{separator}{larger * 1e3 * b:.9g}" for a, b in zip(x, z, strict=True)]
    (tmp_path / "p.txt").write_text("\n".join(["Stylus, 2 µm", head, *lines]), encoding=coding)
    kind, importer = importer_of(tmp_path / "p.txt")
    assert kind == "csv"
    texture = importer(**SOURCE, level="none")(tmp_path / "p.txt")
    np.testing.assert_allclose(texture.values, z, atol=1e-11)
    np.testing.assert_allclose(texture.x, x, atol=1e-9)
    assert "as the header says" in texture.provenance[2]


def test_a_column_without_a_unit_has_that_of_the_file_and_an_unknown_one_is_refused(tmp_path):
    rows = np.arange(50) * 0.02, np.sin(np.arange(50.0))
    path = csv(tmp_path / "a.csv", "x [mm],height", *rows)
    texture = Table(**SOURCE, level="none", unit="um")(path)
    assert np.abs(texture.values).max() == pytest.approx(1e-3, rel=1e-3)
    assert texture.provenance[2:4] == ("x in mm, as the header says.", "Other lengths were in um.")
    with pytest.raises(InputError, match=r"unit: given height in px; allowed: mm \| um"):
        Table(**SOURCE)(csv(tmp_path / "b.csv", "x [mm],height [px]", *rows))
    with pytest.raises(InputError, match=r"unit: given frequency in Hz; allowed: 1/mm"):
        Table(**SOURCE)(csv(tmp_path / "c.csv", "frequency [Hz],amplitude", *rows))


def test_heights_as_steep_as_a_wrong_unit_are_noted(tmp_path):
    x = np.arange(200) * 0.02
    wave = 5e-3 * np.sin(np.pi * x)  # slope 0.011
    for scale, noted in ((1.0, False), (1e3, True)):
        texture = Table(**SOURCE)(csv(tmp_path / "a.csv", "x,height", x, scale * wave))
        assert any("Rms slope 11.1" in note for note in texture.provenance) == noted


def test_decimal_commas_and_gaps(tmp_path):
    (tmp_path / "a.csv").write_text("x;height\n" + "\n".join(f"0,{i}0;0,0{i}" for i in range(1, 9)) + "\n")
    assert Table(**SOURCE)(tmp_path / "a.csv").provenance[2] == "Commas are decimal points."
    (tmp_path / "b.csv").write_text("x,height\n0,0\n1,nan\n2,\n3,3\n4,4\n5,5\n")
    texture = Table(**SOURCE, level="none")(tmp_path / "b.csv")
    assert texture.values.tolist() == pytest.approx([0.0, 1.0, 2.0, 3.0, 4.0, 5.0])


def test_columns_beside_the_two_and_rounded_places_are_no_obstacle(tmp_path):
    place = np.round(np.arange(200) / 30.0, 3)  # steps of 0.033 and 0.034 mm
    height = np.cos(np.arange(200.0))
    path = csv(tmp_path / "a.csv", "time [s],x [mm],height [um]", np.arange(200.0), place, height)
    path.write_text(path.read_text().replace("time", "number"))
    texture = Table(**SOURCE, level="none", smooth=0.01)(path)
    np.testing.assert_array_equal(texture.x, place)
    assert np.abs(texture.values).max() < 1.1e-3
    missing = csv(tmp_path / "b.csv", "x,height", [0.0, 1.0, np.nan, 3.0, 4.0], np.arange(5.0))
    assert Table(**SOURCE, level="none")(missing).x.tolist() == [0.0, 1.0, 3.0, 4.0]


def xyz(path, *columns):
    return csv(path, "x [um],y [um],z [um]", *(1e3 * one for one in columns))


@pytest.mark.parametrize("degrees", [0.0, 30.0, 90.0, 135.0, 200.0])
def test_a_line_keeps_its_length_however_it_lies(tmp_path, degrees):
    t = np.linspace(0.0, 2.0, 41) ** 1.1
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    height = 0.01 * np.sin(3.0 * t)
    path = xyz(tmp_path / "line.csv", 7.0 + cos * t, -3.0 + sin * t, height)
    texture = Table(**SOURCE, level="none")(path)
    np.testing.assert_allclose(texture.x, t, atol=1e-9)
    np.testing.assert_allclose(texture.values, height, atol=1e-9)
    found = re.search(r"Along a line at (\S+) degrees to x", " ".join(texture.provenance))
    assert float(found.group(1)) == pytest.approx(min(degrees % 180.0, 180.0 - degrees % 180.0), abs=1e-3)


@pytest.mark.parametrize(("row", "y"), [(0.0, 1.0), (0.5, 2.0), (1.0, 3.0)])
def test_a_grid_of_points_is_a_line_of_it_along_x(tmp_path, row, y):
    x, ys = np.meshgrid(np.linspace(0.0, 1.0, 5), [1.0, 2.0, 3.0])
    order = np.random.default_rng(0).permutation(x.size)
    rows = (one.ravel()[order] for one in (x, ys, ys * 0.01 * x**2))
    texture = Table(**SOURCE, level="none", row=row)(xyz(tmp_path / "grid.csv", *rows))
    np.testing.assert_allclose(texture.values, y * 0.01 * np.linspace(0.0, 1.0, 5) ** 2, atol=1e-12)
    assert texture.length == pytest.approx(1.0)
    assert f"Line {int(y)} of 3 along x." in texture.provenance


def test_points_on_no_line_and_no_grid_are_refused(tmp_path):
    x, y, z = np.random.default_rng(0).uniform(size=(3, 30))
    refuses(
        "30 points that are neither; allowed: points of x,y,z",
        Table(**SOURCE),
        xyz(tmp_path / "a.csv", x, y, z),
    )


@pytest.mark.parametrize("missing", [-1.7976931348623157e308, 3.4e38])
def test_the_largest_number_of_a_program_is_a_missing_point(tmp_path, missing):
    height = np.array([0.0, 1.0, missing, 3.0, 4.0])
    texture = Table(**SOURCE, level="none")(csv(tmp_path / "a.csv", "x,height", np.arange(5.0), height))
    assert texture.values.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert "1 of 5 values missing, filled by straight lines." in texture.provenance


def test_a_parabola_is_taken_off():
    x = np.linspace(0.0, 3.0, 50)
    _, height, notes = Heights(**SOURCE, level="parabola").cleaned(x, 1.0 + 2.0 * x - 3.0 * x**2)
    assert np.abs(height).max() < 1e-12
    assert notes == ["Levelled: parabola taken off."]


def test_more_than_half_missing_is_refused():
    height = np.array([1.0, np.nan, np.nan, np.nan, 2.0])
    refuses("3 of 5 missing", Heights(**SOURCE).cleaned, np.arange(5.0), height)


def test_a_cut_that_leaves_nothing_is_refused():
    refuses("0 of 5 points", Heights(**SOURCE, start=10.0).cleaned, np.arange(5.0), np.arange(5.0))


def test_smoothing_halves_a_wave_of_the_cut_off_length():
    x = np.arange(0.0, 40.0, 0.01)
    _, height, _ = Heights(**SOURCE, level="none", smooth=2.0).cleaned(x, np.sin(np.pi * x))
    assert np.ptp(height[1000:3000]) == pytest.approx(1.0, rel=5e-3)


def test_friction_is_kept_as_it_is(tmp_path):
    path = csv(tmp_path / "f.csv", "x,friction", [0.0, 1.0], [0.3, 0.5])
    texture = Table(**SOURCE)(path)
    assert (texture.quantity, texture.values.tolist()) == ("friction", [0.3, 0.5])


def test_a_recording_is_a_spectrum_over_the_spatial_frequency(tmp_path):
    time = np.arange(8000) / 4000.0
    samples = 0.4 * np.sin(2 * np.pi * 62.5 * time) + 0.3 * np.sin(2 * np.pi * 125.0 * time)
    path = wav(tmp_path / "r.wav", samples, 4000)
    texture = Recording(**SOURCE, speed=50.0, quantity="displacement")(path)
    assert texture.quantity == "friction_spectrum"
    strong = texture.x[texture.values > 0.2]
    assert np.all((np.abs(strong - 1.25) < 0.06) | (np.abs(strong - 2.5) < 0.06))
    power = [np.sum(texture.values[np.abs(texture.x - f) < 0.2] ** 2) for f in (1.25, 2.5)]
    assert power[0] / power[1] == pytest.approx((0.4 / 0.3) ** 2, rel=0.01)
    assert np.sum(texture.values**2) == pytest.approx(1.0)


def test_an_acceleration_is_divided_by_the_square_of_the_frequency(tmp_path):
    time = np.arange(8192) / 4096.0
    low, high = 2 * np.pi * 64.0, 2 * np.pi * 128.0
    path = csv(tmp_path / "a.csv", "time,acceleration", time, np.sin(low * time) + 4.0 * np.sin(high * time))
    texture = Recording(**SOURCE, speed=64.0)(path)
    power = [np.sum(texture.values[np.abs(texture.x - f) < 0.1] ** 2) for f in (1.0, 2.0)]
    assert power[0] / power[1] == pytest.approx(1.0, rel=0.02)


def hand_held(time):
    """Acceleration of a surface of 0.5 mm at 50 mm/s, and of a hand that drifts by 50 times as much."""
    wave, drift = 2 * np.pi * 100.0, 2 * np.pi * 3.0
    return 0.5 * np.sin(wave * time) + 50 * 0.5 * (drift / wave) ** 2 * np.sin(drift * time)


def test_an_acceleration_is_the_same_texture_in_a_table_and_in_a_wav_and_without_the_hand(tmp_path):
    time = np.arange(4000) / 1000.0
    samples = hand_held(time)
    table = Recording(**SOURCE, speed=50.0)(csv(tmp_path / "a.csv", "time,acceleration", time, samples))
    path = wav(tmp_path / "a.wav", samples, 1000)
    sound = Recording(**SOURCE, speed=50.0, quantity="acceleration")(path)
    for texture in (table, sound):
        near = np.abs(texture.x - 2.0) < 0.2
        assert np.sum(texture.values[near] ** 2) > 0.99
        assert texture.x[0] >= 0.1
    longer = Recording(**SOURCE, speed=50.0, quantity="acceleration", longest=20.0)(path)
    assert longer.x[np.argmax(longer.values)] == pytest.approx(3.0 / 50.0, rel=0.05)


def test_what_a_recording_holds_and_which_channel_must_be_said(tmp_path):
    time = np.arange(2000) / 1000.0
    one, other = np.sin(200 * np.pi * time), np.sin(100 * np.pi * time)
    with pytest.raises(InputError, match=r"quantity: given nothing, and r\.wav does not say"):
        Recording(**SOURCE, speed=50.0)(wav(tmp_path / "r.wav", one, 1000))
    path = csv(tmp_path / "xy.csv", "time [ms],X,Y", 1e3 * time, one, other)
    with pytest.raises(InputError, match=r"channel: given nothing, of 2; allowed: x \| y \| 1 \| 2"):
        Recording(**SOURCE, speed=50.0, quantity="velocity")(path)
    for channel, wave in (("X", 2.0), (1, 2.0), ("y", 1.0), ("2", 1.0)):
        texture = Recording(**SOURCE, speed=50.0, quantity="velocity", channel=channel)(path)
        assert texture.x[np.argmax(texture.values)] == pytest.approx(wave, rel=5e-3)
    twice = csv(tmp_path / "twice.csv", "time,velocity,velocity", time, one, other)
    with pytest.raises(InputError, match=r'channel: given "velocity"; allowed: 1 \| 2'):
        Recording(**SOURCE, speed=50.0, channel="velocity")(twice)
    wrong = csv(tmp_path / "a.csv", "time,acceleration", time, one)
    with pytest.raises(InputError, match="quantity: given height, of acceleration"):
        Recording(**SOURCE, speed=50.0, quantity="height")(wrong)


def test_a_spectrum_becomes_friction_of_the_size_that_is_said(tmp_path):
    time = np.arange(8000) / 4000.0
    path = wav(tmp_path / "r.wav", np.sin(400 * time), 4000)
    texture = Recording(**SOURCE, speed=50.0, quantity="friction")(path)
    friction = friction_profile(texture, mean=0.4, rms=0.05, length=20.0, seed=1)
    assert np.mean(friction.values) == pytest.approx(0.4, rel=1e-9)
    assert np.std(friction.values) == pytest.approx(0.05, rel=1e-9)
    refuses("rms", friction_profile, texture, mean=0.4, rms=0.5, length=20.0)


def spectrum(frequency, amplitude):
    return Texture("felt", "recorded", frequency, amplitude, "CC0-1.0", "friction_spectrum")


def test_friction_has_its_mean_and_rms_whatever_the_phases():
    """Tones that beat over more than the 10 mm: before, the rms was 0.044 to 0.055, by the seed."""
    tones = spectrum([0.11, 0.95, 1.02, 2.0], [0.5, 0.5, 0.5, 0.5])
    for seed in range(30):
        friction = friction_profile(tones, mean=0.4, rms=0.05, length=10.0, seed=seed)
        assert np.mean(friction.values) == pytest.approx(0.4, rel=1e-9)
        assert np.std(friction.values) == pytest.approx(0.05, rel=1e-9)
        assert friction.provenance[-1] == f"Friction 0.4 on average, rms 0.05, phases from seed {seed}."
    again = friction_profile(tones, mean=0.4, rms=0.05, length=10.0, seed=29)
    assert again.values.tolist() == friction.values.tolist()
    assert np.std(friction_profile(tones, mean=0.4, rms=0.0, length=10.0).values) < 1e-12
    refuses("felt, whose amplitudes are 0", friction_profile, spectrum([1.0, 2.0], [0.0, 0.0]), 0.4, 0.1, 1.0)


def test_friction_that_is_cut_off_at_0_says_what_it_has():
    """A sine of rms 0.4 about 0.4 is below 0 where its sine is below -1/sqrt(2), a quarter of the length:
    mean 0.4 (3/4 + 1/pi (1/sqrt(2)) sqrt(2)) = 0.4273.
    """
    wave = spectrum([1.0, 2.0], [1.0, 0.0])
    with pytest.warns(UserWarning, match="cut off at 0") as warned:
        friction = friction_profile(wave, mean=0.4, rms=0.4, length=100.0)
    assert np.min(friction.values) == 0.0
    assert np.mean(friction.values) == pytest.approx(0.4 * (0.75 + 1.0 / np.pi), rel=1e-3)
    has = f"Friction {np.mean(friction.values):.3g} on average, rms {np.std(friction.values):.3g}: cut off"
    assert friction.provenance[-1].startswith(f"{has} at 0 on 25 % of 100 mm, of mean 0.4, rms 0.4, phases")
    assert str(warned[0].message) == (
        f"felt: {friction.provenance[-1]} Up to an rms of about 0.28 nothing is cut off."
    )
    assert np.min(friction_profile(wave, mean=0.4, rms=0.28, length=100.0).values) > 0.0


def test_waves_that_the_rows_of_a_friction_profile_do_not_hold_are_refused():
    """20 waves per mm over 1000 mm were a slow drift in 20,000 rows."""
    fine = spectrum([1.0, 20.0], [0.6, 0.8])
    refused = refuses("length: given 1000 mm", friction_profile, fine, mean=0.4, rms=0.05, length=1000.0)
    assert "at most 250 mm, or a spectrum without waves below 0.2 mm" in str(refused)
    held = friction_profile(fine, mean=0.4, rms=0.05, length=250.0)
    assert held.x.size == 20_002
    power = np.abs(np.fft.rfft(held.values - 0.4)) ** 2
    at = np.fft.rfftfreq(held.x.size, held.x[1])
    assert np.sum(power[np.abs(at - 20.0) < 0.1]) / np.sum(power) == pytest.approx(0.64, abs=0.01)
    without = spectrum([1.0, 20.0], [1.0, 1e-4])  # which no one would feel
    assert friction_profile(without, mean=0.4, rms=0.05, length=1000.0).length == 1000.0


def test_grey_values_become_heights_of_the_depth_that_is_said(tmp_path):
    grey = np.zeros((5, 8), np.uint8)
    grey[2] = [0, 255, 0, 255, 0, 255, 51, 255]
    Picture.fromarray(grey).save(tmp_path / "cloth.png")
    texture = Image(**SOURCE, pixel=0.1, depth=0.2, level="none")(tmp_path / "cloth.png")
    assert texture.values.tolist() == pytest.approx([0.0, 0.2, 0.0, 0.2, 0.0, 0.2, 0.04, 0.2])
    assert texture.x[-1] == pytest.approx(0.7)
    assert any("not measured" in note for note in texture.provenance)


RAMP = np.array([[0.0, 0.25, 1.0, 0.5, 0.75, 0.0]])
GREYS = {
    "8.png": np.rint(255 * RAMP).astype(np.uint8),
    "16.png": np.rint(65535 * RAMP).astype(np.uint16),
    "16.tif": np.rint(65535 * RAMP).astype(np.uint16),
    "big.tif": np.rint(65535 * RAMP).astype(">u2"),
    "32.tif": np.rint(1e6 * RAMP - 3e5).astype(np.int32),
    "float.tif": (3.0 * RAMP + 1.0).astype(np.float32),
    "rgb.png": np.repeat(np.rint(255 * RAMP).astype(np.uint8)[..., None], 3, axis=2),
}


def raw(path, depth=0.1):
    return Image(**SOURCE, pixel=0.1, depth=depth, level="none")(path)


@pytest.mark.parametrize("name", GREYS)
def test_a_picture_has_all_its_greys_whatever_its_bits(tmp_path, name):
    Picture.fromarray(GREYS[name]).save(tmp_path / name)
    texture = raw(tmp_path / name)
    within = 1e-4 if GREYS[name].dtype.itemsize > 1 else 0.003
    np.testing.assert_allclose(texture.values, 0.1 * RAMP[0], atol=0.1 * within)
    assert any(note.startswith("Grey values") for note in texture.provenance)


def test_a_faint_picture_of_16_bits_is_a_share_of_white_and_not_of_its_brightest_point(tmp_path):
    Picture.fromarray(np.array([[0, 4095, 0, 4095]], np.uint16)).save(tmp_path / "a.png")
    assert raw(tmp_path / "a.png", 1.0).values.max() == pytest.approx(1.0 / 16.0, rel=1e-3)


def test_where_a_picture_is_transparent_there_is_a_gap(tmp_path):
    grey = np.array([[0, 200, 100, 150, 200]], np.uint8)
    seen = np.array([[255, 0, 255, 255, 255]], np.uint8)
    Picture.merge("LA", [Picture.fromarray(grey), Picture.fromarray(seen)]).save(tmp_path / "a.png")
    texture = raw(tmp_path / "a.png", 2.55)
    assert texture.values.tolist() == pytest.approx([0.0, 0.5, 1.0, 1.5, 2.0])
    assert "1 of 5 values missing, filled by straight lines." in texture.provenance


@pytest.mark.parametrize("name", ["a.png", "a.wav", "a.csv"])
def test_damaged_files_are_refused(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\xff\xff")
    readers = {
        "a.png": lambda: Image(**SOURCE, pixel=0.1, depth=0.1)(path),
        "a.wav": lambda: Recording(**SOURCE, speed=10.0, quantity="height")(path),
        "a.csv": lambda: Table(**SOURCE)(path),
    }
    refuses("file: given", readers[name])


def test_an_image_of_too_many_pixels_is_refused_before_it_is_decoded(tmp_path):
    Picture.new("1", (10_000, 5_000)).save(tmp_path / "large.png")
    refuses("10000 x 5000 pixels", Image(**SOURCE, pixel=0.1, depth=0.1), tmp_path / "large.png")


def test_missing_values_at_the_ends_of_a_tilted_scan_make_no_relief(tmp_path):
    """They were held at the first known height, and then levelled: 0.05 mm of relief on a plane."""
    x = np.arange(0.0, 12.0001, 0.02)
    height = 0.05 * x
    height[x < 1.0] = height[-3:] = np.nan
    height[300:310] = np.nan
    rows = np.column_stack([np.where(np.arange(x.size) % 100 == 99, np.nan, x), height])
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header="x,height", comments="")
    texture = Table(**SOURCE)(tmp_path / "a.csv")
    assert np.ptp(texture.values) < 1e-12
    assert texture.x[0] == 0.0
    assert texture.x[-1] == pytest.approx(x[-4] - 1.0)
    done = ["6 rows without x left out.", "52 missing values at the ends cut off."]
    assert [one for one in texture.provenance if one in done] == done


def test_without_the_extra_a_scan_is_refused_with_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr(importers, "find_spec", lambda name: None)
    refuses(r"evfem\[scans\]", Scan(**SOURCE), tmp_path / "a.x3p")


def test_an_importer_of_ones_own_is_found_by_its_ending_and_has_its_options(tmp_path, capsys):
    """One class: the command line and the page have its options."""
    with patch.dict(IMPORTERS):

        @dataclass(frozen=True, kw_only=True)
        class Stairs(Heights, kind="stairs"):
            """Steps of one height."""

            riser: Annotated[float, number("above zero", Within(0.0, above=True), "mm"), "height of a step"]
            endings = (".stairs",)

            def __call__(self, path):
                x = np.arange(8.0)
                return self.heights(Path(path), "stairs", x, self.riser * np.floor(x / 2.0), [])

        (tmp_path / "a.stairs").write_text("")
        words = ["texture", "import", str(tmp_path / "a.stairs"), "--licence", "CC0-1.0", "--level", "none"]
        words += ["--out", str(tmp_path / "a.json")]
        assert cli.main(words) == 2
        assert "--riser: missing" in capsys.readouterr().err
        assert cli.main([*words, "--riser", "0.1"]) == 0
        assert read(tmp_path / "a.json").values.max() == pytest.approx(0.3)
        assert b"Riser (mm): height of a step" in page.with_choices(b"<!-- importers -->")
