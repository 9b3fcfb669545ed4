"""The database connection: how it is opened, brought up to date, and how a read and a write begin."""

from __future__ import annotations

import json
import logging
import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from sqlalchemy import Connection, Engine, Select, create_engine, event, exc, insert, inspect, select, update
from sqlalchemy.engine import make_url

from bentray_kernels.errors import InvalidInput

from ..refusals import DatabaseFull, DatabaseUnavailable
from . import schema
from .admission import MOST_AT_ONCE, Admission
from .migration import SQLITE_PRAGMAS, STEPS, migrate

log = logging.getLogger("bentray.storage")

# How long a transaction waits for another's to end, or for a connection, s.
BUSY_SECONDS = 5.0
# Connections to PostgreSQL that stay open, and that come on top while many ask.
KEPT_CONNECTIONS, MORE_CONNECTIONS = 5, 10

# How often the log tells that the database cannot be used, s; every refused request would be too often.
SILENCE_SECONDS = 60.0

# How SQLite and PostgreSQL say that there is no space.
FULL = ("database or disk is full", "No space left on device")


class Database:
    """One engine and the two ways to use it.

    Both raise ``DatabaseUnavailable`` while the database does not answer or is held by another program, and
    ``DatabaseFull`` where it has no space; a write has not happened then, unless the connection broke just
    when it was to become durable.
    """

    def __init__(self, engine: Engine) -> None:
        self._writer = engine
        self._reader = engine.execution_options(bentray_read_only=True)
        self._admission = Admission()
        self._said = -SILENCE_SECONDS

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """A transaction that only reads; it never waits for a writer."""
        with self._told(), self._reader.begin() as connection:
            yield connection

    @contextmanager
    def write(self) -> Iterator[Connection]:
        """A transaction that is durable once the block ends without an error."""
        with self._told(), self._writer.begin() as connection:
            yield connection

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Let a thread to the database, and tell what is no fault of its statement as a refusal."""
        with self._admission():
            try:
                yield
            except (exc.DBAPIError, exc.TimeoutError) as error:
                refusal = _refusal(error)
                if refusal is None:
                    raise
                # Callers are not told where the database is.
                if time.monotonic() - self._said >= SILENCE_SECONDS:
                    self._said = time.monotonic()
                    log.warning("the database cannot be used: %s", getattr(error, "orig", None) or error)
                raise refusal from error

    def rows(self, query: Select[Any]) -> list[dict[str, Any]]:
        """The rows that a query gives, in a transaction of its own."""
        with self.read() as connection:
            return [dict(row) for row in connection.execute(query).mappings()]

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
    except (exc.SQLAlchemyError, ImportError) as error:
        reason = str(getattr(error, "orig", None) or error).splitlines()[0]
        raise InvalidInput(
            "database_url", f"{shown} ({reason})", "the SQLAlchemy address of a database that can be written"
        ) from error
    return Database(engine)


def _options(address: str) -> dict[str, Any]:
    if address.startswith("sqlite"):
        waiting: dict[str, Any] = {"connect_args": {"timeout": BUSY_SECONDS}}
        return waiting if ":memory:" in address else {**waiting, "pool_size": MOST_AT_ONCE, "max_overflow": 0}
    return {
        "pool_pre_ping": True,
        "pool_size": KEPT_CONNECTIONS,
        "max_overflow": MORE_CONNECTIONS,
        "pool_timeout": BUSY_SECONDS,
        "connect_args": {"connect_timeout": int(BUSY_SECONDS)},
    }


def _refusal(error: exc.SQLAlchemyError) -> DatabaseUnavailable | DatabaseFull | None:
    """What to tell of an error that says more about the database than about the statement; None of others."""
    if isinstance(error, exc.DBAPIError):
        if any(words in str(error.orig) for words in FULL):
            return DatabaseFull()
        if not (error.connection_invalidated or isinstance(error, exc.OperationalError | exc.InterfaceError)):
            return None
        if "locked" in str(error.orig) or "lock timeout" in str(error.orig):
            return DatabaseUnavailable(f"locked by another program for more than {BUSY_SECONDS:g} s")
    return DatabaseUnavailable("no answer")


def _engine(address: str, pragmas: tuple[str, ...], *, patient: bool = True) -> Engine:
    """An engine.

    Args:
        address: of the database.
        pragmas: for SQLite alone.
        patient: whether it gives up statements that take long; PostgreSQL alone.
    """

    def configure_sqlite(connection: Any, _record: object) -> None:
        # The driver's own idea of when a transaction begins is switched off; _begin_sqlite says it instead.
        connection.isolation_level = None
        for pragma in ("journal_mode=WAL", "synchronous=FULL", *pragmas):
            connection.execute(f"PRAGMA {pragma}")

    engine = create_engine(address, json_serializer=_json, **_options(address))
    if engine.dialect.name == "sqlite":
        event.listen(engine, "connect", configure_sqlite)
        event.listen(engine, "begin", _begin_sqlite)
    elif engine.driver == "psycopg" and patient:
        event.listen(engine, "do_connect", _connect_patiently)
    return engine


def _json(value: Any) -> str:
    """As JSON that every database takes: null for NaN and infinity."""
    try:
        return json.dumps(value, allow_nan=False)
    except ValueError:
        return json.dumps(_finite(value), allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _finite(inside) for name, inside in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inside) for inside in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _connect_patiently(_dialect: object, _record: object, words: list[Any], how: dict[str, Any]) -> Any:
    from .postgresql_patience import TimeoutConnection

    connection = TimeoutConnection.connect(*words, **how)
    connection.execute(f"SET lock_timeout = '{BUSY_SECONDS:g}s'")
    connection.commit()
    return connection


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
    # A large table may take its time.
    engine = _engine(address, SQLITE_PRAGMAS, patient=False)
    try:
        with engine.begin() as connection:
            found = _version(connection)
            log.warning("%s goes from schema version %d to %d", shown, found, schema.VERSION)
            migrate(connection, found)
    finally:
        engine.dispose()


def _version(connection: Connection) -> int:
    return int(connection.execute(select(schema.about.c.version)).scalar_one())
