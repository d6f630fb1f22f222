"""The page about a run: one file that is whole, true and harmless, from Python and from a folder."""

import base64
import os
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from tools.commands import called
from tools.domes import dome_scene
from tools.fakes import SQUARE_SCENE, fake_result
from tools.meshes import square_mesh
from tools.refusals import refuses

import evfem as ev
from evfem.mesh import file as meshfile
from evfem.sweeps.check import Checked

SCENE = f"""{SQUARE_SCENE}
[[motion]]
kind = "press"
indentation = 0.2
steps = 2
"""
#: elements that need no end
VOID = {"meta", "img", "br", "wbr"}


class Reader(HTMLParser):
    """Texts, elements and pictures of a page; every element ends where it should."""

    def __init__(self, text):
        super().__init__()
        self.open, self.seen, self.images, self.cells, self.rows = [], [], [], [], []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attributes):
        self.seen.append((tag, dict(attributes)))
        if tag == "img":
            self.images.append(dict(attributes))
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.cells.append(data)
        if self.open and self.open[-1] in ("td", "th"):
            self.rows[-1][-1] += data

    @property
    def text(self):
        return " ".join(self.cells)

    def row(self, name):
        """The cells of the first row that begins so."""
        return next(row for row in self.rows if row and row[0] == name)


def page_of(result, folder, **more):
    result.report(folder / "page.html", **more)
    return Reader((folder / "page.html").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def slid():
    finger = ev.FingerPad(ridges=False, resolution="coarse")
    motion = [ev.Press(force=0.05, steps=2), ev.Slide(2.0, steps=3)]
    return ev.simulate(ev.Scene(finger, ev.Display(), ev.Kaczmarek(), 400.0, motion, depth=10.0))


def test_the_page_needs_no_other_file_and_runs_nothing(slid, tmp_path):
    found = page_of(slid, tmp_path)
    tags = {tag for tag, _ in found.seen}
    assert not tags & {"script", "link", "iframe", "object", "form", "a"}
    for tag, attributes in found.seen:
        assert not [name for name in attributes if name.startswith("on") or name in ("href", "srcset")]
        assert tag == "img" or "src" not in attributes
    style = re.search("<style>(.*)</style>", (tmp_path / "page.html").read_text(), re.S)[1]
    assert "url(" not in style
    assert "@import" not in style
    assert len(found.images) == 3
    softly = 1e3 * slid.frames[-1].contact_pressure.max()
    assert f"at most {softly:.3g} kPa" in found.images[2]["alt"]
    for image in found.images:
        head, data = image["src"].split(",")
        assert head == "data:image/png;base64"
        assert base64.b64decode(data, validate=True)[:4] == b"\x89PNG"
        assert len(image["alt"]) > 20
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]


def test_its_numbers_are_those_of_the_run_over_its_depth(slid, tmp_path):
    found, whole = page_of(slid, tmp_path), slid.total
    for name in ("normal_force", "contact_width", "friction", "stored_energy"):
        # a width over a depth is an area
        _, value, unit, meaning = found.row(name.replace("width", "area"))
        assert float(value) == pytest.approx(whole[name][-1], rel=1e-4)
        assert unit.replace("mm²", "mm2") == whole.units[name]
        assert meaning == slid.meanings[name]
    last = found.row("5")
    assert last[1] == "slide"
    assert float(last[6]) == pytest.approx(whole.normal_force[-1], rel=1e-4)
    largest = f"{whole.normal_force.max():.4g} N"
    assert any(largest in image["alt"] for image in found.images)
    assert "over a depth of 10 mm" in found.text
    assert 'kind = "slide"' in found.text
    assert "Kaczmarek law" in found.text
    assert found.row("numpy")[1] == slid.provenance["versions"]["numpy"]
    assert found.row("scene (digest)")[1] == slid.provenance["scene"]["digest"]
    left = float(found.row("energy that the balance leaves over, of the largest work")[1])
    assert 0.0 < left < 1e-7


def test_warnings_per_mm_of_depth_say_so_beside_forces_in_newtons(slid, tmp_path):
    """A page in N said "0.0202 N/mm" without a word."""
    assert "0.01 N/mm are" not in page_of(slid, tmp_path).text
    said = ["the attraction, 0.0202 N/mm in step 1, is 2 times the load, which is 0.01 N/mm at most"]
    warned = replace(slid, provenance={**slid.provenance, "warnings": said})
    found = page_of(warned, tmp_path)
    assert "These warnings are per mm of depth: 0.01 N/mm are 0.1 N over the depth of 10 mm." in found.text
    assert "what is in N/mm (warnings, checks, scene, plan) is per mm of it" in found.text


def test_an_unbalanced_history_is_told(slid, tmp_path):
    """A tenth of the work of the bone is lost."""
    broken = replace(slid, external_work=0.9 * slid.external_work)
    left = page_of(broken, tmp_path).row("energy that the balance leaves over, of the largest work")[1]
    assert float(left) == pytest.approx(0.1 / 0.9, rel=0.05)


