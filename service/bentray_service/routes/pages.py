"""The pages for people: the viewer at /, the reference at /docs and their static files."""

from __future__ import annotations

from pathlib import Path

from fastapi import APIRouter, Request
from fastapi.responses import FileResponse, HTMLResponse, RedirectResponse

from ..web.reference import reference_page

WEB = Path(__file__).parent.parent / "web"

router = APIRouter(include_in_schema=False)


@router.get("/")
def viewer() -> FileResponse:
    """Upload, start, watch."""
    return FileResponse(WEB / "index.html", headers={"Cache-Control": "no-cache"})


@router.get("/docs")
def docs(request: Request) -> HTMLResponse:
    """The REST interface, written out from its OpenAPI description."""
    return HTMLResponse(reference_page(request.app.openapi()))


@router.get("/problems/{slug}")
def problem(slug: str) -> RedirectResponse:
    """Where the ``type`` of a problem leads."""
    return RedirectResponse("/docs#problems")
