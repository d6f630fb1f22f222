"""Fig. 12: a friction step and a sinusoidal texture, rendered on a display by (20a) and exactly.

[a] friction rises from 0.5 to 0.6 at x = 5 mm; [b] the texture (25) with friction 0.1, on a
display with the smallest apparent friction that the texture has. Pads with ridges (as in the
paper) and without. Expected (the paper): [a] 1776.73 V, r = 0.9995; [b] smallest apparent friction
0.072, r = 0.988, in one instant 1911.12 V. Exact encoding: relative L2 error of the friction force
below 1e-6.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from .common import COLOURS, Axes, Figure, Series, Study, new_figure, panel_letter, side_by_side
from .rendered import ASSUMPTIONS, QUICK_STEP, QUICK_TEXTURE, STEP, TEXTURE, Case, Outcome, render

PAPER = {
    "transition.voltage_max_V": 1776.73,
    "transition.pearson": 0.9995,
    "sinusoid.mu_min": 0.072,
    "sinusoid.pearson": 0.988,
    "sinusoid.voltage_max_V": 1911.12,
}
INSIGHTS = {
    "1911.12 V": "that is (20a) for an apparent friction of 0.0887 on 0.072, below the texture's 0.1: one "
    "instant, not the largest voltage; while all nodes slip forward the mean over a period is 0.0997 or more "
    "(work of friction on the profile), which makes the largest voltage on 0.072 more than 2460 V",
    "out of reach": "steps where the display's force is not as wished within 1e-6: while part of the contact "
    "sticks, where the voltage hardly acts on it, and at the smallest friction, where the wish is below the "
    "display's own",
}
#: prefix of the keys -> what is simulated; the first pad is the paper's
PADS = {"": True, "without_ridges.": False}
SCENES = {"transition": STEP, "sinusoid": TEXTURE}
OPEN = ("open",)
#: what is changed one at a time, all on coarse pads with ridges
_STEP = replace(STEP, resolution="coarse", encodings=OPEN)
_TEXTURE = replace(TEXTURE, resolution="coarse", encodings=())
VARIATIONS: dict[str, Case] = {
    "transition.coarse": _STEP,
    "transition.half_steps": replace(_STEP, steps=2 * _STEP.steps),
    "transition.load_held": replace(_STEP, hold="force"),
    "transition.load_0.02": replace(_STEP, force=0.02),
    "sinusoid.coarse": _TEXTURE,
    "sinusoid.half_steps": replace(_TEXTURE, steps=2 * _TEXTURE.steps),
    "sinusoid.load_held": replace(_TEXTURE, hold="force"),
    "sinusoid.load_0.02": replace(_TEXTURE, force=0.02),
    "sinusoid.viscosity_0.2ms": replace(_TEXTURE, viscosity=2e-4),
    "sinusoid.viscosity_1ms": replace(_TEXTURE, viscosity=1e-3),
    "sinusoid.speed_50mm_s": replace(_TEXTURE, speed=50.0),
    "sinusoid.without_mass": replace(_TEXTURE, dynamics="viscous"),
    "sinusoid.friction_0.08": replace(_TEXTURE, friction=0.08),
    "sinusoid.stiffness_0.5": replace(_TEXTURE, softness=0.5),
    "sinusoid.crest_exponent_2": replace(_TEXTURE, ridge_exponent=2.0),
    "sinusoid.crest_flat_0.3": replace(_TEXTURE, crest=0.3),
}
#: keep every n-th step of the coarse texture run when looking for the smallest apparent friction
SAMPLING = (5, 10)


def _main_numbers(prefix: str, name: str, outcome: Outcome) -> dict[str, float]:
    """Numbers of one pad on one reference: open loop, and exact with `inverse.` before them."""
    signal, numbers = outcome.signal, {}
    voltages = {"open": "", "exact": "inverse."}
    for kind, inverse in voltages.items():
        found, key = outcome.rendered[kind], f"{prefix}{inverse}{name}"
        numbers[f"{key}.pearson"] = found.pearson
        numbers[f"{key}.relative_l2"] = found.relative_l2
        numbers[f"{key}.largest_error_N_per_mm"] = found.largest_error
        numbers[f"{key}.voltage_max_V"] = float(found.voltage.max())
        if name == "sinusoid":
            lowest = outcome.lowest_friction if kind == "open" else found.lowest_friction
            numbers[f"{key}.mu_min"] = lowest
    key = f"{prefix}{name}"
    possible, share = _where_possible(outcome)
    numbers[f"{prefix}inverse.{name}.relative_l2_where_possible"] = possible
    numbers[f"{prefix}inverse.{name}.share_out_of_reach"] = share
    steered = np.flatnonzero(outcome.rendered["exact"].voltage > 0.0)
    numbers[f"{prefix}inverse.{name}.first_voltage_at_mm"] = float(outcome.position[steered[0]])
    apart = outcome.rendered["exact"].voltage - outcome.rendered["open"].voltage
    numbers[f"{key}.voltage_difference_V"] = float(np.abs(apart).max())
    numbers[f"{key}.voltage_rms_V"] = signal.rms
    numbers[f"{key}.carrier_amplitude_V"] = signal.carrier
    numbers[f"{key}.share_not_renderable"] = signal.share_not_renderable
    if name == "sinusoid":
        numbers |= {
            f"{key}.mu_of_display": outcome.friction,
            f"{key}.mu_mean": _mean_friction(outcome),
            f"{key}.mu_max": float(outcome.apparent.max()),
            f"{key}.voltage_median_V": float(np.median(outcome.rendered["open"].voltage)),
        }
    if "thick" in outcome.rendered:
        thick = outcome.rendered["thick"]
        numbers[f"{key}.dsc_0.38mm.relative_l2"] = thick.relative_l2
        numbers[f"{key}.dsc_0.38mm.pearson"] = thick.pearson
        for kind, label in (("open", "dsc_0.20mm"), ("thick", "dsc_0.38mm")):
            numbers[f"{key}.{label}.rise_over_wish"] = _rise(outcome, kind)
    return numbers


def _where_possible(outcome: Outcome) -> tuple[float, float]:
    """Relative L2 error of the exact encoding over the steps it can serve, and the share of the
    others.

    Out of reach are steps in which the friction force on the display is not the wished one: while
    part of the contact sticks, and where the display has more than that of its own.
    """
    found = outcome.rendered["exact"]
    error = found.force - outcome.force
    beyond = np.abs(error) > 1e-6 * np.abs(outcome.force).max()
    served = np.linalg.norm(error[~beyond]) / np.linalg.norm(outcome.force[~beyond])
    return float(served), float(np.mean(beyond))


def _mean_friction(outcome: Outcome) -> float:
    """Mean apparent friction over whole periods (2 pi / 6 mm) at the end of the slide."""
    period = np.pi / 3.0
    slipped = outcome.position[-1] - max(outcome.full_slip, 0.5)
    periods = max(int(slipped / period), 1)
    return float(outcome.apparent[outcome.position > outcome.position[-1] - periods * period].mean())


def _rise(outcome: Outcome, kind: str) -> float:
    """Rise of the friction force across the step on the display over that of the reference."""
    before = int(np.searchsorted(outcome.position, 2.0))
    felt = outcome.rendered[kind].force
    return float((felt[-1] - felt[before]) / (outcome.force[-1] - outcome.force[before]))


def _variation_numbers(outcomes: Mapping[str, Outcome]) -> dict[str, float]:
    """What changes with mesh, steps, load, viscosity, speed, friction, stiffness and ridges."""
    numbers = {}
    for name, outcome in outcomes.items():
        key = f"variation.{name}"
        if name.startswith("transition"):
            found = outcome.rendered["open"]
            numbers[f"{key}.pearson"], numbers[f"{key}.relative_l2"] = found.pearson, found.relative_l2
        else:
            numbers[f"{key}.mu_min"], numbers[f"{key}.mu_mean"] = (
                outcome.lowest_friction,
                _mean_friction(outcome),
            )
        base = outcomes[f"{name.split('.')[0]}.coarse"]
        if outcome is not base:
            numbers[f"{key}.change_of_force"] = _apart(base, outcome)
    coarse = outcomes["sinusoid.coarse"]
    slipping = coarse.position >= coarse.full_slip
    for n in SAMPLING:
        seen = coarse.apparent[slipping][n - 1 :: n]
        numbers[f"variation.sinusoid.every_{n}th_step.mu_min"] = float(seen.min())
    return numbers


def _apart(base: Outcome, other: Outcome) -> float:
    """Relative L2 difference of the reference's friction force, at the positions of `base`."""
    force = np.interp(base.position, other.position, other.force)
    return float(np.linalg.norm(force - base.force) / np.linalg.norm(base.force))


