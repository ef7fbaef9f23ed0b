"""The command line: `gi-engine …`, and `blender -c gi_engine …` with the same commands.

Exit codes: 0 done; 1 the render failed; 2 bad arguments (an input or output that cannot be used included);
130 cancelled by Ctrl-C or SIGTERM, with what was finished written. bpy is imported only once the arguments are known to be good.
"""

from __future__ import annotations

import contextlib
import os
import re
import signal
import sys
from pathlib import Path

from . import control, native
from .arguments import ArgumentError, check_file, check_parameters, find_integrator, overrides, parser
from .control import Control, RenderError
from .display import display_on, duration, flush_all, quiet
from .info import describe
from .output import OutputError, Target, check_suffix, numbered

FORBIDDEN = r'[\\/:*?"<>|]'  # in names of files
DONE, FAILED, BAD_ARGUMENTS, CANCELLED = 0, 1, 2, 130


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
        arguments = parser(COMMANDS, in_blender).parse_args(argv)
    except SystemExit as stop:  # argparse has said why
        return stop.code or DONE
    arguments.in_blender = in_blender
    with quiet(not arguments.verbose) as (out, err):
        try:
            return arguments.command(arguments, out, err)
        except (ArgumentError, OutputError) as error:
            print(f"gi-engine: {error}", file=err)
            return BAD_ARGUMENTS
        except (RenderError, native.NativeMissing) as error:
            print(f"gi-engine: {error}", file=err)
            return FAILED
        except KeyboardInterrupt:
            print("gi-engine: cancelled before anything was rendered", file=err)
            return CANCELLED


# Commands


def render_command(arguments, out, err) -> int:
    check_render(arguments)
    wishes = Control(overrides=overrides(arguments), parameters=dict(arguments.set))
    with controlled(wishes, err), interruptible(wishes):
        headless = open_scene(arguments)
        scene = headless.bpy.context.scene
        settle(arguments, headless, scene)
        with display_on(err) as display:
            if arguments.strategies is not None:
                return render_strategies(arguments, headless, scene, wishes, display, (out, err))
            return render_frames(arguments, headless, scene, wishes, display, (out, err))


def settle(arguments, headless, scene) -> None:
    """Sets what is the scene's own: size and format. The rest reaches the engine by itself."""
    chosen = find_integrator(arguments.integrator or scene.gi_engine.integrator)
    check_parameters(chosen, dict(arguments.set))
    if arguments.cache is not None and not chosen["kept_version"]:
        able = ", ".join(d["id"] for d in native.integrators() if d["kept_version"])
        raise ArgumentError(f'--cache: integrator "{chosen["id"]}" has nothing to keep; these have: {able}')
    if arguments.resolution is not None:
        try:
            headless.set_resolution(scene, *arguments.resolution)
        except ValueError as error:
            raise ArgumentError(f"--resolution: {error}") from error
    if arguments.output is not None:
        headless.set_format(scene, arguments.output.suffix.lower())


def render_frames(arguments, headless, scene, wishes: Control, display, streams) -> int:
    out, err = streams
    arguments.frame = frames_of(arguments, scene)
    look_ahead(arguments, headless, scene, wishes)
    for frame in arguments.frame:
        written, passes = [], 0
        if not wishes.cancelled:
            written, passes = render_frame(arguments, headless, scene, frame, wishes, display)
        for name in written:
            note = f", {wishes.last.note}" if wishes.last.note else ""
            display.say(f"{name}: {passes} passes in {duration(wishes.last.seconds)}{note}", out)
        if wishes.cancelled:
            outcome = f"the picture has {passes} passes" if written else "no pass was finished, nothing is written"
            display.say(f"gi-engine: cancelled; {outcome}", err)
            return CANCELLED
    return DONE


def frames_of(arguments, scene) -> list[int]:
    if arguments.animation:
        return list(range(scene.frame_start, scene.frame_end + 1, scene.frame_step))
    return list(arguments.frame or [scene.frame_current])


def look_ahead(arguments, headless, scene, wishes: Control) -> None:
    """Where an integrator keeps something from frame to frame, it is told where the camera will be."""
    from . import camera_path
    from .export import ExportError

    chosen = find_integrator(arguments.integrator or scene.gi_engine.integrator)
    if len(arguments.frame) < 2 or not chosen["kept_version"] or not scene.gi_engine.keep:
        return
    try:
        wishes.path = camera_path.collect(headless.bpy.context, arguments.frame)
    except ExportError as error:
        raise RenderError(str(error)) from error


