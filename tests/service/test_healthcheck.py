"""The health check of a container: silent when ready, otherwise the reason."""

import fcntl
import os
import signal
import socket
import tempfile
import threading
import time
from contextlib import suppress

import pytest

from bentray_service import healthcheck
from bentray_service.healthcheck import (
    check_scheduler,
    check_service,
    check_worker,
    main,
)
from bentray_workers.cluster import heartbeat

from ..waiting import wait_until


def test_a_service_without_workers_is_alive_and_not_ready(serve, cluster):
    url = serve()
    assert (check_service(url), check_service(url, "ready")) == (None, None)
    cluster.workers = 0
    assert check_service(url) is None
    assert "workers" in check_service(url, "ready")


def test_unreachable_service_is_reported():
    assert "no answer from a service at http://127.0.0.1:9" in check_service("http://127.0.0.1:9")


@pytest.fixture
def container(monkeypatch, tmp_path):
    """Kills in a made-up container; process 7 is its command, 9 a child of that, 30 is this check."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    for process, (name, parent) in {
        1: ("tini", 0),
        7: ("python", 1),
        9: ("python", 7),
        30: ("sh", 0),
    }.items():
        folder = tmp_path / "proc" / str(process)
        folder.mkdir(parents=True)
        (folder / "comm").write_text(f"{name}\n")
        (folder / "stat").write_text(f"{process} ({name} x) S {parent} {'0 ' * 17}{500 + process} 0")
    killed = []
    monkeypatch.setattr(os, "kill", lambda process, number: killed.append((process, number)))
    monkeypatch.setattr(healthcheck, "PROCESSES", tmp_path / "proc")
    return killed


def test_the_last_of_several_failures_in_a_row_ends_the_container(container, monkeypatch, tmp_path):
    answers = []
    monkeypatch.setitem(healthcheck.CHECKS, ("http",), lambda _url: answers.pop(0))

    def checked(*given):
        for argument in given:
            answers.append(argument)
            with suppress(SystemExit):
                main(["--restart-after", "2"])
        return len(container)

    assert checked("x", "x", "x") == 0, "it has not started yet"
    assert checked(None, "x", None, "x") == 0
    assert checked("x") == 1
    assert container == [(7, signal.SIGKILL)]
    # In a folder that the container which follows has too.
    (tmp_path / "proc/1/stat").write_text("1 (tini) S 0 " + "0 " * 17 + "900 0")
    assert checked("x", "x", "x") == 1
    # Elsewhere nothing is killed.
    (tmp_path / "proc/1/comm").write_text("systemd\n")
    assert checked(None, "x", "x", "x") == 1


def test_a_worker_whose_scheduler_is_away_waits_for_it(container, monkeypatch):
    away = [None, "x"]
    monkeypatch.setitem(healthcheck.CHECKS, ("tcp", "worker"), lambda _address: away[0])
    monkeypatch.setattr(healthcheck, "check_scheduler", lambda _address: away[1])
    main(["--restart-after", "1", "tcp://scheduler:8786", "worker"])
    for scheduler, killed in (("x", 0), (None, 1)):
        away = ["x", scheduler]
        with pytest.raises(SystemExit):
            main(["--restart-after", "1", "tcp://scheduler:8786", "worker"])
        assert len(container) == killed


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
    assert wait_until(lambda: heard) == [words]


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


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["http://127.0.0.1:9"], "no answer from a service"),
        (["ftp://x"], 2),
        (["tcp://127.0.0.1:9", "service"], 2),
        (["--restart-after", "often"], 2),
    ],
)
def test_how_it_ends(words, code):
    with pytest.raises(SystemExit) as end:
        main(words)
    assert end.value.code == code or str(end.value.code).startswith(str(code))
