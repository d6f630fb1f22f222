"""How many capabilities the heart of the package knows by name.

    python tests/tools/threading_count.py [CHECKOUT] [--list]

1. A *mention* is an identifier, dotted name, keyword, import or short string that matches the pattern of a
   capability; docstrings and comments do not count.
2. A *conditional* is the test of an `if`, conditional expression, `while`, `assert` or filter of a
   comprehension; a boolean `and`/`or` outside those; or an `isinstance` call outside those. It knows a
   capability if its text matches the pattern, or if it asks whether a local name is None (or true) that was
   made from a matching expression.
3. Files of the capability itself (`own`) do not count.
4. In the sums of a folder, equal conditionals of one function count once, and a conditional that knows
   several capabilities counts once.

Counting is by text: renaming a capability means renaming it in `CAPABILITIES`, and numbers are right to
about 5 %. The file is not called `threading`: tools that run as scripts would import it for the module of
that name of the standard library.
"""

from __future__ import annotations

import argparse
import ast
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

CHECKOUT = Path(__file__).parents[2]
#: folders that every run passes through, and those that compute
MAIN_PATH = ("scene", "planning", "simulation", "solver", "newton", "contact", "response")
HEART = ("newton", "solver", "contact", "simulation")
#: the longest string constant that is taken for a name
LONGEST_NAME = 40
#: files of the heart in the second table
WORST = 24

Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Capability:
    """Something optional: the `pattern` of its names, its `own` files, the pattern of its `conditionals`."""

    name: str
    pattern: re.Pattern[str]
    own: tuple[str, ...] = ()
    conditionals: re.Pattern[str] | None = None


def capability(name: str, pattern: str, own: str = "", conditionals: str = "") -> Capability:
    """A capability from text: verbose patterns, files by blanks."""
    tests = re.compile(conditionals, re.VERBOSE) if conditionals else None
    return Capability(name, re.compile(pattern, re.VERBOSE), tuple(own.split()), tests)


