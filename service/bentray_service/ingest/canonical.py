"""Conversion of an uploaded file, or a corrected copy of a stored scan, to a canonical file in its place."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import KeyReused
from ..files.disk import digest_of
from ..files.tenant_files import TenantFiles
from ..rows.stored_tables import Datasets, RequestKey
from ..rows.tables import DatasetRow
from .ingest_process import CORRECTION, FILE_NAME
from .sandbox import ingest

ENDING = ", corrected"


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
        given: metadata; ``FILE_NAME`` is the title of a file that has none.
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
    stated = {name: value for name, value in given.items() if name != FILE_NAME}
    try:
        candidate = files.candidate(result_id)
        summary = ingest(
            what,
            source,
            candidate,
            memory_bytes=limits.memory_bytes,
            seconds=limits.seconds,
            scratch=limits.scratch,
            given=stated,
            started=started,
            reserve=lambda size: reserve(max(size, received)),
        )
        # The uploaded file will be deleted.
        reserve(candidate.stat().st_size)
        files.adopt(result_id)
    finally:
        files.discard_candidate(result_id)
    return {**summary, "title": summary["title"] or given.get(FILE_NAME, "")}


LONGEST_NAME, LONGEST_NOTES = 200, 4000


def add_corrected(
    scan: DatasetRow,
    correction: Mapping[str, Any],
    request: RequestKey,
    new_id: str,
    datasets: Datasets,
    files: TenantFiles,
    limits: IngestLimits,
    reserve: Callable[[int], None],
) -> DatasetRow:
    """Write the corrected copy of a scan in a separate process, as for an upload, and insert its row.

    Args:
        scan: stored; neither its row nor its file is changed, since its results were made of them.
        correction: arguments of ``Correction``.
        request: an equal one that was faster keeps its copy, and there is no other.
        new_id: of the copy.
        datasets: the table.
        files: of the tenant; the file of ``scan`` is here.
        limits: of the process.
        reserve: reserves storage, bytes, replacing an earlier reservation.

    Raises:
        KeyReused: when the key was used with another request.
        InvalidInput, QuotaExceeded, StorageFull, StorageUnavailable: as ``make_canonical``.
    """
    given = {CORRECTION: dict(correction), "origin": scan.id}
    summary = make_canonical("dataset", files.dataset(scan.id), new_id, files, limits, given, reserve)
    path = files.dataset(new_id)
    statement = summary["source"].partition(". ")[0]
    own = {
        "name": (scan.name or scan.title or scan.id)[: LONGEST_NAME - len(ENDING)] + ENDING,
        "notes": "\n".join(part for part in (statement, scan.notes) if part)[:LONGEST_NOTES],
        "water_temperature_c": scan.water_temperature_c,
    }
    size, sha256 = digest_of(path)
    try:
        made = datasets.add_once(
            scan.tenant, new_id, request, size=size, sha256=sha256, summary=summary | own
        )
    except KeyReused:
        files.remove([new_id])
        raise
    if made.id != new_id:
        files.remove([new_id])
    return made
