"""Measurements: what is read of a run at measured places, csv files, refused input."""

from dataclasses import replace

import numpy as np
import pytest
from tools.builders import finger
from tools.meshes import block
from tools.refusals import refuses

from evfem.calibration.measured import NUMBERS, MeasuredCurve, MeasuredValues, along
from evfem.common.units import named_unit
from evfem.errors import InputError
from evfem.scene.motion import Press, Slide
from evfem.scene.scene import Scene
from evfem.simulation.run import simulate
from evfem.surface.surfaces import Flat


@pytest.fixture(scope="module")
def result():
    """A press to 0.2 mm in four steps, a slide of 0.4 mm in four."""
    motion = [Press(indentation=0.2, steps=4), Slide(distance=-0.4, steps=4)]
    return simulate(Scene(finger(block()), Flat(friction=0.3), motion=motion))


def test_a_curve_meets_the_steps_and_the_state_before_a_motion(result):
    force = along(result, "normal_force", "indentation", np.array([0.0, 0.05, 0.1, 0.2]), motion=0)
    np.testing.assert_allclose(force, [0.0, *result.normal_force[[0, 1, 3]]], atol=1e-15)
    # the slide begins where the press ended, and its positions fall
    friction = along(result, "tangential_force", "position", np.array([0.0, -0.1, -0.4]), motion=1)
    np.testing.assert_allclose(friction, result.tangential_force[[3, 4, 7]], atol=1e-15)


def test_between_the_steps_a_curve_stays_between_them(result):
    x = np.linspace(0.05, 0.1, 9)
    force = along(result, "normal_force", "indentation", x, motion=0)
    assert (np.diff(force) > 0.0).all()
    assert force[0] == pytest.approx(result.normal_force[0], rel=1e-14)
    # four times as many steps: the press has a closed run of its own, near by
    fine = simulate(Scene(finger(block()), Flat(friction=0.3), motion=Press(indentation=0.2, steps=16)))
    np.testing.assert_allclose(force, along(fine, "normal_force", "indentation", x), rtol=2e-3)


def test_places_beyond_the_run_are_refused(result):
    with pytest.raises(InputError, match=r"indentation from 0.1 to 0.3; allowed: .* of the run, 0 to 0.2"):
        along(result, "normal_force", "indentation", np.array([0.1, 0.3]), motion=0)
    with pytest.raises(InputError, match="indentation, which does not advance in the run"):
        along(result, "normal_force", "indentation", np.array([0.1]))
    with pytest.raises(InputError, match="indentation, which does not advance in motion 1"):
        along(result, "normal_force", "indentation", np.array([0.1]), motion=1)


def test_the_commanded_load_is_within_a_run_that_solves_for_it():
    """Closed form of nothing: the run's own last row, which the solver left short of the load."""
    run = simulate(Scene(finger(block()), Flat(friction=0.3), motion=Press(force=0.05, steps=4)))
    reached = run.applied_force[-1]
    for load in (0.05, reached * (1.0 - 5e-9), reached * (1.0 + 5e-9)):
        depth = along(run, "indentation", "applied_force", np.array([load]), motion=0)
        assert depth[0] == pytest.approx(run.indentation[-1], rel=1e-7)
    with pytest.raises(InputError, match="within those of the run"):
        along(run, "indentation", "applied_force", np.array([0.05 * (1.0 + 1e-5)]), motion=0)


def test_a_load_that_changes_by_rounding_does_not_advance():
    motion = [Press(force=0.05, steps=2), Slide(distance=0.2, steps=2, hold="force")]
    run = simulate(Scene(finger(block()), Flat(friction=0.3), motion=motion))
    rising = replace(run, applied_force=0.05 + 1e-12 * np.arange(4.0))
    with pytest.raises(InputError, match="applied_force, which does not advance in motion 1"):
        along(rising, "indentation", "applied_force", np.array([0.05]), motion=1)


