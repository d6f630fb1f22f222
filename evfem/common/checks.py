"""Validation of user input: each check returns the clean value or raises InputError.

First checks of single values (`real`, `count`, `choice`), then of numbers or arrays of numbers
(`above`, `at_least`, `finite`), then rules that the fields of a dataclass carry: `check_fields` applies
them, and a scene file is read, written and described by them (`evfem.scene.keys`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from functools import cache
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Any, ClassVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from evfem.common.units import in_unit
from evfem.errors import InputError, Mistakes, describe_value

MOST_STEPS = 1_000_000
#: removed keys, or values of keys, and what replaces them, for one release
RENAMED_KEYS = {
    "solver.symmetry": "nothing: gone since 0.3, the whole finger is computed",
    "electrostatics.coupling": "nothing: the staggered coupling was removed in 0.4.0 (the equilibria of "
    "staggered are those of monolithic); leave the key out",
}
Values = Any  # a number, or an array of numbers: real, or complex in a complex step


def real(
    key: str, value: object, allowed: str, test: Callable[[float], bool] = lambda x: True, unit: str = ""
) -> float:
    """`value` as a finite float that passes `test`; where there is a `unit`, a text may have another one.

    >>> real("gap", 1, "a gap in mm, not negative", lambda gap: gap >= 0)
    1.0
    >>> real("gap", "15 um", "a gap in mm", unit="mm")
    0.015
    """
    value = in_unit(key, value, unit, allowed)
    if isinstance(value, bool) or not isinstance(value, Real):
        raise InputError(key, describe_value(value), _bare(value, allowed))
    try:
        number = float(value)
    except OverflowError:  # an integer beyond all floats
        number = math.inf
    if not (math.isfinite(number) and test(number)):
        raise InputError(key, describe_value(value), allowed)
    return number


def _bare(value: object, allowed: str) -> str:
    """What is allowed in place of a value that is no number; of a text that was to be one, how it is written.

    >>> _bare("0.5 N", "a force in N/mm"), _bare("soft", "0 to 1 MPa")
    ('a number without quotes and unit, a force in N/mm', 'a number, 0 to 1 MPa')
    """
    if not isinstance(value, str) or allowed.startswith("a number"):
        return allowed
    if value.strip()[:1] in tuple("+-.0123456789"):
        return f"a number without quotes and unit, {allowed}"
    return f"a number, {allowed}" if allowed.lstrip("-")[:1].isdigit() else allowed


def count(key: str, value: object, most: int = MOST_STEPS, least: int = 1, allowed: str = "") -> int:
    """`value` as a whole number from `least` to `most`.

    >>> count("steps", 2.5)
    Traceback (most recent call last):
    evfem.errors.InputError: steps: given 2.5; allowed: a whole number from 1 to 1000000
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or not least <= int(value) <= most:
        raise InputError(key, describe_value(value), allowed or f"a whole number from {least} to {most}")
    return int(value)


def choice(key: str, value: object, names: Collection[str]) -> str:
    """`value` if it is one of `names`."""
    if not isinstance(value, str) or value not in names:
        raise InputError(key, describe_value(value), " | ".join(names))
    return value


def to_python(value: Values) -> Values:
    """A Python number for a single value, the array itself otherwise."""
    return value.item() if isinstance(value, (np.ndarray, np.generic)) and value.ndim == 0 else value


def above(key: str, entered: Values, lowest: float, allowed: str) -> Values:
    """`entered` as float or array of floats, all finite and (by their real part) > `lowest`.

    >>> above("area", -1.0, 0.0, "an area in mm2 above zero")
    Traceback (most recent call last):
    evfem.errors.InputError: area: given -1.0; allowed: an area in mm2 above zero
    """
    value = finite(key, entered, allowed)
    if not np.all(np.real(value) > lowest):  # the smallest alone, so that no long array floods the message
        raise InputError(key, float(np.min(np.real(entered))), allowed)
    return value


def at_least(key: str, entered: Values, lowest: float, allowed: str) -> Values:
    """As `above`, but `lowest` itself is admissible."""
    value = finite(key, entered, allowed)
    if not np.all(np.real(value) >= lowest):
        raise InputError(key, float(np.min(np.real(entered))), allowed)
    return value


