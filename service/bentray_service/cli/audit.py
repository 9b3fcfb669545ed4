"""`bentray audit`: show the audit log of a service."""

from collections import deque
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Annotated, Any

import typer

from bentray_kernels.errors import InvalidInput

from .keys import Data, service_settings
from .output.terminal import AsJson, print_json, print_table

COLUMNS = ("time", "tenant", "how", "who", "method", "route", "ids", "status", "sent")


def audit(
    tenant: Annotated[str | None, typer.Option(help="Only this tenant.", show_default="all")] = None,
    who: Annotated[
        str | None, typer.Option(help="Only this key (its id) or proxy user.", show_default="all")
    ] = None,
    touched: Annotated[
        str | None,
        typer.Option("--id", help="Only requests that named or created this id.", show_default="all"),
    ] = None,
    since: Annotated[
        str | None, typer.Option(help="Only from this date on, e.g. 2026-11-22.", show_default="the first")
    ] = None,
    last: Annotated[int, typer.Option(min=1, max=1_000_000, help="Number of newest records.")] = 1000,
    data: Data = None,
    as_json: AsJson = False,
) -> None:
    """Show the audit log: who read and changed what, oldest first.

    It has every authenticated request, except for polling jobs. The files in DATA/audit, one per day, are
    append-only; BENTRAY_AUDIT_KEEP_DAYS deletes old ones.

    Example:  bentray audit --id ds-0123456789abcdef0123 --since 2026-11-01
    """
    from ..access.audit import entries
    from ..files.data_folder import Files

    settings = service_settings(data)
    folder, first = Files(settings.data_dir).audit, _day(since)
    if not folder.is_dir():
        raise InvalidInput(
            "data_dir", f"{settings.data_dir}, without audit log", "the data folder of a service"
        )

    def matching() -> Iterator[dict[str, Any]]:
        for entry in entries(folder):
            filters = {"tenant": tenant, "who": who}
            if any(value is not None and entry.get(name) != value for name, value in filters.items()):
                continue
            if touched is not None and touched not in entry.get("ids", []):
                continue
            if str(entry.get("time", "")) >= first:
                yield entry

    rows = deque(matching(), maxlen=last)
    if as_json:
        print_json(list(rows))
        return
    print_table("Audit", COLUMNS, [tuple(_cell(entry.get(name)) for name in COLUMNS) for entry in rows])


def _day(text: str | None) -> str:
    if text is None:
        return ""
    try:
        return datetime.strptime(text, "%Y-%m-%d").replace(tzinfo=UTC).strftime("%Y-%m-%d")
    except ValueError:
        raise InvalidInput("since", repr(text[:40]), "a date, e.g. 2026-11-22") from None


def _cell(value: Any) -> str:
    return " ".join(value) if isinstance(value, list) else str(value)
