"""What README and gallery say of studies, in sentences with the numbers of their files."""

from __future__ import annotations

import re
import textwrap
from typing import Any

Found = dict[str, Any]


def fringe(found: Found) -> str:
    """What the columns miss, in sentences."""
    n, cases = found["numbers"], ("HVHD", "HVLD", "LVLD")
    ridged, columns, smooth, plain = (
        n[f"finger.{pad}.pressed.{field}_air_share"]
        for pad in ("ridged", "smooth")
        for field in ("full", "local")
    )
    full, measured = (
        [n[f"participants.{one}_median_mN.{case}"] for case in cases] for one in ("full", "measured")
    )
    over = [own / theirs for own, theirs in zip(full, measured, strict=True)]
    held = [n[f"participants.tilted_full_median_over_measured.{case}"] for case in cases]
    gain = max(abs(n[f"participants.gain_median.{case}"] - 1.0) for case in cases)
    flat, filling = n["spreading.smooth"], n["spreading.filled.smooth"]
    rough = [n[f"spreading.{kind}5um"] - 1.0 for kind in ("", "filled.")]
    return filled(
        f"Pressed at 0.05 N/mm, the ridged finger has {percent(ridged)} of its attraction beside the "
        f"contact, {percent(columns)} by columns; the smooth one {percent(smooth)} and {percent(plain)}.",
        f"Grooved skin that touches a touchscreen with 30 % of its face is pulled {flat:.1f} times as hard "
        f"as by columns, {filling:.1f} times if its layer fills the ridges, and {percent(min(rough))} to "
        f"{percent(max(rough))} harder between rough faces 5 um apart.",
        f"At Table 1's fingers ridges change the medians of (8a) by {percent(gain)} at most, which remain "
        f"{min(over):.1f} to {max(over):.1f} times the measured ones; held at 30 degrees they are "
        f"{min(held):.2f} to {max(held):.2f} times these.",
    )


def fingertip(found: Found) -> str:
    """The whole pad beside Adams' laws and Table 1, in sentences."""
    n = found["numbers"]
    areas = [rf"verdict\.{one}_over_adams" for one in (r"smooth\.gross", r"ridged\.ridge")]
    laws = [rf"verdict\.ridged\.{law}\.median_over_measured" for law in ("kaczmarek", "strong_troxel")]
    held, troxel_held = (
        spread(n, rf"verdict\.held\.{law}\.median_over_measured") for law in ("kaczmarek", "strong_troxel")
    )
    gross, ridge, kaczmarek, troxel, width = (spread(n, key) for key in (*areas, *laws, r"width_mm\."))
    gains = {
        key: n[key] / n["variant.smooth.area_mm2"] - 1.0 for key in n if re.match(r"variant\..+area", key)
    }
    half = gains.pop("variant.all moduli x 0.5.area_mm2")
    wanted, other = n["variant.wanted_over_unchanged"] - 1.0, max(gains.values())
    return filled(
        f"From 0.05 to 1 N Table 2's pad touches {gross} of Adams' gross area and {ridge} of his ridge area; "
        f"half of all moduli add {percent(half)} at 0.5 N where {percent(wanted)} are wanted, no other "
        f"single change more than {percent(other)}.",
        f"A cross-section has the same force over {width} mm.",
        f"Hovering ridged pads have {kaczmarek} of the measured medians by Kaczmarek's law and {troxel} by "
        f"Strong and Troxel's; smooth ones held at 30 degrees, as they were, {held} and {troxel_held}.",
    )


def fingerprint(found: Found) -> str:
    """What prints do to stiffness, in a sentence."""
    stiff = {key: value for key, value in found["numbers"].items() if key.endswith("stiffness_N_per_mm")}
    ridged, smooth = (
        1.0 - stiff[f"{one}.x.stiffness_N_per_mm"] / stiff[f"{one}.z.stiffness_N_per_mm"]
        for one in ("along", "smooth")
    )
    softer = {
        f"{one}.{way}": 100.0 * (1.0 - stiff[f"{one}.{way}.stiffness_N_per_mm"] / own)
        for way in "xz"
        for own in [stiff[f"smooth.{way}.stiffness_N_per_mm"]]
        for one in ("whorl", "loop", "arch")
    }
    return filled(
        f"Parallel ridges are {percent(ridged)} softer across than along themselves, a smooth pad by "
        f"{percent(smooth)} already; curved ones are {spread(softer, '')} % softer than the smooth pad."
    )


