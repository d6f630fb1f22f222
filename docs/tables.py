"""Writes what stands in the documentation about keys, columns, importers and public names from the
package itself: `python docs/tables.py` after a change of one. A test compares.
"""

import re
import textwrap
from pathlib import Path

import evfem
from evfem.common.checks import Key, keys_of
from evfem.response.file import SensitivityTable
from evfem.scene import schema as scenes
from evfem.scene.schema import Entry, Section
from evfem.simulation.history import MEANINGS
from evfem.simulation.result import UNITS
from evfem.sweeps import file as sweeps
from evfem.textures.importers import IMPORTERS

DOCS = Path(__file__).parent
WIDTH = 99
HEAD = """\
# Keys of scenes, sweeps and sensitivities

<!-- written by docs/tables.py -->

Each key with type, unit, default and what is allowed, as the reader of the files has them.
`evfem schema` prints the same as a JSON schema, with which an editor completes and checks keys
([how](../commandline.md#keys-in-an-editor)); `evfem init` writes a scene to begin with.
A number in mm, s, V, MPa, Hz, degrees or the like may also be a text with
[another unit](../notation.md#units).
"""
OPTIONS = re.compile("(<!-- importers -->)\n.*?(<!-- end -->)", re.S)
PUBLIC = re.compile("(<!-- public names -->)\n.*?(<!-- end -->)", re.S)
TABLE = re.compile(r"(?<=^## Columns of the history\n\n)(.*?\n\n)\|.*?\n\n", re.M | re.S)


def page() -> str:
    """The page of keys."""
    parts = [HEAD]
    asked = [scenes.section("", SensitivityTable)]
    for title, found in (
        ("Scene", scenes.sections()),
        ("Sweep", sweeps.sections()),
        ("Sensitivities", asked),
    ):
        parts.append(f"## {title}\n")
        seen: set[tuple[str, str]] = set()
        for section in found:
            parts.append(f"### {heading(title, section)}\n")
            new = [key for key in section.keys if (section.name, entry(key)) not in seen]
            seen |= {(section.name, entry(key)) for key in section.keys}
            parts.append("\n".join(map(entry, new)) + "\n")
            if again := [f"`{key.name}`" for key in section.keys if key not in new]:
                parts.append(filled(f"And as above: {', '.join(again)}.", "") + "\n")
    return "\n".join(parts)


def heading(title: str, section: Section) -> str:
    """What a table is called."""
    if not section.name:
        return f"The {title.lower()} file"
    table = "[[motion]]" if section.name == "motion" else f"[{section.name}]"
    return f"`{table}`: {section.kind}" if section.kind else f"`{table}`"


def entry(key: Entry) -> str:
    """An item of a list about a key, each sentence on a line."""
    if "const" in key.schema:
        return f'- `{key.name} = "{key.schema["const"]}"`'
    unit = f" in {key.unit}" if key.unit else ""
    default = "needed" if key.required else f"default `{key.default}`" if key.default else "optional"
    rule = filled(f"- `{key.name}`: {key.type}{unit}; {default}; {key.allowed}.")
    return f"{rule}\n{filled(f'  {key.meaning[0].upper()}{key.meaning[1:]}.')}"


def filled(text: str, indent: str = "  ") -> str:
    """The text in lines that fit."""
    return textwrap.fill(
        text, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )


def columns(text: str) -> str:
    """The page on notation with the table of the history's columns."""
    lines = ["| name | unit | meaning |", "|---|---|---|"]
    lines += [f"| `{name}` | {UNITS[name]} | {MEANINGS[name]} |".replace("|  |", "| |") for name in MEANINGS]
    return TABLE.sub(lambda found: found[1] + "\n".join(lines) + "\n\n", text)


def importers(text: str) -> str:
    """The page on textures with the options of all kinds of files."""
    keys = {key.name: key for one in IMPORTERS.values() for key in keys_of(one)}
    lines = []
    for name in keys:
        kinds = [kind for kind, one in IMPORTERS.items() if name in {key.name for key in keys_of(one)}]
        whose = ", ".join(kinds) if len(kinds) < len(IMPORTERS) else "all"
        lines.append(filled(f"- `--{name}` ({whose}): {_told(keys[name])}."))
    return OPTIONS.sub(lambda found: found[1] + "\n\n" + "\n".join(lines) + "\n\n" + found[2], text)


def public_names(text: str) -> str:
    """The first page of the reference with a list of the public names for each page that has some."""
    parts, places = [], _places()
    for page, own in places.items():
        heading = (DOCS / "reference" / f"{page}.md").read_text(encoding="utf-8").splitlines()[0]
        rows = [filled(f"- `ev.{name}`: {_summary(getattr(evfem, name))}.") for name in sorted(own)]
        lines = [f"### [{heading.removeprefix('# ')}]({page}.md)", "", *rows]
        parts.append("\n".join(lines))
    return PUBLIC.sub(lambda found: f"{found[1]}\n\n" + "\n\n".join(parts) + f"\n\n{found[2]}", text)


def _places() -> dict[str, list[str]]:
    """Page of the reference -> public names whose module it shows."""
    places: dict[str, list[str]] = {}
    homes = evfem._HOME | evfem._MODULES
    for path in sorted((DOCS / "reference").glob("*.md")):
        shown = re.findall(r"automodule:: evfem\.([\w.]+)", path.read_text(encoding="utf-8"))
        if own := [name for name, home in homes.items() if home in shown]:
            places[path.stem] = own
    return places


def _summary(thing: object) -> str:
    """The first sentence of a docstring, or the value of what has none of its own."""
    if isinstance(thing, float) or type(thing).__module__.startswith("evfem."):
        return f"`{thing!r}`"
    paragraph = " ".join((thing.__doc__ or "").split("\n\n")[0].split())
    first = re.split(r"(?<=[\w)`*])[.;] ", paragraph)[0].rstrip(".")
    return first.replace(" + ", "\xa0+ ")  # no line begins with what makes an item of a list


def _told(key: Key) -> str:
    unit = f" in {key.rule['unit']}" if key.rule.get("unit") else ""
    default = "; needed" if key.required else f"; default {key.default}" if key.default is not None else ""
    return f"{key.meaning}{unit}; {key.allowed}{default}".replace("|", "or")


def main() -> None:
    """Write the pages."""
    reference = DOCS / "reference" / "index.md"
    reference.write_text(public_names(reference.read_text(encoding="utf-8")), encoding="utf-8")
    (DOCS / "reference" / "keys.md").write_text(page(), encoding="utf-8")
    notation = DOCS / "notation.md"
    notation.write_text(columns(notation.read_text(encoding="utf-8")), encoding="utf-8")
    textures = DOCS / "howto" / "texture.md"
    textures.write_text(importers(textures.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
