"""Scheduler preload: keep no history of finished tasks, which would grow without bound."""

from collections import deque
from collections.abc import Iterable
from typing import Any

import dask

from .dask_settings import LOGS


class NoSpans:
    """Replaces the spans extension of Dask, which keeps every group of tasks for ever.

    Each task that is submitted separately is a group: a few kilobytes in the scheduler, and the times of each
    span in its worker. Dask has no setting for it.
    """

    def observe_tasks(self, tasks: Iterable[Any], code: Any, span_metadata: Any) -> dict[Any, Any]:
        """Called with new tasks; returns no annotations of spans."""
        return {}

    def heartbeat(self, worker: Any, data: dict[Any, Any]) -> None:
        """Called with the times measured by a worker."""


def dask_setup(scheduler: Any) -> None:
    """Called by Dask in a scheduler that preloads this module, before anything is submitted."""
    # A scheduler that is started by hand has not read our settings.
    dask.config.set(LOGS)
    scheduler.extensions["spans"] = NoSpans()
    # While there is work, Dask appends all of it to the last of these.
    scheduler.computations = deque(maxlen=0)
