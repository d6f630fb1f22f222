"""What README and pages show of the benchmark's packages and of work against error: tables of their files."""

from __future__ import annotations

from collections.abc import Iterable

from sentences import Found, short, worst

from evfem.studies.common import markdown

PACKAGES = {"evfem": "evfem", "fenicsx": "FEniCSx", "felupe": "FElupe", "getfem": "GetFEM"}
PACKAGES |= {"ngsolve": "NGSolve"}
#: cells by name: evfem's element and the others'
CELLS = {"linear": ("q1", "q1"), "quadratic": ("q2p1", "q2")}
LEVELS = ("L0", "L1", "L2")


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A Markdown table."""
    return "\n".join(markdown(list(head), rows)) + "\n"


def run(found: Found) -> str:
    """Date, versions and packages of a run."""
    made, others = found["provenance"], found["assumptions"].get("peers", {})
    versions = ", ".join(f"{name} {number}" for name, number in (made["versions"] | others).items())
    words, lines = f"One run on {made['date'][:10]}, one thread: {versions}.".split(), [""]
    for word in words:
        if len(lines[-1]) + len(word) > 90:
            lines.append("")
        lines[-1] += f" {word}" if lines[-1] else word
    return "\n".join(lines) + "\n"


def costs(found: Found) -> str:
    """Largest errors, CPU seconds and memory on the same nodes."""
    numbers, rows = found["numbers"], []
    for scene in "ABC":
        for level in LEVELS:
            for name, (own, its) in CELLS.items():
                keys = [f"{scene}.{level}.{p}_{own if p == 'evfem' else its}" for p in PACKAGES]
                if f"{keys[0]}.cpu_s" not in numbers:
                    continue
                others = [e for key in keys[1:] if (e := worst(numbers, key)) is not None]
                errors = [worst(numbers, keys[0]), max(others, default=None)]
                said = ", ".join("-" if e is None else f"{e:.2f} %" for e in errors)
                rows.append([f"{scene}, {level}", name, said, *(_cost(numbers, key) for key in keys)])
    return table(["scene, mesh", "cells", "error: evfem, others", *PACKAGES.values()], rows)


def _cost(numbers: Found, key: str) -> str:
    cpu = numbers.get(f"{key}.cpu_s")
    return "not run" if cpu is None else f"{short(cpu)}, {numbers[f'{key}.peak_MB']:.0f}"


def ratios(found: Found) -> str:
    """How many times faster than the fastest other package, alone and with imports."""
    numbers, rows = found["numbers"], []
    for scene in "ABC":
        for name, (own, _) in CELLS.items():
            keys = [f"{scene}.{level}.fastest_over_evfem.{own}.cpu_s" for level in LEVELS]
            if any(key in numbers for key in keys):
                rows.append([f"{scene}, {name}", *(short(numbers.get(key)) for key in keys)])
            whole = [_with_imports(numbers, f"{scene}.{level}", own) for level in LEVELS]
            if any(whole):
                rows.append([f"{scene}, {name}, with imports", *map(short, whole)])
    return table(["scene, cells", *LEVELS], rows)


def _with_imports(numbers: Found, place: str, element: str) -> float | None:
    keys = [f"{place}.{peer}_over_evfem.{element}.process_cpu_s" for peer in PACKAGES]
    return min((numbers[key] for key in keys if key in numbers), default=None)


def race(found: Found) -> str:
    """CPU seconds to 0.1 % by number of steps, and with the best."""
    numbers, rows = found["numbers"], []
    goals = {"A": "normal force", "B": "friction force after 3 mm"}
    for scene, goal in goals.items():
        for way in ("15+30_steps", "5+10_steps", "3+6_steps", "best"):
            key = f"race.{scene}.{way}"
            values = [numbers.get(f"{key}.{name}.cpu_s") for name in PACKAGES]
            if any(values):
                ratio = numbers.get(f"{key}.fastest_over_evfem.cpu_s")
                said = "each its best" if way == "best" else way.replace("_", " ")
                rows.append([f"{scene}, {goal}", said, *map(short, values), short(ratio)])
    return table(["goal", "steps", *PACKAGES.values(), "fastest / evfem"], rows)


def cheapest(found: Found) -> str:
    """The cheapest way to an error."""
    return "\n".join(found["assumptions"]["tables"]["The cheapest way to an error"]) + "\n"


def questions(found: Found) -> str:
    """Growth, memory, and what a step costs in factorisations."""
    n = found["numbers"]
    growth = (n["growth.exponent.press_s"], n["growth.exponent.slide_s"])
    memory = n.get("growth.peak_MB_at_100k_nodes")
    share = 100.0 * n["shares.setup_share_of_a_20_step_press"]
    steps = {"press": "a press step on L2", "stick_slip": "a step of stick and slip on L2"}
    steps |= {"full_slip": "a step of full slip on L2"}
    rows = [
        ["growth of a step", f"nodes to the power {growth[0]:.2f} (press), {growth[1]:.2f} (slide)"],
        ["memory at 100k nodes", "-" if memory is None else f"{memory / 1e3:.2f} GB"],
    ]
    for phase, name in steps.items():
        count = n.get(f"shares.{phase}.factorisations")
        rows.append([name, "-" if count is None else f"{count:.2g} LDL^T factorisations of its matrix"])
    rows.append(["set-up", f"{share:.0f} % of a press of 20 steps"])
    return table(["question", "answer"], rows)


def readme(peers: Found, runs: Found) -> str:
    """README's table and when it was measured."""
    n, key, race = peers["numbers"], "B.L2.evfem_q2p1", "race.B.best"
    slide, best = (_peer_times(n, name) for name in ("B.L2.{}_q2", f"{race}.{{}}"))
    own, to_goal = short(n[f"{key}.cpu_s"]), short(n[f"{race}.evfem.cpu_s"])
    run = runs["numbers"]
    rows = [
        ["benchmark's slide, 23,000 nodes", f"evfem {own} CPU s; {slide}"],
        ["its largest force error", f"{worst(n, key):.2f} %; the reference is uncertain by 0.2 %"],
        ["friction to 0.1 % of the reference", f"evfem {to_goal} CPU s; {best}"],
        ["Hertz line contact, closed form", "peak pressure 0.05 %, half width 0.6 %"],
        [
            f"default run, {run['default.steps']:.0f} steps, one thread",
            f"{short(run['default.cpu_s'])} CPU s",
        ],
    ]
    return table(["question", "answer"], rows)


def _peer_times(numbers: Found, key: str) -> str:
    """CPU seconds of the two fastest other packages; `key` has a field for the package."""
    times = {name: numbers.get(f"{key.format(peer)}.cpu_s") for peer, name in PACKAGES.items()}
    measured = {name: time for name, time in times.items() if name != "evfem" and time is not None}
    return ", ".join(
        f"{name} {short(measured[name])} s" for name in sorted(measured, key=measured.__getitem__)[:2]
    )
