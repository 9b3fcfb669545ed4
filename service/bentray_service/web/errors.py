"""Error responses as problem+json (RFC 9457), and exception handlers."""

import errno
import json
import logging
import math
import secrets
from collections.abc import Mapping, Sequence
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import Response
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.routing import Match, Mount

from bentray_kernels.errors import InvalidInput

from .. import errors
from ..errors import PROBLEMS, ProblemType
from .middleware import REQUEST_ID, SECURITY_HEADERS
from .problem import Fault, Problem

log = logging.getLogger("bentray.errors")

MEDIA_TYPE = "application/problem+json"
LONGEST_FOUND = 120
# Suggested time before the next attempt, s.
RETRY_AFTER = "10"
METHODS = ("DELETE", "GET", "HEAD", "OPTIONS", "PATCH", "POST", "PUT")


# Temporary problems; the response has Retry-After.
LATER = (
    errors.Busy,
    errors.DatabaseUnavailable,
    errors.ProviderUnavailable,
    errors.QueueFull,
    errors.StorageUnavailable,
    errors.TooManyStreams,
)
# Answered by the proxy in front (deploy/nginx.conf) for requests that do not reach the service.
EDGE = (
    ProblemType(400, "malformed-request", "Malformed request"),
    ProblemType(408, "too-slow", "Body received too slowly"),
    ProblemType(414, "address-too-long", "Address too long"),
    ProblemType(431, "head-too-large", "Request headers too long"),
    ProblemType(502, "service-away", "Service unavailable"),
    ProblemType(503, "too-many-connections", "Too many connections"),
    ProblemType(504, "service-away", "Service unavailable"),
)
INVALID_REQUEST = ProblemType(422, "invalid-request", "Invalid request")
UNREADABLE = ProblemType(400, "unreadable-body", "Unreadable body")
NOT_FOUND = ProblemType(404, "not-found", "Unknown address")
INTERNAL = ProblemType(500, "internal", "Internal error")
FAILED = ProblemType(500, "job-failed", "Job failed")


def make_problem(kind: ProblemType, detail: str, faults: Sequence[Fault] = (), **more: Any) -> Problem:
    """A problem of a type; the fields of the first fault are repeated at the top level."""
    first = faults[0].model_dump() if faults else {}
    return Problem(
        type=f"/problems/{kind.slug}", title=kind.title, status=kind.status, detail=detail, **first, **more
    )


def problem_of(error: InvalidInput, instance: str | None = None) -> Problem:
    """The problem for an :class:`InvalidInput` or a refusal."""
    kind = error.problem if isinstance(error, errors.Refusal) else errors.INVALID
    fault = Fault(field=error.field, found=error.value, accepted=error.accepted)
    return make_problem(kind, str(error), [fault], instance=instance)


def problems(*statuses: int | str) -> dict[int | str, dict[str, Any]]:
    """The error responses of a route, for the OpenAPI description."""
    content = {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}
    titles: dict[int | str, list[str]] = {"default": ["A problem"]}
    for kind in (*EDGE, *PROBLEMS, INVALID_REQUEST, UNREADABLE):
        titles.setdefault(kind.status, []).append(kind.title)
    words = {status: "; or: ".join(dict.fromkeys(said)) for status, said in titles.items()}
    return {status: {"description": words[status], "content": content} for status in statuses}


def fault_of(error: Mapping[str, Any], job_kinds: Sequence[str] = ()) -> Fault:
    """Convert an entry of ``ValidationError.errors()`` to field, found, accepted."""
    where = [str(part) for part in error["loc"]]
    if where and where[0] in ("body", "query", "path", "header") and len(where) > 1:
        where = where[1:]
        # Pydantic adds the kind of job to the location; it is not part of the request.
        if where[0] in job_kinds:
            where = where[1:] or ["body"]
    context = error.get("ctx", {})
    if error["type"] in ("union_tag_invalid", "union_tag_not_found"):
        field = str(context["discriminator"]).strip("'")
        found = repr(context["tag"])[:LONGEST_FOUND] if "tag" in context else "nothing"
        return Fault(field=field, found=found, accepted=" or ".join(map(repr, job_kinds)))
    cause = context.get("error")
    if isinstance(cause, InvalidInput):
        # A nested record names itself in its errors.
        inner = where[:-1] if where and cause.field.startswith(f"{where[-1]}.") else where
        return Fault(field=".".join([*inner, cause.field]), found=cause.value, accepted=cause.accepted)
    if error["type"] == "json_invalid":
        return Fault(field="body", found=f"no JSON ({cause})", accepted="a JSON object")
    if error["type"] in ("model_attributes_type", "dataclass_type"):
        return Fault(field=".".join(where), found=_short(error["input"]), accepted="a JSON object")
    if error["type"] == "missing":
        return Fault(field=".".join(where), found="nothing", accepted="a value; it is required")
    if error["type"] == "extra_forbidden":
        return Fault(field=".".join(where), found=_short(error["input"]), accepted="no such field; see /docs")
    message = error["msg"].removeprefix("Input should be ").partition(", unable to parse")[0]
    accepted = str(context.get("expected") or message)
    return Fault(field=".".join(where), found=_short(error["input"]), accepted=accepted)


