"""`bentray serve`: the service on this machine, with its own workers or those of a given scheduler."""

from __future__ import annotations

import errno
import json
import logging
import os
import socket
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bentray_kernels.errors import InvalidInput

from .output.exit_codes import WorkFailed
from .output.terminal import print_lines, remark

if TYPE_CHECKING:
    from ..settings import ServiceSettings

log = logging.getLogger("bentray.serve")

OPTIONS = {
    "host": "--host",
    "port": "--port",
    "data_dir": "--data",
    "dask_scheduler_address": "--scheduler",
    "workers": "--workers",
}


def serve(
    host: Annotated[str | None, typer.Option(help="Address to listen on.", show_default="127.0.0.1")] = None,
    port: Annotated[int | None, typer.Option(help="Port; 0 picks a free one.", show_default="8000")] = None,
    data: Annotated[
        Path | None,
        typer.Option(help="Folder of the datasets, volumes and the database.", show_default="./bentray-data"),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(help="Dask scheduler to use instead of own workers, as tcp://head:8786."),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="Worker processes to start.", show_default="one a core")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print {url, pid, data} as one JSON object.")
    ] = False,
) -> None:
    """Start the service and keep it running until Ctrl-C.

    An option that is not given is read from its environment variable (BENTRAY_PORT and so on).

    Example:  bentray serve --port 8000 --data /srv/bentray
    """
    from ..settings import ServiceSettings

    options = {
        "host": host,
        "port": port,
        "data_dir": data,
        "dask_scheduler_address": scheduler,
        "workers": workers,
    }
    given = {name: value for name, value in options.items() if value is not None}
    try:
        settings = ServiceSettings.load(**given)
    except InvalidInput as error:
        # The settings speak of environment variables; the user may have typed an option.
        name = error.field.removeprefix("BENTRAY_").lower()
        field = OPTIONS[name] if name in given else error.field
        raise InvalidInput(field, error.value, error.accepted) from error
    listening = _listen(settings.host, settings.port)
    try:
        _run(settings, listening, as_json)
    finally:
        listening.close()


def _listen(host: str, port: int) -> socket.socket:
    from ..web.listening import Listening

    # The socket is bound here and handed on, so that a busy port is found before any worker starts
    # and port 0 is known by its real number.
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    except (socket.gaierror, UnicodeError) as error:
        raise InvalidInput("host", repr(host), "an address of this machine, as 127.0.0.1") from error
    listening = Listening(family, kind, protocol)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind(address)
    except OSError as error:
        listening.close()
        if error.errno == errno.EADDRNOTAVAIL:
            raise InvalidInput("host", repr(host), "an address of this machine, as 127.0.0.1") from error
        raise InvalidInput(
            "port", f"{port} on {host} ({error.strerror})", "a free port of this machine; 0 picks one"
        ) from error
    return listening


def _run(settings: ServiceSettings, listening: socket.socket, as_json: bool) -> None:
    from .. import logs
    from ..app import create_app
    from ..arenas import limit_arenas
    from ..web.server import Server

    host, port = listening.getsockname()[:2]
    url = f"http://{f'[{host}]' if ':' in host else host}:{port}"

    class Announcing(Server):
        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            await super().startup(sockets)
            if self.started and as_json:
                here = {"url": url, "pid": os.getpid(), "data": str(settings.data_dir.resolve())}
                print_lines([json.dumps(here)])
            if self.started:
                _say(settings, f"Bentray is at {url} (data in {settings.data_dir}); Ctrl-C stops it.")
                _say(settings, _reach(asks=not made.state.parts.sign_in.open()))

        async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
            made.state.leaving.set()
            await super().shutdown(sockets)

    limit_arenas()
    made = create_app(settings)
    app = _Starting(made)
    server = Announcing(app, settings)
    # Uvicorn ends the process when the application cannot start; here the reason has the last word.
    with suppress(SystemExit), logs.configured(settings.log_format):
        server.run(sockets=[listening])
    if app.failure is not None:
        raise app.failure
    if not server.started:
        raise WorkFailed("the service could not start")


class _Starting:
    """Keeps what stopped the application from starting, for one clear line instead of a logged traceback."""

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


def _say(settings: ServiceSettings, words: str) -> None:
    if settings.log_format == "json":
        log.info(words)
    else:
        remark(words)


def _reach(*, asks: bool) -> str:
    if asks:
        return "Every caller is asked for a key, or comes through a trusted proxy."
    return (
        "It is open on loopback only: nothing but this machine can reach it, and nobody here is asked for a "
        "key. The first one, of `bentray keys create`, changes that."
    )
