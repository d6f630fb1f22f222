"""How hard steps are tried: parts, releases and rounds, and what a number of the strategy changes."""

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest
from tools.builders import finger
from tools.meshes import block
from tools.refusals import refuses

from evfem.newton.state import Record, StepFailed
from evfem.newton.strategy import Strategy
from evfem.scene.motion import Press, Slide
from evfem.scene.scene import Scene, Solver
from evfem.simulation.run import simulate
from evfem.solver.path import Halves
from evfem.solver.stepping import Stepper
from evfem.surface.surfaces import Flat
from evfem.terms.traction import NoTraction


class Unbooked:
    """Accounts that keep nothing."""

    def add_substep(self, old, new):
        pass

    def snapshot(self):
        pass

    def restore(self, kept):
        pass


@dataclass
class Steps:
    """An equilibrium that is found wherever the way is at most `longest`, in so many iterations."""

    strategy: Strategy
    longest: float
    takes: int = 5
    attraction = NoTraction()
    record: Record = field(default_factory=Record)
    ways: list = field(default_factory=list)

    def step(self, old, target, start=None):
        self.record.iterations += self.takes
        if target - old > self.longest:
            raise StepFailed("too far", [1.0])
        self.ways.append(target - old)
        return target


def ways(strategy, longest, takes=5):
    steps = Steps(strategy, longest, takes)
    Stepper(steps).follow(0.0, lambda _, share: share, Unbooked())
    assert sum(steps.ways) == pytest.approx(1.0, rel=1e-14)
    return steps.ways


def test_parts_are_halved_until_they_hold_and_grow_by_the_factor():
    """1 and 1/2 fail, 1/4 holds; then each part is 1.25 times the last one, the end is met exactly."""
    assert ways(Strategy(), 0.3) == pytest.approx([0.25, 0.15625, 0.1953125, 0.244140625, 0.154296875])
    assert ways(Strategy(growth=1.0), 0.3) == [0.25] * 4
    # no part is easy
    assert ways(Strategy(easy=4), 0.3) == [0.25] * 4


@dataclass(frozen=True)
class Timed:
    """A place that is reached in so many seconds."""

    x: float
    duration: float


class Lasts:
    """A body whose deformation takes time."""

    drag_rate = 0.0

    def takes_time(self, seconds):
        return seconds > 0.0


class Lasting(Steps):
    """The same for targets that say how long they take; nothing counts but where they are."""

    def step(self, old, target, start=None):
        return super().step(old, target.x)


@pytest.mark.parametrize(("duration", "smallest"), [(1.0, 1 / 16), (0.0, 1 / 4)])
def test_a_step_that_takes_time_has_parts_down_to_the_square_of_the_smallest(duration, smallest):
    """Viscosity and inertia hold the more, the shorter a part is."""

    def followed(longest):
        steps = Lasting(Strategy(smallest_part=0.25, growth=1.0, relaxation=False), longest)
        stepper = Stepper(steps, body=Lasts())
        return stepper.follow(0.0, lambda _, share: Timed(share, duration), Unbooked())[1]

    assert followed(smallest) == round(1 / smallest)
    with pytest.raises(StepFailed):
        followed(0.99 * smallest)


class Snapping(Steps):
    """Nothing is found from these places on; a release takes them as they are."""

    lost = 0.3

    def step(self, old, target, start=None):
        self.record.iterations += self.takes
        raise StepFailed("no equilibrium near", [1.0])


class Applying:
    """A release that applies everywhere."""

    def __init__(self, body, solve, charged):
        pass

    def applies(self, target):
        return True


