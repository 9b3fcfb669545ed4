"""What the client raises: the problem of the service, readable and with its fields."""

from __future__ import annotations

from typing import Any

import httpx


class ClientError(Exception):
    """The service refused, the job failed, or nothing answered.

    Attributes:
        status: the HTTP status, or None when there was no answer.
        field, found, accepted: from the problem, or None.
        problem: the whole problem, empty when there was none.
        upload: the id of the upload that was broken off; ``upload(…, resume=…)`` goes on with it.
        retry_after_s: how long the service asks to wait before the next attempt, s, or None.
    """

    def __init__(
        self, message: str, status: int | None = None, problem: dict[str, Any] | None = None
    ) -> None:
        super().__init__(message)
        self.status = status
        self.problem = problem or {}
        self.field: str | None = self.problem.get("field")
        self.found: str | None = self.problem.get("found")
        self.accepted: str | None = self.problem.get("accepted")
        self.upload: str | None = None
        self.retry_after_s: float | None = None


class NoAnswer(ClientError):  # noqa: N818 - names what happened, to whoever tries again
    """The connection could not be made, or broke.

    Attributes:
        sent: whether the service may have got the request.
    """

    def __init__(self, message: str, *, sent: bool = True) -> None:
        super().__init__(message)
        self.sent = sent


def no_answer(url: str, error: httpx.TransportError) -> NoAnswer:
    """The error of a connection that failed."""
    refused = isinstance(error, httpx.ConnectError | httpx.ConnectTimeout)
    return NoAnswer(f"no answer from {url}: {error}", sent=not refused)


def from_problem(problem: dict[str, Any], status: int | None = None) -> ClientError:
    """The error that a problem+json describes."""
    title, detail = problem.get("title", "The service refused"), problem.get("detail", "")
    return ClientError(f"{title}: {detail}" if detail else title, status or problem.get("status"), problem)


def from_response(response: httpx.Response) -> ClientError:
    """The error of an answer that is not a success."""
    if response.headers.get("content-type", "").startswith("application/problem+json"):
        error = from_problem(response.json(), response.status_code)
    else:
        words = f"{response.url} answered {response.status_code}, and not as Bentray does"
        error = ClientError(words, response.status_code)
    wait = response.headers.get("retry-after", "")
    if wait.isdecimal():
        error.retry_after_s = float(wait)
    return error
