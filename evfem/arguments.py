"""Command-line arguments of `evfem`: commands, options, and one-sentence error messages."""

from __future__ import annotations

import argparse
import importlib
import re
import sys
from collections.abc import Collection
from difflib import get_close_matches
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn

import evfem
from evfem.common import notices
from evfem.errors import InputError
from evfem.templates import TEMPLATES

BAD_INPUT = 2
STATUS = (
    "exit status: 0 done, 1 checked ends differ or a voltage at its limit, 2 bad input, "
    "3 a step did not converge, 4 disk failed, 130 interrupted"
)
#: completion of an argument in a shell, in the notation of shtab: `shtab --shell bash evfem.cli.parser`
FILES = {"bash": "_shtab_compgen_files", "zsh": "_files", "tcsh": "f"}
FOLDERS = {"bash": "_shtab_compgen_dirs", "zsh": "_files -/", "tcsh": "d"}


class Known(tuple[str, ...]):
    """Names offered for completion; others are accepted here and refused where they are looked up."""

    def __contains__(self, name: object) -> bool:
        return True


class _Parser(argparse.ArgumentParser):
    """A parser that reports a mistake in one sentence."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """So that the command that does not know an argument says so, not `evfem`."""
        found, left = super().parse_known_args(args, namespace)
        if left:
            close = [one for word in left for one in get_close_matches(word, self._option_string_actions, 1)]
            meant = f"; did you mean {close[0]}?" if close else ""
            self.error(f"unrecognized arguments: {' '.join(left)}{meant}")
        return found, left

    def error(self, message: str) -> NoReturn:
        for kind, allowed in (("float", "a number"), ("int", "a whole number")):
            message = re.sub(f"invalid {kind} value: '(.*)'", rf"given '\1'; allowed: {allowed}", message)
        text = f"{self.prog}: {message}{_meant(message)} (see {self.prog} --help)"
        self.exit(BAD_INPUT, notices.wrapped(text, sys.stderr) + "\n")


def _meant(message: str) -> str:
    """A guess at a misspelt choice from argparse's "invalid choice: 'rnu' (choose from 'run', ...)"."""
    found = re.search(r"invalid choice: '(.*)' \(choose from (.*)\)", message)
    close = get_close_matches(found[1], re.findall(r"\w+", found[2]), 1) if found else []
    return f"; did you mean {close[0]}?" if close else ""


def _path(
    command: argparse.ArgumentParser, name: str, metavar: str, how: dict[str, str] = FILES, **more: Any
) -> None:
    argument = command.add_argument(name, metavar=metavar, **{"type": Path, **more})
    argument.complete = how  # type: ignore[attr-defined]


def parser(words: Collection[str] = ("texture",)) -> argparse.ArgumentParser:
    """All commands and options; those of `texture`, which import numpy, only if it is among the words."""
    top = _Parser(
        prog="evfem",
        description="Contact, friction and attraction of a finger on an electrovibration display, by finite "
        "elements.",
        epilog=f"`evfem run` alone runs a built-in scene; `evfem COMMAND --help` lists options. {STATUS}",
    )
    top.add_argument("--version", action="version", version=f"evfem {evfem.__version__}")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", parser_class=_Parser)
    for name, does, options in (
        ("run", "run a scene and write history, fields, summary and picture", _run_options),
        ("init", "write a commented scene to begin with", _init_options),
        ("plan", "check a scene; list its physics, unknowns and solver; solve nothing", _scene_argument),
        ("check", "compare final forces by other steps and solvers, and state errors", _check_options),
        ("report", "write one page about a run: scene, forces, pictures, accuracy", _report_options),
        ("sensitivities", "derivatives of forces, works and energies by keys of a scene", _response_options),
        ("impedance", "dynamic stiffness of the finger versus frequency", _impedance_options),
        (
            "electrical-impedance",
            "what an amplifier sees of the finger versus frequency",
            _electrical_options,
        ),
        ("study", "run studies and write their numbers, series and pictures", _study_options),
        ("sweep", "run many scenes in parallel and write one table", _sweep_options),
        ("mesh", "write the finger's mesh as .vtu or .msh", _mesh_options),
        ("signal", "write a voltage signal as .wav, .png, .hjif or .csv", _signal_options),
        ("texture", "list, make, import, slide over and estimate textures", _texture_options),
        ("studio", "open the studio in the browser: voltage signals for textures", _studio_options),
        ("schema", "print the keys of scenes or sweeps as a JSON schema for editors", _schema_options),
    ):
        command = commands.add_parser(name, help=does, description=f"{does[0].upper()}{does[1:]}.")
        if name != "texture" or name in words:
            options(command)
    return top


