"""The studies of the whole finger pad, and of whorl, loop and arch."""

import numpy as np
import pytest
from evfem.studies import fingertip

import evfem as ev
from evfem.electrostatics.laws import Layers
from evfem.surface.skin import make_skin

SKIN = ev.Layer(0.38, 1650.0)


def test_a_smooth_rigid_pad_has_the_force_of_its_ellipsoid():
    """Kaczmarek's pressure over the ellipse of the lower half, by Gauss's rule in polar coordinates:
    within 0.1 %. The stratum corneum is as thick as below the lowest point.
    """
    finger = ev.Fingertip.participant("ii", "coarse", ridges=False)
    a, b, c = 0.5 * finger.width, 0.5 * finger.height, 0.5 * finger.length
    x, w = np.polynomial.legendre.leggauss(400)
    radius, weight = 0.5 * (1.0 + x), 0.5 * w  # sin of the polar angle
    layers = Layers.of(SKIN, ev.FILM)
    for voltage, gap in ((2000.0, 0.5), (2000.0, 0.25)):
        pressure = ev.Kaczmarek().traction(gap + b * (1.0 - np.sqrt(1.0 - radius**2)), voltage, layers)
        exact = 1e3 * 2.0 * np.pi * a * c * float(weight @ (radius * pressure))
        mesh = finger.mesh()
        own = fingertip.force_on(finger, mesh, make_skin(mesh), ev.Kaczmarek(), voltage, gap)
        assert own == pytest.approx(exact, rel=1e-3)


@pytest.mark.slow
def test_areas_and_widths_and_what_would_bring_them_to_adams(numbers_of):
    """The quick study: Adams' area is twice the pad's at 0.5 N, half the moduli give 1.4, and a
    cross-section needs a wider pad under more load; ridges and laws order the hovering forces.
    """
    numbers = numbers_of("fingertip")
    wanted = numbers["variant.wanted_over_unchanged"]
    assert 1.0 / numbers["verdict.smooth.gross_over_adams.0.5N"] == pytest.approx(wanted)
    assert 1.2 < numbers["variant.all moduli x 0.5.area_over_unchanged"] < wanted < 2.4
    assert 4.5 < numbers["width_mm.smooth.0.1N"] < numbers["width_mm.smooth.0.5N"] < 8.0
    for law in ("kaczmarek", "strong_troxel"):
        for case in ("HVHD", "HVLD", "LVLD"):
            smooth, ridged = (numbers[f"{kind}.{law}.median_mN.{case}"] for kind in ("smooth", "ridged"))
            assert 0.9 * smooth < ridged < smooth
            assert 0.92 < numbers[f"verdict.smooth.{law}.over_closed_form.{case}"] < 1.0


@pytest.mark.slow
def test_parallel_ridges_yield_across_and_slide_in_the_end_with_the_coefficient(numbers_of):
    """The quick study: two directions of one pattern, beside a smooth pad."""
    numbers = numbers_of("fingerprint")
    x, z = (numbers[f"along.{way}.stiffness_N_per_mm"] for way in "xz")
    smooth_x, smooth_z = (numbers[f"smooth.{way}.stiffness_N_per_mm"] for way in "xz")
    assert x < smooth_x
    assert z / x > 1.02 * smooth_z / smooth_x
    for way in "xz":
        assert 0.8 < numbers[f"along.{way}.friction_at_the_end_over_full_slip"] < 1.0 + 1e-6
    assert 0.6 < numbers["verdict.along.attraction_over_smooth"] < 1.0
