"""Electrostatic attraction between skin and an insulated electrode: solid layers and the two force laws.

Both laws treat skin and electrode as parallel plates with solid layers (stratum corneum, insulator) and
a gap in series. With ``s`` = sum of d / eps_r over the solid layers (`Layers.reduced`), ``D`` = their
total thickness (`Layers.thickness`), the gap ``g``, the permittivity ``e`` of what fills it (1 for air)
and the voltage ``U``::

    StrongTroxel   p = e eps_0 U^2 / (2 (g + e s)^2)            equations (3), (6), (8a), (9a)
    Kaczmarek      p = e eps_0 U^2 / (2 (g + e s) (g + D))      equations (5), (7), (8b), (9b)

Under a sine of the effective voltage U, layers and gap that conduct make the reduced thickness
complex, ``z/e = (1 + sigma_g / (i w eps_0 e)) * sum of d / eps*`` (`Layers.of` with a frequency). Its
real part replaces s, its imaginary part is `Layers.loss`, below ``l``, and the mean over the
cycle is::

    StrongTroxel   p = e eps_0 U^2 / (2 ((g + e s)^2 + (e l)^2))
    Kaczmarek      p = e eps_0 U^2 (g + e s) / (2 ((g + e s)^2 + (e l)^2) (g + D))

The second is our definition, which follows the law's derivation: nobody has defined it for
alternating voltage in print. Without losses, l = 0, both are what stands above, bit for bit.

Units: mm, N, MPa, V; ``eps_0`` in F/m is numerically N/V^2. Tractions are
positive where they attract. Equation numbers are those of the paper on modelling and validating
electrovibration displays that the project starts from. Every function takes scalars or arrays that
broadcast, real or complex (for derivatives by complex step); scalars give a float.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from evfem.common.checks import Checked, Values, Within, above, at_least, finite, number, real, to_python
from evfem.common.units import in_unit
from evfem.errors import ABSENT, InputError, describe_value
from evfem.protocols import ForceLaw
from evfem.tensor import derivative

#: electric constant in F/m, numerically N/V^2: CODATA 2022 (a literal: `scipy.constants` takes 0.1 s to load)
eps_0 = 8.8541878188e-12
#: step of differences of a law by its gap (mm)
GAP_STEP = 1e-5
#: field (V/mm) that breaks any solid down, and which fields a layer may have as its own strength
SOLID, STRONG = 3e5, Within(0.0, 1e8, above=True)
STRENGTH = "a field in V/mm, larger than 0, up to 1e8"


@dataclass(frozen=True)
class Layer:
    """A solid dielectric: `thickness` in mm, or a text as "1 um", and relative permittivity `eps_r` >= 1,
    numbers or arrays; or an `evfem.Dielectric` as `eps_r`, whose permittivity depends on the frequency.
    `strength` is the field in V/mm above which it breaks down, without one that of any solid.

    >>> Layer(thickness=0.09, eps_r=3.35)
    Layer(thickness=0.09, eps_r=3.35)
    >>> Layer("1 um", 3.9).thickness
    0.001
    """

    thickness: Values
    eps_r: Values
    strength: float = field(default=SOLID, kw_only=True, repr=False)

    def __post_init__(self) -> None:
        strength = real("layer strength", self.strength, STRENGTH, STRONG)
        object.__setattr__(self, "strength", strength)
        length = "a finite length in mm, not negative"
        thickness = in_unit("layer thickness", self.thickness, "mm", length)
        thickness = at_least("layer thickness", thickness, 0.0, length)
        object.__setattr__(self, "thickness", thickness)
        if not callable(getattr(self.eps_r, "permittivity", None)):
            eps_r = at_least("layer eps_r", self.eps_r, 1.0, "a relative permittivity of at least 1")
            object.__setattr__(self, "eps_r", eps_r)

    @property
    def parts(self) -> tuple[Layer, ...]:
        """The layers that it consists of: itself."""
        return (self,)

    def permittivity(self, frequency: Values | None) -> Values:
        """Relative permittivity at `frequency` (Hz), complex of dielectrics: InputError without."""
        of: Any = getattr(self.eps_r, "permittivity", None)
        if of is None:
            return self.eps_r
        if frequency is None:
            allowed = "a frequency in Hz, where the permittivity of a layer depends on it"
            raise InputError("frequency", ABSENT, allowed)
        return of(frequency)


@dataclass(frozen=True)
class LayerStack(Layer):
    """Solid layers from the top, as the one layer that the laws see: sum d thick, with sum d / eps_r as its
    reduced thickness, so that no force depends on their order.

    >>> coated = LayerStack((Layer(0.02, 2.5), Layer(0.09, 3.35)))
    >>> round(coated.thickness, 9), round(coated.thickness / coated.eps_r, 9)
    (0.11, 0.034865672)
    """

    thickness: Values = field(init=False)
    eps_r: Values = field(init=False)
    layers: tuple[Layer, ...] = ()

    def __post_init__(self) -> None:
        allowed = "layers (thickness, eps_r) that are numbers; a Dielectric is a single layer's"
        for one in self.layers:
            if not (type(one) is Layer and isinstance(one.thickness, float) and isinstance(one.eps_r, float)):
                raise InputError("surface.insulator", one, allowed)
        total = sum(one.thickness for one in self.layers)
        if not total > 0.0:
            raise InputError(
                "surface.insulator", f"layers that are {total:g} mm thick together", "above 0 mm"
            )
        object.__setattr__(self, "thickness", total)
        object.__setattr__(self, "eps_r", total / Layers.of(*self.layers).reduced)

    @property
    def parts(self) -> tuple[Layer, ...]:
        """The layers."""
        return self.layers


def stacked(value: Any) -> Any:
    """Several layers as one; anything else as it is."""
    return LayerStack(tuple(value)) if isinstance(value, (list, tuple)) and value else value


def _insulator(key: str, value: Any) -> Layer | None:
    found: Layer | None = stacked(value)
    if not isinstance(found, Layer | None):
        raise InputError(key, describe_value(value), LAYER)
    return found


LAYER = "Layer(thickness, eps_r), a list of them from the top, or None"
Insulator = Annotated[Any, {"allowed": LAYER, "check": _insulator}]
#: insulators of displays: the film of the paper's Table 2, driven with 1 to 2 kV, and a touchscreen, driven
#: with about 100 V. Meyer et al. (2013) used 1 um at 140 V, as the paper reports in section 3.2.2; 3.9 is the
#: permittivity of silicon dioxide (Sze and Ng 2006, doi:10.1002/0470068329).
FILM = Layer(thickness=0.09, eps_r=3.35)
TOUCHSCREEN = Layer(thickness=0.001, eps_r=3.9)
INSULATORS = {"film": FILM, "touchscreen": TOUCHSCREEN}


@dataclass(frozen=True)
class Layers:
    """A stack of solid layers as the laws see it: `reduced` = sum d / eps_r, `thickness` = sum d, in mm.

    Both are numbers or arrays per node. `Layers.of` adds up any number of layers. `loss` (mm) is the
    imaginary part of the reduced thickness under alternating voltage, 0 without losses.

    >>> stack = Layers.of(Layer(0.38, 1650.0), Layer(0.09, 3.35))
    >>> round(stack.thickness, 9), round(stack.reduced, 9)
    (0.47, 0.027095975)
    """

    reduced: Values
    thickness: Values
    loss: Values = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "loss", finite("layers.loss", self.loss, "a length in mm"))
        for name in ("reduced", "thickness"):
            value = at_least(f"layers.{name}", getattr(self, name), 0.0, "a length in mm, not negative")
            object.__setattr__(self, name, value)

    @classmethod
    def of(
        cls,
        *layers: Layer,
        frequency: Values | None = None,
        gap_conductivity: Values = 0.0,
        gap_eps_r: Values = 1.0,
    ) -> Layers:
        """The stack of these layers, in any order; without layers both sums are zero.

        At a `frequency` (Hz) with what conducts: dielectrics among the layers, and the gap with
        `gap_conductivity` (S/m) and the permittivity `gap_eps_r` of the law.

        >>> screen = Layers.of(Layer(0.001, 3.9), frequency=1000.0, gap_conductivity=1e-8)
        >>> round(1e6 * screen.reduced, 3), round(1e6 * screen.loss, 3)      # nm
        (256.41, -46.09)
        """
        thickness = sum(layer.thickness for layer in layers)
        if frequency is None and not np.any(gap_conductivity):
            return cls(sum(layer.thickness / layer.permittivity(None) for layer in layers), thickness)
        if frequency is None:
            raise InputError("frequency", ABSENT, "a frequency in Hz, with a gap that conducts")
        f = above("frequency", frequency, 0.0, "a frequency in Hz above 0")
        sigma = at_least("gap_conductivity", gap_conductivity, 0.0, "a conductivity in S/m, not negative")
        leak = 1.0 - 1j * np.asarray(sigma) / (2.0 * np.pi * np.asarray(f) * eps_0 * np.asarray(gap_eps_r))
        sums = leak * sum(layer.thickness / np.asarray(layer.permittivity(f)) for layer in layers)
        return cls(to_python(sums.real), thickness, to_python(sums.imag))


def _lengths(gap: Values, layers: Layers, gap_eps_r: float) -> tuple[Values, Values]:
    """g + e s and g + D; both must be positive, or the conductors would touch."""
    gap = np.asarray(gap)
    near, far = gap + gap_eps_r * layers.reduced, gap + layers.thickness
    if not (np.all(near.real > 0) and np.all(far.real > 0)):
        lowest = float(np.min(gap.real))
        raise InputError(
            "gap", lowest, "a gap in mm for which gap + layers stays positive: without any insulation "
            "between skin and electrode the pressure would be infinite",
        )  # fmt: skip
    return near, far


GapPermittivity = Annotated[
    float,
    number("a relative permittivity, at least 1", Within(1.0)),
    "relative permittivity of what fills the gap",
]


#: force laws by their names in a scene file
FORCE_LAWS: dict[str, Any] = {}


class NamedLaw(Checked):
    """A force law with a name in scene files, whose annotated fields are keys of [electrostatics]: a class
    `class Own(NamedLaw, name="own")` is all that one needs, here or in a module that has been imported.
    What derives from a law without a name is for Python alone.
    """

    #: whether its force is the stress of a field between the conductors, which rigid layers alone have
    of_a_field = False

    def __init_subclass__(cls, name: str = "") -> None:
        cls.of_a_field = vars(cls).get("of_a_field", False)  # another law has another force
        if name:
            FORCE_LAWS[name] = cls


@dataclass(frozen=True)
class StrongTroxel(NamedLaw, name="strong_troxel"):
    """Attraction of rigid layers over a movable gap, equations (3) and (6).

    ``p = e eps_0 U^2 / (2 (g + e s)^2)``, potential per area ``Pi = -e eps_0 U^2 / (2 (g + e s))``
    with ``p = dPi/dg``. A slightly negative gap (a penetrating trial state) continues the formula.
    `gap_eps_r` is ``e``, the permittivity of what fills the gap: 1 for air.

    >>> layers = Layers.of(Layer(0.38, 1650.0), Layer(0.09, 3.35))
    >>> round(1e3 * StrongTroxel().traction(0.0, 2000.0, layers), 1)      # kPa, touching skin
    24.1
    """

    gap_eps_r: GapPermittivity = 1.0
    of_a_field = True

    def traction(self, gap: Values, voltage: Values, layers: Layers) -> Values:
        """Attraction in MPa for `gap` in mm, `voltage` in V; InputError where it would be infinite."""
        near, _ = _lengths(gap, layers, self.gap_eps_r)
        if np.any(layers.loss):
            near = np.sqrt(near**2 + (self.gap_eps_r * layers.loss) ** 2)
        return to_python(0.5 * self.gap_eps_r * eps_0 * (np.asarray(voltage) / near) ** 2)

    def traction_derivative(self, gap: Values, voltage: Values, layers: Layers) -> Values:
        """dp/dg in MPa/mm (negative)."""
        near, _ = _lengths(gap, layers, self.gap_eps_r)
        if np.any(layers.loss):
            square = near**2 + (self.gap_eps_r * layers.loss) ** 2
            return to_python(-self.gap_eps_r * eps_0 * np.asarray(voltage) ** 2 * near / square**2)
        return to_python(-self.gap_eps_r * eps_0 * (np.asarray(voltage) / near) ** 2 / near)

    def potential(self, gap: Values, voltage: Values, layers: Layers) -> Values:
        """Pi in N/mm (= N mm per mm^2), zero at infinite gap."""
        near, _ = _lengths(gap, layers, self.gap_eps_r)
        angle = _atan_ratio(self.gap_eps_r * layers.loss / near) if np.any(layers.loss) else 1.0
        return to_python(-0.5 * self.gap_eps_r * eps_0 * np.asarray(voltage) ** 2 / near * angle)


def _log1p_ratio(ratio: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """ln(1 + r) / r to rounding for every r > -1, with the limit 1 at r = 0; complex-safe."""
    small = np.abs(ratio) < 1e-3
    r = np.where(small, 1.0, ratio)
    if np.iscomplexobj(r):  # numpy's complex log1p cancels for small arguments
        logarithm = 0.5 * np.log1p(r.real * (2.0 + r.real) + r.imag**2) + 1j * np.arctan2(
            r.imag, 1.0 + r.real
        )
    else:
        logarithm = np.log1p(r)
    q = np.where(small, ratio, 0.0)
    series = 1.0 - q * (1 / 2 - q * (1 / 3 - q * (1 / 4 - q * (1 / 5 - q * (1 / 6 - q / 7)))))
    return np.where(small, series, logarithm / r)


def _atan_ratio(ratio: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """atan(r) / r, with the limit 1 at r = 0; complex-safe."""
    zero = np.asarray(ratio) == 0.0
    r = np.where(zero, 1.0, ratio)
    return np.where(zero, 1.0, np.arctan(r) / r)


@dataclass(frozen=True)
class Kaczmarek(NamedLaw, name="kaczmarek"):
    """Attraction of layers that stretch with the gap, equations (5) and (7).

    ``p = e eps_0 U^2 / (2 (g + e s)(g + D))``, potential per area ``Pi = -e eps_0 U^2 / (2 (D - e s)) ln((g +
    D) / (g + e s))`` with ``p = dPi/dg``; for ``D -> e s`` both become those of `StrongTroxel`. `gap_eps_r`
    is ``e``, for what fills the gap: 1 for air. With losses under alternating voltage (`Layers.loss`) the law
    is our own definition: ``p = e eps_0 U^2 a / (2 (a^2 + c^2)(a + d))`` with a = g + e s, c = e l, d = D - e
    s and ``Pi = -e eps_0 U^2 ((d/2) ln((a + d)^2 / (a^2 + c^2)) + c atan(c/a)) / (2 (c^2 + d^2))``.

    >>> layers = Layers.of(Layer(0.38, 1650.0), Layer(0.09, 3.35))
    >>> round(1e3 * Kaczmarek().traction(0.0, 2000.0, layers), 2)         # kPa, touching skin
    1.39
    """

    gap_eps_r: GapPermittivity = 1.0

    def traction(self, gap: Values, voltage: Values, layers: Layers) -> Values:
        """Attraction in MPa for `gap` in mm, `voltage` in V; InputError where it would be infinite."""
        near, far = _lengths(gap, layers, self.gap_eps_r)
        if np.any(layers.loss):
            near = near + (self.gap_eps_r * layers.loss) ** 2 / near
        return to_python(0.5 * self.gap_eps_r * eps_0 * np.asarray(voltage) ** 2 / (near * far))

    def traction_derivative(self, gap: Values, voltage: Values, layers: Layers) -> Values:
        """dp/dg in MPa/mm (negative)."""
        near, far = _lengths(gap, layers, self.gap_eps_r)
        if np.any(layers.loss):
            square = (self.gap_eps_r * layers.loss) ** 2
            steepness = (near**2 - square) / (near * (near**2 + square)) + 1.0 / far
            return to_python(-np.asarray(self.traction(gap, voltage, layers)) * steepness)
        traction = 0.5 * self.gap_eps_r * eps_0 * np.asarray(voltage) ** 2 / (near * far)
        return to_python(-traction * (1.0 / near + 1.0 / far))

    def potential(self, gap: Values, voltage: Values, layers: Layers) -> Values:
        """Pi in N/mm (= N mm per mm^2), zero at infinite gap; exact to rounding also where D = e s."""
        near, _ = _lengths(gap, layers, self.gap_eps_r)
        ratio = np.asarray((layers.thickness - self.gap_eps_r * layers.reduced) / near)
        factor = _log1p_ratio(ratio)
        if np.any(layers.loss):
            q, r = ratio**2, np.asarray(self.gap_eps_r * layers.loss / near) ** 2
            lossy = q * factor - 0.5 * ratio * r * _log1p_ratio(r) + r * _atan_ratio(np.sqrt(r))
            factor = np.where(q + r == 0.0, 1.0, lossy / np.where(q + r == 0.0, 1.0, q + r))
        return to_python(-0.5 * self.gap_eps_r * eps_0 * np.asarray(voltage) ** 2 / near * factor)


def traction_derivative(law: ForceLaw, gap: Values, voltage: Values, layers: Layers) -> Values:
    """dp/dg in MPa/mm of any law: its own `traction_derivative`, else a complex step on `traction`.

    A law that drops the imaginary part (it takes absolute values, say) is differenced over `GAP_STEP`.
    """
    own = getattr(law, "traction_derivative", None)
    if own is not None:
        return own(gap, voltage, layers)
    return to_python(derivative(lambda g: law.traction(g, voltage, layers), np.asarray(gap), GAP_STEP))
