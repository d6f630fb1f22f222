"""evfem: a finger pad on an electrovibration display, by finite elements on scikit-fem.

Names are loaded when they are first used, so that the laws cost neither scikit-fem nor matplotlib
(`__init__.pyi` says the same to editors and mypy):

>>> import evfem as ev
>>> layers = ev.Layers.of(ev.Layer(thickness=0.09, eps_r=3.35))
>>> f"{ev.Kaczmarek().traction(0.25, 1000.0, layers):.3e} MPa"
'4.703e-05 MPa'
"""

import sys as _sys
from importlib import import_module as _import_module
from typing import Any

__version__ = "0.4.0.dev0"

#: module -> the public names it gives
_NAMES = {
    "calibration.fit": ("fit",),
    "calibration.measured": ("MeasuredCurve", "MeasuredValues"),
    "calibration.parameters": ("Parameter",),
    "surface.adhesion": ("Capillary", "Dugdale"),
    "surface.elastic": ("ElasticLayer", "ElasticStack"),
    "surface.friction": (
        "AdhesiveFriction",
        "AgeingFriction",
        "Coulomb",
        "LoadIndexFriction",
        "RateFriction",
        "SlipMemory",
    ),
    "surface.relief": ("Relief",),
    "surface.surfaces": ("Display", "Flat", "Profile", "Sinusoid"),
    "surface.textures": ("Grating", "SelfAffine"),
    "surface.ways": ("FrictionMap",),
    "electrostatics.dielectrics": ("Dielectric", "DielectricTable"),
    "electrostatics.laws": ("FILM", "Kaczmarek", "Layer", "Layers", "StrongTroxel", "TOUCHSCREEN", "eps_0"),
    "electrostatics.roughness": (
        "ConstantRoughness",
        "ExponentialRoughness",
        "PowerRoughness",
        "TableRoughness",
    ),
    "circuit.signalfile": ("Playback", "read_signal", "write_signal"),
    "circuit.signals": ("Amplifier", "FollowForce", "VoltageProfile"),
    "electrostatics.drive": ("Drive",),
    "electrostatics.timesignals": ("Carrier", "ChargeControl", "OpenCircuit", "Sampled", "Sine", "Square"),
    "errors": ("EvfemError", "InputError", "NotConverged", "StopRun", "StorageError"),
    "finger.fingerpad": ("Electrical", "FingerPad", "MeshedFinger"),
    "finger.fingerprint": ("HeightMap",),
    "finger.fingertip": ("Fingertip",),
    "finger.layers": ("stiffening_skin",),
    "finger.scan": ("RidgeScan",),
    "loading": ("load",),
    "response.impedance": ("impedance",),
    "response.electrical": ("electrical_impedance",),
    "mesh.mesh": ("Mesh",),
    "reporting.page": ("report",),
    "reporting.watch": ("StopWhen",),
    "scene.motion": ("Hover", "Press", "Slide", "VoltageRamp", "Wait"),
    "scene.options": ("Output", "Solver"),
    "scene.probes": ("Probe",),
    "planning.plan": ("plan",),
    "response.parameters": ("ShapeChange",),
    "response.design": ("design",),
    "response.sensitivities": ("sensitivities",),
    "response.uncertainty": ("uncertainty",),
    "scene.scene": ("Scene", "default_scene"),
    "scene.terms": ("Boundary", "Region"),
    "simulation.loop": ("loop",),
    "simulation.result": ("Result",),
    "simulation.run": ("simulate",),
    "simulation.spectrum": ("spectrum",),
    "terms.hand": ("Hand",),
    "newton.strategy": ("Strategy",),
    "sweeps.accurate": ("accurate",),
    "sweeps.check": ("check",),
    "sweeps.file": ("Sweep",),
    "sweeps.run": ("sweep",),
    "sweeps.samples": ("Normal", "Samples", "Uniform"),
    "textures.texture": ("Texture",),
    "estimate.touch": ("Touch",),
    "tissue.forms": ("form",),
    "tissue.laws": ("LinearElastic", "NeoHookean", "Ogden", "Yeoh"),
    "tissue.ogden": ("relaxation_of",),
}
#: public modules -> where they are
_MODULES = {
    "electrostatics": "electrostatics",
    "encoding": "circuit.encoding",
    "export": "export",
    "fieldfiles": "fieldfiles",
    "forces": "electrostatics.forces",
    "materials": "tissue.laws",
    "meshfile": "mesh.file",
    "plotting": "plotting",
    "protocols": "protocols",
    "reference": "reference",
    "rendering": "estimate.rendering",
    "result": "simulation.result",
    "scenefile": "scene.file",
    "signals": "circuit.signals",
    "surfaces": "surface.surfaces",
    "tensor": "tensor",
}
_HOME = {name: module for module, names in _NAMES.items() for name in names}
#: names of a public module that are made above it: it asks for them here
_ABOVE = {"electrostatics": dict.fromkeys(("FieldSolution", "rigid_field"), "field.rigid")}
#: what a name of tensor algebra is since 0.4, and a class that is only received
_ALGEBRA = ("ddot", "det", "dot", "grad", "inv", "mul", "positive_part", "trace", "transpose")
_RECEIVED = {
    "Checkpoint": ("simulation.checkpoint", "what a run keeps in its folder for `--resume`"),
    "FitResult": ("calibration.result", "what `ev.fit` returns"),
    "Frame": ("simulation.result", "what `result.frames` consists of"),
    "Impedance": ("response.impedance", "what `ev.impedance` returns"),
    "Loop": ("simulation.loop", "what `ev.loop` returns"),
    "Sensitivities": ("response.sensitivities", "what `ev.sensitivities` returns"),
    "SweepResult": ("sweeps.table", "what `ev.sweep` returns"),
}
#: names that `ev` had -> the sentence that says what to use instead
_GONE = dict.fromkeys(
    ("FastModel", "reduce"),
    "the fast model is gone since 0.3; run the scene itself with `ev.simulate` (a coarser `resolution` is "
    "about as fast), several at a time with `ev.sweep`",
)
_GONE |= {name: f"since 0.4 it is `ev.tensor.{name}`" for name in _ALGEBRA}
_GONE |= {name: f"since 0.4 it is `evfem.{home}.{name}`, {what}" for name, (home, what) in _RECEIVED.items()}

