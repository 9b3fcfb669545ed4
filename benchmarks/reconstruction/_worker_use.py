"""Peak memory of this process, to be called on a worker."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from distributed import Client

SELF = Path("/proc/self")


def forget_peak() -> None:
    """Let the peak start again at the present memory.

    Raises:
        OSError: on another system than Linux.
    """
    # See proc(5), clear_refs.
    (SELF / "clear_refs").write_text("5")


def peak_bytes() -> int:
    """Largest resident memory since ``forget_peak``.

    Raises:
        OSError: on another system than Linux.
    """
    lines = (SELF / "status").read_text().splitlines()
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith("VmHWM:"))


def of_worker(client: Client, function: Callable[[], Any]) -> Any:
    """The result of a function on the only worker."""
    (result,) = client.run(function).values()
    return result
