"""The workers that are connected now."""

from collections.abc import Mapping
from typing import Any

from distributed import Client


def connected_workers(client: Client) -> Mapping[str, Any]:
    """Information of the scheduler about every worker, by address.

    Raises:
        ConnectionError: when the scheduler is not available.
    """
    info = client.scheduler_info(n_workers=-1)
    # A client that has just lost its scheduler returns an empty record.
    if "workers" not in info:
        raise ConnectionError("the scheduler is not available")
    return dict(info["workers"])
