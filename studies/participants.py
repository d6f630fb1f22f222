"""Eleven participants, two laws, three hover cases by finite elements, as one sweep; measurements
beside it.

Each participant has a finger of his or her own (`FingerPad.participant`): width and height a_i,
b_i of Table 1, bone, nail and the layers below the stratum corneum scaled with it from Table 2's
finger; stratum corneum, ridges and moduli are Table 2's. The bone is held, the tissue deforms. A
plane model gives N/mm: the force in mN is that times the width out of the plane over which a
rigid, smooth ellipsoid of the participant's axes (8a), (8b), (24) has the same force as its
cross-section alone. So what differs from the closed forms of Fig. 5 is what deformation and ridges
do. Expected: together they take away 2 to 6 %, about the same for everybody (ridges more,
deformation gives some back), so that the closed forms' differences from the measured forces, up to
a factor of three for fingers of the same size, are not theirs to explain.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import evfem as ev
from evfem.electrostatics.forces import pad_force, pad_force_per_depth

from .common import (
    CASES,
    COLOURS,
    LABELS,
    LAWS,
    Figure,
    Floats,
    Series,
    Study,
    new_figure,
    panel_letter,
    participants,
    table2_layers,
)
from .measured import participant_forces, participant_pads

ASSUMPTIONS = {
    "fingers": "width a_i and height b_i; nail, bone, epidermis and dermis scaled with a_i / 16.68 mm",
    "width out of the plane": "rigid smooth ellipsoid over its cross-section; axes a_i, b_i, c_i cos 30 deg",
    "voltages": "HV = 2000 V, LV = 1414 V",
    "mesh": "coarse, 0.2 % below medium with Kaczmarek's law; quick: the first three participants",
}


def main(quick: bool = False, out: Path | None = None) -> dict[str, Any]:
    """Forces per participant, law and case by finite elements, beside the closed forms and those
    measured.
    """
    names = participants()["participant"][: 3 if quick else None]
    # few points: starting processes costs more than they save
    table = ev.sweep(plan(names), workers=1 if quick else None)
    forces = widths(len(names))
    for law, case in forces:
        chosen = [
            row["electrostatic_force.last"]
            for row in table.rows
            if (row["electrostatics.law"], row["case"]) == (law, case)
        ]
        forces[law, case] *= 1e3 * np.array(chosen)
    closed = {key: values[: len(names)] for key, values in participant_forces().items()}
    numbers = _numbers(names, forces, closed) | {"points": len(table.rows), "done": _done(table)}
    series = [
        Series(f"{kind} {law} {case}", names, values, "mN over participant")
        for kind, found in (("fe", forces), ("closed form", closed))
        for (law, case), values in found.items()
    ]
    series += [
        Series(f"measured {case}", names, participants()[case][: len(names)], "mN over participant")
        for case in CASES
    ]
    parameters = {"sweep": table.provenance["scene"], "grid": table.provenance["grid"]}
    return Study(
        "participants", numbers, {}, ASSUMPTIONS, series, lambda: _draw(names, forces, closed), parameters
    ).finish(out, quick)


def plan(names: list[str]) -> ev.Sweep:
    """The sweep: a coarse finger of Table 2 hovering over its display; laws, cases and
    participants.
    """
    values = ev.data.load("table2")
    scene = {
        "version": 1,
        "finger": {"resolution": "coarse"},
        "surface": {"kind": "flat", "friction": values.value("mu")},
        "electrostatics": {
            "law": "kaczmarek",
            "voltage": 2000.0,
            "insulator_thickness": values.value("d_i"),
            "insulator_eps_r": values.value("eps_i"),
        },
        "motion": [{"kind": "hover", "gap": 0.25}],
    }
    cases = {
        case: {"electrostatics.voltage": voltage, "motion.0.gap": gap}
        for case, (voltage, gap) in CASES.items()
    }
    grid = {"electrostatics.law": list(LAWS), "case": cases, "finger.participant": names}
    return ev.Sweep(scene, grid, outputs=("electrostatic_force.last", "min_gap.last"), name="participants")


def widths(count: int) -> dict[tuple[str, str], Floats]:
    """(law, case) -> width out of the plane in mm of each participant, from the rigid closed
    forms.
    """
    pads, layers = participant_pads(), table2_layers()
    found = {}
    for name, law in LAWS.items():
        for case, (voltage, gap) in CASES.items():
            ratio = pad_force(law, pads, gap, voltage, layers)
            found[name, case] = (ratio / pad_force_per_depth(law, pads, gap, voltage, layers))[:count]
    return found


def _done(table: ev.SweepResult) -> int:
    return sum(row["status"] == "done" for row in table.rows)


def _numbers(names: list[str], forces: dict[Any, Floats], closed: dict[Any, Floats]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for (law, case), values in forces.items():
        measured = participants()[case][: len(names)]
        key, change = f"{law}.{case}", values / closed[law, case] - 1.0
        found |= {f"{law}.{name}.{case}_mN": v for name, v in zip(names, values, strict=True)}
        found |= {
            f"{law}.median_mN.{case}": np.median(values),
            f"verdict.median_over_measured.{key}": np.median(values) / np.median(measured),
            f"verdict.change_from_closed_form_lowest.{key}": change.min(),
            f"verdict.change_from_closed_form_highest.{key}": change.max(),
            f"verdict.above_measured.{key}": int(np.sum(values > measured)),
            f"verdict.above_measured_closed_form.{key}": int(np.sum(closed[law, case] > measured)),
        }
    return found


def _draw(names: list[str], forces: dict[Any, Floats], closed: dict[Any, Floats]) -> Figure:
    figure = new_figure(5.6)
    axes = figure.subplots(3, 1, sharex=True)
    place = np.arange(len(names))
    for ax, (case, (voltage, gap)), letter in zip(axes, CASES.items(), "abc", strict=True):
        ax.plot(place, participants()[case][: len(names)], "D", color=COLOURS["measured"], markersize=5)
        for law, shift in (("kaczmarek", -0.14), ("strong_troxel", 0.14)):
            ax.plot(place + shift, forces[law, case], "o", color=COLOURS[law], markersize=5)
            ax.plot(
                place + shift, closed[law, case], "_", color=COLOURS[law], markersize=11, markeredgewidth=1.6
            )
        ax.set(ylabel="force (mN)", ylim=(0, None))
        ax.set_title(f"{case}: {voltage:g} V, {gap:.2f} mm", fontsize="medium")
        panel_letter(ax, letter)
        ax.grid(axis="y", linewidth=0.4, alpha=0.5)
    axes[-1].set_xticks(place, names)
    axes[-1].set_xlabel("participant")
    figure.legend(handles=_handles(), loc="outside lower center", ncols=3, fontsize="small")
    return figure


def _handles() -> list[Any]:
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], linestyle="", marker="D", color=COLOURS["measured"], label="measured")]
    for law in ("kaczmarek", "strong_troxel"):
        colour = COLOURS[law]
        label = f"{LABELS[law]}, finite elements"
        handles.append(Line2D([], [], linestyle="", marker="o", color=colour, label=label))
        handles.append(
            Line2D(
                [],
                [],
                linestyle="",
                marker="_",
                markersize=11,
                color=colour,
                label=f"{LABELS[law]}, closed form",
            )
        )
    return handles
