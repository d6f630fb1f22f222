"""One page about a run, for whoever has to judge it: scene, plan, forces, pictures, accuracy, versions.

The page is one HTML file that needs nothing else: pictures are in it as PNG, there are no scripts, it prints
on A4 and is read on a telephone. Everything that comes from the run is escaped.
"""

from __future__ import annotations

import base64
import html
import io
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evfem.common import notices
from evfem.common.storage import check_ending, write_text
from evfem.common.views import plus
from evfem.errors import InputError
from evfem.simulation.history import DRIFT, HEADS, chosen
from evfem.simulation.result import Result

if TYPE_CHECKING:
    from evfem.sweeps.check import Checked

#: where works go
SPENT = (
    "stored_energy",
    "kinetic_energy",
    "friction_dissipation",
    "viscous_dissipation",
    "integrator_dissipation",
    "snap_dissipation",
)
#: columns that say nothing of the finger
COUNTS = ("step", "motion_index", "motion", "substeps", "newton_iterations", "seconds")
#: further columns of the table of forces, and their heads there
FRICTION = {"friction": "friction", "apparent_friction": "apparent"}
#: what no run knows
UNKNOWN = (
    "These are errors of the computation. What the model does not know is usually larger: the gap between "
    "skin and surface, the real area of contact, the coefficient of friction. Vary them too "
    "(evfem sensitivities, evfem sweep)."
)
#: of a section with a depth
OVER = (
    " Forces (N) and areas are over a depth of {:g} mm; what is in N/mm (warnings, checks, scene, plan) is "
    "per mm of it."
)
#: rows of the table of forces; dots per inch of a picture
ROWS, DPI = 12, 120
STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.5 "Helvetica Neue", Arial, sans-serif; color: #1b1b1b; background: #fff;
  max-width: 46rem; margin: 0 auto; padding: 1rem; overflow-wrap: anywhere; }
