"""The command line: `gi-engine …`, and `blender -c gi_engine …` with the same commands.

Exit codes: 0 done; 1 the render failed; 2 bad arguments (an input or output that cannot be used included);
130 cancelled by Ctrl-C, with what was finished written. bpy is imported only once the arguments are known to be good.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import signal
import sys
from pathlib import Path

from . import control, native
from .display import display_on, duration, flush_all, quiet
from .info import describe
from .output import OutputError, Target, check_suffix, numbered

DONE, FAILED, BAD_ARGUMENTS, CANCELLED = 0, 1, 2, 130
EPILOG = "exit codes: 0 done; 1 the render failed; 2 bad arguments; 130 cancelled, with what was finished written"


class ArgumentError(ValueError):
    """The arguments cannot be used; the message names the one."""


def main() -> None:
    """The `gi-engine` program."""
    code = run(sys.argv[1:])
    flush_all()
    if "bpy" in sys.modules:
        os._exit(code)  # Blender 4.5's module can hang when the interpreter shuts down
    sys.exit(code)


def run(argv: list[str], in_blender: bool = False) -> int:
    """Runs one command and returns its exit code. `in_blender`: the engine is registered and a file may be open."""
    try:
        arguments = parser(in_blender).parse_args(argv)
    except SystemExit as stop:  # argparse has said why
        return stop.code or DONE
    arguments.in_blender = in_blender
    with quiet(not arguments.verbose) as (out, err):
        try:
            return arguments.command(arguments, out, err)
        except (ArgumentError, OutputError) as error:
            print(f"gi-engine: {error}", file=err)
            return BAD_ARGUMENTS
        except native.NativeMissing as error:
            print(f"gi-engine: {error}", file=err)
            return FAILED
        except KeyboardInterrupt:
            print("gi-engine: cancelled before anything was rendered", file=err)
            return CANCELLED


# Arguments


def parser(in_blender: bool) -> argparse.ArgumentParser:
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
    render.add_argument("--integrator", metavar="ID", help="see `gi-engine integrators`")
    target = render.add_mutually_exclusive_group()
    target.add_argument("--samples", type=at_least_one, metavar="N", help="stop at N samples a pixel")
    target.add_argument("--time", type=positive, metavar="S", help="stop after S seconds of sampling")
    target.add_argument(
        "--noise",
        type=positive,
        metavar="X",
        help="stop when 95 %% of the pixels have a relative standard error under X",
    )
    render.add_argument("--resolution", type=resolution, metavar="WxH", help="pixels")
    render.add_argument(
        "--frame", type=frames, metavar="N|A-B", help="one frame or a range; default: the scene's current frame"
    )
    render.add_argument(
        "--threads", type=at_least_one, metavar="N", help="default: all cores, or the scene's fixed number"
    )
    render.add_argument("--seed", type=seed, metavar="N", help="another seed, another pattern of noise")
    render.add_argument(
        "--set",
        type=assignment,
        action="append",
        default=[],
        metavar="name=value",
        help="a parameter of the integrator",
    )
    render.set_defaults(command=render_command)

    info = commands.add_parser("info", help="say what would be rendered and what is not supported", epilog=EPILOG)
    info.add_argument("file", **file)
    info.set_defaults(command=info_command)

    integrators = commands.add_parser("integrators", help="list the integrators and their parameters")
    integrators.set_defaults(command=integrators_command)
    for command in (render, info, integrators):
        command.add_argument("-v", "--verbose", action="store_true", help="show what Blender prints")
    return program


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


# Commands


def render_command(arguments, out, err) -> int:
    check_file(arguments)
    native.module()  # says at once if it is not there
    if arguments.output is not None:
        check_suffix(arguments.output)
    if arguments.integrator is not None:
        find_integrator(arguments.integrator)
    wishes = control.Control(overrides=overrides(arguments), parameters=dict(arguments.set))
    if arguments.output is not None:
        Target(arguments.output).__exit__()  # before Blender starts, so that a bad folder is said at once
    headless = open_scene(arguments, err)
    if headless is None:
        return FAILED
    scene = headless.bpy.context.scene
    control.current = wishes
    try:
        with ctrl_c(wishes, err), display_on(err) as display:
            return render_frames(arguments, headless, scene, wishes, display, (out, err))
    except headless.RenderError as error:
        print(f"gi-engine: {error}", file=err)
        return FAILED
    finally:
        control.current = None
        for warning in wishes.warnings:
            print(f"gi-engine: warning: {warning}", file=err)


def render_frames(arguments, headless, scene, wishes, display, streams) -> int:
    out, err = streams
    headless.use_engine(scene)
    check_parameters(find_integrator(arguments.integrator or scene.gi_engine.integrator), wishes.parameters)
    if arguments.resolution:
        try:
            headless.set_resolution(scene, *arguments.resolution)
        except ValueError as error:
            raise ArgumentError(f"--resolution: {error}") from error
    if arguments.output is not None:
        headless.set_format(scene, arguments.output.suffix.lower())
    chosen = arguments.frame or range(scene.frame_current, scene.frame_current + 1)
    for frame in chosen:
        path = (
            numbered(arguments.output, frame, len(chosen) > 1)
            if arguments.output
            else headless.own_output(scene, frame)
        )
        best = control.Progress()

        def watch(progress):
            nonlocal best
            best = progress if progress.passes > 0 else best
            display.update(progress)

        wishes.on_progress = watch
        display.begin(f"Frame {frame}" if len(chosen) > 1 else path.name)
        with Target(path) as target:
            headless.render_frame(scene, frame, target.folder, "picture")
            if best.passes == 0 and wishes.cancelled:
                print(
                    f"gi-engine: cancelled before the first pass of {path.name} was finished; nothing was written",
                    file=err,
                )
                return CANCELLED
            if best.passes == 0:
                raise headless.RenderError(f'scene "{scene.name}" was not rendered: no pass was finished')
            written = target.publish(path, "picture")
        for name in written:
            display.say(f"{name}: {best.passes} passes in {duration(best.seconds)}", out)
        if wishes.cancelled:
            display.say(f"gi-engine: cancelled; the picture has {best.passes} passes", err)
            return CANCELLED
    return DONE


def info_command(arguments, out, err) -> int:
    check_file(arguments)
    native.module()
    headless = open_scene(arguments, err)
    if headless is None:
        return FAILED
    scene = headless.bpy.context.scene
    headless.use_engine(scene)
    layers = {}

    def look(view_layer, exported, settings):
        layers[view_layer] = describe(exported, settings)

    control.current = wishes = control.Control(inspect=look)
    try:
        headless.look_at(scene)
    except headless.RenderError as error:
        print(f"gi-engine: {error}", file=err)
        return FAILED
    finally:
        control.current = None
    print(f'scene: "{scene.name}", frame {scene.frame_current}', file=out)
    for view_layer, lines in layers.items():
        print(f'view layer: "{view_layer}"', *(f"  {line}" for line in lines), sep="\n", file=out)
    for warning in wishes.warnings:
        print(f"warning: {warning}", file=out)
    return DONE


def integrators_command(arguments, out, err) -> int:
    native.module()
    for descriptor in native.integrators():
        print(f"{descriptor['id']}: {descriptor['label']}. {descriptor.get('blurb', '')}", file=out)
        for parameter in descriptor["parameters"]:
            print(
                f"    {parameter['name']}={parameter['default']} ({range_of(parameter)})  {parameter.get('help', '')}",
                file=out,
            )
    return DONE


def range_of(parameter: dict) -> str:
    kind = parameter["type"].lower()
    if kind == "enum":
        return " | ".join(item if isinstance(item, str) else item[0] for item in parameter["items"])
    if kind == "bool":
        return "on | off"
    return f"{kind}, {parameter.get('min'):g} to {parameter.get('max'):g} {parameter.get('unit', '')}".strip()


# What commands share


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
    return chosen


def open_scene(arguments, err):
    """Opens the file with the engine registered and gives the module that does the rest; None where it cannot be read."""
    from . import headless

    if not arguments.in_blender:
        headless.register_once()
    try:
        if arguments.file is not None:
            headless.open_file(arguments.file, factory_settings=not arguments.in_blender)
    except headless.RenderError as error:
        print(f"gi-engine: {error}", file=err)
        return None
    return headless


@contextlib.contextmanager
def ctrl_c(wishes: control.Control, err):
    """The first Ctrl-C asks the render to stop and keep what it has; the second ends the program."""

    def stop(*_):
        if wishes.cancelled:
            os._exit(CANCELLED)
        wishes.cancelled = True

    try:
        before = signal.signal(signal.SIGINT, stop)
    except ValueError:  # not the main thread: whoever runs us handles signals
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
