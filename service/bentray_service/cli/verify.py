"""`bentray verify`: verify the checksums of all stored files."""

from __future__ import annotations

from collections import Counter
from contextlib import closing
from typing import Annotated

import typer

from .keys import Data, service_settings
from .output.exit_codes import WorkFailed
from .output.terminal import AsJson, print_json, print_lines, remark

# States that are listed individually.
LISTED = ("damaged", "orphan")


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
