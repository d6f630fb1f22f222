"""How time and memory of a step grow with the nodes: the benchmark's finger on finer and finer meshes.

Four steps of press by 0.1 mm, then four of slide by 0.1 mm at friction 0.3, each size in a process of its
own. The first step, which analyses the matrix, counts as set-up.
"""

import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

import evfem as ev
from evfem.meshes.benchmark import divided_mesh

from ..common import Series, alone, markdown
from ..peers.apart import resident_MB
from ..peers.problem import PLANE, TOLERANCE
from .runs import ROUNDS, warm_up
from .scenes import benchmark_finger

#: cells around, across the tissue and across the skin: 3k, 12k, 47k, 105k and 201k nodes
SIZES = ((120, 20, 4), (240, 40, 8), (480, 80, 16), (720, 120, 24), (1000, 166, 34))
QUICK = ((60, 10, 2), (120, 20, 4))
STEPS = 4
#: cells around up to which a run is repeated
SMALL = 240


@dataclass(frozen=True)
class Size:
    """A mesh: CPU seconds of set-up and of a mean step, iterations of a step, and memory in MB."""

    nodes: int
    setup_s: float
    press_s: float
    slide_s: float
    press_iterations: float
    slide_iterations: float
    imported_MB: float
    peak_MB: float


class Clock:
    """An observer that notes the CPU seconds at the start and after every step."""

    def __init__(self) -> None:
        self.at: list[float] = []

    def step(self, *_: Any) -> None:
        """A step has converged, or the parts are built."""
        self.at.append(time.process_time())

    started = step


def measure_alone(divisions: tuple[int, int, int]) -> Size:
    """One size in a process that has done nothing else."""
    warm_up()
    return _measured(divisions, ROUNDS if divisions[0] <= SMALL else 1)


def _measured(divisions: tuple[int, int, int], rounds: int) -> Size:
    """One size, run so many times; the least of every step counts."""
    from evfem.simulation.run import simulate

    imported, costs = resident_MB(), []
    for _ in range(rounds):
        clock, begin = Clock(), time.process_time()
        result = simulate(scene(divisions), observers=[clock])
        costs.append(np.diff([begin, *clock.at]))
    cost, iterations = np.min(costs, axis=0), result.newton_iterations
    return Size(
        nodes=len(result.mesh.points),
        setup_s=float(cost[:2].sum()),
        press_s=float(cost[2 : STEPS + 1].mean()),
        slide_s=float(cost[STEPS + 1 :].mean()),
        press_iterations=float(iterations[1:STEPS].mean()),
        slide_iterations=float(iterations[STEPS:].mean()),
        imported_MB=imported,
        peak_MB=resident_MB(),
    )


def scene(divisions: tuple[int, int, int]) -> ev.Scene:
    """Press and slide on a mesh with so many cells."""
    finger = benchmark_finger(divided_mesh(divisions, 2, same_nodes=True))
    motion = [ev.Press(indentation=0.1 * STEPS, steps=STEPS), ev.Slide(distance=0.1 * STEPS, steps=STEPS)]
    how: dict[str, Any] = {"solver": ev.Solver(tolerance=TOLERANCE), "output": ev.Output(every=1000)}
    return ev.Scene(finger, ev.Flat(friction=0.3, y=PLANE), motion=motion, **how)


def measured(quick: bool) -> list[Size]:
    """All sizes, each in its own process; the quick ones in this one, whose memory says little."""
    if quick:
        return [_measured(one, 1) for one in QUICK]
    return [alone(measure_alone, one) for one in SIZES]


def numbers(sizes: list[Size]) -> dict[str, float]:
    """Costs by nodes, exponents between the smallest and the largest mesh, memory at 100k nodes."""
    found: dict[str, float] = {}
    nodes = np.array([one.nodes for one in sizes], dtype=float)
    for one in sizes:
        found |= {f"growth.{one.nodes}.{k}": float(v) for k, v in asdict(one).items() if k != "nodes"}
    for name in ("setup_s", "press_s", "slide_s"):
        cost = np.array([getattr(one, name) for one in sizes])
        found[f"growth.exponent.{name}"] = exponent(nodes, cost)
        found[f"growth.exponent_of_the_finest_two.{name}"] = exponent(nodes[-2:], cost[-2:])
    memory = np.array([max(one.peak_MB - one.imported_MB, 1.0) for one in sizes])
    found["growth.exponent.memory"] = exponent(nodes, memory)
    if nodes[0] <= 1e5 <= nodes[-1]:
        peak = np.interp(np.log(1e5), np.log(nodes), np.log([one.peak_MB for one in sizes]))
        found["growth.peak_MB_at_100k_nodes"] = float(np.exp(peak))
    return found


def series(sizes: list[Size]) -> list[Series]:
    """Costs over the nodes."""
    units = {"setup_s": "s", "press_s": "s", "slide_s": "s", "peak_MB": "MB"}
    nodes = [one.nodes for one in sizes]
    return [Series(f"growth {k}", nodes, [getattr(one, k) for one in sizes], u) for k, u in units.items()]


def exponent(nodes: Any, cost: Any) -> float:
    """Slope of the straight line through the logarithms."""
    return float(np.polyfit(np.log(nodes), np.log(cost), 1)[0])


def table(found: Mapping[str, float], sizes: list[Size]) -> list[str]:
    """The sizes as lines of a Markdown table, with the exponents below."""
    rows = []
    for one in sizes:
        press = f"{one.press_s:.3g} ({one.press_iterations:.1f})"
        slide = f"{one.slide_s:.3g} ({one.slide_iterations:.1f})"
        rows.append([f"{one.nodes:,}", f"{one.setup_s:.3g}", press, slide, f"{one.peak_MB:.0f}"])
    powers = [found[f"growth.exponent.{name}"] for name in ("setup_s", "press_s", "slide_s", "memory")]
    head = ("nodes", "set-up with first step: CPU s", "press step: CPU s (iterations)", "slide step")
    return markdown((*head, "peak MB"), [*rows, ["exponent", *(f"{power:.2f}" for power in powers)]])
