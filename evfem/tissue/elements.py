"""The elements by name; a new one is a row here, and a scene takes it by that name.

How an element measures its volume is said in `evfem.tissue.space`, which builds it.
"""

from __future__ import annotations

from collections.abc import Mapping

from evfem.mesh.mesh import CELLS

#: element -> (mesh kind, order of quadrature, how ln J is sampled)
ELEMENTS: Mapping[str, tuple[str, int, str]] = {
    "q1": ("quad", 3, "point"),
    "q1_fbar": ("quad", 3, "centroid"),
    "q2": ("quad9", 5, "point"),
    "q2p1": ("quad9", 5, "linear"),
    "p2": ("triangle6", 4, "point"),
    "hex8": ("hexahedron", 3, "mean"),
    "hex27p1": ("hexahedron27", 5, "linear"),
}


def elements_on(corners: int) -> tuple[str, ...]:
    """Names of the elements on cells with that many corners (3, 4 or 8).

    >>> elements_on(3), elements_on(4), elements_on(8)
    (('p2',), ('q1', 'q1_fbar', 'q2', 'q2p1'), ('hex8', 'hex27p1'))
    """
    return tuple(name for name, (kind, *_) in ELEMENTS.items() if CELLS[kind].corners == corners)


def elements_of_order(order: int) -> tuple[str, ...]:
    """Names of the elements with cells of that order (1 or 2).

    >>> elements_of_order(1)
    ('q1', 'q1_fbar', 'hex8')
    """
    return tuple(name for name, (kind, *_) in ELEMENTS.items() if CELLS[kind].order == order)
