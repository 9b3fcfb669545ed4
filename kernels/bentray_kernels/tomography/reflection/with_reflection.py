"""A reconstruction with its reflection image: plans of the slices, their task graphs, the result."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...arrays import Floats
from ..reconstruction_graph import Run
from ..result import Reconstruction, Reflection
from ..scan import Source
from ..settings import Settings
from .reflection_graph import ReflectionGraph
from .reflection_image import envelope_of, in_decibels
from .reflection_plan import plan_reflection


def with_reflection(
    result: Reconstruction,
    source: Source,
    settings: Settings,
    run_graphs: Run,
    before: int,
) -> Reconstruction:
    """The reconstruction with the reflection image along the rays of its speed.

    Args:
        result: with the speed.
        source: of the scan, with traces of the object.
        settings: as requested.
        run_graphs: runs graphs to their end.
        before: emitter passes already made.

    Raises:
        InvalidInput: as ``plan_reflection``.
    """
    dataset = source.dataset()
    speeds = _slices(result.speed)
    origin = (result.origin_m[0], result.origin_m[1])
    graphs, plans = [], []
    for index, speed in enumerate(speeds):
        plan = plan_reflection(dataset.slice(index), settings, speed, result.spacing_m[0], origin)
        graph = ReflectionGraph((source, index), plan, source.samples, dataset.rate_hz, result.history)
        run_graphs([graph], before, graph.total * (len(speeds) - 1 - index))
        before += graph.total
        plans.append(plan)
        graphs.append(graph)
    images = in_decibels([envelope_of(graph.sums, graph.total) for graph in graphs])
    stacked = result.speed.ndim == 3
    plan, pulse = plans[0], graphs[0].pulse
    image = Reflection(
        np.ascontiguousarray(np.stack(images, axis=-1)) if stacked else images[0],
        (plan.pixel_m, plan.pixel_m, *result.spacing_m[2:]),
        (*plan.origin_m, *result.origin_m[2:]),
    )
    assert pulse is not None
    nx, ny = plan.pixels.inside.shape
    medium = "water" if settings.numerics.delays == "water" else "the reconstructed speed"
    summary = (
        f"{nx} by {ny} pixels of {1e3 * plan.pixel_m:.3g} mm; delays in {medium}; pulse "
        f"{1e6 * pulse.delay_s:.3g} us after its travel time, muted for {1e6 * pulse.length_s:.3g} us"
    )
    if plan.engine == "opencl":
        summary += "; echoes summed on OpenCL devices"
    return replace(result, reflection=image, provenance={**result.provenance, "reflection": summary})


def _slices(values: Floats) -> list[Floats]:
    return [np.ascontiguousarray(plane) for plane in np.moveaxis(np.atleast_3d(values), -1, 0)]
