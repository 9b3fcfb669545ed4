"""Run the ingest process: started apart, timed, killed with its group, believed only when it ends well."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from bentray_kernels.errors import InvalidInput

from ..refusals import StorageFull
from .child import ACCEPTED

log = logging.getLogger("bentray.ingest")

# Slow for reading and packing traces: a busy machine must be able to.
BYTES_PER_S = 8 * 2**20

# One thread each: every further one reserves address space, which is limited. No filter plug-in is loaded.
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
) -> dict[str, Any]:
    """Check ``source`` in a process of its own and write the canonical ``target``.

    Args:
        what: a key of ``ACCEPTED``.
        source, target: paths of this machine.
        memory_bytes: what the process may use of address space.
        seconds: of processor and of wall time, and one more for each ``BYTES_PER_S`` of the source.
        scratch: the folder it runs in.
        given: what the user says of it: of a volume as ``volume_reading.Given``, of a mesh its title.
        started: told the id of the process.

    Returns:
        The summary of what it holds.

    Raises:
        InvalidInput: when the file is refused, and also when reading it crashed, hung or ate the memory.
        StorageFull: when there is no space for the canonical file.
    """
    seconds += source.stat().st_size // BYTES_PER_S
    command = [sys.executable, "-I", "-m", "bentray_service.ingest.child", what, str(source), str(target)]
    command += ["--memory", str(memory_bytes), "--seconds", str(seconds), "--given", json.dumps(dict(given))]
    process = subprocess.Popen(  # noqa: S603 - our own program and paths
        command,
        cwd=scratch,
        env=ENVIRONMENT,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    try:
        started(process.pid)
        output, complaint = process.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        raise InvalidInput(
            "file", f"a file that takes more than {seconds:g} s to read", ACCEPTED[what]
        ) from None
    finally:
        _kill(process)
    if process.returncode != 0:
        log.warning(
            "the ingest process ended with %s: %s", process.returncode, complaint.decode(errors="replace")
        )
        raise InvalidInput("file", _death(process.returncode, memory_bytes), ACCEPTED[what])
    answer: dict[str, Any] = json.loads(output)
    if "full" in answer:
        raise StorageFull("body", "no space for the checked copy", "a smaller file, or a larger disk")
    if "error" in answer:
        raise InvalidInput(answer["error"]["field"], answer["error"]["found"], answer["error"]["accepted"])
    return dict(answer["ok"])


def _kill(process: subprocess.Popen[bytes]) -> None:
    """End the process and whatever it started, then collect it."""
    if process.returncode is None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def _death(code: int, memory_bytes: int) -> str:
    if code == -signal.SIGXCPU:
        return "a file that takes too much processor time to read"
    if code < 0:
        name = signal.Signals(-code).name
        return f"a file that crashed its reader ({name}, within {memory_bytes} bytes of memory)"
    return f"a file that stopped its reader (exit code {code}, within {memory_bytes} bytes of memory)"
