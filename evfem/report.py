"""Text for the terminal: a short table of forces."""

from __future__ import annotations

from collections.abc import Sequence

from evfem.result import Row

COLUMNS = {
    "position": "position",
    "indentation": "indent.",
    "voltage": "voltage",
    "applied_force": "applied",
    "normal_force": "normal",
    "tangential_force": "tangential",
    "electrostatic_force": "electrost.",
}
UNITS = ("mm", "mm", "V", "N/mm", "N/mm", "N/mm", "N/mm")
WIDTHS = (9, 8, 8, 10, 10, 11, 11)


def table(rows: Sequence[Row], most: int = 12) -> str:
    """At most about `most` rows of a history, always the last of each motion, in 80 columns.

    >>> row = dict.fromkeys(COLUMNS, 0.0) | {"step": 1, "motion": "press", "motion_index": 0}
    >>> print(table([row]))
    step motion  position indent. voltage   applied    normal tangential electrost.
                       mm      mm       V      N/mm      N/mm       N/mm       N/mm
       1 press      0.000   0.000       0   0.00000   0.00000    0.00000    0.00000
    """
    lines = [_line("step", "motion", list(COLUMNS.values())), _line("", "", UNITS)]
    for row in (rows[i] for i in chosen(rows, most)):
        numbers = [f"{float(row[name]):.{_digits(name)}f}" for name in COLUMNS]
        lines.append(_line(str(row["step"]), str(row["motion"]), numbers))
    return "\n".join(line.rstrip() for line in lines)


def chosen(rows: Sequence[Row], most: int) -> list[int]:
    """Numbers of the rows to show: the last of each motion, and as many between as there is room for."""
    last = len(rows) - 1
    ends = [i for i in range(last + 1) if i == last or rows[i]["motion_index"] != rows[i + 1]["motion_index"]]
    room = max(most - len(ends), 0)
    between = [round((k + 1) * last / (room + 1)) for k in range(room)] if last > 0 else []
    return sorted({*ends, *between})


def _line(step: str, motion: str, values: Sequence[str]) -> str:
    return f"{step:>4} {motion:<7}" + "".join(f"{v:>{w}}" for v, w in zip(values, WIDTHS, strict=True))


def _digits(name: str) -> int:
    return {"position": 3, "indentation": 3, "voltage": 0}.get(name, 5)
