"""The Uvicorn server with limits on connections."""

from __future__ import annotations

import socket
from functools import partial
from typing import Any, cast

import uvicorn

from ..settings import ServiceSettings
from . import descriptors
from .addresses import networks
from .connections import ConnectionLimits, Connections
from .protocol import CountedProtocol

# Time for requests in progress when the service stops, s; longer uploads are aborted and can be
# resumed with tus.
PATIENCE_S = 5


class Server(uvicorn.Server):
    """The server of an application."""

    def __init__(self, app: Any, settings: ServiceSettings) -> None:
        """Raises:
        InvalidInput: if the limit of open files is too low.
        """
        self._descriptors = descriptors.raise_limit()
        self._of_address = settings.connections_per_address
        self.connections = Connections(self._limits(0), networks(settings.trusted_proxies or ""))
        config = uvicorn.Config(
            app,
            http=cast("type[Any]", partial(CountedProtocol, self.connections)),
            # No WebSockets; the listening socket is made for asyncio.
            ws="none",
            loop="asyncio",
            log_config=None,
            log_level="warning",
            access_log=False,
            # Trusted proxies are handled by the authentication.
            proxy_headers=False,
            lifespan="on",
            timeout_graceful_shutdown=PATIENCE_S,
        )
        super().__init__(config)

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start the application and the server."""
        await super().startup(sockets)
        self.connections.limits = self._limits(descriptors.in_use())

    def _limits(self, in_use: int) -> ConnectionLimits:
        return ConnectionLimits.of(self._descriptors, in_use, self._of_address)
