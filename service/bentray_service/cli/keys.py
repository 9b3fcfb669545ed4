"""`bentray keys`: create, list and revoke API keys."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bentray_kernels.errors import InvalidInput

from .output.exit_codes import CommandList
from .output.terminal import AsJson, print_json, print_result, print_table, remark

if TYPE_CHECKING:
    from ..rows.database import Database
    from ..rows.tables import KeyRow
    from ..settings import ServiceSettings

Data = Annotated[
    Path | None,
    typer.Option("--data", help="Data folder of the service.", show_default="as for bentray serve"),
]
ACCEPTED_AGES = "a number with h, d or w, e.g. 12h, 90d, 52w; never by default"
SECONDS = {"h": 3600.0, "d": 86400.0, "w": 604800.0}
LONGEST_NAME = 100

keys = typer.Typer(
    cls=CommandList,
    rich_markup_mode=None,
    help="API keys: a key gives access to the data of its tenant. Keys are stored in the database of the "
    "service, which may be running; once a key exists, authentication is required.",
    no_args_is_help=True,
)


@keys.command()
def create(
    name: Annotated[str, typer.Option(help="Name of the key.")],
    tenant: Annotated[str, typer.Option(help="Tenant whose data it can access.")] = "local",
    scopes: Annotated[
        str, typer.Option(help="Scopes, separated by commas: read, write, metrics.")
    ] = "read,write",
    expires: Annotated[
        str | None, typer.Option(help="Lifetime, e.g. 12h, 90d, 52w.", show_default="never")
    ] = None,
    data: Data = None,
    as_json: AsJson = False,
) -> None:
    """Create a key and show it once; only its digest is stored.

    Example:  bentray keys create --tenant clinic --name scanner --expires 90d
    """
    from ..access.caller import checked_scopes
    from ..files.data_folder import remember_authentication
    from ..rows.ids import checked_tenant
    from ..rows.keys import ApiKey, Keys

    requested, whose = checked_scopes(scopes), checked_tenant(tenant)
    if not (1 <= len(name) <= LONGEST_NAME and name.isprintable()):
        raise InvalidInput("name", repr(name[:LONGEST_NAME]), f"1 to {LONGEST_NAME} printable characters")
    until = None if expires is None else time.time() + _seconds(expires)
    token = ApiKey.new()
    with opened_database(data) as database:
        row = Keys(database).add(token, whose, name, requested, until)
        remember_authentication(service_settings(data).data_dir)
    if not as_json:
        remark(
            f"A key of the tenant {whose}; it is not shown again. Set BENTRAY_KEY to it, or send the header"
        )
        remark("Authorization: Bearer …")
    print_result({**_shown(row), "key": token.shown()}, [token.shown()], as_json=as_json)


@keys.command("list")
def list_keys(
    tenant: Annotated[str | None, typer.Option(help="Only its keys.", show_default="all")] = None,
    data: Data = None,
    as_json: AsJson = False,
) -> None:
    """List the keys, without their secrets.

    Example:  bentray keys list --tenant clinic
    """
    from ..rows.ids import checked_tenant
    from ..rows.keys import Keys

    whose = None if tenant is None else checked_tenant(tenant)
    with opened_database(data) as database:
        found = [_shown(row) for row in Keys(database).all(whose)]
    if as_json:
        print_json(found)
        return
    columns = ("id", "tenant", "name", "scopes", "state", "expires", "used")
    rows = [tuple(_cell(key[column]) for column in columns) for key in found]
    print_table("Keys", columns, rows)


@keys.command()
def revoke(
    key_id: Annotated[str, typer.Argument(metavar="ID", help="As `bentray keys list` shows it.")],
    data: Data = None,
    as_json: AsJson = False,
) -> None:
    """Revoke a key; a running service rejects it from the next request on.

    Example:  bentray keys revoke 0f3a5c7e9b1d
    """
    from ..rows.keys import Keys

    with opened_database(data) as database:
        row = _shown(Keys(database).revoke(key_id))
    print_result(row, [f"{row['id']} of {row['tenant']} revoked"], as_json=as_json)


@contextmanager
def opened_database(data: Path | None) -> Iterator[Database]:
    """The database of the service with this data folder, which may be running."""
    from ..files.data_folder import Files, open_folder_database
    from ..files.disk import private_files

    settings = service_settings(data)
    with private_files():
        files = Files(settings.data_dir)
        files.prepare()
        database = open_folder_database(files, settings.database)
        try:
            yield database
        finally:
            database.close()


def service_settings(data: Path | None) -> ServiceSettings:
    """The settings of the environment, with this data folder if it is given."""
    from ..settings import ServiceSettings

    return ServiceSettings.load(**({} if data is None else {"data_dir": data}))


def _seconds(text: str) -> float:
    match = re.fullmatch(r"([1-9][0-9]{0,4})([hdw])", text)
    if match is None:
        raise InvalidInput("expires", repr(text[:40]), ACCEPTED_AGES)
    return int(match[1]) * SECONDS[match[2]]


def _shown(row: KeyRow) -> dict[str, Any]:
    times = {name: shown_time(getattr(row, name)) for name in ("created", "expires", "revoked", "used")}
    same = {name: getattr(row, name) for name in ("id", "tenant", "name", "scopes")}
    expired = row.expires is not None and row.expires <= time.time()
    state = "revoked" if row.revoked is not None else "expired" if expired else "valid"
    return {**same, "state": state, **times}


def shown_time(seconds: float | None) -> str | None:
    """A time, s since 1970, as text."""
    return None if seconds is None else datetime.fromtimestamp(seconds, UTC).isoformat(timespec="seconds")


def _cell(value: Any) -> str:
    return ", ".join(value) if isinstance(value, list) else str(value or "never")
