"""The database connection: opening, schema update, transactions, and how many threads may have one."""

import hashlib
import itertools
import json
import logging
import math
import secrets
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from sqlalchemy import (
    Connection,
    CursorResult,
    Engine,
    Select,
    UpdateBase,
    create_engine,
    event,
    exc,
    func,
    inspect,
    select,
    text,
    update,
)
from sqlalchemy.engine import make_url
from sqlalchemy.orm import Session
from sqlalchemy.pool import QueuePool

from bentray_kernels.errors import InvalidInput

from ..errors import DatabaseFull, DatabaseUnavailable
from .tables import VERSION, About, Base, SchemaVersion

log = logging.getLogger("bentray.storage")

# The service answers requests with 40 threads; the rest stays free for requests without the database.
MAX_CONCURRENT = 32
# Longest wait for a place, s.
PLACE_SECONDS = 2.0
# A transaction that takes longer than this marks the database as slow; then fewer threads may wait, s.
SLOW_SECONDS = 2.0
MAX_CONCURRENT_WHEN_SLOW = 8
# Longest wait for another transaction, or for a connection, s.
BUSY_SECONDS = 5.0
# Connections to PostgreSQL kept open, and additional ones under load.
KEPT_CONNECTIONS, MORE_CONNECTIONS = 5, 10

# Shortest interval between two log lines about an unavailable database, s.
SILENCE_SECONDS = 60.0

# Versions of before Alembic that its first revision takes over.
TAKEN_OVER = ("12", "13")
# SQLite rebuilds a table to change a column; references to the old table must not be rewritten meanwhile.
SQLITE_PRAGMAS = ("foreign_keys=OFF", "legacy_alter_table=ON")

# Key of the lock for the migration of a database of PostgreSQL, in which others may have locks.
UPGRADE_LOCK = 0x62656E747261

# Error messages of SQLite and PostgreSQL for a full disk.
FULL = ("database or disk is full", "No space left on device")

Row = TypeVar("Row")