CAPABILITIES = (
    capability(
        "charges, drive, leakage",
        r"""charg|Sandwich|leak|lossless|conduct|source_work|field_energy|stretch_work|source_of|resolved
        |permittivit|alternat|harmonic|Drive\b""",
    ),
    capability(
        "core (linear replacement)",
        r"""\bcore\b|cored|\.restored|\brestored\b|withheld|withhold|trapped|with_core|Cored|Softened
        |Closing\.core""",
        own="planning/core",
    ),
    capability("roughness", r"(?<!th)rough|gain_on_pressing|loss_on_opening|separation|limited_gain"),
    capability("adhesion", r"adhes|adher|came_off|\bON\b|self\.let_go|ledger\.let_go|self\.pull\b"),
    capability(
        "elastic surface",
        r"""ElasticFoundation|foundation_of|Yielding|BelowCandidates|tilted|untilted|surface_sink
        |\.elastic\b|\belastic\b|surface_displacement|surface_gradient|foundation\.yields""",
    ),
    capability(
        "full field",
        r"""fringe|FieldAttraction|DrivenField|has_energy|column_law|tangent_factor|fullfield|\bfacing\b
        |chosen_field|beyond_trapezoidal|attraction\.rounding|Harmonic|\.field\b|no_progress""",
        own="planning/fieldchoice",
    ),
    capability("hand", r"\bhand\b|Hand\b|HandControl|NO_HAND|_driven\b|_hand\b"),
    capability(
        "viscosity, inertia, branches",
        r"""dynamics|viscous|viscos|inertia|branch|kinetic|NO_RATES|\brates\b|velocity|\binner\b|\bpast\b
        |\bPast\b|\btimed\b|\bmass\b|restart_if_speed|start_clock
        |scheme""",
        own="planning/timescales",
    ),
    capability(
        "penalty contact",
        r"""penalt|Penalt|interface_compliance|part\.compliance|self\.compliance|interface\.compliance
        |springs""",
    ),
    capability(
        "friction laws beyond Coulomb",
        r"""friction_law|FrictionLaw|Coulomb|Slipping|\.slipping\b|Oscillating|oscillating|cohesion
        |slip_stiffness|secants|by_speed|by_slip|\bage\b|\baged\b|NO_AGE|known\.law|self\.law\b
        |interface\.law""",
    ),
    capability(
        "voltage that follows",
        r"""FollowForce|FollowFriction|missed_force|KeptCharge|GivenGap|ConstrainedVoltage|OpenCircuit|ChargeControl
        |voltage\.(follows|free|find|missed|lacking|missing|held|after|accepts|unknowns|begin|solve)
        |VoltageProblem|VoltageStep|electrode_charge|smallest_gap|\bdriven\b|_kept\b|course\.gap
        |last\.gap""",
    ),
    capability("jumps of friction", r"\bjumps\b|FrictionJumps|\bSteps\b|friction_steps|pinned|left_discont"),
    capability(
        "voltage ramp, path error",
        r"""\braised\b|FIRST_PART|VoltageProfile|TimeSignal|allowed\b|path_error|relative_difference""",
        own="solver/path",
    ),
    capability(
        "third dimension",
        r"""\bdim\b|Skin\b|skin\b|spatial|SPATIAL|interface\.follows|self\.follows|position_z|\.z\b
        |\bWIDTHS\b|\.areas\b|bone\.size|bone_size""",
        own="scene/spatial",
        conditionals=r"""(dim|size|len\(\w+\))\s*(==|!=|<|>)\s*[123]|\.follows\b
        |isinstance\([^)]*(Pad|Skin)\)|position_z|\bz\ is\ None""",
    ),
    capability(
        "nearly incompressible",
        r"""\bpressure\.(active|begin|after|misfit|further_forces|check)|NO_PRESSURE|mixed|Mixed
        |nearly_incompressible|state\.pressure|_with_pressure|of_tangent""",
        own="newton/pressure",
    ),
    capability("sensitivities", r"response|sensitivit|Sensitivit|derivatives?_of|adjoint"),
    capability("forms of the user", r"\bforms\b|given_forces|body\.given|user_forces|make_term|users"),
    capability(
        "linearised loop",
        r"linearised\b(?!\()|LinearBody|linearbody|\.whole\(",
        own="solver/linearbody",
    ),
)


@dataclass(frozen=True)
class Unit:
    """A function with what is in it, or what is left of a module ("<module>"): its texts, read once."""

    file: str
    name: str
    line: int
    words: frozenset[str]
    conditionals: tuple[str, ...]
    #: local names and the texts that they are made of
    made: tuple[tuple[frozenset[str], str], ...]

    @property
    def folder(self) -> str:
        return self.file.split("/")[0]

    @property
    def is_function(self) -> bool:
        return self.name != "<module>"

    def mentions(self, capability: Capability) -> bool:
        return any(map(capability.pattern.search, self.words))

    def knowing(self, capability: Capability) -> list[str]:
        """The conditionals that know a capability."""
        if capability.conditionals:
            return [text for text in self.conditionals if capability.conditionals.search(text)]
        locals_: set[str] = set()
        locals_.update(*(names for names, text in self.made if capability.pattern.search(text)))
        return [t for t in self.conditionals if capability.pattern.search(t) or decided_by(t) & locals_]


def decided_by(text: str) -> set[str]:
    """Names that a conditional asks for None, or the one whose truth it is."""
    return {*re.findall(r"(\w+) is (?:not )?None", text), text, text.removeprefix("not ")}


def below(node: ast.AST, functions: bool) -> Iterator[ast.AST]:
    """A node and all in it, parents first; without `functions`, not what is in a function."""
    waiting = [node]
    while waiting:
        node = waiting.pop()
        yield node
        children = ast.iter_child_nodes(node)
        waiting += [child for child in children if functions or not isinstance(child, Function)]


