"""Uvicorn as the service runs it: with our protocol, and connections for which there are descriptors."""

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

# What requests under way may take once the service is told to stop, s: an upload that never ends must not
# keep it from stopping, and a client goes on with what it sent by tus.
PATIENCE_S = 5


class Server(uvicorn.Server):
    """The server of an application."""

    def __init__(self, app: Any, settings: ServiceSettings) -> None:
        """Raises:
        InvalidInput: where this process may open too few files.
        """
        self._descriptors = descriptors.raise_limit()
        self._of_address = settings.connections_per_address
        self.connections = Connections(self._limits(0), networks(settings.trusted_proxies or ""))
        config = uvicorn.Config(
            app,
            http=cast("type[Any]", partial(CountedProtocol, self.connections)),
            # Nobody speaks WebSocket here; and what asyncio does with sockets is what ours is made for.
            ws="none",
            loop="asyncio",
            log_config=None,
            log_level="warning",
            access_log=False,
            # Whether a proxy is believed is for the door to say, by who really called.
            proxy_headers=False,
            lifespan="on",
            timeout_graceful_shutdown=PATIENCE_S,
        )
        super().__init__(config)

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start the application, then serve."""
        await super().startup(sockets)
        self.connections.limits = self._limits(descriptors.in_use())

    def _limits(self, in_use: int) -> ConnectionLimits:
        return ConnectionLimits.of(self._descriptors, in_use, self._of_address)
