"""Attraction over the frequency of the voltage, and what published experiments say beside it.

Plates with the insulator of a touchscreen, a gap of 1 um and 0.30 mm of stratum corneum under 100 V peak:
mean pressure over the frequency for four skins and for three conductivities of the gap, a square wave beside
a sine of the same amplitude, and the step of a direct voltage. Statements of experiments stand in the numbers
as `published.WHO.WHAT`, what the model gives under the same name with `model.`; both are kept where they
disagree. The conductivity of the gap is a parameter that nobody has measured.

Expected: the gap discharges below a corner of tens to hundreds of hertz, the skin is a conductor below
kilohertz and alone gives no corner below; a square wave fluctuates more than a sine below about 190 Hz and
less above it; a step rises before it decays.
"""

from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.electrostatics import alternating
from evfem.electrostatics.dielectrics import SKINS
from evfem.electrostatics.laws import TOUCHSCREEN, Layers, StrongTroxel, eps_0

from .common import Series, Study
from .plots import COLOURS, Figure, panels

GAP, PEAK, THICKNESS = 0.001, 100.0, 0.30  # mm, V, mm
LEAKS = (0.0, 1e-8, 1e-7)  # S/m
LEAK = 1e-8
LEAKY = {"insulator": TOUCHSCREEN, "gap_conductivity": LEAK}
#: dry skin at 1 kHz, as a step and the corners take it
CONSTANTS = {"skin_eps_r": 1136.0, "skin_conductivity": 2e-4, "skin_thickness": THICKNESS}
#: Rauf and Follmer (2025), doi:10.1016/j.eml.2025.102382: shear capacity (kPa) of an electroadhesive clutch
VOLTS = (150.0, 200.0, 250.0, 300.0)
CLUTCH = {"DC": (2.05, 3.45, 5.71, 6.92), "100 Hz": (1.96, 4.00, 5.04, 6.25)}
CLUTCH["10 kHz"] = (1.27, 2.47, 3.28, 3.94)
LINES = ("#000000", COLOURS["strong_troxel"], COLOURS["kaczmarek"], COLOURS["fe"])
ASSUMPTIONS = {
    "plate": "100 V peak, gap 1 um, insulator 1 um / 3.9, stratum corneum 0.30 mm",
    "skins": "measured on forearms, none on the stratum corneum of a fingertip",
    "gap conductivity": "assumed: 0, 1e-8 and 1e-7 S/m; no measured value is known",
    "AliAbbasi et al., doi:10.1109/TOH.2022.3152030": "leakage dominates below 250 Hz, skin above; agrees "
    "in kind, and in number for the conductivity in model.aliabbasi.gap_conductivity_S_per_m",
    "Meyer et al. (2013)": "an RC model of skin and insulator misses the frequency dependence; agrees: "
    "without a leaking gap the only corner is the skin's",
    "Shultz, Peshkin, Colgate, IEEE Haptics Symposium (2018)": "sliding raises the impedance by 100 to "
    "1000 %; agrees for gaps of about half a micrometre and more",
    "Vardar et al. (2017), doi:10.1109/TOH.2017.2704603": "square waves feel stronger than sines below "
    "60 Hz and equal above; the direction follows from leakage, the equality above 60 Hz does not",
    "Nakamura and Yamamoto (2017), doi:10.1186/s40648-017-0085-3": "after a step the force rises, then "
    "decays; agrees in kind",
    "Rauf and Follmer (2025), doi:10.1016/j.eml.2025.102382": "an electroadhesive clutch, no finger: "
    "compared are the exponent of the voltage, and whether the loss from 100 Hz to 10 kHz depends on it; "
    "the model's loss is that of the plate above with dry skin and no leak, not of the clutch's own layers",
}


