"""The tables of the database, for SQLite and PostgreSQL: a class is a table, its instances are rows."""

from collections import Counter
from typing import Annotated, Any, ClassVar, Literal, get_args

from sqlalchemy import (
    JSON,
    BigInteger,
    CheckConstraint,
    Float,
    ForeignKey,
    Index,
    String,
    UniqueConstraint,
    func,
    inspect,
    select,
)
from sqlalchemy.orm import (
    DeclarativeBase,
    Mapped,
    column_property,
    foreign,
    mapped_column,
    query_expression,
    relationship,
)

from .ids import Tenant

# The newest revision of Alembic, in ``alembic/versions``.
VERSION = 14

STATES = ("queued", "running", "cancelling", "succeeded", "failed", "cancelled")
ENDED = ("succeeded", "failed", "cancelled")
UNFINISHED = ("queued", "running", "cancelling")

# Phases that count as progress of a job; the others count by themselves.
COUNTED = (None, "", "reconstructing", "sampling")

Plain = dict[str, Any]

Number = Annotated[int, mapped_column(primary_key=True)]
# What is a reference to another table, or the id of a row.
Id = Annotated[str, mapped_column(String(32))]
UniqueId = Annotated[str, mapped_column(String(32), unique=True)]
Bytes = Annotated[int, mapped_column(BigInteger)]
Sha256 = Annotated[str, mapped_column(String(64))]
Text200 = Annotated[str, mapped_column(String(200))]
# Times are seconds since 1970 UTC: SQLite has no type with a time zone.
Time = float
# The owner; every query of a caller selects by it.
Owner = Annotated[Tenant, mapped_column(String(64), server_default="local")]
# Of a request, and a digest of the request.
IdempotencyKey = Annotated[str | None, mapped_column(String(200))]
RequestSha256 = Annotated[str | None, mapped_column(String(64))]
# In place of the title of a file, or of the default heading of a job.
UserName = Annotated[str, mapped_column(String(200), server_default="")]
UserNotes = Annotated[str, mapped_column(String(4000), server_default="")]
# The process that holds something, and the end of its lease.
LeaseOwner = Annotated[str | None, mapped_column(String(64))]


class Base(DeclarativeBase):
    """Base class of all tables."""

    type_annotation_map: ClassVar[dict[Any, Any]] = {
        # FLOAT in both databases, which has 8 bytes in both.
        float: Float(),
        **dict.fromkeys((Plain, dict[str, int], dict[str, str]), JSON(none_as_null=True)),
        **dict.fromkeys((list[Plain], list[str], list[int]), JSON(none_as_null=True)),
        **dict.fromkeys((list[float], list[float | None]), JSON(none_as_null=True)),
    }

    def values(self) -> Plain:
        """The columns by name."""
        return {name: getattr(self, name) for name in inspect(type(self)).column_attrs.keys()}  # noqa: SIM118 - no dict


class SchemaVersion(Base):
    """The version of the tables in the database, as Alembic stores it."""

    __tablename__ = "alembic_version"

    version_num: Mapped[Id] = mapped_column(primary_key=True)


class About(Base):
    """Facts about the database; one row."""

    __tablename__ = "about"

    # The id of this database, to match it with a bucket or a data folder.
    database: Mapped[Id] = mapped_column(primary_key=True)
    probed: Mapped[Time]
    # Total running time of services on this database, s; independent of the system clock.
    observed_s: Mapped[float] = mapped_column(server_default="0")
    # Number of service starts on this database; a data folder with a larger number belongs to a later state
    # of it.
    begun: Mapped[int] = mapped_column(server_default="0")


class Owned:
    """What a tenant has under an id."""

    number: Mapped[Number]
    id: Mapped[UniqueId]
    tenant: Mapped[Owner]


class Uploaded:
    """The columns of a table of uploaded items, or of files created by a job or from a volume."""

    number: Mapped[Number]
    id: Mapped[UniqueId]
    created: Mapped[Time]
    bytes: Mapped[Bytes]
    # Of the uploaded or created file.
    sha256: Mapped[Sha256]
    title: Mapped[Text200]
    tenant: Mapped[Owner]


class MadeOnce:
    """What a request with an idempotency key makes."""

    # Of a row in an answer: whether an earlier request made it.
    replayed = False


