"""The database of parametric textures: which points it has, how it is computed, and its file.

Each of both fingers has `INNER` points of Sobol's sequence in the box of `RANGES` (Sobol 1967,
doi:10.1016/0041-5553(67)90144-9) and the corners of the box, without the 16 at which the shortest wave is the
steepest: sliding snaps from crest to crest there, and takes fifty times longer. `compute_database` runs
`parametric.scene` of every point; what is finished lies in its folder and is not computed again. Beside each
curve stand that of the pad that yields linearly (`sliding`), and how wrong the estimator is there when it
does not know the point: the root mean square of what is left of the friction, over the slope.

From these follows the error of an estimate: `local` averages them around a place, and for `OF_TEN` of the
points that are left out the largest error of the curve is below `factor` times what the others make `local`.

Errors of the estimate for the reference textures, which are not in the database, are in a separate
table: both fingers, at the default touch.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path

import numpy as np

import evfem
from evfem.common.arrays import Floats
from evfem.common.digest import digest
from evfem.common.notices import milestone
from evfem.common.pools import open_pool
from evfem.common.storage import alone_in, write_text
from evfem.common.tables import csv_text, read_columns, read_table
from evfem.errors import InputError
from evfem.estimate.correction import corrected, corrections, importance
from evfem.estimate.estimators import Estimator, best_kernel
from evfem.estimate.parametric import RANGES, SAMPLES, SPEED, Parametric, at, scene
from evfem.estimate.pressed import FILE as PADS
from evfem.estimate.pressed import Remembered, remember, write
from evfem.estimate.pressed import read as read_pad
from evfem.estimate.sliding import slid
from evfem.estimate.touch import Touch, friction_of, steps_over, touch_scene
from evfem.scene.file import dump
from evfem.scene.scene import Scene
from evfem.simulation.result import Result
from evfem.sweeps.folder import Answer, SweepFolder
from evfem.sweeps.run import answered, compute
from evfem.textures.library import REFERENCES, reference

#: points of Sobol's sequence for each finger
INNER = 192
#: share of unseen textures for which the error of an estimate holds at every position
OF_TEN = 0.9
FILE, KERNELS, CURVES = "textures-database.csv", "textures-kernels.csv", "textures-references.csv"
CURVE, LINEAR = (tuple(f"{name}{i:02d}" for i in range(SAMPLES)) for name in ("mu", "linear"))
ERROR, KERNEL = "error", ("ridged", *RANGES, "smoothing", "factor")


@dataclass(frozen=True, eq=False)
class Database:
    """Textures (N,) of one finger, and over a period of each the apparent friction (N, SAMPLES) and, as
    `linear`, that of a pad that yields linearly, at x = (i + 1) / SAMPLES wavelengths behind a place where
    the first sine rises through zero; `errors` (N,) of the estimator that does not know the point; the
    largest error of a curve is up to `factor` times as large.
    """

    textures: tuple[Parametric, ...]
    friction: Floats
    linear: Floats
    errors: Floats
    scale: Floats
    smoothing: float
    factor: float = 1.0

    @cached_property
    def responses(self) -> tuple[Floats, Floats, Floats]:
        """Places (N, 6), corrections (N, 3) and their importance (N, 3)."""
        return responses_of(self.textures, self.friction, self.linear)

    @cached_property
    def estimator(self) -> Estimator:
        points, responses, _ = self.responses
        return Estimator(points, responses, self.scale, self.smoothing)

    @property
    def relative_errors(self) -> Floats:
        """The errors (N,) as fractions of the range of each curve."""
        slope = np.array([texture.slope for texture in self.textures])
        return np.asarray(self.errors * slope / np.ptp(self.friction, axis=1))

    def errors_of(self, responses: Floats) -> Floats:
        """Root mean square error (N,) of the curves with these corrections (N, 3), over the slope."""
        return np.asarray(np.sqrt(np.mean(np.square(self.wrong(responses)), axis=1)))

    def local(self, location: Floats, without: int | None = None) -> float:
        """Root mean square of the errors around a place (6,), without one of the points."""
        errors, estimator = self.errors, self.estimator
        if without is not None:
            errors, estimator = np.delete(errors, without), estimator.without(without)
        return float(np.sqrt(estimator.near(location) @ errors**2))

    def error(self, location: Floats) -> float:
        """Largest error of a curve at a place (6,), over the slope, for `OF_TEN` of unseen textures."""
        return self.factor * self.local(location)

    def times_local(self, responses: Floats) -> Floats:
        """Largest errors (N,) of the curves with these corrections (N, 3) of points that are left out, over
        what the others make of them.
        """
        largest = np.abs(self.wrong(responses)).max(axis=1)
        return largest / [self.local(one, i) for i, one in enumerate(self.estimator.points)]

    def wrong(self, responses: Floats) -> Floats:
        """Errors (N, SAMPLES) of the curves with these corrections (N, 3), over the slope."""
        parts = zip(self.textures, self.friction, self.linear, responses, strict=True)
        curves = [
            corrected(_samples(one), linear, response, one.slope, one.wavelength) - friction
            for one, friction, linear, response in parts
        ]
        return np.asarray(curves) / np.array([[texture.slope] for texture in self.textures])


def responses_of(
    textures: Sequence[Parametric], friction: Floats, linear: Floats
) -> tuple[Floats, Floats, Floats]:
    """Places (N, 6) of textures, their corrections (N, 3), and how much each of these counts (N, 3)."""
    points = np.array([texture.point() for texture in textures])
    wavelength, slope = np.array([[texture.wavelength, texture.slope] for texture in textures]).T
    curves = (friction, linear, wavelength, slope)
    return points, corrections(*curves), importance(*curves)


def linear_curve(texture: Parametric, pad: Remembered) -> Floats:
    """The friction (SAMPLES,) of a pad that yields linearly."""
    pressed = pad.at(texture.load, texture.friction)
    return slid(pressed, texture.surface(), texture.friction, _samples(texture), SPEED)


def _samples(texture: Parametric) -> Floats:
    """Positions (SAMPLES,) of a period in mm."""
    return np.linspace(0.0, texture.wavelength, SAMPLES + 1)[1:]


def read(path: Path, ridged: bool) -> Database:
    """The database of one finger in a file that `compute_database` wrote."""
    table = read_table(path, "database")
    if list(table) != [*RANGES, "ridged", *CURVE, *LINEAR, ERROR]:
        raise InputError("database", f"{path}, with other columns", f"a file called {FILE}")
    of = table["ridged"] == float(ridged)
    rows = np.column_stack([table[name][of] for name in RANGES]).tolist()
    textures = tuple(Parametric(**dict(zip(RANGES, row, strict=True)), ridged=ridged) for row in rows)
    friction, linear = (np.column_stack([table[name][of] for name in names]) for names in (CURVE, LINEAR))
    kernels = read_columns(path.with_name(KERNELS), dict.fromkeys(KERNEL, "1"), "database")
    _, *scale, smoothing, factor = np.column_stack(kernels)[int(ridged)].tolist()
    return Database(textures, friction, linear, table[ERROR][of], np.array(scale), smoothing, factor)


#: where the files are that come with evfem
DATA = Path(evfem.__file__).parent / "data"


@cache
def shipped(ridged: bool) -> Database:
    """The database of one finger that comes with evfem."""
    return read(DATA / FILE, ridged)


@cache
def reference_curves(ridged: bool) -> dict[str, tuple[Floats, Floats]]:
    """x (mm) and the model's friction of one finger at the usual touch, for each reference texture."""
    table = read_table(DATA / CURVES, "references")
    of = table["ridged"] == float(ridged)
    return {name: (table["x"][of], table[name][of]) for name in REFERENCES}


