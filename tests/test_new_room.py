"""The criterion of the rooms: capabilities that evfem does not have, each in this file alone.

A pull that builds up, a layer that creeps, a hand with a Maxwell arm and springs that relax: each remembers.
All run in the plane and in space, go on from a checkpoint to the last bit, show their columns, close the
balance of energy, and are differentiated. No file of `evfem/` knows them.
"""

from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tools.builders import SKIN, watched
from tools.domes import LINEAR, Dome
from tools.meshes import block
from tools.refusals import refuses

import evfem as ev
from evfem.response.parameters import parameter_of
from evfem.runfolder import RunFolder, saved
from evfem.simulation.result import Saved
from evfem.terms import BodyTerm, Column, Foundation, Hand, HandControl, PadTraction

SECONDS = 0.01  # of every step
#: a block of tissue, 4 mm wide and 2 mm high, its lower side curved
PAD = ev.MeshedFinger(block(sag=0.3), {"tissue": ev.NeoHookean(E=0.1, nu=0.4)}, SKIN)


@dataclass
class Wetting(PadTraction):
    """A pull that builds up: p = strength m exp(-gap / reach) (MPa, mm) with m' = (1 - m) / tau (s)."""

    strength: float = 2e-3
    reach: float = 0.1
    tau: float = 0.05
    name = "film"
    label = "film"
    columns = (Column("film_wetness", "", "how far the film has built up"),)

    def memory(self, state):
        return {"film": np.zeros(len(state.contact_force))}

    def begin(self, old, seconds):
        before = old.memory["film"]
        self.wetness = (before + seconds / self.tau) / (1.0 + seconds / self.tau)

    def forces(self, pad):
        found = np.zeros_like(pad.position)
        found[:, 1] = -self.strength * self.wetness * np.exp(-pad.gap / self.reach) * pad.lengths
        return found

    def accept(self, old, new):
        return {"film": self.wetness}

    def takes_time(self, seconds):
        return seconds > 0.0

    def values(self, model, state):
        return {"film_wetness": float(state.memory["film"].mean())}


@dataclass
class Tethers(BodyTerm):
    """Springs of k (N/mm) on all nodes, towards where they were, that relax in tau (s)."""

    k: float = 2e-5
    tau: float = 0.02
    columns = (
        Column("tether_force", "N/mm", "of the springs of the bone, along x"),
        Column("tether_dissipation", "N", "in the springs"),
    )

    def placed(self, mesh):
        self.bone = mesh.node_sets["bone"]

    def memory(self, state):
        return {"tethers": np.zeros_like(state.u)}

    def begin(self, old, seconds):
        self.before, self.u, self.left = old.memory["tethers"], old.u, 1.0 / (1.0 + seconds / self.tau)

    def forces(self, u):
        return self.left * (self.before + self.k * (u - self.u))

    def stiffness(self, u):
        return np.full_like(u, self.left * self.k)

    def accept(self, old, new):
        return {"tethers": self.forces(new.u)}

    def stored(self, state):
        return 0.5 * float(np.sum(state.memory["tethers"] ** 2)) / self.k

    def dissipation(self, old, new, seconds):
        return float(np.sum(new.memory["tethers"] ** 2)) * seconds / (self.k * self.tau)

    def takes_time(self, seconds):
        return seconds > 0.0

    def values(self, model, state):
        return {"tether_force": float(state.memory["tethers"][self.bone, 0].sum())}

    def works(self, substep):
        seconds = substep.model.equilibrium.interface.duration
        return {"tether_dissipation": self.dissipation(substep.old, substep.new, seconds)}


