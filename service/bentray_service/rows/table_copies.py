"""Copies of all tables between databases, of one moment and of either kind."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy import Connection, func, insert, inspect, select

from bentray_kernels.errors import InvalidInput

from .database import check_file, named_database, opened, version_of
from .tables import VERSION, About, Base

# Rows in memory at once.
BATCH = 500

ACCEPTED = "the database of a service"


@contextmanager
def snapshot(address: str) -> Iterator[Connection]:
    """A view of a database at one moment; it blocks no writer and migrates nothing.

    Raises:
        InvalidInput: when it cannot be read, is empty, or has another schema version.
    """
    check_file(address, ACCEPTED)
    with named_database(address, ACCEPTED) as shown, opened(address, patient=False) as engine:
        reading = engine.execution_options(bentray_read_only=True)
        if engine.dialect.name != "sqlite":
            # A read transaction of SQLite is of one moment anyway.
            reading = reading.execution_options(isolation_level="REPEATABLE READ")
        with reading.begin() as connection:
            if not inspect(connection).has_table(About.__tablename__):
                raise InvalidInput("database_url", f"{shown}, without tables", ACCEPTED)
            version = version_of(connection)
            if version != str(VERSION):
                accepted = f"schema version {VERSION}; use the Bentray version of the service"
                raise InvalidInput("database_url", f"{shown} with schema version {version}", accepted)
            yield connection


def copy_to_file(source: Connection, path: Path) -> None:
    """Write all rows to a new SQLite file; one with this name is replaced."""
    remove_database(path)
    copy_to(source, f"sqlite:///{path}")


def copy_to(source: Connection, address: str) -> None:
    """Copy all rows into a database without tables, in one transaction.

    Args:
        source: of the present schema version.
        address: of the other database.
    """
    with opened(address, ("foreign_keys=ON",), patient=False) as engine, engine.begin() as target:
        Base.metadata.create_all(target)
        _copy_rows(source, target)


def _copy_rows(source: Connection, target: Connection) -> None:
    for table in Base.metadata.sorted_tables:
        rows = source.execute(select(table).execution_options(yield_per=BATCH)).mappings()
        for part in rows.partitions():
            target.execute(insert(table), [dict(row) for row in part])
        number = table.c.get("number")
        if target.dialect.name == "postgresql" and number is not None:
            # The next number that PostgreSQL gives follows those that were copied.
            sequence = func.pg_get_serial_sequence(table.name, number.name)
            last = func.coalesce(func.max(number), 1), func.count(number) > 0
            target.execute(select(func.setval(sequence, *last)))


def has_tables(address: str, besides: str = "") -> bool:
    """Whether a database has tables of a service; one with the id ``besides`` does not count.

    Raises:
        InvalidInput: when it does not answer.
    """
    with (
        named_database(address, "a database that answers"),
        opened(address) as engine,
        engine.begin() as connection,
    ):
        if not inspect(connection).has_table(About.__tablename__):
            return False
        return connection.execute(select(About.database)).scalar_one_or_none() != besides


def remove_database(path: Path) -> None:
    """Remove an SQLite file and those beside it."""
    for suffix in ("", "-wal", "-shm", "-journal"):
        path.with_name(path.name + suffix).unlink(missing_ok=True)
