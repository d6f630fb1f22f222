"""Hunter's problem on a finite block: a rigid cylinder that is drawn over tissue which relaxes.

A parabola of 10 mm radius stands still, a block of nearly incompressible tissue with one branch slides over
it without friction under 0.05 N/mm. Tissue is squeezed on the way and has no time to come back: the contact
is shifted to where it comes in, and the surface resists the slide though nothing rubs.

The half-plane is solved in closed form after S. C. Hunter, J. Appl. Mech. 28 (1961) 611-617; `HALF_PLANE` has
half width, centre and coefficient of resistance of these numbers. The block is 120 mm wide and 60 mm high,
bonded above: it is to show direction and size, to within what its size leaves.
"""

from typing import NamedTuple

import numpy as np

import evfem as ev
from evfem.common.arrays import Floats

from .stability.scenes import grid

RADIUS, LOAD, MODULUS, SHARE, TAU = 10.0, 0.05, 0.01, 2.0, 0.07
#: speed in mm/s -> half width, distance of the middle ahead of the lowest point (mm), tangential over normal
HALF_PLANE = {
    10.0: (3.32211910, 0.57225403, 0.0931657551),
    20.0: (2.84824771, 0.85249353, 0.1158799098),
    60.0: (2.40581584, 0.75361563, 0.0861761985),
}
WIDTH, HEIGHT, TRACK, WAY = 120.0, 60.0, 14.0, 18.0
NU = 0.499


class Rolling(NamedTuple):
    """Half width and distance of the middle ahead (mm) of a contact, tangential over normal force, and the
    pressure (MPa) over the place ahead (mm).
    """

    half_width: float
    ahead: float
    resistance: float
    place: Floats
    pressure: Floats


def block(cell: float) -> ev.Mesh:
    """Quadrilaterals of `cell` mm along the track, growing away from it."""
    far = np.geomspace(TRACK, 0.5 * WIDTH, 10)[1:]
    x = np.concatenate([-far[::-1], np.linspace(-TRACK, TRACK, round(2.0 * TRACK / cell) + 1), far])
    fine = np.arange(6) * cell
    y = np.concatenate([fine, np.geomspace(fine[-1], HEIGHT, 14)[1:]])
    return grid(*np.meshgrid(x, y))


def rolled(speed: float, cell: float, step: float) -> Rolling:
    """The cylinder after `WAY` at `speed` (mm/s) in steps of `step` mm, on cells of `cell` mm."""
    law = ev.NeoHookean(E=2.0 * (1.0 + NU) * MODULUS, nu=NU, relaxation=((SHARE, TAU),))
    begin = 0.5 * WAY
    x = np.linspace(begin - 16.0, begin + 16.0, 321)
    ground = ev.Profile(x, -((x - begin) ** 2) / (2.0 * RADIUS), friction=0.0)
    motion = [ev.Press(force=LOAD, steps=4)]
    motion += [ev.Slide(WAY, steps=round(WAY / step), speed=speed, hold="force")]
    solver, output = ev.Solver(dynamics="viscous"), ev.Output(every=10_000)
    finger = ev.MeshedFinger(block(cell), {"tissue": law})
    result = ev.simulate(ev.Scene(finger, ground, motion=motion, solver=solver, output=output))
    frame, mesh = result.frames[-1], result.mesh
    pad = mesh.node_sets["pad"]
    place = begin - (mesh.points[pad, 0] + frame.displacement[pad, 0])
    order = np.argsort(place)
    place, pressure = place[order], frame.contact_pressure[pad][order]
    touching = place[frame.contact_status[pad][order] > 0]
    width, middle = 0.5 * np.ptp(touching), 0.5 * (touching[0] + touching[-1])
    resistance = result.tangential_force[-1] / result.normal_force[-1]
    return Rolling(float(width), float(middle), float(resistance), place, pressure)
