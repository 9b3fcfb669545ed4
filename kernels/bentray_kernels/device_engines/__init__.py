"""Everything that exists for OpenCL devices, beside compiled code: example problems, comparison and trial."""

from .comparison import Comparison, compare
from .engine import Engine
from .problems import ENGINES_COMPARED, engines

__all__ = ["ENGINES_COMPARED", "Comparison", "Engine", "compare", "engines"]
