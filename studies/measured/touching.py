"""Fingers that touch a display: thresholds with two films, Meyer's force, the clutch's powers of the voltage,
the impedance of a finger that slides, and the corner of leakage.
"""

from dataclasses import replace
from typing import Any

import numpy as np

import evfem as ev
from evfem import data
from evfem.common.arrays import Floats
from evfem.electrostatics import contact_impedance, corner_frequencies, eps_0
from evfem.electrostatics.forces import effective_thickness_from_thresholds, plate_force

from ..common import LAWS, area_law
from .table import Experiment, Row, spread, together

LOADS = (0.2, 0.5, 1.0)  # N, the load that nobody wrote down; the middle one is predicted for
LOAD = LOADS[1]
THRESHOLDS, MEYER = data.load("thresholds"), data.load("meyer")
FILMS = {"half_mil": ("d_i2", "U_2"), "one_mil": ("d_i3", "U_3")}
SKIN_SERIES = MEYER.value("d_sc") / 1650.0  # mm, of the skin alone
SKIN: dict[str, Any] = {"skin": "gabriel_dry", "skin_thickness": 0.3, "insulator": ev.TOUCHSCREEN}
#: skin, film and gap of row 10, with a conductivity that nobody has measured
CORNER: dict[str, Any] = {"skin_eps_r": 1136.0, "skin_conductivity": 2e-4, "skin_thickness": 0.3}
LEAK, FREQUENCY = 1e-8, 1e3


def others(key: str) -> dict[str, float]:
    """Measured value and its scatter."""
    table = data.load("others")
    return {name: table.value(key, name if name != "measured" else "value")
            for name in ("measured", "low", "high")}  # fmt: skip


def series_gap() -> float:
    """What is in series with the films at Strong and Troxel's thresholds (mm): from their ratio alone."""
    films = [ev.Layer(THRESHOLDS.value(key), THRESHOLDS.value("eps_i")) for key, _ in FILMS.values()]
    volts = THRESHOLDS.value("U_2"), THRESHOLDS.value("U_3")
    return float(effective_thickness_from_thresholds(volts, (films[0], films[1])))


def threshold(film: str, series: float, area: float, load: float) -> float:
    """Voltage (V) whose attraction adds Weber's fraction to the load, by Strong and Troxel's law."""
    total = series + THRESHOLDS.value(FILMS[film][0]) / THRESHOLDS.value("eps_i")
    wanted = others("weber")["measured"] * load
    return float(total * np.sqrt(2.0 * wanted / (eps_0 * area)))


def thresholds(areas: list[float]) -> Experiment:
    """Both films, with the gap from the ratio of the thresholds, without one, and over a fingertip's own
    area (mm2) by mesh.
    """
    gross, gap, rows = area_law("gross"), series_gap(), []
    for film, (_, measured) in FILMS.items():
        value = THRESHOLDS.value(measured)
        by_load = [threshold(film, gap, float(gross(one)), one) for one in LOADS]
        error = 0.5 * np.log(max(by_load) / min(by_load))
        own = [threshold(film, gap, area, LOAD) for area in areas]
        more = {"unit": "V", "measured": value, "law": "strong_troxel"}
        rows += [
            Row(f"threshold.{film}", "threshold with a gap in series, from the ratio of both",
                predicted=by_load[1], error=error, **more),
            Row(f"threshold_by_fingertip.{film}", "the same over the area that Table 2's pad has",
                predicted=own[-1], error=together(error, 0.5 * spread(areas)), **more),
            Row(f"threshold_without_gap.{film}", "threshold with skin alone in series",
                predicted=threshold(film, SKIN_SERIES, float(gross(LOAD)), LOAD), error=error, **more),
        ]  # fmt: skip
    return replace(STRONG, rows=tuple(rows))


