"""Files of every format that evfem reads, damaged at random: `damaged(kind, folder, rng)` makes one
in a folder and returns the words of the command that reads it.
"""

import json
import re
from copy import deepcopy
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import meshio
import numpy as np
from scipy.io import savemat

import evfem as ev
from evfem.common.storage import save_arrays
from evfem.mesh import file as meshfile
from evfem.scene.file import load
from evfem.textures import texture
from tools.commands import called, contents
from tools.kills import head
from tools.meshes import block

PAD = """version = 1
[finger]
resolution = "coarse"
width = 16.0
height = 12.0
ridges = true
ridge_height = 0.15
ridge_phase = 0.25
viscosity = 0.001
[finger.materials.dermis]
law = "ogden"
mu = [0.03, -0.01]
alpha = [2.0, -2.0]
nu = 0.45
"""
FLAT = '[surface]\nkind = "flat"\nfriction = [[0.0, 0.3], [1.0, 0.4]]\n'
SINUSOID = (
    '[surface]\nkind = "sinusoid"\nfriction = 0.2\nterms = [[0.02, 6.0, 0.0], [0.01, 12.0, 1.5]]\ny = -9.0\n'
)
PROFILE = '[surface]\nkind = "profile"\nfile = "scan.csv"\nfriction = 0.2\n'
VOLTAGE = """[electrostatics]
law = "kaczmarek"
{voltage}
insulator_thickness = 0.09
insulator_eps_r = 3.35
air_layer = true
direction = "vertical"
coupling = "monolithic"
"""
SOLVER = '[solver]\nelement = "q1"\ntolerance = 1e-8\nthreads = 1\n[output]\nevery = 2\n'
PRESS = '[[motion]]\nkind = "press"\nindentation = 0.1\nsteps = 1\n'
MOTIONS = PRESS + '[[motion]]\nkind = "slide"\ndistance = -0.5\nsteps = 3\nhold = "force"\nspeed = 20.0\n'
RAMP = '[[motion]]\nkind = "hover"\ngap = 0.2\n[[motion]]\nkind = "voltage"\nvoltage = 50.0\nsteps = 2\n'
SWEEP = """version = 1
scene = "mesh_vtu.toml"
outputs = ["normal_force.last"]
[grid]
surface.friction = [0.1, 0.2]
[samples]
count = 4
seed = 1
[samples.parameters]
motion.0.indentation = { normal = [0.1, 0.01], between = [0.05, 0.15] }
"""
SCAN = "x,height\n" + "".join(f"{0.1 * k - 2.0!r},{0.01 * (k % 3)!r}\n" for k in range(41))
SIGNAL = "position,voltage\n" + "".join(f"{0.2 * k!r},{20.0 * (k % 5)!r}\n" for k in range(12))


WRITTEN = Path(__file__).parents[1] / "mesh" / "written"
#: meshes that libraries of other programs wrote
MESHES = {
    "mesh_msh4": "gmsh_quad9_4.1.msh",
    "mesh_inp": "gmsh_quad9.inp",
    "mesh_bdf": "gmsh_quad.bdf",
    "mesh_mesh": "gmsh_quad.mesh",
    "mesh_su2": "gmsh_quad9.su2",
    "mesh_med": "gmsh_quad9.med",
    "mesh_exo": "exodus_quad9.exo",
    "mesh_xdmf": "dolfinx_quad9.xdmf",
}


def _presses(mesh, surface, law=""):
    return head(mesh) + surface + law + SOLVER + PRESS


#: scenes of one step on a small square, by the format that they read
SCENES = {
    "profile": _presses("square.vtu", PROFILE),
    "voltage": _presses("square.vtu", FLAT, VOLTAGE.format(voltage='voltage_file = "signal.csv"')),
    "voltage_wav": _presses("square.vtu", FLAT, VOLTAGE.format(voltage='voltage_file = "signal.wav"')),
    "mesh_vtu": _presses("square.vtu", FLAT),
    "mesh_vtu_text": _presses("text.vtu", FLAT),
    "mesh_msh": _presses("square.msh", FLAT),
    "checkpoint": _presses("square.vtu", FLAT),
}


