"""Cases of the attraction: pull-in and hysteresis, thin insulators, voltages that jump."""

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

import evfem as ev
from evfem.reference import PullIn, pull_in_kaczmarek, pull_in_strong_troxel

from ..common import LAWS
from .case import Group, Log, Verdict, alike
from .scenes import SKIN, block, finger, pad, scene

PULL_IN = Group("pull-in")
THIN = Group("thin insulators")
VOLTAGE = Group("voltage")
GROUPS = (PULL_IN, THIN, VOLTAGE)


def _hysteresis(log: Log, law: str, top: float) -> Verdict:
    up, down = ev.VoltageRamp(top, steps=10), ev.VoltageRamp(0.0, steps=10)
    result = log.simulate(scene(pad(), ev.Display(), ev.Hover(0.05), up, down, law=LAWS[law]))
    touching = result.contact_width > 0.0
    if touching[0] or not touching[10] or touching[-1]:
        return False, "open, closed and open again at 0 V, full voltage and 0 V: not so"
    snap_in = float(result.voltage[1:11][touching[1:11]].min())
    let_go = float(result.voltage[11:][~touching[11:]].max())
    left = float(np.abs(result.frames[-1].displacement - [0.0, 0.05]).max())
    good = 0.0 < let_go < snap_in and left < 1e-9
    return good, f"snaps in by {snap_in:g} V, lets go by {let_go:g} V; {left:.0e} mm left at the end"


for _law, _top in (("strong_troxel", 3000.0), ("kaczmarek", 5000.0)):
    PULL_IN.case(
        f"hover {_law}", f"up to {_top:g} V and back: lets go below where it snaps in, undeformed at the end"
    )(partial(_hysteresis, law=_law, top=_top))


@ev.form
def rollers(u: Any, v: Any, w: Any) -> Any:
    """Sides that cannot move sideways: a spring of 1e4 MPa/mm."""
    return 1e4 * u[0] * v[0]


#: wider than about three thicknesses, a nearly incompressible layer would wrinkle below the plate's pull-in
#: (10.1103/PhysRevLett.86.119)
GAP, WIDTH, E, NU = 0.005, 0.5, 0.05, 0.45
THIN_LAYER = ev.Layer(thickness=0.01, eps_r=3.35)
SKIN_AND_INSULATOR = ev.Layers.of(ev.Layer(0.38, 1650.0), THIN_LAYER)


@dataclass(frozen=True)
class Plate:
    """A block of `thickness` (mm) that hovers GAP over a display, under a law."""

    law: Any
    thickness: float

    def scene(self, *motion: ev.VoltageRamp) -> ev.Scene:
        """Hover, then ramps of the voltage."""
        mesh = block(4, 4, width=WIDTH, height=self.thickness)
        sides = np.flatnonzero(np.abs(mesh.points[:, 0]) > 0.499 * WIDTH)
        mesh = replace(mesh, node_sets={**mesh.node_sets, "sides": sides})
        body = ev.MeshedFinger(mesh, {"tissue": ev.NeoHookean(E=E, nu=NU)}, SKIN)
        how = {"law": self.law, "solver": ev.Solver(core="off")}  # the formula is that of the law itself
        whole = scene(body, ev.Display(THIN_LAYER), ev.Hover(GAP), *motion, **how)
        return whole.with_term(rollers, on=ev.Boundary("sides"))

    @property
    def exact(self) -> PullIn:
        """Pull-in of the rigid plate on a spring of the layer's constrained modulus."""
        modulus = E * (1.0 - NU) / ((1.0 + NU) * (1.0 - 2.0 * NU))
        formula = pull_in_strong_troxel if isinstance(self.law, ev.StrongTroxel) else pull_in_kaczmarek
        return formula(modulus / self.thickness, GAP, 1.0, SKIN_AND_INSULATOR)  # N/mm on 1 mm2


def _snap(result: ev.Result) -> tuple[float, float]:
    """The last open and the first closed voltage of a ramp."""
    first = int(np.argmax(result.contact_width > 0.0))
    return float(result.voltage[first - 1]), float(result.voltage[first])


def _plate(log: Log, law: str) -> Verdict:
    """Ramps around the formula: it lies between them, the nearer the thicker the layer."""
    deviations = []
    for thickness, reach, steps in ((1.0, 0.02, 40), (10.0, 0.002, 40)):
        plate = Plate(LAWS[law], thickness)
        exact = plate.exact.voltage
        ramps = ev.VoltageRamp((1.0 - reach) * exact, 10), ev.VoltageRamp((1.0 + reach) * exact, steps)
        result = log.simulate(plate.scene(*ramps))
        if not (result.contact_width > 0.0).any():
            return False, f"open at {1.0 + reach:g} times the formula's {exact:.2f} V ({thickness:g} mm)"
        low, high = _snap(result)
        deviations.append(0.5 * (low + high) / exact - 1.0)
    good = abs(deviations[0]) < 0.01 and abs(deviations[1]) < 0.2 * abs(deviations[0]) + 1e-4
    said = f"{deviations[0]:+.3%} off the plate formula at 1 mm of thickness, {deviations[1]:+.4%} at 10 mm"
    return good, said


