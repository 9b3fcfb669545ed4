"""What the service refuses beside plain bad input; each names the field, what was found and what is taken."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy.exc import SQLAlchemyError

from bentray_kernels.errors import InvalidInput

# Where things are listed that are not called as their ids are.
LISTED = {"mesh": "meshes", "field": "geometry-fields"}


class Refusal(InvalidInput):
    """A refusal whose constructor takes other arguments than the three parts; it is pickled by these."""

    def __reduce__(self) -> tuple[type[InvalidInput], tuple[str, str, str]]:
        return InvalidInput, (self.field, self.value, self.accepted)


class UnknownId(Refusal):
    """Nothing of this kind has this id."""

    def __init__(self, field: str, value: str) -> None:
        listed = LISTED.get(field, f"{field}s")
        super().__init__(field, repr(value[:80]), f"the id of a {field} that exists; see GET /v1/{listed}")


class Deleted(Refusal, FileNotFoundError):  # noqa: N818 - a refusal, like the others
    """It was deleted while the request was on its way."""

    def __init__(self, name: str) -> None:
        InvalidInput.__init__(self, "id", f"{name}, which has been deleted", "an id of what is there")


class Damaged(Refusal):
    """What lies on the disk is not what was stored."""

    def __init__(self, name: str, found: str) -> None:
        accepted = "the bytes that were stored: restore its file from a backup, or delete it and make it anew"
        super().__init__("stored data", f"{name}, {found}", accepted)


class WrongMediaType(Refusal):
    """The Content-Type of the request is not one that the route takes."""

    def __init__(self, found: str | None, accepted: Sequence[str]) -> None:
        super().__init__("Content-Type", repr(found) if found else "nothing", " or ".join(accepted))


class EmptyBody(InvalidInput):
    """The request has no body."""


class TooLarge(InvalidInput):
    """The body is larger than the service takes."""


class BodyTimeout(InvalidInput):
    """The body hardly comes."""


class TinyChunks(InvalidInput):
    """The body comes in chunks so small that most of the work is with them."""


class MalformedRequest(InvalidInput):
    """What came is no HTTP."""


class UnknownMethod(InvalidInput):
    """The method is one that nothing here knows."""


class HeadersTooLarge(InvalidInput):
    """The head of the request is too long."""


class TooManyConnections(InvalidInput):
    """So many connections are open that this one cannot be served."""


class WrongProtocol(InvalidInput):
    """The request does not speak the version of the upload protocol that the service does."""


class WrongOffset(InvalidInput):
    """What was sent does not begin where the upload stands."""


class Locked(InvalidInput):
    """Another request is at work on it."""


class WrongChecksum(InvalidInput):
    """What came is not what was sent."""


class UnknownChecksum(InvalidInput):
    """The checksum is of a kind that the service does not know."""


class InUse(InvalidInput):
    """A job that is not at its end needs it."""


class JobFinished(InvalidInput):
    """The job has ended, so nothing can be asked of it any more."""


class KeyReused(InvalidInput):
    """The idempotency key came with another request before."""


class QueueFull(InvalidInput):
    """So many jobs wait already that no more are taken for now."""


class NotAuthenticated(InvalidInput):
    """The caller is not known."""


class Forbidden(InvalidInput):
    """The caller is known, and may not do this."""


class RateLimited(Refusal):
    """The tenant asks more often than it may.

    Attributes:
        wait_s: after which it may again.
    """

    def __init__(self, field: str, value: str, accepted: str, wait_s: float) -> None:
        super().__init__(field, value, accepted)
        self.wait_s = wait_s


class TooManyStreams(InvalidInput):
    """So many event streams are open that no more are taken for now."""


class QuotaExceeded(InvalidInput):
    """The tenant stores as much as it may."""


class RangeNotSatisfiable(Refusal):
    """A part of a file was asked for that begins beyond its end.

    Attributes:
        size: of the file, bytes.
    """

    def __init__(self, found: str, size: int) -> None:
        super().__init__("Range", repr(found), f"a part that begins within the {size} bytes")
        self.size = size


class NoAnimation(Refusal):
    """The job is none of kind refraction, or has no result."""

    def __init__(self, job_id: str, kind: str, state: str) -> None:
        super().__init__("job", f"{job_id}, {kind}, {state}", "a job of kind refraction that has succeeded")


class StorageFull(InvalidInput):
    """The disk of the service is full."""


class StorageUnavailable(Refusal):
    """The bucket that keeps the files does not answer, or refuses."""

    def __init__(self, found: str) -> None:
        super().__init__("storage", found, "another try, once it answers again")


class DatabaseUnavailable(Refusal, SQLAlchemyError):  # noqa: N818 - a refusal, like the others
    """The database does not answer, is held by another program, or has too many waiting for it already."""

    def __init__(self, found: str) -> None:
        InvalidInput.__init__(self, "database", found, "another try, once it answers again")


class DatabaseFull(Refusal, StorageFull, SQLAlchemyError):  # noqa: N818 - a refusal, like the others
    """The disk of the database is full."""

    def __init__(self) -> None:
        InvalidInput.__init__(
            self, "database", "no space to write a row", "a larger disk, or other files gone"
        )


class Busy(InvalidInput):
    """No worker took the task in time."""


class NotReady(Exception):  # noqa: N818 - names a state, like the other refusals
    """Some part that the service needs does not work; each fault is (part, found, needed)."""

    def __init__(self, faults: Sequence[tuple[str, str, str]]) -> None:
        self.faults = tuple(faults)
        super().__init__("; ".join(f"{part}: {found}" for part, found, _ in faults))
