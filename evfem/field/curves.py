r"""Smooth curves through the points of an outline, as polylines with the same area.

A row of points that turn little and ever the same way are samples of a curve: where the angles
turned at both ends of a chord of length L are below `TURN`, of one sign and backed by a neighbour,
the curve leaves the chord by the cubic of the curvatures :math:`\kappa_0, \kappa_1` at its ends,

.. math:: \delta(t) = \tfrac16 L^2\, t (1 - t) \left[(2 - t)\,\kappa_0 + (1 + t)\,\kappa_1\right],
          \qquad \kappa_i = \frac{2 \theta_i}{L_{i-1} + L_i},

with the angle :math:`\theta_i` turned at point i: of the fourth order in L where the spacing is
even. All else is straight: corners, pieces between two corners, points that turn to and fro. The
curve is cut into chords whose sagitta is at most `SAGITTA` of the distance to the electrode and of
the radius. Their points are moved outwards by
:math:`\kappa (L_{i-1}^3 + L_i^3) / 12 (L_{i-1} + L_i)`, so that the polyline has the curve's area;
what that leaves is of the second order in the sagitta.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.field.outlines import FLANK, SAME, TURN, Outline

#: largest ratio of the curvatures at the two ends of a chord
RATIO = 3.0
#: sagitta of a chord, as a fraction of its distance to the electrode and of its radius
SAGITTA = 3e-3
#: most chords between two points
MOST = 200


def curved(outline: Outline, reduced: float) -> Outline:
    """The outline with its curves as finer polylines; `reduced` (mm) adds to the gap.

    >>> x = np.linspace(-0.6, 0.6, 7)
    >>> arc = curved(Outline.of(x, 2.0 - np.sqrt(4.0 - x**2), periodic=False), 0.01)
    >>> fine = np.linspace(-0.6, 0.6, 1001)
    >>> off = np.interp(fine, arc.x, arc.height) - 2.0 + np.sqrt(4.0 - fine**2)
    >>> bool(abs(off.mean()) < 2e-6), Outline.of([0, 1, 2], [1, 0.98, 1]).x.size
    (True, 3)
    """
    p = outline.x + 1j * outline.height
    bend = _bends(outline, np.diff(p))
    begin, end = _of_chords(bend)
    if not np.any(begin) and not np.any(end):
        return outline
    sharpest = np.maximum(np.abs(begin), np.abs(end))
    sagitta = sharpest * np.abs(np.diff(p)) ** 2 / 8.0
    distance = np.minimum(outline.height[1:], outline.height[:-1]) + reduced
    with np.errstate(divide="ignore"):
        parts = np.ceil(np.sqrt(sagitta / SAGITTA * np.maximum(1.0 / distance, sharpest)))
    parts = np.clip(parts, 1, MOST).astype(int)
    points, sides = _cut(p, begin, end, parts)
    corner = np.zeros(points.size, dtype=bool)
    corner[np.append(0, np.cumsum(parts))] = np.isnan(bend[1:-1])
    smooth = np.any(sides != 0.0, axis=0) & ~corner
    moved = points + _outwards(outline, points, sides, smooth)
    round_ = np.stack([moved.real, 1.0 / np.maximum(np.abs(sides).max(axis=0), 1e-300)])[:, smooth]
    new = Outline(moved.real, np.maximum(moved.imag, 0.0), outline.periodic, round_)
    usable = np.all(np.diff(new.x) >= 0.0) and (reduced > 0.0 or new.height.min() > 0.0)
    return new if usable else outline


def _bends(outline: Outline, chord: Any) -> Floats:
    """Curvatures (N + 2,) in 1/mm at the points and at one before and after; not a number at corners."""
    seam = 1j * (outline.height[0] - outline.height[-1])
    if not outline.periodic:
        around = np.concatenate([[0.0], chord, [0.0]])
    elif abs(seam) > SAME * max(outline.length, float(outline.height.max())):  # a wall
        around = np.concatenate([[seam], chord, [seam]])
    else:
        around = np.concatenate([chord[-1:], chord, chord[:1]])
    length = np.abs(around)
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = np.angle(around[1:] / around[:-1])
        bend = np.where(np.abs(turn) < TURN, 2.0 * turn / (length[1:] + length[:-1]), np.nan)
    if not outline.periodic:
        return np.concatenate([[np.nan], [np.nan], bend[1:-1], [np.nan], [np.nan]])
    return np.concatenate([bend[-2:-1], bend, bend[1:2]])


def _of_chords(bend: Floats) -> tuple[Floats, Floats]:
    """Curvatures (N - 1,) at the beginning and at the end of each chord, 0 where it is straight."""
    before, first, last, after = bend[:-3], bend[1:-2], bend[2:-1], bend[3:]
    backed = _alike(before, first) | _alike(after, last)
    begin, end = (np.where(backed, _limited(*pair), 0.0) for pair in ((first, last), (last, first)))
    for corner, own, beyond, step in ((first, last, after, -1), (last, first, before, 1)):
        lone = np.isnan(corner) & _alike(own, beyond) & np.roll(backed, step)  # as at the other end
        begin[lone] = end[lone] = own[lone]
    return begin, end


def _alike(a: Floats, b: Floats) -> Any:
    """Places where two curvatures have the same sign and a similar size."""
    small, large = np.minimum(np.abs(a), np.abs(b)), np.maximum(np.abs(a), np.abs(b))
    return (a * b > 0.0) & (large <= RATIO * small)


def _limited(own: Floats, other: Floats) -> Floats:
    """A curvature, at most `RATIO` times the one at the other end of the chord; 0 if that turns back."""
    size = np.minimum(np.abs(own), RATIO * np.abs(other))
    return np.where(own * other > 0.0, np.copysign(size, own), 0.0)


def _cut(p: Any, begin: Floats, end: Floats, parts: Ints) -> tuple[Any, Floats]:
    """Points (M,) of the curve, complex, and the curvatures (2, M) on their left and on their right."""
    chord = np.repeat(np.arange(parts.size), parts)
    t = (np.arange(chord.size) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[chord]
    chords = np.diff(p)[chord]
    bulge = t * (1.0 - t) / 6.0 * ((2.0 - t) * begin[chord] + (1.0 + t) * end[chord])
    points = np.append(p[:-1][chord] + chords * (1.0 * t - 1j * np.abs(chords) * bulge), p[-1])
    right = np.append((1.0 - t) * begin[chord] + t * end[chord], begin[0])
    left = np.append(end[-1], right[1:])
    left[np.cumsum(parts)] = end
    return points, np.stack([left, right])


def _outwards(outline: Outline, points: Any, sides: Floats, smooth: Any) -> Any:
    """By how much points (complex) are moved so that chords have the curve's area."""
    chords = np.diff(points)
    if outline.periodic:
        around = np.concatenate([chords[-1:], chords, chords[:1]])
    else:
        around = np.concatenate([chords[:1], chords, chords[-1:]])
        sides = sides.copy()
        sides[0, 0], sides[1, -1] = sides[1, 0], sides[0, -1]
        smooth = smooth | (np.arange(points.size) % (points.size - 1) == 0)
    tangent = around[:-1] + around[1:]
    tangent /= np.abs(tangent)
    length = np.abs(np.stack([around[:-1], around[1:]]))
    far = np.sum(sides * length**3, axis=0) / (12.0 * np.sum(length, axis=0))
    out = np.where(smooth, -1j * far * tangent, 0.0)
    if outline.periodic:  # the period stays where it is
        out[[0, -1]] = 1j * (out.imag / tangent.real**2)[[0, -1]] * (tangent.real[[0, -1]] > FLANK)
    return out
