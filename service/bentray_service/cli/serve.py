"""`bentray serve`: run the service with its own workers or an existing cluster."""

from __future__ import annotations

import ctypes
import json
import logging
import os
import socket
import time
from contextlib import ExitStack, suppress
from pathlib import Path
from threading import Thread
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bentray_kernels.errors import InvalidInput

from .options.option_tables import Option, with_options
from .output.exit_codes import WorkFailed
from .output.terminal import print_lines, progress_bar, remark

if TYPE_CHECKING:
    from ..settings import ServiceSettings

log = logging.getLogger("bentray.serve")

BARE = (
    "No proxy is in front of the service (--bare): connections are not encrypted, and slow clients are not "
    "limited; deploy/nginx.conf does both."
)
# By the settings that they set.
OPTIONS = {
    "host": Option("--host", str, "127.0.0.1", "Address to listen on."),
    "port": Option("--port", int, "8000", "Port; 0 picks a free one."),
    "behind_proxy": Option(
        "--behind-proxy",
        str,
        "",
        "Addresses of the proxy in front, needed to listen on more than this machine.",
    ),
    "bare": Option("--bare", bool, "", "Listen without a proxy: no TLS, no limits of slow clients."),
    "data_dir": Option("--data", Path, "./bentray-data", "Folder of the datasets, volumes and the database."),
    "dask_scheduler_address": Option(
        "--scheduler", str, "", "Dask scheduler to use instead of own workers, e.g. tcp://head:8786."
    ),
    "workers": Option("--workers", int, "one per core", "Worker processes to start."),
}
# Parameter of ``mallopt`` in <malloc.h>.
M_ARENA_MAX = -8
# In addition to the main arena; threads rarely allocate at the same time because of the GIL.
MAX_ARENAS = 2


@with_options(OPTIONS)
def serve(
    options: dict[str, Any],
    as_json: Annotated[
        bool, typer.Option("--json", help="Print {url, pid, data} as one JSON object.")
    ] = False,
) -> None:
    """Start the service and run it until Ctrl-C.

    Default values of the options are read from environment variables (BENTRAY_PORT and so on).

    Example:  bentray serve --port 8000 --data /srv/bentray
    """
    from ..settings import ServiceSettings
    from ..web.server import listen

    try:
        settings = ServiceSettings.load(**options)
    except InvalidInput as error:
        # Name the option instead of the environment variable if the option was given.
        name = error.field.removeprefix("BENTRAY_").lower()
        field = OPTIONS[name].name if name in options else error.field
        raise InvalidInput(field, error.value, error.accepted) from error
    shown = {name: f"{OPTIONS[name].name} {value}" for name, value in options.items()}
    unused = list(ServiceSettings.unused_variables(os.environ, shown))
    # The socket is bound before any worker starts, so that a busy port is reported early
    # and port 0 is replaced by the actual number.
    listening = listen(settings.host, settings.port)
    try:
        _check_exposure(settings, listening.getsockname()[0])
        with ExitStack() as starting:
            starting.enter_context(progress_bar("Starting the service", shown=settings.log_format != "json"))
            _run(settings, listening, unused, as_json, starting)
    finally:
        listening.close()


def _check_exposure(settings: ServiceSettings, address: str) -> None:
    """Refuse to listen for other machines without a proxy, unless that is the declared intention."""
    from ..web.addresses import is_loopback

    if is_loopback(address) or settings.behind_proxy or settings.trusted_proxies:
        return
    if not settings.bare:
        raise InvalidInput(
            "host",
            f"{settings.host}, reachable by others, without a proxy in front",
            "127.0.0.1, with a proxy on this machine (deploy/nginx.conf); or --behind-proxy and the "
            "addresses of a proxy elsewhere; or --bare, without TLS and without limits of slow clients",
        )
    _announce(settings, BARE, logging.WARNING)


def _run(
    settings: ServiceSettings,
    listening: socket.socket,
    unused: list[str],
    as_json: bool,
    starting: ExitStack,
) -> None:
    """Run the service; ``starting`` is closed once it answers."""
    import uvicorn

    from .. import logs
    from ..app import create_app
    from ..web.server import configuration

    host, port = listening.getsockname()[:2]
    url = f"http://{f'[{host}]' if ':' in host else host}:{port}"

    class Announcing(uvicorn.Server):
        interrupted = False

        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            await super().startup(sockets)
            starting.close()
            if self.started and as_json:
                here = {"url": url, "pid": os.getpid(), "data": str(settings.data_dir.resolve())}
                print_lines([json.dumps(here)])
            if self.started:
                _announce(
                    settings, f"Bentray runs at {url} (data in {settings.data_dir}); stop it with Ctrl-C."
                )
                _announce(settings, _reachability(required=made.state.access.sign_in.required()))

        def handle_exit(self, sig: int, frame: FrameType | None) -> None:
            super().handle_exit(sig, frame)
            if not self.started:
                self.interrupted = True
                # Nobody waits for minutes of compilation, nor reads why its end let the start fail.
                logging.disable(logging.CRITICAL)
                Thread(target=_stop_starting, daemon=True).start()

        async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
            made.state.leaving.set()
            await super().shutdown(sockets)

    limit_arenas()
    made = create_app(settings)
    app = _Starting(made)
    server = Announcing(configuration(app))
    # Uvicorn exits when the application cannot start; the reason is raised below.
    with suppress(SystemExit), logs.configured(settings.log_format):
        for words in unused:
            _announce(settings, words, logging.WARNING)
        server.run(sockets=[listening])
    if server.interrupted:
        raise KeyboardInterrupt
    if app.failure is not None:
        raise app.failure
    if not server.started:
        raise WorkFailed("the service could not start")


def _stop_starting() -> None:
    from bentray_workers.cluster.supervision import stop_starting

    # Again and again, since a worker may only be about to be started.
    while True:
        stop_starting()
        time.sleep(0.1)


class _Starting:
    """Remembers the error of a failed start, for a one-line message instead of a traceback."""

    def __init__(self, app: Any) -> None:
        self._app = app
        self.failure: Exception | None = None

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] != "lifespan":
            await self._app(scope, receive, send)
            return

        async def quiet(message: dict[str, Any]) -> None:
            await send({"type": message["type"]})

        try:
            await self._app(scope, receive, quiet)
        except Exception as error:
            self.failure = error


def _announce(settings: ServiceSettings, words: str, level: int = logging.INFO) -> None:
    if settings.log_format == "json":
        log.log(level, words)
    else:
        remark(words)


def _reachability(*, required: bool) -> str:
    if required:
        return "Authentication by API key or trusted proxy is required."
    return (
        "Only this machine can reach the service, and no authentication is required; to require it, "
        "create a key with `bentray keys create`."
    )


def limit_arenas() -> None:
    """Set the limit; to be called before threads are started. No effect with other C libraries."""
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        return
    mallopt(M_ARENA_MAX, MAX_ARENAS)
