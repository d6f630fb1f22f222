"""Fig. 12: a friction step and a sinusoidal texture, rendered on a display by (20a) and exactly.

[a] friction rises from 0.5 to 0.6 at x = 5 mm; [b] the texture (25) with friction 0.1, on a display with the
smallest apparent friction that the texture has. Pads with ridges (as in the paper) and without. Expected (the
paper): [a] 1776.73 V, r = 0.9995; [b] smallest apparent friction 0.072, r = 0.988, in one instant 1911.12 V.
Exact encoding: relative L2 error of the friction force below 1e-6.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from evfem import data

from . import rendered
from .common import Series, Study, side_by_side
from .plots import COLOURS, Axes, Figure, new_figure
from .printed import Printed
from .rendered import Case, Outcome, display_encoding, render

STEP_PLACE, WAVE_PLACE = "section 3.3.1", "section 3.3.2"
OPEN = "load, speed, viscosity, steps and ridges of the paper's runs are not printed"
THIN = "the printed voltage needs 0.20 mm of stratum corneum in (20a), where Table 2 has 0.38 mm"
INSTANT = (
    "the paper prints the voltage of one instant, here it is the largest: while all nodes slip forward the "
    "mean apparent friction over a period is at least 0.0997 (work of friction on the profile), for which "
    "a display of 0.072 needs more than 2460 V"
)
LOW = "1911.12 V render 0.089, less than the texture's own friction: they are the voltage of one instant"
PAPER = {
    "transition.voltage_max_V": Printed("1776.73", "largest voltage by (20a), step", "V", STEP_PLACE),
    "closed_form.voltage_V.dsc_0.38mm": Printed(
        "1776.73", "the same with Table 2's skin", "V", STEP_PLACE, THIN
    ),
    "transition.pearson": Printed(
        "0.9995", "correlation, step", "", STEP_PLACE, f"{OPEN}; the pad without ridges correlates better"
    ),
    "sinusoid.mu_min": Printed("0.072", "smallest apparent friction, texture", "", WAVE_PLACE, OPEN),
    "sinusoid.pearson": Printed("0.988", "correlation, texture", "", WAVE_PLACE, OPEN),
    "sinusoid.voltage_max_V": Printed(
        "1911.12", "largest voltage by (20a), texture", "V", "Fig. 13", INSTANT
    ),
    "closed_form.voltage_V.texture": Printed(
        "1911.12", "(20a) for friction 0.1 on a display of 0.072", "V", WAVE_PLACE, LOW
    ),
}
INSIGHTS = {
    "out of reach": "steps where the display's force is not as wished within 1e-6: while part of the contact "
    "sticks, where the voltage hardly acts on it, and at the smallest friction, where the wish is below the "
    "display's own"
}
#: prefix of the keys -> what is simulated; the first pad is the paper's
PADS = {"": True, "without_ridges.": False}
SCENES = {"transition": rendered.STEP, "sinusoid": rendered.TEXTURE}


def _main_numbers(prefix: str, name: str, outcome: Outcome) -> dict[str, float]:
    """Numbers of one pad on one reference: open loop, and exact with `inverse.` before them."""
    signal, numbers = outcome.signal, {}
    for kind, inverse in (("open", ""), ("exact", "inverse.")):
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


def _closed_numbers() -> dict[str, float]:
    """What (20a) says without a simulation: step with Table 2's skin, and the texture's own friction."""
    skin = float(data.load("table2").value("d_sc"))
    step, texture = display_encoding(rendered.BEFORE, skin), display_encoding(PAPER["sinusoid.mu_min"].value)
    return {
        "closed_form.voltage_V.dsc_0.38mm": float(step.voltage_for_friction(rendered.AFTER)),
        "closed_form.voltage_V.texture": float(texture.voltage_for_friction(rendered.TEXTURE.friction)),
    }


def _where_possible(outcome: Outcome) -> tuple[float, float]:
    """Relative L2 error of the exact encoding over the steps it can serve, and the others' share.

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


def _cases(quick: bool) -> dict[str, Case]:
    """Key -> case, those that take longest first."""
    scenes = {"transition": rendered.QUICK_STEP, "sinusoid": rendered.QUICK_TEXTURE} if quick else SCENES
    cases = {}
    for name in ("sinusoid", "transition"):
        for prefix, ridges in PADS.items():
            if ridges or not quick:
                cases[f"{prefix}{name}"] = replace(scenes[name], ridges=ridges)
    thick = cases["transition"]
    return cases | {"transition": replace(thick, encodings=(*thick.encodings, "thick"))}


