"""Derivatives of runs against those of closed forms: relaxation, creep, spheres."""

from dataclasses import replace

import numpy as np
import pytest
from simulation.test_spheres import NU, sphere
from tools.meshes import block

import evfem as ev
from evfem.tensor import STEP

SMALL, SHARE, TAU = 1e-5, 0.8, 0.07  # mm, so that strains are linear; of a branch, s
BRANCH = [f"finger.materials.tissue.relaxation.0.{k}" for k in (0, 1)]


def relaxing(duration, *motion):
    """Derivatives by share and time of a block that sticks and relaxes alike everywhere, after a press."""
    law = ev.NeoHookean(E=0.034, nu=0.48, relaxation=((SHARE, TAU),), bulk_relaxation=True)
    finger = ev.MeshedFinger(block(4, 1, 8.0, 1.0), {"tissue": law})
    solver = ev.Solver(dynamics="viscous", element="q1", tolerance=1e-11)
    motion = [ev.Press(indentation=SMALL, speed=SMALL / duration, steps=1), *motion]
    scene = ev.Scene(finger, ev.Flat(friction=50.0, y=0.0), motion=motion, solver=solver)
    return ev.sensitivities(scene, BRANCH, ["applied_force", "indentation"])


def derivatives(law):
    """Of a law of share and time, by complex steps."""
    return [np.imag(law(SHARE + 1j * STEP, TAU)) / STEP, np.imag(law(SHARE, TAU + 1j * STEP)) / STEP]


def test_relaxation_after_a_ramp():
    """F/F(rest) = 1 + r (1 - e^(-T/tau)) tau/T e^(-t/tau) at t after a press that lasted T."""
    T = 0.01
    found = relaxing(T, ev.Wait(0.2, steps=4))
    t = found.result["time"] - T

    def law(share, tau):
        return 1.0 + share * -np.expm1(-T / tau) * tau / T * np.exp(-t / tau)

    rest = found.result.applied_force / law(SHARE, TAU)
    got = [found["applied_force", key] / rest for key in BRANCH]
    np.testing.assert_allclose(got, derivatives(law), rtol=2e-6)


def test_creep_under_a_held_force():
    """After a press too short to relax, d/d(0) = 1 + r - r e^(-t/(tau (1 + r)))."""
    T = 1e-6
    found = relaxing(T, ev.Wait(0.2, steps=40, hold="force"))
    t = found.result["time"] - T

    def law(share, tau):
        return SMALL * (1.0 + share - share * np.exp(-t / (tau * (1.0 + share))))

    got = [found["indentation", key] for key in BRANCH]
    np.testing.assert_allclose(got, derivatives(law), rtol=4e-4, atol=1e-12)


@pytest.mark.slow
def test_spheres():
    """F = 4/3 E/(1 - nu^2) R^(1/2) d^(3/2); Q = mu P (1 - (1 - x)^(3/2)), x the way over that of full slip
    (Johnson, Contact Mechanics, ch. 4 and 7). With 7 nodes on the radius, by nu, depth and way within 1.1,
    3.1 and 1.3 %, with 5 nodes 1.3, 3.2 and 5.6 %.
    """
    scene = sphere(4, 5, 7)
    scene = replace(scene, finger=ev.MeshedFinger(scene.finger.mesh(), scene.finger.materials))
    keys = ["finger.materials.lower.nu", "motion.0.indentation", "motion.1.distance", "surface.friction"]
    found = ev.sensitivities(scene, keys, ["normal_force", "tangential_force"])
    pressed = [found.elasticity["normal_force", key][0] for key in keys[:2]]
    way, friction = (found.elasticity["tangential_force", key][1] for key in keys[2:])
    assert way + friction == pytest.approx(1.0, abs=2e-3)  # Q = mu P f(way / mu)
    slipped = found.result.tangential_force[1] / (0.3 * found.result.normal_force[1])
    left = (1.0 - slipped) ** (1.0 / 3.0)
    exact = [2.0 * NU**2 / (1.0 - NU**2), 1.5, 1.5 * left * (1.0 - left**2) / slipped]
    assert (np.abs(np.array([*pressed, way]) / exact - 1.0) < [0.015, 0.035, 0.015]).all()
