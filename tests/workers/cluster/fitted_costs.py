"""Fit ``task_costs.json`` to peaks of tasks; ``python -m tests.workers.cluster.fitted_costs`` measures them.

For each kind of task the coefficients are those whose memory is at least each peak and a margin, and exceeds
the peaks by the least in relation to them: a linear programme with coefficients that are not negative.
"""

import json
import sys
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from benchmarks.memory._measured_tasks import FITTED
from benchmarks.memory._task_peaks import measured
from scipy.optimize import linprog

from bentray import __version__
from bentray_workers.cluster.task_costs import OVERHEAD, TABLE, TaskSize

# Of a plan above each peak, at least; and peaks below which an excess counts less and less.
MARGIN, SMALL_BYTES = 0.1, 8 * 2**20


class Peak(NamedTuple):
    """A measured task.

    Attributes:
        job: that it was part of.
        counts: by term, see ``TaskSize``.
        bytes: its peak beyond the idle worker.
    """

    job: str
    counts: Mapping[str, float]
    bytes: int


def fitted(peaks: Sequence[Peak]) -> dict[str, float]:
    """Bytes for each count of a term.

    Raises:
        ValueError: where there is no envelope, as for a peak without counts.
    """
    terms = [OVERHEAD, *sorted({term for peak in peaks for term, count in peak.counts.items() if count})]
    counts = np.array([[{OVERHEAD: 1.0, **peak.counts}.get(term, 0.0) for term in terms] for peak in peaks])
    peak = np.array([peak.bytes for peak in peaks])
    # Of each row in relation to its peak, but that of small ones; of each column to its largest count.
    unit, weight = counts.max(axis=0), peak / np.maximum(peak, SMALL_BYTES) ** 2
    relative = counts / unit / peak[:, None]
    found = linprog(weight @ counts / unit, A_ub=-relative, b_ub=np.full(len(peaks), -1.0 - MARGIN))
    if not found.success:
        raise ValueError(found.message)
    # Rounded up, to four digits.
    return {term: float(f"{1.0005 * each:.4g}") for term, each in zip(terms, found.x / unit, strict=True)}


def table(peaks: Mapping[str, Sequence[Peak]]) -> dict[str, Any]:
    """The file, from the peaks by kind of task."""
    return {
        "unit": "bytes beyond a warm worker for each count",
        "margin": MARGIN,
        "measured": datetime.now(UTC).date().isoformat(),
        "version": __version__,
        "bytes": {kind: fitted(rows) for kind, rows in sorted(peaks.items())},
        "peaks": {kind: [peak._asdict() for peak in rows] for kind, rows in sorted(peaks.items())},
    }


def peaks_in(file: Path = TABLE) -> dict[str, list[Peak]]:
    """The peaks that a table was fitted to, by kind of task."""
    stored = json.loads(file.read_text(encoding="utf-8"))["peaks"]
    return {kind: [Peak(**peak) for peak in rows] for kind, rows in stored.items()}


def main() -> None:
    peaks: dict[str, list[Peak]] = {}
    for kind, jobs in groupby(FITTED, lambda job: job.name):
        sys.stderr.write(f"{kind}\n")
        same = tuple(jobs)
        with TemporaryDirectory() as folder:
            for job, tasks in zip(same, measured(Path(folder), *same), strict=True):
                for task in tasks.values():
                    if not isinstance(task.plan, TaskSize):
                        continue
                    peak = Peak(str(job), task.plan.counts, task.peak_bytes)
                    peaks.setdefault(task.plan.kind, []).append(peak)
    TABLE.write_text(json.dumps(table(peaks), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
