"""How sure are Fig. 5's closed forms? 500 samples of what was measured or assumed.

The closed forms are (8a), (8b) with (24), the rigid smooth ellipsoid of each participant by
quadrature. They are adequate because the fingers hover: nothing touches. What they leave out, the
study measures on some of its own samples by deformable finite elements (a sweep of scenes):
deformation adds a few per cent with Kaczmarek's law, more with Strong-Troxel's at the smallest
gaps, where it moves that law farther from what was measured.

Each sample has one value of every input for all participants (an instrument that is off is off for
all); the answer is the median over the eleven, as Fig. 5 has it. Latin hypercube, fixed seed.
Expected: the air gap matters most, then the stratum corneum (Kaczmarek alone) and the inclination;
the permittivity of skin does not matter; Kaczmarek's law lies within the measured medians'
intervals, Strong-Troxel's above them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import evfem as ev
from evfem.electrostatics.forces import EllipsoidalPad, pad_force, pad_force_per_depth

from .common import (
    CASES,
    COLOURS,
    LABELS,
    LAWS,
    Figure,
    Floats,
    Series,
    Study,
    median_interval,
    new_figure,
    panel_letter,
    participants,
)

COUNT, SEED = 500, 5
INPUTS: dict[str, ev.Uniform | ev.Normal] = {
    "gap_error": ev.Uniform(-0.05, 0.05),
    "voltage_factor": ev.Uniform(0.99, 1.01),
    "stratum_corneum": ev.Uniform(0.27, 0.49),
    "stratum_corneum_eps_r": ev.Uniform(1000.0, 10000.0),
    "insulator": ev.Uniform(0.0855, 0.0945),
    "insulator_eps_r": ev.Uniform(3.0, 3.7),
    "width_error": ev.Normal(0.0, 0.3, between=(-0.9, 0.9)),
    "height_error": ev.Normal(0.0, 0.3, between=(-0.9, 0.9)),
    "length_error": ev.Normal(0.0, 0.3, between=(-0.9, 0.9)),
    "inclination": ev.Normal(30.0, 3.0, between=(21.0, 39.0)),
}
SHOWN = {
    "gap_error": "air gap, ±0.05 mm",
    "voltage_factor": "voltage, ±1 %",
    "stratum_corneum": "stratum corneum, 0.27-0.49 mm",
    "stratum_corneum_eps_r": "its permittivity, 1000-10000",
    "insulator": "insulator, 0.09 mm ±5 %",
    "insulator_eps_r": "its permittivity, 3.0-3.7",
    "width_error": "finger width, s 0.3 mm",
    "height_error": "finger height, s 0.3 mm",
    "length_error": "finger length, s 0.3 mm",
    "inclination": "inclination, s 3 deg",
}
ASSUMPTIONS = {
    "stratum corneum": "0.27 to 0.49 mm as in Fig. 10, permittivity 1000 to 10000 as in Fig. 7; uniform",
    "other spreads": "assumed, the paper states none: see the labels of the figure (s: standard deviation)",
    "independent": "inputs vary independently; one value for all participants",
    "model": "rigid smooth ellipsoid over the rectangle; deformation is checked, ridges are left out",
}


def main(quick: bool = False, out: Path | None = None) -> dict[str, Any]:
    """Distribution of the median force by both laws in each case, what it depends on, and the
    check.
    """
    samples = ev.Samples(INPUTS, 60 if quick else COUNT, SEED)
    drawn = samples.draw()
    medians = {(law, case): np.median(forces(drawn, law, case), axis=1) for law in LAWS for case in CASES}
    ranks = {key: _rank_correlations(drawn, values) for key, values in medians.items()}
    numbers = _numbers(medians, ranks) | check(samples, 1 if quick else 8)
    series = [
        Series(f"median {law} {case}", np.arange(len(v)), v, "mN over sample")
        for (law, case), v in medians.items()
    ]
    series += [
        Series(f"rank correlation {law} {case}", list(found), list(found.values()), "1 over input")
        for (law, case), found in ranks.items()
    ]
    parameters = {"count": samples.count, "seed": SEED, "method": samples.method}
    parameters["inputs"] = {name: repr(one) for name, one in INPUTS.items()}
    return Study(
        "uncertainty", numbers, {}, ASSUMPTIONS, series, lambda: _draw(medians, ranks), parameters
    ).finish(out, quick)


def forces(drawn: dict[str, Floats], law: str, case: str) -> Floats:
    """Forces in mN, (samples, participants)."""
    voltage, gap = CASES[case]
    one = {name: values[:, None] for name, values in drawn.items()}
    table = participants()
    length = (table["c"] + one["length_error"]) * np.cos(np.radians(one["inclination"]))
    pads = EllipsoidalPad(table["a"] + one["width_error"], table["b"] + one["height_error"], length)
    gaps, voltages = gap + one["gap_error"], voltage * one["voltage_factor"]
    return 1e3 * pad_force(LAWS[law], pads, gaps, voltages, _layers(one))


def _layers(one: dict[str, Any]) -> ev.Layers:
    skin = ev.Layer(one["stratum_corneum"], one["stratum_corneum_eps_r"])
    return ev.Layers.of(skin, ev.Layer(one["insulator"], one["insulator_eps_r"]))


def check(samples: ev.Samples, count: int) -> dict[str, float]:
    """Deformable finite elements over the rigid cross-section, smallest and largest ratio less 1:
    the mean finger, smooth and coarse, in `count` of the samples, both laws and all cases.
    """
    drawn = samples.draw()
    picked = np.linspace(0, samples.count - 1, count).astype(int)
    chosen = {
        f"{case} {i}": (case, {name: float(values[i]) for name, values in drawn.items()})
        for case in CASES
        for i in picked
    }
    rows = {label: _keys(*sample) for label, sample in chosen.items()}
    scene = {
        "version": 1,
        "finger": {"resolution": "coarse", "ridges": False},
        "surface": {"kind": "flat"},
        "electrostatics": {"law": "kaczmarek", "insulator_thickness": 0.09, "insulator_eps_r": 3.35},
        "motion": [{"kind": "hover"}],
    }
    grid = {"electrostatics.law": list(LAWS), "sample": rows}
    table = ev.sweep(ev.Sweep(scene, grid, outputs=("electrostatic_force.last",)), workers=1)
    changes: dict[str, list[float]] = {law: [] for law in LAWS}
    for row in table.rows:
        pad = EllipsoidalPad(row["finger.width"], row["finger.height"], 1.0)
        gap, voltage = row["motion.0.gap"], row["electrostatics.voltage"]
        layers = _layers(chosen[row["sample"]][1])
        rigid = pad_force_per_depth(LAWS[row["electrostatics.law"]], pad, gap, voltage, layers)
        changes[row["electrostatics.law"]].append(row["electrostatic_force.last"] / rigid - 1.0)
    found: dict[str, float] = {"check.points": len(table.rows)}
    for law, values in changes.items():
        found[f"check.deformable_over_rigid_lowest.{law}"] = min(values)
        found[f"check.deformable_over_rigid_highest.{law}"] = max(values)
    return found


def _keys(case: str, one: dict[str, float]) -> dict[str, float]:
    """A sample as keys of a scene."""
    (voltage, gap), table = CASES[case], ev.data.load("table2")
    return {
        "electrostatics.voltage": voltage * one["voltage_factor"],
        "electrostatics.insulator_thickness": one["insulator"],
        "electrostatics.insulator_eps_r": one["insulator_eps_r"],
        "finger.width": table.value("a") + one["width_error"],
        "finger.height": table.value("b") + one["height_error"],
        "finger.stratum_corneum_thickness": one["stratum_corneum"],
        "finger.electrical.stratum_corneum_eps_r": one["stratum_corneum_eps_r"],
        "motion.0.gap": gap + one["gap_error"],
    }


def _rank_correlations(drawn: dict[str, Floats], values: Floats) -> dict[str, float]:
    """Spearman's rank correlation of each input with the median force."""
    ranks = np.argsort(np.argsort(values))
    return {
        name: float(np.corrcoef(np.argsort(np.argsort(inputs)), ranks)[0, 1])
        for name, inputs in drawn.items()
    }