@cache
def _whole():
    """Whole files of every format, by name. Made once: another run has other times in its files,
    whose lengths differ then.
    """
    with TemporaryDirectory() as name:
        folder = Path(name)
        for kind in ("vtu", "msh"):
            meshfile.write(block(2, 2, width=2.0), folder / f"square.{kind}")
        meshio.vtu.write(folder / "text.vtu", meshio.read(folder / "square.vtu"), binary=False)
        names = '<DataArray type="Int32" Name="region:tissue" format="ascii">0</DataArray>'
        grid = f"<UnstructuredGrid><FieldData>{names}</FieldData>"  # which meshio does not write as text
        text = (folder / "text.vtu").read_text().replace("<UnstructuredGrid>", grid)
        (folder / "text.vtu").write_text(text)
        (folder / "scan.csv").write_text(SCAN)
        (folder / "signal.csv").write_text(SIGNAL)
        profile = ev.VoltageProfile([0.0, 0.5, 1.0], [0.0, 100.0, 50.0])
        ev.write_signal(folder / "signal.wav", profile, ev.Playback(full_scale=100.0, speed=20.0, rate=400))
        for kind, text in SCENES.items():
            (folder / f"{kind}.toml").write_text(text)
        assert called(folder, "run", "checkpoint.toml", "--no-plots", "--no-fields")[0] == 0
        ev.simulate(load(folder / "checkpoint.toml")).save(folder / "run.npz")
        _others(folder)
        return contents(folder)


def _others(folder):
    """Tables, haptics, a fit, a sweep and a texture, and the meshes of other programs."""
    (folder / "sweep.toml").write_text(SWEEP)
    savemat(folder / "signal.mat", {"position": np.arange(9.0), "voltage": 20.0 * np.arange(9.0)})
    profile = ev.VoltageProfile([0.0, 0.5, 1.0], [0.0, 100.0, 50.0])
    device = ev.Playback(full_scale=100.0, speed=20.0, friction=(0.4, 0.6))
    ev.write_signal(folder / "signal.hjif", profile, device)
    forces = ev.MeasuredValues("normal_force.last", [2e-3, 3e-3], {"motion.0.indentation": [0.05, 0.1]})
    free = {"finger.materials.tissue.E": (0.01, 0.2)}
    ev.fit(folder / "mesh_vtu.toml", forces, free, workers=1).save(folder / "fit.json")
    wave = ev.Texture("wave", "drawn", [0.0, 0.1, 0.2], [0.0, 0.01, 0.005], "CC0-1.0", period=0.3)
    texture.write(wave, folder / "wave.json")
    for name in (*MESHES.values(), "dolfinx_quad9.h5"):
        (folder / name).write_bytes((WRITTEN / name).read_bytes())


def damaged(kind, folder, rng):
    """Whole files and a damaged one in `folder`; the words that read it, after `evfem`."""
    for name, content in _whole().items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    if kind == "scene":
        (folder / "scene.toml").write_text(_scene(rng))
    name, damage = FORMATS[kind]
    damage(folder / name, rng)
    if kind == "scene":
        return ["plan", name]
    if kind not in SCENES:
        return ["load", name]
    return ["run", f"{kind}.toml", "--no-plots", "--no-fields", *(["--resume"] * (kind == "checkpoint"))]


def _scene(rng):
    motion = rng.choice([MOTIONS, RAMP])
    laws = ["voltage = 100.0", 'voltage_file = "signal.csv"', "voltage_profile = [[0.0, 1.0]]"]
    voltage = VOLTAGE.format(voltage=laws[0] if motion == RAMP else rng.choice(laws))
    surface = rng.choice([FLAT, SINUSOID, PROFILE])
    return rng.choice([PAD, head("square.vtu")]) + surface + voltage + SOLVER + motion