def parameters(found: Found) -> str:
    """Which parameters decide, in sentences."""
    n, soft = found["numbers"], "finger.materials.hypodermis."
    load, moduli = (n[f"rest.normal_force.{soft}{one}"] for one in ("nu", "E"))
    partial, friction, slip = (
        n[f"{state}.tangential_force.{key}"]
        for state, key in (
            ("partial slip", f"{soft}E"),
            ("partial slip", "surface.friction"),
            ("full slip", "surface.friction"),
        )
    )
    insulator, skin = (
        n[f"rest.electrostatic_force.{key}"]
        for key in ("electrostatics.insulator_thickness", "finger.stratum_corneum_thickness")
    )
    return filled(
        f"The hypodermis decides the normal force (Poisson's ratio {load:.1f}, modulus {moduli:.1f}) and, by "
        f"its modulus, the tangential force in partial slip ({partial:.2f}).",
        f"Friction then counts for {friction:.2f}, because the soft layers take up the displacement, and for "
        f"{slip:.2f} in full slip.",
        "The attraction goes with the square of the voltage, and nearly inversely with the thickness of "
        f"insulator ({insulator:.1f}) and stratum corneum ({skin:.1f}).",
    )


def soft(found: Found) -> str:
    """A soft display beside a rigid one, in a sentence."""
    n, thick = found["numbers"], "E_0.1MPa.h_8mm"
    gains = (
        n[f"{thick}.{name}"] / n[f"rigid.{name}"] - 1.0
        for name in ("electrostatic_force", "tangential_force")
    )
    pull, friction = map(percent, gains)
    return filled(
        f"On 8 mm of 0.1 MPa the contact is {n[f'{thick}.contact_width']:.2f} mm wide, on a rigid display "
        f"{n['rigid.contact_width']:.2f} mm; the attraction is {pull} larger, friction {friction}."
    )


def moisture(found: Found) -> str:
    """What the voltage adds beside a film of water, in a sentence."""
    gains = (found["numbers"][f"250Hz.{film}um.gain_percent"] for film in (0, 2, 10))
    dry, thin, thick = (f"{gain:.0f} %" for gain in gains)
    return filled(
        f"At 250 Hz the voltage adds {dry} without a film, {thin} with one of 2 µm, {thick} with one of "
        "10 µm."
    )


def readme_why(peers: Found) -> str:
    """README's answer to why not in another package."""
    n = peers["numbers"]
    other, own = (f"B.L2.{name}" for name in ("fenicsx_q2", "evfem_q2p1"))
    times = n[f"{other}.cpu_s"] / n[f"{own}.cpu_s"]
    return filled(
        f"FEniCSx takes {short(times)} times the CPU time for the [benchmark](docs/performance.md)'s slide, "
        f"{short(n[f'{other}.cpu_s'])}\xa0s at an error of {worst(n, other):.2f}\xa0%; evfem takes "
        f"{short(n[f'{own}.cpu_s'])}\xa0s at {worst(n, own):.2f}\xa0%, of a reference known to 0.2\xa0%.",
        width=88,
    ).replace("\xa0", " ")


def worst(numbers: Found, key: str) -> float | None:
    """The largest error of a run's forces (%), None where there is no reference or no run."""
    errors = [abs(v) for name, v in numbers.items() if name.startswith(f"{key}.error_percent.")]
    return max(errors, default=None)


def percent(share: float) -> str:
    """A share in per cent, without digits behind the point."""
    return f"{100.0 * share:.0f} %"


def spread(numbers: Found, pattern: str) -> str:
    """From the smallest to the largest of the numbers whose names begin so."""
    values = [value for key, value in numbers.items() if re.match(pattern, key)]
    return f"{short(min(values))} to {short(max(values))}"


def filled(*sentences: str, width: int = 99) -> str:
    """Sentences in lines that fit, each beginning a line."""
    return "\n".join(textwrap.fill(one, width, break_on_hyphens=False) for one in sentences) + "\n"


def short(value: float | None) -> str:
    """Two digits, or three above 100; a dash without a value."""
    if value is None:
        return "-"
    return f"{value:.0f}" if value >= 10.0 else f"{value:.2g}"
