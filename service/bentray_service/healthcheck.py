"""Ask a running service whether it is ready: ``python -m bentray_service.healthcheck [URL]``; exit 0 or 1."""

from __future__ import annotations

import sys

import httpx

SECONDS = 10.0


def check(url: str) -> str | None:
    """None when the service at ``url`` is ready; otherwise why not, in words."""
    try:
        answer = httpx.get(f"{url.rstrip('/')}/health/ready", timeout=SECONDS)
        if answer.status_code == httpx.codes.OK:
            return None
        return str(answer.json()["detail"])
    except (httpx.HTTPError, httpx.InvalidURL, ValueError, KeyError) as error:
        return f"no service answers at {url}: {error}"


def main() -> None:
    """For a container's health check."""
    trouble = check(sys.argv[1] if len(sys.argv) > 1 else "http://127.0.0.1:8000")
    if trouble:
        sys.exit(trouble)


if __name__ == "__main__":
    main()
