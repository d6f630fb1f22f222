r"""A fast model of one finger on a flat surface, with a stated error: for sweeps and signal
design.

`reduce` runs a scene once in full and remembers a few of its equilibria with their condensed
tangents (`evfem.fast.memory`). `FastModel.simulate` then runs other scenes of the same finger with
contact, friction and attraction solved as ever (`evfem.fast.step`), but without the tissue: other
voltages, laws, insulators, friction coefficients and motions. Some of its steps are done again by
the full model, from the same state of friction; the differences are the stated error, and where
they are too large the whole scene is.

Make it from a scene with the largest load and the most friction that will be used: between its
equilibria the fast model errs by some 1e-5 of the force, beyond them by percents.
"""

from __future__ import annotations

import json
import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import evfem
from evfem.common import notices
from evfem.common.arrays import Floats
from evfem.common.constants import PAD_TOLERANCE, SMALLEST_FORCE
from evfem.common.digest import digest
from evfem.common.storage import load_arrays, save_arrays
from evfem.contact.pad import Pad, make_pad
from evfem.electrostatics.signals import FollowForce
from evfem.errors import InputError, NotConverged, quoted
from evfem.fast.memory import CondensedPad, Kept
from evfem.fast.step import RememberedPad
from evfem.fast.training import Memory, check_shapes, remember
from evfem.mesh.mesh import Mesh
from evfem.scene.motion import Press, Slide
from evfem.scene.plan import largest_voltage, scene_mesh
from evfem.scene.scene import Scene
from evfem.simulation.ledger import Ledger
from evfem.simulation.model import Model, make_attraction, make_model, placed
from evfem.simulation.result import Result, provenance
from evfem.simulation.run import Request, Run, simulate
from evfem.solver.control import Target
from evfem.solver.equilibrium import Equilibrium
from evfem.solver.factorised import FactorisedBody
from evfem.solver.interface import Interface
from evfem.solver.state import Limits, State, StepFailed
from evfem.solver.stepping import Stepper
from evfem.tissue.body import Body

FORMAT = "evfem-reduced-1"
#: equilibria remembered of a press, and of slides in each direction
PRESS, SLIDE = 5, 5
#: arrays of a file
PAD, KEPT = (
    ("moved", "force", "compliance", "press", "slide"),
    ("near", "knots", "low", "high", "share", "hold"),
)
#: forces that are compared
COMPARED = ("normal_force", "tangential_force", "electrostatic_force")
ADVICE = "a fast model made from a scene with more load or friction may go further"


def reduce(scene: Scene, *, press: int = PRESS, slide: int = SLIDE, progress: bool = False) -> FastModel:
    """Run `scene` in full and keep the pad of it: `press` equilibria while it presses, up to
    `slide` more for each direction it slides in, spread evenly over the forces.

    Give it the largest load and friction that will be needed. The time is that of the run and of
    one dense factorisation per equilibrium; `progress` shows a bar. Raises InputError for scenes
    the fast model cannot stand for (`FastModel`), `NotConverged` where the run fails.

    >>> import evfem as ev
    >>> display = ev.Display(insulator=ev.Layer(0.09, 3.35), friction=0.5)
    >>> motion = [ev.Press(force=0.05, steps=5), ev.Slide(1.5, steps=15, hold="force")]
    >>> pad = ev.FingerPad(resolution="coarse", ridges=False)
    >>> scene = ev.Scene(pad, display, law=ev.Kaczmarek(), voltage=1000.0, motion=motion)
    >>> fast = ev.reduce(scene)
    >>> from dataclasses import replace
    >>> result = fast.simulate(replace(scene, voltage=500.0))
    >>> stated = result.provenance["fast"]
    >>> stated["fallback"], stated["error"]["tangential_force"] < 1e-3
    (False, True)
    """
    _check_scene(scene)
    for key, count in (("press", press), ("slide", slide)):
        if not (isinstance(count, int) and 1 <= count <= 100):
            raise InputError(key, quoted(count), "a number of equilibria from 1 to 100")
    _check_training(scene)
    bar = notices.bar(scene.total_steps, "step", wanted=progress)
    with threadpool_limits(limits=scene.solver.threads), notices.shown(progress), bar:
        run = Run(scene, None)
        states, kinds = [run.state], ["rest"]
        for request in run.requests():
            run.advance(request)
            run.frames.clear()
            states.append(run.state)
            kinds.append(request.kind)
            bar.update(1)
        memory = remember(run.model, states, kinds, press, slide)
    made = {"samples": len(memory.whole), "kept": memory.pad.kept.size}
    return FastModel(memory, _identity(scene), provenance(scene, run.model.mesh, made))


