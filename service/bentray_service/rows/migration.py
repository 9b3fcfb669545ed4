"""Migration of an older schema to the current one, in one transaction."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from sqlalchemy import (
    JSON,
    BigInteger,
    Column,
    Connection,
    Float,
    Index,
    Integer,
    MetaData,
    String,
    Table,
    text,
    update,
)

from . import schema

# SQLite rebuilds a table to change a column; references to the old table must not be rewritten meanwhile.
SQLITE_PRAGMAS = ("foreign_keys=OFF", "legacy_alter_table=ON")

# As created by SQLite.
JOBS_OF_VERSION_2 = """
CREATE TABLE jobs (
    number INTEGER NOT NULL, id VARCHAR(32) NOT NULL, kind VARCHAR(32) NOT NULL, dataset_id VARCHAR(32),
    volume_id VARCHAR(32), settings JSON NOT NULL, state VARCHAR(16) NOT NULL, attempts INTEGER NOT NULL,
    done INTEGER NOT NULL, total INTEGER NOT NULL, history JSON NOT NULL, error JSON, created FLOAT NOT NULL,
    started FLOAT, finished FLOAT,
    PRIMARY KEY (number),
    CONSTRAINT known_state CHECK (
        state IN ('queued', 'running', 'cancelling', 'succeeded', 'failed', 'cancelled')),
    UNIQUE (id), FOREIGN KEY(dataset_id) REFERENCES datasets (id))
