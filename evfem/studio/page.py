"""What the page shows of a state: curves with a few hundred points, numbers, and sentences."""

from __future__ import annotations

import json
import tempfile
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import keys_of
from evfem.common.tables import csv_text
from evfem.electrostatics.laws import FORCE_LAWS, INSULATORS
from evfem.electrostatics.signalfile import write_signal
from evfem.errors import InputError
from evfem.scene.file import dump
from evfem.studio.state import State, rows
from evfem.textures.cleaning import Cleaning
from evfem.textures.estimate import estimate
from evfem.textures.feeling import Device, Rendering, playback, render, render_exact
from evfem.textures.importing import (
    LONGEST_WAVE,
    Source,
    friction_profile,
    from_csv,
    from_image,
    from_recording,
    kind_of,
)
from evfem.textures.scans import from_scan
from evfem.textures.texture import Texture
from evfem.textures.touch import FrictionCurve, touch_scene

#: points of a curve that is drawn
POINTS = 401
#: what the buttons give: name of the file, and its type
FILES = {
    "csv": ("voltage.csv", "text/csv"),
    "wav": ("voltage.wav", "audio/wav"),
    "png": ("friction-map.png", "image/png"),
    "hjif": ("voltage.hjif", "application/json"),
    "toml": ("scene.toml", "application/toml"),
    "friction": ("friction.csv", "text/csv"),
}
#: a rendering that loses more of the slide is warned of
LOST = 0.02


def with_choices(content: bytes) -> bytes:
    """The page with the force laws and insulators to choose from; a law that needs parameters is none."""
    laws = {name: name for name, law in FORCE_LAWS.items() if not any(key.required for key in keys_of(law))}
    insulators = {name: f"{name}, {1e3 * one.thickness:g} um" for name, one in INSULATORS.items()}
    for place, choices in ((b"<!-- laws -->", laws), (b"<!-- insulators -->", insulators)):
        content = content.replace(place, "".join(map(_option, choices.items())).encode())
    return content


def _option(choice: tuple[str, str]) -> str:
    name, text = map(escape, choice)
    chosen = " selected" if name in (Device().law, Device().insulator) else ""
    return f'<option value="{name}"{chosen}>{text}</option>'


def answer(state: State) -> dict[str, Any]:
    """Profile, friction with its band, voltage, spectrum, numbers and warnings of a state."""
    curve, notes = _curve(state)
    found = _rendering(state, curve)
    x = np.linspace(0.0, min(state.touch.length, float(curve.x[-1])), POINTS)
    voltage = np.asarray(found.signal.profile(x))
    heights = np.interp(x, *state.texture.over(0.0, float(x[-1])))
    frequency, wish, felt = _spectra(found, state.touch.speed, x)
    return {
        "quantity": state.texture.quantity,
        "x": _short(x),
        "profile": _short(heights * (1e3 if state.texture.quantity == "height" else 1.0)),
        "friction": _short(np.interp(x, curve.x, curve.friction)),
        "felt": _short(np.interp(x, curve.x, found.felt)),
        "lost": [bool(one) for one in np.interp(x, curve.x, found.lost.astype(float)) > 0.5],
        "band": curve.error,
        "source": curve.source,
        "encoding": "closed form" if state.exact is None else "model",
        "voltage": _short(voltage),
        "frequency": _short(frequency),
        "wish": _short(wish),
        "given": _short(felt),
        "numbers": _numbers(found),
        "bands": [[None if value != value else round(value, 6) for value in band] for band in found.bands],
        "notes": [*notes, *_warnings(found)],
        "texture": repr(state.texture),
        "licence": state.texture.licence,
        "provenance": list(state.texture.provenance),
    }


def _curve(state: State) -> tuple[FrictionCurve, tuple[str, ...]]:
    if state.model is not None:
        return state.model, ()
    found = estimate(state.texture, state.touch)
    return found.curve, found.notes


def _rendering(state: State, curve: FrictionCurve) -> Rendering:
    if state.exact is not None:
        return render_exact(curve, state.exact, state.touch, state.device)
    return render(curve, state.touch, state.device)


