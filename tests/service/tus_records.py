"""Headers of resumable uploads, and their records at their ends."""

from ..waiting import wait_until

TUS = {"Tus-Resumable": "1.0.0"}
PIECE = {**TUS, "Content-Type": "application/offset+octet-stream"}
ENDED = ("done", "refused")


def settled(http, location):
    """The record of an upload once its file is read or refused."""
    return wait_until(lambda: (record := http.get(location).json())["state"] in ENDED and record)
