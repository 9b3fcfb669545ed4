"""What tells one database from all others, for the files that belong to it."""

from __future__ import annotations

import secrets

from sqlalchemy import insert, select

from .database import Database
from .schema import bucket_mark


def mark_of(database: Database) -> str:
    """The mark of a database; made when first asked for."""
    with database.write() as connection:
        found = connection.execute(select(bucket_mark.c.database)).scalar_one_or_none()
        if found is None:
            found = secrets.token_hex(16)
            connection.execute(insert(bucket_mark).values(database=found))
        return str(found)
