"""Health check of a service, scheduler or worker.

Usage: ``python -m bentray_service.healthcheck [ADDRESS [worker]]``

Without an address, checks the service on port 8000 of this machine. The address of a Dask scheduler, e.g.
``tcp://127.0.0.1:8786``, checks the scheduler; with ``worker``, a worker of this machine. The exit code is 0,
1 with a reason, or 2 for wrong arguments.

Containers run it every few seconds, so it imports the standard library only.
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
# Both sides of the Dask protocol start with a message that contains this name.
GREETING = b"pickle-protocol"


def check(url: str) -> str | None:
    """None if the service at ``url`` is ready, else the reason."""
    try:
        parts = urlsplit(url)
        kind = http.client.HTTPSConnection if parts.scheme == "https" else http.client.HTTPConnection
        connection = kind(parts.hostname or "", parts.port, timeout=SECONDS)
        try:
            connection.request("GET", f"{parts.path.rstrip('/')}/health/ready")
            response = connection.getresponse()
            body = response.read()
        finally:
            connection.close()
        return None if response.status == http.client.OK else str(json.loads(body)["detail"])
    except (OSError, http.client.HTTPException, ValueError, KeyError, TypeError) as error:
        return f"no answer from a service at {url}: {error}"


def check_scheduler(address: str) -> str | None:
    """None if a Dask scheduler answers at ``address``, else the reason.

    With TLS, the certificates are in the folder ``BENTRAY_TLS_DIR``.
    """
    try:
        parts = urlsplit(address)
        with _connected(parts.hostname or "", parts.port or 0, secured=parts.scheme == "tls") as connection:
            greeting = connection.recv(4096)
            if GREETING not in greeting:
                return f"the server at {address} is not a Dask scheduler"
            # The greeting is returned, since the scheduler logs incomplete handshakes.
            connection.sendall(greeting)
    except (OSError, ValueError) as error:
        return f"no answer from a scheduler at {address}: {error}"
    return None


def check_worker(address: str) -> str | None:
    """None if a worker of this machine is connected to the scheduler at ``address``, else the reason."""
    silence = heartbeat.seconds_since_heartbeat(address)
    if silence is not None and silence <= heartbeat.STALE_S:
        return None
    known = "none so far" if silence is None else f"the last one {silence:.0f} s ago"
    return f"no heartbeat of a worker of {address}: {known}"


def _connected(host: str, port: int, *, secured: bool) -> socket.socket:
    plain = socket.create_connection((host, port), SECONDS)
    if not secured:
        return plain
    folder = os.environ.get("BENTRAY_TLS_DIR")
    try:
        if not folder:
            raise ValueError("BENTRAY_TLS_DIR is not set to a folder of certificates")
        context = ssl.create_default_context(cafile=str(Path(folder) / "authority.pem"))
        context.load_cert_chain(Path(folder) / "certificate.pem", Path(folder) / "key.pem")
        # As in Dask, any certificate of the authority is accepted, without a check of the host name.
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
    """Run the health check of a container."""
    address, *part = words or ["http://127.0.0.1:8000"]
    chosen = CHECKS.get((address.partition("://")[0], *part))
    if chosen is None:
        sys.stderr.write((__doc__ or "").splitlines()[2] + "\n")
        sys.exit(2)
    if trouble := chosen(address):
        sys.exit(trouble)


if __name__ == "__main__":
    main(sys.argv[1:])