@dataclass
class Creeping(Foundation):
    """Springs of k (MPa/mm) below the pad, with dampers beside them: they bear F = f + tau f' (s) with the
    force f of the springs.
    """

    k: float = 0.2
    tau: float = 0.02
    columns = (Column("layer_force", "N/mm", "of the springs on the finger"),)

    def memory(self, state):
        return {"layer": np.zeros_like(state.contact_force)}

    def begin(self, old, seconds):
        self.seconds = seconds

    @property
    def left(self):
        return self.tau / (self.tau + self.seconds) if self.seconds > 0.0 else 0.0

    def compliance(self, x, lengths):
        return np.diag(np.tile((1.0 - self.left) / (self.k * lengths), 1 + np.ndim(x) * 1))

    def compliance_slope(self, x, lengths):
        d = np.ndim(x)
        return np.zeros((d, (d + 1) * len(x), (d + 1) * len(x)))

    def accept(self, old, new):
        force = new.memory["surface_force"]
        return {"layer": (1.0 - self.left) * force + self.left * old.memory["layer"]}

    def energy(self, state, force, displacement):
        return 0.5 * float(np.sum(state.memory["layer"] * displacement))

    def dissipation(self, old, new, seconds):
        if seconds == 0.0:
            return 0.0
        moved = new.memory["surface_displacement"] - old.memory["surface_displacement"]
        return self.tau / seconds * float(np.sum((new.memory["layer"] - old.memory["layer"]) * moved))

    def takes_time(self, seconds):
        return seconds > 0.0

    def values(self, model, state):
        return {"layer_force": float(state.memory["layer"][:, 1].sum())}


@dataclass(frozen=True)
class MaxwellHand(Hand):
    """A hand whose drive also pulls by a spring `arm` (N/mm) that relaxes in `tau` (s)."""

    arm: float = 0.05
    tau: float = 0.02
    columns = (Column("arm_force", "N/mm", "of the arm on the bone, along x"),)

    @property
    def timed(self):
        return True

    @property
    def control(self):
        return MaxwellControl(self)

    def stored(self, state):
        return super().stored(state) + 0.5 * float(np.sum(state.memory["arm"] ** 2)) / self.arm

    def dissipation(self, old, new, duration):
        own = float(np.sum(new.memory["arm"] ** 2)) * duration / (self.arm * self.tau)
        return super().dissipation(old, new, duration) + own

    def values(self, model, state):
        return {"arm_force": float(state.memory["arm"][0])}


@dataclass(frozen=True)
class MaxwellControl(HandControl):
    """Backward Euler of q' = arm (X - x)' - q / tau."""

    kept: Any = 0.0

    def memory(self, state):
        return super().memory(state) | {"arm": np.zeros(state.bone.size - 1)}

    def begun(self, old, drive, duration):
        return replace(super().begun(old, drive, duration), kept=old.memory["arm"])

    @property
    def left(self):
        return 1.0 / (1.0 + self.duration / self.hand.tau)

    def pull(self, x):
        stretched = (self.drive - self.before[0]) - (x - self.before[1])
        return self.left * (self.kept + self.hand.arm * stretched)

    @property
    def stiffness(self):
        return super().stiffness + self.left * self.hand.arm

    def drive_force(self, x):
        return super().drive_force(x) + self.pull(x)

    def accept(self, old, new):
        return super().accept(old, new) | {"arm": self.pull(new.bone[::2])}


def motions(dim, finer=1):
    """Press, slide and wait, in 4, 3 and 3 steps of the same duration, or so many times as many."""
    n, aside = finer, {"angle": 30.0} if dim == 3 else {}
    return (
        ev.Press(indentation=0.3, steps=round(4 * n), speed=0.3 / (4 * SECONDS)),
        ev.Slide(distance=0.3, steps=round(3 * n), speed=0.1 / SECONDS, **aside),
        ev.Wait(3 * SECONDS, steps=round(3 * n)),
    )


def base(dim, **other):
    """A small finger on a flat surface."""
    finger = Dome() if dim == 3 else PAD
    solver = {"solver": LINEAR} if dim == 3 else {}
    usual = {"surface": ev.Flat(friction=0.3), "motion": motions(dim), "output": ev.Output(every=100)}
    return ev.Scene(finger, **usual | solver | other)


def flat(**other):
    return ev.Flat(friction=0.3, **other)


#: kind -> what a scene has of it
OWN = {
    "film": lambda: {"rooms": (Wetting(),)},
    "springs": lambda: {"rooms": (Tethers(),)},
    "layer": lambda: {"surface": flat(elastic=Creeping())},
    "hand": lambda: {"hand": MaxwellHand(0.02)},
}
CASES = list(product(OWN, (2, 3)))
SHOWN = {
    "film": ("film_force", "film_force_x", "film_work", "film_wetness"),
    "springs": ("tether_force", "tether_dissipation"),
    "layer": ("layer_force",),
    "hand": ("arm_force",),
}
each = pytest.mark.parametrize(("kind", "dim"), CASES)


