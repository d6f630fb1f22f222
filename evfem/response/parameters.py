"""Parameters of a scene by the dotted keys of its file, and changes of the finger's shape.

A key names a number in the objects of a scene as its file does: `finger.materials.dermis.E`,
`surface.friction`, `surface.friction.0.1` (first row of a table, its coefficient),
`electrostatics.insulator_thickness`, `motion.1.distance`. Scenes that no file can hold, with a mesh object or
laws of one's own, have the same keys, and attributes of laws of one's own are keys too.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import fields_of
from evfem.electrostatics.laws import LayerStack
from evfem.errors import ABSENT, InputError, describe_value, unknown
from evfem.mesh.mesh import Mesh, raised
from evfem.planning.plan import scene_mesh
from evfem.scene import file as scenefile
from evfem.scene.format import dotted
from evfem.scene.scene import Scene
from evfem.simulation.result import Result

#: keys of [electrostatics] -> where the scene has them
ELECTRIC = {
    "insulator_thickness": ("surface", "insulator", "thickness"),
    "insulator_eps_r": ("surface", "insulator", "eps_r"),
    "electrodes": ("surface", "electrodes"),
    "signal": ("voltage",),
    "roughness_gap": ("roughness_gap",),
    "voltage": ("voltage",),
}
TABLES = ("finger", "surface", "electrostatics", "adhesion", "hand", "motion", "rooms")
NUMBER = "a number of the scene"


@dataclass(frozen=True, eq=False)
class ShapeChange:
    """A parameter that moves the nodes of the undeformed finger; its value in the scene is 0.

    `velocity` (nodes, dim): derivative of the nodes' coordinates in mm by the parameter, for the nodes of the
    finger's mesh or, without those in the middle of edges, for its corners; these then follow linearly.

    >>> ShapeChange("taller", np.zeros((4, 2)))
    ShapeChange(name='taller')
    """

    name: str
    velocity: Floats = field(repr=False)

    def __post_init__(self) -> None:
        velocity = np.asarray(self.velocity, dtype=float)
        if velocity.ndim != 2 or not np.isfinite(velocity).all():
            raise InputError("velocity", f"an array of shape {velocity.shape}", "finite numbers (nodes, dim)")
        object.__setattr__(self, "velocity", velocity)

    #: value in the scene
    value = 0.0

    @property
    def size(self) -> float:
        """What changes the finger by about a millimetre."""
        return 1.0 / max(float(np.abs(self.velocity).max()), 1e-300)

    def applied(self, scene: Scene, change: float) -> Scene:
        """The scene with its finger changed by so much."""
        return replace(scene, finger=_Moved(scene.finger, self.velocity, change))


class _Moved:
    """A finger whose nodes are moved by `change` times `velocity` (nodes, dim)."""

    def __init__(self, finger: Any, velocity: Floats, change: float) -> None:
        self._finger, self._velocity, self._change = finger, velocity, change

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._finger, name)

    @property
    def materials(self) -> Mapping[str, Any]:
        return self._finger.materials

    @property
    def viscosity(self) -> float:
        return self._finger.viscosity

    @property
    def electrical(self) -> Any:
        return self._finger.electrical

    def mesh(self, order: int) -> Mesh:
        """The mesh with its nodes moved."""
        mesh = self._finger.mesh(order)
        return replace(
            mesh, points=mesh.points + self._change * following(self._finger, mesh, self._velocity)
        )


def following(finger: Any, mesh: Mesh, velocity: Floats) -> Floats:
    """Velocities (N, dim) of all nodes of a finger's `mesh`, from those of its nodes or of its linear mesh,
    whose middles follow. InputError for other sizes.
    """
    if velocity.shape == mesh.points.shape:
        return velocity
    allowed = f"{mesh.points.shape}: nodes of the finger's mesh, dim"
    if mesh.order == 2:
        linear = finger.mesh(1)
        allowed += f", or {linear.points.shape}: corners, dim"
        if velocity.shape == linear.points.shape:
            found = raised(replace(linear, points=velocity))
            if np.array_equal(found.cells, mesh.cells):
                return found.points
    raise InputError("velocity", f"an array of shape {velocity.shape}", allowed)


@dataclass(frozen=True)
class Keyed:
    """The parameter of a scene with a dotted key."""

    scene: Scene
    name: str

    @cached_property
    def path(self) -> tuple[str, ...]:
        """Attributes, names and numbers from the scene to it."""
        table, *rest = self.name.split(".")
        if table not in TABLES or not rest:
            meant = f"{dotted(self.name)}? " if self._has(dotted(self.name)) else ""
            allowed = f"{meant}TABLE.KEY, TABLE one of {', '.join(TABLES)}"
            raise InputError("parameters", describe_value(self.name), allowed)
        if table == "electrostatics":
            return self._electric(*rest)
        if (table, rest[0]) == ("surface", "friction_law"):
            return tuple(rest)
        if (table, rest[0], len(rest)) == ("surface", "points", 3):
            return (table, {"0": "x", "1": "samples"}.get(rest[2], rest[2]), rest[1])
        return (table, *rest)

    def _has(self, other: str) -> bool:
        """Whether another key is a parameter of the scene."""
        with suppress(InputError):
            return other not in ("", self.name) and Keyed(self.scene, other).value != 0.0
        return False

    def _electric(self, name: str, *rest: str) -> tuple[str, ...]:
        """The same of a key of [electrostatics]."""
        if name == "voltage_profile":
            row, column = rest if len(rest) == 2 else ("", "")
            return ("voltage", {"0": "position", "1": "voltage"}.get(column, column), row)
        insulator: Any = getattr(self.scene.surface, "insulator", None)
        if name in ("insulator_thickness", "insulator_eps_r") and isinstance(insulator, LayerStack):
            layer, *more = rest or ("",)
            return ("surface", "insulator", "layers", layer, name.removeprefix("insulator_"), *more)
        if name in ELECTRIC:
            return (*ELECTRIC[name], *rest)
        if self.scene.drive is not None and _field(self.scene.drive, name) is not None:
            return ("drive", name, *rest)
        if name in {"stratum_corneum_thickness", "stratum_corneum_eps_r"}:
            return ("finger", "electrical", name)
        return ("law", name, *rest)

    @cached_property
    def value(self) -> float:
        """Its value in the scene; InputError where the scene has no number there."""
        here: Any = self.scene
        for step in self.path:
            here = _part(here, step, self.name)
        if isinstance(here, (bool, str)) or not isinstance(here, (int, float, np.floating)):
            raise InputError(f"parameters.{self.name}", describe_value(here), NUMBER)
        if isinstance(here, int) and self.path[-1] in ("steps", "every"):
            raise InputError(f"parameters.{self.name}", "a whole number", NUMBER)
        return float(here)

    @property
    def size(self) -> float:
        """The size of its changes: of Poisson's ratio the distance to 1/2."""
        return min(self.value, 0.5 - self.value) if self.path[-1] == "nu" else abs(self.value)

    def applied(self, scene: Scene, change: float) -> Scene:
        """A scene with it changed by so much."""
        return _with(scene, self.path, self.value + change, self.name)


