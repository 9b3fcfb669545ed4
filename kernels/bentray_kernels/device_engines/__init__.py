"""Everything that exists for OpenCL devices, beside compiled code: example problems, comparison and trial."""

from .comparison import Comparison, compare
from .engine import Engine
from .problems import engines

__all__ = ["Comparison", "Engine", "compare", "engines"]
