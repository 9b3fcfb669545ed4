"""A sleeping task in place of a kernel: same bytes and time, no CPU time."""

import time


def pause(seconds: float, sent: bytes, returned: int) -> bytes:
    """Sleep, then return ``returned`` bytes."""
    time.sleep(seconds)
    return bytes(returned)
