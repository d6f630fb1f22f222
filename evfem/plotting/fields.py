"""Fields of a frame as they are coloured: values, smooth colours, scales.

A field of cells becomes smooth by nodal averages, weighted by the area of the cells; on a border
between regions each region keeps its own average, for stress jumps there. Colours between nodes
are linear in triangles.

A field of the pad colours the outline, tractions are arrows as well. A node has its colour on its half of
the edges beside it, as it has its fraction of their length in the model. Arrows are the tractions on the
finger: contact pressure pushes along the normal of the surface, shear along its tangent, attraction pulls
down. Pressure and shear stand in the surface, attraction begins at the outline.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.errors import EvfemError, InputError, describe_value
from evfem.mesh.mesh import Mesh
from evfem.mesh.split import split
from evfem.plotting.figures import BOTH_SIGNS, EDGE, ONE_SIGN, STATUS, TISSUE
from evfem.simulation.result import POINT_FIELDS, Frame, Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Height = Callable[[Floats], Floats]


def height_of(result: Result, frame: Frame) -> Height:
    """Height (mm) of the surface at x (mm): the scene's, sunk as the pad's nodes say, or by their gaps."""
    known, position = _from_scene(result), result.mesh.points + frame.displacement
    pad = np.flatnonzero(np.isfinite(frame.gap))
    pad = pad[np.argsort(position[pad, 0])]
    x, y, gap, sink = position[pad, 0], position[pad, 1], frame.gap[pad], frame.surface_sink[pad]
    if known is None:
        return lambda at: np.interp(at, x, y - gap)
    return known if not sink.any() else lambda at: known(at) - np.interp(at, x, sink)


def _from_scene(result: Result) -> Height | None:
    from evfem.simulation.model import placed

    with suppress(EvfemError):
        surface = result.scene.ground
        surface, _ = placed(surface, result.mesh.points[result.mesh.node_sets["pad"]])
        return lambda x: surface.y + surface.height(x)
    return None


STRESSES = tuple(f"cauchy_stress_{c}" for c in ("xx", "yy", "zz", "xy"))
CELL_FIELDS = ("von_mises", *STRESSES, "J")
FIELDS = (*CELL_FIELDS, "displacement", *POINT_FIELDS)
#: fields whose colours begin at 0; fields with a sign, and the value in their middle, which is white
FROM_ZERO = ("von_mises", "gap", "contact_pressure", "electrostatic_traction")
MIDDLES = {**dict.fromkeys(STRESSES, 0.0), "J": 1.0, "shear_traction": 0.0, "surface_sink": 0.0}
Window = tuple[float, float, float, float]
#: most arrows across a picture, and the longest one as a fraction of the surface's least depth in it
MOST_ARROWS, LONGEST = 36, 0.8
#: width of an arrow's shaft, inches: heads are seen in panels of any size
SHAFT = 0.011
TRACTIONS = ("contact_pressure", "shear_traction", "electrostatic_traction")


def values_of(frame: Frame, field: str) -> Floats:
    """Values of one of `FIELDS` in the cells (E,) or at the nodes (N,)."""
    if field in STRESSES:
        return frame.cauchy_stress[:, STRESSES.index(field)]
    if field == "displacement":
        return np.hypot.reduce(frame.displacement, axis=1)
    return getattr(frame, field)


def frame_of(result: Result, number: int) -> Frame:
    """A frame by its number among those kept, from the end if negative; InputError for another."""
    if not -len(result.frames) <= number < len(result.frames):
        allowed = f"the number of one of the {len(result.frames)} frames kept"
        raise InputError("frame", describe_value(number), allowed)
    return result.frames[number]


def rounds(mesh: Mesh) -> Ints:
    """Nodes of each cell once around (E, corners or twice as many), middle nodes between their corners."""
    m = mesh.corners
    if mesh.order == 1:
        return mesh.cells
    return mesh.cells[:, np.column_stack([np.arange(m), m + np.arange(m)]).ravel()]


def areas(outlines: Floats) -> Floats:
    """Areas (E,) of polygons (E, n, 2), positive if they go round counter-clockwise."""
    x, y = outlines[..., 0], outlines[..., 1]
    return 0.5 * np.sum(x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1), axis=1)


@dataclass(frozen=True, eq=False)
class Patches:
    """Triangles (T, 3) between V vertices, own ones in each region: of a `mesh` whose regions share no node,
    from `nodes` (V,) of the whole one.
    """

    mesh: Mesh
    nodes: Ints
    triangles: Ints


def patches(mesh: Mesh) -> Patches:
    """The cells of a mesh in triangles through all of their nodes.

    >>> import numpy as np
    >>> points = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [2.0, 0.0], [2.0, 1.0]])
    >>> cells = np.array([[0, 1, 2, 3], [1, 4, 5, 2]])
    >>> two = patches(Mesh(points, cells, "quad", np.array([0, 1]), {"soft": 0, "hard": 1}))
    >>> len(two.nodes), len(two.triangles)  # nodes 1 and 2 belong to both regions
    (8, 4)
    """
    apart, nodes = split(mesh)
    if mesh.kind == "quad9":  # a fan around the middle node
        fans = [[8, i, 4 + i] for i in range(4)] + [[8, 4 + i, (i + 1) % 4] for i in range(4)]
    elif mesh.kind == "triangle6":  # three corners and the triangle of middle nodes
        fans = [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]
    else:
        fans = [[0, i, i + 1] for i in range(1, mesh.corners - 1)]
    return Patches(apart, nodes, np.concatenate([apart.cells[:, fan] for fan in fans]))


@dataclass(frozen=True)
class Scale:
    """Colours of a field: map, lowest and highest value, and at which ends values lie beyond."""

    cmap: str
    low: float
    high: float
    extend: str = "neither"

    def colour_map(self) -> Any:
        """The map of matplotlib."""
        import matplotlib
        from matplotlib.colors import ListedColormap

        if self.cmap == "status":
            return ListedColormap(list(STATUS.values()))
        return matplotlib.colormaps[self.cmap]

    def apply(self, mapped: Any) -> None:
        """Give an artist with values these colours."""
        mapped.set_cmap(self.colour_map())
        mapped.set_clim(self.low, self.high)


def scale_of(field: str, values: Floats, vmin: float | None = None, vmax: float | None = None) -> Scale:
    """The scale of a field for the values that are shown, from their smallest to their largest.

    A given end replaces one of these. A field with a sign has as much of its colours on either
    side of its middle, unless both ends are given. Raises InputError unless vmin is below vmax.

    >>> scale_of("von_mises", np.array([0.1, 0.4]), vmin=0.0)
    Scale(cmap='viridis', low=0.0, high=0.4, extend='neither')
    >>> scale_of("cauchy_stress_yy", np.array([-0.4, 0.1])).high
    0.4
    """
    if field == "contact_status":
        return Scale("status", -0.5, len(STATUS) - 0.5)
    if vmin is not None and vmax is not None and not vmin < vmax:
        raise InputError("vmin", describe_value(vmin), f"a value below vmax, which is {vmax:g}")
    least, most = (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
    least = min(least, 0.0) if field in FROM_ZERO else least
    middle = MIDDLES.get(field)
    low, high = least, most
    if middle is not None:
        limit = vmin if vmax is None else vmax
        reach = max(most - middle, middle - least) or 1.0 if limit is None else abs(limit - middle)
        low, high = middle - reach, middle + reach
    low, high = (low if vmin is None else vmin), (high if vmax is None else vmax)
    if not low < high:  # one value throughout, or all beyond a given end
        low, high = (high - 1.0, high) if vmin is None and vmax is not None else (low, low + 1.0)
    slack = 1e-9 * (high - low)
    ends = (least < low - slack, most > high + slack)
    extend = {(True, True): "both", (True, False): "min", (False, True): "max"}.get(ends, "neither")
    return Scale(ONE_SIGN if middle is None else BOTH_SIGNS, low, high, extend)


def within(position: Floats, window: Window) -> Any:
    """Points (N, 2) in the window, (N,) bool."""
    left, right, bottom, top = window
    x, y = position.T
    return (x >= left) & (x <= right) & (y >= bottom) & (y <= top)


def draw_outline(ax: Axes, mesh: Mesh, frame: Frame, field: str, scale: Scale) -> Any:
    """The tissue in one pale colour and the pad's outline in the colours of the field (a LineCollection)."""
    from matplotlib.collections import LineCollection, PolyCollection

    points = mesh.points + frame.displacement
    ax.add_collection(PolyCollection(list(points[rounds(mesh)]), facecolors=TISSUE, edgecolors=TISSUE))
    nodes, halves = half_edges(mesh, points)
    values = values_of(frame, field)[nodes]
    if field in TRACTIONS:  # where there is none, the outline is a line and no colour
        halves, values = halves[values != 0.0], values[values != 0.0]
    lines = LineCollection(list(halves), array=values, linewidths=3.5, zorder=3)
    scale.apply(lines)
    lines.set_capstyle("round")
    return ax.add_collection(lines)


