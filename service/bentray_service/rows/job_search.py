"""Search of the jobs of a tenant by a word in what people gave names to."""

from __future__ import annotations

from typing import Any

from sqlalchemy import ColumnElement, SQLColumnExpression, func, literal, or_, select
from sqlalchemy.orm import aliased

from .tables import DatasetRow, JobRow, MeshRow, ResultVolumeRow, UploadedVolumeRow
from .tenants import Tenant

ESCAPE = "\\"


def matches(tenant: Tenant, words: str) -> ColumnElement[bool]:
    """Whether a job has a text: in id, name, notes or owner, or in the id or title of scan, volume or mesh.

    Letters match in both cases (with SQLite only those of ASCII). Titles of other tenants match nothing.

    Args:
        tenant: owner.
        words: without NUL, which PostgreSQL stores in no text.
    """
    scans = select(DatasetRow.id).where(
        DatasetRow.tenant == tenant, contains(words, DatasetRow.name, DatasetRow.title)
    )
    made_here = select(DatasetRow.job_id).where(DatasetRow.id.in_(scans), DatasetRow.job_id.is_not(None))
    made = aliased(JobRow)
    reconstructed = (
        select(ResultVolumeRow.id)
        .join(made, made.id == ResultVolumeRow.job_id)
        .where(ResultVolumeRow.tenant == tenant, made.dataset_id.in_(scans))
    )
    return or_(
        contains(words, JobRow.id, JobRow.name, JobRow.notes, JobRow.started_by),
        contains(words, JobRow.dataset_id, JobRow.volume_id, JobRow.mesh_id),
        JobRow.dataset_id.in_(scans),
        JobRow.id.in_(made_here),
        JobRow.volume_id.in_(reconstructed),
        JobRow.volume_id.in_(_titled(UploadedVolumeRow, tenant, words)),
        JobRow.mesh_id.in_(_titled(MeshRow, tenant, words)),
    )


def _titled(table: Any, tenant: Tenant, words: str) -> Any:
    return select(table.id).where(table.tenant == tenant, contains(words, table.title))


Text = SQLColumnExpression[str] | SQLColumnExpression[str | None]


def contains(words: str, *columns: Text) -> ColumnElement[bool]:
    """Whether one of the columns contains the words, as they are: no character is a pattern."""
    for special in (ESCAPE, "%", "_"):
        words = words.replace(special, ESCAPE + special)
    # Both sides by the database, whose lower() decides which letters have two cases.
    pattern = func.lower(literal(f"%{words}%"))
    return or_(*(func.lower(column).like(pattern, escape=ESCAPE) for column in columns))
