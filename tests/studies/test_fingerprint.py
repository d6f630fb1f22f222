"""The study of whorl, loop and arch."""

import pytest

from evfem import studies


@pytest.mark.slow
def test_parallel_ridges_yield_across_and_slide_in_the_end_with_the_coefficient(tmp_path):
    """The quick study: two directions of one pattern, beside a smooth pad."""
    numbers = studies.run("fingerprint", quick=True, out=tmp_path)["numbers"]
    assert (tmp_path / "fingerprint.png").stat().st_size > 10_000
    x, z = (numbers[f"along.{way}.stiffness_N_per_mm"] for way in "xz")
    smooth_x, smooth_z = (numbers[f"smooth.{way}.stiffness_N_per_mm"] for way in "xz")
    assert x < smooth_x
    assert z / x > 1.02 * smooth_z / smooth_x
    for way in "xz":
        assert 0.8 < numbers[f"along.{way}.friction_at_the_end_over_full_slip"] < 1.0 + 1e-6
    assert 0.6 < numbers["verdict.along.attraction_over_smooth"] < 1.0
