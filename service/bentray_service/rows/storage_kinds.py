"""Storage of one tenant by the kind of item."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Literal, get_args

from sqlalchemy import or_, select

from .database import Database
from .ids import PREFIXES
from .schema import storage, volumes
from .tenants import Tenant

StoredKind = Literal["scans", "results", "volumes", "meshes", "geometry-fields", "exports", "jobs", "uploads"]

_BY_PREFIX: dict[str, StoredKind] = {
    PREFIXES["dataset"]: "scans",
    PREFIXES["volume"]: "volumes",
    PREFIXES["mesh"]: "meshes",
    PREFIXES["field"]: "geometry-fields",
    PREFIXES["job"]: "jobs",
    PREFIXES["upload"]: "uploads",
}


@dataclass(frozen=True)
class KindUsage:
    """Stored items of one kind.

    Attributes:
        kind: ``results`` are volumes of reconstructions, ``volumes`` uploaded ones, ``jobs`` space for
            unfinished jobs and finished turntables.
        items: number of stored items.
        stored, reserved: bytes.
    """

    kind: StoredKind
    items: int
    stored: int
    reserved: int


def usage_by_kind(database: Database, tenant: Tenant) -> list[KindUsage]:
    """Storage of a tenant by kind, without reservations of dead processes; kinds without any are left out."""
    alive = or_(storage.c.lease_until.is_(None), storage.c.lease_until >= time.time())
    mine = select(storage.c.name, storage.c.bytes, storage.c.reserved).where(
        storage.c.tenant == tenant, alive
    )
    made = select(volumes.c.id).where(volumes.c.tenant == tenant)
    with database.read() as connection:
        results = set(connection.execute(made).scalars())
        rows = list(connection.execute(mine))
    counted: dict[StoredKind, list[int]] = {kind: [0, 0, 0] for kind in get_args(StoredKind)}
    for name, size, reserved in rows:
        entry = counted[_kind_of(str(name), results)]
        entry[0] += not reserved
        entry[2 if reserved else 1] += int(size)
    return [KindUsage(kind, *entry) for kind, entry in counted.items() if any(entry)]


def _kind_of(name: str, results: set[str]) -> StoredKind:
    # An exported volume is named ID.EXTENSION.
    if "." in name:
        return "exports"
    if name in results:
        return "results"
    return _BY_PREFIX.get(name.partition("-")[0], "jobs")
