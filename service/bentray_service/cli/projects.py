"""`bentray projects`: create and list projects and set their members, as the operator of the service."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from bentray_kernels.errors import InvalidInput

from .keys import Data, opened_database, shown_time
from .output.exit_codes import CommandList
from .output.terminal import AsJson, print_json, print_result, print_table

if TYPE_CHECKING:
    from ..rows.projects import Projects
    from ..rows.tables import ProjectRow

NOBODY = "none"

projects = typer.Typer(
    cls=CommandList,
    rich_markup_mode=None,
    help="Projects inside a tenant: only members see the data of a project. Owners change them over REST, "
    "operators with these commands on the database of the service, which may be running.",
    no_args_is_help=True,
)


@projects.command()
def create(
    name: Annotated[str, typer.Argument(help="Name of the project.")],
    owner: Annotated[str, typer.Option(help="Its owner: user:NAME, or key:ID.")],
    tenant: Annotated[str, typer.Option(help="Tenant of the project.")] = "local",
    data: Data = None,
    as_json: AsJson = False,
) -> None:
    """Create a project.

    Example:  bentray projects create Trial-7 --tenant clinic --owner user:alice
    """
    from ..rows.ids import checked_tenant
    from ..rows.projects import ACCEPTED, LONGEST_NAME, MEMBER, Projects

    whose = checked_tenant(tenant)
    if not MEMBER.fullmatch(owner):
        raise InvalidInput("owner", repr(owner[:80]), ACCEPTED)
    if not (1 <= len(name) <= LONGEST_NAME and name.isprintable()):
        raise InvalidInput("name", repr(name[:80]), f"1 to {LONGEST_NAME} printable characters")
    with opened_database(data) as database:
        store = Projects(database)
        made = _shown(store, store.add(whose, name, owner))
    print_result(made, [made["id"]], as_json=as_json)


@projects.command("list")
def list_projects(
    tenant: Annotated[str, typer.Option(help="Tenant of the projects.")] = "local",
    data: Data = None,
    as_json: AsJson = False,
) -> None:
    """List the projects of a tenant with their members.

    Example:  bentray projects list --tenant clinic
    """
    from ..rows.ids import checked_tenant
    from ..rows.projects import Projects

    with opened_database(data) as database:
        store = Projects(database)
        found = [_shown(store, row) for row in store.all(checked_tenant(tenant), None)]
    if as_json:
        print_json(found)
        return
    rows = [
        (one["id"], one["name"], ", ".join(f"{name} ({role})" for name, role in one["members"].items()))
        for one in found
    ]
    print_table(f"Projects of {tenant}", ("id", "name", "members"), rows)


@projects.command()
def member(
    project: Annotated[str, typer.Argument(help="Id of the project.")],
    name: Annotated[str, typer.Argument(metavar="MEMBER", help="user:NAME, or key:ID.")],
    role: Annotated[str, typer.Argument(help="reader, contributor or owner; none: no member any more.")],
    tenant: Annotated[str, typer.Option(help="Tenant of the project.")] = "local",
    data: Data = None,
    as_json: AsJson = False,
) -> None:
    """Add a member to a project, change their role or remove them.

    Example:  bentray projects member project-… user:bob reader --tenant clinic
    """
    from ..rows.ids import checked_tenant
    from ..rows.projects import Projects

    with opened_database(data) as database:
        store = Projects(database)
        row = store.get(checked_tenant(tenant), project, None)
        if role == NOBODY:
            store.remove_member(row, name)
        else:
            store.put_member(row, name, role)
        found = _shown(store, row)
    lines = [f"{one} {what}" for one, what in found["members"].items()]
    print_result(found, lines, as_json=as_json)


def _shown(store: Projects, row: ProjectRow) -> dict[str, Any]:
    members = {one.member: one.role for one in store.members(row)}
    same = {"id": row.id, "tenant": row.tenant, "name": row.name}
    return {**same, "created": shown_time(row.created), "members": members}
