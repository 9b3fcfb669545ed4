"""`bentray backup`, `bentray restore` and `bentray verify`: copies of a service, and checks of its files."""

from collections import Counter
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from .keys import Data, service_settings
from .output.exit_codes import WorkFailed
from .output.terminal import AsJson, print_json, print_lines, print_result, progress_bar, remark

# States that are listed individually.
LISTED = ("damaged", "orphan")


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


def verify(
    remove_orphans: Annotated[
        bool,
        typer.Option("--remove-orphans", help="Remove files without a database row; stop the service first."),
    ] = False,
    data: Data = None,
    as_json: AsJson = False,
) -> None:
    """Verify the checksum of every stored file; the service may be running.

    Damaged files are listed, and not served until they are restored; then the exit code is 1. Files without
    checksum, from earlier versions, get one. Files in a bucket are downloaded.

    Example:  bentray verify --data /srv/bentray --json
    """
    from ..files.bucket_store import open_store
    from ..files.checked_store import CheckedStore, scrub
    from ..files.data_folder import Files, lock, open_folder_database
    from ..files.orphans import Orphans
    from ..rows.checksums import Checksums

    settings = service_settings(data)
    root = Files(settings.data_dir)
    root.prepare()
    with closing(open_folder_database(root, settings.database)) as database:
        checksums = Checksums(database)
        inner = open_store(settings.storage_url, root.root, database, settings.cache_bytes)
        files = Files(settings.data_dir, CheckedStore(inner, root.root, checksums))
        orphans = Orphans(files, database, is_store=settings.storage_url is None)
        if remove_orphans:
            with closing(lock(files.root)):
                orphans.accept()
        findings = list(scrub(files, checksums, orphans))
    counts = Counter(one.state for one in findings)
    if as_json:
        print_json({"counts": counts, "things": [one._asdict() for one in findings]})
    else:
        listed = [one for one in findings if one.state in LISTED]
        print_lines([f"{one.state}: {one.tenant} {one.path} {one.found}".rstrip() for one in listed])
        words = ", ".join(f"{count} {state}" for state, count in sorted(counts.items()))
        remark(words or "no stored files")
    if counts["damaged"]:
        raise WorkFailed(f"{counts['damaged']} of {len(findings)} stored items are damaged")
