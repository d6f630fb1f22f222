"""Counter-surfaces, rigid or elastic: height, slope and curvature of the outline, friction, insulator.

A surface is a function height(x) in mm; the finger is above it. The methods give the UNSHIFTED
profile: the scene adds `y` (mm), and where `y` is None chooses it so that the smallest vertical
gap of the undeformed finger is 0. `friction` is a number, or a table [[x, mu], ...]: linear
between its rows, constant beyond them; at a repeated x the later row holds from that x on.
`insulator` is the layer between the surface and the electrode under it (None: no electrode).
`elastic` is the compliance of the surface (`evfem.surface.elastic`; None: rigid). x may be any
array, real or complex (for `tensor.complex_step`); the results have its shape.

Below a finger in three dimensions a surface varies along the direction of its `angle` only, and x above is
the distance along that direction; tables of friction stay tables over x, and an `ev.FrictionMap` has
coefficients over x and z. `ev.Relief` (`evfem.surface.relief`) has heights over x and z.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np

from evfem.common.checks import Checked, Within, number, real, set_frozen
from evfem.common.tables import numbers, piecewise_linear, piecewise_slope, read_columns
from evfem.common.views import changed
from evfem.electrostatics.laws import FILM, Insulator, Layer
from evfem.errors import InputError, describe_value
from evfem.protocols import Elastic
from evfem.surface.elastic import ELASTIC, elastic_of
from evfem.surface.ways import ANGLE, FrictionMap, Unidirectional, direction
from evfem.tensor import Array

Rows = Sequence[Sequence[float]]

FRICTION = (
    "a number from 0 to 100, or a table [[x, mu], ...] with mu from 0 to 100 and x not decreasing, "
    "within 1e6 mm, in at most 10000 rows, or a FrictionMap"
)
ELECTRODES = "rows [from, to, fraction] in mm from left to right, gaps in between, fractions from -1 to 1"
TERMS = (
    "a list of at most 1000 rows [amplitude, wavenumber, phase] or [amplitude, wavenumber, phase, angle], "
    "amplitudes within 1e3 mm, wavenumbers and phases within 1e6, angles within 360 degrees"
)
#: largest number of rows of a table, of sines, of samples of a profile
MOST_ROWS, MOST_TERMS, MOST_SAMPLES = 10_000, 1_000, 1_000_000
#: values of a sum of sines that are evaluated at once
MOST_VALUES = 1_000_000
#: largest positions, heights and amplitudes (mm), wavenumbers (rad/mm), friction coefficients; smallest
#: distance of samples (mm)
FARTHEST, HIGHEST, FASTEST, ROUGHEST, NEAREST = 1e6, 1e3, 1e6, 100.0, 1e-9
#: Equation (25) of the paper, 0.025 (sin 6x + cos 12x - 1) in mm, as rows amplitude, wavenumber, phase.
EQUATION_25 = ((0.025, 6.0, 0.0), (0.025, 12.0, np.pi / 2), (-0.025, 0.0, np.pi / 2))


Friction = Annotated[
    float | Rows | FrictionMap,
    {
        "allowed": FRICTION,
        "check": lambda key, value: _friction(key, value),
        "type": float | list[list[float]] | dict,
    },
    "Coulomb's coefficient, its table over x (mm), or a table {x, z, friction}; linear in between",
]
Angle = Annotated[float, ANGLE, "from +x, of the direction in which it varies; 90 is along the finger"]
Shift = Annotated[
    float | None,
    number("a height in mm, within 1e3 mm", Within(-HIGHEST, HIGHEST), "mm"),
    "shift of the profile; without it the finger just touches at the start",
]
GivesWay = Annotated[Elastic | None, {"check": lambda key, value: elastic_of(value, key), "allowed": ELASTIC}]


class RigidSurface(Unidirectional, Checked):
    """Base of surfaces; subclasses are frozen dataclasses with these fields."""

    friction: float | Rows | FrictionMap
    y: float | None
    insulator: Layer | None
    elastic: Elastic | None
    is_flat = False
    _table = "surface."

    @property
    def has_friction(self) -> bool:
        """Whether the friction coefficient is positive anywhere."""
        if isinstance(self.friction, FrictionMap):
            return bool(np.max(self.friction.friction) > 0.0)
        return bool(np.max(np.atleast_2d(self.friction)[:, -1]) > 0.0)

    @property
    def _rows(self) -> Array:
        """Positions and coefficients (R, 2) of the table over x; of a map that on z = 0."""
        if isinstance(self.friction, FrictionMap):
            x = self.friction.x
            return np.column_stack([x, self.friction.at(x[:, None])])
        return np.array(self.friction)

    def friction_coefficient(self, x: Array) -> Array:
        """Friction coefficient at x (mm), real, on z = 0.

        >>> step = Flat(friction=[[0.0, 0.5], [2.0, 0.5], [2.0, 0.6]])
        >>> step.friction_coefficient(np.array([-1.0, 1.9, 2.0, 9.0])).tolist()
        [0.5, 0.5, 0.6, 0.6]
        """
        if isinstance(self.friction, float):
            return np.full(np.shape(x), self.friction)
        position, mu = self._rows.T
        return piecewise_linear(position, mu, x)

    def friction_slope(self, x: Array) -> Array:
        """Derivative (1/mm) of the friction coefficient at x (mm), jumps left out.

        >>> Flat(friction=[[0.0, 0.25], [2.0, 0.75]]).friction_slope(np.array([1.0, 3.0])).tolist()
        [0.25, 0.0]
        """
        if isinstance(self.friction, float):
            return np.zeros(np.shape(x))
        position, mu = self._rows.T
        return piecewise_slope(position, mu, x)

    @property
    def friction_jumps(self) -> Array:
        """Jumps of the friction coefficient, (J, 3): position in mm, coefficient before and from there on.

        >>> Flat(friction=[[0.0, 0.5], [2.0, 0.5], [2.0, 0.6]]).friction_jumps.tolist()
        [[2.0, 0.5, 0.6]]
        """
        if isinstance(self.friction, float):
            return np.zeros((0, 3))
        position, mu = self._rows.T
        first = np.concatenate([[True], np.diff(position) > 0])
        last = np.concatenate([np.diff(position) > 0, [True]])
        jumps = np.stack([position[last], mu[first], mu[last]], axis=1)
        return jumps[jumps[:, 1] != jumps[:, 2]]

    @property
    def friction_ramps(self) -> Array:
        """Ramps of the friction coefficient, (R, 4): begin and end in mm, coefficients there.

        >>> Flat(friction=[[0.0, 0.5], [2.0, 0.5], [2.1, 0.6]]).friction_ramps.tolist()
        [[2.0, 2.1, 0.5, 0.6]]
        """
        if isinstance(self.friction, float):
            return np.zeros((0, 4))
        position, mu = self._rows.T
        ramps = np.stack([position[:-1], position[1:], mu[:-1], mu[1:]], axis=1)
        return ramps[(ramps[:, 0] < ramps[:, 1]) & (ramps[:, 2] != ramps[:, 3])]

    def shifted(self, y: float) -> Self:
        """The same surface with its height shifted by `y` (mm)."""
        moved = copy(self)
        set_frozen(moved, y=y)
        return moved

    def height(self, x: Array) -> Array:
        """Height (mm) of the unshifted profile at x (mm)."""
        return self.relief(np.asarray(x)[..., None])[0]

    def slope(self, x: Array) -> Array:
        """Derivative of the height at x (mm)."""
        return self.relief(np.asarray(x)[..., None])[1][..., 0]

    def curvature(self, x: Array) -> Array:
        """Second derivative (1/mm) of the height at x (mm)."""
        return self.relief(np.asarray(x)[..., None])[2][..., 0, 0]


class _Level(RigidSurface):
    """A level surface: height, slope and curvature are zero."""

    is_flat = True

    def height(self, x: Array) -> Array:
        """Zero at every x."""
        return np.zeros_like(x, dtype=np.result_type(x, float))

    slope = curvature = height

    def relief(self, position: Array) -> tuple[Array, Array, Array]:
        """Zeros."""
        return (
            np.zeros(position.shape[:-1]),
            np.zeros(position.shape),
            np.zeros((*position.shape, position.shape[-1])),
        )


@dataclass(frozen=True)
class Flat(_Level):
    """A level rigid surface.

    >>> Flat(friction=0.4).height(np.array([1.0, 2.0])).tolist()
    [0.0, 0.0]
    """

    friction: Friction = 0.3
    y: Shift = None
    insulator: Insulator = None
    elastic: GivesWay = None


@dataclass(frozen=True)
class Display(_Level):
    """A level display: an insulator over an electrode, by default the film of Table 2 (0.09 mm, eps_r 3.35).

    `electrodes` are rows [from, to, fraction] of finite electrodes, in mm, from left to right with gaps
    between them, each at its fraction (-1 to 1) of the scene's voltage; None is one infinite electrode.

    >>> from evfem.electrostatics.laws import TOUCHSCREEN
    >>> Display().insulator, Display(TOUCHSCREEN).insulator
    (Layer(thickness=0.09, eps_r=3.35), Layer(thickness=0.001, eps_r=3.9))
    """

    insulator: Insulator = FILM
    friction: Friction = 0.3
    y: Shift = None
    electrodes: Rows | None = None
    elastic: GivesWay = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.electrodes is None:
            return
        rows = _rows("surface.electrodes", self.electrodes, 3, ELECTRODES, MOST_TERMS)
        table = np.array(rows)
        ends = table[:, :2].ravel()
        if np.any(np.diff(ends) <= 0.0) or np.any(np.abs(table[:, 2]) > 1.0):
            raise InputError("surface.electrodes", describe_value(self.electrodes), ELECTRODES)
        set_frozen(self, electrodes=rows)


@dataclass(frozen=True)
class Sinusoid(RigidSurface):
    """A sum of sines, height(x) = sum of amplitude sin(wavenumber x + phase); without `terms` equation (25)
    of the paper, 0.025 (sin 6x + cos 12x - 1) mm. A term may have an angle of its own, from that of the
    surface on.

    >>> float(Sinusoid().height(0.0))
    0.0
    >>> eggs = Sinusoid(terms=[[0.02, 6.0, 0.0], [0.02, 6.0, 0.0, 90.0]])
    >>> eggs.relief(np.array([[0.1, 0.2]]))[0].round(6).tolist()
    [0.029934]
    """

    friction: Friction = 0.3
    terms: Annotated[
        Rows | None,
        {"allowed": TERMS, "type": list[list[float]]},
        "sum of a sin(k x + phase); without it eq. (25) of the paper",
    ] = None
    y: Shift = None
    insulator: Insulator = None
    elastic: GivesWay = None
    angle: Angle = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        terms = EQUATION_25 if self.terms is None else self.terms
        rows = _terms("surface.terms", terms)
        set_frozen(self, terms=rows)

    @property
    def crosses(self) -> bool:
        """Whether a finger in the plane cannot have it."""
        return super().crosses or any(angle != 0.0 for _, _, _, *own in self._all for angle in own)

    @property
    def _all(self) -> Rows:
        assert self.terms is not None
        return self.terms

    def relief(self, position: Array) -> tuple[Array, Array, Array]:
        """Heights, slopes and curvatures of all terms, each along its own direction."""
        d = position.shape[-1]
        amplitude, wave, phase = self._waves
        wave, rows = wave[:, :d], position.reshape(-1, d)
        square = (wave[:, :, None] * wave[:, None, :]).reshape(-1, d * d)
        kind = np.result_type(position, float)  # complex in a complex step
        height, slope, curvature = (np.zeros((len(rows), size), kind) for size in (1, d, d * d))
        block = max(MOST_VALUES // max(len(rows), 1), 1)
        for first in range(0, len(wave), block):
            some = slice(first, first + block)
            at = rows @ wave[some].T + phase[some]
            sine, cosine = amplitude[some] * np.sin(at), amplitude[some] * np.cos(at)
            height += sine.sum(axis=1, keepdims=True)
            slope += cosine @ wave[some]
            curvature -= sine @ square[some]
        return (
            height.reshape(position.shape[:-1]),
            slope.reshape(position.shape),
            curvature.reshape(*position.shape, d),
        )

    @cached_property
    def _waves(self) -> tuple[Array, Array, Array]:
        """Amplitudes (T,) in mm, wave vectors (T, 2) in rad/mm and phases (T,) of the terms."""
        terms = np.array([[a, k, phase, sum(own)] for a, k, phase, *own in self._all])
        directions = np.array([direction(self.angle + own) for own in terms[:, 3].tolist()])
        return terms[:, 0], terms[:, 1:2] * directions, terms[:, 2]


@dataclass(frozen=True, eq=False, init=False)
class Profile(RigidSurface):
    """A sampled profile: points x, height (mm), monotone cubics between them (PCHIP), level beyond the ends.

    x must increase; at least two points (kept as `x` and `samples`). Between two samples the
    height stays between their heights, its slope is continuous, its curvature jumps at samples.
    Source: Fritsch and Carlson, SIAM J. Numer. Anal. 17 (1980) 238-246, doi:10.1137/0717021.

    >>> Profile([0.0, 1.0, 2.0], [0.0, 0.5, 0.0]).height(np.array([-1.0, 1.0, 1.5])).tolist()
    [0.0, 0.5, 0.375]
    """

    x: Array
    samples: Array
    friction: Friction = 0.3
    y: Shift = None
    insulator: Insulator = None
    elastic: GivesWay = None
    angle: Angle = 0.0

    def __init__(
        self,
        x: Any,
        height: Any,
        friction: Any = 0.3,
        y: float | None = None,
        insulator: Layer | None = None,
        elastic: Elastic | None = None,
        angle: float = 0.0,
    ) -> None:
        set_frozen(self, friction=friction, y=y, insulator=insulator, elastic=elastic, angle=angle)
        super().__post_init__()
        set_frozen(self, x=numbers("surface.x", x, "a list of positions in mm"))
        set_frozen(self, samples=numbers("surface.height", height, "a list of heights in mm"))
        _check_samples(self.x, self.samples)

    @classmethod
    def from_csv(
        cls,
        path: str | Path,
        friction: Any = 0.3,
        y: float | None = None,
        insulator: Layer | None = None,
        elastic: Elastic | None = None,
        angle: float = 0.0,
    ) -> Profile:
        """The profile in a file with the header `x,height` and one point (mm) in each further line."""
        x, height = read_columns(Path(path), dict.fromkeys(("x", "height"), "mm"), "surface.file")
        return cls(x, height, friction, y, insulator, elastic, angle)

    def __repr__(self) -> str:
        x, low, high = self.x, self.samples.min(), self.samples.max()
        size = f"{x.size} points, x {x[0]:.4g} to {x[-1]:.4g} mm, height {low:.4g} to {high:.4g} mm"
        more = [f"{key}={v!r}" for key, v in changed(self).items() if key not in ("x", "samples")]
        return f"Profile({', '.join([size, *more])})"

    @cached_property
    def _cubics(self) -> Array:
        """Coefficients (4, pieces) of the powers 3, 2, 1, 0 of the distance from a piece's left end."""
        from scipy.interpolate import PchipInterpolator

        with np.errstate(over="ignore"):  # slopes next to nothing have infinite inverses, and so vanish
            inner = PchipInterpolator(self.x, self.samples).c
        ends = np.zeros((4, 2))
        ends[3] = self.samples[0], self.samples[-1]
        return np.concatenate([ends[:, :1], inner, ends[:, 1:]], axis=1)

    def _piece(self, x: Array) -> tuple[Array, Array]:
        """Cubic (4, ...) at x, and distance (...) from the left end of its piece."""
        piece = np.searchsorted(self.x, np.real(x), side="right")
        return self._cubics[:, piece], x - self.x[np.maximum(piece - 1, 0)]

    def height(self, x: Array) -> Array:
        """Height (mm) of the unshifted profile at x (mm)."""
        c, d = self._piece(x)
        return c[3] + d * (c[2] + d * (c[1] + d * c[0]))

    def slope(self, x: Array) -> Array:
        """Derivative of the height at x (mm)."""
        c, d = self._piece(x)
        return c[2] + d * (2.0 * c[1] + d * 3.0 * c[0])

    def curvature(self, x: Array) -> Array:
        """Second derivative (1/mm) of the height at x (mm)."""
        c, d = self._piece(x)
        return 2.0 * c[1] + d * 6.0 * c[0]


