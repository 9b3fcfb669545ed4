"""Storage accounting: bytes stored and reserved by each tenant; every function runs in a transaction."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from sqlalchemy import ColumnElement, Connection, delete, func, insert, not_, or_, select, update

from ..errors import QuotaExceeded
from .accounts import Account, account_in, account_of, family_of
from .schema import storage
from .tenants import Tenant


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


def usage_of(connection: Connection, tenant: Tenant, besides: str = "") -> Usage:
    """The usage of a tenant and its projects, or of all of those of a project; without dead processes.

    Args:
        connection: in a transaction.
        tenant: owner.
        besides: name of an item to leave out.
    """
    family = storage.c.tenant.in_(family_of(connection, tenant))
    # The name alone would leave out an equal one of another project, as of a geometry field.
    other = or_(storage.c.tenant != tenant, storage.c.name != besides)
    mine = family, other, _counted()
    query = select(storage.c.reserved, func.sum(storage.c.bytes)).where(*mine).group_by(storage.c.reserved)
    sizes = {bool(reserved): int(size) for reserved, size in connection.execute(query)}
    return Usage(sizes.get(False, 0), sizes.get(True, 0))


def largest(connection: Connection, most: int) -> dict[Account, int]:
    """Bytes stored and reserved by the accounts that use most."""
    each = select(account_in(storage.c.tenant).label("account"), storage.c.bytes).where(_counted()).subquery()
    size = func.sum(each.c.bytes)
    query = select(each.c.account, size).group_by(each.c.account).order_by(size.desc(), each.c.account)
    return {Account(account): int(total) for account, total in connection.execute(query.limit(most))}


def reserve(
    connection: Connection, tenant: Tenant, name: str, size: int, most: int, lease: Lease | None = None
) -> None:
    """Reserve storage for an item, or change its reservation.

    Args:
        connection: in a write transaction; it serialises reservations of one tenant.
        tenant: owner.
        name: id of the item, or another unique name.
        size: its maximum size, bytes.
        most: quota of the tenant, bytes.
        lease: for a reservation that ends with its process; None: it lasts until it is released.

    Raises:
        QuotaExceeded: when less is available; nothing is changed.
    """
    _take_turn(connection, tenant)
    used = usage_of(connection, tenant, name)
    if used.stored + used.reserved + size > most:
        raise QuotaExceeded(
            "storage",
            f"{used.stored} bytes stored, {used.reserved} reserved, {size} more requested",
            f"at most {most} bytes per tenant (BENTRAY_MAX_TENANT_BYTES); delete stored data",
        )
    if connection.execute(update(storage).where(*_one(tenant, name)).values(bytes=size)).rowcount:
        return
    held = {} if lease is None else {"lease_owner": lease.owner, "lease_until": lease.until}
    row = {"tenant": tenant, "name": name, "bytes": size, "reserved": True, **held}
    connection.execute(insert(storage).values(**row))


def grow(connection: Connection, tenant: Tenant, name: str, size: int) -> None:
    """Increase a reservation to ``size`` bytes, if it is smaller."""
    mine = *_one(tenant, name), storage.c.reserved, storage.c.bytes < size
    connection.execute(update(storage).where(*mine).values(bytes=size))


def keep(connection: Connection, tenant: Tenant, name: str, otherwise: int) -> None:
    """Turn a reservation into a stored item of the same size, or of ``otherwise`` bytes without one."""
    if not _settle(connection, tenant, name):
        store(connection, tenant, name, otherwise)


def store(connection: Connection, tenant: Tenant, name: str, size: int) -> None:
    """Store the size of an item, bytes."""
    _take_turn(connection, tenant)
    if not _settle(connection, tenant, name, bytes=size):
        connection.execute(insert(storage).values(tenant=tenant, name=name, bytes=size, reserved=False))


def release(connection: Connection, tenant: Tenant, name: str) -> None:
    """Release a reservation; a stored item is kept."""
    connection.execute(delete(storage).where(*_one(tenant, name), storage.c.reserved))


def forget(connection: Connection, tenant: Tenant, names: Collection[str]) -> None:
    """Remove items and their exports ``ID.EXTENSION``."""
    parts = [storage.c.name.like(f"{name}.%") for name in names]
    gone = or_(storage.c.name.in_(names), *parts)
    connection.execute(delete(storage).where(storage.c.tenant == tenant, gone))


def correct(connection: Connection, tenant: Tenant, sizes: Mapping[str, int]) -> None:
    """Correct the sizes of stored items; missing items are added."""
    mine = select(storage.c.name, storage.c.bytes, storage.c.reserved).where(storage.c.tenant == tenant)
    known = {row.name: row for row in connection.execute(mine)}
    for name, size in sizes.items():
        if name not in known:
            store(connection, tenant, name, size)
        elif not known[name].reserved and known[name].bytes != size:
            connection.execute(update(storage).where(*_one(tenant, name)).values(bytes=size))


def renew(connection: Connection, lease: Lease) -> None:
    """Extend all leases of a process."""
    mine = storage.c.lease_owner == lease.owner
    connection.execute(update(storage).where(mine).values(lease_until=lease.until))


def drop_expired(connection: Connection) -> None:
    """Remove reservations of dead processes."""
    connection.execute(delete(storage).where(not_(_counted())))


def drop_leased(connection: Connection) -> None:
    """Remove all reservations of processes, if no other service uses the database."""
    connection.execute(delete(storage).where(storage.c.lease_owner.is_not(None)))


def _settle(connection: Connection, tenant: Tenant, name: str, **values: int) -> bool:
    """Turn a reservation into a stored item; returns whether it or the item existed."""
    now = {"reserved": False, "lease_owner": None, "lease_until": None}
    return bool(
        connection.execute(update(storage).where(*_one(tenant, name)).values(**now, **values)).rowcount
    )


def _one(tenant: Tenant, name: str) -> tuple[ColumnElement[bool], ColumnElement[bool]]:
    return storage.c.tenant == tenant, storage.c.name == name


def _counted() -> ColumnElement[bool]:
    return or_(storage.c.lease_until.is_(None), storage.c.lease_until >= time.time())


def _take_turn(connection: Connection, tenant: Tenant) -> None:
    """Serialise write transactions of one tenant; those of SQLite are serialised anyway."""
    if connection.dialect.name != "sqlite":
        digest = hashlib.sha256(f"storage/{account_of(connection, tenant)}".encode()).digest()
        connection.execute(select(func.pg_advisory_xact_lock(int.from_bytes(digest[:8], signed=True))))
