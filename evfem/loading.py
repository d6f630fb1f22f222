"""One `load` for every file that evfem reads or writes, by what is in it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from evfem.common.storage import begins, format_of
from evfem.common.tables import TABLES
from evfem.errors import InputError

Found = Any  # Result, FitResult, VoltageProfile, Sampled, Scene, Sweep, SweepResult, Mesh or Texture
ALLOWED = (
    "the folder of a run or a sweep, a result (.npz), a fit (.json), a signal (.csv, .xlsx, .mat, .wav, "
    ".hjif), a scene or a sweep (.toml), a mesh (.vtu, .msh), a texture (.json)"
)
#: format of the fast models that 0.2 saved
FAST_MODEL = "evfem-reduced-1"
#: how the file of a history begins
HISTORY = b"step,motion_index,"
#: how the formats of checkpoints of all versions begin
CHECKPOINT = "evfem-checkpoint-"


def load(path: str | Path) -> Found:
    """Read any file or folder of evfem.

    Parameters
    ----------
    path
        A file or folder; its content decides what is returned.

    Returns
    -------
    Result
        From the folder of `evfem run`, or a file of `Result.save` under any name.
    FitResult, Texture
        From .json; a texture with its .csv, or from their folder.
    SweepResult
        From the folder of a sweep, its `sweep.json`, or a csv file with its table.
    VoltageProfile, Sampled
        From .csv, .xlsx, .mat, .wav or .hjif; `Sampled` from a table over time.
    Scene, Sweep
        From .toml.
    Mesh
        From .vtu, .msh or another format of meshio's.

    Raises
    ------
    InputError
        Another kind of file, or a damaged one.
    StorageError
        The file cannot be read.

    Examples
    --------
    >>> import evfem as ev
    >>> ev.VoltageProfile([0.0, 5.0], [100.0, 400.0]).to_csv("ramp.csv")
    >>> load("ramp.csv")(2.5)
    250.0
    """
    if not isinstance(path, (str, Path)):
        raise InputError("path", path, f"the path of {ALLOWED}")
    path = Path(path)
    if path.is_dir():
        return _run(path)
    if not path.is_file():
        raise InputError("path", f"{path}, which does not exist", ALLOWED)
    reader = READERS.get(path.suffix.lower(), _other)
    if path.suffix.lower() != ".npz" and _is_of_a_run(path):
        raise InputError("path", f"{path}, one file of a run", f"the run's folder, {path.parent}")
    if path.suffix.lower() == ".parquet":
        allowed = f"the sweep's folder, {path.parent}; `pandas.read_parquet` reads the file itself"
        raise InputError("path", f"{path}, the table of a sweep for other programs", allowed)
    return reader(path)


def _is_of_a_run(path: Path) -> bool:
    """Whether the folder of a run lists the file among its own."""
    from evfem.runfolder import MANIFEST

    manifest = path.parent / MANIFEST
    return manifest.is_file() and path.name in manifest.read_text("utf-8", "replace").splitlines()


def _run(path: Path) -> Found:
    from evfem.textures import texture

    if (path / texture.NAME).is_file():
        return texture.read(path)
    from evfem.sweeps import folder, table

    if (path / folder.PROVENANCE).is_file():
        return table.read(path)
    from evfem.runfolder import result_in

    return result_in(path)


def _other(path: Path) -> Found:
    from evfem.mesh.file import FORMATS
    from evfem.simulation.result import RESULT_FORMAT
    from evfem.simulation.result import load as load_result

    if path.suffix.lower() in FORMATS:
        return _mesh(path)
    form = format_of(path)
    if form == FAST_MODEL:
        allowed = "other files: the fast model is gone since 0.3, `ev.simulate` runs the scene itself"
        raise InputError("path", f"{path}, a fast model", allowed)
    if (form or "").startswith(CHECKPOINT):
        raise InputError(
            "path", f"{path}, the checkpoint of a run", "`evfem run --resume`, which goes on there"
        )
    if form != RESULT_FORMAT and path.suffix.lower() != ".npz":
        other = "heights of other files: `evfem texture import`, haptic patterns: `ev.Sampled.from_haptic`"
        raise InputError("path", f"{path}, of another kind", f"{ALLOWED}; {other}")
    return load_result(path)


def _signal(path: Path) -> Found:
    from evfem.circuit.signalfile import read_voltage
    from evfem.sweeps import table

    if table.is_table(path):
        return table.read(path)
    if begins(path, HISTORY):
        allowed = "the run's folder, or its .npz; `pandas.read_csv` reads the file itself"
        raise InputError("path", f"{path}, the history of a run", allowed)
    try:
        return read_voltage(path)
    except InputError as error:
        if path.suffix.lower() not in TABLES or "." in error.key:  # a unit
            raise
        allowed = "a voltage (position,voltage or time,voltage) or the table of a sweep; measurements: "
        allowed += "`ev.MeasuredCurve.from_csv`, heights: `ev.Profile.from_csv`, `evfem texture import`"
        raise InputError("path", error.given, allowed) from None


def _tables(path: Path) -> Found:
    from evfem.scene import file as scenefile
    from evfem.sweeps import file as sweepfile

    tables = scenefile.tables_of("scene", scenefile.read_text("scene", path))
    return sweepfile.load(path) if "scene" in tables else scenefile.load(path)


def _fit(path: Path) -> Found:
    from evfem.calibration.result import load
    from evfem.sweeps import folder, table
    from evfem.textures import texture

    if path.name == folder.PROVENANCE:
        return table.read(path)
    return texture.read(path) if texture.is_texture(path) else load(path)


def _mesh(path: Path) -> Found:
    from evfem.mesh.file import read

    return read(path)


READERS: Mapping[str, Callable[[Path], Found]] = {
    **dict.fromkeys(TABLES, _signal),
    ".json": _fit,
    ".wav": _signal,
    ".hjif": _signal,
    ".toml": _tables,
}
