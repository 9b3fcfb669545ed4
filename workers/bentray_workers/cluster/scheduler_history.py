"""Scheduler preload: keep no history of tasks that are done, which would grow for as long as it runs."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import Any

import dask

from .dask_settings import LOGS


class NoSpans:
    """In place of Dask's spans, which sum up what has run and refer to every group of tasks there ever was.

    Each task that is submitted by itself is a group: a few kilobytes in the scheduler, and in its worker the
    times of each span, none of them ever given up. Dask has no setting for that.
    """

    def observe_tasks(self, tasks: Iterable[Any], code: Any, span_metadata: Any) -> dict[Any, Any]:
        """Called with tasks that are new; nothing is to be told of their spans."""
        return {}

    def heartbeat(self, worker: Any, data: dict[Any, Any]) -> None:
        """Called with the times that a worker has measured."""


def dask_setup(scheduler: Any) -> None:
    """Called by Dask in a scheduler that preloads this module, before anything is submitted."""
    # One that is started by hand has read no settings of ours.
    dask.config.set(LOGS)
    scheduler.extensions["spans"] = NoSpans()
    # As long as there is work, Dask adds it all to the latest of these.
    scheduler.computations = deque(maxlen=0)
