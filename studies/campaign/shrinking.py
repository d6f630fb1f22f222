"""Scenes made smaller as long as they end the same way: motions dropped, steps coarsened, keys
simplified.

Greedy: the first smaller scene that still ends so takes the place of the scene, until none does or
the CPU time is used up.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from .ending import Ending
from .tables import Tables, copied, steps_of

#: CPU seconds for one scene, the least for one attempt, and how many times the scene's own
BUDGET_S, LEAST_S, FACTOR = 40.0, 3.0, 2.0
#: keys without which a table is simpler, in groups that go together first
PLAIN = {
    "electrostatics": (
        ("air_layer", "direction", "gap_eps_r", "coupling"),
        ("insulator_eps_r",),
        ("drive", "frequency", "waveform", "skin", "gap_conductivity"),
    ),
    "solver": (("element", "tolerance"), ("contact", "penalty_normal", "penalty_tangential"), ("dynamics",)),
}
#: what stands in for a key that a table must have
STAND_IN = {"insulator_eps_r": 3.35}

Judge = Callable[[Tables, float], Ending]


def shrunk(tables: Tables, ending: Ending, judge: Judge) -> tuple[Tables, Ending]:
    """The smallest scene found that ends as `tables` did, and its end; `judge(tables, limit_s)`
    says how one ends.
    """
    left, limit_s = BUDGET_S, max(LEAST_S, FACTOR * ending.cpu_s)
    tables = copied(tables)
    smaller = True
    while smaller and left > 0.0:
        smaller = False
        for candidate in reductions(tables, ending):
            found = judge(candidate, limit_s)
            left -= max(found.cpu_s, 0.1)
            if found.same_as(ending):
                tables, ending, smaller = candidate, found, True
                break
            if left <= 0.0:
                break
    return tables, ending


def reductions(tables: Tables, ending: Ending) -> Iterator[Tables]:
    """Smaller scenes, those that save most first; none is equal to the scene."""
    for one in _all(tables, ending):
        if one != tables:
            yield one


def _all(tables: Tables, ending: Ending) -> Iterator[Tables]:
    yield from _shorter(tables, ending)
    yield from _simpler_solver(tables)
    yield from _simpler_surface(tables)
    yield from _simpler_finger(tables)
    yield from _simpler_attraction(tables)
    yield from _coarser(tables)
    yield from _rounder(tables)


def _shorter(tables: Tables, ending: Ending) -> Iterator[Tables]:
    """Without what comes after the end, and without each of the motions before."""
    done, motions = 0, tables["motion"]
    for index, motion in enumerate(motions):
        steps = steps_of(motion)
        if done <= ending.steps < done + steps and index + 1 < len(motions):
            yield tables | {"motion": motions[: index + 1]}
        if motion["kind"] == "slide" and done < ending.steps + 1 < done + steps:
            part = (ending.steps + 1 - done) / steps
            last = motion | {"steps": ending.steps + 1 - done, "distance": motion["distance"] * part}
            yield tables | {"motion": [*motions[:index], last]}
        done += steps
    for index in range(len(motions)):
        if len(motions) > 1:
            yield tables | {"motion": motions[:index] + motions[index + 1 :]}


def _coarser(tables: Tables) -> Iterator[Tables]:
    """Each motion in fewer steps; a slide of half the way in half the steps."""
    for index, motion in enumerate(tables["motion"]):
        steps, others = steps_of(motion), tables["motion"]
        changes: list[Tables] = []
        if steps > 1:
            changes = [{"steps": 1}, {"steps": steps // 2}]
            if motion["kind"] == "slide":
                part = (steps // 2) / steps
                changes.insert(0, {"steps": steps // 2, "distance": motion["distance"] * part})
        for change in changes:
            yield tables | {"motion": [*others[:index], motion | change, *others[index + 1 :]]}
        for key in ("hold", "speed"):
            if key in motion:
                plain = {name: value for name, value in motion.items() if name != key}
                yield tables | {"motion": [*others[:index], plain, *others[index + 1 :]]}


def _without(table: Tables, keys: tuple[str, ...]) -> Tables:
    kept = {name: value for name, value in table.items() if name not in keys}
    return kept | {key: STAND_IN[key] for key in keys if key in STAND_IN}


def _simpler_solver(tables: Tables) -> Iterator[Tables]:
    yield tables | {"solver": {}}
    for keys in PLAIN["solver"]:
        yield tables | {"solver": _without(tables["solver"], keys)}


def _simpler_attraction(tables: Tables) -> Iterator[Tables]:
    if "electrostatics" not in tables:
        return
    without = {name: value for name, value in tables.items() if name != "electrostatics"}
    motions = [motion for motion in tables["motion"] if motion["kind"] != "voltage"]
    if motions:
        yield without | {"motion": motions}
    table = tables["electrostatics"]
    for keys in PLAIN["electrostatics"]:
        yield tables | {"electrostatics": _without(table, keys)}
        for key in keys:
            yield tables | {"electrostatics": _without(table, (key,))}
    rows = table.get("voltage_profile", [])
    if rows:
        most = max((row[1] for row in rows), key=abs)
        yield tables | {"electrostatics": _without(table, ("voltage_profile",)) | {"voltage": most}}


def _simpler_surface(tables: Tables) -> Iterator[Tables]:
    surface = tables["surface"]
    level = {name: value for name, value in surface.items() if name not in ("points", "terms", "y")}
    yield tables | {"surface": level | {"kind": "flat"}}
    yield tables | {"surface": {name: value for name, value in surface.items() if name != "y"}}
    friction = surface["friction"]
    for simpler in [0.0, *_frictions(friction)]:
        yield tables | {"surface": surface | {"friction": simpler}}
    for key in ("terms", "points"):
        rows = surface.get(key, [])
        for start in range(0, len(rows), max(1, len(rows) // 4)):
            left = rows[:start] + rows[start + max(1, len(rows) // 4) :]
            if len(left) >= (1 if key == "terms" else 2):
                yield tables | {"surface": surface | {key: left}}


def _frictions(friction: Any) -> Iterator[Any]:
    """A coefficient instead of a table, or a table with a row less."""
    if not isinstance(friction, list):
        return
    yield from sorted({mu for _, mu in friction})
    for index in range(len(friction)):
        if len(friction) > 1:
            yield friction[:index] + friction[index + 1 :]


def _simpler_finger(tables: Tables) -> Iterator[Tables]:
    finger = tables["finger"]
    plain = {"resolution": "coarse", "ridges": False}
    kept = {"viscosity": finger["viscosity"]} if "viscosity" in finger else {}
    yield tables | {"finger": plain}
    yield tables | {"finger": plain | kept}
    ridges = {name: value for name, value in finger.items() if name.startswith("ridge")}
    yield tables | {"finger": {"resolution": "coarse"} | ridges | kept}
    yield tables | {"finger": _without(finger, tuple(ridges)) | {"ridges": False}}
    for key in ("materials", "electrical", "viscosity"):
        yield tables | {"finger": _without(finger, (key,))}


def _rounder(tables: Tables) -> Iterator[Tables]:
    """All numbers of one table with two digits."""
    for name in ("motion", "electrostatics", "surface", "finger", "solver"):
        if name in tables:
            yield tables | {name: _rounded(tables[name])}


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _rounded(one) for name, one in value.items()}
    if isinstance(value, list):
        return [_rounded(one) for one in value]
    return float(f"{value:.2g}") if isinstance(value, float) else value
