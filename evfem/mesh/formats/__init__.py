"""Formats of mesh files that meshio reads in part: each module has `read(path)`, which gives a `meshio.Mesh`.

Where a format has names, the mesh has an attribute `groups` (`evfem.mesh.groups.Group`), and its sets of
nodes in `point_sets`. Raised is anything, which `evfem.mesh.file.parts` turns into one sentence.
"""
