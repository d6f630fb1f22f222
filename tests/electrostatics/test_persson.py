"""Rough faces of a scanned map or a spectrum: their waves, Persson's mean separation, the law of its rows."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import erf
from tools.builders import benchmark_finger, left_over
from tools.refusals import refuses
from tools.scenes import PRESS, head

import evfem as ev
from evfem.electrostatics import persson
from evfem.electrostatics.roughness import separation_derivative
from evfem.scene.file import dump, loads

#: a self-affine spectrum: mm^4 at 10/mm, its power, and its ends in 1/mm; modulus in MPa
C_0, POWER, Q_0, Q_1 = 1e-9, -3.6, 10.0, 1000.0
E = 0.7
PIXEL = 0.002


def spectrum(q):
    return C_0 * (q / Q_0) ** POWER


def moment(n):
    """By hand: the integral of q^n C dq."""
    n += POWER + 1.0
    return C_0 * Q_0**-POWER * (Q_1**n - Q_0**n) / n


def waves(rows=2):
    q = np.geomspace(Q_0, Q_1, rows)
    return persson.waves_of_spectrum(q, spectrum(q))


def power_law(q):
    """Amplitudes of waves of up to 16 pixels, q in waves per pixel."""
    return np.where(q < 1.0 / 16.0, 0.0, np.maximum(q, 1.0 / 16.0) ** -1.8)


def heights(size=(64, 64), amplitude=power_law):
    """A periodic map (mm) with waves of random phase."""
    rng = np.random.default_rng(1)
    q = np.hypot(*np.meshgrid(*map(np.fft.fftfreq, size), indexing="ij"))
    h = np.fft.ifft2(np.fft.fft2(rng.standard_normal(size)) * amplitude(q)).real
    return 1e-3 * h / h.std()


def published(p, gamma=0.45):
    """The published double integral (Yang and Persson 2008), by quadrature."""

    def inner(root):
        q = Q_0 + root**2
        w = (np.pi * C_0 * Q_0**-POWER * (q**0.4 - Q_0**0.4) / 0.4) ** -0.5

        def of(load):
            share = erf(w * load / E)
            return (gamma + 3.0 * (1.0 - gamma) * share**2) * np.exp(-((w * load / E) ** 2)) / load

        most = 7.0 * E / w
        found = quad(of, p, most, epsrel=1e-9, limit=200)[0] if most > p else 0.0
        return 2.0 * root * q**2 * spectrum(q) * w * found

    return np.sqrt(np.pi) * quad(inner, 0.0, np.sqrt(Q_1 - Q_0), epsrel=1e-7, limit=300)[0]


def test_the_mean_separation_is_the_published_integral():
    for p in (1e-4, 2e-3, 2e-2):
        assert persson.separation([p], waves(), E)[0] == pytest.approx(published(p), rel=2e-4)


def test_waves_of_a_spectrum_have_its_moments():
    found = waves()
    assert found.rms == pytest.approx(np.sqrt(2.0 * np.pi * moment(1)), rel=1e-4)
    assert found.slope[-1] == pytest.approx(np.sqrt(2.0 * np.pi * moment(3)), rel=1e-4)


@pytest.mark.parametrize("size", [(64, 64), (48, 32)])
def test_waves_of_a_periodic_map_have_its_heights_and_slopes(size):
    """Parseval; slopes of the trigonometric polynomial, by another way than the power."""
    h = heights(size) + 0.3
    found = persson.waves_of_map(h, PIXEL, True)
    assert found.rms == pytest.approx(h.std(), rel=1e-13)
    assert found.summit == pytest.approx(h.max() - h.mean(), rel=1e-13)
    square = 0.0
    for axis, n in enumerate(size):
        k = 2.0 * np.pi * np.fft.fftfreq(n, PIXEL).reshape(-1, *(1,) * (1 - axis))
        square += np.mean(np.abs(np.fft.ifft(1j * k * np.fft.fft(h, axis=axis), axis=axis)) ** 2)
    assert found.slope[-1] == pytest.approx(np.sqrt(square), rel=1e-12)


def test_one_wave_has_its_own_wave_number_and_slope():
    x = np.arange(40) * PIXEL
    h = 0.001 * np.sin(2.0 * np.pi * x / 0.02)[:, None] * np.ones(40)
    found = persson.waves_of_map(h, PIXEL, True)
    strong = np.argmax(np.diff(found.slope**2, prepend=0.0))
    assert found.q[strong] == pytest.approx(2.0 * np.pi / 0.02, rel=1e-12)
    assert found.slope[-1] == pytest.approx(0.001 * 2.0 * np.pi / 0.02 / np.sqrt(2.0), rel=1e-12)


def test_a_wave_as_long_as_the_map_counts():
    """And one of a quarter of it: wave numbers and slopes of a periodic map, in closed form."""
    x, length = 1e-3 * np.arange(64), 0.064
    h = 1e-3 * np.sin(2.0 * np.pi * x / length) + 2e-4 * np.cos(8.0 * np.pi * x / length)
    waves = persson.waves_of_map(np.tile(h, (64, 1)), 1e-3, True)
    q, rms = np.array([2.0, 8.0]) * np.pi / length, np.array([1e-3, 2e-4]) / np.sqrt(2.0)
    some = np.append(True, np.diff(waves.slope) > 1e-9 * waves.slope[-1])  # rounding has rings too
    assert waves.q[some] == pytest.approx(q, rel=1e-12)
    assert waves.slope[some] == pytest.approx(np.sqrt(np.cumsum((q * rms) ** 2)), rel=1e-12)


def test_the_work_of_flattening_is_the_energy_of_the_flattened_waves():
    """The integral of u dp over all loads is E*/4 sum q |h_q|^2: of a half-space that follows every wave."""
    h = heights()
    found = persson.waves_of_map(h, PIXEL, True)
    full = persson.full_pressure(found, E)
    p = np.geomspace(1e-9 * full, full, 2001)
    work = np.trapezoid(persson.separation(p, found, E) * p, np.log(p))
    power = np.abs(np.fft.fft2(h) / h.size) ** 2
    q = 2.0 * np.pi * np.hypot(*np.meshgrid(*(np.fft.fftfreq(64, PIXEL),) * 2))
    assert work == pytest.approx(0.25 * E * (q * power).sum(), rel=1e-5)


def test_a_light_load_separates_by_the_logarithm_of_the_pressure():
    """u_0 = sqrt(pi) gamma int q^2 C w dq, of the order of the rms height; gamma alone where few touch."""
    light = np.array([1e-9, 1e-8])
    u = persson.separation(light, waves(), E)
    integral = quad(
        lambda root: (
            2.0 * root * (Q_0 + root**2) ** 2 * spectrum(Q_0 + root**2)
            * (np.pi * C_0 * Q_0**-POWER * ((Q_0 + root**2) ** 0.4 - Q_0**0.4) / 0.4) ** -0.5
        ),
        0.0, np.sqrt(Q_1 - Q_0), limit=300,
    )[0]  # fmt: skip
    decay = (u[0] - u[1]) / np.log(10.0)
    assert decay == pytest.approx(0.45 * np.sqrt(np.pi) * integral, rel=5e-4)
    assert 0.2 < decay / waves().rms < 1.0


def test_separations_scale_with_the_heights_and_pressures_with_modulus_and_slope():
    h = heights()
    p = np.array([1e-3, 1e-2, 0.1])
    law = ev.TableRoughness.from_map(h, PIXEL, E, periodic=True)
    higher = ev.TableRoughness.from_map(2.0 * h, PIXEL, E, periodic=True)
    wider = ev.TableRoughness.from_map(h, 2.0 * PIXEL, 2.0 * E, periodic=True)
    np.testing.assert_allclose(higher.separation(2.0 * p), 2.0 * law.separation(p), rtol=1e-9)
    np.testing.assert_allclose(wider.separation(p), law.separation(p), rtol=1e-9)


def test_the_law_has_the_theory_between_its_rows_and_its_summit_when_open():
    q = np.geomspace(Q_0, Q_1, 20)
    law = ev.TableRoughness.from_spectrum(q, spectrum(q), E)
    assert law.separation(0.0) == pytest.approx(3.0 * waves().rms, rel=1e-4)
    assert law.distribution == "gaussian"
    p = np.geomspace(law.pressure[1], law.pressure[-1], 5000)
    u = persson.separation(p, waves(), E)
    assert np.abs(law.separation(p) - u).max() < 2e-4 * law.gap[0]
    assert (np.diff(law.separation(p)) <= 0.0).all()
    before = np.linspace(0.0, law.pressure[1], 9)[1:-1]
    tangent = law.gap[0] + (law.gap[1] - law.gap[0]) * before / law.pressure[1]
    np.testing.assert_allclose(law.separation(before), tangent, rtol=2e-3)
    slope = (persson.separation([1.0001 * law.pressure[1]], waves(), E)[0] - u[0]) / (1e-4 * law.pressure[1])
    assert (law.gap[1] - law.gap[0]) / law.pressure[1] == pytest.approx(slope, rel=1e-3)
    assert law.separation(10.0) == law.gap[-1] < 1e-12


TABLE = ev.TableRoughness([0.0, 0.01, 0.05, 0.1], [0.004, 0.003, 0.0022, 0.0013], "exponential")


def test_rows_are_met_and_slopes_are_continuous_and_those_of_the_separation():
    np.testing.assert_allclose(TABLE.separation(np.array(TABLE.pressure)), TABLE.gap, rtol=1e-14)
    p = np.array([0.004, 0.03, 0.08, 0.5])
    by_step = np.imag(TABLE.separation(p + 1e-30j)) / 1e-30
    np.testing.assert_allclose(separation_derivative(TABLE, p), by_step, rtol=1e-12, atol=1e-15)
    by_difference = (TABLE.separation(p + 1e-7) - TABLE.separation(p - 1e-7)) / 2e-7
    np.testing.assert_allclose(by_step, by_difference, rtol=1e-6, atol=1e-12)
    for row in TABLE.pressure[1:]:
        sides = [separation_derivative(TABLE, row * (1.0 + side)) for side in (-1e-9, 1e-9)]
        assert sides[0] == pytest.approx(sides[1], rel=1e-6, abs=1e-9)


def test_a_scan_is_levelled_and_keeps_its_rms_height():
    h = heights()
    tilted = h + 0.01 * np.arange(64)[:, None] * PIXEL + 0.02 * np.arange(64) * PIXEL
    level, found = (persson.waves_of_map(one, PIXEL, False) for one in (h, tilted))
    for one, other in zip(level, found, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6)
    assert found.rms == pytest.approx(h.std(), rel=0.01)
    p = np.array([1e-3, 1e-2])
    laws = [ev.TableRoughness.from_map(h, PIXEL, E, periodic=whole) for whole in (False, True)]
    windowed, periodic = (law.separation(p) for law in laws)
    np.testing.assert_allclose(windowed, periodic, rtol=0.1)


def test_a_scene_with_a_scanned_law_obeys_the_theory_at_every_node():
    law = ev.TableRoughness.from_map(heights(), PIXEL, 30.0, periodic=True)
    scene = ev.Scene(
        benchmark_finger(), ev.Display(ev.TOUCHSCREEN), ev.StrongTroxel(), 100.0,
        [ev.Press(force=0.05, steps=2), ev.Slide(0.2, steps=1)], roughness_gap=law,
    )  # fmt: skip
    result, plain = (
        ev.simulate(scene),
        ev.simulate(replace(scene, roughness_gap=replace(law, distribution="none"))),
    )
    assert left_over(result) < 1e-7
    assert result.electrostatic_force[-1] > 1.05 * plain.electrostatic_force[-1] > 0.0
    frame, pad = plain.frames[-1], plain.mesh.node_sets["pad"]
    pressed, found = frame.contact_pressure[pad], frame.electrostatic_traction[pad]
    touching = (frame.contact_status[pad] > 0) & (found > 0.0)
    skin = ev.Layers.of(ev.Layer(0.38, 1650.0), ev.TOUCHSCREEN)
    waves = persson.waves_of_map(heights(), PIXEL, True)
    apart = persson.separation(np.maximum(pressed[touching], 1e-9), waves, 30.0)
    loaded = pressed[touching] > law.pressure[1]
    assert loaded.sum() > 10
    expected = ev.StrongTroxel().traction(apart[loaded], 100.0, skin)
    np.testing.assert_allclose(found[touching][loaded], expected, rtol=2e-3)


def test_a_scene_file_holds_the_rows():
    rows = "law = 'table'\npressure = [0.0, 0.01, 0.05, 0.1]\ngap = [0.004, 0.003, 0.0022, 0.0013]\n"
    text = head('law = "kaczmarek"\nvoltage = 100.0\ninsulator = "touchscreen"\nROUGH') + PRESS
    table = "[electrostatics.roughness_gap]\n" + rows + "distribution = 'exponential'"
    scene = loads(text.replace("ROUGH", table))
    assert scene.roughness_gap == TABLE
    assert loads(dump(scene)).roughness_gap == TABLE


@pytest.mark.parametrize(
    ("words", "rows"),
    [
        ("pressure: given 2 from", ([0.1, 0.2], [0.002, 0.001])),
        ("pressure: given 1 from", ([0.0], [0.002])),
        ("pressure: given pressures that do not grow", ([0.0, 0.2, 0.2], [0.003, 0.002, 0.001])),
        ("gap: given 1 for 2 pressures", ([0.0, 0.2], [0.002])),
        ("gap: given 2 for 2 pressures; allowed: as many", ([0.0, 0.2], [0.001, 0.002])),
        ("gap: given -0.001", ([0.0, 0.2], [0.001, -0.001])),
        ("pressure: given nan", ([0.0, np.nan], [0.002, 0.001])),
    ],
)  # fmt: skip
def test_rows_that_are_no_law_are_refused(words, rows):
    refuses(words, ev.TableRoughness, *rows)


def test_what_is_no_map_or_spectrum_is_refused():
    from_map, from_spectrum = ev.TableRoughness.from_map, ev.TableRoughness.from_spectrum
    h = heights()
    refuses(r"heights: given an array of shape \(64,\)", from_map, h[0], PIXEL, E)
    for gaps in (np.where(h == h.max(), np.nan, h), np.ma.masked_equal(h, h.max())):
        refuses("heights: given 1 of 4096 points missing", from_map, gaps, PIXEL, E)
    refuses("heights: given an array of shape .*complex", from_map, 1j * h, PIXEL, E)
    refuses("heights: given heights of rms", from_map, np.ones((8, 8)), PIXEL, E)
    refuses("pixel: given 0", from_map, h, 0.0, E)
    refuses("modulus: given -1", from_map, h, PIXEL, -1.0)
    refuses("open_gap: given 0", from_map, h, PIXEL, E, open_gap=0.0)
    refuses("open_gap: given 1", from_map, h, PIXEL, E, open_gap=1.0)
    refuses('distribution: given "even"', from_map, h, PIXEL, E, distribution="even")
    refuses("q: given 2 wave numbers that do not grow", from_spectrum, [20.0, 10.0], [1e-9, 1e-9], E)
    refuses("C: given an array of shape", from_spectrum, [10.0, 20.0], [1e-9], E)
    refuses("C: given", from_spectrum, [10.0, 20.0], [1e-9, 0.0], E)
    refuses("C: given", from_spectrum, [10.0, 20.0], np.ma.masked_less([1e-9, 1e-12], 1e-10), E)


@pytest.mark.scans
@pytest.mark.filterwarnings("ignore::ImportWarning")
def test_a_spectrum_of_surfacetopography_gives_the_law_of_the_map(tmp_path):
    """Its spectrum is (2 pi)^2 times the one here; a scan goes through a file."""
    from SurfaceTopography import Topography, read_topography

    h, size = heights((256, 256), lambda q: np.exp(-((q / 0.05) ** 2))), 256 * PIXEL
    Topography(h, physical_sizes=(size, size), unit="mm", periodic=True).to_netcdf(str(tmp_path / "a.nc"))
    scan = read_topography(str(tmp_path / "a.nc")).to_unit("mm")
    law = ev.TableRoughness.from_map(scan.heights(), scan.pixel_size[0], E, periodic=True)
    q, C = scan.power_spectrum_from_area()
    there = np.nan_to_num(C) > 1e-9 * np.nanmax(C)
    other = ev.TableRoughness.from_spectrum(q[there], C[there] / (2.0 * np.pi) ** 2, E)
    p = np.array([1e-3, 5e-3, 2e-2])
    np.testing.assert_allclose(other.separation(p), law.separation(p), rtol=0.03)
