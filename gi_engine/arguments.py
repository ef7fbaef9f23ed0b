"""What the command line accepts: options, their types and their checks. No bpy; nothing is done here."""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

from . import native
from .compare import arguments as compare_arguments
from .scene_data import LIGHTMAP_CONTENTS

EPILOG = "exit codes: 0 done; 1 the render failed; 2 bad arguments; 130 cancelled, with what was finished written"


class ArgumentError(ValueError):
    """The arguments cannot be used; the message names the one."""


def parser(commands_by_name: dict, in_blender: bool) -> argparse.ArgumentParser:
    """`commands_by_name`: the functions that `.command` of the result is one of."""
    program = argparse.ArgumentParser(
        prog="gi-engine", description="Global illumination for Blender scenes.", epilog=EPILOG
    )
    commands = program.add_subparsers(required=True, metavar="COMMAND")
    file = {"nargs": "?" if in_blender else None, "type": Path, "metavar": "FILE.blend"}

    render = commands.add_parser("render", help="render a .blend file", epilog=EPILOG)
    render.add_argument("file", **file)
    render.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="OUT.png|.exr",
        help="default: where the scene says; '#'s hold the frame number",
    )
    render.add_argument(
        "--strategies",
        type=Path,
        metavar="DIR",
        help="instead of the picture: every strategy of a bidirectional integrator, weighted and not, for paths of up to 8 vertices, into this folder",
    )
    render.add_argument("--resolution", type=resolution, metavar="WxH", help="pixels")
    which = render.add_mutually_exclusive_group()
    which.add_argument(
        "--frame", type=frames, metavar="N|A-B", help="one frame or a range; default: the scene's current frame"
    )
    which.add_argument("--animation", action="store_true", help="the scene's frames, from its first to its last")
    render.add_argument(
        "--cache",
        type=Path,
        metavar="FILE",
        help="takes what an earlier render worked out from this file, and keeps there what this one adds",
    )
    render.add_argument(
        "--cache-misfit",
        type=str.upper,
        choices=("WITHOUT", "REPLACE", "STOP"),
        help="where the file is damaged or does not fit the scene: render without it, replace it, or stop",
    )
    add_sampling(render)
    render.set_defaults(command=commands_by_name["render"])

    bake = commands.add_parser("bake", help="bake the light on objects into lightmaps", epilog=EPILOG)
    bake.add_argument("file", **file)
    bake.add_argument("--object", action="append", required=True, metavar="NAME", help="whose surface; may be repeated")
    bake.add_argument(
        "--image", type=Path, required=True, metavar="OUT.exr", help="with several objects, their names are added to it"
    )
    bake.add_argument(
        "--uv-map", default="", metavar="NAME", help="default: a fresh one, made without overlaps; see --save"
    )
    bake.add_argument(
        "--content",
        type=str.upper,
        choices=[item[0] for item in LIGHTMAP_CONTENTS],
        default="IRRADIANCE",
        help="default: %(default)s",
    )
    bake.add_argument("--size", type=resolution, default=(512, 512), metavar="WxH", help="texels; default: 512x512")
    bake.add_argument(
        "--margin", type=at_least_one, default=8, metavar="N", help="texels filled beyond the edges; default: 8"
    )
    bake.add_argument("--no-denoise", action="store_true", help="keep the noise")
    bake.add_argument(
        "--save", type=Path, metavar="OUT.blend", help="keep the scene with its fresh UV maps and its lightmaps"
    )
    add_sampling(bake)
    bake.set_defaults(command=commands_by_name["bake"])

    info = commands.add_parser("info", help="say what would be rendered and what is not supported", epilog=EPILOG)
    info.add_argument("file", **file)
    info.set_defaults(command=commands_by_name["info"])

    integrators = commands.add_parser("integrators", help="list the integrators and their parameters")
    integrators.set_defaults(command=commands_by_name["integrators"])
    others = compare_arguments.add_commands(commands, commands_by_name, file, sys.modules[__name__])
    if not in_blender:
        others.append(add_package(commands, commands_by_name))
    for command in (render, bake, info, integrators, *others):
        command.add_argument("-v", "--verbose", action="store_true", help="show what Blender prints")
    return program


def add_package(commands, commands_by_name: dict):
    command = commands.add_parser("package", help="make the extension's zip for Blender, from a checkout")
    command.add_argument(
        "-o", "--output", type=Path, default=Path("dist"), metavar="DIR", help="the folder of the zip; default: dist"
    )
    command.add_argument(
        "--wheel",
        type=Path,
        action="append",
        default=[],
        metavar="WHEEL",
        help="the compiled part, made elsewhere; may be repeated, a zip is made for each platform; default: compile it here",
    )
    command.add_argument(
        "--compiler",
        choices=("zig", "system"),
        default="zig",
        help="zig makes what runs on old systems too; the system's compiler what runs on systems as new as this one",
    )
    command.set_defaults(command=commands_by_name["package"])
    return command


