# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Compare participants
#
# Table 1 of the paper has the fingers of eleven participants and the electrostatic force measured on each
# while it hovers over the display. How far does the size of a finger explain its force? All of them are
# computed by closed form, three by finite elements too.

# %%
import matplotlib.pyplot as plt
import numpy as np

import evfem as ev
from evfem import data
from evfem.electrostatics.forces import EllipsoidalPad, pad_force, pad_force_per_depth

people = data.load("table1")
print(people.title)
print(
    "force in",
    people.units["HVLD"],
    "at 2000 V and a gap of 0.25 mm:",
    people["HVLD"],
)

# %% [markdown]
# ## Closed form
#
# The pad as a rigid ellipsoid, (8a) and (8b) with (24). The finger is held at 30 degrees, so the horizontal
# axis is c cos 30. Nothing is fitted.

# %%
gap, voltage = 0.25, 2000.0  # mm, V
skin, film = (
    ev.Layer(thickness=0.38, eps_r=1650.0),
    ev.Layer(thickness=0.09, eps_r=3.35),
)
layers = ev.Layers.of(skin, film)
laws = {"kaczmarek": ev.Kaczmarek(), "strong_troxel": ev.StrongTroxel()}
pads = EllipsoidalPad(
    people["a"], people["b"], people["c"] * np.cos(np.radians(30.0))
)
closed = {
    name: 1e3 * pad_force(law, pads, gap, voltage, layers)
    for name, law in laws.items()
}  # mN

# %% [markdown]
# ## Finite elements
#
# A sweep over width and height of the finger, three participants and both laws. The plane model gives N/mm;
# the width out of the plane is that over which the rigid ellipsoid has the same force as its cross-section.

# %%
chosen = [0, 5, 8]  # i, vi, ix: large, small, tall
plan = ev.Sweep(
    {
        "version": 1,
        "finger": {"resolution": "coarse"},
        "surface": {"kind": "flat"},
        "electrostatics": {
            "law": "kaczmarek",
            "voltage": voltage,
            "insulator_thickness": film.thickness,
            "insulator_eps_r": film.eps_r,
        },
        "motion": [{"kind": "hover", "gap": gap}],
    },
    grid={
        "electrostatics.law": list(laws),
        "participant": {
            people["participant"][i]: {
                "finger.width": float(people["a"][i]),
                "finger.height": float(people["b"][i]),
            }
            for i in chosen
        },
    },
    outputs=("electrostatic_force.last", "min_gap.last"),
    name="participants",
)
table = ev.sweep(plan, workers=1, progress=True)
table

# %%
forces = np.reshape(table["electrostatic_force.last"], (len(laws), len(chosen)))
computed = {}
for (name, law), per_depth in zip(laws.items(), forces, strict=True):
    width = pad_force(law, pads, gap, voltage, layers) / pad_force_per_depth(
        law, pads, gap, voltage, layers
    )
    computed[name] = 1e3 * per_depth * width[chosen]
    change = computed[name] / closed[name][chosen] - 1.0
    print(
        f"{name:<14} finite elements change the closed form by",
        ", ".join(f"{c:+.1%}" for c in change),
    )

# %% [markdown]
# ## Beside what was measured

# %%
labels = {"kaczmarek": "Kaczmarek", "strong_troxel": "Strong-Troxel"}
colours = {"kaczmarek": "#0072B2", "strong_troxel": "#E69F00"}
place = np.arange(len(people["participant"]))
figure, ax = plt.subplots(figsize=(8, 4), layout="constrained")
ax.plot(place, people["HVLD"], "D", color="#B04A85", label="measured")
for (name, values), shift in zip(closed.items(), (-0.15, 0.15), strict=True):
    style = {"color": colours[name], "markersize": 12, "markeredgewidth": 2}
    ax.plot(place + shift, values, "_", label=f"{labels[name]}, closed form", **style)
    style = {
        "color": colours[name],
        "markersize": 5,
        "label": f"{labels[name]}, finite elements",
    }
    ax.plot(place[chosen] + shift, computed[name], "o", **style)
ax.set_xticks(place, people["participant"])
ax.set(xlabel="participant", ylabel="electrostatic force (mN)", ylim=(0, None))
figure.legend(loc="outside lower center", ncols=3, fontsize="small")
plt.show()

# %% [markdown]
# Neither law follows the participants: computed forces spread little, because fingers are much alike, while
# the largest of the measured ones is about three times the smallest.

# %%
for name, values in [("measured", people["HVLD"]), *closed.items()]:
    spread = np.std(values, ddof=1) / np.mean(values)
    ratio = max(values) / min(values)
    print(
        f"{name:<14} median {np.median(values):.2f} mN, spread {spread:.0%}, max / min {ratio:.1f}"
    )