class DatasetRow(MadeOnce, Uploaded, Base):
    """A scan."""

    __tablename__ = "datasets"
    __table_args__ = (
        Index("datasets_by_tenant", "tenant", "number"),
        Index("datasets_by_key", "tenant", "idempotency_key", unique=True),
    )

    name: Mapped[UserName]
    notes: Mapped[UserNotes]
    source: Mapped[Text200]
    license: Mapped[Text200]
    dimension: Mapped[int]
    elements: Mapped[int]
    ntx: Mapped[int]
    nrx: Mapped[int]
    slices: Mapped[int]
    has_traces: Mapped[bool]
    has_travel_times: Mapped[bool]
    has_truth: Mapped[bool]
    water_speed_mps: Mapped[float]
    # Numbers for planning; null for datasets from before version 4.
    counts: Mapped[Plain | None]
    # In place of that of the file, °C, by the user; null: as the file states it.
    water_temperature_c: Mapped[float | None]
    # The simulation that created it; not a foreign key, since jobs reference datasets.
    job_id: Mapped[Id | None]
    # Of the correction that created it.
    idempotency_key: Mapped[IdempotencyKey]
    request_sha256: Mapped[RequestSha256]


class JobRow(MadeOnce, Owned, Base):
    """A job."""

    __tablename__ = "jobs"
    __table_args__ = (
        CheckConstraint("state IN ('" + "', '".join(STATES) + "')", name="known_state"),
        Index("jobs_by_state", "state", "number"),
        Index("jobs_by_tenant", "tenant", "state"),
        Index("jobs_by_key", "tenant", "idempotency_key", unique=True),
        Index("jobs_by_age", "tenant", "number"),
        Index("jobs_by_batch", "batch_id"),
    )

    kind: Mapped[Id]
    # Input: a reconstruction has a dataset, a refraction a volume of either table, a geometry field a mesh.
    dataset_id: Mapped[Id | None] = mapped_column(ForeignKey("datasets.id"))
    volume_id: Mapped[Id | None]
    mesh_id: Mapped[Id | None]
    # The geometry field that it creates or reuses.
    field_id: Mapped[Id | None]
    # Not a foreign key: a batch is deleted with the last of its jobs.
    batch_id: Mapped[Id | None]
    settings: Mapped[Plain]
    state: Mapped[str] = mapped_column(String(16))
    attempts: Mapped[int] = mapped_column(default=0)
    done: Mapped[int] = mapped_column(default=0)
    total: Mapped[int] = mapped_column(default=0)
    # The current phase of a job with several phases.
    phase: Mapped[Id | None]
    history: Mapped[list[Plain]] = mapped_column(default=list)
    error: Mapped[Plain | None]
    # The planned decomposition into tasks, and the choice of ``auto``.
    plan: Mapped[Plain | None]
    advice: Mapped[str | None] = mapped_column(String(2000))
    created: Mapped[Time]
    started: Mapped[Time | None]
    finished: Mapped[Time | None]
    name: Mapped[UserName]
    notes: Mapped[UserNotes]
    # The id of a key, or the user of a proxy.
    started_by: Mapped[UserName]
    # Address that is called when it ends.
    webhook: Mapped[str | None] = mapped_column(String(2000))
    idempotency_key: Mapped[IdempotencyKey]
    request_sha256: Mapped[RequestSha256]
    lease_owner: Mapped[LeaseOwner]
    lease_until: Mapped[Time | None]

    @property
    def fraction(self) -> float:
        """Progress, 0 to 1; what has ended counts as done, whatever its end."""
        if self.state in ENDED:
            return 1.0
        if self.state == "queued" or not self.total or self.phase not in COUNTED:
            return 0.0
        return min(1.0, self.done / self.total)


