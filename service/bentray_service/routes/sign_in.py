"""/sign-in and /sign-out: users of the page sign in at an OpenID provider."""

import logging
from collections.abc import Callable
from html import escape
from typing import TypeVar

import anyio
import anyio.to_thread
from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.status import HTTP_303_SEE_OTHER

from bentray_kernels.errors import InvalidInput

from ..access.browser_sessions import CALLBACK, START, BrowserSessions, Cookie
from ..errors import NoSignIn
from ..web.documents import document
from ..web.errors import problem_of
from ..wiring import access_of

log = logging.getLogger("bentray.access")

router = APIRouter(include_in_schema=False)

Result = TypeVar("Result")

THREADS = 4
NO_STORE = {"Cache-Control": "no-store"}


@router.get("/sign-in/provider")
def provider(request: Request) -> JSONResponse:
    """The name of the OpenID provider for the page; null without one."""
    browsers = access_of(request.scope).sign_in.browsers
    return JSONResponse({"name": None if browsers is None else browsers.name})


@router.get("/sign-in")
async def begin(request: Request, address: str = START) -> Response:
    """Redirect to the provider."""
    peer = request.client
    access_of(request.scope).sign_in.check_sign_in(peer.host if peer else "")
    browsers = _browsers(request)
    url, cookie = await _in_thread(request, lambda: browsers.begin(address))
    return _redirect(url, [cookie])


@router.get(CALLBACK)
async def finish(request: Request) -> Response:
    """Start a session with the response of the provider, and return to the page; else say why not."""
    browsers = _browsers(request)
    try:
        address, caller, cookies = await _in_thread(
            request, lambda: browsers.finish(request.query_params, request.headers)
        )
    except InvalidInput as error:
        problem = problem_of(error)
        log.warning("sign-in refused: %s", error)
        text = (
            f"<h2>{escape(problem.title)}</h2><p>The sign-in did not succeed. {escape(problem.detail)}.</p>"
            '<p><a href="/sign-in">Sign in again</a> · <a href="/">Back to the page</a></p>'
        )
        return HTMLResponse(document("Sign-in", request.app.version, text), problem.status, NO_STORE)
    # For the log and the audit log.
    request.state.caller = caller
    return _redirect(address, cookies)


@router.post("/sign-out")
async def sign_out(request: Request) -> Response:
    """End the session; returns the address at which the user signs out at the provider, or null."""
    browsers = _browsers(request)
    caller, url, cookie = await _in_thread(request, lambda: browsers.sign_out(request.headers))
    request.state.caller = caller
    return JSONResponse({"address": url}, headers={**NO_STORE, "Set-Cookie": cookie.header()})


async def _in_thread(request: Request, work: Callable[[], Result]) -> Result:
    """Ask the provider in one of few threads of its own: if it is slow, only sign-ins wait for it."""
    state = request.app.state
    if not hasattr(state, "sign_in_threads"):
        state.sign_in_threads = anyio.CapacityLimiter(THREADS)
    return await anyio.to_thread.run_sync(work, limiter=state.sign_in_threads)


def _browsers(request: Request) -> BrowserSessions:
    browsers = access_of(request.scope).sign_in.browsers
    if browsers is None:
        accepted = "an API key; BENTRAY_OIDC_ISSUER names a provider"
        raise NoSignIn("sign-in", "no OpenID provider", accepted)
    return browsers


def _redirect(url: str, cookies: list[Cookie]) -> RedirectResponse:
    response = RedirectResponse(url, HTTP_303_SEE_OTHER, NO_STORE)
    for cookie in cookies:
        response.headers.append("Set-Cookie", cookie.header())
    return response
