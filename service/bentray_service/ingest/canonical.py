"""From an uploaded file to the canonical one in its place."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..files.tenant_files import TenantFiles
from .sandbox import ingest


@dataclass(frozen=True)
class IngestLimits:
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
    limits: IngestLimits,
    given: Mapping[str, Any],
    reserve: Callable[[int], None],
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
        reserve: reserves so many bytes for it, in place of what was reserved before; it may refuse.
        started: told the id of the process.

    Returns:
        The summary of what it holds.

    Raises:
        QuotaUsedUp: from ``reserve``; nothing is left then.
        InvalidInput, StorageFull: as ``sandbox.ingest`` does; nothing is left then.
        StorageAway: when the canonical file cannot be kept now; the same.
    """
    received = source.stat().st_size
    try:
        candidate = files.candidate(result_id)
        summary = ingest(
            what,
            source,
            candidate,
            memory_bytes=limits.memory_bytes,
            seconds=limits.seconds,
            scratch=limits.scratch,
            given=given,
            started=started,
            reserve=lambda size: reserve(max(size, received)),
        )
        # What was received goes now.
        reserve(candidate.stat().st_size)
        files.adopt(result_id)
    finally:
        files.discard_candidate(result_id)
    return summary