def test_releases_of_one_step_come_at_longer_and_longer_parts(monkeypatch):
    """Nothing is ever found without a release: the first comes at 1/32 of the step, each further one
    at a part four times as long, up to the whole rest.
    """
    ends = []

    class Released(Applying):
        def follow(self, state, target, accept):
            ends.append(target)
            return target

    monkeypatch.setattr("evfem.solver.stepping.Relaxation", Released)
    stepper = Stepper(Snapping(Strategy(), 1.0), body=object(), substep=0.5)
    state, substeps = stepper.follow(0.0, lambda _, share: share, Unbooked())
    parts = np.diff([0.0, *ends])
    assert state == ends[-1] == 1.0
    assert substeps == stepper.relaxations == len(parts)
    assert parts[0] == 1 / 32
    assert (parts[:-1] < 2 * 4.0 ** np.arange(len(parts) - 1) / 32).all()
    assert len(parts) == 4
    assert stepper.substep == 1.0
    held = Stepper(Snapping(Strategy(relaxation=False), 1.0), body=object())
    with pytest.raises(StepFailed):
        held.follow(0.0, lambda _, share: share, Unbooked())


def test_a_release_that_comes_to_no_rest_is_taken_back_and_smaller_parts_are_tried(monkeypatch):
    """Parts of 1/100 work, a release at 1/32 books two parts and fails: they are not kept."""

    class Restless(Applying):
        def follow(self, state, target, accept):
            accept(state, target)
            accept(state, target)
            raise StepFailed("no rest", [])

    class Kept:
        def __init__(self):
            self.parts = []

        def add_substep(self, old, new):
            self.parts.append((old, new))

        def snapshot(self):
            return len(self.parts)

        def restore(self, kept):
            del self.parts[kept:]

    monkeypatch.setattr("evfem.solver.stepping.Relaxation", Restless)
    kept, stepper = Kept(), Stepper(Steps(Strategy(), 1 / 100), body=object())
    state, substeps = stepper.follow(0.0, lambda _, share: share, kept)
    assert state == 1.0
    assert substeps == len(kept.parts)
    assert [old for old, _ in kept.parts[1:]] == [new for _, new in kept.parts[:-1]]
    assert stepper.relaxations == 0
    none = Stepper(Steps(Strategy(), 1 / 5000), body=object())
    with pytest.raises(StepFailed):
        none.follow(0.0, lambda _, share: share, Kept())


@pytest.mark.parametrize("found", [False, True])
def test_a_part_that_failed_for_stability_is_not_forgotten_until_one_works(found):
    """Whole and half fail, the half because the body gives way; 1/4 works or fails, and all after it."""

    class Unsteady(Steps):
        def step(self, old, target, start=None):
            if found and old == 0.0 and target == 0.25:
                return target
            failed = StepFailed("fails", [1.0])
            failed.unstable = old == 0.0 and target == 0.5
            raise failed

    with pytest.raises(StepFailed) as error:
        Stepper(Unsteady(Strategy(), 1.0)).follow(0.0, lambda _, share: share, Unbooked())
    assert error.value.unstable is not found


def work(*motion, body=None, friction=0.3, **numbers):
    """Iterations and factorisations of a smooth motion, and its last normal force."""
    solver = Solver(strategy=Strategy(**numbers))
    body = body or finger(block(8, 3, sag=0.4))
    result = simulate(Scene(body, Flat(friction=friction), motion=motion, solver=solver))
    done = result.provenance["solver"]
    return done["iterations"], done["factorisations"], result.normal_force[-1]


def test_a_step_begins_ahead_on_the_last_ones_way():
    """A sticking block sheared in ten equal steps, a fresh tangent each time: where the guess is
    the last state, its error is of first order in the step, along the trend of second, as after
    one iteration. So each step but the first, which comes from a press, saves one.
    """
    motion, body = [Press(indentation=0.4, steps=2), Slide(0.5, steps=10)], finger(block(8, 3))
    ahead, _, force = work(*motion, body=body, friction=10.0, patience=0.0)
    behind, _, same = work(*motion, body=body, friction=10.0, patience=0.0, reach=0.0)
    assert ahead <= behind - 8
    assert force == pytest.approx(same, rel=1e-7)


class Decaying(Steps):
    """y' = -y by backward Euler: what a step of length h leaves of a state is 1 / (1 + h)."""

    def begin(self, old, target):
        pass

    def step(self, old, target, start=None):
        self.ways.append((target.duration, start is not None))
        assert len(self.ways) < 10_000, "the same part is tried again and again"
        return SimpleNamespace(reaction=old.reaction / (1.0 + target.duration), bone=np.zeros(2))


