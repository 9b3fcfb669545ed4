"""nginx with deploy/nginx.conf in front of a service of this machine, from Debian's package `nginx-light`."""

import os
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from .free_ports import free_port

START_S = 30.0
CONFIGURATION = Path(__file__).resolve().parents[1] / "deploy" / "nginx.conf"
SKIPPED = "nginx is not installed, so the edge was not tried: apt-get install nginx-light"


def program() -> str | None:
    """The path of nginx; None where there is none."""
    return shutil.which("nginx", path=f"{os.environ.get('PATH', '')}:/usr/sbin")


@dataclass(frozen=True)
class Edge:
    """A running nginx.

    Attributes:
        port, tls_port: of 127.0.0.1; url: the address without TLS.
        folder: of its files: ``edge-certificate.pem``, ``temporary`` and ``log``.
        pid: of its main process.
    """

    port: int
    tls_port: int
    folder: Path
    pid: int

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"


@contextmanager
def edge(folder: Path, service: int, **changed: str) -> Iterator[Edge]:
    """Start nginx in front of a port of 127.0.0.1.

    Args:
        folder: for its files; made if it is missing.
        service: the port of the service.
        changed: values of directives in place of those of the file.
    """
    nginx = program()
    assert nginx is not None, SKIPPED
    (folder / "temporary").mkdir(parents=True)
    port, tls_port = free_port(), free_port()
    text = CONFIGURATION.read_text()
    replaced = {
        "listen 8080 ": f"listen 127.0.0.1:{port} ",
        "listen 8443 ": f"listen 127.0.0.1:{tls_port} ",
        "service:8000": f"127.0.0.1:{service}",
        " /tmp/nginx": f" {folder}/temporary/nginx",
    }
    for name, value in changed.items():
        line = next(line for line in text.splitlines() if line.strip().startswith(f"{name} "))
        replaced[line.strip()] = f"{name} {value};"
    for before, after in replaced.items():
        assert before in text, before
        text = text.replace(before, after)
    (folder / "nginx.conf").write_text(text)
    certificate = ["-keyout", str(folder / "edge-key.pem"), "-out", str(folder / "edge-certificate.pem")]
    subprocess.run(
        [
            *("openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes"),
            *("-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1", *certificate),
        ],
        check=True,
        capture_output=True,
    )
    with (folder / "log").open("wb") as log:
        words = [nginx, "-e", "stderr", "-c", str(folder / "nginx.conf"), "-g", "daemon off;"]
        process = subprocess.Popen(words, stdout=log, stderr=log, start_new_session=True)
    try:
        deadline = time.monotonic() + START_S
        while True:
            assert process.poll() is None, (folder / "log").read_text()
            assert time.monotonic() < deadline
            with suppress(OSError), socket.create_connection(("127.0.0.1", port), 1.0):
                break
            time.sleep(0.02)
        yield Edge(port, tls_port, folder, process.pid)
    finally:
        process.terminate()
        process.wait(START_S)
