"""Deformed fingers of several results beside each other, on one scale."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from evfem.plotting.curves import named
from evfem.plotting.fields import Window, check_field, frame_of, scale_of, shown_values
from evfem.plotting.figures import Panels, new_figure
from evfem.plotting.finger import Near, View, label_bar, told
from evfem.plotting.labels import field_label
from evfem.simulation.result import Result

ACROSS = 3.3  # inches for each finger


def side_by_side(
    results: Mapping[str, Result],
    field: str = "von_mises",
    frame: int = -1,
    *,
    near: Near = "contact",
    vmin: float | None = None,
    vmax: float | None = None,
) -> Panels:
    """The deformed fingers of several results by their names: whole above, close-ups below.

    All are coloured by one field on one scale, as `deformed` does it; `near=None` leaves out the
    close-ups. The panels come row by row.
    """
    check_field(field)
    views = {name: View(one, frame_of(one, frame), field) for name, one in named(results).items()}
    rows = [[view.window(None) for view in views.values()]]
    if near is not None:
        rows.append([view.window(near) for view in views.values()])
    shown = [
        shown_values(view.result.mesh, view.frame, field, window)
        for row in rows
        for view, window in zip(views.values(), row, strict=True)
    ]
    scale = scale_of(field, np.concatenate(shown), vmin, vmax)
    tall = [max(_height(window) for window in row) for row in rows]
    figure = new_figure(sum(tall) + 0.75 * len(rows), ACROSS * len(views) + 1.0)
    axes = figure.subplots(len(rows), len(views), squeeze=False, height_ratios=tall)
    for panels, row in zip(axes, rows, strict=True):
        for ax, view, window in zip(panels, views.values(), row, strict=True):
            mapped = view.draw(ax, window, scale)
            ax.set_title(told(view.result, view.frame), fontsize="x-small")
    for ax, name in zip(axes[0], views, strict=True):
        ax.set_title(name, fontsize="medium")
    for ax in axes[:, 1:].ravel():
        ax.set_ylabel("")
    for ax in axes[:-1].ravel():
        ax.set_xlabel("")
    bar = figure.colorbar(mapped, ax=axes, label=field_label(field), shrink=0.8, extend=scale.extend)
    label_bar(bar, field)
    return Panels(axes.ravel())


def _height(window: Window) -> float:
    """Inches of a window that is as wide as its finger's place."""
    left, right, bottom, top = window
    return (ACROSS - 0.7) * (top - bottom) / (right - left)
