"""The rows of the database as typed records; the columns are those of ``rows.schema``."""

from __future__ import annotations

from typing import Any, Literal, NotRequired, TypedDict

from .tenants import Tenant

Plain = dict[str, Any]


class StoredRow(TypedDict):
    """What the rows of all stored things have; times are seconds since 1970."""

    id: str
    tenant: Tenant
    created: float
    bytes: int


class DatasetRow(StoredRow):
    """A scan; ``counts`` is None and ``job_id`` set as in ``rows.schema``."""

    name: str
    notes: str
    number: int
    sha256: str
    title: str
    source: str
    license: str
    dimension: int
    elements: int
    ntx: int
    nrx: int
    slices: int
    has_traces: bool
    has_travel_times: bool
    has_truth: bool
    water_speed_mps: float
    water_temperature_c: float | None
    counts: Plain | None
    job_id: str | None


class VolumeRow(StoredRow):
    """A volume: of a reconstruction (``job_id`` and what follows it) or uploaded (``sha256``)."""

    title: str
    axes: str
    shape: list[int]
    spacing_m: list[float | None]
    origin_m: list[float | None]
    value_range: list[float]
    unit: str
    job_id: NotRequired[str]
    dataset_id: NotRequired[str]
    speed_range_mps: NotRequired[list[float]]
    water_speed_mps: NotRequired[float]
    provenance: NotRequired[dict[str, str]]
    sha256: NotRequired[str]


class MeshRow(StoredRow):
    """A triangle mesh; ``volume_id`` and ``iso`` are those of an iso-surface."""

    number: int
    sha256: str
    title: str
    format: str
    volume_id: str | None
    iso: float | None
    vertices: int
    faces: int
    genus: int
    holes: int
    coloured: bool
    repairs: dict[str, int]
    content: str


class FieldRow(StoredRow):
    """A geometry field, of the mesh and the job that it was first made for."""

    number: int
    mesh_id: str
    job_id: str
    settings: Plain
    figures: Plain


class JobProgress(TypedDict):
    """How far a job is."""

    id: str
    state: str
    done: int
    total: int
    phase: str | None


class JobRow(JobProgress):
    """A job."""

    number: int
    tenant: Tenant
    name: str
    notes: str
    started_by: str
    kind: str
    dataset_id: str | None
    volume_id: str | None
    mesh_id: str | None
    field_id: str | None
    batch_id: str | None
    settings: Plain
    attempts: int
    history: list[Plain]
    error: Plain | None
    plan: Plain | None
    advice: str | None
    created: float
    started: float | None
    finished: float | None
    webhook: str | None
    idempotency_key: str | None
    request_sha256: str | None
    lease_owner: str | None
    lease_until: float | None


class BatchJob(TypedDict):
    """A job of a batch."""

    id: str
    batch_id: str
    dataset_id: str | None
    state: str
    done: int
    total: int
    phase: str | None
    started: float | None
    finished: float | None


class BatchRow(TypedDict):
    """A batch, with state, progress (``fraction``, 0 to 1) and times from its jobs; ``size`` at first."""

    number: int
    id: str
    tenant: Tenant
    name: str
    settings: Plain
    size: int
    created: float
    started_by: str
    state: str
    fraction: float
    counts: dict[str, int]
    jobs: list[BatchJob]
    started: float | None
    finished: float | None


class ProjectRow(TypedDict):
    """A project, with the role of the caller."""

    number: int
    id: str
    tenant: Tenant
    name: str
    created: float
    role: str


class MemberRow(TypedDict):
    """A member of a project."""

    number: int
    project_id: str
    member: str
    role: str
    created: float


class EventRow(TypedDict):
    """A change of state of a job; ``number`` is the id of the server-sent event."""

    number: int
    job_id: str
    time: float
    state: str
    note: str


class DeliveryRow(TypedDict):
    """A message to a webhook."""

    number: int
    id: str
    tenant: Tenant
    job_id: str
    url: str
    body: str
    state: Literal["waiting", "delivered", "failed"]
    attempts: int
    log: list[Plain]
    created: float
    due: float
    lease_until: float | None


class UploadRow(TypedDict):
    """An upload in pieces; ``what`` becomes ``result_id`` of ``length`` bytes."""

    number: int
    id: str
    tenant: Tenant
    what: Literal["dataset", "volume", "mesh"]
    result_id: str
    length: int
    given: Plain
    metadata: str
    multipart_id: str | None
    state: Literal["receiving", "reading", "done", "refused"]
    problem: Plain | None
    created: float
    expires: float


class KeyRow(TypedDict):
    """An API key without its secret."""

    number: int
    id: str
    tenant: Tenant
    name: str
    sha256: str
    scopes: list[str]
    created: float
    expires: float | None
    revoked: float | None
    used: float | None


class SessionRow(TypedDict):
    """A session of a browser without its secret."""

    number: int
    id: str
    tenant: Tenant
    who: str
    sha256: str
    scopes: list[str]
    created: float
    expires: float


class PendingSignInRow(TypedDict):
    """A sign-in whose user is at the provider; ``address`` is the part of the page to return to."""

    number: int
    state_sha256: str
    browser_sha256: str
    nonce: str
    verifier: str
    address: str
    expires: float


class ChecksumRow(TypedDict):
    """The checksum of a stored file, and since when its content is known to differ."""

    tenant: Tenant
    id: str
    path: str
    bytes: int
    sha256: str
    noted: float
    as_written: bool
    damaged: float | None