@dataclass(eq=False)
class FastModel:
    """The pad of one finger on a flat surface, ready for many scenes; made by `reduce` or
    `FastModel.load`.

    `memory` is what is remembered of the finger, `identity` fingerprints of what must not change,
    `provenance` that of the run it was made from.

    A scene may differ from that one in voltage, law, insulator, friction, direction, air layer,
    coupling and motion. Finger, element and height of the surface must be the same; textured
    surfaces, forms of the user's, time (`dynamics`), penalty contact and `FollowForce` are
    refused.
    """

    memory: Memory
    identity: Mapping[str, str]
    provenance: dict[str, Any] = field(default_factory=dict)
    _parts: tuple[Mesh, Pad] | None = field(default=None, init=False, repr=False)
    _body: Body | None = field(default=None, init=False, repr=False)

    def __repr__(self) -> str:
        sums = np.abs(self.memory.pad.sums)
        N, T = sums.max(axis=0)
        name, count = self.provenance["scene"]["name"], len(sums)
        return f"FastModel of {name!r}: {count} equilibria, to {N:.4g} N/mm of load and {T:.4g} N/mm of shear"

    def simulate(self, scene: Scene, *, tolerance: float = 0.01, checks: int = 3) -> Result:
        """Run `scene` fast, do `checks` of its steps again with the full model, and if these
        forces differ by more than `tolerance` (relative to the largest of the run) run all of it
        in full, with a warning.

        The result has the usual columns, forces and works among them; `stored_energy`,
        `integrator_dissipation` and `snap_dissipation` are NaN and there are no fields. Its
        `provenance["fast"]` says `error` (largest relative difference of each force over the
        checks), `checked` (which steps), `outside` (how far N and T have left those of the run it
        was made from, as a share of their range; 0 inside) and `fallback`. With `checks=0` no
        error is stated. Raises InputError for other scenes than the class allows, `NotConverged`.
        """
        parts = self._parts_for(scene)
        if not (isinstance(checks, int) and 0 <= checks <= scene.total_steps):
            raise InputError("checks", quoted(checks), "a number of steps from 0 to all of the scene's")
        if not 0.0 < tolerance < np.inf:
            raise InputError("tolerance", quoted(tolerance), "a relative error larger than 0")
        with threadpool_limits(limits=scene.solver.threads):
            run = FastRun(self.memory.pad, scene, *parts)
            try:
                for request in run.requests():
                    run.advance(request)
            except NotConverged as error:
                return _in_full(scene, {"error": {}, "checked": [], "reason": str(error)})
            stated = self._stated(run, checks)
        worst = max(stated["error"].values(), default=0.0)
        if worst > tolerance:
            reason = f"the fast model differs from the full one by {worst:.2g}, allowed are {tolerance:g}"
            return _in_full(scene, stated | {"reason": reason})
        result = run.result()
        result.provenance["fast"] = stated
        return result

    def save(self, path: str | Path) -> None:
        """Write everything to one .npz file, in one step. Raises StorageError when the disk
        refuses.
        """
        arrays = {"format": np.array(FORMAT), "version": np.array(evfem.__version__)}
        arrays |= {f"pad/{name}": getattr(self.memory.pad, name) for name in PAD}
        arrays |= {f"kept/{name}": getattr(self.memory.pad.kept, name) for name in KEPT}
        arrays |= {"whole": self.memory.whole, "identity": np.array(json.dumps(dict(self.identity)))}
        save_arrays(path, arrays | {"provenance": np.array(json.dumps(self.provenance))})

    @classmethod
    def load(cls, path: str | Path) -> FastModel:
        """Read what `save` wrote. Raises InputError for any other, cut off or damaged file."""
        arrays = load_arrays(path, "reduced", FORMAT)
        try:
            kept = Kept(*(arrays[f"kept/{name}"] for name in KEPT))
            pad = CondensedPad(kept, *(arrays[f"pad/{name}"] for name in PAD))
            identity, made = json.loads(str(arrays["identity"])), json.loads(str(arrays["provenance"]))
            memory = Memory(pad, arrays["whole"])
            check_shapes(memory)
            known = isinstance(made["mesh"]["digest"], str) and isinstance(made["scene"]["name"], str)
            if not (known and isinstance(identity, dict)):
                raise ValueError("no identity")
        except (KeyError, ValueError, TypeError, IndexError, RecursionError) as error:
            allowed = "a file written by FastModel.save"
            raise InputError("reduced", f"{path}, damaged: {error}", allowed) from error
        return cls(memory, identity, made)

    def _parts_for(self, scene: Scene) -> tuple[Mesh, Pad]:
        """Mesh and pad, if this is a model of the finger of `scene`."""
        _check_scene(scene)
        for key, value in _identity(scene).items():
            if self.identity.get(key) != value:
                raise InputError(key, "another one", f"the {key} that the fast model was made with")
        if self._parts is None:
            mesh, _ = scene_mesh(scene)
            if digest(mesh) != self.provenance["mesh"]["digest"]:
                raise InputError("finger", "another mesh", "the mesh that the fast model was made with")
            self._parts = mesh, make_pad(mesh)
        return self._parts

    def _stated(self, run: FastRun, checks: int) -> dict[str, Any]:
        """Differences to the full model at the steps where they are likely to be largest."""
        outside = [self.memory.pad.beyond(on_pad(state)) for state in run.states[1:]]
        error: dict[str, float] = {}
        steps = _worth_checking(run, outside, checks)
        if steps:
            full = self._full_model(run)
            largest = {name: max(abs(row[name]) for row in run.rows) for name in COMPARED}
            for step in steps:
                for name, value in self._checked(full, run, step).items():
                    error[name] = max(error.get(name, 0.0), value / max(largest[name], SMALLEST_FORCE))
        return {
            "error": error,
            "checked": steps,
            "outside": max(outside),
            "fallback": False,
            "reason": "",
            "made_from": self.provenance["scene"],
        }

    def _full_model(self, run: FastRun) -> Model:
        """The full model of the scene of `run`; the body is built once and serves all scenes."""
        if self._body is None:
            self._body = make_model(run.scene).body
        mesh, pad = self._parts_for(run.scene)
        fast, solver = run.model, run.scene.solver
        attraction = None if fast.attraction is None else replace(fast.attraction, pad=pad)
        limits = Limits(solver.tolerance, solver.strategy, solver.threads)
        interface = Interface(pad, mesh.points, fast.surface, solver.tolerance)
        factorised = FactorisedBody(self._body, interface, attraction, limits)
        full = Equilibrium(factorised, interface, attraction, limits)
        return Model(run.scene, mesh, self._body, pad, fast.surface, attraction, full, fast.first_gap)

    def _checked(self, full: Model, run: FastRun, step: int) -> dict[str, float]:
        """Absolute differences of the forces (N/mm) after `step`, done again by the full model."""
        before, after = (self._lifted(run.states[k]) for k in (step - 1, step))
        # where friction holds the nodes is known exactly
        old = replace(before, u=before.u.copy())
        old.u[full.pad.nodes] = run.states[step - 1].u
        try:
            new = full.equilibrium.step(old, run.targets[step - 1], start=after)
        except StepFailed:
            return dict.fromkeys(COMPARED, np.inf)
        contact, pull = full.equilibrium.contact_forces(new).sum(axis=0), new.attraction.sum(axis=0)
        found = dict(zip(COMPARED, (contact[1], -contact[0], -pull[1]), strict=True))
        return {name: abs(float(value) - run.rows[step - 1][name]) for name, value in found.items()}

    def _lifted(self, state: State) -> State:
        """A state of the pad as one of the whole finger, the tissue as between the stored
        equilibria.
        """
        weight = self.memory.pad.weights(on_pad(state))
        u = state.bone + np.tensordot(weight, self.memory.whole, 1)
        return replace(state, u=u, velocity=np.zeros_like(u), last_increment=np.zeros_like(u))


