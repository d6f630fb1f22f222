"""Requests of the page: a texture, a finger, a display; checked as strictly as a file.

The page keeps all of it, the server nothing: two pages cannot mix, and a link holds what it shows.
A texture that was drawn or uploaded travels as its rows.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from evfem.errors import InputError, describe_value
from evfem.estimate.display import Device, ExactCurve
from evfem.estimate.touch import FrictionCurve, Touch
from evfem.scene.keys import read
from evfem.textures.generate import Knobs, make
from evfem.textures.library import reference
from evfem.textures.texture import Texture

#: most rows of a texture, and of a friction curve, that a page sends
MOST_ROWS = 2000
#: largest size of the numbers in a curve
LARGEST = {"x": 1e4, "voltage": 1e5, "friction": 100.0}
KEYS = ("texture", "touch", "device")
ROWS = ("name", "kind", "x", "values", "licence", "quantity", "period", "provenance")


@dataclass(frozen=True)
class State:
    """Everything that decides what the page shows; `model` is the model's friction curve where the
    page has one for this texture and touch, `exact` its voltage for this display as well.

    >>> state = parse('{"texture": {"reference": "weave"}, "touch": {"load": 0.04}}')
    >>> state.texture.name, state.touch.load, state.device.law
    ('weave', 0.04, 'kaczmarek')
    """

    texture: Texture
    touch: Touch
    device: Device
    model: FrictionCurve | None = None
    exact: ExactCurve | None = None


def parse(text: str | bytes) -> State:
    """The state in a JSON text; InputError for anything else."""
    try:
        table = json.loads(text)
    except (ValueError, RecursionError):
        raise InputError("state", "no JSON", "what the page sends") from None
    table = _table("state", table, (*KEYS, "model", "exact"))
    return State(
        _texture(table.get("texture", {"reference": "weave"})),
        read(Touch, table.get("touch", {}), "touch"),
        read(Device, table.get("device", {}), "device"),
        _curve("model", table, ("x", "friction"), partial(FrictionCurve, source="model")),
        _curve("exact", table, ("x", "voltage", "friction"), ExactCurve),
    )


def _table(key: str, entry: Any, keys: tuple[str, ...]) -> Mapping[str, Any]:
    if not isinstance(entry, dict):
        raise InputError(key, describe_value(entry), "an object")
    odd = sorted(set(entry) - set(keys))
    if odd:
        raise InputError(key, describe_value(odd[0]), ", ".join(keys))
    return entry


def _texture(entry: Any) -> Texture:
    """A reference texture, one by three knobs, or one by its rows."""
    if isinstance(entry, dict) and "reference" in entry:
        return reference(_table("texture", entry, ("reference",))["reference"])
    if isinstance(entry, dict) and "generator" in entry:
        return make(entry["generator"], read(Knobs, entry, "texture", tag="generator"), "dialled")
    table = _table("texture", entry, ROWS)
    missing = [key for key in ("x", "values", "licence") if key not in table]
    if missing:
        raise InputError("texture", f"no {missing[0]}", f"reference, generator, or {', '.join(ROWS)}")
    size = len(table["x"]) if isinstance(table["x"], list) else 0
    if not 2 <= size <= MOST_ROWS:
        raise InputError("texture", f"{size} rows", f"2 to {MOST_ROWS} rows")
    return Texture(**{"name": "drawn", "kind": "drawn", **table})


def rows(texture: Texture) -> dict[str, Any]:
    """A texture as the page keeps it: at most `MOST_ROWS` rows, others in between left out."""
    x, values, notes = texture.x, texture.values, list(texture.provenance)
    if x.size > MOST_ROWS:
        few = np.linspace(x[0], x[-1], MOST_ROWS)
        x, values = few, np.interp(few, x, values)
        notes.append(f"{MOST_ROWS} of {texture.x.size} rows kept by the studio.")
    numbers = {"x": np.round(x, 6).tolist(), "values": np.round(values, 8).tolist()}
    return {name: getattr(texture, name) for name in ROWS} | numbers | {"provenance": notes}


def _curve(key: str, state: Mapping[str, Any], names: tuple[str, ...], kind: Callable[..., Any]) -> Any:
    """A curve of this kind by its columns of numbers over a rising x, within `LARGEST` of each, if given."""
    if state.get(key) is None:
        return None
    table = _table(key, state[key], names)
    columns = [np.asarray(table.get(name, []), dtype=object) for name in names]
    numbers = all(type(value) in (int, float) for one in columns for value in one.ravel())
    if len({one.shape for one in columns}) != 1 or columns[0].ndim != 1 or not numbers:
        raise InputError(key, "another shape", f"as many numbers in each of {', '.join(names)}")
    if not 16 <= columns[0].size <= MOST_ROWS:
        raise InputError(key, f"{columns[0].size} numbers", f"16 to {MOST_ROWS} in each column")
    try:
        found = [one.astype(float) for one in columns]
    except OverflowError:  # a whole number of more than 308 digits
        raise InputError(key, "numbers out of range", "a curve of the model") from None
    if not all(np.isfinite(one).all() for one in found) or not (np.diff(found[0]) > 0.0).all():
        raise InputError(key, "numbers that are not finite or do not rise", "a curve of the model")
    if any(np.abs(one).max() > LARGEST[name] for one, name in zip(found, names, strict=True)):
        raise InputError(key, "numbers out of range", "a curve of the model")
    return kind(*found)
