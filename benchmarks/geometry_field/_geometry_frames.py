"""Frame rates of a scene with geometry fields on CPU and OpenCL, and differences from exact intersection."""

import os
import warnings
from collections.abc import Iterable

import numpy as np

from bentray_kernels.geometry_field.tracing.packed_scene import world_of
from bentray_kernels.geometry_field.tracing.ray_tracer import TraceSettings, trace
from bentray_kernels.geometry_field.tracing.ray_tracer_opencl import OpenCLTracer
from bentray_kernels.opencl import OpenCLFallbackWarning
from bentray_service.cli.output.benchmark_row import Row

from ..shared._timing import alternate
from ._geometry_scenes import SCENES

PIXELS = 512
THREADS = min(2, len(os.sched_getaffinity(0)))
SCENE = "two instances in a mirror"

# What a hand that turns an object expects, frames a second; and pixels that may differ between devices, %.
INTERACTIVE, ODD = 10.0, 0.1


def rows(quick: bool) -> Iterable[Row]:
    """Frames a second of the first scene of figure 26, by way of asking the fields."""
    scene, camera = SCENES[SCENE]()
    world = world_of(scene)

    def settings(way: str, eye: str) -> TraceSettings:
        return TraceSettings(PIXELS, PIXELS, way=way, eye=eye, threads=THREADS)

    def here(way: str):
        return lambda: trace(world, camera, settings(way, way))

    runs = {way: here(way) for way in ("nearest", "walk", "exact")}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", OpenCLFallbackWarning)
        tracer = OpenCLTracer.on_the_device(world)
        if tracer is not None and tracer.fault_of(camera) == "":
            runs["OpenCL"] = lambda: tracer.follow(camera, settings("walk", "walk"))
    seconds = alternate(runs, 3 if quick else 7)
    listed = ", ".join(f"{name} {1.0 / least:.1f}" for name, least in seconds.items())
    detail = f"frames a second, {PIXELS}², {THREADS} threads: {listed}; theirs 50 to 60 on a graphics card"
    yield Row("frames, fields", 1.0 / seconds["walk"], INTERACTIVE, ">=", "1/s", detail)
    yield Row("frames, fields over exact", seconds["exact"] / seconds["walk"], 1.0, ">=", "", detail)
    labels = (("frames, OpenCL", INTERACTIVE, ">=", "1/s"), ("frames, OpenCL odd pixels", ODD, "<=", "%"))
    if "OpenCL" not in runs:
        reason = "; ".join(str(remark.message) for remark in caught) or "the device fails its self-test"
        yield from (Row(label, None, goal, op, unit, reason) for label, goal, op, unit in labels)
    else:
        off = np.abs(runs["OpenCL"]().astype(int) - runs["walk"]()).max(axis=2) > 1
        detail = f"{tracer.session.handle.name}; {listed}"
        yield Row(labels[0][0], 1.0 / seconds["OpenCL"], *labels[0][1:], detail)
        yield Row(labels[1][0], 100.0 * off.mean(), *labels[1][1:], "pixels off by more than 1 of 255")
    off = np.abs(runs["exact"]().astype(int) - runs["walk"]()).max(axis=2) > 8
    detail = "pixels off by more than 8 of 255, fields against the exact intersector"
    yield Row("frames, fields, odd pixels", 100.0 * off.mean(), 1.0, "<=", "%", detail)