def half_edges(mesh: Mesh, points: Floats) -> tuple[Ints, Floats]:
    """The pad's edges in halves (H, 2, 2), and the node that each belongs to (H,)."""
    edges = mesh.sides_of("pad")
    pairs = edges[:, :2] if edges.shape[1] == 2 else np.concatenate([edges[:, [0, 2]], edges[:, [2, 1]]])
    start, end = points[pairs[:, 0]], points[pairs[:, 1]]
    middle = 0.5 * (start + end)
    halves = np.concatenate([np.stack([start, middle], axis=1), np.stack([middle, end], axis=1)])
    return np.concatenate([pairs[:, 0], pairs[:, 1]]), halves


def reach_of(height: Height, window: Window) -> float:
    """Length of the longest arrow that has room in a window, as a fraction of the window's width."""
    left, right, bottom, top = window
    room = float(height(np.linspace(left, right, 500)).min()) - bottom
    return LONGEST * max(room, 0.05 * (top - bottom)) / (right - left)


def draw_arrows(
    ax: Axes, mesh: Mesh, frame: Frame, field: str, height: Height, window: Window, scale: Scale, reach: float
) -> Any:
    """Tractions on the finger as arrows (a Quiver), of neighbouring nodes that of the largest traction.

    `reach`, a fraction of the window's width, is the length of the largest traction of the scale, and of what
    lies beyond: panels with one scale and reach have one scale of arrows.
    """
    values, position = values_of(frame, field), mesh.points + frame.displacement
    nodes = _thinned(position, np.where(within(position, window), np.abs(values), 0.0), window)
    if not nodes.size:
        return None
    x, size = position[nodes, 0], np.clip(values[nodes] / max(abs(scale.low), abs(scale.high)), -1.0, 1.0)
    at, width = np.column_stack([x, height(x)]), window[1] - window[0]
    longest = reach * width
    normal = _normals(height, x, 1e-4 * width)
    if field == "contact_pressure":
        arrows, pivot = size[:, None] * normal * longest, "tip"
    elif field == "shear_traction":
        along = np.column_stack([normal[:, 1], -normal[:, 0]])
        arrows, pivot = size[:, None] * along * 1.5 * width / MOST_ARROWS, "middle"
        at = at - 0.4 * longest * normal
    else:
        arrows, pivot, at = size[:, None] * np.array([0.0, -longest]), "tail", position[nodes]
    look: dict[str, Any] = {"units": "inches", "width": SHAFT, "headwidth": 4.5, "headlength": 5.0}
    quiver = ax.quiver(*at.T, *arrows.T, angles="xy", scale_units="xy", scale=1.0, pivot=pivot, **look)
    quiver.set(color=EDGE, zorder=4)
    return quiver


def _thinned(position: Floats, size: Floats, window: Window) -> Ints:
    """The node with the largest size of each of so many strips of the window, none where it is 0."""
    strip = np.floor((position[:, 0] - window[0]) / (window[1] - window[0]) * MOST_ARROWS)
    order = np.lexsort([-size, strip])
    order = order[size[order] > 0.0]
    _, first = np.unique(strip[order], return_index=True)
    return order[first]


def _normals(height: Height, x: Floats, step: float) -> Floats:
    """Unit normals (n, 2) of the surface, towards the finger."""
    slope = (height(x + step) - height(x - step)) / (2.0 * step)
    return np.column_stack([-slope, np.ones_like(slope)]) / np.sqrt(1.0 + slope**2)[:, None]
