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
        numbers = [_number(float(row[name]), _digits(name)) for name in COLUMNS]
        lines.append(_line(str(row["step"]), str(row["motion"]), numbers))
    return "\n".join(line.rstrip() for line in lines)


def chosen(rows: Sequence[Row], most: int) -> list[int]:
    """Numbers of the rows to show: about equally many of each motion, evenly spaced, with its last.

    >>> chosen([{"motion_index": int(i > 3)} for i in range(104)], 6)
    [0, 2, 3, 36, 70, 103]
    """
    index = [row["motion_index"] for row in rows]
    ends = [i + 1 for i in range(len(index)) if i + 1 == len(index) or index[i + 1] != index[i]]
    share = max(most // max(len(ends), 1), 1)
    picked = []
    for start, end in zip([0, *ends], ends, strict=False):
        count = min(share, end - start)
        picked += [start + round((k + 1) * (end - start) / count) - 1 for k in range(count)]
    return picked


def _line(step: str, motion: str, values: Sequence[str]) -> str:
    return f"{step:>4} {motion:<7}" + "".join(f"{v:>{w}}" for v, w in zip(values, WIDTHS, strict=True))


def _number(value: float, digits: int) -> str:
    """With so many decimals, and no sign on what rounds to zero."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


def _digits(name: str) -> int:
    return {"position": 3, "indentation": 3, "voltage": 0}.get(name, 5)