def _mesh_numbers(outcomes: Mapping[str, Outcome], coarse: Mapping[str, Outcome]) -> dict[str, float]:
    """Change of the reference's friction force from coarse pads to those of the figure."""
    return {
        f"variation.{name}.coarse.change_of_force": _apart(outcomes[name], coarse[f"{name}.coarse"])
        for name in SCENES
    }


def _cases(quick: bool) -> dict[str, Case]:
    """Key -> case, those that take longest first."""
    scenes = {"transition": QUICK_STEP, "sinusoid": QUICK_TEXTURE} if quick else SCENES
    cases = {}
    for name in ("sinusoid", "transition"):
        for prefix, ridges in PADS.items():
            if ridges or not quick:
                cases[f"{prefix}{name}"] = replace(scenes[name], ridges=ridges)
    thick = cases["transition"]
    cases["transition"] = replace(thick, encodings=(*thick.encodings, "thick"))
    return cases if quick else cases | {f"variation.{key}": case for key, case in VARIATIONS.items()}


def main(quick: bool = False, out: Path | None = None) -> dict[str, Any]:
    """Both references on both pads, open loop and exact; what changes them; the figure."""
    cases = _cases(quick)
    found = side_by_side(render, list(cases.values()), 1 if quick else 2)
    outcomes = dict(zip(cases, found, strict=True))
    shown = {key: outcome for key, outcome in outcomes.items() if not key.startswith("variation.")}
    numbers: dict[str, float] = {}
    for key, outcome in shown.items():
        prefix, name = key[: -len(key.split(".")[-1])], key.split(".")[-1]
        numbers |= _main_numbers(prefix, name, outcome)
    varied = {key.removeprefix("variation."): o for key, o in outcomes.items() if key not in shown}
    if varied:
        numbers |= _variation_numbers(varied) | _mesh_numbers(shown, varied)
    costs = {key: outcome.costs for key, outcome in outcomes.items()}
    return Study(
        "fig12",
        numbers,
        PAPER,
        ASSUMPTIONS | INSIGHTS,
        _series(shown),
        lambda: draw(shown, numbers),
        {"costs": costs},
    ).finish(out, quick)


