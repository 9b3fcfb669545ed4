"""Runs the ingest process in a sandbox: separate process group, time limit, validated output."""

import contextlib
import json
import logging
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from bentray_kernels.errors import InvalidInput

from ..errors import StorageFull
from .ingest_process import ACCEPTED

log = logging.getLogger("bentray.ingest")

PROGRAM = "bentray_service.ingest.ingest_process"

# Minimum ingestion rate of a slow machine, bytes/s.
BYTES_PER_S = 8 * 2**20

# Wall time over CPU time: a reader may share its processors. The limit of CPU time ends one that computes,
# that of wall time one that waits.
WALL = 4.0

# Maximum length of the error output in the log.
LONGEST_COMPLAINT = 2000

# One thread, since each further one uses address space; no plug-ins of HDF5.
ENVIRONMENT = {
    "PATH": os.defpath,
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
    "HDF5_PLUGIN_PRELOAD": "::",
    "HDF5_USE_FILE_LOCKING": "FALSE",
}


def ingest(
    what: str,
    source: Path,
    target: Path,
    *,
    memory_bytes: int,
    seconds: float,
    scratch: Path,
    given: Mapping[str, Any] = MappingProxyType({}),
    started: Callable[[int], None] = lambda process_id: None,
    reserve: Callable[[int], None] = lambda size: None,
) -> dict[str, Any]:
    """Validate ``source`` in a separate process and write the canonical ``target``.

    The caller deletes temporary files next to ``target`` that a killed process has left.

    Args:
        what: a key of ``ACCEPTED``.
        source, target: paths.
        memory_bytes: address space of the process.
        seconds: CPU time, plus one second per ``BYTES_PER_S`` bytes of the source; wall time is ``WALL``
            times as long.
        scratch: working folder.
        given: metadata: see ``volume_formats.VolumeMetadata``; for a mesh its title.
        started: called with the process id.
        reserve: called with the maximum size of ``target`` before it is written; an exception ends the
            process.

    Returns:
        summary of the content.

    Raises:
        InvalidInput: for an invalid file, also if the reader crashed, timed out or ran out of memory.
        StorageFull: when there is no space for the canonical file.
    """
    seconds += source.stat().st_size // BYTES_PER_S
    command = [sys.executable, "-I", "-m", PROGRAM, what, str(source), str(target)]
    command += ["--memory", str(memory_bytes), "--seconds", str(seconds), "--given", json.dumps(dict(given))]
    with tempfile.TemporaryFile(dir=scratch) as complaint:
        process = subprocess.Popen(  # noqa: S603 - our own program and paths
            command,
            cwd=scratch,
            env={**ENVIRONMENT, "TMPDIR": str(target.parent)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=complaint,
            start_new_session=True,
        )
        try:
            started(process.pid)
            outcome = _answer(process, WALL * seconds, reserve)
        finally:
            _kill(process)
        if outcome is None:
            slow_file = f"a file that takes longer than {WALL * seconds:g} s to read"
            raise InvalidInput("file", slow_file, ACCEPTED[what])
        if process.returncode != 0:
            complaint.seek(0)
            output = complaint.read(LONGEST_COMPLAINT).decode(errors="replace")
            log.warning("the ingest process ended with %s: %s", process.returncode, output)
            raise InvalidInput("file", _death(process.returncode, memory_bytes), ACCEPTED[what])
    return summary_in(outcome)


def summary_in(outcome: Mapping[str, Any]) -> dict[str, Any]:
    """The summary in an outcome of ``ingest_process.convert_upload``.

    Raises:
        InvalidInput, StorageFull: that the outcome names.
    """
    if "full" in outcome:
        raise StorageFull("body", "no space for the canonical file", "a smaller file, or more disk space")
    if "error" in outcome:
        raise InvalidInput(outcome["error"]["field"], outcome["error"]["found"], outcome["error"]["accepted"])
    return dict(outcome["ok"])


def _answer(
    process: subprocess.Popen[bytes], seconds: float, reserve: Callable[[int], None]
) -> dict[str, Any] | None:
    """The last output line of the process; None after a time-out."""
    assert process.stdin is not None
    assert process.stdout is not None
    late = threading.Event()

    def end() -> None:
        late.set()
        _kill_group(process)

    outcome: dict[str, Any] = {}
    watch = threading.Timer(seconds, end)
    watch.start()
    try:
        for line in process.stdout:
            if not line.endswith(b"\n"):
                # The process died while it wrote.
                break
            outcome = json.loads(line)
            if "reserve" in outcome:
                reserve(int(outcome["reserve"]))
                # The exit code of a dead process is evaluated later.
                with contextlib.suppress(BrokenPipeError):
                    process.stdin.write(b"go\n")
                    process.stdin.flush()
        process.wait()
    finally:
        watch.cancel()
        watch.join()
    return None if late.is_set() else outcome


def _kill_group(process: subprocess.Popen[bytes]) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def _kill(process: subprocess.Popen[bytes]) -> None:
    """Kill the process group, then wait for the process."""
    if process.returncode is None:
        _kill_group(process)
        process.wait()
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with contextlib.suppress(BrokenPipeError):
                pipe.close()


def _death(code: int, memory_bytes: int) -> str:
    if code == -signal.SIGXCPU:
        return "a file that takes too much CPU time to read"
    if code < 0:
        name = signal.Signals(-code).name
        return f"a file that crashed its reader ({name}, within {memory_bytes} bytes of memory)"
    return f"a file that stopped its reader (exit code {code}, within {memory_bytes} bytes of memory)"