def on_pad(state: State) -> Floats:
    """All forces on the pad nodes of a flat scene (P, 2)."""
    return state.contact_force[:, ::-1] + state.attraction


class FastRun(Run):
    """A scene on its way without the tissue; `states` before the first and after every step, and
    `targets` of the steps.
    """

    def __init__(self, pad: CondensedPad, scene: Scene, mesh: Mesh, whole: Pad) -> None:
        self.scene, solver = scene, scene.solver
        alone = replace(whole, nodes=np.arange(whole.nodes.size))
        points = mesh.points[whole.nodes]
        surface, first_gap = placed(scene.ground, points)
        attraction = None
        if scene.law is not None and largest_voltage(scene) != 0.0:
            attraction = make_attraction(scene, mesh, whole, surface)
            attraction = replace(attraction, pad=alone)
        limits = Limits(max(solver.tolerance, PAD_TOLERANCE), solver.strategy)
        interface = Interface(alone, points, surface, limits.tolerance)
        remembered = RememberedPad(pad, interface, attraction, limits)
        equilibrium = Equilibrium(remembered, interface, attraction, limits)

        body: Any = NoTissue()
        self.model = Model(scene, mesh, body, alone, surface, attraction, equilibrium, first_gap)
        self.ledger = Ledger(self.model)
        self.stepper = Stepper(equilibrium, scene.coupling)
        self.rows, self.frames, self.time = [], [], 0.0
        self.state = equilibrium.rest(self.model.bone(0.0, 0.0), self.voltage_at(0.0, 0.0))
        self.states: list[State] = [self.state]
        self.targets: list[Target] = []

    def advance(self, request: Request) -> None:
        """Reach a request's target exactly and record its row."""
        begin, record = clock.perf_counter(), self.model.equilibrium.record
        iterations = record.iterations
        try:
            self.state, substeps = self.stepper.follow(self.state, request.path, self.ledger.accept)
        except StepFailed as error:
            advice = "; ".join(part for part in (error.reason, error.findings, ADVICE) if part)
            raise NotConverged(request.step, error.residuals, advice, self.result()) from error
        self.time += request.duration
        row = self._row(request)
        row |= {"substeps": substeps, "newton_iterations": record.iterations - iterations, "relaxations": 0}
        self.rows.append(row | {"seconds": clock.perf_counter() - begin})
        self.states.append(self.state)
        self.targets.append(request.path(0.0, 1.0))

    def _row(self, request: Request) -> dict[str, Any]:
        """The row of the present state; where only the place has changed, that of the step before
        serves.
        """
        before, now = self.states[-1], self.state
        place = (request.step, request.motion_index, request.kind, self.time)
        if not self.rows or before.contact_force is not now.contact_force:
            return self.ledger.row(now, *place)
        if before.attraction is not now.attraction or before.bone[1] != now.bone[1]:
            return self.ledger.row(now, *place)
        named = dict(zip(("step", "motion_index", "motion", "time"), place, strict=True))
        moved = {"position": float(now.bone[0]), "voltage": now.voltage}
        return self.rows[-1] | named | moved | self.ledger.sums

    def result(self) -> Result:
        """Everything up to the last converged step."""
        record = self.model.equilibrium.record
        solver = {"model": "fast", "iterations": record.iterations, "contact_solves": record.contact_solves}
        made = provenance(self.scene, self.model.mesh, solver | {"cuts": self.stepper.cuts})
        return Result.from_rows(self.rows, [], self.model.mesh, made)