def test_a_curve_from_a_file(tmp_path):
    (tmp_path / "press.csv").write_text("indentation, normal_force,sd\n0.1,0.01,1e-3\n0.2,0.03,2e-3\n")
    curve = MeasuredCurve.from_csv(tmp_path / "press.csv", motion=0)
    assert (curve.over, curve.column, curve.motion) == ("indentation", "normal_force", 0)
    assert (curve.at.tolist(), curve.values.tolist()) == ([0.1, 0.2], [0.01, 0.03])
    assert curve.sd.tolist() == [1e-3, 2e-3]
    (tmp_path / "plain.csv").write_text("position,tangential_force\n0,0\n1,0.02\n")
    assert MeasuredCurve.from_csv(tmp_path / "plain.csv", sd=0.1).sd.tolist() == [0.1, 0.1]


#: as machines write: a note, names, units, a place twice by rounding, a gap, there and back
MACHINE = """Machine 7, 2 µm
Time;Standard travel;Standard force
s;mm;mN
0,0;0,50;0
0,1;0,50;2
0,2;0,70;9
0,3;0,80;
0,4;0,90;36
# turned
0,5;0,89;35
0,6;0,69;8
"""


@pytest.mark.parametrize("coding", ["utf-8-sig", "latin-1", "utf-16"])
@pytest.mark.parametrize("columns", [("Standard travel", "standard FORCE"), (2, 3)])
def test_a_file_as_machines_write_it(tmp_path, coding, columns):
    path = tmp_path / "press.csv"
    path.write_bytes(MACHINE.encode(coding))
    chosen = dict(zip(("indentation", "normal_force"), columns, strict=True))
    loading = MeasuredCurve.from_csv(path, 0, columns=chosen, zero=0.5, branch="loading", depth=10.0)
    np.testing.assert_allclose(loading.at, [0.0, 0.2, 0.4], atol=1e-15)
    np.testing.assert_allclose(loading.values, [1e-4, 9e-4, 36e-4])  # mN over 10 mm
    with pytest.raises(InputError, match=r'data\.columns: given "travel", no column; allowed: step, '):
        MeasuredCurve.from_csv(path, 0, columns={"travel": 2, "normal_force": 3})
    unloading = MeasuredCurve.from_csv(path, 1, columns=chosen, branch="unloading")
    assert unloading.at.tolist() == [0.9, 0.89, 0.69]
    np.testing.assert_allclose(unloading.values, [0.036, 0.035, 0.008])


def pressed(path, text, **given):
    """First place (mm) and force (N) of a file's rows, 100 um and 12 mN if it is read right."""
    path.write_text(text, encoding="utf-8")
    columns = {"indentation": 1, "normal_force": 2}
    curve = MeasuredCurve.from_csv(path, 0, **{"columns": columns, **given})
    return curve.at[0], curve.values[0]


HEADS = {
    "a speed beside": "Depth,Load,Speed\num,mN,mm/s",
    "a temperature beside": "Depth,Load,T\nµm,mN,°C",
    "a word beside": "Depth,Load,Gain\num,mN,counts",
    "brackets": "Depth,Load,Gain\n[um],[mN],[counts]",
    "units first": "um,mN,s\nDepth,Load,Time",
    "underscore": "depth_um,load_mN,n",
    "colon": "depth:um,load:mN,n",
    "a quotient": "depth:um,load:mN/mm,n",
    "blank": "depth um,load mN,n",
    "in": "depth in um,load in mN,n",
    "a title": "Sample,B,3\nDepth [um],Load/mN,n",
}


@pytest.mark.parametrize("head", HEADS)
def test_units_of_the_columns_that_are_read_count_whatever_the_others_are(tmp_path, head):
    found = pressed(tmp_path / "press.csv", f"{HEADS[head]}\n100,12,1\n200,31,1\n")
    assert found == pytest.approx((0.1, 0.012), rel=1e-12)


