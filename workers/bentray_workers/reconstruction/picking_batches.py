"""Batches of emissions that are examined and picked, one for each task."""

from __future__ import annotations

from bentray_kernels.tomography.settings import Settings

from ..files.dataset.counts import Traces

# Samples of object and water in one task: half a second to a second.
TASK_SAMPLES = 10_000_000


def batches_of(emissions: int, trace_samples: int) -> list[range]:
    """Batches of emissions, one for each task.

    Args:
        emissions: of one slice.
        trace_samples: of all traces of one emission.
    """
    step = emissions_per_task(trace_samples)
    return [range(k, min(k + step, emissions)) for k in range(0, emissions, step)]


def emissions_per_task(trace_samples: int) -> int:
    """Largest number of emissions of one task."""
    return max(1, TASK_SAMPLES // max(trace_samples, 1))


def picking_tasks(traces: Traces | None, slices: int, settings: Settings) -> int:
    """Number of tasks that examine and pick a scan."""
    if traces is None:
        return 0
    batches = -(-traces.emissions // emissions_per_task(traces.receivers * traces.samples))
    examined = slices * (batches + 1) if settings.picking.examine or not traces.water_shot else 0
    examined += 0 if traces.water_shot else slices * (batches + 1)
    return examined + slices * (batches + 1) + 1
