"""Checks of resolution: node spacing against the surface profile; time steps against the voltage signal,
the hand and the tissue; and the sources of step-size dependence.

With n nodes per wavelength a sine lies up to 1 - cos(pi / n) of its amplitude above the chord between
two nodes: a fifth with five nodes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import accumulate
from typing import Any

import numpy as np

from evfem.circuit.signals import FollowForce, VoltageProfile
from evfem.common.arrays import Floats, Ints
from evfem.electrostatics.timesignals import Carrier
from evfem.mesh.mesh import Mesh
from evfem.protocols import TimeSignal
from evfem.scene.scene import Scene
from evfem.surface.textures import SelfAffine
from evfem.tissue.laws import split

#: largest deviation of a profile from the chord between two nodes, as a fraction of its height
MISSED = 0.2
#: largest unresolved fraction of a profile's rms slope
ROUGH = 0.25
#: nodes per shortest wavelength of roughness, at least
PER_WAVE = 5.0
#: samples of the profile per node spacing, and their largest number
PER_SPACING, MOST = 8, 200_000
#: lines beside one another on which a surface is seen
LINES = 64
#: value of `steps` for adaptive step sizes
AUTO = "auto"
#: steps in a period of the voltage, at least: 10 in one of its square, which the attraction follows
PER_PERIOD = 20.0
#: fraction of its range by which a profile may vary between two rows
SKIPPED = 0.2
#: rows in a wave of the surface, at least: with fewer it shows as a longer one
ROWS_PER_WAVE = 2.0


def unresolved(scene: Scene, mesh: Mesh) -> str | None:
    """A sentence if the surface is sharper or rougher than the node spacing of the pad, else None.

    Compared are height and slope in the middle between two nodes with the mean height below them and the
    slope from node to node: noise hardly shows in heights, but contact acts along the slope.
    """
    surface: Any = scene.ground
    if surface.is_flat:
        return None
    found = (_unresolved(scene, mesh, axis) for axis in range(mesh.dim - 1))
    return next((sentence for sentence in found if sentence is not None), None)


def _unresolved(scene: Scene, mesh: Mesh, axis: int) -> str | None:
    """The same along x (`axis` 0) or z (1)."""
    surface: Any = scene.ground
    if not len(edges := _pad_edges(mesh, axis)):
        return None
    ends = mesh.points[edges]
    spacing = float(np.median(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1))) / mesh.order
    if isinstance(scene.surface, SelfAffine) and scene.surface.shortest < PER_WAVE * spacing:
        return (
            f"the shortest waves of the surface ({scene.surface.shortest:g} mm) have fewer than "
            f"{PER_WAVE:g} nodes of the pad each, which are {spacing:.2g} mm apart; use a finer mesh, or a "
            f"shortest wave of {PER_WAVE * spacing:.2g} mm"
        )
    path_points = path_line(scene, mesh, spacing / PER_SPACING, axis)
    half = 0.5 * spacing * np.eye(mesh.dim - 1)[axis]
    before, height, after = (surface.relief(path_points + shift)[0] for shift in (-half, 0.0 * half, half))
    missed, whole = float(np.abs(height - 0.5 * (before + after)).max()), float(np.ptp(height))
    if missed > MISSED * whole:
        return (
            f"the surface is sharper than the node spacing of the pad ({spacing:.2g} mm): up to {missed:.2g} "
            f"of its {whole:.2g} mm of height lie between two nodes; use a finer mesh or a smoother profile"
        )
    slope = surface.relief(path_points)[1][:, axis]
    fine, all_of_it = (float(np.sqrt(np.mean(s**2))) for s in (slope - (after - before) / spacing, slope))
    if fine > ROUGH * all_of_it:
        return (
            f"the surface is rougher than the node spacing of the pad ({spacing:.2g} mm): "
            f"{fine / all_of_it:.0%} of its slope is finer than that, as noise is; smooth the profile, "
            "or expect small steps and a long run"
        )
    return None


def _pad_edges(mesh: Mesh, axis: int) -> Ints:
    """Ends (K, 2) of the pad's edges; in space of its faces' that run more along x (`axis` 0) or z (1)."""
    sides = mesh.sides_of("pad")
    if mesh.dim == 2:
        return sides[:, :2]
    faces = sides[:, :4]
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    extent = np.abs(np.diff(mesh.points[edges], axis=1)[:, 0, ::2])
    return edges[extent[:, axis] > extent[:, 1 - axis]]


def too_fast(scene: Scene) -> str | None:
    """A sentence if a motion's steps are too long for a voltage over time, else None: the attraction has up
    to twice its frequency, and what is above half the rate of the steps appears below it (aliasing).
    """
    signal = scene.electrics.voltage
    if not isinstance(signal, TimeSignal) or not signal.highest_frequency > 0.0:
        return None
    (longest, step), f = _longest(scene), signal.highest_frequency
    found = 1.0 / (f * step) if step > 0.0 else math.inf
    if found >= PER_PERIOD * (1.0 - 1e-9):
        return None
    few = f"motion {longest} has {found:.3g} steps in a period of the voltage ({f:g} Hz)"
    alias = ""
    if 2.0 * f > 0.5 / step:
        alias = f", and shows what the attraction does above {0.5 / step:.4g} Hz at a lower frequency"
    needed = math.ceil(PER_PERIOD * f * scene.courses[longest].seconds() * (1.0 - 1e-9))
    mean = ", or resolved=False for the mean over the carrier's cycles"
    instead = mean if isinstance(signal, Carrier) and signal.resolved else ""
    return f"{few}{alias}: take at least {PER_PERIOD:g}, {needed} steps in all{instead}"


def skipped(scene: Scene) -> Iterator[str]:
    """A sentence for a slide between whose rows a voltage or a force over the position varies by more than
    `SKIPPED` of its range, beyond the straight line from row to row.
    """
    signal = scene.electrics.voltage
    if not isinstance(signal, VoltageProfile | FollowForce):
        return
    place = np.zeros(2)
    for i, motion in enumerate(scene.motion):
        course = motion.course
        heading = np.array(course.direction if isinstance(signal, FollowForce) else (1.0, 0.0))
        begin, way = float(place @ heading), float(np.array(course.travel) @ heading)
        place = place + course.travel
        rows = begin + way * np.linspace(0.0, 1.0, motion.steps + 1)
        within = signal.position[(signal.position > rows.min()) & (signal.position < rows.max())]
        if not way or not within.size:
            continue
        ends, seen = np.sort(rows), np.asarray(signal(np.sort(rows)))
        off = float(np.abs(np.interp(within, ends, seen) - signal(within)).max())
        whole = float(np.ptp(signal(np.union1d(within, ends))))
        if off > SKIPPED * whole > 0.0:
            yield (
                f"motion {i} has rows {abs(way) / motion.steps:.3g} mm apart, and between them what is "
                f"prescribed over the position varies by {off / whole:.0%} of its range: more steps show it"
            )


def aliased(scene: Scene, mesh: Mesh) -> str | None:
    """A sentence if waves with fewer than `ROWS_PER_WAVE` rows of any slide are needed for all but `SKIPPED`
    of the variance of the surface's height or friction, else None: the curve over the position then has
    waves that are not there. A slide with coarser rows than another only leads to where that one begins.
    """
    slides = [(i, one, one.course) for i, one in enumerate(scene.motion) if one.course.distance]
    rows = [(abs(course.distance) / one.steps, i, course) for i, one, course in slides if one.steps > 1]
    if not rows:
        return None
    apart, finest, course = min(rows, key=lambda row: row[:2])
    pad = mesh.points[mesh.node_sets["pad"], ::2]
    reach = float(np.ptp(pad, axis=0).max()) + sum(abs(course.distance) for *_, course in slides)
    line = np.linspace(-0.5 * reach, 0.5 * reach, int(np.clip(2 * PER_SPACING * reach / apart, 2, MOST)))
    points = pad.mean(axis=0) + line[:, None] * np.array(course.direction)[: mesh.dim - 1]
    surface: Any = scene.ground
    for what, values in (("height", surface.relief(points)[0]), ("friction", surface.friction_at(points))):
        wave = _shortest_wave(values, line[1] - line[0])
        if wave < ROWS_PER_WAVE * apart:
            needed = math.ceil(ROWS_PER_WAVE * abs(course.distance) / wave)
            return (
                f"slides have rows {apart:.3g} mm apart or more, and the surface's {what} waves of "
                f"{wave:.2g} mm: with fewer than {ROWS_PER_WAVE:g} rows in a wave curves over the position "
                f"have longer waves that are not there; take more than {needed} steps in motion {finest}"
            )
    return None


def _shortest_wave(values: Floats, step: float) -> float:
    """The wavelength above which all but `SKIPPED` of the variance of evenly spaced values lies; infinite
    where they are even.
    """
    if np.ptp(values) <= 1e-9 * np.abs(values).max():
        return math.inf
    power = np.abs(np.fft.rfft((values - values.mean()) * np.hanning(len(values)))) ** 2
    known = int(np.searchsorted(np.cumsum(power), (1.0 - SKIPPED) * power.sum()))
    return len(values) * step / max(known, 1)


def oscillating(scene: Scene, mesh: Mesh) -> Iterator[str]:
    """A sentence for hand and tissue if a motion's steps are longer than their period: of its mass on its
    spring; of the softest layer in shear, about 4 h sqrt(rho / G). Overdamped, neither has one.
    """
    longest, step = _longest(scene)
    for what, period in _periods(scene, mesh):
        if step > period:
            yield (
                f"motion {longest} has steps of {step:.3g} s, and {what} by itself swings with a "
                f"period of {period:.3g} s: they damp that away; take at least {PER_PERIOD:g} in a period, "
                f"{math.ceil(PER_PERIOD * scene.courses[longest].seconds() / period)} in all, to follow it"
            )


def _periods(scene: Scene, mesh: Mesh) -> Iterator[tuple[str, float]]:
    hand = scene.hand
    if hand is not None and hand.damping < 2.0 * math.sqrt(hand.stiffness * hand.mass):
        yield "the hand", 2.0 * math.pi * math.sqrt(hand.mass / hand.stiffness)
    if not scene.solver.inertial:
        return
    law = min(scene.finger.materials.values(), key=lambda one: split(one, mesh.dim).shear_modulus)
    bone, pad = (float(mesh.points[mesh.node_sets[name], 1].min()) for name in ("bone", "pad"))
    speed = math.sqrt(split(law, mesh.dim).shear_modulus / getattr(law, "density", 1e-9))
    period, own = 4.0 * abs(bone - pad) / speed, getattr(law, "viscosity", None)
    viscosity = scene.finger.viscosity if own is None else own
    if period > math.pi * viscosity:  # Kelvin and Voigt's tissue has the damping ratio omega tau / 2
        yield "the tissue", period


def _longest(scene: Scene) -> tuple[int, float]:
    """The motion with the longest steps, presses being from first touch, and their seconds."""
    steps = [motion.course.seconds() / motion.part(motion.steps)[2] for motion in scene.motion]
    return steps.index(max(steps)), max(steps)


def path_line(scene: Scene, mesh: Mesh, step: float, axis: int = 0) -> Floats:
    """Places (n, d) on a line along x (`axis` 0) or z (1) that the pad may come to, `step` apart or as near
    to that as memory allows.
    """
    pad = mesh.points[mesh.node_sets["pad"], ::2]
    bone = [0.0, *accumulate(course.travel[axis] for course in scene.courses)]
    first, last = pad[:, axis].min() + min(bone), pad[:, axis].max() + max(bone)
    path_points = np.zeros((int(np.clip((last - first) / step, 2, MOST)), mesh.dim - 1))
    path_points[:, axis] = np.linspace(first, last, len(path_points))
    return path_points


def path_lines(scene: Scene, mesh: Mesh, step: float, axis: int = 0) -> Floats:
    """Places (m, n, d) on such lines beside one another, on all that the pad may come to."""
    line = path_line(scene, mesh, step, axis)
    if mesh.dim == 2:
        return line[None]
    beside = path_line(scene, mesh, np.inf, 1 - axis)[:, 1 - axis]  # its ends
    found = np.tile(line, (LINES, 1, 1))
    found[:, :, 1 - axis] = np.linspace(beside[0], beside[-1], LINES)[:, None]
    return found


def slip_scale(scene: Scene, mesh: Mesh) -> float:
    """Length (mm) of slip in which height or friction of the surface can change by all of their range: that
    range over the steepest slope, and no less than two spacings of the pad's nodes; inf where both are even.
    """
    surface: Any = scene.ground
    edges = mesh.points[_pad_edges(mesh, 0)]
    spacing = float(np.median(np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1))) / mesh.order
    found = [np.inf]
    for axis in range(mesh.dim - 1):
        lines = path_lines(scene, mesh, spacing / PER_SPACING, axis)
        step = float(lines[0, 1, axis] - lines[0, 0, axis])
        heights = surface.relief(lines.reshape(-1, mesh.dim - 1))[0].reshape(lines.shape[:2])
        for values in (heights, surface.friction_at(lines)):
            steepest = float(np.abs(np.diff(values, axis=1)).max()) / step
            if steepest > 0.0:
                found.append(max(2.0 * spacing, float(np.ptp(values)) / steepest))
    return min(found)


def path_depth(scene: Scene, mesh: Mesh, step: float) -> float:
    """Depth (mm) of the surface where the pad may come to, seen every `step` (mm)."""
    surface: Any = scene.ground
    places = path_lines(scene, mesh, step).reshape(-1, mesh.dim - 1)
    return float(np.ptp(surface.relief(places)[0]))


def path_dependence(scene: Scene) -> tuple[str, ...]:
    """Sources of path dependence, in words; empty if the end does not depend on the steps.

    >>> import evfem as ev
    >>> pad, press = ev.FingerPad(resolution="coarse"), [ev.Press(indentation=0.5, steps=2)]
    >>> [path_dependence(ev.Scene(pad, ev.Flat(friction=mu), motion=press)) for mu in (0.0, 0.3)]
    [(), ('friction',)]
    """
    found = {
        "friction": scene.has_friction,
        "time": scene.solver.timed,
        "charges": scene.electrics.resolved,
        "the hand": scene.hand is not None and scene.hand.timed,
        "contact state": scene.law is not None and not scene.air_layer,
    }
    return tuple(name for name, present in found.items() if present)


def allowed_error(scene: Scene) -> float | None:
    """Admissible step-size error of a substep with adaptive steps; None with prescribed steps."""
    strategy = scene.solver.strategy
    return strategy.path_error if strategy.steps == AUTO and path_dependence(scene) else None


def steps_line(scene: Scene) -> str:
    """The plan's line on adaptive steps; empty if the steps are prescribed."""
    if scene.solver.strategy.steps != AUTO:
        return ""
    names = path_dependence(scene)
    if not names:
        snaps = " except through snaps" if scene.electrics.acts or not scene.ground.is_flat else ""
        return f"steps auto: no dependence on the step size{snaps}, one substep for each step"
    limit = f"{100.0 * scene.solver.strategy.path_error:g} %"
    causes = ", ".join(names)
    return f"steps auto: path-dependent ({causes}), error of a substep at most {limit} of the force"
