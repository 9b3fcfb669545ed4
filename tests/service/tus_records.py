"""Records of resumable uploads, waited for."""

from ..waiting import wait_until

ENDED = ("done", "refused")


def settled(http, location):
    """The record of an upload once its file is read or refused."""
    return wait_until(lambda: (record := http.get(location).json())["state"] in ENDED and record)
