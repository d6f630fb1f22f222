"""Parts of one's own, each from scratch in under fifteen lines; mypy checks them against the protocols."""

import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from tools.builders import INSULATOR, SKIN
from tools.meshes import block
from tools.refusals import refuses

import evfem as ev
from evfem.errors import InputError
from evfem.protocols import CompleteSurface, Observer, Surface
from evfem.surface.usersurface import completed
from evfem.tensor import ddot, det, inv, transpose

FLAT = ev.Flat(friction=0.3)
PRESS, SLIDE = ev.Press(indentation=0.15, steps=2), ev.Slide(distance=0.5, steps=3)


def pad(material: Any = None) -> ev.MeshedFinger:
    """A block, 4 mm wide and 2 mm high, its lower side curved."""
    return ev.MeshedFinger(block(sag=0.3), {"tissue": material or ev.NeoHookean(E=0.1, nu=0.4)}, SKIN)


class ConstantPull:
    """An electrostatic law: the same traction at every gap (MPa)."""

    def traction(self, gap: Any, voltage: Any, layers: Any) -> Any:
        return 1e-9 * voltage**2 + 0.0 * gap


class Tissue:
    """A material by its energy: neo-Hookean with the Lame constants of E = 0.1 MPa, nu = 0.4."""

    mu, lmbda = 0.1 / 2.8, 0.1 * 0.4 / (1.4 * 0.2)

    def psi(self, F: Any) -> Any:
        J = det(F)
        return 0.5 * self.mu * (ddot(F, F) - 3.0 - 2.0 * np.log(J)) + 0.5 * self.lmbda * np.log(J) ** 2


class StressedTissue(Tissue):
    """The same material by its stress."""

    def P(self, F: Any) -> Any:
        G = transpose(inv(F))
        return self.mu * (F - G) + self.lmbda * np.log(det(F)) * G


class Waves:
    """A surface: one sine of 0.02 mm."""

    friction = 0.2

    def height(self, x: Any) -> Any:
        return 0.02 * np.sin(6.0 * x)


@ev.form
def weight(u: Any, v: Any, w: Any) -> Any:
    """A weak form: weight of 1e-3 N/mm3, in the residual of the internal forces."""
    return 1e-3 * v[1]


class Progress:
    """An observer that says how far the run is."""

    def started(self, mesh: Any, scene: Any, total_steps: int) -> None:
        self.total, self.lines = total_steps, [f"{len(mesh.points)} nodes"]

    def step(self, row: Mapping[str, Any], frame: Any, checkpoint: Callable[[], dict[str, Any]]) -> None:
        self.lines.append(f"{row['motion']} {row['step']}/{self.total}")


class LivePlot:
    """An observer that draws the forces anew after every step."""

    def __init__(self, path: Path) -> None:
        self.path, self.rows = path, list[tuple[float, float]]()

    def step(self, row: Mapping[str, Any], frame: Any, checkpoint: Callable[[], dict[str, Any]]) -> None:
        self.rows.append((row["step"], row["normal_force"]))
        figure = Figure()
        figure.add_subplot().plot(*np.array(self.rows).T, "o-")
        figure.savefig(self.path)


class StopAtForce:
    """An observer that ends the run once the pad is pressed hard enough."""

    def __init__(self, force: float) -> None:
        self.force = force

    def step(self, row: Mapping[str, Any], frame: Any, checkpoint: Callable[[], dict[str, Any]]) -> None:
        if row["normal_force"] >= self.force:
            raise ev.StopRun(f"{self.force} N/mm reached")


@pytest.mark.parametrize(
    "part", [ConstantPull, Tissue, StressedTissue, Waves, weight.function, Progress, LivePlot, StopAtForce]
)
def test_a_part_is_short_and_inherits_nothing_of_ours(part: Any) -> None:
    assert len(inspect.getsource(part).splitlines()) < 15
    assert not [base for base in getattr(part, "__mro__", ()) if base.__module__.startswith("evfem")]


def test_own_law_pulls_with_its_traction_on_the_projected_width() -> None:
    display = ev.Display(insulator=INSULATOR)
    law = ConstantPull()
    result = ev.simulate(ev.Scene(pad(), display, law=law, voltage=1000.0, motion=ev.Hover(gap=1.0)))
    moved = result.mesh.points + result.frames[-1].displacement
    x = moved[result.mesh.node_sets["pad"], 0]
    assert result.electrostatic_force[0] == pytest.approx(1e-3 * np.ptp(x), rel=1e-12)
    assert np.ptp(x) == pytest.approx(4.0, rel=0.05)


def test_own_surface_is_the_built_in_one() -> None:
    sine = ev.Sinusoid(friction=0.2, terms=[[0.02, 6.0, 0.0]])
    ours, own = (ev.simulate(ev.Scene(pad(), surface, motion=[PRESS, SLIDE])) for surface in (sine, Waves()))
    np.testing.assert_allclose(own.normal_force, ours.normal_force, rtol=1e-7)
    np.testing.assert_allclose(own.tangential_force, ours.tangential_force, rtol=1e-6, atol=1e-9)


