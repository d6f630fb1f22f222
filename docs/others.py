"""What the page on measurements of others says, from the file of the study `measured`."""

from __future__ import annotations

import re
import textwrap
from typing import Any

import numpy as np
from sentences import Found, filled, short

from evfem.studies.common import markdown

#: words of an experiment, and how the page calls them
SAID = {
    "conditions": "Known",
    "assumed": "Assumed",
    "fitted": "Fitted elsewhere",
    "reason": "Why",
    "sceptic": "A sceptic",
    "answer": "The answer",
}
#: the row of a threshold's level
LEVEL = "threshold.half_mil"
#: the same over the area of the package's own pad
OWN = "threshold_by_fingertip.half_mil"


def rows_of(found: Found) -> list[dict[str, Any]]:
    """The rows with their numbers, in the order of the page."""
    n, kept = found["numbers"], []
    for one in found["assumptions"]["experiments"]:
        for row in one["rows"]:
            start = f"{row['name']}."
            own = {key.removeprefix(start): value for key, value in n.items() if key.startswith(start)}
            kept.append(row | own)
    return kept


def lead(found: Found) -> str:
    """What the table shows, in sentences."""
    ratios = {row["name"]: row["ratio"] for row in rows_of(found)}
    far = [f"`{name}`" for name, ratio in ratios.items() if not 1 / 3 < ratio < 3]
    tilted, flat, tops = (
        [between(ratios, rf"hover_{how}\.{law}") for law in ("strong_troxel", "kaczmarek")]
        for how in ("30deg", "flat", "flatter")
    )
    area, wide = (between(ratios, rf"gross_area{end}\.") for end in ("", "_flatter"))
    level = ratios[LEVEL]
    return filled(
        f"{met(ratios)}, which is no rate of hits; farther off than a factor of three are {', '.join(far)}.",
        f"Hovering fingers do not choose a law: held at 30 degrees, as they were, they would have "
        f"{tilted[0]} of the measured medians by Strong and Troxel's law and {tilted[1]} by Kaczmarek's; "
        f"laid flat, {flat[0]} and {flat[1]}.",
        f"Table 2's ellipsoid touches {area} of the measured area, and the power of the load is "
        f"{ratios['load_index.gross']:.2f} times the measured one; a flatter pad of the same axes has {wide} "
        f"and {ratios['load_index_flatter.gross']:.2f}, and hovers with {tops[0]} and {tops[1]}.",
        f"A gap of 2.6 um, from the ratio of two thresholds alone, gives {level:.2f} of their level with a "
        f"Weber fraction that others measured; without a gap Strong and Troxel's attraction on a touchscreen "
        f"is {short(ratios['meyer.strong_troxel'])} times the measured one.",
        "The area in slip changes by less than meshes differ, so its sign is not resolved; under a voltage "
        "its sign is wrong.",
        "No law that is quadratic in the voltage has the powers above two of hovering fingers and below two "
        "of clutches.",
    )


def met(ratios: dict[str, float]) -> str:
    """How many rows are near."""
    near = sum(1 / 1.5 < ratio < 1.5 for ratio in ratios.values())
    return (
        f"Of {len(ratios)} rows (two laws and three fingers of the hovering forces, three rows of a clutch "
        f"and one of another model among them) {near} are met within a factor of 1.5"
    )


def readme(found: Found) -> str:
    """The same in README, with forces, thresholds and the area of contact."""
    ratios = {row["name"]: row["ratio"] for row in rows_of(found)}
    forces = {law: between(ratios, rf"hover_30deg\.{law}") for law in ("strong_troxel", "kaczmarek")}
    (error,) = (row["predicted_error"] / row["predicted"] for row in rows_of(found) if row["name"] == LEVEL)
    return filled(
        f"{met(ratios)}; the page says which are predictions.",
        f"With fingers held as they were, Strong and Troxel's law has {forces['strong_troxel']} of the "
        f"measured hovering forces (medians) and Kaczmarek's {forces['kaczmarek']}; thresholds, with "
        f"a gap fitted to their ratio and a measured area, agree within the prediction's own error of "
        f"{100.0 * error:.0f}\xa0% if the published voltages are effective; over the package's own pad they "
        f"are {ratios[OWN]:.1f} times as large.",
        f"What misses is said too: the default ellipsoid touches {between(ratios, r'gross_area[.]')} of the "
        "measured area, and the attraction on a touchscreen is known from three times more to six times "
        "less, as the gap is.",
        width=88,
    ).replace("\xa0", " ")


