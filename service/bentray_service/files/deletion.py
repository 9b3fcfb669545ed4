"""Deletion of stored items with everything derived from them: rows first, then files."""

import logging
from collections.abc import Callable, Collection, Iterator

from sqlalchemy import ColumnElement, and_, delete, or_, select, update
from sqlalchemy.orm import Session

from ..errors import DatabaseUnavailable, InUse, StorageUnavailable, UnknownId
from ..rows import usage
from ..rows.ages import StoredItem
from ..rows.checksums import deletion_of
from ..rows.database import Database
from ..rows.ids import Tenant, checked
from ..rows.tables import (
    ENDED,
    BatchRow,
    DatasetRow,
    DeliveryRow,
    EventRow,
    ExpiredRow,
    FieldRow,
    JobRow,
    MeshRow,
    ResultVolumeRow,
    UploadedVolumeRow,
    UploadRow,
)
from .data_folder import Files

log = logging.getLogger("bentray.storage")


Deletable = DatasetRow | ResultVolumeRow | UploadedVolumeRow | MeshRow | JobRow


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
        """Delete a dataset, volume, mesh or job, and everything derived from it.

        Raises:
            UnknownId: when the tenant has no such item.
            InUse: when an unfinished job needs it; nothing is deleted.
            StorageUnavailable: when files cannot be deleted now; nothing is deleted.
        """
        name = checked(stored.what, stored.id)
        if fault := self._files.store.fault():
            # Before the write transaction, which must be short.
            raise StorageUnavailable(fault)
        with self._database.write() as session:
            if not any(_has(session, table, stored.tenant, name) for table in _TABLES[stored.what]):
                raise UnknownId(stored.what, stored.id)
            gone = _of(session, stored.tenant, _JOBS[stored.what](name))
            made = select(ResultVolumeRow.id).where(ResultVolumeRow.job_id.in_(gone))
            results = set(session.scalars(made))
            gone |= _of(session, stored.tenant, JobRow.volume_id.in_(results))
            self._check_finished(session, stored, gone)
            fields = _fields(session, stored.tenant, name, gone)
            _forget(session, stored.tenant, {name, *results}, fields, gone)
            usage.forget(session, stored.tenant, [name, *results, *fields, *gone])
        try:
            self._files.of(stored.tenant).remove([name, *results, *fields, *gone])
        except (StorageUnavailable, DatabaseUnavailable, OSError) as error:
            log.warning("files of %s remain until they are removed as orphans: %s", stored.id, error)

    def older_than(self, time: float) -> Iterator[StoredItem]:
        """The items of all tenants created before a time, s since 1970."""
        for what, tables in _TABLES.items():
            for table in tables:
                old = _ended_without_result(time) if table is JobRow else table.created < time
                query = select(table.tenant, table.id).where(old)
                with self._database.read() as session:
                    rows = session.execute(query).all()
                yield from (StoredItem(tenant, what, name) for tenant, name in rows)

    def _check_finished(self, session: Session, stored: StoredItem, gone: Collection[str]) -> None:
        needing = JobRow.id.in_(gone), JobRow.state.not_in(ENDED)
        busy = session.execute(select(JobRow.id, JobRow.state).where(*needing)).first()
        if busy is not None:
            found = f"{stored.id}, needed by {busy.id} ({busy.state})"
            raise InUse(stored.what, found, "an item that no unfinished job needs; cancel the job first")


def _has(session: Session, table: type[Deletable], tenant: Tenant, name: str) -> bool:
    query = select(table.id).filter_by(tenant=tenant, id=name)
    # Locked, so that a concurrent submission of a job waits and finds the row deleted.
    return session.scalar(query.with_for_update()) is not None


def _of(session: Session, tenant: Tenant, condition: ColumnElement[bool]) -> set[str]:
    """The ids of the jobs of a tenant that fulfil a condition."""
    return set(session.scalars(select(JobRow.id).where(JobRow.tenant == tenant, condition)))


def _made(table: type[DatasetRow | ResultVolumeRow], name: str) -> ColumnElement[bool]:
    """Whether a job has made an item."""
    return JobRow.id.in_(select(table.job_id).where(table.id == name))


def _ended_without_result(time: float) -> ColumnElement[bool]:
    """Jobs that ended before a time and are not deleted together with a stored item."""
    read = JobRow.dataset_id, JobRow.volume_id, JobRow.mesh_id
    made = select(DatasetRow.id).where(DatasetRow.job_id == JobRow.id).exists()
    return and_(JobRow.finished < time, *(one.is_(None) for one in read), ~made)


def _fields(session: Session, tenant: Tenant, mesh: str, gone: Collection[str]) -> set[str]:
    """The geometry fields to delete with a mesh; a field used by another mesh is assigned to that one."""
    mine = FieldRow.tenant == tenant
    query = select(FieldRow.id).where(mine, or_(FieldRow.mesh_id == mesh, FieldRow.job_id.in_(gone)))
    going = set()
    for field in session.scalars(query).all():
        sharing = JobRow.tenant == tenant, JobRow.field_id == field, JobRow.id.not_in(gone)
        heir = session.execute(
            select(JobRow.id, JobRow.mesh_id).where(*sharing, JobRow.state == "succeeded").limit(1)
        ).first()
        if heir is None:
            going.add(field)
        else:
            now = {"job_id": heir.id, "mesh_id": heir.mesh_id}
            session.execute(update(FieldRow).where(mine, FieldRow.id == field).values(now))
    return going


def _forget(
    session: Session,
    tenant: Tenant,
    names: Collection[str],
    fields: Collection[str],
    gone: Collection[str],
) -> None:
    """Delete the rows, those with references first."""
    mine = FieldRow.tenant == tenant, FieldRow.id.in_(fields)
    session.execute(delete(FieldRow).where(*mine))
    session.execute(deletion_of(tenant, {*names, *fields, *gone}))
    session.execute(delete(ExpiredRow).where(ExpiredRow.tenant == tenant, ExpiredRow.id.in_(names)))
    for table in (EventRow, DeliveryRow):
        session.execute(delete(table).where(table.job_id.in_(gone)))
    session.execute(delete(ResultVolumeRow).where(ResultVolumeRow.id.in_(names)))
    session.execute(delete(JobRow).where(JobRow.id.in_(gone)))
    left = select(JobRow.id).where(JobRow.batch_id == BatchRow.id).exists()
    session.execute(delete(BatchRow).where(BatchRow.tenant == tenant, ~left))
    for item in (DatasetRow, UploadedVolumeRow, MeshRow):
        session.execute(delete(item).where(item.id.in_(names)))
    session.execute(delete(UploadRow).where(UploadRow.result_id.in_(names), UploadRow.state == "done"))
    session.execute(update(MeshRow).where(MeshRow.volume_id.in_(names)).values(volume_id=None))
    session.execute(update(DatasetRow).where(DatasetRow.job_id.in_(gone)).values(job_id=None))


_TABLES: dict[str, tuple[type[Deletable], ...]] = {
    "dataset": (DatasetRow,),
    "volume": (ResultVolumeRow, UploadedVolumeRow),
    "mesh": (MeshRow,),
    "job": (JobRow,),
}
# The jobs that are deleted with an item.
_JOBS: dict[str, Callable[[str], ColumnElement[bool]]] = {
    "dataset": lambda name: or_(JobRow.dataset_id == name, _made(DatasetRow, name)),
    "volume": lambda name: or_(JobRow.volume_id == name, _made(ResultVolumeRow, name)),
    "mesh": lambda name: JobRow.mesh_id == name,
    "job": lambda name: JobRow.id == name,
}
