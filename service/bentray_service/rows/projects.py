"""The tables of projects and their members.

The items of a project have the id of the project as tenant. So whatever separates tenants separates projects:
rows, folders, lists, events, counts, pictures and downloads.
"""

import re
import time
from collections.abc import Sequence

from sqlalchemy import SQLColumnExpression, delete, func, literal, select, update
from sqlalchemy.orm import Session, with_expression

from bentray_kernels.errors import InvalidInput

from ..errors import InUse, UnknownId
from .database import Repository, rows_changed
from .ids import Tenant, checked, new_id
from .tables import WITH_FILES, MemberRow, ProjectRow, StorageRow, UploadRow

# Permissions of each role; owners also change the project and its members.
ROLES = {"reader": ("read",), "contributor": ("read", "write"), "owner": ("read", "write")}
OWNER = "owner"
# The id of a key, or the name of a user of a proxy or an OpenID provider.
MEMBER = re.compile(r"key:[0-9a-f]{12}|user:.{1,200}")
ACCEPTED = "key: and the id of a key, or user: and the name of a user"
LONGEST_NAME = 200
MOST_PROJECTS = 1000
MOST_MEMBERS = 1000

# Tables that have items of a project.
HOLDING = (*WITH_FILES, UploadRow, StorageRow)


class Projects(Repository):
    """Projects of tenants; several may have the same name.

    ``member`` None stands for a caller who may do everything in the tenant.
    """

    def add(self, tenant: Tenant, name: str, member: str | None) -> ProjectRow:
        """Insert a project; ``member`` becomes its owner.

        Raises:
            InvalidInput: when the tenant has too many.
        """
        project_id = new_id("project")
        row = ProjectRow(id=project_id, tenant=tenant, name=name, created=time.time())
        with self._database.write() as session:
            mine = select(func.count()).where(ProjectRow.tenant == tenant)
            if (count := session.scalars(mine).one()) >= MOST_PROJECTS:
                raise InvalidInput("projects", f"{count} of this tenant", f"at most {MOST_PROJECTS}")
            session.add(row)
            session.flush()
            if member is not None:
                _put(session, project_id, member, OWNER)
        return self.get(tenant, project_id, member)

    def get(self, tenant: Tenant, name: str, member: str | None) -> ProjectRow:
        """A project of this tenant, with the role of the member.

        Raises:
            UnknownId: when the tenant has no such project, or the member is none of it.
        """
        found = self.all(tenant, member, checked("project", name))
        if not found:
            raise UnknownId("project", name)
        return found[0]

    def all(self, tenant: Tenant, member: str | None, name: str | None = None) -> list[ProjectRow]:
        """The projects of this tenant that the member belongs to, by name; only the one with an id."""
        query = select(ProjectRow).where(ProjectRow.tenant == tenant)
        if name is not None:
            query = query.where(ProjectRow.id == name)
        role: SQLColumnExpression[str] = literal(OWNER)
        if member is not None:
            query = query.join(MemberRow, MemberRow.project_id == ProjectRow.id)
            query, role = query.where(MemberRow.member == member), MemberRow.role
        query = query.options(with_expression(ProjectRow.role, role))
        return self._database.rows(query.order_by(ProjectRow.name))

    def members(self, project: ProjectRow) -> list[MemberRow]:
        """The members of a project, the first first."""
        query = select(MemberRow).where(MemberRow.project_id == project.id).order_by(MemberRow.number)
        return self._database.rows(query)

    def rename(self, project: ProjectRow, name: str) -> None:
        """Rename a project."""
        self._database.change(update(ProjectRow).where(ProjectRow.id == project.id).values(name=name))

    def put_member(self, project: ProjectRow, member: str, role: str) -> None:
        """Add a member, or change their role.

        Raises:
            InvalidInput: for an invalid member or role, or when the last owner would lose the role.
        """
        if not MEMBER.fullmatch(member):
            raise InvalidInput("member", repr(member[:80]), ACCEPTED)
        if role not in ROLES:
            raise InvalidInput("role", repr(role[:80]), ", ".join(ROLES))
        with self._database.write() as session:
            owned = _is_owner(session, project.id, member)
            _put(session, project.id, member, role)
            if owned:
                _check_owner(session, project.id)

    def remove_member(self, project: ProjectRow, member: str) -> None:
        """Remove a member; their requests in progress end within a second.

        Raises:
            InvalidInput: for someone who is no member, or for the last owner.
        """
        with self._database.write() as session:
            owned = _is_owner(session, project.id, member)
            mine = delete(MemberRow).filter_by(project_id=project.id, member=member)
            if not rows_changed(session, mine):
                raise InvalidInput("member", repr(member[:80]), "a member of the project")
            if owned:
                _check_owner(session, project.id)

    def delete(self, project: ProjectRow) -> None:
        """Delete an empty project.

        Raises:
            InUse: while it has items.
        """
        with self._database.write() as session:
            for table in HOLDING:
                held = select(table.tenant).where(table.tenant == project.id).limit(1)
                if session.execute(held).first() is not None:
                    found = f"{project.id} with {table.__tablename__.replace('_', ' ')}"
                    raise InUse(
                        "project", found, "an empty project; delete its scans, volumes, meshes and jobs"
                    )
            session.execute(delete(MemberRow).where(MemberRow.project_id == project.id))
            session.execute(delete(ProjectRow).where(ProjectRow.id == project.id))

    def ended(self, memberships: Sequence[str]) -> list[str]:
        """Those of some ``membership`` that have ended."""
        asked = [one for one in memberships if "/" in one]
        ids = {one.partition("/")[0] for one in asked}
        rows = self._database.rows(select(MemberRow).where(MemberRow.project_id.in_(ids)))
        left = {membership(row.project_id, row.member) for row in rows}
        return [one for one in asked if one not in left]


def membership(project_id: str, member: str) -> str:
    """A name of a membership, for ``Projects.ended``."""
    return f"{project_id}/{member}"


def _put(session: Session, project_id: str, member: str, role: str) -> None:
    mine = update(MemberRow).filter_by(project_id=project_id, member=member)
    if rows_changed(session, mine.values(role=role)):
        return
    count = session.scalars(select(func.count()).where(MemberRow.project_id == project_id)).one()
    if count >= MOST_MEMBERS:
        raise InvalidInput("members", f"{count} of this project", f"at most {MOST_MEMBERS}")
    session.add(MemberRow(project_id=project_id, member=member, role=role, created=time.time()))


def _is_owner(session: Session, project_id: str, member: str) -> bool:
    query = select(MemberRow.role).filter_by(project_id=project_id, member=member)
    return session.scalar(query) == OWNER


def _check_owner(session: Session, project_id: str) -> None:
    """Raise InvalidInput if nobody could change the project any more; the transaction is rolled back."""
    owners = select(MemberRow.member).filter_by(project_id=project_id, role=OWNER)
    if session.scalar(owners.limit(1)) is None:
        raise InvalidInput(
            "role", "no owner left", "a project with an owner; make another member owner first"
        )
