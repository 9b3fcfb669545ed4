"""Samplers: filtered grids in space for kernels that call the code of any filter by its address."""

from __future__ import annotations

import platform
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from llvmlite import binding, ir  # type: ignore[import-untyped]  # numba's own; it has no types
from numba import types
from numba.extending import intrinsic

from ..arrays import Floats, Vector
from ..compilation.compiled import kernel
from .lanes import DOUBLE, FLOAT, INDEX, SHORT, Lanes, axes_at, point_vector, value, value_and_gradient

if TYPE_CHECKING:
    from .spline import Spline

# The plan of a sampler: the last cell along x, y and z, and z again; the shift, four times; then whole
# numbers: addresses of coefficients and weights, and the coefficients between nodes along x and along y.
ENDS, SHIFTS, DATA, WEIGHTS, STRIDES, PLANNED = 0, 4, 8, 9, 10, 12

# Numba keeps more numbers in registers over calls of this convention: a frame takes 1 % longer than with the
# filter inlined, with C's convention 4 %.
CONVENTION = "x86_regcallcc" if platform.machine() in ("x86_64", "AMD64") else "ccc"

VECTOR = ir.VectorType(DOUBLE, 4)


class Sampler(NamedTuple):
    """A filtered grid in space as an argument of kernels.

    It is valid in the process that made it, as long as its spline exists.

    Attributes:
        value, value_and_gradient: addresses of the compiled code of the filter.
        plan: (12,) where the code finds the coefficients.
    """

    value: int
    value_and_gradient: int
    plan: Floats


def sampler_of(spline: Spline) -> Sampler:
    """The sampler of a spline in space."""
    coefficients, stencil = spline.coefficients, spline.stencil
    plan = np.empty(PLANNED)
    last = np.array(coefficients.shape) - len(stencil.places)
    plan[ENDS:DATA] = *last, last[-1], *[stencil.shift] * 4
    strides = np.array(coefficients.strides[:2]) // coefficients.itemsize
    plan.view(np.int64)[DATA:] = coefficients.ctypes.data, stencil.weights.ctypes.data, *strides
    return Sampler(*_compiled(len(stencil.places), coefficients.dtype.name), plan)


@kernel(inline="always")
def sampled_value(sampler: Sampler, point: Vector) -> float:
    """The filtered value at a point (x, y, z), nodes, as ``sampling.value_at``."""
    return _value(sampler, point)  # type: ignore[no-any-return]


@kernel(inline="always")
def sampled_value_and_gradient(sampler: Sampler, point: Vector) -> tuple[float, Vector]:
    """The filtered value and its gradient per node, as ``sampling.value_and_gradient_at``."""
    return _value_and_gradient(sampler, point)  # type: ignore[no-any-return]


@intrinsic
def _value(_typing: Any, sampler: Any, point: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _call(context, builder, signature, arguments, 0, DOUBLE)

    return types.float64(sampler, point), generate


@intrinsic
def _value_and_gradient(_typing: Any, sampler: Any, point: Any) -> Any:
    gradient = types.UniTuple(types.float64, 3)
    returned = types.Tuple((types.float64, gradient))

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        vector = _call(context, builder, signature, arguments, 1, VECTOR)
        first, *slopes = (builder.extract_element(vector, SHORT(k)) for k in range(4))
        return context.make_tuple(builder, returned, [first, context.make_tuple(builder, gradient, slopes)])

    return returned(sampler, point), generate


def _call(context: Any, builder: Any, signature: Any, arguments: Any, which: int, returned: Any) -> Any:
    sampler, point = arguments
    plan = context.make_array(signature.args[0][2])(context, builder, builder.extract_value(sampler, 2)).data
    taken = [plan, *(builder.extract_value(point, axis) for axis in range(3))]
    function = ir.FunctionType(returned, [one.type for one in taken]).as_pointer()
    address = builder.inttoptr(builder.extract_value(sampler, which), function)
    return builder.call(address, taken, cconv=CONVENTION, attrs=("nounwind", "readonly"))


# Compiled code lives as long as the process.
_ENGINES: list[Any] = []


@cache
def _compiled(taps: int, dtype: str) -> tuple[int, int]:
    """Addresses of the code for filters of so many taps, which takes 0.1 s."""
    module = ir.Module("sampler")
    for slopes in (False, True):
        taken = [DOUBLE.as_pointer(), DOUBLE, DOUBLE, DOUBLE]
        function = ir.Function(module, ir.FunctionType(VECTOR if slopes else DOUBLE, taken), f"f{slopes:d}")
        function.calling_convention = CONVENTION
        lanes = Lanes(
            ir.IRBuilder(function.append_basic_block()), taps, DOUBLE if dtype == "float64" else FLOAT
        )
        lanes.builder.ret(_body(lanes, *function.args, slopes=slopes))
    target = binding.Target.from_default_triple().create_target_machine(
        cpu=binding.get_host_cpu_name(), features=binding.get_host_cpu_features().flatten(), opt=3
    )
    compiled = binding.parse_assembly(str(module))
    passes = binding.create_pass_builder(target, binding.create_pipeline_tuning_options(speed_level=3))
    passes.getModulePassManager().run(compiled, passes)
    engine = binding.create_mcjit_compiler(compiled, target)
    engine.finalize_object()
    _ENGINES.append(engine)
    return engine.get_function_address("f0"), engine.get_function_address("f1")


def _body(lanes: Lanes, plan: Any, *point: Any, slopes: bool) -> Any:
    builder = lanes.builder
    whole = builder.bitcast(plan, INDEX.as_pointer())

    def vector(first: int) -> Any:
        return Lanes(builder, 4, DOUBLE).load(builder.gep(plan, [INDEX(first)]), 4)

    def number(place: int) -> Any:
        return builder.load(builder.gep(whole, [INDEX(place)]))

    data, tables = (builder.inttoptr(number(k), lanes.real.as_pointer()) for k in (DATA, WEIGHTS))
    strides = [number(STRIDES), number(STRIDES + 1), INDEX(1)]
    places = builder.fadd(point_vector(builder, point), vector(SHIFTS))
    axes = axes_at(lanes, places, vector(ENDS), strides, tables, slopes=slopes)
    if not slopes:
        return value(lanes, axes, data)
    returned = ir.Constant(VECTOR, ir.Undefined)
    for k, result in enumerate(value_and_gradient(lanes, axes, data)):
        returned = builder.insert_element(returned, result, SHORT(k))
    return returned
