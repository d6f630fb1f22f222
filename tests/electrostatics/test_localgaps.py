"""Rough faces attract with the mean over local gaps: closed forms, other laws, scenes in plane and space."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import exp1
from scipy.stats import norm
from tools.builders import benchmark_finger, left_over, resumed
from tools.domes import dome_scene
from tools.refusals import refuses
from tools.scenes import PRESS, head

import evfem as ev
from evfem.electrostatics.localgaps import SpreadGaps
from evfem.electrostatics.roughness import separation_derivative
from evfem.scene.file import dump, loads

gap_of = ev.electrostatics.equivalent_gap
DISTRIBUTIONS = pytest.mark.parametrize("distribution", ["exponential", "gaussian"])
#: layers of a touchscreen and of the paper's film, in um
SCREEN, FILM = 0.3776, 27.1
POWER = ev.PowerRoughness(gap=0.001, pressure=0.01, exponent=0.3, open_gap=0.004)
DRIVE = {"frequency": 1000.0, "gap_conductivity": 1e-7, "skin": "gabriel_dry"}


def averaged(of, mean, distribution):
    """The mean of a function over gaps, by adaptive quadrature on pieces that grow with the gap."""
    rms = mean / 3.0
    density = norm(mean, rms).pdf if distribution == "gaussian" else lambda u: np.exp(-u / mean) / mean
    ends = np.concatenate([[0.0], mean * np.geomspace(1e-7, 0.1, 25), mean * np.linspace(0.2, 5.0, 40)])
    if distribution == "exponential":
        ends = np.append(ends, mean * np.array([10.0, 20.0, 60.0]))
    pieces = [
        quad(lambda u: of(u) * density(u), *piece, epsabs=0.0, epsrel=1e-12)[0] for piece in pairwise(ends)
    ]
    return sum(pieces)


@DISTRIBUTIONS
@pytest.mark.parametrize("layers", [1e-4, 0.01, SCREEN, 3.0, FILM, 1e3])
def test_the_equivalent_gap_is_that_of_quadrature(layers, distribution):
    for mean in (0.2, 1.0, 5.0):
        pull = averaged(lambda u: (u + layers) ** -2, mean, distribution)
        found = gap_of(mean, layers, distribution)
        assert (found + layers) ** -2 == pytest.approx(pull, rel=1e-10)


def test_exponential_gaps_have_the_closed_form_with_the_exponential_integral():
    U, s = np.meshgrid([0.5, 1.0, 3.0], [0.1, SCREEN, 2.0])
    pull = (1.0 / s - np.exp(s / U) * exp1(s / U) / U) / U
    np.testing.assert_allclose((gap_of(U, s) + s) ** -2, pull, rtol=1e-12)


@pytest.mark.parametrize(
    ("distribution", "layers", "mean", "more"),
    [
        ("exponential", SCREEN, 1.0, 2.97),
        ("exponential", SCREEN, 3.0, 7.75),
        ("exponential", SCREEN, 5.0, 12.72),
        ("exponential", FILM, 1.0, 1.00),
        ("exponential", FILM, 10.0, 1.16),
        ("gaussian", SCREEN, 3.0, 1.51),
        ("gaussian", SCREEN, 6.0, 1.75),
        ("gaussian", SCREEN, 9.0, 1.93),
    ],
)
def test_how_much_more_than_at_the_mean_gap_rough_faces_attract(distribution, layers, mean, more):
    """Found by others, twice; the touchscreen's with a mean of 1 um to ten digits."""
    found = ((mean + layers) / (gap_of(mean, layers, distribution) + layers)) ** 2
    assert found == pytest.approx(more, rel=0.005 / more)
    assert gap_of(1.0, SCREEN) == pytest.approx(1.5666929069**-0.5 - SCREEN, rel=1e-9)


def test_thick_layers_see_the_mean_gap_and_none_the_smallest():
    """To the second order 1 - 2 U/s + 6 U^2/s^2; and e -> sqrt(U s), as half the way is open."""
    s = np.array([1e2, 1e4, 1e8])
    np.testing.assert_allclose(gap_of(1.0, s), 1.0 - 1.5 / s, rtol=0.0, atol=10.0 / s[0] ** 2)
    assert gap_of(1.0, 1e8) == pytest.approx(1.0, rel=1e-7)
    assert gap_of(1.0, 1e-9) == pytest.approx(1e-9**0.5, rel=1e-4)
    assert gap_of([0.0, 1.0], [SCREEN, 0.0]).tolist() == [0.0, 0.0]
    narrow = gap_of(3.0, SCREEN, "gaussian", rms=0.003)
    assert narrow == pytest.approx(3.0 - 1.5 * 0.003**2 / (3.0 + SCREEN), abs=1e-9)