def check_render(arguments) -> None:
    """What can be known to be wrong before Blender starts."""
    check_file(arguments)
    native.module()
    if arguments.integrator is not None:
        find_integrator(arguments.integrator)
    if arguments.strategies is not None:
        if arguments.output is not None or arguments.animation or len(arguments.frame or ()) > 1:
            raise ArgumentError(
                "--strategies: writes one frame into its folder; leave --output and ranges of frames out"
            )
        check_folder(arguments.strategies)
    if arguments.cache_misfit is not None and arguments.cache is None:
        raise ArgumentError("--cache-misfit: there is no --cache")
    if arguments.cache is not None:
        with Target(arguments.cache):
            pass
    if arguments.output is not None:
        check_suffix(arguments.output)
        with Target(arguments.output):
            pass


def check_folder(path: Path) -> None:
    """Makes the folder where it is missing. Raises OutputError."""
    try:
        path.mkdir(exist_ok=True)
    except OSError as error:
        raise OutputError(f'output folder "{path}" cannot be made: {error.strerror}') from error
    with Target(path / "strategies"):
        pass


def render_strategies(arguments, headless, scene, wishes: Control, display, streams) -> int:
    from . import strategies
    from .export import ExportError
    from .session import RenderFailed

    out, err = streams
    if arguments.frame:
        scene.frame_set(arguments.frame[0])
    display.begin(arguments.strategies.name)
    wishes.on_progress = display.update
    try:
        made = strategies.render(headless.bpy.context, arguments.strategies, arguments.integrator, control.cancelled)
    except strategies.StrategyError as error:
        raise ArgumentError(f"--strategies: {error}") from error
    except (ExportError, RenderFailed) as error:
        raise RenderError(str(error)) from error
    if made is None:
        display.say("gi-engine: cancelled; nothing is written", err)
        return CANCELLED
    for warning in made.warnings:
        control.warn(warning)
    display.say(f"{arguments.strategies}: {len(made.images)} pictures and two sheets of {len(made.images) // 2}", out)
    return DONE


def render_frame(arguments, headless, scene, frame: int, wishes: Control, display) -> tuple[list, int]:
    """Renders one frame into its file. Returns the files and the passes in them; none where it was cancelled too soon."""
    if arguments.output is not None:
        path = numbered(arguments.output, frame, always=arguments.animation or len(arguments.frame) > 1)
    else:
        path = headless.own_output(scene, frame)
    passes = 0

    def watch(progress):
        # A view layer that comes after a cancelled one has no pass.
        nonlocal passes
        passes = progress.passes or passes
        display.update(progress)

    wishes.on_progress = watch
    display.begin(path.name)
    with Target(path) as target:
        headless.render_frame(scene, frame, target.folder, "picture")
        if passes == 0 and not wishes.cancelled:
            raise RenderError(f'scene "{scene.name}" was not rendered: no pass was finished')
        return (target.publish(path, "picture") if passes else []), passes


def bake_command(arguments, out, err) -> int:
    paths = check_bake(arguments)
    wishes = Control(overrides=overrides(arguments), parameters=dict(arguments.set))
    with controlled(wishes, err), interruptible(wishes):
        headless = open_scene(arguments)
        chosen = find_integrator(arguments.integrator or headless.bpy.context.scene.gi_engine.integrator)
        check_parameters(chosen, wishes.parameters)
        if not chosen["bakes"]:
            raise ArgumentError(f'integrator "{chosen["id"]}" cannot bake lightmaps; choose another with --integrator')
        with display_on(err) as display:
            wishes.on_progress = display.update
            code = bake_objects(arguments, headless, chosen["id"], paths, display, (out, err))
        if arguments.save is not None and code == DONE:
            headless.save_file(arguments.save)
        return code


def bake_objects(arguments, headless, integrator: str, paths: dict[str, Path], display, streams) -> int:
    from . import bake

    (width, height), (out, err) = arguments.size, streams
    context = headless.bpy.context
    try:
        for name in paths:  # all that can be wrong before any is baked
            bake.check_map(bake.find_object(context.view_layer, name), arguments.uv_map)
        for name, path in paths.items():
            request = bake.Request(name, arguments.uv_map, arguments.content, width, height, arguments.margin)
            request.denoise = not arguments.no_denoise
            display.begin(path.name)
            image, uv_map, passes, warnings = bake.bake(context, request, path, integrator, control.cancelled)
            for warning in warnings:
                control.warn(warning)
            if image is not None:
                display.say(
                    f'{path}: {passes} passes in {duration(control.current.last.seconds)}, UV map "{uv_map}"', out
                )
            if control.cancelled():
                display.say("gi-engine: cancelled" + ("" if image else "; nothing is written"), err)
                return CANCELLED
    except bake.BakeError as error:
        raise ArgumentError(str(error)) from error
    except bake.USER_ERRORS as error:
        raise RenderError(str(error)) from error
    if not arguments.uv_map and arguments.save is None:
        control.warn(f'the fresh UV map "{bake.FRESH_MAP}" is kept in no file; name one with --save')
    return DONE


