"""The recipe of the ready-made meshes: `python -m evfem.meshes.make [FOLDER]` writes them all
again.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from evfem.finger.fingerpad import FingerPad
from evfem.mesh import file as meshfile
from evfem.mesh.mesh import Mesh
from evfem.meshes.benchmark import benchmark_mesh


def triangles(mesh: Mesh) -> Mesh:
    """Linear quads cut along their shorter diagonal."""
    a, b, c, d = mesh.cells.T
    length = [np.linalg.norm(mesh.points[j] - mesh.points[i], axis=1) for i, j in ((a, c), (b, d))]
    short = (length[0] <= length[1])[:, None]
    first = np.where(short, np.column_stack([a, b, c]), np.column_stack([a, b, d]))
    second = np.where(short, np.column_stack([a, c, d]), np.column_stack([b, c, d]))
    cells = np.stack([first, second], axis=1).reshape(-1, 3)
    return replace(mesh, cells=cells, kind="triangle", region=np.repeat(mesh.region, 2))


def _finger(resolution: str, ridges: bool) -> Mesh:
    return FingerPad(resolution=resolution, ridges=ridges).mesh(order=1)


#: file name -> what makes its mesh
RECIPES: Mapping[str, Callable[[], Mesh]] = {
    "finger-coarse-smooth.vtu": partial(_finger, "coarse", False),
    "finger-coarse-ridged.vtu": partial(_finger, "coarse", True),
    "finger-medium-smooth.vtu": partial(_finger, "medium", False),
    "finger-medium-ridged.vtu": partial(_finger, "medium", True),
    "benchmark-L0.vtu": partial(benchmark_mesh, 0),
    "benchmark-L1.vtu": partial(benchmark_mesh, 1),
    "benchmark-L0-triangles.msh": lambda: triangles(benchmark_mesh(0)),
}


def main(folder: Path) -> None:
    """Write every mesh of `RECIPES` into `folder`."""
    for name, recipe in RECIPES.items():
        meshfile.write(recipe(), folder / name)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent)
