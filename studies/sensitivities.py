"""Which of Table 2's parameters decide the forces, at rest, in partial and in full slip?

The paper's ridged finger is pressed to a depth that gives about 0.05 N/mm, then slid: 0.6 mm, where a part
of the contact slips, then 3 mm, where all of it does. Derivatives of normal and tangential force and of the
attraction are those of `ev.sensitivities`; a width of contact counts nodes, and is differenced between runs
with a parameter 10 % smaller and larger. Expected: the indentation given, the soft layers decide the normal
force; friction decides the tangential one in full slip alone, stiffness in partial slip; the voltage counts
twice in the attraction, the thicknesses of insulator and stratum corneum nearly once, and the permittivity of
skin not at all.

Figs 5 and 11 again, with bands of one standard deviation to first order (`ev.uncertainty`): the force of the
hovering finger, and the attraction (9b) over the load, with and without ridges. The share of the air layer
needs (10), which counts what touches, and has no derivative.
"""

from __future__ import annotations

from typing import Any

import numpy as np

import evfem as ev
from evfem import data
from evfem.common.arrays import Floats
from evfem.response.parameters import parameter_of

from .common import CASES, Series, Study, markdown, median_interval, paper_display, participants
from .plots import COLOURS, Figure, new_figure, panel_letter
from .printed import Printed

#: last step of each state, and what is asked of it
STATES, FORCES, WIDTH = (
    ("rest", "partial slip", "full slip"),
    ("normal_force", "tangential_force", "electrostatic_force"),
    "contact_width",
)
SHOWN = {"normal_force": "$F_n$", "tangential_force": "$F_t$", "electrostatic_force": "$F_e$", WIDTH: "width"}
DEPTH, BETWEEN, OUT_OF_PLANE = 0.7, 0.1, 9.0
#: parameters whose models are in memory at a time
AT_ONCE = 5
LAYERS = ("stratum_corneum", "epidermis", "dermis", "hypodermis", "nail")
#: of Table 2: key -> how it is called
KEYS = {
    **{f"finger.materials.{layer}.E": f"E, {layer.replace('_', ' ')}" for layer in LAYERS},
    **{f"finger.materials.{layer}.nu": f"ν, {layer.replace('_', ' ')}" for layer in LAYERS},
    **{f"finger.{layer}_thickness": f"thickness, {layer.replace('_', ' ')}" for layer in LAYERS[:3]},
    "surface.friction": "friction",
    "finger.electrical.stratum_corneum_eps_r": "permittivity, stratum corneum",
    "electrostatics.insulator_thickness": "thickness, insulator",
    "electrostatics.insulator_eps_r": "permittivity, insulator",
    "electrostatics.voltage": "voltage",
}
QUICK = ("finger.materials.hypodermis.E", "surface.friction", "electrostatics.voltage")
#: standard deviations: of what `uncertainty` varies, uniform there, and of moduli and the gap (mm)
STIFF, GAP = 0.2, 0.05 / 3**0.5
SPREADS = {
    "finger.stratum_corneum_thickness": 0.22 / 12**0.5,
    "electrostatics.insulator_thickness": 0.009 / 12**0.5,
    "electrostatics.insulator_eps_r": 0.7 / 12**0.5,
}
ASSUMPTIONS = {
    "mesh": "coarse: 12 nodes per ridge",
    "depth": "0.7 mm in three steps, then held: the normal force is what the finger answers",
    "law": "Kaczmarek's, 1000 V; display and friction of Table 2",
    "elasticity": "d ln column / d ln parameter; of nu too, whose distance to 1/2 changes by more",
    "width": "central difference over 10 % of a parameter, of nu of its distance to 1/2: a node at the edge "
    "of the contact changes it by 0.3, by nu of the hypodermis by 7, as in full slip",
    "spreads": "standard deviations: moduli of all soft layers 20 % (assumed); stratum corneum, insulator, "
    "permittivity, voltage and gap those of the uniform spreads of the study uncertainty; independent",
    "width out of the plane": "9 mm for Fig. 5, the middle of the paper's 8 to 10",
}
PAPER: dict[str, Printed] = {}


