"""A corrected copy of a stored scan, with the names and notes of the user."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ..errors import KeyReused
from ..files.digests import digest_of
from ..files.tenant_files import TenantFiles
from ..rows.idempotency import RequestKey
from ..rows.stored_tables import Datasets
from ..rows.tables import DatasetRow
from ..rows.tenants import Tenant
from .canonical import IngestLimits, make_canonical
from .ingest_process import CORRECTION

LONGEST_NAME, LONGEST_NOTES = 200, 4000
ENDING = ", corrected"


def add_corrected(
    tenant: Tenant,
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
        tenant: owner of both.
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
    size, digest = path.stat().st_size, digest_of(path).sha256
    try:
        made = datasets.add_once(tenant, new_id, request, size=size, sha256=digest, summary=summary | own)
    except KeyReused:
        files.remove([new_id])
        raise
    if made.id != new_id:
        files.remove([new_id])
    return made
