"""Gratings and self-affine roughness against their closed forms: areas, spectrum, root mean squares."""

import numpy as np
import pytest
from scipy.integrate import trapezoid

from evfem.errors import InputError
from evfem.surface.textures import Grating, SelfAffine

X = np.linspace(-1.7137, 2.3071, 41)
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
    with pytest.raises(InputError, match=sentence):
        make()