def meyer() -> Experiment:
    """Attraction at 140 V by both laws without a gap, and by one with the gap of the thresholds."""
    film = ev.Layer(MEYER.value("d_i"), ev.TOUCHSCREEN.eps_r)
    skin = ev.Layer(MEYER.value("d_sc"), 1650.0)
    area, volts = MEYER.value("A"), MEYER.value("U")
    measured = {"unit": "N", "measured": MEYER.value("F_e"), "low": MEYER.value("F_e_min")}
    measured |= {"high": MEYER.value("F_e_max")}
    rows = []
    for law in LAWS:
        found = float(plate_force(LAWS[law], area, 0.0, volts, ev.Layers.of(skin, film)))
        rows.append(Row(f"meyer.{law}", "attraction at 140 V, skin and film alone", predicted=found,
                        error=meyer_error(law, 0.0), law=law, **measured))  # fmt: skip
    gap = series_gap() - SKIN_SERIES
    found = float(plate_force(LAWS["strong_troxel"], area, gap, volts, ev.Layers.of(skin, film)))
    rows.append(Row("meyer_with_gap.strong_troxel", "the same with the gap of the thresholds",
                    predicted=found, error=meyer_error("strong_troxel", gap), law="strong_troxel",
                    **measured))  # fmt: skip
    return replace(MEYERS, rows=tuple(rows))


def meyer_error(law: str, gap: float) -> float:
    """Relative standard error by what was assumed: area by a third, thickness of skin by a half, its
    permittivity by a factor of two, that of the film by a third.
    """

    def force(area: float = 1.0, skin: float = 1.0, eps: float = 1.0, film: float = 1.0) -> float:
        own = ev.Layer(skin * MEYER.value("d_sc"), eps * 1650.0)
        other = ev.Layer(MEYER.value("d_i"), film * ev.TOUCHSCREEN.eps_r)
        return float(plate_force(LAWS[law], area, gap, 1.0, ev.Layers.of(own, other)))

    changes = ({"area": 1.33}, {"skin": 1.5}, {"eps": 2.0}, {"film": 1.33})
    return together(*(float(np.log(force(**one) / force())) for one in changes))


def clutch() -> Experiment:
    """The power of the voltage in the shear capacity of a clutch."""
    rows = [
        Row(f"clutch.{kind}", f"power of the voltage, {said}", "1", 2.0, 0.0, **others(f"clutch_{kind}"))
        for kind, said in {"DC": "direct", "100Hz": "100 Hz", "10kHz": "10 kHz"}.items()
    ]
    return replace(RAUF, rows=tuple(rows))


def impedance(gap: Floats) -> Floats:
    """Size of the impedance of a gap (mm) in series with skin and film over that without a gap."""
    one, none = (contact_impedance(g, 1.0, FREQUENCY, **SKIN, gap_conductivity=LEAK) for g in (gap, 0.0))
    return np.abs(one / none)


def sliding() -> Experiment:
    """Impedance with the gap of the thresholds, which opens as the finger slides."""
    gap = series_gap() - SKIN_SERIES
    low, middle, high = impedance(np.array([0.5, 1.0, 2.0]) * gap)
    row = Row("sliding_impedance", "impedance sliding over at rest", "1", float(middle),
              float(0.5 * np.log(high / low)), **others("sliding_impedance"))  # fmt: skip
    return replace(SHULTZ, rows=(row,))


def leaking() -> Experiment:
    """The corner below which the gap leaks, for a conductivity that may be ten times more or less."""
    corner, _ = corner_frequencies(0.001, **CORNER, insulator=ev.TOUCHSCREEN, gap_conductivity=LEAK)
    row = Row("leakage_corner", "frequency below which leakage governs", "Hz", float(corner),
              float(np.log(10.0)), **others("leakage_corner"))  # fmt: skip
    return replace(ALIABBASI, rows=(row,))


