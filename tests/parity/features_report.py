"""Writes docs/features.md: which integrator has what, from the integrators' own descriptors.

python -m tests.parity.features_report"""

from __future__ import annotations

from pathlib import Path

from gi_engine import native

PAGE = Path(__file__).resolve().parents[2] / "docs" / "features.md"


def has(*names):
    """By the parameters that an integrator declares."""
    return lambda d: any(p["name"] in names for p in d["parameters"])


FEATURES = {
    "Subsurface scattering by random walk and by profile (else diffuse of the same albedo)": lambda d: (
        "subsurface" in d["carries"]
    ),
    "Volumes that only absorb, evenly or not, in objects and the world (else left out)": lambda d: (
        "absorption" in d["carries"]
    ),
    "Volumes that scatter or glow (else left out)": lambda d: "volumes" in d["carries"],
    "Ray portals (else they show what lies behind them, but let no light through)": lambda d: "portals" in d["carries"],
    "Light that hair and points send on to other surfaces (else left out, in part at least)": lambda d: (
        "strands" in d["carries"]
    ),
    "Bakes lightmaps": lambda d: d["bakes"],
    "Keeps what it worked out over frames and in files": lambda d: d["kept_version"] > 0,
    "… and drops of it only what is near what moved": lambda d: d["kept_by_place"],
    "Ways of sampling lights to choose from": has("light_sampling"),
    "Limits of bounces by kind": has("diffuse_bounces"),
    "Caustics switches": has("caustics_reflective"),
    "Filter Glossy": has("filter_glossy"),
    "Clamping": has("clamp_direct", "clamp_indirect"),
}


def page(descriptors: list[dict]) -> str:
    names = [d["label"] for d in descriptors]
    lines = [
        "# What each integrator has",
        "",
        "Written by `python -m tests.parity.features_report` from the integrators' descriptors. All of them render every surface closure,",
        "texture, lamp, camera and world; a render warns of what its integrator does not carry.",
        "",
        f"| | {' | '.join(names)} |",
        f"|---|{'---|' * len(names)}",
    ]
    for feature, test in FEATURES.items():
        lines.append(f"| {feature} | {' | '.join('yes' if test(d) else '–' for d in descriptors)} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(native.integrators()))
