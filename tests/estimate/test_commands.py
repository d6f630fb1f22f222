"""`evfem texture`: files in and out, one sentence for a mistake, and nothing written then."""

import json
import re

import numpy as np
import pytest
from PIL import Image

from evfem import cli
from evfem.circuit.signalfile import read_signal
from evfem.circuit.signals import VoltageProfile
from evfem.textures.library import names
from evfem.textures.texture import read


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def run(*words):
    return cli.main(["texture", *words])


def test_the_list_has_a_line_for_every_reference_texture(capsys):
    assert run("list") == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == names()


def test_what_is_made_is_shown(capsys):
    assert run("make", "self_affine", "--hurst", "0.8", "--seed", "3", "--out", "rough.json") == 0
    assert run("show", "rough.json") == 0
    out = capsys.readouterr().out
    assert "hurst 0.8, seed 3" in out
    assert "licence: CC0-1.0" in out
    assert read("rough.json").name == "rough"


def test_an_image_is_imported_with_what_it_cannot_know(tmp_path, capsys):
    Image.fromarray(np.tile(np.arange(0, 250, 5, dtype=np.uint8), (3, 1))).save("cloth.png")
    words = ("import", "cloth.png", "--licence", "CC0-1.0", "--out", "cloth")
    assert run(*words) == 2
    assert "--pixel" in capsys.readouterr().err
    assert run(*words, "--pixel", "0.1", "--depth", "0.2", "--unit", "um") == 2
    assert "--unit" in capsys.readouterr().err
    assert not (tmp_path / "cloth").exists()
    assert run(*words, "--pixel", "0.1", "--depth", "0.2", "--level", "mean") == 0
    assert json.loads((tmp_path / "cloth/texture.json").read_text())["licence"] == "CC0-1.0"


def test_a_recording_is_imported_with_what_it_holds(capsys):
    from scipy.io import wavfile

    time = np.arange(2000) / 1000.0
    wavfile.write("hum.wav", 1000, np.column_stack([np.sin(200 * np.pi * time), np.cos(400 * time)]))
    words = ("import", "hum.wav", "--licence", "CC0-1.0", "--out", "hum", "--speed", "50")
    assert run(*words, "--channel", "1") == 2
    assert "quantity: given nothing" in capsys.readouterr().err
    assert run(*words, "--quantity", "velocity") == 2
    assert "channel: given nothing, of 2" in capsys.readouterr().err
    assert run(*words, "--quantity", "velocity", "--channel", "1", "--longest", "4") == 0
    assert "- Waves of up to 4 mm." in capsys.readouterr().out
    assert read("hum").x[0] == pytest.approx(0.25, abs=0.03)
    assert run(*words, "--quantity", "velocity", "--channel", "1", "--longest", "0") == 2


def friction_in(path):
    return np.loadtxt(path, delimiter=",", skiprows=1).T


def test_a_recording_becomes_a_signal_in_one_command(tmp_path, capsys):
    """The same numbers as by import; waves of 20 mm/s / 40 Hz, whose friction under the finger is theirs."""
    time = np.arange(8000) / 2000.0
    np.savetxt("rec.csv", np.column_stack([time, np.sin(80.0 * np.pi * time)]), delimiter=",",
               header="time,friction", comments="")  # fmt: skip
    size = ("--friction-mean", "0.4", "--friction-rms", "0.05", "--load", "0.02")
    whole = ("rec.csv", *size, "--speed", "20", "--length", "2")
    assert run("import", "rec.csv", "--licence", "CC0-1.0", "--speed", "20", "--out", "rec.json") == 2
    assert "would replace rec.csv, which is no texture's; allowed: another name, as rec-texture.json" in (
        capsys.readouterr().err
    )
    words = ("import", "rec.csv", "--licence", "CC0-1.0", "--speed", "20", "--out", "rec-texture.json")
    assert run(*words) == 0
    for command in ("estimate", "simulate"):
        assert run(command, *whole, "--out", f"{command}.csv", "--signal", f"{command}.wav") == 0
        assert run(command, "rec-texture.json", *whole[1:], "--out", "other.csv") == 0
        assert (tmp_path / "other.csv").read_text() == (tmp_path / f"{command}.csv").read_text()
        x, friction = friction_in(f"{command}.csv")
        assert np.mean(friction) == pytest.approx(0.4, rel=0.02)
        turns = np.flatnonzero(np.diff(np.sign(friction - np.mean(friction))))
        assert np.ptp(x[turns]) / (len(turns) - 1) == pytest.approx(0.25, rel=0.1)  # half a wave
    assert np.std(friction) < 0.05  # averaged over the contact
    assert run("estimate", *whole, "--seed", "1", "--out", "other.csv") == 0
    assert not np.allclose(friction_in("other.csv")[1], friction_in("estimate.csv")[1], atol=0.01)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["rec.csv", "--friction-mean", "0.4"], "--speed: missing; allowed: the speed in mm/s at which rec"),
        (["rec.csv", "--speed", "20"], "--friction-mean: missing; .*rec is a spectrum without a size"),
        (
            ["rec.csv", "--speed", "20", "--friction-mean", "0.4"],
            "--friction-rms: missing; .*to the mean: rec",
        ),
        (
            ["rec.csv", "--speed", "20", "--friction-mean", "0.4", "--friction-rms", "0.5"],
            "--friction-rms: given 0.5; allowed: a number from 0 to the mean",
        ),
        (["weave", "--friction-rms", "0.1"], "--friction-rms: given 0.1 beside weave, no spectrum"),
        (["rec.txt"], "texture: given rec.txt; allowed: `evfem texture import` makes a texture of it"),
    ],
)
def test_what_a_recording_does_not_say_is_asked_for(tmp_path, capsys, words, said):
    time = np.arange(800) / 2000.0
    rows = np.column_stack([time, np.sin(80.0 * np.pi * time)])
    np.savetxt("rec.csv", rows, delimiter=",", header="time,friction", comments="")
    (tmp_path / "rec.txt").write_text("x,height\n0,0\n1,0\n")
    for command in ("simulate", "estimate"):
        assert run(command, *words) == 2
        assert re.search(said, capsys.readouterr().err)


