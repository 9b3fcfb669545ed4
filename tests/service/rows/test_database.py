"""The database: durable settings, checked version, plain refusals."""

import threading
from contextlib import closing

import pytest
from sqlalchemy import insert, select, text, update
from sqlalchemy.dialects import postgresql
from sqlalchemy.exc import IntegrityError
from sqlalchemy.schema import CreateTable

from bentray_kernels.errors import InvalidInput
from bentray_service.rows.database import open_database
from bentray_service.rows.tables import About, Base, EventRow, SchemaVersion


def test_pragmas(tmp_path):
    with (
        closing(open_database(f"sqlite:///{tmp_path / 'db.sqlite'}")) as database,
        database.read() as connection,
    ):
        result = {
            name: connection.execute(text(f"PRAGMA {name}")).scalar()
            for name in ("journal_mode", "synchronous")
        }
    assert result == {"journal_mode": "wal", "synchronous": 2}


def test_foreign_keys_hold(database):
    row = {"job_id": "job-none", "time": 0.0, "state": "queued"}
    with pytest.raises(IntegrityError), database.write() as connection:
        connection.execute(insert(EventRow).values(**row))


def test_a_write_that_fails_leaves_nothing(database):
    def spoil():
        with database.write() as connection:
            connection.execute(update(About).values(probed=-1.0))
            raise RuntimeError("stop")

    with pytest.raises(RuntimeError):
        spoil()
    with database.read() as connection:
        assert connection.execute(select(About.probed)).scalar_one() > 0


def test_a_reader_does_not_wait_for_a_writer(database):
    read = threading.Event()

    def reader():
        with database.read() as connection:
            connection.execute(select(About)).all()
        read.set()

    with database.write() as connection:
        connection.execute(update(About).values(probed=1.0))
        thread = threading.Thread(target=reader)
        thread.start()
        assert read.wait(60.0)
    thread.join()


def test_another_version_is_rejected(address):
    database = open_database(address)
    with database.write() as connection:
        connection.execute(update(SchemaVersion).values(version_num="99"))
    database.close()
    with pytest.raises(InvalidInput, match="schema version 99"):
        open_database(address)


def test_a_file_that_is_no_database(tmp_path):
    (tmp_path / "db.sqlite").write_bytes(b"certainly not a database, " * 100)
    with pytest.raises(InvalidInput, match="not a database"):
        open_database(f"sqlite:///{tmp_path / 'db.sqlite'}")


@pytest.mark.parametrize("address", ["nonsense", "nosuch://x/y", "postgresql://user:secret@127.0.0.1:1/x"])
def test_a_wrong_address_is_rejected_without_its_password(address):
    with pytest.raises(InvalidInput, match=r"^database_url: ") as caught:
        open_database(address)
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize("table", Base.metadata.sorted_tables, ids=lambda table: table.name)
def test_postgres_takes_the_schema(table):
    assert table.name in str(CreateTable(table).compile(dialect=postgresql.dialect()))
