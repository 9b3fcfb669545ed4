"""Cancellation of tasks of a job: a task ends once the folder of its job is removed."""

from pathlib import Path


class JobEnded(Exception):  # noqa: N818 - not an error: its job was cancelled
    """The job of a task has ended before it; the result is dropped."""


def check_job_active(folder: Path) -> None:
    """Raise if the job of a task has ended; to be called a few times a second by long tasks.

    Dask cancels waiting tasks only; a running one must check. Checking a folder takes some microseconds, and
    unlike a message it also reaches tasks whose service was killed and has cancelled the job since.

    Args:
        folder: of the job; it is removed, or renamed, when the job ends.

    Raises:
        JobEnded: once the folder is gone.
    """
    if not folder.exists():
        raise JobEnded(folder.name)