def _series(outcomes: Mapping[str, Outcome]) -> list[Series]:
    series = []
    for key, outcome in outcomes.items():
        x = outcome.position
        series.append(Series(f"{key}.reference.force", x, outcome.force, "N/mm"))
        series.append(Series(f"{key}.reference.load", x, outcome.load, "N/mm"))
        for kind, found in outcome.rendered.items():
            series.append(Series(f"{key}.{kind}.force", x, found.force, "N/mm"))
            series.append(Series(f"{key}.{kind}.load", x, found.load, "N/mm"))
            series.append(Series(f"{key}.{kind}.voltage", x, found.voltage, "V"))
    return series


COLOUR = {"open": COLOURS["strong_troxel"], "exact": COLOURS["fe"], "thick": COLOURS["measured"]}
LABEL = {
    "open": "display, (20a)",
    "exact": "display, exact encoding",
    "thick": "display, (20a), 0.38 mm in the pad",
}
TITLE = {
    "transition": ("a", "friction step"),
    "without_ridges.transition": ("a", "friction step, no ridges"),
    "sinusoid": ("b", "sinusoid (25)"),
    "without_ridges.sinusoid": ("b", "sinusoid (25), no ridges"),
}


def draw(outcomes: Mapping[str, Outcome], numbers: Mapping[str, float]) -> Figure:
    """Voltage, force and residual over the position, a column for each reference and pad."""
    keys = [key for key in TITLE if key in outcomes]
    figure = new_figure(7.5, 3.1 * len(keys) if len(keys) > 2 else 7.5)
    axes = figure.subplots(3, len(keys), squeeze=False, sharex="col", height_ratios=(1.0, 1.3, 1.0))
    for column, key in zip(axes.T, keys, strict=True):
        letter, title = TITLE[key]
        panel_letter(column[0], letter)
        column[0].set_title(title, fontsize="medium")
        _draw_voltage(column[0], outcomes[key], key)
        _draw_force(column[1], outcomes[key], numbers, key)
        _draw_residual(column[2], outcomes[key])
    for row, label in zip(
        axes[:, 0], ("voltage (V)", "friction force (N/mm)", "error over largest force"), strict=True
    ):
        row.set_ylabel(label)
    handles, labels = axes[1, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize="small")
    return figure