def finite(key: str, entered: Values, allowed: str) -> Values:
    """`entered` as float or array of floats (complex if it was), all finite and none masked."""
    try:
        value = np.asarray(entered)
    except ValueError as error:  # rows of different length
        raise InputError(key, describe_value(entered), allowed) from error
    if value.dtype.kind not in "iufc" or np.ma.is_masked(entered) or not np.all(np.isfinite(value)):
        raise InputError(key, describe_value(entered), _bare(entered, allowed))
    return to_python(value * 1.0)


def set_frozen(target: object, **values: object) -> None:
    """Store checked values in a frozen dataclass under construction."""
    for name, value in values.items():
        object.__setattr__(target, name, value)


@dataclass(frozen=True)
class Within:
    """The test of a number from `low` to `high`; `low` itself is out where it is `above`, `high` where it is
    `below`, and 0 where it is `not_zero`.

    >>> Within(0.0, 200.0)(0.0), Within(0.0, above=True)(0.0), Within(-1.0, 1.0, not_zero=True)(0.0)
    (True, False, False)
    """

    low: float = -math.inf
    high: float = math.inf
    above: bool = False
    below: bool = False
    not_zero: bool = False

    def __call__(self, value: float) -> bool:
        edge = (self.above and value == self.low) or (self.below and value == self.high)
        return self.low <= value <= self.high and not edge and not (self.not_zero and value == 0.0)


def number(allowed: str, test: Callable[[float], bool], unit: str = "") -> dict[str, Any]:
    """Rule of a field that is a finite float and passes `test`; `allowed` says so in words."""
    check = lambda key, value: real(key, value, allowed, test, unit)  # noqa: E731
    return {"allowed": allowed, "check": check, "test": test, "unit": unit}


def several(allowed: str, test: Callable[[float], bool], unit: str = "") -> dict[str, Any]:
    """Rule of a field that is a number or a list of them, kept as a tuple."""

    def check(key: str, entered: Any) -> tuple[float, ...]:
        alone = isinstance(entered, str) or not isinstance(entered, Sequence | np.ndarray)
        values = (entered,) if alone else tuple(entered)
        return tuple(real(key, value, allowed, test, unit) for value in values)

    return {"allowed": allowed, "check": check, "unit": unit, "type": float | list[float]}


def between(low: float, high: float, unit: str = "", *, of: str = "") -> dict[str, Any]:
    """Rule of a field that is a number within a range; `of` names what a fraction is relative to.

    >>> between(12.0, 24.0, "mm")["allowed"]
    '12 to 24 mm'
    """
    return number(f"{low:g} to {high:g} {of or unit}".rstrip(), Within(low, high), unit)


def whole(most: int = MOST_STEPS, least: int = 1, allowed: str = "") -> dict[str, Any]:
    """Rule of a field that is a whole number from `least` to `most`."""
    allowed = allowed or f"a whole number from {least} to {most}"
    check = lambda key, value: count(key, value, most, least, allowed)  # noqa: E731
    return {"allowed": allowed, "check": check, "test": Within(least, most)}


SEED = whole(2**63 - 1, 0, "a whole number, not negative")


def one_of(*names: str) -> dict[str, Any]:
    """Rule of a field that is one of `names`."""
    return among(names)


def among(names: Collection[str]) -> dict[str, Any]:
    """Rule of a field that is one of `names`, of which there may be more later."""
    return {"check": lambda key, value: choice(key, value, names), "names": names}


def yes_or_no() -> dict[str, Any]:
    """Rule of a field that is True or False."""
    return {"allowed": "true | false", "check": truth}


