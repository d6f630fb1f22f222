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
# # Explore a scene
#
# A finger pad is pressed on a display under voltage and slides. What it feels depends on the load, the
# voltage and the friction of the display. Units: mm, V, N per mm of depth.

# %%
import matplotlib.pyplot as plt

import evfem as ev
from evfem import plotting

# %% [markdown]
# The finger of the paper's Table 2, coarse (a run takes a few seconds):

# %%
finger = ev.FingerPad(resolution="coarse")
finger

# %% [markdown]
# ## From four numbers to a result


# %%
def slide(load=0.05, voltage=1000.0, friction=0.3, distance=1.0):
    """Press to `load` N/mm and slide `distance` mm at `voltage` V."""
    scene = ev.Scene(
        finger,
        ev.Display(friction=friction),
        law=ev.Kaczmarek(),
        voltage=voltage,
        motion=[
            ev.Press(force=load, steps=3),
            ev.Slide(distance=distance, steps=6, hold="force"),
        ],
        output=ev.Output(every=9),  # the fields of the last step only
    )
    return ev.simulate(scene)


def show(load=0.05, voltage=1000.0, friction=0.3, distance=1.0):
    """Forces over the steps above the deformed pad, with the von Mises stress."""
    result = slide(load, voltage, friction, distance)
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(11, 4), width_ratios=[1, 1.35], layout="constrained"
    )
    plotting.forces(result, ax=left)
    plotting.deformed(result, "von_mises", ax=right)
    plt.show()
    plt.close(figure)
    runs.append(result)


runs = []
show()

# %% [markdown]
# ## Move the sliders
#
# With `ipywidgets` there are sliders; without it, change the numbers in the call `show()` above, as in
# `show(voltage=2000.0)`.

# %%
try:
    from ipywidgets import FloatSlider, interactive
except ModuleNotFoundError:
    controls = None
else:
    controls = interactive(
        show,
        load=FloatSlider(0.05, min=0.01, max=0.2, step=0.01, continuous_update=False),
        voltage=FloatSlider(
            1000.0, min=0.0, max=2000.0, step=100.0, continuous_update=False
        ),
        friction=FloatSlider(
            0.3, min=0.05, max=1.0, step=0.05, continuous_update=False
        ),
        distance=FloatSlider(
            1.0, min=0.2, max=3.0, step=0.2, continuous_update=False
        ),
    )
controls

# %% [markdown]
# ## Read the numbers
#
# The last run, by the sliders or by the call. Run these two cells again after moving a slider.

# %%
result = runs[-1]
result

# %% [markdown]
# The bone carries `applied_force`; the display pushes back with `normal_force`, which is larger by the
# attraction. In full slip the friction force is the coefficient times `normal_force`.

# %%
balance = result.normal_force - result.electrostatic_force - result.applied_force
added = result.electrostatic_force[-1] / result.applied_force[-1]
print(f"forces balance to {abs(balance).max():.0e} N/mm")
print(
    f"friction coefficient seen from the bone: {result.tangential_force[-1] / result.applied_force[-1]:.4f}"
)
print(f"the voltage adds {added:.1%} to the load")