"""

STORED_IN_VERSION_3 = ("datasets", "uploaded_volumes", "volumes", "meshes", "geometry_fields")

UPLOADED_VOLUMES_OF_VERSION_2 = Table(
    "uploaded_volumes",
    MetaData(),
    *schema.uploaded_columns(),
    Column("shape", JSON, nullable=False),
    Column("spacing_m", JSON, nullable=False),
    Column("origin_m", JSON, nullable=False),
    Column("value_range", JSON, nullable=False),
)

UPLOADS_OF_VERSION_3 = Table(
    "uploads",
    MetaData(),
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("id", String(32), nullable=False, unique=True),
    Column("what", String(16), nullable=False),
    Column("result_id", String(32), nullable=False),
    Column("length", BigInteger, nullable=False),
    Column("given", JSON, nullable=False),
    Column("metadata", String(4000), nullable=False),
    Column("state", String(16), nullable=False),
    Column("problem", JSON(none_as_null=True)),
    Column("created", Float, nullable=False),
    Column("expires", Float, nullable=False),
    Column("tenant", String(64), nullable=False, server_default="local"),
    Index("uploads_by_state", "state", "number"),
)


def migrate(connection: Connection, found: int) -> None:
    """Migrate the tables from version ``found``, a key of ``STEPS`` or later, to ``rows.schema.VERSION``.

    Args:
        connection: in a transaction of the caller; with SQLite under ``SQLITE_PRAGMAS``.
        found: version of the tables.

    Raises:
        RuntimeError: when a reference would become invalid; the transaction must be rolled back.
    """
    for version in range(found, schema.VERSION):
        STEPS[version](connection)
    if connection.dialect.name == "sqlite":
        lost: list[Any] = list(connection.execute(text("PRAGMA foreign_key_check")))
        if lost:
            raise RuntimeError(f"{len(lost)} rows with invalid references")
    connection.execute(update(schema.about).values(version=schema.VERSION))


def _to_2(connection: Connection) -> None:
    """Version 2: jobs with volumes as inputs; a table of uploaded volumes."""
    UPLOADED_VOLUMES_OF_VERSION_2.create(connection)
    if connection.dialect.name != "sqlite":
        connection.execute(text("ALTER TABLE jobs ALTER COLUMN dataset_id DROP NOT NULL"))
        connection.execute(text("ALTER TABLE jobs ADD COLUMN volume_id VARCHAR(32)"))
        return
    columns = (
        "number, id, kind, dataset_id, settings, state, attempts, done, total, history, error, created, "
        "started, finished"
    )
    connection.execute(text("DROP INDEX jobs_by_state"))
    connection.execute(text("ALTER TABLE jobs RENAME TO jobs_of_version_1"))
    connection.execute(text(JOBS_OF_VERSION_2))
    connection.execute(text("CREATE INDEX jobs_by_state ON jobs (state, number)"))
    connection.execute(text(f"INSERT INTO jobs ({columns}) SELECT {columns} FROM jobs_of_version_1"))  # noqa: S608
    connection.execute(text("DROP TABLE jobs_of_version_1"))


def _to_3(connection: Connection) -> None:
    """Version 3: tenants, leases, meshes, geometry fields, keys and uploads."""
    for table in ("datasets", "uploaded_volumes", "volumes", "jobs"):
        tenant = "tenant VARCHAR(64) NOT NULL DEFAULT 'local'"
        connection.execute(text(f"ALTER TABLE {table} ADD COLUMN {tenant}"))
    for column in (
        "idempotency_key VARCHAR(200)",
        "request_sha256 VARCHAR(64)",
        "lease_owner VARCHAR(64)",
        "lease_until FLOAT",
        "phase VARCHAR(32)",
        "plan JSON",
        "advice VARCHAR(2000)",
        "mesh_id VARCHAR(32)",
        "field_id VARCHAR(32)",
    ):
        connection.execute(text(f"ALTER TABLE jobs ADD COLUMN {column}"))
    connection.execute(text("ALTER TABLE datasets ADD COLUMN job_id VARCHAR(32)"))
    connection.execute(text("CREATE INDEX jobs_by_tenant ON jobs (tenant, state)"))
    connection.execute(text("CREATE UNIQUE INDEX jobs_by_key ON jobs (tenant, idempotency_key)"))
    for name, table, order in (
        ("datasets_by_tenant", "datasets", "number"),
        ("uploaded_volumes_by_tenant", "uploaded_volumes", "created"),
        ("volumes_by_tenant", "volumes", "created"),
        ("jobs_by_age", "jobs", "number"),
    ):
        connection.execute(text(f"CREATE INDEX {name} ON {table} (tenant, {order})"))
    for new in (schema.meshes, schema.geometry_fields, schema.keys, UPLOADS_OF_VERSION_3, schema.bucket_mark):
        new.create(connection)


def _to_4(connection: Connection) -> None:
    """Version 4: checksums, marks of expired items, and storage accounting."""
    connection.execute(text("ALTER TABLE about ADD COLUMN observed_s FLOAT NOT NULL DEFAULT 0"))
    connection.execute(text("ALTER TABLE about ADD COLUMN begun INTEGER NOT NULL DEFAULT 0"))
    connection.execute(text("ALTER TABLE datasets ADD COLUMN counts JSON"))
    for new in (schema.checksums, schema.too_old, schema.storage):
        new.create(connection)
    _count_stored_bytes(connection)


def _to_5(connection: Connection) -> None:
    """Version 5: names and notes of datasets and jobs, and who started a job."""
    for table in ("datasets", "jobs"):
        connection.execute(text(f"ALTER TABLE {table} ADD COLUMN name VARCHAR(200) NOT NULL DEFAULT ''"))
        connection.execute(text(f"ALTER TABLE {table} ADD COLUMN notes VARCHAR(4000) NOT NULL DEFAULT ''"))
    connection.execute(text("ALTER TABLE jobs ADD COLUMN started_by VARCHAR(200) NOT NULL DEFAULT ''"))


def _to_6(connection: Connection) -> None:
    """Version 6: the temperature of the water of a dataset, as the user states it."""
    connection.execute(text("ALTER TABLE datasets ADD COLUMN water_temperature_c FLOAT"))


def _to_7(connection: Connection) -> None:
    """Version 7: sessions of browsers, and sign-ins under way."""
    for new in (schema.sessions, schema.pending_sign_ins):
        new.create(connection)


def _to_8(connection: Connection) -> None:
    """Version 8: batches of jobs."""
    connection.execute(text("ALTER TABLE jobs ADD COLUMN batch_id VARCHAR(32)"))
    connection.execute(text("CREATE INDEX jobs_by_batch ON jobs (batch_id)"))
    schema.batches.create(connection)


def _to_9(connection: Connection) -> None:
    """Version 9: projects and their members."""
    for new in (schema.projects, schema.project_members):
        new.create(connection)


def _to_10(connection: Connection) -> None:
    """Version 10: webhooks of jobs, messages to them, and the secrets that sign these."""
    connection.execute(text("ALTER TABLE jobs ADD COLUMN webhook VARCHAR(2000)"))
    for new in (schema.deliveries, schema.webhook_secrets):
        new.create(connection)


def _to_11(connection: Connection) -> None:
    """Version 11: uploads to the bucket."""
    connection.execute(text("ALTER TABLE uploads ADD COLUMN multipart_id VARCHAR(1024)"))


def _to_12(connection: Connection) -> None:
    """Version 12: idempotency keys of corrected copies of scans."""
    for column in ("idempotency_key VARCHAR(200)", "request_sha256 VARCHAR(64)"):
        connection.execute(text(f"ALTER TABLE datasets ADD COLUMN {column}"))
    connection.execute(text("CREATE UNIQUE INDEX datasets_by_key ON datasets (tenant, idempotency_key)"))


def _to_13(connection: Connection) -> None:
    """Version 13: tenants of claimed names; names of projects are not unique."""
    schema.claimed_tenants.create(connection)
    tables = ("datasets", "jobs", "projects", "volumes", "uploaded_volumes", "meshes", "geometry_fields")
    tenants = " UNION ".join(f"SELECT tenant FROM {table}" for table in (*tables, "uploads", "storage"))  # noqa: S608
    # A key has no claimed name, and the items of a project have its id.
    named = "SELECT tenant FROM keys UNION SELECT id FROM projects UNION SELECT 'local'"
    connection.execute(
        text(
            "INSERT INTO claimed_tenants (tenant, issuer, claim, value) "  # noqa: S608
            f"SELECT tenant, '', '', tenant FROM ({tenants}) AS held WHERE tenant NOT IN ({named})"
        )
    )
    # Users sign in again, and get their tenants.
    connection.execute(text("DELETE FROM sessions"))
    if connection.dialect.name != "sqlite":
        connection.execute(text("ALTER TABLE projects DROP CONSTRAINT IF EXISTS projects_tenant_name_key"))
        connection.execute(text("CREATE INDEX IF NOT EXISTS projects_by_tenant ON projects (tenant)"))
        return
    columns = "number, id, tenant, name, created"
    connection.execute(text("DROP INDEX IF EXISTS projects_by_tenant"))
    connection.execute(text("ALTER TABLE projects RENAME TO projects_of_version_12"))
    schema.projects.create(connection)
    connection.execute(text(f"INSERT INTO projects ({columns}) SELECT {columns} FROM projects_of_version_12"))  # noqa: S608
    connection.execute(text("DROP TABLE projects_of_version_12"))


def _count_stored_bytes(connection: Connection) -> None:
    """Initialise storage accounting from the rows; the service corrects the sizes when it starts."""
    rows = [f"SELECT tenant, id, bytes, false FROM {table}" for table in STORED_IN_VERSION_3]  # noqa: S608
    # A service that died may have stored the result of an upload.
    coming = "state IN ('receiving', 'reading') AND result_id NOT IN (SELECT name FROM storage)"
    rows.append(f"SELECT tenant, result_id, length, true FROM uploads WHERE {coming}")  # noqa: S608
    for query in rows:
        connection.execute(text(f"INSERT INTO storage (tenant, name, bytes, reserved) {query}"))


STEPS: Mapping[int, Callable[[Connection], None]] = MappingProxyType(
    dict(
        enumerate(
            (_to_2, _to_3, _to_4, _to_5, _to_6, _to_7, _to_8, _to_9, _to_10, _to_11, _to_12, _to_13), start=1
        )
    )
)