def _numbers(medians: dict[Any, Floats], ranks: dict[Any, dict[str, float]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for (law, case), values in medians.items():
        low, middle, high = np.percentile(values, [5, 50, 95])
        least, most, _ = median_interval(participants()[case])
        key = f"{law}.{case}"
        found |= {
            f"{law}.p05_mN.{case}": low,
            f"{law}.p50_mN.{case}": middle,
            f"{law}.p95_mN.{case}": high,
            f"{law}.relative_sd.{case}": np.std(values, ddof=1) / np.mean(values),
            f"verdict.share_inside_measured_interval.{key}": np.mean((values >= least) & (values <= most)),
        }
        found |= {f"rank.{key}.{name}": rank for name, rank in ranks[law, case].items()}
    return found


def _draw(medians: dict[Any, Floats], ranks: dict[Any, dict[str, float]]) -> Figure:
    figure = new_figure(4.4, 8.4)
    left, right = figure.subplots(1, 2, width_ratios=[1.0, 0.9])
    for place, case in enumerate(CASES):
        low, high, _ = median_interval(participants()[case])
        left.plot(
            [place - 0.3] * 2, [low, high], color=COLOURS["measured"], linewidth=5, solid_capstyle="butt"
        )
        left.plot(place - 0.3, np.median(participants()[case]), "_", color="black", markersize=11)
        for law, at in (("kaczmarek", 0.0), ("strong_troxel", 0.27)):
            parts = left.violinplot([medians[law, case]], [place + at], widths=0.24, showextrema=False)
            for body in parts["bodies"]:
                body.set(facecolor=COLOURS[law], alpha=0.55)
            low, middle, high = np.percentile(medians[law, case], [5, 50, 95])
            left.plot([place + at] * 2, [low, high], color=COLOURS[law], linewidth=1.6)
            left.plot(place + at, middle, "o", color=COLOURS[law], markersize=4)
    left.set_xticks(range(len(CASES)), [f"{c}\n{u:g} V\n{g:.2f} mm" for c, (u, g) in CASES.items()])
    left.set(ylabel="median force of the eleven (mN)", ylim=(0, None))
    panel_letter(left, "a")
    names = list(reversed(SHOWN))
    place = np.arange(len(names))
    for law, at in (("kaczmarek", 0.2), ("strong_troxel", -0.2)):
        right.barh(place + at, [ranks[law, "HVLD"][name] for name in names], 0.36, color=COLOURS[law])
    right.axvline(0.0, color=COLOURS["neutral"], linewidth=0.8)
    right.set_yticks(place, [SHOWN[name] for name in names], fontsize="small")
    right.set(xlabel="rank correlation with the force, HVLD", xlim=(-1, 1))
    panel_letter(right, "b")
    figure.legend(handles=_handles(), loc="outside lower center", ncols=3, fontsize="small")
    return figure


def _handles() -> list[Any]:
    from matplotlib.patches import Patch

    measured = Patch(color=COLOURS["measured"], label="measured median, 93.5 % interval")
    laws = [
        Patch(facecolor=COLOURS[law], alpha=0.7, label=f"{LABELS[law]}, line: 5 to 95 %")
        for law in ("kaczmarek", "strong_troxel")
    ]
    return [measured, *laws]
