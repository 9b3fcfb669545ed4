"""Which workers there are, and a scheduler that has just gone."""

import pytest

from bentray_workers.cluster.connected import connected_workers


class Client:
    """Tells what it was last told."""

    def __init__(self, told):
        self._told = told

    def scheduler_info(self, n_workers):
        assert n_workers == -1, "of all of them"
        return self._told


def test_every_worker_by_its_address():
    assert connected_workers(Client({"workers": {"a": {"nthreads": 1}}})) == {"a": {"nthreads": 1}}
    assert connected_workers(Client({"workers": {}})) == {}


def test_a_client_without_its_scheduler_says_so():
    with pytest.raises(ConnectionError, match="the scheduler is not available"):
        connected_workers(Client({}))