@cache
def ran(kind, dim):
    """A run and what a checkpoint has after each of its steps."""
    return watched(base(dim, **OWN[kind]()))


def left(result):
    """What the balance of energy lacks in every row (steps,), relative to the largest work on the bone."""
    given = [result.external_work, result.electrostatic_work]
    given += [result[name] for name in result.columns if name == "film_work"]
    kept = [result.stored_energy, result.kinetic_energy, result.friction_dissipation]
    kept += [result.viscous_dissipation, result.integrator_dissipation, result.snap_dissipation]
    return np.abs(sum(given) - sum(kept)) / np.abs(result.external_work).max()


# -- columns, files


@each
def test_its_columns_are_in_the_result_and_its_files(kind, dim, tmp_path):
    result, _ = ran(kind, dim)
    names = (*SHOWN[kind], *(("film_force_z",) if (kind, dim) == ("film", 3) else ()))
    assert set(names) <= set(result.columns)
    for name in names:
        assert name.endswith(("_force_x", "_force_z")) or np.abs(result[name]).max() > 0.0
        in_units = {"force": ("N/mm", "N"), "work": ("N", "mJ"), "dissipation": ("N", "mJ")}
        unit = in_units.get(name.split("_")[1], ("", ""))[dim - 2]
        assert result.units[name] == unit
    result.to_csv(tmp_path / "history.csv")
    result.save(tmp_path / "run.npz")
    again, lines = ev.load(tmp_path / "run.npz"), (tmp_path / "history.csv").read_text().splitlines()
    last = dict(zip(lines[0].split(","), lines[-1].split(","), strict=True))
    for name in names:
        assert again[name].tolist() == result[name].tolist()
        assert again.units[name] == result.units[name]
        assert float(last[name]) == result[name][-1]


# -- checkpoints


def differ(first, second):
    """Columns of two runs, but the wall time, that are not the same to the last bit."""
    assert first.columns == second.columns
    names = [name for name in first.columns if name != "seconds"]
    return [name for name in names if repr(first[name].tolist()) != repr(second[name].tolist())]


@each
def test_it_goes_on_from_a_checkpoint_to_the_last_bit(kind, dim):
    whole, kept = ran(kind, dim)
    for step in (3, 8):  # as it presses, as it waits
        resume = Saved(kept[step - 1], whole.rows[:step])
        assert differ(whole, ev.simulate(base(dim, **OWN[kind]()), resume=resume)) == []


class Interrupt:
    """An observer that ends a run after a step."""

    def __init__(self, after):
        self.after = after

    def step(self, row, frame, checkpoint):
        if row["step"] == self.after:
            raise ev.StopRun("enough")


@pytest.mark.parametrize("dim", [2, 3])
def test_a_folder_goes_on_with_all_of_them_at_once(dim, tmp_path):
    """As `evfem run --resume`: two processes could not share more than the folder."""
    own = {"rooms": (Wetting(), Tethers()), "hand": MaxwellHand(0.02), "surface": flat(elastic=Creeping())}
    own |= {"motion": motions(dim, 0.5)[:2]}
    scene = base(dim, **own)
    quiet = {"fields": False, "plots": False}
    ev.simulate(scene, observers=[RunFolder(tmp_path, scene, **quiet), Interrupt(3)])
    scene = base(dim, **{**own, "rooms": (Wetting(), Tethers())})
    resume = saved(tmp_path, scene)
    assert len(resume.rows) == 3
    folder = RunFolder(tmp_path, scene, resume=resume, **quiet)
    result = ev.simulate(scene, resume=resume, observers=[folder])
    folder.close(result)
    whole = ev.simulate(scene)
    assert differ(whole, result) == []
    assert left(whole).max() < 1e-7
    heads = (tmp_path / "history.csv").read_text().splitlines()[0].split(",")
    assert {name for names in SHOWN.values() for name in names} <= set(heads)
    with pytest.raises(ev.InputError, match="another scene"):  # a parameter of a room is one of the scene
        saved(tmp_path, base(dim, **{**own, "rooms": (Wetting(tau=0.06), Tethers())}))