def _scene_argument(command: argparse.ArgumentParser) -> None:
    _path(command, "scene", "SCENE.toml", nargs="?", help="default: the built-in scene")


def _run_options(run: argparse.ArgumentParser) -> None:
    _scene_argument(run)
    _results(run)
    _again(run, "continue the interrupted run in the folder", "replace the files of an earlier run")
    said = "tell every step, and keep the lines with their times in steps.log in the folder"
    run.add_argument("-v", "--verbose", action="store_true", help=said)
    run.add_argument("--no-fields", action="store_true", help="do not write fields.pvd and its .vtu files")
    run.add_argument("--no-plots", action="store_true", help="do not draw forces.png")


def _check_options(check: argparse.ArgumentParser) -> None:
    _scene_argument(check)
    said = "columns, or COLUMN.STATISTIC[.MOTION]; default: the forces and the extent of the contact"
    check.add_argument("--outputs", nargs="+", metavar="NAME", help=said)
    said = "leave out the runs on a finer and a coarser mesh, which take longest"
    check.add_argument("--no-mesh", action="store_true", help=said)


def _report_options(report: argparse.ArgumentParser) -> None:
    _path(report, "path", "FOLDER", FOLDERS, help="the folder of a run, or a saved result (.npz)")
    _path(report, "--out", "FILE.html", help="default: report.html in the folder, or beside the result")
    said = "run evfem check of the scene too, and tell its errors in the page"
    report.add_argument("--check", action="store_true", help=said)


def _response_options(command: argparse.ArgumentParser) -> None:
    _path(command, "scene", "FILE.toml", help="a scene; without --by a file that names scene and keys")
    said = "parameters: dotted keys of the scene, such as surface.friction"
    command.add_argument("--by", nargs="+", metavar="KEY", help=said)
    _results(command)


def _impedance_options(command: argparse.ArgumentParser) -> None:
    _electrical_options(command)
    said = "direction of the bone's vibration; default: normal"
    command.add_argument("--axis", choices=("normal", "tangential"), default="normal", help=said)


def _electrical_options(command: argparse.ArgumentParser) -> None:
    _path(command, "scene", "SCENE.toml", help="the scene")
    said = "frequencies in Hz"
    command.add_argument("--frequencies", nargs="+", type=float, metavar="HZ", required=True, help=said)
    _results(command)


def _study_options(study: argparse.ArgumentParser) -> None:
    names, told = _study_names(), "name of a study"
    if names:
        told = f"{', '.join(names[:-1])}, or all (all but {' and '.join(studies().APART)})"
    study.add_argument("names", nargs="+", metavar="NAME", choices=names or None, help=told)
    _path(study, "--out", "DIR", FOLDERS, default=Path(), help="folder; default: here")
    study.add_argument("--quick", action="store_true", help="coarser meshes and fewer steps")
    drawn = study.add_argument_group("campaign only", "random scenes")
    drawn.add_argument(
        "--scenes", type=int, metavar="N", help="number of scenes; default: 300, 6 with --quick"
    )
    drawn.add_argument("--seed", type=int, metavar="S", help="seed of the random scenes; default: 0")
    drawn.add_argument("--workers", type=int, metavar="N", help="processes; default: one for each core")
    drawn.add_argument("--limit", type=int, metavar="SECONDS", help="CPU time limit of a scene; default: 60")


