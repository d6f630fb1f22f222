r"""How well a least-squares fit knows its unknowns, from the Jacobian of the residuals.

With N residuals r, P unknowns z and J = dr/dz at the solution, the residuals' variance is s^2 = r.r / (N -
P), the covariance of the unknowns s^2 (J^T J)^-1, and the interval of confidence c of an unknown is z -+ t
se, se the root of its variance and t the quantile (1 + c) / 2 of Student's distribution with N - P degrees of
freedom (Seber and Wild, Nonlinear Regression, 1989, doi:10.1002/0471725315, section 5.1).

This assumes that the model is right, that measured values err independently of each other, by the
normal distribution and as much as their standard deviations say relative to each other, and that
the residuals are linear in the unknowns as far as the interval reaches.

The singular values of J with columns of length 1 say whether the data determine the unknowns one
by one: a small one belongs to a combination of them along which nothing measured changes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np

from evfem.common.arrays import Floats

#: singular value over the largest below which a combination is not determined; part of an unknown in it
#: that is worth naming; correlation worth a warning; length of a column of J over the longest one below
#: which its unknown changes nothing
UNDETERMINED, NAMED, CORRELATED, NOTHING = 1e-3, 0.1, 0.95, 1e-6


@dataclass(frozen=True)
class Confidence:
    """Confidence intervals of P unknowns from the Jacobian (N, P) and the residuals (N,)."""

    errors: Floats
    correlation: Floats
    singular_values: Floats
    warnings: tuple[str, ...]


def confidence(jacobian: Floats, residuals: Floats, names: Sequence[str]) -> Confidence:
    """Standard errors (P,), inf of what is not determined, correlation (P, P), singular values (P,) of the
    scaled Jacobian, and a sentence for each unknown or combination that the data do not determine.
    >>> J = np.array([[1.0, 2.0], [2.0, 4.0], [0.5, 1.0]])
    >>> confidence(J, np.ones(3), ["a", "b"]).warnings
    ('the data do not tell a and b apart: only a combination of them is determined',)
    """
    count, unknowns = jacobian.shape
    length = np.linalg.norm(jacobian, axis=0)
    seen = length > NOTHING * max(length.max(), 1e-300)
    scale = np.where(seen, length, 1.0)
    _, singular, right = np.linalg.svd(jacobian[:, seen] / scale[seen], full_matrices=False)
    known = singular > UNDETERMINED * singular[0]
    inverse = (right[known].T / singular[known] ** 2) @ right[known]
    covariance = np.full((unknowns, unknowns), np.nan)
    covariance[np.ix_(seen, seen)] = inverse / np.outer(scale[seen], scale[seen])
    lost = np.zeros(unknowns)
    lost[seen] = np.abs(right[~known]).max(axis=0, initial=0.0)
    variance = residuals @ residuals / (count - unknowns)
    errors = np.sqrt(variance * np.diag(covariance))
    errors[~seen | (lost > NAMED)] = np.inf
    spread = np.sqrt(np.diag(covariance))
    correlation = np.clip(covariance / np.outer(spread, spread), -1.0, 1.0)
    told = [f"{name} changes nothing that was measured" for name in np.array(names)[~seen]]
    for row in right[~known]:
        parts = np.array(names)[seen][np.abs(row) > NAMED]
        told.append(
            f"the data do not tell {', '.join(parts[:-1])} and {parts[-1]} apart: "
            "only a combination of them is determined"
        )
    told += [
        f"{names[i]} and {names[j]} are correlated by {correlation[i, j]:.3f}: "
        "the data determine a combination of them much better than each"
        for i, j in combinations(np.flatnonzero(np.isfinite(errors)).tolist(), 2)
        if abs(correlation[i, j]) > CORRELATED
    ]
    padded = np.concatenate([singular, np.zeros(unknowns - len(singular))])
    return Confidence(errors, correlation, padded, tuple(told))


def few_runs(residuals: Floats) -> float:
    """Probability that residuals (n,) without a pattern have as few runs of one sign as these, or fewer: of
    their signs every order is as likely (A. Wald, J. Wolfowitz, Ann. Math. Stat. 11 (1940) 147-162).

    >>> few_runs(np.array([1.0, 2.0, 0.5, -1.0, -3.0, -0.2]))
    0.1
    """
    above = residuals > 0.0
    a, b = int(above.sum()), int((~above).sum())
    most = 1 + int(np.sum(above[1:] != above[:-1]))
    return sum(_orders(a, b, runs) for runs in range(1, most + 1)) / comb(a + b, a)


def _orders(a: int, b: int, runs: int) -> int:
    """Orders of a signs and b others that have so many runs."""
    if a == 0 or b == 0:
        return int(runs == 1)
    half, odd = divmod(runs, 2)
    if not half:
        return 0
    parts = [comb(n - 1, half - 1) for n in (a, b)]
    if not odd:
        return 2 * parts[0] * parts[1]
    return comb(a - 1, half) * parts[1] + parts[0] * comb(b - 1, half)
