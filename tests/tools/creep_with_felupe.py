"""Creep of a block with one Maxwell branch by FElupe (`pip install felupe`), for `tissue/test_branches.py`.

FElupe's branch is of small strain, its step exact for strain that grows evenly. Steps are equal and the block
is linear, so the forces after the bone has moved within the first step give the displacements under a
constant load. Run in `tests`: `python -m tools.creep_with_felupe`.
"""

import felupe as fem
import numpy as np

from tools.meshes import block

E, NU, SHARE, TAU, STEP, STEPS = 0.034, 0.4, 1.5, 0.05, 0.01, 20


def forces():
    """Forces (STEPS,) on the bone in N/mm per mm, the pad held."""
    mesh = block(6, 4, 4.0, 2.0)
    quads = fem.Mesh(mesh.points, mesh.cells, "quad")
    field = fem.FieldContainer([fem.FieldPlaneStrain(fem.RegionQuad(quads), dim=2)])
    mu, lmbda = 0.5 * E / (1.0 + NU), E * NU / (1.0 + NU) / (1.0 - 2.0 * NU)
    law = fem.linear_elastic_viscoelastic
    how = {"λ": lmbda, "μ": mu, "G": [SHARE * mu], "τ": [TAU], "Δt": STEP}
    body = fem.SolidBody(fem.MaterialStrain(law, statevars=[(1, 3, 3)], **how), field)

    def held(nodes, axis, value=0.0):
        mask = np.zeros(mesh.points.shape, dtype=bool)
        mask[mesh.node_sets[nodes], axis] = True
        return fem.Boundary(field[0], mask=mask, value=value)

    ends = [held("pad", 0), held("pad", 1), held("bone", 0), held("bone", 1, -1e-5)]
    bounds = dict(enumerate(ends))
    dof0, dof1 = fem.dof.partition(field, bounds)
    known = fem.dof.apply(field, bounds, dof0)
    found = []
    for _ in range(STEPS):
        result = fem.newtonraphson(
            x0=field, items=[body], dof0=dof0, dof1=dof1, ext0=known, verbose=0, tol=1e-9
        )
        found.append(np.asarray(result.fun).reshape(-1, 2)[mesh.node_sets["bone"], 1].sum() / -1e-5)
    return np.array(found)


def creep(response):
    """Displacements (STEPS,) under a constant load, over the first one."""
    moved = np.zeros(STEPS)
    for n in range(STEPS):
        moved[n] = (response[0] - response[n:0:-1] @ moved[:n]) / response[0]
    return np.cumsum(moved)


if __name__ == "__main__":
    response = forces()
    print(f"{response[0]:.9g}", creep(response)[[4, 9, 19]].round(8).tolist())
