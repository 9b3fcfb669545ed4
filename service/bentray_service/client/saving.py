"""Atomic download to a file."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import httpx

from .errors import ClientError
from .steps import DownloadStep


@contextmanager
def saving(step: DownloadStep, response: httpx.Response) -> Iterator[Callable[[bytes], None]]:
    """Yield a function that writes chunks; at the end, the file replaces the target.

    Args:
        step: target and progress callback.
        response: to be read in chunks.

    Raises:
        ClientError: when the file cannot be written.
    """
    target = step.target
    partial = target.with_name(f"{target.name}.partial")
    total = int(response.headers.get("content-length", 0))
    try:
        with partial.open("wb") as file:

            def save(chunk: bytes) -> None:
                file.write(chunk)
                if step.on_progress is not None:
                    step.on_progress(file.tell(), total)

            yield save
            file.flush()
            os.fsync(file.fileno())
        partial.replace(target)
    except OSError as error:
        raise ClientError(f"{target} cannot be written: {error.strerror}") from error
    finally:
        partial.unlink(missing_ok=True)
