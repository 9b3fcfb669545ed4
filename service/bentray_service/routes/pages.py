"""The web pages: viewer at /, REST reference at /docs, file formats at /docs/formats."""

from __future__ import annotations

from pathlib import Path

from fastapi import APIRouter, Request
from fastapi.responses import FileResponse, HTMLResponse, RedirectResponse

from ..web.reference import reference_page

WEB = Path(__file__).parent.parent / "web"

router = APIRouter(include_in_schema=False)


@router.get("/")
def viewer() -> FileResponse:
    """The viewer."""
    return FileResponse(WEB / "index.html", headers={"Cache-Control": "no-cache"})


@router.get("/docs")
def docs(request: Request) -> HTMLResponse:
    """The REST reference, generated from the OpenAPI description."""
    return HTMLResponse(reference_page(request.app.openapi()))


@router.get("/docs/formats")
def formats(request: Request) -> HTMLResponse:
    """The formats of files that are read."""
    # With it come all readers, which the service itself does not use.
    from ..web.formats import formats_page

    return HTMLResponse(formats_page(request.app.version))


@router.get("/problems/{slug}")
def problem(slug: str) -> RedirectResponse:
    """Redirect from the ``type`` of a problem to its description."""
    return RedirectResponse("/docs#problems")