__all__ = sorted([*_HOME, *_MODULES])


class _Moved:
    """Asked last, for a module that is nowhere: one that moved since 0.2, and a name that was imported from
    here (`from evfem import Loop`), say the new place.
    """

    @staticmethod
    def find_spec(name: str, path: Any = None, target: Any = None) -> None:
        """Raises `ModuleNotFoundError` for a name of `_GONE` and of `data/moved.csv`."""
        package, _, own = name.partition(".")
        if package != __name__:
            return
        if own in _GONE:
            raise ModuleNotFoundError(f"{own}: {_GONE[own]}")
        with open(f"{__path__[0]}/data/moved.csv", encoding="utf-8") as file:
            if place := dict(line.strip().split(",") for line in file).get(name):
                raise ModuleNotFoundError(f"{name} has moved since 0.2; its new place: {place}")


_sys.meta_path.append(_Moved)


def __getattr__(name: str) -> Any:
    """PEP 562: load a name, or a module, when it is first asked for."""
    if name in _HOME:
        value = getattr(_import_module(f"{__name__}.{_HOME[name]}"), name)
        if hasattr(value, "__dataclass_fields__"):
            _import_module(f"{__name__}.common.views").describe(value)
    elif name in _MODULES:
        value = _import_module(f"{__name__}.{_MODULES[name]}")
    elif name in _GONE:
        raise AttributeError(f"{name}: {_GONE[name]}")
    else:
        # tools ask every module for `__wrapped__` and the like: nobody misspelt these
        close = not name.startswith("_") and _import_module(f"{__name__}.errors").closest_name(name, __all__)
        meant = f"; did you mean {close[0]}?" if close else ""
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}{meant}")
    globals()[name] = value
    return value


def _from_above(module: str, name: str) -> Any:
    """What a public module hands on of a module that stands above it."""
    own = module.removeprefix(f"{__name__}.")
    if name not in _ABOVE[own]:
        raise AttributeError(f"module {module!r} has no attribute {name!r}")
    return getattr(_import_module(f"{__name__}.{_ABOVE[own][name]}"), name)


def __dir__() -> list[str]:
    """The public names, loaded or not."""
    return ["__version__", *__all__]
