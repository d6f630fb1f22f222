r"""Impedance of a finger about a loaded state: force over displacement of the bone at given frequencies.

The state is the last one of a scene whose tissue is at rest in every step. Small motions
:math:`u\,e^{i\omega t}` about it obey

.. math:: \Bigl[K + \sum_i \frac{i\omega\tau_i}{1 + i\omega\tau_i} K_i + i\omega C - \omega^2 M
          - K_{el} - K_c\Bigr] u = f ,

with the tangent K of tissue at rest, the tangents :math:`K_i` of its Maxwell branches to fast changes, C of
its Kelvin-Voigt viscosity, its mass M, and the stiffness of attraction :math:`K_{el}` and of contact forces
:math:`K_c`. Nodes that stick do not move, those that slip move along the surface: with their displacement s
along the tangent t their contact force changes by

.. math:: d\lambda = d\lambda_n\,(n + b'e) + \bigl[\phi'(\lambda_t n - \lambda_n t)
          + b_\mu\mu'\,e\bigr]dx - b_v\,(e\cdot i\omega s)\,e - \frac{b}{v}\,i\omega s_\perp ,
          \qquad \phi' = \frac{h''}{1 + h'^2},

with the bound :math:`b(\lambda_n, \mu, v)` of their friction, the direction e of their shear force, their
speed v, and, in space, the component :math:`s_\perp` of s across e. The unknown :math:`d\lambda_n` is
eliminated node by node, and one sparse system is solved for each frequency. Open nodes are free. A slipping
finger slides on: the motion is smaller than its sliding distance in a period.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints, blas_limits
from evfem.common.checks import choice
from evfem.common.storage import write_text
from evfem.common.tables import csv_text, numbers
from evfem.contact.condensed import COMPONENTS
from evfem.contact.signorini import FORWARD, STICK, sizes
from evfem.electrostatics.timesignals import ChargeControl, OpenCircuit
from evfem.errors import InputError, describe_value
from evfem.newton.state import State
from evfem.response.parameters import scene_of
from evfem.scene.scene import Scene
from evfem.simulation.model import Model
from evfem.simulation.result import Result
from evfem.simulation.run import Run
from evfem.surface.friction import SlipMemory
from evfem.tissue.dynamics import Dynamics, make_dynamics, mass_matrices

AXES = ("normal", "tangential")
#: steps of differences of a law that drops imaginary parts: in N/mm and mm
FORCE_STEP, LENGTH_STEP = 1e-7, 1e-6


@dataclass(frozen=True, eq=False)
class Impedance:
    """Stiffness of a finger versus frequency, arrays (n,).

    `frequency` in Hz; `stiffness`, complex, amplitude of the applied force over that of the bone's
    displacement, in `unit`: N/mm, in the plane per mm of depth. Its imaginary part is positive where the
    force is ahead of the displacement, as under losses.
    """

    frequency: Floats
    stiffness: Any
    axis: str
    unit: str

    @property
    def impedance(self) -> Any:
        """Force over velocity (n,), complex: N s/mm, in the plane per mm of depth."""
        return self.stiffness / (2.0j * np.pi * self.frequency)

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write the table, a row for each frequency; whole or not at all."""
        names = ("frequency (Hz)", f"stiffness real ({self.unit})", f"stiffness imaginary ({self.unit})")
        columns = (self.frequency, self.stiffness.real, self.stiffness.imag)
        write_text(Path(path), csv_text([names, *np.transpose(columns).tolist()]))

    def __repr__(self) -> str:
        """Axis, and stiffness at the first and the last frequency."""
        told = [
            f"{abs(self.stiffness[i]):.4g} {self.unit} at {np.degrees(np.angle(self.stiffness[i])):.3g} "
            f"degrees at {self.frequency[i]:g} Hz"
            for i in dict.fromkeys((0, len(self.frequency) - 1))
        ]
        return f"Impedance, {self.axis}: " + ", ".join(told)