# -- energy


@each
def test_the_balance_of_energy_closes(kind, dim):
    result, _ = ran(kind, dim)
    assert result.substeps.max() == 1
    assert left(result).max() < 2e-8
    assert result.snap_dissipation[-1] == 0.0
    if kind != "film":  # what a traction loses is its work
        assert (np.diff(result.viscous_dissipation) >= 0.0).all()
        assert result.viscous_dissipation[-1] > 0.0


@pytest.mark.parametrize("kind", OWN)
def test_what_its_integrator_loses_falls_with_the_step(kind):
    """Backward Euler is of first order; what nodes lose as they land is a scene's without, taken off."""
    stuck = kind == "hand"  # without friction nothing holds a finger behind a hand
    friction, motion = (10.0, slice(3)) if stuck else (0.0, slice(1))
    elastic = Creeping() if kind == "layer" else None
    without = {"hand": Hand(0.07)} if stuck else {}
    found = []
    for finer in (2, 4):
        lost = []
        for own in (OWN[kind]() | {"surface": ev.Flat(friction=friction, elastic=elastic)}, without):
            usual = {"surface": ev.Flat(friction=friction), "motion": motions(2, finer)[motion]}
            result = ev.simulate(base(2, **usual | own))
            lost.append(result.integrator_dissipation[-1] / result.external_work.max())
        found.append(lost[0] - lost[1])
    assert 0.2 < found[1] / found[0] < 0.65


# -- closed forms


@pytest.mark.parametrize("dim", [2, 3])
def test_a_film_builds_up_as_backward_euler_says(dim):
    result, _ = ran("film", dim)
    expected = 1.0 - (1.0 + SECONDS / Wetting().tau) ** -np.arange(1.0, 11.0)
    assert_allclose(result["film_wetness"], expected, rtol=1e-12)


@pytest.mark.parametrize("dim", [2, 3])
def test_springs_relax_at_rest(dim):
    result, _ = ran("springs", dim)
    force = result["tether_force"]
    assert_allclose(force[7:] / force[6:-1], 1.0 / (1.0 + SECONDS / Tethers().tau), rtol=1e-12)


@pytest.mark.parametrize("dim", [2, 3])
def test_an_arm_relaxes_while_its_drive_rests(dim):
    result, hand = ran("hand", dim)[0], MaxwellHand(0.02)
    along = np.cos(np.radians(30.0)) if dim == 3 else 1.0
    drive = along * np.minimum(np.maximum(np.arange(11.0) - 4.0, 0.0), 3.0) * 0.1
    stretched = np.diff(drive) - np.diff(result.position, prepend=0.0)
    force = np.append(0.0, result["arm_force"])
    expected = (force[:-1] + hand.arm * stretched) / (1.0 + SECONDS / hand.tau)
    assert_allclose(force[1:], expected, rtol=1e-9, atol=1e-15)
    assert force[-1] < 0.6 * force[7]


@pytest.mark.parametrize("dim", [2, 3])
def test_a_layer_creeps_under_a_load(dim):
    """By exp(-t / tau), in backward Euler's way; at the end it is the layer at rest."""
    layer, press = Creeping(), ev.Press(indentation=0.3, steps=2, speed=0.3 / (2 * SECONDS))
    motion = (press, ev.Wait(4 * SECONDS, steps=4, hold="force"))
    later = ev.Wait(2000 * layer.tau, steps=2, hold="force")
    scene = base(dim, surface=ev.Flat(friction=0.0, elastic=layer), motion=(*motion, later))
    result = ev.simulate(scene)
    load = result.applied_force[-1]
    short = (load - result["layer_force"])[1:6]
    assert_allclose(short[1:] / short[:-1], layer.tau / (layer.tau + SECONDS), rtol=1e-5)
    assert_allclose(result["layer_force"][-1], load, rtol=1e-5)
    surface = ev.Flat(friction=0.0, elastic=Creeping(tau=1e-12))
    rest = ev.simulate(replace(scene, surface=surface, motion=ev.Press(force=float(load), steps=2)))
    for name in ("indentation", "surface_sink", "contact_width" if dim == 2 else "contact_area"):
        assert_allclose(result[name][-1], rest[name][-1], rtol=1e-5)
    assert result.indentation[1] < 0.97 * result.indentation[-1]


