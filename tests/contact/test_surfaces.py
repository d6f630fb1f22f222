"""Surfaces and textures: heights, areas and spectra against their formulas, derivatives by differences,
friction tables, refused input.
"""

import numpy as np
import pytest
from scipy.integrate import trapezoid
from tools.refusals import refuses

from evfem.electrostatics.laws import Layer
from evfem.surface.surfaces import Display, Flat, Profile, Sinusoid
from evfem.surface.textures import Grating, SelfAffine
from evfem.tensor import complex_step

X = np.linspace(-1.7137, 2.3071, 41)  # meets no sample, where curvatures jump
SAMPLES = ([-1.0, -0.4, 0.1, 0.9, 1.3, 2.0], [0.0, 0.05, 0.02, 0.02, -0.1, 0.3])
SURFACES = [Flat(), Display(), Sinusoid(), Sinusoid(terms=[[0.1, 3.0, 0.4]]), Profile(*SAMPLES)]
SURFACES += [Grating(period=1.0, groove_depth=0.1), Grating(0.7, 0.02, 0.2, wall_width=0.1, phase=0.3)]
SURFACES += [SelfAffine(hurst=0.7, rms=0.02)]
names = {"ids": lambda surface: type(surface).__name__}


def test_equation_25():
    np.testing.assert_allclose(
        Sinusoid().height(X), 0.025 * (np.sin(6.0 * X) + np.cos(12.0 * X) - 1.0), atol=1e-16
    )


def test_terms_are_amplitude_wavenumber_phase():
    np.testing.assert_allclose(Sinusoid(terms=[[0.1, 3.0, 0.4]]).height(X), 0.1 * np.sin(3.0 * X + 0.4))


@pytest.mark.parametrize("surface", SURFACES, **names)
def test_slope_and_curvature_are_derivatives_of_the_height(surface):
    h = 1e-5
    slope = (surface.height(X + h) - surface.height(X - h)) / (2 * h)
    np.testing.assert_allclose(surface.slope(X), slope, atol=1e-7)
    np.testing.assert_allclose(surface.slope(X), complex_step(surface.height, X), atol=1e-14)
    np.testing.assert_allclose(surface.curvature(X), complex_step(surface.slope, X), atol=1e-12)


@pytest.mark.parametrize("surface", SURFACES, **names)
@pytest.mark.parametrize("x", [0.3, np.array(0.3), np.full((2, 3), 0.3)])
def test_results_have_the_shape_of_x(surface, x):
    for method in (surface.height, surface.slope, surface.curvature, surface.friction_coefficient):
        assert np.shape(method(x)) == np.shape(x)
    assert np.iscomplexobj(surface.height(np.asarray(x) + 1e-30j))


def test_profile_is_scipys_pchip_inside_and_level_outside():
    from scipy.interpolate import PchipInterpolator

    surface, inner = Profile(*SAMPLES), PchipInterpolator(*SAMPLES)
    inside = (X >= -1.0) & (X <= 2.0)
    np.testing.assert_allclose(surface.height(X)[inside], inner(X[inside]), atol=1e-16)
    np.testing.assert_allclose(surface.slope(X)[inside], inner(X[inside], 1), atol=1e-15)
    ends = surface.height(np.array([-9.0, -1.0, 2.0, 9.0]))
    np.testing.assert_allclose(ends, [0.0, 0.0, 0.3, 0.3], atol=1e-15)
    assert surface.slope(np.array([-9.0, 9.0])).tolist() == [0.0, 0.0]


def test_friction_is_linear_between_rows_and_jumps_at_a_repeated_x():
    surface = Flat(friction=[[0.0, 0.2], [1.0, 0.4], [1.0, 0.6], [3.0, 0.0]])
    x = np.array([-5.0, 0.0, 0.25, np.nextafter(1.0, 0.0), 1.0, 2.0, 3.0, 5.0])
    np.testing.assert_allclose(
        surface.friction_coefficient(x), [0.2, 0.2, 0.25, 0.4, 0.6, 0.3, 0.0, 0.0], atol=1e-15
    )
    for rows, found in (([[0.0, 0.7]], [0.7] * 3), ([[0.0, 0.1], [0.0, 0.3]], [0.1, 0.3, 0.3])):
        assert Flat(friction=rows).friction_coefficient(np.array([-1.0, 0.0, 1.0])).tolist() == found