def main(quick: bool = False) -> Study:
    """Both references on both pads, open loop and exact; the figure."""
    cases = _cases(quick)
    outcomes = dict(zip(cases, side_by_side(render, list(cases.values()), 1 if quick else 2), strict=True))
    numbers = _closed_numbers()
    for key, outcome in outcomes.items():
        name = key.split(".")[-1]
        numbers |= _main_numbers(key.removesuffix(name), name, outcome)
    costs, picture = {key: one.costs for key, one in outcomes.items()}, lambda: draw(outcomes, numbers)
    return Study(
        "fig12", numbers, PAPER, rendered.ASSUMPTIONS | INSIGHTS, _series(outcomes), picture, {"costs": costs}
    )


def _series(outcomes: Mapping[str, Outcome]) -> list[Series]:
    series = []
    for key, outcome in outcomes.items():
        curves = {"reference.force": (outcome.force, "N/mm"), "reference.load": (outcome.load, "N/mm")}
        for kind, found in outcome.rendered.items():
            curves |= {f"{kind}.force": (found.force, "N/mm"), f"{kind}.load": (found.load, "N/mm")}
            curves[f"{kind}.voltage"] = (found.voltage, "V")
        series += [Series(f"{key}.{name}", outcome.position, y, unit) for name, (y, unit) in curves.items()]
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
    figure = new_figure(6.6, max(2.5 * len(keys), 7.5))
    axes = figure.subplots(3, len(keys), squeeze=False, sharex="col", height_ratios=(1.0, 1.3, 1.0))
    for column, key in zip(axes.T, keys, strict=True):
        letter, title = TITLE[key]
        column[0].set_title(f"[{letter}] {title}", loc="left", fontsize="medium")
        _draw_voltage(column[0], outcomes[key], key)
        _draw_force(column[1], outcomes[key], numbers, key)
        _draw_residual(column[2], outcomes[key])
    labels = ("voltage (V)", "friction force (N/mm)", "error over largest force")
    for row, label in zip(axes[:, 0], labels, strict=True):
        row.set_ylabel(label)
    handles, labels = axes[1, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize="small")
    return figure


def _draw_voltage(ax: Axes, outcome: Outcome, key: str) -> None:
    for kind, found in outcome.rendered.items():
        if kind != "thick":
            ax.plot(outcome.position, found.voltage, color=COLOUR[kind], linewidth=1.1)
    printed = PAPER[f"{key.split('.')[-1]}.voltage_max_V"]
    ax.axhline(printed.value, color=COLOURS["neutral"], linewidth=0.8, linestyle=":")
    ax.set_ylim(0.0, 1.3 * max(ax.get_ylim()[1], printed.value))
    ax.text(
        0.03, 0.97, f"dotted: paper, {printed.digits} V", transform=ax.transAxes, va="top", fontsize="x-small"
    )
    ax.grid(alpha=0.3)


def _draw_force(ax: Axes, outcome: Outcome, numbers: Mapping[str, float], key: str) -> None:
    x, name = outcome.position, key.split(".")[-1]
    ax.plot(x, outcome.force, color=COLOURS["kaczmarek"], linewidth=2.4, alpha=0.6, label="reference")
    for kind, found in outcome.rendered.items():
        style = "--" if kind == "exact" else "-"
        ax.plot(x, found.force, style, color=COLOUR[kind], linewidth=1.1, label=LABEL[kind])
    text = f"(20a): r = {numbers[f'{key}.pearson']:.4f} (paper {PAPER[f'{name}.pearson'].digits})"
    text += f"\nrelative L2 error {numbers[f'{key}.relative_l2']:.3f}"
    if name == "sinusoid":
        own, level = PAPER["sinusoid.mu_min"].digits, outcome.friction * outcome.case.force
        text += f"\nsmallest friction {numbers[f'{key}.mu_min']:.3f} (paper {own})"
        ax.axhline(level, color=COLOURS["neutral"], linewidth=0.8, linestyle=":")
        ax.set_ylim(top=ax.get_ylim()[1] * 1.3)
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
