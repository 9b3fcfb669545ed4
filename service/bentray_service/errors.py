"""Errors of the service with the field, the value found and the values accepted."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy.exc import SQLAlchemyError

from bentray_kernels.errors import InvalidInput

# Resources with irregular plurals.
LISTED = {"mesh": "meshes", "field": "geometry-fields", "batch": "batches"}


class Rejection(InvalidInput):
    """A refusal whose constructor has other arguments; it is pickled as plain InvalidInput."""

    def __reduce__(self) -> tuple[type[InvalidInput], tuple[str, str, str]]:
        return InvalidInput, (self.field, self.value, self.accepted)


class UnknownId(Rejection):
    """No item has this id."""

    def __init__(self, field: str, value: str) -> None:
        listed = LISTED.get(field, f"{field}s")
        super().__init__(field, repr(value[:80]), f"the id of a {field} that exists; see GET /v1/{listed}")


class Deleted(Rejection, FileNotFoundError):  # noqa: N818 - a refusal, like the others
    """The item was deleted during the request."""

    def __init__(self, name: str) -> None:
        InvalidInput.__init__(self, "id", f"{name}, which has been deleted", "the id of an existing item")


class Damaged(Rejection):
    """The content of a stored file has changed."""

    def __init__(self, name: str, found: str) -> None:
        accepted = (
            "the original content: restore the file from a backup, or delete the item and create it again"
        )
        super().__init__("stored data", f"{name}, {found}", accepted)


class WrongMediaType(Rejection):
    """The Content-Type is not accepted."""

    def __init__(self, found: str | None, accepted: Sequence[str]) -> None:
        super().__init__("Content-Type", repr(found) if found else "nothing", " or ".join(accepted))


class PackedBody(Rejection):
    """The body is packed; the response has Accept-Encoding (RFC 9110, 15.5.16)."""

    def __init__(self, header: str, found: str, accepted: str) -> None:
        super().__init__(header, repr(found[:80]), f"{accepted}: send the body as it is, without packing")


class EmptyBody(InvalidInput):
    """The request has no body."""


class TooLarge(InvalidInput):
    """The body is too large."""


class WrongProtocol(InvalidInput):
    """The request has another version of the upload protocol."""


class WrongOffset(InvalidInput):
    """The offset of the data differs from that of the upload."""


class Locked(InvalidInput):
    """Another request uses the upload."""


class WrongChecksum(InvalidInput):
    """The received data does not match its checksum."""


class UnknownChecksum(InvalidInput):
    """The checksum algorithm is unknown."""


class InUse(InvalidInput):
    """An unfinished job needs the item."""


class JobFinished(InvalidInput):
    """The job has ended and cannot be changed."""


class KeyReused(InvalidInput):
    """The idempotency key was used with another request."""


class QueueFull(InvalidInput):
    """Too many jobs are queued."""


class NotAuthenticated(InvalidInput):
    """The caller is not authenticated."""


class Forbidden(InvalidInput):
    """The caller does not have the required permission."""


class RateLimited(Rejection):
    """The tenant exceeds a rate limit.

    Attributes:
        wait_s: time until the next request is accepted, s.
    """

    def __init__(self, field: str, value: str, accepted: str, wait_s: float) -> None:
        super().__init__(field, value, accepted)
        self.wait_s = wait_s


class TooManyStreams(InvalidInput):
    """Too many event streams are open."""


class QuotaExceeded(InvalidInput):
    """The storage quota of the tenant is exceeded."""


class RangeNotSatisfiable(Rejection):
    """The requested range starts beyond the end of the file.

    Attributes:
        size: of the file, bytes.
    """

    def __init__(self, found: str, size: int) -> None:
        super().__init__("Range", repr(found), f"a range that starts within the {size} bytes")
        self.size = size


class NoAnimation(Rejection):
    """The job has no animation: it has another kind, or has not succeeded."""

    def __init__(self, job_id: str, kind: str, state: str) -> None:
        super().__init__("job", f"{job_id}, {kind}, {state}", "a successful job of kind refraction")


class NoPreview(Rejection):
    """The job has no image to preview: it has another kind, does not run, or has not got that far."""

    def __init__(self, job_id: str, kind: str, found: str) -> None:
        accepted = "a running job of kind reconstruction, after its first iteration"
        super().__init__("job", f"{job_id}, {kind}, {found}", accepted)


class StorageFull(InvalidInput):
    """The disk of the service is full."""


class StorageUnavailable(Rejection):
    """The bucket with the files is unavailable."""

    def __init__(self, found: str) -> None:
        super().__init__("storage", found, "a later request, when the storage is available")


class DatabaseUnavailable(Rejection, SQLAlchemyError):  # noqa: N818 - a refusal, like the others
    """The database is unavailable, locked by another program, or overloaded."""

    def __init__(self, found: str) -> None:
        InvalidInput.__init__(self, "database", found, "a later request, when the database is available")


class DatabaseFull(Rejection, StorageFull, SQLAlchemyError):  # noqa: N818 - a refusal, like the others
    """The disk of the database is full."""

    def __init__(self) -> None:
        InvalidInput.__init__(self, "database", "no space to write a row", "more free disk space")


class NoBucket(Rejection):
    """The files of the service are not in a bucket."""

    def __init__(self) -> None:
        super().__init__("storage", "no bucket", "a resumable upload (/v1/uploads)")


class NoSignIn(Rejection):
    """The service has no OpenID provider."""

    def __init__(self) -> None:
        super().__init__("sign-in", "no OpenID provider", "an API key; BENTRAY_OIDC_ISSUER names a provider")


class ProviderUnavailable(Rejection):
    """The provider of sign-ins does not answer, or not as OpenID Connect says."""

    def __init__(self, found: str) -> None:
        super().__init__("OpenID provider", found, "a later request; see the log of the service")


class Busy(InvalidInput):
    """No worker was available in time."""


class NotReady(Exception):  # noqa: N818 - names a state, like the other refusals
    """Parts of the service do not work; each fault is (part, found, needed)."""

    def __init__(self, faults: Sequence[tuple[str, str, str]]) -> None:
        self.faults = tuple(faults)
        super().__init__("; ".join(f"{component}: {fault}" for component, fault, _ in faults))
