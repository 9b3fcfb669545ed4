"""The rows of what each tenant stores and has reserved, in bytes; every call is part of a transaction."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from sqlalchemy import ColumnElement, Connection, delete, func, insert, not_, or_, select, update

from ..refusals import QuotaExceeded
from .schema import storage
from .tenants import Tenant


@dataclass(frozen=True)
class Usage:
    """Bytes of a tenant: stored, and reserved by what is on its way."""

    stored: int
    reserved: int


@dataclass(frozen=True)
class Lease:
    """Which process a reservation belongs to, and until when it is believed to live, s since 1970."""

    owner: str
    until: float


def usage_of(connection: Connection, tenant: Tenant, besides: str = "") -> Usage:
    """What a tenant stores and has reserved; a reservation whose process died counts no more.

    Args:
        connection: in a transaction.
        tenant: whose.
        besides: the name of one thing that is left out.
    """
    mine = storage.c.tenant == tenant, storage.c.name != besides, _believed()
    query = select(storage.c.reserved, func.sum(storage.c.bytes)).where(*mine).group_by(storage.c.reserved)
    found = {bool(reserved): int(size) for reserved, size in connection.execute(query)}
    return Usage(found.get(False, 0), found.get(True, 0))


def reserve(
    connection: Connection, tenant: Tenant, name: str, size: int, most: int, lease: Lease | None = None
) -> None:
    """Reserve room for one thing, or change how much is reserved for it.

    Args:
        connection: in a transaction that writes; until it ends no other one reserves for this tenant.
        tenant: whose it is.
        name: its id, or what else names it.
        size: bytes that it will have at most.
        most: bytes that the tenant may store.
        lease: of a new reservation that ends with its process; without it, it stays until it is released.

    Raises:
        QuotaUsedUp: when there is less room; nothing is changed then.
    """
    _take_turn(connection, tenant)
    used = usage_of(connection, tenant, name)
    if used.stored + used.reserved + size > most:
        raise QuotaExceeded(
            "storage",
            f"{used.stored} bytes stored, {used.reserved} reserved, {size} more asked for",
            f"at most {most} bytes for a tenant (BENTRAY_MAX_TENANT_BYTES); delete something",
        )
    if connection.execute(update(storage).where(*_one(tenant, name)).values(bytes=size)).rowcount:
        return
    held = {} if lease is None else {"lease_owner": lease.owner, "lease_until": lease.until}
    row = {"tenant": tenant, "name": name, "bytes": size, "reserved": True, **held}
    connection.execute(insert(storage).values(**row))


def grow(connection: Connection, tenant: Tenant, name: str, size: int) -> None:
    """Say that what is on its way takes ``size`` bytes already, where less was reserved for it."""
    mine = *_one(tenant, name), storage.c.reserved, storage.c.bytes < size
    connection.execute(update(storage).where(*mine).values(bytes=size))


def keep(connection: Connection, tenant: Tenant, name: str, otherwise: int) -> None:
    """Say that a thing is stored now and takes what was reserved for it, or ``otherwise`` bytes."""
    if not _settle(connection, tenant, name):
        store(connection, tenant, name, otherwise)


def store(connection: Connection, tenant: Tenant, name: str, size: int) -> None:
    """Say that a thing is stored now and takes ``size`` bytes."""
    _take_turn(connection, tenant)
    if not _settle(connection, tenant, name, bytes=size):
        connection.execute(insert(storage).values(tenant=tenant, name=name, bytes=size, reserved=False))


def release(connection: Connection, tenant: Tenant, name: str) -> None:
    """Give up a reservation; what is stored by now stays."""
    connection.execute(delete(storage).where(*_one(tenant, name), storage.c.reserved))


def forget(connection: Connection, tenant: Tenant, names: Collection[str]) -> None:
    """Say that things are gone, with what was made of them: ``ID.EXTENSION`` goes with ``ID``."""
    parts = [storage.c.name.like(f"{name}.%") for name in names]
    gone = or_(storage.c.name.in_(names), *parts)
    connection.execute(delete(storage).where(storage.c.tenant == tenant, gone))


def correct(connection: Connection, tenant: Tenant, sizes: Mapping[str, int]) -> None:
    """Write down the true sizes of stored things; those that nothing is known of are added."""
    mine = select(storage.c.name, storage.c.bytes, storage.c.reserved).where(storage.c.tenant == tenant)
    known = {row.name: row for row in connection.execute(mine)}
    for name, size in sizes.items():
        if name not in known:
            store(connection, tenant, name, size)
        elif not known[name].reserved and known[name].bytes != size:
            connection.execute(update(storage).where(*_one(tenant, name)).values(bytes=size))


def renew(connection: Connection, lease: Lease) -> None:
    """Let all reservations of a process hold until a later time."""
    mine = storage.c.lease_owner == lease.owner
    connection.execute(update(storage).where(mine).values(lease_until=lease.until))


def drop_expired(connection: Connection) -> None:
    """Remove reservations whose processes died."""
    connection.execute(delete(storage).where(not_(_believed())))


def drop_leased(connection: Connection) -> None:
    """Remove all reservations that belong to a process, where there is no other service."""
    connection.execute(delete(storage).where(storage.c.lease_owner.is_not(None)))


def _settle(connection: Connection, tenant: Tenant, name: str, **values: int) -> bool:
    """Turn a reservation into something stored; whether there was one, or the thing itself."""
    now = {"reserved": False, "lease_owner": None, "lease_until": None}
    return bool(
        connection.execute(update(storage).where(*_one(tenant, name)).values(**now, **values)).rowcount
    )


def _one(tenant: Tenant, name: str) -> tuple[ColumnElement[bool], ColumnElement[bool]]:
    return storage.c.tenant == tenant, storage.c.name == name


def _believed() -> ColumnElement[bool]:
    return or_(storage.c.lease_until.is_(None), storage.c.lease_until >= time.time())


def _take_turn(connection: Connection, tenant: Tenant) -> None:
    """Wait for whoever else writes for this tenant; SQLite's writers wait for each other from the start."""
    if connection.dialect.name != "sqlite":
        digest = hashlib.sha256(f"storage/{tenant}".encode()).digest()
        connection.execute(select(func.pg_advisory_xact_lock(int.from_bytes(digest[:8], signed=True))))