def truth(key: str, value: object) -> bool:
    """`value` if it is True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise InputError(key, describe_value(value), "true | false")
    return bool(value)


def instance(allowed: str, *classes: Any, unit: str = "") -> dict[str, Any]:
    """Rule of a field that is of one of these classes."""

    def check(key: str, value: Any) -> Any:
        if not isinstance(value, classes) or (isinstance(value, bool) and bool not in classes):
            raise InputError(key, describe_value(value), allowed)
        return value

    return {"allowed": allowed, "check": check, "unit": unit}


@dataclass(frozen=True)
class Key:
    """What a field of a dataclass is to who sets it: the type and the default of the field, and from its
    annotation `Annotated[type, rule, meaning]` the rule it obeys and what it means, in words.

    A rule has what is `allowed`, in words, and where there is one the `check` of a value, its `test` or
    `names` to choose from, and its `unit`; where a file has it otherwise, its `key` and `type` there.
    """

    field: str
    annotation: Any
    default: Any
    rule: Mapping[str, Any]
    meaning: str

    @property
    def name(self) -> str:
        """How a file calls it."""
        return str(self.rule.get("key", self.field))

    @property
    def allowed(self) -> str:
        """What it may be, in words."""
        return self.rule.get("allowed") or " | ".join(self.rule["names"])

    @property
    def documented(self) -> str:
        """What it means and may be, in words."""
        unit = f" ({self.rule['unit']})" if self.rule.get("unit") else ""
        return f"{self.meaning}{unit}. Allowed: {self.allowed}"

    @property
    def required(self) -> bool:
        """Whether it must be given."""
        return self.default is MISSING

    @property
    def types(self) -> tuple[Any, ...]:
        """What a value in a file may be; there is no None in a file."""
        entered = self.rule.get("type", self.annotation)
        union = isinstance(entered, UnionType) or get_origin(entered) is Union
        return tuple(one for one in (get_args(entered) if union else (entered,)) if one is not NoneType)


@cache
def fields_of(cls: type) -> tuple[Key, ...]:
    """The fields of a dataclass that its constructor takes, whether they say what they mean or not."""
    hints, found = get_type_hints(cls, include_extras=True), []
    for spec in fields(cls):
        hint = hints[spec.name]
        about = getattr(hint, "__metadata__", ())
        rule = dict(spec.metadata)
        for one in about:
            rule |= one if isinstance(one, dict) else {}
        meaning = "".join([one for one in about if isinstance(one, str)][-1:])
        default = spec.default if spec.default_factory is MISSING else spec.default_factory()
        if spec.init:
            found.append(Key(spec.name, hint.__origin__ if about else hint, default, rule, meaning))
    return tuple(found)


def keys_of(cls: type) -> tuple[Key, ...]:
    """The fields of a dataclass that say what they mean: the keys of its table in a file.

    >>> from evfem.scene.motion import Hover
    >>> key, _ = keys_of(Hover)
    >>> key.name, key.rule["unit"], key.meaning, key.required
    ('gap', 'mm', 'of the undeformed outline to the surface', True)
    """
    return tuple(key for key in fields_of(cls) if key.meaning)


def check_fields(target: Any, prefix: str = "") -> None:
    """Check and store every field of a frozen dataclass that has a rule; a default None may stay
    None. All mistakes are reported at once, under `prefix`.

    >>> from evfem.scene.motion import Hover
    >>> Hover(1).gap
    1.0
    >>> Hover(-1)
    Traceback (most recent call last):
    evfem.errors.InputError: gap: given -1; allowed: a gap in mm from 0 to 200
    """
    mistakes = Mistakes()
    cls: Any = type(target)
    for key in fields_of(cls):
        if "check" not in key.rule or ((value := getattr(target, key.field)) is None and key.default is None):
            continue
        with mistakes.of_a_part():
            set_frozen(target, **{key.field: key.rule["check"](prefix + key.name, value)})
    mistakes.report()


class Checked:
    """A frozen dataclass whose fields obey their annotations' rules; sentences begin with `_table`."""

    _table = ""

    def __post_init__(self) -> None:
        check_fields(self, self._table)


class Named(Checked):
    """A class with a name in files; `class Own(Family, kind="own")` adds to its family's live dict."""

    kind: ClassVar[str]
    kinds: ClassVar[dict[str, Any]]

    def __init_subclass__(cls, kind: str = "") -> None:
        if Named in cls.__bases__:
            cls.kinds = {}
        if kind:
            cls.kind, cls.kinds[kind] = kind, cls
