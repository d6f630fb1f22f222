"""What a campaign leaves on disk while it goes: a table of ends, and the scenes that ended badly.

`campaign/ends.csv` has a row per scene; `campaign/failures/` has each failed scene as it was drawn,
complete in itself. Rows of the same scene and the same code count as done.
"""

from __future__ import annotations

import csv
import hashlib
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from pathlib import Path

import evfem
from evfem.common.digest import digest
from evfem.common.storage import disk, write_text
from evfem.common.tables import csv_text

from ..common import make_folder
from .ending import Ending
from .tables import Tables, put_mesh, text_of

TABLE, FAILURES = "ends.csv", "failures"
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
        if self.folder is None:
            return
        make_folder(self.folder / FAILURES)
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
        self.ends[key], self.digests[key] = ending, self._digest(tables)
        if self.folder is None:
            return
        file = self.folder / FAILURES / f"seed{key[0]}-scene{key[1]:04d}.toml"
        file.unlink(missing_ok=True)
        if not ending.good:
            put_mesh(tables, file.parent)
            write_text(file, _told(key, ending, tables))
        write_text(self.folder / TABLE, self._text())

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
