"""A download on its way into a file, which is there whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import ClientError


@contextmanager
def saving(target: Path) -> Iterator[Callable[[bytes], object]]:
    """What the chunks are given to; on leaving, the file takes the target's place.

    Raises:
        ClientError: where it cannot be written.
    """
    partial = target.with_name(f"{target.name}.partial")
    try:
        with partial.open("wb") as file:
            yield file.write
            file.flush()
            os.fsync(file.fileno())
        partial.replace(target)
    except OSError as error:
        raise ClientError(f"{target} cannot be written: {error.strerror}") from error
    finally:
        partial.unlink(missing_ok=True)