def main(quick: bool = False) -> Study:
    """The curves, the statements and their numbers, and a figure of six panels."""
    frequency = np.geomspace(1.0, 1e5, 41 if quick else 241)
    curves = {f"skin {name}": _mean(frequency, name, LEAK) for name in SKINS}
    curves |= {f"leak {leak:g} S/m": _mean(frequency, "gabriel_dry", leak) for leak in LEAKS}
    swings = _fluctuations(frequency)
    time = np.geomspace(1e-6, 0.1, 61 if quick else 301)
    step = 1e6 * alternating.step_pressure(time, GAP, PEAK, **CONSTANTS, **LEAKY)
    numbers = _numbers(swings, frequency) | _statements(time, step)
    series = [Series(name, frequency, y, "Pa over Hz") for name, y in curves.items()]
    series += [Series(f"{name} wave", frequency, y, "Pa over Hz") for name, y in swings.items()]
    series.append(Series("step", time, step, "Pa over s"))
    series += [Series(f"clutch {name}", VOLTS, y, "kPa over V") for name, y in CLUTCH.items()]
    given, picture = {"gap_mm": GAP, "peak_V": PEAK}, lambda: _draw(frequency, curves, swings, (time, step))
    return Study("frequency", numbers, {}, ASSUMPTIONS, series, picture, given)


def _mean(frequency: Any, skin: str, leak: float) -> Any:
    """Mean pressure in Pa under a sine."""
    given = {"skin": skin, "skin_thickness": THICKNESS, "insulator": TOUCHSCREEN}
    rms = PEAK / np.sqrt(2.0)
    return 1e6 * alternating.alternating_pressure(GAP, rms, frequency, **given, gap_conductivity=leak)


def _fluctuations(frequency: Floats) -> dict[str, Floats]:
    """Mean and standard deviation of the pressure over the cycle (Pa), skin shorted, by waveform."""
    metal = {"skin": 1.0, "skin_thickness": 0.0} | LEAKY
    sine = 1e6 * alternating.alternating_pressure(GAP, PEAK / np.sqrt(2.0), frequency, **metal)
    square = 1e6 * alternating.square_wave_pressure(frequency, GAP, PEAK, **LEAKY)
    full = 1e6 * StrongTroxel().traction(GAP, PEAK, Layers.of(TOUCHSCREEN))
    tau = eps_0 * (1.0 + GAP * 3.9 / 0.001) / LEAK
    a = 1.0 / (2.0 * frequency * tau)
    square_of_it = full**2 * (2.0 / (1.0 + np.exp(-a))) ** 4 * -np.expm1(-4.0 * a) / (4.0 * a)
    spread = np.sqrt(np.maximum(square_of_it - square**2, 0.0))
    return {
        "mean of a sine": sine,
        "mean of a square": square,
        "fluctuation of a sine": sine / np.sqrt(2.0),  # p (1 + cos): its standard deviation
        "fluctuation of a square": spread,
    }


def _numbers(swings: dict[str, Floats], frequency: Floats) -> dict[str, float]:
    """Pressures at some frequencies, corners, and the square wave beside the sine."""
    numbers = {}
    for f in (1.0, 10.0, 250.0, 1e3, 1e4, 1e5):
        for skin in SKINS:
            numbers[f"mean_Pa.{skin}.{f:g}_Hz"] = _mean(f, skin, LEAK)
        for leak in LEAKS:
            numbers[f"mean_Pa.leak_{leak:g}.{f:g}_Hz"] = _mean(f, "gabriel_dry", leak)
    at = np.array([15.0, 60.0, 1920.0])
    found = _fluctuations(at)
    for i, f in enumerate(at):
        for name, values in found.items():
            numbers[f"{name.replace(' ', '_')}_Pa.{f:g}_Hz"] = values[i]
    ratio = swings["fluctuation of a square"] / swings["fluctuation of a sine"]
    numbers["square_over_sine.equal_at_Hz"] = float(np.exp(np.interp(0.0, -np.log(ratio), np.log(frequency))))
    return numbers


