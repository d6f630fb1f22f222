"""Options of the solver and of the output."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import InitVar, dataclass, field
from typing import Annotated, Any

from evfem.common.checks import (
    RENAMED_KEYS,
    Checked,
    Within,
    among,
    check_fields,
    number,
    real,
    whole,
    yes_or_no,
)
from evfem.errors import ABSENT, InputError, describe_value
from evfem.newton.strategy import Strategy
from evfem.tissue.dynamics import DYNAMICS
from evfem.tissue.space import ELEMENTS, elements_on

CONTACTS = ("exact", "penalty")
PRECISIONS = ("single", "double")
_PENALTY = number("a penalty in N/mm3, larger than 0", Within(0.0, above=True), "N/mm3")
#: cores of the attraction beside a length
CORES = ("auto", "off")
_CORE = '"auto", "off", or a length in mm, larger than 0, up to 1'


def _core(key: str, value: object) -> float | str:
    if isinstance(value, str) and value in CORES:
        return value
    return real(key, value, _CORE, Within(0.0, 1.0, above=True))


_TOLERANCE = number("a relative residual from 1e-13 to 1e-3", Within(1e-13, 1e-3))


@dataclass(frozen=True)
class Solver:
    """How a scene is solved; the defaults are the recommended ones."""

    element: Annotated[
        str | None, among(ELEMENTS), "without it q2p1 on quads, p2 on triangles, hex27p1 on hexahedra"
    ] = None
    dynamics: Annotated[str, among(DYNAMICS), "without time, with viscosity, or with inertia too"] = (
        "quasistatic"
    )
    contact: Annotated[str, among(CONTACTS), "exact (Signorini, Coulomb), or springs"] = "exact"
    penalty_normal: Annotated[float | None, _PENALTY, "with contact = penalty"] = None
    penalty_tangential: Annotated[float | None, _PENALTY, "with contact = penalty and friction"] = None
    tolerance: Annotated[
        float, _TOLERANCE, "largest free residual over the largest reaction, of every step"
    ] = 1e-8
    threads: Annotated[int, whole(1024), "of PARDISO, which is in evfem[fast]"] = 1
    strategy: Annotated[Strategy, {"allowed": "a table [solver.strategy]"}, "how hard steps are tried"] = (
        field(default_factory=Strategy)
    )
    core: Annotated[
        float | str,
        {"allowed": _CORE, "check": _core},
        "gap below which a line of the same work replaces a law too steep for the mesh",
    ] = "auto"
    symmetry: InitVar[object] = None

    def __post_init__(self, symmetry: object) -> None:
        if symmetry is not None:
            raise InputError("symmetry", describe_value(symmetry), RENAMED_KEYS["solver.symmetry"])
        if not isinstance(self.strategy, Strategy):
            raise InputError("strategy", describe_value(self.strategy), "a Strategy")
        for key in ("penalty_normal", "penalty_tangential"):
            if self.contact == "exact" and getattr(self, key) is not None:
                raise InputError(key, describe_value(getattr(self, key)), 'only with contact = "penalty"')
        check_fields(self)
        if self.contact == "penalty" and self.penalty_normal is None:
            allowed = 'a penalty in N/mm3, needed with contact = "penalty"'
            raise InputError("penalty_normal", ABSENT, allowed)

    @property
    def timed(self) -> bool:
        """Whether the tissue knows of time."""
        return DYNAMICS[self.dynamics] is not None

    @property
    def inertial(self) -> bool:
        """Whether the tissue has mass."""
        return getattr(DYNAMICS[self.dynamics], "inertia", False)

    @classmethod
    def within(cls, error: float = 1e-3) -> Solver:
        """What costs least where forces shall err by at most this share beside the mesh's own error:
        residuals of a thousandth of it, and steps that are cut only where the path would err by more. The
        mesh may err by far more: `ev.check` states by how much, and `ev.accurate` chooses it too.

        >>> auto = Strategy(steps="auto", path_error=0.001)
        >>> Solver.within(0.001) == Solver(tolerance=1e-6, strategy=auto)
        True
        """
        strategy = Strategy(steps="auto", path_error=error)
        return cls(tolerance=1e-3 * error, strategy=strategy)

    def element_on(self, corners: int) -> str:
        """The element used on cells with that many corners (3, 4 or 8).

        >>> Solver().element_on(4), Solver().element_on(3), Solver(element="q1").element_on(4)
        ('q2p1', 'p2', 'q1')
        >>> Solver(element="q1").element_on(3)
        Traceback (most recent call last):
        evfem.errors.InputError: solver.element: given q1 on a mesh of triangles; allowed: p2
        """
        names = elements_on(corners)
        if self.element is None:
            return {3: "p2", 4: "q2p1", 8: "hex27p1"}[corners]
        if self.element not in names:
            cells = {3: "triangles", 4: "quads", 8: "hexahedra"}[corners]
            raise InputError("solver.element", f"{self.element} on a mesh of {cells}", " | ".join(names))
        return self.element


def _probes(key: str, value: Any) -> Any:
    if value == {}:  # whose check would cost an import
        return {}
    from evfem.scene.probes import checked

    return checked(key, value)


@dataclass(frozen=True)
class Output(Checked):
    """Which fields are kept, and of which points histories. What is left open `evfem run` chooses so that
    its files of fields stay small (`evfem.export.FieldFiles`).
    """

    every: Annotated[
        int | None,
        whole(),
        "fields of every n-th step, and of the last one; without it as many as fit in 25 MB",
    ] = None
    precision: Annotated[
        str | None,
        among(PRECISIONS),
        "of the fields; without it single where they would take more than 25 MB",
    ] = None
    compression: Annotated[
        bool, yes_or_no(), "of the fields' files: a third of the size, slower to write"
    ] = False
    probes: Annotated[
        Mapping[str, Any],
        {"allowed": "a table [output.probes] of names with points or a Probe", "check": _probes},
        "points of the tissue whose stress and strain are kept after every step",
    ] = field(default_factory=dict)
