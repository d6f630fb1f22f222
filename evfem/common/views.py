"""How objects show themselves: changed fields, tables and curves for notebooks, parameters in `help`."""

from __future__ import annotations

import html
import math
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from inspect import cleandoc
from textwrap import fill
from typing import Any

from evfem.common.checks import fields_of, keys_of

#: size of a curve in pixels
WIDTH, HEIGHT = 240, 48
LONGEST = 160
#: columns of what `help` says, and of what objects say of themselves
COLUMNS = 96
#: what is shown as 0, in any of our units
TINY = 1e-12


def changed(value: Any) -> dict[str, Any]:
    """The fields of a dataclass that differ from their defaults.

    >>> from dataclasses import dataclass
    >>> @dataclass
    ... class Slide:
    ...     distance: float
    ...     steps: int = 100
    ...     hold: str = "indentation"
    >>> changed(Slide(distance=5.0, steps=10))
    {'distance': 5.0, 'steps': 10}
    """
    shown = {}
    for spec in fields(value):
        default = spec.default if spec.default_factory is MISSING else spec.default_factory()
        found = getattr(value, spec.name)
        if spec.init and spec.repr and (default is MISSING or bool(found != default)):
            shown[spec.name] = found
    return shown


def called(name: str, arguments: Mapping[str, Any]) -> str:
    """The call that makes an object."""
    return f"{name}({', '.join(f'{key}={value!r}' for key, value in arguments.items())})"


def plus(value: float) -> float:
    """The number itself, with 0 for -0 and for what rounds to it in a table."""
    return 0.0 if abs(value) < TINY else float(value)


def plainly(value: Any) -> str:
    """The call that makes an object of a dataclass, without its defaults; nothing for an object of another
    class, or with a representation of its own, or of fields that are not compared.
    """
    if not is_dataclass(value) or not hasattr(type(value).__repr__, "__wrapped__"):
        return ""
    try:
        return called(type(value).__name__, changed(value))
    except ValueError:  # of arrays
        return ""


def screen(lines: Sequence[str]) -> str:
    """Lines broken between words, so that none is longer than a screen is wide."""
    width: Any = {"break_long_words": False, "break_on_hyphens": False}
    return "\n".join(fill(one, COLUMNS, subsequent_indent="    ", **width) for one in lines)


def short(value: Any) -> str:
    """The representation of a value on one line, cut to a readable length; of a dataclass what differs from
    its defaults.
    """
    text = " ".join((plainly(value) or repr(value)).split())
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def table(title: str, rows: Sequence[tuple[str, str]], below: str = "") -> str:
    """A small table in HTML; texts are escaped, `below` is HTML already.

    >>> table("a < b", [("force", "1 N")])
    '<table><caption>a &lt; b</caption><tr><th>force</th><td>1 N</td></tr></table>'
    """
    lines = [f"<tr><th>{html.escape(key)}</th><td>{html.escape(text)}</td></tr>" for key, text in rows]
    foot = f'<tr><td colspan="2">{below}</td></tr>' if below else ""
    return f"<table><caption>{html.escape(title)}</caption>{''.join(lines)}{foot}</table>"


def curves(lines: Mapping[str, tuple[str, Sequence[float]]]) -> str:
    """Curves over their number, {name: (colour, values)}, on one scale with zero in it, as a small SVG."""
    finite = [0.0, *(v for _, values in lines.values() for v in values if math.isfinite(v))]
    longest = max(len(values) for _, values in lines.values())
    step, height = max(longest // WIDTH, 1), max(finite) - min(finite) or 1.0
    drawn = ""
    for name, (colour, values) in lines.items():
        picked = ((i, values[i]) for i in range(0, len(values), step) if math.isfinite(values[i]))
        points = " ".join(f"{i},{-value:.6g}" for i, value in picked)
        style = f'stroke="{colour}" stroke-width="1.5" vector-effect="non-scaling-stroke"'
        title = f"<title>{html.escape(name)}</title>"
        drawn += f'<polyline fill="none" {style} points="{points}">{title}</polyline>'
    box = f'viewBox="0 {-max(finite):.6g} {longest - 1} {height:.6g}" preserveAspectRatio="none"'
    return f'<svg width="{WIDTH}" height="{HEIGHT}" overflow="visible" {box} role="img">{drawn}</svg>'


def describe(cls: Any) -> None:
    """Let `help` say the parameters of a dataclass, from their annotations: type, meaning and range."""
    keys = keys_of(cls) if isinstance(cls, type) and is_dataclass(cls) else ()
    if not keys:
        return
    lines = []
    for key in keys:
        words = (
            key.meaning if key.annotation is bool or key.allowed.startswith("a table [") else key.documented
        )
        lines += [key.field, fill(words, COLUMNS, initial_indent="    ", subsequent_indent="    ")]
    cls.__doc__ = "\n".join([cleandoc(cls.__doc__ or ""), "", "Parameters", "----------", *lines])
    plain = {key.field: key.annotation for key in fields_of(cls) if key.rule}
    cls.__init__.__annotations__ = {**cls.__init__.__annotations__, **plain}
