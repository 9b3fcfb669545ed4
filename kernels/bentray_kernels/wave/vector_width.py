"""The widest vectors of the processor for a compiled kernel, where LLVM would take half of it."""

from typing import Any

from numba import types
from numba.extending import intrinsic

# An attribute of functions in LLVM; processors with narrower vectors, or of another kind, ignore it.
WIDEST = '"prefer-vector-width"="512"'


@intrinsic
def use_widest_vectors(_context: Any) -> Any:
    """Call once in a kernel: its loops are built for 512 bits where the processor has them.

    For most Intel processors LLVM prefers 256 bits, as the first ones with 512 lowered their clock. Results
    have the same bits with any width.
    """

    def mark(target: Any, builder: Any, _signature: Any, _arguments: Any) -> Any:
        # llvmlite's own ``add`` refuses attributes with a value.
        set.add(builder.function.attributes, WIDEST)
        return target.get_dummy_value()

    return types.none(), mark
