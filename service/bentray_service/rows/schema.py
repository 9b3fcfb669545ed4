"""The database schema for SQLite and PostgreSQL."""

from __future__ import annotations

from typing import Any

from sqlalchemy import (
    JSON,
    BigInteger,
    Boolean,
    CheckConstraint,
    Column,
    Float,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    String,
    Table,
    UniqueConstraint,
)

VERSION = 13

STATES = ("queued", "running", "cancelling", "succeeded", "failed", "cancelled")
ENDED = ("succeeded", "failed", "cancelled")
UNFINISHED = ("queued", "running", "cancelling")

metadata = MetaData()


def _tenant() -> Column[str]:
    """The owner; every query of a caller selects by it."""
    return Column("tenant", String(64), nullable=False, server_default="local")


def uploaded_columns() -> list[Column[Any]]:
    """The first columns of a table of uploaded items."""
    return [
        Column("number", Integer, primary_key=True, autoincrement=True),
        Column("id", String(32), nullable=False, unique=True),
        Column("created", Float, nullable=False),
        Column("bytes", BigInteger, nullable=False),
        # Of the uploaded file, or of the file created by a job or from a volume.
        Column("sha256", String(64), nullable=False),
        Column("title", String(200), nullable=False),
    ]


def named_columns() -> list[Column[Any]]:
    """The words of the user about an item; in jobs and datasets."""
    return [
        # In place of the title of a file, or of the default heading of a job.
        Column("name", String(200), nullable=False, server_default=""),
        Column("notes", String(4000), nullable=False, server_default=""),
    ]


# Times are seconds since 1970 UTC: SQLite has no type with a time zone.
about = Table(
    "about",
    metadata,
    Column("version", Integer, primary_key=True, autoincrement=False),
    Column("probed", Float, nullable=False),
    # Total running time of services on this database, s; independent of the system clock.
    Column("observed_s", Float, nullable=False, server_default="0"),
    # Number of service starts on this database; a data folder with a larger number belongs to a later
    # state of it.
    Column("begun", Integer, nullable=False, server_default="0"),
)

datasets = Table(
    "datasets",
    metadata,
    *uploaded_columns(),
    Column("source", String(200), nullable=False),
    Column("license", String(200), nullable=False),
    Column("dimension", Integer, nullable=False),
    Column("elements", Integer, nullable=False),
    Column("ntx", Integer, nullable=False),
    Column("nrx", Integer, nullable=False),
    Column("slices", Integer, nullable=False),
    Column("has_traces", Boolean, nullable=False),
    Column("has_travel_times", Boolean, nullable=False),
    Column("has_truth", Boolean, nullable=False),
    Column("water_speed_mps", Float, nullable=False),
    # Numbers for planning; null for datasets from before version 4.
    Column("counts", JSON(none_as_null=True)),
    # In place of that of the file, °C, by the user; null: as the file states it.
    Column("water_temperature_c", Float),
    # The simulation that created it; not a foreign key, since jobs reference datasets.
    Column("job_id", String(32)),
    # Idempotency key of the correction that created it, and a digest of the request.
    Column("idempotency_key", String(200)),
    Column("request_sha256", String(64)),
    _tenant(),
    *named_columns(),
    Index("datasets_by_tenant", "tenant", "number"),
    Index("datasets_by_key", "tenant", "idempotency_key", unique=True),
)