# -- derivatives

KEYS = {
    "film": ("rooms.0.strength", "rooms.0.tau"),
    "springs": ("rooms.0.k", "rooms.0.tau"),
    "layer": ("surface.elastic.k", "surface.elastic.tau"),
    "hand": ("hand.arm", "hand.tau"),
}


@each
def test_it_is_differentiated_by_its_own_parameters_and_others(kind, dim):
    solver = ev.Solver(tolerance=1e-11, element="hex8" if dim == 3 else None)
    # in space a node that stops slipping has no direction: derivatives end there (`reasons` says so)
    motion = motions(dim, 0.5)[: 3 if dim == 2 else 2]
    scene = base(dim, **OWN[kind](), solver=solver, motion=motion)
    columns = ("normal_force", "stored_energy", *(name for name in SHOWN[kind] if name != "film_force_x"))
    keys = (*KEYS[kind], "surface.friction")
    found = ev.sensitivities(scene, keys, columns)
    assert not found.reasons
    digits = 2e-6 if dim == 2 else 2e-4  # of the differences, by the tolerance of runs
    for key in keys:
        parameter = parameter_of(scene, key)
        step = 5e-4 * parameter.value
        more, less = (ev.simulate(parameter.applied(scene, sign * step)) for sign in (1.0, -1.0))
        holds = np.cumprod(found.valid_to[key] > 4 * step).astype(bool)
        assert holds.sum() >= 2
        for name in columns:
            row = (more[name] - less[name]) / (2.0 * step)
            scale = max(np.abs(row).max(), 1e-3 * np.abs(found.result[name]).max() / parameter.value)
            assert_allclose(found[name, key][holds], row[holds], rtol=digits, atol=digits * scale)


# -- together


@pytest.mark.parametrize("dim", [2, 3])
def test_a_voltage_and_a_film_add_up(dim):
    """Each has its columns; the finger is pulled by both."""
    electric = {"law": ev.Kaczmarek(), "voltage": 500.0}
    display = ev.Display(insulator=ev.Layer(0.09, 3.35), friction=0.3)
    result = ev.simulate(base(dim, surface=display, rooms=(Wetting(),), **electric))
    assert min(result.electrostatic_force[-1], result["film_force"][-1]) > 1e-4
    pulled = result.electrostatic_force + result["film_force"]
    assert_allclose(result.normal_force - pulled, result.applied_force, rtol=1e-6)
    assert left(result).max() < 2e-8
    alone = ev.simulate(base(dim, surface=display, **electric))
    assert result.normal_force[-1] > alone.normal_force[-1] + 0.5 * result["film_force"][-1]


# -- where a scene goes


def test_a_scene_tells_its_rooms():
    scene = base(2, rooms=(Wetting(), Tethers()))
    assert "own rooms" in str(ev.plan(scene))
    assert "Wetting pulls on the pad (film_force), Tethers within the body" in " ".join(
        str(ev.plan(scene)).split()
    )
    assert "Wetting" in repr(scene)
    assert scene.digest() == base(2, rooms=(Wetting(), Tethers())).digest()
    assert scene.digest() != base(2, rooms=(Wetting(strength=1e-3), Tethers())).digest()
    assert scene.digest() != base(2, rooms=(Tethers(), Wetting())).digest()
    about = ran("film", 2)[0].provenance
    assert "Wetting" in about["parameters"]
    assert ["film_wetness", "", "how far the film has built up"] in [list(one) for one in about["columns"]]


@pytest.mark.parametrize("kind", OWN)
def test_no_file_holds_it(kind):
    """It would be read back as a scene without."""
    place = {"film": "rooms", "springs": "rooms", "layer": "surface.elastic", "hand": "hand"}[kind]
    refuses(f"^{place}: given .*for a file", ev.scenefile.dump, base(2, **OWN[kind]()))