def outer_functions(node: ast.AST) -> Iterator[Function]:
    """Functions and methods that are in no other function."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, Function):
            yield child
        else:
            yield from outer_functions(child)


def docstrings(tree: ast.Module) -> set[int]:
    """Identities of the nodes that are docstrings."""
    found = set()
    for node in ast.walk(tree):
        documented = isinstance(node, ast.Module | ast.ClassDef | Function)
        if documented and ast.get_docstring(node, clean=False) is not None:
            found.add(id(node.body[0].value))
    return found


def words_of(nodes: Iterable[ast.AST], docs: set[int]) -> Iterator[str]:
    """Names and short strings."""
    for node in nodes:
        match node:
            case ast.Attribute():
                yield ast.unparse(node)
            case ast.Name(id=word) | ast.alias(name=word):
                yield word
            case ast.keyword(arg="frozen", value=ast.Constant()):
                pass  # of a dataclass
            case ast.arg(arg=str(word)) | ast.keyword(arg=str(word)) | ast.ImportFrom(module=str(word)):
                yield word
            case ast.Constant(value=str(word)) if id(node) not in docs and len(word) < LONGEST_NAME:
                yield word
            case ast.FunctionDef(name=word) | ast.ClassDef(name=word):
                yield word


def conditionals_of(nodes: list[ast.AST]) -> Iterator[str]:
    """Texts of what decides (parents first)."""
    inside: set[int] = set()
    for node in nodes:
        tests: list[ast.expr] = []
        if isinstance(node, ast.If | ast.IfExp | ast.While | ast.Assert):
            tests = [node.test]
        elif isinstance(node, ast.comprehension):
            tests = node.ifs
        for test in tests:
            inside.update(map(id, ast.walk(test)))
            yield ast.unparse(test)
    for node in nodes:
        if id(node) in inside:
            continue
        if isinstance(node, ast.BoolOp):
            inside.update(map(id, ast.walk(node)))
            yield ast.unparse(node)
        elif isinstance(node, ast.Call) and getattr(node.func, "id", "") == "isinstance":
            yield ast.unparse(node)


def made_of(nodes: Iterable[ast.AST]) -> Iterator[tuple[frozenset[str], str]]:
    """Names that are given a value, and its text."""
    for node in nodes:
        if isinstance(node, ast.Assign | ast.NamedExpr | ast.AnnAssign) and node.value is not None:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            parts = (part for target in targets for part in ast.walk(target))
            names = frozenset(part.id for part in parts if isinstance(part, ast.Name))
            yield names, ast.unparse(node.value)


def units_of(file: str, source: str) -> Iterator[Unit]:
    """Every outer function of a file, then what is in none."""
    tree = ast.parse(source)
    docs = docstrings(tree)
    parts = [(node.name, node.lineno, below(node, True)) for node in outer_functions(tree)]
    for name, line, found in [*parts, ("<module>", 0, below(tree, False))]:
        nodes = list(found)
        words = frozenset(words_of(nodes, docs))
        yield Unit(file, name, line, words, tuple(conditionals_of(nodes)), tuple(made_of(nodes)))


def read(checkout: Path) -> list[Unit]:
    """All units of the main path."""
    root = checkout / "evfem"
    paths = [path for folder in MAIN_PATH for path in sorted((root / folder).glob("*.py"))]
    return [
        unit
        for path in paths
        for unit in units_of(path.relative_to(root).with_suffix("").as_posix(), path.read_text("utf-8"))
    ]


@dataclass
class Row:
    """Where a capability is known: files, functions that mention it, conditionals (file, function, text)."""

    files: set[str] = field(default_factory=set)
    functions: list[Unit] = field(default_factory=list)
    conditionals: list[tuple[str, str, str]] = field(default_factory=list)

    def add(self, unit: Unit, knowing: list[str]) -> None:
        self.files.add(unit.file)
        self.functions += [unit] * unit.is_function
        self.conditionals += [(unit.file, unit.name, text) for text in knowing]

    def in_heart(self) -> Row:
        return Row(
            {file for file in self.files if of_heart(file)},
            [unit for unit in self.functions if of_heart(unit.file)],
            [one for one in self.conditionals if of_heart(one[0])],
        )

    def numbers(self) -> tuple[int, int, int]:
        return len(self.files), len(self.functions), len(self.conditionals)


def of_heart(file: str) -> bool:
    return file.split("/")[0] in HEART


@dataclass(frozen=True)
class Count:
    """Rows by the capability's name, and the units that they were counted in."""

    units: list[Unit]
    rows: dict[str, Row]

    def heart_files(self, name: str) -> set[str]:
        """Files of the heart that know a capability, without its own and the one that builds the model."""
        return self.rows[name].in_heart().files - {"simulation/model"}

    def conditionals(self, folders: Iterable[str]) -> tuple[int, int]:
        """Different conditionals that know a capability, and all conditionals, of some folders."""
        chosen = set(folders)
        known = {one for row in self.rows.values() for one in row.conditionals}
        every = sum(len(unit.conditionals) for unit in self.units if unit.folder in chosen)
        return sum(file.split("/")[0] in chosen for file, _, _ in known), every

    def functions(self, folders: Iterable[str]) -> tuple[int, int]:
        """Functions that mention a capability, and all functions, of some folders."""
        chosen = set(folders)
        known = {(unit.file, unit.name, unit.line) for row in self.rows.values() for unit in row.functions}
        every = sum(unit.is_function for unit in self.units if unit.folder in chosen)
        return sum(file.split("/")[0] in chosen for file, _, _ in known), every


