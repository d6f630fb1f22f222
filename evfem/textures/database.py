"""The database of parametric textures: which points it has, how it is computed, and its file.

Each of both fingers has the 64 corners of the box of `RANGES`, so that the convex hull of the points
is the box, and `INNER` points of Sobol's sequence in it (Sobol 1967,
doi:10.1016/0041-5553(67)90144-9). `compute_database` runs `parametric.scene` of every point; what is
finished lies in its folder and is not computed again.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import evfem
from evfem.common.arrays import Floats
from evfem.common.digest import digest
from evfem.common.notices import milestone
from evfem.common.storage import alone_in, write_text
from evfem.common.tables import csv_text
from evfem.scene.file import dump
from evfem.simulation.result import Result
from evfem.sweeps.folder import Answer, SweepFolder
from evfem.sweeps.pools import open_pool
from evfem.sweeps.run import answered, compute
from evfem.textures.parametric import RANGES, SAMPLES, Parametric, at, scene

#: points of Sobol's sequence for each finger
INNER = 192
FILE = "textures-database.csv"
CURVE = tuple(f"mu{i:02d}" for i in range(SAMPLES))


@dataclass(frozen=True, eq=False)
class Database:
    """Points (N, 6) of one finger and the apparent friction (N, SAMPLES) of a period at each.

    Sample i is the friction F_t / F_n at x = (i + 1) / SAMPLES wavelengths behind a zero of the
    first sine at which the profile rises.
    """

    ridged: bool
    textures: tuple[Parametric, ...]
    friction: Floats

    @property
    def points(self) -> Floats:
        """Places (N, 6) from 0 to 1."""
        return np.array([texture.point() for texture in self.textures])

    @property
    def response(self) -> Floats:
        """What is interpolated (N, SAMPLES): (mu - friction) / slope."""
        own = np.array([[texture.friction, texture.slope] for texture in self.textures])
        return (self.friction - own[:, :1]) / own[:, 1:]


def textures() -> list[Parametric]:
    """Every texture of the database, smooth and ridged in turn."""
    from scipy.stats.qmc import Sobol

    corners = np.array(list(itertools.product((0.0, 1.0), repeat=len(RANGES))))
    inner = Sobol(len(RANGES), scramble=False).random(256)[:INNER] + 0.5 / 256
    points = np.concatenate([inner, corners])
    return [at(point, ridged) for point in points for ridged in (False, True)]


def _ask(result: Result) -> dict[str, float | None]:
    period = result.motion_index == 2
    mu = result.applied_tangential_force[period] / result.applied_force[period]
    return dict(zip(CURVE, mu.tolist(), strict=True))


def _evaluate(text: str) -> Answer:
    return answered(text, ".", _ask)


def compute_database(
    folder: str | Path, *, workers: int | None = None, scheduler: str | None = None
) -> tuple[Path, dict[str, int]]:
    """Run the model at every point that is not finished in `folder`, and write `FILE` there.

    `workers` and `scheduler` as in `evfem.sweep`. Returns the file, and how many points are done and
    how many are not converged.
    """
    folder = Path(folder)
    jobs = {digest((dump(scene(one)), evfem.__version__)): one for one in textures()}
    with alone_in(folder):
        kept = SweepFolder(folder, resume=True)
        kept.open(set(jobs), digest(sorted(jobs)))
        answers = {key: answer for key in jobs if (answer := kept.read(key)) is not None}
        waiting = {key: dump(scene(one)) for key, one in jobs.items() if key not in answers}

        def keep(key: str, answer: Answer) -> None:
            kept.write(key, answer)
            answers[key] = answer
            milestone("point", len(answers), len(jobs))

        compute(_evaluate, waiting, open_pool(workers, scheduler), keep)
        rows = [_row(one, answers[key]) for key, one in jobs.items() if answers[key].status == "done"]
        write_text(folder / FILE, csv_text([[*RANGES, "ridged", *CURVE], *rows]))
    done = len(rows)
    return folder / FILE, {"done": done, "not converged": len(jobs) - done}


def _row(texture: Parametric, answer: Answer) -> list[str]:
    values = [f"{getattr(texture, name):.6g}" for name in RANGES]
    return [*values, str(int(texture.ridged)), *(f"{answer.outputs[name]:.6f}" for name in CURVE)]
