"""A pad pressed to a series of loads, with and without voltage: runs, and what its outline tells."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

import evfem as ev
from evfem.common.arrays import Floats
from evfem.finger.layers import TABLE_2
from evfem.mesh.faces import layer_thickness
from evfem.surface.pad import outline_nodes

from .common import LAWS, paper_display, side_by_side, table2_layers, tissue


@dataclass(frozen=True)
class Pad:
    """What a study varies of the finger; `stiffness` multiplies the moduli of all soft layers."""

    ridges: bool = True
    phase: float = 0.0
    exponent: float = 7.0
    crest: float = 0.0
    groove: float = 0.0
    resolution: str = "medium"
    stiffness: float = 1.0
    stratum_corneum_E: float = TABLE_2["stratum_corneum"][0]
    outline: float = 2.0

    def finger(self) -> ev.FingerPad:
        """The pad with these values, else Table 2."""
        soft = tissue(self.stiffness, stratum_corneum=self.stratum_corneum_E)
        shape = {name: getattr(self, name) for name in ("phase", "exponent", "crest", "groove")}
        ridge = {f"ridge_{name}": value for name, value in shape.items()}
        ridge |= {"outline": self.outline}
        return ev.FingerPad(ridges=self.ridges, resolution=self.resolution, materials=soft, **ridge)


@dataclass(frozen=True)
class Case:
    """One run through the loads (N/mm). Without friction the order of load and voltage does not matter, and
    the voltage is there from the start; with friction it comes on under each load, unless `voltage_first`.
    """

    pad: Pad
    loads: tuple[float, ...]
    voltage: float = 0.0
    law: str = "kaczmarek"
    friction: float = 0.0
    voltage_first: bool = False

    def scene(self, *motion: Any, voltage: float) -> ev.Scene:
        """The scene of some motions, at a voltage from the start."""
        display = paper_display(self.friction)
        return ev.Scene(self.pad.finger(), display, law=LAWS[self.law], voltage=voltage, motion=motion)


def contact_spans(x: Floats, gap: Floats, touching: Any) -> Floats:
    """Begin and end (K, 2) of every contact, as fractional indices into the nodes of the outline.

    `x`, `gap`, `touching` (P,) are current abscissa, gap and contact of the nodes in the order of
    `outline_nodes`. Use it as ``np.interp(spans, np.arange(P), x)`` for abscissae; any other
    quantity along the outline goes the same way.

    Beyond the edge a of a smooth contact the gap opens like :math:`(x - a)^{3/2}` (Hertz; Johnson,
    Contact Mechanics, doi:10.1017/CBO9781139171731, ch. 4), so :math:`y = g^{2/3}` starts linearly.
    Where the outline curves away, y grows faster: an exponential through the first three open nodes,
    :math:`y = y_1 + b (e^{k (x - x_1)} - 1)`, has its zero at the edge; its limit k = 0 is the straight
    line.

    >>> x = np.arange(-5.0, 6.0)
    >>> gap = np.maximum(np.abs(x) - 1.75, 0.0) ** 1.5       # touches from -1.75 to 1.75
    >>> np.interp(contact_spans(x, gap, gap == 0.0), np.arange(11), x).round(12).tolist()
    [[-1.75, 1.75]]
    """
    x, gap, touching = np.asarray(x), np.asarray(gap), np.asarray(touching)
    change = np.flatnonzero(np.diff(np.concatenate([[False], touching, [False]]).astype(int)))
    begins, ends = change[0::2], change[1::2] - 1
    spans = np.empty((len(begins), 2))
    for k, (begin, end) in enumerate(zip(begins, ends, strict=True)):
        spans[k, 0] = begin - _reach(x, gap, touching, begin, -1, end > begin)
        spans[k, 1] = end + _reach(x, gap, touching, end, 1, end > begin)
    return spans


def _reach(x: Floats, gap: Floats, touching: Any, last: int, step: int, wide: bool) -> float:
    """How far contact reaches beyond `last`, in spacings of nodes: from -1/2 (a lone node 0) to 1."""
    outside: list[int] = []
    for node in range(last + step, last + 4 * step, step):
        if not 0 <= node < x.size or touching[node]:
            break
        outside.append(node)
    if not outside:
        return 0.0
    if len(outside) == 1:
        return 0.5
    distance = np.abs(x[outside] - x[last])
    found = _zero(distance, gap[outside] ** (2.0 / 3.0))
    inner = abs(x[last] - x[last - step]) if wide else distance[0]
    spacing = distance[0] if found > 0.0 else inner
    return float(np.clip(found / spacing, -0.5 if wide else 0.0, 1.0))


def _zero(x: Floats, y: Floats) -> float:
    """Zero of the exponential through three points, or of the line through the first two."""
    slope = [(y1 - y0) / (x1 - x0) for (x0, y0), (x1, y1) in pairwise(zip(x, y, strict=True))]
    if slope[0] <= 0.0:
        return float(0.5 * x[0])
    rate = np.log(slope[1] / slope[0]) / (0.5 * (x[2] - x[0])) if slope[-1] > slope[0] else 0.0
    if rate * x[0] < 1e-9:
        return float(x[0] - y[0] / slope[0])
    scale = (y[1] - y[0]) / np.expm1(rate * (x[1] - x[0]))
    return float(x[0] + np.log(max(1.0 - y[0] / scale, 1e-12)) / rate)


@dataclass(frozen=True, eq=False)
class Pressed:
    """The outline at every load: L loads, P nodes in the order of `outline_nodes`.

    `points` (P, 2) before deformation, `thickness` (P,) of the stratum corneum, `x`, `gap`,
    `touching` (L, P), and the solver's attraction `force` (L,) in N/mm (zero without voltage).
    """

    case: Case
    points: Floats
    thickness: Floats
    x: Floats
    gap: Floats
    touching: Any
    force: Floats
    iterations: int

    def spans(self, load: int) -> Floats:
        """Interpolated begins and ends of contact at a load, fractional indices (K, 2)."""
        return contact_spans(self.x[load], self.gap[load], self.touching[load])

    def widths(self) -> tuple[Floats, Floats]:
        """Width of real contact, and between its outermost ends, per load (mm)."""
        real, gross = [], []
        for load, x in enumerate(self.x):
            ends = np.interp(self.spans(load), np.arange(x.size), x)
            real.append(float(np.sum(ends[:, 1] - ends[:, 0])))
            gross.append(float(np.ptp(ends)))
        return np.array(real), np.array(gross)

    def line(self, load: int, area: str) -> Floats:
        """Coordinate (P,) along the outline in mm whose differences are an area convention's lengths."""
        if area == "projected":
            return self.x[load]
        if area == "reference":
            step = np.hypot(*np.diff(self.points, axis=0).T)
        else:
            step = np.hypot(np.diff(self.x[load]), np.diff(self.gap[load]))
        return np.concatenate([[0.0], np.cumsum(step)])

    def pressure(self, gap: Any, voltage: float, law: str, thickness: Any = None) -> Floats:
        """Attraction in MPa of every outline node at a gap."""
        layers = table2_layers(
            self.thickness if thickness is None else np.full_like(self.thickness, thickness)
        )
        return np.asarray(LAWS[law].traction(gap, voltage, layers))

    def shares(self, load: int, area: str) -> Floats:
        """Length (P,) of outline per node in mm for (9b): 1/6, 4/6, 1/6 of every quadratic edge."""
        line = self.line(load, area)
        edge = np.maximum(line[2::2] - line[:-2:2], 0.0)
        share = np.zeros_like(line)
        share[:-2:2] += edge / 6.0
        share[1::2] += edge * (4.0 / 6.0)
        share[2::2] += edge / 6.0
        return share

    def total(self, voltage: float, law: str, area: str = "projected", thickness: Any = None) -> Floats:
        """(9a), (9b): attraction of all nodes at their gaps, per load (N/mm)."""
        pull = [self.pressure(np.maximum(gap, 0.0), voltage, law, thickness) for gap in self.gap]
        return np.array([one @ self.shares(load, area) for load, one in enumerate(pull)])

    def contact_only(
        self, voltage: float, law: str, area: str = "projected", thickness: Any = None, nodal: bool = False
    ) -> Floats:
        """(10): attraction between the interpolated ends of contact, per load (N/mm).

        `nodal` takes the touching nodes with their shares instead, as the sum in (10) is written.
        """
        pressure = self.pressure(0.0, voltage, law, thickness)
        found = []
        for load in range(len(self.x)):
            if nodal:
                found.append(float(pressure @ (self.shares(load, area) * self.touching[load])))
                continue
            line = self.line(load, area)
            steps = 0.5 * (pressure[1:] + pressure[:-1]) * np.diff(line)
            integral = np.concatenate([[0.0], np.cumsum(steps)])
            ends = np.interp(self.spans(load), np.arange(line.size), integral)
            found.append(float(np.sum(ends[:, 1] - ends[:, 0])))
        return np.array(found)


