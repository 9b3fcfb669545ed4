"""Errors of the service with the field, the value found, the values accepted, and their type of problem."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from sqlalchemy.exc import SQLAlchemyError

from bentray_kernels.errors import InvalidInput

# Resources with irregular plurals.
LISTED = {"mesh": "meshes", "field": "geometry-fields", "batch": "batches"}


@dataclass(frozen=True)
class ProblemType:
    """A type of problem: HTTP status, slug of its address, title."""

    status: int
    slug: str
    title: str


# All types, in the order of the reference.
PROBLEMS: list[ProblemType] = []


def _problem(status: int, slug: str, title: str) -> ProblemType:
    PROBLEMS.append(ProblemType(status, slug, title))
    return PROBLEMS[-1]


INVALID = _problem(422, "invalid-input", "Invalid value")


class Refusal(InvalidInput):
    """An error with a type of problem of its own."""

    problem: ClassVar[ProblemType]


def _refusal(name: str, status: int, slug: str, title: str) -> type[Refusal]:
    """A refusal of field, value and accepted, whose title says what it is."""
    return type(name, (Refusal,), {"problem": _problem(status, slug, title), "__module__": __name__})


EmptyBody = _refusal("EmptyBody", 422, "empty-body", "Empty body")
WrongMediaType = _refusal("WrongMediaType", 415, "wrong-media-type", "Unsupported media type")
# The response has Accept-Encoding (RFC 9110, 15.5.16).
PackedBody = _refusal("PackedBody", 415, "packed-body", "Unsupported content coding")
TooLarge = _refusal("TooLarge", 413, "too-large", "Body too large")
WrongProtocol = _refusal("WrongProtocol", 412, "wrong-protocol", "Unsupported version of the upload protocol")
WrongOffset = _refusal("WrongOffset", 409, "wrong-offset", "Wrong offset of the upload")
Locked = _refusal("Locked", 423, "locked", "Upload in use by another request")
# Status code of tus, not of HTTP.
WrongChecksum = _refusal("WrongChecksum", 460, "wrong-checksum", "Checksum mismatch")
UnknownChecksum = _refusal("UnknownChecksum", 400, "unknown-checksum", "Unknown checksum algorithm")
InUse = _refusal("InUse", 409, "in-use", "Needed by an unfinished job")
JobFinished = _refusal("JobFinished", 409, "job-finished", "The job has ended")
KeyReused = _refusal("KeyReused", 409, "key-reused", "Idempotency key used with another request")
QueueFull = _refusal("QueueFull", 429, "queue-full", "Too many queued jobs")
NotAuthenticated = _refusal("NotAuthenticated", 401, "not-let-in", "Authentication required")
Forbidden = _refusal("Forbidden", 403, "not-allowed", "Permission denied")
TooManyStreams = _refusal("TooManyStreams", 429, "too-many-streams", "Too many event streams")
QuotaExceeded = _refusal("QuotaExceeded", 507, "quota-used-up", "Storage quota exceeded")
NoAnimation = _refusal("NoAnimation", 409, "no-animation", "No animation")
NoPreview = _refusal("NoPreview", 409, "no-preview", "No preview")
NoBucket = _refusal("NoBucket", 409, "no-bucket", "No bucket for direct uploads")
NoSignIn = _refusal("NoSignIn", 404, "no-sign-in", "No sign-in")
Busy = _refusal("Busy", 503, "busy", "No worker available in time")


class Rejection(Refusal):
    """A refusal whose constructor has other arguments; it is pickled as plain InvalidInput."""

    def __reduce__(self) -> tuple[type[InvalidInput], tuple[str, str, str]]:
        return InvalidInput, (self.field, self.value, self.accepted)


class UnknownId(Rejection):
    """No item has this id."""

    problem = _problem(404, "unknown-id", "Unknown id")

    def __init__(self, field: str, value: str) -> None:
        listed = LISTED.get(field, f"{field}s")
        super().__init__(field, repr(value[:80]), f"the id of a {field} that exists; see GET /v1/{listed}")


class Deleted(Rejection, FileNotFoundError):  # noqa: N818 - a refusal, like the others
    """The item was deleted during the request."""

    problem = _problem(404, "deleted", "Deleted")

    def __init__(self, name: str) -> None:
        InvalidInput.__init__(self, "id", f"{name}, which has been deleted", "the id of an existing item")


class Damaged(Rejection):
    """The content of a stored file has changed."""

    problem = _problem(500, "stored-data-damaged", "Stored data is damaged")

    def __init__(self, name: str, found: str) -> None:
        accepted = (
            "the original content: restore the file from a backup, or delete the item and create it again"
        )
        super().__init__("stored data", f"{name}, {found}", accepted)


class RateLimited(Rejection):
    """The tenant exceeds a rate limit.

    Attributes:
        wait_s: time until the next request is accepted, s.
    """

    problem = _problem(429, "too-often", "Too many requests")

    def __init__(self, field: str, value: str, accepted: str, wait_s: float) -> None:
        super().__init__(field, value, accepted)
        self.wait_s = wait_s


class RangeNotSatisfiable(Rejection):
    """The requested range starts beyond the end of the file.

    Attributes:
        size: of the file, bytes.
    """

    problem = _problem(416, "no-such-part", "Range not satisfiable")

    def __init__(self, found: str, size: int) -> None:
        super().__init__("Range", repr(found), f"a range that starts within the {size} bytes")
        self.size = size


class StorageFull(Refusal):
    """The disk of the service is full."""

    problem = _problem(507, "storage-full", "Disk full")


class StorageUnavailable(Rejection):
    """The bucket with the files is unavailable."""

    problem = _problem(503, "storage-away", "Storage unavailable")

    def __init__(self, found: str) -> None:
        super().__init__("storage", found, "a later request, when the storage is available")


class DatabaseUnavailable(Rejection, SQLAlchemyError):  # noqa: N818 - a refusal, like the others
    """The database is unavailable, locked by another program, or overloaded."""

    problem = _problem(503, "database-away", "Database unavailable")

    def __init__(self, found: str) -> None:
        InvalidInput.__init__(self, "database", found, "a later request, when the database is available")


class DatabaseFull(Rejection, StorageFull, SQLAlchemyError):  # noqa: N818 - a refusal, like the others
    """The disk of the database is full."""

    def __init__(self) -> None:
        InvalidInput.__init__(self, "database", "no space to write a row", "more free disk space")


class ProviderUnavailable(Rejection):
    """The provider of sign-ins does not answer, or not as OpenID Connect says."""

    problem = _problem(503, "provider-away", "Sign-in unavailable")

    def __init__(self, found: str) -> None:
        super().__init__("OpenID provider", found, "a later request; see the log of the service")


class NotReady(Exception):  # noqa: N818 - names a state, like the other refusals
    """Parts of the service do not work; each fault is (part, found, needed)."""

    problem = _problem(503, "not-ready", "Service not ready")

    def __init__(self, faults: Sequence[tuple[str, str, str]]) -> None:
        self.faults = tuple(faults)
        super().__init__("; ".join(f"{component}: {fault}" for component, fault, _ in faults))