def test_an_rms_of_its_own_is_that_of_the_faces():
    pull = quad(lambda u: norm(3.0, 1.5).pdf(u) / (u + SCREEN) ** 2, 0.0, 30.0, limit=200, epsrel=1e-11)[0]
    assert (gap_of(3.0, SCREEN, "gaussian", rms=1.5) + SCREEN) ** -2 == pytest.approx(pull, rel=1e-9)
    assert gap_of(3.0, SCREEN, "gaussian", rms=1.0) == gap_of(3.0, SCREEN, "gaussian")


def test_what_is_no_gap_or_distribution_is_refused():
    refuses("mean: given -1.0; allowed: a length in mm", gap_of, -1.0, SCREEN)
    refuses("reduced: given -1.0; allowed: a length in mm", gap_of, 1.0, -1.0)
    refuses("distribution.*exponential | gaussian", gap_of, 1.0, SCREEN, "none")
    refuses("rms: given 1.0; allowed: only that of gaussian", gap_of, 1.0, SCREEN, rms=1.0)
    refuses("rms: given 2.0; allowed: up to half the mean gap", gap_of, 3.0, SCREEN, "gaussian", rms=2.0)
    refuses("rms: given 0.0; allowed: a length in mm above zero", gap_of, 1.0, SCREEN, "gaussian", rms=0.0)
    refuses(
        "distribution.*none | exponential | gaussian", ev.ConstantRoughness, 0.001, distribution="uniform"
    )


LAWS = {
    "kaczmarek": (ev.Kaczmarek(), None),
    "sine": (ev.StrongTroxel(), ev.Drive(**DRIVE)),
    "square": (ev.Kaczmarek(), ev.Drive(**DRIVE, waveform="square")),
    "oil": (ev.StrongTroxel(gap_eps_r=2.5), None),
}


def touchscreen(rough, law=None, drive=None, **more):
    motion = [ev.Press(force=0.05, steps=2), ev.Slide(0.4, steps=2)]
    given = {"law": law or ev.StrongTroxel(), "voltage": 100.0, "drive": drive, "roughness_gap": rough}
    finger, surface, output = benchmark_finger(), ev.Display(ev.TOUCHSCREEN), ev.Output(every=4)
    return ev.Scene(finger, surface, motion=motion, output=output, **given, **more)


@DISTRIBUTIONS
@pytest.mark.parametrize("name", LAWS)
def test_any_law_attracts_at_the_equivalent_gap_with_its_own_mean(name, distribution):
    law, layers = touchscreen(0.001, *LAWS[name]).electrics.attraction
    faces = SpreadGaps(POWER, distribution, law, layers)
    for pressure in (0.0, 0.03):
        mean = averaged(lambda u: law.traction(u, 100.0, layers), POWER.separation(pressure), distribution)
        assert law.traction(faces.separation(pressure), 100.0, layers) == pytest.approx(mean, rel=1e-8)
    columns = [np.asarray(one)[..., None] * np.ones(2) for one in (layers.reduced, layers.loss)]
    nodes = ev.Layers(columns[0], layers.thickness, columns[1])
    rows = replace(faces, layers=nodes).separation(np.array([[0.0, 0.03], [0.01, 0.02], [0.03, 0.0]]))
    assert rows[:, 0].tolist() == pytest.approx([*map(faces.separation, (0.0, 0.01, 0.03))], rel=1e-12)


@DISTRIBUTIONS
@pytest.mark.parametrize("name", ["direct", *LAWS])
def test_derivatives_by_the_pressure_are_those_of_differences(name, distribution):
    law, layers = touchscreen(0.001, *LAWS.get(name, ())).electrics.attraction
    faces = SpreadGaps(POWER, distribution, law, layers)
    for p in (1e-5, 1e-3, 0.02, 0.5):
        expected = (faces.separation(1.0001 * p) - faces.separation(0.9999 * p)) / (2e-4 * p)
        assert separation_derivative(faces, p) == pytest.approx(expected, rel=1e-6)


@DISTRIBUTIONS
def test_nodes_of_a_touchscreen_obey_the_law_with_their_equivalent_gaps(distribution):
    """In the plane and in space, where the skin's layer adds to the touchscreen's."""
    rough = replace(POWER, distribution=distribution)
    stack = ev.Layers.of(ev.Layer(0.38, 1650.0), ev.TOUCHSCREEN)
    space = dome_scene(
        ev.Press(indentation=0.3, steps=2), surface=ev.Display(ev.TOUCHSCREEN), law=ev.StrongTroxel(),
        voltage=30.0, roughness_gap=rough,
    )  # fmt: skip
    for scene, volts in ((touchscreen(rough), 100.0), (space, 30.0)):
        result = ev.simulate(replace(scene, solver=replace(scene.solver, core="off")))
        frame, pad = result.frames[-1], result.mesh.node_sets["pad"]
        touching, pressure = frame.contact_status[pad] > 0, np.maximum(frame.contact_pressure[pad], 0.0)
        apart = np.where(touching, 0.0, np.maximum(frame.gap[pad], 0.0))
        apart += gap_of(POWER.separation(pressure), stack.reduced, distribution)
        found = frame.electrostatic_traction[pad]
        facing = found > 0.0
        assert touching[facing].sum() > 8
        expected = ev.StrongTroxel().traction(apart, volts, stack)
        np.testing.assert_allclose(found[facing], expected[facing], rtol=1e-9)


