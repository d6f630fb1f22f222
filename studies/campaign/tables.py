"""The tables of a scene file as plain values: random numbers for them, their text, files beside them."""

import shutil
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from evfem.common.storage import disk, write_text
from evfem.common.tables import csv_text
from evfem.meshes import FOLDER
from evfem.scene.file import loads
from evfem.scene.scene import Scene

Tables = dict[str, Any]


def text_of(tables: Tables) -> str:
    """The scene as TOML, complete in itself."""
    return tomli_w.dumps({key: value for key, value in tables.items() if value != {}})


def scene_of(tables: Tables) -> Scene:
    """The scene; raises InputError if it is none."""
    return loads(text_of(tables), FOLDER)


def with_files(tables: Tables, folder: Path) -> Tables:
    """The same scene with profile and voltage in csv files and its mesh in `folder`, as users have them."""
    tables = deepcopy(tables)
    put_mesh(tables, folder)
    surface, electrostatics = tables["surface"], tables.get("electrostatics", {})
    if "points" in surface:
        write_text(folder / "profile.csv", csv_text([["x", "height"], *surface.pop("points")]))
        surface["file"] = "profile.csv"
    if "voltage_profile" in electrostatics:
        rows = electrostatics.pop("voltage_profile")
        write_text(folder / "voltage.csv", csv_text([["position", "voltage"], *rows]))
        electrostatics["voltage_file"] = "voltage.csv"
    return tables


def put_mesh(tables: Tables, folder: Path) -> None:
    """Put the ready-made mesh of a scene, if it has one, into the folder of its file."""
    if "mesh" in tables["finger"]:
        with disk(f"write {folder}"):
            shutil.copy(FOLDER / tables["finger"]["mesh"], folder)


# -- random numbers

#: of the generator itself: another one draws other scenes
GENERATOR = 2


class Draw:
    """Random numbers of one scene: the same for the same seed, number and `further` ones."""

    def __init__(self, seed: int, number: int, *further: int) -> None:
        self._random = np.random.default_rng([GENERATOR, seed, number, *further])

    def chance(self, probability: float) -> bool:
        """True with that probability."""
        return bool(self._random.random() < probability)

    def between(self, low: float, high: float) -> float:
        """Evenly between two numbers, with six digits."""
        return six_digits(self._random.uniform(low, high))

    def spread(self, low: float, high: float) -> float:
        """Evenly on a logarithmic scale between two positive numbers, with six digits."""
        return six_digits(np.exp(self._random.uniform(np.log(low), np.log(high))))

    def whole(self, low: int, high: int) -> int:
        """A whole number, both ends included; small ones are as likely as large ones."""
        return int(np.clip(np.rint(self.spread(max(low, 1) - 0.49, high + 0.49)), low, high))

    def sign(self) -> float:
        """1 or -1."""
        return 1.0 if self.chance(0.5) else -1.0

    def one_of(self, *choices: Any) -> Any:
        """One of the choices, each as likely."""
        return choices[int(self._random.integers(len(choices)))]

    def places(self, count: int, low: float, high: float) -> list[float]:
        """Increasing positions, with six digits."""
        return sorted(map(six_digits, self._random.uniform(low, high, count)))


def six_digits(value: float) -> float:
    """The number that stands in the file."""
    return float(f"{value:.6g}")
