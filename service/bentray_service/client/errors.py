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


class NoAnswer(ClientError):  # noqa: N818 - names what happened, to whoever tries again
    """The connection could not be made, or broke."""


def from_problem(problem: dict[str, Any], status: int | None = None) -> ClientError:
    """The error that a problem+json describes."""
    title, detail = problem.get("title", "The service refused"), problem.get("detail", "")
    return ClientError(f"{title}: {detail}" if detail else title, status or problem.get("status"), problem)


def from_response(response: httpx.Response) -> ClientError:
    """The error of an answer that is not a success."""
    if response.headers.get("content-type", "").startswith("application/problem+json"):
        return from_problem(response.json(), response.status_code)
    return ClientError(
        f"{response.url} answered {response.status_code}, and not as Bentray does", response.status_code
    )