def impedance(
    scene: Scene | Result | str | PathLike[str], frequencies: Any, axis: str = "normal"
) -> Impedance:
    """Stiffness and impedance of a finger about the state at the end of a scene, relaxed.

    Parameters
    ----------
    scene
        A `Scene`, the path of a scene file, or a result, whose scene is run again. Its motions
        are followed with tissue at rest in every
        step; viscosity, branches and densities count in the impedance, whatever the scene's `dynamics`.
    frequencies
        In Hz, larger than 0.
    axis
        normal: force and displacement into the surface; tangential: along the last slide, +x without one.
        The bone does not move otherwise, and a hand takes no part.

    Returns
    -------
    Impedance
        Arrays over the frequencies, in the plane per mm of depth.

    Raises
    ------
    InputError
        Another axis or frequency; a result of a loop, or from a file that does not hold its
        scene; an elastic surface; an attraction whose charge is given or takes time.
    NotConverged
        A step of the scene has no solution.

    Examples
    --------
    >>> import evfem as ev
    >>> finger = ev.FingerPad(ridges=False, resolution="coarse", relaxation=((0.8, 0.004), (0.5, 0.07)))
    >>> scene = ev.Scene(finger, ev.Flat(friction=1.0), motion=ev.Press(indentation=0.5, steps=2))
    >>> found = ev.impedance(scene, [0.01, 1e4], axis="tangential")
    >>> bool(abs(found.stiffness[1]) > abs(found.stiffness[0]))
    True
    """
    choice("axis", axis, AXES)
    frequency = checked_frequencies(frequencies)
    _check(scene := scene_of(scene))
    state, model = _end(scene)
    system = linearised(model, state)
    unit_vector = _unit_vector(scene, axis, model.mesh.dim)
    found = np.array([system.stiffness(2.0 * np.pi * each, unit_vector) for each in frequency])
    return Impedance(frequency, found, axis, "N/mm" if model.mesh.dim == 3 else "N/mm per mm")


def checked_frequencies(frequencies: Any) -> Floats:
    """One or several frequencies as an array (n,) in Hz; InputError for others."""
    allowed = "one or several frequencies in Hz, larger than 0"
    found = numbers("frequencies", [frequencies] if np.isscalar(frequencies) else frequencies, allowed)
    if not found.size or found.min() <= 0.0:
        raise InputError("frequencies", describe_value(frequencies), allowed)
    return found


def _check(scene: Scene) -> None:
    """Raise `InputError` for scenes without a stiffness of small motions."""
    if isinstance(scene.friction_law, SlipMemory):
        allowed = "a law of friction without memory; steps in time show what a memory does"
        raise InputError("scene", "a scene with friction that slip renews", allowed)
    if scene.ground.elastic is not None:
        raise InputError("scene", "a scene with an elastic surface", "a rigid surface")
    resolved = scene.drive is not None and scene.drive.resolved
    if resolved or isinstance(scene.electrics.voltage, (ChargeControl, OpenCircuit)):
        given = "a drive that is resolved in time" if resolved else "a prescribed charge"
        allowed = 'a scene with a prescribed voltage, and drive = "mean" where it alternates'
        raise InputError("scene", given, allowed)


def _end(scene: Scene) -> tuple[State, Model]:
    """State at the end of the scene, its tissue at rest in every step, and the model of the scene."""
    at_rest = replace(scene, solver=replace(scene.solver, dynamics="quasistatic"))
    with blas_limits():
        with warnings.catch_warnings():  # branches count below
            warnings.filterwarnings("ignore", "tissue relaxes with", UserWarning)
            run = Run(at_rest, None)
        for request in run.requests():
            run.advance(request)
    return run.state, run.model


def _unit_vector(scene: Scene, axis: str, dim: int) -> Floats:
    """Unit vector (dim,) along which the bone moves."""
    if axis == "normal":
        return np.eye(dim)[1]
    angles = [course.angle for course in scene.courses if course.distance]
    angle = np.radians(angles[-1] if angles else 0.0)
    return np.array([np.cos(angle), 0.0, np.sin(angle)])[:dim]


