"""The tables of projects and their members.

The items of a project have the id of the project as tenant. So whatever separates tenants separates projects:
rows, folders, lists, events, counts, pictures and downloads.
"""

from __future__ import annotations

import re
import time
from collections.abc import Sequence
from typing import cast

from sqlalchemy import Connection, delete, func, insert, select, update

from bentray_kernels.errors import InvalidInput

from ..errors import InUse, UnknownId
from . import schema
from .database import Database
from .ids import checked, new_id
from .schema import project_members, projects
from .tenants import Tenant
from .typed_rows import MemberRow, Plain, ProjectRow

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
_HOLDING = (
    "datasets",
    "jobs",
    "volumes",
    "uploaded_volumes",
    "meshes",
    "geometry_fields",
    "uploads",
    "storage",
)


class Projects:
    """Projects of tenants; several may have the same name.

    ``member`` None stands for a caller who may do everything in the tenant.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def add(self, tenant: Tenant, name: str, member: str | None) -> ProjectRow:
        """Insert a project; ``member`` becomes its owner.

        Raises:
            InvalidInput: when the tenant has too many.
        """
        project_id = new_id("project")
        row = {"id": project_id, "tenant": tenant, "name": name, "created": time.time()}
        with self._database.write() as connection:
            mine = select(func.count()).where(projects.c.tenant == tenant)
            if (count := connection.execute(mine).scalar_one()) >= MOST_PROJECTS:
                raise InvalidInput("projects", f"{count} of this tenant", f"at most {MOST_PROJECTS}")
            connection.execute(insert(projects).values(**row))
            if member is not None:
                _put(connection, project_id, member, OWNER)
        return self.get(tenant, project_id, member)

    def get(self, tenant: Tenant, name: str, member: str | None) -> ProjectRow:
        """A project of this tenant, with the role of the member.

        Raises:
            UnknownId: when the tenant has no such project, or the member is none of it.
        """
        found = self._read(tenant, member, checked("project", name))
        if not found:
            raise UnknownId("project", name)
        return found[0]

    def all(self, tenant: Tenant, member: str | None) -> list[ProjectRow]:
        """The projects of this tenant that the member belongs to, by name."""
        return self._read(tenant, member)

    def members(self, project: ProjectRow) -> list[MemberRow]:
        """The members of a project, the first first."""
        table = project_members.c
        query = select(project_members).where(table.project_id == project["id"]).order_by(table.number)
        return cast(list[MemberRow], self._database.rows(query))

    def rename(self, project: ProjectRow, name: str) -> None:
        """Rename a project."""
        with self._database.write() as connection:
            connection.execute(update(projects).where(projects.c.id == project["id"]).values(name=name))

    def put_member(self, project: ProjectRow, member: str, role: str) -> None:
        """Add a member, or change their role.

        Raises:
            InvalidInput: for an invalid member or role, or when the last owner would lose the role.
        """
        if not MEMBER.fullmatch(member):
            raise InvalidInput("member", repr(member[:80]), ACCEPTED)
        if role not in ROLES:
            raise InvalidInput("role", repr(role[:80]), ", ".join(ROLES))
        with self._database.write() as connection:
            owned = _is_owner(connection, project["id"], member)
            _put(connection, project["id"], member, role)
            if owned:
                _check_owner(connection, project["id"])

    def remove_member(self, project: ProjectRow, member: str) -> None:
        """Remove a member; their requests in progress end within a second.

        Raises:
            InvalidInput: for someone who is no member, or for the last owner.
        """
        table = project_members.c
        with self._database.write() as connection:
            mine = table.project_id == project["id"], table.member == member
            owned = _is_owner(connection, project["id"], member)
            if not connection.execute(delete(project_members).where(*mine)).rowcount:
                raise InvalidInput("member", repr(member[:80]), "a member of the project")
            if owned:
                _check_owner(connection, project["id"])

    def delete(self, project: ProjectRow) -> None:
        """Delete an empty project.

        Raises:
            InUse: while it has items.
        """
        with self._database.write() as connection:
            for name in _HOLDING:
                table = schema.metadata.tables[name]
                held = select(table.c.tenant).where(table.c.tenant == project["id"]).limit(1)
                if connection.execute(held).first() is not None:
                    found = f"{project['id']} with {name.replace('_', ' ')}"
                    raise InUse(
                        "project", found, "an empty project; delete its scans, volumes, meshes and jobs"
                    )
            connection.execute(delete(project_members).where(project_members.c.project_id == project["id"]))
            connection.execute(delete(projects).where(projects.c.id == project["id"]))

    def ended(self, memberships: Sequence[str]) -> list[str]:
        """Those of some ``membership`` that have ended."""
        table = project_members.c
        query = select(table.project_id, table.member)
        asked = [one for one in memberships if "/" in one]
        query = query.where(table.project_id.in_({one.partition("/")[0] for one in asked}))
        with self._database.read() as connection:
            left = {membership(row.project_id, row.member) for row in connection.execute(query)}
        return [one for one in asked if one not in left]

    def _read(self, tenant: Tenant, member: str | None, name: str | None = None) -> list[ProjectRow]:
        query = select(projects).where(projects.c.tenant == tenant)
        if name is not None:
            query = query.where(projects.c.id == name)
        if member is not None:
            joined = project_members.c.project_id == projects.c.id, project_members.c.member == member
            query = query.join(project_members, joined[0] & joined[1]).add_columns(project_members.c.role)
        rows = self._database.rows(query.order_by(projects.c.name))
        return [cast(ProjectRow, {"role": OWNER, **row}) for row in rows]


def membership(project_id: str, member: str) -> str:
    """A name of a membership, for ``Projects.ended``."""
    return f"{project_id}/{member}"


def _put(connection: Connection, project_id: str, member: str, role: str) -> None:
    table = project_members.c
    mine = table.project_id == project_id, table.member == member
    if connection.execute(update(project_members).where(*mine).values(role=role)).rowcount:
        return
    count = connection.execute(select(func.count()).where(table.project_id == project_id)).scalar_one()
    if count >= MOST_MEMBERS:
        raise InvalidInput("members", f"{count} of this project", f"at most {MOST_MEMBERS}")
    row: Plain = {"project_id": project_id, "member": member, "role": role, "created": time.time()}
    connection.execute(insert(project_members).values(**row))


def _is_owner(connection: Connection, project_id: str, member: str) -> bool:
    table = project_members.c
    mine = select(table.role).where(table.project_id == project_id, table.member == member)
    return connection.execute(mine).scalar_one_or_none() == OWNER


def _check_owner(connection: Connection, project_id: str) -> None:
    """Raise InvalidInput if nobody could change the project any more; the transaction is rolled back."""
    owners = select(project_members.c.member).where(
        project_members.c.project_id == project_id, project_members.c.role == OWNER
    )
    if connection.execute(owners.limit(1)).first() is None:
        raise InvalidInput(
            "role", "no owner left", "a project with an owner; make another member owner first"
        )