def between(ratios: dict[str, float], pattern: str) -> str:
    """From the smallest to the largest of the ratios whose names begin so."""
    values = [value for key, value in ratios.items() if re.match(pattern, key)]
    return f"{min(values):.2f} to {max(values):.2f}"


def table(found: Found) -> str:
    """Row, prediction with its error, measured value with its scatter, ratio."""
    lines = []
    for row in rows_of(found):
        unit = "" if row["unit"] == "1" else f" {row['unit']}"
        scatter = (
            f" ({row['measured_low']:.3g} to {row['measured_high']:.3g})" if "measured_low" in row else ""
        )
        ratio = f"{row['ratio']:.2f}" if row["ratio"] < 10.0 else f"{row['ratio']:.0f}"
        predicted = number(row["predicted"], row["predicted_error"])
        lines.append([f"`{row['name']}`", predicted, f"{row['measured']:.3g}{scatter}{unit}", ratio])
    return "\n".join(markdown(["row", "predicted", "measured", "ratio"], lines)) + "\n"


def number(value: float, error: float) -> str:
    """A value with three digits, and its error with two, a large one as a factor."""
    if error > 0.3 * value:
        return f"{value:.3g}, factor {short(float(np.exp(error / value)))}"
    return f"{value:.3g} ± {short(error)}" if error else f"{value:.3g}"


def signs(found: Found) -> str:
    """Directions: the predicted change beside the published word."""
    n, lines = found["numbers"], []
    for one in found["assumptions"]["experiments"]:
        for sign in one["signs"]:
            change, error = (100.0 * n[f"{sign['name']}.{key}"] for key in ("predicted", "predicted_error"))
            said = f"{change:+.1f} %" + (f", meshes differ by {error:.1f} %" if error else "")
            lines.append([f"`{sign['name']}`", said, sign["measured"]])
    return "\n".join(markdown(["row", "predicted", "measured"], lines)) + "\n"


def words(found: Found) -> str:
    """A section for each publication: rows, conditions, what was assumed, why, objection and answer."""
    blocks = []
    for one in found["assumptions"]["experiments"]:
        doi = f", [doi](https://doi.org/{one['doi']})" if one["doi"] else ""
        blocks.append(f"### {one['title']}\n\n" + filled(f"{one['source']}{doi}; read: {one['read']}."))
        blocks.append("\n".join(item(f"`{name}`: {what}.") for what, name in whats(one).items()))
        blocks.append("\n".join(item(f"*{SAID[key]}*: {one[key]}") for key in SAID))
    left = found["assumptions"]["left_out"]
    blocks.append("## Left out\n\n" + "\n".join(item(f"{who}: {why}.") for who, why in left.items()))
    return "\n\n".join(block.rstrip("\n") for block in blocks) + "\n"


def whats(one: dict[str, Any]) -> dict[str, str]:
    """What the rows of a publication are, and their name, or what the names of several begin with."""
    found: dict[str, list[str]] = {}
    for row in one["rows"] + one["signs"]:
        found.setdefault(row["what"], []).append(row["name"])
    return {what: names[0] if len(names) == 1 else names[0].split(".")[0] for what, names in found.items()}


def item(text: str) -> str:
    """An entry of a list in lines that fit."""
    return textwrap.fill(f"- {text}", 99, subsequent_indent="  ", break_on_hyphens=False)
