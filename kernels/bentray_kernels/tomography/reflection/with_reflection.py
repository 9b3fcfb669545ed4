"""A reconstruction with its reflection image: plans of the slices, their task graphs, coherence, decibels."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...arrays import Float32s, Floats
from ..reconstruction_graph import Run
from ..result import Reconstruction, Reflection
from ..scan import Source
from ..settings import Settings
from .delay_and_sum import Sums
from .reflection_graph import ReflectionGraph
from .reflection_plan import plan_reflection

# Echoes below this, relative to the strongest one, are noise of any scanner, dB.
FLOOR_DB = -100.0


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


def envelope_of(sums: Sums, emissions: int) -> Float32s:
    """Envelope of the mean echo at every pixel, |Σ b_e| / Σ w, times the coherence factor.

    The factor is |Σ b_e|² / (n Σ |b_e|²), from 0 for echoes of n emissions
    with random phases (1/n on average) to 1 for equal ones (Mallart & Fink, J. Acoust. Soc. Am. 96, 1994).

    Args:
        sums: over all emissions.
        emissions: n.
    """
    size = np.abs(sums.echo)
    mean = np.divide(size, sums.weight, out=np.zeros_like(size), where=sums.weight > 0.0)
    most = emissions * sums.power
    return np.asarray(mean * np.divide(size**2, most, out=np.zeros_like(size), where=most > 0.0))


def in_decibels(envelopes: Sequence[Float32s]) -> list[Floats]:
    """Envelopes relative to the largest value of all of them, dB, at least ``FLOOR_DB``."""
    largest = max(float(image.max()) for image in envelopes)
    floor = 10.0 ** (FLOOR_DB / 20.0)
    if largest == 0.0:
        return [np.full(image.shape, FLOOR_DB) for image in envelopes]
    return [20.0 * np.log10(np.maximum(image.astype(np.float64) / largest, floor)) for image in envelopes]