#: what numbers and words of a text are replaced with
NASTY = (
    *("nan", "inf", "-inf", "1e400", "-1e308", "1e308", "5e-324", "0", "-0.0", "-1", "1e-300", "1e300"),
    *("2147483648", "4294967295", "9223372036854775808", "1000000000", "1000000", "1e6", "0.5", "1_0", "١٢"),
    *("true", "false", "None", "[]", "{}", "''", "[[]]", "[[1.0]]", "[nan]", "[[1.0, 2.0, 3.0, 4.0]]"),
    *("07:32:00", "1979-05-27T07:32:00Z", "'../../../etc/passwd'", '"/dev/zero"'),
    *('"."', '"text"', '"\\u0000"'),
    *("\x00", "\ufeff", "\u202e", "&lol;", '<!DOCTYPE a [<!ENTITY b "c">]>'),
    *("9" * 400, "9" * 5000, "0x" + "f" * 5000, '"' + "x" * 100_000 + '"'),
    *("[" * 50 + "]" * 50, "[" * 3000 + "]" * 3000, "{a = " * 60 + "1" + "}" * 60),
    *("$NodeData\n1000000000000\n", "$Periodic\n1000000000\n", "__import__('os').system('touch owned')"),
)
WORD = re.compile(r"[-+.\w]+|'[^']*'|\"[^\"]*\"")
LINES = (
    "a" + ".a" * 3000 + " = 1\n",
    "[[motion]]\nkind = 'slide'\ndistance = 1.0\nsteps = 1000000\n" * 3,
    "[[motion]]\nkind = 'press'\nindentation = 1.0\nsteps = 1000000000\n",
    "[finger]\nresolution = 'fine'\n",
    "[solver]\nelement = 'p2'\n",
    "unknown = 1\n",
    "=\n",
    "\x00\x01\n",
    "1,2,3\n",
    "1\n" * 1000,
    "-5.0,1.0\n",
    "0.0,1e9\n",
)


def _bytes(path, rng):
    """Pieces flipped, cut out, put in, written over, repeated or cut off, or everything random."""
    content = path.read_bytes()
    for _ in range(rng.choice((1, 1, 2, 5))):
        start = rng.randint(0, len(content))
        piece = content[start : rng.choice((start, *(start + n for n in (1, 1, 4, 8, 100, 5000)), None))]
        flipped = bytes([*piece[:-1], piece[-1] ^ 1 << rng.randint(0, 7)]) if piece else b""
        other = (b"\xff" * 8, b"\x00" * 8, b"\x7f" * 4, rng.randbytes(8))
        new = rng.choice((flipped, flipped, b"", piece * 2, piece * 4, *other))
        content = content[:start] + new + content[start + len(piece) :]
    path.write_bytes(content if rng.random() < 0.95 else rng.randbytes(rng.randint(0, 300)))


def _text(path, rng):
    """Words replaced, numbers scaled, lines lost, repeated, put in or swapped; sometimes bytes too."""
    text = path.read_text(encoding="utf-8")
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        text = rng.choice((_word, _word, _line))(text, rng)
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    if rng.random() < 0.2:
        _bytes(path, rng)


def _word(text, rng):
    found = rng.choice([*WORD.finditer(text)] or [re.match("", text)])
    new = rng.choice(NASTY)
    if found[0].lstrip("+-.")[:1].isdigit() and rng.random() < 0.5:
        try:
            new = repr(float(found[0]) * rng.choice((-1, 0, 2, 10, 1e-3, 1e3, 1e9, 1e-12)))
        except ValueError:
            new = "1"
        new = rng.choice((new, new.split(".")[0]))
    return text[: found.start()] + new + text[found.end() :]


def _line(text, rng):
    lines = text.splitlines(keepends=True) or [""]
    i, j = (rng.randint(0, len(lines) - 1) for _ in "ij")
    new = rng.choice(([], [lines[i]] * 2, [lines[j], lines[i]], [lines[i], rng.choice(LINES)]))
    return "".join([*lines[:i], *new, *lines[i + 1 :]])