jobs = Table(
    "jobs",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("id", String(32), nullable=False, unique=True),
    Column("kind", String(32), nullable=False),
    # Input: a reconstruction has a dataset, a refraction a volume of either table, a geometry
    # field a mesh.
    Column("dataset_id", String(32), ForeignKey("datasets.id")),
    Column("volume_id", String(32)),
    Column("mesh_id", String(32)),
    # The geometry field that it creates or reuses.
    Column("field_id", String(32)),
    Column("settings", JSON, nullable=False),
    Column("state", String(16), nullable=False),
    Column("attempts", Integer, nullable=False, default=0),
    Column("done", Integer, nullable=False, default=0),
    Column("total", Integer, nullable=False, default=0),
    # The current phase of a job with several phases.
    Column("phase", String(32)),
    Column("history", JSON, nullable=False, default=list),
    Column("error", JSON(none_as_null=True)),
    # The planned decomposition into tasks, and the choice of ``auto``.
    Column("plan", JSON(none_as_null=True)),
    Column("advice", String(2000)),
    Column("created", Float, nullable=False),
    Column("started", Float),
    Column("finished", Float),
    # Not a foreign key: a batch is deleted with the last of its jobs.
    Column("batch_id", String(32)),
    # Owner, and who of them started it: the id of a key, or the user of a proxy.
    _tenant(),
    *named_columns(),
    Column("started_by", String(200), nullable=False, server_default=""),
    # Address that is called when it ends.
    Column("webhook", String(2000)),
    # Idempotency key of the request, and a digest of the request.
    Column("idempotency_key", String(200)),
    Column("request_sha256", String(64)),
    # The service that runs it, and the end of its lease.
    Column("lease_owner", String(64)),
    Column("lease_until", Float),
    CheckConstraint("state IN ('" + "', '".join(STATES) + "')", name="known_state"),
    Index("jobs_by_state", "state", "number"),
    Index("jobs_by_tenant", "tenant", "state"),
    Index("jobs_by_key", "tenant", "idempotency_key", unique=True),
    Index("jobs_by_age", "tenant", "number"),
    Index("jobs_by_batch", "batch_id"),
)

# Reconstructions of many scans that were started together. State and progress are those of their jobs.
batches = Table(
    "batches",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("id", String(32), nullable=False, unique=True),
    _tenant(),
    Column("name", String(200), nullable=False),
    Column("settings", JSON, nullable=False),
    # Number of jobs at first.
    Column("size", Integer, nullable=False),
    Column("created", Float, nullable=False),
    Column("started_by", String(200), nullable=False),
    Column("idempotency_key", String(200)),
    Column("request_sha256", String(64)),
    Index("batches_by_tenant", "tenant", "number"),
    Index("batches_by_key", "tenant", "idempotency_key", unique=True),
)

# Projects inside a tenant. Their items have the id of the project as tenant.
projects = Table(
    "projects",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("id", String(32), nullable=False, unique=True),
    _tenant(),
    # Not unique, so that nobody learns the names of projects of others.
    Column("name", String(200), nullable=False),
    Column("created", Float, nullable=False),
    Index("projects_by_tenant", "tenant"),
)

project_members = Table(
    "project_members",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("project_id", String(32), ForeignKey("projects.id"), nullable=False),
    # "key:" and the id of a key, or "user:" and the name of a user.
    Column("member", String(210), nullable=False),
    Column("role", String(16), nullable=False),
    Column("created", Float, nullable=False),
    UniqueConstraint("project_id", "member"),
)

# Append-only; the number of a row is the id of a server-sent event. The tenant is that of the job.
events = Table(
    "events",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("job_id", String(32), ForeignKey("jobs.id"), nullable=False, index=True),
    Column("time", Float, nullable=False),
    Column("state", String(16), nullable=False),
    Column("note", String(500), nullable=False, default=""),
)

# Messages to the webhooks of jobs that have ended. A message is sent until its receiver accepts it or its
# attempts are used up; ``log`` has the outcome of each attempt.
deliveries = Table(
    "deliveries",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("id", String(32), nullable=False, unique=True),
    _tenant(),
    Column("job_id", String(32), ForeignKey("jobs.id"), nullable=False, unique=True),
    Column("url", String(2000), nullable=False),
    # As it is sent, byte for byte in UTF-8.
    Column("body", String(2000), nullable=False),
    # waiting, delivered or failed.
    Column("state", String(16), nullable=False),
    Column("attempts", Integer, nullable=False, default=0),
    Column("log", JSON, nullable=False, default=list),
    Column("created", Float, nullable=False),
    # Time of the next attempt, and the end of the attempt under way.
    Column("due", Float, nullable=False),
    Column("lease_until", Float),
    Index("deliveries_by_due", "state", "due"),
)

