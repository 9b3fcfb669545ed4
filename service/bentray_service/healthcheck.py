"""Whether a part of an installation works: ``python -m bentray_service.healthcheck [ADDRESS [worker]]``.

Without an address it asks the service on port 8000 of this machine whether it is ready. The address of a
Dask scheduler, as ``tcp://127.0.0.1:8786``, asks whether that answers; with the word ``worker`` whether a
worker of this machine has joined it. Ends with 0, or 1 and the reason, or 2 where the words make no sense.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

SECONDS = 10.0


def check(url: str) -> str | None:
    """None when the service at ``url`` is ready; otherwise why not, in words."""
    import httpx

    try:
        answer = httpx.get(f"{url.rstrip('/')}/health/ready", timeout=SECONDS)
        if answer.status_code == httpx.codes.OK:
            return None
        return str(answer.json()["detail"])
    except (httpx.HTTPError, httpx.InvalidURL, ValueError, KeyError) as error:
        return f"no service answers at {url}: {error}"


def check_scheduler(address: str) -> str | None:
    """None when a Dask scheduler answers at ``address``; otherwise why not."""
    from bentray_kernels.errors import InvalidInput

    try:
        _hosts(address)
    except InvalidInput as error:
        return str(error)
    return None


def check_worker(address: str) -> str | None:
    """None when the scheduler at ``address`` has a worker of this machine; otherwise why not."""
    from bentray_kernels.errors import InvalidInput
    from bentray_workers.joining import own_address

    try:
        found, here = _hosts(address), own_address(address)
    except (InvalidInput, OSError) as error:
        return str(error)
    return None if here in found else f"{address} has {len(found)} workers, none of them at {here}"


def _hosts(address: str) -> list[str]:
    """Where the workers of a scheduler are; the certificates are those that ``BENTRAY_TLS_DIR`` names."""
    from bentray_workers.cluster import identity_of
    from bentray_workers.tls import security_of

    folder = os.environ.get("BENTRAY_TLS_DIR")
    security = security_of(Path(folder) if folder else None)
    workers = identity_of(address, security, SECONDS, workers=-1)["workers"].values()
    return [worker["host"] for worker in workers]


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
