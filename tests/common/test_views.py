"""What objects say of themselves: short, true, complete where it counts, and safe inside a page."""

import pydoc
from dataclasses import is_dataclass, replace
from inspect import signature
from xml.etree import ElementTree

import numpy as np
import pytest
from tools.commands import printed
from tools.fakes import fake_result

import evfem as ev
from evfem.common.checks import keys_of
from evfem.estimate.rendering import ApparentFriction, Comparison
from evfem.simulation.result import Result

NAIL = ev.NeoHookean(E=20.0, nu=0.3)
EVIL = "<script>alert('&')</script>"


def rows(page):
    """Caption, {heading: text} and the curves of a small table; it must be well-formed."""
    tree = ElementTree.fromstring(page)
    assert tree.tag == "table"
    found = {tr.find("th").text: tr.find("td").text for tr in tree.iter("tr") if tr.find("th") is not None}
    return tree.find("caption").text, found, list(tree.iter("polyline"))


def test_a_finger_shows_what_differs_from_table_2():
    assert repr(ev.FingerPad()) == "FingerPad()"
    finger = ev.FingerPad(ridge_height=0.1, resolution="coarse", materials={"nail": NAIL})
    known = {"FingerPad": ev.FingerPad, "NeoHookean": ev.NeoHookean}
    name, _, arguments = repr(finger).partition("(")
    assert name in known
    assert arguments == f"ridge_height=0.1, resolution='coarse', materials={{'nail': {NAIL!r}}})"
    caption, found, _ = rows(finger._repr_html_())
    assert caption == "FingerPad"
    assert found["ridges"] == "0.1 mm high, every 0.5 mm"
    assert found["materials"].startswith("{'nail': NeoHookean(E=20.0")
    assert rows(ev.FingerPad(ridges=False)._repr_html_())[1]["ridges"] == "none"


def test_a_scene_shows_what_is_not_as_usual_and_fits_a_screen():
    scene = ev.default_scene()
    lines = repr(scene).splitlines()
    assert lines[0] == "Scene 'default': FingerPad() on Display(), Kaczmarek() at 1000 V"
    assert lines[1:] == ["  Press(force=0.05), Slide(distance=5.0)"]
    soft = ev.Display(friction=0.1, elastic=ev.ElasticLayer(E=1.0, nu=0.4, thickness=1.0))
    still, voltage = [ev.Press(force=0.1), ev.Wait(1e-3, steps=1)], ev.Sine(50.0, 9.0)
    driven = replace(scene, motion=still, voltage=voltage, drive=ev.Drive(resolved=True))
    text = repr(replace(driven, surface=soft, law=ev.StrongTroxel()))
    told = " ".join(text.split())
    assert "Display(friction=0.1, elastic=ElasticLayer(E=1.0, nu=0.4, thickness=1.0))" in told
    assert "StrongTroxel() at Sine(frequency=50.0, amplitude=9.0)" in told
    assert max(map(len, text.splitlines())) <= 96
    special = replace(
        scene, solver=ev.Solver(element="q1"), air_layer=False, motion=[ev.Press(force=0.1)] * 40
    )
    lines = repr(special).splitlines()
    assert len(lines) == 4
    assert lines[2] == "    Press(force=0.1), ... (40 motions)"
    assert lines[3] == "  air_layer=False, solver=Solver(element='q1')"
    assert max(map(len, lines)) <= 96
    still = ev.Scene(ev.FingerPad(), ev.Flat(), motion=[ev.Press(force=0.1)])
    assert "no attraction" in repr(still)
    signal = replace(scene, voltage=ev.VoltageProfile(np.linspace(0.0, 1.0, 1000), np.zeros(1000)))
    assert "at VoltageProfile" in repr(signal)
    caption, found, _ = rows(special._repr_html_())
    assert caption == "Scene default, 400 steps"
    assert len([key for key in found if key.startswith("motion")]) == 6
    assert found["air_layer"] == "False"


def test_a_voltage_shows_its_size():
    shown = repr(ev.VoltageProfile([1.0, 2.0, 4.0], [-50.0, 200.0, 0.0]))
    assert shown == "VoltageProfile(3 rows, x 1 to 4 mm, -50 to 200 V)"


def test_a_profile_shows_its_size_so_that_a_wrong_unit_is_seen():
    x = np.linspace(0.0, 8000.0, 801)
    shown = repr(ev.Profile(x, 8.0 * np.sign(x - 1.0), friction=0.2))
    assert shown == "Profile(801 points, x 0 to 8000 mm, height -8 to 8 mm, friction=0.2)"


