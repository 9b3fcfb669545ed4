"""Pictures as tasks of the render lane: whole, or strip by strip and then joined."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from distributed import Client, Future

from .images.png import Colours, png_of
from .lanes import RENDER

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


def submit(
    client: Client,
    whole: Callable[[Path, Any], bytes],
    strip: Callable[[Path, Any, int, int], Colours],
    path: Path,
    view: View,
    priority: int,
) -> Future:
    """Start a picture on a cluster: one task, or a task a strip and one that joins them.

    Args:
        client: of the cluster.
        whole: task that draws all of a view as PNG.
        strip: task that draws the rows from a first one to a last one, not included.
        path: of what is drawn, readable by every worker.
        view: what to draw.
        priority: above or below that of other tasks.

    Returns:
        Of the PNG; once it is released, tasks that have not begun are dropped.
    """
    how = {"pure": False, "resources": RENDER, "priority": priority}
    parts = strips_of(view)
    if len(parts) == 1:
        return client.submit(whole, path, view, **how)
    drawn = [client.submit(strip, path, view, first, last, **how) for first, last in parts]
    return client.submit(joined_png, drawn, **how)


def joined_png(strips: Sequence[Colours]) -> bytes:
    """Task: strips, one below the other, as PNG."""
    return png_of(np.concatenate(strips))