def test_a_model_is_left_alone_by_another():
    """Rooms that keep arrays of their own: a scene is run twice, and differentiated, between its runs."""

    class Kept(Wetting):
        def __init__(self, **other):
            super().__init__(**other)
            self.scratch = {"wetness": np.zeros(1)}

        def begin(self, old, seconds):
            super().begin(old, seconds)
            self.scratch["wetness"][:] = self.wetness[0]

        def forces(self, pad):
            return super().forces(pad) * (self.scratch["wetness"][0] / max(self.wetness[0], 1e-300))

    scene = base(2, rooms=(Kept(),), motion=motions(2)[:1])
    first = ev.simulate(scene)
    assert scene.rooms[0].scratch["wetness"][0] == 0.0
    assert not hasattr(scene.rooms[0], "wetness")
    assert differ(first, ev.simulate(scene)) == []
    found = ev.sensitivities(scene, "rooms.0.tau", "normal_force")
    plain = ev.sensitivities(replace(scene, rooms=(Wetting(),)), "rooms.0.tau", "normal_force")
    assert_allclose(found["normal_force", "rooms.0.tau"], plain["normal_force", "rooms.0.tau"], rtol=1e-9)


def test_a_check_runs_with_it_and_a_sweep_says_that_it_cannot():
    """A sweep is made of the tables of a file, which holds no rooms."""
    scene = base(2, rooms=(Wetting(), Tethers()), motion=motions(2)[:1])
    checked = ev.check(scene)  # of first order in the step: the ends agree no better
    assert not any(row["why"] for row in checked.rows)
    assert max(row["difference"] for row in checked.rows) < 0.1
    refuses("^rooms: given rooms of your own", ev.Sweep, scene, grid={"surface.friction": [0.1, 0.2]})


def test_a_finger_hangs_on_its_pull():
    """No load is enough where a room of one's own pulls."""
    motion = (
        ev.Press(indentation=0.2, steps=2, speed=5.0),
        ev.Wait(0.1, steps=2),
        ev.Press(force=0.0, steps=2),
    )
    result = ev.simulate(base(2, rooms=(Wetting(strength=5e-3),), motion=motion))
    assert abs(result.applied_force[-1]) < 1e-9
    assert_allclose(result.normal_force[-1], result["film_force"][-1], rtol=1e-6)


# -- what goes wrong, in one sentence


def broken(kind, **methods):
    """A room of a class that does something else."""
    return type("Broken", (kind,), methods)()