def _draw_voltage(ax: Axes, outcome: Outcome, key: str) -> None:
    for kind, found in outcome.rendered.items():
        if kind != "thick":
            ax.plot(outcome.position, found.voltage, color=COLOUR[kind], linewidth=1.1)
    ax.margins(y=0.12)
    printed = PAPER[f"{key.split('.')[-1]}.voltage_max_V"]
    ax.axhline(printed, color=COLOURS["neutral"], linewidth=0.8, linestyle=":")
    ax.annotate(
        f"paper {printed:g} V",
        (0.02, printed),
        xycoords=("axes fraction", "data"),
        xytext=(0, 2),
        textcoords="offset points",
        fontsize="x-small",
        color=COLOURS["neutral"],
        bbox={"facecolor": "white", "alpha": 0.75, "linewidth": 0.0, "pad": 0.5},
    )
    ax.grid(alpha=0.3)


def _draw_force(ax: Axes, outcome: Outcome, numbers: Mapping[str, float], key: str) -> None:
    x, name = outcome.position, key.split(".")[-1]
    ax.plot(x, outcome.force, color=COLOURS["kaczmarek"], linewidth=2.4, alpha=0.6, label="reference")
    for kind, found in outcome.rendered.items():
        style = "--" if kind == "exact" else "-"
        ax.plot(x, found.force, style, color=COLOUR[kind], linewidth=1.1, label=LABEL[kind])
    text = f"(20a): r = {numbers[f'{key}.pearson']:.4f} (paper {PAPER[f'{name}.pearson']:g})"
    text += f"\nrelative L2 error {numbers[f'{key}.relative_l2']:.3f}"
    if name == "sinusoid":
        own, level = PAPER["sinusoid.mu_min"], outcome.friction * outcome.case.force
        text += f"\nsmallest apparent friction {numbers[f'{key}.mu_min']:.3f} (paper {own:g})"
        ax.axhline(level, color=COLOURS["neutral"], linewidth=0.8, linestyle=":")
        ax.set_ylim(top=ax.get_ylim()[1] * 1.25)
        ax.text(0.03, 0.97, text, transform=ax.transAxes, va="top", fontsize="x-small")
    else:
        ax.text(0.97, 0.05, text, transform=ax.transAxes, ha="right", fontsize="x-small")
    ax.grid(alpha=0.3)


def _draw_residual(ax: Axes, outcome: Outcome) -> None:
    largest = np.abs(outcome.force).max()
    for kind, found in outcome.rendered.items():
        error = np.maximum(np.abs(found.force - outcome.force) / largest, 1e-16)
        ax.semilogy(outcome.position, error, color=COLOUR[kind], linewidth=1.0)
    ax.set_ylim(1e-15, 1.0)
    ax.set_xlabel("position of the bone (mm)")
    ax.grid(alpha=0.3)
