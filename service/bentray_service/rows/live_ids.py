"""Ids that are in use: of all stored items, and of inputs and outputs of unfinished jobs."""

from __future__ import annotations

from sqlalchemy import Connection, select

from .database import Database
from .ids import PREFIXES
from .schema import ENDED, datasets, geometry_fields, jobs, meshes, uploaded_volumes, uploads, volumes

# Tenant and id.
Name = tuple[str, str]


class LiveIds:
    """Queries over all tenants, for cleaning up files."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def names(self) -> set[Name]:
        """All ids that may have files, including those of uploads and jobs in progress."""
        with self._database.read() as connection:
            names = self._of_jobs(connection)
            for table in (datasets, uploaded_volumes, volumes, meshes, geometry_fields, jobs):
                rows = connection.execute(select(table.c.tenant, table.c.id))
                names |= {(row.tenant, row.id) for row in rows}
            coming = select(uploads.c.tenant, uploads.c.id)
            names |= {(row.tenant, row.id) for row in connection.execute(coming)}
            coming = select(uploads.c.tenant, uploads.c.result_id).where(uploads.c.state == "reading")
            return names | {(row.tenant, row.result_id) for row in connection.execute(coming)}

    def needed(self) -> set[str]:
        """The ids of inputs and outputs of unfinished jobs."""
        with self._database.read() as connection:
            return {name for _, name in self._of_jobs(connection)}

    def _of_jobs(self, connection: Connection) -> set[Name]:
        reads = jobs.c.dataset_id, jobs.c.volume_id, jobs.c.mesh_id, jobs.c.field_id
        names: set[Name] = set()
        unfinished = select(jobs.c.tenant, jobs.c.id, *reads).where(jobs.c.state.not_in(ENDED))
        for row in connection.execute(unfinished):
            # The result of a job has the id of the job with another prefix.
            own = row.id.removeprefix(PREFIXES["job"])
            made = (prefix + own for prefix in PREFIXES.values())
            names |= {(row.tenant, name) for name in (*row[2:], *made) if name is not None}
        return names
