"""`bentray backup` and `bentray restore`: back up a service, and restore it elsewhere."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from .keys import Data, service_settings
from .output.exit_codes import WorkFailed
from .output.terminal import AsJson, print_result, progress_bar, remark


def backup(
    folder: Annotated[Path, typer.Argument(help="New folder for the backup.")],
    link: Annotated[
        Path | None,
        typer.Option(
            "--link",
            help="An earlier backup on the same disk: its equal files are linked, and take no space again.",
            show_default="copy all files",
        ),
    ] = None,
    data: Data = None,
    as_json: AsJson = False,
) -> None:
    """Back up a service, which may be running: database (SQLite or PostgreSQL), files and audit log.

    The backup is of one moment. It has no incomplete uploads and no checkpoints: after it is restored, a job
    that was running starts again and ends with the same result. An interrupted backup is continued by the
    same command; only a complete one has backup.json. It is not encrypted. Damaged files are listed; then
    the exit code is 1.

    Example:  bentray backup /srv/backups/2026-11-25 --data /srv/bentray
    """
    from ..backup.back_up import back_up

    with progress_bar("Backing up", shown=not as_json) as step:
        made = back_up(service_settings(data), folder, link, step)
    if not as_json:
        remark(f"{made.items} stored items, {made.bytes} bytes with database and audit log")
    lines = [str(folder), *(f"missing: {path}" for path in made.missing)]
    print_result({"folder": str(folder.resolve()), **asdict(made)}, lines, as_json=as_json)
    if made.missing:
        count = len(made.missing)
        raise WorkFailed(f"{count} damaged or missing items are not in the backup; see `bentray verify`")


def restore(
    folder: Annotated[Path, typer.Argument(help="Folder of a complete backup.")],
    data: Data = None,
    as_json: AsJson = False,
) -> None:
    """Restore a backup into an empty data folder, and an empty database if it is not in the folder.

    The database (BENTRAY_DATABASE_URL) and the bucket (BENTRAY_STORAGE_URL) may be of another kind than those
    of the backup. Every file is compared with its checksum. Nothing that exists is overwritten. An
    interrupted restoration is continued by the same command; until then no service starts on the folder.

    Example:  bentray restore /srv/backups/2026-11-25 --data /srv/bentray-restored
    """
    from ..backup.restore import restore as restore_backup

    settings = service_settings(data)
    with progress_bar("Restoring", shown=not as_json) as step:
        restored = restore_backup(folder, settings, step)
    target = settings.data_dir.resolve()
    if not as_json:
        stored = f"{restored.items} stored items of a backup by Bentray {restored.bentray}"
        remark(f"{stored}; start the service with")
    figures = {"data": str(target), **asdict(restored)}
    print_result(figures, [f"bentray serve --data {target}"], as_json=as_json)
