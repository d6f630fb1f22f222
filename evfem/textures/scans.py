"""Scans of surfaces through SurfaceTopography (extra `scans`): over forty formats of instruments."""

from __future__ import annotations

import warnings
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import real
from evfem.errors import InputError
from evfem.textures.cleaning import Cleaning
from evfem.textures.importing import LENGTHS, Source, from_csv, kind_of
from evfem.textures.texture import Texture

#: largest file in bytes, and most points of a scan
MOST_BYTES, MOST_POINTS = 512_000_000, 50_000_000


def from_scan(
    path: str | Path,
    source: Source,
    *,
    row: float = 0.5,
    unit: str | None = None,
    cleaning: Cleaning | None = None,
) -> Texture:
    """A line along x through a scanned surface, or a scanned profile; `row` (0 first to 1 last) says
    which line. `unit` (mm, um, nm, m) is that of files that do not name theirs; heights of .x3p
    files are in metres (ISO 25178-72).

    A text with a profile in columns is read as `from_csv` does, which knows a unit of each. Raises
    InputError without SurfaceTopography and for a file that it cannot read.
    """
    path = Path(path)
    real("row", row, "a place from 0 (first) to 1 (last)", lambda place: 0.0 <= place <= 1.0)
    if kind_of(path) == "csv":
        return from_csv(path, source, cleaning, unit)
    if find_spec("SurfaceTopography") is None:
        raise InputError("file", str(path), 'the extra scans: pip install "evfem[scans]"')
    x, height, notes = _line(_topography(path), row, unit, path)
    x, height, done = (cleaning or Cleaning())(x, height)
    return source.texture(path, "scan", (x, height), [*notes, *done])


def _topography(path: Path) -> Any:
    allowed = "a scan that SurfaceTopography reads, of up to 50,000,000 points"
    try:
        if path.stat().st_size > MOST_BYTES:
            raise InputError("file", f"{path}, which is too long", allowed)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import SurfaceTopography

            reader = SurfaceTopography.open_topography(str(path))
            if np.prod(reader.default_channel.nb_grid_pts) > MOST_POINTS:
                raise InputError("file", f"{path}, with too many points", allowed)
            return reader.topography()
    except InputError:
        raise
    except Exception as error:  # forty readers, each with errors of its own
        reason = getattr(error, "strerror", None) or "of an unknown kind or damaged"
        raise InputError("file", f"{path} ({reason})", allowed) from None


def _line(topography: Any, row: float, unit: str | None, path: Path) -> tuple[Floats, Floats, list[str]]:
    """x and heights (n,) in mm of one line, gaps as NaN, and what was assumed."""
    named = topography.unit or unit
    if named not in LENGTHS:
        given = f"{path}, {'without a unit' if named is None else f'in {named}'}"
        raise InputError("unit", given, f"one of {', '.join(LENGTHS)}")
    scale = LENGTHS[named]
    heights = np.ma.filled(np.ma.asarray(topography.heights(), dtype=float), np.nan) * scale
    if topography.dim == 1:
        return np.asarray(topography.positions()).ravel() * scale, heights.ravel(), [f"In {named}."]
    size = topography.physical_sizes[0] * scale
    line = round(row * (heights.shape[1] - 1))
    x = (np.arange(heights.shape[0]) + 0.5) * (size / heights.shape[0])
    return x, heights[:, line], [f"Line {line + 1} of {heights.shape[1]} along x, in {named}."]