class NoTissue:
    """In place of the body: its forces and its energy are not known."""

    dynamics = None
    drag_rate = 0.0

    @staticmethod
    def drag_dissipation(u: Floats) -> float:
        """Nothing: it is not released."""
        return 0.0

    @staticmethod
    def forces(u: Floats) -> Floats:
        """Not numbers."""
        return np.full_like(u, np.nan)

    @staticmethod
    def given_forces(u: Floats) -> Floats:
        """Nothing: there are no forms of the user's."""
        return np.zeros_like(u)

    @staticmethod
    def energy(u: Floats) -> float:
        """Not a number."""
        return float("nan")


def _in_full(scene: Scene, stated: dict[str, Any]) -> Result:
    """The full model's result, with a warning that says why."""
    notices.warn(f"running the full model: {stated['reason']}")
    result = simulate(scene)
    # a check that did not converge has no error that could be stated
    error = {name: value if np.isfinite(value) else None for name, value in stated["error"].items()}
    result.provenance["fast"] = stated | {"error": error, "fallback": True}
    return result


def _worth_checking(run: FastRun, outside: Sequence[float], checks: int) -> list[int]:
    """Steps (from 1) to check: farthest outside the trained forces, at the extremes of the forces,
    half way to the largest friction force, then evenly spread ones.
    """
    columns = {name: np.abs([row[name] for row in run.rows]) for name in COMPARED}
    shear = columns["tangential_force"]
    places = [int(np.argmax(outside))] if max(outside) > 0.0 else []
    places += [int(np.argmax(shear)), int(np.argmin(np.abs(shear - 0.5 * shear.max())))]
    places += [int(np.argmax(columns["electrostatic_force"])), int(np.argmax(columns["normal_force"]))]
    places += [int(k) for k in np.linspace(len(run.rows) - 1, 0, checks + 5)]
    return sorted(k + 1 for k in list(dict.fromkeys(places))[:checks])


