"""Rendered images with ETag and rate limit, until the client disconnects; views from query parameters."""

import asyncio
import hashlib
import inspect
import math
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import fields
from typing import Annotated, Any, TypeVar, get_type_hints

from fastapi import Depends, Query, Request, Response
from starlette.requests import ClientDisconnect

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.request_fields import check_used
from bentray_workers.rendering.field_view import FieldView
from bentray_workers.rendering.refraction_view import RefractionView

from .. import __version__
from ..rows.tables import StoredRow
from ..web.errors import problems
from ..wiring import Context, RequestContext
from .downloads import headers_of, unchanged, without_length

Made = TypeVar("Made")

# Rays of a picture that counts in full in the rate limit, and what the smallest one counts.
WHOLE_RAYS = 2**18
LEAST_SHARE = 0.1

# Responses of a rendered image.
PICTURE: dict[int | str, dict[str, Any]] = {
    200: {"content": {"image/png": {}}, "description": "The picture."},
    304: {"description": "Not modified."},
    **problems(404, 422, 429, 503),
}

View = TypeVar("View")


async def picture(
    context: RequestContext,
    item: StoredRow,
    how: Mapping[str, Any],
    draw: Callable[[], Awaitable[bytes]],
    media_type: str = "image/png",
) -> Response:
    """The response with a PNG or another result of a worker, or 304.

    Args:
        context: HEAD is answered without rendering, hence without Content-Length.
        item: what is shown.
        how: all other parameters of the image.
        draw: renders the image; cancelled when the client disconnects.
        media_type: of the image.
    """
    request = context.request
    seed = repr((__version__, item.id, item.created, sorted(how.items())))
    tag = f'"{hashlib.sha256(seed.encode()).hexdigest()[:32]}"'
    if (response := unchanged(request, tag)) is not None:
        return response
    if request.method == "HEAD":
        return without_length(media_type, headers_of(tag))
    context.check_render(_share(how))
    return Response(await while_connected(request, draw()), media_type=media_type, headers=headers_of(tag))


def _share(how: Mapping[str, Any]) -> float:
    """Weight of a picture in the rate limit; a viewer that turns an object requests many small ones."""
    times = how.get("rays", how.get("degree", 1) if how.get("supersampling") == "real" else 1)
    side = how.get("size") or math.inf
    rays: float = how.get("width", side) * how.get("height", side) * (times / how.get("ray_spacing", 1)) ** 2
    return min(1.0, max(LEAST_SHARE, rays / WHOLE_RAYS))


async def check_render_rate(context: Context) -> None:
    """Limit the rate of what workers compute like that of rendered images."""
    context.check_render()


async def while_connected(request: Request, work: Awaitable[Made]) -> Made:
    """Await ``work``; it is cancelled when the client disconnects.

    Args:
        request: its body has been read, or is empty.
        work: on the cluster.

    Raises:
        ClientDisconnect: when the client has disconnected.
    """
    making, leaving = asyncio.ensure_future(work), asyncio.ensure_future(_left(request))
    try:
        await asyncio.wait((making, leaving), return_when=asyncio.FIRST_COMPLETED)
        if making.done():
            return making.result()
        raise ClientDisconnect
    finally:
        for one in (making, leaving):
            one.cancel()
        await asyncio.gather(making, leaving, return_exceptions=True)


async def _left(request: Request) -> None:
    while (await request.receive())["type"] != "http.disconnect":
        """The empty body of the request."""


def view_dependency(kind: type[View], **fixed: Any) -> Callable[..., View]:
    """A dependency that builds a view from the query.

    It raises InvalidInput for parameters that are unknown or have no effect beside the others.

    Args:
        kind: a dataclass whose fields have a ``description`` in their metadata.
        fixed: values of fields that are no parameters.
    """
    names = [field.name for field in fields(kind) if field.name not in fixed]  # type: ignore[arg-type]

    def view_of(request: Request, **values: Any) -> View:
        for name in request.query_params:
            if name not in names:
                raise InvalidInput(name, repr(request.query_params[name])[:80], "one of " + ", ".join(names))
        given = {name: tuple(v) if isinstance(v, list) else v for name, v in values.items()}
        view = kind(**given, **fixed)
        checked: View = check_used(view)
        return checked

    view_of.__signature__ = _signature(kind, names)  # type: ignore[attr-defined]
    return view_of


def _signature(kind: type[Any], names: Sequence[str]) -> inspect.Signature:
    """The signature for FastAPI: the named fields of the view with their descriptions."""
    types = get_type_hints(kind)
    parameters = [inspect.Parameter("request", inspect.Parameter.KEYWORD_ONLY, annotation=Request)]
    for field in (field for field in fields(kind) if field.name in names):
        default: Any = field.default
        several = isinstance(default, tuple)
        annotation: Any = list[float] if several else types[field.name]
        query = Query(
            description=field.metadata["description"] + (" May be repeated." if several else ""),
            json_schema_extra=field.metadata.get("json_schema_extra"),
        )
        parameters.append(
            inspect.Parameter(
                field.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=list(default) if several else default,
                annotation=Annotated[annotation, query],
            )
        )
    return inspect.Signature(parameters)


ViewParameters = Annotated[RefractionView, Depends(view_dependency(RefractionView))]
FieldViewParameters = Annotated[FieldView, Depends(view_dependency(FieldView))]
# Without a field all rays are exact.
MeshViewParameters = Annotated[FieldView, Depends(view_dependency(FieldView, lookup="exact", eye="exact"))]
