"""The edge of contact between nodes: closed forms of the gap, any place of the nodes, and short outlines."""

import numpy as np
import pytest

from evfem.finger.fingerpad import FingerPad
from evfem.studies.pressing import contact_spans
from evfem.surface.pad import outline_nodes


def spans(x, gap):
    return np.interp(contact_spans(x, gap, gap == 0.0), np.arange(x.size), x)


def hertz_gap(x, a):
    # outside a Hertz contact of half-width a (R = 1/2): x sqrt(x^2 - a^2) - a^2 acosh(x / a)
    r = np.maximum(np.abs(x), a)
    return r * np.sqrt(r**2 - a**2) - a**2 * np.arccosh(r / a)


@pytest.mark.parametrize("shift", [0.0, 0.02, 0.05, 0.08, 0.097])
def test_hertz_edge_within_a_twentieth_of_the_spacing(shift):
    # nodes alone, whichever share counts, miss it by up to half a spacing, 0.05
    x = np.arange(-3.0, 3.0, 0.1) + shift
    (found,) = spans(x, hertz_gap(x, 0.83))
    assert found == pytest.approx([-0.83, 0.83], abs=0.005)


@pytest.mark.parametrize("shift", [0.0, 0.3, 0.6, 0.9])
def test_exponential_growth_is_met_exactly(shift):
    # the ansatz itself, y = b (e^{k s} - 1): a straight line through y would end 0.4 spacings off
    x = np.arange(-10.0, 11.0) + shift
    depth = np.maximum(np.abs(x) - 4.37, 0.0)
    (found,) = spans(x, np.expm1(0.4 * depth) ** 1.5)
    assert found == pytest.approx([-4.37, 4.37], abs=1e-9)


def test_several_contacts_lone_nodes_and_ends_of_the_outline():
    x = np.arange(12.0)
    gap = np.array([0.0, 0.0, 1.0, 8.0, 27.0, 1.0, 0.0, 1.0, 0.0, 4.0, 0.0, 0.0])
    found = contact_spans(x, gap, gap == 0.0)
    # y = g^(2/3) after node 1 is 1, 4, 9: exponential with ratio 5/3, zero at 2 - ln(1 + (e^k - 1)/3)/k
    k = np.log(5.0 / 3.0)
    assert found[0] == pytest.approx([0.0, 2.0 + np.log(1.0 - (np.exp(k) - 1.0) / 3.0) / k])
    assert found[1:, 1] == pytest.approx(
        [6.5, 8.5, 11.0]
    )  # one open node between: half way; the outline's end
    assert np.all(found[:, 1] >= found[:, 0])
    assert contact_spans(x, np.ones(12), np.zeros(12, dtype=bool)).shape == (0, 2)


def test_outline_runs_along_the_pad():
    mesh = FingerPad(resolution="coarse").mesh(order=2)
    nodes = outline_nodes(mesh)
    points = mesh.points[nodes]
    step = np.hypot(*np.diff(points, axis=0).T)
    assert sorted(nodes) == sorted(mesh.node_sets["pad"])
    assert step.max() < 1.0  # never jumps across the finger
    assert points[0, 0] < points[-1, 0]
    middles = nodes[1::2]
    assert set(middles) <= set(mesh.cells[:, 4:].ravel())  # ends and middles alternate
    assert not set(nodes[0::2]) & set(mesh.cells[:, 4:].ravel())