def install_handlers(app: FastAPI, job_kinds: Sequence[str] = ()) -> None:
    """Convert all errors of ``app`` to problems; ``job_kinds`` are the accepted kinds of job."""

    def invalid_request(request: Request, error: Exception) -> Response:
        assert isinstance(error, RequestValidationError)
        faults = [fault_of(one, job_kinds) for one in error.errors()]
        words = "; ".join(f"{one.field}: found {one.found}; accepted: {one.accepted}" for one in faults)
        return _respond(
            make_problem(INVALID_REQUEST, words, faults, errors=faults, instance=request.url.path)
        )

    app.add_exception_handler(InvalidInput, _refused)
    app.add_exception_handler(errors.NotReady, _not_ready)
    app.add_exception_handler(RequestValidationError, invalid_request)
    app.add_exception_handler(ClientDisconnect, _disconnected)
    app.add_exception_handler(HTTPException, _http)
    app.add_exception_handler(OSError, _system_error)
    app.add_exception_handler(Exception, _unexpected)


def _respond(problem: Problem, headers: Mapping[str, str] | None = None) -> Response:
    # Escaped to ASCII, since the found value may contain lone surrogates.
    body = json.dumps(problem.model_dump(exclude_none=True))
    return Response(body, problem.status, headers=headers, media_type=MEDIA_TYPE)


def _refused(request: Request, error: Exception) -> Response:
    assert isinstance(error, InvalidInput)
    return problem_response(error, request.url.path)


def problem_response(error: InvalidInput, path: str | None) -> Response:
    """The response for an :class:`InvalidInput` or a refusal."""
    headers: dict[str, str] = {}
    if isinstance(error, LATER):
        headers["Retry-After"] = RETRY_AFTER
    if isinstance(error, errors.RateLimited):
        headers["Retry-After"] = str(math.ceil(error.wait_s))
    if isinstance(error, errors.NotAuthenticated):
        headers["WWW-Authenticate"] = 'Bearer realm="bentray"'
    if isinstance(error, errors.PackedBody):
        headers["Accept-Encoding"] = "identity"
    if isinstance(error, errors.RangeNotSatisfiable):
        headers["Content-Range"] = f"bytes */{error.size}"
    return _respond(problem_of(error, path), headers)


def _system_error(request: Request, error: Exception) -> Response:
    """A full disk; all other errors are unexpected."""
    if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
        full = errors.StorageFull("disk", "no space left", "a later request, when there is free space")
        return problem_response(full, request.url.path)
    raise error


def _not_ready(request: Request, error: Exception) -> Response:
    assert isinstance(error, errors.NotReady)
    faults = [Fault(field=part, found=found, accepted=needed) for part, found, needed in error.faults]
    problem = make_problem(error.problem, str(error), faults, errors=faults, instance=request.url.path)
    return _respond(problem, {"Retry-After": "5"})


def _http(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    path = request.url.path
    if error.status_code == NOT_FOUND.status:
        return _respond(
            make_problem(NOT_FOUND, f"unknown address {path}; see /docs for all addresses", instance=path)
        )
    if error.status_code == UNREADABLE.status:
        fault = Fault(
            field="body", found="unreadable JSON", accepted="a JSON object in UTF-8, not deeply nested"
        )
        words = f"{fault.field}: found {fault.found}; accepted: {fault.accepted}"
        return _respond(make_problem(UNREADABLE, words, [fault], instance=path))
    phrase = HTTPStatus(error.status_code).phrase
    kind = ProblemType(error.status_code, phrase.lower().replace(" ", "-"), phrase)
    if error.status_code != HTTPStatus.METHOD_NOT_ALLOWED:
        return _respond(make_problem(kind, str(error.detail), instance=path), error.headers)
    allowed = ", ".join(_methods(request))
    detail = f"{request.method} is not allowed at {path}; accepted: {allowed}"
    return _respond(make_problem(kind, detail, instance=path), {"Allow": allowed})


def _methods(request: Request) -> list[str]:
    """The allowed methods of an address; the router only reports those of the first route."""
    # Mounts match every method; they contain static files, which are read-only.
    routes = [route for route in request.app.routes if not isinstance(route, Mount)]
    allowed = [
        method
        for method in METHODS
        if any(route.matches({**request.scope, "method": method})[0] is Match.FULL for route in routes)
    ]
    return allowed or ["GET", "HEAD"]


def _disconnected(request: Request, error: Exception) -> Response:
    """The client has disconnected; nobody reads this response."""
    log.info("%s %s: the client disconnected", request.method, request.url.path)
    return Response(status_code=UNREADABLE.status)


def _unexpected(request: Request, error: Exception) -> Response:
    # The request id is in all log lines of the request.
    number = getattr(request.state, "request_id", None) or secrets.token_hex(8)
    figures = {"request": number}
    words = "%s %s failed [%s]"
    log.error(words, request.method, request.url.path, number, exc_info=error, extra={"figures": figures})
    detail = f"internal error of the service; see the log entry {number}"
    # This response bypasses the middleware.
    headers = {**SECURITY_HEADERS, REQUEST_ID: number}
    return _respond(make_problem(INTERNAL, detail, instance=request.url.path, correlation_id=number), headers)


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= LONGEST_FOUND else text[: LONGEST_FOUND - 1] + "…"
