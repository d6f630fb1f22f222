"""Pictures show themselves once: by `plt.show()`, below a notebook's cell, or as its last line."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from tools.commands import printed
from tools.fakes import fake_result
from tools.refusals import refuses
from tools.solids import block

import evfem as ev
from evfem import plotting
from evfem.calibration.result import FitResult
from evfem.mesh.mesh import raised
from evfem.plotting import contact_pressure, deformed, forces, history, impedance, signal
from evfem.plotting.figures import REGIONS
from evfem.plotting.meshes import DIMMEST, EYE, regions
from evfem.response.impedance import Impedance

PNG = b"\x89PNG"
#: a backend that tells which figures `plt.show()` shows, instead of opening windows
BACKEND = """
from matplotlib.backend_bases import FigureManagerBase
from matplotlib.backends.backend_agg import FigureCanvasAgg

class FigureManager(FigureManagerBase):
    @classmethod
    def pyplot_show(cls, *, block=None):
        from matplotlib._pylab_helpers import Gcf
        print("shown", len(Gcf.get_all_fig_managers()))

class FigureCanvas(FigureCanvasAgg):
    manager_class = FigureManager
"""
DRAW = "from tools.fakes import fake_result; from evfem import plotting as p; result = fake_result()\n"


def shown(code, folder, backend="agg"):
    """The lines that a new process prints, in which pyplot has that backend; warnings are errors."""
    (folder / "showing.py").write_text(BACKEND)
    return printed(code, folder, MPLBACKEND=backend, PYTHONWARNINGS="error").splitlines()


def test_matplotlib_is_loaded_only_when_something_is_drawn_and_pyplot_never(tmp_path):
    code = (
        "import sys, evfem.plotting as p; assert 'matplotlib' not in sys.modules\n"
        "from tools.fakes import fake_result; p.forces(fake_result()).figure.savefig('f.png')\n"
        "print('matplotlib' in sys.modules, 'matplotlib.pyplot' in sys.modules)"
    )
    assert shown(code, tmp_path) == ["True False"]


def test_show_shows_what_was_drawn(tmp_path):
    code = "import matplotlib.pyplot as plt\n" + DRAW
    code += "p.forces(result); p.deformed(result); p.signal(result); plt.show(); plt.close('all'); plt.show()"
    assert shown(code, tmp_path, "module://showing") == ["shown 3", "shown 0"]


def test_a_notebook_shows_a_picture_once(tmp_path):
    """What pyplot shows below the cell, the last line does not show again; afterwards it does."""
    code = "import matplotlib.pyplot as plt\n" + DRAW
    code += (
        "for drawn in p.forces(result), p.history(result, ['voltage']):\n"
        "    print(drawn._repr_png_())\n"
        "    plt.close(drawn.figure)\n"
        "    print(drawn._repr_png_()[:4])\n"
    )
    assert shown(code, tmp_path, "module://showing") == ["None", repr(PNG)] * 2


def test_nothing_stays_open_where_nothing_can_be_shown(tmp_path):
    code = "import matplotlib.pyplot as plt\n" + DRAW
    code += "[p.forces(result) for _ in range(30)]; print(plt.get_fignums())"
    assert shown(code, tmp_path) == ["[]"]


@pytest.mark.parametrize("draw", [forces, deformed, signal, lambda r: history(r, ["voltage", "step"])])
def test_the_last_line_of_a_cell_is_the_picture(draw):
    picture = draw(fake_result())._repr_png_()
    assert picture.startswith(PNG)
    assert len(picture) > 5000


def test_a_picture_can_be_kept_and_loaded(tmp_path):
    """Matplotlib's own way to keep a figure that can still be changed."""
    code = DRAW + "import pickle\nback = pickle.loads(pickle.dumps(p.deformed(result)))\n"
    code += "print(back.get_xlabel(), back._repr_png_()[:4])"
    assert shown(code, tmp_path) == [f"x (mm) {PNG!r}"]


def test_given_axes_are_left_to_their_figure():
    ax = Figure().add_subplot()
    for draw in (forces, contact_pressure, deformed):
        assert draw(fake_result(), ax=ax) is ax
    assert not hasattr(ax, "_repr_png_")


def fitted(with_sd):
    """Three forces and two widths, computed 1, -2, 3, -4 and 5 sd beside what was measured."""
    measured, scale = np.array([10.0, 20.0, 30.0, 4.0, 5.0]), np.array([2.0, 2.0, 2.0, 0.5, 0.5])
    names = [f"normal_force at indentation {x}" for x in (0.1, 0.2, 0.3)]
    names += [f"contact_width.last, motion.0.gap {x}" for x in (0.1, 0.2)]
    return FitResult(
        parameters={"surface.friction": ev.Parameter(0.1, 1.0)},
        values={"surface.friction": 0.3},
        unknowns=np.zeros(1),
        errors=np.ones(1),
        correlation=np.eye(1),
        singular_values=np.ones(1),
        names=names,
        measured=measured,
        predicted=measured + scale * np.array([1.0, -2.0, 3.0, -4.0, 5.0]),
        scale=scale,
        warnings=(),
        tables={},
        paths=Path(),
        provenance={"sd": with_sd},
    )


