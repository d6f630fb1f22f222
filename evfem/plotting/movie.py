"""A moving picture of a result: the deformed finger frame by frame, the forces below.

A .gif needs nothing beyond Pillow, which comes with matplotlib; an .mp4 needs ffmpeg. Window and
colours are the same in every frame; a close-up goes along with the finger.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from subprocess import CalledProcessError
from typing import TYPE_CHECKING, Any

import numpy as np

from evfem.common import notices
from evfem.common.arrays import Floats
from evfem.common.checks import choice, count
from evfem.common.storage import replacing
from evfem.errors import InputError, StorageError
from evfem.plotting.curves import abscissa, forces
from evfem.plotting.fields import FIELDS, Scale, Window, scale_of
from evfem.plotting.figures import BLACK, BLUE, GREEN, VERMILION, WIDTH, add_colorbar
from evfem.plotting.finger import Near, View, figure_height, label_bar, told
from evfem.plotting.footprint import SkinView
from evfem.plotting.labels import check_result, on_lines
from evfem.simulation.result import POINT_FIELDS, Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI, CURVES_HEIGHT = 100, 2.0  # pixels per inch; height of the forces in inches
OF_SCALE, SHADES = 160, 12  # of the 256 colours of a .gif: those of the scale, and of each curve


def animate(
    result: Result,
    path: str | Path,
    field: str = "von_mises",
    *,
    near: Near = None,
    vmin: float | None = None,
    vmax: float | None = None,
    fps: int = 10,
    progress: bool = True,
) -> Path:
    """Write the frames of a result as a moving picture, `path` ending in .gif or .mp4, and return the path,
    which a notebook shows as the picture.

    Each frame shows the finger as `deformed` or `footprint` does, and the forces with a mark where it is.
    `near="contact"` goes along with the finger, as does no other window. `fps` frames are shown in
    a second; keep more of them with `Output(every=...)`. Raises InputError for another ending, for .mp4
    without ffmpeg, and for a result without frames; StorageError when the disk refuses.
    """
    from matplotlib.animation import FFMpegWriter

    check_result(result)
    path, fps = Path(path), count("fps", fps, 60)
    choice("field", field, POINT_FIELDS if result.mesh.dim == 3 else FIELDS)
    if not result.frames:
        raise InputError("result", "a result without frames", "a result with frames (Output(every=...))")
    if path.suffix not in (".gif", ".mp4"):
        raise InputError("path", str(path), "a file name that ends in .gif or .mp4")
    if not path.absolute().parent.is_dir():
        raise StorageError(f"cannot write {path}: there is no folder {path.parent}")
    if path.suffix == ".mp4" and not FFMpegWriter.isAvailable():
        raise InputError("path", f"{path}, and no ffmpeg", "a .gif, or an .mp4 where ffmpeg is installed")
    write = _write_gif if path.suffix == ".gif" else _write_mp4
    reel = make_reel(result, field, near, (vmin, vmax))
    wanted = progress and notices.drawable()
    with replacing(path) as temporary, notices.bar(len(result.frames), "frame", wanted=wanted) as bar:
        write(temporary, reel, fps, bar.update)
    return MoviePath(path)


class MoviePath(type(Path())):  # type: ignore[misc]
    """The path of a moving picture, which a notebook shows as what is there."""

    def _repr_html_(self) -> str:
        from base64 import b64encode

        data = b64encode(self.read_bytes()).decode("ascii")
        if self.suffix == ".gif":
            return f'<img src="data:image/gif;base64,{data}">'
        return f'<video controls loop src="data:video/mp4;base64,{data}"></video>'


def _write_gif(path: Path, reel: Reel, fps: int, update: Any) -> None:
    """All frames with Pillow in the same 256 colours, for ever from the beginning."""
    from PIL import Image
    from scipy.spatial import cKDTree

    pictures: list[Image.Image] = []
    for figure in reel.frames():
        pixels = np.asarray(figure.canvas.buffer_rgba())[..., :3]  # type: ignore[attr-defined]
        if not pictures:
            colours = _palette(reel.scale, pixels)
            tree = cKDTree(colours)
        code, where = np.unique(pixels.astype(np.int32) @ (65536, 256, 1), return_inverse=True)
        nearest = tree.query(np.column_stack([code >> 16, code >> 8 & 255, code & 255]))[1]
        picture = Image.fromarray(nearest.astype(np.uint8)[where].reshape(pixels.shape[:2]))
        picture.putpalette(colours.astype(np.uint8).tobytes())
        pictures.append(picture)
        update()
    rest, duration = pictures[1:], round(1000.0 / fps)
    pictures[0].save(path, "GIF", save_all=True, append_images=rest, duration=duration, loop=0)


def _palette(scale: Scale, pixels: Any) -> Floats:
    """256 colours (256, 3), 0 to 255: the scale's, curves and greys on white, a picture's most frequent."""
    from matplotlib.colors import to_rgb
    from PIL import Image

    curves = np.array([to_rgb(colour) for colour in (BLUE, VERMILION, GREEN, BLACK)])
    paler = [1.0 - share * (1.0 - curves) for share in np.linspace(1.0, 0.0, SHADES)]
    fixed = np.concatenate([scale.colour_map()(np.linspace(0.0, 1.0, OF_SCALE))[:, :3], *paler])
    others = 256 - len(fixed)
    frequent = Image.fromarray(pixels).quantize(others).convert("RGB").getcolors(others) or []
    found = np.array([colour for _, colour in frequent], dtype=float).reshape(-1, 3)
    return np.concatenate([(255.0 * fixed).round(), found, np.zeros((others - len(found), 3))])


def _write_mp4(path: Path, reel: Reel, fps: int, update: Any) -> None:
    from matplotlib.animation import FFMpegWriter

    writer = FFMpegWriter(fps=fps, extra_args=["-f", "mp4"])
    try:
        with writer.saving(reel.figure, str(path), DPI):
            for _ in reel.frames():
                writer.grab_frame()
                update()
    except CalledProcessError as error:
        raise StorageError(f"cannot write the .mp4: ffmpeg ended with {error.returncode}") from error


@dataclass(frozen=True, eq=False)
class Reel:
    """The frames of a result, each with its window, on one scale, in one figure."""

    views: Sequence[View | SkinView]
    windows: list[Window]
    scale: Scale
    figure: Figure

    def frames(self) -> Iterator[Figure]:
        """The figure, drawn for one frame after the other."""
        result, field = self.views[0].result, self.views[0].field
        heights = figure_height(self.windows[0]), CURVES_HEIGHT
        above, below = self.figure.subplots(2, 1, height_ratios=heights)
        column = abscissa(result)
        forces(result, column, ax=below)
        below.set_ylabel(on_lines(below.get_ylabel()))
        below.get_legend().remove()  # beside the axes, where no mark passes
        self.figure.legend(loc="outside lower center", ncols=4, frameon=False, fontsize="small")
        bar = None
        for view, window in zip(self.views, self.windows, strict=True):
            above.clear()
            mapped = view.draw(above, window, self.scale)
            above.set_title(told(result, view.frame), fontsize="medium")
            if bar is None:
                bar = add_colorbar(mapped, above, "", self.scale.extend)
                label_bar(bar, field, self.scale)
                self.figure.align_ylabels([above, below])
            at = getattr(result, column)[result.step == view.frame.step]
            marks = [below.axvline(x, color="0.3", linewidth=1.0) for x in at]
            self.figure.canvas.draw()
            self.figure.set_layout_engine("none")  # the first frame's layout is that of all
            yield self.figure
            for mark in marks:
                mark.remove()


def make_reel(result: Result, field: str, near: Near, limits: tuple[float | None, float | None]) -> Reel:
    """Views, windows and scale of all frames of a result, and an empty figure for them."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    kind = SkinView if result.mesh.dim == 3 else View
    views = [kind(result, frame, field) for frame in result.frames]
    windows = _windows(views, near)
    shown = [view.shown(window) for view, window in zip(views, windows, strict=True)]
    scale = scale_of(views[0].scaled_as, np.concatenate(shown), *limits)
    tall = 2.0 * round(0.5 * DPI * (figure_height(windows[0]) + CURVES_HEIGHT)) / DPI  # even, for ffmpeg
    figure = Figure(figsize=(WIDTH, tall), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    return Reel(views, windows, scale, figure)


def _windows(views: Sequence[View | SkinView], near: Near) -> list[Window]:
    """A window for each view, all of one size: around all of them, or a close-up that goes along."""
    found = np.array([view.window(near) for view in views])
    x = np.array([view.frame.position if near == "contact" else 0.0 for view in views])
    found[:, :2] -= x[:, None]
    (left, _, bottom, _), (_, right, _, top) = found.min(axis=0), found.max(axis=0)
    return [(left + at, right + at, bottom, top) for at in x.tolist()]
