"""Damage to files: at random places, and with the values that programs trip over."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from random import Random

import numpy as np

#: what numbers and words of a text are replaced with
NASTY = (
    *("nan", "inf", "-inf", "1e400", "-1e308", "1e308", "5e-324", "0", "-0.0", "-1", "1e-300", "1e300"),
    *("2147483648", "4294967295", "9223372036854775808", "1000000000", "1000000", "1e6", "0.5", "1_0", "١٢"),
    *("true", "false", "None", "[]", "{}", "''", "[[]]", "[[1.0]]", "[nan]", "[[1.0, 2.0, 3.0, 4.0]]"),
    *(
        "07:32:00",
        "1979-05-27T07:32:00Z",
        "'../../../etc/passwd'",
        '"/dev/zero"',
        '"."',
        '"text"',
        '"\\u0000"',
    ),
    *("\x00", "\ufeff", "\u202e", "&lol;", '<!DOCTYPE a [<!ENTITY b "c">]>'),
    *("9" * 400, "9" * 5000, "0x" + "f" * 5000, '"' + "x" * 100_000 + '"'),
    *("[" * 50 + "]" * 50, "[" * 3000 + "]" * 3000, "{a = " * 60 + "1" + "}" * 60),
    *("$NodeData\n1000000000000\n", "$Periodic\n1000000000\n", "__import__('os').system('touch owned')"),
)
WORD = re.compile(r"[-+.\w]+|'[^']*'|\"[^\"]*\"")
LINES = (
    "a" + ".a" * 3000 + " = 1\n",
    "[[motion]]\nkind = 'slide'\ndistance = 1.0\nsteps = 1000000\n" * 3,
    "[[motion]]\nkind = 'press'\nindentation = 1.0\nsteps = 1000000000\n",
    "[finger]\nresolution = 'fine'\n",
    "[solver]\nelement = 'p2'\n",
    "unknown = 1\n",
    "=\n",
    "\x00\x01\n",
    "1,2,3\n",
    "1\n" * 1000,
    "-5.0,1.0\n",
    "0.0,1e9\n",
)


def mutated(content: bytes, rng: Random) -> bytes:
    """Bytes flipped, cut out, put in, repeated, cut off, or all of them random."""
    for _ in range(rng.choice((1, 1, 2, 5))):
        content = rng.choice(BYTES)(content, rng)
    return content


def mutated_text(text: str, rng: Random) -> bytes:
    """Words replaced, lines lost, repeated, put in or swapped; sometimes bytes as well."""
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        text = rng.choice(TEXTS)(text, rng)
    content = text.encode("utf-8", "surrogatepass")
    return mutated(content, rng) if rng.random() < 0.2 else content


def mutated_arrays(arrays: Mapping[str, np.ndarray], rng: Random) -> dict[str, np.ndarray]:
    """Arrays lost, of another kind or shape, with other values, or objects that run code if
    unpickled.
    """
    changed = dict(arrays)
    for _ in range(rng.choice((1, 1, 2))):
        name = rng.choice(sorted(changed))
        changed[name] = rng.choice(ARRAYS)(changed[name], rng)
        if rng.random() < 0.1:
            changed.pop(name)
    return changed or {"nothing": np.zeros(1)}


def _place(content: bytes, rng: Random) -> tuple[int, int]:
    start = rng.randint(0, len(content))
    return start, min(len(content), start + rng.choice((1, 4, 8, 100, 5000)))


def _flip(content: bytes, rng: Random) -> bytes:
    data = bytearray(content)
    for _ in range(rng.choice((1, 1, 3, 20)) if data else 0):
        data[rng.randint(0, len(data) - 1)] ^= 1 << rng.randint(0, 7)
    return bytes(data)


def _cut_out(content: bytes, rng: Random) -> bytes:
    start, end = _place(content, rng)
    return content[:start] + content[end:]


def _put_in(content: bytes, rng: Random) -> bytes:
    start, _ = _place(content, rng)
    return (
        content[:start]
        + rng.choice((b"\xff" * 8, b"\x00" * 8, b"\x7f" * 4, rng.randbytes(16)))
        + content[start:]
    )


def _write_over(content: bytes, rng: Random) -> bytes:
    start, _ = _place(content, rng)
    new = rng.choice((b"\xff" * 8, b"\x00" * 8, b"\xff\xff\xff\x7f", rng.randbytes(8)))
    return content[:start] + new + content[start + len(new) :]


def _repeat(content: bytes, rng: Random) -> bytes:
    start, end = _place(content, rng)
    return content[:end] + content[start:end] * rng.choice((1, 3)) + content[end:]


def _cut_off(content: bytes, rng: Random) -> bytes:
    return content[: rng.randint(0, len(content))]


def _any(content: bytes, rng: Random) -> bytes:
    return rng.randbytes(rng.randint(0, 300))


def _word(text: str, rng: Random) -> str:
    words = list(WORD.finditer(text))
    if not words:
        return text
    found = rng.choice(words)
    return text[: found.start()] + rng.choice(NASTY) + text[found.end() :]


def _number(text: str, rng: Random) -> str:
    words = [word for word in WORD.finditer(text) if word[0].lstrip("+-.")[:1].isdigit()]
    if not words:
        return text
    found = rng.choice(words)
    factor = rng.choice((-1, 0, 2, 10, 1e-3, 1e3, 1e9, 1e-12))
    try:
        new = repr(float(found[0]) * factor)
    except ValueError:
        new = "1"
    return text[: found.start()] + rng.choice((new, new.split(".")[0])) + text[found.end() :]


def _lines(text: str, rng: Random) -> str:
    lines = text.splitlines(keepends=True)
    if not lines:
        return text
    i, j = rng.randint(0, len(lines) - 1), rng.randint(0, len(lines) - 1)
    how = rng.choice(("lose", "repeat", "swap", "put in"))
    if how == "lose":
        lines.pop(i)
    elif how == "repeat":
        lines.insert(i, lines[j])
    elif how == "swap":
        lines[i], lines[j] = lines[j], lines[i]
    else:
        lines.insert(i, rng.choice(LINES))
    return "".join(lines)


class _Payload:
    """Runs a function when unpickled."""

    def __reduce__(self) -> tuple[Callable[..., object], tuple[str, str]]:
        return open, ("owned", "w")


def _other_kind(array: np.ndarray, rng: Random) -> np.ndarray:
    dtype = rng.choice(("f4", ">f8", "i8", "u1", "?", "U3", "S4", "c16", "M8[s]"))
    with np.errstate(all="ignore"):
        return array.astype(dtype) if array.dtype.kind not in "U" else np.array([1.0, 2.0]).astype(dtype)


def _other_shape(array: np.ndarray, rng: Random) -> np.ndarray:
    flat = array.ravel()
    return rng.choice((flat[:-1], flat[:0], flat[None], np.append(flat, flat), array[None], array.T))


def _other_values(array: np.ndarray, rng: Random) -> np.ndarray:
    changed = array.copy()
    if changed.dtype.kind in "iufb" and changed.size:
        nasty = {"f": (np.nan, np.inf, 1e300, -1.0, 0.0), "b": (True, False)}
        whole = np.array([-1, 0, 3, 2**31 - 1, -(2**63), 10**12], dtype=np.int64)
        values = nasty.get(changed.dtype.kind, whole)
        changed.flat[rng.randint(0, changed.size - 1)] = np.array(rng.choice(list(values))).astype(
            changed.dtype
        )
    elif changed.dtype.kind == "U":
        text = str(changed.flat[0]) if changed.size else ""
        place = rng.randint(0, len(text))
        new = (
            text[:place],
            text[place:],
            "[]",
            "null",
            "{}",
            "[" * 5000,
            "x",
            text.replace("1", "1e999"),
            text + " ",
        )
        changed = np.array(rng.choice(new))
    return changed


def _objects(array: np.ndarray, rng: Random) -> np.ndarray:
    held = np.empty(1, dtype=object)
    held[0] = _Payload()
    return held


BYTES = (_flip, _cut_out, _put_in, _write_over, _repeat, _cut_off, _flip, _any)
TEXTS = (_word, _word, _number, _number, _lines, _lines)
ARRAYS = (_other_kind, _other_shape, _other_values, _other_values, _objects)
