"""The BLAS keeps to its threads in a process in which no variable says how many.

A limit holds for the libraries that are loaded: whatever enters one before scipy has loaded its BLAS
leaves that on all cores. Looked at is what each limit has over at its end, and the CPU time of other
threads than the main one.
"""

import os

import pytest
from tools.commands import printed

WATCH = """
import time
import threadpoolctl

beyond, ended = [], 0

class Watched(threadpoolctl.threadpool_limits):
    def __init__(self, limits=None, **options):
        self.most = limits or 10**6
        super().__init__(limits=limits, **options)

    def __exit__(self, *error):
        global ended
        ended += 1
        blas = [one for one in threadpoolctl.threadpool_info() if "blas" in one["internal_api"]]
        beyond.extend(one for one in blas if one["num_threads"] > self.most)
        super().__exit__(*error)

threadpoolctl.threadpool_limits = Watched
import evfem as ev
pad = ev.FingerPad(ridges=False, resolution="coarse")
scene = ev.Scene(pad, ev.Flat(friction=0.3), motion=ev.Press(force=0.01, steps=1))
all_before, main_before = time.process_time(), time.thread_time()
"""
LOOKED = """
everyone, main = time.process_time() - all_before, time.thread_time() - main_before
print(ended > 0, beyond, everyone - main < 0.3 * everyone + 0.1)
"""
WAYS = {
    "simulate": "ev.simulate(scene)",
    "a whole fingertip": "tip = ev.Fingertip(resolution='coarse', ridges=False)\n"
    "ev.simulate(ev.Scene(tip, ev.Flat(), motion=ev.Press(indentation=0.05, steps=1)))",
    "sweep": "grid = {'surface.friction': [0.2, 0.3]}\n"
    "ev.sweep(ev.Sweep(scene, grid, outputs=['normal_force.last']), 'out', workers=1)",
    "fit": "data = ev.MeasuredCurve('indentation', 'applied_force', [0.005, 0.01], [0.1, 0.2])\n"
    "ev.fit(scene, data, {'finger.materials.hypodermis.E': (0.02, 0.06)}, workers=1)",
    "estimate": "from evfem.textures.library import reference\n"
    "from evfem.estimate.estimate import estimate\n"
    "estimate(reference('weave'), ev.Touch(length=2.0))",
    "studio": "from evfem.studio import page\nfrom evfem.studio.state import parse\npage.answer(parse('{}'))",
}


def fresh(code, folder):
    """What a new process prints, without the variables that limit threads."""
    return printed(code, folder, **{key: None for key in os.environ if key.endswith("_NUM_THREADS")})


@pytest.mark.parametrize("way", WAYS)
def test_a_limit_is_that_of_every_blas(way, tmp_path):
    assert fresh(f"{WATCH}{WAYS[way]}{LOOKED}", tmp_path).splitlines()[-1] == "True [] True"


def test_a_process_of_a_pool_has_one_thread_whatever_it_loads(tmp_path):
    code = (
        "from tools.workers import blas_threads\n"
        "from evfem.common import pools\n"
        "with pools.open_pool(2, None) as pool: print([found for _, found in pool(blas_threads, {0: 0})])"
    )
    assert fresh(code, tmp_path) == "[[1, 1]]"


@pytest.mark.parametrize("load", ["linalg()", "compiled_algebra('blas')", "compiled_algebra('lapack')"])
def test_scipy_comes_under_the_limits_that_hold_when_it_is_loaded(load, tmp_path):
    code = (
        "from evfem.common.arrays import blas_limits, compiled_algebra, linalg\n"
        "from tools.workers import blas_threads\n"
        "with blas_limits(3):\n"
        "    with blas_limits(1):\n"
        f"        {load}\n"
        "        inner = blas_threads(None)\n"
        "    print(inner, blas_threads(None))\n"
        "import os\n"
        "print({*blas_threads(None)} == {os.cpu_count()})"
    )
    assert fresh(code, tmp_path).splitlines() == ["[1, 1] [3, 3]", "True"]


def test_the_algebra_without_its_package_is_found_in_it_later(tmp_path):
    code = (
        "from evfem.common.arrays import compiled_algebra\n"
        "alone = compiled_algebra('lapack')\n"
        "import scipy.linalg.cython_lapack\n"
        "print(alone is scipy.linalg.cython_lapack.__pyx_capi__, 'dpotrf' in alone)"
    )
    assert fresh(code, tmp_path) == "True True"


@pytest.mark.pardiso
def test_a_limit_that_begins_within_a_run_leaves_the_threads_of_its_factorisations(tmp_path):
    """PARDISO ends the process where a phase has fewer threads than the analysis had."""
    code = (
        "import evfem as ev, threadpoolctl\n"
        "class Limits:\n"
        "    def step(self, *said):\n"
        "        self.kept = threadpoolctl.threadpool_limits(1)\n"
        "motion = [ev.Press(force=0.05, steps=5), ev.Slide(0.1, steps=5)]\n"
        "waves = ev.Sinusoid(terms=[[0.005, 12.0, 0.0]], friction=0.3)\n"
        "pad, solver = ev.FingerPad(resolution='coarse', ridges=False), ev.Solver(threads=2)\n"
        "ev.simulate(ev.Scene(pad, waves, motion=motion, solver=solver), observers=[Limits()])\n"
        "print('done')"
    )
    assert fresh(code, tmp_path) == "done"


@pytest.mark.pardiso
def test_the_threads_of_a_scene_are_those_of_its_factorisations_alone(tmp_path):
    """Threads of the BLAS that spin beside them took twice the CPU time, and longer."""
    code = (
        "import evfem as ev\n"
        "from evfem.common.arrays import linalg\n"
        "from tools.workers import blas_threads\n"
        "class Looks:\n"
        "    def step(self, *said): linalg(); print(blas_threads(None))\n"
        "tip, two = ev.Fingertip(resolution='coarse', ridges=False), ev.Solver(threads=2)\n"
        "scene = ev.Scene(tip, ev.Flat(), motion=ev.Press(indentation=0.05, steps=1), solver=two)\n"
        "ev.simulate(scene, observers=[Looks()])\n"
        "ev.loop(scene, observers=[Looks()])\n"
        "import os; print(os.environ['KMP_BLOCKTIME'])"
    )
    assert fresh(code, tmp_path).splitlines() == ["[1, 1]", "[1, 1]", "0"]
