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
# # Compare two presses as a published neuron sees them
#
# A finger pad is pressed to one depth twice, fast and slowly, and held. A probe keeps the stress at a point
# below the epidermis; a model of a slowly adapting afferent turns it into spikes.
#
# **What this is:** a comparison of two signals. The neuron's constants were fitted to mice, with another
# model of the skin. Its spikes are no threshold and no rate of a person, and say nothing of what anybody
# feels.

# %%
import matplotlib.pyplot as plt
import numpy as np

import evfem as ev
from evfem import export

# %% [markdown]
# ## Two histories of stress
#
# Time must pass, in steps that are short against what is asked for. The tissue itself does not relax here:
# what differs is how fast it is pressed.

# %%
finger = ev.FingerPad(resolution="coarse", ridges=False)


def press(seconds, depth=1.5, hold=1.0):
    """Press within so many seconds and hold, with a probe at the base of the epidermis."""
    scene = ev.Scene(
        finger,
        ev.Flat(friction=0.3),
        motion=[
            ev.Press(indentation=depth, speed=depth / seconds, steps=15),
            ev.Wait(hold, steps=20),
        ],
        output=ev.Output(probes={"receptor": ev.Probe(x=[0.0], at="epidermis")}),
    )
    return ev.simulate(scene)


runs = {"in 50 ms": press(0.05), "in 500 ms": press(0.5)}

# %% [markdown]
# ## The neuron
#
# Gerling and others: a current follows changes of the stress and forgets them in 8, 200 and 1744.6 ms, a
# part never; it charges a membrane that leaks, and at 30 mV fires and starts again. Compression is positive.
# Units: kPa, ms, pA, mV. The constants are those of their published programs; the model of a population is
# in doi:10.1109/TOH.2013.36.

# %%
TAU = np.array([8.0, 200.0, 1744.6, np.inf])  # ms
GAIN = np.array([0.74, 0.2088, 0.07, 0.0312])  # pA/kPa
CLUSTER, CAPACITY, RESISTANCE, FIRES = 8, 30.0, 5.0, 30.0  # endings, pF, GOhm, mV


def spikes(time, stress, step=0.05):
    """Times (ms) of spikes under a stress (kPa) that is linear between times (ms)."""
    at = np.arange(0.0, time[-1] + 0.5 * step, step)
    change = np.diff(np.interp(at, time, stress))
    forget, leak = np.exp(-step / TAU), np.exp(-step / (RESISTANCE * CAPACITY))
    kept, u, found = np.zeros(4), 0.0, []
    for now, more in zip(at[1:], change, strict=True):
        kept = forget * kept + np.sqrt(forget) * more
        driven = RESISTANCE * CLUSTER * max(0.0, GAIN @ kept)
        before, u = u, driven + (u - driven) * leak
        if u >= FIRES:
            found.append(now - step * (u - FIRES) / (u - before))
            u = driven * (1.0 - np.exp(-(now - found[-1]) / (RESISTANCE * CAPACITY)))
    return np.array(found)


# %% [markdown]
# ## Does it do what the published one does?
#
# Under a constant 30 kPa it fires every 242.38 ms in the end. Under 20 kPa in 100 ms and 2 s of hold it fires
# 3 times in the ramp and 23 times in the hold, first at 51.10 ms and last at 1921.14 ms.

# %%
constant = spikes(
    np.array([0.0, 1e-6, 20000.0]), np.array([0.0, 30.0, 30.0]), step=0.5
)
ramp = spikes(np.array([0.0, 100.0, 2100.0]), np.array([0.0, 20.0, 20.0]))
interval = np.diff(constant)[-1]
print(
    f"{interval:.2f} ms; {(ramp <= 100).sum()} and {(ramp > 100).sum()}, {ramp[0]:.2f} to {ramp[-1]:.2f} ms"
)

# %% [markdown]
# ## The two presses


# %%
def signal(result):
    """Times (ms) and vertical compression (kPa) at the probe, from nothing on."""
    stress = -1e3 * result.probes["receptor"].cauchy_stress[:, 0, 1, 1]
    return np.append(0.0, 1e3 * result.time), np.append(0.0, stress)


fired = {name: spikes(*signal(result)) for name, result in runs.items()}
figure, (upper, lower) = plt.subplots(
    2, 1, sharex=True, height_ratios=[2, 1], layout="constrained"
)
for row, (name, result) in enumerate(runs.items()):
    (line,) = upper.plot(*signal(result), label=name)
    lower.vlines(fired[name], row - 0.35, row + 0.35, color=line.get_color())
upper.set(ylabel="vertical compression (kPa)")
upper.legend(title="pressed")
lower.set(
    xlabel="time (ms)", yticks=range(len(runs)), yticklabels=runs, ylabel="pressed"
)
plt.show()
plt.close(figure)

# %% [markdown]
# Both end under the same stress. The fast press makes the current larger while it lasts, so that spikes
# follow each other more closely.

# %%
for name, result in runs.items():
    time, stress = signal(result)
    print(
        f"pressed {name}: {stress[-1]:.1f} kPa in the end, {fired[name].size} spikes",
        end=", ",
    )
    print(f"shortest interval {np.diff(fired[name]).min():.0f} ms")

# %% [markdown]
# ## For another model of afferents
#
# TouchSim has a half-space of its own and wants traces of pins; these are its arguments. A section in the
# plane gives a line of pins, no area.

# %%
stimulus = export.touchsim(runs["in 50 ms"], sample_rate=5000.0)
print({name: getattr(value, "shape", value) for name, value in stimulus.items()})
