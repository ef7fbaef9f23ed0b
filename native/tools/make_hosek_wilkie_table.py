"""Writes native/src/shading/sky/hosek_wilkie.inc: the authors' fit of their sky, in CIE XYZ.

Reads ArHosekSkyModelData_CIEXYZ.h of version 1.4a (cgg.mff.cuni.cz/projects/SkylightModelling), whose licence goes along with the
numbers. [Hosek & Wilkie 2012, "An analytic model for full spectral sky-dome radiance"] Runs by hand, never in the build:
    python native/tools/make_hosek_wilkie_table.py ArHosekSkyModelData_CIEXYZ.h
"""

import re
import sys
from pathlib import Path


def numbers(header: str, name: str) -> list[str]:
    body = re.search(rf"\bdouble {name}\[\]\s*=\s*\{{(.*?)\}};", header, re.S)[1]
    return [f"{float(x):.7g}" for x in re.sub(r"//.*", "", body).replace("\n", " ").split(",") if x.strip()]


def table(header: str, kind: str, width: int) -> list[str]:
    lines = []
    for channel in "123":
        values = numbers(header, f"dataset{kind}{channel}")
        assert len(values) == 2 * 10 * 6 * width, (kind, channel, len(values))
        # Floats need a point or an exponent before their "f".
        floats = [x + ("f" if re.search(r"[.e]", x) else ".0f") for x in values]
        lines += [",".join(floats[i : i + 6 * width]) + "," for i in range(0, len(floats), 6 * width)]
    return lines


def main():
    header = Path(sys.argv[1]).read_text()
    licence = re.search(r"/\*(.*?)\*/", header, re.S)[1].strip().splitlines()
    lines = [
        "// Written by native/tools/make_hosek_wilkie_table.py from data published under this licence:",
        "//",
        *(f"// {line.rstrip()}".rstrip() for line in licence),
        "",
        "// X, Y, Z; by albedo (0, 1), turbidity (1 to 10), control point of the sun's height; then the 9 shape parameters.",
        "// clang-format off",
        f"constexpr float kShape[{3 * 2 * 10 * 6 * 9}] = {{",
        *table(header, "XYZ", 9),
        "};",
        "// The same of the mean radiance.",
        f"constexpr float kRadiance[{3 * 2 * 10 * 6}] = {{",
        *table(header, "XYZRad", 1),
        "};",
        "// clang-format on",
        "",
    ]
    path = Path(__file__).parents[1] / "src/shading/sky/hosek_wilkie.inc"
    path.write_text("\n".join(lines))


if __name__ == "__main__":
    main()
