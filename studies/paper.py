"""The paper, figure by figure: a page with every number that it prints beside the computed one, from
the files that the studies leave.
"""

import json
import textwrap
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from evfem.common.storage import write_text

from . import NAMES, title
from .common import markdown
from .printed import AGREES, INSIDE, Row, reasons, rows_of

TITLE = "The paper, figure by figure"
HEAD = ["what", "place", "paper", "here", "difference", "why"]
WIDTH = 99
STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 60rem; padding: 0 1rem; }
table { border-collapse: collapse; width: 100%; font-size: 0.9rem; }
td, th { border-bottom: 1px solid #ccc; padding: 0.2rem 0.6rem; text-align: left; }
td:nth-child(n+3), th:nth-child(n+3) { text-align: right; font-variant-numeric: tabular-nums; }
img { max-width: 100%; height: auto; }
"""


@dataclass(frozen=True)
class Section:
    """A study on the page: its name and title, its rows, and how its numbers came about."""

    name: str
    title: str
    rows: list[Row]
    made: Mapping[str, Any]

    @property
    def heading(self) -> str:
        """The figure or section of the paper."""
        return self.title.partition(":")[0]

    @property
    def about(self) -> str:
        """What it shows, as the beginning of a sentence."""
        return _capital(self.title.partition(": ")[2])

    @property
    def how(self) -> str:
        """When, how long and with which versions, in a sentence."""
        made, seconds = self.made, self.made.get("seconds")
        versions = ", ".join(f"{name} {number}" for name, number in made["versions"].items())
        took = "" if seconds is None else f" in {seconds:.0f} s" if seconds >= 1.0 else " in less than 1 s"
        quick = ", coarser and shorter (--quick)" if made.get("quick") else ""
        return f"Computed on {made['date'][:10]}{took}{quick} with {versions}."


def sections(folder: Path) -> list[Section]:
    """All studies whose file in the folder has printed numbers, in the order of `NAMES`."""
    found = []
    for name in NAMES:
        file = folder / f"{name}.json"
        result = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {"assumptions": {}}
        if rows := rows_of(result):
            found.append(Section(name, title(name), rows, result["provenance"]))
    return found


def summary(all_sections: Iterable[Section]) -> list[str]:
    """How many numbers agree, and how far apart the others are: sentences."""
    differences = [row.difference for section in all_sections for row in section.rows]
    apart = [abs(float(said.split()[0])) for said in differences if said not in (AGREES, INSIDE)]
    same = len(differences) - len(apart)
    near = sum(share < 1.0 for share in apart)
    return [
        f"Of {len(differences)} printed numbers {same} agree to the last digit or within the printed range.",
        f"Of the others {near} differ by less than 1 %, {len(apart) - near} by more.",
        "No number is fitted to the paper.",
    ]


def page(found: list[Section], pictures: str = "") -> str:
    """The page in Markdown; `pictures` is the folder of the pictures, with a slash at its end."""
    blocks = [f"# {TITLE}", "\n".join(summary(found))]
    for section in found:
        blocks += [
            f"## {section.heading}",
            "\n".join(_filled(f"{section.about} (`evfem study {section.name}`).")),
            f"![{_alternative(section)}]({pictures}{section.name}.png)",
            "\n".join(markdown(HEAD, _cells(section))),
        ]
        blocks += ["\n".join(markdown(head, cells)) for head, cells in _computed_otherwise(section)]
        lines = [_filled(f"{i}. {_sentence(why)}", "   ") for why, i in reasons(section.rows).items()]
        blocks += ["\n".join(line for item in lines for line in item)] if lines else []
        blocks.append("\n".join(_filled(section.how)))
    return "\n\n".join(blocks) + "\n"


def html(found: list[Section]) -> str:
    """The page as HTML, with the pictures beside it."""
    parts = [f"<h1>{TITLE}</h1>", f"<p>{escape(' '.join(summary(found)))}</p>"]
    for section in found:
        parts.append(f"<h2>{escape(section.heading)}</h2>")
        parts.append(f"<p>{escape(section.about)} (<code>evfem study {section.name}</code>).</p>")
        parts.append(f'<p><img src="{section.name}.png" alt="{escape(_alternative(section))}"></p>')
        rows = [_row(HEAD, "th"), *(_row(row, "td") for row in _cells(section))]
        parts.append("<table>\n" + "\n".join(rows) + "\n</table>")
        for heads, cells in _computed_otherwise(section):
            more = [_row(heads, "th"), *(_row(row, "td") for row in cells)]
            parts.append("<table>\n" + "\n".join(more) + "\n</table>")
        items = [f"<li>{escape(_sentence(why))}</li>" for why in reasons(section.rows)]
        parts.append("<ol>" + "\n".join(items) + "</ol>" if items else "")
        parts.append(f"<p>{escape(section.how)}</p>")
    head = f'<meta charset="utf-8">\n<title>{TITLE}</title>\n<style>{STYLE}</style>'
    body = "\n".join(parts)
    return f'<!DOCTYPE html>\n<html lang="en">\n<head>\n{head}\n</head>\n<body>\n{body}\n</body>\n</html>\n'


def _cells(section: Section) -> list[list[str]]:
    numbers = reasons(section.rows)
    return [
        [row.what, row.place, row.printed, row.here, row.difference, str(numbers.get(row.why, ""))]
        for row in section.rows
    ]


def _computed_otherwise(section: Section) -> list[tuple[list[str], list[list[str]]]]:
    """A second table, if there is one: printed numbers beside the same computed in other ways."""
    rows = [row for row in section.rows if row.others]
    heads = list(dict.fromkeys(head for row in rows for head in row.others))
    cells = [[row.what, row.printed, row.here, *(row.others.get(head, "") for head in heads)] for row in rows]
    return [(["what", "paper", "here", *heads], cells)] if rows else []


def _row(cells: Iterable[str], tag: str) -> str:
    return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in cells) + "</tr>"


def _sentence(why: str) -> str:
    return f"{_capital(why)}."


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _alternative(section: Section) -> str:
    return f"{section.heading}, computed"


def _filled(text: str, indent: str = "") -> list[str]:
    return textwrap.wrap(
        text, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )


def write(folder: Path) -> list[Path]:
    """Write paper.md and paper.html into the folder of the studies' files; none without such files."""
    found = sections(folder)
    texts = {"paper.md": page(found), "paper.html": html(found)} if found else {}
    for name, text in texts.items():
        write_text(folder / name, text)
    return [folder / name for name in texts]
