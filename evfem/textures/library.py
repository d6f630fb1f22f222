"""Twenty synthetic reference textures, generated from the parameters in `REFERENCES` (licence: CC0-1.0).

Their names suggest wavelength and roughness; none is measured. `find` takes the name of one of them or the
path of a texture of your own.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from evfem.errors import InputError, describe_value, unknown
from evfem.textures.generate import FREE, Knobs, make
from evfem.textures.texture import Texture, read

#: name -> description, generator, and its parameters
REFERENCES: dict[str, tuple[str, str, Knobs]] = {
    "grating-1mm": ("a fine grating", "grating", Knobs(1.0, 0.01)),
    "grating-2mm": ("a grating", "grating", Knobs(0.5, 0.02)),
    "grating-4mm": ("a coarse grating", "grating", Knobs(0.25, 0.04)),
    "grating-worn": ("a grating with uneven grooves", "grating", Knobs(0.5, 0.02, 0.5, seed=1)),
    "wave-1mm": ("a fine sine", "sinusoids", Knobs(1.0, 0.01)),
    "wave-2mm": ("a sine", "sinusoids", Knobs(0.5, 0.03)),
    "wave-4mm": ("a long sine", "sinusoids", Knobs(0.25, 0.06)),
    "saw-2mm": ("an asymmetric, saw-like wave", "sinusoids", Knobs(0.5, 0.025, second=0.35)),
    "hump-2mm": ("a wave with narrow crests", "sinusoids", Knobs(0.5, 0.025, second=0.3, phase=-1.5708)),
    "eq-25": ("the paper's texture (25)", "sinusoids", Knobs(0.954930, 0.025, second=1.0, phase=1.5708)),
    "weave": ("like a woven cloth", "sinusoids", Knobs(0.8, 0.02, 0.1, 0.3, seed=2)),
    "knit": ("like a knitted cloth", "sinusoids", Knobs(0.4, 0.04, 0.15, 0.2, seed=3)),
    "leather": ("like grained leather", "sinusoids", Knobs(0.6, 0.03, 0.6, seed=4)),
    "wood": ("like planed wood across its fibres", "spectral", Knobs(0.3, 0.02, 0.35, seed=5)),
    "paper": ("like drawing paper", "spectral", Knobs(1.0, 0.004, 0.6, seed=6)),
    "plaster": ("like fine plaster", "self_affine", Knobs(0.3, 0.02, 0.3, seed=7)),
    "stone": ("like sawn stone", "self_affine", Knobs(0.5, 0.015, 0.2, seed=8)),
    "cork": ("like cork", "self_affine", Knobs(0.25, 0.03, 0.5, seed=9)),
}
#: name -> description, x (mm) of its rows, friction at each, and the period (mm)
FRICTIONS: dict[str, tuple[str, tuple[float, ...], tuple[float, ...], float]] = {
    "friction-steps": ("stripes of two frictions", (0.0, 1.95, 2.05, 3.95), (0.3, 0.3, 0.5, 0.5), 4.0),
    "friction-ramps": ("friction that rises and falls", (0.0, 2.0), (0.3, 0.6), 4.0),
}


def names() -> list[str]:
    """The names of the twenty reference textures."""
    return [*REFERENCES, *FRICTIONS]


def about(name: str) -> str:
    """Description of a reference texture."""
    return (REFERENCES.get(name) or FRICTIONS[name])[0]


def reference(name: Any) -> Texture:
    """The reference texture of this name.

    >>> reference("wave-2mm")
    Texture('wave-2mm', sinusoids, 256 heights, period 16 mm, 0.06 mm from lowest to highest)
    """
    if not isinstance(name, str) or name not in names():
        raise unknown(
            "texture", str(name), [*names(), "a .json or folder, a recording"], str(describe_value(name))
        )
    if name in REFERENCES:
        _, kind, knobs = REFERENCES[name]
        return make(kind, knobs, name)
    what, x, friction, period = FRICTIONS[name]
    notes = (f"Made by evfem: {what}.",)
    return Texture(name, "table", np.array(x), np.array(friction), FREE, "friction", period, notes)


def find(name: str | Path) -> Texture:
    """The reference texture of this name, or the texture at this path."""
    path = Path(name)
    if str(name) not in names() and (path.suffix == ".json" or path.is_dir()):
        return read(path)
    if path.is_file() and str(name) not in names():
        allowed = "`evfem texture import` makes a texture of it; or a recording, with --speed"
        raise InputError("texture", path.name, allowed)
    return reference(str(name))
