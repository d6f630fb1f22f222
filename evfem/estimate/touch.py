"""Conditions of a slide over a texture (finger, load, speed), its scene, and the simulated friction.

The pad is the coarse one, viscous; it is pressed to the load, slid until its whole contact slips,
and then over the requested length of the texture, at constant load. Heights are those of the
rigid surface; a friction profile lies on a flat one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import SEED, Checked, Within, between, keys_of, number, yes_or_no
from evfem.common.tables import csv_text
from evfem.errors import ABSENT, InputError
from evfem.estimate.parametric import SLIP_PER_FORCE, SPEED, STEPS_BEFORE, sliding
from evfem.scene.keys import at
from evfem.scene.scene import Output, Scene
from evfem.simulation.result import Result
from evfem.surface.surfaces import Flat, Profile
from evfem.textures.importers import Channel, Longest, Quantity, Recording, friction_profile
from evfem.textures.texture import Texture

#: steps per mm, largest number of steps of a slide and of rows of a friction table, mm beside the finger
STEPS_PER_MM, MOST_STEPS, MOST_TABLE, BESIDE = 16, 400, 9_000, 10.0


@dataclass(frozen=True)
class Touch(Checked):
    """Conditions of a slide over a texture: finger, material's friction, load, speed and length.

    >>> Touch(load=-1.0)
    Traceback (most recent call last):
    evfem.errors.InputError: load: given -1.0; allowed: 0.001 to 1 N/mm
    """

    ridged: Annotated[bool, yes_or_no(), "whether the finger has ridges"] = True
    friction: Annotated[float, between(0.01, 3.0), "coefficient of the texture's material"] = 0.3
    load: Annotated[float, between(0.001, 1.0, "N/mm"), "on the finger"] = 0.05
    speed: Annotated[float, between(0.1, 1000.0, "mm/s"), "of the slide"] = SPEED
    length: Annotated[float, between(0.5, 50.0, "mm"), "of the slide"] = 8.0


@dataclass(frozen=True, kw_only=True)
class Vibration(Checked):
    """What a spectrum of friction does not say, and a recording of one: size, phases, meaning.

    >>> felt = Texture("felt", "recorded", [0.5, 1.0], [0.8, 0.6], "CC0-1.0", "friction_spectrum")
    >>> Vibration(friction_mean=0.4, friction_rms=0.03).friction_of(felt, Touch(length=4.0)).length
    24.0
    >>> Vibration(friction_mean=0.4).friction_of(felt, Touch())
    Traceback (most recent call last):
    evfem.errors.InputError: friction_rms: missing; allowed: a number from 0 to the mean: felt is a spectrum \
without a size
    """

    friction_mean: Annotated[
        float | None, number("a friction coefficient from 0 to 10", Within(0.0, 10.0)), "of a spectrum"
    ] = None
    friction_rms: Annotated[
        float | None, number("a number from 0 to the mean", Within(0.0, 10.0)), "of a spectrum"
    ] = None
    seed: Annotated[int, SEED, "of a spectrum's phases"] = 0
    quantity: Quantity = None
    longest: Longest = 10.0
    channel: Channel = None

    def recorded(self, path: Path, speed: float) -> Texture:
        """The spectrum of a recording of a slide at that speed (mm/s)."""
        return Recording(
            licence="none given",
            speed=speed,
            quantity=self.quantity,
            longest=self.longest,
            channel=self.channel,
        )(path)

    def friction_of(self, texture: Texture, touch: Touch) -> Texture:
        """The texture, or friction below the whole slide where it is a spectrum. Raises InputError for a
        spectrum without a size, and for a size of what has one.
        """
        sizes = {"friction_mean": self.friction_mean, "friction_rms": self.friction_rms}
        spectrum = texture.quantity == "friction_spectrum"
        for key in keys_of(Vibration):
            if key.name in sizes and (sizes[key.name] is None) is spectrum:
                given = ABSENT if spectrum else f"{sizes[key.name]:g} beside {texture.name}, no spectrum"
                about = f"{key.allowed}: {texture.name} is a spectrum without a size"
                raise InputError(key.name, given, about if spectrum else "nothing here")
        if self.friction_mean is None or self.friction_rms is None:
            return texture
        length = touch.length + 2.0 * BESIDE
        with at("", {"rms": "friction_rms"}):
            return friction_profile(texture, self.friction_mean, self.friction_rms, length, self.seed)


@dataclass(frozen=True, eq=False)
class FrictionCurve:
    """Friction (n,) over x (n,) in mm from the texture's start; its `source`, and `error` (+-) if known."""

    x: Floats
    friction: Floats
    source: str
    error: float | None = None

    def rows(self) -> str:
        """Content of its `.csv`."""
        return csv_text([["x", "friction"], *zip(self.x.tolist(), self.friction.tolist(), strict=True)])


def touch_scene(texture: Texture, touch: Touch, *, every: int = 0) -> Scene:
    """The scene of a slide over the texture, x = 0 where the second slide begins; `every` as in `Output`."""
    before = max(SLIP_PER_FORCE * touch.friction * touch.load, 0.5)
    slides = [(before, STEPS_BEFORE), (touch.length, steps_over(touch.length))]
    output = Output(every=every) if every else Output()
    surface, name = surface_of(texture, touch, before), _file_name(texture.name)
    return sliding(surface, touch, slides, touch.speed, output=output, name=name)


def steps_over(length: float) -> int:
    """Number of steps of a slide over `length` (mm)."""
    return int(np.clip(round(STEPS_PER_MM * length), 20, MOST_STEPS))


def surface_of(texture: Texture, touch: Touch, before: float) -> Flat | Profile:
    """The texture below the whole slide, shifted so that its x = 0 is reached after `before` mm."""
    x, values = texture.over(-before - BESIDE, touch.length + BESIDE)
    x = x + before
    if texture.quantity == "height":
        return Profile(x, values, friction=touch.friction)
    if x.size > MOST_TABLE:
        few = np.linspace(x[0], x[-1], MOST_TABLE)
        x, values = few, np.interp(few, x, values)
    return Flat(friction=np.column_stack([x, values]).tolist())


def _file_name(name: str) -> str:
    return "".join(c if c.isascii() and (c.isalnum() or c in "-_") else "-" for c in name)[:60] or "texture"


def from_texture(result: Result) -> Result:
    """The result of `touch_scene` for pictures, shifted to the x of the texture and of the curve."""
    before = _run_in(result)
    frames = [
        replace(one, position=one.position - before, displacement=one.displacement - [before, 0.0])
        for one in result.frames
    ]
    elsewhere = result.provenance | {"parameters": ""}
    return replace(result, frames=frames, provenance=elsewhere, simulated=None)


def _run_in(result: Result) -> float:
    """Position (mm) of the bone where the second slide begins."""
    return float(result.position[result.motion_index < 2][-1])


def friction_of(result: Result) -> FrictionCurve:
    """The apparent friction of the second slide of `touch_scene`."""
    last = result.motion_index == 2
    if not last.any():
        raise InputError("result", "no second slide", "the result of a scene of touch_scene")
    x = result.position[last] - _run_in(result)
    return FrictionCurve(x, result.applied_tangential_force[last] / result.applied_force[last], "model")