Parameter = Keyed | ShapeChange


def scene_of(source: Any) -> Scene:
    """The scene given as such, as a path of its file, or by its `Result`, which is run again: InputError for
    a result that ended before its scene.
    """
    if not isinstance(source, Result):
        return scenefile.scene_at(source)
    done, asked = len(source.step), source.scene.total_steps
    if done < asked:
        allowed = "a whole result, or a scene that ends there: its own one is run again, to its end"
        raise InputError("scene", f"a result that ended after {done} of {asked} steps", allowed)
    return source.scene


def parameter_of(scene: Scene, wanted: Any) -> Parameter:
    """What was asked for: a key or a `ShapeChange`; InputError for what the scene does not have, for a number
    that is 0, which has no small share, and for shapes whose velocities do not fit the mesh.
    """
    if isinstance(wanted, ShapeChange):
        following(scene.finger, scene_mesh(scene)[0], wanted.velocity)
        return wanted
    if not isinstance(wanted, str):
        raise InputError(
            "parameters", describe_value(wanted), "dotted keys of the scene, and ShapeChange objects"
        )
    found = Keyed(scene, wanted)
    if found.value == 0.0:
        raise InputError(f"parameters.{wanted}", 0.0, "a number other than 0: steps are fractions of it")
    return found


def _field(owner: Any, name: str) -> str | None:
    """The attribute of an object that a file calls `name`."""
    if is_dataclass(owner):
        kind: Any = type(owner)
        for key in fields_of(kind):
            if name in (key.name, key.field):
                return key.field
    return name if hasattr(owner, name) else None


def _part(owner: Any, step: str, key: str) -> Any:
    """What an object has under a name or a number."""
    if isinstance(owner, Mapping):
        if step not in owner:
            raise unknown(f"parameters.{key}", step, tuple(owner))
        return owner[step]
    if isinstance(owner, (tuple, list, np.ndarray)):
        if not (step.isdecimal() and int(step) < len(owner)):
            raise InputError(f"parameters.{key}", step or "no number", f"numbers from 0 to {len(owner) - 1}")
        return owner[int(step)]
    attribute = _field(owner, step)
    if attribute is None and not hasattr(owner, "__dict__"):  # a number, or a part that is not there
        raise InputError(f"parameters.{key}", ABSENT, NUMBER)
    if attribute is None:
        names = [spec.name for spec in fields(owner)] if is_dataclass(owner) else sorted(vars(owner))
        raise (
            unknown(f"parameters.{key}", step, tuple(names))
            if names
            else InputError(f"parameters.{key}", ABSENT, NUMBER)
        )
    return getattr(owner, attribute)


def _with(owner: Any, path: tuple[str, ...], value: float, key: str) -> Any:
    """A copy of an object with another number at the end of a path."""
    if not path:
        return value
    step, rest = path[0], path[1:]
    part = _with(_part(owner, step, key), rest, value, key)
    if isinstance(owner, Mapping):
        return {**owner, step: part}
    if isinstance(owner, np.ndarray):
        changed = owner.astype(float)
        changed[int(step)] = part
        return changed
    if isinstance(owner, (tuple, list)):
        return type(owner)(part if i == int(step) else one for i, one in enumerate(owner))
    attribute = _field(owner, step)
    assert attribute is not None
    if is_dataclass(owner) and attribute not in {spec.name for spec in fields(owner)}:
        raise InputError(key, f"{attribute}, which {type(owner).__name__} computes", "what is given to it")
    kind: Any = type(owner)
    if is_dataclass(owner) and kind.__dataclass_params__.init:
        return replace(owner, **{attribute: part})  # type: ignore[type-var]
    changed = copy(owner)
    if is_dataclass(owner):  # made from other names than its fields' own; what is cached is not kept
        for name in vars(owner).keys() - {spec.name for spec in fields(owner)}:
            del vars(changed)[name]
    object.__setattr__(changed, attribute, part)
    return changed
