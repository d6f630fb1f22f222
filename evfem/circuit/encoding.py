"""Closed-form rendering: from the friction of a real surface to a display's voltage, (1), (12)-(20b).

Friction on a display is ``F_t = mu (F_n + F_e)``. The attraction of touching skin is ``F_e = A p(0, U)`` with
the contact area ``A = k F_n^m``; the air layer around it is left out. Between rough faces p is that at their
gap. Units: mm, N, V. In plane strain,
forces are per mm of depth; then only a linear area law (m = 1) keeps its k, in mm^2/N.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import Values, above, at_least, finite, to_python
from evfem.electrostatics.drive import Drive, mean_law
from evfem.electrostatics.laws import Layer, Layers
from evfem.electrostatics.timesignals import WAVEFORMS
from evfem.errors import InputError
from evfem.protocols import ForceLaw

POSITIVE_FORCE = "a normal force above zero"


@dataclass(frozen=True)
class AreaLaw:
    """Contact area ``A = k F_n^m``, equation (15): mm^2 for N, with k in mm^2/N^m.

    >>> round(AreaLaw(k=63.0, m=0.68)(1.0), 6)
    63.0
    """

    k: float
    m: float = 1.0

    def __post_init__(self) -> None:
        above("k", self.k, 0.0, "an area per N^m in mm^2 above zero")
        finite("m", self.m, "a finite exponent")

    def __call__(self, normal_force: Values) -> Values:
        """Area in mm^2 at `normal_force` in N, 0 or more."""
        force = at_least("normal_force", normal_force, 0.0, "a normal force in N, not negative")
        return to_python(self.k * np.asarray(force) ** self.m)

    def linearised(self, highest: float) -> AreaLaw:
        """The line through the origin closest to this law in least squares over 0 <= F_n <= `highest`.

        k' = 3 k highest^(m - 1) / (m + 2): what the paper's k' in (20a) stands for.

        >>> round(AreaLaw(63.0, 0.68).linearised(0.2).k, 1)
        118.0
        """
        above("highest", highest, 0.0, POSITIVE_FORCE)
        return AreaLaw(3.0 * self.k * highest ** (self.m - 1.0) / (self.m + 2.0))


def required_attraction(friction: Values, display_friction: Values, normal_force: Values) -> Values:
    """Attraction (force of `normal_force`'s unit) that makes the display feel like `friction`, equation (18).

    ``F_e = (mu_rs / mu_hd - 1) F_n``; 0 where the surface is slipperier than the display, because
    attraction can only add friction (see `share_not_renderable`).
    """
    surface = at_least("friction", friction, 0.0, "a friction coefficient, not negative")
    display = above("display_friction", display_friction, 0.0, "a friction coefficient above zero")
    force = at_least("normal_force", normal_force, 0.0, "a normal force, not negative")
    excess = np.asarray(surface) / display - 1.0
    return to_python(np.where(excess.real > 0.0, excess, 0.0) * force)


def share_not_renderable(position: Values, friction: Values, display_friction: float) -> float:
    """Share of the path on which `friction` (linear between `position` in mm) is below the display's own.

    >>> share_not_renderable([0.0, 1.0, 2.0], [0.4, 0.6, 0.6], display_friction=0.5)
    0.25
    """
    x = np.asarray(finite("position", position, "positions in mm"))
    above("display_friction", display_friction, 0.0, "a friction coefficient above zero")
    excess = np.asarray(finite("friction", friction, "friction coefficients")) - display_friction
    length = np.diff(x)
    if x.ndim != 1 or x.shape != excess.shape or x.size < 2 or np.any(length < 0) or not np.any(length > 0):
        raise InputError("position", f"shape {x.shape}", "positions that do not fall, as many as frictions")
    lower, upper = np.minimum(excess[:-1], excess[1:]), np.maximum(excess[:-1], excess[1:])
    rise = np.where(upper > lower, upper - lower, 1.0)
    below = np.where(upper <= lower, lower < 0.0, np.clip(-lower / rise, 0.0, 1.0))
    return float(np.sum(below * length) / np.sum(length))


@dataclass(frozen=True)
class Encoding:
    """A display with what is needed to encode friction as voltage: law, solid layers, area law, own friction.
    Voltages are effective ones; `crest` is the peak of the display's waveform over them. Where they touch,
    rough faces are `gap` (mm) apart.

    The paper's (16a), (17), (19), (20a) are this with `Kaczmarek`, (16b), (20b) with
    `StrongTroxel`; (20a) and (20b) have a linear area law, where the voltage does not depend on
    the normal force. The law must be quadratic in the voltage, as electrostatics is.

    >>> from evfem.electrostatics.laws import Kaczmarek, Layer
    >>> skin, film = Layer(0.20, 1650.0), Layer(0.09, 3.35)
    >>> display = Encoding(Kaczmarek(), Layers.of(skin, film), AreaLaw(112.0), friction=0.5)
    >>> round(display.voltage_for_friction(0.6), 2)
    1776.73
    """

    law: ForceLaw
    layers: Layers
    area: AreaLaw
    friction: float
    crest: float = WAVEFORMS["sine"].crest
    gap: float = 0.0

    @classmethod
    def driven(
        cls,
        law: ForceLaw,
        drive: Drive,
        solids: tuple[Layer, Layer],
        area: AreaLaw,
        friction: float,
        gap: float = 0.0,
    ) -> Encoding:
        """With a `drive` at its frequency, through what skin and gap conduct; `solids` are stratum
        corneum and insulator. Voltages stay effective ones, `peak` is that of the drive's waveform.

        >>> from evfem.electrostatics.laws import FILM, Layer, StrongTroxel
        >>> fast, slow = (
        ...     Encoding.driven(StrongTroxel(), Drive(f, skin="gabriel_dry"), (Layer(0.38, 1.0), FILM),
        ...                     AreaLaw(112.0), friction=0.5) for f in (1e5, 100.0))
        >>> round(fast.voltage_for_friction(0.6) / slow.voltage_for_friction(0.6), 4)
        1.0126
        """
        skin = drive.skin_layer(solids[0].thickness, solids[0].eps_r)
        if drive.resolved:
            raise InputError("drive", "resolved in time", "the mean over the cycle")
        return cls(
            *mean_law(law, drive, drive.frequency, (skin, solids[1])),
            area,
            friction,
            WAVEFORMS[drive.waveform].crest,
            gap,
        )

    def __post_init__(self) -> None:
        above("crest", self.crest, 0.0, "a peak over effective voltage above zero")
        above("friction", self.friction, 0.0, "a friction coefficient above zero")
        at_least("gap", self.gap, 0.0, "a length in mm, not negative")
        one, two = (np.asarray(self.pressure(u)) for u in (1.0, 2.0))
        if not np.allclose(two, 4.0 * one, rtol=1e-9, atol=0.0):
            raise InputError("law", self.law, "a law whose traction grows with the square of the voltage")

    def pressure(self, voltage: Values) -> Values:
        """Attraction in MPa of touching skin."""
        return self.law.traction(self.gap, voltage, self.layers)

    def attraction(self, normal_force: Values, voltage: Values) -> Values:
        """F_e in N of touching skin, equations (14) and (15)."""
        return to_python(self.area(normal_force) * np.asarray(self.pressure(voltage)))

    def tangential_force(self, normal_force: Values, voltage: Values) -> Values:
        """F_t = mu_hd (F_n + F_e) in N in full slip, equations (1), (13), (16a), (16b)."""
        return to_python(self.friction * np.asarray(normal_force + self.attraction(normal_force, voltage)))

    def peak(self, voltage: Values) -> Values:
        """Peak (V) of the alternating voltage whose effective value is `voltage` (V)."""
        return to_python(self.crest * np.asarray(voltage))

    def voltage_for_attraction(self, attraction: Values, normal_force: Values) -> Values:
        """U in V that attracts with `attraction` N at `normal_force` N, equation (17)."""
        wanted = at_least("attraction", attraction, 0.0, "a force in N, not negative")
        force = above("normal_force", normal_force, 0.0, POSITIVE_FORCE)
        per_square_volt = self.pressure(1.0) * self.area(force)
        return to_python(np.sqrt(np.asarray(wanted) / per_square_volt))

    def voltage_for_friction(self, friction: Values, normal_force: Values = 1.0) -> Values:
        """U in V that makes the display feel like `friction`, equations (19), (20a), (20b).

        0 where the surface is slipperier than the display. `normal_force` in N matters only if m
        differs from 1.
        """
        wanted = required_attraction(friction, self.friction, normal_force)
        return self.voltage_for_attraction(wanted, normal_force)


@dataclass(frozen=True)
class PowerFit:
    """``y = k x^m`` fitted to points, with the standard errors of both (infinite with only two points)."""

    k: float
    m: float
    k_error: float
    m_error: float


def fit_power(x: Values, y: Values, *, relative: bool = True) -> PowerFit:
    """Least-squares fit of ``y = k x^m`` to at least two points.

    `relative` (the default) minimises the errors of ln y, which needs y > 0; otherwise those of y itself.
    Area laws (15) are ``fit_power(normal_force, area)``; in (11), alpha is k and beta is -m. Raises
    InputError for other than two equally long lists, x <= 0, or fewer than two different x.

    >>> fit = fit_power([0.1, 0.5, 1.0], [63.0 * 0.1**0.68, 63.0 * 0.5**0.68, 63.0])
    >>> round(fit.k, 9), round(fit.m, 9)
    (63.0, 0.68)
    """
    from scipy.optimize import OptimizeWarning, curve_fit

    x = np.asarray(above("x", x, 0.0, "values above zero"))
    y = np.asarray(finite("y", y, "finite values"))
    if x.ndim != 1 or x.shape != y.shape or np.unique(x).size < 2:
        allowed = "two lists of equal length, two different x"
        raise InputError("x, y", f"shapes {x.shape} and {y.shape}", allowed)
    if relative:
        above("y", y, 0.0, "values above zero for a fit of relative errors")
    usable = y > 0
    enough = np.unique(x[usable]).size >= 2
    m, log_k = np.polyfit(np.log(x[usable]), np.log(y[usable]), 1) if enough else (1.0, 0.0)
    k = float(np.exp(log_k)) if enough else float(np.mean(y))

    def law(at: Floats, share: float, power: float) -> Floats:
        return np.log(share * k) + power * np.log(at) if relative else share * k * at**power

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", OptimizeWarning)  # errors without degrees of freedom are infinite
        wanted = np.log(y) if relative else y
        found, spread = curve_fit(law, x, wanted, (1.0, m), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    errors = np.sqrt(np.diag(spread))
    return PowerFit(float(k * found[0]), float(found[1]), abs(k) * float(errors[0]), float(errors[1]))


def fit_area_to_friction(
    normal_force: Values, tangential_force: Values, voltage: float, display: Encoding
) -> PowerFit:
    """Area law that explains friction measured with `voltage` on: (16a), (16b) fitted for k and m.

    `display` gives law, layers, rough gap and friction coefficient (its own area law is not used). Least
    squares in the tangential force, in N; k in mm^2/N^m. The two laws give the same m, and k in
    the inverse ratio of their contact pressures.
    """
    above("voltage", voltage, 0.0, "a voltage in V above zero")
    excess = np.asarray(tangential_force) / display.friction - np.asarray(normal_force)
    pressure = display.pressure(voltage)
    return fit_power(normal_force, excess / pressure, relative=False)