STRONG = Experiment(
    title="Thresholds with two films",
    source="Strong and Troxel (1970)",
    doi="10.1109/TMMS.1970.299965",
    read="the abstract, and the numbers that the paper quotes",
    conditions="Films of 0.5 and 1.0 mil, permittivity 4.5, 200 Hz, one subject.",
    assumed="A load of 0.5 N (0.2 to 1 N in the error), Adams' gross area at it, and that what is felt is a "
    "change of friction by the Weber fraction of 0.11 that Gueorguiev et al. measured; that the voltages are "
    "effective ones (were they peaks, 0.71 of each would be).",
    fitted="what is in series with the films, as much as 2.75 um of air, to the ratio of the two thresholds: "
    "their level is predicted, their ratio is not. The rows without a gap have nothing fitted.",
    reason="2.6 um of air between rough faces, and skin that counts as 0.2 um of it, explain both voltages; "
    "5.5 mm of skin, as the paper has it, are not needed. Skin alone attracts so strongly that half to two "
    "thirds of the voltage would do.",
    sceptic="Three publications of three laboratories and an assumed load: agreement by chance is easy.",
    answer="The load enters weakly: five times the load raises the threshold by a half; from the assumed one "
    "that is a fifth to either side, the error given. The Weber fraction enters by its root. What would "
    "count against it is a gap measured far from 2 to 3 um.",
)
MEYERS = Experiment(
    title="Attraction on a touchscreen",
    source="Meyer, Peshkin and Colgate (2013)",
    doi="10.1109/WHC.2013.6548382",
    read="the abstract, and the numbers that the paper quotes",
    conditions="140 V effective at 10 kHz, insulator of 1 um; friction 0.3; one subject 0.25 N, all 0.05 to "
    "0.35 N; the force goes with the square of the voltage. Their model's "
    "cut-off below 500 Hz is at odds with what they measured.",
    assumed="An area of 100 mm2 and 0.2 mm of skin / 1650, as the paper does; a film of permittivity 3.9.",
    fitted="nothing to Meyer; the gap of one row to the ratio of Strong and Troxel's thresholds.",
    reason="Without a gap Strong and Troxel's law is two orders too large; Kaczmarek's is in the range as it "
    "divides by the whole thickness of the skin. 2.6 um of air bring the first within a factor of four.",
    sceptic="With area, skin and gap all assumed, any number can be had.",
    answer="Not any: no area or skin within the errors takes two orders from Strong and Troxel's law without "
    "a gap. The factor of four that stays is what one gap from other films cannot say: these faces may be "
    "farther apart.",
)
RAUF = Experiment(
    title="An electroadhesive clutch",
    source="Rauf and Follmer (2025)",
    doi="10.1016/j.eml.2025.102382",
    read="the published capacities, to which the powers are fits",
    conditions="Capacity in shear from 150 to 300 V, dielectric of 24 um / 54.2, roughness 2.0 to 2.8 um; no "
    "finger.",
    assumed="That the capacity is proportional to the attraction.",
    fitted="nothing.",
    reason="Both laws go with the square of the voltage at a given gap; the capacity rises more slowly.",
    sceptic="A clutch that peels does not measure an attraction.",
    answer="True: a strip slips from its end on, and a capacity that saturates lowers the power. It is here "
    "because hovering fingers have a power that is not two either, but above it.",
)
SHULTZ = Experiment(
    title="Impedance of a finger that slides",
    source="Shultz, Peshkin and Colgate (2018)",
    doi="10.1109/HAPTICS.2018.8357168",
    read="the abstract",
    conditions="Two displays; sliding raises the impedance by 100 to 1000 %.",
    assumed="1 kHz, a film of 1 um / 3.9, 0.3 mm of dry skin, a leak of 1e-8 S/m, no gap at rest; half and "
    "twice the gap in the error.",
    fitted="nothing to Shultz; the gap to the ratio of Strong and Troxel's thresholds.",
    reason="A gap of a few micrometres is many times the 0.3 um that skin and film have in series.",
    sceptic="A range from 2 to 11 is hard to miss; its middle (geometric) is no measurement.",
    answer="A gap below 0.3 um or above 3 um would miss it. More it does not say.",
)
ALIABBASI = Experiment(
    title="Leakage",
    source="AliAbbasi et al. (2022)",
    doi="10.1109/TOH.2022.3152030",
    read="the abstract of the thesis that has it",
    conditions="Ten people; below 250 Hz leakage governs the force, above it the skin.",
    assumed="A gap of 1 um with a leak of 1e-8 S/m, which nobody has measured: ten times more and less in "
    "the error.",
    fitted="nothing.",
    reason="The corner is proportional to a conductivity that is not known; 7e-8 S/m would give 250 Hz, at a "
    "gap of 5 um 2.9e-7. Meyer et al. expected a cut-off below 500 Hz and measured none.",
    sceptic="A prediction that is good to a factor of ten predicts nothing.",
    answer="It says which conductivity to measure. The row stands for that.",
)
