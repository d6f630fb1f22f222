"""What of a scene remembers the way: where nothing does, the steps decide no equilibrium that is
reached, and few of them will do.
"""

from __future__ import annotations

from evfem.scene.scene import Scene

AUTO = "auto"


def remembers(scene: Scene) -> tuple[str, ...]:
    """What makes forces depend on the way, in words; empty where nothing does.

    >>> import evfem as ev
    >>> pad, press = ev.FingerPad(resolution="coarse"), [ev.Press(indentation=0.5, steps=2)]
    >>> [remembers(ev.Scene(pad, ev.Flat(friction=mu), motion=press)) for mu in (0.0, 0.3)]
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
    return strategy.path_error if strategy.steps == AUTO and remembers(scene) else None


def said(scene: Scene) -> str:
    """What a plan says of the steps of a scene that leaves them to the solver; nothing otherwise."""
    if scene.solver.strategy.steps != AUTO:
        return ""
    names = remembers(scene)
    if not names:
        what = "nothing but a snap" if scene.electrics.acts or not scene.ground.is_flat else "nothing"
        return f"steps auto: {what} remembers the way, each step is one part"
    limit = f"{100.0 * scene.solver.strategy.path_error:g} %"
    verb = "remembers" if len(names) == 1 else "remember"
    return f"steps auto: {', '.join(names)} {verb} the way, a part errs by at most {limit} of the force"
