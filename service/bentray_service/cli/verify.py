"""`bentray verify`: read everything that is stored and compare it with the checksums in the database."""

from __future__ import annotations

from collections import Counter
from contextlib import closing
from typing import Annotated

import typer

from .keys import Data
from .output.exit_codes import WorkFailed
from .output.terminal import AsJson, print_json, print_lines, remark

# What is named one by one.
TOLD = ("damaged", "orphan")


def verify(
    remove_orphans: Annotated[
        bool,
        typer.Option("--remove-orphans", help="Remove files without a database row; stop the service first."),
    ] = False,
    data: Data = None,
    as_json: AsJson = False,
) -> None:
    """Verify the checksum of every stored file; the service may be running.

    What is damaged is named, and not served until it is restored; the exit code is 1 then. Files from before
    there were checksums get one. With a bucket, what lies there is fetched and compared.

    Example:  bentray verify --data /srv/bentray --json
    """
    from ..files.checked_store import CheckedStore
    from ..files.data_folder import Files, lock
    from ..files.open_store import open_store
    from ..files.orphans import Orphans
    from ..files.scrub import scrub
    from ..rows.checksums import Checksums
    from ..rows.database import open_database
    from ..settings import ServiceSettings

    settings = ServiceSettings.load(**({} if data is None else {"data_dir": data}))
    root = Files(settings.data_dir)
    root.prepare()
    with closing(open_database(settings.database)) as database:
        checksums = Checksums(database)
        inner = open_store(settings.storage_url, root.root, database, settings.cache_bytes)
        files = Files(settings.data_dir, CheckedStore(inner, root.root, checksums))
        orphans = Orphans(files, database, keeps=settings.storage_url is None)
        if remove_orphans:
            with closing(lock(files.root)):
                orphans.accept()
        found = list(scrub(files, checksums, orphans))
    counts = Counter(one.state for one in found)
    if as_json:
        print_json({"counts": counts, "things": [one._asdict() for one in found]})
    else:
        told = [one for one in found if one.state in TOLD]
        print_lines([f"{one.state}: {one.tenant} {one.path} {one.found}".rstrip() for one in told])
        words = ", ".join(f"{count} {state}" for state, count in sorted(counts.items()))
        remark(words or "nothing is stored")
    if counts["damaged"]:
        raise WorkFailed(f"{counts['damaged']} of {len(found)} stored things are damaged")