# Secrets that sign messages to webhooks. They are stored as such, since signing needs them.
webhook_secrets = Table(
    "webhook_secrets",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    _tenant(),
    Column("secret", String(100), nullable=False),
    Column("created", Float, nullable=False),
    # Of a secret that was replaced.
    Column("expires", Float),
    Index("webhook_secrets_by_tenant", "tenant"),
)

# Results of reconstructions; uploaded volumes have their own table.
volumes = Table(
    "volumes",
    metadata,
    Column("id", String(32), primary_key=True),
    Column("job_id", String(32), ForeignKey("jobs.id"), nullable=False, unique=True),
    Column("created", Float, nullable=False),
    Column("bytes", BigInteger, nullable=False),
    Column("axes", String(8), nullable=False),
    Column("shape", JSON, nullable=False),
    Column("spacing_m", JSON, nullable=False),
    Column("origin_m", JSON, nullable=False),
    Column("speed_range_mps", JSON, nullable=False),
    Column("water_speed_mps", Float, nullable=False),
    Column("provenance", JSON, nullable=False),
    _tenant(),
    Index("volumes_by_tenant", "tenant", "created"),
)

uploaded_volumes = Table(
    "uploaded_volumes",
    metadata,
    *uploaded_columns(),
    Column("shape", JSON, nullable=False),
    Column("spacing_m", JSON, nullable=False),
    Column("origin_m", JSON, nullable=False),
    Column("value_range", JSON, nullable=False),
    _tenant(),
    Index("uploaded_volumes_by_tenant", "tenant", "created"),
)

meshes = Table(
    "meshes",
    metadata,
    *uploaded_columns(),
    Column("format", String(16), nullable=False),
    # Source of an iso-surface.
    Column("volume_id", String(32)),
    Column("iso", Float),
    Column("vertices", Integer, nullable=False),
    Column("faces", Integer, nullable=False),
    Column("genus", Integer, nullable=False),
    Column("holes", Integer, nullable=False),
    Column("coloured", Boolean, nullable=False),
    # Numbers of repaired vertices and faces by type of repair.
    Column("repairs", JSON, nullable=False),
    # SHA-256 of vertices, faces and colours; geometry fields are identified by it.
    Column("content", String(64), nullable=False),
    _tenant(),
    Index("meshes_by_tenant", "tenant", "number"),
)

# A field is identified by its content: the same mesh and settings have one field per tenant.
# Fields are not shared between tenants, so that no tenant learns about data of another.
geometry_fields = Table(
    "geometry_fields",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("id", String(32), nullable=False),
    # The first mesh and job.
    Column("mesh_id", String(32), nullable=False),
    Column("job_id", String(32), ForeignKey("jobs.id"), nullable=False),
    Column("created", Float, nullable=False),
    Column("bytes", BigInteger, nullable=False),
    Column("settings", JSON, nullable=False),
    Column("figures", JSON, nullable=False),
    _tenant(),
    UniqueConstraint("tenant", "id"),
    Index("geometry_fields_by_tenant", "tenant", "number"),
)

# Resumable uploads. The offset is the size of the file.
uploads = Table(
    "uploads",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("id", String(32), nullable=False, unique=True),
    # Type of the result, and its id.
    Column("what", String(16), nullable=False),
    Column("result_id", String(32), nullable=False),
    Column("length", BigInteger, nullable=False),
    # Metadata for the ingest process, and as sent by the client.
    Column("given", JSON, nullable=False),
    Column("metadata", String(4000), nullable=False),
    # DIRECT for an upload to the bucket; null for data that is sent to the service.
    Column("multipart_id", String(1024)),
    # receiving, reading, done, or refused with the problem.
    Column("state", String(16), nullable=False),
    Column("problem", JSON(none_as_null=True)),
    Column("created", Float, nullable=False),
    Column("expires", Float, nullable=False),
    _tenant(),
    Index("uploads_by_state", "state", "number"),
)

