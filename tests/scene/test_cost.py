"""The CPU time that a plan says, beside that of runs."""

import csv
from pathlib import Path

import pytest

import evfem as ev
from evfem.planning.cost import needed_time
from evfem.scene.file import loads
from evfem.studies.campaign.drawing import draw
from evfem.studies.campaign.tables import text_of, with_files


@pytest.mark.parametrize(
    ("resolution", "ridges", "steps", "seconds"),
    [
        ("coarse", "none", (4, 5), 2.5),
        ("medium", "none", (4, 0), 6.5),
        ("coarse", "none", (3, 40), 3.1),
        ("coarse", "across", (3, 5), 12.7),
        ("coarse", "along", (8, 15), 30.0),
        ("fine", "none", (3, 3), 33.7),
        ("coarse", "whorl", (8, 10), 106.0),
    ],
)
def test_the_time_said_is_that_of_fingertips(resolution, ridges, steps, seconds):
    """CPU seconds of presses to 0.3 to 1 N and slides under a voltage, measured once."""
    pressed, slid = steps
    motion = [ev.Press(force=0.5, steps=pressed), *([ev.Slide(1.0, steps=slid)] if slid else [])]
    finger = ev.Fingertip(resolution=resolution, ridges=ridges)
    least, most = needed_time(ev.Scene(finger, ev.Display(), motion=motion), finger.mesh())
    assert least < seconds / 1.2 < 1.2 * seconds < most
    assert most <= 6.5 * least


@pytest.mark.parametrize(
    ("E", "steps", "seconds"), [(10.0, (1, 0), 11.4), (1e4, (2, 0), 20.0), (1e4, (2, 2), 30.0)]
)
def test_the_time_said_has_that_of_an_elastic_surface_in_space(E, steps, seconds):
    """CPU seconds of coarse fingertips over 3 mm of it, measured once; rigid they take 1.1 s."""
    pressed, slid = steps
    motion = [ev.Press(force=0.3, steps=pressed), *([ev.Slide(1.0, steps=slid)] if slid else [])]
    finger = ev.Fingertip(resolution="coarse", ridges="none")
    ground = ev.Flat(friction=0.3, elastic=ev.ElasticLayer(E, 0.4, 3.0))
    least, most = needed_time(ev.Scene(finger, ground, motion=motion), finger.mesh())
    assert least < seconds < most


def test_the_time_said_is_that_of_nine_of_ten_drawn_scenes(tmp_path):
    """Every sixteenth of the 370 scenes whose ends and CPU seconds, without those of packages, are kept."""
    with (Path(__file__).parents[1] / "tools/ends.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["end"] == "equilibrium"][::16]
    packages, below, above = 0.5, 0, 0
    for row in rows:
        drawn = with_files(draw(int(row["seed"]), int(row["scene"])), tmp_path)
        scene = loads(text_of(drawn), tmp_path)
        least, most = needed_time(scene, scene.finger.mesh())
        seconds = packages + float(row["cpu_s"])
        below += seconds < least
        above += seconds > most
    assert below <= 0.1 * len(rows)
    assert above <= 0.1 * len(rows)
