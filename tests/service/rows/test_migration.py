"""A database of an older version opens, keeps every row, and is as a new one afterwards."""

import json
import sqlite3

import pytest
from sqlalchemy import create_engine, inspect, select, text
from sqlalchemy.exc import IntegrityError

from bentray_service.rows import migration, schema
from bentray_service.rows.database import open_database
from bentray_service.rows.deliveries import WebhookSecrets
from bentray_service.rows.ids import new_id, volume_of
from bentray_service.rows.job_queue import Queue
from bentray_service.rows.jobs import Jobs
from bentray_service.rows.projects import Projects
from bentray_service.rows.stored_tables import Datasets, Volumes
from bentray_service.rows.tenants import LOCAL, ClaimedTenants, Tenant
from bentray_service.rows.usage import Usage, usage_of

# The tables of version 1, word for word as SQLite kept them.
VERSION_1 = """
CREATE TABLE about (version INTEGER NOT NULL, probed FLOAT NOT NULL, PRIMARY KEY (version));
CREATE TABLE datasets (
    number INTEGER NOT NULL, id VARCHAR(32) NOT NULL, created FLOAT NOT NULL, bytes BIGINT NOT NULL,
    sha256 VARCHAR(64) NOT NULL, title VARCHAR(200) NOT NULL, source VARCHAR(200) NOT NULL,
    license VARCHAR(200) NOT NULL, dimension INTEGER NOT NULL, elements INTEGER NOT NULL,
    ntx INTEGER NOT NULL, nrx INTEGER NOT NULL, slices INTEGER NOT NULL, has_traces BOOLEAN NOT NULL,
    has_travel_times BOOLEAN NOT NULL, has_truth BOOLEAN NOT NULL, water_speed_mps FLOAT NOT NULL,
    PRIMARY KEY (number), UNIQUE (id));
CREATE TABLE jobs (
    number INTEGER NOT NULL, id VARCHAR(32) NOT NULL, kind VARCHAR(32) NOT NULL,
    dataset_id VARCHAR(32) NOT NULL, settings JSON NOT NULL, state VARCHAR(16) NOT NULL,
    attempts INTEGER NOT NULL, done INTEGER NOT NULL, total INTEGER NOT NULL, history JSON NOT NULL,
    error JSON, created FLOAT NOT NULL, started FLOAT, finished FLOAT,
    PRIMARY KEY (number),
    CONSTRAINT known_state CHECK (
        state IN ('queued', 'running', 'cancelling', 'succeeded', 'failed', 'cancelled')),
    UNIQUE (id), FOREIGN KEY(dataset_id) REFERENCES datasets (id));
CREATE INDEX jobs_by_state ON jobs (state, number);
CREATE TABLE events (
    number INTEGER NOT NULL, job_id VARCHAR(32) NOT NULL, time FLOAT NOT NULL, state VARCHAR(16) NOT NULL,
    note VARCHAR(500) NOT NULL, PRIMARY KEY (number), FOREIGN KEY(job_id) REFERENCES jobs (id));
CREATE INDEX ix_events_job_id ON events (job_id);
CREATE TABLE volumes (
    id VARCHAR(32) NOT NULL, job_id VARCHAR(32) NOT NULL, created FLOAT NOT NULL, bytes BIGINT NOT NULL,
    axes VARCHAR(8) NOT NULL, shape JSON NOT NULL, spacing_m JSON NOT NULL, origin_m JSON NOT NULL,
    speed_range_mps JSON NOT NULL, water_speed_mps FLOAT NOT NULL, provenance JSON NOT NULL,
    PRIMARY KEY (id), FOREIGN KEY(job_id) REFERENCES jobs (id), UNIQUE (job_id));
INSERT INTO about VALUES (1, 0.0);
"""
# Of versions 9 to 12; the steps make the tables of today.
PROJECTS = """
DROP INDEX projects_by_tenant;
DROP TABLE projects{cascade};
CREATE TABLE projects (
    number INTEGER NOT NULL, id VARCHAR(32) NOT NULL, tenant VARCHAR(64) DEFAULT 'local' NOT NULL,
    name VARCHAR(200) NOT NULL, created FLOAT NOT NULL,
    PRIMARY KEY (number), UNIQUE (id), UNIQUE (tenant, name));
"""
DATASET, DONE, WAITING = new_id("dataset"), new_id("job"), new_id("job")


@pytest.fixture(params=[*range(1, schema.VERSION)])
def old(request, tmp_path):
    """A database as an older version left it, with a finished and a waiting job."""
    path = tmp_path / "old.sqlite"
    _of_version_1(path)
    if request.param > 1:
        # Only as far as this version.
        engine = create_engine(f"sqlite:///{path}")
        with engine.begin() as connection:
            for pragma in migration.SQLITE_PRAGMAS:
                connection.execute(text(f"PRAGMA {pragma}"))
            for version in range(1, request.param):
                migration.STEPS[version](connection)
            connection.execute(text(f"UPDATE about SET version = {request.param}"))
        engine.dispose()
    if request.param >= 9:
        with sqlite3.connect(path) as connection:
            connection.executescript(PROJECTS.format(cascade=""))
        connection.close()
    return f"sqlite:///{path}"


