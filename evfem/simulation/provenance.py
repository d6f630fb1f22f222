"""Provenance of a result: versions, date, scene, mesh and the solver's record."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields
from datetime import UTC, datetime
from functools import cache
from importlib import metadata
from platform import python_version
from typing import Any

import evfem
from evfem.common.digest import digest
from evfem.common.views import called
from evfem.errors import InputError
from evfem.mesh.mesh import Mesh
from evfem.scene.scene import Scene


@cache
def versions() -> dict[str, str]:
    """Versions of evfem, Python and the packages that compute, as far as they are installed."""
    found = {"evfem": evfem.__version__, "python": python_version()}
    for package in ("numpy", "scipy", "scikit-fem", "meshio", "pypardiso"):
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return found


def origin() -> dict[str, Any]:
    """Versions and date, for the provenance of whatever is computed now."""
    return {"versions": dict(versions()), "date": datetime.now(UTC).isoformat(timespec="seconds")}


def provenance(scene: Scene, mesh: Mesh, solver: Mapping[str, Any]) -> dict[str, Any]:
    """Versions, parameters, fingerprints and the solver's own record, in plain values ready for JSON.

    `parameters` is the scene as TOML, or its representation where it holds a law or form of the user's own.
    """
    from evfem.scene.serialiser import dump

    try:
        parameters = dump(scene)
    except InputError:
        parameters = called("Scene", {spec.name: getattr(scene, spec.name) for spec in fields(scene)})
    return {
        **origin(),
        "scene": {
            "name": scene.name,
            "digest": scene.digest(),
            "total_steps": scene.total_steps,
            "depth": scene.depth,
        },
        "parameters": parameters,
        "mesh": {
            "digest": digest(mesh),
            "nodes": len(mesh.points),
            "cells": len(mesh.cells),
            "kind": mesh.kind,
        },
        "solver": {"tolerance": scene.solver.tolerance, **solver},
    }


#: kinds of what is read of a provenance, and of its scene
KINDS: Mapping[str, type] = {
    **dict.fromkeys(("scene", "mesh", "solver", "versions"), dict),
    **dict.fromkeys(("warnings", "columns"), list),
    **dict.fromkeys(("parameters", "date"), str),
}
OF_SCENE = {"name": (str,), "total_steps": (int,), "depth": (int, float, type(None))}


def sound(found: Any) -> dict[str, Any]:
    """The provenance in a file; ValueError for one of another kind, or with text that no file can hold."""
    wrong = [] if isinstance(found, dict) else ["itself"]
    wrong = wrong or [key for key in KINDS.keys() & found if not isinstance(found[key], KINDS[key])]
    scene = {} if wrong else found.get("scene", {})
    wrong += [key for key in OF_SCENE.keys() & scene if type(scene[key]) not in OF_SCENE[key]]
    if wrong:
        raise ValueError(f"no provenance: {', '.join(sorted(wrong))}")
    json.dumps(found, ensure_ascii=False).encode()  # halves of letters
    return dict(found)


class Told:
    """What the provenance of a result tells, and the scene itself where the result was `simulated` now."""

    provenance: dict[str, Any]
    simulated: Scene | None

    @property
    def scene(self) -> Scene:
        """The scene: the one that was run, and of a result from a file the one that its provenance holds.

        Raises InputError where that is none, as with a mesh in memory or a law of the user's own.
        """
        from evfem.scene.file import loads

        try:
            return self.simulated or loads(self.provenance.get("parameters", ""))
        except InputError as error:
            given = f"a result of a scene that no file holds ({error})"
            raise InputError("scene", given, "the scene itself") from None

    @property
    def depth(self) -> float | None:
        """The scene's depth (mm), None without one."""
        return self.provenance.get("scene", {}).get("depth")

    @property
    def warnings(self) -> list[str]:
        """Warnings of the run about its numbers, one sentence each."""
        return list(self.provenance.get("warnings", []))
