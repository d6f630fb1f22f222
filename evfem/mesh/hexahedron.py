"""The hexahedron in VTK's order: 8 corners, 12 middles of edges, 6 of faces, and the centre.

    3--------2        y
   /|       /|        |
  7--------6 |        o-- x
  | 0------|-1       /
  |/       |/       z
  4--------5

The faces' middles come in the order -x, +x, -y, +y, -z, +z, as VTK's programs have them.
"""

from __future__ import annotations

import numpy as np

from evfem.common.arrays import Ints

#: ends of the edges, in the order of their middles
EDGES: Ints = np.array(
    [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
)
#: corners of the faces, in the order of their middles, counter-clockwise seen from outside
FACES: Ints = np.array([(0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (2, 3, 7, 6), (0, 3, 2, 1), (4, 5, 6, 7)])
_CORNERS = np.array(
    [(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)]
)
#: places (27, 3) of the nodes in -1..1
PLACES: Ints = np.vstack(
    [
        _CORNERS,
        _CORNERS[EDGES].sum(axis=1) // 2,
        _CORNERS[FACES].sum(axis=1) // 4,
        np.zeros((1, 3), dtype=int),
    ]
)
#: nodes of the mirror image that make it a proper cell again (x and z exchanged)
MIRRORED: Ints = np.array([np.flatnonzero((PLACES[:, ::-1] == place).all(axis=1))[0] for place in PLACES])


def face_nodes(order: int) -> Ints:
    """Local nodes (6, 4 or 9) of the faces: corners[, middles of their edges, middle], as a quad or
    quad9 that is seen from outside.

    >>> face_nodes(2)[2].tolist()
    [0, 1, 5, 4, 8, 17, 12, 16, 22]
    """
    if order == 1:
        return FACES
    ends = np.sort(np.stack([FACES, np.roll(FACES, -1, axis=1)], axis=2), axis=2)
    same = (ends[:, :, None] == np.sort(EDGES, axis=1)).all(axis=3)
    return np.hstack([FACES, 8 + same.argmax(axis=2), 20 + np.arange(6)[:, None]])
