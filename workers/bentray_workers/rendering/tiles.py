"""Pictures as tasks of the render lane: whole, or strip by strip and then joined."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from distributed import Client, Future

from ..cluster.resources import RENDER
from ..images.png import Colours, png_of

# Of one task: about a second of work.
TASK_RAYS = 2**19


class View(Protocol):
    """What a picture shows."""

    @property
    def width(self) -> int:
        """Pixels."""

    @property
    def height(self) -> int:
        """Pixels."""

    @property
    def times(self) -> int:
        """Rays along each side of a pixel."""


def strips_of(view: View) -> list[tuple[int, int]]:
    """First and last row, the last one not included, of strips that are one task each."""
    rows = max(1, TASK_RAYS // (view.width * view.times**2))
    return [(first, min(first + rows, view.height)) for first in range(0, view.height, rows)]


class Tasks(NamedTuple):
    """A picture as tasks, each a function with its arguments.

    Attributes:
        parts: by themselves, in any order.
        join: makes the PNG of the list of their results; None where the only part gives it.
    """

    parts: list[tuple[Any, ...]]
    join: Callable[[Sequence[Colours]], bytes] | None


def tasks_of(
    whole: Callable[[Path, Any], bytes],
    strip: Callable[[Path, Any, int, int], Colours],
    path: Path,
    view: View,
) -> Tasks:
    """A picture as one task, or as a task a strip and one that joins them.

    Args:
        whole: task that draws all of a view as PNG.
        strip: task that draws the rows from a first one to a last one, not included.
        path: of what is drawn, readable by every worker.
        view: what to draw.
    """
    parts = strips_of(view)
    if len(parts) == 1:
        return Tasks([(whole, path, view)], None)
    return Tasks([(strip, path, view, first, last) for first, last in parts], joined_png)


def submit(client: Client, tasks: Tasks, priority: int, where: Mapping[str, Any] | None = None) -> Future:
    """Start a picture on a cluster.

    Args:
        client: of the cluster.
        tasks: of the picture.
        priority: above or below that of other tasks.
        where: what ``Client.submit`` takes of resources and workers; None: the render lane of any.

    Returns:
        Of the PNG; once it is released, tasks that have not begun are dropped.
    """
    how = {"pure": False, "resources": RENDER, "priority": priority, **(where or {})}
    drawn = [client.submit(*task, **how) for task in tasks.parts]
    return drawn[0] if tasks.join is None else client.submit(tasks.join, drawn, **how)


def joined_png(strips: Sequence[Colours]) -> bytes:
    """Task: strips, one below the other, as PNG."""
    return png_of(np.concatenate(strips))