class Admission:
    """Limits the number of threads in database transactions."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._changed = threading.Condition()
        self._numbers = itertools.count()
        # Start time of each running transaction, oldest first.
        self._inside: dict[int, float] = {}

    @contextmanager
    def __call__(self) -> Iterator[None]:
        """Take a place for the duration of the block.

        Raises:
            DatabaseUnavailable: when too many threads hold or wait for a place.
        """
        with self._changed:
            if self._slow() and len(self._inside) >= MAX_CONCURRENT_WHEN_SLOW:
                raise DatabaseUnavailable(f"{len(self._inside)} requests waiting for a slow database")
            if not self._changed.wait_for(lambda: len(self._inside) < MAX_CONCURRENT, PLACE_SECONDS):
                raise DatabaseUnavailable(f"{len(self._inside)} requests waiting for the database")
            number = next(self._numbers)
            self._inside[number] = self._clock()
        try:
            yield
        finally:
            with self._changed:
                del self._inside[number]
                self._changed.notify()

    def _slow(self) -> bool:
        oldest = next(iter(self._inside.values()), None)
        return oldest is not None and self._clock() - oldest > SLOW_SECONDS


class Database:
    """An SQLAlchemy engine with read and write transactions.

    Both raise ``DatabaseUnavailable`` while the database does not answer or is locked by another program, and
    ``DatabaseFull`` when its disk is full. In both cases the write has not happened, except when the
    connection breaks during the commit.
    """

    def __init__(self, engine: Engine) -> None:
        self._writer = engine
        self._reader = engine.execution_options(bentray_read_only=True)
        self._admission = Admission()
        self._logged = -SILENCE_SECONDS

    @contextmanager
    def read(self) -> Iterator[Session]:
        """A read-only transaction; it never waits for a writer. Its rows can be used afterwards."""
        with self._checked(), _session(self._reader) as session:
            yield session

    @contextmanager
    def write(self) -> Iterator[Session]:
        """A transaction that is committed when the block ends without an error."""
        with self._checked(), _session(self._writer) as session:
            yield session

    @contextmanager
    def _checked(self) -> Iterator[None]:
        """Limit the number of threads, and convert errors of the connection to refusals."""
        with self._admission():
            try:
                yield
            except (exc.DBAPIError, exc.TimeoutError) as error:
                refusal = _refusal(error)
                if refusal is None:
                    raise
                # The address of the database is logged, not sent to callers.
                if time.monotonic() - self._logged >= SILENCE_SECONDS:
                    self._logged = time.monotonic()
                    log.warning("the database is unavailable: %s", getattr(error, "orig", None) or error)
                raise refusal from error

    def rows(self, query: Select[Row]) -> list[Row]:
        """The rows of a query for one table, in a transaction of its own."""
        with self.read() as session:
            return list(session.scalars(query))

    def row(self, query: Select[Row]) -> Row | None:
        """The first row of such a query; None without any."""
        with self.read() as session:
            return session.scalar(query)

    def change(self, statement: UpdateBase) -> int:
        """Execute an UPDATE or DELETE in a transaction of its own; returns the number of its rows."""
        with self.write() as session:
            return rows_changed(session, statement)

    def connections(self) -> tuple[int, int]:
        """Connections in use now, and their maximum."""
        pool = self._writer.pool
        if not isinstance(pool, QueuePool):
            return 0, 1
        # No public attribute has the overflow that was asked for.
        overflow = 0 if self._writer.dialect.name == "sqlite" else MORE_CONNECTIONS
        return pool.checkedout(), pool.size() + overflow

    def probe(self) -> None:
        """Write one number to verify that writing works; any error is raised."""
        self.change(update(About).values(probed=time.time()))

    def close(self) -> None:
        self._writer.dispose()


class Repository:
    """Queries of some tables of a database."""

    def __init__(self, database: Database) -> None:
        self._database = database


def open_database(address: str, way_back: str | None = None) -> Database:
    """Open the database, create its tables if it is new, and migrate an older schema.

    Args:
        address: of the database.
        way_back: for a database that must not be new: what is accepted in place of an empty one.

    Raises:
        InvalidInput: when it cannot be opened, belongs to another program, or was created by a later version
            of Bentray.
    """
    accepted = way_back or "the SQLAlchemy address of a database that can be written"
    with named_database(address, accepted) as shown:
        if way_back is not None:
            check_file(address, way_back, "missing", "without content")
        engine = engine_of(address, ("foreign_keys=ON",))
        with engine.begin() as connection:
            current = _make_or_check(connection, shown, way_back)
        if not current:
            _upgrade(address, shown)
    return Database(engine)


@contextmanager
def named_database(address: str, accepted: str) -> Iterator[str]:
    """Yield the address of a database without its password; its errors in the block name it.

    Raises:
        InvalidInput: naming ``database_url`` and what is ``accepted``.
    """
    shown = address
    try:
        shown = make_url(address).render_as_string(hide_password=True)
        yield shown
    except (exc.SQLAlchemyError, ImportError) as error:
        reason = str(getattr(error, "orig", None) or error).splitlines()[0]
        raise InvalidInput("database_url", f"{shown} ({reason})", accepted) from error


def _options(address: str) -> dict[str, Any]:
    if address.startswith("sqlite"):
        waiting: dict[str, Any] = {"connect_args": {"timeout": BUSY_SECONDS}}
        pool = {} if ":memory:" in address else {"pool_size": MAX_CONCURRENT, "max_overflow": 0}
        return {**waiting, **pool}
    return {
        "pool_pre_ping": True,
        "pool_size": KEPT_CONNECTIONS,
        "max_overflow": MORE_CONNECTIONS,
        "pool_timeout": BUSY_SECONDS,
        "connect_args": {"connect_timeout": int(BUSY_SECONDS)},
    }


def _refusal(error: exc.SQLAlchemyError) -> DatabaseUnavailable | DatabaseFull | None:
    """The refusal for an error of the connection or the disk; None for an error of the statement."""
    if isinstance(error, exc.DBAPIError):
        if any(words in str(error.orig) for words in FULL):
            return DatabaseFull()
        if not (error.connection_invalidated or isinstance(error, exc.OperationalError | exc.InterfaceError)):
            return None
        if "locked" in str(error.orig) or "lock timeout" in str(error.orig):
            return DatabaseUnavailable(f"locked by another program for more than {BUSY_SECONDS:g} s")
    return DatabaseUnavailable("no answer")


def engine_of(address: str, pragmas: tuple[str, ...], *, patient: bool = True) -> Engine:
    """Create an engine.

    Args:
        address: of the database.
        pragmas: for SQLite only.
        patient: whether statements have a time limit; PostgreSQL only.
    """

    def configure_sqlite(connection: Any, _record: object) -> None:
        # Transactions are started by _begin_sqlite, not by the driver.
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


@contextmanager
def opened(address: str, pragmas: tuple[str, ...] = (), *, patient: bool = True) -> Iterator[Engine]:
    """An engine as of ``engine_of``; its connections are closed at the end of the block."""
    engine = engine_of(address, pragmas, patient=patient)
    try:
        yield engine
    finally:
        engine.dispose()


def _json(value: Any) -> str:
    """Serialise to JSON; NaN and infinity become null."""
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
    from .postgresql_timeouts import TimeoutConnection

    connection = TimeoutConnection.connect(*words, **how)
    connection.execute(f"SET lock_timeout = '{BUSY_SECONDS:g}s'")
    connection.commit()
    return connection


def _begin_sqlite(connection: Connection) -> None:
    # A read transaction of SQLite that starts to write fails at once when another one writes.
    # Therefore a write transaction takes the lock at its start.
    read_only = connection.get_execution_options().get("bentray_read_only", False)
    connection.exec_driver_sql("BEGIN" if read_only else "BEGIN IMMEDIATE")


def check_file(address: str, accepted: str, absent: str = "which does not exist", empty: str = "") -> None:
    """Reject a file of SQLite that opening would create, in words; an empty one too if there are words."""
    url = make_url(address)
    path = Path(url.database or "")
    if url.get_backend_name() == "sqlite" and not (path.is_file() and (path.stat().st_size or not empty)):
        raise InvalidInput(
            "database_url", f"{path}, {empty if path.exists() and empty else absent}", accepted
        )


def _make_or_check(connection: Connection, shown: str, way_back: str | None) -> bool:
    """Create the tables of a new database; returns whether the schema is current."""
    tables = inspect(connection).get_table_names()
    if About.__tablename__ not in tables:
        # A server may hold the tables of several programs in one database, a file belongs to one.
        others = connection.dialect.name == "sqlite" and tables
        if way_back is not None or others:
            found = f"with tables of another program ({tables[0]})" if tables else "without tables"
            raise InvalidInput("database_url", f"{shown}, {found}", way_back or "a database of its own")
        Base.metadata.create_all(connection, checkfirst=bool(tables))
        with Session(connection) as session, session.begin():
            session.add(SchemaVersion(version_num=str(VERSION)))
            session.add(About(database=new_mark(), probed=time.time()))
        return True
    version = version_of(connection)
    if version != str(VERSION) and version not in TAKEN_OVER:
        raise InvalidInput(
            "database_url",
            f"{shown} with schema version {version}",
            f"{TAKEN_OVER[0]} to {VERSION}: use the Bentray version that created it, or another database",
        )
    return version == str(VERSION)


def _upgrade(address: str, shown: str) -> None:
    """Migrate over a separate connection: SQLite accepts the pragmas only outside of a transaction."""
    from alembic import command
    from alembic.config import Config

    # Migration of a large table may take long.
    with opened(address, SQLITE_PRAGMAS, patient=False) as engine, engine.begin() as connection:
        if connection.dialect.name != "sqlite":
            # Another service may start on it. Write transactions of SQLite are serialised.
            connection.execute(select(func.pg_advisory_xact_lock(UPGRADE_LOCK)))
        log.warning("migrating %s from schema version %s to %d", shown, version_of(connection), VERSION)
        config = Config(attributes={"connection": connection})
        config.set_main_option("script_location", "bentray_service.rows:alembic")
        command.upgrade(config, "head")
        if connection.dialect.name == "sqlite":
            lost = connection.execute(text("PRAGMA foreign_key_check")).all()
            if lost:
                raise RuntimeError(f"{len(lost)} rows with invalid references")


def version_of(connection: Connection) -> str:
    """The version of the tables of a database, which those of before Alembic have in another table."""
    if inspect(connection).has_table(SchemaVersion.__tablename__):
        return connection.execute(select(SchemaVersion.version_num)).scalar_one()
    return str(connection.execute(text("SELECT about.version FROM about")).scalar_one())


def rows_changed(session: Session, statement: UpdateBase) -> int:
    """Execute an UPDATE or DELETE; returns the number of its rows."""
    result = session.execute(statement)
    assert isinstance(result, CursorResult)
    return int(result.rowcount)


def take_lock(session: Session, words: str) -> None:
    """Serialise write transactions with the same words until they end; those of SQLite are anyway."""
    if session.get_bind().dialect.name != "sqlite":
        digest = hashlib.sha256(words.encode()).digest()
        session.execute(select(func.pg_advisory_xact_lock(int.from_bytes(digest[:8], signed=True))))


def new_mark() -> str:
    """A new random id of a database."""
    return secrets.token_hex(16)


def mark_of(database: Database) -> str:
    """The id of a database."""
    with database.read() as session:
        return session.scalars(select(About.database)).one()


@contextmanager
def _session(engine: Engine) -> Iterator[Session]:
    # Statements change no rows in memory: sessions are short, and rows are read anew.
    options = {"synchronize_session": False}
    with Session(engine, expire_on_commit=False, execution_options=options) as session, session.begin():
        # The transaction of the database begins here, not with the first statement.
        session.connection()
        yield session
