"""Pictures show themselves once: by `plt.show()`, below a notebook's cell, or as its last line."""

import subprocess
import sys

import pytest
from matplotlib.figure import Figure
from tools.fakes import fake_result

from evfem.plotting import contact_pressure, deformed, forces, history, signal

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


def printed(code, folder, backend="agg"):
    """What a new process prints, in which pyplot has that backend; warnings are errors."""
    (folder / "showing.py").write_text(BACKEND)
    paths = [str(folder), *sys.path]
    begin = f"import sys, os; sys.path[:0] = {paths!r}; os.environ['MPLBACKEND'] = {backend!r}\n"
    words = [sys.executable, "-W", "error", "-c", begin + code]
    done = subprocess.run(words, capture_output=True, text=True, cwd=folder)
    assert done.returncode == 0, done.stderr
    return done.stdout.split("\n")[:-1]


def test_matplotlib_is_loaded_only_when_something_is_drawn_and_pyplot_never(tmp_path):
    code = (
        "import sys, evfem.plotting as p; assert 'matplotlib' not in sys.modules\n"
        "from tools.fakes import fake_result; p.forces(fake_result()).figure.savefig('f.png')\n"
        "print('matplotlib' in sys.modules, 'matplotlib.pyplot' in sys.modules)"
    )
    assert printed(code, tmp_path) == ["True False"]


def test_show_shows_what_was_drawn(tmp_path):
    code = "import matplotlib.pyplot as plt\n" + DRAW
    code += "p.forces(result); p.deformed(result); p.signal(result); plt.show(); plt.close('all'); plt.show()"
    assert printed(code, tmp_path, "module://showing") == ["shown 3", "shown 0"]


def test_a_notebook_shows_a_picture_once(tmp_path):
    """What pyplot shows below the cell, the last line does not show again; afterwards it does."""
    code = "import matplotlib.pyplot as plt\n" + DRAW
    code += (
        "for drawn in p.forces(result), p.history(result, ['voltage']):\n"
        "    print(drawn._repr_png_())\n"
        "    plt.close(drawn.figure)\n"
        "    print(drawn._repr_png_()[:4])\n"
    )
    assert printed(code, tmp_path, "module://showing") == ["None", repr(PNG)] * 2


def test_nothing_stays_open_where_nothing_can_be_shown(tmp_path):
    code = "import matplotlib.pyplot as plt\n" + DRAW
    code += "[p.forces(result) for _ in range(30)]; print(plt.get_fignums())"
    assert printed(code, tmp_path) == ["[]"]


@pytest.mark.parametrize("draw", [forces, deformed, signal, lambda r: history(r, ["voltage", "step"])])
def test_the_last_line_of_a_cell_is_the_picture(draw):
    picture = draw(fake_result())._repr_png_()
    assert picture.startswith(PNG)
    assert len(picture) > 5000


def test_a_picture_can_be_kept_and_loaded(tmp_path):
    """Matplotlib's own way to keep a figure that can still be changed."""
    code = DRAW + "import pickle\nback = pickle.loads(pickle.dumps(p.deformed(result)))\n"
    code += "print(back.get_xlabel(), back._repr_png_()[:4])"
    assert printed(code, tmp_path) == [f"x (mm) {PNG!r}"]


def test_given_axes_are_left_to_their_figure():
    ax = Figure().add_subplot()
    for draw in (forces, contact_pressure, deformed):
        assert draw(fake_result(), ax=ax) is ax
    assert not hasattr(ax, "_repr_png_")