def test_jumps_and_slopes_of_a_friction_table_are_those_of_the_coefficient():
    """Just before and at a jump; central differences between the rows; equal rows are no jump."""
    rows = [[-1.0, 0.3], [0.0, 0.5], [0.0, 0.2], [1.0, 0.2], [1.0, 0.2], [3.0, 0.8], [3.0, 0.9]]
    table = Flat(friction=rows)
    places = np.array([0.0, 3.0])
    before, after = (table.friction_coefficient(places + shift) for shift in (-1e-9, 0.0))
    np.testing.assert_allclose(table.friction_jumps, np.stack([places, before, after], axis=1), atol=1e-8)
    x = np.array([-2.0, -0.5, 0.5, 1.5, 2.9, 4.0])
    rise = table.friction_coefficient(x + 1e-3) - table.friction_coefficient(x - 1e-3)
    np.testing.assert_allclose(table.friction_slope(x), rise / 2e-3, atol=1e-12)
    assert np.unique(table.friction_slope(x).round(9)).tolist() == [0.0, 0.2, 0.3]


def test_has_friction_looks_at_the_whole_table():
    assert Flat(friction=0.1).has_friction
    assert not Flat(friction=0.0).has_friction
    assert Sinusoid(friction=[[0.0, 0.0], [1.0, 0.2]]).has_friction
    assert not Sinusoid(friction=[[0.0, 0.0], [1.0, 0.0]]).has_friction


def test_only_level_surfaces_are_flat():
    assert [s.is_flat for s in SURFACES] == [True, True] + [False] * 6


def test_display_is_flat_with_the_insulator_of_table_2():
    display = Display()
    assert display.insulator == Layer(thickness=0.09, eps_r=3.35)
    assert display.friction == 0.3
    assert Display(Layer(0.001, 5.0)).insulator.thickness == 0.001
    assert Flat().insulator is None


@pytest.mark.parametrize("surface", SURFACES, **names)
def test_shifted_returns_a_copy_whose_profile_is_not_shifted(surface):
    moved = surface.shifted(-6.4)
    assert (surface.y, moved.y) == (None, -6.4)
    assert type(moved) is type(surface)
    np.testing.assert_array_equal(moved.height(X), surface.height(X))


def test_profile_from_a_file(tmp_path):
    path = tmp_path / "scan.csv"
    path.write_text("x,height\n-1, 0.0\n0.5,0.25\n\n2.0,1e-1\n")
    surface = Profile.from_csv(path, friction=0.2, y=1.0)
    np.testing.assert_array_equal(surface.x, [-1.0, 0.5, 2.0])
    np.testing.assert_array_equal(surface.samples, [0.0, 0.25, 0.1])
    assert (surface.friction, surface.y) == (0.2, 1.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("height,x\n0,1\n1,2\n", "header x,height"),
        ("", "header x,height"),
        ("x,height\n0,1\n1,two\n", "line 3"),
        ("x,height\n0,1\n1,2,3\n", "line 3"),
        ("x,height\n0,1\n1,nan\n", "line 3"),
        ("x,height\n0,1\n", "at least two points"),
        ("x,height\n0,1\n2,1\n1,1\n", "2, then 1 .points 2, 3"),
        ("x,height\n0,1\n0,2\n", "increasing"),
        (
            "0.0 0.1\n1.0 0.2\n",
            "scan.csv, which has no header; allowed: a readable csv file with the header x,height",
        ),
    ],
)
def test_wrong_files_are_refused_with_the_place(tmp_path, text, words):
    path = tmp_path / "scan.csv"
    path.write_text(text)
    refuses(words, Profile.from_csv, path)


