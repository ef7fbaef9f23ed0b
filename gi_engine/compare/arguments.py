"""What `gi-engine compare`, `series` and `parity` accept. No bpy; nothing is done here."""

from __future__ import annotations

import argparse
import re
from pathlib import Path


def add_commands(commands, commands_by_name: dict, file: dict, types) -> list:
    """`types`: the module with the types of numbers. Returns the parsers."""
    compare = commands.add_parser("compare", help="compare engines and integrators on a scene, with a report")
    compare.add_argument("file", **file)
    compare.add_argument(
        "--engines",
        default="path,bdpt,cycles",
        metavar="A,B,…",
        help="integrators' ids or their beginnings, and cycles; default: %(default)s",
    )
    compare.add_argument(
        "--reference",
        default="cycles",
        metavar="ENGINE|IMAGE.exr",
        help="what is taken for the truth; default: %(default)s",
    )
    add_limits(compare, types)
    compare.add_argument("--until-error", type=types.positive, metavar="X", help="go on until the relative MSE is X")
    compare.add_argument(
        "--region",
        type=region,
        metavar="X0,Y0,X1,Y1",
        help="shares of the picture from its lower left corner, such as 0.25,0.25,0.75,0.75",
    )
    compare.add_argument("--frame", type=int, metavar="N", help="default: the scene's current frame")
    compare.add_argument(
        "-o", "--output", type=Path, default=Path("report"), metavar="DIR", help="default: %(default)s"
    )
    compare.set_defaults(command=commands_by_name["compare"])
    series = commands.add_parser(
        "series", help="the classic figure: from ray tracing to global illumination, on one sheet"
    )
    series.add_argument("file", **file)
    add_limits(series, types)
    series.add_argument("--frame", type=int, metavar="N", help="default: the scene's current frame")
    series.add_argument("-o", "--output", type=Path, default=Path("series"), metavar="DIR", help="default: %(default)s")
    series.set_defaults(command=commands_by_name["series"])
    parity = commands.add_parser("parity", help="compare with Cycles on many .blend files, in one table and page")
    parity.add_argument(
        "folders", type=Path, nargs="+", metavar="DIR", help="searched for .blend files; or such a file"
    )
    parity.add_argument("--engine", default="path", metavar="ID", help="integrator; default: %(default)s")
    limit = parity.add_mutually_exclusive_group()
    limit.add_argument("--samples", type=types.at_least_one, metavar="N", help="per pixel of each picture; default: 64")
    limit.add_argument("--time", type=types.positive, metavar="S", help="seconds of each picture")
    parity.add_argument(
        "--size",
        type=types.at_least_one,
        default=128,
        metavar="N",
        help="pixels along the longer side; default: %(default)s",
    )
    parity.add_argument("--threads", type=types.at_least_one, metavar="N", help="default: the scenes'")
    parity.add_argument(
        "--limit",
        type=types.positive,
        default=1800.0,
        metavar="S",
        help="give a scene up after this many seconds; default: %(default)g",
    )
    parity.add_argument(
        "--notes", type=Path, metavar="FILE.json", help="what is known of scenes, by name, for their rows"
    )
    parity.add_argument("--fresh", action="store_true", help="render scenes anew that an earlier run finished")
    parity.add_argument("-o", "--output", type=Path, default=Path("parity"), metavar="DIR", help="default: %(default)s")
    parity.set_defaults(command=commands_by_name["parity"])
    return [compare, series, parity]


def add_limits(command, types) -> None:
    limit = command.add_mutually_exclusive_group()
    limit.add_argument("--time", type=types.positive, metavar="S", help="seconds of each engine; default: 10")
    limit.add_argument("--samples", type=types.at_least_one, metavar="N", help="samples per pixel of each engine")
    long = command.add_mutually_exclusive_group()
    long.add_argument("--reference-time", type=types.positive, metavar="S", help="default: ten times an engine's")
    long.add_argument("--reference-samples", type=types.at_least_one, metavar="N")
    command.add_argument("--resolution", type=types.resolution, metavar="WxH", help="pixels")
    command.add_argument("--threads", type=types.at_least_one, metavar="N", help="default: the scene's")
    command.add_argument(
        "--limit",
        type=types.positive,
        default=600.0,
        metavar="S",
        help="give a render up that takes this much longer than it should; default: %(default)g",
    )
    command.add_argument(
        "--cache", type=Path, metavar="DIR", help="where references are kept; default: the user's cache"
    )


def region(text: str) -> tuple[float, float, float, float]:
    number = r"\s*(\d*\.?\d+)\s*"
    match = re.fullmatch(",".join([number] * 4), text)
    found = tuple(float(part) for part in match.groups()) if match else (0.0,) * 4
    if not (0 <= found[0] < found[2] <= 1 and 0 <= found[1] < found[3] <= 1):
        raise argparse.ArgumentTypeError(
            f'"{text}" is not X0,Y0,X1,Y1 with 0 ≤ X0 < X1 ≤ 1 and 0 ≤ Y0 < Y1 ≤ 1, such as 0.25,0.25,0.75,0.75'
        )
    return found
