"""Every program that the engines build for OpenCL devices, so that compilers can be tried on all of them."""

from __future__ import annotations

from collections.abc import Iterator

from ..geometry_field.tracing import ray_tracer_opencl
from ..opencl import blocks, session
from ..opencl.program import Program
from ..refraction import caster_opencl
from ..tomography.reflection import delay_and_sum_opencl
from ..tomography.sart import device_slices
from ..wave import device_waves

MAKERS = (
    session.programs,
    blocks.programs,
    device_waves.programs,
    device_slices.programs,
    delay_and_sum_opencl.programs,
    caster_opencl.programs,
    ray_tracer_opencl.programs,
)


def every_program() -> Iterator[Program]:
    """The programs of all engines, each with every combination of macros that its engine may define."""
    for programs in MAKERS:
        yield from programs()