MISTAKES = {
    "no room": (lambda: ("film",), r'rooms\[0\]: given "film"; allowed: a PadTraction or a BodyTerm'),
    "a layer among them": (lambda: (Creeping(),), "a Foundation goes to elastic="),
    "the same name": (lambda: (Wetting(), Wetting()), r"rooms\[0\].name: given film"),
    "its memory": (
        lambda: (Tethers(), broken(Wetting, memory=lambda self, state: {"tethers": np.zeros(3)})),
        "memory: given tethers, which another room keeps",
    ),
    "a column of the history": (
        lambda: (broken(Tethers, columns=(Column("voltage", "V", "another"),)),),
        "Broken.columns: given voltage",
    ),
    "no name of a column": (
        lambda: (broken(Tethers, columns=(Column("a b", "", "two"),)),),
        "Broken.columns: given a b",
    ),
    "its forces": (
        lambda: (broken(Wetting, forces=lambda self, pad: np.zeros(len(pad.position))),),
        r"Broken.forces: given ndarray of shape \(\d+,\); allowed: an array of shape \(\d+, 2\)",
    ),
    "no forces": (lambda: (broken(Wetting, forces=lambda self, pad: None),), "Broken.forces: given None"),
    "its stiffness": (
        lambda: (broken(Tethers, stiffness=lambda self, u: self.k),),
        r"Broken.stiffness: given float of shape \(\)",
    ),
    "forces in the body": (
        lambda: (broken(Tethers, forces=lambda self, u: u[:, 0]),),
        r"Broken.forces: given ndarray of shape \(\d+,\)",
    ),
    "another shape of memory": (
        lambda: (broken(Wetting, accept=lambda self, old, new: {"film": np.zeros(1)}),),
        r"Broken.accept: given film of shape \(1,\); allowed: \(\d+,\) as at rest",
    ),
    "what it did not keep": (
        lambda: (broken(Tethers, accept=lambda self, old, new: {"other": np.zeros(1)}),),
        "Broken.accept: given other; allowed: names that its `memory` has at rest",
    ),
    "a value that is missing": (
        lambda: (broken(Wetting, values=lambda self, model, state: {}),),
        r"Broken.values: given \[\]; allowed: its columns \['film_wetness'\]",
    ),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_a_mistake_is_one_sentence(case):
    rooms, words = MISTAKES[case]
    with pytest.raises(ev.InputError, match=words):
        ev.simulate(base(2, rooms=rooms(), motion=motions(2)[:1]))


def test_a_frozen_room_could_keep_nothing():
    @dataclass(frozen=True)
    class Frozen(PadTraction):
        name = "frozen"

        def begin(self, old, seconds):
            self.seconds = seconds

    @dataclass(frozen=True)
    class FrozenLayer(Foundation):
        def begin(self, old, seconds):
            self.seconds = seconds

    refuses(r"rooms\[0\]: given Frozen, a frozen dataclass", base, 2, rooms=(Frozen(),))
    layer = ev.Flat(elastic=FrozenLayer())
    refuses("surface.elastic: given FrozenLayer, a frozen dataclass", base, 2, surface=layer)


def test_memory_that_is_not_kept_shows_where_a_run_goes_on():
    """What resumes is what `accept` gave: a room that hides its state in itself is another after a resume."""

    class Hiding(Wetting):
        def memory(self, state):
            return {}

        def begin(self, old, seconds):
            self.wetness = getattr(self, "hidden", 0.0)

        def accept(self, old, new):
            self.hidden = 0.5
            return {}

        def values(self, model, state):
            return {"film_wetness": getattr(self, "hidden", 0.0)}

    whole, kept = watched(base(2, rooms=(Hiding(),), motion=motions(2)[:1]))
    resume = Saved(kept[1], whole.rows[:2])
    again = ev.simulate(base(2, rooms=(Hiding(),), motion=motions(2)[:1]), resume=resume)
    assert "normal_force" in differ(whole, again)


class Squeezed(PadTraction):
    """A film that resists being squeezed: all that it knows of the past is where the step begins."""

    name = "squeezed"
    of_rates = True

    def begin(self, old, seconds):
        self.before, self.seconds = old.gap, seconds

    def forces(self, pad):
        found = np.zeros_like(pad.position)
        if self.seconds > 0.0:
            rate = (self.before - pad.gap) / self.seconds
            found[:, 1] = 1e-7 * rate / (pad.gap + 0.05) ** 3 * pad.lengths
        return found


@pytest.mark.parametrize("stop", [2, 3, 5])
def test_what_lives_from_the_begin_of_a_step_resumes_to_the_last_bit(stop):
    """The tangent that the interrupted run had at hand is made again from where its step began."""
    scene = base(2, rooms=(Squeezed(),), motion=ev.Press(indentation=0.3, steps=6, speed=5.0))
    seen = Kept(stop)
    whole = ev.simulate(scene, observers=[seen])
    again = ev.simulate(scene, resume=Saved(seen.arrays, whole.rows[:stop]))
    for one, other in zip(whole.rows, again.rows, strict=True):
        assert {**one, "seconds": 0.0} == {**other, "seconds": 0.0}


def test_the_work_of_a_rate_is_that_of_its_end_forces():
    """The energy that the steps lose falls with them; from partial rates it tended to -6 %."""

    def lost(steps, rooms):
        scene = base(2, rooms=rooms, motion=ev.Press(indentation=0.3, steps=steps, speed=20.0))
        row = ev.simulate(scene).rows[-1]
        return row["integrator_dissipation"] / row["external_work"]

    coarse, fine = (lost(steps, (Squeezed(),)) - lost(steps, ()) for steps in (8, 32))
    assert abs(fine) < 0.5 * abs(coarse)


class Kept:
    """Keeps the arrays of a checkpoint after a step."""

    def __init__(self, step):
        self.at = step

    def step(self, row, frame, checkpoint):
        if row["step"] == self.at:
            self.arrays = checkpoint()


@dataclass(frozen=True)
class Borrowed(Hand):
    """A hand whose control is that of another one: its own spring would be left out in silence."""

    @property
    def control(self):
        return Hand(0.02).control


def test_a_control_of_another_hand_is_refused():
    refuses("Borrowed.control: given .*a HandControl of this hand", ev.simulate, base(2, hand=Borrowed(0.05)))
