"""The keywords of a deck of Abaqus or CalculiX (`.inp`) that say what its body is.

Read are *NODE, *ELEMENT, *NSET, *ELSET, *SURFACE, *SYSTEM, *PART, *INSTANCE and *ASSEMBLY; what makes or
moves nodes in another way is refused by its name (`REFUSED`); steps, materials, sections and conditions
are passed over. Names count without their case. Source: Abaqus keywords guide (2017).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from evfem.common.arrays import Floats

_PLANE = {3: "triangle", 4: "quad", 6: "triangle6", 65: "triangle6", 8: "quad8", 9: "quad9"}
_TRUSS = {2: "line", 3: "line3"}
_BEAM = {1: "line", 2: "line3", 3: "line"}
_SOLID = {4: "tetra", 5: "pyramid", 6: "wedge", 8: "hexahedron", 10: "tetra10", 15: "wedge15",
          20: "hexahedron20", 27: "hexahedron27"}  # fmt: skip
#: first letters of an element's name -> its kind, by the number that follows them
FAMILIES: Mapping[str, Mapping[int, str]] = {
    **dict.fromkeys(("CPE", "CPEG", "CPS", "M3D", "SFM3D", "S", "STRI", "R3D"), _PLANE),
    **dict.fromkeys(("T2D", "T3D", "R2D"), _TRUSS),
    **dict.fromkeys(("B2", "B3"), _BEAM),
    "C3D": _SOLID,
}
_TYPE = re.compile(rf"({'|'.join(FAMILIES)})(\d+)[A-Z]*5?")
#: keywords that make or move nodes or elements, and are not read -> what to do
REFUSED: Mapping[str, str] = {
    **dict.fromkeys(
        ("NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYMMETRICMODELGENERATION"),
        "write the nodes and elements out",
    ),
    **dict.fromkeys(("IMPERFECTION", "ADJUST"), "write the nodes where they come to lie"),
    **dict.fromkeys(("INCLUDE", "IMPORT"), "write everything into one file"),
}
#: the scope of an assembly; others are the names of parts, and "" where a deck has none
ASSEMBLY = "*ASSEMBLY"


class Card(NamedTuple):
    """A keyword, without its star and blanks, its parameters, and the lines of data below it."""

    word: str
    parameters: Mapping[str, str]
    lines: list[str]

    def get(self, name: str) -> str | None:
        """The value of a parameter, which may be cut to three letters or more; "" where it has none."""
        for key, value in self.parameters.items():
            if key == name or (len(key) > 2 and name.startswith(key)):
                return value
        return None

    def named(self, name: str) -> str:
        """The value of a parameter that must be there."""
        if not (value := self.get(name)):
            raise ValueError(f"*{self.word} without {name}=")
        return value

    def rows(self) -> Iterator[list[str]]:
        """The words of the lines of data."""
        return ([word.strip() for word in line.removesuffix(",").split(",")] for line in self.lines)

    def numbers(self) -> list[list[float]]:
        """The lines of data as numbers, 0 for what is empty."""
        try:
            return [[float(word.upper().replace("D", "E") or 0) for word in row] for row in self.rows()]
        except ValueError:
            raise ValueError(f"*{self.word} with data that are no numbers") from None

    def whole(self) -> list[list[int]]:
        """The lines of data as integers."""
        try:
            return [[int(word) for word in row if word] for row in self.rows()]
        except ValueError:
            raise ValueError(f"*{self.word} with data that are no whole numbers") from None


#: numbers of nodes or elements in a scope
Members = tuple[str, "list[int] | range"]


class Named(NamedTuple):
    """A set as the deck spells it, its members, and whether Abaqus/CAE made it."""

    name: str
    members: list[Members]
    internal: bool = False


class Surface(NamedTuple):
    """As the deck spells it, whether of elements (ELSET) or nodes (NSET), and those with their faces."""

    name: str
    of: str
    faces: list[tuple[Members, str]]


class Scope:
    """What a part, an assembly, or a deck without parts has, by numbers and names in capitals."""

    def __init__(self) -> None:
        self.nodes: dict[int, list[float]] = {}
        self.kinds: list[str] = []  # of the blocks, one for each *ELEMENT
        self.blocks: list[list[list[int]]] = []
        self.elements: dict[int, tuple[int, int]] = {}  # number -> block, and place in it
        self.sets: dict[str, dict[str, Named]] = {"NSET": {}, "ELSET": {}}
        self.surfaces: dict[str, Surface] = {}


def cards(lines: Iterable[str]) -> Iterator[Card]:
    """The keywords of a deck that are not inside of a step.

    >>> list(cards(["** a comment", "*Nset, nset=pad,", "GENERATE", "1, 9,", "*STEP", "*NODE", "*END STEP"]))
    [Card(word='NSET', parameters={'NSET': 'pad', 'GENERATE': ''}, lines=['1, 9,'])]
    """
    head, data, inside = "", list[str](), False
    for line in chain(_meaning(lines), "*"):
        if head.endswith(",") and line[0].isalpha() and not data:
            head += line
        elif not line.startswith("*"):
            data.append(line)
        else:
            card = _card(head, data)
            inside = inside or card.word == "STEP"
            if head and not inside:
                yield card
            inside = inside and card.word != "ENDSTEP"
            head, data = line, []


def _meaning(lines: Iterable[str]) -> Iterator[str]:
    """Lines without comments and empty ones."""
    for line in lines:
        stripped = line.strip()
        if stripped and not stripped.startswith("**"):
            yield stripped


def _card(head: str, data: list[str]) -> Card:
    word, *rest = head.removeprefix("*").split(",")
    pairs = (one.partition("=") for one in rest if one.strip())
    parameters = {key.strip().upper(): value.strip().strip('"') for key, _, value in pairs}
    return Card("".join(word.split()).upper(), parameters, data)


class Deck:
    """The scopes of a deck, filled card by card."""

    def __init__(self) -> None:
        self.scopes: dict[str, Scope] = {}
        self.scope = ""
        self.instances: dict[str, tuple[str, str]] = {}  # name in capitals -> as it is spelt, its part
        self.places: dict[str, list[list[float]]] = {}
        self.system: list[list[float]] = []
        self.cards: set[str] = set()  # names of sets of elements that have a card of their own
        self.in_surfaces: set[str] = set()  # names of sets that surfaces are made of

    def take(self, card: Card) -> None:
        """Read one card, or pass it over."""
        if card.word in REFUSED:
            raise ValueError(f"*{card.word}, which is not read: {REFUSED[card.word]}")
        reads = {
            "PART": self._part, "ENDPART": self._end, "ASSEMBLY": self._assembly, "ENDASSEMBLY": self._end,
            "INSTANCE": self._instance, "ENDINSTANCE": self._assembly, "SYSTEM": self._system,
            "NODE": self._nodes, "ELEMENT": self._elements, "NSET": self._set, "ELSET": self._set,
            "SURFACE": self._surface,
        }  # fmt: skip
        if card.word in reads:
            if card.get("INPUT") is not None:
                raise ValueError(f"*{card.word}, INPUT=, which is not read: {REFUSED['INCLUDE']}")
            reads[card.word](card)

    @property
    def here(self) -> Scope:
        """The scope that cards fill."""
        return self.scopes.setdefault(self.scope, Scope())

    def _part(self, card: Card) -> None:
        self.scope, self.system = card.named("NAME").upper(), []

    def _assembly(self, card: Card) -> None:
        self.scope, self.system = ASSEMBLY, []

    def _end(self, card: Card) -> None:
        self.scope, self.system = "", []

    def _instance(self, card: Card) -> None:
        if card.get("PART") is None:
            raise ValueError(f"*INSTANCE without PART=, which is not read: {REFUSED['IMPORT']}")
        name, self.scope = card.named("NAME"), card.named("PART").upper()
        self.instances[name.upper()] = name, self.scope
        self.places[name.upper()], self.system = card.numbers(), []

    def _system(self, card: Card) -> None:
        self.system = card.numbers()

    def _nodes(self, card: Card) -> None:
        if (card.get("SYSTEM") or "R").upper() != "R":
            raise ValueError(f"*NODE, SYSTEM={card.get('SYSTEM')}, which is not read: give x, y and z")
        rows = [[*row, 0.0, 0.0, 0.0][:4] for row in card.numbers()]
        points = from_axes(np.array(rows).reshape(-1, 4)[:, 1:], self.system)
        numbers = [int(row[0]) for row in rows]
        self.here.nodes.update(zip(numbers, points.tolist(), strict=True))
        self._keep("NSET", card.get("NSET"), [(self.scope, numbers)])

    def _elements(self, card: Card) -> None:
        kind = kind_of(card.named("TYPE").upper())
        width, numbers = 1 + nodes_of(kind), [one for row in card.whole() for one in row]
        if len(numbers) % width:
            raise ValueError(f"*ELEMENT, TYPE={card.get('TYPE')} with {len(numbers)} numbers: {width} a line")
        rows = [numbers[k : k + width] for k in range(0, len(numbers), width)]
        here, block = self.here, len(self.here.blocks)
        for place, (number, *_) in enumerate(rows):
            if number in here.elements:
                raise ValueError(f"two elements {number}: number them apart")
            here.elements[number] = block, place
        here.kinds.append(kind)
        here.blocks.append([row[1:] for row in rows])
        self._keep("ELSET", card.get("ELSET"), [(self.scope, [row[0] for row in rows])])

    def _keep(self, what: str, name: str | None, members: list[Members], internal: bool = False) -> None:
        """Add to a set, which is made where there is none, what it does not have of other sets already."""
        if name:
            kept = self.here.sets[what].setdefault(name.upper(), Named(name, [], internal)).members
            known = {id(numbers) for _, numbers in kept}
            kept += {id(one[1]): one for one in members if id(one[1]) not in known}.values()

    def _set(self, card: Card) -> None:
        name, where = card.named(card.word), self._scope_of(card.get("INSTANCE"))
        members: list[Members] = []
        if card.get("GENERATE") is not None:
            for row in filter(None, card.whole()):
                first, last, step = (row + [row[0], 1][len(row) - 1 :])[:3]
                members.append((where, range(first, last + 1, step or 1)))
        else:
            for words in card.rows():
                members += self._row(card.word, words, where)
        if card.word == "NSET" and (elements := card.get("ELSET")):
            members += self._nodes_of(self._members("ELSET", elements, where))
        if card.word == "ELSET":
            self.cards.add(name.upper())
        self._keep(card.word, name, members, card.get("INTERNAL") is not None)

    def _scope_of(self, instance: str | None) -> str:
        """The scope of an instance's numbers."""
        if instance is None:
            return self.scope
        if instance.upper() not in self.instances:
            raise ValueError(f"a set of the instance {instance}, which no *INSTANCE before it is")
        return self.instances[instance.upper()][1]

    def _row(self, what: str, row: list[str], where: str) -> list[Members]:
        """The members that a line of numbers and names has."""
        if all(word.isdigit() or not word for word in row):
            return [(where, [int(word) for word in row if word])]
        return [one for word in row if word for one in self._members(what, word, where)]

    def _members(self, what: str, word: str, where: str) -> list[Members]:
        """Those of a number or name, which may be an instance's: 7, pad, F1.7 or F1.pad."""
        instance, dot, rest = word.partition(".")
        if dot and instance.upper() in self.instances:
            return self._members(what, rest, self.instances[instance.upper()][1])
        if word.isdigit():
            return [(where, [int(word)])]
        for scope in dict.fromkeys((where, self.scope)):
            if found := self.scopes.get(scope, Scope()).sets[what].get(word.strip('"').upper()):
                return list(found.members)
        raise ValueError(f"a set of {word}, which no *{what} before it is")

    def _nodes_of(self, members: list[Members]) -> list[Members]:
        """The nodes of elements."""
        found: list[Members] = []
        for where, numbers in members:
            scope = self.scopes.get(where, Scope())
            at = [scope.elements[one] for one in existing(numbers, scope.elements, "element")]
            found += [(where, scope.blocks[block][place]) for block, place in at]
        return found

    def _surface(self, card: Card) -> None:
        kind = (card.get("TYPE") or "ELEMENT").upper()
        if kind not in ("ELEMENT", "NODE") or card.get("COMBINE") is not None:
            return
        name, what = card.named("NAME"), "ELSET" if kind == "ELEMENT" else "NSET"
        faces = self.here.surfaces.setdefault(name.upper(), Surface(name, what, [])).faces
        for word, *face in card.rows():
            if word:
                self.in_surfaces.add(word.rpartition(".")[2].upper())
                members = self._members(what, word, self.scope)
                faces += [(one, (face or [""])[0].upper()) for one in members]


