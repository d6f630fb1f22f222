"""Energy barriers: seen where an equilibrium is one of several, and nowhere else."""

import pytest

import evfem as ev

pytestmark = pytest.mark.filterwarnings("ignore:.*the attraction exceeds the load")
THIN = ev.Layer(0.0055, 7.5)


def attracted(surface, motion, voltage=150.0, **parts):
    parts = {"law": ev.StrongTroxel(), "breakdown": "off", "voltage": voltage} | parts
    pad = ev.FingerPad(resolution="coarse", ridges=False)
    return ev.simulate(ev.Scene(pad, surface, motion=motion, **parts))


@pytest.mark.parametrize("friction", [0.0, 1.0])
def test_a_press_under_a_strong_attraction_climbs_no_barrier(friction):
    """Tissue holds nodes beside the contact back: with all of them carried along by the bone, their way back
    against the attraction was taken for a barrier in every step, held by drag in about 30 iterations.
    """
    display = ev.Display(friction=friction, insulator=THIN)
    result = attracted(display, [ev.Press(indentation=0.03, steps=6)])
    assert result.provenance["solver"]["barriers"] == 0
    assert result["newton_iterations"].sum() <= 45


def test_a_pad_that_slides_on_a_wave_climbs_no_barrier():
    """Touching nodes follow the profile, not the chord between their ends: cut short through the crests they
    would give energy, which was then to be climbed.
    """
    wave = ev.Sinusoid(0.0, [(0.03, 3.0, 0.0)], insulator=THIN)
    result = attracted(wave, [ev.Press(force=0.1, steps=2), ev.Slide(distance=0.4, steps=2)], 100.0)
    assert result.provenance["solver"]["barriers"] == 0
