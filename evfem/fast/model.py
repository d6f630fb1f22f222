r"""A fast model of one finger on a flat surface, with a stated error: for sweeps and signal
design.

`reduce` runs a scene once in full and remembers a few of its equilibria with their condensed
tangents (`evfem.fast.memory`). `FastModel.simulate` then runs other scenes of the same finger with
contact, friction and attraction solved as ever (`evfem.fast.step`), but without the tissue: other
voltages, laws, insulators, friction coefficients and motions. It is compared with the full model
at a few of its states, which gives the error of the whole path (`evfem.fast.error`); where that is
too large, the whole scene is run in full.

Make it from a scene with the largest load and the most friction that will be used: between its
equilibria the fast model errs by some 1e-4 of the force, beyond them by percents.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import evfem
from evfem.common import notices
from evfem.common.digest import digest
from evfem.common.storage import load_arrays, save_arrays
from evfem.contact.friction import Coulomb
from evfem.contact.pad import Pad, make_pad
from evfem.electrostatics.roughness import ConstantRoughness, roughness_of
from evfem.electrostatics.signals import FollowForce
from evfem.errors import InputError, NotConverged, quoted
from evfem.fast.error import HeldFinger, stated_error
from evfem.fast.memory import CondensedPad, Kept
from evfem.fast.run import FastRun, limits_of
from evfem.fast.step import on_pad
from evfem.fast.training import Memory, check_shapes, remember
from evfem.mesh.mesh import Mesh
from evfem.scene.motion import Press, Slide
from evfem.scene.plan import scene_mesh
from evfem.scene.scene import Scene
from evfem.simulation.result import Result, provenance
from evfem.simulation.run import Run, simulate

FORMAT = "evfem-reduced-1"
#: equilibria remembered of a press, and of slides in each direction
PRESS, SLIDE = 5, 5
#: arrays of a file
PAD, KEPT = (
    ("moved", "force", "compliance", "press", "slide"),
    ("near", "knots", "low", "high", "share", "hold"),
)
#: states of a run at which it is compared with the full model, and how many may be
CHECKS, MOST_CHECKS = 8, 100


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
    _finger: HeldFinger | None = field(default=None, init=False, repr=False)

    def __repr__(self) -> str:
        sums = np.abs(self.memory.pad.sums)
        N, T = sums.max(axis=0)
        name, count = self.provenance["scene"]["name"], len(sums)
        return f"FastModel of {name!r}: {count} equilibria, to {N:.4g} N/mm of load and {T:.4g} N/mm of shear"

    def simulate(self, scene: Scene, *, tolerance: float = 0.01, checks: int = CHECKS) -> Result:
        """Run `scene` fast, compare it with the full model at `checks` of its states, and if these
        forces differ by more than `tolerance` (relative to the largest of the run) run all of it
        in full, with a warning.

        The result has the usual columns, forces and works among them; `stored_energy`,
        `integrator_dissipation` and `snap_dissipation` are NaN and there are no fields. Its
        `provenance["fast"]` says `error` (largest relative difference of each force over the whole
        path, `evfem.fast.error`), `checked` (at which steps it was compared), `outside` (how far N
        and T have left those of the run it was made from, as a share of their range; 0 inside) and
        `fallback`. With `checks=0` no error is stated. Raises InputError for other scenes than the
        class allows, `NotConverged`.
        """
        parts = self._parts_for(scene)
        if not (isinstance(checks, int) and 0 <= checks <= MOST_CHECKS):
            raise InputError("checks", quoted(checks), f"a number of states from 0 to {MOST_CHECKS}")
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
            if not np.isfinite(worst):
                reason = "under the forces of the fast model the full one finds no equilibrium"
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
        """How far the run is from the full model, and from what the model was made for."""
        error: dict[str, float] = {}
        steps: list[int] = []
        if checks:
            if self._finger is None or self._finger.limits != limits_of(run.scene):
                self._finger = HeldFinger(run.scene, run.whole)
            error, steps = stated_error(run, self.memory, self._finger, checks)
        return {
            "error": error,
            "checked": steps,
            "outside": max(self.memory.pad.beyond(on_pad(state)) for state in run.states[1:]),
            "fallback": False,
            "reason": "",
            "made_from": self.provenance["scene"],
        }


def _in_full(scene: Scene, stated: dict[str, Any]) -> Result:
    """The full model's result, with a warning that says why."""
    notices.warn(f"running the full model: {stated['reason']}")
    result = simulate(scene)
    # a check that did not converge has no error that could be stated
    error = {name: value if np.isfinite(value) else None for name, value in stated["error"].items()}
    result.provenance["fast"] = stated | {"error": error, "fallback": True}
    return result


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
    if scene.field != "local":
        raise InputError("electrostatics.field", quoted(scene.field), "local with the fast model")
    if scene.solver.dynamics != "quasistatic":
        raise InputError("solver.dynamics", quoted(scene.solver.dynamics), "quasistatic with the fast model")
    if scene.solver.contact != "exact":
        raise InputError("solver.contact", quoted(scene.solver.contact), "exact with the fast model")
    if scene.forms:
        raise InputError("forms", f"{len(scene.forms)} of your own", "none with the fast model")
    if scene.hand is not None:
        raise InputError("hand", repr(scene.hand), "no hand with the fast model")
    if not isinstance(scene.friction_law, Coulomb):
        given = type(scene.friction_law).__name__
        raise InputError("surface.friction_law", given, "Coulomb with the fast model")
    if scene.drive is not None and scene.drive.resolved:
        raise InputError("drive", "resolved in time", "the mean over the cycle with the fast model")
    rough = roughness_of(scene.roughness_gap)
    if rough is not None and not isinstance(rough, ConstantRoughness):
        allowed = "a length in mm with the fast model"
        raise InputError("electrostatics.roughness_gap", type(rough).__name__, allowed)
    if isinstance(scene.voltage, FollowForce):
        raise InputError("voltage", "FollowForce", "a number or a VoltageProfile with the fast model")


def _check_training(scene: Scene) -> None:
    kinds = [motion.kind for motion in scene.motion]
    if Slide.kind not in kinds or Press.kind not in kinds[: kinds.index(Slide.kind)]:
        raise InputError("motion", ", ".join(kinds), "a press and then a slide, to make a fast model from")
