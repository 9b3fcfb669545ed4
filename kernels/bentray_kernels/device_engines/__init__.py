"""Test problems that compare OpenCL engines with compiled code, and their benchmark on a device."""

from .comparison import Comparison, compare
from .engine import Engine
from .problems import ENGINES_COMPARED, engines

__all__ = ["ENGINES_COMPARED", "Comparison", "Engine", "compare", "engines"]
