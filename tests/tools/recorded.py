"""Small scenes that together go through every branch of the model, and what is recorded of them.

Contact, friction, attraction, time, own parts, elements, laws, encoding, resuming, sweeps
and closed forms; a minute in all. Only the public interface of evfem is used.
"""

import tempfile
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

import evfem as ev
from evfem import encoding, materials, meshes, reference, rendering, result, scenefile

FORCES = ("applied_force", "applied_tangential_force", "normal_force", "tangential_force")
FORCES += ("electrostatic_force", "electrostatic_force_x")
WIDTHS = ("contact_width", "real_contact_width")
WORKS = ("external_work", "electrostatic_work", "stored_energy", "friction_dissipation")
WORKS += ("viscous_dissipation", "kinetic_energy")
STEPS = ("substeps", "newton_iterations")
COUNTS = ("iterations", "factorisations", "contact_solves", "cuts", "candidates", "unknowns")

INSULATOR = ev.Layer(thickness=0.09, eps_r=3.35)
SKIN = ev.Electrical(stratum_corneum_thickness=0.38)
LAYERS = ev.Layers.of(ev.Layer(0.38, 1650.0), INSULATOR)
LAST = ev.Output(every=100_000)  # fields of the last step only
BENCHMARK = {"tissue": ev.NeoHookean(E=0.05, nu=0.48), "skin": ev.NeoHookean(E=1.0, nu=0.30)}
STEP = [[0.0, 0.3], [0.3, 0.3], [0.3, 0.45], [0.6, 0.4]]
PRESS = ev.Press(force=0.05, steps=3)
INDENT, SLIDE = ev.Press(indentation=0.15, steps=2), ev.Slide(0.5, steps=5)

Scenes = dict[str, ev.Scene]
Numbers = dict[str, dict[str, Any]]
EMPTY: Numbers = {"columns": {}, "fields": {}, "counts": {}}


# -- bodies and own parts --------------------------------------------------------------------------------


def smooth() -> ev.FingerPad:
    return ev.FingerPad(resolution="coarse", ridges=False)


def ridged() -> ev.FingerPad:
    return ev.FingerPad(resolution="coarse")


def block(columns: int = 16, rows: int = 4, sag: float = 0.3) -> ev.Mesh:
    """4 mm wide, 2 mm high, its lower side curved."""
    x, t = np.meshgrid(np.linspace(-2.0, 2.0, columns + 1), np.linspace(0.0, 1.0, rows + 1))
    low = sag * (0.5 * x) ** 2
    node = np.arange(x.size).reshape(x.shape)
    corners = [node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]]
    points = np.column_stack([x.ravel(), (low + t * (2.0 - low)).ravel()])
    cells = np.stack([corner.ravel() for corner in corners], axis=1)
    sets = {"pad": node[0], "bone": node[-1]}
    return ev.Mesh(points, cells, "quad", np.zeros(len(cells), dtype=int), {"tissue": 0}, sets)


def cushion(material: Any = None, viscosity: float = 0.0) -> ev.MeshedFinger:
    return ev.MeshedFinger(block(), {"tissue": material or ev.NeoHookean(E=0.1, nu=0.4)}, SKIN, viscosity)


def benchmark(file: str = "benchmark-L0.vtu") -> ev.MeshedFinger:
    return ev.MeshedFinger(meshes.path(file), BENCHMARK, SKIN)


class OwnLaw:
    def traction(self, gap: Any, voltage: Any, layers: Any) -> Any:
        return 1e-9 * voltage**2 / (1.0 + 5.0 * gap)


class OwnEnergy:
    mu, bulk = 0.036, 0.14

    def psi(self, F: Any) -> Any:
        J = ev.det(F)
        return 0.5 * self.mu * (ev.ddot(F, F) - 3.0 - 2.0 * np.log(J)) + 0.5 * self.bulk * np.log(J) ** 2


class OwnStress:
    mu, bulk = 0.036, 0.14

    def P(self, F: Any) -> Any:
        G = ev.transpose(ev.inv(F))
        return self.mu * (F - G) + self.bulk * np.log(ev.det(F)) * G


class OwnSurface:
    friction = 0.2

    def height(self, x: Any) -> Any:
        return 0.02 * np.sin(6.0 * x)


@ev.form
def nail_bed(u: Any, v: Any, w: Any) -> Any:
    return 2e-2 * ev.dot(u, v)


@ev.form
def weight(u: Any, v: Any, w: Any) -> Any:
    return 1e-4 * v[1]


