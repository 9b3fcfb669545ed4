"""From an uploaded file to the canonical one in its place."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..storage.tenant_files import TenantFiles
from .sandbox import ingest


@dataclass(frozen=True)
class Limits:
    """Of an ingest process.

    Attributes:
        memory_bytes, seconds: as ``sandbox.ingest`` takes them.
        scratch: the folder it runs in.
    """

    memory_bytes: int
    seconds: float
    scratch: Path


def make_canonical(
    what: str,
    source: Path,
    result_id: str,
    files: TenantFiles,
    limits: Limits,
    given: Mapping[str, Any],
    started: Callable[[int], None] = lambda process_id: None,
) -> dict[str, Any]:
    """Check ``source`` in a process of its own and put the canonical file where its id says.

    Args:
        what: a key of ``ACCEPTED``.
        source: the uploaded file.
        result_id: of what it becomes.
        files: of the tenant.
        limits: of the process.
        given: what the user says of it.
        started: told the id of the process.

    Returns:
        The summary of what it holds.

    Raises:
        InvalidInput, StorageFull: as ``sandbox.ingest`` does; nothing is left then.
        StorageAway: when the canonical file cannot be kept now; the same.
    """
    try:
        summary = ingest(
            what,
            source,
            files.candidate(result_id),
            memory_bytes=limits.memory_bytes,
            seconds=limits.seconds,
            scratch=limits.scratch,
            given=given,
            started=started,
        )
        files.adopt(result_id)
    finally:
        files.discard_candidate(result_id)
    return summary
