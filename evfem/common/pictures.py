"""Grey values of pictures, with all their bits.

Pillow's own way to grey, `convert("L")`, has 8 bits: it clips what has more, and every number above
255 becomes white.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from evfem.common.arrays import Floats
from evfem.errors import InputError

#: largest file in bytes
MOST_BYTES = 64_000_000
#: tag of TIFF that says whether 0 is white
PHOTOMETRIC = 262


def read_grey(
    path: Path, key: str, allowed: str, most_pixels: int, formats: tuple[str, ...] | None = None
) -> tuple[Floats, str]:
    """Grey values (rows, columns) from 0, black, to 1, white; NaN where a picture is transparent; and a
    sentence about the numbers in the file.

    Integers of 8 and 16 bits are shares of their largest; floats and longer integers have no white
    of their own: their smallest is black, their largest white. Colours become grey by their luma
    (ITU-R BT.601), of which Pillow reads 8 bits. Raises InputError with `key` and `allowed`.
    """
    from PIL import Image

    try:
        if path.stat().st_size > MOST_BYTES:
            raise InputError(key, f"{path.name}, which is too long", allowed)
        with Image.open(path, formats=formats) as image:
            if image.width * image.height > most_pixels or min(image.size) < 1:
                raise InputError(key, f"{path.name}, {image.width} x {image.height} pixels", allowed)
            values, white = _values(image)
    except InputError:
        raise
    except Exception as error:  # whatever the many decoders raise for a damaged file
        reason = getattr(error, "strerror", None) or "cut off, damaged or of another kind"
        raise InputError(key, f"{path.name} ({reason})", allowed) from None
    known = values[np.isfinite(values)]
    if not known.size:
        raise InputError(key, f"{path.name}, in which nothing is to be seen", allowed)
    low, high = float(known.min()), float(known.max())
    if white is None:
        told = f"Grey values {low:.6g} to {high:.6g}: black and white, as such numbers have no others."
        return (values - low) / (high - low or 1.0), told
    return values / white, f"Grey values {low:g} to {high:g} of {white:g}."


def _values(image: object) -> tuple[Floats, float | None]:
    """Stored values, NaN for transparent pixels, and the value of white, None if unknown."""
    from PIL import Image, ImageOps

    assert isinstance(image, Image.Image)
    inverted = getattr(image, "tag_v2", {}).get(PHOTOMETRIC) == 0
    upright = ImageOps.exif_transpose(image)
    if upright.mode.startswith("I;16") or (upright.mode == "I" and image.format in ("PNG", "PPM")):
        values, white = np.asarray(upright).astype(float), 65535.0
        return (white - values if inverted else values), white
    if upright.mode in ("I", "F"):
        values = np.asarray(upright).astype(float)
        values[~np.isfinite(values)] = np.nan
        return (-values if inverted else values), None
    values = np.asarray(upright.convert("L")).astype(float)
    if upright.has_transparency_data:
        values[np.asarray(upright.convert("RGBA").getchannel("A")) == 0] = np.nan
    return values, 255.0
