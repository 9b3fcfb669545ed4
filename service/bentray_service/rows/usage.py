"""Storage accounting: bytes stored and reserved by each tenant; every function runs in a transaction."""

import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Literal, get_args

from sqlalchemy import ColumnElement, delete, func, not_, or_, select, update
from sqlalchemy.orm import Session

from ..errors import QuotaExceeded
from .accounts import Account, account_in, account_of, family_of
from .database import Database, rows_changed, take_lock
from .ids import PREFIXES, Tenant
from .tables import ResultVolumeRow, StorageRow


@dataclass(frozen=True)
class Usage:
    """Bytes of a tenant: stored, and reserved for uploads and jobs."""

    stored: int
    reserved: int


@dataclass(frozen=True)
class Lease:
    """The process that holds a reservation, and when its lease ends, s since 1970."""

    owner: str
    until: float


def usage_of(session: Session, tenant: Tenant, besides: str = "") -> Usage:
    """The usage of a tenant and its projects, or of all of those of a project; without dead processes.

    Args:
        session: in a transaction.
        tenant: owner.
        besides: name of an item to leave out.
    """
    family = StorageRow.tenant.in_(family_of(session, tenant))
    # The name alone would leave out an equal one of another project, as of a geometry field.
    other = or_(StorageRow.tenant != tenant, StorageRow.name != besides)
    mine = family, other, _counted()
    query = select(StorageRow.reserved, func.sum(StorageRow.bytes)).where(*mine).group_by(StorageRow.reserved)
    sizes = {bool(reserved): int(size) for reserved, size in session.execute(query)}
    return Usage(sizes.get(False, 0), sizes.get(True, 0))


def largest(session: Session, most: int) -> dict[Account, int]:
    """Bytes stored and reserved by the accounts that use most."""
    each = (
        select(account_in(StorageRow.tenant).label("account"), StorageRow.bytes).where(_counted()).subquery()
    )
    size = func.sum(each.c.bytes)
    query = select(each.c.account, size).group_by(each.c.account).order_by(size.desc(), each.c.account)
    return {Account(account): int(total) for account, total in session.execute(query.limit(most))}


def reserve(
    session: Session, tenant: Tenant, name: str, size: int, most: int, lease: Lease | None = None
) -> None:
    """Reserve storage for an item, or change its reservation.

    Args:
        session: in a write transaction; it serialises reservations of one tenant.
        tenant: owner.
        name: id of the item, or another unique name.
        size: its maximum size, bytes.
        most: quota of the tenant, bytes.
        lease: for a reservation that ends with its process; None: it lasts until it is released.

    Raises:
        QuotaExceeded: when less is available; nothing is changed.
    """
    take_lock(session, f"storage/{account_of(session, tenant)}")
    used = usage_of(session, tenant, name)
    if used.stored + used.reserved + size > most:
        raise QuotaExceeded(
            "storage",
            f"{used.stored} bytes stored, {used.reserved} reserved, {size} more requested",
            f"at most {most} bytes per tenant (BENTRAY_MAX_TENANT_BYTES); delete stored data",
        )
    if rows_changed(session, update(StorageRow).where(*_one(tenant, name)).values(bytes=size)):
        return
    held = {} if lease is None else {"lease_owner": lease.owner, "lease_until": lease.until}
    session.add(StorageRow(tenant=tenant, name=name, bytes=size, reserved=True, **held))


def grow(session: Session, tenant: Tenant, name: str, size: int) -> None:
    """Increase a reservation to ``size`` bytes, if it is smaller."""
    mine = *_one(tenant, name), StorageRow.reserved, StorageRow.bytes < size
    session.execute(update(StorageRow).where(*mine).values(bytes=size))


def keep(session: Session, tenant: Tenant, name: str, otherwise: int) -> None:
    """Turn a reservation into a stored item of the same size, or of ``otherwise`` bytes without one."""
    if not _settle(session, tenant, name):
        store(session, tenant, name, otherwise)


def store(session: Session, tenant: Tenant, name: str, size: int) -> None:
    """Store the size of an item, bytes."""
    take_lock(session, f"storage/{account_of(session, tenant)}")
    if not _settle(session, tenant, name, bytes=size):
        session.add(StorageRow(tenant=tenant, name=name, bytes=size, reserved=False))