def test_a_licence_is_needed(capsys):
    assert run("import", "a.csv", "--out", "a.json") == 2
    assert "--licence" in capsys.readouterr().err


def test_an_estimate_becomes_files(capsys):
    assert run("estimate", "wave-2mm", "--out", "mu.csv", "--signal", "wave.wav") == 0
    told = capsys.readouterr().out
    assert "can be rendered" in told or "cannot be rendered" in told
    assert 0.2 < np.loadtxt("mu.csv", delimiter=",", skiprows=1)[:, 1].mean() < 0.4
    assert read_signal("wave.wav").voltage.max() > 100.0


def test_a_voltage_beyond_the_limit_is_told_and_ends_with_a_status(capsys):
    """100 V of the 3.8 kV that the model needs: nothing of the texture is left."""
    words = ("simulate", "wave-2mm", "--length", "0.5", "--exact", "--display", "0.2", "--signal", "a.wav")
    assert run(*words, "--voltage-max", "100") == 1
    told = capsys.readouterr()
    assert "100% of the slide cannot be rendered" in told.out
    assert "100% of the slide is beyond the limits of the voltage" in told.err
    assert "Comparison(" not in told.out
    assert run("estimate", "wave-2mm", "--voltage-max", "100", "--signal", "a.wav") == 1
    assert "beyond the limits of the voltage" in capsys.readouterr().err


def test_a_signal_does_not_replace_the_rows_of_a_texture(tmp_path, capsys):
    """Beside `bumps.json` a `bumps.csv` has its heights."""
    assert run("make", "grating", "--out", "bumps.json") == 0
    VoltageProfile([0.0, 1.0], [0.0, 100.0]).to_csv("ramp.csv")
    rows = (tmp_path / "bumps.csv").read_bytes()
    assert cli.main(["signal", "ramp.csv", "--out", "bumps.csv"]) == 2
    assert "has the rows of a texture" in capsys.readouterr().err
    assert (tmp_path / "bumps.csv").read_bytes() == rows


def test_roughness_is_an_option_and_smooth_faces_are_doubted(capsys):
    """With 5 um of air the voltage grows by (g + s) / s, s = 0.38 / 1650 + 0.001 / 3.9."""
    words = ("estimate", "wave-2mm", "--law", "strong_troxel", "--insulator", "touchscreen")
    found = []
    for gap in ("0", "0.005"):
        assert run(*words, "--roughness-gap", gap, "--signal", "a.csv") == 0
        found.append((capsys.readouterr().err, read_signal("a.csv").voltage.max()))
    (smooth, low), (rough, high) = found
    reduced = 0.38 / 1650.0 + 0.001 / 3.9
    assert high / low == pytest.approx((0.005 + reduced) / reduced, rel=1e-3)
    assert "see roughness_gap" in smooth
    assert "roughness_gap" not in rough


def test_an_estimate_outside_the_database_has_no_error(capsys):
    assert run("make", "grating", "--frequency", "1.25", "--amplitude", "0.012", "--out", "sq.json") == 0
    assert run("estimate", "sq.json") == 0
    told = capsys.readouterr()
    assert "error unknown" in told.out
    assert "+-" not in told.out
    assert "wavelength 0.8 is outside the database" in told.err


@pytest.mark.parametrize(
    "words",
    [
        ("show", "nothing"),
        ("show", "no.json"),
        ("estimate", "weave", "--signal", "a.mp3"),
        ("estimate", "weave", "--out", "a.txt"),
        ("estimate", "weave", "--load", "-1"),
        ("simulate", "weave", "--law", "coulomb"),
        ("make", "grating", "--frequency", "0", "--out", "a.json"),
        ("make", "grating", "--out", "a.txt"),
        (),
    ],
)
def test_mistakes_are_one_sentence_and_nothing_is_written(tmp_path, capsys, words):
    assert run(*words) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) <= 3
    assert list(tmp_path.iterdir()) == []
