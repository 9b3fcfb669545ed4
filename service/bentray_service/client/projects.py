"""Flows of projects and their members."""

from __future__ import annotations

from typing import TypeAlias

from ..html_tables import RecordList
from ..routes.models.project_records import (
    MemberList,
    MemberRecord,
    ProjectDetails,
    ProjectList,
    ProjectRecord,
    Role,
)
from .connection import Connection
from .lists import get
from .steps import Flow, RequestStep

ProjectId: TypeAlias = str | ProjectRecord


def projects(connection: Connection) -> Flow[RecordList[ProjectRecord]]:
    """List the projects that the caller is a member of."""
    return RecordList((yield from get(ProjectList, "/v1/projects")).projects)


def project(connection: Connection, project: ProjectId) -> Flow[ProjectDetails]:
    """Get a project with its members."""
    return (yield from get(ProjectDetails, _path_of(project)))


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
    response = yield RequestStep("PUT", f"{_path_of(project)}/members", request, repeatable=True)
    return RecordList(MemberList.model_validate_json(response.content).members)


def delete_project(connection: Connection, project: ProjectId) -> Flow[None]:
    """Delete an empty project."""
    yield RequestStep("DELETE", _path_of(project))


def _path_of(project: ProjectId) -> str:
    return f"/v1/projects/{project if isinstance(project, str) else project.id}"
