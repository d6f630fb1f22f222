"""User-defined components: any object with the documented method is a law, material, surface or observer.

There is no base class and no registration; the object is passed wherever one of the package is. Methods
called optional may be missing. Arrays have any trailing shape; a method that takes complex numbers gets exact
derivatives (`evfem.tensor.complex_step`), any other one finite differences.

=====================  ========================================  =======================================
component              passed to                                 needs
=====================  ========================================  =======================================
electrostatic law      ``Scene(law=...)``                        `ForceLaw`
rough faces            ``Scene(roughness_gap=...)``              `RoughnessLaw`
adhesion               ``Scene(adhesion=...)``                   `AdhesionLaw`
material               ``FingerPad(materials={region: ...})``    `StressLaw`, `EnergyLaw` or a `WeakForm`
surface                ``Scene(surface=...)``                    `Surface`
elastic surface        ``Flat(elastic=...)``, any surface        `Elastic`
friction               ``Scene(friction_law=...)``               `FrictionLaw`
voltage over time      ``Scene(voltage=...)``                    `TimeSignal`
weak form              ``Scene.with_term(form(...), on=...)``    `WeakForm`
observer               ``simulate(observers=[...])``             any of `Starting`, `Stepping`, `Finishing`
=====================  ========================================  =======================================
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol, runtime_checkable


@runtime_checkable
class ForceLaw(Protocol):
    """An electrostatic law.

    Optional methods of the same arguments: `traction_derivative` (MPa/mm), and `potential` (N/mm),
    whose derivative by the gap is the traction, needed for `direction="normal"`.
    """

    def traction(self, gap: Any, voltage: Any, layers: Any) -> Any:
        """Attraction in MPa, positive when it attracts, at gaps in mm (positive when open) and voltages in V.

        `layers.reduced` is the sum of thickness / permittivity of the solid layers,
        `layers.thickness` that of their thicknesses, in mm. Complex-safe, or it is differenced.
        """


@runtime_checkable
class AdhesionLaw(Protocol):
    """Adhesion without a voltage. Optional: `traction_derivative` (MPa/mm) of the same argument."""

    def traction(self, gap: Any) -> Any:
        """Attraction in MPa, never negative or growing, at gaps in mm. Complex-safe, or differenced."""

    def potential(self, gap: Any) -> Any:
        """Potential in N/mm, whose derivative by the gap is the traction, 0 far away."""


@runtime_checkable
class RoughnessLaw(Protocol):
    """Separation of rough faces in contact.

    Optional: `separation_derivative` (mm/MPa) of the same argument.
    """

    def separation(self, pressure: Any) -> Any:
        """Mean separation in mm at contact pressures in MPa (0 for an open node). It falls with the pressure
        and is finite at zero pressure. Complex-safe, or it is differenced.
        """


@runtime_checkable
class StressLaw(Protocol):
    """A material by its stress. Optional: `psi` too, `viscosity` in s, `density` in t/mm3,
    rows `relaxation`.
    """

    def P(self, F: Any) -> Any:
        """First Piola-Kirchhoff stress (3, 3, ...) in MPa at the deformation gradient F (3, 3, ...)."""


@runtime_checkable
class EnergyLaw(Protocol):
    """A material by its energy alone; stress and tangent are derived, so `psi` must be complex-safe."""

    def psi(self, F: Any) -> Any:
        """Energy per reference volume (...) in MPa at the deformation gradient F (3, 3, ...)."""


class WeakForm(Protocol):
    """What `evfem.form` marks as a weak form: a function, or any object that can be called like one."""

    def __call__(self, u: Any, v: Any, w: Any) -> Any:
        """Integrand (...) of a residual, linear in `v`: displacement (mm) and test function with gradients
        (`evfem.tensor.grad`), and the position: `w.x` (2, ...) in mm, `w.n` the outward normal on a
        boundary. Over a region also `u.theta` and `v.theta`, the element's volume change, and `w.law`, its
        material.
        """


Material = StressLaw | EnergyLaw | WeakForm


@runtime_checkable
class Surface(Protocol):
    """A rigid surface by its height.

    Optional attributes: `friction`, a number or a table [[x, coefficient], ...] (without it 0);
    `y`, the height (mm) at which the profile lies (without it or None: first touch); `insulator`,
    a `Layer`; `elastic`, an `Elastic`; `angle` (degrees), the direction of x on the display below a finger
    in three dimensions. Optional methods of x: `slope` and `curvature`, which are derived otherwise;
    `friction_coefficient`, instead of `friction`.
    """

    def height(self, x: Any) -> Any:
        """Height (mm) of the profile at x (mm, any shape)."""


@runtime_checkable
class Elastic(Protocol):
    """Compliance of a surface for forces on strips of it, linear and quasi-static.

    Optional: `compliance_slope(x, lengths)` (1, 2n, 2n), in space (2, 3n, 3n), its derivatives by position
    of what is displaced; otherwise it is differenced.
    """

    def compliance(self, x: Any, lengths: Any) -> Any:
        """Mean displacements of n strips by forces on them, (2n, 2n) in mm per N/mm, symmetric and positive.

        `x` and `lengths` (n,) are their middles and lengths in mm; first the n displacements into the
        surface, then the n along +x; columns in the same order, forces on the surface into it and along +x.
        In space squares: `x` (n, 2) has their x and z, `lengths` their areas in mm2; (3n, 3n), last along +z.
        """


@runtime_checkable
class CompleteSurface(Surface, Protocol):
    """Everything that contact asks of a surface; `evfem.surface.usersurface.completed` gives it to any
    `Surface`.
    """

    @property
    def y(self) -> float | None:
        """Height of the profile's zero (mm), None for first touch at the start."""

    @property
    def insulator(self) -> Any:
        """Layer over the electrode, or None."""

    @property
    def elastic(self) -> Any:
        """The compliance of the surface; None if rigid."""

    @property
    def is_flat(self) -> bool:
        """Whether height, slope and curvature are zero everywhere."""

    @property
    def has_friction(self) -> bool:
        """Whether the friction coefficient is positive anywhere."""

    @property
    def crosses(self) -> bool:
        """Whether it varies otherwise than along x, so that a finger in the plane cannot have it."""

    @property
    def friction_jumps(self) -> Any:
        """Jumps of the friction coefficient, (J, 3): position in mm, coefficient before and from there on."""

    def slope(self, x: Any) -> Any:
        """Derivative of the height."""

    def curvature(self, x: Any) -> Any:
        """Second derivative of the height (1/mm)."""

    def friction_coefficient(self, x: Any) -> Any:
        """Friction coefficient, real."""

    def friction_slope(self, x: Any) -> Any:
        """Derivative of the friction coefficient (1/mm), jumps left out."""

    def relief(self, position: Any) -> Any:
        """Heights (...) in mm, slopes (..., d) and curvatures (..., d, d) in 1/mm at positions (..., d): x,
        in space x and z.
        """

    def friction_at(self, position: Any) -> Any:
        """Friction coefficients (...) at positions (..., d)."""

    def friction_gradient(self, position: Any) -> Any:
        """Their derivatives (..., d), jumps left out."""

    def friction_steps(self, short: float) -> Any:
        """Their jumps, and ramps shorter than `short` (mm), as `evfem.surface.ways.Steps`."""

    def shifted(self, y: float) -> Any:
        """The same surface at the height `y` (mm)."""