def _identity(scene: Scene) -> dict[str, str]:
    """What must be the same in all scenes of a fast model."""
    element = "default" if scene.solver.element is None else scene.solver.element
    return {"finger": digest(scene.finger), "solver.element": element}


def _check_scene(scene: Scene) -> None:
    """Refuse what the fast model cannot stand for."""
    if not isinstance(scene, Scene):
        raise InputError("scene", quoted(scene), "a Scene")
    if not scene.ground.is_flat:
        raise InputError("surface", type(scene.surface).__name__, "a flat surface with the fast model")
    if scene.solver.dynamics != "quasistatic":
        raise InputError("solver.dynamics", quoted(scene.solver.dynamics), "quasistatic with the fast model")
    if scene.solver.contact != "exact":
        raise InputError("solver.contact", quoted(scene.solver.contact), "exact with the fast model")
    if scene.forms:
        raise InputError("forms", f"{len(scene.forms)} of your own", "none with the fast model")
    if isinstance(scene.voltage, FollowForce):
        raise InputError("voltage", "FollowForce", "a number or a VoltageProfile with the fast model")


def _check_training(scene: Scene) -> None:
    kinds = [motion.kind for motion in scene.motion]
    if Slide.kind not in kinds or Press.kind not in kinds[: kinds.index(Slide.kind)]:
        raise InputError("motion", ", ".join(kinds), "a press and then a slide, to make a fast model from")
