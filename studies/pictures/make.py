"""The pictures of README and pages: `python studies/pictures/make.py [PICTURE...]` draws them again.

Those of the studies come from `evfem study NAME --out docs/pictures`.
"""

import re
import shutil
import sys
from collections.abc import Iterable
from contextlib import chdir
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import evfem as ev
from evfem import plotting
from evfem.simulation.result import Frame, Result

README = Path(__file__).with_name("slide.png")
WHORL = ev.Fingertip(resolution="coarse", ridges="whorl")
#: the picture of a print on a texture, which takes minutes
RELIEF = "relief.png"
DOCS = Path(__file__).resolve().parents[2] / "docs"
#: picture in docs/pictures -> the page that shows it, and the file that this page's code writes; the code of
#: "paraview.png" needs evfem[vtk]
OF_PAGES = {
    "howto-layers.png": ("howto/finger.md", "layers.png"),
    "howto-nail.png": ("howto/fingertip.md", "nail.png"),
    "howto-residuals.png": ("howto/fit.md", "residuals.png"),
    "tutorial-forces.png": ("tutorial.md", "forces.png"),
    "tutorial-deformed.png": ("tutorial.md", "deformed.png"),
    "paraview.png": ("howto/paraview.md", "pad.png"),
    "pictures-contact.png": ("howto/pictures.md", "contact.png"),
    "pictures-stress.png": ("howto/pictures.md", "stress.png"),
    "pictures-beside.png": ("howto/pictures.md", "beside.png"),
    "pictures-slide.gif": ("howto/pictures.md", "slide.gif"),
    "amplifier.png": ("howto/amplifier.md", "amplifier.png"),
    "touchscreen.png": ("howto/touchscreen.md", "touchscreen.png"),
    "probes-marks.png": ("howto/probes.md", "marks.png"),
    "probes-history.png": ("howto/probes.md", "probes.png"),
}
EXAMPLES = (
    "pressure stress whole status slide stiffness area tractions energies layers electrovibration hover "
)
EXAMPLES += (
    "textures laws spectrum history rendered texture beside sweep map samples footprint insulator design edge"
)
for name in EXAMPLES.split():
    file = f"{name}.gif" if name == "slide" else f"{name}.png"
    OF_PAGES[f"gallery-{file}"] = ("gallery.md", file)
CODE = re.compile(r"^(<!-- not run: .+? -->\n)?```python\n(.*?)^```$", re.M | re.S)


def touchscreen_slides(finger: ev.Fingertip = WHORL) -> dict[str, Result]:
    """A finger under 0.3 N that slides over a touchscreen, without voltage and at 150 V and 5 kHz."""
    scene = ev.Scene(
        finger,
        ev.Display(ev.TOUCHSCREEN, friction=0.4),
        ev.StrongTroxel(),
        150.0 / np.sqrt(2.0),
        [ev.Press(force=0.3, steps=2), ev.Slide(distance=0.5, steps=10, hold="force")],
        drive=ev.Drive(5000.0, skin="gabriel_dry", gap_conductivity=1e-8),
        roughness_gap=ev.ConstantRoughness(0.005, distribution="gaussian"),
    )
    off = replace(scene, voltage=0.0, drive=None, law=None, roughness_gap=0.0)
    return {"150 V": ev.simulate(scene), "0 V": ev.simulate(off)}


def draw_story(results: dict[str, Result], path: Path = README) -> plotting.figures.Panels:
    """Friction over the position, what sticks while some of the skin slips, and the attraction, with letters
    that are read where the picture is 390 pixels wide.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    on, near = results["150 V"], (-2.9, 2.9, -4.1, 4.1)
    begun = int(np.argmax([_slipping(frame) for frame in on.frames]))
    with rc_context({"font.size": 15.0, "axes.titlesize": 15.0, "lines.linewidth": 2.5}):
        figure = Figure(figsize=(9.0, 3.4), layout="constrained")
        figure.get_layout_engine().set(wspace=0.06, rect=(0.0, 0.0, 0.98, 1.0))
        left, middle, right = panels = figure.subplots(1, 3, width_ratios=(1.4, 1.0, 1.0))
        plotting.friction(results, over="position", ax=left).set(xlabel="position (mm)", ylabel="")
        plotting.footprint(on, "contact_status", begun, middle, near=near).set(xticks=[], yticks=[])
        plotting.footprint(on, "electrostatic_traction", begun, right, near=near).set(xticks=[], yticks=[])
        for ax, title in zip(panels, ("friction coefficient", "what slips", "attraction (kPa)"), strict=True):
            ax.set_title(title, fontsize="medium")
        for ax in figure.axes[1:]:
            ax.set(xlabel="", ylabel="")
        figure.savefig(path, dpi=130)
    return plotting.figures.Panels(panels)


def _slipping(frame: Frame) -> float:
    """How far the touching nodes are from all sticking or all slipping: 0.25 where half of them slip."""
    slip = np.mean(frame.contact_status[frame.contact_status > 0] == 2)
    return float(slip * (1.0 - slip))


def draw_relief(path: Path) -> None:
    """Press a print on waves along x and z and slide it askew; draw pressures, then what sticks and slips."""
    from matplotlib.figure import Figure

    finger = ev.Fingertip(resolution="coarse", ridges="whorl", ridge_width=0.6)
    eggs = ev.Sinusoid(terms=[[0.08, 2.0, 0.0], [0.08, 2.0, 0.0, 90.0]], friction=0.3)
    motion = [ev.Press(force=0.5, steps=4), ev.Slide(0.06, steps=1, angle=45.0, hold="force")]
    result = ev.simulate(ev.Scene(finger, eggs, motion=motion))
    figure = Figure(figsize=(9.6, 4.6), layout="constrained")
    figure.get_layout_engine().set(wspace=0.06)
    titles = "pressed to 0.5 N", "slid 0.06 mm towards 45 degrees"
    for ax, field, frame, title in zip(
        figure.subplots(1, 2), ("contact_pressure", "contact_status"), (3, 4), titles, strict=True
    ):
        plotting.footprint(result, field, frame, ax, near=(-5.0, 5.0, -5.0, 5.0)).set_title(title)
        x, z = np.meshgrid(*[np.linspace(-5.0, 5.0, 200)] * 2)
        height = eggs.relief(np.stack([x, z], axis=-1))[0]
        ax.contour(x, z, height, levels=[-0.08, 0.0, 0.08], colors="0.5", linewidths=0.6)
    figure.savefig(path, dpi=75)


def draw_from_page(page: str, pictures: Iterable[str]) -> None:
    """Run the Python blocks of the page in a folder of their own and keep the pictures."""
    code = "\n".join(block for mark, block in CODE.findall((DOCS / page).read_text("utf-8")) if not mark)
    with TemporaryDirectory() as folder, chdir(folder):
        exec(compile(code, page, "exec"), {"__name__": "page"})
        for picture in pictures:
            shutil.copyfile(OF_PAGES[picture][1], DOCS / "pictures" / picture)


def main(names: list[str]) -> None:
    """Draw the named pictures, or all of them; each page is run once."""
    wanted = names or [README.name, RELIEF, *OF_PAGES]
    if README.name in wanted:
        draw_story(touchscreen_slides())
    if RELIEF in wanted:
        draw_relief(DOCS / "pictures" / RELIEF)
    pages: dict[str, list[str]] = {}
    for name in wanted:
        if name not in (README.name, RELIEF):
            pages.setdefault(OF_PAGES[name][0], []).append(name)
    for page, pictures in pages.items():
        draw_from_page(page, pictures)


if __name__ == "__main__":
    main(sys.argv[1:])