@DISTRIBUTIONS
def test_books_close_and_a_resumed_run_is_the_same(distribution):
    scene = touchscreen(replace(POWER, distribution=distribution))
    whole, again = resumed(scene, 2)
    assert left_over(whole) < 1e-7
    np.testing.assert_array_equal(whole.electrostatic_force, again.electrostatic_force)
    mean = ev.simulate(touchscreen(POWER))
    assert (whole.electrostatic_force > 1.05 * mean.electrostatic_force).all()


@DISTRIBUTIONS
def test_a_constant_mean_is_the_run_of_its_constant_equivalent_gap(distribution):
    """Also where the mesh needs a core, and with a pull along the normal, by the potential."""
    apart = gap_of(0.002, ev.Layers.of(ev.Layer(0.38, 1650.0), ev.TOUCHSCREEN).reduced, distribution)
    spread = touchscreen(ev.ConstantRoughness(0.002, distribution), direction="normal")
    runs = [ev.simulate(one) for one in (spread, replace(spread, roughness_gap=apart))]
    assert runs[0].provenance["core"] == pytest.approx(runs[1].provenance["core"], rel=1e-12)
    for name in ("applied_force", "electrostatic_force", "tangential_force", "electrostatic_work"):
        np.testing.assert_allclose(*(one[name] for one in runs), rtol=1e-9, atol=1e-12)


TABLE = head('law = "strong_troxel"\nvoltage = 100.0\ninsulator = "touchscreen"\nMORE') + PRESS
ROUGH = 'roughness_gap = {law = "constant", gap = 0.002, distribution = "DISTRIBUTION"}'


@DISTRIBUTIONS
def test_a_scene_file_says_it_and_the_plan_too(distribution):
    scene = loads(TABLE.replace("MORE", ROUGH.replace("DISTRIBUTION", distribution)))
    assert scene.roughness_gap == ev.ConstantRoughness(0.002, distribution)
    assert loads(dump(scene)) == scene
    told = next(term.reason for term in ev.plan(scene).terms if term.name == "electrostatics")
    reduced = scene.electrics.attraction[1].reduced
    even = f"{gap_of(0.002, reduced, distribution):.3g} mm does"
    assert f"an air gap of 0.002 mm in contact on average, {distribution}: it attracts as an even one" in told
    assert even in told
    pull = ev.StrongTroxel().traction(gap_of(0.002, reduced, distribution), 100.0, ev.Layers(reduced, 1.0))
    assert f"at most {pull:.2g} MPa on touching skin" in told


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (TABLE.replace("MORE", ROUGH), 'distribution: given "DISTRIBUTION"; allowed: none | exponential'),
        (
            TABLE.replace("MORE", 'drive = "resolved"\n' + ROUGH.replace("DISTRIBUTION", "gaussian"))
            + '[[motion]]\nkind = "wait"\nduration = 0.1\n',
            "distribution: given gaussian; allowed: .none. in a resolved drive",
        ),
    ],
)
def test_a_distribution_without_a_meaning_is_refused(text, sentence):
    assert refuses(sentence, loads, text).key == "electrostatics.roughness_gap.distribution"


def test_adhesion_alone_keeps_the_mean_gap_and_says_so():
    with pytest.raises(ev.InputError, match="only with a law of attraction: adhesion keeps the mean gap"):
        ev.Scene(
            benchmark_finger(), ev.Flat(), motion=ev.Press(force=0.05), adhesion=ev.Dugdale(0.01, 0.01),
            roughness_gap=ev.ConstantRoughness(0.001, "gaussian"),
        )  # fmt: skip


def test_a_sweep_goes_over_distributions():
    scene = loads(TABLE.replace("MORE", ROUGH.replace("DISTRIBUTION", "exponential")))
    key = "electrostatics.roughness_gap.distribution"
    sweep = ev.Sweep(scene, grid={key: ["none", "gaussian"]}, outputs=["electrostatic_force.last"])
    swept = [loads(point.text).roughness_gap for point in sweep.points()]
    assert swept == [ev.ConstantRoughness(0.002), ev.ConstantRoughness(0.002, "gaussian")]


class Own:
    """Rough faces of one's own, with a distribution."""

    def __init__(self, distribution):
        self.distribution = distribution

    def separation(self, pressure):
        return 0.003 / (1.0 + pressure / 0.02)


def test_a_law_of_ones_own_may_have_a_distribution():
    runs = [ev.simulate(touchscreen(Own(name))).electrostatic_force[-1] for name in ("none", "exponential")]
    assert runs[1] > 2.0 * runs[0]
    with pytest.raises(ev.InputError, match=r"roughness_gap\.distribution: given"):
        touchscreen(Own("wide"))
