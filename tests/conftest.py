"""What all tests share: how the process ends, and where the repository is."""

import os
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT


_status = 0


def pytest_sessionfinish(exitstatus):
    global _status
    _status = int(exitstatus)


@pytest.hookimpl(trylast=True)
def pytest_unconfigure():
    # Blender 4.5's module can hang when the interpreter shuts down (a thread that never wakes up).
    if "bpy" in sys.modules and "xdist" not in sys.modules:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(_status)
