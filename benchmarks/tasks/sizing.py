"""Sizing benchmark: memory and CPU time of every kind of task, beside the plans.

``bentray bench sizing`` measures sizes that the table of task costs was not fitted to. This file as a program
(``make task-costs``) measures all sizes, and fits the table to the others.
"""

from __future__ import annotations

import json
import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from contextlib import nullcontext
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.optimize import linprog

from bentray_kernels.arrays import Floats
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_workers.cluster import task_costs
from bentray_workers.cluster.capacities import MIB
from bentray_workers.cluster.task_costs import FIXED

from . import _measured_pictures, _measured_tasks
from ._measured_tasks import Job, Measured
from ._task_peaks import metered_worker

JOBS = (*_measured_tasks.JOBS, *_measured_pictures.JOBS)
TABLE = Path(task_costs.__file__).with_suffix(".json")
RECORD = Path(__file__).with_name("task_peaks.json")

# The envelope over what was measured: the same task takes more or less from run to run. At most this much
# more is planned than measured, beside what the idle worker itself varies by.
MARGIN, MOST, IDLE_BYTES, IDLE_S = 0.15, 0.4, 8 * MIB, 0.5

# Lowest coefficients: a travel time was measured by itself and is whole in each task that computes one.
SHARES = {"bytes of a wave front": 1.0}


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """The tasks of each size that the table was not fitted to, with their plans as goals."""
    jobs = JOBS[::8] if context.quick else JOBS
    for number, task in enumerate(measured_tasks(jobs, checks=True)):
        context.progress(min(number, len(jobs)), len(jobs), task.job)
        if task.bytes:
            yield row_of(task)


def row_of(task: Measured) -> Row:
    """The memory of a task with its plan as goal."""
    label = f"{task.kind}: {task.job}, {task.size}"
    return Row(label, task.bytes / MIB, task.planned_bytes / MIB, "<=", "MiB", "above an idle worker")


def measured_tasks(jobs: Iterable[Job], *, checks: bool) -> Iterator[Measured]:
    """The tasks of jobs; those that run on a worker share it."""
    for warm, group in groupby(jobs, key=lambda job: job.warm is not None):
        with TemporaryDirectory() as folder:
            files = Path(folder)
            with metered_worker(files) if warm else nullcontext() as client:
                for job in group:
                    yield from job.measure(client, files, checks=checks)


def fitted(measured: Sequence[Measured]) -> dict[str, dict[str, float]]:
    """Coefficients of one kind: of its memory and CPU time, as far as these were measured."""
    names = [FIXED, *dict.fromkeys(name for task in measured for name in task.counts)]
    counts = np.array([[{FIXED: 1.0, **task.counts}.get(name, 0.0) for name in names] for task in measured])
    found = {}
    for quantity, fit in (("bytes", envelope), ("seconds", nearest)):
        values = np.array([float(getattr(task, quantity)) for task in measured])
        if values.any():
            found[quantity] = fit(names, counts, values)
    return found


def envelope(names: Sequence[str], counts: Floats, peaks: Floats) -> dict[str, float]:
    """Coefficients, none negative, with ``counts @ coefficients`` at least ``peaks`` and the margin.

    Args:
        names: (n,) of the counts.
        counts: (m, n) of each measurement.
        peaks: (m,), bytes; those below ``IDLE_BYTES`` may be exceeded by as much.
    """
    scale = counts.max(axis=0) + (counts.max(axis=0) == 0.0)
    weights = 1.0 / np.maximum(peaks, IDLE_BYTES)
    lowest = np.array([SHARES.get(name, 0.0) for name in names]) * scale
    scaled = counts / scale
    bounds = [(least, None) for least in lowest]
    solved = linprog(weights @ scaled, A_ub=-scaled, b_ub=-(1.0 + MARGIN) * peaks, bounds=bounds)
    return _rounded(names, solved.x / scale, counts)


def nearest(names: Sequence[str], counts: Floats, seconds: Floats) -> dict[str, float]:
    """Coefficients, none negative, with the least mean error of ``counts @ coefficients`` by its parts.

    Args:
        names, counts: as of ``envelope``.
        seconds: (m,); errors are relative, but to ``IDLE_S`` at least.
    """
    scale = counts.max(axis=0) + (counts.max(axis=0) == 0.0)
    weights = 1.0 / np.maximum(seconds, IDLE_S)
    scaled, errors = weights[:, None] * counts / scale, np.eye(len(seconds))
    above, below = np.hstack((scaled, -errors)), np.hstack((-scaled, -errors))
    target = weights * seconds
    solved = linprog(
        np.concatenate((np.zeros(len(names)), np.ones(len(seconds)))),
        A_ub=np.vstack((above, below)),
        b_ub=np.concatenate((target, -target)),
    )
    return _rounded(names, solved.x[: len(names)] / scale, counts)


def _rounded(names: Sequence[str], coefficients: Floats, counts: Floats) -> dict[str, float]:
    """Those that are not zero, by name, with four digits."""
    used = counts.any(axis=0) & (coefficients > 0.0)
    return {name: float(f"{coefficients[k]:.4g}") for k, name in enumerate(names) if used[k]}


def recorded() -> list[Measured]:
    """What was measured for the table."""
    return [Measured(**task) for task in json.loads(RECORD.read_text())]


def record(jobs: Iterable[Job], *, checks: bool = False) -> None:
    """Measure jobs and replace what was measured of them before."""
    for task in measured_tasks(jobs, checks=checks):
        print(task.job, task.size, f"{task.kind}: {task.bytes / MIB:.1f} MiB, {task.seconds} s", flush=True)
        same = task.job, task.size, task.kind, bool(task.bytes)
        kept = [old for old in recorded() if (old.job, old.size, old.kind, bool(old.bytes)) != same]
        lines = ",\n".join(json.dumps(each._asdict()) for each in (*kept, task))
        RECORD.write_text(f"[\n{lines}\n]\n")


def write_table() -> None:
    """Fit the table to what was measured."""
    kinds: dict[str, list[Measured]] = defaultdict(list)
    for task in recorded():
        if not task.check:
            kinds[task.kind].append(task)
    table: dict[str, dict[str, Any]] = json.loads(TABLE.read_text())
    for kind, tasks in kinds.items():
        for quantity, coefficients in fitted(tasks).items():
            table[quantity][kind] = coefficients
    lines = (
        f' "{quantity}": {{\n'
        + ",\n".join(f'  "{kind}": {json.dumps(each)}' for kind, each in sorted(kinds.items()))
        + "\n }"
        for quantity, kinds in table.items()
    )
    TABLE.write_text("{\n" + ",\n".join(lines) + "\n}\n")
    task_costs.table.cache_clear()


if __name__ == "__main__":
    # Travel times first: their memory is a count of the tasks that trace rays.
    for words in sys.argv[1:] or ("travel time", ""):
        jobs = [job for job in JOBS if words in job.name]
        record(jobs)
        write_table()
        record(jobs, checks=True)