@runtime_checkable
class FrictionLaw(Protocol):
    """How much shear a touching node carries before it slips, and while it does.

    Optional: `timed` True for a law that depends on speed or age, so that slides need a speed.
    """

    def bound(self, pressure: Any, mu: Any, speed: Any, age: Any) -> Any:
        """Largest shear traction in MPa, not negative, at contact pressures in MPa, coefficients of
        the surface at the node's position, speeds of slip in mm/s (0 for a node that sticks, or where
        no time passes) and times since it touched in s. Complex-safe, or it is differenced.
        """


@runtime_checkable
class TimeSignal(Protocol):
    """A voltage over time."""

    @property
    def largest(self) -> float:
        """Largest magnitude (V)."""

    @property
    def highest_frequency(self) -> float:
        """Frequency (Hz) up to which the voltage has content, 0 for a constant; the steps must resolve it."""

    def __call__(self, time: Any) -> Any:
        """Voltage (V) at times in s (any shape), 0 being the start of the run."""


class Starting(Protocol):
    """An observer that is told when a run starts."""

    def started(self, mesh: Any, scene: Any, total_steps: int, /) -> None:
        """The mesh is made, no step is solved yet."""


class Stepping(Protocol):
    """An observer that is told of every converged step, and may end the run by raising `evfem.StopRun`."""

    def step(self, row: Mapping[str, Any], frame: Any, checkpoint: Callable[[], dict[str, Any]], /) -> None:
        """`row` of the history, `frame` its fields or None, `checkpoint()` gives arrays to resume from."""


class Finishing(Protocol):
    """An observer that is told when a run has reached its end, or was stopped."""

    def finished(self, result: Any, /) -> None:
        """The result is complete up to the last step."""


Observer = Starting | Stepping | Finishing
