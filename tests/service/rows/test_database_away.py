"""A database that is held, stopped, killed or full is refused in time, and used again once it is back."""

import os
import signal
import subprocess
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager

import pytest
from sqlalchemy import select, text, update

from bentray_service.errors import DatabaseFull, DatabaseUnavailable
from bentray_service.rows import database, postgresql_timeouts
from bentray_service.rows.database import open_database
from bentray_service.rows.ids import LOCAL
from bentray_service.rows.jobs import Jobs, NewJob
from bentray_service.rows.tables import VERSION, About, SchemaVersion

from ..held_database import held

# A request that waits longer than this would be one that hangs.
BOUNDED_S = 200.0


def ask(opened):
    with opened.read() as connection:
        return connection.execute(select(SchemaVersion.version_num)).scalar_one()


@contextmanager
def stopped(server):
    """PostgreSQL with all its processes, that take in what is sent and say nothing."""
    listed = subprocess.run(["pgrep", "-P", str(server.process.pid)], capture_output=True, text=True)
    everything = [server.process.pid, *map(int, listed.stdout.split())]
    for number in everything:
        os.kill(number, signal.SIGSTOP)
    try:
        yield
    finally:
        for number in everything:
            os.kill(number, signal.SIGCONT)


def test_held_by_another_program(tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(database, "BUSY_SECONDS", 0.2)
    with closing(open_database(f"sqlite:///{tmp_path / 'db.sqlite'}")) as opened:
        jobs = Jobs(opened)
        with held(tmp_path / "db.sqlite"):
            for _ in range(3):
                with pytest.raises(DatabaseUnavailable, match="locked by another program"):
                    jobs.add(LOCAL, NewJob("simulation", {}))
            assert jobs.newest(LOCAL, 9) == [], "reading goes on"
        assert jobs.add(LOCAL, NewJob("simulation", {})).state == "queued"
    assert [record.message for record in caplog.records] == [
        "the database is unavailable: database is locked"
    ], "once a minute, not once a request"


def test_few_threads_wait_while_it_is_held(tmp_path, monkeypatch):
    monkeypatch.setattr(database, "BUSY_SECONDS", 2.0)
    monkeypatch.setattr(database, "SLOW_SECONDS", 0.1)
    with closing(open_database(f"sqlite:///{tmp_path / 'db.sqlite'}")) as opened:
        jobs = Jobs(opened)

        def submit(_):
            with pytest.raises(DatabaseUnavailable) as refused:
                jobs.add(LOCAL, NewJob("simulation", {}))
            return refused.value.value

        with held(tmp_path / "db.sqlite"), ThreadPoolExecutor(40) as pool:
            pool.submit(submit, 0)
            time.sleep(0.3)
            found = list(pool.map(submit, range(39)))
    # Beside the first.
    assert sum("locked by another program" in one for one in found) < database.MAX_CONCURRENT_WHEN_SLOW
    assert any("waiting for a slow database" in one for one in found)


def test_a_full_disk(tmp_path):
    with closing(open_database(f"sqlite:///{tmp_path / 'db.sqlite'}")) as opened:
        with opened.read() as connection:
            connection.execute(text("PRAGMA max_page_count = 1"))
        with pytest.raises(DatabaseFull):
            Jobs(opened).add(LOCAL, NewJob("simulation", {"much": "x" * 100_000}))


def test_postgresql_that_is_killed(postgresql_server):
    address = postgresql_server.new_database()
    with closing(open_database(address)) as opened:
        assert ask(opened) == str(VERSION)
        postgresql_server.kill()
        try:
            begun = time.monotonic()
            for _ in range(3):
                with pytest.raises(DatabaseUnavailable) as caught:
                    ask(opened)
                assert str(postgresql_server.port) not in str(caught.value), (
                    "its address is nobody's business"
                )
            assert time.monotonic() - begun < BOUNDED_S
        finally:
            postgresql_server.start()
        assert ask(opened) == str(VERSION)
    postgresql_server.drop(address)


def test_unresponsive_postgresql(postgresql_server, monkeypatch):
    monkeypatch.setattr(database, "BUSY_SECONDS", 2.0)
    monkeypatch.setattr(postgresql_timeouts, "ANSWER_SECONDS", 0.5)
    address = postgresql_server.new_database()
    with closing(open_database(address)) as opened:
        assert ask(opened) == str(VERSION)
        threads = threading.active_count()
        with stopped(postgresql_server), ThreadPoolExecutor(30) as pool:
            begun = time.monotonic()
            asked = [pool.submit(ask, opened) for _ in range(30)]
            ends = [one.exception(timeout=BOUNDED_S) for one in asked]
            assert time.monotonic() - begun < BOUNDED_S
        assert {type(end) for end in ends} == {DatabaseUnavailable}
        assert ask(opened) == str(VERSION)
        assert threading.active_count() <= threads, "nobody still waits"
    postgresql_server.drop(address)


def test_a_row_that_another_holds_on_postgresql(postgresql_server, monkeypatch):
    monkeypatch.setattr(database, "BUSY_SECONDS", 0.2)
    address = postgresql_server.new_database()
    with closing(open_database(address)) as opened, closing(open_database(address)) as other:
        with other.write() as connection:
            connection.execute(update(About).values(probed=1.0))
            with pytest.raises(DatabaseUnavailable, match="locked by another program"):
                opened.probe()
        opened.probe()
    postgresql_server.drop(address)
