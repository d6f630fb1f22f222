"""The database of parametric textures: which points it has, how it is computed, and its file.

Each of both fingers has `INNER` points of Sobol's sequence in the box of `RANGES` (Sobol 1967,
doi:10.1016/0041-5553(67)90144-9) and the corners of the box, without the 16 at which the shortest
wave is the steepest: sliding snaps from crest to crest there, and takes fifty times longer.
`compute_database` runs `parametric.scene` of every point; what is finished lies in its folder and
is not computed again. Beside each curve stands how wrong each estimator is there when it does not
know the point: the root mean square of (mu - friction) / slope.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

import numpy as np

import evfem
from evfem.common.arrays import Floats
from evfem.common.digest import digest
from evfem.common.notices import milestone
from evfem.common.storage import alone_in, write_text
from evfem.common.tables import csv_text, read_columns, read_table
from evfem.errors import InputError
from evfem.scene.file import dump
from evfem.simulation.result import Result
from evfem.sweeps.folder import Answer, SweepFolder
from evfem.sweeps.pools import open_pool
from evfem.sweeps.run import answered, compute
from evfem.textures.estimators import METHODS, Estimator, best_kernel, best_width, left_out
from evfem.textures.parametric import RANGES, SAMPLES, Parametric, at, scene

#: points of Sobol's sequence for each finger
INNER = 192
FILE, KERNELS = "textures-database.csv", "textures-kernels.csv"
CURVE = tuple(f"mu{i:02d}" for i in range(SAMPLES))
ERRORS = {method: f"error_{method}" for method in METHODS}


@dataclass(frozen=True, eq=False)
class Database:
    """Textures (N,) of one finger, and the apparent friction (N, SAMPLES) of a period at each.

    Sample i is F_t / F_n at x = (i + 1) / SAMPLES wavelengths behind a place where the first sine
    rises through zero. `errors`: of each method, (N,), NaN where the point is a corner of the hull.
    """

    textures: tuple[Parametric, ...]
    friction: Floats
    errors: Mapping[str, Floats]
    scale: Floats
    smoothing: float

    @cached_property
    def estimator(self) -> Estimator:
        """The estimator of responses at places in the box."""
        points, responses = responses_of(self.textures, self.friction)
        width = best_width(points * self.scale, responses)
        return Estimator(points, responses, width, self.scale, self.smoothing)

    @property
    def relative_errors(self) -> dict[str, Floats]:
        """Each method's errors (N,) as shares of the range of each curve."""
        slope = np.array([texture.slope for texture in self.textures])
        return {name: error * slope / np.ptp(self.friction, axis=1) for name, error in self.errors.items()}

    @property
    def best(self) -> str:
        """The method with the smallest median of these errors."""
        return min(self.relative_errors.items(), key=lambda one: float(np.nanmedian(one[1])))[0]


def responses_of(textures: Sequence[Parametric], friction: Floats) -> tuple[Floats, Floats]:
    """Places (N, 6) of textures, and the responses (N, SAMPLES) that are interpolated."""
    points = np.array([texture.point() for texture in textures])
    own = np.array([[texture.friction, texture.slope] for texture in textures])
    return points, (friction - own[:, :1]) / own[:, 1:]


def read(path: Path, ridged: bool) -> Database:
    """The database of one finger in a file that `compute_database` wrote."""
    table = read_table(path, "database")
    if list(table) != [*RANGES, "ridged", *CURVE, *ERRORS.values()]:
        raise InputError("database", f"{path}, with other columns", f"a file called {FILE}")
    of = table["ridged"] == float(ridged)
    rows = np.column_stack([table[name][of] for name in RANGES]).tolist()
    textures = tuple(Parametric(**dict(zip(RANGES, row, strict=True)), ridged=ridged) for row in rows)
    friction = np.column_stack([table[name][of] for name in CURVE])
    errors = {method: table[name][of] for method, name in ERRORS.items()}
    kernels = read_columns(path.with_name(KERNELS), ["ridged", *RANGES, "smoothing"], "database")
    _, *scale, smoothing = np.column_stack(kernels)[int(ridged)].tolist()
    return Database(textures, friction, errors, np.array(scale), smoothing)


@cache
def shipped(ridged: bool) -> Database:
    """The database of one finger that comes with evfem."""
    return read(Path(evfem.__file__).parent / "data" / FILE, ridged)


def textures() -> list[Parametric]:
    """Every texture of the database, smooth and ridged in turn."""
    from scipy.stats.qmc import Sobol

    corners = np.array(list(itertools.product((1.0, 0.0), repeat=len(RANGES))))
    corners = corners[(corners[:, 0] > 0.5) | (corners[:, 1] < 0.5)]  # wavelength, slope
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
    """Run the model at every point that is not finished in `folder`, and write
    `FILE` and `KERNELS` there.

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
        done = {one: answers[key] for key, one in jobs.items() if answers[key].status == "done"}
        _write(folder, done)
    return folder / FILE, {"done": len(done), "not converged": len(jobs) - len(done)}


def _write(folder: Path, done: Mapping[Parametric, Answer]) -> None:
    """Both files of the database."""
    rows: list[list[str]] = []
    kernels: list[list[str]] = []
    for ridged in (False, True):
        textures = tuple(one for one in done if one.ridged == ridged)
        friction = np.array([[done[one].outputs[name] for name in CURVE] for one in textures], dtype=float)
        friction = friction.round(6)  # what stands in the file is what is estimated from
        scale, smoothing = best_kernel(*responses_of(textures, friction))
        words = [f"{value:.4g}" for value in (*scale, smoothing)]
        kernels.append([str(int(ridged)), *words])
        written = np.array([float(word) for word in words])
        rows += _rows(Database(textures, friction, {}, written[:-1], float(written[-1])), ridged)
    write_text(folder / KERNELS, csv_text([["ridged", *RANGES, "smoothing"], *kernels]))
    write_text(folder / FILE, csv_text([[*RANGES, "ridged", *CURVE, *ERRORS.values()], *rows]))


def _rows(database: Database, ridged: bool) -> list[list[str]]:
    """The rows of one finger, with the errors of points that are left out."""
    estimator = database.estimator
    errors = [left_out(estimator, method) - estimator.responses for method in METHODS]
    sizes = np.sqrt(np.mean(np.square(errors), axis=2)).T
    return [
        [
            *(f"{getattr(one, name):.6g}" for name in RANGES),
            str(int(ridged)),
            *(f"{mu:.6f}" for mu in curve),
            *(f"{size:.5g}" for size in beside),
        ]
        for one, curve, beside in zip(database.textures, database.friction, sizes, strict=True)
    ]
