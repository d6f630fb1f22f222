"""Reads the tables of a scene file into the dataclasses that they describe; every mistake is one sentence.

The keys of a table are the annotated fields of its dataclass (`evfem.common.checks.Key`). What a value may
be its constructor judges, whoever calls it: nothing here knows of a single key.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import is_dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, get_origin

from evfem.common.checks import RENAMED_KEYS, Key, keys_of
from evfem.errors import ABSENT, MEANT, InputError, Mistakes, closest_name, combine, readable, unknown

#: of the format
VERSION = 1
#: largest file of numbers, in bytes
LARGEST_TABLE = 64 * 2**20


def names(*classes: Any) -> list[str]:
    """The keys of tables."""
    return [key.name for cls in classes for key in keys_of(cls)]


def read(
    cls: Any,
    table: Any,
    prefix: str,
    folder: Path = Path(),
    *,
    tag: str = "",
    beside: Sequence[str] = (),
    homes: Mapping[str, Collection[Any]] | None = None,
    kinds: Mapping[str, Any] = MappingProxyType({}),
    **extra: Any,
) -> Any:
    """What a table describes, or all mistakes in it: first unknown keys, then others but the lack of what an
    unknown one may stand for. Paths start at `folder`; the key `tag` and those of somebody else's may stand
    `beside`; `homes` are other tables and `kinds` all of this one by their `tag`, whose keys may have been
    meant; `extra` are fields that no file has.
    """
    if not isinstance(table, Mapping):
        raise InputError(prefix, shown(table), f"a table [{prefix}]")
    keys = keys_of(cls)
    known = list(dict.fromkeys([*([tag] if tag else []), *(key.name for key in keys), *beside]))
    mistakes, meant = Mistakes(), set[str]()
    for name, value in table.items():
        path = _join(prefix, name)
        if name in known:
            continue
        if path in RENAMED_KEYS:
            mistakes.found.append(InputError(path, shown(value), RENAMED_KEYS[path]))
        else:
            mistakes.found.append(_unknown_key(path, name, known, homes or {}, kinds, tag))
            meant |= {*closest_name(name, known)}
    for key in keys:
        with mistakes.of_a_part(), at(prefix):
            if key.name in table:
                extra[key.field] = _value(key, table[key.name], _join(prefix, key.name), folder)
            elif key.required and key.name not in meant:
                raise InputError(key.name, ABSENT, key.allowed)
    mistakes.report()
    with at(prefix):
        made = cls(**extra)
        return made.made() if hasattr(made, "made") else made


def read_kind(
    table: Any, prefix: str, kinds: Mapping[str, Any], folder: Path = Path(), tag: str = "kind", **more: Any
) -> Any:
    """What a table describes that says by its key `tag` which of `kinds` it is."""
    cls = kinds[kind_of(table, prefix, kinds, tag)]
    return read(cls, table, prefix, folder, tag=tag, kinds=kinds, **more)


def _value(key: Key, entry: Any, prefix: str, folder: Path) -> Any:
    """The value of a key: of a table the object that it describes, of a path that of the file."""
    rule, types = key.rule, key.types
    several = any(get_origin(one) is Mapping for one in types)
    if several and not isinstance(entry, Mapping):
        raise InputError(key.name, shown(entry), key.allowed)
    if several and "kinds" in rule:
        mistakes, found = Mistakes(), {}
        for name, table in entry.items():
            with mistakes.of_a_part():
                found[name] = read_kind(table, f"{prefix}.{name}", rule["kinds"](), folder, rule["tag"])
        mistakes.report()
        return found
    if "kinds" in rule and isinstance(entry, Mapping):
        return read_kind(entry, prefix, rule["kinds"](), folder, rule.get("tag", "kind"))
    inner: Any = next((one for one in types if is_dataclass(one)), None)
    if inner is not None and keys_of(inner):
        return read(inner, entry, prefix, folder)
    file = rule.get("file", False)
    if isinstance(entry, str) and (file(entry) if callable(file) else file):
        entry = folder / entry
        check_size(key.name, entry, LARGEST_TABLE if callable(file) or file is True else file)
    return rule["check"](key.name, entry) if "check" in rule else entry


def _unknown_key(
    key: str,
    name: str,
    known: Sequence[str],
    homes: Mapping[str, Collection[Any]],
    kinds: Mapping[str, Any],
    tag: str,
) -> InputError:
    """The error for a key that its table does not have, and which kind of it or other table has it."""
    mistake, close = unknown(key, name, known), closest_name(name, known)
    for meant in (name, *([] if close else MEANT.get(name.lower(), "").split())):
        if having := [kind for kind, cls in kinds.items() if meant in names(cls)]:
            told = f"{meant} with {tag} = {' | '.join(having)}? ({', '.join(known)})"
            return InputError(key, mistake.given, told)
    home = next((table for table, classes in homes.items() if name in names(*classes)), "")
    here = re.sub(r"\[\d+\]", "", key.rpartition(".")[0])
    if home.strip("[]") in ("", here) or close:
        return mistake
    return InputError(key, mistake.given, f"{name} in {home}? ({', '.join(known)})")


def check_size(key: str, path: Path, most: int) -> None:
    """Raise InputError for a path that is no file, or a file of more than `most` bytes."""
    try:
        size = path.stat().st_size
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the path
        reason = getattr(error, "strerror", None) or "no path"
        problem, allowed = f"{shown(str(path))} ({reason})", "a file that exists and can be read"
        beside = _beside(path)
        close = [one for one in beside if one == f"{path.name}.toml"] or closest_name(path.name, beside)
        raise InputError(key, problem, f"{close[0]}? ({allowed})" if close else allowed) from error
    if not path.is_file():
        raise InputError(key, f"{path}, which is no file", "a file")
    if size > most:
        raise InputError(key, f"{path} with {size / 2**20:.0f} MB", f"a file of at most {most // 2**20} MB")


def _beside(path: Path) -> list[str]:
    """Names of the files in the folder of a path."""
    try:
        return [one.name for one in path.parent.iterdir()]
    except (OSError, ValueError):
        return []


def columns(key: str, rows: list[list[float]]) -> tuple[list[float], list[float]]:
    """Rows of two numbers as two columns."""
    for i, row in enumerate(rows):
        if not isinstance(row, list) or len(row) != 2:
            raise InputError(f"{key}[{i}]", shown(row), "a row of two numbers")
    return [row[0] for row in rows], [row[1] for row in rows]


def kind_of(table: Any, prefix: str, kinds: Mapping[str, Any], key: str = "kind") -> str:
    """The kind that a table says it is by its `key`, one of `kinds`."""
    if not isinstance(table, Mapping):
        raise InputError(prefix, shown(table), f"a table with {key} = {' | '.join(kinds)} and its keys")
    kind = table.get(key, ABSENT)
    if not isinstance(kind, str) or kind not in kinds:
        problem = ABSENT if kind is ABSENT else shown(kind)
        raise InputError(f"{prefix}.{key}", problem, " | ".join(kinds))
    return kind


def _join(prefix: str, name: str) -> str:
    return f"{prefix}.{name}" if prefix else name


def shown(value: object) -> str:
    """A value as it stands in the file, cut to a readable length."""
    text = str(value).lower() if isinstance(value, bool) else readable(value)
    return text if len(text) <= 80 else text[:77] + "..."


@contextmanager
def at(prefix: str, renamed: Mapping[str, str] = MappingProxyType({})) -> Iterator[None]:
    """Errors raised inside name the key as it stands in the file, in the table `prefix`."""
    try:
        yield
    except InputError as error:
        raise combine([_moved(one, prefix, renamed) for one in error.mistakes]) from None


def _moved(mistake: InputError, prefix: str, renamed: Mapping[str, str]) -> InputError:
    key, problem = renamed.get(mistake.key, mistake.key), mistake.given
    if key == mistake.key and _table_of(key) != _table_of(prefix):
        key = _join(prefix, key)
    return InputError(
        key, problem if problem is ABSENT or isinstance(problem, str) else shown(problem), mistake.allowed
    )


def _table_of(key: str) -> str:
    return re.split(r"[.\[]", key)[0]
