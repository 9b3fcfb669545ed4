"""The web pages: viewer at /, documentation, REST reference at /docs, file formats at /docs/formats."""

from pathlib import Path
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import FileResponse, HTMLResponse, RedirectResponse, Response
from starlette.concurrency import run_in_threadpool

from bentray_workers.files.export.registry import FORMATS

from ..web.documents import documentation_files, missing_page
from ..web.reference import reference_page
from ..web.written_pages import found_pages, page_files, written_page

WEB = Path(__file__).parent.parent / "web"
# Characters of a search of the documentation.
LONGEST_SEARCH = 200

router = APIRouter(include_in_schema=False)


@router.get("/")
def viewer() -> FileResponse:
    """The viewer."""
    return FileResponse(WEB / "index.html", headers={"Cache-Control": "no-cache"})


@router.get("/documentation")
def documentation_start() -> RedirectResponse:
    """Redirect to the start page, so that its relative links lead into the folder."""
    return RedirectResponse("/documentation/")


@router.get("/documentation/{path:path}")
async def documentation(path: str, request: Request, q: str = "") -> Response:
    """A file of the built documentation; where it is not built, a page as it is written, or a search."""
    files = documentation_files()
    if files is not None:
        return await files.get_response(path or ".", request.scope)
    if path in page_files() and path.endswith(".png"):
        return FileResponse(page_files()[path])
    version = request.app.version
    if q:
        return HTMLResponse(await run_in_threadpool(found_pages, q[:LONGEST_SEARCH], version))
    page = await run_in_threadpool(written_page, path, version)
    return HTMLResponse(page or missing_page(version), 200 if page else 404)


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


@router.get("/static/export_formats.json")
def export_formats() -> list[dict[str, Any]]:
    """The formats of exports, which the page lists."""
    return [{"format": name, "title": form.title, "single": form.single} for name, form in FORMATS.items()]


@router.get("/problems/{slug}")
def problem(slug: str) -> RedirectResponse:
    """Redirect from the ``type`` of a problem to its description."""
    return RedirectResponse("/docs#problems")