for _law in LAWS:
    PULL_IN.case(
        f"plate {_law}",
        "pull-in voltage of the plate formula within 1 %, nearer the thicker the layer",
        _law == "kaczmarek",
    )(partial(_plate, law=_law))


def _thin(log: Log, law: str, thickness: float) -> Verdict:
    """Touching nodes carry p(0), the others less: F_e is at least p(0) times the real contact width.
    Under Strong-Troxel's law that is more than the shear of the pad can overcome: it sticks.
    """
    display = ev.Display(ev.Layer(thickness, 3.35), friction=0.3)
    motion = ev.Press(force=0.05, steps=5), ev.Slide(3.0, steps=15)
    result = log.simulate(scene(pad(), display, *motion, law=LAWS[law], voltage=140.0))
    skin = ev.Layer(0.38, 1650.0)
    closed = LAWS[law].traction(0.0, 140.0, ev.Layers.of(skin, ev.Layer(thickness, 3.35)))
    least = float(closed) * float(result.real_contact_width[4])
    share = float(result.electrostatic_force[4]) / least
    ratio = float(result.tangential_force[-1] / result.normal_force[-1])
    in_cone = 0.0 < ratio < 0.3 if law == "strong_troxel" else abs(ratio - 0.3) < 1e-6
    good = share > 1.0 - 1e-9 and in_cone
    said = f"F_e {result.electrostatic_force[4]:.4g} N/mm = {share:.3f} p(0) w, p(0) = {1e3 * closed:.3g} kPa"
    return good, f"{said}; F_t/F_n = {ratio:.7f} after 3 mm"


_ENDS = {"strong_troxel": "sticks, F_t < 0.3 F_n", "kaczmarek": "slides in full, F_t = 0.3 F_n"}
for _law in LAWS:
    for _thickness in (1e-3, 2e-4, 5e-5):
        THIN.case(
            f"{1e6 * _thickness:g} nm {_law}",
            f"140 V: touching skin carries p(0), the pad {_ENDS[_law]}",
            quick=_thickness == 1e-3 and _law == "kaczmarek",
        )(partial(_thin, law=_law, thickness=_thickness))


@VOLTAGE.case("square wave", "0 and 1000 V in turn: every plateau pulls alike, F_t = 0.3 F_n in every step")
def _square(log: Log) -> Verdict:
    edges = np.arange(2.0, 6.0, 0.5)
    position = np.concatenate([[0.0], np.repeat(edges, 2), [8.0]])
    level = np.concatenate([[0.0, 0.0], np.repeat(np.arange(1, len(edges) + 1) % 2, 2)])[: len(position)]
    voltage = ev.VoltageProfile(position, 1000.0 * level)
    motion = ev.Press(force=0.05, steps=5), ev.Slide(6.0, steps=60, hold="force")
    result = log.simulate(scene(pad(), ev.Display(), *motion, law=ev.Kaczmarek(), voltage=voltage))
    later = result.position > 3.0
    ratio = result.tangential_force[later] / result.normal_force[later]
    on = result.voltage[later] > 999.0
    pull = result.electrostatic_force[later][on]
    spread = float(np.ptp(pull) / pull.mean())
    off = float(np.abs(ratio - 0.3).max())
    good = off < 1e-6 and spread < 0.02 and 5 < on.sum() < len(on) - 5
    return good, f"F_t/F_n within {off:.0e} of 0.3, pull of all plateaus within {spread:.2%}"


@VOLTAGE.case("3000 V in one step", "the state that a ramp of 20 steps reaches")
def _at_once(log: Log) -> Verdict:
    asked = []
    for steps in (20, 1):
        motion = ev.Press(force=0.05, steps=5), ev.VoltageRamp(3000.0, steps=steps, hold="force")
        asked.append(scene(pad(), ev.Display(friction=0.0), *motion, law=ev.Kaczmarek()))
    return alike(log, asked, "electrostatic_force normal_force indentation", 1e-6)


@VOLTAGE.case("3000 V from the first step", "Strong-Troxel on ridges: forces balance, F_t at most 0.3 F_n")
def _full(log: Log) -> Verdict:
    motion = ev.Press(indentation=0.5, steps=3), ev.Slide(1.0, steps=2)
    result = log.simulate(
        scene(pad(ridges=True), ev.Display(), *motion, law=ev.StrongTroxel(), voltage=3000.0)
    )
    ratio = float(result.tangential_force[-1] / result.normal_force[-1])
    good = 0.0 < ratio <= 0.3 * (1.0 + 1e-9) and log.force_error < 1e-7
    return good, f"F_t/F_n = {ratio:.4f} after 1 mm, F_e = {result.electrostatic_force[-1]:.3f} N/mm"


@VOLTAGE.case("attraction alone holds", "no load on the bone: contact carries the attraction", True)
def _alone(log: Log) -> Verdict:
    worst = 0.0
    for body in (finger(block(8, 3, sag=0.4)), pad()):
        how = {"law": ev.Kaczmarek(), "voltage": 1000.0}
        result = log.simulate(scene(body, ev.Display(), ev.Press(force=0.0, steps=2), **how))
        worst = max(worst, abs(float(result.normal_force[-1] / result.electrostatic_force[-1]) - 1.0))
        if result.indentation[-1] <= 0.0:
            return False, "not pulled in"
    return worst < 1e-6, f"F_n = F_e within {worst:.0e}"