h1 { font-size: 1.6rem; line-height: 1.2; margin: 0 0 .3rem; }
h2 { font-size: 1.15rem; margin: 2rem 0 .5rem; border-bottom: 1px solid #bbb; break-after: avoid; }
p { margin: .5rem 0; } figure { margin: 1rem 0; break-inside: avoid; }
img { max-width: 100%; height: auto; } figcaption { font-size: .875rem; color: #444; }
pre { font: .8125rem/1.45 "DejaVu Sans Mono", Consolas, monospace; white-space: pre-wrap;
  background: #f5f5f3; padding: .7rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .8125rem; overflow-wrap: normal; }
caption { text-align: left; color: #444; padding-bottom: .3rem; }
th, td { padding: .2rem .4rem; text-align: right; vertical-align: top; white-space: nowrap;
  border-bottom: 1px solid #ddd; }
th:first-child, td:first-child { text-align: left; padding-left: 0; }
.words td:last-child, .words th:last-child { text-align: left; white-space: normal; min-width: 7rem; }
.words td:first-child { white-space: normal; }
.facts td { text-align: left; white-space: normal; overflow-wrap: anywhere; }
.warning { border-left: 4px solid #d55e00; padding: .1rem .8rem; background: #fdf3ec; }
@media print { body { font-size: 10pt; max-width: none; padding: 0; } .wide { overflow: visible; }
  table { font-size: 7.5pt; } th, td { padding: 1pt 3pt; } pre { font-size: 8pt; }
  img { max-height: 9cm; } }
@page { size: A4; margin: 18mm 16mm; }
"""


def report(result: Result, path: str | Path, checked: Checked | None = None) -> None:
    """Write a page about a run, whole or not at all.

    Parameters
    ----------
    result
        A result with at least one step.
    path
        The file, ending in .html.
    checked
        What `ev.check` found of the same scene: its tables are then in the page.

    Raises
    ------
    InputError
        Another ending, or a result without a step.
    StorageError
        The file cannot be written.
    """
    check_ending(path, ".html", "the page is one HTML file; a browser prints it as .pdf")
    write_text(path, page(result, checked))


def told(result: Any, check: bool = False) -> str:
    """The page of `evfem report`, with a check of the scene if that is wished; InputError for no run."""
    if not isinstance(result, Result):
        raise InputError("report", type(result).__name__, "the folder of a run, or a saved result (.npz)")
    if not check:
        return page(result)
    from evfem.sweeps.check import check as compared

    with notices.status("checking the scene"):
        return page(result, compared(result.scene))


def page(result: Result, checked: Checked | None = None) -> str:
    """The page as a text."""
    if not len(result.step):
        raise InputError("result", "a result without a step", "a run that has at least one")
    whole = result.total if result.depth is not None else result
    title = f"Run of {_name(result)}"
    parts = (
        _head(result, title),
        _warnings(result),
        _section("Forces", [_forces(whole), *_curves(whole)]),
        _section("At the end", [_end(whole), *_pictures(whole)]),
        _section("Numerical error", _accuracy(result, checked)),
        _section("Scene", [_pre(str(result.provenance.get("parameters", "")))]),
        _section("Plan", [_plan(result)]),
        _section("Versions", [_versions(result)]),
    )
    meta = '<meta charset="utf-8">\n<meta name="viewport" content="width=device-width, initial-scale=1">'
    head = f"{meta}\n<title>{html.escape(title)}</title>\n<style>{STYLE}</style>"
    body = "<main>\n" + "\n".join(parts) + "\n</main>"
    return f'<!DOCTYPE html>\n<html lang="en">\n<head>\n{head}\n</head>\n<body>\n{body}\n</body>\n</html>\n'


def _name(result: Result) -> str:
    return str(result.provenance.get("scene", {}).get("name", "scene"))


def _head(result: Result, title: str) -> str:
    about, steps = result.provenance, len(result.step)
    wanted = about.get("scene", {}).get("total_steps", steps)
    version = about.get("versions", {}).get("evfem", "")
    done = "complete" if steps == wanted else f"ended after {steps} of {wanted} steps"
    size = f"{len(result.mesh.points)} nodes, {len(result.mesh.cells)} cells ({result.mesh.kind})"
    seconds = float(np.sum(result.seconds))
    text = f"evfem {version}, {about.get('date', '')}: {steps} steps, {done}; {size}; "
    text += f"computed in {seconds:.3g} s."
    over = "" if result.depth is None else OVER.format(result.depth)
    return f"<h1>{html.escape(title)}</h1>\n{_p(text + over)}"


def _warnings(result: Result) -> str:
    found = list(result.warnings)
    if (drift := result.load_drift) > DRIFT:
        found.append(f'the load drifted by {drift:.1%} at a held indentation; hold = "force" keeps it')
    if not found:
        return _section("Warnings", [_p("None.")])
    told = [f'<p class="warning">{html.escape(_sentence(one))}</p>' for one in found]
    told += [_p(_sentence(one)) for one in per_depth(found, result.depth)]
    return _section("Warnings", told)


def per_depth(warnings: Sequence[str], depth: float | None) -> list[str]:
    """A sentence that says what N/mm in warnings is in N, where other forces are over a whole `depth` (mm).

    >>> per_depth(["step 3: reached 0.02 N/mm at 400 V"], 10.0)
    ['these warnings are per mm of depth: 0.01 N/mm are 0.1 N over the depth of 10 mm']
    >>> per_depth(["motion 1, a slide, never touched"], 10.0), per_depth(["reached 0.02 N/mm"], None)
    ([], [])
    """
    if depth is None or not any(unit in one for one in warnings for unit in ("N/mm", "N mm/mm")):
        return []
    over = f"0.01 N/mm are {0.01 * depth:.4g} N over the depth of {depth:g} mm"
    return [f"these warnings are per mm of depth: {over}"]


def _forces(whole: Result) -> str:
    """The history in about a dozen rows, the last of each motion always."""
    heads = {name: short for name, (short, *_) in HEADS.items()}
    heads |= {name: short for name, short in FRICTION.items() if name in whole.columns}
    rows = [
        [str(whole.step[i]), str(whole.motion[i]), *(_number(whole[name][i]) for name in heads)]
        for i in chosen(whole.rows, ROWS)
    ]
    units = [f"{short}<br>{whole.units[name]}" for name, short in heads.items()]
    said = f"{len(rows)} of {len(whole.step)} steps; the last one of each motion is among them"
    return _table(said, ["step", "motion", *units], rows)


def _curves(whole: Result) -> Iterator[str]:
    from evfem.plotting.curves import forces

    largest = float(np.max(np.abs(whole.normal_force)))
    unit = whole.units["normal_force"]
    said = f"Forces over the run; the normal force is at most {largest:.4g} {unit}."
    yield _figure(forces(whole).figure, said)


def _end(whole: Result) -> str:
    """The columns of the last step with unit and meaning."""
    meanings, last = whole.meanings, {name: whole[name][-1] for name in whole.columns if name not in COUNTS}
    rows = [
        [
            _named(name, whole.units[name]),
            _number(value),
            whole.units[name].replace("mm2", "mm²"),
            meanings[name],
        ]
        for name, value in last.items()
        if np.isfinite(value) and plus(value) != 0.0
    ]
    heads = ["column", "value", "unit", "meaning"]
    return _table("The last step, without columns that are 0", heads, rows, "words")


def _named(name: str, unit: str) -> str:
    """A column's name; a width over a depth is an area."""
    return name.replace("width", "area") if unit == "mm2" else name


def _pictures(result: Result) -> Iterator[str]:
    """The finger of the last frame, where fields were kept."""
    if not result.frames:
        yield _p("No fields were kept, so there is no picture of the finger.")
        return
    from evfem.plotting.labels import shown_in

    frame = result.frames[-1]
    most, at = np.max(frame.contact_pressure), f"step {frame.step}"
    unit, factor = shown_in("MPa", most)
    pressure = f"{factor * most:.3g} {unit}"
    if result.mesh.dim == 3:
        from evfem.plotting.footprint import footprint

        said = f"Contact pressure from below in {at}, at most {pressure}."
        yield _figure(footprint(result, near="contact").figure, said)
        return
    from evfem.plotting.curves import contact_pressure
    from evfem.plotting.finger import deformed

    yield _figure(deformed(result).figure, f"The deformed finger with its von Mises stress in {at}.")
    yield _figure(contact_pressure(result).figure, f"Contact pressure in {at}, at most {pressure}.")


def _accuracy(result: Result, checked: Checked | None) -> Iterator[str]:
    solver = result.provenance.get("solver", {})
    rows = [
        ["residual of every step, relative to the largest reaction", f"below {solver.get('tolerance', '?')}"],
        ["energy that the balance leaves over, of the largest work", f"{_left_over(result):.1e}"],
        ["energy that finite steps dissipate, of the largest work", f"{_by_steps(result):.1e}"],
        ["drift of the load at a held indentation", f"{result.load_drift:.1e}"],
        ["releases and snaps", str(int(np.sum(result.jumps)))],
        ["linear solver", str(solver.get("backend", "?"))],
    ]
    yield _table("What the run itself says", [], rows, "facts")
    yield _p(UNKNOWN)
    if checked is None:
        yield _p(
            "How far mesh, steps and solution path change the numbers is not said here: a check runs the "
            "scene with others (evfem report FOLDER --check)."
        )
        return
    from evfem.sweeps.accuracy import accuracy_rows

    unit = result.units["normal_force"]
    heads, *ends = checked.ends()
    yield _table(
        f"Ends of the scene run in other ways, forces in {unit}, lengths in mm", heads, ends, "words"
    )
    yield _p(_sentence(checked.verdict))
    if checked.outputs:
        heads, *errors = accuracy_rows(checked.outputs)
        yield _table(f"Errors of the numbers at the end, forces in {unit}", heads, errors, "words")


def _works(result: Result) -> Mapping[str, Any]:
    names = ("external_work", "electrostatic_work", "adhesive_work")
    return {name: np.asarray(result[name]) for name in names}


def _largest(result: Result) -> float:
    """The largest work or energy of a run, not 0."""
    found = [np.abs(one).max() for one in (*_works(result).values(), np.asarray(result.stored_energy))]
    return float(max(*found, 1e-300))


def _left_over(result: Result) -> float:
    """Works less energies and dissipations, at most, relative to the largest work."""
    left = sum(_works(result).values()) - sum(np.asarray(result[name]) for name in SPENT)
    return float(np.abs(left).max()) / _largest(result)


def _by_steps(result: Result) -> float:
    return float(np.abs(result.integrator_dissipation).max()) / _largest(result)


def _plan(result: Result) -> str:
    """The plan of the scene on the mesh of the run."""
    from evfem.planning.plan import plan_on

    try:
        scene = result.scene
        element = scene.solver.element_on(result.mesh.corners)
        return _pre(str(plan_on(scene, result.mesh, element)))
    except InputError as error:
        return _p(f"There is no plan: {error}.")


def _versions(result: Result) -> str:
    about = result.provenance
    rows = [[name, str(version)] for name, version in about.get("versions", {}).items()]
    rows += [[f"{name} (digest)", str(about.get(name, {}).get("digest", ""))] for name in ("scene", "mesh")]
    return _table("", [], rows, "facts")


def _number(value: Any) -> str:
    value = float(value)
    return f"{plus(value):.5g}" if np.isfinite(value) else ""


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}{'' if text.endswith('.') else '.'}"


def _p(text: str) -> str:
    return f"<p>{html.escape(text)}</p>"


def _pre(text: str) -> str:
    return f"<pre>{html.escape(text.strip())}</pre>"


def _section(title: str, parts: Iterable[str]) -> str:
    return "\n".join([f"<section>\n<h2>{html.escape(title)}</h2>", *parts, "</section>"])


def _table(caption: str, heads: Sequence[str], rows: Sequence[Sequence[str]], kind: str = "numbers") -> str:
    """A table of texts, which are escaped; heads are HTML."""
    top = "".join(f'<th scope="col">{head}</th>' for head in heads)
    lines = ["".join(f"<td>{html.escape(cell).replace('_', '_<wbr>')}</td>" for cell in row) for row in rows]
    body = "\n".join(f"<tr>{line}</tr>" for line in ([top] if top else []) + lines)
    named = f"<caption>{html.escape(caption)}</caption>\n" if caption else ""
    return f'<div class="wide" tabindex="0"><table class="{kind}">\n{named}{body}\n</table></div>'


def _figure(figure: Any, said: str) -> str:
    """A picture in the page, and what it shows in words."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=DPI)
    if "matplotlib.pyplot" in sys.modules:  # which would show it below a notebook's cell as well
        sys.modules["matplotlib.pyplot"].close(figure)
    data, words = base64.b64encode(file.getvalue()).decode("ascii"), html.escape(said)
    image = f'<img alt="{words}" src="data:image/png;base64,{data}">'
    return f"<figure>{image}<figcaption>{words}</figcaption></figure>"
