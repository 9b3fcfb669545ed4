"""Whether a part of an installation works: ``python -m bentray_service.healthcheck [ADDRESS [worker]]``.

Without an address it asks the service on port 8000 of this machine whether it is ready. The address of a
Dask scheduler, as ``tcp://127.0.0.1:8786``, asks whether that answers; with the word ``worker`` whether a
worker of this machine serves it. Ends with 0, or 1 and the reason, or 2 where the words make no sense.

A container runs it every few seconds, so it imports the standard library alone.
"""

from __future__ import annotations

import http.client
import json
import os
import socket
import ssl
import sys
from collections.abc import Callable
from pathlib import Path
from urllib.parse import urlsplit

from bentray_workers.cluster import heartbeat

SECONDS = 10.0
# Both sides of Dask's protocol begin with a message that holds this name.
GREETING = b"pickle-protocol"


def check(url: str) -> str | None:
    """None when the service at ``url`` is ready; otherwise why not, in words."""
    try:
        parts = urlsplit(url)
        kind = http.client.HTTPSConnection if parts.scheme == "https" else http.client.HTTPConnection
        connection = kind(parts.hostname or "", parts.port, timeout=SECONDS)
        try:
            connection.request("GET", f"{parts.path.rstrip('/')}/health/ready")
            answer = connection.getresponse()
            body = answer.read()
        finally:
            connection.close()
        return None if answer.status == http.client.OK else str(json.loads(body)["detail"])
    except (OSError, http.client.HTTPException, ValueError, KeyError, TypeError) as error:
        return f"no service answers at {url}: {error}"


def check_scheduler(address: str) -> str | None:
    """None when a Dask scheduler answers at ``address``; otherwise why not.

    With TLS the certificates are those in the folder that ``BENTRAY_TLS_DIR`` names.
    """
    try:
        parts = urlsplit(address)
        with _connected(parts.hostname or "", parts.port or 0, secured=parts.scheme == "tls") as connection:
            greeting = connection.recv(4096)
            if GREETING not in greeting:
                return f"what answers at {address} is no Dask scheduler"
            # Its own words are those of a peer of its version; a connection that broke off is logged.
            connection.sendall(greeting)
    except (OSError, ValueError) as error:
        return f"no scheduler answers at {address}: {error}"
    return None


def check_worker(address: str) -> str | None:
    """None when a worker of this machine serves the scheduler at ``address``; otherwise why not."""
    silence = heartbeat.silence_s(address)
    if silence is not None and silence <= heartbeat.STALE_S:
        return None
    known = "none" if silence is None else f"the last {silence:.0f} s ago"
    return f"no sign of life of a worker of {address}: {known}"


def _connected(host: str, port: int, *, secured: bool) -> socket.socket:
    plain = socket.create_connection((host, port), SECONDS)
    if not secured:
        return plain
    folder = os.environ.get("BENTRAY_TLS_DIR")
    try:
        if not folder:
            raise ValueError("BENTRAY_TLS_DIR names no folder of certificates")
        context = ssl.create_default_context(cafile=str(Path(folder) / "authority.pem"))
        context.load_cert_chain(Path(folder) / "certificate.pem", Path(folder) / "key.pem")
        # As Dask does: who holds a certificate of the authority is trusted, whatever its name.
        context.check_hostname = False
        return context.wrap_socket(plain)
    except (OSError, ValueError):
        plain.close()
        raise


CHECKS: dict[tuple[str, ...], Callable[[str], str | None]] = {
    ("http",): check,
    ("https",): check,
    ("tcp",): check_scheduler,
    ("tls",): check_scheduler,
    ("tcp", "worker"): check_worker,
    ("tls", "worker"): check_worker,
}


def main(words: list[str]) -> None:
    """For a container's health check."""
    address, *part = words or ["http://127.0.0.1:8000"]
    chosen = CHECKS.get((address.partition("://")[0], *part))
    if chosen is None:
        sys.stderr.write((__doc__ or "").partition("\n")[0] + "\n")
        sys.exit(2)
    if trouble := chosen(address):
        sys.exit(trouble)


if __name__ == "__main__":
    main(sys.argv[1:])
