"""Measures what no study does, in CPU seconds on one thread: the built-in scene by the command,
single steps of a loop, and ridged fingertips with their memory. `python docs/runs.py`
writes docs/results/runs.json and the pages; it takes about four minutes.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

os.environ["OMP_NUM_THREADS"] = "1"

import numpy as np

import evfem as ev
from evfem.simulation.provenance import origin
from evfem.studies.common import commit, processor

RESULTS = Path(__file__).parent / "results"
RUN = "import sys; from evfem.cli import main; sys.exit(main(['run', '--out', 'out']))"
LOOPS = {
    "coarse": (ev.FingerPad(resolution="coarse", ridges=False), 0.05, 100),
    "medium": (ev.FingerPad(resolution="medium", ridges=False), 0.05, 60),
    "fingertip": (ev.Fingertip(resolution="coarse", ridges=False), 0.2, 12),
}
#: a fingertip's ridges -> pressing force (N) and the slides at 1000 V
TIPS: dict[str, tuple[float, list[ev.Motion]]] = {
    "along": (1.0, [ev.Slide(3.0, steps=15, hold="force")]),
    "whorl": (0.5, [ev.Slide(1.0, steps=5, hold="force", angle=angle) for angle in (0.0, 90.0)]),
}


def default_run() -> dict[str, float]:
    """CPU seconds and files of the built-in scene."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with TemporaryDirectory() as folder:
        subprocess.run([sys.executable, "-c", RUN], cwd=folder, check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        out = Path(folder) / "out"
        size = sum(path.stat().st_size for path in out.iterdir())
        said = json.loads((out / "summary.json").read_text(encoding="utf-8"))["provenance"]
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    steps, nodes = said["scene"]["total_steps"], said["mesh"]["nodes"]
    return {"cpu_s": spent, "MB": size / 1e6, "steps": steps, "nodes": nodes}


def loop_times(finger: ev.FingerPad | ev.Fingertip, force: float, steps: int) -> dict[str, float]:
    """Steps of 0.02 mm under a voltage that changes."""
    begin = time.process_time()
    scene = ev.Scene(finger, ev.Display(friction=0.3), ev.Kaczmarek(), 0.0, [])
    loop = ev.loop(scene, largest_voltage=1000.0)
    taken = [time.process_time() - begin]
    for share in (0.5, 1.0):
        loop.step(force=share * force)
    for i in range(1, steps + 1):
        begin = time.process_time()
        loop.step(position=0.02 * i, voltage=500.0 * (1.0 - np.cos(0.3 * i)))
        taken.append(time.process_time() - begin)
    half, most = np.quantile(taken[1:], (0.5, 0.9))
    unknowns = loop.result().mesh.points.size
    return {"begin_s": taken[0], "median_s": half, "ninth_s": most, "unknowns": unknowns}


def tip_run(ridges: str) -> None:
    """Press a ridged fingertip and slide it; print its nodes, steps, CPU seconds and GB of this process."""
    begin, (force, slides) = time.process_time(), TIPS[ridges]
    finger = ev.Fingertip(resolution="coarse", ridges=ridges)
    motion = [ev.Press(force=force, steps=8), *slides]
    result = ev.simulate(ev.Scene(finger, ev.Display(friction=0.3), ev.Kaczmarek(), 1000.0, motion))
    found = {
        "nodes": len(result.mesh.points),
        "steps": len(result.normal_force),
        "cpu_s": time.process_time() - begin,
    }
    found["GB"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024.0 / 1e9
    print(json.dumps(found))


def main() -> None:
    """Measure, keep, and write the pages."""
    import measured

    begin = time.perf_counter()
    numbers = {f"default.{key}": value for key, value in default_run().items()}
    for name, (finger, force, steps) in LOOPS.items():
        numbers |= {f"loop.{name}.{k}": float(v) for k, v in loop_times(finger, force, steps).items()}
    for name in TIPS:
        child = subprocess.run([sys.executable, __file__, name], check=True, capture_output=True)
        numbers |= {f"tip.{name}.{k}": float(v) for k, v in json.loads(child.stdout).items()}
    made = {"quick": False, "seconds": round(time.perf_counter() - begin, 1)}
    made |= {"commit": commit(), "processor": processor()}
    found = {"study": "runs", "numbers": numbers, "paper": {}, "provenance": origin() | made}
    (RESULTS / "runs.json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    measured.write()


if __name__ == "__main__":
    tip_run(*sys.argv[1:]) if sys.argv[1:] else main()
