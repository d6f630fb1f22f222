"""The manifest of a folder: the names of the files that evfem wrote there, true whenever a run is killed."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from evfem.common.storage import disk, names_in, write_text
from evfem.errors import StorageError


class Manifest:
    """The names of the files that evfem wrote in a folder, also listed in the file `path`; a line that
    is no name of the pattern `ours` is ignored.

    A name is listed before its file takes its place, and its line ended after: a file of an open line is
    evfem's unless its temporary file is still there. What is removed goes under a temporary name first. So no
    file is taken for somebody else's, whenever a kill came.
    """

    def __init__(self, path: Path, ours: re.Pattern[str]) -> None:
        self.path = path
        lines = [line if ours.fullmatch(line) else "" for line in names_in(path)]
        names, last = [line for line in lines[:-1] if line], "".join(lines[-1:])
        gone = {name for name in names if _removed(path.with_name(name)).exists()}
        self.names = {*names} - gone
        if last and not any(path.parent.glob(f".{last}.*.tmp")):
            self.names.add(last)
        if last or gone:
            self._write()

    def _write(self) -> None:
        write_text(self.path, "".join(f"{name}\n" for name in sorted(self.names)))

    def begin(self, others: Collection[str] = ()) -> None:
        """Forget the names of files that are no longer there, and list `others`."""
        kept = {name for name in self.names if self.path.with_name(name).exists()}
        self.names = {*kept, *others}
        self._write()

    def remove(self) -> None:
        """Remove all files of the list, and their names from it; a folder stays."""
        files = [self.path.with_name(name) for name in sorted(self.names)]
        files = [file for file in files if file.is_file()]
        for file in files:
            file.replace(_removed(file))
        self.names -= {file.name for file in files}
        self._write()
        for file in files:
            _removed(file).unlink()

    @contextmanager
    def writing(self, path: Path) -> Iterator[None]:
        """Inside, the file `path` is written by `replacing`; its name is listed."""
        if path.name in self.names:
            yield
            return
        if path.exists():
            raise StorageError(f"cannot write {path}: a file that evfem did not write is in its place")
        temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")  # as `replacing` has it
        try:
            with disk(f"write {path}"):
                temporary.touch()
                self._append(path.name)
            yield
            with disk(f"write {self.path}"):
                self._append("\n")
            self.names.add(path.name)
        except BaseException:
            with suppress(OSError):
                self.names |= {path.name} if path.exists() else set()
                self._write()
            with suppress(OSError):
                temporary.unlink()
            raise

    def _append(self, text: str) -> None:
        with self.path.open("a", encoding="utf-8", newline="\n") as file:
            file.write(text)


def _removed(path: Path) -> Path:
    """Temporary name of a file that is being removed; no process writes to it."""
    return path.with_name(f".{path.name}.0.tmp")