def _of_version_1(path):
    with sqlite3.connect(path) as connection:
        connection.executescript(VERSION_1)
        connection.execute(
            "INSERT INTO datasets VALUES (1, ?, 1.0, 9, 'f', 'A scan', '', '', 2, 8, 8, 8, 1, 0, 1, 0, 1500)",
            (DATASET,),
        )
        for number, job, state in ((3, DONE, "succeeded"), (7, WAITING, "queued")):
            row = (number, job, DATASET, json.dumps({"nodes": number}), state)
            connection.execute(
                "INSERT INTO jobs VALUES (?, ?, 'reconstruction', ?, ?, ?, 1, 2, 3, '[]', NULL, 5, 6, 7)",
                row,
            )
            connection.execute("INSERT INTO events VALUES (?, ?, 1.0, ?, 'a note')", (number, job, state))
        volume = (volume_of(DONE), DONE, "[8, 8]", "[1, 1]", "[0, 0]", "[1400, 1600]", "{}")
        connection.execute("INSERT INTO volumes VALUES (?, ?, 8.0, 9, 'x,y', ?, ?, ?, ?, 1500.0, ?)", volume)
    connection.close()


def described(database):
    """Columns, keys and indices of every table."""
    with database.read() as connection:
        found = inspect(connection)
        return {
            table: (
                {
                    column["name"]: (str(column["type"]), column["nullable"])
                    for column in found.get_columns(table)
                },
                sorted(str(key["constrained_columns"]) for key in found.get_foreign_keys(table)),
                sorted(str(key["referred_table"]) for key in found.get_foreign_keys(table)),
                sorted(str(index["column_names"]) for index in found.get_indexes(table)),
                sorted(str(one["column_names"]) for one in found.get_unique_constraints(table)),
            )
            for table in found.get_table_names()
        }


