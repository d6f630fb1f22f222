"""A part of the study `work_precision` in a process of its own: for memory, for clocks that
nothing else has run on, and for runs in which the packages of evfem[fast] cannot be imported.

`python -m evfem.studies.precision.apart TASK fast|plain` reads a JSON list and prints its answers
as one.
"""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

from ..peers.hosts import environment

FAST = ("pypardiso",)
#: task -> module and function, which takes and returns a JSON list
TASKS = {
    "runs": ("runs", "measure_plain"),
    "growth": ("growth", "measure_sizes"),
    "shares": ("shares", "measure_shares"),
}


def answer(task: str, questions: list[Any], *, fast: bool = True) -> list[Any]:
    """The answers of a new process; its last words in a RuntimeError if it fails."""
    words = [sys.executable, "-P", "-m", f"{__package__}.apart", task, "fast" if fast else "plain"]
    done = subprocess.run(
        words,
        env=environment(sys.executable),
        input=json.dumps(questions),
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise RuntimeError(f"{task}: {done.stderr.strip()[-1000:]}")
    found: list[Any] = json.loads(done.stdout.splitlines()[-1])
    return found


#: prints the CPU seconds of importing modules, and which of two heavy packages came along
IMPORT = """
import sys, time
from importlib import import_module
begin = time.process_time()
for name in sys.argv[1:]:
    import_module(name)
print(time.process_time() - begin, *{"skfem", "matplotlib"} & set(sys.modules))
"""


def import_s(modules: list[str]) -> tuple[float, list[str]]:
    """CPU seconds of importing modules in a new process, and which heavy packages they load."""
    words = [sys.executable, "-P", "-c", IMPORT, *modules]
    done = subprocess.run(words, env=environment(sys.executable), capture_output=True, text=True, check=True)
    seconds, *heavy = done.stdout.split()
    return float(seconds), heavy


def main() -> None:
    """Answer what comes in on the standard input."""
    from importlib import import_module

    task, how = sys.argv[1:]
    if how == "plain":
        for name in FAST:
            sys.modules[name] = None  # type: ignore[assignment]
    module, function = TASKS[task]
    found = getattr(import_module(f".{module}", __package__), function)(json.load(sys.stdin))
    print(json.dumps(found))


if __name__ == "__main__":
    main()
