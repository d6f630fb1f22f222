"""Units of files, and whether a scene has them: forces in all, and over a mm of depth."""

import pytest
from tools.meshes import block
from tools.refusals import refuses

import evfem as ev
from evfem.mesh import file as meshfile
from evfem.scene import file as scenefile

E = "finger.materials.tissue.E"
SCENE = """
version = 1
[finger]
mesh = "block.vtu"
[finger.materials.tissue]
law = "neo_hookean"
E = 0.1
nu = 0.4
[surface]
kind = "flat"
[[motion]]
kind = "press"
indentation = 0.2
steps = 3
"""


@pytest.fixture
def scene(tmp_path):
    """The file of a press of a block in the plane, whose E is 0.1 MPa."""
    meshfile.write(block(), tmp_path / "block.vtu")
    (tmp_path / "scene.toml").write_text(SCENE)
    return tmp_path / "scene.toml"


def curve(path, head, **more):
    """A curve of a file with that header and force."""
    path.write_text(f"{head}\n0.1,12\n0.2,24\n")
    return ev.MeasuredCurve.from_csv(path, motion=0, **more)


def test_a_force_over_a_depth_is_not_divided_by_it_again(tmp_path):
    path, head = tmp_path / "press.csv", "indentation [mm],normal_force [N/m]"
    sentence = r"normal_force: given normal_force in N/m; allowed: N | .*, as a depth is given"
    refuses(sentence, curve, path, head, depth=10.0)
    assert curve(path, head).values == pytest.approx([0.012, 0.024])
    whole = curve(path, "indentation [mm],normal_force [mN]", depth=10.0)
    assert whole.values == pytest.approx([1.2e-3, 2.4e-3])
    width = curve(path, "indentation,contact_width [cm2]", depth=10.0)
    assert width.values == pytest.approx([120.0, 240.0])  # mm2 over 10 mm
    refuses("contact_width in mm; allowed: mm2", curve, path, "indentation,contact_width [mm]", depth=10.0)


def test_a_fit_has_forces_as_its_scene_has_them(tmp_path, scene):
    """The press of the scene itself, in N over 2 mm: without the depth E would be another one."""
    path, run = tmp_path / "press.csv", ev.simulate(scenefile.load(scene))
    for unit, size, depth in (("N/mm", 1.0, None), ("mN", 2000.0, 2.0)):
        rows = zip(run.indentation, run.normal_force * size, strict=True)
        lines = [f"indentation,normal_force [{unit}]", *(f"{x},{force}" for x, force in rows)]
        path.write_text("\n".join(lines))
        measured = ev.MeasuredCurve.from_csv(path, motion=0, depth=depth)
        found = ev.fit(scene, measured, {E: (0.01, 1.0)}, workers=1)
        assert found[E] == pytest.approx(0.1, rel=1e-4)
    bare = ev.MeasuredCurve.from_csv(path, motion=0)
    sentence = "data.normal_force: given N for a finger in the plane; allowed: N/mm, or `depth`"
    refuses(sentence, ev.fit, scene, bare, {E: (0.01, 1.0)}, workers=1)


@pytest.mark.parametrize(
    ("head", "key"),
    [
        ("motion.0.force [N],indentation.last", "motion.0.force"),
        ("motion.0.indentation,normal_force.last [mN]", "normal_force.last"),
    ],
)
def test_values_of_runs_have_forces_as_the_scene_has_them(tmp_path, scene, head, key):
    path = tmp_path / "runs.csv"
    path.write_text(f"{head}\n0.1,2\n0.2,3\n")
    driven = key.removeprefix("motion.0.") if key.startswith("motion") else "indentation"
    scene.write_text(SCENE.replace("indentation", driven))
    values = ev.MeasuredValues.from_csv(path)
    sentence = f"data.{key}: given N for a finger in the plane; allowed: N/mm"
    refuses(sentence, ev.fit, scene, values, {E: (0.01, 1.0)}, workers=1)


def test_values_of_runs_over_a_depth_are_divided_by_it(tmp_path, scene):
    """Presses by three loads in N over 2 mm, of which the indentations follow."""
    scene.write_text(SCENE.replace("indentation = 0.2", "force = 0.01"))
    path, loads = tmp_path / "runs.csv", (0.01, 0.015, 0.02)
    pressed = [
        ev.simulate(scenefile.loads(scene.read_text().replace("0.01", f"{f}"), tmp_path)) for f in loads
    ]
    rows = [f"{2.0 * f},{1e3 * run.indentation[-1]},3" for f, run in zip(loads, pressed, strict=True)]
    path.write_text("\n".join(["motion.0.force [N],indentation.last [um],sd [um]", *rows]))
    values = ev.MeasuredValues.from_csv(path, depth=2.0)
    assert values.where["motion.0.force"] == pytest.approx(loads, rel=1e-12)
    assert values.sd == pytest.approx([0.003] * 3, rel=1e-12)  # a length has no depth in it
    found = ev.fit(scene, values, {E: (0.01, 1.0)}, workers=1)
    assert found[E] == pytest.approx(0.1, rel=1e-4)


def test_deviations_are_over_the_depth_of_their_values(tmp_path):
    path = tmp_path / "runs.csv"
    for head, more in (
        ("electrostatics.voltage,tangential_force.last [mN],sd", {}),
        ("electrostatics.voltage,tangential_force.last [mN]", {"sd": 0.02}),
    ):
        path.write_text(f"{head}\n0,200{',20' if not more else ''}\n500,400{',40' if not more else ''}\n")
        values = ev.MeasuredValues.from_csv(path, depth=10.0, **more)
        assert values.values == pytest.approx([0.02, 0.04], rel=1e-12)
        assert values.sd[0] == pytest.approx(0.002, rel=1e-12)
        assert values.where["electrostatics.voltage"] == [0.0, 500.0]
    path.write_text("electrostatics.voltage,tangential_force.last [N/m]\n0,2\n")
    sentence = "tangential_force.last in N/mm; allowed: N, in all, as a depth is given"
    refuses(sentence, ev.MeasuredValues.from_csv, path, depth=10.0)


def test_a_coefficient_in_newtons_is_told_the_name_of_the_force(tmp_path):
    path, sentence = (
        tmp_path / "drag.csv",
        "friction in N; allowed: no unit; a friction force is tangential_force",
    )
    path.write_text("position [mm],friction [N]\n1,0.2\n2,0.2\n")
    refuses(sentence, ev.MeasuredCurve.from_csv, path, motion=1)
    path.write_text("electrostatics.voltage [V],friction.last [N]\n0,0.2\n")
    refuses(sentence.replace("friction in", "friction.last in"), ev.MeasuredValues.from_csv, path)
