"""What is simulated: a finger, a surface, a voltage and motions; frozen, validated, nothing computed.

Units mm, N, MPa, V, s; forces of the plane model are per mm of depth (N/mm). The bone translates
by (`position`, -(`indentation` + g0)), g0 being the smallest vertical gap of the undeformed
outline at the start.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import InitVar, dataclass, field, replace
from functools import cached_property
from itertools import accumulate
from typing import Annotated, Any, Protocol, cast, runtime_checkable

from evfem.circuit.signals import FollowForce, VoltageProfile
from evfem.common.checks import (
    RENAMED_KEYS,
    Within,
    check_fields,
    number,
    one_of,
    real,
    set_frozen,
    yes_or_no,
)
from evfem.common.digest import digest
from evfem.common.rooms import BodyTerm, Foundation, Room, unchangeable
from evfem.common.views import called, changed, screen, short, table
from evfem.electrostatics.breakdown import MODES
from evfem.electrostatics.drive import Drive
from evfem.electrostatics.laws import FORCE_LAWS
from evfem.electrostatics.roughness import NONE, RoughnessGap, distribution_of
from evfem.electrostatics.timesignals import ChargeControl, OpenCircuit
from evfem.errors import ABSENT, InputError, Mistakes, describe_value
from evfem.protocols import AdhesionLaw, CompleteSurface, ForceLaw, FrictionLaw, Surface, TimeSignal
from evfem.scene.electrics import Electrics, check_drive, without_field
from evfem.scene.motion import MOTIONS, VOLTAGE, Course, Motion, Press, Slide
from evfem.scene.options import Output, Solver
from evfem.scene.terms import Boundary, Region, Term
from evfem.surface.adhesion import ADHESION, adhesion_of
from evfem.surface.friction import Coulomb
from evfem.surface.usersurface import completed
from evfem.terms.hand import Hand
from evfem.terms.traction import PadTraction
from evfem.tissue.forms import Form

DIRECTIONS = ("vertical", "normal")
#: the attraction column by column, by Poisson's problem, or whichever the bounds ask for
FIELDS = ("local", "full", "auto")
#: names of the tractions of a voltage and of adhesion
TAKEN = ("electrostatic", "adhesive")
#: voltages that are no number
SIGNALS = (VoltageProfile, FollowForce, TimeSignal)
DEPTH = number("a depth in mm, larger than 0, up to 200", Within(0.0, 200.0, above=True), "mm")
# keys that a scene file has in [electrostatics]
AirLayer = Annotated[bool, yes_or_no(), "false: only touching nodes carry force, eq. (10)"]
Direction = Annotated[str, one_of(*DIRECTIONS), "normal: Maxwell stress on the deformed outline"]
FieldChoice = Annotated[
    str, one_of(*FIELDS), "full: Poisson's problem, not column by column; auto: where it matters"
]
Grounded = Annotated[bool, yes_or_no(), "false: the finger has no charge; with field full"]
Breakdown = Annotated[
    str, one_of(*MODES), "of air: warn of it; limit: the field of such gaps is held at it; off: do not look"
]
#: a table of its own in a file, not a key of [electrostatics]
Adhesion = Annotated[
    AdhesionLaw | None, {"allowed": ADHESION, "check": lambda key, law: adhesion_of("adhesion", law)}
]


def monolithic(key: str, value: object) -> str:
    """The coupling of old files, which is always that; InputError for another."""
    if not isinstance(value, str) or value != "monolithic":
        raise InputError(key, describe_value(value), RENAMED_KEYS["electrostatics.coupling"])
    return value


Coupling = Annotated[
    str, {"names": ("monolithic",), "check": monolithic}, "without effect; kept for files of 0.3"
]


@runtime_checkable
class Finger(Protocol):
    """What a scene needs of a finger: `FingerPad` and `MeshedFinger` have it."""

    @property
    def materials(self) -> Mapping[str, Any]:
        """Material law of each region."""

    @property
    def viscosity(self) -> float:
        """Relaxation time of Kelvin-Voigt tissue (s)."""

    @property
    def electrical(self) -> Any:
        """Thickness (mm, or None for the mesh's own) and permittivity of the stratum corneum."""

    def mesh(self, order: int) -> Any:
        """The mesh with elements of that order."""


class Motions:
    """What `Scene.motion` is: given one motion or several, it is a tuple of them."""

    def __get__(self, scene: Scene | None, owner: type[Scene]) -> tuple[Motion, ...]:
        return () if scene is None else vars(scene)["motion"]

    def __set__(self, scene: Scene, motions: Motion | Sequence[Motion]) -> None:
        one = isinstance(motions, (str, type)) or not isinstance(motions, Iterable)
        vars(scene)["motion"] = (motions,) if one else tuple(cast(Iterable[Motion], motions))


@dataclass(frozen=True)
class Scene:
    """A finger, a surface, an electrostatic law with a voltage, and what happens.

    `voltage` in V: a number, acting in full from the first step, a `VoltageProfile` over the position of the
    bone, or a signal over time (`Sine`, `Carrier`, `Sampled`). A `drive` makes it alternate, or leak. `law`
    None and `voltage` 0: no electrostatics. Only where the field is full may the finger be not `grounded`:
    without a charge, above electrodes of different voltages. `friction_law` says what the surface's
    coefficient means (`Coulomb`, ... or one's own), `adhesion` what attracts without a voltage (`Dugdale`,
    `Capillary`, or one's own). `rooms` are capabilities of one's own (`evfem.terms`). A `hand` is between
    drive and bone: motions then say where the drive goes. `depth` (mm) of a plane finger adds `Result.total`,
    in N and mm2. `motion` may be empty where steps are taken at will (`evfem.simulation.loop`). Raises
    InputError for anything that does not fit together.
    """

    finger: Finger
    surface: Surface
    law: ForceLaw | None = None
    voltage: float | VoltageProfile | FollowForce | TimeSignal = 0.0
    motion: Motions = Motions()
    air_layer: AirLayer = field(default=True, kw_only=True)
    direction: Direction = field(default="vertical", kw_only=True)
    coupling: InitVar[object] = field(default=None, kw_only=True)  # without effect
    drive: Drive | None = field(default=None, kw_only=True)
    roughness_gap: RoughnessGap = field(default=0.0, kw_only=True)
    adhesion: Adhesion = field(default=None, kw_only=True)
    breakdown: Breakdown = field(default="warn", kw_only=True)
    friction_law: FrictionLaw = field(default=Coulomb(), kw_only=True)
    hand: Hand | None = field(default=None, kw_only=True)
    solver: Solver = field(default=Solver(), kw_only=True)
    name: str = field(default="scene", kw_only=True, compare=False)
    forms: tuple[Term, ...] = field(default=(), kw_only=True)
    rooms: tuple[Room, ...] = field(default=(), kw_only=True)
    depth: float | None = field(default=None, kw_only=True)
    output: Output = field(default=Output(), kw_only=True)
    grounded: Grounded = field(default=True, kw_only=True)
    field: FieldChoice = field(
        default="local", kw_only=True
    )  # the last one: from here on `field` is its default

    def __post_init__(self, coupling: object) -> None:
        _check_parts(self)
        set_frozen(self, forms=tuple(self.forms), rooms=tuple(self.rooms))
        mistakes = Mistakes()
        with mistakes.of_a_part():
            monolithic("electrostatics.coupling", "monolithic" if coupling is None else coupling)
        checks = (
            _check_electrostatics,
            check_drive,
            _check_friction,
            _check_elastic,
            _check_hand,
            _check_motion,
            _check_speeds,
            _check_time,
        )
        for check in (*checks, _check_dynamics):
            with mistakes.of_a_part():
                check(self)
        mistakes.report()

    def __repr__(self) -> str:
        """Finger, surface and attraction; what happens; and what is not as usual."""
        pull = "no attraction" if self.law is None else f"{short(self.law)} at {_volts(self.voltage)}"
        lines = [f"Scene {self.name!r}: {short(self.finger)} on {short(self.surface)}, {pull}"]
        lines.append("  " + ", ".join(called(type(m).__name__, changed(m)) for m in self.motion[:6]))
        lines[-1] += f", ... ({len(self.motion)} motions)" if len(self.motion) > 6 else ""
        own = [f"{name}={short(value)}" for name, value in self._unusual().items()]
        return screen([*lines, *(["  " + ", ".join(own)] if own else [])])

    def _repr_html_(self) -> str:
        """For notebooks: the same as a small table."""
        rows = [("finger", short(self.finger)), ("surface", short(self.surface))]
        if self.law is not None:
            rows.append(("attraction", f"{short(self.law)} at {_volts(self.voltage)}"))
        rows += [(f"motion {i}", called(type(m).__name__, changed(m))) for i, m in enumerate(self.motion[:6])]
        rows += [(name, short(value)) for name, value in self._unusual().items()]
        return table(f"Scene {self.name}, {self.total_steps} steps", rows)

    def _unusual(self) -> dict[str, Any]:
        told = ("finger", "surface", "law", "voltage", "motion", "name")
        return {key: value for key, value in changed(self).items() if key not in told}

    @cached_property
    def ground(self) -> CompleteSurface:
        """The surface with all that contact asks of it, derived where it is the user's own."""
        return completed(self.surface)

    @cached_property
    def electrics(self) -> Electrics:
        """Voltage, layers and law of the attraction as a run has them."""
        return Electrics.of(self)

    @property
    def courses(self) -> tuple[Course, ...]:
        """The course of each motion."""
        return tuple(motion.course for motion in self.motion)

    @property
    def reach(self) -> tuple[float, float]:
        """Smallest and largest x (mm) of the bone where motions begin and end."""
        x = [0.0, *accumulate(course.travel[0] for course in self.courses)]
        return min(x), max(x)

    @property
    def has_friction(self) -> bool:
        """Whether anything may resist sliding."""
        return self.ground.has_friction or not isinstance(self.friction_law, Coulomb)

    @property
    def has_voltage(self) -> bool:
        """Whether there is a law for a voltage."""
        return self.law is not None

    @property
    def may_spark(self) -> bool:
        """Whether a voltage acts on air that may break down."""
        return self.electrics.acts and self.breakdown != "off"

    @property
    def is_pulled(self) -> bool:
        """Whether a voltage, adhesion or a traction of one's own may pull the finger down."""
        own = any(isinstance(room, PadTraction) for room in self.rooms)
        return self.has_voltage or self.adhesion is not None or own

    @property
    def total_steps(self) -> int:
        """Number of requested steps, which is the number of rows of the history."""
        return sum(motion.steps for motion in self.motion)

    @property
    def time_needed_by(self) -> tuple[str, ...]:
        """What of it resists by the speed, in words."""
        friction = self.friction_law
        found = (
            self.solver.timed and f"dynamics = {self.solver.dynamics}",
            getattr(self.hand, "timed", False) and "a hand that has a damping or a mass",
            getattr(friction, "timed", False) and type(friction).__name__,
        )
        return tuple(filter(None, found))

    def with_term(self, form: Form, on: Region | Boundary) -> Scene:
        """A copy of the scene with `form` added to the internal residual over the region or boundary `on`."""
        if not isinstance(form, Form):
            raise InputError("form", describe_value(form), "a function marked with @evfem.form")
        if not isinstance(on, (Region, Boundary)):
            raise InputError("on", describe_value(on), "evfem.Region(name) or evfem.Boundary(name)")
        return replace(self, forms=(*self.forms, Term(form, on)))

    def digest(self) -> str:
        """SHA-256 over everything in the scene but its name, equal in every process."""
        return digest(self)


#: what no field knows of a finger in space
IN_SPACE = "in space there is only one electrode that never ends, under a grounded finger"


def _volts(voltage: object) -> str:
    return f"{voltage:g} V" if isinstance(voltage, float) else short(voltage)


def _check_parts(scene: Scene) -> None:
    if not isinstance(scene.finger, Finger):
        raise InputError("finger", describe_value(scene.finger), "a FingerPad, a Fingertip or a MeshedFinger")
    real("finger.viscosity", scene.finger.viscosity, "a relaxation time in s, not negative", lambda t: t >= 0)
    completed(scene.surface)
    if not isinstance(scene.solver, Solver):
        raise InputError("solver", describe_value(scene.solver), "a Solver")
    if not isinstance(scene.output, Output):
        raise InputError("output", describe_value(scene.output), "an Output")
    if not isinstance(scene.drive, Drive | None):
        raise InputError("electrostatics.drive", describe_value(scene.drive), "a Drive, or None")
    if scene.depth is not None:
        set_frozen(scene, depth=DEPTH["check"]("depth", scene.depth))
    if not isinstance(scene.name, str) or not scene.name or any(c in scene.name for c in "/\\:\0\n"):
        raise InputError("name", describe_value(scene.name), "a name that can be part of a file name")
    if not all(isinstance(term, Term) for term in scene.forms):
        raise InputError("forms", describe_value(scene.forms), "terms as made by Scene.with_term")
    names = [room.name for room in scene.rooms if isinstance(room, PadTraction)]
    for i, room in enumerate(scene.rooms):
        if not isinstance(room, PadTraction | BodyTerm):
            allowed = "a PadTraction or a BodyTerm; a Foundation goes to elastic=, a hand to hand="
            raise InputError(f"rooms[{i}]", describe_value(room), allowed)
        if unchangeable(room):
            allowed = "a class that is not frozen: `begin` keeps in it what a step needs"
            raise InputError(f"rooms[{i}]", f"{type(room).__name__}, a frozen dataclass", allowed)
        if isinstance(room, PadTraction) and (names.count(room.name) > 1 or room.name in TAKEN):
            raise InputError(f"rooms[{i}].name", room.name, "a name that no other traction has")
    for i, motion in enumerate(scene.motion):
        if not isinstance(motion, Motion):
            raise InputError(f"motion[{i}]", describe_value(motion), f"one of {_names(MOTIONS)}")


def _check_electrostatics(scene: Scene) -> None:
    check_fields(scene, "electrostatics.")
    if not scene.is_pulled and scene.roughness_gap != 0.0:
        allowed = "only with a law of attraction, or adhesion: without one it changes nothing"
        raise InputError("electrostatics.roughness_gap", describe_value(scene.roughness_gap), allowed)
    if scene.law is None and (spread := distribution_of(scene.roughness_gap)) != NONE:
        allowed = "only with a law of attraction: adhesion keeps the mean gap"
        raise InputError("electrostatics.roughness_gap.distribution", spread, allowed)
    _check_field(scene)
    if not isinstance(scene.voltage, SIGNALS):
        allowed = f"{VOLTAGE['allowed']}, a VoltageProfile or a signal over time"
        voltage = real("electrostatics.voltage", scene.voltage, allowed, VOLTAGE["test"], "V")
        set_frozen(scene, voltage=voltage)
    if scene.law is None:
        if scene.voltage != 0.0:
            allowed = f"{_names(FORCE_LAWS, '()')} or a law of your own"
            raise InputError("electrostatics.law", "a voltage without a law", allowed)
    elif isinstance(scene.law, type) or not isinstance(scene.law, ForceLaw):
        allowed = f"{_names(FORCE_LAWS, '()')} or an object with a method traction(gap, voltage, layers)"
        raise InputError("electrostatics.law", describe_value(scene.law), allowed)
    elif scene.direction == "normal" and not callable(getattr(scene.law, "potential", None)):
        allowed = 'vertical, or a law that also has potential(gap, voltage, layers), for direction = "normal"'
        raise InputError("electrostatics.direction", "normal with a law without a potential", allowed)
    elif scene.ground.insulator is None:
        allowed = f"{type(scene.surface).__name__} with insulator=Layer(thickness in mm, eps_r), or no law"
        raise InputError("surface.insulator", "a law and no insulator", allowed)


def _names(classes: Mapping[str, type], made: str = "") -> str:
    return ", ".join(f"{cls.__name__}{made}" for cls in classes.values())


def _check_hand(scene: Scene) -> None:
    hand = scene.hand
    if hand is None:
        return
    if not (isinstance(hand, Hand) or (isinstance(hand, Room) and hasattr(hand, "control"))):
        raise InputError("hand", describe_value(hand), "a Hand, a room with a control, or None")
    if isinstance(scene.voltage, FollowForce):
        raise InputError("hand", "a hand together with a target friction force", "one of the two")


def _check_speeds(scene: Scene) -> None:
    """Raise InputError for a slide that takes no time beside something that needs it."""
    needing = " and ".join(scene.time_needed_by)
    for i, course in enumerate(scene.courses if needing else ()):
        if course.distance and not course.takes_time:
            raise InputError(f"motion[{i}].speed", ABSENT, f"a speed in mm/s, needed with {needing}")


def _check_field(scene: Scene) -> None:
    ended = getattr(scene.surface, "electrodes", None) is not None
    if scene.field != "full" and (ended or not scene.grounded):
        given = f"{scene.field} with {'electrodes that end' if ended else 'a finger that is not grounded'}"
        allowed = f"full, which exists for fingers in the plane only: {IN_SPACE}"
        raise InputError("electrostatics.field", given, allowed)
    against = without_field(scene)
    if against is not None and scene.field == "full":
        raise InputError("electrostatics.field", f"full with {against[0]}", f"local, or {against[1]}")


def _check_friction(scene: Scene) -> None:
    law = scene.friction_law
    if isinstance(law, type) or not isinstance(law, FrictionLaw):
        allowed = "Coulomb() or another law of friction, or an object with bound(pressure, mu, speed, age)"
        raise InputError("surface.friction_law", describe_value(law), allowed)


def _check_elastic(scene: Scene) -> None:
    if scene.ground.elastic is None:
        return
    elastic = scene.ground.elastic
    if isinstance(elastic, Foundation) and unchangeable(elastic):
        allowed = "a class that is not frozen: `begin` keeps in it what a step needs"
        raise InputError("surface.elastic", f"{type(elastic).__name__}, a frozen dataclass", allowed)
    found = isinstance(scene.voltage, (FollowForce, OpenCircuit, ChargeControl))
    if found or any(course.gap is not None for course in scene.courses):
        allowed = "a rigid surface, or a prescribed voltage: it is not sought above an elastic surface"
        raise InputError("surface.elastic", "an elastic surface under a voltage that is sought", allowed)


def _check_motion(scene: Scene) -> None:
    pressed = False
    for i, course in enumerate(scene.courses):
        key, ramps = f"motion[{i}]", course.largest_voltage is not None
        pressed = (pressed or course.presses) and not course.hovers
        if ramps and scene.law is None:
            raise InputError(key, "a voltage ramp without a law", "a scene with an electrostatic law")
        if ramps and isinstance(scene.voltage, SIGNALS):
            raise InputError(key, "a voltage ramp beside a voltage profile or signal", "one of the two")
        if course.hold == "force" and not pressed:
            raise InputError(
                f"{key}.hold", "force before any press", "a press first, to have a force to hold"
            )
        if course.force == 0.0 and not scene.is_pulled:
            raise InputError(f"{key}.force", 0.0, "larger than 0 when nothing else pulls the finger down")


def _check_time(scene: Scene) -> None:
    timed = isinstance(scene.electrics.voltage, TimeSignal) or scene.electrics.resolved
    if timed and scene.motion and not any(motion.takes_time for motion in scene.motion):
        given = "a signal over time, and no motion that takes any"
        raise InputError("electrostatics.voltage", given, "a Wait, or a slide or press with a speed")


def _check_dynamics(scene: Scene) -> None:
    solver = scene.solver
    if solver.contact == "penalty" and scene.has_friction and solver.penalty_tangential is None:
        allowed = 'a penalty in N/mm3, needed with contact = "penalty" and friction'
        raise InputError("solver.penalty_tangential", ABSENT, allowed)
    if not solver.timed:
        return
    givers = (scene.finger, *scene.finger.materials.values())
    timed = any(getattr(one, "viscosity", None) or getattr(one, "relaxation", None) for one in givers)
    if not solver.inertial and not timed:
        allowed = f"a relaxation time in s, larger than 0, or relaxation, with dynamics = {solver.dynamics}"
        raise InputError("finger.viscosity", 0.0, allowed)


def default_scene() -> Scene:
    """Table 2's finger (medium) pressed to 0.05 N/mm and slid 5 mm over a display at 1000 V."""
    from evfem.electrostatics.laws import Kaczmarek, Layer
    from evfem.finger.fingerpad import FingerPad
    from evfem.surface.surfaces import Display

    display = Display(insulator=Layer(thickness=0.09, eps_r=3.35), friction=0.3)
    motion = (Press(force=0.05), Slide(distance=5.0, steps=100))
    return Scene(FingerPad(), display, law=Kaczmarek(), voltage=1000.0, motion=motion, name="default")
