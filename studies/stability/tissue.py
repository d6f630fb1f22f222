"""Cases of the tissue: incompressible and unequal layers, meshes good and bad."""

from dataclasses import replace
from functools import partial

import numpy as np

import evfem as ev
from evfem.mesh.file import read
from evfem.meshes import FOLDER

from .case import Group, Log, Verdict, alike
from .scenes import benchmark, block, finger, grid, layered, pad, scene, shaken

INCOMPRESSIBLE = Group("incompressible")
CONTRAST = Group("contrast")
MESHES = Group("meshes")
GROUPS = (INCOMPRESSIBLE, CONTRAST, MESHES)

#: nu of the tissue -> F_n (N/mm) at 1 mm: this package's Q2-P1 on the next finer mesh (3025 nodes), pinned
FINER = {0.49: 0.269697, 0.499: 0.306696, 0.4999: 0.311283, 0.49999: 0.311753}
#: element -> deviation that its theory allows at nu = 0.49 ... 0.49999; None: it must lock
ALLOWED = {"q1": None, "q1_fbar": 0.01, "q2": 0.10, "q2p1": 0.01, "p2": 0.10}
GENTLY = {"q2", "p2"}


def _incompressible(log: Log, element: str, nu: float) -> Verdict:
    body = benchmark(tissue=(0.05, nu))
    if element == "p2":
        triangles = read(FOLDER / "benchmark-L0-triangles.msh")
        body = layered(triangles, tissue=(0.05, nu), skin=(1.0, 0.30))
    flat, press = ev.Flat(friction=0.0, y=-6.395), ev.Press(indentation=1.0, steps=4)
    result = log.simulate(scene(body, flat, press, solver=ev.Solver(element=element)))
    error = float(result.normal_force[-1]) / FINER[nu] - 1.0
    allowed = ALLOWED[element]
    if allowed is None:
        locks = error > 0.03
        return locks, f"{'locks' if locks else 'does not lock'}: F_n {error:+.1%}"
    return abs(error) < allowed, f"F_n {error:+.2%} of Q2-P1 on a finer mesh, allowed {allowed:.0%}"


for _element, _allowed in ALLOWED.items():
    for _nu in FINER:
        _physics = (
            "full integration locks: far too stiff"
            if _allowed is None
            else f"F_n within {_allowed:.0%} of a finer mesh"
            + (", stiffening mildly as nu tends to 1/2" if _element in GENTLY else "")
        )
        INCOMPRESSIBLE.case(f"{_element} nu {_nu}", _physics, quick=_nu == 0.49)(
            partial(_incompressible, element=_element, nu=_nu)
        )


def _with(layer: str, E: float, nu: float = 0.3) -> ev.FingerPad:
    return pad(ridges=True, materials={layer: ev.NeoHookean(E=E, nu=nu)})


@CONTRAST.case("nail 17 MPa on 0.034 MPa", "a nail 1000 times stiffer still changes F_n by less than 1 %")
def _nail(log: Log) -> Verdict:
    motion = ev.Press(indentation=1.0, steps=4), ev.Slide(1.0, steps=5)
    asked = [scene(_with("nail", E), ev.Flat(friction=0.3), *motion) for E in (17.0, 17_000.0)]
    return alike(log, asked, "normal_force", 0.01)


@CONTRAST.case("dry stratum corneum 100 MPa", "a dry skin carries more at the same indentation, also in slip")
def _dry(log: Log) -> Verdict:
    motion, forces = (ev.Press(indentation=1.0, steps=4), ev.Slide(4.0, steps=16)), []
    for E in (1.0, 100.0):
        result = log.simulate(scene(_with("stratum_corneum", E), ev.Flat(friction=0.5), *motion))
        ratio = float(result.tangential_force[-1] / result.normal_force[-1])
        if abs(ratio - 0.5) > 1e-6:
            return False, f"F_t/F_n = {ratio:.6f} at {E:g} MPa"
        forces.append(float(result.normal_force[3]))
    return forces[1] > 1.2 * forces[0], f"F_n {forces[0]:.4f} N/mm at 1 MPa, {forces[1]:.4f} at 100 MPa"


