"""Exceptions of file readers on damaged data, converted to InvalidInput."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from bentray_kernels.errors import InvalidInput


@contextmanager
def rejecting_damage(
    field: str, accepted: str, errors: tuple[type[Exception], ...] = (Exception,)
) -> Iterator[None]:
    """Convert these exceptions of readers on damaged data to InvalidInput for this field.

    By default all but MemoryError: readers raise exceptions of any type on a damaged header.
    """
    try:
        yield
    except InvalidInput:
        raise
    except errors as error:
        if isinstance(error, MemoryError) and MemoryError not in errors:
            raise
        reason = next(iter(str(error).splitlines()), "") or type(error).__name__
        raise InvalidInput(field, f"damaged data ({reason[:120]})", accepted) from None


def first_bytes(data: bytes) -> str:
    """The beginning of a file of another kind in words, for a message."""
    return f"it begins with {repr(data[:8])[1:]}"