class BatchRow(MadeOnce, Owned, Base):
    """Reconstructions of many scans that were started together; state and progress are those of the jobs."""

    __tablename__ = "batches"
    __table_args__ = (
        Index("batches_by_tenant", "tenant", "number"),
        Index("batches_by_key", "tenant", "idempotency_key", unique=True),
    )

    name: Mapped[Text200]
    settings: Mapped[Plain]
    # Number of jobs at first.
    size: Mapped[int]
    created: Mapped[Time]
    started_by: Mapped[Text200]
    idempotency_key: Mapped[IdempotencyKey]
    request_sha256: Mapped[RequestSha256]
    # Oldest first.
    jobs: Mapped[list[JobRow]] = relationship(
        primaryjoin=lambda: foreign(JobRow.batch_id) == BatchRow.id,
        order_by=JobRow.number,
        viewonly=True,
        lazy="raise",
    )

    @property
    def counts(self) -> dict[str, int]:
        """Jobs in each state."""
        return dict(Counter(job.state for job in self.jobs))

    @property
    def state(self) -> str:
        """State of the batch: queued until the first job starts, running until the last has ended."""
        counts = Counter(job.state for job in self.jobs)
        if not set(counts) - set(ENDED):
            return next((state for state in ("failed", "cancelled") if counts[state]), "succeeded")
        if counts["cancelling"] and not counts["running"] and not counts["queued"]:
            return "cancelling"
        # Between two of its jobs it does not wait.
        return "queued" if set(counts) == {"queued"} else "running"

    @property
    def fraction(self) -> float:
        """Progress, 0 to 1."""
        return sum(job.fraction for job in self.jobs) / len(self.jobs) if self.jobs else 1.0

    @property
    def started(self) -> float | None:
        """Start of the first job."""
        return min((job.started for job in self.jobs if job.started), default=None)

    @property
    def finished(self) -> float | None:
        """End of the last job, once all have ended."""
        if any(job.state not in ENDED for job in self.jobs):
            return None
        return max((job.finished or 0.0 for job in self.jobs), default=None)


class ProjectRow(Owned, Base):
    """A project inside a tenant; its items have the id of the project as tenant."""

    __tablename__ = "projects"
    __table_args__ = (Index("projects_by_tenant", "tenant"),)

    # Not unique, so that nobody learns the names of projects of others.
    name: Mapped[Text200]
    created: Mapped[Time]
    # Of the member for whom it was read.
    role: Mapped[str] = query_expression()


class MemberRow(Base):
    """A member of a project."""

    __tablename__ = "project_members"
    __table_args__ = (UniqueConstraint("project_id", "member"),)

    number: Mapped[Number]
    project_id: Mapped[Id] = mapped_column(ForeignKey("projects.id"))
    # "key:" and the id of a key, or "user:" and the name of a user.
    member: Mapped[str] = mapped_column(String(210))
    role: Mapped[str] = mapped_column(String(16))
    created: Mapped[Time]


class EventRow(Base):
    """A change of state of a job, never changed itself; ``number`` is the id of the server-sent event."""

    __tablename__ = "events"

    number: Mapped[Number]
    job_id: Mapped[Id] = mapped_column(ForeignKey("jobs.id"), index=True)
    time: Mapped[Time]
    state: Mapped[str] = mapped_column(String(16))
    note: Mapped[str] = mapped_column(String(500), default="")


class DeliveryRow(Owned, Base):
    """A message to the webhook of a job that has ended.

    It is sent until its receiver accepts it or its attempts are used up; ``log`` has the outcome of each.
    """

    __tablename__ = "deliveries"
    __table_args__ = (Index("deliveries_by_due", "state", "due"),)

    job_id: Mapped[UniqueId] = mapped_column(ForeignKey("jobs.id"))
    url: Mapped[str] = mapped_column(String(2000))
    # As it is sent, byte for byte in UTF-8.
    body: Mapped[str] = mapped_column(String(2000))
    state: Mapped[Literal["waiting", "delivered", "failed"]] = mapped_column(String(16))
    attempts: Mapped[int] = mapped_column(default=0)
    log: Mapped[list[Plain]] = mapped_column(default=list)
    created: Mapped[Time]
    # Time of the next attempt, and the end of the attempt under way.
    due: Mapped[Time]
    lease_until: Mapped[Time | None]


class WebhookSecretRow(Base):
    """A secret that signs messages to webhooks; stored as such, since signing needs it."""

    __tablename__ = "webhook_secrets"
    __table_args__ = (Index("webhook_secrets_by_tenant", "tenant"),)

    number: Mapped[Number]
    tenant: Mapped[Owner]
    secret: Mapped[str] = mapped_column(String(100))
    created: Mapped[Time]
    # Of a secret that was replaced.
    expires: Mapped[Time | None]