def run(case: Case) -> Pressed:
    """Press through the loads as the case says."""
    motion = [ev.Press(force=load, steps=1) for load in case.loads]
    if case.voltage and case.friction and not case.voltage_first:
        on = ev.VoltageRamp(case.voltage, steps=1, hold="force")
        ways = [case.scene(*motion[: k + 1], on, voltage=0.0) for k in range(len(motion))]
        results = [ev.simulate(way) for way in ways]
        return _bundle(case, results, [one.frames[-1] for one in results], -1)
    result = ev.simulate(case.scene(*motion, voltage=case.voltage))
    return _bundle(case, [result], result.frames, slice(None))


def _bundle(case: Case, results: list[ev.Result], frames: list[ev.result.Frame], rows: Any) -> Pressed:
    mesh = results[0].mesh
    nodes = outline_nodes(mesh)
    points = mesh.points[nodes]
    return Pressed(
        case,
        points,
        layer_thickness(mesh, "stratum_corneum", nodes),
        np.stack([points[:, 0] + frame.displacement[nodes, 0] for frame in frames]),
        np.stack([frame.gap[nodes] for frame in frames]),
        np.stack([frame.contact_status[nodes] > 0 for frame in frames]),
        np.hstack([one.electrostatic_force[rows] for one in results]),
        int(sum(one.newton_iterations.sum() for one in results)),
    )


def run_all(cases: Iterable[Case], processes: int = 1) -> dict[Case, Pressed]:
    """Every case once, the dearest first, in this process or in several."""
    wanted = sorted(set(cases), key=_cost, reverse=True)
    return dict(zip(wanted, side_by_side(run, wanted, processes), strict=True))


def _cost(case: Case) -> float:
    size = {"coarse": 1.0, "medium": 4.0, "paper": 9.0, "fine": 20.0}[case.pad.resolution]
    return size * (2.0 if case.friction else 1.0) * (1.2 if case.voltage else 1.0)


def phases(pad: Pad) -> list[Pad]:
    """The two ridge phases that a result is averaged over; a smooth pad has but one."""
    return [replace(pad, phase=0.0), replace(pad, phase=0.5)] if pad.ridges else [pad]