def _spectra(found: Rendering, speed: float, x: Floats) -> tuple[Floats, Floats, Floats]:
    """Frequencies (Hz) and amplitudes of the wish and of what is felt."""
    window = 1.0 - np.cos(2.0 * np.pi * (np.arange(x.size) + 0.5) / x.size)
    both = []
    for values in (found.curve.friction, found.felt):
        even = np.interp(x, found.curve.x, values)
        both.append(2.0 / x.size * np.abs(np.fft.rfft((even - even.mean()) * window)))
    frequency = np.arange(0.0, both[0].size) * (speed / float(x[-1] - x[0]))
    return frequency[1:], both[0][1:], both[1][1:]


def _numbers(found: Rendering) -> dict[str, float | None]:
    told = {
        "rms": found.signal.rms,
        "peak": found.signal.largest,
        "carrier": found.signal.carrier,
        "mean": float(found.curve.friction.mean()),
        "range": float(np.ptp(found.curve.friction)),
        "lost": float(found.lost.mean()),
        "force_error": found.force_error,
        "change_error": found.change_error,
        "spectrum_error": found.spectrum_error,
    }
    return {name: None if value != value else value for name, value in told.items()}


def _warnings(found: Rendering) -> list[str]:
    notes = []
    if found.signal.share_not_renderable > LOST:
        share = found.signal.share_not_renderable
        notes.append(f"{share:.0%} of the slide is slipperier than the display: it cannot be rendered")
    if found.signal.share_limited > LOST:
        notes.append(f"the amplifier cannot follow on {found.signal.share_limited:.0%} of the slide")
    return notes


def _short(values: Floats) -> list[float]:
    return [float(f"{value:.5g}") for value in values]


def file(state: State, kind: str) -> bytes:
    """What a button gives, as bytes."""
    if kind not in FILES:
        raise InputError("file", repr(kind), ", ".join(FILES))
    if kind == "toml":
        return dump(touch_scene(state.texture, state.touch)).encode()
    curve, _ = _curve(state)
    if kind == "friction":
        both = zip(curve.x.tolist(), curve.friction.tolist(), strict=True)
        return csv_text([["x", "friction"], *both]).encode()
    profile = _rendering(state, curve).signal.profile
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"file.{kind}"
        write_signal(path, profile, playback(profile, state.touch, state.device))
        return path.read_bytes()


def uploaded(data: bytes, name: str, options: dict[str, str]) -> dict[str, Any]:
    """The texture in an uploaded file, as the page keeps it; read by the importers.

    `options`: licence, and as they are needed pixel, depth, speed, quantity, longest, channel, row,
    unit, smooth, mean, rms.
    """
    safe = "".join(c for c in Path(name).name if c.isalnum() or c in "._- ")[-80:] or "file"
    source = Source(options.get("licence", ""), Path(safe).stem[:80] or "file")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / safe
        path.write_bytes(data)
        return rows(_imported(path, source, options))


def _imported(path: Path, source: Source, options: dict[str, str]) -> Texture:
    cleaning = Cleaning(smooth=_number(options, "smooth"))
    how, row, unit = kind_of(path), _number(options, "row", 0.5), options.get("unit") or None
    if how == "recording":
        spectrum = from_recording(
            path,
            source,
            _number(options, "speed") or 0.0,
            quantity=options.get("quantity") or None,
            longest=_number(options, "longest", LONGEST_WAVE) or 0.0,
            channel=options.get("channel") or None,
        )
        mean, rms = _number(options, "mean") or 0.4, _number(options, "rms") or 0.02
        return friction_profile(spectrum, mean, rms, length=20.0)
    if how == "image":
        sizes = {key: _number(options, key) or 0.0 for key in ("pixel", "depth")}
        return from_image(path, source, **sizes, row=row or 0.0, cleaning=cleaning)
    if how == "csv":
        return from_csv(path, source, cleaning, unit)
    return from_scan(path, source, row=row or 0.0, unit=unit, cleaning=cleaning)


def _number(options: dict[str, str], key: str, usual: float | None = None) -> float | None:
    text = options.get(key, "")
    if not text:
        return usual
    try:
        return float(text)
    except ValueError:
        raise InputError(key, repr(text[:40]), "a number") from None


def text(value: Any) -> bytes:
    """JSON as bytes, without NaN."""
    return json.dumps(value, allow_nan=False, separators=(",", ":")).encode()