class ResultVolumeRow(Base):
    """The result of a reconstruction, with the scan and its title."""

    __tablename__ = "volumes"
    __table_args__ = (Index("volumes_by_tenant", "tenant", "created"),)

    unit: ClassVar = "m/s"
    sha256: ClassVar[None] = None

    id: Mapped[Id] = mapped_column(primary_key=True)
    job_id: Mapped[UniqueId] = mapped_column(ForeignKey("jobs.id"))
    tenant: Mapped[Owner]
    created: Mapped[Time]
    bytes: Mapped[Bytes]
    axes: Mapped[str] = mapped_column(String(8))
    shape: Mapped[list[int]]
    spacing_m: Mapped[list[float | None]]
    origin_m: Mapped[list[float | None]]
    speed_range_mps: Mapped[list[float]]
    water_speed_mps: Mapped[float]
    provenance: Mapped[dict[str, str]]
    dataset_id: Mapped[str] = column_property(
        select(JobRow.dataset_id).where(JobRow.id == job_id).correlate_except(JobRow).scalar_subquery()
    )
    title: Mapped[str] = column_property(
        select(func.coalesce(func.nullif(DatasetRow.name, ""), DatasetRow.title))
        .join(JobRow, JobRow.dataset_id == DatasetRow.id)
        .where(JobRow.id == job_id)
        .correlate_except(JobRow, DatasetRow)
        .scalar_subquery()
    )

    @property
    def value_range(self) -> list[float]:
        """Smallest and largest value."""
        return self.speed_range_mps


class UploadedVolumeRow(Uploaded, Base):
    """An uploaded volume."""

    __tablename__ = "uploaded_volumes"
    __table_args__ = (Index("uploaded_volumes_by_tenant", "tenant", "created"),)

    unit: ClassVar = ""
    axes: ClassVar = "x,y,z"
    job_id: ClassVar[None] = None
    dataset_id: ClassVar[None] = None
    speed_range_mps: ClassVar[None] = None
    water_speed_mps: ClassVar[None] = None
    provenance: ClassVar[dict[str, str]] = {}

    shape: Mapped[list[int]]
    spacing_m: Mapped[list[float | None]]
    origin_m: Mapped[list[float | None]]
    value_range: Mapped[list[float]]


VolumeRow = ResultVolumeRow | UploadedVolumeRow


class MeshRow(Uploaded, Base):
    """A triangle mesh."""

    __tablename__ = "meshes"
    __table_args__ = (Index("meshes_by_tenant", "tenant", "number"),)

    format: Mapped[str] = mapped_column(String(16))
    # Source of an iso-surface.
    volume_id: Mapped[Id | None]
    iso: Mapped[float | None]
    vertices: Mapped[int]
    faces: Mapped[int]
    genus: Mapped[int]
    holes: Mapped[int]
    coloured: Mapped[bool]
    # Numbers of repaired vertices and faces by type of repair.
    repairs: Mapped[dict[str, int]]
    # SHA-256 of vertices, faces and colours; geometry fields are identified by it.
    content: Mapped[Sha256]


class FieldRow(Base):
    """A geometry field, identified by its content: the same mesh and settings have one field per tenant.

    Fields are not shared between tenants, so that no tenant learns about data of another.
    """

    __tablename__ = "geometry_fields"
    __table_args__ = (
        UniqueConstraint("tenant", "id"),
        Index("geometry_fields_by_tenant", "tenant", "number"),
    )

    number: Mapped[Number]
    id: Mapped[Id]
    tenant: Mapped[Owner]
    # The first mesh and job.
    mesh_id: Mapped[Id]
    job_id: Mapped[Id] = mapped_column(ForeignKey("jobs.id"))
    created: Mapped[Time]
    bytes: Mapped[Bytes]
    settings: Mapped[Plain]
    figures: Mapped[Plain]


# The tables of stored items.
StoredRow = DatasetRow | ResultVolumeRow | UploadedVolumeRow | MeshRow | FieldRow
# Those whose rows have stored files; the file of a turntable belongs to its job.
WITH_FILES = (*get_args(StoredRow), JobRow)
# The tables of results of jobs, whose rows have the id of the job.
ResultRow = ResultVolumeRow | DatasetRow | FieldRow


