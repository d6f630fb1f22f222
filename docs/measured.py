"""Writes what the pages show of runs: every block between `<!-- measured: NAME -->` and `<!-- end -->`,
the page on the paper, the pictures, and the times that the command says beforehand:

    evfem study all peers campaign --out FOLDER
    python docs/measured.py FOLDER
    python docs/runs.py

The first two keep the files of the studies in docs/results and their pictures in docs/pictures, the third
measures the default run, single steps and ridged fingertips. A page has what these files have: a test
compares. `docs/results/long.csv` has what the tests do in hours, line by line, with date and commit.
`python docs/measured.py` alone writes the pages anew, `python docs/measured.py --times FOLDER` takes
the times of the studies alone, also of those with --quick.
"""

from __future__ import annotations

import csv
import json
import re
import shutil
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import benchmark
import others
from benchmark import table
from sentences import (
    Found,
    filled,
    fingerprint,
    fingertip,
    fringe,
    moisture,
    parameters,
    readme_why,
    short,
    soft,
)

from evfem.studies import NAMES, paper

DOCS = Path(__file__).parent
ROOT = DOCS.parent
RESULTS, PAPER = DOCS / "results", DOCS / "paper.md"
TIMES = ROOT / "studies" / "seconds.csv"
#: what a run left, as text between its marks
BLOCK = re.compile(r"(<!-- measured: ([\w-]+) -->\n\n).*?(\n<!-- end -->)", re.S)
PAGES = (ROOT / "README.md", *sorted(DOCS.rglob("*.md")))
#: how many campaigns a page is wide
SHOWN = 6
#: rows of the table of campaigns, which are columns of campaigns.csv
ENDS = ["scenes", "equilibrium", "explained", "not_converged", "invariants_broken", "error", "timeout"]


def default_run(runs: Found) -> str:
    """What `evfem run` takes."""
    n = runs["numbers"]
    return filled(
        f"`evfem run` ({n['default.nodes']:,.0f} nodes, {n['default.steps']:.0f} steps, "
        f"{n['default.MB']:.0f} MB of files) takes {short(n['default.cpu_s'])} CPU seconds, "
        "imports included, on one thread."
    )


def tips(runs: Found) -> str:
    """What ridged fingertips take."""
    n, rows = runs["numbers"], []
    for name, title in {"along": "along the finger", "whorl": "whorl"}.items():
        nodes, steps, spent, memory = (n[f"tip.{name}.{key}"] for key in ("nodes", "steps", "cpu_s", "GB"))
        rows.append([title, f"{nodes:,.0f}", f"{steps:.0f}", short(spent), short(memory)])
    return table(["ridges", "nodes", "steps", "CPU s", "GB"], rows)


def loop_times(runs: Found) -> str:
    """What a step of a loop takes."""
    n, rows = runs["numbers"], []
    for name, title in LOOPS.items():
        begin, half, most = (n[f"loop.{name}.{key}"] for key in ("begin_s", "median_s", "ninth_s"))
        count = n[f"loop.{name}.unknowns"]
        unknowns = f"{float(f'{count:.2g}'):,.0f}"
        rows.append([f"{title}, {unknowns} unknowns", *map(seconds, (begin, half, most))])
    return table(["finger", "to begin", "half of the steps below", "nine of ten below"], rows)


#: name of a loop in runs.json -> the finger
LOOPS = {
    "coarse": "`coarse` pad",
    "medium": "`medium` pad",
    "fingertip": "`coarse` fingertip",
}


def seconds(value: float) -> str:
    """Seconds, or milliseconds below a tenth of one."""
    return f"{short(value)} s" if value >= 0.1 else f"{short(1e3 * value)} ms"


def robustness(stability: Found, campaigns: list[Found], long: list[Found], mistakes: Found) -> str:
    """What was tried to break it, and what it did."""
    n, last = stability["numbers"], max(reversed(campaigns), key=lambda one: int(one["scenes"]))
    rows = [[row["question"], row["answer"], f"`{row['where']}`"] for row in long]
    cases = f"{n['good']:.0f} of {n['cases']:.0f} end as they should"
    rows.append(["hard cases", cases, "`evfem study stability`"])
    ends = f"{last['equilibrium']} equilibria, {last['explained']} explained"
    rows.append([f"{int(last['scenes']):,} drawn scenes", ends, "`evfem study campaign`"])
    rows.append(
        [
            f"{len(mistakes['mistake'])} deliberate errors in the physics",
            "each makes a test fail",
            "`tests/tools/mistakes.py`",
        ]
    )
    return table(["question", "answer", "test"], rows)