def _friction(key: str, value: Any) -> float | Rows | FrictionMap:
    """A number as float, a table as a tuple of rows, a map as it is or from its table."""
    if isinstance(value, FrictionMap):
        return value
    if isinstance(value, Mapping):
        if set(value) != {"x", "z", "friction"}:
            found = ", ".join(map(str, value)) or "nothing"
            raise InputError(key, f"a table of {found}", "x, z and friction")
        return FrictionMap(**value)
    if not isinstance(value, Sequence | np.ndarray) or isinstance(value, str):
        return real(key, value, FRICTION, lambda mu: 0.0 <= mu <= ROUGHEST)
    rows = _rows(key, value, 2, FRICTION, MOST_ROWS)
    x, mu = np.array(rows).T
    if not ((mu >= 0.0) & (mu <= ROUGHEST) & (np.abs(x) <= FARTHEST)).all() or (np.diff(x) < 0.0).any():
        raise InputError(key, value, FRICTION)
    return rows


def _terms(key: str, value: Any) -> tuple[tuple[float, ...], ...]:
    """Rows of a sum of sines, with angles or without."""
    many = isinstance(value, Sequence | np.ndarray) and not isinstance(value, str)
    rows = list(value) if many else value
    sizes = [len(row) if isinstance(row, list | tuple | np.ndarray) else 0 for row in rows] if many else []
    if long := 4 in sizes:  # some rows with an angle, some without
        rows = [[*row, 0.0] if size == 3 else row for row, size in zip(rows, sizes, strict=True)]
    found = _rows(key, rows, 4 if long else 3, TERMS, MOST_TERMS)
    if (np.abs(found) > [HIGHEST, FASTEST, FASTEST, 360.0][: len(found[0])]).any():
        raise InputError(key, describe_value(value), TERMS)
    return found