def check_bake(arguments) -> dict[str, Path]:
    """What can be known to be wrong before Blender starts. Returns the image of each object."""
    check_file(arguments)
    native.module()
    if arguments.integrator is not None:
        find_integrator(arguments.integrator)
    if arguments.image.suffix.lower() != ".exr":
        raise OutputError(f'image "{arguments.image}": the name must end in .exr')
    names = list(dict.fromkeys(arguments.object))
    image = arguments.image
    paths = {
        name: image if len(names) == 1 else image.with_stem(f"{image.stem}-{re.sub(FORBIDDEN, '_', name)}")
        for name in names
    }
    if len(set(paths.values())) < len(paths):
        raise ArgumentError("--object: two of the names would make the same name of a file")
    for path in [*paths.values(), *([arguments.save] if arguments.save else [])]:
        with Target(path):
            pass
    return paths


def info_command(arguments, out, err) -> int:
    check_file(arguments)
    native.module()
    headless = open_scene(arguments)
    scene = headless.bpy.context.scene
    layers = {}

    def look(view_layer, exported, settings):
        layers[view_layer] = describe(exported, settings)

    with controlled(Control(inspect=look), out):
        headless.look_at(scene)
        print(f'scene: "{scene.name}", frame {scene.frame_current}', file=out)
        for view_layer, lines in layers.items():
            print(f'view layer: "{view_layer}"', *(f"  {line}" for line in lines), sep="\n", file=out)
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


def compare_command(arguments, out, err) -> int:
    from .compare.commands import compare_command

    return compare_command(arguments, out, err)


def series_command(arguments, out, err) -> int:
    from .compare.commands import series_command

    return series_command(arguments, out, err)


def parity_command(arguments, out, err) -> int:
    from .compare.commands import parity_command

    return parity_command(arguments, out, err)


def package_command(arguments, out, err) -> int:
    from .package.assemble import package
    from .package.wheels import WheelError

    try:
        for path in package(arguments.output, arguments.wheel, arguments.compiler, lambda text: print(text, file=err)):
            print(f"{path}: {path.stat().st_size / 2**20:.1f} MiB", file=out)
    except WheelError as error:
        raise RenderError(str(error)) from error
    return DONE


COMMANDS = {
    "render": render_command,
    "bake": bake_command,
    "info": info_command,
    "integrators": integrators_command,
    "compare": compare_command,
    "series": series_command,
    "parity": parity_command,
    "package": package_command,
}


# What commands share


def open_scene(arguments):
    """Opens the file with the engine chosen, and gives the module that does the rest. Raises RenderError."""
    from . import headless

    if not arguments.in_blender:
        headless.register_once()
    if arguments.file is not None:
        headless.open_file(arguments.file, factory_settings=not arguments.in_blender)
    headless.bpy.context.scene.render.engine = "GI_ENGINE"
    return headless


@contextlib.contextmanager
def controlled(wishes: Control, stream):
    """Lets the engine know of `wishes`, and says its warnings on `stream` in the end."""
    control.current = wishes
    try:
        yield
    finally:
        control.current = None
        for warning in wishes.warnings:
            print(f"gi-engine: warning: {warning}", file=stream)


@contextlib.contextmanager
def interruptible(wishes: Control):
    """The first Ctrl-C or SIGTERM asks the render to stop and keep what it has; the second ends the program."""

    def stop(*_):
        if wishes.cancelled:
            os._exit(CANCELLED)
        wishes.cancelled = True

    before = {}
    with contextlib.suppress(ValueError):  # not the main thread: whoever runs us handles signals
        for number in (signal.SIGINT, signal.SIGTERM):
            before[number] = signal.signal(number, stop)
    try:
        yield
    finally:
        for number, handler in before.items():
            # The program's own handler, which Python knows only as None, cannot be put back.
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
