"""What the client raises: the problem of the service, readable and with its fields."""

from __future__ import annotations

import httpx

from ..web.problem import Problem


class ClientError(Exception):
    """The service refused, the job failed, or nothing answered.

    Attributes:
        status: the HTTP status, or None when there was no answer.
        field, found, accepted: from the problem, or None.
        problem: the whole problem, or None.
        upload: the id of the upload that was broken off; ``upload(…, resume=…)`` goes on with it.
        retry_after_s: how long the service asks to wait before the next attempt, s, or None.
    """

    def __init__(self, message: str, status: int | None = None, problem: Problem | None = None) -> None:
        super().__init__(message)
        self.status = status
        self.problem = problem
        self.field: str | None = getattr(problem, "field", None)
        self.found: str | None = getattr(problem, "found", None)
        self.accepted: str | None = getattr(problem, "accepted", None)
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


def from_problem(problem: Problem | None) -> ClientError:
    """The error that a problem+json describes."""
    if problem is None:
        return ClientError("The service refused without a reason")
    detail = f": {problem.detail}" if problem.detail else ""
    return ClientError(problem.title + detail, problem.status, problem)


def from_response(response: httpx.Response) -> ClientError:
    """The error of an answer that is not a success."""
    if response.headers.get("content-type", "").startswith("application/problem+json"):
        error = from_problem(Problem.model_validate_json(response.content))
    else:
        words = f"{response.url} answered {response.status_code}, and not as Bentray does"
        error = ClientError(words, response.status_code)
    wait = response.headers.get("retry-after", "")
    if wait.isdecimal():
        error.retry_after_s = float(wait)
    return error
