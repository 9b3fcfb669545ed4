"""Ids of stored items: creation, and validation before an id becomes part of a path."""

from __future__ import annotations

import re
import secrets

from ..errors import UnknownId

PREFIXES = {
    "dataset": "ds",
    "job": "job",
    "batch": "batch",
    "project": "project",
    "volume": "vol",
    "mesh": "mesh",
    "field": "field",
    "upload": "up",
}
_RANDOM = re.compile(r"[0-9a-f]{20}")


def new_id(what: str) -> str:
    """A new random id, e.g. ``ds-`` and 20 hexadecimal digits; ``what`` is a key of ``PREFIXES``."""
    return f"{PREFIXES[what]}-{secrets.token_hex(10)}"


def checked(what: str, text: str) -> str:
    """Return ``text`` if it has the format of an id of ``what``.

    Raises:
        UnknownId: otherwise.
    """
    prefix, _, random = text.partition("-")
    if prefix != PREFIXES[what] or not _RANDOM.fullmatch(random):
        raise UnknownId(what, text)
    return text


def volume_of(job_id: str) -> str:
    """The volume id of a reconstruction; it is fixed, so that a repeated job writes the same file."""
    return PREFIXES["volume"] + checked("job", job_id).removeprefix(PREFIXES["job"])


def dataset_of(job_id: str) -> str:
    """The dataset id of a simulation, fixed for the same reason."""
    return PREFIXES["dataset"] + checked("job", job_id).removeprefix(PREFIXES["job"])


def field_of(content: str) -> str:
    """The geometry field id of a SHA-256 in hexadecimal; the same content has the same id."""
    return f"{PREFIXES['field']}-{content[:20]}"
