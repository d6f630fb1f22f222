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
# # Lecture: a finger under a voltage, step by step
#
# A finger pad is pressed on a display and pulled along; then the voltage is switched on. Each step is asked
# for when it is wanted. Every figure has the same scales, so that what grows is seen to grow. Units: mm, V,
# kPa, and N per mm of the finger's depth.

# %%
import matplotlib.pyplot as plt
import numpy as np

import evfem as ev

# %% [markdown]
# ## The experiment
#
# The finger of the paper's Table 2 without ridges, coarse, so that a step takes a fraction of a second. The
# display rubs with the coefficient 0.3. Nothing is prescribed yet: the list of motions is empty.

# %%
FRICTION, LOAD, VOLTAGE = 0.3, 0.05, 1500.0  # -, N/mm, V
finger = ev.FingerPad(resolution="coarse", ridges=False)
scene = ev.Scene(finger, ev.Display(friction=FRICTION), law=ev.Kaczmarek(), motion=[])
loop = ev.loop(scene, largest_voltage=VOLTAGE)
loop

# %% [markdown]
# ## One figure for all steps
#
# Left, what the skin feels: pressure and shear traction where it touches. Right, the friction force on the
# way. The axes never change.


# %%
def show():
    """Tractions of the last step, and the friction force of all steps."""
    result = loop.result()
    frame, last = result.frames[-1], result.rows[-1]
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(10, 3.6), layout="constrained"
    )
    pad = result.mesh.node_sets["pad"]
    x = (result.mesh.points + frame.displacement)[pad, 0] - frame.position
    order = np.argsort(x)
    left.plot(x[order], 1e3 * frame.contact_pressure[pad][order], label="pressure")
    left.plot(
        x[order], 1e3 * frame.shear_traction[pad][order], "--", label="shear traction"
    )
    left.set(
        xlim=(-5.0, 5.0),
        ylim=(-6.0, 18.0),
        xlabel="place below the bone (mm)",
        ylabel="traction (kPa)",
    )
    left.set_title(f"{last['voltage']:.0f} V, bone at {last['position']:.2f} mm")
    left.legend(loc="upper right")
    right.plot(result.position, result.tangential_force, ".-")
    right.axhline(FRICTION * LOAD, color="0.6", ls=":")
    right.text(
        2.95,
        FRICTION * LOAD - 4e-4,
        "friction times load",
        ha="right",
        va="top",
        color="0.4",
    )
    right.set(xlim=(0.0, 3.0), ylim=(0.0, 0.025))
    right.set(xlabel="position of the bone (mm)", ylabel="friction force (N/mm)")
    plt.show()
    return figure


# %% [markdown]
# ## 1. Press
#
# To half the load and to all of it. How wide is the contact?

# %%
for load in (0.5 * LOAD, LOAD):
    row = loop.step(force=load)
    print(
        f"{row.applied_force:.3f} N/mm: {row.indentation:.2f} mm deep, {row.contact_width:.2f} mm wide"
    )
figures = [show()]

# %% [markdown]
# ## 2. Pull
#
# The load stays, for nothing else is asked for. At first the skin sticks and the force rises with the shear
# of the tissue. Slip begins at the edges, where there is little pressure, and eats its way to the middle.

# %%
places = np.linspace(0.125, 1.5, 12)
for position in places[:3]:
    loop.step(position=position)
figures.append(show())

# %%
for position in places[3:]:
    row = loop.step(position=position)
figures.append(show())
print(
    f"friction force {row.tangential_force:.4f} N/mm, {FRICTION} times {row.normal_force:.4f} N/mm"
)

# %% [markdown]
# ## 3. The voltage
#
# It attracts the skin, and the load on the bone stays as it is: the display pushes back with more.

# %%
for voltage in np.linspace(0.0, VOLTAGE, 5)[1:]:
    row = loop.step(voltage=voltage)
    print(f"{voltage:6.0f} V: attraction {row.electrostatic_force:.4f} N/mm")
figures.append(show())

# %% [markdown]
# The skin that slipped may stick now: it needs to be pulled on for the friction force to follow.

# %%
for position in np.linspace(1.625, 3.0, 12):
    row = loop.step(position=position)
figures.append(show())
coefficient = row.tangential_force / row.applied_force
print(
    f"friction coefficient seen from the bone: {coefficient:.3f}, without a voltage {FRICTION}"
)

# %% [markdown]
# ## Ask for something else
#
# Whatever comes next starts from here. With `ipywidgets` each movement of a slider is a step; without it,
# write `loop.step(voltage=0.0)` and `show()`.

# %%
try:
    from ipywidgets import FloatSlider, interactive
except ModuleNotFoundError:
    controls = None
else:

    def step(position=3.0, voltage=VOLTAGE):
        loop.step(position=position, voltage=voltage)
        show()

    controls = interactive(
        step,
        position=FloatSlider(
            3.0, min=0.0, max=3.0, step=0.05, description="position (mm)"
        ),
        voltage=FloatSlider(
            VOLTAGE, min=0.0, max=VOLTAGE, step=100.0, description="voltage (V)"
        ),
    )
controls

# %% [markdown]
# The whole lesson is a result like any other:

# %%
result = loop.result()
result
