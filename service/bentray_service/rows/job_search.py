"""Search of the jobs of a tenant by a word in what people gave names to."""

from __future__ import annotations

from typing import Any

from sqlalchemy import ColumnElement, func, literal, or_, select

from .schema import datasets, jobs, meshes, uploaded_volumes, volumes
from .tenants import Tenant

ESCAPE = "\\"


def matches(tenant: Tenant, words: str) -> ColumnElement[bool]:
    """Whether a job has a text: in id, name, notes or owner, or in the id or title of scan, volume or mesh.

    Letters match in both cases (with SQLite only those of ASCII). Titles of other tenants match nothing.

    Args:
        tenant: owner.
        words: without NUL, which PostgreSQL stores in no text.
    """
    scans = select(datasets.c.id).where(
        datasets.c.tenant == tenant, contains(words, datasets.c.name, datasets.c.title)
    )
    made_here = select(datasets.c.job_id).where(datasets.c.id.in_(scans), datasets.c.job_id.is_not(None))
    made = jobs.alias()
    reconstructed = (
        select(volumes.c.id)
        .join(made, made.c.id == volumes.c.job_id)
        .where(volumes.c.tenant == tenant, made.c.dataset_id.in_(scans))
    )
    return or_(
        contains(words, jobs.c.id, jobs.c.name, jobs.c.notes, jobs.c.started_by),
        contains(words, jobs.c.dataset_id, jobs.c.volume_id, jobs.c.mesh_id),
        jobs.c.dataset_id.in_(scans),
        jobs.c.id.in_(made_here),
        jobs.c.volume_id.in_(reconstructed),
        jobs.c.volume_id.in_(_titled(uploaded_volumes, tenant, words)),
        jobs.c.mesh_id.in_(_titled(meshes, tenant, words)),
    )


def _titled(table: Any, tenant: Tenant, words: str) -> Any:
    return select(table.c.id).where(table.c.tenant == tenant, contains(words, table.c.title))


def contains(words: str, *columns: ColumnElement[str]) -> ColumnElement[bool]:
    """Whether one of the columns contains the words, as they are: no character is a pattern."""
    for special in (ESCAPE, "%", "_"):
        words = words.replace(special, ESCAPE + special)
    # Both sides by the database, whose lower() decides which letters have two cases.
    pattern = func.lower(literal(f"%{words}%"))
    return or_(*(func.lower(column).like(pattern, escape=ESCAPE) for column in columns))