def textures() -> list[Parametric]:
    """Every texture of the database, smooth and ridged in turn."""
    from scipy.stats.qmc import Sobol

    corners = np.array(list(itertools.product((1.0, 0.0), repeat=len(RANGES))))
    corners = corners[(corners[:, 0] > 0.5) | (corners[:, 1] < 0.5)]  # wavelength, slope
    inner = Sobol(len(RANGES), scramble=False).random(256)[:INNER] + 0.5 / 256
    points = np.concatenate([inner, corners])
    return [at(point, ridged) for point in points for ridged in (False, True)]


def references() -> dict[tuple[str, bool], Scene]:
    """The scenes of the reference textures of heights, by their names and whether ridged."""
    both = itertools.product(REFERENCES, (False, True))
    return {(name, ridged): touch_scene(reference(name), Touch(ridged=ridged)) for name, ridged in both}


def _ask(result: Result) -> dict[str, float | None]:
    return {f"mu{i:02d}": value for i, value in enumerate(friction_of(result).friction.tolist())}


def _evaluate(text: str) -> Answer:
    return answered(text, ".", _ask)


def compute_database(
    folder: str | Path, *, workers: int | None = None, scheduler: str | None = None
) -> tuple[Path, dict[str, int]]:
    """Run the model at every point and over every reference texture that is not finished in `folder`, and
    write `FILE`, `KERNELS`, `CURVES` and `PADS` there; the file, and how many points are done and are not.
    """
    folder = Path(folder)
    scenes: list[tuple[Parametric | tuple[str, bool], Scene]] = [(one, scene(one)) for one in textures()]
    texts = {one: dump(of) for one, of in [*scenes, *references().items()]}
    jobs = {digest((text, evfem.__version__)): one for one, text in texts.items()}
    with open_pool(workers, scheduler) as pool, alone_in(folder):
        kept = SweepFolder(folder, resume=True)
        kept.open(set(jobs), digest(sorted(jobs)))
        answers = {key: answer for key in jobs if (answer := kept.read(key)) is not None}
        waiting = {key: texts[one] for key, one in jobs.items() if key not in answers}

        def keep(key: str, answer: Answer) -> None:
            kept.write(key, answer)
            answers[key] = answer
            milestone("point", len(answers), len(jobs))

        compute(_evaluate, waiting, pool, keep)
        done = {one: answers[key] for key, one in jobs.items() if answers[key].status == "done"}
        write(folder / PADS, {ridged: remember(ridged) for ridged in (False, True)})
        _write(folder, {one: answer for one, answer in done.items() if isinstance(one, Parametric)})
        _write_references(folder, {one: done[one] for one in references() if one in done})
    return folder / FILE, {"done": len(done), "not converged": len(jobs) - len(done)}


