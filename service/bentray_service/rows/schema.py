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
    UniqueConstraint,
)

VERSION = 4

STATES = ("queued", "running", "cancelling", "succeeded", "failed", "cancelled")
ENDED = ("succeeded", "failed", "cancelled")

metadata = MetaData()


def _tenant() -> Column[str]:
    """Whose the row is; every query for a caller asks for it."""
    return Column("tenant", String(64), nullable=False, server_default="local")


# Times are seconds since 1970 UTC: SQLite has no type for them that keeps the zone.
about = Table(
    "about",
    metadata,
    Column("version", Integer, primary_key=True, autoincrement=False),
    Column("probed", Float, nullable=False),
    # How long services have been at work on this database, s: no clock that can be set tells it.
    Column("observed_s", Float, nullable=False, server_default="0"),
    # How often a service has begun on this database; a data folder that knows of more belongs to a later
    # state of it than this one.
    Column("begun", Integer, nullable=False, server_default="0"),
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
    # What plans are made of; none of one from before version 4.
    Column("counts", JSON(none_as_null=True)),
    # The simulation that made it; no key, for jobs point at datasets already.
    Column("job_id", String(32)),
    _tenant(),
    Index("datasets_by_tenant", "tenant", "number"),
)

jobs = Table(
    "jobs",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("id", String(32), nullable=False, unique=True),
    Column("kind", String(32), nullable=False),
    # What the job reads: a reconstruction a dataset, a refraction a volume of either table, a geometry
    # field a mesh.
    Column("dataset_id", String(32), ForeignKey("datasets.id")),
    Column("volume_id", String(32)),
    Column("mesh_id", String(32)),
    # The geometry field that it makes, or finds made.
    Column("field_id", String(32)),
    Column("settings", JSON, nullable=False),
    Column("state", String(16), nullable=False),
    Column("attempts", Integer, nullable=False, default=0),
    Column("done", Integer, nullable=False, default=0),
    Column("total", Integer, nullable=False, default=0),
    # What is done of how much, where a job has several such things to do.
    Column("phase", String(32)),
    Column("history", JSON, nullable=False, default=list),
    Column("error", JSON(none_as_null=True)),
    # How a reconstruction was to be cut into tasks, and what ``auto`` chose once it has.
    Column("plan", JSON(none_as_null=True)),
    Column("advice", String(2000)),
    Column("created", Float, nullable=False),
    Column("started", Float),
    Column("finished", Float),
    # Tenants take turns.
    _tenant(),
    # What the client calls the request, so that one sent twice makes one job; and a digest of what was asked.
    Column("idempotency_key", String(200)),
    Column("request_sha256", String(64)),
    # Which service runs it, and until when that may be believed.
    Column("lease_owner", String(64)),
    Column("lease_until", Float),
    CheckConstraint("state IN ('" + "', '".join(STATES) + "')", name="known_state"),
    Index("jobs_by_state", "state", "number"),
    Index("jobs_by_tenant", "tenant", "state"),
    Index("jobs_by_key", "tenant", "idempotency_key", unique=True),
    Index("jobs_by_age", "tenant", "number"),
)

# Only ever appended to; the number of a row is the id of a server-sent event. Their tenant is their job's.
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
    _tenant(),
    Index("volumes_by_tenant", "tenant", "created"),
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
    _tenant(),
    Index("uploaded_volumes_by_tenant", "tenant", "created"),
)

meshes = Table(
    "meshes",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("id", String(32), nullable=False, unique=True),
    Column("created", Float, nullable=False),
    Column("bytes", BigInteger, nullable=False),
    # Of what was uploaded, or of the file that was made of a volume.
    Column("sha256", String(64), nullable=False),
    Column("title", String(200), nullable=False),
    Column("format", String(16), nullable=False),
    # Of an iso-surface.
    Column("volume_id", String(32)),
    Column("iso", Float),
    Column("vertices", Integer, nullable=False),
    Column("faces", Integer, nullable=False),
    Column("genus", Integer, nullable=False),
    Column("holes", Integer, nullable=False),
    Column("coloured", Boolean, nullable=False),
    # How many vertices and faces were mended, by what was done to them.
    Column("repairs", JSON, nullable=False),
    # SHA-256 of vertices, faces and colours: what a geometry field depends on.
    Column("content", String(64), nullable=False),
    _tenant(),
    Index("meshes_by_tenant", "tenant", "number"),
)

# A field is named by its content: the same mesh and settings have one field, however often a tenant asks for
# it. Another tenant has one of its own, and cannot learn that there is another.
geometry_fields = Table(
    "geometry_fields",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("id", String(32), nullable=False),
    # The mesh and the job that it was first made for.
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

# What comes in by pieces. How far one is, the size of its file tells.
uploads = Table(
    "uploads",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("id", String(32), nullable=False, unique=True),
    # What it becomes, and the id that this will have.
    Column("what", String(16), nullable=False),
    Column("result_id", String(32), nullable=False),
    Column("length", BigInteger, nullable=False),
    # What the user says of it: as the ingest process takes it, and as it was sent.
    Column("given", JSON, nullable=False),
    Column("metadata", String(4000), nullable=False),
    # receiving, reading, done or refused, and then why.
    Column("state", String(16), nullable=False),
    Column("problem", JSON(none_as_null=True)),
    Column("created", Float, nullable=False),
    Column("expires", Float, nullable=False),
    _tenant(),
    Index("uploads_by_state", "state", "number"),
)

# What lets a caller in. The secret itself is nowhere: only its digest is.
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

# What tells this database from all others, for the bucket that keeps its files; one row, made when asked for.
bucket_mark = Table("bucket_mark", metadata, Column("database", String(32), primary_key=True))

# What a file held when it was written, or, of one from before version 4, when it was first read. Of a folder
# it is the digest of its files. The id is that of the dataset, the volume, the mesh, the field or the job of
# the turntable; the path begins in the tenant's folder.
checksums = Table(
    "checksums",
    metadata,
    Column("tenant", String(64), primary_key=True),
    Column("id", String(32), primary_key=True),
    Column("path", String(100), nullable=False),
    Column("bytes", BigInteger, nullable=False),
    Column("sha256", String(64), nullable=False),
    Column("noted", Float, nullable=False),
    # Whether it is that of the file as it was written.
    Column("as_written", Boolean, nullable=False),
    # Since when it is known to hold something else.
    Column("damaged", Float),
)

# What is older than it may become, and how much time (``about.observed_s``) had been observed when that was
# first noticed. It goes if it still is a day of such time later.
too_old = Table(
    "too_old",
    metadata,
    Column("tenant", String(64), primary_key=True),
    Column("id", String(32), primary_key=True),
    Column("what", String(16), nullable=False),
    Column("noticed_s", Float, nullable=False),
)

# What each tenant stores, in bytes, and what it has reserved for what is on its way: an upload under the id
# of what it becomes, a job under its own, a volume in another format as ``ID.EXTENSION``.
storage = Table(
    "storage",
    metadata,
    Column("tenant", String(64), primary_key=True),
    Column("name", String(64), primary_key=True),
    Column("bytes", BigInteger, nullable=False),
    Column("reserved", Boolean, nullable=False),
    # Of a reservation that ends with its process: which one, and until when it is believed to live.
    Column("lease_owner", String(64)),
    Column("lease_until", Float),
)