@pytest.mark.parametrize(
    ("unit", "newtons"), [("gf", 9.80665e-3), ("kgf", 9.80665), ("lbf", 4.4482216152605), ("µN", 1e-6)]
)
def test_forces_are_in_newtons_by_definition(tmp_path, unit, newtons):
    """The kilogram-force and the pound-force of NIST SP 811 (2008), appendix B.8."""
    text = f"depth,load\nmm,{unit}\n1,2\n2,3\n"
    assert pressed(tmp_path / "press.csv", text)[1] == pytest.approx(2.0 * newtons, rel=1e-12)


def test_a_deviation_without_a_unit_has_that_of_the_value(tmp_path):
    path = tmp_path / "press.csv"
    path.write_text("indentation [um],normal_force [mN],sd\n100,12,1\n200,31,2\n")
    assert MeasuredCurve.from_csv(path).sd == pytest.approx([1e-3, 2e-3])
    path.write_text("indentation [um],normal_force [mN],sd [uN]\n100,12,1\n200,31,2\n")
    assert MeasuredCurve.from_csv(path).sd == pytest.approx([1e-6, 2e-6])


def test_a_pressure_is_in_megapascal(tmp_path):
    path = tmp_path / "p.csv"
    path.write_text("position (in),pressure kPa\n1,12\n2,13\n")
    curve = MeasuredCurve.from_csv(path, columns={"position": 1, "peak_contact_pressure": "pressure kPa"})
    assert (curve.at[0], curve.values[0]) == pytest.approx((25.4, 0.012), rel=1e-12)


@pytest.mark.parametrize("head", ["depth,load\nmm,furlong", "depth,load [furlong]", "depth,load:furlong"])
def test_an_unknown_unit_is_refused_until_its_size_is_given(tmp_path, head):
    path, text = tmp_path / "press.csv", f"{head}\n1,2\n2,3\n"
    sentence = r'normal_force: given load in furlong; .* factors=\{"normal_force": how many N/mm one'
    refuses(sentence, pressed, path, text)
    assert pressed(path, text, factors={"normal_force": 0.5})[1] == 1.0
    refuses("data.factors: .*normal_force", pressed, path, text, factors={"force": 0.5})
    refuses("data.factors.normal_force: given 0", pressed, path, text, factors={"normal_force": 0})
    volts = text.replace("furlong", "V")  # of a sensor
    refuses("given load in V; allowed: N | mN", pressed, path, volts)


def test_names_that_end_like_units_are_names(tmp_path):
    for name in NUMBERS:
        assert named_unit(name) == (name, None)
    columns = {"indentation": "depth", "normal_force": "load_A"}  # of two sensors, A and C
    text = "depth_um,load_C,load_A\n100,7,12\n200,8,31\n"
    assert pressed(tmp_path / "press.csv", text, columns=columns) == pytest.approx((0.1, 12.0))


@pytest.mark.parametrize(
    ("head", "right"),
    [
        ("Travel [um] avg,Load [mN] avg", 0.012),
        ("(um) travel,(mN) load", 0.012),
        ("travel (avg) [um],load [mN].1", 0.012),  # as pandas writes a name that is there twice
        ("travel_um,normal_force_mN_mm", 0.012),
        ("travel_um,load_N_mm", 12.0),
    ],
)
def test_units_within_a_name_and_quotients_are_understood(tmp_path, head, right):
    assert pressed(tmp_path / "press.csv", f"{head}\n100,12\n200,24\n") == pytest.approx((0.1, right))


@pytest.mark.parametrize(
    ("load", "told"),
    [
        ("Load [furlong] avg", "furlong"),
        ("load_mN_raw", "mN_raw"),
        ("Load (x10) [mN]", "x10 and mN"),
        ("Load [mN] (N)", "mN and N"),
    ],
)
def test_what_looks_like_a_unit_in_a_name_is_understood_or_refused(tmp_path, load, told):
    path, text = tmp_path / "press.csv", f"depth,{load}\n1,12\n2,24\n"
    refuses(rf"given load.* in {told}; .* factors=", pressed, path, text)
    assert pressed(path, text, factors={"normal_force": 0.5})[1] == 6.0
    columns = {"indentation": 1, "normal_force": 3}  # of the others nothing is asked
    text = f"depth,{load},force\n1,12,7\n2,24,8\n"
    assert pressed(path, text, columns=columns)[1] == 7.0


