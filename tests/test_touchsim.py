"""Arrays for TouchSim: the depth of a flat surface in undeformed skin, in time."""

import numpy as np
import pytest

import evfem as ev
from evfem import export


def pressed(**more):
    motion = [
        ev.Press(indentation=0.4, speed=4.0, steps=4),
        ev.Wait(0.05, steps=2),
        ev.Press(indentation=0.2, speed=4.0, steps=2),
    ]
    return ev.simulate(ev.Scene(ev.FingerPad(ridges=False, resolution="coarse"), ev.Flat(), motion=motion))


@pytest.fixture(scope="module")
def result():
    return pressed()


def test_a_pin_is_as_deep_as_the_plate_stands_in_undeformed_skin(result):
    """Exactly: indentation less the height of the node above the lowest one, where that is positive."""
    found = export.touchsim(result, sample_rate=1000.0)
    x, points = found["location"][:, 0], result.mesh.points
    pad = points[result.mesh.node_sets["pad"]]
    height = np.array([pad[np.argmin(np.abs(pad[:, 0] - each)), 1] for each in x]) - pad[:, 1].min()
    # 0.1 s to 0.4 mm, held for 0.05 s, 0.05 s back to 0.2 mm
    time = np.arange(201) / 1000.0
    depth = np.interp(time, [0.0, 0.1, 0.15, 0.2], [0.0, 0.4, 0.4, 0.2])
    assert found["trace"].shape == (201, x.size)
    for k in (25, 50, 75, 100, 140, 200):  # of steps, where nothing is interpolated
        np.testing.assert_allclose(found["trace"][k], np.maximum(depth[k] - height, 0.0), atol=1e-9)
    assert (found["trace"].max(axis=0) > 0.0).all()
    assert (found["location"][:, 1] == 0.0).all()
    assert found["fs"] == 1000.0
    mean = np.abs(np.diff(np.sort(x))).mean()
    assert found["pin_radius"] == pytest.approx(0.5 * mean, rel=0.2)
    assert export.touchsim(result, pin_radius=0.2)["pin_radius"] == 0.2


def test_refused(result):
    still = ev.Scene(
        ev.FingerPad(ridges=False, resolution="coarse"), ev.Flat(), motion=ev.Press(indentation=0.1, steps=1)
    )
    with pytest.raises(ev.InputError, match="no time passes"):
        export.touchsim(ev.simulate(still))
    with pytest.raises(ev.InputError, match="sample_rate"):
        export.touchsim(result, sample_rate=0.0)
    with pytest.raises(ev.InputError, match="pin_radius"):
        export.touchsim(result, pin_radius=-1.0)
