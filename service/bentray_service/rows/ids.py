"""Ids of stored items and names of tenants: creation, and validation before either becomes part of a path."""

import re
import secrets
from typing import NewType

from bentray_kernels.errors import InvalidInput

from ..errors import UnknownId

# A folder has this name, so it must not contain path separators.
TENANT_PATTERN = re.compile(r"[a-z0-9][a-z0-9._@+-]{0,63}")
ACCEPTED_TENANTS = "1 to 64 of a-z, 0-9 and . _ @ + -, beginning with a letter or digit"

# Names that nobody chooses: of claimed names, and of projects, whose id is the tenant of their items.
GIVEN = re.compile(r"user-[0-9a-f]{40}|project-[0-9a-f]{20}")

Tenant = NewType("Tenant", str)

# The owner of all data when authentication is not required.
LOCAL = Tenant("local")
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


def checked_tenant(text: str) -> Tenant:
    """Return ``text`` if it is a valid tenant name.

    Raises:
        InvalidInput: otherwise.
    """
    if not TENANT_PATTERN.fullmatch(text):
        raise InvalidInput("tenant", repr(text[:80]), ACCEPTED_TENANTS)
    return Tenant(text)


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
