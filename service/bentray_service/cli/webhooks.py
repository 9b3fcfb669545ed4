"""`bentray webhooks`: secrets that sign messages to webhooks, and the messages."""

from typing import Annotated, Any, Literal

import typer

from bentray_kernels.errors import InvalidInput

from .keys import Data, opened_database, shown_time
from .output.exit_codes import CommandList
from .output.terminal import AsJson, print_json, print_result, print_table, remark

COLUMNS = ("id", "tenant", "job", "state", "attempts", "created", "last")

webhooks = typer.Typer(
    cls=CommandList,
    rich_markup_mode=None,
    help="Webhooks: addresses that the service calls when a job ends. Secrets and messages are stored in the "
    "database of the service, which may be running.",
    no_args_is_help=True,
)


@webhooks.command("create-secret")
def create_secret(
    tenant: Annotated[str, typer.Option(help="Tenant whose messages it signs.")] = "local",
    data: Data = None,
    as_json: AsJson = False,
) -> None:
    """Create the secret that signs messages of a tenant, and show it once; jobs may then have webhooks.

    Run it again to replace the secret: for one day, messages are signed with both.

    Example:  bentray webhooks create-secret --tenant clinic
    """
    from ..rows.deliveries import WebhookSecrets
    from ..rows.ids import checked_tenant

    whose = checked_tenant(tenant)
    with opened_database(data) as database:
        secret = WebhookSecrets(database).create(whose)
    if not as_json:
        remark(f"A secret of the tenant {whose}; it is not shown again. Receivers check messages with it.")
    print_result({"tenant": whose, "secret": secret}, [secret], as_json=as_json)


@webhooks.command("list")
def list_messages(
    tenant: Annotated[str | None, typer.Option(help="Only its messages.", show_default="all")] = None,
    state: Annotated[
        Literal["waiting", "delivered", "failed"] | None, typer.Option(help="Only these.", show_default="all")
    ] = None,
    last: Annotated[int, typer.Option(min=1, max=100_000, help="Number of newest messages.")] = 100,
    data: Data = None,
    as_json: AsJson = False,
) -> None:
    """List messages to webhooks with their attempts, without their addresses, which may be secret.

    Example:  bentray webhooks list --state failed
    """
    from ..rows.deliveries import Deliveries
    from ..rows.ids import checked_tenant

    whose = None if tenant is None else checked_tenant(tenant)
    with opened_database(data) as database:
        shown = [_shown(row) for row in Deliveries(database).newest(whose, state, last)]
    if as_json:
        print_json(shown)
    else:
        print_table("Messages", COLUMNS, [tuple(one[name] for name in COLUMNS) for one in shown])


@webhooks.command()
def retry(
    ids: Annotated[list[str], typer.Argument(metavar="ID...", help="As `bentray webhooks list` shows them.")],
    data: Data = None,
    as_json: AsJson = False,
) -> None:
    """Send failed messages again, with all attempts from the first.

    Example:  bentray webhooks retry msg-0123456789abcdef0123
    """
    from ..rows.deliveries import Deliveries

    with opened_database(data) as database:
        count = Deliveries(database).retry(ids)
    if count < len(set(ids)):
        found = f"{len(set(ids)) - count} of {len(set(ids))} that have not failed"
        raise InvalidInput("id", found, "ids of failed messages, see `bentray webhooks list --state failed`")
    print_result({"retried": count}, [f"{count} messages are sent again"], as_json=as_json)


def _shown(row: Any) -> dict[str, Any]:
    return {
        "id": row.id,
        "tenant": row.tenant,
        "job": row.job_id,
        "state": row.state,
        "attempts": row.attempts,
        "created": shown_time(row.created),
        "last": (row.log[-1]["error"] or "accepted") if row.log else "",
    }
