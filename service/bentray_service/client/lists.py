"""Flows that get records, one or a list, newest first, and pictures; and those of projects."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypeVar, Unpack
from urllib.parse import parse_qsl, urlsplit

from pydantic import BaseModel

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.names import DEFAULT_PICKER, PickerName
from bentray_kernels.requests.ranges import Range

from ..html_tables import RecordList
from ..interactive.picture import Picture
from ..routes.models.batch_records import BatchList, BatchRecord
from ..routes.models.job_records import (
    DatasetList,
    DatasetRecord,
    JobList,
    JobRecord,
    State,
    VolumeList,
    VolumeRecord,
)
from ..routes.models.project_records import (
    MemberList,
    MemberRecord,
    ProjectDetails,
    ProjectList,
    ProjectRecord,
    Role,
)
from ..routes.models.quality_records import QualityRecord
from ..routes.models.surface_records import MeshList, MeshRecord
from ..settings_request import check_setting_names
from .connection import Connection, Flow, RequestStep
from .errors import ClientError

if TYPE_CHECKING:
    from ..interactive.setting_types import RefractionSettings

# Every method of the clients takes the id of a record in its place.
DatasetId: TypeAlias = str | DatasetRecord
JobId: TypeAlias = str | JobRecord
VolumeId: TypeAlias = str | VolumeRecord | JobRecord
BatchId: TypeAlias = str | BatchRecord
ProjectId: TypeAlias = str | ProjectRecord
StoredId: TypeAlias = str | DatasetRecord | VolumeRecord | MeshRecord

Answer = TypeVar("Answer", bound=BaseModel)
JobKind = Literal["reconstruction", "simulation", "refraction", "geometry-field"]

# Records of one request, as the service limits them.
LIMIT = Range(1, 1000)


def id_of(stored: StoredId | JobId | BatchId | ProjectId) -> str:
    """The id of a record, or the id itself."""
    return stored if isinstance(stored, str) else stored.id


def volume_of(stored: VolumeId) -> str:
    """The id of a volume: its own, or that of the result of a job.

    Raises:
        ClientError: for a job without a result.
    """
    if not isinstance(stored, JobRecord):
        return id_of(stored)
    if stored.volume is None or stored.state != "succeeded":
        raise ClientError(f"{stored.id} is {stored.state} and has no volume: wait for it with client.wait")
    return stored.volume


def datasets(
    connection: Connection, limit: int = 100, *, text: str | None = None
) -> Flow[RecordList[DatasetRecord]]:
    """List the newest scans, at most 1000.

    Args:
        limit: largest number of scans.
        text: only scans with this text in id, name, title or notes.
    """
    return (yield from _list(DatasetList, "/v1/datasets", limit, text))


def volumes(connection: Connection, limit: int = 100) -> Flow[RecordList[VolumeRecord]]:
    """List the newest volumes, reconstructed and uploaded, at most 1000."""
    return (yield from _list(VolumeList, "/v1/volumes", limit))


def meshes(connection: Connection, limit: int = 100) -> Flow[RecordList[MeshRecord]]:
    """List the newest meshes, at most 1000."""
    return (yield from _list(MeshList, "/v1/meshes", limit))


def jobs(
    connection: Connection,
    limit: int = 100,
    *,
    state: State | None = None,
    kind: JobKind | None = None,
    text: str | None = None,
) -> Flow[RecordList[JobRecord]]:
    """List the newest jobs.

    Args:
        limit: largest number of jobs; more than 1000 take several requests.
        state, kind: only these.
        text: only jobs with this text in id, name, notes or owner, or in the id or title of scan, volume or
            mesh.
    """
    if limit < 1:
        raise InvalidInput("limit", limit, "a number from 1")
    filters = {"state": state, "kind": kind, "text": text}
    how: dict[str, Any] = {name: value for name, value in filters.items() if value is not None}
    listed: RecordList[JobRecord] = RecordList()
    while True:
        how["limit"] = min(limit - len(listed), int(LIMIT.most))
        page = yield from get(JobList, "/v1/jobs", dict(how))
        listed.extend(page.jobs)
        if page.next is None or len(listed) >= limit:
            return listed
        how |= dict(parse_qsl(urlsplit(page.next).query))


def dataset(connection: Connection, dataset: DatasetId) -> Flow[DatasetRecord]:
    """Get the current record of a scan."""
    return (yield from get(DatasetRecord, f"/v1/datasets/{id_of(dataset)}"))


def job(connection: Connection, job: JobId) -> Flow[JobRecord]:
    """Get the current record of a job."""
    return (yield from get(JobRecord, f"/v1/jobs/{id_of(job)}"))


def volume(connection: Connection, volume: VolumeId) -> Flow[VolumeRecord]:
    """Get the record of a volume, or of the result of a job."""
    return (yield from get(VolumeRecord, f"/v1/volumes/{volume_of(volume)}"))


def quality(
    connection: Connection, dataset: DatasetId, picker: PickerName = DEFAULT_PICKER
) -> Flow[QualityRecord]:
    """Check the quality of a scan on a worker: faulty elements and times, and what is done about each.

    Args:
        dataset: id or record of the scan.
        picker: of first arrivals in traces; ignored for scans with travel times.
    """
    place = f"/v1/datasets/{id_of(dataset)}/quality"
    return (yield from get(QualityRecord, place, {"picker": picker}))


def batch(connection: Connection, batch: BatchId) -> Flow[BatchRecord]:
    """Get the current record of a batch."""
    return (yield from get(BatchRecord, f"/v1/batches/{id_of(batch)}"))


def batches(connection: Connection, limit: int = 100) -> Flow[RecordList[BatchRecord]]:
    """List the newest batches, at most 1000."""
    return (yield from _list(BatchList, "/v1/batches", limit))


def get(model: type[Answer], path: str, params: dict[str, Any] | None = None) -> Flow[Answer]:
    """Get one record."""
    return (yield from answer(model, "GET", path, {"params": params or {}}, repeatable=True))


def answer(
    model: type[Answer],
    method: str,
    path: str,
    options: dict[str, Any] | None = None,
    *,
    repeatable: bool = False,
) -> Flow[Answer]:
    """Send a request, see ``RequestStep``; the result is the record in its response."""
    response = yield RequestStep(method, path, options or {}, repeatable=repeatable)
    return model.model_validate_json(response.content)


def _list(model: type[Answer], path: str, limit: int, text: str | None = None) -> Flow[RecordList[Any]]:
    LIMIT.check("limit", limit)
    found = yield from get(model, path, {"limit": limit} | ({} if text is None else {"text": text}))
    # The field of the records has the name of the resource.
    return RecordList(getattr(found, path.rpartition("/")[2]))


def projects(connection: Connection) -> Flow[RecordList[ProjectRecord]]:
    """List the projects that the caller is a member of."""
    return RecordList((yield from get(ProjectList, "/v1/projects")).projects)


def project(connection: Connection, project: ProjectId) -> Flow[ProjectDetails]:
    """Get a project with its members."""
    return (yield from get(ProjectDetails, f"/v1/projects/{id_of(project)}"))


def create_project(connection: Connection, name: str) -> Flow[ProjectDetails]:
    """Create a project, whose owner is the caller. ``Client(url, project=…)`` works in it."""
    return (yield from answer(ProjectDetails, "POST", "/v1/projects", {"json": {"name": name}}))


def set_member(
    connection: Connection, project: ProjectId, member: str, role: Role | None
) -> Flow[RecordList[MemberRecord]]:
    """Add a member, change their role or remove them; the result are the members.

    Args:
        project: id or record.
        member: ``key:`` and the id of a key, or ``user:`` and the name of a user.
        role: ``reader``, ``contributor`` or ``owner``; None: no member any more.
    """
    request, path = {"json": {"member": member, "role": role}}, f"/v1/projects/{id_of(project)}/members"
    return RecordList((yield from answer(MemberList, "PUT", path, request, repeatable=True)).members)


def delete_project(connection: Connection, project: ProjectId) -> Flow[None]:
    """Delete an empty project."""
    yield RequestStep("DELETE", f"/v1/projects/{id_of(project)}")


def slice_png(connection: Connection, volume: VolumeId, /, **how: str | float) -> Flow[Picture]:
    """Get a slice as PNG; ``how``: axis, index, quantity, low, high, colormap, size, frame."""
    return (yield from _picture(f"/v1/volumes/{volume_of(volume)}/slice.png", how))


def refraction_png(
    connection: Connection, volume: VolumeId, /, **view: Unpack[RefractionSettings]
) -> Flow[Picture]:
    """Render a 3-D volume with even spacing as refracting glass, or its surface, as PNG.

    Args:
        volume: id or record of the volume, or record of its job.
        view: such as ``iso=(1500.0,)``, ``index=(1.5,)``, ``azimuth_deg=30``, ``mode="shaded"``.

    Raises:
        InvalidInput: for an unknown setting, with the one that is spelt most like it.
    """
    from bentray_workers.rendering.refraction_view import RefractionView

    check_setting_names(view, RefractionView)
    return (yield from _picture(f"/v1/volumes/{volume_of(volume)}/refraction.png", dict(view)))


def quality_png(
    connection: Connection, dataset: DatasetId, picker: PickerName = DEFAULT_PICKER
) -> Flow[Picture]:
    """Get the quality report of a scan as PNG: gathers with picks, matrix of times, findings."""
    return (yield from _picture(f"/v1/datasets/{id_of(dataset)}/quality.png", {"picker": picker}))


def _picture(path: str, params: dict[str, Any]) -> Flow[Picture]:
    given = {name: value for name, value in params.items() if value is not None}
    return Picture((yield RequestStep("GET", path, {"params": given}, repeatable=True)).content)
