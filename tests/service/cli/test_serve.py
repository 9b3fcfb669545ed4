"""`bentray serve`: prints its address and reachability, and rejects bad settings in one line."""

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_service.cli import serve as module
from bentray_service.web.server import listen

from .conftest import Run


@pytest.fixture
def busy() -> Iterator[int]:
    """A port that another program listens on."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


def test_a_busy_port_is_rejected_before_anything_starts(bentray: Run, busy: int, tmp_path: Path) -> None:
    result = bentray("serve", "--port", busy, "--data", tmp_path / "data", code=2)
    assert result.stderr.startswith(f"bentray: port: found {busy} on 127.0.0.1 (Address already in use)")
    assert "0 picks one" in result.stderr
    assert not (tmp_path / "data").exists()


def test_a_host_that_is_not_of_this_machine_is_rejected(bentray: Run, tmp_path: Path) -> None:
    # 192.0.2.0/24 is reserved for documentation (RFC 5737), so no machine has it.
    result = bentray("serve", "--host", "192.0.2.1", "--port", 0, "--data", tmp_path, code=2)
    assert result.stderr.startswith("bentray: host: found '192.0.2.1'")


@pytest.mark.parametrize("host", ["a..b", 70 * "a", "\udc80"])
def test_rejects_invalid_host_names(host: str) -> None:
    with pytest.raises(InvalidInput, match="host: found"):
        listen(host, 0)


def test_an_unknown_host_is_rejected(monkeypatch: pytest.MonkeyPatch) -> None:
    def unknown(*given: object, **more: object) -> None:
        raise socket.gaierror(-2, "Name or service not known")

    monkeypatch.setattr("socket.getaddrinfo", unknown)
    with pytest.raises(InvalidInput, match=r"host: found 'nowhere'"):
        listen("nowhere", 0)


@pytest.mark.parametrize("words", [(), ("--workers", 2)])
def test_a_bad_setting_is_named_as_it_was_given(
    bentray: Run, monkeypatch: pytest.MonkeyPatch, words: tuple[object, ...]
) -> None:
    monkeypatch.setenv("BENTRAY_PORT", "http")
    result = bentray("serve", *words, code=2)
    assert result.stderr.startswith("bentray: BENTRAY_PORT: found 'http'; accepted: ")


def test_an_option_wins_over_the_environment(
    bentray: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("BENTRAY_WORKERS", "7")
    monkeypatch.setenv("BENTRAY_JOBS_AT_ONCE", "3")
    seen = []
    monkeypatch.setattr(module, "_run", lambda settings, *_: seen.append(settings))
    bentray("serve", "--port", 0, "--data", tmp_path, "--workers", 2)
    assert (seen[0].workers, seen[0].jobs_at_once, seen[0].data_dir) == (2, 3, tmp_path)


def test_reachability_is_shown() -> None:
    assert "Only this machine can reach the service" in module._reachability(required=False)
    assert "Authentication by API key" in module._reachability(required=True)


@pytest.mark.parametrize(
    ("words", "found", "accepted"),
    [
        ((), "0.0.0.0, reachable by others, without a proxy in front", "--behind-proxy"),
        (("--bare",), "0.0.0.0, reachable by others, without any key", "bentray keys create"),
        (("--behind-proxy", "10.0.0.7"), "0.0.0.0 behind a proxy, reachable by others, without any", "keys"),
        (("--behind-proxy", "edge"), "'edge'", "addresses or networks"),
    ],
)
def test_remote_access_needs_a_proxy_and_keys(
    bentray: Run, tmp_path: Path, words: tuple[str, ...], found: str, accepted: str
) -> None:
    result = bentray("serve", "--host", "0.0.0.0", *words, "--port", 0, "--data", tmp_path, code=2)
    assert "Traceback" not in result.stderr
    last = result.stderr.splitlines()[-1]
    assert f": found {found}" in last
    assert accepted in last
    assert (module.BARE in result.stderr) == ("--bare" in words)


def test_start_failure_is_one_line(bentray: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def unreachable(*given: object, **more: object) -> None:
        raise InvalidInput("scheduler_address", "tcp://127.0.0.1:1", "a running scheduler")

    monkeypatch.setattr("bentray_service.app.open_cluster", unreachable)
    result = bentray("serve", "--port", 0, "--data", tmp_path, "--scheduler", "tcp://127.0.0.1:1", code=2)
    assert "Traceback" not in result.stderr
    assert result.stderr.endswith(
        "bentray: scheduler_address: found tcp://127.0.0.1:1; accepted: a running scheduler\n"
    )
