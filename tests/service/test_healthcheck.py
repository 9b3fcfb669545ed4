"""The health check of a container: silent when ready, otherwise the reason."""

import pytest

import bentray_workers.joining  # noqa: F401 - before a test replaces what it imports
from bentray_service import healthcheck
from bentray_service.healthcheck import check, check_scheduler, check_worker, main


def test_ready_service_passes(serve):
    assert check(serve()) is None


def test_the_reason_is_told(serve, cluster):
    cluster.workers = 0
    assert "workers" in check(serve())


def test_nobody_there():
    assert "no service answers at http://127.0.0.1:9" in check("http://127.0.0.1:9")


def test_a_scheduler_and_whether_a_worker_of_this_machine_has_joined_it(monkeypatch):
    known = {"workers": {}}
    asked = []

    def identity_of(address, security, timeout_s, workers):
        asked.append((address, security.require_encryption))
        return known

    monkeypatch.setattr("bentray_workers.cluster.identity_of", identity_of)
    assert check_scheduler("tcp://127.0.0.1:8786") is None
    assert (
        check_worker("tcp://127.0.0.1:8786")
        == "tcp://127.0.0.1:8786 has 0 workers, none of them at 127.0.0.1"
    )
    known["workers"] = {"tcp://192.0.2.7:4000": {"host": "192.0.2.7"}}
    assert "has 1 workers, none of them at" in check_worker("tcp://127.0.0.1:8786")
    known["workers"]["tcp://127.0.0.1:4000"] = {"host": "127.0.0.1"}
    assert check_worker("tcp://127.0.0.1:8786") is None
    assert asked == 4 * [("tcp://127.0.0.1:8786", False)]


@pytest.mark.parametrize("ask", [check_scheduler, check_worker])
def test_no_scheduler(ask, monkeypatch):
    monkeypatch.setattr(healthcheck, "SECONDS", 0.5)
    assert "scheduler_address: found tcp://127.0.0.1:9" in ask("tcp://127.0.0.1:9")


@pytest.mark.parametrize(
    ("words", "code"),
    [(["http://127.0.0.1:9"], "no service answers"), (["ftp://x"], 2), (["tcp://127.0.0.1:9", "service"], 2)],
)
def test_how_it_ends(words, code):
    with pytest.raises(SystemExit) as end:
        main(words)
    assert end.value.code == code or str(end.value.code).startswith(str(code))
