"""A temporary service: `bentray serve` in a child process."""

import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .output.exit_codes import WorkFailed

# Time limit for the start, s; the first start compiles the kernels, which takes a minute or more.
START_S = 600.0
STOP_S = 20.0


@contextmanager
def running_service(data: Path, log: Path) -> Iterator[str]:
    """Start a service on a free port and yield its URL; it is stopped at the end of the block.

    Args:
        data: its data folder.
        log: file for its output.

    Raises:
        WorkFailed: when it does not start.
    """
    command = [sys.executable, "-m", "bentray_service.cli", "serve", "--host", "127.0.0.1", "--port", "0"]
    command += ["--json", "--data", str(data)]
    # A separate process group, to stop its workers as well; Ctrl-C is handled by this process only.
    with log.open("wb") as errors:
        process = subprocess.Popen(  # noqa: S603 - our own command, no shell
            command, stdout=subprocess.PIPE, stderr=errors, start_new_session=True
        )
    try:
        with _terminable():
            yield _url(process, log)
    finally:
        _stop(process)


def _url(process: subprocess.Popen[bytes], log: Path) -> str:
    assert process.stdout is not None
    deadline = time.monotonic() + START_S
    while not select.select([process.stdout], [], [], 0.2)[0]:
        if time.monotonic() > deadline:
            raise WorkFailed(f"the service did not start within {START_S:g} s; its log is {log}")
    line = process.stdout.readline()
    if not line:
        lines = log.read_text(errors="replace").strip().splitlines()
        raise WorkFailed(f"the service exited at once: {lines[-1] if lines else 'no output'} (log: {log})")
    return str(json.loads(line)["url"])


def _stop(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    try:
        with suppress(subprocess.TimeoutExpired):
            process.wait(STOP_S)
    finally:
        # Kill remaining processes of the group.
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        if process.stdout is not None:
            process.stdout.close()


@contextmanager
def _terminable() -> Iterator[None]:
    """Handle SIGTERM and SIGHUP like Ctrl-C, so that the service is stopped."""

    def leave(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    before = {number: signal.signal(number, leave) for number in (signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
