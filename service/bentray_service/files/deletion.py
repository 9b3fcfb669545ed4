"""Deletion of stored items with everything derived from them: rows first, then files."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Iterator
from typing import NamedTuple

from sqlalchemy import ColumnElement, Connection, Table, and_, delete, or_, select, update

from ..errors import DatabaseUnavailable, InUse, StorageUnavailable, UnknownId
from ..rows import usage
from ..rows.checksums import delete_checksums
from ..rows.database import Database
from ..rows.ids import checked
from ..rows.schema import (
    ENDED,
    batches,
    datasets,
    deliveries,
    events,
    geometry_fields,
    jobs,
    meshes,
    too_old,
    uploaded_volumes,
    uploads,
    volumes,
)
from ..rows.tenants import Tenant
from .data_folder import Files

log = logging.getLogger("bentray.storage")


class StoredItem(NamedTuple):
    """An item to delete; ``what`` is ``dataset``, ``volume``, ``mesh`` or ``job``."""

    tenant: Tenant
    what: str
    id: str


class Deletion:
    """Deletes datasets, volumes, meshes and jobs of a tenant.

    A dataset is deleted with the simulation that created it, its jobs and their volumes; a volume with its
    job, turntables and exports; a mesh with its jobs and their fields; a job with what it made, except for a
    simulated scan. Meshes of iso-surfaces are kept.

    Open files can still be read. If the service dies in between, files without rows remain; see ``Orphans``.
    """

    def __init__(self, database: Database, files: Files) -> None:
        self._database = database
        self._files = files

    def delete(self, stored: StoredItem) -> None:
        """Delete an item and everything derived from it.

        Raises:
            UnknownId: when the tenant has no such item.
            InUse: when an unfinished job needs it; nothing is deleted.
            StorageUnavailable: when files cannot be deleted now; nothing is deleted.
        """
        name = checked(stored.what, stored.id)
        if fault := self._files.store.fault():
            # Before the write transaction, which must be short.
            raise StorageUnavailable(fault)
        with self._database.write() as connection:
            if not any(_has(connection, table, stored.tenant, name) for table in _TABLES[stored.what]):
                raise UnknownId(stored.what, stored.id)
            gone = _JOBS[stored.what](connection, stored.tenant, name)
            results = set(
                connection.execute(select(volumes.c.id).where(volumes.c.job_id.in_(gone))).scalars()
            )
            gone |= _of(connection, stored.tenant, jobs.c.volume_id.in_(results))
            self._check_finished(connection, stored, gone)
            fields = _fields(connection, stored.tenant, name, gone)
            _forget(connection, stored.tenant, {name, *results}, fields, gone)
            usage.forget(connection, stored.tenant, [name, *results, *fields, *gone])
        try:
            self._files.of(stored.tenant).remove([name, *results, *fields, *gone])
        except (StorageUnavailable, DatabaseUnavailable, OSError) as error:
            log.warning("files of %s remain until they are removed as orphans: %s", stored.id, error)

    def older_than(self, time: float) -> Iterator[StoredItem]:
        """The items of all tenants created before a time, s since 1970."""
        for what, tables in _TABLES.items():
            for table in tables:
                old = _ended_without_result(time) if table is jobs else table.c.created < time
                query = select(table.c.tenant, table.c.id).where(old)
                with self._database.read() as connection:
                    rows = connection.execute(query).all()
                yield from (StoredItem(Tenant(tenant), what, name) for tenant, name in rows)

    def _check_finished(self, connection: Connection, stored: StoredItem, gone: Collection[str]) -> None:
        needing = jobs.c.id.in_(gone), jobs.c.state.not_in(ENDED)
        busy = connection.execute(select(jobs.c.id, jobs.c.state).where(*needing)).first()
        if busy is not None:
            found = f"{stored.id}, needed by {busy.id} ({busy.state})"
            raise InUse(stored.what, found, "an item that no unfinished job needs; cancel the job first")


def _has(connection: Connection, table: Table, tenant: Tenant, name: str) -> bool:
    mine = select(table.c.id).where(table.c.tenant == tenant, table.c.id == name)
    # Locked, so that a concurrent submission of a job waits and finds the row deleted.
    return connection.execute(mine.with_for_update()).first() is not None


def _of(connection: Connection, tenant: Tenant, condition: ColumnElement[bool]) -> set[str]:
    """The ids of the jobs of a tenant that fulfil a condition."""
    return set(connection.execute(select(jobs.c.id).where(jobs.c.tenant == tenant, condition)).scalars())


def _of_dataset(connection: Connection, tenant: Tenant, name: str) -> set[str]:
    made_it = select(datasets.c.job_id).where(datasets.c.id == name)
    return _of(connection, tenant, or_(jobs.c.dataset_id == name, jobs.c.id.in_(made_it)))


def _of_volume(connection: Connection, tenant: Tenant, name: str) -> set[str]:
    made_it = select(volumes.c.job_id).where(volumes.c.id == name)
    return _of(connection, tenant, or_(jobs.c.volume_id == name, jobs.c.id.in_(made_it)))


def _ended_without_result(time: float) -> ColumnElement[bool]:
    """Jobs that ended before a time and are not deleted together with a stored item."""
    read = jobs.c.dataset_id, jobs.c.volume_id, jobs.c.mesh_id
    made = select(datasets.c.id).where(datasets.c.job_id == jobs.c.id).exists()
    return and_(jobs.c.finished < time, *(one.is_(None) for one in read), ~made)


def _fields(connection: Connection, tenant: Tenant, mesh: str, gone: Collection[str]) -> set[str]:
    """The geometry fields to delete with a mesh; a field used by another mesh is assigned to that one."""
    mine = geometry_fields.c.tenant == tenant
    rows = connection.execute(
        select(geometry_fields.c.id).where(
            mine, or_(geometry_fields.c.mesh_id == mesh, geometry_fields.c.job_id.in_(gone))
        )
    )
    going = set()
    for field in rows.scalars().all():
        sharing = jobs.c.tenant == tenant, jobs.c.field_id == field, jobs.c.id.not_in(gone)
        heir = connection.execute(
            select(jobs.c.id, jobs.c.mesh_id).where(*sharing, jobs.c.state == "succeeded").limit(1)
        ).first()
        if heir is None:
            going.add(field)
        else:
            now = {"job_id": heir.id, "mesh_id": heir.mesh_id}
            connection.execute(update(geometry_fields).where(mine, geometry_fields.c.id == field).values(now))
    return going


def _forget(
    connection: Connection,
    tenant: Tenant,
    names: Collection[str],
    fields: Collection[str],
    gone: Collection[str],
) -> None:
    """Delete the rows, those with references first."""
    mine = geometry_fields.c.tenant == tenant, geometry_fields.c.id.in_(fields)
    connection.execute(delete(geometry_fields).where(*mine))
    delete_checksums(connection, tenant, {*names, *fields, *gone})
    connection.execute(delete(too_old).where(too_old.c.tenant == tenant, too_old.c.id.in_(names)))
    for table in (events, deliveries):
        connection.execute(delete(table).where(table.c.job_id.in_(gone)))
    connection.execute(delete(volumes).where(volumes.c.id.in_(names)))
    connection.execute(delete(jobs).where(jobs.c.id.in_(gone)))
    left = select(jobs.c.id).where(jobs.c.batch_id == batches.c.id).exists()
    connection.execute(delete(batches).where(batches.c.tenant == tenant, ~left))
    for table in (datasets, uploaded_volumes, meshes):
        connection.execute(delete(table).where(table.c.id.in_(names)))
    connection.execute(delete(uploads).where(uploads.c.result_id.in_(names), uploads.c.state == "done"))
    connection.execute(update(meshes).where(meshes.c.volume_id.in_(names)).values(volume_id=None))
    connection.execute(update(datasets).where(datasets.c.job_id.in_(gone)).values(job_id=None))


_TABLES = {
    "dataset": (datasets,),
    "volume": (volumes, uploaded_volumes),
    "mesh": (meshes,),
    "job": (jobs,),
}
_JOBS: dict[str, Callable[[Connection, Tenant, str], set[str]]] = {
    "dataset": _of_dataset,
    "volume": _of_volume,
    "mesh": lambda connection, tenant, name: _of(connection, tenant, jobs.c.mesh_id == name),
    "job": lambda connection, tenant, name: {name},
}
