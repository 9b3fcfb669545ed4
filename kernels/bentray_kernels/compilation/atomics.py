"""Atomic counters in compiled kernels, for threads that share the work of one kernel."""

from typing import Any

from numba import types
from numba.extending import intrinsic

from ..arrays import Ints
from .compiled import kernel

# Spins before a waiting thread gives its core to others, about a microsecond.
SPINS = 1000

_yield_core = types.ExternalFunction("sched_yield", types.int32())


@intrinsic
def add(typing: Any, counters: Any, place: Any, value: Any) -> Any:
    """``counters[place] += value``; gives the count before."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.atomic_rmw(
            "add", _address(context, builder, signature, arguments), arguments[2], "seq_cst"
        )

    return types.int64(counters, types.intp, types.int64), generate


@intrinsic
def load(typing: Any, counters: Any, place: Any) -> Any:
    """``counters[place]`` as other threads see it."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load_atomic(_address(context, builder, signature, arguments), "seq_cst", 8)

    return types.int64(counters, types.intp), generate


def _address(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    array = context.make_array(signature.args[0])(context, builder, arguments[0])
    return builder.gep(array.data, [arguments[1]])


@kernel(inline="always")
def wait_for(counters: Ints, place: int, least: int) -> None:
    """Wait until ``counters[place]`` has reached ``least``; what was written before is visible after."""
    spins = 0
    while load(counters, place) < least:
        spins += 1
        if spins > SPINS:
            _yield_core()
