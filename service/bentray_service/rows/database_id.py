"""The unique id of a database, used to match it with a bucket and a data folder."""

from __future__ import annotations

import secrets

from sqlalchemy import insert, select

from .database import Database
from .schema import bucket_mark


def new_mark() -> str:
    """A new random id."""
    return secrets.token_hex(16)


def mark_of(database: Database) -> str:
    """The id of a database, created on first use."""
    with database.write() as connection:
        database_id = connection.execute(select(bucket_mark.c.database)).scalar_one_or_none()
        if database_id is None:
            database_id = new_mark()
            connection.execute(insert(bucket_mark).values(database=database_id))
        return str(database_id)
