"""Opens the database of a data folder: the one that it was used with, or a new one for a new folder."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.atomic import write_bytes

from ..rows.database import Database, mark_of, open_database
from .data_folder import Files

# The file with the id of the database that used the data folder last, and its number of starts.
STAMP = "database.json"
# Exists in the folder of a service that has required authentication.
GUARDED = "authentication-required"
GUARDED_TEXT = (
    "This service has required authentication. It does not start without keys, OpenID provider and trusted "
    "proxy; delete this file to open it to everyone on this machine.\n"
)


class Stamp(NamedTuple):
    """The database that used a data folder last, and its number of starts then."""

    database: str
    begun: int


def open_folder_database(files: Files, address: str) -> Database:
    """Open the database of a service, and record it in a new data folder.

    Args:
        files: the data folder.
        address: of the database.

    Raises:
        InvalidInput: as ``open_database``; when the folder has been used and the database is missing, empty,
            of another program or of another folder: a new one would have no keys, and would be open.
    """
    stamp = read_stamp(files.root)
    used = any((files.root / name).exists() for name in (STAMP, GUARDED)) or files.used()
    way_back = (
        f"the database that {files.root} was used with: put it back, or restore a backup into a new folder "
        "(`bentray restore`); to begin anew, use a new data folder"
    )
    database = open_database(address, way_back if used else None)
    mark = mark_of(database)
    if stamp is not None and stamp.database != mark:
        database.close()
        accepted = f"{way_back}; if the two do belong together, delete {files.root / STAMP}"
        raise InvalidInput("database_url", "the database of another data folder", accepted)
    if not used:
        write_stamp(files.root, mark, 0)
    return database


def read_stamp(root: Path) -> Stamp | None:
    """The record of a data folder about its database; None if it has none or cannot be read."""
    try:
        content = json.loads((root / STAMP).read_bytes())
        return Stamp(str(content["database"]), int(content["begun"]))
    except (OSError, ValueError, KeyError, TypeError):
        return None


def write_stamp(root: Path, mark: str, begun: int) -> None:
    """Record in a data folder the id of its database, and the number of starts."""
    write_bytes(root / STAMP, json.dumps({"database": mark, "begun": begun}).encode())


def remember_authentication(root: Path) -> None:
    """Record in a data folder that its service requires authentication."""
    if not (root / GUARDED).exists():
        write_bytes(root / GUARDED, GUARDED_TEXT.encode())


def check_authentication(root: Path, *, required: bool) -> None:
    """Record that a service requires authentication, or refuse one that did and no longer does.

    Raises:
        InvalidInput: when settings or keys have been lost, and the service would be open.
    """
    if required:
        remember_authentication(root)
    elif (root / GUARDED).exists():
        raise InvalidInput(
            "authentication",
            "no key, OpenID provider or trusted proxy, in a service that has required authentication",
            "BENTRAY_OIDC_ISSUER or BENTRAY_TRUSTED_PROXIES as before, the database with its keys, or a new "
            f"key (`bentray keys create`); to open it to everyone on this machine, delete {root / GUARDED}",
        )
