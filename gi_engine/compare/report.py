"""What a comparison leaves: report.json, report.csv, report.html (one file that needs nothing else). No scene, no bpy."""

from __future__ import annotations

import base64
import csv
import io
import json
import math
from pathlib import Path

from ..output import Target
from . import pictures
from .runner import Comparison, Rendered

COLUMNS = (
    ("engine", ""), ("seconds", "s"), ("samples", ""), ("relative_mse", ""), ("systematic_mse", ""), ("mean_ratio", ""),
    ("mean_ratio_error", ""), ("flip", ""), ("blocks", ""), ("blocks_beyond_noise", ""), ("rays_per_second", "1/s"),
    ("memory", "MiB"), ("startup", "s"), ("load", "s"), ("export", "s"), ("error", ""),
)  # fmt: skip
PAGE = Path(__file__).with_name("report.html")
HOLE = "/*DATA*/null"


def write(result: Comparison) -> Path:
    """Writes the three files. Returns the page, else the JSON where the page has nothing to show."""
    folder = result.plan.output
    facts = facts_of(result)
    put(folder / "report.json", json.dumps(facts, indent=1, ensure_ascii=False) + "\n")
    put(folder / "report.csv", table_of(facts))
    put(folder / "report.html", page_of(facts | {"images": images_of(result)}))
    return folder / "report.html"


def put(path: Path, text: str) -> None:
    """The file appears whole or not at all."""
    with Target(path) as target:
        (target.folder / ("file" + path.suffix)).write_text(text, encoding="utf-8")
        target.publish(path, "file")


def facts_of(result: Comparison) -> dict:
    plan = result.plan
    found = result.reference
    limit = f"{plan.samples} samples" if plan.samples else f"{plan.seconds:g} s"
    return clean(
        {
            "file": plan.file.name,
            "scene": result.facts.get("scene"),
            "frame": result.facts.get("frame"),
            "blender": result.facts.get("blender"),
            "size": list(found.pixels.shape[1::-1]) if found else result.facts.get("size"),
            "region": plan.region,
            "limit": f"relative MSE of {plan.until:g}" if plan.until else limit,
            "reference": {"name": found.name, **found.figures} if found else None,
            "engines": [engine_of(rendered) for rendered in result.engines],
            "unsupported": result.unsupported,
            "warnings": result.warnings,
            "cancelled": result.cancelled,
        }
    )


def engine_of(rendered: Rendered) -> dict:
    last = rendered.steps[-1] if rendered.steps else {}
    rays = last.get("rays")
    return {
        "engine": rendered.engine,
        "label": rendered.label,
        "error": rendered.error,
        "startup": rendered.startup,
        "load": rendered.load,
        "export": rendered.steps[0]["export"] if rendered.steps else None,
        "seconds": last.get("sampling"),
        "samples": last.get("samples"),
        "rays_per_second": rays / last["sampling"] if rays and last["sampling"] else None,
        "memory": max((step["memory"] for step in rendered.steps), default=None),
        "note": last.get("note", ""),
        "picture": last.get("file"),
        **rendered.figures,
        "passes": rendered.passes,
        "steps": rendered.steps,
    }


def clean(value):
    """JSON has no NaN: null says that there is no number."""
    if isinstance(value, dict):
        return {key: clean(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [clean(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def table_of(facts: dict) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(f"{name} [{unit}]" if unit else name for name, unit in COLUMNS)
    for engine in facts["engines"]:
        writer.writerow(engine.get(name) for name, _ in COLUMNS)
    return text.getvalue()


def images_of(result: Comparison) -> dict[str, dict[str, str]]:
    """Engine or "reference" → kind of picture → data URL."""
    folder = result.plan.output / "images"
    found: dict[str, dict[str, str]] = {}
    for name in ("reference", *(rendered.engine for rendered in result.engines)):
        shown = folder / f"{name}.png"
        if shown.exists():
            found.setdefault(name, {})["picture"] = url(shown.read_bytes())
    for rendered in result.engines:
        for kind, pixels in rendered.maps.items():
            found.setdefault(rendered.engine, {})[kind] = url(pictures.png(pixels))
    return found


def url(data: bytes) -> str:
    return "data:image/png;base64," + base64.b64encode(data).decode()


def page_of(data: dict) -> str:
    text = json.dumps(data, ensure_ascii=False).replace("</", "<\\/")
    return PAGE.read_text(encoding="utf-8").replace(HOLE, text)


def summary(result: Comparison) -> str:
    """A line for each engine, for the terminal."""
    lines = []
    for rendered in result.engines:
        figures = rendered.figures
        if not figures:
            lines.append(f"{rendered.label}: {rendered.error or 'no reference to compare with'}")
            continue
        last = rendered.steps[-1]
        words = [f"relative MSE {figures['relative_mse']:.4g}"]
        words.append(f"mean {figures['mean_ratio']:.4f} ± {figures['mean_ratio_error']:.4f}")
        words += [f"FLIP {figures['flip']:.4f}"] if "flip" in figures else []
        words.append(f"{last['samples']} samples in {last['sampling']:.1f} s")
        lines.append(f"{rendered.label}: {', '.join(words)}")
    return "\n".join(lines)
