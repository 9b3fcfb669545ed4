"""/v1/projects: projects inside a tenant, and their members."""

from typing import Annotated, Any, TypeVar

from fastapi import APIRouter, Body, Depends, Response, status
from fastapi.openapi.models import Example

from ..errors import Forbidden
from ..rows.projects import OWNER
from ..rows.tables import ProjectRow
from ..web.errors import problems
from ..wiring import Context, RequestContext
from .bodies import SmallBody, accept_media_types
from .models.project_records import (
    MemberList,
    MemberRecord,
    MemberRequest,
    ProjectDetails,
    ProjectList,
    ProjectRecord,
    ProjectRequest,
)
from .record_conversion import record_of

NAMES: dict[str, Example] = {"name": {"summary": "A name", "value": {"name": "Trial 7"}}}
MEMBERS: dict[str, Example] = {
    "user": {"summary": "A user", "value": {"member": "user:alice", "role": "contributor"}},
    "key": {"summary": "A key", "value": {"member": "key:0123456789ab", "role": "reader"}},
}
JSON = [Depends(accept_media_types("application/json"))]

Shown = TypeVar("Shown", bound=ProjectRecord)

router = APIRouter(prefix="/v1/projects", tags=["projects"], route_class=SmallBody)


@router.post(
    "", status_code=status.HTTP_201_CREATED, dependencies=JSON, responses=problems(400, 413, 415, 422, 503)
)
def create_project(
    project: Annotated[ProjectRequest, Body(openapi_examples=NAMES)],
    response: Response,
    context: Context,
) -> ProjectDetails:
    """Create a project; the caller becomes its owner."""
    caller = context.caller
    made = _details(context, context.access.sign_in.projects.add(caller.home, project.name, caller.member))
    response.headers["Location"] = made.links["self"]
    return made


@router.get("", responses=problems(503))
def list_projects(context: Context) -> ProjectList:
    """List the projects that the caller is a member of."""
    found = context.access.sign_in.projects.all(context.caller.home, context.caller.member)
    return ProjectList(projects=[_record(ProjectRecord, row) for row in found])


@router.get("/{project_id}", responses=problems(404))
def show_project(project_id: str, context: Context) -> ProjectDetails:
    """Show a project with its members, to its members."""
    return _details(context, _project(context, project_id))


@router.patch("/{project_id}", dependencies=JSON, responses=problems(400, 404, 413, 415, 422))
def rename_project(
    project_id: str,
    project: Annotated[ProjectRequest, Body(openapi_examples=NAMES)],
    context: Context,
) -> ProjectDetails:
    """Rename a project; owners only."""
    context.access.sign_in.projects.rename(_owned(context, project_id), project.name)
    return show_project(project_id, context)


@router.delete("/{project_id}", status_code=status.HTTP_204_NO_CONTENT, responses=problems(404, 409))
def delete_project(project_id: str, context: Context) -> None:
    """Delete an empty project; owners only."""
    context.access.sign_in.projects.delete(_owned(context, project_id))


@router.put("/{project_id}/members", dependencies=JSON, responses=problems(400, 404, 413, 415, 422))
def put_member(
    project_id: str,
    member: Annotated[MemberRequest, Body(openapi_examples=MEMBERS)],
    context: Context,
) -> MemberList:
    """Add a member, change their role or remove them; owners only, but all members may remove themselves."""
    project, projects = _project(context, project_id), context.access.sign_in.projects
    if member.role is not None or member.member != context.caller.member:
        _check_owner(project)
    if member.role is None:
        projects.remove_member(project, member.member)
    else:
        projects.put_member(project, member.member, member.role)
    return MemberList(members=_members(context, project))


def _project(context: RequestContext, project_id: str) -> ProjectRow:
    caller = context.caller
    return context.access.sign_in.projects.get(caller.home, project_id, caller.member)


def _owned(context: RequestContext, project_id: str) -> ProjectRow:
    project = _project(context, project_id)
    _check_owner(project)
    return project


def _check_owner(project: ProjectRow) -> None:
    if project.role != OWNER:
        raise Forbidden("role", project.role, f"{OWNER} of the project")


def _members(context: RequestContext, project: ProjectRow) -> list[MemberRecord]:
    return [record_of(MemberRecord, row) for row in context.access.sign_in.projects.members(project)]


def _details(context: RequestContext, project: ProjectRow) -> ProjectDetails:
    return _record(ProjectDetails, project, members=_members(context, project))


def _record(model: type[Shown], project: ProjectRow, **given: Any) -> Shown:
    here = f"/v1/projects/{project.id}"
    return record_of(model, project, links={"self": here, "members": f"{here}/members"}, **given)