class UploadRow(Owned, Base):
    """A resumable upload; its offset is the size of the file."""

    __tablename__ = "uploads"
    __table_args__ = (Index("uploads_by_state", "state", "number"),)

    # Type of the result, and its id.
    what: Mapped[Literal["dataset", "volume", "mesh"]] = mapped_column(String(16))
    result_id: Mapped[Id]
    length: Mapped[Bytes]
    # Metadata for the ingest process.
    given: Mapped[Plain]
    # As sent by the client; ``metadata`` is a name of SQLAlchemy.
    sent_metadata: Mapped[str] = mapped_column("metadata", String(4000))
    # DIRECT for an upload to the bucket; null for data that is sent to the service.
    multipart_id: Mapped[str | None] = mapped_column(String(1024))
    state: Mapped[Literal["receiving", "reading", "done", "refused"]] = mapped_column(String(16))
    # Why it was refused.
    problem: Mapped[Plain | None]
    created: Mapped[Time]
    expires: Mapped[Time]


class KeyRow(Owned, Base):
    """An API key; only the digest of its secret is stored."""

    __tablename__ = "keys"

    name: Mapped[str] = mapped_column(String(100))
    sha256: Mapped[Sha256]
    scopes: Mapped[list[str]]
    created: Mapped[Time]
    expires: Mapped[Time | None]
    revoked: Mapped[Time | None]
    used: Mapped[Time | None]


class ClaimedTenantRow(Base):
    """The tenant of a claimed name: of a user or group that an OpenID provider or a proxy reports.

    Without issuer it is a tenant of before version 13 that no key has; the first name that had it keeps it.
    """

    __tablename__ = "claimed_tenants"
    __table_args__ = (UniqueConstraint("issuer", "claim", "value"),)

    number: Mapped[Number]
    tenant: Mapped[Tenant] = mapped_column(String(64), unique=True)
    issuer: Mapped[str] = mapped_column(String(500))
    claim: Mapped[Text200]
    value: Mapped[str] = mapped_column(String(255))


class SessionRow(Owned, Base):
    """The session of a browser whose user signed in at an OpenID provider; without its secret."""

    __tablename__ = "sessions"

    who: Mapped[Text200]
    sha256: Mapped[Sha256] = mapped_column(unique=True)
    scopes: Mapped[list[str]]
    created: Mapped[Time]
    expires: Mapped[Time]


class PendingSignInRow(Base):
    """A sign-in whose user is at the provider; the first response deletes it."""

    __tablename__ = "pending_sign_ins"

    number: Mapped[Number]
    state_sha256: Mapped[Sha256] = mapped_column(unique=True)
    browser_sha256: Mapped[Sha256]
    nonce: Mapped[Sha256]
    verifier: Mapped[Sha256]
    # The part of the page to return to.
    address: Mapped[str] = mapped_column(String(500))
    expires: Mapped[Time]


class ChecksumRow(Base):
    """The checksum of a file when it was written, or, from before version 4, when it was first read.

    For a folder, of all its files. The id is that of the dataset, volume, mesh, field or turntable job.
    """

    __tablename__ = "checksums"

    tenant: Mapped[Tenant] = mapped_column(String(64), primary_key=True)
    id: Mapped[Id] = mapped_column(primary_key=True)
    # Relative to the folder of the tenant.
    path: Mapped[str] = mapped_column(String(100))
    bytes: Mapped[Bytes]
    sha256: Mapped[Sha256]
    noted: Mapped[Time]
    # Whether it was computed when the file was written.
    as_written: Mapped[bool]
    # Since when the content is known to differ.
    damaged: Mapped[Time | None]


class ExpiredRow(Base):
    """An expired item, deleted after one further day of observed time (``About.observed_s``)."""

    __tablename__ = "too_old"

    tenant: Mapped[Tenant] = mapped_column(String(64), primary_key=True)
    id: Mapped[Id] = mapped_column(primary_key=True)
    what: Mapped[str] = mapped_column(String(16))
    # The observed time when it was first found expired.
    noticed_s: Mapped[float]


class StorageRow(Base):
    """Bytes that a tenant stores or has reserved.

    An upload has the id of its result as name, a job its own id, an exported volume ``ID.EXTENSION``.
    """

    __tablename__ = "storage"

    tenant: Mapped[Tenant] = mapped_column(String(64), primary_key=True)
    name: Mapped[str] = mapped_column(String(64), primary_key=True)
    bytes: Mapped[Bytes]
    reserved: Mapped[bool]
    # For a reservation that ends with its process.
    lease_owner: Mapped[LeaseOwner]
    lease_until: Mapped[Time | None]
