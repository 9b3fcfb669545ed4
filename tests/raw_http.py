"""Requests that no library would send, and the statuses of all answers on their connection."""

import re
import socket
from collections.abc import Sequence

PATIENCE_S = 20.0
STATUS = re.compile(rb"HTTP/1\.1 (\d{3}) ")


def exchange(
    port: int, head: Sequence[str], body: bytes = b"", *, ends: bool = True
) -> tuple[list[int], bytes]:
    """Send a request with exactly these lines and this body; returns the statuses, and all that came.

    Args:
        port: of 127.0.0.1.
        head: the request line and the headers.
        body: as it is sent, whatever the head says.
        ends: whether to say that nothing follows.
    """
    with socket.create_connection(("127.0.0.1", port), PATIENCE_S) as connection:
        connection.sendall("\r\n".join([head[0], "Host: 127.0.0.1", *head[1:], "", ""]).encode() + body)
        if ends:
            connection.shutdown(socket.SHUT_WR)
        result = b""
        try:
            while more := connection.recv(65536):
                result += more
        except (TimeoutError, ConnectionError):
            pass
    return [int(status) for status in STATUS.findall(result)], result
