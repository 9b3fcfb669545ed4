"""Pictures as rendering tasks: whole, or in tiles of rows that are stacked."""

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from distributed import Client, Future

from ..cluster.resources import RENDER
from ..images.png import png_of
from .drawing_device import Drawn, devices_of

# Rays of one task: about a second of work.
TASK_RAYS = 2**19
# Most threads of one picture that a viewer waits for.
MAX_THREADS = 4


class View(Protocol):
    """Size of a picture."""

    @property
    def width(self) -> int:
        """Pixels."""

    @property
    def height(self) -> int:
        """Pixels."""

    @property
    def times(self) -> int:
        """Rays along each side of a pixel."""


def tile_rows(view: View) -> list[tuple[int, int]]:
    """First and last row, the last one not included, of each tile."""
    rows = max(1, TASK_RAYS // (view.width * view.times**2))
    return [(first, min(first + rows, view.height)) for first in range(0, view.height, rows)]


def viewer_threads() -> int:
    """Threads that trace the rays of a picture that a viewer waits for."""
    return min(MAX_THREADS, len(os.sched_getaffinity(0)))


class PictureTasks(NamedTuple):
    """A picture as tasks, each a function with its arguments.

    Attributes:
        tiles: independent tasks.
        stack: makes the PNG from the list of their results; None where a single task makes it.
    """

    tiles: list[tuple[Any, ...]]
    stack: Callable[[Sequence[Drawn]], bytes] | None


def tasks_of(
    whole: Callable[[Path, Any], bytes],
    tile: Callable[[Path, Any, int, int], Drawn],
    path: Path,
    view: View,
) -> PictureTasks:
    """A picture as one task, or as tiles and a task that stacks them.

    Args:
        whole: task that draws all of a view as PNG.
        tile: task that draws the rows from a first one to a last one, not included.
        path: of the file or folder to draw, readable by every worker.
        view: what to draw.
    """
    rows = tile_rows(view)
    if len(rows) == 1:
        return PictureTasks([(whole, path, view)], None)
    return PictureTasks([(tile, path, view, first, last) for first, last in rows], stack_png)


def submit(
    client: Client, tasks: PictureTasks, priority: int, placement: Mapping[str, Any] | None = None
) -> Future:
    """Start a picture on a cluster.

    Args:
        client: of the cluster.
        tasks: of the picture.
        priority: above or below that of other tasks.
        placement: resources and workers for ``Client.submit``; None: rendering on any worker.

    Returns:
        The future of the PNG; tasks that have not started are dropped when it is released.
    """
    how = {"pure": False, "resources": RENDER, "priority": priority, **(placement or {})}
    drawn = [client.submit(*task, **how) for task in tasks.tiles]
    return drawn[0] if tasks.stack is None else client.submit(tasks.stack, drawn, **how)


def stack_png(tiles: Sequence[Drawn]) -> bytes:
    """Task: tiles, stacked from top to bottom, as PNG."""
    return png_of(np.concatenate([tile.image for tile in tiles]), devices_of(tiles))
