"""Verification of all stored files against their checksums; missing checksums are added."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from ..errors import Damaged, Deleted
from ..rows.checksums import Checksums
from ..rows.tenants import Tenant
from .checked_store import CheckedStore
from .data_folder import Files
from .orphans import Orphans
from .tenant_files import KEPT


class Finding(NamedTuple):
    """The result for one stored item.

    Attributes:
        tenant, path: owner, and path below the folder of the tenant.
        state: ``sound``, ``damaged``, ``first seen`` (checksum added) or ``orphan`` (no row).
        found: description of the damage.
    """

    tenant: Tenant
    path: str
    state: str
    found: str = ""


def scrub(files: Files, checksums: Checksums, orphans: Orphans) -> Iterator[Finding]:
    """Verify all stored items; damaged ones are marked and no longer served.

    Args:
        files: the data folder, with a store that has verified nothing yet.
        checksums: the table of checksums.
        orphans: finds files without a row.
    """
    assert isinstance(files.store, CheckedStore)
    rows = {(row.tenant, row.path) for row in checksums.all()}
    unknown = {_place(path) for path in orphans.found()}
    lying = {_place(path) for path in files.root.glob("tenants/*/*/*") if _kept(path)}
    for tenant, place in sorted(rows | lying | unknown):
        if (tenant, place) in unknown:
            yield Finding(tenant, place, "orphan")
            continue
        try:
            files.store.fetch(files.of(tenant).root / place)
        except Damaged as error:
            yield Finding(tenant, place, "damaged", error.value.partition(", ")[2])
        except Deleted:
            # Deleted by a running service.
            continue
        else:
            yield Finding(tenant, place, "sound" if (tenant, place) in rows else "first seen")


def _kept(path: Path) -> bool:
    return path.parent.name in KEPT and path.suffix != ".partial"


def _place(path: Path) -> tuple[Tenant, str]:
    return Tenant(path.parts[-3]), f"{path.parent.name}/{path.name}"