def decayed(allowed):
    """How far the end is off, in parts of the exact one; the parts' lengths; the stepper."""
    steps, ends = Decaying(Strategy(), 1.0), [0.0]
    stepper = Stepper(steps, parts=Halves(allowed))
    start = SimpleNamespace(reaction=np.ones(1), bone=np.zeros(2))
    path = lambda done, fraction: SimpleNamespace(duration=fraction - done)  # noqa: E731
    kept = Unbooked()
    kept.add_substep = lambda old, new: ends.append(float(new.reaction[0]))
    new, count = stepper.follow(start, path, kept)
    assert count == len(ends) - 1
    whole = [way for way, checked in steps.ways if checked]
    return new.reaction[0] / np.exp(-1.0) - 1.0, whole, stepper


def test_the_error_of_the_path_sets_the_length_of_its_parts():
    """Two halves of a part of length h are off by h^2 / 4 of the force, so 0.9 of h = 2 sqrt(e) is
    tried; over the unit of time they add up to h / 4. A quarter of the error takes twice the parts.
    """
    off, parts, stepper = decayed(1e-4)
    assert parts[-2] == pytest.approx(0.9 * 2.0 * np.sqrt(1e-4), rel=0.02)
    assert off == pytest.approx(parts[-2] / 4.0, rel=0.05)
    assert 0.7e-4 < stepper.parts.largest <= 1e-4
    finer, twice, _ = decayed(0.25e-4)
    assert len(twice) == pytest.approx(2 * len(parts), abs=4)
    assert finer == pytest.approx(off / 2.0, rel=0.1)
    # the last part was cut by the end of the step, which says nothing against the next one
    assert stepper.substep == pytest.approx(parts[-2], rel=1e-6)


@pytest.mark.parametrize("name", ["path_error", "smallest_part"])
def test_fractions_are_above_zero(name):
    refuses(f"{name}: given 0.0; allowed: a fraction", Strategy, **{name: 0.0})


def test_parts_that_err_too_much_are_done_again_shorter():
    _, parts, stepper = decayed(1e-6)
    assert parts[:3] == pytest.approx([1 / 16, 1 / 64, 1 / 256])
    assert stepper.parts.largest <= 1e-6


def test_few_automatic_steps_agree_with_many_given_ones():
    """A curved block pressed and slid with friction: the force on the way is that of very many
    steps, where single ones are off by percents.
    """

    def pressed(presses, slides, **numbers):
        motion = [Press(indentation=0.4, steps=presses), Slide(0.1, steps=slides)]
        solver, body = Solver(strategy=Strategy(**numbers)), finger(block(16, 3, sag=0.4))
        result = simulate(Scene(body, Flat(friction=0.5), motion=motion, solver=solver))
        forces = result.normal_force[presses - 1], result.normal_force[-1], result.tangential_force[-1]
        return np.array(forces), result

    many, _ = pressed(25, 25)
    coarse, _ = pressed(1, 1)
    few, result = pressed(1, 1, steps="auto", path_error=1e-3)
    assert 0.0 < result.provenance["solver"]["path_error"] <= 1e-3
    assert np.abs(few / many - 1.0).max() < 0.2 * np.abs(coarse / many - 1.0).max()


@pytest.mark.parametrize("dynamics", ["viscous", "inertial"])
def test_books_close_where_automatic_steps_pass_time(dynamics):
    """Works are booked by the clock of each accepted half, not by that of the trial in one piece."""
    motion = [Press(indentation=0.3, steps=2, speed=20.0), Slide(0.2, steps=1, speed=20.0)]
    strategy = Strategy(steps="auto", path_error=1e-2)
    body = finger(block(8, 3, sag=0.4), viscosity=0.003)
    result = simulate(
        Scene(body, Flat(friction=0.3), motion=motion, solver=Solver(dynamics=dynamics, strategy=strategy))
    )
    kept = result.stored_energy + result.kinetic_energy + result.integrator_dissipation
    lost = result.friction_dissipation + result.viscous_dissipation + result.snap_dissipation
    assert result.substeps.max() > 1
    np.testing.assert_allclose(kept + lost, result.external_work, atol=1e-7 * result.external_work[-1])
