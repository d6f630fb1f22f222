"""evfem: a finger pad on an electrovibration display, by finite elements on scikit-fem.

Names are loaded when they are first used, so that the laws cost neither scikit-fem nor matplotlib:

>>> import evfem as ev
>>> layers = ev.Layers.of(ev.Layer(thickness=0.09, eps_r=3.35))
>>> f"{ev.Kaczmarek().traction(0.25, 1000.0, layers):.3e} MPa"
'4.703e-05 MPa'
"""

import importlib
import sys
from types import ModuleType
from typing import Any

__version__ = "0.2.0"

_NAMES = {
    "electrostatics": ("Kaczmarek", "Layer", "Layers", "StrongTroxel", "eps_0"),
    "errors": ("EvfemError", "InputError", "NotConverged", "StopRun", "StorageError"),
    "fingerpad": ("Electrical", "FingerPad", "MeshedFinger"),
    "materials": ("LinearElastic", "NeoHookean", "Ogden", "Yeoh"),
    "mesh": ("Mesh",),
    "motion": ("Hover", "Press", "Slide", "VoltageRamp"),
    "plan": ("plan",),
    "reduced": ("FastModel", "reduce"),
    "result": ("Checkpoint", "Frame", "Result"),
    "samples": ("Normal", "Samples", "Uniform"),
    "scene": ("Boundary", "Output", "Region", "Scene", "Solver", "default_scene", "form", "grad"),
    "signalfile": ("Playback", "read_signal", "write_signal"),
    "signals": ("Amplifier", "VoltageProfile"),
    "simulate": ("simulate",),
    "sweep": ("SweepResult", "sweep"),
    "sweepfile": ("Sweep",),
    "strategy": ("Strategy",),
    "surfaces": ("Display", "Flat", "Profile", "Sinusoid"),
    "tensor": ("ddot", "det", "dot", "inv", "mul", "positive_part", "trace", "transpose"),
}
_MODULES = (
    "electrostatics",
    "encoding",
    "export",
    "materials",
    "meshfile",
    "plotting",
    "protocols",
    "reference",
    "rendering",
    "result",
    "scenefile",
    "signals",
    "surfaces",
    "tensor",
)
_HOME = {name: module for module, names in _NAMES.items() for name in names}

__all__ = [*_HOME, *_MODULES]


class _Package(ModuleType):
    """The package itself, where `simulate` and `plan` stay functions although modules have the same names."""

    def __setattr__(self, name: str, value: Any) -> None:
        if isinstance(value, ModuleType) and _HOME.get(name) == name:
            value = getattr(value, name)
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package


def __getattr__(name: str) -> Any:
    """PEP 562: load a name, or a module, when it is first asked for."""
    if name in _HOME:
        value = getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)
        globals()[name] = value
        return value
    if name in _MODULES:
        return importlib.import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """All public names, loaded or not."""
    return sorted({*globals(), *__all__})
