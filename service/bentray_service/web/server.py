"""The options of Uvicorn; hostile connections are limited by the proxy in front (deploy/nginx.conf)."""

import errno
import socket
from typing import Any

import uvicorn

from bentray_kernels.errors import InvalidInput

# Time for requests in progress when the service stops, s; longer uploads are aborted and can be
# resumed with tus.
PATIENCE_S = 5
# Time after which an idle connection is closed, s.
IDLE_S = 5
# Maximum length of the headers of a request, as in deploy/nginx.conf.
LONGEST_HEAD = 32 * 1024


def configuration(app: Any) -> uvicorn.Config:
    """The options of Uvicorn for the service."""
    return uvicorn.Config(
        app,
        # httptools ignores the body of a request that asks for another protocol, as Java's client does.
        http="h11",
        h11_max_incomplete_event_size=LONGEST_HEAD,
        ws="none",
        log_config=None,
        log_level="warning",
        access_log=False,
        server_header=False,
        # The authentication knows the proxies.
        proxy_headers=False,
        lifespan="on",
        timeout_keep_alive=IDLE_S,
        timeout_graceful_shutdown=PATIENCE_S,
    )


def listen(host: str, port: int) -> socket.socket:
    """A socket bound to an address of this machine; port 0 picks a free one.

    Raises:
        InvalidInput: when the address is not one of this machine, or the port is in use.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    except (socket.gaierror, UnicodeError) as error:
        raise InvalidInput("host", repr(host), "an address of this machine, e.g. 127.0.0.1") from error
    # asyncio switches the delay of small segments off only where the protocol of the socket is named.
    listening = socket.socket(family, kind, protocol)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind(address)
    except OSError as error:
        listening.close()
        if error.errno == errno.EADDRNOTAVAIL:
            raise InvalidInput("host", repr(host), "an address of this machine, e.g. 127.0.0.1") from error
        raise InvalidInput(
            "port", f"{port} on {host} ({error.strerror})", "a free port of this machine; 0 picks one"
        ) from error
    return listening
