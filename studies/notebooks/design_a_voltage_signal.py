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
# # Design a voltage signal
#
# A real surface whose friction rises from 0.5 to 0.6 is to be felt on a flat display with friction 0.5. Which
# voltage does that, how well is the surface reproduced, and how does the signal get to a device?

# %%
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import evfem as ev
from evfem.circuit.encoding import AreaLaw, Encoding
from evfem.electrostatics.laws import Layers
from evfem.estimate.rendering import (
    apparent_friction,
    compare,
    exact,
    record,
    replay,
    voltage_for,
)

# %% [markdown]
# ## 1. Slide over the real surface
#
# Friction is a table of positions (mm) and coefficients; a repeated position is a jump.

# %%
finger = ev.FingerPad(resolution="coarse", ridges=False)
real_surface = ev.Flat(friction=[[0.0, 0.5], [1.0, 0.5], [1.0, 0.6]])
motion = [
    ev.Press(force=0.05, steps=2),
    ev.Slide(distance=4.0, steps=16, hold="force"),
]
real = record(ev.Scene(finger, real_surface, motion=motion))
real.result

# %% [markdown]
# The bone feels the ratio of its two forces. It rises gradually: first the pad sticks, then the step in
# friction passes under a contact several millimetres wide.

# %%
felt = apparent_friction(real.result)
print(
    f"full slip from x = {real.full_slip:.2f} mm on; friction at the end {felt.friction[-1]:.4f}"
)

# %% [markdown]
# ## 2. A voltage by closed form
#
# Equation (20a) needs the layers between finger and electrode, the display's friction and an area law:

# %%
display = ev.Display(friction=0.5)
law = ev.Kaczmarek()
layers = Layers.of(ev.Layer(thickness=0.38, eps_r=1650.0), display.insulator)
encoding = Encoding(law, layers, AreaLaw(112.0), friction=display.friction)
closed = voltage_for(felt, encoding)
print(
    f"at most {closed.largest:.0f} V, {closed.rms:.0f} V rms; carrier amplitude {closed.carrier:.0f} V"
)

# %% [markdown]
# ## 3. Exactly
#
# The closed form leaves out the air around the contact and estimates the area of contact. `exact` asks the
# model itself: the voltage of every step becomes an unknown, the recorded friction force its equation.

# %%
by_closed_form = replay(real, display, law, closed.profile)
by_model = exact(real, display, law)
comparisons = {
    "closed form": compare(real.result, by_closed_form.result),
    "exact": compare(real.result, by_model.result),
}
for name, found in comparisons.items():
    print(
        f"{name:<12} relative error {found.relative_l2:.1e}, largest {found.largest_error:.1e} N/mm"
    )

# %% [markdown]
# ## 4. Look at both
#
# What is left of the exact signal's error lies in the first steps: while the pad sticks, no voltage changes
# the force, and the signal keeps the value it had.

# %%
slides = real.result.motion == "slide"
x = real.result.position[slides]
figure, (top, middle, bottom) = plt.subplots(
    3, 1, sharex=True, figsize=(7, 6.5), layout="constrained"
)
top.plot(
    x,
    real.result.applied_tangential_force[slides],
    color="#555555",
    linewidth=4,
    label="real surface",
)
for (name, run), colour, line in zip(
    {"closed form": by_closed_form, "exact": by_model}.items(),
    ("#E69F00", "#0072B2"),
    ("-", "--"),
    strict=True,
):
    top.plot(
        x, run.result.applied_tangential_force[slides], line, color=colour, label=name
    )
    middle.plot(x, 1e6 * comparisons[name].error, line, color=colour)
    bottom.plot(x, run.result.voltage[slides], line, color=colour)
top.set_ylabel("friction force (N/mm)")
middle.set_ylabel("its error (µN/mm)")
bottom.set(xlabel="position (mm)", ylabel="effective voltage (V)")
top.legend()
plt.show()

# %% [markdown]
# ## 5. To a device
#
# The exact signal as a table, limited to what an amplifier can do, as 16-bit WAV and as MPEG haptics:

# %%
signal = ev.VoltageProfile(x, by_model.result.voltage[slides])
amplifier = ev.Amplifier(voltage_max=2500.0, slew=2e5)  # V, V/s
speed = 20.0  # mm/s
limited = amplifier.limit(signal, speed)
playback = ev.Playback(full_scale=2500.0, speed=speed, friction=(0.5, 0.65))
for name in ("signal.csv", "signal.wav", "signal.hjif"):
    ev.write_signal(name, limited, playback)
    print(f"{name}: {Path(name).stat().st_size} bytes")

# %% [markdown]
# Read back, the WAV is the same signal within half a step of its 16 bits:

# %%
back = ev.read_signal("signal.wav")
rounding = float(np.max(np.abs(back(back.position) - limited(back.position))))
print(f"largest difference {1e3 * rounding:.1f} mV")
