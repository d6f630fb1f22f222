"""The runs of a fit: many scenes at once, none of them twice, in a folder that remembers them.

A run is known by the fingerprint of its scene, of what is asked of it and of the version. Those of
a folder are read instead of computed, so that a fit that was interrupted is there again in no time:
its steps follow from the numbers alone. The scenes at the start warn as every run does; those of the
search, hundreds with numbers of their own, do not repeat it.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import evfem
from evfem.calibration.measured import Question
from evfem.common.digest import digest
from evfem.common.pools import Pool
from evfem.errors import InputError
from evfem.response.lines import differentiable
from evfem.response.sensitivities import Sensitivities, sensitivities
from evfem.scene.file import loads
from evfem.scene.scene import Scene
from evfem.simulation.result import Result
from evfem.simulation.run import simulate
from evfem.sweeps.folder import Answer, SweepFolder
from evfem.sweeps.run import answered, compute

Asked = tuple[Question, ...]
Outputs = dict[str, float | None]
#: scene as text, folder of its paths, what is asked, keys by which it is differentiated, whether it warns
Job = tuple[str, str, Asked, tuple[str, ...], bool]
#: fraction of a parameter over which answers are differenced along the derivatives of the history
ALONG = 1e-5


def work(job: Job) -> Answer:
    """Run one scene and ask it all questions; whatever happens to it is in the answer."""
    text, folder, questions, keys, warns = job
    columns = sorted({column for q in questions for column in q.columns})
    exact = keys and all(map(differentiable, columns))

    def run(scene: Scene) -> Result | Sensitivities:
        with suppress(InputError):  # of a parameter without derivatives, or else of the scene: then once more
            return sensitivities(scene, keys, columns)
        return simulate(scene)

    with warnings.catch_warnings():
        if not warns:
            warnings.simplefilter("ignore", UserWarning)
        return answered(text, folder, lambda found: _outputs(found, questions), run if exact else simulate)


def _answers(result: Result, questions: Asked) -> Outputs:
    return {k: v for q in questions for k, v in q.answers(result).items()}


def _outputs(found: Result | Sensitivities, questions: Asked) -> Outputs:
    """The answers of a run, and where it has them their derivatives by each of its parameters."""
    if not isinstance(found, Sensitivities):
        return _answers(found, questions)
    outputs = _answers(found.result, questions)
    for key, value in found.parameters.items():
        way = ALONG * (abs(value) or 1.0)
        more, less = (_answers(found.moved({key: sign * way}), questions) for sign in (1.0, -1.0))
        for name in list(more):
            ends = np.array([more[name], less[name]], dtype=float)
            rate = float(ends[0] - ends[1]) / (2.0 * way)
            outputs[derivative_of(name, key)] = rate if np.isfinite(rate) else None
    return outputs


def derivative_of(name: str, key: str) -> str:
    """How the derivative of an answer by a key is called."""
    return f"{name} by {key}"


@dataclass
class Runs:
    """Answers about scenes, whose paths start at `paths`, by a pool; kept in `folder` if there is one."""

    pool: Pool
    paths: Path
    folder: SweepFolder | None
    answers: dict[str, Answer] = field(default_factory=dict)
    computed: int = 0

    def ask(self, wanted: Sequence[tuple[str, Asked]], by: tuple[str, ...] = ()) -> list[Answer]:
        """The answers to the questions about each scene, and if there are any their derivatives `by` keys."""
        keys = [self._key(text, questions, by) for text, questions in wanted]
        jobs: dict[str, Job] = {
            key: (text, str(self.paths), questions, by, not self.answers)
            for key, (text, questions) in zip(keys, wanted, strict=True)
            if key not in self.answers
        }
        compute(work, jobs, self.pool, self._keep)
        return [self.answers[key] for key in keys]

    def _key(self, text: str, questions: Asked, by: tuple[str, ...]) -> str:
        try:
            scene = loads(text, self.paths).digest()
        except InputError as error:
            key = digest((text, "refused"))
            self.answers[key] = Answer("refused", 0.0, str(error), {})
            return key
        key = digest((scene, questions, evfem.__version__, *([by] if by else [])))
        if key not in self.answers and self.folder is not None and (kept := self.folder.read(key)):
            self.answers[key] = kept
        return key

    def _keep(self, key: str, answer: Answer) -> None:
        self.computed += 1
        if self.folder is not None:
            self.folder.write(key, answer)
        self.answers[key] = answer
