"""Which workers are connected now."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from distributed import Client


def connected_workers(client: Client) -> Mapping[str, Any]:
    """What the scheduler tells of every worker, by its address.

    Raises:
        ConnectionError: when the scheduler is away; a client that has just lost it tells of none at all.
    """
    told = client.scheduler_info(n_workers=-1)
    if "workers" not in told:
        raise ConnectionError("the scheduler is away")
    return dict(told["workers"])