def release(session: Session, tenant: Tenant, name: str) -> None:
    """Release a reservation; a stored item is kept."""
    session.execute(delete(StorageRow).where(*_one(tenant, name), StorageRow.reserved))


def forget(session: Session, tenant: Tenant, names: Collection[str]) -> None:
    """Remove items and their exports ``ID.EXTENSION``."""
    parts = [StorageRow.name.like(f"{name}.%") for name in names]
    gone = or_(StorageRow.name.in_(names), *parts)
    session.execute(delete(StorageRow).where(StorageRow.tenant == tenant, gone))


def correct(session: Session, tenant: Tenant, sizes: Mapping[str, int]) -> None:
    """Correct the sizes of stored items; missing items are added."""
    mine = select(StorageRow.name, StorageRow.bytes, StorageRow.reserved).where(StorageRow.tenant == tenant)
    known = {row.name: row for row in session.execute(mine)}
    for name, size in sizes.items():
        if name not in known:
            store(session, tenant, name, size)
        elif not known[name].reserved and known[name].bytes != size:
            session.execute(update(StorageRow).where(*_one(tenant, name)).values(bytes=size))


def renew(session: Session, lease: Lease) -> None:
    """Extend all leases of a process."""
    mine = StorageRow.lease_owner == lease.owner
    session.execute(update(StorageRow).where(mine).values(lease_until=lease.until))


def drop_expired(session: Session) -> None:
    """Remove reservations of dead processes."""
    session.execute(delete(StorageRow).where(not_(_counted())))


def drop_leased(session: Session) -> None:
    """Remove all reservations of processes, if no other service uses the database."""
    session.execute(delete(StorageRow).where(StorageRow.lease_owner.is_not(None)))


def _settle(session: Session, tenant: Tenant, name: str, **values: int) -> bool:
    """Turn a reservation into a stored item; returns whether it or the item existed."""
    now = {"reserved": False, "lease_owner": None, "lease_until": None}
    return bool(rows_changed(session, update(StorageRow).where(*_one(tenant, name)).values(**now, **values)))


def _one(tenant: Tenant, name: str) -> tuple[ColumnElement[bool], ColumnElement[bool]]:
    return StorageRow.tenant == tenant, StorageRow.name == name


def _counted() -> ColumnElement[bool]:
    return or_(StorageRow.lease_until.is_(None), StorageRow.lease_until >= time.time())


StoredKind = Literal["scans", "results", "volumes", "meshes", "geometry-fields", "exports", "jobs", "uploads"]

_BY_PREFIX: dict[str, StoredKind] = {
    PREFIXES["dataset"]: "scans",
    PREFIXES["volume"]: "volumes",
    PREFIXES["mesh"]: "meshes",
    PREFIXES["field"]: "geometry-fields",
    PREFIXES["job"]: "jobs",
    PREFIXES["upload"]: "uploads",
}


def usage_by_kind(database: Database, tenant: Tenant) -> dict[StoredKind, list[int]]:
    """Items, stored and reserved bytes of a tenant by kind; kinds without any are left out.

    ``results`` are volumes of reconstructions, ``volumes`` uploaded ones, ``jobs`` space for unfinished jobs
    and finished turntables. Reservations of dead processes do not count.
    """
    columns = StorageRow.name, StorageRow.bytes, StorageRow.reserved
    mine = select(*columns).where(StorageRow.tenant == tenant, _counted())
    made = select(ResultVolumeRow.id).where(ResultVolumeRow.tenant == tenant)
    with database.read() as session:
        results = set(session.execute(made).scalars())
        rows = list(session.execute(mine))
    counted: dict[StoredKind, list[int]] = {kind: [0, 0, 0] for kind in get_args(StoredKind)}
    for name, size, reserved in rows:
        entry = counted[_kind_of(str(name), results)]
        entry[0] += not reserved
        entry[2 if reserved else 1] += int(size)
    return {kind: entry for kind, entry in counted.items() if any(entry)}


def _kind_of(name: str, results: set[str]) -> StoredKind:
    # An exported volume is named ID.EXTENSION.
    if "." in name:
        return "exports"
    if name in results:
        return "results"
    return _BY_PREFIX.get(name.partition("-")[0], "jobs")
