"""What a campaign leaves on disk while it goes: a table of ends, and the scenes that ended badly.

`campaign/ends.csv` has a row per scene; `campaign/failures/` has each failed scene as it was
drawn, `campaign/minimal/` its shrunk one, both complete in themselves. Rows of the same scene and
the same code count as done.
"""

from __future__ import annotations

import csv
import hashlib
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from pathlib import Path
from threading import Lock

import evfem
from evfem.common.digest import digest
from evfem.common.storage import disk, write_text
from evfem.common.tables import csv_text

from ..common import make_folder
from .ending import Ending
from .tables import Tables, put_mesh, text_of

TABLE, FAILURES, MINIMAL = "ends.csv", "failures", "minimal"
COLUMNS = ("seed", "scene", *(spec.name for spec in fields(Ending)), "digest")
WHOLE, REAL = ("requested", "steps", "unknowns", "iterations", "substeps", "cuts"), ("cpu_s", "remainder")

#: modules beside this one that decide on an end
JUDGES = ("ending", "invariants", "tables", "twins")

Key = tuple[int, int]


def code_digest() -> str:
    """A fingerprint of the package, and of what judges its scenes."""
    package, here, total = Path(evfem.__file__).parent, Path(__file__).parent, hashlib.sha256()
    for path in [*sorted(package.rglob("*.py")), *(here / f"{name}.py" for name in JUDGES)]:
        total.update(path.read_bytes())
    return total.hexdigest()


@dataclass
class Records:
    """The ends of a campaign by seed and scene; in `folder` if there is one."""

    folder: Path | None
    ends: dict[Key, Ending] = field(default_factory=dict)
    digests: dict[Key, str] = field(default_factory=dict)
    code: str = field(default_factory=code_digest)

    def __post_init__(self) -> None:
        self._lock = Lock()
        if self.folder is None:
            return
        for name in (FAILURES, MINIMAL):
            make_folder(self.folder / name)
        if (self.folder / TABLE).exists():
            with disk(f"read {self.folder / TABLE}"):
                text = (self.folder / TABLE).read_text(encoding="utf-8")
            for key, ending, known in _rows(text):
                self.ends[key], self.digests[key] = ending, known

    def known(self, key: Key, tables: Tables) -> Ending | None:
        """The end of a scene that this code has run before."""
        return self.ends.get(key) if self.digests.get(key) == self._digest(tables) else None

    def add(self, key: Key, tables: Tables, ending: Ending) -> None:
        """Keep the end of a scene, and the scene if it failed."""
        with self._lock:
            self.ends[key], self.digests[key] = ending, self._digest(tables)
            if self.folder is None:
                return
            for name in (FAILURES, MINIMAL):
                self._file(name, key).unlink(missing_ok=True)
            if not ending.good:
                put_mesh(tables, self.folder / FAILURES)
                write_text(self._file(FAILURES, key), _told(key, ending, tables))
            write_text(self.folder / TABLE, self._text())

    def add_minimal(self, key: Key, tables: Tables, ending: Ending) -> None:
        """Keep what is left of a failed scene, with its own end."""
        if self.folder is not None:
            put_mesh(tables, self.folder / MINIMAL)
            write_text(self._file(MINIMAL, key), _told(key, ending, tables))

    def shrinks(self, key: Key) -> bool:
        """Whether a scene failed and has not been shrunk; one that takes too long stays as it is."""
        ending = self.ends[key]
        if self.folder is None or ending.good or ending.outcome in ("timeout", "refused"):
            return False
        return not self._file(MINIMAL, key).exists()

    def _file(self, name: str, key: Key) -> Path:
        assert self.folder is not None
        return self.folder / name / f"seed{key[0]}-scene{key[1]:04d}.toml"

    def _digest(self, tables: Tables) -> str:
        return digest((tables, self.code))

    def _text(self) -> str:
        rows = [
            [*key, *(getattr(end, spec.name) for spec in fields(Ending)), self.digests[key]]
            for key, end in sorted(self.ends.items())
        ]
        return csv_text([COLUMNS, *rows])


def _rows(text: str) -> Iterator[tuple[Key, Ending, str]]:
    """What a table of ends holds; rows of another form are left out."""
    for row in csv.DictReader(text.splitlines()):
        if tuple(row) != COLUMNS or None in row.values():
            continue
        seed, scene, known = int(row.pop("seed")), int(row.pop("scene")), row.pop("digest")
        numbers = {name: int(row.pop(name)) for name in WHOLE} | {name: float(row.pop(name)) for name in REAL}
        yield (seed, scene), Ending(**row, **numbers), known  # type: ignore[arg-type]


def _told(key: Key, ending: Ending, tables: Tables) -> str:
    """A scene file that begins with how it ended."""
    said = textwrap.wrap(f"seed {key[0]}, scene {key[1]}: {ending.outcome}; {ending.said}", 96)
    return "".join(f"# {line}\n" for line in said) + text_of(tables)