def test_a_result_shows_how_far_it_came_and_its_end():
    result = fake_result(steps=4)
    assert repr(result).splitlines() == [
        "Result of 'fake': 4 of 4 steps, 2 with fields, 9 nodes",
        "  position 0.2 mm; indentation 1.286 mm; voltage 1.429 V",
        "  normal force 1.857 N/mm; tangential force 2 N/mm",
        "  electrostatic force 2.143 N/mm; contact width 2.429 mm",
    ]
    caption, found, curves = rows(result._repr_html_())
    assert caption == "Result of 'fake': 4 of 4 steps, 2 with fields, 9 nodes"
    assert found["tangential force"] == "2 N/mm"
    points = [[float(v) for v in pair.split(",")] for pair in curves[1].get("points").split()]
    # tangential forces 11/7 ... 14/7 N/mm, y downwards; the box reaches from 0 to the largest, 14/7
    assert points == [[i, pytest.approx(-n / 7, rel=1e-5)] for i, n in enumerate((11, 12, 13, 14))]
    box = ElementTree.fromstring(result._repr_html_()).find(".//svg").get("viewBox")
    assert [float(v) for v in box.split()] == pytest.approx([0.0, -2.0, 3.0, 2.0])


def test_a_result_with_a_depth_shows_its_end_over_it_too():
    result = fake_result(provenance={"scene": {"name": "fake", "total_steps": 4, "depth": 10.0}})
    assert repr(result).splitlines()[3:] == [
        "  electrostatic force 2.143 N/mm; contact width 2.429 mm",
        "  over 10 mm: normal force 18.57 N; tangential force 20 N",
        "  electrostatic force 21.43 N; contact area 24.29 mm2",
    ]
    assert repr(result.total).splitlines()[2:] == [
        "  normal force 18.57 N; tangential force 20 N",
        "  electrostatic force 21.43 N; contact area 24.29 mm2",
    ]


def test_results_without_or_with_odd_steps():
    empty = Result.from_rows([], [], fake_result().mesh, {})
    assert repr(empty) == "Result of 'scene': 0 of 0 steps, 0 with fields, 9 nodes"
    assert rows(empty._repr_html_())[2] == []
    odd = fake_result(steps=4)
    odd.normal_force[1:3] = np.nan, np.inf
    assert len(rows(odd._repr_html_())[2][0].get("points").split()) == 2
    long = fake_result(steps=4)
    many = replace(long, **{name: np.resize(getattr(long, name), 5000) for name in ("normal_force", "step")})
    assert len(many._repr_html_()) < 10_000


def test_text_of_others_is_escaped():
    scene = replace(ev.default_scene(), name=EVIL.replace("/", ""))
    result = fake_result(provenance={"scene": {"name": EVIL, "total_steps": 4}})
    finger = ev.FingerPad(materials={"nail": type("Law", (), {"__repr__": lambda self: EVIL, "P": abs})()})
    for page in (scene._repr_html_(), result._repr_html_(), finger._repr_html_()):
        assert "<script>" not in page
        assert "alert" in page
        rows(page)


def test_help_says_every_parameter_with_its_meaning_and_range():
    said = pydoc.plain(pydoc.render_doc(ev.Slide))
    begins = " ".join(said.replace("|", " ").split())  # newer Pythons give each parameter its line
    assert "Slide( distance: float, steps: int = 100" in begins.replace("Slide(d", "Slide( d")
    assert (
        " |  speed\n |      needed with dynamics other than quasistatic (mm/s). Allowed: a speed in" in said
    )
    told = 0
    for one in (getattr(ev, name) for name in ev.__all__):
        for key in keys_of(one) if isinstance(one, type) and is_dataclass(one) else ():
            assert f"\n{key.field}\n    " in one.__doc__.partition("\nParameters\n---")[2], one
            assert "Annotated" not in str(signature(one))
            told += 1
    assert told > 150


def test_showing_a_scene_loads_nothing_heavy():
    code = (
        "import evfem as ev, sys\n"
        "scene = ev.default_scene(); repr(scene); scene._repr_html_(); scene.finger._repr_html_()\n"
        "print(sorted({'skfem', 'matplotlib', 'scipy.optimize', 'meshio'} & set(sys.modules)))"
    )
    assert printed(code) == "[]"


def test_meshes_frames_and_forces_show_their_size_not_their_numbers():
    result = fake_result("quad9")
    assert repr(result.mesh) == "Mesh of 25 nodes, 4 cells (quad9); regions soft, hard; sets pad, bone"
    assert repr(result.frames[1]) == "Frame of step 4 at 0.2 mm, 0 s: 25 nodes, 4 cells"
    felt = ApparentFriction(np.linspace(-0.0, 5.0, 1000), np.full(1000, 0.05), np.linspace(0.0, 0.02, 1000))
    assert repr(felt) == "ApparentFriction(1000 positions, 0 to 5 mm, friction 0 to 0.4)"
    found = Comparison(np.arange(3.0), np.array([1e-3, 0.0, 1e-9]), 0.99, 0.01, 0.0)
    assert repr(found) == (
        "Comparison(3 positions: pearson 0.99, relative L2 error 0.01, at most 0.001 N/mm and 0 V apart)"
    )
