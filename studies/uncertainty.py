"""How sure are Fig. 5's closed forms? 500 samples of what was measured or assumed.

The closed forms are (8a), (8b) with (24), the rigid smooth ellipsoid of each participant by quadrature. They
are adequate because the fingers hover: nothing touches. What deformation and ridges change is a few per cent,
which `participants` computes.

Each sample has one value of every input for all participants (an instrument that is off is off for all); the
answer is the median over the eleven, as Fig. 5 has it. Latin hypercube, fixed seed. Expected: the air gap
matters most, then the stratum corneum (Kaczmarek alone) and the inclination; the permittivity of skin does
not matter; Kaczmarek's law lies within the measured medians' intervals, Strong-Troxel's above them.
"""

from typing import Any

import numpy as np

import evfem as ev
from evfem.electrostatics.forces import EllipsoidalPad, pad_force

from .common import CASES, LAWS, Floats, Series, Study, median_interval, participants
from .plots import COLOURS, LABELS, Figure, panels

COUNT, SEED = 500, 5
#: what varies, and how the figure calls it (s: standard deviation)
GIVEN: dict[str, tuple[ev.Uniform | ev.Normal, str]] = {
    "gap_error": (ev.Uniform(-0.05, 0.05), "air gap, ±0.05 mm"),
    "voltage_factor": (ev.Uniform(0.99, 1.01), "voltage, ±1 %"),
    "stratum_corneum": (ev.Uniform(0.27, 0.49), "stratum corneum, 0.27-0.49 mm"),
    "stratum_corneum_eps_r": (ev.Uniform(1000.0, 10000.0), "its permittivity, 1000-10000"),
    "insulator": (ev.Uniform(0.0855, 0.0945), "insulator, 0.09 mm ±5 %"),
    "insulator_eps_r": (ev.Uniform(3.0, 3.7), "its permittivity, 3.0-3.7"),
    "width_error": (ev.Normal(0.0, 0.3, between=(-0.9, 0.9)), "finger width, s 0.3 mm"),
    "height_error": (ev.Normal(0.0, 0.3, between=(-0.9, 0.9)), "finger height, s 0.3 mm"),
    "length_error": (ev.Normal(0.0, 0.3, between=(-0.9, 0.9)), "finger length, s 0.3 mm"),
    "inclination": (ev.Normal(30.0, 3.0, between=(21.0, 39.0)), "inclination, s 3 deg"),
}
INPUTS = {name: one for name, (one, _) in GIVEN.items()}
SHOWN = {name: said for name, (_, said) in GIVEN.items()}
ASSUMPTIONS = {
    "stratum corneum": "0.27 to 0.49 mm as in Fig. 10, permittivity 1000 to 10000 as in Fig. 7; uniform",
    "other spreads": "assumed, the paper states none: see the labels of the figure (s: standard deviation)",
    "independent": "inputs vary independently; one value for all participants",
    "model": "rigid smooth ellipsoid over the rectangle; deformation and ridges are left out",
}


def main(quick: bool = False) -> Study:
    """Distribution of the median force by both laws in each case, and what it depends on."""
    samples = ev.Samples(INPUTS, 60 if quick else COUNT, SEED)
    drawn = samples.draw()
    medians = {(law, case): np.median(forces(drawn, law, case), axis=1) for law in LAWS for case in CASES}
    ranks = {key: _rank_correlations(drawn, values) for key, values in medians.items()}
    numbers = _numbers(medians, ranks)
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
    return Study("uncertainty", numbers, {}, ASSUMPTIONS, series, lambda: _draw(medians, ranks), parameters)


def forces(drawn: dict[str, Floats], law: str, case: str) -> Floats:
    """Forces in mN, (samples, participants)."""
    voltage, gap = CASES[case]
    one = {name: values[:, None] for name, values in drawn.items()}
    table = participants()
    length = (table["c"] + one["length_error"]) * np.cos(np.radians(one["inclination"]))
    pads = EllipsoidalPad(table["a"] + one["width_error"], table["b"] + one["height_error"], length)
    gaps, voltages = gap + one["gap_error"], voltage * one["voltage_factor"]
    skin = ev.Layer(one["stratum_corneum"], one["stratum_corneum_eps_r"])
    layers = ev.Layers.of(skin, ev.Layer(one["insulator"], one["insulator_eps_r"]))
    return 1e3 * pad_force(LAWS[law], pads, gaps, voltages, layers)


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
    from matplotlib.patches import Patch

    figure, (left, right) = panels(4.4, 2, 8.4, width_ratios=[1.0, 0.9])
    for place, case in enumerate(CASES):
        low, high, _ = median_interval(participants()[case])
        look = {"color": COLOURS["measured"], "linewidth": 5, "solid_capstyle": "butt"}
        left.plot([place - 0.3] * 2, [low, high], **look)
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
    names = list(reversed(SHOWN))
    place = np.arange(len(names))
    for law, at in (("kaczmarek", 0.2), ("strong_troxel", -0.2)):
        right.barh(place + at, [ranks[law, "HVLD"][name] for name in names], 0.36, color=COLOURS[law])
    right.axvline(0.0, color=COLOURS["neutral"], linewidth=0.8)
    right.set_yticks(place, [SHOWN[name] for name in names], fontsize="small")
    right.set(xlabel="rank correlation with the force, HVLD", xlim=(-1, 1))
    handles = [Patch(color=COLOURS["measured"], label="measured median, 93.5 % interval")]
    for law in ("kaczmarek", "strong_troxel"):
        label = f"{LABELS[law]}, line: 5 to 95 %"
        handles.append(Patch(facecolor=COLOURS[law], alpha=0.7, label=label))
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize="small")
    return figure