def campaigns(rows: list[Found]) -> str:
    """Ends of the last campaigns, as many as a page is wide, by seeds."""
    rows = rows[-SHOWN:]
    lines = [[f"`{end}`" if end != "scenes" else end, *(row[end] or "-" for row in rows)] for end in ENDS]
    lines.append(["CPU s of a scene, at most", *(row["limit"] for row in rows)])
    lines.append(["slowest over the median of its size", *(f"{float(row['slowest']):.0f}" for row in rows)])
    lines.append(["energy left over", *(f"{float(row['remainder']):.1e}" for row in rows)])
    lines.append(["date", *(row["date"] for row in rows)])
    return table(["seed", *(row["seed"] for row in rows)], lines)


#: what a way to run a scene may cost, in the scenes in which it acts
COSTS = ("iterations", "factorisations")
#: ways to run a scene that should end as it does, in words
WAYS = {
    "solver": "the other sparse solver",
    "input": "an input changed by 1e-9",
    "compiled": "without compiled code",
    "kept": "no tangent kept",
    "predicted": "nothing extrapolated",
    "steps": "twice the steps",
}


#: safeguards of the solver, in words
SAFEGUARDS = {
    "release": "release",
    "barrier": "barriers",
    "stuck": "stagnation",
    "stability": "stability of what is accepted",
    "fold": "folds of the outline",
    "volume": "volume ratios above 0.05",
    "travel": "bone's travel limited",
    "softening": "softening scaled below critical",
    "gain": "gain between rough faces limited",
    "slope": "slope of friction in the compliance",
    "follower": "turning contact forces",
    "brackets": "bracketed friction",
    "pins": "pins at jumps of friction",
    "rounds": "nodes added before the next iterate",
    "damped": "damped changes of status",
    "worst": "worst node first",
    "coarser": "longer substeps after a release",
    "combined": "combined iterates",
}


def ends(words: dict[str, str], what: str) -> Callable[[list[Found]], str]:
    """What shows how drawn scenes end on other ways, which have these `words`."""

    def shown(rows: list[Found]) -> str:
        lines = []
        for row in sorted(rows, key=lambda row: [*words].index(row["variant"])):
            late = str(int(row["scenes"]) - int(row["compared"]))
            scenes = [row["compared"], late, *(row[name] for name in ("worse", "elsewhere", "largest"))]
            costs = [f"x {float(row[name]):.2f}" for name in COSTS]
            lines.append([words[row["variant"]], *scenes, row["acts"], *costs])
        heads = [what, "scenes", "timeouts", "worse", "elsewhere", "largest", "acts", *COSTS]
        return table(heads, lines)

    return shown


def rows_of(text: str) -> list[Found]:
    """Rows of a csv file by its header; ValueError where a row is longer or shorter."""
    head, *rows = csv.reader(text.splitlines())
    return [dict(zip(head, row, strict=True)) for row in rows]


#: table -> what a row of it is of
TABLES = {
    "long.csv": "{question}",
    "campaigns.csv": "campaign {seed}",
    "variants.csv": "scenes of seed {seed} on other ways",
    "safeguards.csv": "scenes of seed {seed} without safeguards",
}


def when() -> str:
    """What was run when, at which commit, with which version, for how long."""
    rows = []
    for path in RESULTS.glob("*.json"):
        made = json.loads(path.read_text(encoding="utf-8"))["provenance"]
        took = made.get("seconds")
        said = [f"evfem {made['versions']['evfem']}, Python {made['versions']['python']}"]
        said += [] if took is None else [seconds(max(took, 0.1))]
        rows.append([f"`{path.stem}`", made["date"][:10], made.get("commit") or "-", ", ".join(said)])
    for name, what in TABLES.items():
        found = rows_of((RESULTS / name).read_text(encoding="utf-8"))
        said = {what.format(**row): [row["date"], row["commit"] or "-", ""] for row in found}
        rows += [[one, *more] for one, more in said.items()]
    rows.sort(key=lambda row: row[0])
    return table(["what", "date", "commit", "with"], sorted(rows, key=lambda row: row[1], reverse=True))


MISTAKES = "../../tests/tools/mistakes.toml"
#: block -> what makes it, and the files in docs/results that it needs
BLOCKS: dict[str, tuple[Callable[..., str], list[str]]] = {
    "readme": (benchmark.readme, ["peers.json", "runs.json"]),
    "readme-why": (readme_why, ["peers.json"]),
    "readme-others": (others.readme, ["measured.json"]),
    "peers-run": (benchmark.run, ["peers.json"]),
    "peers-costs": (benchmark.costs, ["peers.json"]),
    "peers-ratios": (benchmark.ratios, ["peers.json"]),
    "peers-race": (benchmark.race, ["peers.json"]),
    "precision-run": (benchmark.run, ["work_precision.json"]),
    "precision-cheapest": (benchmark.cheapest, ["work_precision.json"]),
    "precision-questions": (benchmark.questions, ["work_precision.json"]),
    "default-run": (default_run, ["runs.json"]),
    "loop-times": (loop_times, ["runs.json"]),
    "tips": (tips, ["runs.json"]),
    "robustness": (robustness, ["stability.json", "campaigns.csv", "long.csv", MISTAKES]),
    "campaigns": (campaigns, ["campaigns.csv"]),
    "variants": (ends(WAYS, "way"), ["variants.csv"]),
    "safeguards": (ends(SAFEGUARDS, "without"), ["safeguards.csv"]),
    "fringe": (fringe, ["fringe.json"]),
    "fingertip": (fingertip, ["fingertip.json"]),
    "fingerprint": (fingerprint, ["fingerprint.json"]),
    "sensitivities": (parameters, ["sensitivities.json"]),
    "soft": (soft, ["soft_display.json"]),
    "moisture": (moisture, ["moisture.json"]),
    "others-lead": (others.lead, ["measured.json"]),
    "others-table": (others.table, ["measured.json"]),
    "others-signs": (others.signs, ["measured.json"]),
    "others-words": (others.words, ["measured.json"]),
    "when": (when, []),
}
READERS: dict[str, Callable[[str], Any]] = {
    ".json": json.loads,
    ".csv": rows_of,
    ".toml": tomllib.loads,
}


