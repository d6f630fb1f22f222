"""Texts of scene files: a coarse smooth pad above a flat display, its keys of `[electrostatics]` and its
motions.
"""

HOVER = '[[motion]]\nkind = "hover"\ngap = 0.5\n'
WAIT = '[[motion]]\nkind = "wait"\nduration = 0.1\nsteps = 200\n'
PRESS = '[[motion]]\nkind = "press"\nforce = 0.05\n'


def head(electrostatics):
    """The beginning of a scene with these keys of `[electrostatics]`."""
    finger = '[finger]\nridges = false\nresolution = "coarse"\n'
    return f'version = 1\n{finger}[surface]\nkind = "flat"\n[electrostatics]\n{electrostatics}\n'
