"""Records of resumable uploads, waited for."""

import time

PATIENCE_S = 60.0


def settled(http, location):
    """The record of an upload once its file is read or refused."""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        record = http.get(location).json()
        if record["state"] in ("done", "refused"):
            return record
        time.sleep(0.02)
    raise AssertionError(record)