def test_what_comes_from_the_run_is_escaped(tmp_path):
    evil = '</pre><script>alert("1")</script>&'
    about = {"scene": {"name": evil, "total_steps": 4}, "parameters": evil, "warnings": [evil]}
    about |= {
        "versions": {evil: evil},
        "solver": {"backend": evil},
        "columns": [("friction_of_me", evil, evil)],
    }
    result = fake_result(provenance=about, rooms=("friction_of_me",))
    found = page_of(result, tmp_path)
    assert not [tag for tag, _ in found.seen if tag == "script"]
    assert found.text.count('alert("1")') >= 7
    assert "There is no plan" in found.text


def test_warnings_come_first_and_a_run_that_ended_early_says_so(tmp_path):
    about = {"scene": {"name": "x", "total_steps": 9}, "warnings": ["the skin passed through the surface"]}
    result = fake_result(provenance=about)
    found = page_of(result, tmp_path)
    assert "The skin passed through the surface." in found.text
    assert "ended after 4 of 9 steps" in found.text
    quiet = page_of(fake_result(), tmp_path)
    assert "None." in quiet.text
    assert "complete" in quiet.text


def test_without_fields_there_is_no_picture_of_the_finger(slid, tmp_path):
    found = page_of(replace(slid, frames=[]), tmp_path)
    assert len(found.images) == 1
    assert "No fields were kept" in found.text


def test_a_finger_in_three_dimensions_is_shown_from_below(tmp_path):
    result = ev.simulate(dome_scene(ev.Press(indentation=0.1, steps=1)))
    found = page_of(result, tmp_path)
    assert any("from below" in image["alt"] for image in found.images)
    assert float(found.row("contact_area")[1]) == pytest.approx(result.contact_area[-1], rel=1e-4)


def test_errors_of_a_check_are_in_the_page(slid, tmp_path):
    without = page_of(slid, tmp_path)
    assert "is not said here" in without.text
    own = dict.fromkeys(("normal_force", "tangential_force", "electrostatic_force"), 1.25)
    row = {"way": "twice the steps", "source": "steps", "indentation": 0.5, "difference": 2e-5, "why": ""}
    found = page_of(slid, tmp_path, checked=Checked([row | own]))
    assert "twice the steps" in found.text
    assert "The ends agree" in found.text
    assert found.row("twice the steps")[2:] == ["1.25", "1.25", "1.25", "0.5", "2.0e-05"]
    assert "forces in N/mm" in found.text
    assert "is not said here" not in found.text


def test_it_is_written_whole_or_not_at_all(slid, tmp_path, monkeypatch):
    (tmp_path / "page.html").write_text("mine")

    def full(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(os, "replace", full)
        with pytest.raises(ev.StorageError):
            slid.report(tmp_path / "page.html")
    assert (tmp_path / "page.html").read_text() == "mine"
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]
    refuses("ends in .html", slid.report, tmp_path / "page.pdf")
    none = {name: slid[name][:0] for name in slid.columns if name not in slid.in_rooms}
    refuses("without a step", replace(slid, **none, in_rooms={}).report, tmp_path / "page.html")
    assert (tmp_path / "page.html").read_text() == "mine"


def test_pictures_of_a_page_do_not_show_themselves(slid, tmp_path, monkeypatch):
    from matplotlib import pyplot

    monkeypatch.setattr(pyplot, "get_backend", lambda: "module://inline")
    before = pyplot.get_fignums()
    page_of(slid, tmp_path)
    assert pyplot.get_fignums() == before


@pytest.fixture
def place(tmp_path):
    meshfile.write(square_mesh("quad9"), tmp_path / "square.vtu")
    (tmp_path / "square.toml").write_text(SCENE)
    assert called(tmp_path, "run", "square.toml")[0] == 0
    return tmp_path


def test_the_command_writes_it_into_the_folder_and_a_new_run_removes_it(place):
    results = place / "square-out"
    status, out, err = called(place, "report", "square-out")
    assert (status, out.strip(), err) == (0, str(results.relative_to(place) / "report.html"), "")
    found = Reader((results / "report.html").read_text(encoding="utf-8"))
    assert "Run of square" in found.text
    assert len(found.images) == 3
    assert "report.html" in (results / ".evfem-files").read_text().split()
    assert called(place, "report", "square-out")[0] == 0
    assert called(place, "run", "square.toml", "--overwrite")[0] == 0
    assert not (results / "report.html").exists()


def test_a_page_of_somebody_elses_stays(place):
    (place / "square-out" / "report.html").write_text("mine")
    status, _, err = called(place, "report", "square-out")
    assert status == 4
    assert "a file that evfem did not write" in err
    assert (place / "square-out" / "report.html").read_text() == "mine"
    assert called(place, "report", "square-out", "--out", "other.html")[0] == 0
    assert (place / "other.html").exists()


def test_the_command_takes_a_saved_result_and_refuses_other_things(place):
    ev.load(place / "square-out").save(place / "kept.npz")
    status, out, _ = called(place, "report", "kept.npz")
    assert (status, out.strip()) == (0, "kept.html")
    assert np.isfinite(float(Reader((place / "kept.html").read_text()).row("normal_force")[1]))
    status, _, err = called(place, "report", "square.toml")
    assert status == 2
    assert "given Scene; allowed: the folder of a run" in err
    assert called(place, "report", "nothing")[0] == 2
    assert called(place, "report", "kept.npz", "--out", "page.pdf")[0] == 2
