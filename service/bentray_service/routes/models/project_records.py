"""Models of projects and their members."""

from datetime import datetime
from typing import Annotated, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field

from ...html_tables import ShownRecord
from .name_changes import TEXT

Role = Literal["reader", "contributor", "owner"]
Name = Annotated[str, Field(min_length=1, max_length=200, pattern=TEXT, description="Unique in the tenant.")]
Member = Annotated[
    str,
    Field(
        max_length=205,
        pattern=r"^(key:[0-9a-f]{12}|user:[^\x00-\x1f]{1,200})$",
        description="`key:` and the id of a key, or `user:` and the name of a user, as `who` of /v1/access.",
    ),
]


class ProjectRequest(BaseModel):
    """A new project, or a new name."""

    model_config = ConfigDict(extra="forbid")

    name: Name


class MemberRequest(BaseModel):
    """A member with a role, or without one any more."""

    model_config = ConfigDict(extra="forbid")

    member: Member
    role: Role | None = Field(
        description="reader: sees everything; contributor: also uploads, starts and deletes; owner: also "
        "changes the project and its members; null: no member any more."
    )


class MemberRecord(ShownRecord):
    """One member."""

    columns: ClassVar = ("member", "role", "created")

    member: str
    role: Role
    created: datetime = Field(description="Since when.")


class MemberList(BaseModel):
    """The members of a project, the first first."""

    members: list[MemberRecord]


class ProjectRecord(ShownRecord):
    """One project."""

    columns: ClassVar = ("id", "name", "role", "created")

    id: str = Field(description="Sent as the header Bentray-Project, it makes a request one in the project.")
    name: str
    role: Role = Field(description="Of the caller.")
    created: datetime
    links: dict[str, str]


class ProjectDetails(ProjectRecord):
    """One project with its members."""

    members: list[MemberRecord]


class ProjectList(BaseModel):
    """Projects of the caller, by name."""

    projects: list[ProjectRecord]
