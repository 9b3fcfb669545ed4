"""The table of task costs covers the memory of tasks of sizes that it was not fitted to."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest
from benchmarks.tasks._measured_tasks import WAVE_TASKS, Job, Measured
from benchmarks.tasks._task_peaks import metered_worker
from benchmarks.tasks.sizing import (
    IDLE_BYTES,
    JOBS,
    MARGIN,
    MOST,
    envelope,
    nearest,
    recorded,
)
from distributed import Client
from hypothesis import given
from hypothesis import strategies as st

from bentray_workers.cluster.task_costs import table

# Kinds of which some measured size is planned more than 40 % and 8 MiB too large: memory that they free and
# keep grows in steps, the larger of two stages counts, or they are not fitted (waves).
WIDE = {
    "blocks straight",
    "echoes",
    "export to ome-zarr",
    "maps straight in space",
    "picking",
    "refraction",
    "sart in space",
    "sart on a device",
    "stacking",
    "travel time fim",
    "travel time fmm",
    "uncertainty in space",
    "waves",
}
# Kinds of which all recorded sizes were needed to fit them.
UNCHECKED = {
    "blocks",
    "gauss-newton in space",
    "gauss-newton straight in space",
    "maps in space",
    "maps straight in space",
    "picking",
    "picking without water",
    "sart in space",
    "sart on a device",
    "stacking",
    "uncertainty in space",
}


def planned(names, counts, found):
    return counts @ [found.get(name, 0.0) for name in names]


@given(
    truth=st.lists(st.floats(0.0, 100.0), min_size=3, max_size=3),
    seed=st.integers(0, 2**32 - 1),
)
def test_an_envelope_is_above_every_peak_and_near_the_truth(truth: list[float], seed: int) -> None:
    random, names = np.random.default_rng(seed), ("fixed", "a", "b")
    counts = np.column_stack((np.full(12, 1e6), random.uniform(1e6, 1e9, (12, 2))))
    exact = counts @ truth
    peaks = exact * random.uniform(0.97, 1.0, 12)
    found = envelope(names, counts, peaks)
    # Coefficients have four digits.
    assert np.all(planned(names, counts, found) >= (1.0 + MARGIN - 1e-3) * peaks - 1.0)
    assert np.all(planned(names, counts, found) <= (1.0 + MARGIN) * 1.1 * exact + 2 * IDLE_BYTES)
    assert all(each > 0.0 for each in found.values())


def test_the_nearest_cost_is_not_moved_by_one_that_took_long() -> None:
    random, names = np.random.default_rng(1), ("fixed", "rays")
    counts = np.column_stack((np.ones(9), random.uniform(1e6, 1e8, 9)))
    exact = counts @ (2.0, 1e-6)
    taken = np.where(np.arange(9) == 4, 3.0, 1.0) * exact
    assert planned(names, counts, nearest(names, counts, taken)) == pytest.approx(exact, rel=1e-3)


def wrong(tasks: Iterable[Measured]) -> dict[str, tuple[int, int]]:
    """Plan and peak of tasks whose plan is below the peak, or far above it, by kind, job and size."""
    groups: dict[tuple[str, str, str], list[Measured]] = defaultdict(list)
    for task in tasks:
        if task.bytes:
            groups["waves" if task.kind.split()[0] in WAVE_TASKS else task.kind, task.job, task.size].append(
                task
            )
    found = {}
    for (kind, job, size), same in groups.items():
        planned, peak = max(task.planned_bytes for task in same), max(task.bytes for task in same)
        much = kind not in WIDE and planned > (1.0 + MOST) * peak + IDLE_BYTES
        if planned < peak or much:
            found[f"{kind}: {job}, {size}"] = planned, peak
    return found


def test_plans_cover_what_was_recorded_and_little_more() -> None:
    assert not wrong(recorded())


def test_every_kind_is_measured_and_checked() -> None:
    fitted = {task.kind for task in recorded() if task.bytes and not task.check}
    checked = {task.kind for task in recorded() if task.bytes and task.check}
    assert {kind for kind in table()["bytes"] if kind.split()[0] not in WAVE_TASKS} == fitted
    assert fitted <= checked | UNCHECKED


@pytest.fixture(scope="module")
def worker(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    with metered_worker(tmp_path_factory.mktemp("worker")) as client:
        yield client


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.parametrize("job", JOBS, ids=lambda job: job.name)
def test_plans_of_other_sizes_are_above_their_peaks_by_a_little(
    job: Job, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    client = None if job.warm is None else request.getfixturevalue("worker")
    assert not wrong(job.measure(client, tmp_path, checks=True))