@pytest.mark.parametrize("old", [1], indirect=True)
def test_the_old_tables_were_those_of_version_1(old, tmp_path):
    """Guards the fixture: all but what version 2 changed is as in a new database."""
    new = open_database(f"sqlite:///{tmp_path / 'new.sqlite'}")
    expected = described(new)
    new.close()
    with sqlite3.connect(tmp_path / "old.sqlite") as connection:
        names = {row[0] for row in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    connection.close()
    later = {"uploaded_volumes", "meshes", "geometry_fields", "keys", "uploads", "bucket_mark"}
    later |= {"checksums", "too_old", "storage", "sessions", "pending_sign_ins", "batches", "projects"}
    later |= {"project_members", "deliveries", "webhook_secrets", "claimed_tenants"}
    assert names == set(expected) - later


def test_afterwards_it_is_as_a_new_one(old, tmp_path):
    new, opened = open_database(f"sqlite:///{tmp_path / 'new.sqlite'}"), open_database(old)
    assert described(opened) == described(new)
    new.close()
    opened.close()


def test_every_row_is_kept(old):
    for _ in range(2):
        database = open_database(old)
        jobs, volume = Jobs(database), Volumes(database).get(LOCAL, volume_of(DONE))
        assert [row["id"] for row in jobs.newest(LOCAL, 9)] == [WAITING, DONE]
        job = jobs.get(LOCAL, DONE)
        assert (job["number"], job["dataset_id"], job["volume_id"]) == (3, DATASET, None)
        assert (job["settings"], job["done"], job["finished"]) == ({"nodes": 3}, 2, 7.0)
        assert (job["name"], job["notes"], job["started_by"]) == ("", "", "")
        assert Datasets(database).get(LOCAL, DATASET)["title"] == "A scan"
        assert [event["note"] for event in jobs.events(LOCAL, WAITING)] == ["a note"]
        assert (volume["dataset_id"], volume["shape"]) == (DATASET, [8, 8])
        database.close()


def test_a_job_that_waited_is_run(old):
    database = open_database(old)
    queue = Queue(database)
    assert queue.claim()["id"] == WAITING
    assert queue.state(WAITING) == "running"
    database.close()


def test_old_jobs_and_scans_can_be_named(old):
    database = open_database(old)
    assert Jobs(database).describe(LOCAL, DONE, name="The first")["name"] == "The first"
    assert Datasets(database).describe(LOCAL, DATASET, notes="Cold")["notes"] == "Cold"
    database.close()


def test_stored_bytes_count_after_migration(old):
    database = open_database(old)
    with database.read() as connection:
        assert usage_of(connection, LOCAL) == Usage(stored=9 + 9, reserved=0)
    database.close()


def test_keys_hold_afterwards(old):
    database = open_database(old)
    with pytest.raises(IntegrityError), database.write() as connection:
        connection.execute(text("DELETE FROM jobs"))
    database.close()


def test_failed_migration_keeps_the_old_database(old, monkeypatch):
    last = migration.STEPS[schema.VERSION - 1]

    def broken(connection):
        last(connection)
        raise RuntimeError("the power went")

    monkeypatch.setattr(migration, "STEPS", {**migration.STEPS, schema.VERSION - 1: broken})
    with pytest.raises(RuntimeError, match="power"):
        open_database(old)
    monkeypatch.undo()
    database = open_database(old)
    assert Jobs(database).get(LOCAL, DONE)["settings"] == {"nodes": 3}
    database.close()


def test_dangling_reference_stops_the_migration(old, tmp_path):
    with sqlite3.connect(tmp_path / "old.sqlite") as connection:
        connection.execute("INSERT INTO events VALUES (99, 'job-gone', 1.0, 'queued', '')")
    connection.close()
    with pytest.raises(RuntimeError, match="1 rows with invalid references"):
        open_database(old)


@pytest.mark.parametrize("old", [12], indirect=True)
def test_tenants_without_keys_are_those_of_claimed_names(old, tmp_path):
    project = "project-0123456789abcdef0123"
    with sqlite3.connect(tmp_path / "old.sqlite") as connection:
        for number, tenant in enumerate(("alice", "alice", "bob@x", "clinic", project, "local")):
            connection.execute(
                "INSERT INTO storage (tenant, name, bytes, reserved) VALUES (?, ?, 1, 0)",
                (tenant, str(number)),
            )
        connection.execute("INSERT INTO keys VALUES (1, 'k', 'clinic', '', '', '[]', 1, NULL, 1, NULL)")
        connection.execute("INSERT INTO projects VALUES (1, ?, 'lab', 'Trial 7', 1)", (project,))
        connection.execute("INSERT INTO project_members VALUES (1, ?, 'user:alice', 'owner', 1)", (project,))
        connection.execute("INSERT INTO sessions VALUES (1, 's', 'clinic', 'eve', 'd', '[]', 1, 9e9)")
    connection.close()
    opened = open_database(old)
    rows = opened.rows(select(schema.claimed_tenants))
    assert sorted((row["tenant"], row["issuer"]) for row in rows) == [
        ("alice", ""),
        ("bob@x", ""),
        ("lab", ""),
    ]
    assert opened.rows(select(schema.sessions)) == []
    Projects(opened).add(Tenant("lab"), "Trial 7", "user:alice")
    assert [one["role"] for one in Projects(opened).all(Tenant("lab"), "user:alice")] == ["owner", "owner"]
    opened.close()


@pytest.mark.parametrize("version", [6, 12])
def test_a_real_postgres_keeps_its_jobs_and_is_as_a_new_one_afterwards(postgresql_server, version):
    addresses = [postgresql_server.new_database() for _ in range(2)]
    engine = create_engine(addresses[0])
    with engine.begin() as connection:
        connection.exec_driver_sql(VERSION_1.replace("number INTEGER NOT NULL", "number SERIAL NOT NULL"))
        connection.exec_driver_sql(
            "INSERT INTO datasets VALUES"
            " (1, 'ds-x', 1, 9, 'f', '', '', '', 2, 8, 8, 8, 1, false, true, false, 1500);"
            f"INSERT INTO jobs VALUES (1, '{WAITING}', 'reconstruction', 'ds-x', '{{}}', 'queued',"
            " 0, 0, 0, '[]', NULL, 5, NULL, NULL)"
        )
        for step in range(1, version):
            migration.STEPS[step](connection)
        connection.execute(text(f"UPDATE about SET version = {version}"))
        if version == 12:
            projects = PROJECTS.format(cascade=" CASCADE").replace("number INTEGER", "number SERIAL")
            members = "project_members ADD FOREIGN KEY (project_id) REFERENCES projects (id)"
            connection.exec_driver_sql(f"{projects} ALTER TABLE {members}")
        if version == 6:
            # What only the tables of this version hold: an upload under way, and an owner of a job.
            connection.exec_driver_sql(
                "INSERT INTO uploads VALUES (4, 'up-x', 'dataset', 'ds-y', 9, '{}', '', 'receiving', NULL,"
                " 1, 4e9, 'clinic'); UPDATE jobs SET started_by = 'alice', tenant = 'alice';"
                "INSERT INTO keys VALUES (1, 'k', 'clinic', '', '', '[]', 1, NULL, 1, NULL)"
            )
    engine.dispose()
    opened, new = map(open_database, addresses)
    assert described(opened) == described(new)
    job = Queue(opened).claim()
    assert (job["id"], job["webhook"], job["batch_id"]) == (WAITING, None, None)
    if version == 6:
        assert job["started_by"] == "alice"
        assert ClaimedTenants(opened).tenant("https://id.example", "sub", "1", "alice") == "alice"
        assert ClaimedTenants(opened).tenant("https://id.example", "sub", "2", "clinic") != "clinic"
        (upload,) = opened.rows(select(schema.uploads))
        assert (upload["id"], upload["multipart_id"], upload["tenant"]) == ("up-x", None, "clinic")
    # What the new tables are for works in the migrated database.
    project = Projects(opened).add(LOCAL, "Trial 7", "user:alice")
    assert Projects(opened).all(LOCAL, "user:alice") == [project]
    secret = WebhookSecrets(opened).create(LOCAL)
    assert WebhookSecrets(opened).of(LOCAL) == [secret]
    for database, address in zip((opened, new), addresses, strict=True):
        database.close()
        postgresql_server.drop(address)