# -- scenes ----------------------------------------------------------------------------------------------


def contact_scenes() -> Scenes:
    """Presses and slides without attraction: what is held, friction, surfaces, penalty."""
    x = np.linspace(-10.0, 10.0, 61)
    profile = ev.Profile(x, 0.02 * np.cos(1.5 * x) + 0.005 * x, friction=0.2)
    penalty = ev.Solver(contact="penalty", penalty_normal=50.0, penalty_tangential=20.0)
    both_ways = [PRESS, ev.Slide(0.8, steps=6, hold="force"), ev.Slide(-0.4, steps=3)]
    release = [INDENT, SLIDE, ev.Press(indentation=-0.1, steps=2)]
    on = {
        "press to a force, no friction": (smooth(), ev.Flat(friction=0.0), [PRESS]),
        "press, slide and release, ridged": (ridged(), ev.Flat(friction=0.3), release),
        "friction table, force held, back": (smooth(), ev.Flat(friction=STEP), both_ways),
        "profile": (smooth(), profile, [INDENT, ev.Slide(1.0, steps=5, hold="force")]),
        "equation 25": (smooth(), ev.Sinusoid(friction=0.1), [INDENT, ev.Slide(0.4, steps=8)]),
        "own surface": (cushion(), OwnSurface(), [INDENT, SLIDE]),
    }
    scenes = {name: ev.Scene(a, b, motion=c) for name, (a, b, c) in on.items()}
    motion, hasty = [INDENT, SLIDE], ev.Solver(strategy=ev.Strategy(iterations=5, easy=4))
    scenes["penalty"] = ev.Scene(cushion(), ev.Flat(), motion=motion, solver=penalty)
    scenes["cut steps"] = replace(scenes["own surface"], surface=textured(0.02), solver=hasty)
    return scenes


def electric_scenes() -> Scenes:
    """Slides under attraction: both laws, directions, couplings, with and without air layer."""
    display, slide = ev.Display(friction=0.3), [PRESS, ev.Slide(0.6, steps=4)]
    thin = ev.Display(ev.Layer(2e-4, 3.35))
    kaczmarek, troxel = ev.Kaczmarek(), ev.StrongTroxel()
    return {
        "Kaczmarek, ridged slide": ev.Scene(ridged(), display, kaczmarek, 1000.0, slide),
        "Strong-Troxel, normal": ev.Scene(ridged(), display, troxel, 800.0, slide, direction="normal"),
        "Kaczmarek, normal, sinusoid": ev.Scene(
            cushion(), textured(0.01), kaczmarek, 2000.0, [INDENT, SLIDE], direction="normal"
        ),
        "no air layer": ev.Scene(smooth(), display, kaczmarek, 1500.0, slide, air_layer=False),
        "staggered": ev.Scene(smooth(), display, kaczmarek, 1500.0, slide, coupling="staggered"),
        "staggered once": ev.Scene(smooth(), display, kaczmarek, 1500.0, slide, coupling="staggered_once"),
        "thin insulator": ev.Scene(smooth(), thin, troxel, 140.0, slide),
    }


def voltage_scenes() -> Scenes:
    """Hovers, and voltages that change."""
    display, kaczmarek, troxel = ev.Display(friction=0.3), ev.Kaczmarek(), ev.StrongTroxel()
    up = [PRESS, ev.VoltageRamp(2000.0, steps=4, hold="force")]
    snap = [ev.Hover(gap=0.05, steps=1), ev.VoltageRamp(4000.0, steps=4), ev.VoltageRamp(0.0, steps=4)]
    flat_topped = replace(ridged(), ridge_crest=0.3, ridge_groove=0.2, ridge_phase=0.25)
    profile = ev.VoltageProfile([0.0, 0.3, 0.3, 0.6], [0.0, 800.0, 1500.0, 500.0])
    return {
        "hover": ev.Scene(smooth(), display, troxel, 2000.0, ev.Hover(gap=0.2, steps=2)),
        "rigid hover": ev.Scene(flat_topped, display, kaczmarek, 5.0, ev.Hover(gap=1.0, steps=2)),
        "voltage ramp, force held": ev.Scene(smooth(), display, kaczmarek, 0.0, up),
        "snap in and release": ev.Scene(cushion(), display, troxel, 0.0, snap),
        "voltage profile": ev.Scene(smooth(), display, kaczmarek, profile, [PRESS, ev.Slide(0.6, steps=4)]),
    }


