"""The pictures of README and pages: `python studies/pictures/make.py [PICTURE...]` draws them
again.

Those of the studies come from `evfem study NAME --out docs/pictures`.
"""

import re
import shutil
import sys
from collections.abc import Iterable
from contextlib import chdir
from pathlib import Path
from tempfile import TemporaryDirectory

import evfem as ev
from evfem import plotting

README = Path(__file__).with_name("slide.png")
DOCS = Path(__file__).resolve().parents[2] / "docs"
#: picture in docs/pictures -> the page that shows it, and the file that this page's code writes; the code of
#: "paraview.png" needs evfem[vtk]
OF_PAGES = {
    "howto-layers.png": ("howto/finger.md", "layers.png"),
    "howto-residuals.png": ("howto/fit.md", "residuals.png"),
    "tutorial-forces.png": ("tutorial.md", "forces.png"),
    "tutorial-deformed.png": ("tutorial.md", "deformed.png"),
    "paraview.png": ("howto/paraview.md", "pad.png"),
    "pictures-contact.png": ("howto/pictures.md", "contact.png"),
    "pictures-stress.png": ("howto/pictures.md", "stress.png"),
    "pictures-beside.png": ("howto/pictures.md", "beside.png"),
    "pictures-slide.gif": ("howto/pictures.md", "slide.gif"),
    "probes-marks.png": ("howto/probes.md", "marks.png"),
    "probes-history.png": ("howto/probes.md", "probes.png"),
}
EXAMPLES = (
    "pressure stress whole status slide stiffness area tractions energies layers electrovibration hover "
)
EXAMPLES += "textures laws spectrum history rendered texture beside sweep map samples footprint"
for name in EXAMPLES.split():
    file = f"{name}.gif" if name == "slide" else f"{name}.png"
    OF_PAGES[f"gallery-{file}"] = ("gallery.md", file)
CODE = re.compile(r"^(<!-- not run: .+? -->\n)?```python\n(.*?)^```$", re.M | re.S)


def draw_readme(path: Path = README) -> None:
    """Run the README's example and draw forces, pad and contact pressure."""
    from matplotlib.figure import Figure

    finger = ev.FingerPad()
    display = ev.Display(insulator=ev.Layer(thickness=0.09, eps_r=3.35), friction=0.3)
    motion = [ev.Press(force=0.05), ev.Slide(distance=2.0, steps=40, hold="force")]
    scene = ev.Scene(
        finger, display, law=ev.Kaczmarek(), voltage=1000.0, motion=motion, output=ev.Output(every=50)
    )
    result = ev.simulate(scene)
    figure = Figure(figsize=(13.0, 4.0), layout="constrained")
    figure.get_layout_engine().set(wspace=0.04)
    left, middle, right = figure.subplots(1, 3, width_ratios=[1.0, 1.45, 1.1])
    plotting.forces(result, ax=left)
    plotting.deformed(result, ax=middle)
    plotting.contact_pressure(result, ax=right).set_title("tractions along the pad", fontsize="medium")
    figure.savefig(path, dpi=90)


def draw_from_page(page: str, pictures: Iterable[str]) -> None:
    """Run the Python blocks of the page in a folder of their own and keep the pictures."""
    code = "\n".join(block for mark, block in CODE.findall((DOCS / page).read_text("utf-8")) if not mark)
    with TemporaryDirectory() as folder, chdir(folder):
        exec(compile(code, page, "exec"), {"__name__": "page"})
        for picture in pictures:
            shutil.copyfile(OF_PAGES[picture][1], DOCS / "pictures" / picture)


def main(names: list[str]) -> None:
    """Draw the named pictures, or all of them; each page is run once."""
    wanted = names or [README.name, *OF_PAGES]
    if README.name in wanted:
        draw_readme()
    pages: dict[str, list[str]] = {}
    for name in wanted:
        if name != README.name:
            pages.setdefault(OF_PAGES[name][0], []).append(name)
    for page, pictures in pages.items():
        draw_from_page(page, pictures)


if __name__ == "__main__":
    main(sys.argv[1:])