def _archive(path, rng):
    """Bytes of the archive, or arrays in an archive that is itself whole."""
    if rng.random() < 0.5:
        _bytes(path, rng)
        return
    with np.load(path, allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    for _ in range(rng.choice((1, 1, 2))):
        name = rng.choice(sorted(arrays))
        change = rng.choice((_other_kind, _other_shape, _other_values, _other_values, objects))
        arrays[name] = change(arrays[name], rng)
        if rng.random() < 0.1:
            del arrays[name]
    if rng.random() < 0.05:
        arrays = {name.replace("/", "_"): array for name, array in arrays.items()}
    try:
        save_arrays(path, arrays)
    except ev.InputError:  # objects: as numpy would write them
        with path.open("wb") as file:
            rng.choice((np.savez, np.savez_compressed))(file, **arrays)


def _other_kind(array, rng):
    kind = rng.choice(("f4", ">f8", "i8", "u1", "?", "U3", "S4", "c16", "M8[s]"))
    with np.errstate(all="ignore"):
        return (array.real if array.dtype.kind not in "UO" else np.array([1.0, 2.0])).astype(kind)


def _other_shape(array, rng):
    flat = array.ravel()
    return rng.choice((flat[:-1], flat[:0], flat[None], np.append(flat, flat), array[None], array.T))


def _other_values(array, rng):
    changed = array.copy()
    if changed.dtype.kind == "U":
        text = str(changed.flat[0]) if changed.size else ""
        place = rng.randint(0, len(text))
        new = (text[:place], text[place:], "[]", "null", "{}", "[" * 5000, "x", text.replace("1", "1e999"))
        return np.array(rng.choice((*new, text + " ")))
    if changed.dtype.kind in "iufb" and changed.size:
        nasty = {"f": (np.nan, np.inf, 1e300, -1.0, 0.0), "b": (True, False)}
        value = rng.choice(nasty.get(changed.dtype.kind, (-1, 0, 3, 2**31 - 1, -(2**63), 10**12)))
        changed.flat[rng.randint(0, changed.size - 1)] = np.array(value).astype(changed.dtype)
    return changed


#: what values in JSON are replaced with
LEAVES = (
    *(10**400, 2**63, -1, 0, 1.5, 1e308, -1e308, 5e-324, float("nan"), float("inf"), True, None),
    *("", "text", "a" * 100_000, "\ud800", "two\nlines", [], {}, [[]], [1e300] * 40, [[1, 2], [3, 4]]),
)


def _json(path, rng):
    """Values replaced, numbers scaled, lists repeated, keys lost; sometimes words of the text too."""
    table = json.loads(path.read_text())
    for _ in range(rng.choice((1, 1, 2))):
        holder, key = rng.choice(_places(table) or [({"": 0}, "")])
        value = holder[key]
        new = [deepcopy(rng.choice(LEAVES))] * 2  # a list of them may be changed later
        if type(value) is float or (type(value) is int and abs(value) < 1e300):
            new.append(value * rng.choice((-1, 0, 1e3, 1e-9, 1e300)))
        new += [value * rng.choice((0, 2, 100))] if isinstance(value, list) else []
        holder[key] = rng.choice(new)
        if rng.random() < 0.1:
            del holder[key]
    path.write_text(json.dumps(table))
    if rng.random() < 0.2:
        _text(path, rng)


def _places(table):
    """What holds each value of some JSON, and its key or number there."""
    found = [(table, key) for key in (table if isinstance(table, dict) else range(len(table)))]
    inner = [holder[key] for holder, key in found if isinstance(holder[key], (dict, list))]
    return [*found, *(place for one in inner for place in _places(one))]


class _Payload:
    """Runs a function when unpickled."""

    def __reduce__(self):
        return open, ("owned", "w")


def objects(*_):
    """An array of an object that does."""
    held = np.empty(1, dtype=object)
    held[0] = _Payload()
    return held


#: what is read -> the file that is damaged, and how
FORMATS = {
    "scene": ("scene.toml", _text),
    "profile": ("scan.csv", _text),
    "voltage": ("signal.csv", _text),
    "voltage_wav": ("signal.wav", _bytes),
    "mesh_vtu": ("square.vtu", _bytes),
    "mesh_vtu_text": ("text.vtu", _text),
    "mesh_msh": ("square.msh", _text),
    "result": ("run.npz", _archive),
    "checkpoint": ("checkpoint-out/checkpoint.npz", _archive),
    "sweep": ("sweep.toml", _text),
    "fit": ("fit.json", _json),
    "texture": ("wave.json", _json),
    "haptics": ("signal.hjif", _json),
    "table_mat": ("signal.mat", _bytes),
    **{kind: (name, _bytes if kind in ("mesh_med", "mesh_exo") else _text) for kind, name in MESHES.items()},
}
