"""Many comparisons in one table: what agrees within noise, what differs and by how much, what is unsupported, what failed. As Markdown, CSV
and a page that needs nothing else. Nothing is rendered here."""

from __future__ import annotations

import base64
import csv
import io
import math
from html import escape
from pathlib import Path

AGREES, DIFFERS, UNSUPPORTED, BLACK, FAILED = "agrees", "differs", "unsupported", "black", "failed"
TITLES = {
    AGREES: "agree within noise",
    DIFFERS: "differ",
    UNSUPPORTED: "differ, with features that are unsupported",
    BLACK: "are black, so that nothing is compared",
    FAILED: "failed",
}
# The mean of all blocks sees smaller differences than one block does; below this share they are rounding.
MEAN_ERRORS, MEAN_ROUNDING = 4.0, 0.003
FIGURES = (
    "mean_ratio", "mean_ratio_error", "blocks", "blocks_beyond_noise", "worst_block", "largest_beyond_noise", "not_finite",
    "relative_mse", "systematic_mse", "flip", "seconds", "reference_seconds",
)  # fmt: skip
MOST_MESSAGES = 3  # of a scene in the table; the page has them all


def verdict(row: dict, rounding: float = MEAN_ROUNDING) -> tuple[str, str]:
    """Which of TITLES a row is one of, and what there is to say. `row`: FIGURES, and "error", "unsupported", "note" where there are any.
    `rounding`: share that the mean may be off."""
    if row.get("error"):
        return FAILED, row["error"]
    ratio, words = row["mean_ratio"], []
    if row["blocks_beyond_noise"]:
        most = row.get("largest_beyond_noise")
        by = f", by {100 * most:+.1f} % at most" if most is not None else ""
        words.append(f"{row['blocks_beyond_noise']} of {row['blocks']} blocks differ{by}")
    if row["not_finite"]:
        words.append(f"{row['not_finite']} values are not finite")
    if not words and (ratio is None or math.isnan(ratio)):
        return BLACK, "black in both: nothing is compared"
    if not words and abs(ratio - 1) > max(MEAN_ERRORS * row["mean_ratio_error"], rounding):
        off = abs(ratio - 1) / max(row["mean_ratio_error"], 1e-9)
        words.append(f"no block differs, but the mean does by {100 * (ratio - 1):+.1f} %, {off:.0f} standard errors")
    if not words:
        return AGREES, "agrees"
    return UNSUPPORTED if row.get("unsupported") else DIFFERS, "; ".join(words)


def counts(rows: list[dict]) -> str:
    """One sentence."""
    kinds = [verdict(row)[0] for row in rows]
    parts = [f"{kinds.count(kind)} {title}" for kind, title in TITLES.items() if kinds.count(kind) or kind == AGREES]
    return f"Of {len(rows)} scenes, {', '.join(parts)}."


# Markdown


def markdown(rows: list[dict], introduction: list[str]) -> str:
    head = ["| scene | mean | worst | FLIP | |", "|---|---|---|---|---|"]
    lines = [line_of(row, flip=True) for row in rows]
    return "\n".join(["# Parity with Cycles", "", *introduction, "", counts(rows), "", *head, *lines]) + "\n"


def line_of(row: dict, flip: bool = False, rounding: float = MEAN_ROUNDING) -> str:
    """One row of a table; in bold what does not agree."""
    kind, words = verdict(row, rounding)
    cells = [row["name"], "–", "–", *(["–"] if flip else [])]
    if kind != FAILED:
        if row["mean_ratio"] is not None and math.isfinite(row["mean_ratio"]):
            cells[1] = f"{row['mean_ratio']:.4f} ± {row['mean_ratio_error']:.4f}"
        cells[2] = f"{row['worst_block']:.1f}"
        if flip and row.get("flip") is not None:
            cells[3] = f"{row['flip']:.3f}"
    words = f"**{words}**" if kind in (DIFFERS, UNSUPPORTED, FAILED) else words
    note = f": {row['note']}" if row.get("note") else ""
    messages = alike(row.get("unsupported", []))
    if messages:
        more = f"; {len(messages) - MOST_MESSAGES} more" if len(messages) > MOST_MESSAGES else ""
        note += f". Said: {'; '.join(messages[:MOST_MESSAGES])}{more}"
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in (*cells, words + note)) + " |"


def alike(messages: list[str]) -> list[str]:
    """One of those that say the same of different nodes, and how many there are."""
    groups: dict[str, list[str]] = {}
    for message in messages:
        groups.setdefault(message.rpartition("): ")[2], []).append(message)
    return [group[0] + (f" ({len(group)} times)" if len(group) > 1 else "") for group in groups.values()]


