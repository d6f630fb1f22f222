"""Content of the page for a state: curves of a few hundred points, numbers, and sentences."""

from __future__ import annotations

import json
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from evfem.circuit.signalfile import write_signal
from evfem.common.arrays import Floats
from evfem.common.checks import Key, choice, keys_of
from evfem.common.storage import passing_folder
from evfem.electrostatics.laws import FORCE_LAWS, INSULATORS
from evfem.estimate.display import Device, Rendering, playback, render, render_exact, spectrum_of
from evfem.estimate.estimate import Estimate, estimate
from evfem.estimate.touch import touch_scene
from evfem.scene.file import dump
from evfem.scene.keys import read
from evfem.studio.state import State, rows
from evfem.textures.importers import IMPORTERS, friction_profile, importer_of

#: points of a curve that is drawn
POINTS = 401
#: letters of an uploaded file's name that are kept, each of up to 4 bytes: a disk takes 255
LETTERS = 60
#: what the buttons give: name of the file, and its type
FILES = {
    "csv": ("voltage.csv", "text/csv"),
    "wav": ("voltage.wav", "audio/wav"),
    "png": ("friction-map.png", "image/png"),
    "hjif": ("voltage.hjif", "application/json"),
    "toml": ("scene.toml", "application/toml"),
    "friction": ("friction.csv", "text/csv"),
}


def with_choices(content: bytes) -> bytes:
    """The page with force laws without parameters, insulators and options of importers to choose from."""
    laws = {name: name for name, law in FORCE_LAWS.items() if not any(key.required for key in keys_of(law))}
    insulators = {name: f"{name}, {1e3 * one.thickness:g} um" for name, one in INSULATORS.items()}
    options = {key.name: key for one in IMPORTERS.values() for key in keys_of(one) if key.name != "name"}
    for marker, parts in (
        (b"<!-- laws -->", [_option(*one, Device().law) for one in laws.items()]),
        (b"<!-- insulators -->", [_option(*one, Device().insulator) for one in insulators.items()]),
        (b"<!-- importers -->", map(_control, options.values())),
    ):
        content = content.replace(marker, "".join(parts).encode())
    return content


def _option(name: str, text: str, usual: str) -> str:
    return f'<option value="{escape(name)}"{" selected" * (name == usual)}>{escape(text)}</option>'


def _control(key: Key) -> str:
    """The control of an importer's option; empty where the importer has no usual value."""
    unit = f" ({key.rule['unit']})" if key.rule.get("unit") else ""
    label = escape(f"{key.name.capitalize()}{unit}: {key.meaning}")
    usual = "" if key.required or key.default is None else str(key.default)
    about = f'id="import-{key.name}" data-import="{key.name}"'
    if "names" not in key.rule:
        return f'<label>{label} <input {about} value="{escape(usual)}" maxlength="200"></label>\n'
    options = "".join(_option(name, name, usual) for name in (*[""] * (not usual), *key.rule["names"]))
    return f"<label>{label} <select {about}>{options}</select></label>\n"


def answer(state: State) -> dict[str, Any]:
    """Profile, friction with its band, voltage, spectrum, numbers and warnings of a state."""
    found, notes = _rendered(state)
    curve = found.curve
    x = np.linspace(0.0, min(state.touch.length, float(curve.x[-1])), POINTS)
    voltage = np.asarray(found.signal.profile(x))
    heights = np.interp(x, *state.texture.over(0.0, float(x[-1])))
    wish, felt = (np.interp(x, found.curve.x, one) for one in (found.curve.friction, found.felt))
    frequency, wished = spectrum_of(x, wish, state.touch.speed)
    rendered = spectrum_of(x, felt, state.touch.speed)[1]
    layers, rough, signal = state.device.encoding.layers, state.device.roughness_gap, found.signal
    warned = [*found.losses, *state.device.doubts(signal.largest)]
    numbers = {
        "rms": signal.rms,
        "peak": signal.largest,
        "carrier": signal.carrier,
        "mean": float(curve.friction.mean()),
        "range": float(np.ptp(curve.friction)),
        "lost": found.share_lost,
        "force_error": found.force_error,
        "change_error": found.change_error,
        "spectrum_error": found.spectrum_error,
        "laws": float((rough + layers.thickness) / (rough + layers.reduced)),
    }
    return {
        "quantity": state.texture.quantity,
        "x": _short(x),
        "profile": _short(heights * (1e3 if state.texture.quantity == "height" else 1.0)),
        "friction": _short(wish),
        "felt": _short(felt),
        "lost": [bool(one) for one in np.interp(x, curve.x, found.lost.astype(float)) > 0.5],
        "band": curve.error,
        "source": curve.source,
        "encoding": "closed form" if state.exact is None else "model",
        "voltage": _short(voltage),
        "frequency": _short(frequency),
        "wish": _short(wished),
        "given": _short(rendered),
        "numbers": {name: None if value != value else value for name, value in numbers.items()},
        "bands": [[None if value != value else round(value, 6) for value in band] for band in found.bands],
        "notes": [*notes, *warned],
        "texture": repr(state.texture),
        "licence": state.texture.licence,
        "provenance": list(state.texture.provenance),
    }


def _rendered(state: State) -> tuple[Rendering, tuple[str, ...]]:
    """The rendering of the model's friction curve, or else of the estimated one, and notes on that."""
    found = estimate(state.texture, state.touch) if state.model is None else Estimate(state.model, ())
    if state.exact is not None:
        return render_exact(found.curve, state.exact, state.touch, state.device), found.notes
    return render(found.curve, state.touch, state.device), found.notes


def _short(values: Floats) -> list[float]:
    return [float(f"{value:.5g}") for value in values]


def file(state: State, kind: str) -> bytes:
    """The file of a button, as bytes."""
    choice("file", kind, FILES)
    if kind == "toml":
        return dump(touch_scene(state.texture, state.touch)).encode()
    found, _ = _rendered(state)
    if kind == "friction":
        return found.curve.rows().encode()
    profile = found.signal.profile
    with passing_folder() as folder:
        path = folder / f"file.{kind}"
        write_signal(path, profile, playback(profile, state.touch, state.device))
        return path.read_bytes()


def uploaded(data: bytes, name: str, options: dict[str, str]) -> dict[str, Any]:
    """The texture in an uploaded file as the page keeps it; `options` are an importer's, `mean` and `rms`."""
    safe = "".join(c for c in Path(name).name if c.isalnum() or c in "._- ").strip(". ")[-LETTERS:] or "file"
    with passing_folder() as folder:
        path = folder / safe
        path.write_bytes(data)
        _, importer = importer_of(path)
        known: dict[str, Any] = {}
        for key in keys_of(importer):
            if text := options.get(key.name):
                known[key.name] = _number(text) if float in key.types else text
        texture = read(importer, known | {"name": Path(safe).stem or "file"}, "")(path)
    if texture.quantity == "friction_spectrum":
        mean, rms = (_number(options.get(key) or usual) for key, usual in (("mean", "0.4"), ("rms", "0.02")))
        texture = friction_profile(texture, mean, rms, length=20.0)
    return rows(texture)


def _number(text: str) -> Any:
    """The number in a control, or else its text."""
    try:
        return float(text)
    except ValueError:
        return text


def text(value: Any) -> bytes:
    """JSON as bytes, without NaN."""
    return json.dumps(value, allow_nan=False, separators=(",", ":")).encode()
