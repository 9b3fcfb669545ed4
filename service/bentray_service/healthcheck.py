"""Health check of a service, scheduler or worker, which can end a container that hangs.

Usage: ``python -m bentray_service.healthcheck [--restart-after N] [ADDRESS [ready | worker]]``

Without an address, checks whether the service on port 8000 of this machine is alive; with ``ready``, whether
it can process jobs. The address of a Dask scheduler, e.g. ``tcp://127.0.0.1:8786``, checks the scheduler;
with ``worker``, a worker of this machine. The exit code is 0, 1 with a reason, or 2 for wrong arguments.

With ``--restart-after N`` in a container, the N-th failure in a row after a success kills the command of
the container, and the engine restarts it: engines themselves only mark a container as unhealthy.

Containers run it every few seconds, so it imports the standard library only.
"""

import http.client
import json
import os
import signal
import socket
import ssl
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from urllib.parse import urlsplit

from bentray_workers.cluster import heartbeat

SECONDS = 5.0
# Both sides of the Dask protocol start with a message that contains this name.
GREETING = b"pickle-protocol"
# The init processes of containers, which end with their command.
PROCESSES = Path("/proc")
INITS = ("tini", "docker-init", "catatonit")


def check_service(url: str, question: str = "live") -> str | None:
    """None if the service at ``url`` answers, or with ``ready`` can process jobs, else the reason."""
    try:
        address = urlsplit(url)
        kind = http.client.HTTPSConnection if address.scheme == "https" else http.client.HTTPConnection
        connection = kind(address.hostname or "", address.port, timeout=SECONDS)
        try:
            connection.request("GET", f"{address.path.rstrip('/')}/health/{question}")
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
        split = urlsplit(address)
        with _connected(split.hostname or "", split.port or 0, secured=split.scheme == "tls") as connection:
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
    last = "none so far" if silence is None else f"the last one {silence:.0f} s ago"
    return f"no heartbeat of a worker of {address}: {last}"


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


class Failures:
    """The failures in a row of a container, in a file in its temporary folder.

    Nothing counts before the first success, since a start may take minutes.
    """

    def __init__(self) -> None:
        self._file = Path(tempfile.gettempdir()) / f"bentray-failures-{os.getuid()}"
        # A folder that outlives the container must not pass on the failures of its predecessor.
        self._start = _fields(PROCESSES / "1")[19]

    def count(self) -> int:
        """Failures since the last success, with this check as one more; 0 before the first success.

        The check counts before it ends, because the engine may kill one that takes too long.
        """
        start, _, count = self._file.read_text().partition(" ") if self._file.exists() else ("", "", "")
        if start != self._start:
            return 0
        self._file.write_text(f"{start} {int(count) + 1}")
        return int(count) + 1

    def reset(self) -> None:
        """Record a success."""
        self._file.write_text(f"{self._start} 0")

    def end_container(self) -> None:
        """Kill the command of this container; does nothing outside of one."""
        if (PROCESSES / "1" / "comm").read_text().strip() not in INITS:
            return
        for process in PROCESSES.glob("[0-9]*"):
            if _fields(process)[1] == "1":
                os.kill(int(process.name), signal.SIGKILL)


def _fields(process: Path) -> list[str]:
    """The fields of ``/proc/PID/stat`` after the name: state, parent, …, and as the 20th the start time."""
    try:
        return (process / "stat").read_text().rpartition(")")[2].split()
    except OSError:
        # It has ended meanwhile.
        return [""] * 50


CHECKS: dict[tuple[str, ...], Callable[[str], str | None]] = {
    **dict.fromkeys((("http",), ("https",)), check_service),
    **dict.fromkeys((("http", "ready"), ("https", "ready")), partial(check_service, question="ready")),
    **dict.fromkeys((("tcp",), ("tls",)), check_scheduler),
    **dict.fromkeys((("tcp", "worker"), ("tls", "worker")), check_worker),
}


def main(words: list[str]) -> None:
    """Run the health check of a container."""
    most = 0
    if words[:1] == ["--restart-after"]:
        most, words = int(words[1]) if words[1:] and words[1].isdigit() else -1, words[2:]
    address, *check = words or ["http://127.0.0.1:8000"]
    chosen = CHECKS.get((address.partition("://")[0], *check))
    if chosen is None or most < 0:
        sys.stderr.write((__doc__ or "").splitlines()[2] + "\n")
        sys.exit(2)
    failures = Failures() if most else None
    count = failures.count() if failures else 0
    trouble = chosen(address)
    if failures and (trouble is None or (count and check == ["worker"] and check_scheduler(address))):
        # A worker whose scheduler is away waits for it; a restart would not help.
        failures.reset()
    elif failures and count >= most:
        failures.end_container()
        trouble = f"{trouble}; ended after {count} failures in a row, to be restarted"
    if trouble:
        sys.exit(trouble)


if __name__ == "__main__":
    main(sys.argv[1:])
