"""Whether anybody still waits for what a task gives: as long as the folder of its job is there."""

from __future__ import annotations

from pathlib import Path


class Unwanted(Exception):  # noqa: N818 - no error: its job was cancelled, and nobody sees it
    """The job of a task has ended before it; what it gives is dropped."""


def check_wanted(folder: Path) -> None:
    """End a task whose job has ended: to be called a few times a second by what takes longer.

    Dask cancels what waits; what runs must ask. A look at a folder takes some microseconds, and unlike a
    message it also tells tasks whose service was killed and has cancelled the job since.

    Args:
        folder: of the job; it is removed, or renamed, when the job ends.

    Raises:
        Unwanted: once it has gone.
    """
    if not folder.exists():
        raise Unwanted(folder.name)
