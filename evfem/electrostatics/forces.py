"""Closed-form forces on flat and ellipsoidal pads (3)-(8b), (24); skin thickness from thresholds;
the gain of friction that slip renews.

Units: mm, N, V; permittivities relative. All arguments broadcast; scalars give a float. Equation numbers are
those of the paper on modelling and validating electrovibration displays that the project starts from.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from evfem.common.checks import Values, above, at_least, to_python
from evfem.electrostatics.laws import Layer, Layers
from evfem.errors import InputError, describe_value
from evfem.protocols import ForceLaw

Outline = Literal["rectangle", "ellipse"]


def plate_force(law: ForceLaw, area: Values, gap: Values, voltage: Values, layers: Layers) -> Values:
    """Force in N on a flat pad of `area` in mm^2: equations (3) and (5) at gap 0, (6) and (7) above it."""
    area = at_least("area", area, 0.0, "an area in mm^2, not negative")
    gap = at_least("gap", gap, 0.0, "an air gap in mm, not negative")
    return to_python(np.asarray(area * law.traction(gap, voltage, layers)))


@dataclass(frozen=True)
class EllipsoidalPad:
    """The pad of equation (24) by its FULL axes in mm: `width` 2a, `height` 2b, `length` 2c.

    >>> EllipsoidalPad(16.70, 12.80, 22.5).gap(0.0, 0.0, 0.25)
    0.25
    """

    width: Values
    height: Values
    length: Values

    def __post_init__(self) -> None:
        for name in ("width", "height", "length"):
            value = above(f"pad {name}", getattr(self, name), 0.0, "a length in mm above zero")
            object.__setattr__(self, name, value)

    def gap(self, x: Values, y: Values, lowest: Values) -> Values:
        """Air gap d^a(x, y) in mm, equation (24); abs(x) <= a, abs(y) <= c; `lowest`: d^a0 in the middle."""
        b = self.height / 2.0
        rise_x = 1.0 - np.sqrt(1.0 - (2.0 * np.asarray(x) / self.width) ** 2)
        rise_y = 1.0 - np.sqrt(1.0 - (2.0 * np.asarray(y) / self.length) ** 2)
        return to_python(lowest + b * (rise_x + rise_y))


_POINTS = 28  # per direction; error below 3e-12 for every pad and law with gap + layers above 1e-6 mm
_BATCH = 256  # evaluations at a time, so that memory stays small whatever the sweep


def _near_pole(scale: Values, upper: Values) -> tuple[Values, Values]:
    """Gauss points and weights (last axis) on [0, upper] for 1 / (scale^2 + t^2)^q: t = scale sinh(v)."""
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    end, scale = 0.5 * np.arcsinh(upper / scale)[..., None], np.asarray(scale)[..., None]
    at = end * (nodes + 1.0)
    return scale * np.sinh(at), weights * end * scale * np.cosh(at)


def _pole_distance(gap: Values, height: Values, layers: Layers) -> Values:
    """Angle at which gap + reduced thickness has doubled; real, because it only places the points."""
    nearest = np.asarray(gap).real + np.minimum(np.real(layers.reduced), np.real(layers.thickness))
    if not np.all(nearest > 0):
        raise InputError(
            "gap", gap, "an air gap above zero where no solid layer insulates: the force would be infinite"
        )
    return np.sqrt(4.0 * nearest / np.real(height))


def pad_force(
    law: ForceLaw,
    pad: EllipsoidalPad,
    gap: Values,
    voltage: Values,
    layers: Layers,
    over: Outline = "rectangle",
) -> Values:
    """Force in N on an ellipsoidal pad at lowest air gap `gap` in mm: (8a) or (8b) with (24), 1e-10 relative.

    `over` chooses the area of integration: the rectangle abs(x) <= a, abs(y) <= c (the paper's numbers) or
    the ellipse in it. All arguments broadcast; the result has their common shape. With x = a sin(t), y = c
    sin(v) the gap is ``gap + b (2 - cos t - cos v)``, so the integrand is smooth and one product Gauss rule
    serves every evaluation. Raises InputError for a negative gap or where nothing insulates.

    >>> from evfem.electrostatics.laws import Kaczmarek
    >>> pad, skin, film = EllipsoidalPad(16.70, 12.80, 22.5), Layer(0.38, 1650.0), Layer(0.09, 3.35)
    >>> round(1e3 * pad_force(Kaczmarek(), pad, 0.25, 2000.0, Layers.of(skin, film)), 3)  # mN, HVLD
    2.947
    """
    if over not in ("rectangle", "ellipse"):
        raise InputError("over", describe_value(over), "'rectangle' or 'ellipse'")
    gap = at_least("gap", gap, 0.0, "an air gap in mm, not negative")
    given = (gap, voltage, layers.reduced, layers.thickness, pad.width, pad.height, pad.length)
    columns = np.broadcast_arrays(*given)
    shape, flat = columns[0].shape, [np.ravel(column) for column in columns]
    pieces = [
        _pad_force_batch(law, [column[i : i + _BATCH] for column in flat], over)
        for i in range(0, flat[0].size, _BATCH)
    ]
    return to_python(np.concatenate(pieces).reshape(shape)) if pieces else np.zeros(shape)


def _pad_force_batch(law: ForceLaw, columns: list[npt.NDArray[Any]], over: Outline) -> npt.NDArray[Any]:
    gap, voltage, reduced, thickness, width, height, length = columns
    near = _pole_distance(gap, height, Layers(reduced, thickness))
    v, weight_v = _near_pole(near, np.full_like(near, np.pi / 2.0))
    end = np.pi / 2.0 - v if over == "ellipse" else np.full_like(v, np.pi / 2.0)
    t, weight_t = _near_pole(np.hypot(near[:, None], v), end)
    v = v[..., None]
    lift = 2.0 * (np.sin(0.5 * t) ** 2 + np.sin(0.5 * v) ** 2)  # 2 - cos t - cos v without cancellation
    deep = (slice(None), None, None)
    stack = Layers(reduced[deep], thickness[deep])
    traction = law.traction(gap[deep] + 0.5 * height[deep] * lift, voltage[deep], stack)
    inner = np.sum(weight_t * np.cos(t) * traction, axis=-1)
    return width * length * np.sum(weight_v * np.cos(v[..., 0]) * inner, axis=-1)


def pad_force_per_depth(
    law: ForceLaw, pad: EllipsoidalPad, gap: Values, voltage: Values, layers: Layers
) -> Values:
    """Force in N/mm per depth on the lower half of the elliptic cross-section of `pad`, 1e-10 relative.

    The two-dimensional counterpart of (8a), (8b): the vertical traction on the projected width;
    `pad.length` is not used.

    >>> from evfem.electrostatics.laws import Kaczmarek
    >>> pad, skin, film = EllipsoidalPad(16.68, 12.79, 22.5), Layer(0.38, 1650.0), Layer(0.09, 3.35)
    >>> round(1e3 * pad_force_per_depth(Kaczmarek(), pad, 0.25, 2000.0, Layers.of(skin, film)), 5)  # mN/mm
    0.40356
    """
    gap = at_least("gap", gap, 0.0, "an air gap in mm, not negative")
    columns = np.broadcast_arrays(gap, voltage, layers.reduced, layers.thickness, pad.width, pad.height)
    gap, voltage, reduced, thickness, width, height = (column[..., None] for column in columns)
    near = _pole_distance(columns[0], columns[5], Layers(columns[2], columns[3]))
    t, weight = _near_pole(near, np.full_like(near, np.pi / 2.0))
    traction = law.traction(gap + height * np.sin(0.5 * t) ** 2, voltage, Layers(reduced, thickness))
    return to_python(np.sum(width * weight * np.cos(t) * traction, axis=-1))


_PANELS = 0.5 * 0.25 ** np.arange(11)  # shares of a piece towards each of its ends


def _graded(start: float, end: float) -> tuple[Values, Values]:
    """Gauss points and weights on [start, end], in panels that shrink fourfold towards both ends."""
    edges = np.concatenate([[0.0], _PANELS[::-1], 1.0 - _PANELS[1:], [1.0]])
    nodes, weights = np.polynomial.legendre.leggauss(16)
    half = 0.5 * np.diff(edges)[:, None]
    at = (edges[:-1, None] + half * (nodes + 1.0)).ravel()
    return start + (end - start) * at, (end - start) * (half * weights).ravel()


@dataclass(frozen=True)
class _Superellipsoid:
    """abs(x/a)^n + abs(y/b)^n + abs(z/c)^n = 1 with semi-axes `semi` in mm; `up`: the vertical in its axes.

    Its points are v = d / |d|_n in units of the semi-axes, d a unit vector at a `turn` around x from y to z
    and a `latitude` from the plane y, z: what is seen from below lies between two turns. An area of the unit
    sphere belongs to the area vector a b c / (n a_i) dF/dv_i |d|_n^-3, as F = |v|_n^n is homogeneous.
    """

    semi: Values
    up: Values
    n: float

    @property
    def lowest(self) -> float:
        """Height in mm of the centre above the lowest point: the dual norm of the vertical."""
        power = self.n / (self.n - 1.0)
        return float(np.sum((self.semi * np.abs(self.up)) ** power) ** (1.0 / power))

    def turns(self) -> Values:
        """Turns from silhouette to silhouette, with those of the lowest point and of the axes between."""
        root = 1.0 / (self.n - 1.0)
        (_, b, c), (_, y, z) = self.semi, self.up
        start = np.arctan2((y / b) ** root, -np.sign(z) * abs(z / c) ** root)
        lowest = np.arctan2(-np.sign(z) * abs(c * z) ** root, -((b * y) ** root))
        special = np.concatenate([[lowest], 0.5 * np.pi * np.arange(4)])
        inside = start + np.mod(special - start, 2.0 * np.pi)
        return np.unique(np.round([start, *inside[inside < start + np.pi], start + np.pi], 12))

    def columns(self, start: float, end: float) -> tuple[Values, Values]:
        """Heights in mm above the lowest point and areas seen from below, in mm^2, between two turns."""
        (turn, share), (latitude, weight) = _graded(start, end), _graded(0.0, 0.5 * np.pi)
        across = np.broadcast_to(np.sin(latitude), (len(turn), len(latitude)))
        d = np.stack([across, *(np.outer(one, np.cos(latitude)) for one in (np.cos(turn), np.sin(turn)))])
        size = np.sum(np.abs(d) ** self.n, axis=0) ** (1.0 / self.n)
        outward = np.sign(d) * np.abs(d / size) ** (self.n - 1.0)
        sphere = 2.0 * np.outer(share, weight * np.cos(latitude)) / size**3  # both signs of x
        area = -np.tensordot(self.up * np.prod(self.semi) / self.semi, outward, 1) * sphere
        height = self.lowest + np.tensordot(self.up * self.semi, d / size, 1)
        return np.maximum(height, 0.0), area


def outline_force(
    law: ForceLaw,
    width: Values,
    height: Values,
    length: Values,
    gap: Values,
    voltage: Values,
    layers: Layers,
    outline: Values = 2.0,
    tilt: Values = 0.0,
) -> Values:
    """Force in N on a whole superellipsoid whose lowest point is `gap` mm above the display, 1e-8 relative.

    The finger is abs(x/a)^n + abs(y/b)^n + abs(z/c)^n = 1 with n = `outline`, 2 to 4, and the FULL axes
    `width` 2a, `height` 2b, `length` 2c in mm; its z axis is turned by `tilt` degrees from the display. Each
    vertical column below it has the traction of `law` at its own gap. All arguments broadcast.

    >>> from evfem.electrostatics.laws import StrongTroxel
    >>> layers = Layers.of(Layer(0.38, 1650.0), Layer(0.09, 3.35))
    >>> round(1e3 * outline_force(StrongTroxel(), 16.68, 12.789, 22.56, 0.25, 2000.0, layers), 3)  # mN, HVLD
    5.093
    """
    axes = [above(f"pad {key}", value, 0.0, "a length in mm above zero")
            for key, value in (("width", width), ("height", height), ("length", length))]  # fmt: skip
    gap = at_least("gap", gap, 0.0, "an air gap in mm, not negative")
    _pole_distance(gap, axes[1], layers)
    outline = _between("outline", outline, 2.0, 4.0, "an exponent from 2 (an ellipse) to 4")
    tilt = _between("tilt", tilt, -89.0, 89.0, "an angle in degrees from -89 to 89")
    given = np.broadcast_arrays(*axes, gap, voltage, layers.reduced, layers.thickness, outline, tilt)
    found = np.empty(given[0].shape, np.result_type(*given, float))
    for at in np.ndindex(found.shape):
        a, b, c, lowest, volts, reduced, thickness, n, degrees = (one[at].item() for one in given)
        rise, areas = _columns_of(a, b, c, n, degrees)
        found[at] = np.sum(law.traction(lowest + rise, volts, Layers(reduced, thickness)) * areas)
    return to_python(found)


@lru_cache(maxsize=1)  # other gaps, voltages and laws of one finger
def _columns_of(width: float, height: float, length: float, n: float, tilt: float) -> tuple[Values, Values]:
    """Heights above the lowest point and areas of all columns below a turned superellipsoid."""
    turned = np.radians(tilt)
    up = np.array([0.0, np.cos(turned), np.sin(turned)])
    body = _Superellipsoid(0.5 * np.array([width, height, length]), up, n)
    pieces = [body.columns(start, end) for start, end in pairwise(body.turns())]
    rise, areas = (np.concatenate([np.ravel(one) for one in column]) for column in zip(*pieces, strict=True))
    return rise, areas


def _between(key: str, entered: Values, lowest: float, highest: float, allowed: str) -> Values:
    value = at_least(key, entered, lowest, allowed)
    if np.any(value > highest):
        raise InputError(key, float(np.max(value)), allowed)
    return value


def slip_memory_gain(frequency: Values, speed: Values, length: Values) -> Values:
    """Share of a change of friction that skin follows under `ev.SlipMemory`, complex: 1 / (1 + 2 pi i f L/v).

    The pressure changes with `frequency` (Hz) while the skin slides at `speed` (mm/s), and friction follows
    over the `length` (mm) of slip. Half of its power is left at v/(2 pi L), 13.8 Hz per mm/s of the speed in
    arXiv:2505.11162. Raises InputError where a frequency is negative, a speed or length not
    above 0.

    >>> gain = slip_memory_gain(276.0, 20.0, 1.0 / (2.0 * np.pi * 13.8))
    >>> round(abs(gain), 10), round(float(np.degrees(np.angle(gain))), 6)
    (0.7071067812, -45.0)
    """
    frequency = at_least("frequency", frequency, 0.0, "a frequency in Hz, not negative")
    speed = above("speed", speed, 0.0, "a speed in mm/s above zero")
    length = above("length", length, 0.0, "a length of slip in mm above zero")
    return to_python(np.asarray(1.0 / (1.0 + 2.0j * np.pi * frequency * length / speed)))


def _threshold_weights(
    voltages: tuple[Values, Values], friction: tuple[Values, Values]
) -> tuple[Values, Values]:
    """U^2 mu of both experiments."""
    first, second = (above("voltages", u, 0.0, "two voltages in V above zero") for u in voltages)
    one, other = (above("friction", mu, 0.0, "two friction coefficients above zero") for mu in friction)
    return first**2 * one, second**2 * other


def effective_thickness_from_thresholds(
    voltages: tuple[Values, Values],
    insulators: tuple[Layer, Layer],
    friction: tuple[Values, Values] = (1.0, 1.0),
) -> Values:
    """Reduced thickness d_sc / eps_sc in mm of skin that feels the same with two insulators, equation (21).

    `voltages` are the two thresholds in V. The printed closed form (22) is the special case d_i3 =
    2 d_i2 with d_i = d_i2. Raises InputError if no positive thickness satisfies (21).

    >>> mil = 0.0254
    >>> films = Layer(0.5 * mil, 4.5), Layer(1.0 * mil, 4.5)
    >>> round(1e3 * effective_thickness_from_thresholds((73.0, 110.0), films), 3)     # um
    2.746
    """
    first, second = (np.sqrt(w) for w in _threshold_weights(voltages, friction))
    a, b = (film.thickness / film.eps_r for film in insulators)
    with np.errstate(divide="ignore", invalid="ignore"):
        result = np.asarray((first * b - second * a) / (second - first))
    return to_python(_positive_thickness(result, voltages))


def stratum_corneum_from_thresholds(
    voltages: tuple[Values, Values], insulators: tuple[Layer, Layer], eps_r: Values,
    friction: tuple[Values, Values] = (1.0, 1.0),
) -> Values:  # fmt: skip
    """Thickness d_sc in mm of skin of permittivity `eps_r` after Kaczmarek's law, equation (23).

    (23) is a quadratic in d_sc; its positive root. With Strong-Troxel's law the thickness is `eps_r` times
    `effective_thickness_from_thresholds`. Raises InputError if no positive thickness satisfies (23).
    """
    first, second = (np.asarray(w) for w in _threshold_weights(voltages, friction))
    (da, ea), (db, eb) = ((film.thickness, film.eps_r) for film in insulators)
    eps_r = at_least("eps_r", eps_r, 1.0, "a relative permittivity of at least 1")
    square = (first - second) / eps_r
    linear = first * db * (1.0 / eps_r + 1.0 / eb) - second * da * (1.0 / eps_r + 1.0 / ea)
    constant = first * db**2 / eb - second * da**2 / ea
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(linear**2 - 4.0 * square * constant)
        result = -2.0 * constant / (linear - root)
        other = -2.0 * constant / (linear + root)
    return to_python(_positive_thickness(np.where(np.real(other) > 0, other, result), voltages))


def _positive_thickness(result: npt.NDArray[Any], voltages: tuple[Values, Values]) -> npt.NDArray[Any]:
    if not np.all(np.isfinite(result) & (result.real > 0)):
        raise InputError(
            "voltages", voltages, "thresholds that differ, the higher one for the thicker insulator, but "
            "less than in proportion to it; no thickness satisfies the equation with these",
        )  # fmt: skip
    return result
