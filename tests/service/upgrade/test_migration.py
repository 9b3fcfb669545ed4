"""Databases of versions 12 and 13 are taken over; afterwards, as new ones, they have the tables of today."""

from contextlib import closing

import pytest
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import MetaData, create_engine, insert, inspect, select, text

from bentray_kernels.errors import InvalidInput
from bentray_service.rows.database import SQLITE_PRAGMAS, engine_of, open_database, version_of
from bentray_service.rows.ids import Tenant
from bentray_service.rows.job_queue import Queue
from bentray_service.rows.jobs import Jobs
from bentray_service.rows.keys import ClaimedTenants
from bentray_service.rows.projects import Projects
from bentray_service.rows.tables import VERSION, About, Base, ClaimedTenantRow


@pytest.fixture(params=["sqlite", "postgresql"])
def address(request, tmp_path):
    """An empty database."""
    if request.param == "sqlite":
        yield f"sqlite:///{tmp_path / 'empty.sqlite'}"
        return
    server = request.getfixturevalue("postgresql_server")
    made = server.new_database()
    yield made
    server.drop(made)


@pytest.fixture
def old(left, address, tmp_path):
    """The database of an earlier service, with its rows, in either kind of database."""
    source, target = create_engine(f"sqlite:///{tmp_path / 'data/bentray.sqlite'}"), create_engine(address)
    tables = MetaData()
    with source.connect() as reading, target.begin() as writing:
        tables.reflect(reading)
        if target.dialect.name == "sqlite":
            for (statement,) in reading.execute(text("SELECT sql FROM sqlite_master WHERE sql NOT NULL")):
                writing.execute(text(statement))
        else:
            tables.create_all(writing)
        for table in tables.sorted_tables:
            rows = [dict(row) for row in reading.execute(select(table)).mappings()]
            if rows:
                writing.execute(insert(table), rows)
        writing.execute(text("INSERT INTO sessions VALUES (1, 's', 'clinic', 'eve', 'd', '[]', 1, 9e9)"))
        writing.execute(
            text("INSERT INTO storage (tenant, name, bytes, reserved) VALUES ('bob', 'x', 1, false)")
        )
        if target.dialect.name == "postgresql":
            # As if PostgreSQL had given the numbers.
            for name in (table.name for table in tables.sorted_tables if "number" in table.columns):
                last = f"SELECT max(number) FROM {name} HAVING count(*) > 0"
                writing.execute(text(f"SELECT setval(pg_get_serial_sequence('{name}', 'number'), ({last}))"))
    with target.connect() as reading:
        counts = {
            name: reading.execute(text(f"SELECT count(*) FROM {name}")).scalar_one() for name in tables.tables
        }
    source.dispose()
    target.dispose()
    return address, counts


def differences(address):
    """What Alembic would change to make a database that of the models."""
    engine = engine_of(address, ())
    with engine.connect() as connection:
        found = compare_metadata(MigrationContext.configure(connection), Base.metadata)
    engine.dispose()
    return found


def test_a_new_database_has_the_tables_of_the_models(address):
    open_database(address).close()
    assert differences(address) == []
    migrations = Config()
    migrations.set_main_option("script_location", "bentray_service.rows:alembic")
    assert ScriptDirectory.from_config(migrations).get_heads() == [str(VERSION)]


def test_an_earlier_database_is_taken_over(old, left):
    address, before = old
    with closing(open_database(address)) as database:
        with database.read() as session:
            connection = session.connection()
            assert version_of(connection) == str(VERSION)
            for name in set(inspect(connection).get_table_names()) & set(before):
                count = session.execute(text(f"SELECT count(*) FROM {name}")).scalar_one()
                # From version 12, users sign in again.
                ended = name == "sessions" and "claimed_tenants" not in before
                assert count == (0 if ended else before[name]), name
            about = session.scalars(select(About)).one()
        assert len(about.database) == 32
        assert about.begun == 1
        # A tenant that no key has is that of the first name that had it; a project keeps its items.
        unclaimed = {row.tenant for row in database.rows(select(ClaimedTenantRow))}
        assert unclaimed == ({"bob"} if "claimed_tenants" not in before else set())
        assert (ClaimedTenants(database).tenant("https://id", "sub", "1", "bob") == "bob") == bool(unclaimed)
        project = left["clinic"]["projects"][0]
        assert Projects(database).get(Tenant("clinic"), project["id"], "user:alice").role == "reader"
        Projects(database).add(Tenant("clinic"), project["name"], "user:bob")
        assert Jobs(database).get(Tenant("clinic"), left["clinic"]["done"]).state == "succeeded"
        assert Queue(database).recover({"detail": ""}) == 1
        assert Queue(database).claim().id == left["clinic"]["interrupted"]
    assert differences(address) == []
    # It is opened as it is from now on.
    open_database(address).close()


def test_a_failed_takeover_keeps_the_earlier_database(old, monkeypatch):
    address, _ = old
    engine = engine_of(address, SQLITE_PRAGMAS)
    with engine.connect() as connection:
        version = version_of(connection)

    def stop(*_):
        raise RuntimeError("the power went")

    monkeypatch.setattr("alembic.op.bulk_insert", stop)
    with pytest.raises(RuntimeError, match="power"):
        open_database(address)
    monkeypatch.undo()
    with engine.connect() as connection:
        assert version_of(connection) == version
    engine.dispose()
    open_database(address).close()


def test_a_reference_to_nothing_stops_the_takeover(left, tmp_path):
    engine = create_engine(f"sqlite:///{tmp_path / 'data/bentray.sqlite'}")
    with engine.begin() as connection:
        connection.execute(text("INSERT INTO events VALUES (999, 'job-gone', 1.0, 'queued', '')"))
    engine.dispose()
    with pytest.raises(RuntimeError, match="1 rows with invalid references"):
        open_database(str(engine.url))


def test_a_database_of_before_version_12_is_refused(left, tmp_path):
    engine = create_engine(f"sqlite:///{tmp_path / 'data/bentray.sqlite'}")
    with engine.begin() as connection:
        connection.execute(text("UPDATE about SET version = 11"))
    engine.dispose()
    with pytest.raises(InvalidInput, match=f"schema version 11; accepted: 12 to {VERSION}"):
        open_database(str(engine.url))