@pytest.mark.parametrize(
    ("head", "told"),
    [
        ("travel,load\nmillimetres,millinewtons", "travel in millimetres"),
        ("travel,load\nMM,MN", "travel in MM"),
        ("travel,load\nmil,dyn", "travel in mil"),
        ("travel,load,T\nmil,dyn,°C", "travel in mil"),
        ("travel,load,n\nmil,dyn", "travel in mil"),
        ("travel,load,n\nmil", "travel in mil"),
        ("travel [um],load [mN]\nmm,N", "travel in um and mm"),
        ("travel [um],load [mN],n\nmm,N", "travel in um and mm"),
        ("travel [um],load [mN]\nfirst,second", r"travel \[um\] in first"),
    ],
)
def test_a_line_of_units_is_understood_or_refused(tmp_path, head, told):
    path = tmp_path / "press.csv"
    text = f"{head}\n1,2,7\n2,3,8\n" if head.split("\n")[0].count(",") == 2 else f"{head}\n1,2\n2,3\n"
    refuses(rf"indentation: given {told}; .* factors=", pressed, path, text)
    factors = {"indentation": 0.0254, "normal_force": 1e-5}
    assert pressed(path, text, factors=factors) == pytest.approx((0.0254, 2e-5))


@pytest.mark.parametrize(
    "head",
    [
        "depth,load,n\num,mN",
        "depth,load,n\num,mN,,",
        "# depth,load,n\n# um,mN",
        "depth,load,n\nµm,mN,counts",
        "depth [um],load,n\nμm,mN,",
        "um,mN,counts\nDepth,Load,Gain",
        "depth [um],load [mN],n\n[Data]",
        "depth [um],load [mN],n\n# seen twice",
    ],
)
def test_a_line_of_units_counts_for_the_cells_that_it_has(tmp_path, head):
    found = pressed(tmp_path / "press.csv", f"{head}\n100,12,1\n200,31,1\n")
    assert found == pytest.approx((0.1, 0.012), rel=1e-12)


def test_a_title_above_the_names_is_none_where_these_are_called(tmp_path):
    path, text = tmp_path / "press.csv", "Sample,Skin\nDepth,Load\n1,2\n2,3\n"
    assert pressed(path, text, columns={"indentation": "Depth", "normal_force": "load"}) == (1.0, 2.0)
    refuses("given sample in Depth", pressed, path, text)
    refuses(
        "given sample in Depth", pressed, path, text, columns={"indentation": "sample", "normal_force": 2}
    )


@pytest.mark.parametrize(
    ("rows", "right"),
    [
        ('depth,load\n1,"1,234"\n2,"2,000.5"\n', 1234.0),  # commas between columns: decimals have points
        ("depth;load\n1,0;1.234,5\n2,0;2.000,5\n", 1234.5),
        ("depth;load\n0.5;1,234\n2.5;1,234,567\n", 1234.0),
        ("depth;load\n1;1,234\n2;2,345\n", 1.234),  # nothing says that these are thousands
        ('depth,load\n1,"1,5"\n2,"2,25"\n', 1.5),
    ],
)
def test_commas_between_thousands_are_no_decimal_commas(tmp_path, rows, right):
    assert pressed(tmp_path / "press.csv", rows)[1] == right


@pytest.mark.parametrize("time", ["1.5", "1,5", "12:00:01", "1.234.567,5"])
@pytest.mark.parametrize(("load", "right"), [("12,500", 12.5), ("12.500", 12.5), ("12,5", 12.5)])
def test_columns_that_are_not_read_do_not_say_what_a_comma_is(tmp_path, time, load, right):
    columns = {"indentation": 2, "normal_force": "Load"}
    text = f"t;Depth;Load\n{time};1;{load}\n{time};2;{load}\n"
    assert pressed(tmp_path / "press.csv", text, columns=columns) == (1.0, right)


