"""The compiled loops of hexahedra: refusals; what they compute is compared in `test_solid`."""

import numpy as np
import pytest
from tools.solids import box

from evfem.tissue.laws import NeoHookean
from evfem.tissue.weakform import Tissue


def test_loops_of_hexahedra_refuse_what_would_read_beyond_an_array():
    space = box("hex8", (2, 1, 1))
    tissue = Tissue(space, {"lower": NeoHookean(E=1.0, nu=0.4)})
    cells, out = space.cells, np.zeros((space.size, 3))
    for wrong in (out[:-1], out.astype("f4"), out[:, :2].copy()):
        with pytest.raises(ValueError, match="expected"):
            tissue.loops.forces(cells, wrong, *tissue._moduli, out)
    with pytest.raises(ValueError, match="kind"):
        tissue.loops.forces(cells._replace(sizes=(space.size, 1, 20, 8, 0, 1)), out, *tissue._moduli, out)