def _statements(time: Floats, step: Floats) -> dict[str, float]:
    """What experiments state, and what the model gives."""
    corners = alternating.corner_frequencies(GAP, **CONSTANTS, **LEAKY)
    found = _fluctuations(np.array([15.0, 60.0, 480.0]))
    over = found["fluctuation of a square"] / found["fluctuation of a sine"]
    skin = {"skin": "gabriel_dry", "skin_thickness": THICKNESS, "insulator": TOUCHSCREEN}
    none = abs(alternating.complex_length(1e3, **skin))
    dc, slow, fast = (np.array(CLUTCH[name]) for name in CLUTCH)
    exponents = [float(np.polyfit(np.log(VOLTS), np.log(y), 1)[0]) for y in (dc, slow, fast)]
    return {
        "published.aliabbasi.corner_Hz": 250.0,
        "model.aliabbasi.corner_Hz": corners[0],
        "model.aliabbasi.gap_conductivity_S_per_m": LEAK * 250.0 / corners[0],
        "model.meyer.skin_corner_Hz": corners[1],
        "published.shultz.impedance_of_sliding_over_rest_least": 2.0,
        "published.shultz.impedance_of_sliding_over_rest_most": 11.0,
        "model.shultz.impedance_with_0.5_um_over_none": (none + 0.0005) / none,
        "model.shultz.impedance_with_2.5_um_over_none": (none + 0.0025) / none,
        "model.vardar.square_over_sine.15_Hz": over[0],
        "model.vardar.square_over_sine.60_Hz": over[1],
        "model.vardar.square_over_sine.480_Hz": over[2],
        "model.nakamura.largest_over_first": float(step.max() / step[0]),
        "model.nakamura.largest_at_s": float(time[np.argmax(step)]),
        "model.nakamura.half_at_s": float(np.interp(-0.5, -step[np.argmax(step) :] / step.max(),
                                                    time[np.argmax(step) :])),
        **{f"published.rauf.exponent.{name.replace(' ', '_')}": exponent
           for name, exponent in zip(CLUTCH, exponents, strict=True)},
        "model.rauf.exponent": 2.0,
        "model.rauf.fast_over_slow": _mean(1e4, "gabriel_dry", 0.0) / _mean(100.0, "gabriel_dry", 0.0),
        "published.rauf.fast_over_slow_least": float((fast / slow).min()),
        "published.rauf.fast_over_slow_most": float((fast / slow).max()),
    }  # fmt: skip


def _draw(
    frequency: Floats, curves: dict[str, Any], swings: dict[str, Floats], step: tuple[Floats, Floats]
) -> Figure:
    figure, axes = panels(7.6, 2, rows=3)
    axes = axes.reshape(3, 2)
    for ax, kind in zip(axes[0], ("skin ", "leak "), strict=True):
        names = [name for name in curves if name.startswith(kind)]
        for name, colour, dash in zip(names, LINES, ("-", "-", "--", ":"), strict=False):
            label = name.removeprefix(kind)
            ax.loglog(frequency, curves[name], color=colour, linestyle=dash, label=label)
        ax.set(xlabel="frequency (Hz)", ylabel="mean pressure (Pa)", ylim=(10.0, 4e4))
        ax.legend(fontsize="small", title=f"{kind.strip()}{'' if kind == 'skin ' else ' of the gap'}")
    for ax, what in zip(axes[1], ("mean", "fluctuation"), strict=True):
        for wave, colour in (("sine", COLOURS["kaczmarek"]), ("square", COLOURS["strong_troxel"])):
            ax.semilogx(frequency, swings[f"{what} of a {wave}"], color=colour, label=wave)
        ax.set(xlabel="frequency (Hz)", ylabel=f"{what} (Pa)")
        ax.legend(fontsize="small")
    axes[1, 1].axvspan(frequency[0], 60.0, color=COLOURS["measured"], alpha=0.12)
    axes[1, 1].text(1.2, 2.0e4, "square feels\nstronger:\nVardar 2017", fontsize="xx-small")
    axes[2, 0].semilogx(1e3 * step[0], step[1], color="black")
    axes[2, 0].set(xlabel="time after a step (ms)", ylabel="pressure (Pa)")
    clutch, volts = axes[2, 1], np.linspace(0.0, 320.0, 81)
    for (name, y), colour in zip(CLUTCH.items(), LINES[1:], strict=True):
        clutch.plot(VOLTS, y, "o", color=colour, label=name)
        clutch.plot(volts, np.exp(np.mean(np.log(y) - 2.0 * np.log(VOLTS))) * volts**2, color=colour)
    clutch.set(xlabel="voltage (V)", ylabel="shear capacity (kPa)", xlim=(0.0, 320.0))
    clutch.legend(fontsize="small", title="clutch; lines: U squared")
    return figure
