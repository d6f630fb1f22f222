"""Path dependence of a scene: without it the equilibria do not depend on the steps, and few steps suffice."""

from __future__ import annotations

from evfem.scene.scene import Scene

AUTO = "auto"


def path_dependence(scene: Scene) -> tuple[str, ...]:
    """Causes of path dependence, in words; empty if there is none.

    >>> import evfem as ev
    >>> pad, press = ev.FingerPad(resolution="coarse"), [ev.Press(indentation=0.5, steps=2)]
    >>> [path_dependence(ev.Scene(pad, ev.Flat(friction=mu), motion=press)) for mu in (0.0, 0.3)]
    [(), ('friction',)]
    """
    drive = scene.drive is not None and scene.drive.resolved
    found = {
        "friction": scene.has_friction,
        "time": scene.solver.timed,
        "charges": drive,
        "the hand": scene.hand is not None and scene.hand.timed,
        "who touches": scene.law is not None and not scene.air_layer,
    }
    return tuple(name for name, there in found.items() if there)


def allowed_error(scene: Scene) -> float | None:
    """The error of a part's path that its strategy allows; None where the steps are as given."""
    strategy = scene.solver.strategy
    return strategy.path_error if strategy.steps == AUTO and path_dependence(scene) else None


def steps_line(scene: Scene) -> str:
    """A plan's line on steps that the solver chooses; empty if the scene gives them."""
    if scene.solver.strategy.steps != AUTO:
        return ""
    names = path_dependence(scene)
    if not names:
        what = "nothing but a snap" if scene.electrics.acts or not scene.ground.is_flat else "nothing"
        return f"steps auto: {what} depends on the path, each step is one part"
    limit = f"{100.0 * scene.solver.strategy.path_error:g} %"
    return f"steps auto: path dependence by {', '.join(names)}, a part errs by at most {limit} of the force"
