"""Errors of the client, with the problem returned by the service."""

from __future__ import annotations

import httpx

from ..web.outbound import through_proxy
from ..web.problem import Problem


class ClientError(Exception):
    """The service rejected a request, a job failed, or there was no answer.

    Attributes:
        status: HTTP status, or None without an answer.
        field, found, accepted: from the problem, or None.
        problem: the problem, or None.
        upload: id of an interrupted upload, to continue with ``upload(…, resume=…)``.
        retry_after_s: suggested time before the next attempt, s, or None.
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
    """The connection failed.

    Attributes:
        sent: whether the service may have received the request.
    """

    def __init__(self, message: str, *, sent: bool = True) -> None:
        super().__init__(message)
        self.sent = sent


def no_answer(url: str, error: httpx.TransportError) -> NoAnswer:
    """The error for a failed connection."""
    refused = isinstance(error, httpx.ConnectError | httpx.ConnectTimeout)
    proxy = through_proxy(error.request.url)
    hint = ""
    if "CERTIFICATE_VERIFY_FAILED" in str(error):
        hint = "; SSL_CERT_FILE names a file with the certificate of your own authority"
    elif isinstance(error, httpx.ConnectError) and not proxy:
        hint = "; bentray serve starts a service"
    return NoAnswer(f"no answer from {url}{proxy}: {error}{hint}", sent=not refused)


def from_problem(problem: Problem | None) -> ClientError:
    """The error for a problem+json."""
    if problem is None:
        return ClientError("The service refused without a reason")
    detail = f": {problem.detail}" if problem.detail else ""
    return ClientError(problem.title + detail, problem.status, problem)


def from_response(response: httpx.Response) -> ClientError:
    """The error for an unsuccessful response."""
    if response.headers.get("content-type", "").startswith("application/problem+json"):
        error = from_problem(Problem.model_validate_json(response.content))
    else:
        proxy = through_proxy(response.url)
        if proxy and response.status_code >= httpx.codes.INTERNAL_SERVER_ERROR:
            # Of the proxy: the service itself may not exist.
            return NoAnswer(f"no answer from {response.url}{proxy}: status {response.status_code}")
        words = f"{response.url} answered {response.status_code}{proxy}, but not as a Bentray service"
        error = ClientError(words, response.status_code)
    wait = response.headers.get("retry-after", "")
    if wait.isdecimal():
        error.retry_after_s = float(wait)
    return error