def textured(amplitude: float) -> ev.Sinusoid:
    return ev.Sinusoid(friction=0.2, terms=[[amplitude, 6.0, 0.0]], insulator=INSULATOR)


def time_scenes() -> Scenes:
    """Sliding over a texture in time."""
    motion = [ev.Press(indentation=0.2, steps=2, speed=20.0), ev.Slide(0.6, steps=8, speed=20.0)]
    viscous, inertial = ev.Solver(dynamics="viscous"), ev.Solver(dynamics="inertial", element="q2")
    soft, texture = cushion(viscosity=1e-3), ev.Sinusoid(friction=0.1)
    pad = ev.FingerPad(resolution="coarse", ridges=False, viscosity=2e-3)
    penalty = replace(
        viscous, element="q1_fbar", contact="penalty", penalty_normal=50.0, penalty_tangential=20.0
    )
    return {
        "viscous, sinusoid": ev.Scene(pad, texture, motion=motion, solver=viscous),
        "inertial, sinusoid, 1000 V": ev.Scene(
            soft, textured(0.02), ev.Kaczmarek(), 1000.0, motion, solver=inertial
        ),
        "viscous, penalty, 1000 V": ev.Scene(
            soft, textured(0.01), ev.Kaczmarek(), 1000.0, motion, solver=penalty
        ),
    }


def own_scenes() -> Scenes:
    """A user's law, materials and forms."""
    flat, motion = ev.Flat(friction=0.3), [INDENT, SLIDE]
    press = ev.Press(indentation=0.3, steps=3)
    return {
        "own law": ev.Scene(cushion(), ev.Display(), OwnLaw(), 1000.0, motion),
        "own energy": ev.Scene(cushion(OwnEnergy()), flat, motion=motion),
        "own stress, q2": ev.Scene(cushion(OwnStress()), flat, motion=motion, solver=ev.Solver(element="q2")),
        "form on a boundary": ev.Scene(smooth(), flat, motion=press).with_term(
            nail_bed, on=ev.Boundary("nail")
        ),
        "form on a region": ev.Scene(cushion(), flat, motion=motion).with_term(
            weight, on=ev.Region("tissue")
        ),
    }


def tissue_scenes() -> Scenes:
    """Elements on a mesh from a file, material laws."""
    motion = [ev.Press(indentation=0.6, steps=3), ev.Slide(0.6, steps=4)]
    display = ev.Display(y=-6.395, friction=0.3, insulator=INSULATOR)
    scenes = {
        f"element {element}": ev.Scene(
            benchmark(), display, ev.Kaczmarek(), 1000.0, motion, solver=ev.Solver(element=element)
        )
        for element in ("q1", "q1_fbar", "q2", "q2p1")
    }
    triangles = benchmark("benchmark-L0-triangles.msh")
    scenes["element p2"] = ev.Scene(triangles, display, motion=motion)
    laws = {
        "stratum_corneum": ev.LinearElastic(E=1.0, nu=0.3),
        "dermis": ev.Ogden(mu=[0.02, -0.001], alpha=[2.5, -3.0], nu=0.48),
        "hypodermis": ev.Yeoh(c1=0.006, c2=0.002, c3=0.001, nu=0.48),
    }
    for element in ("q2p1", "q1_fbar"):
        pad, solver = replace(smooth(), materials=laws), ev.Solver(element=element)
        scenes[f"Yeoh, Ogden, linear, {element}"] = ev.Scene(
            pad, ev.Flat(), motion=[PRESS, SLIDE], solver=solver
        )
    return scenes


# -- more than one run, and closed forms -----------------------------------------------------------------


def exact_encoding() -> Numbers:
    """Voltages that make a display feel like a step of friction: met, too rough, limited, by
    closed form.
    """
    mesh = ev.MeshedFinger(block(16, 3, 0.4), {"tissue": ev.NeoHookean(E=0.1, nu=0.4)}, SKIN)
    jump = ev.Flat(friction=[[0.0, 0.3], [0.8, 0.3], [0.8, 0.4]])
    motion = (ev.Press(force=0.02, steps=2), ev.Slide(1.2, steps=12))
    real = rendering.record(ev.Scene(mesh, jump, motion=motion, output=LAST))
    found = rendering.exact(real, ev.Display(friction=0.3), ev.Kaczmarek())
    rough = rendering.exact(real, ev.Display(friction=0.35), ev.Kaczmarek())
    slippery = rendering.exact(real, ev.Display(friction=0.2), ev.Kaczmarek(), largest_voltage=2000.0)
    told = rendering.compare(real.result, found.result)
    display = encoding.Encoding(ev.Kaczmarek(), LAYERS, encoding.AreaLaw(60.0), 0.3)
    signal = rendering.voltage_for(rendering.apparent_friction(real.result), display)
    more = {
        "reference": real.result.applied_tangential_force,
        "slips": [real.full_slip, found.full_slip],
        "closed form": signal.profile.voltage,
        "fidelity": [told.pearson, told.relative_l2],
    }
    for name, run in (("rough", rough), ("slippery", slippery)):
        more |= {f"{name} voltage": run.result.voltage, f"{name} force": run.result.tangential_force}
    return with_columns(numbers(found.result), more)