def existing(numbers: list[int] | range, table: Mapping[int, Any], what: str) -> list[int]:
    """The numbers that a table has: all of a list, those of a range that are there.

    >>> existing(range(1, 10**12), {3: 0.0, -1: 0.0}, "node")
    [3]
    """
    if isinstance(numbers, range):
        few = len(numbers[: len(table) + 1]) <= len(table)
        return [one for one in numbers if one in table] if few else [one for one in table if one in numbers]
    if lost := [one for one in numbers if one not in table]:
        raise ValueError(f"{what} {lost[0]}, which is used and not defined")
    return numbers


def kind_of(name: str) -> str:
    """meshio's name of a type of element.

    >>> kind_of("CPE4RH"), kind_of("S8R5"), kind_of("C3D27"), kind_of("STRI65")
    ('quad', 'quad8', 'hexahedron27', 'triangle6')
    """
    found = _TYPE.fullmatch(name)
    if found and (kind := FAMILIES[found[1]].get(int(found[2]))):
        return kind
    what = "are axisymmetric" if name.startswith("CAX") else "the reader does not know"
    raise ValueError(f"elements {name}, which {what}: export plane or solid ones alone")


def nodes_of(kind: str) -> int:
    """The number of nodes of a kind, with which its name ends unless it is linear."""
    linear = {"line": 2, "triangle": 3, "quad": 4, "tetra": 4, "pyramid": 5, "wedge": 6, "hexahedron": 8}
    return linear[kind] if kind in linear else int(kind.lstrip("abcdefghijklmnopqrstuvwxyz"))


def from_axes(points: Floats, system: list[list[float]]) -> Floats:
    """Global coordinates (N, 3) of points in the axes of *SYSTEM: its origin, a point on x, one in the plane
    of x and y. Without the last, z remains and x is taken in the plane.
    """
    if not system:
        return points
    if len(system) > 2 or any(len(row) > most for row, most in zip(system, (6, 3), strict=False)):
        raise ValueError("*SYSTEM with other data than two points and, on a second line, a third")
    origin, on_x = np.reshape((system[0] + 6 * [0.0])[:6], (2, 3))
    if len(system[0]) <= 3:
        return points + origin
    x, up = on_x - origin, np.array([0.0, 0.0, 1.0])
    if len(system) > 1:
        up = np.cross(x, (system[1] + 3 * [0.0])[:3] - origin)
    else:
        x = x * [1.0, 1.0, 0.0]
    axes = np.array([x, np.cross(up, x), up])
    length = np.linalg.norm(axes, axis=1, keepdims=True)
    if not length.all():
        raise ValueError("*SYSTEM with points on one line: give three that make a plane")
    return np.asarray(origin + points @ (axes / length))
