"""Renews what the pages show of runs of the studies: the tables of the page on performance, two rows
of README, the page on the paper, the pictures, and the times that the command says beforehand:

    evfem study all peers --out FOLDER
    python docs/measured.py FOLDER

What has no file in FOLDER stays as it is. Files of studies with numbers of the paper are kept in
docs/results, from which the page on the paper is written; pictures are copied to docs/pictures.
`python docs/measured.py --times FOLDER` takes the times alone, also those of runs with --quick.
"""

from __future__ import annotations

import csv
import json
import re
import shutil
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from evfem.studies import NAMES, paper
from evfem.studies.common import markdown

DOCS = Path(__file__).parent
PAGE, README = DOCS / "performance.md", DOCS.parent / "README.md"
RESULTS, PAPER = DOCS / "results", DOCS / "paper.md"
TIMES = DOCS.parent / "studies" / "seconds.csv"
#: a table between its marks
BLOCK = re.compile(r"(<!-- measured: ([\w-]+) -->\n\n).*?(\n<!-- end -->)", re.S)
PACKAGES = {"evfem": "evfem", "fenicsx": "FEniCSx", "felupe": "FElupe", "getfem": "GetFEM"}
#: cells by name: evfem's element and the others'
CELLS = {"linear": ("q1", "q1"), "quadratic": ("q2p1", "q2")}
LEVELS = ("L0", "L1", "L2")
Found = dict[str, Any]


def short(value: float | None) -> str:
    """Two digits, or three above 100; a dash without a value."""
    if value is None:
        return "-"
    return f"{value:.0f}" if value >= 10.0 else f"{value:.2g}"


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


def worst(numbers: Found, key: str) -> float | None:
    """The largest error of a run's forces (%), None where there is no reference or no run."""
    errors = [abs(v) for name, v in numbers.items() if name.startswith(f"{key}.error_percent.")]
    return max(errors, default=None)


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
    plain = [value for key, value in n.items() if key.endswith("_plain.cpu_over_usual")]
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
    if plain:
        rows.append(["without `[fast]`", f"{min(plain):.1f} to {max(plain):.1f} times as long"])
    rows.append(["set-up", f"{share:.0f} % of a press of 20 steps"])
    return table(["question", "answer"], rows)


#: study -> block -> what makes it
BLOCKS: dict[str, dict[str, Callable[[Found], str]]] = {
    "peers": {"peers-run": run, "peers-costs": costs, "peers-ratios": ratios, "peers-race": race},
    "work_precision": {
        "precision-run": run,
        "precision-cheapest": cheapest,
        "precision-questions": questions,
    },
}


def renewed(text: str, found: dict[str, Found]) -> str:
    """The page with the blocks of the studies that were found."""
    texts = {name: make(found[s]) for s in found for name, make in BLOCKS[s].items()}
    return BLOCK.sub(lambda m: m[1] + texts[m[2]] + m[3] if m[2] in texts else m[0], text)


def rows_of_readme(text: str, found: Found) -> str:
    """README with its two rows and the date of the run of `peers`; as it is where the run lacks them."""
    n, made = found["numbers"], found["provenance"]
    key, race = "B.L2.evfem_q2p1", "race.B.best"
    others = [v for p in PACKAGES if (v := n.get(f"B.L2.{p}_q2.cpu_s")) is not None and p != "evfem"]
    if not others or not {f"{key}.cpu_s", f"{race}.fastest_over_evfem.cpu_s"} <= n.keys():
        return text
    own, peer = n[f"{race}.evfem.cpu_s"], n[f"{race}.fastest_over_evfem.cpu_s"]
    slide = f"error {worst(n, key):.2f} %, {short(n[f'{key}.cpu_s'])} CPU s"
    rows = {
        "a slide on 23,000 nodes": f"{slide}; fastest other package {short(min(others))} s",
        "time to 0.1 % of the friction force": f"{short(own)} CPU s; fastest other package "
        f"{short(own * peer)} s",
    }
    for question, answer in rows.items():
        text, count = re.subn(
            rf"^\| {re.escape(question)} \|.*$", f"| {question} | {answer} |", text, flags=re.M
        )
        assert count == 1, question
    version, date = made["versions"]["evfem"], made["date"][:10]
    return re.sub(r"with version \S+ on\n\d{4}-\d\d-\d\d", f"with version {version} on\n{date}", text)


def page_on_the_paper() -> str:
    """The page on the paper, from the files in docs/results."""
    return paper.page(paper.sections(RESULTS), "pictures/")


def times(found: dict[str, Found], text: str) -> str:
    """The csv of the studies' seconds, with those of the runs that were found."""
    took = {row["study"]: row for row in csv.DictReader(text.splitlines())}
    for study, one in found.items():
        seconds = one["provenance"].get("seconds")
        row = took.setdefault(study, {"study": study, "whole": "", "quick": ""})
        if seconds is not None:
            row["quick" if one["provenance"]["quick"] else "whole"] = f"{float(f'{max(seconds, 0.1):.2g}'):g}"
    rows = [",".join(took[name].values()) for name in NAMES if name in took]
    return "\n".join(["study,whole,quick", *rows]) + "\n"


def keep(folder: Path, found: dict[str, Found]) -> None:
    """Copy pictures, and files with numbers of the paper; write the page on the paper."""
    for study, one in found.items():
        shutil.copy(folder / f"{study}.png", DOCS / "pictures" / f"{study}.png")
        if one["paper"]:
            shutil.copy(folder / f"{study}.json", RESULTS / f"{study}.json")
    PAPER.write_text(page_on_the_paper(), encoding="utf-8")


def main(folder: Path, times_alone: bool = False) -> None:
    """Renew the pages from the files of a folder."""
    files = {study: folder / f"{study}.json" for study in NAMES}
    found = {study: json.loads(file.read_text()) for study, file in files.items() if file.exists()}
    quick = [study for study, one in found.items() if one["provenance"].get("quick")]
    if quick and not times_alone:
        sys.exit(f"{', '.join(quick)} in {folder}: run with --quick; the pages take whole runs alone")
    TIMES.write_text(times(found, TIMES.read_text(encoding="utf-8")), encoding="utf-8")
    if not times_alone:
        blocks = {study: one for study, one in found.items() if study in BLOCKS}
        PAGE.write_text(renewed(PAGE.read_text(encoding="utf-8"), blocks), encoding="utf-8")
        if "peers" in found:
            text = rows_of_readme(README.read_text(encoding="utf-8"), found["peers"])
            README.write_text(text, encoding="utf-8")
        keep(folder, found)
    print(f"renewed from {', '.join(found) or 'nothing'}")


if __name__ == "__main__":
    main(Path(sys.argv[-1]), "--times" in sys.argv)