def _write(folder: Path, done: Mapping[Parametric, Answer]) -> None:
    """Both files of the database, by the pads beside them."""
    rows, kernels = list[list[str]](), list[list[str]]()
    for ridged in (False, True):
        textures = tuple(one for one in done if one.ridged == ridged)
        friction = np.array([[done[one].outputs[name] for name in CURVE] for one in textures], dtype=float)
        pad = read_pad(folder / PADS, ridged)
        linear = np.array([linear_curve(one, pad) for one in textures])
        friction, linear = friction.round(6), linear.round(6)  # what stands in the file is estimated from
        scale, smoothing = best_kernel(*responses_of(textures, friction, linear))
        words = [f"{value:.4g}" for value in (*scale, smoothing)]
        written = np.array([float(word) for word in words])
        known = Database(textures, friction, linear, np.zeros(0), written[:-1], float(written[-1]))
        guesses = known.estimator.left_out()
        known = replace(known, errors=known.errors_of(guesses))
        factor = np.quantile(known.times_local(guesses), OF_TEN)
        kernels.append([str(int(ridged)), *words, f"{factor:.4g}"])
        rows += _rows(known, ridged)
    write_text(folder / KERNELS, csv_text([KERNEL, *kernels]))
    write_text(folder / FILE, csv_text([[*RANGES, "ridged", *CURVE, *LINEAR, ERROR], *rows]))


def _rows(database: Database, ridged: bool) -> list[list[str]]:
    """The rows of one finger, with the errors of points that are left out."""
    rows = zip(database.textures, database.friction, database.linear, database.errors, strict=True)
    return [
        [
            *(f"{getattr(one, name):.6g}" for name in RANGES),
            str(int(ridged)),
            *(f"{mu:.6f}" for mu in (*curve, *linear)),
            f"{error:.5g}",
        ]
        for one, curve, linear, error in rows
    ]


def _write_references(folder: Path, done: Mapping[tuple[str, bool], Answer]) -> None:
    """The model's curves of the reference textures, NaN where a run has not converged."""
    rows: list[list[str]] = []
    length, steps = Touch().length, steps_over(Touch().length)
    for ridged in (False, True):
        found = [done[name, ridged].outputs if (name, ridged) in done else {} for name in REFERENCES]
        for i in range(steps):
            values = np.array([outputs.get(f"mu{i:02d}") for outputs in found], dtype=float)
            x = length * (i + 1) / steps
            rows.append([f"{x:.6g}", str(int(ridged)), *(f"{mu:.6f}" for mu in values)])
    write_text(folder / CURVES, csv_text([["x", "ridged", *REFERENCES], *rows]))