def main(quick: bool = False) -> Study:
    """Relative derivatives in three states, and both figures with their bands."""
    keys = QUICK if quick else tuple(KEYS)
    found, ends = relative(touching(quick), keys)
    pads = (False,) if quick else (True, False)
    hovering = {case: hover(case, quick) for case in CASES}
    pressed = {ridges: loaded(ridges, quick) for ridges in pads}
    numbers = {
        f"{state}.{column}.{key}": found[key][i, j]
        for key in keys
        for i, state in enumerate(STATES)
        for j, column in enumerate(SHOWN)
        if np.isfinite(found[key][i, j])
    }
    numbers |= {f"{state}.normal_force_N_per_mm": force for state, force in zip(STATES, ends, strict=True)}
    series = []
    for case, one in hovering.items():
        force, sd = 1e3 * OUT_OF_PLANE * np.array([one.result.electrostatic_force[-1], last_sd(one)])
        numbers |= {f"fig05.{case}_mN": force, f"fig05.{case}.sd_mN": sd, **check(f"fig05.{case}", one)}
        series.append(Series(f"fig05 {case}", [force], [sd], "mN over mN"))
    for ridges, one in pressed.items():
        name, column = "with_ridges" if ridges else "without_ridges", "electrostatic_force"
        numbers |= {f"fig11.{name}.relative_sd": last_sd(one) / one.result[column][-1]}
        numbers |= check(f"fig11.{name}", one)
        for what, values in (("attraction", one.result[column]), ("sd", one.sd[column])):
            series.append(Series(f"fig11 {name} {what}", one.result.normal_force, values, "N/mm over N/mm"))
    series += [Series(f"elasticity {key}", list(SHOWN) * 3, found[key].ravel(), "1") for key in keys]
    return Study(
        "sensitivities",
        numbers,
        PAPER,
        ASSUMPTIONS,
        series,
        lambda: draw(found, hovering, pressed),
        {"keys": keys, "depth_mm": DEPTH},
        {"What decides": decides(found)},
    )


def touching(quick: bool) -> ev.Scene:
    """The finger pressed, then in partial and in full slip."""
    finger = ev.FingerPad(ridges=not quick, resolution="coarse")
    slides = (ev.Slide(0.6, steps=4), ev.Slide(3.0, steps=3))
    motion = (ev.Press(indentation=DEPTH, steps=3), *slides)
    return ev.Scene(finger, paper_display(friction()), ev.Kaczmarek(), 1000.0, motion)


def friction() -> float:
    """Coefficient of Table 2."""
    return data.load("table2").value("mu")


def relative(scene: ev.Scene, keys: tuple[str, ...]) -> tuple[dict[str, Floats], Floats]:
    """Relative derivatives (states, columns) by each key, and the normal forces (states,)."""
    steps = np.cumsum([motion.steps for motion in scene.motion]) - 1
    answers = {}
    for number, key in enumerate(keys):
        if number % AT_ONCE == 0:
            found = ev.sensitivities(scene, keys[number : number + AT_ONCE], FORCES)
        shares = np.transpose([found.elasticity[column, key][steps] for column in FORCES])
        one = parameter_of(scene, key)
        ends = [
            ev.simulate(one.applied(scene, sign * BETWEEN * one.size)).contact_width for sign in (1.0, -1.0)
        ]
        width = (ends[0] - ends[1]) / (2.0 * BETWEEN * one.size) * one.value / found.result.contact_width
        answers[key] = np.column_stack([shares, width[steps]])
        answers[key][0, 1] = np.nan  # the tangential force at rest is 0
    return answers, found.result.normal_force[steps]


def spreads(scene: ev.Scene) -> dict[str, float]:
    """Standard deviations of what varies in a scene."""
    found = SPREADS | {"electrostatics.voltage": 0.01 * float(scene.electrics.largest_voltage) / 3**0.5}
    for layer in LAYERS[:4]:
        key = f"finger.materials.{layer}.E"
        found[key] = STIFF * parameter_of(scene, key).value
    return found | ({"motion.0.gap": GAP} if isinstance(scene.motion[0], ev.Hover) else {})


def hover(case: str, quick: bool) -> Any:
    """The hovering finger of Fig. 5 and its spread."""
    voltage, gap = CASES[case]
    finger = ev.FingerPad(ridges=not quick, resolution="coarse")
    scene = ev.Scene(finger, paper_display(friction()), ev.Kaczmarek(), voltage, ev.Hover(gap=gap, steps=1))
    return ev.uncertainty(scene, spreads(scene), ["electrostatic_force"])


def loaded(ridges: bool, quick: bool) -> Any:
    """The pad of Fig. 11 under ten loads and its spread."""
    finger = ev.FingerPad(ridges=ridges, resolution="coarse")
    motion = ev.Press(force=0.1, steps=3 if quick else 10)
    scene = ev.Scene(finger, paper_display(0.0), ev.Kaczmarek(), 1000.0, motion)
    return ev.uncertainty(scene, spreads(scene), ["electrostatic_force"])


