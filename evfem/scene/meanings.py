"""What the keys of a scene file are: unit and meaning of each, by table, and limits that no model
states as numbers.

Types, defaults and the words for what is allowed are those of the models that read a file
(`evfem.scene.schema` puts them together; a test holds these tables against the models).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from evfem.common.checks import Within
from evfem.scene.scene import DEPTH as SCENE_DEPTH


class Text(NamedTuple):
    """Unit ("" for none) and meaning of a key; what is allowed, where its model has no words for
    it, and within which limits.
    """

    unit: str
    meaning: str
    allowed: str = ""
    limits: Within | None = None


POSITIVE, NOT_NEGATIVE, RELATIVE = Within(0.0, above=True), Within(0.0), Within(1.0)
TABLE = "a table"

DEPTH = Text(
    "mm", "of the finger; adds forces in N, areas in mm2", SCENE_DEPTH["allowed"], SCENE_DEPTH["test"]
)

SCENE = {
    "version": Text("", "version of the format", "1"),
    "finger": Text("", "the finger; without it that of the paper's Table 2"),
    "surface": Text("", "what the finger touches"),
    "electrostatics": Text("", "insulator, voltage and force law; without it no attraction"),
    "hand": Text("", "between drive and bone; without it the drive moves the bone itself"),
    "solver": Text("", "how the scene is solved; the defaults are the recommended ones"),
    "output": Text("", "which fields are kept"),
    "motion": Text("", "what happens, one table [[motion]] after the other"),
}
FINGER = {
    "kind": Text("", "the cross-section of a finger, or a whole pad in space", "pad | fingertip"),
    "participant": Text("", "sizes of one of Table 1's fingers; other keys go before", "i to xi"),
    "width": Text("mm", "full width of the cross-section"),
    "height": Text("mm", "full height of the cross-section"),
    "ridges": Text("", "whether there are fingerprint ridges", "true | false"),
    "ridge_height": Text("mm", "depth of the grooves; crests lie on the ellipse"),
    "ridge_width": Text("mm", "the pitch, from crest to crest"),
    "ridge_exponent": Text("", "depth = height t^exponent, t = 0 at a crest, 1 in a groove"),
    "ridge_phase": Text("pitches", "0: a crest in the middle, 0.5: a groove"),
    "ridge_crest": Text("pitches", "flat part of a crest; 0: rounded ridges"),
    "ridge_groove": Text("pitches", "flat part of a groove, with flat crests"),
    "ridge_scan": Text(
        "", "ridges as they were scanned", "the path of a csv file with the header x,height or x,y"
    ),
    "stratum_corneum_thickness": Text("mm", "at a crest"),
    "epidermis_thickness": Text("mm", "of the living epidermis"),
    "dermis_thickness": Text("mm", "of the dermis"),
    "nail_thickness": Text("mm", "of the nail"),
    "nail_width": Text("mm", "chord of the nail"),
    "bone_width": Text("mm", "full width of the bone"),
    "bone_height": Text("mm", "full height of the bone"),
    "bone_offset": Text("mm", "centre of the bone above that of the finger"),
    "resolution": Text("", "about 3k, 10k, 23k, 50k nodes"),
    "materials": Text(
        "", "laws of regions that are not to have Table 2's", f"{TABLE} [finger.materials.NAME]"
    ),
    "electrical": Text("", "the dielectric skin", f"{TABLE} [finger.electrical]"),
    "viscosity": Text("s", "relaxation time of materials without their own"),
    "depth": DEPTH,
}
FINGERTIP = {
    name: FINGER[name]
    for name in (
        *("participant", "width", "height", "ridge_height", "ridge_width", "ridge_exponent", "ridge_phase"),
        *("ridge_crest", "ridge_groove", "stratum_corneum_thickness", "epidermis_thickness"),
        *("dermis_thickness", "bone_width", "bone_height", "bone_offset", "materials", "electrical"),
        *("viscosity", "depth"),
    )
} | {
    "length": Text("mm", "full length of the ellipsoid"),
    "ridges": Text(
        "",
        "pattern of the fingerprint ridges, or a measured print",
        "false | none | true | along | across | whorl | loop | arch, the path of a csv file with the "
        "header x,z,height or of a grey image, or a table of x, z and rows of height",
    ),
    "ridge_pixel": Text("mm", "from point to point of a grey image"),
    "bone_length": Text("mm", "full length of the bone"),
    "rim": Text("", "whether the cut around the nail moves with the bone", "fixed | free"),
    "posture": Text("degrees", "how far the tip is turned down"),
    "resolution": Text("", "smooth about 5k, 12k, 43k nodes; with ridges 22k, 34k, 115k and more"),
}
MESHED_FINGER = {
    "mesh": Text("", "a mesh of your own, in mm"),
    "regions": Text("", "names of the numbers in the cell data `region`"),
    "materials": Text("", "the law of each region"),
    "electrical": Text("", "the dielectric skin"),
    "viscosity": Text("s", "relaxation time of materials without their own", "", Within(0.0, 1e3)),
    "depth": DEPTH,
}
ELECTRICAL = {
    "stratum_corneum_thickness": Text("mm", "without it the region's local thickness", "", POSITIVE),
    "stratum_corneum_eps_r": Text("", "relative permittivity", "", RELATIVE),
}
MATERIAL = {
    "law": Text("", "the law", "its name"),
    "E": Text("MPa", "Young's modulus", "a number above 0", POSITIVE),
    "nu": Text("", "Poisson's ratio", "a number above -1 and below 0.5", Within(-1.0, 0.5, above=True)),
    "c1": Text("MPa", "first coefficient of I1 - 3", "a number above 0", POSITIVE),
    "c2": Text("MPa", "second coefficient", "a number"),
    "c3": Text("MPa", "third coefficient", "a number"),
    "mu": Text("MPa", "moduli of the terms", "a number or a list, sum of mu alpha above 0"),
    "alpha": Text("", "exponents of the terms", "as many numbers as in mu, not 0"),
    "bulk": Text("MPa", "bulk modulus, instead of nu", "a number above 0", POSITIVE),
    "viscosity": Text("s", "relaxation time; without it the finger's", "a number, at least 0", NOT_NEGATIVE),
    "density": Text("t/mm3", "with dynamics = inertial", "a number above 0", POSITIVE),
}
SURFACE = {
    "kind": Text("", "the kind of surface", "its name"),
    "friction": Text("", "Coulomb's coefficient, or its table over x (mm), linear in between"),
    "friction_law": Text("", "what the coefficient means; without it Coulomb's law"),
    "y": Text("mm", "shift of the profile; without it the finger just touches at the start"),
    "terms": Text("", "sum of a sin(k x + phase); without it eq. (25) of the paper"),
    "file": Text("", "heights over x"),
    "points": Text("mm", "the same in the scene file"),
    "period": Text("mm", "after which the surface repeats"),
    "groove_depth": Text("mm", "of the grooves below the ridges"),
    "groove_width": Text("mm", "at half depth; without it half the period"),
    "wall_width": Text("mm", "part of x that a wall takes; without it half of ridge or groove"),
    "phase": Text("periods", "place of a ridge's middle", "", Within(-1.0, 1.0)),
    "hurst": Text("", "Hurst exponent", "", Within(0.0, 1.0)),
    "rms": Text("mm", "root mean square height", "", POSITIVE),
    "shortest": Text("mm", "shortest wave"),
    "longest": Text("mm", "longest wave; without it the period"),
    "seed": Text("", "the same seed gives the same surface", "", NOT_NEGATIVE),
}
ELECTROSTATICS = {
    "law": Text("", "force law of the paper, eqs (2) to (5)"),
    "voltage": Text("V", "effective, across skin and insulator", "", Within(-1e6, 1e6)),
    "amplitude": Text("V", "peak, instead of voltage", "", Within(0.0, 1e6)),
    "frequency": Text("Hz", "of the alternating voltage; without it a direct one", "", POSITIVE),
    "waveform": Text("", "of the alternating voltage"),
    "skin": Text("", "dielectric of the stratum corneum; without it stratum_corneum_eps_r"),
    "gap_conductivity": Text("S/m", "of what fills the gap: the leak", "", NOT_NEGATIVE),
    "drive": Text("", "attraction by its mean over the cycle, or resolved in time with its charges"),
    "voltage_file": Text("", "voltage over the position, instead of a number"),
    "voltage_profile": Text("mm, V", "the same in the scene file"),
    "signal": Text("", "voltage over time, instead of a number"),
    "insulator": Text("", "a usual insulator by its name"),
    "insulator_thickness": Text("mm", "of the display's insulator", "", NOT_NEGATIVE),
    "insulator_eps_r": Text("", "its relative permittivity", "", RELATIVE),
    "gap_eps_r": Text("", "relative permittivity of what fills the gap", "", RELATIVE),
    "air_layer": Text("", "false: only touching nodes carry force, eq. (10)"),
    "direction": Text("", "normal: Maxwell stress on the deformed outline"),
    "field": Text("", "full: Poisson's problem, not column by column; auto: where it matters"),
    "electrodes": Text("mm, 1", "where electrodes end, and their share of the voltage; with field full"),
    "grounded": Text("", "false: the finger has no charge; with field full"),
    "coupling": Text("", "staggered_once: the paper's, once in each step"),
    "roughness_gap": Text("mm", "what rough skin keeps between itself and the insulator in contact"),
}
HAND = {
    "stiffness": Text("N/mm", "of the spring, per mm of depth"),
    "damping": Text("N s/mm", "of the damper beside it, per mm of depth"),
    "mass": Text("t", "that moves with the bone, per mm of depth"),
}
FRICTION = {
    "pressure": Text("MPa", "contact pressure at which the coefficient is that of the surface"),
    "index": Text("", "the force grows with this power of the load"),
    "lowest": Text("MPa", "below it the coefficient stays; without it a hundredth of the pressure"),
    "strength": Text("MPa", "shear traction that every place in real contact carries beside mu p"),
    "full": Text("MPa", "contact pressure at which real contact is complete; without it the strength"),
    "speed": Text("mm/s", "at which friction of sliding differs from that of sticking"),
    "ratio": Text("", "friction of fast sliding over that of sticking"),
    "exponent": Text("", "friction goes with this power of speed over that speed"),
    "slowest": Text("mm/s", "below it that power stays; without it a hundredth of the speed"),
    "fresh": Text("", "share of the friction that a place has when it touches"),
    "time": Text("s", "time constant of the rest"),
}
ROUGHNESS = {
    "law": Text("", "how the gap depends on a node's contact pressure", "its name"),
    "gap": Text("mm", "at that pressure; for a constant gap at every one"),
    "decay": Text("mm", "by which it falls for every factor e of the pressure"),
    "pressure": Text("MPa", "contact pressure of that gap; of an exponential one that of full contact"),
    "exponent": Text("", "gap (p / pressure)^-exponent"),
    "open_gap": Text("mm", "at no pressure, where the law itself has no bound"),
}
SIGNAL = {
    "frequency": Text("Hz", "of the sine, square wave or carrier"),
    "amplitude": Text("V", "of the sine or square wave"),
    "bias": Text("V", "mean voltage"),
    "phase": Text("rad", "at time 0"),
    "envelope": Text("V", "height of the carrier: a number, or a signal that modulates it"),
    "charge": Text("nC/mm", "of the electrode, per mm of depth: a number, or a signal of charges"),
    "after": Text("s", "when the electrode is disconnected"),
    "resolved": Text("", "false: the root mean square over its cycles", "true | false"),
    "file": Text("", "the samples"),
    "full_scale": Text("V", "of a .wav"),
    "voltage": Text("V", "the samples in the scene file; of an open circuit the source's"),
    "rate": Text("Hz", "of the samples in the scene file", "", POSITIVE),
    "start": Text("s", "time of the first sample"),
    "repeat": Text("", "whether it begins anew at its end"),
}
SOLVER = {
    "element": Text("", "without it q2p1 on quads, p2 on triangles"),
    "dynamics": Text("", "without time, with viscosity, or with inertia too"),
    "contact": Text("", "exact (Signorini, Coulomb), or springs"),
    "penalty_normal": Text("N/mm3", "with contact = penalty"),
    "penalty_tangential": Text("N/mm3", "with contact = penalty and friction"),
    "tolerance": Text("", "largest free residual over the largest reaction, of every step"),
    "threads": Text("", "of the factorisation"),
    "symmetry": Text("", "whether a scene that is its own mirror image is computed from its right half"),
    "strategy": Text("", "how hard steps are tried"),
}
STRATEGY = {
    "iterations": Text("", "most of one part of a step"),
    "patience": Text("", "iterations with an old factorisation before it is renewed"),
    "smallest_part": Text(
        "", "of what is left of a step before it counts as not converged; its square if time passes"
    ),
    "easy": Text("", "iterations of a part after which the next one may be longer"),
    "growth": Text("", "by which factor"),
    "reach": Text("", "first guess: so many of the last part's displacements ahead"),
    "relaxation": Text("", "whether a finger without an equilibrium near is released"),
    "steps": Text("", "one part each unless it fails, or parts as the error of the path allows"),
    "path_error": Text("", "of a part, with steps = auto: a share of the force on the bone"),
}
OUTPUT = {
    "every": Text("", "fields of every n-th step, and of the last one; without it as many as fit in 25 MB"),
    "precision": Text("", "of the fields; without it single where they would take more than 25 MB"),
    "compression": Text("", "of the fields' files: a third of the size, slower to write"),
}
_STEPS, _HOLD = Text("", "in how many equal parts"), Text("", "what stays as it is")
MOTION = {
    "press": {
        "force": Text("N/mm", "load on the bone at the end; this or indentation"),
        "indentation": Text("mm", "travel of the bone beyond first touch at the end"),
        "steps": _STEPS,
        "speed": Text("mm/s", "of a press to an indentation; without it no time passes"),
    },
    "slide": {
        "distance": Text("mm", "from where it is, negative towards -x"),
        "steps": _STEPS,
        "speed": Text("mm/s", "needed with dynamics other than quasistatic"),
        "hold": _HOLD,
        "angle": Text("degrees", "from +x, of a fingertip; 90 is along the finger"),
    },
    "hover": {"gap": Text("mm", "of the undeformed outline to the surface"), "steps": _STEPS},
    "voltage": {"voltage": Text("V", "at the end, from the present one"), "steps": _STEPS, "hold": _HOLD},
    "wait": {"duration": Text("s", "how long it stays"), "steps": _STEPS, "hold": _HOLD},
}
MOTION_KIND = Text("", "the kind of motion", "its name")
Meanings = Mapping[str, Text]