def count(checkout: Path = CHECKOUT) -> Count:
    """The count of a checkout."""
    units = read(checkout)
    rows = {capability.name: Row() for capability in CAPABILITIES}
    for capability in CAPABILITIES:
        for unit in units:
            if unit.file in capability.own:
                continue
            knowing = unit.knowing(capability)
            if knowing or unit.mentions(capability):
                rows[capability.name].add(unit, knowing)
    return Count(units, rows)


def worst_files(rows: dict[str, Row]) -> list[tuple[str, int, int, int]]:
    """Files of the heart with capabilities, functions times capabilities, and conditionals; worst first."""
    capabilities, functions, conditionals = Counter[str](), Counter[str](), Counter[str]()
    for row in rows.values():
        heart = row.in_heart()
        capabilities.update(sorted(heart.files))
        functions.update(unit.file for unit in heart.functions)
        conditionals.update(file for file, _, _ in heart.conditionals)
    files = sorted(capabilities, key=lambda file: (-conditionals[file] - functions[file], file))
    return [(file, capabilities[file], functions[file], conditionals[file]) for file in files]


def report(found: Count) -> Iterator[str]:
    """The two tables and the sums, as lines."""
    head = "| capability | files | functions | conditionals | of these in the heart: files | functions"
    yield from (f"{head} | conditionals |", "|---" * 7 + "|")
    numbers = {name: (*row.numbers(), *row.in_heart().numbers()) for name, row in found.rows.items()}
    for name, row in numbers.items():
        yield f"| {name} | " + " | ".join(map(str, row)) + " |"
    yield f"sum {[sum(column) for column in zip(*numbers.values(), strict=True)]}\n"
    for folder in HEART:
        (known, every), (mentioning, functions) = found.conditionals([folder]), found.functions([folder])
        yield (
            f"{folder}: {known} of {every} conditionals know an optional capability; "
            f"{mentioning} of {functions} functions mention one"
        )
    (known, every), (mentioning, functions) = found.conditionals(HEART), found.functions(HEART)
    yield f"heart: {known} of {every} conditionals; {mentioning} of {functions} functions\n"
    yield "| file of the heart | capabilities known | function x capability | conditionals |"
    yield "|---" * 4 + "|"
    for file, *row in worst_files(found.rows)[:WORST]:
        yield f"| `{file}` | " + " | ".join(map(str, row)) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("checkout", type=Path, nargs="?", default=CHECKOUT)
    parser.add_argument("--list", action="store_true", help="print the conditionals of the heart too")
    options = parser.parse_args()
    found = count(options.checkout)
    print(*report(found), sep="\n")
    if options.list:
        for name, row in found.rows.items():
            for one in row.in_heart().conditionals:
                print(name, *one, sep="\t")


if __name__ == "__main__":
    main()