def test_progress_and_live_plot_see_every_step(tmp_path: Path) -> None:
    progress, plot = Progress(), LivePlot(tmp_path / "live.png")
    observers: list[Observer] = [progress, plot]
    result = ev.simulate(ev.Scene(pad(), FLAT, motion=[PRESS, SLIDE]), observers=observers)
    assert progress.lines == ["153 nodes", "press 1/5", "press 2/5", "slide 3/5", "slide 4/5", "slide 5/5"]
    assert [force for _, force in plot.rows] == result.normal_force.tolist()
    assert (tmp_path / "live.png").read_bytes().startswith(b"\x89PNG")


def test_a_stop_returns_the_result_so_far() -> None:
    scene = ev.Scene(pad(), FLAT, motion=ev.Press(indentation=0.3, steps=6), output=ev.Output(every=100))
    whole = ev.simulate(scene)
    force = whole.normal_force[2]
    after = Progress()
    result = ev.simulate(scene, observers=[StopAtForce(float(force)), after])
    assert len(after.lines) == 1 + 3  # whoever stops, everybody is told of the step
    assert result.normal_force.tolist() == whole.normal_force[:3].tolist()
    assert result.provenance["stopped"] == f"{float(force)} N/mm reached"
    assert not result.summary()["complete"]
    assert [frame.step for frame in result.frames] == [3]  # its last fields are kept
    assert "stopped" not in whole.provenance


def test_observers_hear_of_the_end_of_a_stopped_run() -> None:
    class Ending:
        def finished(self, result: Any) -> None:
            self.steps = len(result.step)

    ending = Ending()
    ev.simulate(ev.Scene(pad(), FLAT, motion=[PRESS, SLIDE]), observers=[StopAtForce(0.0), ending])
    assert ending.steps == 1


def test_a_stop_before_the_first_step_is_an_error() -> None:
    class Never:
        def started(self, mesh: Any, scene: Any, total_steps: int) -> None:
            raise ev.StopRun("not today")

    with pytest.raises(ev.StopRun, match="not today"):
        ev.simulate(ev.Scene(pad(), FLAT, motion=[PRESS]), observers=[Never()])


@pytest.mark.parametrize("deaf", [object(), None, "progress", lambda row: None])
def test_an_observer_that_would_be_told_of_nothing_is_refused_before_the_run(deaf: Any) -> None:
    heard = Progress()
    words = r"observers\[1\]: given .*; allowed: an object with started\(mesh, scene, total_steps\), step\("
    refuses(words, ev.simulate, ev.Scene(pad(), FLAT, motion=[PRESS]), observers=[heard, deaf])
    assert not hasattr(heard, "lines")


class RealWaves(Waves):
    """A height that drops the imaginary part."""

    def height(self, x: Any) -> Any:
        return 0.02 * np.sin(6.0 * np.real(x))


class TableWaves:
    """A height that cannot take complex numbers, with friction of its own."""

    def height(self, x: Any) -> Any:
        grid = np.linspace(-4.0, 4.0, 9)
        return np.interp(x, grid, 0.1 * grid)

    def friction_coefficient(self, x: Any) -> Any:
        return 0.3 + 0.1 * x


@pytest.mark.parametrize(("waves", "error"), [(Waves(), 1e-8), (RealWaves(), 1e-6)])
def test_derivatives_of_own_heights(waves: Surface, error: float) -> None:
    x = np.linspace(-1.0, 1.0, 31)
    own = completed(waves)
    assert isinstance(own, CompleteSurface)
    np.testing.assert_array_equal(own.height(x), 0.02 * np.sin(6.0 * x))
    np.testing.assert_allclose(own.slope(x), 0.12 * np.cos(6.0 * x), atol=1e-11)
    np.testing.assert_allclose(own.curvature(x), -0.72 * np.sin(6.0 * x), atol=error)
    assert own.friction_coefficient(x).tolist() == [0.2] * 31
    assert own.shifted(-0.5).y == -0.5
    assert own.y is None


def test_own_friction_and_derivatives_are_used() -> None:
    class Told(TableWaves):
        y = -0.25
        insulator = INSULATOR

        def slope(self, x: Any) -> Any:
            return 7.0 + 0.0 * x

        def curvature(self, x: Any) -> Any:
            return 8.0 + 0.0 * x

    x = np.array([0.5, 1.5])
    own, told = completed(TableWaves()), completed(Told())
    np.testing.assert_allclose(own.slope(x), 0.1, rtol=1e-10)
    np.testing.assert_allclose(own.friction_slope(x), 0.1, rtol=1e-9)
    assert own.friction_coefficient(x).tolist() == pytest.approx([0.35, 0.45])
    assert (own.has_friction, own.friction_jumps.shape, own.insulator) == (True, (0, 3), None)
    assert (told.slope(x).tolist(), told.curvature(x).tolist()) == ([7.0, 7.0], [8.0, 8.0])
    assert (told.y, told.insulator) == (-0.25, INSULATOR)


def test_objects_that_are_no_surface() -> None:
    class Rough(Waves):
        friction = -1.0

    no_surfaces: list[Any] = [object(), int, 3.0]
    for wrong in no_surfaces:
        with pytest.raises(InputError, match=r"surface: given .*an object with a method height\(x\)"):
            ev.Scene(pad(), wrong, motion=[PRESS])
    classes: list[Any] = [Waves, ev.Flat]
    for kind in classes:
        with pytest.raises(InputError, match=f"surface: given the class {kind.__name__}; allowed: an object"):
            ev.Scene(pad(), kind, motion=[PRESS])
    refuses(r"surface\.friction: given -1\.0", ev.Scene, pad(), Rough(), motion=[PRESS])