@pytest.mark.parametrize(("with_sd", "factor", "unit"), [(True, 1.0, "sd"), (False, 100.0, "%")])
def test_residuals_are_computed_minus_measured_over_their_scale(with_sd, factor, unit):
    ax = plotting.residuals(fitted(with_sd))
    drawn = {line.get_label(): line.get_xydata() for line in ax.lines if line.get_marker() == "o"}
    assert list(drawn) == ["normal force", "contact width"]
    np.testing.assert_allclose(drawn["normal force"], [[1, factor], [2, -2 * factor], [3, 3 * factor]])
    np.testing.assert_allclose(drawn["contact width"], [[4, -4 * factor], [5, 5 * factor]])
    assert f"({unit}" in ax.get_ylabel()
    bands = [patch for patch in ax.patches if patch.get_label() == "two standard deviations"]
    assert len(bands) == with_sd


def made(unit="N/mm"):
    return Impedance(np.array([1.0, 10.0, 100.0]), np.array([1.0, 1.0 + 1.0j, -2.0]), "normal", unit)


def test_magnitude_and_phase():
    upper, lower = impedance({"one": made(), "other": made()})
    np.testing.assert_allclose(upper.get_lines()[0].get_ydata(), [1.0, np.sqrt(2.0), 2.0])
    np.testing.assert_allclose(lower.get_lines()[1].get_ydata(), [0.0, 45.0, 180.0])
    assert upper.get_ylabel() == "magnitude (N/mm)"
    assert lower.get_xlabel() == "frequency (Hz)"
    assert lower.get_legend() is None
    assert len(impedance(made())) == 2


@pytest.mark.parametrize("found", [{}, {"one": made(), "other": made("N/mm per mm")}])
def test_what_cannot_be_drawn_together_is_refused(found):
    with pytest.raises(ev.InputError, match="found: given"):
        impedance(found)


SIZE = (2.0, 3.0, 4.0)


def solid(order):
    mesh = block((2, 3, 4), SIZE, split=lambda x, y, z: y > 1.0)
    return raised(mesh) if order == 2 else mesh


@pytest.mark.parametrize("order", [1, 2])
def test_faces_towards_the_eye_are_drawn(order):
    """Three sides of the block, as wide as they look from there, shaded colours of the regions."""
    ax = regions(solid(order))
    polygons, *_ = ax.collections
    paths = [path.vertices[:-1] for path in polygons.get_paths()]
    assert len(paths) == 2 * 3 + 2 * 2 + 3 * 2
    assert {len(path) for path in paths} == {4 if order == 1 else 8}
    x, y = (np.array([path[:, i] for path in paths]) for i in (0, 1))
    drawn = 0.5 * np.abs((x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1)).sum()
    towards = np.abs(EYE / np.linalg.norm(EYE))
    assert drawn == pytest.approx(towards @ [3.0 * 2.0, 2.0 * 2.0, 2.0 * 3.0])
    plain = np.array([to_rgb(colour) for colour in REGIONS[:2]])
    colours = polygons.get_facecolors()[:, None, :3]
    factor = (colours * plain).sum(axis=2) / (plain**2).sum(axis=1)
    own = np.abs(colours - factor[..., None] * plain).max(axis=2) < 1e-12
    assert own.any(axis=0).all()
    assert (own.sum(axis=1) == 1).all()
    assert ((factor[own] >= DIMMEST) & (factor[own] <= 1.0)).all()
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["lower", "upper"]


def test_what_is_no_result_is_named(tmp_path):
    """Where a result belongs people hand over its scene, its folder, or results without names."""
    scene = ev.Scene(ev.FingerPad(), ev.Flat(), motion=[ev.Press(force=0.05)])
    p = plotting
    alone = (p.forces, p.energies, p.probes, p.contact_pressure, p.deformed, p.footprint, p.friction)
    more = partial(p.history, columns=["gap"]), partial(p.animate, path=tmp_path / "a.gif")
    for draw in (*alone, p.signal, p.spectrum, *more):
        refuses("a Scene; allowed: a result, as ev.simulate", draw, scene)
        refuses("a str; allowed: a result", draw, "run")
    refuses("a list; allowed: a result", p.compare, [fake_result()], "gap")
    refuses("a Scene; allowed: a result", p.side_by_side, {"mine": scene})
