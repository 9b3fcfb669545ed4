"""The database schema, in terms that SQLite and Postgres both take."""

from __future__ import annotations

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
)

VERSION = 2

STATES = ("queued", "running", "cancelling", "succeeded", "failed", "cancelled")
ENDED = ("succeeded", "failed", "cancelled")

metadata = MetaData()

# Times are seconds since 1970 UTC: SQLite has no type for them that keeps the zone.
about = Table(
    "about",
    metadata,
    Column("version", Integer, primary_key=True, autoincrement=False),
    Column("probed", Float, nullable=False),
)

datasets = Table(
    "datasets",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("id", String(32), nullable=False, unique=True),
    Column("created", Float, nullable=False),
    Column("bytes", BigInteger, nullable=False),
    Column("sha256", String(64), nullable=False),
    Column("title", String(200), nullable=False),
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
)

jobs = Table(
    "jobs",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("id", String(32), nullable=False, unique=True),
    Column("kind", String(32), nullable=False),
    # What the job reads: a reconstruction a dataset, a refraction a volume of either table.
    Column("dataset_id", String(32), ForeignKey("datasets.id")),
    Column("volume_id", String(32)),
    Column("settings", JSON, nullable=False),
    Column("state", String(16), nullable=False),
    Column("attempts", Integer, nullable=False, default=0),
    Column("done", Integer, nullable=False, default=0),
    Column("total", Integer, nullable=False, default=0),
    Column("history", JSON, nullable=False, default=list),
    Column("error", JSON(none_as_null=True)),
    Column("created", Float, nullable=False),
    Column("started", Float),
    Column("finished", Float),
    CheckConstraint("state IN ('" + "', '".join(STATES) + "')", name="known_state"),
    Index("jobs_by_state", "state", "number"),
)

# Only ever appended to; the number of a row will be the id of a server-sent event.
events = Table(
    "events",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("job_id", String(32), ForeignKey("jobs.id"), nullable=False, index=True),
    Column("time", Float, nullable=False),
    Column("state", String(16), nullable=False),
    Column("note", String(500), nullable=False, default=""),
)

# Results of reconstructions; what was uploaded is in a table of its own.
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
)

uploaded_volumes = Table(
    "uploaded_volumes",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("id", String(32), nullable=False, unique=True),
    Column("created", Float, nullable=False),
    Column("bytes", BigInteger, nullable=False),
    Column("sha256", String(64), nullable=False),
    Column("title", String(200), nullable=False),
    Column("shape", JSON, nullable=False),
    Column("spacing_m", JSON, nullable=False),
    Column("origin_m", JSON, nullable=False),
    Column("value_range", JSON, nullable=False),
)
