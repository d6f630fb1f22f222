"""The commands `evfem texture ...`; their arguments are in `evfem.arguments`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from evfem.circuit.signalfile import write_signal
from evfem.common.checks import keys_of
from evfem.common.notices import status, tell
from evfem.common.storage import write_text
from evfem.errors import ABSENT, InputError, describe_value
from evfem.estimate.display import LOST, Device, Rendering, exact_voltage, playback, render, render_exact
from evfem.estimate.estimate import estimate, known_error
from evfem.estimate.rendering import record
from evfem.estimate.touch import FrictionCurve, Touch, Vibration, friction_of, touch_scene
from evfem.scene.keys import at, read
from evfem.textures.generate import Knobs, make
from evfem.textures.importers import IMPORTERS, Recording, importer_of
from evfem.textures.library import REFERENCES, about, find, names, reference
from evfem.textures.texture import Texture, spared, write

#: exit status where the limit of the voltage loses part of the slide
CUT = 1


def run(args: argparse.Namespace) -> int | None:
    """Do one of the commands; None is done."""
    commands = {"list": _list, "show": _show, "make": _make, "import": _import, "simulate": _simulate}
    return {**commands, "estimate": _estimate, "database": _database}[args.what](args)


def _list(args: argparse.Namespace) -> None:
    for name in names():
        texture = reference(name)
        size = f"{np.ptp(texture.values) * 1e3:.0f} um" if texture.quantity == "height" else "friction"
        print(f"{name:<16}{texture.kind:<12}{texture.period:>6.4g} mm {size:>9}  {about(name)}")


def _show(args: argparse.Namespace) -> None:
    texture = find(args.name)
    print(texture)
    print(f"licence: {texture.licence}")
    for note in texture.provenance:
        print(f"- {note}")
    if texture.quantity == "height":
        slope = np.diff(texture.values) / np.diff(texture.x)
        print(f"rms height {np.std(texture.values) * 1e3:.4g} um, rms slope {np.sqrt(np.mean(slope**2)):.4g}")


def _make(args: argparse.Namespace) -> None:
    knobs = Knobs(**_passed(args, Knobs))
    _written(make(args.kind, knobs, args.name or args.out.stem, args.licence), args.out)


def _import(args: argparse.Namespace) -> None:
    options, (_, importer) = _passed(args, *IMPORTERS.values()), importer_of(args.file)
    names = {*options, *(key.name for key in keys_of(importer))}
    with at("", {name: f"--{name}" for name in names}):
        texture = read(importer, options, "")(args.file)
    _written(texture, args.out)
    for note in texture.provenance:
        print(f"- {note}")


def _passed(args: argparse.Namespace, *classes: type, **renamed: str) -> dict[str, Any]:
    """The options that were given of those that are fields of the classes."""
    names = dict.fromkeys(key.name for one in classes for key in keys_of(one))
    values = {name: getattr(args, renamed.get(name, name)) for name in names}
    return {name: value for name, value in values.items() if value is not None}


def _written(texture: Texture, out: Path) -> None:
    paths = write(texture, out)
    print(f"{texture}; in {', '.join(map(str, paths))}", flush=True)


def _felt(args: argparse.Namespace) -> tuple[Touch, Device]:
    return Touch(**_passed(args, Touch)), Device(**_passed(args, Device, friction="display"))


def _texture(args: argparse.Namespace, touch: Touch) -> Texture:
    """The texture to slide over: of a name or a path, or the recording of a slide as fast as this one."""
    vibration, path = Vibration(**_passed(args, Vibration)), Path(args.name)
    flags = {key.name: f"--{key.name.replace('_', '-')}" for key in keys_of(Vibration)}
    with at("", flags):
        if not (path.is_file() and Recording.takes(path)):
            return vibration.friction_of(find(args.name), touch)
        if args.speed is None:
            raise InputError("--speed", ABSENT, f"the speed in mm/s at which {path.name} was recorded")
        return vibration.friction_of(vibration.recorded(path, touch.speed), touch)


def _simulate(args: argparse.Namespace) -> int:
    touch, device = _felt(args)
    texture = _texture(args, touch)
    _check_outputs(args)
    with status(f"sliding over {texture.name}"):
        reference = record(touch_scene(texture, touch))
        exact = exact_voltage(reference, device)[0] if args.exact else None
    curve = friction_of(reference.result)
    _curve(curve, args.out)
    if exact is None:
        return _render(curve, touch, device, args.signal)
    return _rendered(render_exact(curve, exact, touch, device), touch, device, args.signal)


def _estimate(args: argparse.Namespace) -> int:
    touch, device = _felt(args)
    _check_outputs(args)
    found = estimate(_texture(args, touch), touch)
    _curve(found.curve, args.out)
    if args.name in REFERENCES:
        finger = "ridged" if touch.ridged else "smooth"
        error = known_error(args.name, touch.ridged)
        print(f"error for a {finger} finger at the default load and speed: {error:.1%} of the curve's range")
    for note in found.notes:
        tell(f"note: {note}")
    return _render(found.curve, touch, device, args.signal)


def _check_outputs(args: argparse.Namespace) -> None:
    endings = {"out": (".csv",), "signal": (".csv", ".wav", ".png", ".hjif")}
    for key, path in ((key, getattr(args, key)) for key in endings):
        if path is not None and path.suffix.lower() not in endings[key]:
            raise InputError(
                f"--{key}", describe_value(str(path)), f"a file called {', '.join(endings[key])}"
            )
        if path is not None:
            spared(f"--{key}", path)


def _render(curve: FrictionCurve, touch: Touch, device: Device, path: Path | None) -> int:
    """The voltage of the closed forms, if it has a path."""
    return 0 if path is None else _rendered(render(curve, touch, device), touch, device, path)


def _rendered(found: Rendering, touch: Touch, device: Device, path: Path | None) -> int:
    """Print how good a voltage is, and write it, if it has a path; the exit status."""
    lost = f"{found.share_lost:.0%} of the slide cannot be rendered"
    reached = lost if found.lost.any() else "all of the slide can be rendered"
    apart = f", rough faces {1e3 * device.roughness_gap:g} um apart" if device.roughness_gap else ""
    volts = f"up to {found.signal.largest:.4g} V, rms {found.signal.rms:.4g} V"
    errors = f"error of the force {found.force_error:.2%}, of its spectrum {found.spectrum_error:.2%}"
    print(f"{device.law} over {device.insulator}{apart}: {volts}; {reached}; {errors}")
    for low, high, error, fraction in found.bands:
        if fraction > 1e-3:
            print(f"  {low:g} to {high:g} Hz: error {error:.2%}; holds {fraction:.1%} of the target's power")
    for said in (*found.losses, *device.doubts(found.signal.largest)):
        tell(f"warning: {said}")
    if path is not None:
        profile = found.signal.profile
        write_signal(path, profile, playback(profile, touch, device))
        print(path, flush=True)
    return CUT if found.signal.share_limited > LOST else 0


def _curve(curve: FrictionCurve, out: Path | None) -> None:
    """Print what a curve is like, and write it."""
    low, high, mean = curve.friction.min(), curve.friction.max(), curve.friction.mean()
    band = ", error unknown" if curve.source == "estimate" else ""
    if curve.error is not None:
        band = f", each +- {curve.error:.2g} for nine of ten textures"
    print(f"{curve.source}: friction {low:.4g} to {high:.4g}, {mean:.4g} on average{band}", flush=True)
    if out is not None:
        write_text(out, curve.rows())
        print(out, flush=True)


def _database(args: argparse.Namespace) -> None:
    from evfem.estimate.database import compute_database

    path, counted = compute_database(args.out, workers=args.workers, scheduler=args.scheduler)
    told = ", ".join(f"{number} {what}" for what, number in counted.items())
    print(f"{told}; in {path}", flush=True)
