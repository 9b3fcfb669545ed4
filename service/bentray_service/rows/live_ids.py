"""What the database knows of: the ids of everything stored, and of what unfinished jobs need."""

from __future__ import annotations

from sqlalchemy import Connection, select

from .database import Database
from .ids import PREFIXES
from .schema import ENDED, datasets, geometry_fields, jobs, meshes, uploaded_volumes, uploads, volumes

# A tenant and an id.
Name = tuple[str, str]


class LiveIds:
    """Asks for all tenants at once; no caller's request comes here."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def names(self) -> set[Name]:
        """Whatever may rightly lie in a store, with what is about to come there."""
        with self._database.read() as connection:
            found = self._of_jobs(connection)
            for table in (datasets, uploaded_volumes, volumes, meshes, geometry_fields, jobs):
                rows = connection.execute(select(table.c.tenant, table.c.id))
                found |= {(row.tenant, row.id) for row in rows}
            coming = select(uploads.c.tenant, uploads.c.id)
            found |= {(row.tenant, row.id) for row in connection.execute(coming)}
            coming = select(uploads.c.tenant, uploads.c.result_id).where(uploads.c.state == "reading")
            return found | {(row.tenant, row.result_id) for row in connection.execute(coming)}

    def needed(self) -> set[str]:
        """The ids of all that unfinished jobs read or write."""
        with self._database.read() as connection:
            return {name for _, name in self._of_jobs(connection)}

    def _of_jobs(self, connection: Connection) -> set[Name]:
        reads = jobs.c.dataset_id, jobs.c.volume_id, jobs.c.mesh_id, jobs.c.field_id
        found: set[Name] = set()
        unfinished = select(jobs.c.tenant, jobs.c.id, *reads).where(jobs.c.state.not_in(ENDED))
        for row in connection.execute(unfinished):
            # What a job makes is called as the job is, but for what stands in front.
            own = row.id.removeprefix(PREFIXES["job"])
            made = (prefix + own for prefix in PREFIXES.values())
            found |= {(row.tenant, name) for name in (*row[2:], *made) if name is not None}
        return found
