"""Runs of `evfem run` in processes of their own that are killed, and what they leave on disk."""

import csv
import json
import subprocess
import time
from xml.etree import ElementTree

import meshio
import numpy as np

from evfem.common.storage import load_arrays
from evfem.mesh import file as meshfile
from evfem.simulation.checkpoint import CHECKPOINT_FORMAT
from evfem.simulation.result import COLUMNS
from tools.commands import process_of
from tools.meshes import block


def head(mesh, more=""):
    """The beginning of a scene: its finger from a mesh with the region `tissue`, and further keys of it."""
    return f"""version = 1
[finger]
mesh = "{mesh}"
{more}
[finger.materials.tissue]
law = "neo_hookean"
E = 0.05
nu = 0.45
[finger.electrical]
stratum_corneum_thickness = 0.3
"""


VOLTAGE = """[electrostatics]
law = "kaczmarek"
voltage = 400.0
insulator_thickness = 0.09
insulator_eps_r = 3.35
"""
#: name -> scene of 20 steps: attraction and a held force, viscosity on a texture, inertia and a held force
SCENES = {
    "force": head("block.vtu")
    + '[surface]\nkind = "flat"\nfriction = 0.3\n'
    + VOLTAGE
    + '[[motion]]\nkind = "press"\nforce = 0.02\nsteps = 4\n'
    + '[[motion]]\nkind = "slide"\ndistance = 1.0\nsteps = 16\nhold = "force"\n',
    "viscous": head("block.vtu", "viscosity = 1e-3")
    + '[surface]\nkind = "sinusoid"\nfriction = 0.2\n[solver]\ndynamics = "viscous"\n'
    + '[[motion]]\nkind = "press"\nindentation = 0.2\nspeed = 5.0\nsteps = 4\n'
    + '[[motion]]\nkind = "slide"\ndistance = -1.0\nsteps = 16\nspeed = 20.0\n',
    "inertial": head("block.vtu", "viscosity = 1e-4")
    + '[surface]\nkind = "flat"\nfriction = 0.2\n[solver]\ndynamics = "inertial"\n'
    + '[[motion]]\nkind = "press"\nindentation = 0.2\nspeed = 5.0\nsteps = 4\n'
    + '[[motion]]\nkind = "slide"\ndistance = 1.0\nsteps = 16\nspeed = 20.0\nhold = "force"\n',
}
FORCES = tuple(name for name in COLUMNS if "force" in name)


def prepare(folder, name):
    """The mesh and the scene NAME.toml in `folder`."""
    meshfile.write(block(24, 6, sag=0.3), folder / "block.vtu")
    (folder / f"{name}.toml").write_text(SCENES[name])


def kill(folder, words, wait, watched=None):
    """Start `evfem WORDS` in `folder` and kill it `wait` seconds later, counted from when it first
    writes the `watched` file if one is given; whether it was still running.
    """
    command, environment = process_of(*words)
    before = written(watched)
    quiet = subprocess.DEVNULL
    with subprocess.Popen(command, cwd=folder, env=environment, stdout=quiet, stderr=quiet) as process:
        while watched is not None and written(watched) == before and process.poll() is None:
            time.sleep(0.001)
        time.sleep(wait)
        running = process.poll() is None
        process.kill()
    return running


def written(path):
    """When a file was written last, in seconds, 0 if it is not there."""
    return path.stat().st_mtime if path is not None and path.exists() else 0.0


def history(folder):
    """Columns of history.csv, as text."""
    with open(folder / "history.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: [row[name] for row in rows] for name in COLUMNS}


def broken(out):
    """Files in the folder of a run, under the names that a user knows, that are not whole."""
    checks = {
        "history.csv": lambda p: np.array([history(out)[name] for name in FORCES], dtype=float),
        "checkpoint.npz": lambda p: load_arrays(p, "checkpoint", CHECKPOINT_FORMAT),
        "summary.json": lambda p: json.loads(p.read_text()),
        "fields.pvd": lambda p: [
            meshio.read(out / one.attrib["file"]) for one in ElementTree.parse(p).iter("DataSet")
        ],
    }
    found = []
    for path in sorted(out.glob("[!.]*")):
        try:
            checks.get(path.name, meshio.read)(path)
            whole = path.suffix != ".csv" or path.read_bytes().endswith(b"\n")
        except (Exception, SystemExit):  # whatever a reader trips over: the file is not whole
            whole = False
        if not whole:
            found.append(path.name)
    return found


def difference(one, other):
    """Largest difference of a force between the histories in two folders, over the largest force."""
    first, second = history(one), history(other)
    assert first["step"] == second["step"]
    a, b = (np.array([h[name] for name in FORCES], dtype=float) for h in (first, second))
    return float(np.abs(a - b).max() / np.abs(b).max())
