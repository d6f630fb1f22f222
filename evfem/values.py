"""Checks of numbers that come one by one or in arrays; plain numbers where a single one went in."""

from __future__ import annotations

from typing import Any

import numpy as np

from evfem.errors import InputError

Values = Any  # a number, or an array of numbers: real, or complex in a complex step


def plain(value: Values) -> Values:
    """A Python number for a single value, the array itself otherwise.

    >>> plain(np.array(2.5))
    2.5
    """
    return value.item() if np.ndim(value) == 0 and isinstance(value, (np.ndarray, np.generic)) else value


def above(key: str, given: Values, lowest: float, allowed: str) -> Values:
    """`given` as float or array of floats, all finite and (by their real part) > `lowest`.

    >>> above("area", -1.0, 0.0, "an area in mm2 above zero")
    Traceback (most recent call last):
    evfem.errors.InputError: area: given -1.0; allowed: an area in mm2 above zero
    """
    value = finite(key, given, allowed)
    if not np.all(np.real(value) > lowest):
        raise InputError(key, _worst(given), allowed)
    return value


def at_least(key: str, given: Values, lowest: float, allowed: str) -> Values:
    """As `above`, with `lowest` itself allowed."""
    value = finite(key, given, allowed)
    if not np.all(np.real(value) >= lowest):
        raise InputError(key, _worst(given), allowed)
    return value


def finite(key: str, given: Values, allowed: str) -> Values:
    """`given` as float or array of floats (complex if it was), all finite."""
    try:
        value = np.asarray(given)
    except ValueError as error:  # rows of different length
        raise InputError(key, given, allowed) from error
    if value.dtype.kind not in "iufc" or not np.all(np.isfinite(value)):
        raise InputError(key, given, allowed)
    return plain(value * 1.0)


def _worst(given: Values) -> Values:
    """The smallest of the values, so that a long array does not flood the message."""
    return float(np.min(np.real(given)))