def _mesh_options(mesh: argparse.ArgumentParser) -> None:
    _scene_argument(mesh)
    _path(mesh, "--out", "FILE", required=True, help="output file, .vtu or .msh")


def _results(command: argparse.ArgumentParser) -> None:
    _path(command, "--out", "DIR", FOLDERS, help="folder for the results; default: ./NAME-out")


def _pool(command: argparse.ArgumentParser) -> None:
    """Options for parallel computation of the points of a sweep."""
    command.add_argument("--workers", type=int, metavar="N", help="processes; default: one for each core")
    said = "of a Dask cluster, tcp://HOST:PORT; local starts one"
    command.add_argument("--scheduler", metavar="ADDRESS", help=said)


def _again(command: argparse.ArgumentParser, resume: str, overwrite: str) -> None:
    """`--resume` or `--overwrite`, for a folder with results of an earlier run."""
    either = command.add_mutually_exclusive_group()
    either.add_argument("--resume", action="store_true", help=resume)
    either.add_argument("--overwrite", action="store_true", help=overwrite)


def _study_names() -> Known:
    """Names of studies, and all; a checkout that is not installed has none."""
    try:
        return Known((*studies().NAMES, "all"))
    except InputError:
        return Known()


def _sweep_options(sweep: argparse.ArgumentParser) -> None:
    _path(sweep, "sweep", "SWEEP.toml", help="scene and varied parameters")
    _results(sweep)
    _again(sweep, "keep the points of another sweep in the folder", "remove all points in the folder")
    _pool(sweep)


def _signal_options(voltage: argparse.ArgumentParser) -> None:
    _path(voltage, "file", "VOLTAGE", help="input signal, .csv, .wav or .hjif")
    _path(voltage, "--out", "FILE", required=True, help="output file; the suffix sets the format")
    voltage.add_argument("--full-scale", type=float, metavar="V", help="voltage of the file's largest value")
    voltage.add_argument("--speed", type=float, metavar="MM/S", help="sliding speed, for .wav and .hjif")
    said = "friction coefficients at 0 V and at full scale, for .hjif"
    voltage.add_argument("--friction", type=float, nargs=2, metavar=("MU0", "MU1"), help=said)
    said = "sampling rate of the .wav; default: 48000"
    voltage.add_argument("--rate", type=int, default=48_000, metavar="HZ", help=said)
    said = "carrier frequency that the .wav modulates"
    voltage.add_argument("--carrier", type=float, metavar="HZ", help=said)
    said = "bits of a sample of the .wav: 16, 24 or 32; default: 16"
    voltage.add_argument("--bits", type=int, default=16, metavar="N", help=said)
    said = "second channel of the .wav: negative or trigger; default: none"
    voltage.add_argument("--second", metavar="WHAT", help=said)
    said = "width of a pixel of the .png; default: 0.1"
    voltage.add_argument("--pixel", type=float, default=0.1, metavar="MM", help=said)


def _texture_options(texture: argparse.ArgumentParser) -> None:
    commands = texture.add_subparsers(dest="what", metavar="WHAT", required=True, parser_class=_Parser)
    for name, does, options in (
        ("list", "list the reference textures", lambda command: None),
        ("show", "print kind, licence and origin of a texture", _texture_argument),
        ("make", "generate a synthetic texture", _make_options),
        ("import", "make a texture from a csv file, a WAV, an image or a scan", _import_options),
        ("simulate", "slide the finite element pad over a texture", _simulate_options),
        ("estimate", "estimate the friction curve of a texture in milliseconds", _touch_options),
        ("database", "compute the database of the estimators", _database_options),
    ):
        options(commands.add_parser(name, help=does, description=f"{does[0].upper()}{does[1:]}."))


