"""The process that compares on one scene, from plan to report, for who must not wait or fall with it (child.py): Blender's button, and
`gi-engine parity`."""

from __future__ import annotations

from . import plan as plans
from . import report, runner
from .service import serve


class Teller(runner.Watcher):
    """To the parent, which ends this process to stop it."""

    def __init__(self, say):
        self.send = say

    def progress(self, fraction: float, text: str) -> None:
        self.send(progress=True, fraction=fraction, text=text)


def compare(teller: Teller, plan: dict) -> dict:
    result = runner.compare(plans.from_json(plan), teller)
    return {"page": str(report.write(result))}


def main() -> None:
    serve({"compare": compare}, Teller)