@dataclass(frozen=True, eq=False)
class LinearSystem:
    """Sparse matrices of a finger about a state, contact eliminated; the bone's `dim` unknowns are the last:
    at rest, of damping, mass, and of the branches by their relaxation time in s.
    """

    still: Any
    damping: Any
    mass: Any
    branches: dict[float, Any]

    def stiffness(self, omega: float, unit_vector: Floats) -> complex:
        """Force along `unit_vector` (dim,) per displacement of the bone along it, at omega in rad/s."""
        from scipy.sparse.linalg import splu

        A = self.still + 1j * omega * self.damping - omega**2 * self.mass
        for time, matrix in self.branches.items():
            A = A + (1j * omega * time / (1.0 + 1j * omega * time)) * matrix
        A = A.tocsc()
        free = A.shape[0] - unit_vector.size
        force = A[free:, free:] @ unit_vector
        if free:  # a single row of cells between bone and nodes that stick has none
            lu = splu(A[:free, :free], permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
            force = force - A[free:, :free] @ lu.solve(A[:free, free:] @ unit_vector)
        return complex(unit_vector @ force)


def linearised(model: Model, state: State) -> LinearSystem:
    """The finger of a model about an equilibrium `state` of tissue at rest."""
    body, finger = model.body, model.scene.finger
    pattern, contact = body.pattern, Contact(model, state)
    terms = make_dynamics(body.space, finger.materials, finger, "inertial")
    assert terms is not None

    def reduced(matrix: Any) -> Any:
        return contact.onto @ matrix @ contact.along

    def summed(data: Floats) -> Any:
        return reduced(pattern.full(pattern.finish(data)))

    damping = pattern.zeros()
    if terms.viscosity is not None:
        viscous = Dynamics(body.space, terms.viscosity, None)
        viscous.begin_from(state.u, np.zeros_like(state.u), 1.0)
        viscous.add_tangent(state.u, pattern, damping)
    branches = {} if terms.branches is None else terms.branches.at_once(state.u, pattern)
    return LinearSystem(
        reduced(pattern.full(body.tangent(state.u)) + contact.stiffness - contact.attraction),
        summed(damping) + reduced(contact.damping),
        summed(pattern.componentwise(mass_matrices(body.space) * _density(model)[:, None, None])),
        {time: summed(data) for time, data in branches.items()},
    )


def _density(model: Model) -> Floats:
    """Density (E,) in t/mm3 of every cell."""
    found = np.zeros(len(model.mesh.cells))
    for name, law in model.scene.finger.materials.items():
        found[model.mesh.cells_of(name)] = getattr(law, "density", 1e-9)
    return found


class Contact:
    """Contact and attraction about a state: sparse matrices on the n reduced unknowns.

    `stiffness` and `damping` (n, n) of the contact forces, `attraction` (n, n); `along` (n, m) has the
    motions that contact leaves, `onto` (m, n) takes forces to what these motions balance.
    """

    def __init__(self, model: Model, state: State) -> None:
        self.model, self.state = model, state
        self.interface, self.pad = model.equilibrium.interface, model.pad
        self.nodes: Ints = np.flatnonzero(state.touching & self.pad.free)
        self.unknowns: Ints = model.body.unknowns[self.pad.nodes]
        self.size, self.dim = model.body.size, model.mesh.dim
        old = self._before()
        none = np.zeros(state.status.size)
        self.known = self.interface.candidates(old, state, self.nodes, none, none)
        # rows n, t_1[, t_2] in the order x, y[, z]
        self.axes = self.known.surface.axes[:, :, COMPONENTS[: self.dim]]
        self.slips = self.known.status >= FORWARD
        self._friction(old)
        self.felt = self._felt()
        self.attraction = self._attraction()
        self.stiffness, self.damping = self._springs() + self._turning(), self._dashpots()
        self.along, self.onto = self._motions()

    def _before(self) -> State:
        """The state that the last part began with, as far as friction asks for it."""
        state = self.state
        kept = state.memory.get("contact_time")
        aged = {} if kept is None else {"contact_time": kept - self.interface.duration}
        return replace(state, u=state.u - state.last_increment).remembering(aged)

    def _friction(self, old: State) -> None:
        """The largest shear force of slipping nodes and its derivatives, (k,), 0 of others."""
        c, state, interface = self.nodes, self.state, self.interface
        place = interface.on_display(state)[c]
        mu = interface.friction(old, c, place)
        unit_vector = np.where(self.slips, sizes(interface.slip(old, state)[c]), 0.0)
        speed = unit_vector / interface.duration if interface.duration > 0.0 else 0.0 * unit_vector
        found = interface.bounds.slopes(interface, old, state, c, mu, unit_vector)
        each = (found.bound, found.by_normal, found.by_mu, found.by_speed, found.by_length, speed)
        of_slips = (np.where(self.slips, value, 0.0) for value in each)
        self.bound, self.by_normal, by_mu, self.by_speed, self.by_length, self.speed = of_slips
        self.by_place = by_mu[:, None] * interface.surface.friction_gradient(place)

    def _felt(self) -> Floats:
        """What the body feels of touching nodes that are pressed with 1 more, (k, dim) along n and t."""
        felt = np.zeros((self.nodes.size, self.dim))
        felt[:, 0] = 1.0
        felt[:, 1:] = self.by_normal[:, None] * self.known.shear_direction
        attraction, state = self.model.attraction, self.state
        if not attraction.acts(state.voltage):
            return felt
        pad = self.interface.pad_state(state, state.touching)
        gain, surface = attraction.gain_on_pressing(pad)[self.nodes], self.known.surface
        if attraction.direction == "normal":
            felt[:, 0] -= gain * surface.stretch
        else:
            felt -= gain[:, None] * surface.axes[:, :, 0]
        return felt

    def _attraction(self) -> Any:
        attraction: Any = self.model.attraction
        state, u = self.state, self.unknowns.ravel()
        if not attraction.acts(state.voltage):
            return self._matrix(np.zeros(0), u[:0], u[:0])
        found = attraction.full_stiffness(self.interface.pad_state(state, state.touching))
        return self._matrix(found.value, u[found.row], u[found.column])

    def _matrix(self, values: Floats, rows: Ints, columns: Ints) -> Any:
        """Values at these places of a matrix on the reduced unknowns."""
        import scipy.sparse as sparse

        return sparse.csr_matrix((values.ravel(), (rows.ravel(), columns.ravel())), (self.size, self.size))

    def _blocks(self, blocks: Floats) -> Any:
        """Blocks (k, dim, dim) of the touching nodes, in x, y[, z], on the reduced unknowns."""
        u = self.unknowns[self.nodes]
        return self._matrix(blocks, np.repeat(u, self.dim, axis=1), np.tile(u, (1, self.dim)))

    @property
    def _shear(self) -> Floats:
        """Directions e (k, dim) of the shear forces of slipping nodes, in x, y[, z]."""
        return np.einsum("ka,kai->ki", self.known.shear_direction, self.axes[:, 1:])

    def _springs(self) -> Any:
        """An interface that yields: springs along the normal, of nodes that stick along the tangent too."""
        give = self.known.interface_compliance
        yields = give[:, 0] > 0.0
        normal, shear = (np.where(yields, 1.0 / np.where(yields, each, 1.0), 0.0) for each in give.T[:2])
        shear = np.where(self.known.status == STICK, shear, 0.0)
        pressed = np.einsum("ka,kai->ki", self.felt, self.axes)
        blocks = normal[:, None, None] * pressed[:, :, None] * self.axes[:, :1]
        for t in self.axes[:, 1:].swapaxes(0, 1):
            blocks = blocks + shear[:, None, None] * t[:, :, None] * t[:, None]
        return self._blocks(blocks)

    def _turning(self) -> Any:
        """Contact forces that turn with the profile, and friction that changes with place and length."""
        turned = self.known.surface.turned(self.known.force)[:, COMPONENTS[: self.dim]]
        blocks = np.zeros_like(self.axes)
        blocks[:, :, ::2] = -turned - self._shear[:, :, None] * self.by_place[:, None]
        of, moved, value = self.pad.tributary_gradient(self.interface.positions(self.state.u))
        among = np.zeros((self.state.status.size, self.dim))
        among[self.nodes] = self.by_length[:, None] * self._shear
        columns = np.repeat(self.unknowns.ravel()[moved], self.dim)
        return self._blocks(blocks) + self._matrix(-among[of] * value[:, None], self.unknowns[of], columns)

    def _dashpots(self) -> Any:
        """Friction that depends on the speed, and in space on the direction of a slip."""
        e, moves = self._shear, self.speed > 0.0
        along = e[:, :, None] * e[:, None]
        blocks = self.by_speed[:, None, None] * along
        if self.dim == 3:
            across = np.einsum("kai,kaj->kij", self.axes[:, 1:], self.axes[:, 1:]) - along
            turning = np.where(moves, self.bound / np.where(moves, self.speed, 1.0), 0.0)
            blocks += turning[:, None, None] * across
        return self._blocks(blocks)

    def _motions(self) -> tuple[Any, Any]:
        """`along` and `onto`: without unknowns that stick, slipping nodes along their tangents."""
        import scipy.sparse as sparse

        exact = self.known.interface_compliance[:, 0] == 0.0
        held, slips = self.unknowns[self.nodes[exact]].ravel(), exact & self.slips
        kept = np.setdiff1d(np.arange(self.size), held)
        tangents, u = self.axes[slips, 1:], self.unknowns[self.nodes[slips]]
        ratio = self.felt[slips, 1:] / self.felt[slips, :1]
        balanced = tangents - ratio[:, :, None] * self.axes[slips, :1]
        count = tangents.shape[0] * (self.dim - 1)
        rows = np.repeat(u, self.dim - 1, axis=0).ravel()
        columns = np.repeat(np.arange(count), self.dim)

        def matrix(vectors: Floats) -> Any:
            values = np.append(vectors.ravel(), np.ones(kept.size))
            places = np.append(rows, kept), np.append(columns, count + np.arange(kept.size))
            return sparse.csr_matrix((values, places), (self.size, count + kept.size))

        return matrix(tangents), matrix(balanced).T.tocsr()