def add_sampling(command) -> None:
    """What rendering and baking have in common: how light is followed, for how long."""
    command.add_argument("--integrator", metavar="ID", help="see `gi-engine integrators`")
    target = command.add_mutually_exclusive_group()
    target.add_argument("--samples", type=at_least_one, metavar="N", help="stop at N samples a pixel")
    target.add_argument("--time", type=positive, metavar="S", help="stop after S seconds of sampling")
    target.add_argument(
        "--noise",
        type=positive,
        metavar="X",
        help="stop when 95 %% of the pixels have a relative standard error under X",
    )
    command.add_argument(
        "--threads", type=at_least_one, metavar="N", help="default: all cores, or the scene's fixed number"
    )
    command.add_argument("--seed", type=seed, metavar="N", help="another seed, another pattern of noise")
    command.add_argument(
        "--set",
        type=assignment,
        action="append",
        default=[],
        metavar="name=value",
        help="a parameter of the integrator",
    )


def at_least_one(text: str) -> int:
    if not re.fullmatch(r"\d{1,7}", text) or int(text) < 1:
        raise argparse.ArgumentTypeError(f'"{text}" is not a whole number from 1 to 9999999')
    return int(text)


def positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f'"{text}" is not a number above 0')
    return value


def seed(text: str) -> int:
    if not re.fullmatch(r"\d{1,10}", text) or int(text) > 0x7FFFFFFF:
        raise argparse.ArgumentTypeError(f'"{text}" is not a whole number from 0 to 2147483647')
    return int(text)


def resolution(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,5})[xX](\d{1,5})", text)
    size = tuple(int(number) for number in match.groups()) if match else (0, 0)
    if not all(1 <= n <= 65536 for n in size):
        raise argparse.ArgumentTypeError(f'"{text}" is not WIDTHxHEIGHT in pixels, such as 640x360, of 1 to 65536')
    return size


def frames(text: str) -> range:
    match = re.fullmatch(r"(-?\d{1,7})(?:-(-?\d{1,7}))?", text)
    first, last = (int(match[1]), int(match[2] or match[1])) if match else (1, 0)
    if last < first:
        raise argparse.ArgumentTypeError(f'"{text}" is not a frame N or a range A-B')
    return range(first, last + 1)


def assignment(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not (name and equals and value):
        raise argparse.ArgumentTypeError(f'"{text}" is not name=value')
    return name, value


def find_integrator(identifier: str) -> dict:
    for descriptor in native.integrators():
        if descriptor["id"] == identifier:
            return descriptor
    raise ArgumentError(f'no integrator "{identifier}"; there are: {", ".join(d["id"] for d in native.integrators())}')


def check_parameters(descriptor: dict, given: dict[str, str]) -> None:
    """Names and values of --set. Raises ArgumentError with what would be valid."""
    declared = {p["name"]: p for p in descriptor["parameters"]}
    for name, value in given.items():
        if name not in declared:
            raise ArgumentError(
                f'--set: integrator "{descriptor["id"]}" has no parameter "{name}"; it has: {", ".join(declared)}'
            )
        problem = value_problem(declared[name], value)
        if problem:
            raise ArgumentError(f"--set: {name} {problem}")


def value_problem(parameter: dict, value: str) -> str:
    """Why `value` cannot be the parameter's; "" if it can."""
    kind = parameter["type"].lower()
    if kind == "bool":
        return "" if value.lower() in ("0", "1", "false", "true", "off", "on") else f'is on or off, not "{value}"'
    if kind == "enum":
        names = [item if isinstance(item, str) else item[0] for item in parameter["items"]]
        return "" if value in names else f'is one of {", ".join(names)}, not "{value}"'
    try:
        number = int(value) if kind == "int" else float(value)
    except ValueError:
        return f'is a{" whole" if kind == "int" else ""} number, not "{value}"'
    low, high = parameter.get("min"), parameter.get("max")
    inside = (low is None or number >= low) and (high is None or number <= high)
    return "" if inside else f"is from {low} to {high}, not {value}"


def check_file(arguments) -> None:
    """Raises ArgumentError unless the file is there and looks like a .blend (plain, gzip or zstd)."""
    path = arguments.file
    if path is None:
        return
    try:
        with path.open("rb") as file:
            head = file.read(7)
    except OSError as error:
        raise ArgumentError(f'"{path}" cannot be read: {error.strerror}') from error
    if head != b"BLENDER" and head[:2] != b"\x1f\x8b" and head[:4] != b"\x28\xb5\x2f\xfd":
        raise ArgumentError(f'"{path}" is not a .blend file')


def overrides(arguments) -> dict:
    """Fields of Settings that the arguments set. One kind of limit replaces the scene's."""
    chosen = {}
    if arguments.samples or arguments.time or arguments.noise:
        chosen = {
            "samples": arguments.samples or 0,
            "time_limit": arguments.time or 0.0,
            "noise_target": arguments.noise or 0.0,
        }
    if arguments.integrator is not None:
        chosen["integrator"] = arguments.integrator
    if arguments.threads is not None:
        chosen["threads"] = arguments.threads
    if arguments.seed is not None:
        chosen["seed"] = arguments.seed
    if getattr(arguments, "cache", None) is not None:
        chosen["kept_file"] = str(arguments.cache.absolute())
    if getattr(arguments, "cache_misfit", None) is not None:
        chosen["kept_misfit"] = arguments.cache_misfit
    return chosen