def test_missing_and_binary_files_are_refused(tmp_path):
    assert refuses("No such file", Profile.from_csv, tmp_path / "none.csv").key == "surface.file"
    (tmp_path / "picture.csv").write_bytes(b"\x89PNG\x00\x01")
    refuses("not a text file", Profile.from_csv, tmp_path / "picture.csv")


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda: Flat(friction=-0.1), "surface.friction"),
        (lambda: Flat(friction=float("nan")), "surface.friction"),
        (lambda: Flat(friction="rough"), "surface.friction"),
        (lambda: Flat(friction=True), "surface.friction"),
        (lambda: Flat(friction=[]), "surface.friction"),
        (lambda: Flat(friction=[[0.0, 0.1, 0.2]]), "surface.friction"),
        (lambda: Flat(friction=[[0.0, 0.1], [1.0]]), "surface.friction"),
        (lambda: Flat(friction=[[0.0, 0.1], [1.0, -0.1]]), "surface.friction"),
        (lambda: Flat(friction=[[1.0, 0.1], [0.0, 0.1]]), "surface.friction"),
        (lambda: Flat(friction=[[0.0, float("inf")]]), "surface.friction"),
        (lambda: Flat(y="low"), "surface.y"),
        (lambda: Flat(y=float("nan")), "surface.y"),
        (lambda: Display(insulator=0.09), "surface.insulator"),
        (lambda: Sinusoid(terms=[[0.1, 3.0]]), "surface.terms"),
        (lambda: Sinusoid(terms=[]), "surface.terms"),
        (lambda: Profile([0.0, 1.0], [0.0, float("nan")]), "surface.height"),
        (lambda: Profile([0.0, 1.0], [0.0, 1.0, 2.0]), "surface.x"),
        (lambda: Profile([0.0], [0.0]), "surface.x"),
        (lambda: Profile([0.0, 0.0], [0.0, 1.0]), "surface.x"),
        (lambda: Profile([[0.0, 1.0]], [0.0, 1.0]), "surface.x"),
        (lambda: Profile(["a", "b"], [0.0, 1.0]), "surface.x"),
        (lambda: Profile([0.0, 1.0], [0.0, 1.0], friction=-1.0), "surface.friction"),
    ],
)
def test_impossible_surfaces_are_refused_by_key(make, key):
    assert refuses("allowed", make).key == key


def test_profile_does_not_change_with_the_arrays_it_was_made_from():
    x, height = np.array([0.0, 1.0]), np.array([0.0, 1.0])
    surface = Profile(x, height)
    x += 5.0
    assert surface.x.tolist() == [0.0, 1.0]


TEXTURES = [
    Grating(period=1.0, groove_depth=0.1),
    Grating(period=0.7, groove_depth=0.02, groove_width=0.2, wall_width=0.1, phase=0.3),
    SelfAffine(hurst=0.7, rms=0.02),
]


def sampled(rough, count):
    """Heights at `count` places over one period."""
    return rough.height(np.arange(count) * rough.period / count)


@pytest.mark.parametrize("surface", TEXTURES, ids=lambda surface: type(surface).__name__)
def test_a_texture_repeats_after_its_period(surface):
    np.testing.assert_allclose(surface.height(X + 3.0 * surface.period), surface.height(X), atol=1e-13)
    assert np.ptp(surface.height(X + 0.4 * surface.period) - surface.height(X)) > 0.01


def test_a_grating_has_ridges_grooves_and_walls_where_it_says():
    """Ridges 0.42 wide at half depth around x = 0.21, grooves 0.28, walls 0.1 around half depth."""
    grating = Grating(period=0.7, groove_depth=0.04, groove_width=0.28, wall_width=0.1, phase=0.3)
    places = np.array([0.21, 0.37, 0.42, 0.47, 0.56, 0.0, -0.05, 0.05])
    expected = [0.0, 0.0, -0.02, -0.04, -0.04, -0.02, -0.04, 0.0]
    np.testing.assert_allclose(grating.height(places), expected, atol=1e-15)
    assert np.abs(grating.slope(places)).max() == pytest.approx(0.5 * np.pi * 0.04 / 0.1, rel=1e-12)
    # the walls are odd around half depth: a groove is depth times width in area
    x = np.linspace(0.0, 0.7, 70_001)
    assert trapezoid(grating.height(x), x) == pytest.approx(-0.04 * 0.28, rel=1e-8)


def test_a_grating_is_even_by_itself():
    grating = Grating(period=1.2, groove_depth=0.1)
    assert (grating.groove_width, grating.wall_width, grating.phase) == (0.6, 0.3, 0.0)
    assert Grating(period=1.0, groove_depth=0.1, groove_width=0.2).wall_width == 0.1


