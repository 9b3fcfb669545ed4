"""A download on its way into a file, which is there whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import httpx

from .errors import ClientError
from .steps import DownloadStep


@contextmanager
def saving(step: DownloadStep, response: httpx.Response) -> Iterator[Callable[[bytes], None]]:
    """What the chunks are given to; on leaving, the file takes the target's place.

    Args:
        step: says where it goes, and who is told how much has come.
        response: to be read in chunks.

    Raises:
        ClientError: where it cannot be written.
    """
    target = step.target
    partial = target.with_name(f"{target.name}.partial")
    total = int(response.headers.get("content-length", 0))
    try:
        with partial.open("wb") as file:

            def save(chunk: bytes) -> None:
                file.write(chunk)
                if step.told is not None:
                    step.told(file.tell(), total)

            yield save
            file.flush()
            os.fsync(file.fileno())
        partial.replace(target)
    except OSError as error:
        raise ClientError(f"{target} cannot be written: {error.strerror}") from error
    finally:
        partial.unlink(missing_ok=True)