# API keys. Only the digest of the secret is stored.
keys = Table(
    "keys",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("id", String(32), nullable=False, unique=True),
    _tenant(),
    Column("name", String(100), nullable=False),
    Column("sha256", String(64), nullable=False),
    Column("scopes", JSON, nullable=False),
    Column("created", Float, nullable=False),
    Column("expires", Float),
    Column("revoked", Float),
    Column("used", Float),
)

# Tenants of claimed names: of users and groups that an OpenID provider or a proxy reports. Without issuer it
# is a tenant of before version 13 that no key has; the first name that had it then keeps it.
claimed_tenants = Table(
    "claimed_tenants",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("tenant", String(64), nullable=False, unique=True),
    Column("issuer", String(500), nullable=False),
    Column("claim", String(200), nullable=False),
    Column("value", String(255), nullable=False),
    UniqueConstraint("issuer", "claim", "value"),
)

# Sessions of browsers whose users signed in at an OpenID provider. Only the digest of the secret is stored.
sessions = Table(
    "sessions",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("id", String(32), nullable=False, unique=True),
    _tenant(),
    Column("who", String(200), nullable=False),
    Column("sha256", String(64), nullable=False, unique=True),
    Column("scopes", JSON, nullable=False),
    Column("created", Float, nullable=False),
    Column("expires", Float, nullable=False),
)

# Sign-ins whose user is at the provider. A row is deleted by the first response.
pending_sign_ins = Table(
    "pending_sign_ins",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("state_sha256", String(64), nullable=False, unique=True),
    Column("browser_sha256", String(64), nullable=False),
    Column("nonce", String(64), nullable=False),
    Column("verifier", String(64), nullable=False),
    # The part of the page to return to.
    Column("address", String(500), nullable=False),
    Column("expires", Float, nullable=False),
)

# The unique id of this database, to match it with a bucket; at most one row.
bucket_mark = Table("bucket_mark", metadata, Column("database", String(32), primary_key=True))

# Checksums of files when they were written, or, for files from before version 4, when they were first read.
# For a folder, of all its files. The id is that of the dataset, volume, mesh, field or turntable job;
# the path is relative to the folder of the tenant.
checksums = Table(
    "checksums",
    metadata,
    Column("tenant", String(64), primary_key=True),
    Column("id", String(32), primary_key=True),
    Column("path", String(100), nullable=False),
    Column("bytes", BigInteger, nullable=False),
    Column("sha256", String(64), nullable=False),
    Column("noted", Float, nullable=False),
    # Whether it was computed when the file was written.
    Column("as_written", Boolean, nullable=False),
    # Since when the content is known to differ.
    Column("damaged", Float),
)

# Expired items, with the observed time (``about.observed_s``) when they were first found expired. They are
# deleted after one further day of observed time.
too_old = Table(
    "too_old",
    metadata,
    Column("tenant", String(64), primary_key=True),
    Column("id", String(32), primary_key=True),
    Column("what", String(16), nullable=False),
    Column("noticed_s", Float, nullable=False),
)

# Bytes stored and reserved by each tenant: an upload has the id of its result, a job its own id, an exported
# volume ``ID.EXTENSION``.
storage = Table(
    "storage",
    metadata,
    Column("tenant", String(64), primary_key=True),
    Column("name", String(64), primary_key=True),
    Column("bytes", BigInteger, nullable=False),
    Column("reserved", Boolean, nullable=False),
    # For a reservation that ends with its process: the process, and the end of its lease.
    Column("lease_owner", String(64)),
    Column("lease_until", Float),
)
