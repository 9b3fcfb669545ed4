"""From the schema of an older version to the present one, in one transaction."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from sqlalchemy import Connection, text, update

from . import schema

# SQLite rebuilds a table to change a column; what points at the old table must not follow it meanwhile.
SQLITE_PRAGMAS = ("foreign_keys=OFF", "legacy_alter_table=ON")


def migrate(connection: Connection, found: int) -> None:
    """Bring the tables of version ``found``, a key of ``STEPS`` or a later one, to ``schema.VERSION``.

    Args:
        connection: in a transaction, which the caller ends; with SQLite under ``SQLITE_PRAGMAS``.
        found: the version of the tables.

    Raises:
        RuntimeError: when a row would point at nothing afterwards; nothing has been changed then.
    """
    for version in range(found, schema.VERSION):
        STEPS[version](connection)
    if connection.dialect.name == "sqlite":
        lost: list[Any] = list(connection.execute(text("PRAGMA foreign_key_check")))
        if lost:
            raise RuntimeError(f"{len(lost)} rows would point at nothing")
    connection.execute(update(schema.about).values(version=schema.VERSION))


def _to_2(connection: Connection) -> None:
    """Jobs may read a volume in place of a dataset; uploaded volumes have a table."""
    # Version 2 is the present one. The next version writes down here what these two tables were in it.
    schema.uploaded_volumes.create(connection)
    if connection.dialect.name != "sqlite":
        connection.execute(text("ALTER TABLE jobs ALTER COLUMN dataset_id DROP NOT NULL"))
        connection.execute(text("ALTER TABLE jobs ADD COLUMN volume_id VARCHAR(32)"))
        return
    kept = (
        "number, id, kind, dataset_id, settings, state, attempts, done, total, history, error, created, "
        "started, finished"
    )
    connection.execute(text("DROP INDEX jobs_by_state"))
    connection.execute(text("ALTER TABLE jobs RENAME TO jobs_of_version_1"))
    schema.jobs.create(connection)
    connection.execute(text(f"INSERT INTO jobs ({kept}) SELECT {kept} FROM jobs_of_version_1"))  # noqa: S608
    connection.execute(text("DROP TABLE jobs_of_version_1"))


STEPS: Mapping[int, Callable[[Connection], None]] = MappingProxyType({1: _to_2})
