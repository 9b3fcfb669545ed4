"""Listening sockets of processes and web pages on them: for tests that nothing is published."""

import ipaddress

import httpx
import psutil

# What Dask would show of a scheduler or a worker, with and without Bokeh.
PAGES = ("/", "/status", "/health", "/metrics", "/info/main/workers.html", "/json/counts.json", "/sysmon")


def listening(pid: int) -> set[tuple[str, int]]:
    """Address and port of every TCP socket on which a process or one of its children listens."""
    family = [psutil.Process(pid), *psutil.Process(pid).children(recursive=True)]
    return {
        (socket.laddr.ip, socket.laddr.port)
        for process in family
        for socket in process.net_connections("tcp")
        if socket.status == psutil.CONN_LISTEN
    }


def beyond_loopback(sockets: set[tuple[str, int]]) -> set[tuple[str, int]]:
    """Those that another machine might reach."""
    return {(host, port) for host, port in sockets if not ipaddress.ip_address(host).is_loopback}


def pages(sockets: set[tuple[str, int]]) -> list[str]:
    """The pages of Dask that are shown."""
    results = []
    with httpx.Client(timeout=5.0) as client:
        for host, port in sorted(sockets):
            for page in PAGES:
                try:
                    answer = client.get(f"http://{f'[{host}]' if ':' in host else host}:{port}{page}")
                except httpx.HTTPError:  # speaks something else, as Dask's own protocol
                    break
                if answer.status_code != httpx.codes.NOT_FOUND:
                    results.append(str(answer.url))
    return results
