"""What the paper prints beside what a study finds: rows of text, and whether their digits agree."""

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

#: as far as both agree
AGREES, INSIDE = "as printed", "within"
NO_REASON = "no reason is known"
#: a reason that several studies have
CUT = "the digits behind the last one are cut off in the paper, not rounded"


@dataclass(frozen=True)
class Printed:
    """A number of the paper: its digits or range ("2.74", "8 to 10"), what it is, its unit, the place
    where the paper prints it, and why a computed one differs; `also`: keys of the same number computed
    otherwise, by what they say in the head of a column.

    >>> Printed("2.74", "effective thickness", "um").value
    2.74
    """

    digits: str
    what: str
    unit: str = ""
    place: str = ""
    why: str = ""
    also: Mapping[str, str] = field(default_factory=dict)

    @property
    def ends(self) -> tuple[float, ...]:
        """The number, or both ends of the range."""
        return tuple(float(word.replace(",", "")) for word in self.digits.split(" to "))

    @property
    def value(self) -> float:
        """The number, of a range its first end."""
        return self.ends[0]

    def described(self) -> dict[str, Any]:
        """All of it for the file of a study."""
        return (
            {"printed": self.digits}
            | {name: getattr(self, name) for name in ("what", "unit", "place", "why")}
            | ({"also": dict(self.also)} if self.also else {})
        )


def numbers_of(paper: Mapping[str, Printed]) -> dict[str, float]:
    """The numbers by their keys, without the ranges."""
    return {key: one.value for key, one in paper.items() if len(one.ends) == 1}


@dataclass(frozen=True)
class Row:
    """A printed number beside the computed one: texts, and the reason where they differ; `others` are the
    number computed otherwise, by the head of their column.
    """

    what: str
    place: str
    printed: str
    here: str
    difference: str
    why: str
    others: Mapping[str, str] = field(default_factory=dict)


def rows_of(result: Mapping[str, Any]) -> list[Row]:
    """A row for each printed number of a study's dictionary, in its order."""
    printed = result["assumptions"].get("printed", {})
    numbers = result.get("numbers", {})
    return [_row(Printed(said.pop("printed"), **said), key, numbers) for key, said in _copies(printed)]


def _copies(printed: Mapping[str, Mapping[str, Any]]) -> list[tuple[str, dict[str, Any]]]:
    return [(key, dict(said)) for key, said in printed.items()]


def _row(paper: Printed, key: str, numbers: Mapping[str, float]) -> Row:
    here = numbers[key]
    difference = difference_of(paper, here)
    agrees = difference.startswith((AGREES, INSIDE))
    why = "" if agrees else paper.why or NO_REASON
    unit = f" {paper.unit}" if paper.unit else ""
    others = {head: _shown(paper, numbers[other]) for head, other in paper.also.items() if other in numbers}
    return Row(paper.what, paper.place, paper.digits + unit, _shown(paper, here), difference, why, others)


def decimals(digits: str) -> int:
    """Digits behind the point.

    >>> decimals("0.9995"), decimals("23,139"), decimals("8 to 10")
    (4, 0, 0)
    """
    return max(len(word.partition(".")[2]) for word in digits.split(" to "))


def _shown(paper: Printed, here: float) -> str:
    """The computed number, with a digit more than the printed one where it is no count."""
    places = decimals(paper.digits) + (not here.is_integer())
    grouped = "," if here >= 1e4 or "," in paper.digits else ""
    return f"{here:{grouped}.{places}f}"


def difference_of(paper: Printed, here: float) -> str:
    """The relative difference to the printed number, or to the nearer end of a range.

    >>> difference_of(Printed("2.74", ""), 2.7459), difference_of(Printed("2.74", ""), 2.7401)
    ('+0.22 %', 'as printed')
    >>> difference_of(Printed("8 to 10", ""), 9.6), difference_of(Printed("8 to 10", ""), 7.0)
    ('within', '-12 %')
    """
    low, high = min(paper.ends), max(paper.ends)
    if low < high and low <= here <= high:
        return INSIDE
    if low == high and round(here, decimals(paper.digits)) == low:
        return AGREES
    nearest = low if abs(here - low) < abs(here - high) else high
    share = 100.0 * (here / nearest - 1.0)
    return f"{share:+.0f} %" if abs(share) >= 9.95 else f"{share:+.2g} %"


def told(rows: list[Row], width: int = 100) -> str:
    """The rows as text for a terminal, and below them the reasons.

    >>> print(told([Row("thickness", "(21)", "2.74 um", "2.746", "+0.22 %", "cut, not rounded")]))
    thickness    paper 2.74 um    here 2.746    +0.22 %  [1]
    [1] cut, not rounded
    """
    numbers = reasons(rows)
    cells = [
        (row.what, f"paper {row.printed}", f"here {row.here}", row.difference, _mark(numbers, row))
        for row in rows
    ]
    wide = [max(len(one[i]) for one in cells) for i in range(4)]
    lines = [
        f"{a:{wide[0]}}    {b:{wide[1]}}    {c:{wide[2]}}    {d:{wide[3]}}  {e}".rstrip()
        for a, b, c, d, e in cells
    ]
    for why, number in numbers.items():
        lines += textwrap.wrap(f"[{number}] {why}", width, subsequent_indent="    ")
    return "\n".join(lines)


def _mark(numbers: Mapping[str, int], row: Row) -> str:
    return f"[{numbers[row.why]}]" if row.why else ""


def reasons(rows: list[Row]) -> dict[str, int]:
    """Each reason once, with its number."""
    return {why: i for i, why in enumerate(dict.fromkeys(row.why for row in rows if row.why), start=1)}
