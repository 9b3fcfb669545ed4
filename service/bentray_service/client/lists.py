"""Flows that get records, one or a list, newest first; and those of projects."""

from __future__ import annotations

from typing import Any, Literal, TypeAlias, TypeVar
from urllib.parse import parse_qsl, urlsplit

from pydantic import BaseModel

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.names import DEFAULT_PICKER, PickerName
from bentray_kernels.requests.ranges import Range

from ..html_tables import RecordList
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
from .connection import Connection
from .steps import Flow, RequestStep
from .stored import DatasetId, JobId, VolumeId, id_of, volume_of

Answer = TypeVar("Answer", bound=BaseModel)
JobKind = Literal["reconstruction", "simulation", "refraction", "geometry-field"]

# Records of one request, as the service limits them.
LIMIT = Range(1, 1000)


def datasets(
    connection: Connection, limit: int = 100, *, text: str | None = None
) -> Flow[RecordList[DatasetRecord]]:
    """List the newest scans, at most 1000.

    Args:
        limit: largest number of scans.
        text: only scans with this text in id, name, title or notes.
    """
    found = yield from _list(DatasetList, "/v1/datasets", limit, text)
    return RecordList(found.datasets)


def volumes(connection: Connection, limit: int = 100) -> Flow[RecordList[VolumeRecord]]:
    """List the newest volumes, reconstructed and uploaded, at most 1000."""
    found = yield from _list(VolumeList, "/v1/volumes", limit)
    return RecordList(found.volumes)


def meshes(connection: Connection, limit: int = 100) -> Flow[RecordList[MeshRecord]]:
    """List the newest meshes, at most 1000."""
    found = yield from _list(MeshList, "/v1/meshes", limit)
    return RecordList(found.meshes)


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
        response = yield RequestStep("GET", "/v1/jobs", {"params": dict(how)}, repeatable=True)
        page = JobList.model_validate_json(response.content)
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


def get(model: type[Answer], path: str, params: dict[str, Any] | None = None) -> Flow[Answer]:
    """Get one record."""
    response = yield RequestStep("GET", path, {"params": params or {}}, repeatable=True)
    return model.model_validate_json(response.content)


def _list(model: type[Answer], path: str, limit: int, text: str | None = None) -> Flow[Answer]:
    LIMIT.check("limit", limit)
    return (yield from get(model, path, {"limit": limit} | ({} if text is None else {"text": text})))


ProjectId: TypeAlias = str | ProjectRecord


def projects(connection: Connection) -> Flow[RecordList[ProjectRecord]]:
    """List the projects that the caller is a member of."""
    return RecordList((yield from get(ProjectList, "/v1/projects")).projects)


def project(connection: Connection, project: ProjectId) -> Flow[ProjectDetails]:
    """Get a project with its members."""
    return (yield from get(ProjectDetails, _place(project)))


def create_project(connection: Connection, name: str) -> Flow[ProjectDetails]:
    """Create a project, whose owner is the caller. ``Client(url, project=…)`` works in it."""
    response = yield RequestStep("POST", "/v1/projects", {"json": {"name": name}})
    return ProjectDetails.model_validate_json(response.content)


def set_member(
    connection: Connection, project: ProjectId, member: str, role: Role | None
) -> Flow[RecordList[MemberRecord]]:
    """Add a member, change their role or remove them; the result are the members.

    Args:
        project: id or record.
        member: ``key:`` and the id of a key, or ``user:`` and the name of a user.
        role: ``reader``, ``contributor`` or ``owner``; None: no member any more.
    """
    request = {"json": {"member": member, "role": role}}
    response = yield RequestStep("PUT", f"{_place(project)}/members", request, repeatable=True)
    return RecordList(MemberList.model_validate_json(response.content).members)


def delete_project(connection: Connection, project: ProjectId) -> Flow[None]:
    """Delete an empty project."""
    yield RequestStep("DELETE", _place(project))


def _place(project: ProjectId) -> str:
    return f"/v1/projects/{project if isinstance(project, str) else project.id}"