@pytest.mark.parametrize(
    "rows",
    [
        ["2026-11-28 12:00;100;12;OK", "2026-11-28 12:01;200;31;OK"],
        [";100;12;OK", "1;200;31;"],  # the second line has numbers alone
        ["1;100;12;", "1;200;31;OK"],
        ["inf;100;12;OK", "1;;13;OK", "inf;200;31;late"],
    ],
)
def test_columns_that_are_not_read_may_hold_words(tmp_path, rows):
    path, columns = tmp_path / "press.csv", {"indentation": "depth", "normal_force": "load"}
    path.write_text("\n".join(["Press;7;of;9", "time;depth;load;state", "s;um;mN;", *rows]))
    curve = MeasuredCurve.from_csv(path, columns=columns)
    assert (curve.at, curve.values) == (pytest.approx([0.1, 0.2]), pytest.approx([0.012, 0.031]))
    refuses(
        "line [45]: .*; allowed: 4 columns on each line, numbers in 2 and 4",
        MeasuredCurve.from_csv,
        path,
        columns=columns | {"normal_force": 4},
    )


def test_a_first_row_with_a_gap_is_no_header(tmp_path):
    path = tmp_path / "press.csv"
    path.write_text("indentation,normal_force\n,2\n0.2,3\n0.3,4\n")
    assert MeasuredCurve.from_csv(path).at.tolist() == [0.2, 0.3]


def test_of_two_columns_of_a_name_the_number_is_needed(tmp_path):
    path, text = tmp_path / "press.csv", "depth,load,load\n1,2,7\n2,3,8\n"
    columns = {"indentation": "depth", "normal_force": "load"}
    refuses(
        '"load", the name of 2 columns; allowed: one by number: 2 . 3', pressed, path, text, columns=columns
    )
    assert pressed(path, text, columns={"indentation": "depth", "normal_force": 3}) == (1.0, 7.0)
    text = "depth,load_N,load_mN\n1,2,7\n2,3,8\n"
    assert pressed(path, text, columns=columns | {"normal_force": "load_mN"}) == (1.0, 0.007)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({}, "press.csv with the header time,standard travel,standard force; allowed: .*`columns`"),
        ({"columns": {"indentation": 2, "normal_force": "Standard farce"}}, r"standard force\?"),
        ({"columns": {"indentation": 2, "voltage": 3}}, r"voltage: given standard force in mN; allowed: V"),
        ({"columns": {"indentation": 2, "normal_force": 3}}, "0.9, then 0.89 .*a curve each"),
        ({"columns": {"indentation": 2, "normal_force": 3}, "branch": "up"}, r"data\.branch: .*loading"),
    ],
)
def test_what_a_file_of_a_machine_lacks_is_said(tmp_path, given, sentence):
    (tmp_path / "press.csv").write_text(MACHINE)
    caught = refuses(sentence, MeasuredCurve.from_csv, tmp_path / "press.csv", **given)
    assert str(tmp_path) not in str(caught)


