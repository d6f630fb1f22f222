"""Small bodies and meshes of the study of stability; tests use them too."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.electrostatics.laws import Layer
from evfem.finger.fingerpad import Electrical, FingerPad, MeshedFinger
from evfem.mesh.mesh import Mesh
from evfem.meshes.benchmark import benchmark_mesh
from evfem.scene.motion import Motion
from evfem.scene.scene import Output, Scene
from evfem.tissue.laws import NeoHookean

SKIN = Electrical(stratum_corneum_thickness=0.38, stratum_corneum_eps_r=1650.0)
INSULATOR = Layer(thickness=0.09, eps_r=3.35)
#: fields of the last step only
ONCE = Output(every=100_000)
#: region -> E (MPa), nu of the press-and-slide benchmark
BENCHMARK: Mapping[str, tuple[float, float]] = {"tissue": (0.05, 0.48), "skin": (1.0, 0.30)}


def scene(body: Any, surface: Any, *motion: Motion, **options: Any) -> Scene:
    """A scene that keeps the fields of its last step; further options of `Scene`."""
    return Scene(body, surface, motion=motion, output=ONCE, **options)


def pad(ridges: bool = False, **parameters: Any) -> FingerPad:
    """The finger of Table 2 on the coarse mesh; further parameters of `FingerPad`."""
    return FingerPad(ridges=ridges, resolution="coarse", **parameters)


def grid(x: Floats, y: Floats) -> Mesh:
    """Quads on growing x, y of shape (rows, columns); `pad` the first row, `bone` the last."""
    rows, columns = x.shape
    node = np.arange(rows * columns).reshape(rows, columns)
    corners = [node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]]
    cells = np.stack([c.ravel() for c in corners], axis=1)
    sets = {"pad": node[0].copy(), "bone": node[-1].copy()}
    points = np.column_stack([x.ravel(), y.ravel()])
    return Mesh(points, cells, "quad", np.zeros(len(cells), dtype=int), {"tissue": 0}, sets)


def block(columns: int = 8, rows: int = 4, width: float = 4.0, height: float = 2.0, sag: float = 0.0) -> Mesh:
    """A block with its lower side at y = 0 in the middle and `sag` mm higher at both ends."""
    x, t = np.meshgrid(np.linspace(-width / 2, width / 2, columns + 1), np.linspace(0.0, 1.0, rows + 1))
    low = sag * (2.0 * x / width) ** 2
    return grid(x, low + t * (height - low))


def shaken(mesh: Mesh, share: float, seed: int = 7) -> Mesh:
    """Inner nodes moved at random by up to that share of the shortest edge at hand."""
    outer = np.unique(mesh.outer_sides[:, :2])
    inner = np.setdiff1d(np.arange(len(mesh.points)), outer)
    edges, _ = mesh.sides
    length = np.linalg.norm(np.diff(mesh.points[edges], axis=1)[:, 0], axis=1)
    shortest = np.full(len(mesh.points), np.inf)
    np.minimum.at(shortest, edges.ravel(), np.repeat(length, 2))
    move = np.random.default_rng(seed).uniform(-share, share, (len(inner), 2))
    points = mesh.points.copy()
    points[inner] += move * shortest[inner, None]
    return replace(mesh, points=points)


def renumbered(mesh: Mesh, seed: int = 3) -> Mesh:
    """The same mesh with nodes and cells in another order and the cells starting at other corners."""
    random = np.random.default_rng(seed)
    nodes, cells = random.permutation(len(mesh.points)), random.permutation(len(mesh.cells))
    number = np.empty_like(nodes)
    number[nodes] = np.arange(len(nodes))
    turned = np.roll(number[mesh.cells[cells]], 1, axis=1)
    sets = {name: np.sort(number[old]) for name, old in mesh.node_sets.items()}
    return replace(mesh, points=mesh.points[nodes], cells=turned, region=mesh.region[cells], node_sets=sets)


def mirrored(mesh: Mesh) -> Mesh:
    """The mirror image at x = 0 of a mesh of linear cells."""
    return replace(mesh, points=mesh.points * [-1.0, 1.0], cells=mesh.cells[:, ::-1].copy())


def scaled(mesh: Mesh, factor: float) -> Mesh:
    """All lengths times `factor`."""
    return replace(mesh, points=mesh.points * factor)


def finger(mesh: Mesh, E: float = 0.1, nu: float = 0.4, viscosity: float = 0.0) -> MeshedFinger:
    """A body of one neo-Hookean material."""
    return MeshedFinger(mesh, {"tissue": NeoHookean(E=E, nu=nu)}, SKIN, viscosity)


def benchmark(level: int = 0, **materials: tuple[float, float]) -> MeshedFinger:
    """Half a finger between two ellipses; E (MPa) and nu of a region can be replaced."""
    return layered(benchmark_mesh(level), **{**BENCHMARK, **materials})


def layered(mesh: Mesh, **materials: tuple[float, float]) -> MeshedFinger:
    """A mesh with a neo-Hookean law (E in MPa, nu) for each region."""
    return MeshedFinger(mesh, {name: NeoHookean(E=E, nu=nu) for name, (E, nu) in materials.items()}, SKIN)