def _series(log: Log, contrast: float) -> Verdict:
    """Two layers with nu = 0 under a plate are one-dimensional: P = mu (F - 1/F) in both."""
    from scipy.optimize import brentq

    mesh = block(6, 8, width=4.0, height=4.0)
    region = (mesh.points[mesh.cells, 1].mean(axis=1) > 2.0).astype(int)
    two = replace(mesh, region=region, region_names={"soft": 0, "stiff": 1})
    body = layered(two, soft=(0.034, 0.0), stiff=(0.034 * contrast, 0.0))
    press = ev.Press(indentation=0.8, steps=3)
    result = log.simulate(scene(body, ev.Flat(friction=0.0), press))

    def stress(stretch: float, E: float) -> float:
        return 0.5 * E * (1.0 / stretch - stretch)

    def excess(soft: float) -> float:
        return stress(soft, 0.034) - stress(1.6 - soft, 0.034 * contrast)

    exact = 4.0 * stress(float(brentq(excess, 0.6, 0.999, xtol=1e-15)), 0.034)
    error = float(result.normal_force[-1]) / exact - 1.0
    return abs(error) < 1e-6, f"F_n is {error:+.1e} off the closed form {exact:.6f} N/mm"


for _contrast in (500.0, 3000.0, 1e6):
    CONTRAST.case(
        f"two layers 1 to {_contrast:g}", "closed form of two springs in series (nu = 0)", quick=True
    )(partial(_series, contrast=_contrast))


def _against_regular(log: Log, mesh: ev.Mesh, allowed: float) -> Verdict:
    motion = ev.Press(indentation=0.4, steps=3), ev.Slide(1.5, steps=6)
    bodies = [finger(one) for one in (block(16, 8, sag=0.4), mesh)]
    asked = [scene(body, ev.Flat(friction=0.3), *motion) for body in bodies]
    return alike(log, asked, "normal_force tangential_force", allowed)


@MESHES.case("inner nodes moved by 40 %", "forces within 1 % of the regular mesh", quick=True)
def _distorted(log: Log) -> Verdict:
    return _against_regular(log, shaken(block(16, 8, sag=0.4), 0.4), 0.01)


@MESHES.case("graded 1 to 1000", "cells from 0.001 to 0.7 mm, forces within 2 % of the regular mesh")
def _graded(log: Log) -> Verdict:
    half, up = (np.concatenate([[0.0], np.geomspace(5e-4, 1.0, n)]) for n in (18, 12))
    x, t = np.meshgrid(2.0 * np.concatenate([-half[:0:-1], half]), up)
    low = 0.4 * (0.5 * x) ** 2
    return _against_regular(log, grid(x, low + t * (2.0 - low)), 0.02)


@MESHES.case("needles 1 to 200", "cells 200 times as wide as high at the pad, forces within 3 %")
def _needles(log: Log) -> Verdict:
    y = np.concatenate([[0.0], np.linspace(0.001, 0.004, 4) / 2.0, np.linspace(0.1, 1.0, 8)])
    x, t = np.meshgrid(np.linspace(-2.0, 2.0, 21), y)
    low = 0.4 * (0.5 * x) ** 2
    return _against_regular(log, grid(x, low + t * (2.0 - low)), 0.03)


@MESHES.case("sliver ridges", "the steepest walls that are allowed: F_t = 0.3 F_n in full slip")
def _slivers(log: Log) -> Verdict:
    # a crest of 15 % of the pitch carries the load
    body = ev.FingerPad(resolution="coarse", ridge_height=0.2, ridge_exponent=5.5)
    motion = ev.Press(indentation=0.5, steps=4), ev.Slide(2.0, steps=10)
    result = log.simulate(scene(body, ev.Flat(friction=0.3), *motion))
    ratio = float(result.tangential_force[-1] / result.normal_force[-1])
    least = float(result.frames[-1].J.min())
    return abs(ratio - 0.3) < 1e-6 and least > 0.0, f"F_t/F_n = {ratio:.7f}, smallest cell J {least:.2f}"
