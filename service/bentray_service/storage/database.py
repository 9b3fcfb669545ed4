"""The database connection: how it is opened, brought up to date, and how a read and a write begin."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from sqlalchemy import Connection, Engine, create_engine, event, insert, inspect, select, update
from sqlalchemy.engine import make_url
from sqlalchemy.exc import ArgumentError, NoSuchModuleError, SQLAlchemyError

from bentray_kernels.errors import InvalidInput

from . import schema
from .migration import SQLITE_PRAGMAS, STEPS, migrate

log = logging.getLogger("bentray.storage")

BUSY_SECONDS = 30.0


class Database:
    """One engine and the two ways to use it."""

    def __init__(self, engine: Engine) -> None:
        self._writer = engine
        self._reader = engine.execution_options(bentray_read_only=True)

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """A transaction that only reads; it never waits for a writer."""
        with self._reader.begin() as connection:
            yield connection

    @contextmanager
    def write(self) -> Iterator[Connection]:
        """A transaction that is durable once the block ends without an error."""
        with self._writer.begin() as connection:
            yield connection

    def probe(self) -> None:
        """Write one number, as a proof that writing works; raises what goes wrong."""
        with self.write() as connection:
            connection.execute(update(schema.about).values(probed=time.time()))

    def close(self) -> None:
        self._writer.dispose()


def open_database(address: str) -> Database:
    """Open the database, make its tables where it is new, and change them where an older Bentray made them.

    Raises:
        InvalidInput: when it cannot be opened, or was made by a later version of Bentray.
    """
    shown = address
    try:
        shown = make_url(address).render_as_string(hide_password=True)
        engine = _engine(address, ("foreign_keys=ON",))
        with engine.begin() as connection:
            current = _make_or_check(connection, shown)
        if not current:
            _update(address, shown)
    except (SQLAlchemyError, ArgumentError, NoSuchModuleError, ImportError) as error:
        reason = str(getattr(error, "orig", None) or error).splitlines()[0]
        raise InvalidInput(
            "database_url", f"{shown} ({reason})", "the SQLAlchemy address of a database that can be written"
        ) from error
    return Database(engine)


def _options(address: str) -> dict[str, Any]:
    return (
        {"connect_args": {"timeout": BUSY_SECONDS}}
        if address.startswith("sqlite")
        else {"pool_pre_ping": True}
    )


def _engine(address: str, pragmas: tuple[str, ...]) -> Engine:
    """An engine; ``pragmas`` are for SQLite alone."""

    def configure_sqlite(connection: Any, _record: object) -> None:
        # The driver's own idea of when a transaction begins is switched off; _begin_sqlite says it instead.
        connection.isolation_level = None
        for pragma in ("journal_mode=WAL", "synchronous=FULL", *pragmas):
            connection.execute(f"PRAGMA {pragma}")

    engine = create_engine(address, **_options(address))
    if engine.dialect.name == "sqlite":
        event.listen(engine, "connect", configure_sqlite)
        event.listen(engine, "begin", _begin_sqlite)
    return engine


def _begin_sqlite(connection: Connection) -> None:
    # A transaction that turns from reader to writer half-way fails at once when another one writes.
    # So a writer says so at the start, and waits its turn there.
    read_only = connection.get_execution_options().get("bentray_read_only", False)
    connection.exec_driver_sql("BEGIN" if read_only else "BEGIN IMMEDIATE")


def _make_or_check(connection: Connection, shown: str) -> bool:
    """Make the tables of a new database; whether they are those of this version."""
    if not inspect(connection).has_table(schema.about.name):
        schema.metadata.create_all(connection)
        connection.execute(insert(schema.about).values(version=schema.VERSION, probed=time.time()))
        return True
    found = _version(connection)
    if found != schema.VERSION and found not in STEPS:
        raise InvalidInput(
            "database_url",
            f"{shown} with schema version {found}",
            f"{min(STEPS)} to {schema.VERSION}: use the Bentray that made it, or another database",
        )
    return found == schema.VERSION


def _update(address: str, shown: str) -> None:
    """Change the tables by a connection of its own: SQLite takes the pragmas before a transaction only."""
    engine = _engine(address, SQLITE_PRAGMAS)
    try:
        with engine.begin() as connection:
            found = _version(connection)
            log.warning("%s goes from schema version %d to %d", shown, found, schema.VERSION)
            migrate(connection, found)
    finally:
        engine.dispose()


def _version(connection: Connection) -> int:
    return int(connection.execute(select(schema.about.c.version)).scalar_one())
