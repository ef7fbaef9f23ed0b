"""The compiled core of GI Engine. Use gi_engine.native, which says clearly what is wrong where it cannot be loaded."""

from ._core import *  # noqa: F403