def test_keys_and_outputs_of_a_file_have_units(tmp_path):
    head = "electrostatics.voltage [kV],motion.0.gap_um,electrostatic_force.last (mN),sd"
    (tmp_path / "hover.csv").write_text(f"{head}\n2,500,0.2,1\n1.5,250,0.1,1\n")
    values = MeasuredValues.from_csv(tmp_path / "hover.csv")
    assert values.where["electrostatics.voltage"] == [2000.0, 1500.0]
    assert values.where["motion.0.gap"] == [0.5, 0.25]
    assert values.values.tolist() == pytest.approx([2e-4, 1e-4])
    assert values.sd.tolist() == pytest.approx([1e-3, 1e-3])  # in the unit of what it belongs to
    layers = "electrostatics.insulator_thickness.0 [um],electrostatic_force.last"  # one of a list
    (tmp_path / "hover.csv").write_text(f"{layers}\n2,3\n")
    layer = MeasuredValues.from_csv(tmp_path / "hover.csv").where["electrostatics.insulator_thickness.0"]
    assert layer == pytest.approx([0.002], rel=1e-12)
    (tmp_path / "hover.csv").write_text("motion.0.gap [V],electrostatic_force.last\n2,3\n")
    refuses(
        r"data.motion.0.gap: given motion.0.gap in V; allowed: mm",
        MeasuredValues.from_csv,
        tmp_path / "hover.csv",
    )
    for head, wrong in (
        ("normal force [N],friction force [N]", "normal force"),
        ("motion.0.gap,force", "force"),
    ):
        (tmp_path / "hover.csv").write_text(f"{head}\n1,2\n")
        sentence = (
            f'data: given hover.csv with the column "{wrong}"; allowed: keys of the scene, then an output'
        )
        refuses(sentence, MeasuredValues.from_csv, tmp_path / "hover.csv")
    (tmp_path / "hover.csv").write_text("motion.0.gap [um],electrostatic_force.last\n250,2\n,3\n")
    gap = "data.motion.0.gap: given .* in um; allowed: a number in each row"
    refuses(gap, MeasuredValues.from_csv, tmp_path / "hover.csv")


def test_columns_of_a_log_are_chosen_by_names_and_numbers(tmp_path):
    """Those of a tribometer, some columns with words, with units in their heads or in a line of their own."""
    log = "Run;Friction force [mN];Load [N];Remark;Spread\n1;200;0,5;dry;4\n2;500;1,0;moist;8\n"
    (tmp_path / "log.csv").write_text(log)
    called = {"motion.0.force": "load", "tangential_force.last": 2, "sd": "spread"}
    values = MeasuredValues.from_csv(tmp_path / "log.csv", depth=10.0, columns=called)
    assert values.output == "tangential_force.last"
    assert values.where == {"motion.0.force": [0.05, 0.1]}
    assert values.values.tolist() == pytest.approx([0.02, 0.05])
    assert values.sd.tolist() == pytest.approx([4e-4, 8e-4])
    for wrong, sentence in (
        (
            {"motion.0.force": "weight", "tangential_force.last": 2},
            'motion.0.force: given "weight", which',
        ),
        ({"load": "load", "tangential_force.last": 2}, 'data: given log.csv with the column "load"'),
        ({"motion.0.force": "load", "friction.last": 2}, "data.friction.last: given friction.last in mN"),
        ({"motion.0.force": "remark", "tangential_force.last": 2}, "log.csv, line 2"),
    ):
        refuses(sentence, MeasuredValues.from_csv, tmp_path / "log.csv", columns=wrong)


def test_values_from_a_file(tmp_path):
    head = "finger.participant,electrostatics.voltage,motion.0.gap,electrostatic_force.last"
    (tmp_path / "hover.csv").write_text(f"{head}\ni,2000,0.5,2e-4\nii,1414,0.25,1e-4\n")
    values = MeasuredValues.from_csv(tmp_path / "hover.csv")
    assert values.output == "electrostatic_force.last"
    assert values.where == {
        "finger.participant": ["i", "ii"],
        "electrostatics.voltage": [2000.0, 1414.0],
        "motion.0.gap": [0.5, 0.25],
    }
    assert values.values.tolist() == [2e-4, 1e-4]
    assert values.sd is None
    assert values.names[1].startswith("electrostatic_force.last, finger.participant ")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "without a line of numbers"),
        ("indentation,normal_force\n", "without a line of numbers"),
        ("indentation,normal_force\n0.1\n", "without a line of numbers"),
        ("indentation,indentation\n0.1,2\n", "header indentation,indentation; allowed: two columns"),
        ("indentation,normal_force,time\n0.1,2,3\n", "indentation,normal_force,time; allowed: two columns"),
        ("indentation,force\n0.1,2\n", 'or columns={"indentation": "indentation", "normal_force": "force"}'),
        ("indentation,normal_force\n0,0\n0.1,much\n", "line 3: '0.1,much'; allowed: 2 numbers"),
    ],
)
def test_damaged_files_are_refused(tmp_path, text, sentence):
    (tmp_path / "press.csv").write_text(text)
    refuses(sentence, MeasuredCurve.from_csv, tmp_path / "press.csv")
    refuses("No such file", MeasuredCurve.from_csv, tmp_path / "none.csv")


