"""The task that stands in for a kernel: it moves the same bytes and takes the same time, but no processor."""

from __future__ import annotations

import time


def pause(seconds: float, sent: bytes, returned: int) -> bytes:
    """Sleep, then give so many bytes back."""
    time.sleep(seconds)
    return bytes(returned)
