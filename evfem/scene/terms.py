"""Domain of integration of a user's weak form."""

from __future__ import annotations

from dataclasses import dataclass

from evfem.tissue.forms import Form


@dataclass(frozen=True)
class Region:
    """A named region of the mesh, for `Scene.with_term`."""

    name: str


@dataclass(frozen=True)
class Boundary:
    """A named boundary of the mesh, for `Scene.with_term`."""

    name: str


@dataclass(frozen=True)
class Term:
    """A weak form and the named region or boundary it is integrated over."""

    form: Form
    on: Region | Boundary