@pytest.mark.parametrize("hurst", [0.0, 0.5, 0.8, 1.0])
def test_the_spectrum_falls_as_the_hurst_exponent_says(hurst):
    """By the discrete Fourier transform, at every wave of the band: exactly, and nothing beside."""
    rough = SelfAffine(hurst=hurst, rms=0.013, period=8.0, shortest=0.1, longest=4.0, seed=3)
    power = np.abs(np.fft.rfft(sampled(rough, 400))) ** 2
    wave = np.arange(len(power))
    band = (wave >= 2) & (wave <= 80)
    slope, _ = np.polyfit(np.log(wave[band]), np.log(power[band]), 1)
    assert slope == pytest.approx(-(1.0 + 2.0 * hurst), abs=1e-9)
    np.testing.assert_allclose(
        power[band] * wave[band] ** (1.0 + 2.0 * hurst), power[2] * 2 ** (1 + 2 * hurst)
    )
    assert power[~band].max() < 1e-20 * power[2]


@pytest.mark.parametrize("seed", [0, 1, 2**40])
def test_the_root_mean_square_is_exact(seed):
    rough = SelfAffine(hurst=0.6, rms=0.02, period=5.0, shortest=0.25, seed=seed)
    heights = sampled(rough, 50)
    assert np.sqrt(np.mean(heights**2)) == pytest.approx(0.02, rel=1e-12)
    assert heights.mean() == pytest.approx(0.0, abs=1e-15)


def test_the_seed_says_which_profile_it_is():
    rough = SelfAffine(hurst=0.8, rms=0.01, seed=7)
    np.testing.assert_array_equal(rough.height(X), SelfAffine(hurst=0.8, rms=0.01, seed=7).height(X))
    assert np.abs(rough.height(X) - SelfAffine(hurst=0.8, rms=0.01, seed=8).height(X)).max() > 0.005
    # pinned: the first wave's phase over a whole turn is the first number that Python draws from 7
    assert rough.terms[0][2] / (2.0 * np.pi) == pytest.approx(0.32383276483316237, rel=1e-15)


def test_a_wider_band_keeps_the_waves_that_it_had():
    narrow = np.array(SelfAffine(hurst=0.8, rms=0.01, shortest=1.0, longest=5.0).terms)
    wide = np.array(SelfAffine(hurst=0.8, rms=0.01, shortest=0.5).terms)
    assert (len(narrow), len(wide)) == (9, 20)
    np.testing.assert_array_equal(narrow[:, 1:], wide[1:10, 1:])
    np.testing.assert_allclose(narrow[:, 0] / narrow[0, 0], wide[1:10, 0] / wide[1, 0], rtol=1e-12)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Grating(period=0.0, groove_depth=0.1), r"surface\.period: given 0\.0; allowed: a length"),
        (lambda: Grating(period=1.0, groove_depth=np.nan), r"surface\.groove_depth: given nan"),
        (
            lambda: Grating(1.0, 0.1, groove_width=1.0),
            "groove_width: given 1.0; allowed: .* below the period, 1",
        ),
        (lambda: Grating(1.0, 0.1, 0.3, wall_width=0.4), "wall_width: given 0.4; allowed: .* up to 0.3"),
        (lambda: Grating(1.0, 0.1, phase=2.0), r"surface\.phase: given 2\.0"),
        (lambda: SelfAffine(hurst=1.1, rms=0.1), "hurst: given 1.1; allowed: a Hurst exponent from 0 to 1"),
        (lambda: SelfAffine(hurst=0.8, rms=-0.1), "rms: given -0.1"),
        (lambda: SelfAffine(0.8, 0.1, longest=11.0), "longest: given 11.0; allowed: .* up to the period, 10"),
        (
            lambda: SelfAffine(0.8, 0.1, shortest=2.0, longest=1.0),
            "shortest: given 2.0; .* up to the longest, 1",
        ),
        (
            lambda: SelfAffine(0.8, 0.1, shortest=0.001),
            "given 10000 waves between 10 and 0.001 mm; allowed: 1 to",
        ),
        (lambda: SelfAffine(0.8, 0.1, shortest=3.9, longest=4.0, period=9.0), "given 0 waves"),
        (lambda: SelfAffine(0.8, 0.1, seed=1.5), "seed: given 1.5; allowed: a whole number"),
        (lambda: SelfAffine(0.8, 0.1, friction=-1.0), "friction: given -1.0"),
    ],
)
def test_what_cannot_be_is_refused(make, sentence):
    refuses(sentence, make)
