"""Conversion of an uploaded file to a canonical file in its final place."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..files.tenant_files import TenantFiles
from .sandbox import ingest


@dataclass(frozen=True)
class IngestLimits:
    """Limits of an ingest process.

    Attributes:
        memory_bytes, seconds: see ``sandbox.ingest``.
        scratch: its working folder.
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
    """Validate ``source`` in a separate process and store the canonical file; after an error no file is left.

    Args:
        what: a key of ``ACCEPTED``.
        source: the uploaded file.
        result_id: id of the result.
        files: of the tenant.
        limits: of the process.
        given: metadata.
        reserve: reserves storage, bytes, replacing an earlier reservation.
        started: called with the process id.

    Returns:
        summary of the content.

    Raises:
        QuotaExceeded: from ``reserve``.
        InvalidInput, StorageFull: see ``sandbox.ingest``.
        StorageUnavailable: when the canonical file cannot be published.
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
        # The uploaded file will be deleted.
        reserve(candidate.stat().st_size)
        files.adopt(result_id)
    finally:
        files.discard_candidate(result_id)
    return summary
