"""The commands `evfem texture ...`; their arguments are in `evfem.arguments`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from evfem.common.checks import keys_of
from evfem.common.notices import status, tell
from evfem.common.storage import write_text
from evfem.electrostatics.signalfile import write_signal
from evfem.electrostatics.signals import VoltageProfile
from evfem.errors import InputError, quoted
from evfem.estimate.display import Device, exact_voltage, playback, render
from evfem.estimate.estimate import estimate, known_error
from evfem.estimate.rendering import record
from evfem.estimate.touch import FrictionCurve, Touch, friction_of, touch_scene
from evfem.scene.keys import at, read
from evfem.textures.generate import Knobs, make
from evfem.textures.importers import IMPORTERS, importer_of
from evfem.textures.library import REFERENCES, about, find, names, reference
from evfem.textures.texture import Texture, is_data, write


def run(args: argparse.Namespace) -> None:
    """Do one of the commands."""
    commands = {"list": _list, "show": _show, "make": _make, "import": _import, "simulate": _simulate}
    {**commands, "estimate": _estimate, "database": _database}[args.what](args)


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


def _simulate(args: argparse.Namespace) -> None:
    texture, (touch, device) = find(args.name), _felt(args)
    _check_outputs(args)
    with status(f"sliding over {texture.name}"):
        reference = record(touch_scene(texture, touch))
        exact, comparison = exact_voltage(reference, device) if args.exact else (None, None)
    curve = friction_of(reference.result)
    _curve(curve, args.out)
    if exact is None:
        _render(curve, touch, device, args.signal)
    else:
        print(f"exact: {comparison}")
        _signal(VoltageProfile(exact.x, exact.voltage), touch, device, args.signal)


def _estimate(args: argparse.Namespace) -> None:
    touch, device = _felt(args)
    _check_outputs(args)
    found = estimate(find(args.name), touch)
    _curve(found.curve, args.out)
    if args.name in REFERENCES:
        finger = "ridged" if touch.ridged else "smooth"
        error = known_error(args.name, touch.ridged)
        print(f"error for a {finger} finger at the default load and speed: {error:.1%} of the curve's range")
    for note in found.notes:
        tell(f"note: {note}")
    _render(found.curve, touch, device, args.signal)


def _check_outputs(args: argparse.Namespace) -> None:
    endings = {"out": (".csv",), "signal": (".csv", ".wav", ".png", ".hjif")}
    for key, path in ((key, getattr(args, key)) for key in endings):
        if path is not None and path.suffix.lower() not in endings[key]:
            raise InputError(f"--{key}", quoted(str(path)), f"a file called {', '.join(endings[key])}")
        if path is not None and is_data(path):
            raise InputError(f"--{key}", f"{path}, which has the rows of a texture", "another file")


def _render(curve: FrictionCurve, touch: Touch, device: Device, path: Path | None) -> None:
    """Print how good the voltage is, and write it, if it has a path."""
    if path is None:
        return
    found = render(curve, touch, device)
    lost = f"{found.lost.mean():.0%} of the slide cannot be rendered"
    reached = lost if found.lost.any() else "all of the slide can be rendered"
    print(
        f"up to {found.signal.largest:.4g} V, rms {found.signal.rms:.4g} V; {reached}; error of the force "
        f"{found.force_error:.2%}, of its spectrum {found.spectrum_error:.2%}"
    )
    for low, high, error, fraction in found.bands:
        if fraction > 1e-3:
            print(f"  {low:g} to {high:g} Hz: error {error:.2%}; holds {fraction:.1%} of the target's power")
    _signal(found.signal.profile, touch, device, path)


def _signal(profile: VoltageProfile, touch: Touch, device: Device, path: Path | None) -> None:
    if path is not None:
        write_signal(path, profile, playback(profile, touch, device))
        print(path, flush=True)


def _curve(curve: FrictionCurve, out: Path | None) -> None:
    """Print what a curve is like, and write it."""
    low, high, mean = curve.friction.min(), curve.friction.max(), curve.friction.mean()
    band = "" if curve.error is None else f", each +- {curve.error:.2g}"
    print(f"{curve.source}: friction {low:.4g} to {high:.4g}, {mean:.4g} on average{band}", flush=True)
    if out is not None:
        write_text(out, curve.rows())
        print(out, flush=True)


def _database(args: argparse.Namespace) -> None:
    from evfem.estimate.database import compute_database

    path, counted = compute_database(args.out, workers=args.workers, scheduler=args.scheduler)
    told = ", ".join(f"{number} {what}" for what, number in counted.items())
    print(f"{told}; in {path}", flush=True)