def _texture_argument(command: argparse.ArgumentParser) -> None:
    from evfem.textures.library import names

    said = "a reference texture, a .json, a folder, or a recording (of --speed)"
    _path(command, "name", "NAME", type=str, choices=Known(names()), help=said)


def _about_texture(command: argparse.ArgumentParser) -> None:
    _path(command, "--out", "FILE", required=True, help="output .json (with a .csv beside it) or folder")


def _make_options(make: argparse.ArgumentParser) -> None:
    from evfem.textures.generate import GENERATORS, Knobs

    make.add_argument("kind", choices=tuple(GENERATORS))
    _about_texture(make)
    make.add_argument("--name", help="name of the texture; default: that of the file")
    make.add_argument("--licence", default="CC0-1.0", help="its licence; default: CC0-1.0")
    _fields(make, Knobs)


def _import_options(command: argparse.ArgumentParser) -> None:
    from evfem.textures.importers import IMPORTERS

    _path(command, "file", "FILE", help=".csv, .wav, .hjif, an image or a scan")
    _about_texture(command)
    _fields(command, *IMPORTERS.values())


def _fields(command: argparse.ArgumentParser, *classes: type, **renamed: str) -> None:
    """An option for each annotated field of the classes; None if it is left out."""
    from evfem.common.checks import keys_of

    for key in {key.name: key for one in classes for key in keys_of(one)}.values():
        name = renamed.get(key.name, key.name)
        if bool in key.types:  # `ridged`, true by default
            command.add_argument("--smooth-finger", action="store_false", dest=name, help="without ridges")
            continue
        default = "" if key.required or key.default is None else f"; default: {key.default}"
        kind = next((one for one in (float, int) if one in key.types and str not in key.types), str)
        said = f"{key.meaning}; {key.allowed}{default}".replace("%", "%%")
        metavar = str(key.rule.get("unit") or name).upper()
        command.add_argument(f"--{name.replace('_', '-')}", type=kind, metavar=metavar, help=said)


def _touch_options(command: argparse.ArgumentParser) -> None:
    from evfem.estimate.display import Device
    from evfem.estimate.touch import Touch, Vibration

    _texture_argument(command)
    _fields(command, Touch, Vibration)
    _path(command, "--out", "FILE", help="csv file for the friction curve")
    _path(command, "--signal", "FILE", help="output file of the voltage; the suffix sets the format")
    _fields(command, Device, friction="display")


def _simulate_options(command: argparse.ArgumentParser) -> None:
    _touch_options(command)
    command.add_argument("--exact", action="store_true", help="solve the coupled model for the voltage")


def _database_options(command: argparse.ArgumentParser) -> None:
    _path(command, "--out", "DIR", FOLDERS, required=True, help="folder for the points of the database")
    _pool(command)


def _studio_options(studio: argparse.ArgumentParser) -> None:
    studio.add_argument("--port", type=int, default=8321, metavar="N", help="0: any free port; default: 8321")
    studio.add_argument("--no-browser", action="store_true", help="do not open a browser")


def _init_options(init: argparse.ArgumentParser) -> None:
    told = f"{' | '.join(TEMPLATES)}; default: display"
    init.add_argument("--template", metavar="NAME", choices=TEMPLATES, default="display", help=told)
    _path(init, "file", "FILE", nargs="?", help="default: NAME.toml")


def _schema_options(schema: argparse.ArgumentParser) -> None:
    schema.add_argument("of", nargs="?", choices=("scene", "sweep"), default="scene", help="default: scene")
    _path(schema, "--out", "FILE", help="output file, instead of printing")


def studies() -> ModuleType:
    """The studies, which an installed evfem has."""
    try:
        return importlib.import_module("evfem.studies")
    except ModuleNotFoundError as error:
        if error.name != "evfem.studies":
            raise
        raise InputError("study", "a checkout", "an installed evfem: pip install .") from error
