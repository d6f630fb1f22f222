"""Units: of values written as text, and in the texts of others, how a header says so, and the numbers in
their lines.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Collection, Mapping
from typing import NamedTuple

from evfem.errors import InputError, describe_value

#: unit that is meant without a word -> what else it is measured in, and how many of the first that is
SIZES: Mapping[str, Mapping[str, float]] = {
    "mm": {"mm": 1.0, "um": 1e-3, "nm": 1e-6, "pm": 1e-9, "cm": 10.0, "m": 1e3, "in": 25.4, "inch": 25.4},
    "s": {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
    "V": {"V": 1.0, "mV": 1e-3, "kV": 1e3},
    "N": {
        "N": 1.0, "uN": 1e-6, "mN": 1e-3, "cN": 1e-2, "kN": 1e3,
        "gf": 9.80665e-3, "kgf": 9.80665, "kp": 9.80665, "lbf": 4.4482216152605, "ozf": 0.27801385095378125,
    },
    "N/mm": {"N/mm": 1.0, "mN/mm": 1e-3, "N/cm": 0.1, "N/m": 1e-3, "kN/m": 1.0},
    "mm2": {"mm2": 1.0, "um2": 1e-6, "cm2": 100.0, "m2": 1e6},
    "mJ": {"mJ": 1.0, "uJ": 1e-3, "J": 1e3, "Nmm": 1.0, "N*mm": 1.0},
    "MPa": {
        "MPa": 1.0, "kPa": 1e-3, "hPa": 1e-4, "Pa": 1e-6, "GPa": 1e3, "N/mm2": 1.0, "N/cm2": 1e-2,
        "N/m2": 1e-6, "bar": 0.1, "mbar": 1e-4, "psi": 6.894757293168361e-3,
    },
    "Hz": {"Hz": 1.0, "mHz": 1e-3, "kHz": 1e3, "MHz": 1e6, "GHz": 1e9},
    "S/m": {
        "S/m": 1.0, "uS/m": 1e-6, "mS/m": 1e-3, "S/cm": 100.0, "mS/cm": 0.1, "uS/cm": 1e-4, "S/mm": 1e3,
    },
    "mm/s": {"mm/s": 1.0, "um/s": 1e-3, "cm/s": 10.0, "m/s": 1e3, "mm/min": 1.0 / 60.0},
    "1/mm": {"1/mm": 1.0, "mm-1": 1.0, "1/um": 1e3, "1/cm": 0.1, "1/m": 1e-3, "m-1": 1e-3},
    "degrees": {
        "degrees": 1.0, "degree": 1.0, "deg": 1.0, "°": 1.0,
        "rad": 180.0 / math.pi, "mrad": 0.18 / math.pi,
    },
    "V/mm": {"V/mm": 1.0, "V/um": 1e3, "V/m": 1e-3, "kV/mm": 1e3, "kV/m": 1.0, "kV/cm": 100.0, "MV/m": 1e3},
    "t/mm3": {"t/mm3": 1.0, "kg/m3": 1e-12, "g/cm3": 1e-9},
    "1": {"1": 1.0, "-": 1.0, "%": 0.01},
}  # fmt: skip
#: those that a value may have as text; a force of the plane is one per mm of width and has none
WRITTEN = ("mm", "s", "V", "MPa", "Hz", "S/m", "mm/s", "degrees", "V/mm", "t/mm3")
#: those that no column of evfem has, but by which a line is known as one of units
OTHERS = (
    "g kg mg lb lbs oz gram grams °C degC °F degF K A mA uA nA C nC uC pC F uF nF pF ohm Ohm kOhm MOhm Ω kΩ "
    "W mW rpm 1/s 1/min mm/s2 m/s2 N/s mN/s Pa/s MPa/s kPa/s V/s N*m Nm mNm T mT dB lx"
)


def spellings(unit: str) -> set[str]:
    """A unit with either of the two signs for micro.

    >>> sorted(spellings("um"))
    ['um', 'µm', 'μm']
    """
    micro = re.compile(r"(?<![A-Za-z])u(?=[A-Z]|m)|(?<![A-Za-z])u(?=s\b)")
    return {unit, micro.sub("µ", unit), micro.sub("μ", unit)}


#: unit -> the one that is meant without a word, and the number of these
UNITS: Mapping[str, tuple[str, float]] = {
    spelled: (base, size)
    for base, sizes in SIZES.items()
    for name, size in sizes.items()
    for spelled in sorted(spellings(name))
} | {spelled: (name, 1.0) for name in OTHERS.split() for spelled in sorted(spellings(name))}
#: those that a name can end with, and labels (`probe_A`) that are none
LABELS = ("1", "-", "%", "A", "C", "F", "K", "T", "W")
#: a number and what follows
AMOUNT = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([^\d\s.].*?)\s*")
BRACKETS = re.compile(r"\s*[_/,:]?\s*(?:\[([^\]]*)\]|\(([^)]*)\))")
#: a bracket beside that of the unit that is a word, and no factor as (x10)
WORD = re.compile(r"(?!x\s*\d)[^\W\d_].*")
#: unit in the middle of a name, which no word looks like
MIDDLE = re.compile(r"(?<=[_ /])(?:[µμunmkcM](?:m|V|N|Pa|Hz)2?|[mn]s|k?gf|lbf)(?=[_ /]).*")
GAP = re.compile(r"\s+in\s+|\s*[/,:]\s*|_|\s+")
SIGNED = re.compile(r"(.+?)\s*([/,:])\s*([^/,:]+)")
#: a number whose digits stand in threes, with points and with commas
BY_COMMAS = re.compile(r"[+-]?[1-9]\d{0,2}(?:,\d{3})+(?:\.\d*)?")
BY_POINTS = re.compile(r"[+-]?[1-9]\d{0,2}(?:\.\d{3})+(?:,\d*)?")


def plain_unit(text: str | None) -> str | None:
    """A unit as `UNITS` has it, without brackets and with plain exponents; None for nothing.

    >>> [plain_unit(text) for text in ("[mm^2]", "m/s²", "(kPa)", "")]
    ['mm2', 'm/s2', 'kPa', None]
    """
    text = (text or "").strip()
    if text[:1] + text[-1:] in ("[]", "()"):
        text = text[1:-1].strip()
    for sign, plain in (("²", "2"), ("⁻¹", "-1"), ("**", ""), ("^", ""), ("·", "*")):
        text = text.replace(sign, plain)
    return text or None


def can_be_text(unit: str) -> bool:
    """Whether a value of this unit may be a text with another one.

    >>> can_be_text("rad"), can_be_text("N/mm")
    (True, False)
    """
    return UNITS.get(unit, ("", 1.0))[0] in WRITTEN


def in_unit(key: str, value: object, unit: str, allowed: str) -> object:
    """A text such as "3 um" as a number of `unit`, another value as it is; `InputError` where it is in a unit
    of something else.

    >>> in_unit("width", "15 um", "mm", ""), in_unit("phase", "90°", "rad", ""), in_unit("width", 2, "mm", "")
    (0.015, 1.5707963267948966, 2)
    >>> in_unit("frequency", "5 ms", "Hz", "a frequency")
    Traceback (most recent call last):
    evfem.errors.InputError: frequency: given "5 ms"; allowed: a frequency, with Hz | mHz | kHz | MHz | GHz
    """
    found = AMOUNT.fullmatch(value) if isinstance(value, str) and can_be_text(unit) else None
    if found is None:
        return value
    base, size = UNITS[unit]
    same, factor = UNITS.get(plain_unit(found.group(2)) or "", ("", 1.0))
    if same != base:
        raise InputError(key, describe_value(value), f"{allowed}, with {' | '.join(SIZES[base])}")
    amount = float(found.group(1))
    return amount * (factor / size) if factor >= size else amount / (size / factor)  # rounded once


def named_unit(cell: str) -> tuple[str, str | None]:
    """Name and unit of a column: x [mm], x (mm), x/mm, "x, mm", x:mm; x_mm, x_N_mm and x mm, where
    the end is a unit that is known. What looks like a unit elsewhere and is not known is that of the column.

    >>> [named_unit(cell) for cell in ("Load [gf]", "pressure kPa", "v/mm/s", "normal_force", "z:furlong")]
    [('Load', 'gf'), ('pressure', 'kPa'), ('v', 'mm/s'), ('normal_force', None), ('z', 'furlong')]
    >>> [named_unit(cell) for cell in ("Load [mN] avg", "force_N_mm", "load_mN_raw")]
    [('Load avg', 'mN'), ('force', 'N/mm'), ('load', 'mN_raw')]
    """
    if brackets := list(BRACKETS.finditer(cell)):
        return _bracketed(cell, brackets)
    for gap in GAP.finditer(cell, 1):
        end = cell[gap.end() :]
        signed = any(sign in gap.group() for sign in "/,:")
        quotient = end if end.startswith("1") else re.sub("[_ ]", "/", end)  # x_1_mm: the first of some
        for unit in (plain_unit(end), plain_unit(quotient)):
            if unit in UNITS and (signed or unit not in LABELS):
                return cell[: gap.start()], unit
    if found := SIGNED.fullmatch(cell):
        return found.group(1), plain_unit(found.group(3))
    if middle := MIDDLE.search(cell, 1):
        return cell[: middle.start() - 1], middle.group()
    return cell, None


def _bracketed(cell: str, found: list[re.Match[str]]) -> tuple[str, str | None]:
    """Name and unit of a cell with brackets: the one that is known beside words; all where that is not so."""
    told = [plain_unit(one.group(1) or one.group(2)) for one in found]
    known = [i for i, unit in enumerate(told) if unit in UNITS]
    others = [unit for i, unit in enumerate(told) if i not in known and unit is not None]
    if len(known) == 1 and all(map(WORD.fullmatch, others)):
        one, unit = found[known[0]], told[known[0]]
    else:
        one, unit = found[-1], " and ".join(unit for unit in told if unit) or None
    return (cell[: one.start()] + cell[one.end() :]).strip() or cell, unit


class Head(NamedTuple):
    """Of a column the whole cell, the name in small letters, the unit, and a text above, which is the name
    where the cell is a unit that is not known.
    """

    cell: str
    name: str
    unit: str | None
    above: str = ""


def header(heads: list[list[str]]) -> list[Head]:
    """The heads of columns, of the lines of cells above the numbers: the last line, or the one before and
    units in the last, of which one that is known, or brackets round all, is a sign.

    >>> [(one.name, one.unit) for one in header([["Depth", "Load"], ["um", "furlong"]])]
    [('depth', 'um'), ('load', 'furlong')]
    """
    cells, said, above = (heads[-1] if heads else []), None, None
    if len(heads) > 1 and len(heads[-2]) == len(cells):
        if says_units(cells):
            cells, said = heads[-2], cells
        elif says_units([cell for cell in heads[-2] if cell not in LABELS]):
            said = heads[-2]
        else:
            above = heads[-2]
    blank = [""] * len(cells)
    found = zip(cells, said or blank, above or blank, strict=True)
    return [_head(cell, plain_unit(unit), name if is_text(name) else "") for cell, unit, name in found]


def _head(cell: str, said: str | None, above: str) -> Head:
    """The head of a column with its name in `cell` and a unit `said` in another line."""
    name, own = named_unit(cell)
    return both(Head(cell, name.lower(), own, above.lower()), said)


def both(head: Head, said: str | None) -> Head:
    """A head with a unit that another line says, too: where they differ, one that is not known."""
    own = head.unit
    known = own in UNITS and own not in ("1", "-")
    if said is None or UNITS.get(said, said) == UNITS.get(own or "", own):
        return head
    return head._replace(unit=f"{own} and {said}" if known else said)


def below(parts: list[Head], line: list[str]) -> list[Head]:
    """Heads with a shorter line under them: units, or what is not understood in columns without a unit."""
    told = [plain_unit(cell) for cell in line] + [None] * (len(parts) - len(line))
    if any(unit in UNITS for unit in told):
        return [both(one, unit) for one, unit in zip(parts, told, strict=True)]
    return [one._replace(unit=one.unit or unit) for one, unit in zip(parts, told, strict=True)]


def says_units(cells: list[str]) -> bool:
    """Whether a line is one of units."""
    told = [cell for cell in cells if plain_unit(cell) not in (None, "1", "-")]
    bracketed = all(cell[0] + cell[-1] in ("[]", "()") for cell in told)
    return bool(told) and (bracketed or any(plain_unit(cell) in UNITS for cell in told))


def is_text(cell: str) -> bool:
    """Whether there are letters in a cell."""
    return any(map(str.isalpha, cell))


def factor(key: str, name: str, unit: str | None, bases: Collection[str | None], more: str = "") -> float:
    """What the numbers of the column `name` are multiplied with to be in one of `bases`; `InputError`, whose
    end is `more`, where its `unit` is none of these.

    >>> factor("x", "depth", "um", ("mm",))
    0.001
    """
    base, size = UNITS.get(unit, (unit, 1.0)) if unit is not None else (None, 1.0)
    if base is None or base in {one or "1" for one in bases if one is not None}:
        return size
    rule = " | ".join(name for name, (base, _) in UNITS.items() if base in bases and name.isascii())
    raise InputError(key, f"{name} in {unit}", (rule or "no unit") + more)


def first_row(lines: list[tuple[int, str]]) -> int:
    """The first line of numbers: of one without a word, or else the last line, and those straight above it
    that have numbers or gaps where it has numbers, two or more.
    """
    rows = [(i, line) for i, (_, line) in enumerate(lines) if line[0] not in "#%"]
    pure = next((j for j, (_, line) in enumerate(rows) if _is_pure(line)), None)
    j = len(rows) - 1 if pure is None else pure
    last = _by_cell(rows[j][1]) if rows else []
    sign = [i for i, found in enumerate(last) if any(map(math.isfinite, found))]
    if len(sign) < 2:
        return len(lines) if pure is None else rows[j][0]
    while j > 0:
        before = _by_cell(rows[j - 1][1])
        finite = [i for i, found in enumerate(before) if any(map(math.isfinite, found))]
        if len(before) != len(last) or len(finite) < 2 or not all(before[i] for i in sign):
            break
        j -= 1
    return rows[j][0]


def _by_cell(line: str) -> list[list[float]]:
    """Of each cell of a line its number, NaN for a gap; nothing of a word."""
    return [_either([cell]) for cell in cells_in(line, separator_of(line))]


def _is_pure(line: str) -> bool:
    """Whether there are numbers and gaps alone in a line, two or more and not all gaps."""
    found = _either(cells_in(line, separator_of(line)))
    return len(found) > 1 and any(map(math.isfinite, found))


def _either(cells: list[str]) -> list[float]:
    """Numbers with points or commas."""
    return numbers_in(cells, False) or numbers_in(cells, True)


def separator_of(line: str) -> str | None:
    """What is between the cells, None for blanks."""
    return next((one for one in "\t;," if one in line), None)


def cells_in(line: str, separator: str | None) -> list[str]:
    """The cells of a line, without quotes and blanks round them."""
    if separator is None:
        return re.sub(r"\s+(?=[\[(])", "", line).split()
    try:
        (cells,) = csv.reader([line], delimiter=separator)
    except (csv.Error, ValueError):  # a carriage return within, or nothing
        cells = line.split(separator)
    return [cell.strip() for cell in cells]


def trimmed(cells: list[str]) -> list[str]:
    """Cells without the empty ones at the end, of separators there."""
    return cells[: max((i for i, cell in enumerate(cells, 1) if cell), default=0)]


def numbers_in(cells: list[str], comma: bool) -> list[float]:
    """Numbers of a line, with a decimal comma or point, NaN for gaps; none where one is something else."""
    try:
        values = [float(_pointed(cell, comma) or "nan") for cell in cells]
    except ValueError:
        return []
    return [] if any(map(math.isinf, values)) else values


def _pointed(cell: str, comma: bool) -> str:
    """A number with a decimal point, and nothing between its thousands."""
    if "," not in cell and not (comma and "." in cell):
        return cell
    if comma:
        return (cell.replace(".", "") if BY_POINTS.fullmatch(cell) else cell).replace(",", ".")
    return cell.replace(",", "") if BY_COMMAS.fullmatch(cell) else cell


def decimal_comma(cells: list[str], separator: str | None) -> bool:
    """Whether the commas in numbers are decimal ones: not if all stand before three digits, and points are
    decimal elsewhere, or commas between the columns.
    """
    commas = [cell for cell in cells if "," in cell]
    if not commas:
        return False
    points = separator == "," or any("." in cell and not BY_POINTS.fullmatch(cell) for cell in cells)
    return not (points and all(map(BY_COMMAS.fullmatch, commas)))
