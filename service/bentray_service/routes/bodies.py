"""Request parameters and bodies: list limits, accepted media types, and a size limit for JSON."""

from collections.abc import Callable, Coroutine
from typing import Annotated, Any

from fastapi import Header, Query, Request, Response
from fastapi.routing import APIRoute
from starlette.types import Message

from ..errors import TooLarge, WrongMediaType

# Parameter of all lists.
Limit = Annotated[int, Query(ge=1, le=1000, description="Maximum number of records.")]
# Header of requests that start jobs.
IdempotencyKey = Annotated[
    str | None,
    Header(
        min_length=1,
        max_length=200,
        description="Idempotency key: a repeated request with the same key starts nothing a second time; its "
        "answer is that of the first, with Idempotency-Replayed: true.",
    ),
]
# Jobs are a few hundred bytes.
LONGEST_JSON = 64 * 1024
FORM = "application/x-www-form-urlencoded"


def accept_media_types(*accepted: str) -> Callable[[Request], None]:
    """A dependency that rejects all other values of Content-Type.

    Raises:
        WrongMediaType: naming the accepted media types.
    """

    def check(request: Request) -> None:
        found = request.headers.get("content-type")
        if found is None or found.partition(";")[0].strip().lower() not in accepted:
            raise WrongMediaType("Content-Type", repr(found) if found else "nothing", " or ".join(accepted))

    return check


def accept_upload(*accepted: str) -> Callable[[Request], None]:
    """As ``accept_media_types``, for bodies that are files, which tell their format themselves.

    Without a Content-Type, or with that of a form, which ``curl --data-binary`` sends unless told otherwise,
    the body is taken as a file too, but from no browser: any web page may send both without being asked for.
    """
    check = accept_media_types(*accepted)

    def check_upload(request: Request) -> None:
        stated = request.headers.get("content-type", "")
        if stated not in ("", FORM) or "origin" in request.headers:
            check(request)

    return check_upload


def answer_made(response: Response, address: str, *, replayed: bool) -> None:
    """State in the headers where the thing is that a request made, and whether an earlier one made it."""
    response.headers["Location"] = address
    if replayed:
        response.headers["Idempotency-Replayed"] = "true"


class SmallBody(APIRoute):
    """A route that reads at most ``LONGEST_JSON`` bytes of the body."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        handler = super().get_route_handler()

        async def read_then_answer(request: Request) -> Response:
            # Of a body that would be rejected nothing is waited for.
            announced = int(request.headers.get("content-length", 0))
            if announced > LONGEST_JSON:
                raise TooLarge("body", f"{announced} bytes", f"at most {LONGEST_JSON} bytes")
            body = bytearray()
            async for chunk in request.stream():
                body += chunk
                if len(body) > LONGEST_JSON:
                    raise TooLarge("body", f"more than {LONGEST_JSON} bytes", f"at most {LONGEST_JSON} bytes")

            replayed = False

            async def again() -> Message:
                nonlocal replayed
                if replayed:
                    # Waits for the end of the connection.
                    return await request.receive()
                replayed = True
                return {"type": "http.request", "body": bytes(body), "more_body": False}

            return await handler(Request(request.scope, again))

        return read_then_answer