def made(name: str, old: str) -> str:
    """The text of a block; the old one where a file that it needs is not there yet."""
    make, files = BLOCKS[name]
    paths = [RESULTS / file for file in files]
    if not all(path.exists() for path in paths):
        return old
    return make(*(READERS[path.suffix](path.read_text(encoding="utf-8")) for path in paths))


def renewed(text: str) -> str:
    """A page with the blocks that the files in docs/results give."""
    return BLOCK.sub(lambda m: m[1] + made(m[2], m[0][len(m[1]) : -len(m[3])]) + m[3], text)


def page_on_the_paper() -> str:
    """The page on the paper, from the files in docs/results."""
    return paper.page(paper.sections(RESULTS), "pictures/")


def times(found: dict[str, Found], text: str) -> str:
    """The csv of the studies' seconds, with those of the runs that were found."""
    took = {row["study"]: row for row in csv.DictReader(text.splitlines())}
    for study, one in found.items():
        spent = one["provenance"].get("seconds")
        row = took.setdefault(study, {"study": study, "whole": "", "quick": ""})
        if spent is not None:
            row["quick" if one["provenance"]["quick"] else "whole"] = f"{float(f'{max(spent, 0.1):.2g}'):g}"
    rows = [",".join(took[name].values()) for name in NAMES if name in took]
    return "\n".join(["study,whole,quick", *rows]) + "\n"


def with_campaign(rows: list[Found], found: Found) -> list[Found]:
    """Campaigns with that of a file, in place of one of the same seed."""
    n, how = found["numbers"], found["provenance"]
    drawn = how["parameters"]
    row = {"seed": f"{drawn['seed']}"} | {end: f"{n[end]:.0f}" for end in ENDS}
    row |= {"limit": f"{drawn['limit']}", "slowest": f"{n['slowest_over_median']:.3g}"}
    row |= {"remainder": f"{n['largest_remainder']:.2g}", "date": how["date"][:10]}
    row |= {"commit": how.get("commit") or ""}
    return [*(one for one in rows if one["seed"] != row["seed"]), row]


def keep(folder: Path, found: dict[str, Found]) -> None:
    """Copy pictures and files."""
    for study in found:
        shutil.copy(folder / f"{study}.png", DOCS / "pictures" / f"{study}.png")
        if study != "campaign":
            shutil.copy(folder / f"{study}.json", RESULTS / f"{study}.json")
    if "campaign" in found:
        path = RESULTS / "campaigns.csv"
        rows = with_campaign(READERS[".csv"](path.read_text(encoding="utf-8")), found["campaign"])
        lines = [",".join(rows[0]), *(",".join(row.values()) for row in rows)]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write() -> None:
    """Write the pages anew from docs/results."""
    PAPER.write_text(page_on_the_paper(), encoding="utf-8")
    for page in PAGES:
        page.write_text(renewed(page.read_text(encoding="utf-8")), encoding="utf-8")
    missing = sorted({f for _, files in BLOCKS.values() for f in files if not (RESULTS / f).exists()})
    print(f"not there yet: {', '.join(missing)}" if missing else "every block is that of its files")


def main(folder: Path | None = None, times_alone: bool = False) -> None:
    """Keep the files of a folder, and renew the pages."""
    files = {} if folder is None else {study: folder / f"{study}.json" for study in NAMES}
    found = {study: json.loads(file.read_text()) for study, file in files.items() if file.exists()}
    quick = [study for study, one in found.items() if one["provenance"].get("quick")]
    if quick and not times_alone:
        sys.exit(f"{', '.join(quick)} in {folder}: run with --quick; the pages take whole runs alone")
    TIMES.write_text(times(found, TIMES.read_text(encoding="utf-8")), encoding="utf-8")
    if folder is not None and not times_alone:
        keep(folder, found)
    write()


if __name__ == "__main__":
    folders = [Path(word) for word in sys.argv[1:] if word != "--times"]
    main(folders[0] if folders else None, "--times" in sys.argv)