GAPS = {"motion.0.gap": [0.1, 0.2]}


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: MeasuredCurve("motion", "indentation", [0.1], [1.0]), r'data\.column: given "motion", no'),
        (lambda: MeasuredCurve("time", "depth", [0.1], [1.0]), r'data\.over: given "depth", no column'),
        (lambda: MeasuredCurve("time", "position", [0.1], [1.0, 2.0]), "given 2 values; allowed: as many"),
        (lambda: MeasuredCurve("time", "position", [], []), "given 0 values"),
        (lambda: MeasuredCurve("time", "position", [1, 1], [1, 2]), "the same point twice"),
        (
            lambda: MeasuredCurve("normal_force", "indentation", [0.1, 0.2, 0.4, 0.3], [1, 2, 3, 2]),
            r"data\.at: given indentation 0\.2, 0\.4, then 0\.3 \(number 4\); .* a curve each",
        ),
        (lambda: MeasuredCurve("time", "position", [1], [2], sd=0.0), r"data\.sd: .*larger than 0"),
        (lambda: MeasuredCurve("time", "position", [1], [2], sd=[1.0, 2.0]), r"data\.sd"),
        (lambda: MeasuredCurve("time", "position", [1], [2], motion=-1), r"data\.motion: given -1"),
        (lambda: MeasuredCurve("time", "position", [1], [2], where={"gap": 1}), r"data\.where: .*TABLE\.KEY"),
        (lambda: MeasuredValues("time.last", [1.0], GAPS), r"data\.where\.motion\.0\.gap: .*1 values"),
        (lambda: MeasuredValues("time.last", [1.0], {}), r"data\.where: given"),
        (lambda: MeasuredValues("time.last", [1.0, np.nan], GAPS), r"data\.values: .*not finite, number 2"),
        (
            lambda: MeasuredValues("time.last", [1, 2], {"motion.0.gap": [np.nan, 1]}),
            r"where\.motion\.0\.gap: .*finite",
        ),
    ],
)
def test_what_is_no_measurement_is_refused(make, sentence):
    refuses(sentence, make)


def test_separators_at_the_ends_of_lines_and_units_after_a_blank(tmp_path):
    """As profilometers write: a header and lines that end with one comma, or two."""
    path = tmp_path / "scan.csv"
    path.write_text("Lateral um,Load mN,\n0.0,-2.0,,\n500.0,4.0,,\n")
    curve = MeasuredCurve.from_csv(path, columns={"position": 1, "normal_force": 2})
    assert (curve.at.tolist(), curve.values.tolist()) == ([0.0, 0.5], [-0.002, 0.004])


def test_a_file_in_newtons_is_divided_by_its_depth(tmp_path):
    path = tmp_path / "load.csv"
    path.write_text("applied_force,contact_width,sd\n0.2,30,1\n0.5,45,2\n")
    curve = MeasuredCurve.from_csv(path, depth=10.0)
    np.testing.assert_allclose(curve.at, [0.02, 0.05])  # N to N/mm
    np.testing.assert_allclose(curve.values, [3.0, 4.5])  # mm2 to mm
    np.testing.assert_allclose(curve.sd, [0.1, 0.2])
    path.write_text("position,peak_contact_pressure\n1,0.03\n")
    assert MeasuredCurve.from_csv(path, depth=10.0).values.tolist() == [0.03]  # no depth in it
    refuses(r"data.depth: given 0.0; allowed: a depth in mm", MeasuredCurve.from_csv, path, depth=0.0)
