"""Ids that are in use: of all stored items, and of inputs and outputs of unfinished jobs."""

from __future__ import annotations

from sqlalchemy import select
from sqlalchemy.orm import Session

from .checksums import STORED
from .database import Database
from .ids import PREFIXES
from .tables import ENDED, JobRow, UploadRow

# Tenant and id.
Name = tuple[str, str]


class LiveIds:
    """Queries over all tenants, for cleaning up files."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def names(self) -> set[Name]:
        """All ids that may have files, including those of uploads and jobs in progress."""
        with self._database.read() as session:
            names = self._of_jobs(session)
            for table in (*STORED, UploadRow):
                names |= {(tenant, name) for tenant, name in session.execute(select(table.tenant, table.id))}
            coming = select(UploadRow.tenant, UploadRow.result_id).where(UploadRow.state == "reading")
            return names | {(row.tenant, row.result_id) for row in session.execute(coming)}

    def needed(self) -> set[str]:
        """The ids of inputs and outputs of unfinished jobs."""
        with self._database.read() as session:
            return {name for _, name in self._of_jobs(session)}

    def _of_jobs(self, session: Session) -> set[Name]:
        reads = JobRow.dataset_id, JobRow.volume_id, JobRow.mesh_id, JobRow.field_id
        names: set[Name] = set()
        unfinished = select(JobRow.tenant, JobRow.id, *reads).where(JobRow.state.not_in(ENDED))
        for row in session.execute(unfinished):
            # The result of a job has the id of the job with another prefix.
            own = row.id.removeprefix(PREFIXES["job"])
            made = (prefix + own for prefix in PREFIXES.values())
            names |= {(row.tenant, name) for name in (*row[2:], *made) if name is not None}
        return names
