"""Writes native/src/shading/lobes/sheen_table.h: the transformed cosines that the authors fitted to their layer of fibres.

Reads ltc_table_sheen_volume.cpp of github.com/tizian/ltc-sheen, [Zeltner et al. 2022], which Cycles has too. Runs by hand, never
in the build:
    python native/tools/make_sheen_table.py ltc_table_sheen_volume.cpp
"""

import re
import sys
from pathlib import Path

import numpy as np

HEAD = """\
// Written by native/tools/make_sheen_table.py from ltc_table_sheen_volume.cpp of github.com/tizian/ltc-sheen by Tizian Zeltner,
// Brent Burley and Matt Jen-Yuan Chiang, which is licensed under the Apache License, Version 2.0
// (http://www.apache.org/licenses/LICENSE-2.0); rearranged, numbers unchanged.
// Rows: roughness 0..1, columns: view cosine 0..1. A, B: inverse linear transform; R: albedo. Where there is no fit: 0.
// clang-format off
#pragma once

namespace gi {

inline constexpr int kSheenGrid = 32;
"""


def main():
    found = re.findall(r"Vector3f\(([^,]+),([^,]+),([^)]+)\)", Path(sys.argv[1]).read_text())
    table = np.array(found, float).reshape(32, 32, 3)
    lines = [HEAD.rstrip()]
    for channel, name in enumerate("ABR"):
        lines.append(f"inline constexpr float kSheen{name}[32][32] = {{")
        lines += ["    {" + ", ".join(f"{x:.5f}f" for x in row) + "}," for row in table[:, :, channel]]
        lines.append("};")
    path = Path(__file__).parents[1] / "src/shading/lobes/sheen_table.h"
    path.write_text("\n".join([*lines, "", "}  // namespace gi", ""]))


if __name__ == "__main__":
    main()
