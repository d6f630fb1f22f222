"""A coat on an insulator: plate capacitors in series, 1 / C = sum of d / (eps_r eps_0)."""

import numpy as np
import pytest
from tools.refusals import refuses

import evfem as ev
from evfem.electrostatics.laws import LayerStack
from evfem.response.parameters import parameter_of

COAT, FILM, SKIN = ev.Layer(0.02, 2.5), ev.Layer(0.09, 3.35), ev.Layer(0.38, 1650.0)
#: sum of d / eps_r of the three, and sum of d, in mm
REDUCED, THICKNESS = 0.02 / 2.5 + 0.09 / 3.35 + 0.38 / 1650.0, 0.02 + 0.09 + 0.38
PRESS = ev.Press(indentation=0.05, steps=1)
FINGER = ev.FingerPad(resolution="coarse", ridges=False)


def scene(insulator, law=None, voltage=1000.0, **more):
    motion = more.pop("motion", PRESS)
    return ev.Scene(FINGER, ev.Display(insulator), law or ev.StrongTroxel(), voltage, motion, **more)


@pytest.mark.parametrize("gap", [0.0, 0.1])
def test_both_laws_see_layers_in_series(gap):
    layers = ev.Layers.of(SKIN, ev.Display([COAT, FILM]).insulator)
    rigid = 0.5 * ev.eps_0 * (1000.0 / (gap + REDUCED)) ** 2
    assert ev.StrongTroxel().traction(gap, 1000.0, layers) == pytest.approx(rigid, rel=1e-12)
    stretched = 0.5 * ev.eps_0 * 1000.0**2 / ((gap + REDUCED) * (gap + THICKNESS))
    assert ev.Kaczmarek().traction(gap, 1000.0, layers) == pytest.approx(stretched, rel=1e-12)


def test_a_leaking_gap_sees_them_too():
    """Complex series of the two, at 1 kHz with 1e-8 S/m in the gap, by hand."""
    drive = ev.Drive(frequency=1000.0, gap_conductivity=1e-8)
    _, layers = scene([COAT, FILM], drive=drive).electrics.attraction
    skin = 0.4 if FINGER.electrical is None else FINGER.stratum_corneum_thickness
    sums = (1 - 1j * 1e-8 / (2 * np.pi * 1000.0 * ev.eps_0)) * (0.02 / 2.5 + 0.09 / 3.35 + skin / 1650.0)
    assert complex(layers.reduced, layers.loss) == pytest.approx(sums, rel=1e-12)


def test_closed_forms_take_a_coat_too():
    plate = {"skin": "gabriel_dry", "skin_thickness": 0.3, "gap_conductivity": 1e-8}
    one = ev.Layer(0.11, 0.11 / (0.02 / 2.5 + 0.09 / 3.35))
    both = [
        ev.electrostatics.alternating_pressure(0.001, 100.0, 250.0, insulator=insulator, **plate)
        for insulator in ([COAT, FILM], one)
    ]
    assert both[0] == pytest.approx(both[1], rel=1e-12)
    refuses("insulator: given 3.0; allowed: a Layer.*list of them",
            ev.electrostatics.alternating_pressure, 0.001, 100.0, 250.0, insulator=3.0, **plate)  # fmt: skip


def test_a_run_goes_by_the_sums_whatever_the_order():
    forces = [
        ev.simulate(scene(insulator)).electrostatic_force[-1]
        for insulator in ([COAT, FILM], (FILM, COAT), ev.Layer(0.11, 0.11 / (0.02 / 2.5 + 0.09 / 3.35)), FILM)
    ]
    assert forces[:3] == pytest.approx([forces[2]] * 3, rel=1e-9)
    assert forces[3] > 1.4 * forces[0]


def test_each_layer_has_its_own_field():
    """U / (eps_r s): the coat's is 3.35 / 2.5 times the film's. Any solid breaks down at 300 V/um."""
    reduced = 0.002 / 2.5 + 0.009 / 3.35 + FINGER.stratum_corneum_thickness / 1650.0
    volts = 310.0 * 2.5 * reduced * 1e3
    thin = scene([ev.Layer(0.002, 2.5), ev.Layer(0.009, 3.35)], voltage=volts)
    said = [one for one in ev.plan(thin).warnings if "breaks down" in one]
    assert len(said) == 1
    assert "310 V/um in the insulator's layer 1" in said[0]


def test_a_scene_file_and_a_sweep_have_each_layer():
    text = ev.scenefile.dump(scene([COAT, FILM]))
    assert ev.scenefile.loads(text) == scene([COAT, FILM])
    lone = ev.scenefile.dump(scene([COAT]))
    assert ev.scenefile.loads(lone).surface.insulator == LayerStack((COAT,))
    swept = ev.Sweep(scene([COAT, FILM]), {"electrostatics.insulator_thickness.0": [0.01, 0.03]})
    found = [ev.scenefile.loads(point.text).surface.insulator for point in swept.points()]
    assert [one.layers[0].thickness for one in found] == [0.01, 0.03]
    assert [one.layers[1] for one in found] == [FILM, FILM]
    for old, new, said in (
        ("2.5,", "", r"electrostatics.insulator_eps_r: given 1 beside 2 of insulator_thickness; .*as many"),
        ("2.5,", "0.5,", r"electrostatics.insulator_eps_r.0: given 0.5; allowed: a relative permittivity"),
        ("insulator_eps_r = [\n    2.5,\n    3.35,\n]", "insulator_eps_r = 3.0", "given 1 beside 2"),
    ):
        assert old in text
        refuses(said, ev.scenefile.loads, text.replace(old, new))


def test_a_key_of_a_layer_is_a_parameter():
    coated = scene([COAT, FILM])
    key = parameter_of(coated, "electrostatics.insulator_eps_r.1")
    assert key.value == 3.35
    changed = key.applied(coated, 0.15).surface.insulator
    assert changed == LayerStack((COAT, ev.Layer(0.09, 3.5)))
    refuses("numbers from 0 to 1", parameter_of, coated, "electrostatics.insulator_thickness")
    assert parameter_of(scene(FILM), "electrostatics.insulator_thickness").value == 0.09


def test_what_is_no_list_of_layers_is_refused():
    lossy = ev.Layer(0.02, ev.Dielectric(2.5, conductivity=1e-9))
    refuses("a Dielectric is a single layer's", ev.Display, [lossy, FILM])
    refuses("a Dielectric is a single layer's", ev.Display, [FILM, 3.0])
    refuses("a list of them from the top", ev.Display, [])
    refuses("a list of them from the top", ev.Display, "film")
    refuses("given layers that are 0 mm thick", ev.Display, [ev.Layer(0.0, 2.5)])
    assert ev.Display(lossy).insulator == lossy
