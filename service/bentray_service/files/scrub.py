"""Read everything that is stored and compare it with its checksum; what has none yet is given one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from ..refusals import Damaged, Deleted
from ..rows.checksums import Checksums
from ..rows.tenants import Tenant
from .checked_store import CheckedStore
from .data_folder import Files
from .orphans import Orphans
from .tenant_files import KEPT


class Finding(NamedTuple):
    """What was found of one stored thing.

    Attributes:
        tenant, path: whose it is, and where it lies in the tenant's folder.
        state: ``sound``, ``damaged``, ``first seen`` of one that had no checksum, or ``orphan`` of one that
            no row knows.
        found: of a damaged one, in words.
    """

    tenant: Tenant
    path: str
    state: str
    found: str = ""


def scrub(files: Files, checksums: Checksums, orphans: Orphans) -> Iterator[Finding]:
    """Compare one thing after another; what is damaged is marked, and not served from then on.

    Args:
        files: the data folder, with a store that has compared nothing yet.
        checksums: the rows.
        orphans: what tells files without a row.
    """
    assert isinstance(files.store, CheckedStore)
    rows = {(row["tenant"], row["path"]) for row in checksums.all()}
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
            # By the service, which may be running.
            continue
        else:
            yield Finding(tenant, place, "sound" if (tenant, place) in rows else "first seen")


def _kept(path: Path) -> bool:
    return path.parent.name in KEPT and path.suffix != ".partial"


def _place(path: Path) -> tuple[Tenant, str]:
    return Tenant(path.parts[-3]), f"{path.parent.name}/{path.name}"