class StopAfter:
    """Writes a checkpoint after every step and ends the run after one of them."""

    def __init__(self, scene: ev.Scene, last: int, checkpoint: ev.Checkpoint) -> None:
        self.scene, self.last, self.checkpoint, self.rows = scene, last, checkpoint, list[Any]()

    def step(self, row: Any, frame: Any, checkpoint: Callable[[], dict[str, Any]]) -> None:
        self.rows.append(dict(row))
        self.checkpoint.write(self.scene.digest(), checkpoint(), self.rows)
        if row["step"] == self.last:
            raise ev.StopRun("far enough")


def resumed() -> Numbers:
    """A run stopped in the slide, taken up from its checkpoint, saved and loaded; its scene from a
    text.
    """
    motion = [PRESS, ev.Slide(0.6, steps=5, hold="force")]
    scene = ev.Scene(ridged(), ev.Display(), ev.StrongTroxel(), 700.0, motion)
    scene = scenefile.loads(scenefile.dump(scene))
    with tempfile.TemporaryDirectory() as folder:
        point = ev.Checkpoint(Path(folder) / "checkpoint.npz")
        ev.simulate(scene, observers=[StopAfter(scene, 5, point)])
        ev.simulate(scene, resume=point.read(scene.digest())).save(Path(folder) / "run.npz")
        return numbers(result.load(Path(folder) / "run.npz"))


def sweep_of_four() -> Numbers:
    """A grid of two values, each with two samples."""
    scene = ev.Scene(smooth(), ev.Flat(), motion=[INDENT, SLIDE], solver=ev.Solver(element="q1"))
    names = (*FORCES[:4], *WIDTHS, *WORKS[:4], *STEPS)
    outputs = [f"{name}.{of}" for name in names for of in ("last", "max", "mean.1")]
    samples = ev.Samples({"motion.0.indentation": ev.Uniform(0.1, 0.2)}, count=2, seed=3)
    table = ev.sweep(ev.Sweep(scene, {"surface.friction": [0.1, 0.4]}, samples, outputs), workers=1)
    return with_columns(EMPTY, {name: table[name] for name in outputs})


def shapes() -> Numbers:
    """Meshes of the parametric finger."""
    made = {}
    for resolution in ("coarse", "medium", "paper"):
        for ridges in (True, False):
            for order in (1, 2):
                mesh = ev.FingerPad(resolution=resolution, ridges=ridges).mesh(order)
                name = f"{resolution}, {'ridged' if ridges else 'smooth'}, order {order}"
                made[name] = size(mesh.points)
                # with weights, so that neither order of nodes nor of cells goes unnoticed
                place = np.arange(1.0, 1.0 + len(mesh.cells))[:, None] + np.arange(mesh.cells.shape[1])
                made[f"{name}, cells"] = size(mesh.cells * place)
    return EMPTY | {"fields": made}


def laws_at_points() -> Numbers:
    """Laws of attraction and of tissue, built in and own, at points."""
    columns: dict[str, Any] = {}
    gap = np.array([0.0, 1e-4, 1e-3, 0.01, 0.1, 1.0])
    for law in (ev.Kaczmarek(), ev.StrongTroxel(), ev.StrongTroxel(gap_eps_r=2.0)):
        for name in ("traction", "traction_derivative", "potential"):
            columns[f"{law} {name}"] = getattr(law, name)(gap, 1000.0, LAYERS)
    F = np.array([[1.1, 0.2, 0.0], [-0.1, 0.85, 0.0], [0.0, 0.0, 1.0]])
    laws = [ev.NeoHookean(E=0.1, nu=0.45), ev.LinearElastic(E=0.1, nu=0.3)]
    laws += [ev.Yeoh(c1=0.5, c2=0.1, c3=0.01, nu=0.4), ev.Ogden(mu=[1.0, -0.2], alpha=[2.0, -2.0], nu=0.4)]
    for law in laws:
        for name in ("psi", "P", "tangent"):
            columns[f"{law} {name}"] = np.ravel(getattr(law, name)(F))
    for own in (OwnEnergy(), OwnStress()):
        parts = materials.split(own).split_stress(F[:2, :2], np.log(ev.det(F)))
        columns[type(own).__name__] = np.concatenate([np.ravel(part) for part in parts])
    return with_columns(EMPTY, columns)