def _rows(key: str, value: Any, columns: int, allowed: str, most: int) -> tuple[tuple[float, ...], ...]:
    """A table of numbers as a tuple of rows."""
    table = numbers(key, value, allowed, axes=2)
    if table.shape[1] != columns or not 0 < len(table) <= most:
        raise InputError(key, value, allowed)
    return tuple(map(tuple, table.tolist()))


def _check_samples(x: Array, height: Array) -> None:
    if len(x) < 2 or len(x) != len(height):
        value = f"{len(x)} values of x, {len(height)} heights"
        raise InputError("surface.x", value, "at least two points, and as many heights as x")
    if len(x) > MOST_SAMPLES:
        raise InputError("surface.x", f"{len(x)} points", f"at most {MOST_SAMPLES} points")
    for key, values, most in (("surface.x", x, FARTHEST), ("surface.height", height, HIGHEST)):
        if np.abs(values).max() > most:
            value = f"{values[np.argmax(np.abs(values))]:g}"
            raise InputError(key, value, f"lengths in mm within {most:g} mm")
    wrong = np.flatnonzero(np.diff(x) < NEAREST)
    if len(wrong):
        n = int(wrong[0])
        value = f"{x[n]:g}, then {x[n + 1]:g} (points {n + 1}, {n + 2})"
        raise InputError("surface.x", value, f"increasing values, at least {NEAREST:g} mm apart")
