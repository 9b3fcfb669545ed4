"""Ports for servers that a test starts, perhaps again, as processes of their own."""

import os
import socket
from contextlib import suppress
from itertools import count

# Below those that Linux gives to outgoing connections, any of which could take a port before it is used. Each
# process of the tests has its own, and begins elsewhere than the tests of another checkout.
FIRST, EACH = 20_000, 1000
_WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")) % 12
_numbers = count(7 * os.getpid())


def free_port() -> int:
    """A port of loopback that nobody listens on; the next call gives another one."""
    while True:
        port = FIRST + EACH * _WORKER + next(_numbers) % EACH
        with suppress(OSError), socket.create_server(("127.0.0.1", port)):
            return port