def signals_and_references() -> Numbers:
    """A voltage limited, written and read; fitted area laws; closed-form solutions."""
    wish = ev.VoltageProfile([0.0, 1.0, 1.0, 3.0], [0.0, 500.0, 1500.0, 200.0])
    limited = ev.Amplifier(1200.0, slew=1e5).limit(wish, 20.0)
    columns = {"limited at": limited.position, "limited to": limited.voltage, "rms": [wish.rms(0.2, 2.5)]}
    with tempfile.TemporaryDirectory() as folder:
        for ending in ("csv", "wav"):
            ev.write_signal(Path(folder, f"a.{ending}"), limited, ev.Playback(full_scale=2000.0, speed=20.0))
            columns[ending] = ev.read_signal(Path(folder, f"a.{ending}"))(np.linspace(0.0, 3.0, 200))
    force = np.array([0.1, 0.2, 0.5, 1.0])
    display = encoding.Encoding(ev.StrongTroxel(), LAYERS, encoding.AreaLaw(60.0, 0.6), 0.3)
    fit = encoding.fit_area_to_friction(force, display.tangential_force(force, 800.0), 800.0, display)
    columns |= {"fit": [fit.k, fit.m], "encoded": display.voltage_for_friction(0.45, force)}
    layer = reference.BondedLayer.from_load(0.5, 1.0, 5.0, 0.1, 0.45)
    columns["bonded layer"] = layer.pressure(np.linspace(-0.5, 0.5, 5))
    for snap in (reference.pull_in_kaczmarek, reference.pull_in_strong_troxel):
        found = snap(0.1, 0.25, 100.0, LAYERS)
        columns[snap.__name__] = [found.travel, found.voltage]
    columns["cylinder"] = reference.cylinder_force(np.array([0.1, 1.0]), 8.0, 1000.0)
    return with_columns(EMPTY, columns)


SPECIAL: dict[str, Callable[[], Numbers]] = {
    "exact encoding": exact_encoding,
    "resumed, from files": resumed,
    "sweep": sweep_of_four,
    "shapes": shapes,
    "laws at points": laws_at_points,
    "signals, references": signals_and_references,
}


# -- what is recorded


def numbers(found: ev.Result) -> Numbers:
    """Columns of the history, sums and extremes of the last fields and of the mesh, counts of the
    solver.
    """
    names = [spec.name for spec in fields(found) if isinstance(getattr(found, spec.name), np.ndarray)]
    last = found.frames[-1] if found.frames else None
    shown = {} if last is None else {spec.name: getattr(last, spec.name) for spec in fields(last)}
    shown = {name: value for name, value in shown.items() if isinstance(value, np.ndarray)}
    solver = found.provenance["solver"]
    return {
        "columns": {name: getattr(found, name).tolist() for name in names if name != "seconds"},
        "fields": {name: size(value) for name, value in (shown | {"points": found.mesh.points}).items()},
        "counts": {name: solver[name] for name in COUNTS if name in solver},
    }


def size(values: np.ndarray) -> list[float]:
    """Sum, sum of magnitudes and largest magnitude of what is a number."""
    there = np.asarray(values, dtype=float)
    there = there[np.isfinite(there)]
    magnitude = np.abs(there)
    return [float(there.sum()), float(magnitude.sum()), float(magnitude.max(initial=0.0))]


def with_columns(made: Numbers, more: dict[str, Any]) -> Numbers:
    plain = {name: np.asarray(values).tolist() for name, values in more.items()}
    return made | {"columns": made["columns"] | plain}


def runs() -> dict[str, Callable[[], Numbers]]:
    """Name of every scene and what computes its numbers."""

    def of(scene: ev.Scene) -> Callable[[], Numbers]:
        return lambda: numbers(ev.simulate(replace(scene, output=LAST)))

    groups = [contact_scenes(), electric_scenes(), voltage_scenes(), time_scenes(), own_scenes()]
    groups += [tissue_scenes()]
    return {name: of(scene) for group in groups for name, scene in group.items()} | SPECIAL