def last_sd(found: Any) -> float:
    """Standard deviation of the attraction in the last step."""
    return float(found.sd["electrostatic_force"][-1])


def check(name: str, found: Any) -> dict[str, float]:
    """The largest contribution, by the derivative and by a run."""
    one = found.checked
    return {f"{name}.{one.key}.by_derivative": one.by_derivative, f"{name}.{one.key}.by_run": one.by_run}


def decides(found: dict[str, Floats]) -> list[str]:
    """For each state and column the three parameters with the largest relative derivative."""
    rows = []
    for i, state in enumerate(STATES):
        for j, column in enumerate(SHOWN):
            known = {key: float(values[i, j]) for key, values in found.items() if np.isfinite(values[i, j])}
            first = sorted(known, key=lambda key: -abs(known[key]))[:3]
            rows.append([state, column, ", ".join(f"{KEYS[key]} {known[key]:+.2f}" for key in first)])
    return markdown(("state", "column", "d ln column / d ln parameter"), rows)


def draw(found: dict[str, Floats], hovering: dict[str, Any], pressed: dict[bool, Any]) -> Figure:
    """Derivatives as a table of colours, and both figures with bands."""
    figure = new_figure(1.6 + 0.26 * max(len(found), 12), 9.2)
    grid = figure.add_gridspec(2, 2, width_ratios=[1.5, 1.0])
    axes = [figure.add_subplot(grid[:, 0]), figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])]
    for ax, letter in zip(axes, "abc", strict=True):
        panel_letter(ax, letter)
    _draw_shares(axes[0], found)
    _draw_hover(axes[1], hovering)
    _draw_loads(axes[2], pressed)
    return figure


def _draw_shares(ax: Any, found: dict[str, Floats]) -> None:
    shares = np.array([values.ravel() for values in found.values()])
    ax.imshow(shares, cmap="RdBu_r", vmin=-2.0, vmax=2.0, aspect="auto")
    for (row, column), value in np.ndenumerate(shares):
        if abs(value) >= 0.005:
            colour = "white" if abs(value) > 1.3 else "black"
            ax.text(column, row, f"{value:.2f}", ha="center", va="center", fontsize=6, color=colour)
    ax.set_yticks(range(len(found)), [KEYS[key] for key in found], fontsize="small")
    ax.set_xticks(range(shares.shape[1]), list(SHOWN.values()) * 3, fontsize="x-small")
    for i, state in enumerate(STATES):
        ax.axvline(4 * i - 0.5, color="black", linewidth=0.8)
        ax.text(4 * i + 1.5, 1.01, state, ha="center", transform=ax.get_xaxis_transform(), fontsize="small")


def _draw_hover(ax: Any, hovering: dict[str, Any]) -> None:
    for place, (case, one) in enumerate(hovering.items()):
        low, high, _ = median_interval(participants()[case])
        ax.plot([place - 0.15] * 2, [low, high], color=COLOURS["measured"], linewidth=5)
        ax.plot(place - 0.15, np.median(participants()[case]), "_", color="black", markersize=10)
        force, sd = 1e3 * OUT_OF_PLANE * np.array([one.result.electrostatic_force[-1], last_sd(one)])
        ax.errorbar(place + 0.15, force, sd, fmt="o", color=COLOURS["kaczmarek"], capsize=4)
    ax.plot([], [], color=COLOURS["measured"], linewidth=5, label="median measured, its interval")
    ax.errorbar([], [], [], fmt="o", color=COLOURS["kaczmarek"], capsize=4, label="computed, one sd")
    ax.legend(fontsize="x-small", loc="lower right")
    ax.set_xticks(range(len(hovering)), list(hovering))
    ax.set(ylabel="force of Fig. 5 (mN)", ylim=(0.0, None), xlim=(-0.5, len(hovering) - 0.5))


def _draw_loads(ax: Any, pressed: dict[bool, Any]) -> None:
    looks = {True: ("with ridges", COLOURS["strong_troxel"]), False: ("without", COLOURS["kaczmarek"])}
    for ridges, one in pressed.items():
        label, colour = looks[ridges]
        load, force = one.result.applied_force, 1e3 * one.result.electrostatic_force
        sd = 1e3 * one.sd["electrostatic_force"]
        ax.plot(load, force, "o-", color=colour, label=label, markersize=3)
        ax.fill_between(load, force - sd, force + sd, color=colour, alpha=0.3, linewidth=0.0)
    ax.set(xlabel="applied load (N/mm)", ylabel="attraction of Fig. 11 (mN/mm)", ylim=(0.0, None))
    ax.legend(fontsize="small")
