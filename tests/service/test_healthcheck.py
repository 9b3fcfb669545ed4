"""The health check of a container: silent when ready, otherwise the reason."""

import fcntl
import os
import socket
import subprocess
import sys
import tempfile
import threading
import time

import pytest

from bentray_service.healthcheck import check, check_scheduler, check_worker, main
from bentray_workers.cluster import heartbeat


def wait_for(heard):
    deadline = time.monotonic() + 60.0
    while not heard:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    return heard


def test_ready_service_passes(serve):
    assert check(serve()) is None


def test_failure_reason_is_shown(serve, cluster):
    cluster.workers = 0
    assert "workers" in check(serve())


def test_unreachable_service_is_reported():
    assert "no answer from a service at http://127.0.0.1:9" in check("http://127.0.0.1:9")


@pytest.fixture
def greeting():
    """Answers one connection with some bytes and keeps what comes back; gives the address and that."""
    heard = []
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer(words):
            def run():
                connection, _ = server.accept()
                with connection:
                    connection.sendall(words)
                    heard.append(connection.recv(4096))

            thread = threading.Thread(target=run)
            thread.start()
            threads.append(thread)
            return f"tcp://127.0.0.1:{server.getsockname()[1]}", heard

        threads = []
        yield answer
        for thread in threads:
            thread.join(60.0)


def test_a_scheduler_answers_and_logs_no_broken_connection(greeting):
    words = b"\0\0\xafpickle-protocol\x05"
    address, heard = greeting(words)
    assert check_scheduler(address) is None
    # Dask takes its own greeting for that of a peer; without one it logs a connection that broke off.
    assert wait_for(heard) == [words]


def test_rejects_hosts_that_are_no_scheduler(greeting):
    address, _ = greeting(b"HTTP/1.1 400 Bad Request\r\n\r\n")
    assert check_scheduler(address) == f"the server at {address} is not a Dask scheduler"


def test_no_scheduler():
    assert check_scheduler("tcp://127.0.0.1:9").startswith(
        "no answer from a scheduler at tcp://127.0.0.1:9: "
    )


def test_worker_is_healthy_while_it_sends_heartbeats(monkeypatch, tmp_path):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    address = "tcp://scheduler:8786"
    assert check_worker(address) == f"no heartbeat of a worker of {address}: none so far"
    with heartbeat.file_for(address).open("ab") as file:
        fcntl.flock(file, fcntl.LOCK_SH)
        assert check_worker(address) is None
        assert check_worker("tcp://other:8786") is not None
        old = time.time() - 2.0 * heartbeat.STALE_S
        os.utime(file.fileno(), (old, old))
        assert check_worker(address).endswith("the last one 60 s ago")
        os.utime(file.fileno())
        assert check_worker(address) is None
    assert check_worker(address).endswith("none so far"), "who gave the sign is gone"


def test_it_loads_the_standard_library_alone():
    program = "import sys, bentray_service.healthcheck; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    loaded = {name.partition(".")[0] for name in done.stdout.split()}
    assert not loaded & {"numpy", "dask", "distributed", "httpx", "pydantic", "fastapi", "typer"}


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["http://127.0.0.1:9"], "no answer from a service"),
        (["ftp://x"], 2),
        (["tcp://127.0.0.1:9", "service"], 2),
    ],
)
def test_how_it_ends(words, code):
    with pytest.raises(SystemExit) as end:
        main(words)
    assert end.value.code == code or str(end.value.code).startswith(str(code))