def table(rows: list[dict]) -> str:
    """CSV."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["scene", "verdict", *FIGURES, "unsupported", "error"])
    for row in rows:
        figures = [row.get(name) for name in FIGURES]
        messages = " / ".join(row.get("unsupported", []))
        writer.writerow([row["name"], verdict(row)[0], *figures, messages, row.get("error", "")])
    return text.getvalue()


# The page

STYLE = """
:root { color-scheme: light dark; --page: light-dark(#f5f5f2, #16171a); --card: light-dark(#fff, #1f2125);
  --ink: light-dark(#1c1d20, #e9e9e6); --soft: light-dark(#63666d, #9b9fa8); --line: light-dark(#deded8, #34373d);
  --accent: light-dark(#0b63c5, #6db3ff); --good: light-dark(#1a7f37, #56d364); --bad: light-dark(#b3261e, #ff8a80); }
body { margin: 0; background: var(--page); color: var(--ink); font: 15px/1.5 system-ui, sans-serif; }
main { max-width: 1180px; margin: 0 auto; padding: 28px 24px 64px; }
h1 { font-size: 26px; margin: 0 0 6px; } p { margin: 4px 0; max-width: 78ch; } a { color: var(--accent); }
.soft, th { color: var(--soft); } table { border-collapse: collapse; width: 100%; background: var(--card); margin-top: 20px; }
th, td { text-align: left; padding: 8px 12px; border-bottom: 1px solid var(--line); vertical-align: top; }
th { font-weight: 500; font-size: 13px; } td.number { font-variant-numeric: tabular-nums; white-space: nowrap; }
img { height: 72px; image-rendering: pixelated; border-radius: 4px; display: block; } td.pictures { display: flex; gap: 6px; }
.agrees { color: var(--good); } .differs, .failed, .unsupported { color: var(--bad); } summary { cursor: pointer; }
"""


def page(rows: list[dict], introduction: list[str], folder: Path) -> str:
    """HTML with each scene's pictures in it, and links to its own report where that is in `folder`."""
    heads = "".join(
        f"<th scope=col>{head}</th>" for head in ("Scene", "Ours, Cycles’", "Mean", "Worst block", "FLIP", "")
    )
    body = "\n".join(row_of(row, folder) for row in rows)
    return (
        "<!doctype html>\n<html lang=en><head><meta charset=utf-8>"
        '<meta name=viewport content="width=device-width, initial-scale=1">'
        f"<title>GI Engine: parity</title><style>{STYLE}</style></head>\n<body><main><h1>Parity with Cycles</h1>"
        f"<p>{escape(counts(rows))}</p>" + "".join(f"<p class=soft>{escape(line)}</p>" for line in introduction)
        + f"<table><thead><tr>{heads}</tr></thead>\n<tbody>\n{body}\n</tbody></table></main></body></html>\n"
    )  # fmt: skip


def row_of(row: dict, folder: Path) -> str:
    kind, words = verdict(row)
    mean = worst = flip = "–"
    if kind != FAILED:
        if row["mean_ratio"] is not None:
            mean = f"{row['mean_ratio']:.4f} ± {row['mean_ratio_error']:.4f}"
        worst = f"{row['worst_block']:.1f}"
        flip = "–" if row.get("flip") is None else f"{row['flip']:.3f}"
    name = escape(row["name"])
    if (folder / row["folder"] / "report.html").exists():
        name = f'<a href="{escape(row["folder"], quote=True)}/report.html">{name}</a>'
    numbers = "".join(f"<td class=number>{text}</td>" for text in (mean, worst, flip))
    said = f"<span class={kind}>{escape(words)}</span>"
    said += f"<p>{escape(row['note'])}</p>" if row.get("note") else ""
    if row.get("unsupported"):
        messages = "".join(f"<li>{escape(message)}</li>" for message in row["unsupported"])
        said += f"<details><summary>{len(row['unsupported'])} warnings</summary><ul>{messages}</ul></details>"
    return (
        f"<tr><th scope=row>{name}</th><td class=pictures>{pictures_of(row, folder)}</td>{numbers}<td>{said}</td></tr>"
    )


def pictures_of(row: dict, folder: Path) -> str:
    found = []
    for name, label in ((row.get("engine", ""), "ours"), ("reference", "Cycles’")):
        path = folder / row["folder"] / "images" / f"{name}.png"
        if path.exists():
            data = base64.b64encode(path.read_bytes()).decode()
            found.append(f'<img src="data:image/png;base64,{data}" alt="{escape(row["name"], quote=True)}, {label}">')
    return "".join(found)
