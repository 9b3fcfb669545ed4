"""The lane of short jobs: which jobs use it, and for how long."""

from collections.abc import Mapping, Sequence
from typing import Any

from .capacities import WorkerCapacity
from .resources import RECONSTRUCTION, SHORT

SHORT_LANE, LONG_LANE = next(iter(SHORT)), next(iter(RECONSTRUCTION))
# Planned duration of a short job on idle workers, s.
SHORT_S = 10.0
# A job that was planned too short leaves the lane after so much time of tasks in flight, s.
LEAVES_S = 60.0
# Part of the memory of a worker for a task of this lane. The long task beside it is planned for 80 %, and
# Dask kills a worker at 95 %.
MEMORY_PART = 0.05


def is_short(plan: Mapping[str, Any], seconds: float | None, capacities: Sequence[WorkerCapacity]) -> bool:
    """Whether a job of the long lane is short enough for the other one.

    Args:
        plan: of the job, with ``lane`` and ``largest_bytes``.
        seconds: estimated duration; None if unknown.
        capacities: of the connected workers. Those of an earlier version have no such lane.
    """
    if seconds is None or seconds > SHORT_S or plan.get("lane") != LONG_LANE:
        return False
    able = [worker for worker in capacities if SHORT_LANE in worker.resources]
    most = min((MEMORY_PART * host.memory_bytes for host in able if host.memory_bytes), default=float("inf"))
    return bool(able) and plan["largest_bytes"] <= most
