"""The cluster connection: an embedded cluster, a given scheduler, and rejected addresses."""

import os
import socket
import sys
import threading
import warnings
from types import SimpleNamespace
from urllib.parse import urlsplit

import pytest
from distributed import LocalCluster
from distributed.security import Security

from bentray_kernels.errors import InvalidInput
from bentray_workers.cluster.connection import Cluster, identity_of, open_cluster
from bentray_workers.cluster.job_progress import compilation_on
from bentray_workers.cluster.resources import RENDER
from bentray_workers.cluster.tls import own_security

from ...listening import beyond_loopback, listening, pages


def test_embedded_cluster_has_all_lanes(cluster):
    facts = cluster.describe()
    assert facts["embedded"] is True
    assert facts["workers"] == 2
    assert facts["threads"] == 8
    assert facts["lanes"] == {"recon": 2.0, "render": 2.0, "short": 2.0, "drawing": 2.0}


def test_given_scheduler_is_joined_and_survives_leaving(cluster):
    address = cluster.client.cluster.scheduler_address
    if address.startswith("inproc"):
        address = cluster.client.scheduler.address
    with open_cluster(address) as joined:
        assert joined.describe()["embedded"] is False
        assert joined.client.submit(sum, [1, 2], resources=RENDER).result() == 3
    assert cluster.client.submit(sum, [2, 2]).result() == 4


def test_large_arguments_are_no_reason_to_warn(cluster):
    """Dask would from 10 MB on; a step of a refinement takes as much."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert cluster.client.submit(len, bytes(2 * 10**7)).result() == 2 * 10**7


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """A cluster whose worker is a process, as the service starts it, and where it listens."""
    before = listening(os.getpid())
    with open_cluster(workers=1, local_directory=tmp_path_factory.mktemp("own")) as cluster:
        yield cluster, listening(os.getpid()) - before


def test_workers_in_processes_are_isolated_and_have_loaded_the_tasks(own):
    own, _ = own
    pid = own.client.submit(os.getpid).result()
    assert pid != os.getpid()
    assert own.client.submit(_loaded, "bentray_workers.reconstruction.reconstruction_run").result()
    assert not compilation_on(own.client).active


def test_it_listens_on_loopback_only_and_shows_no_page(own):
    own, sockets = own
    scheduler = own.describe()["scheduler"]
    assert int(scheduler.rsplit(":", 1)[1]) in {port for _, port in sockets}
    assert len(sockets) >= 4, "a web server each beside Dask's own ports, and they are looked at"
    assert beyond_loopback(sockets) == set()
    assert pages(sockets) == []


def test_other_users_cannot_connect(own):
    """They reach loopback, but have no key of this process: neither plainly nor by a key of their own."""
    own, sockets = own
    assert own.describe()["scheduler"].startswith("tls://")
    for host, port in sockets:
        for protocol, security in (("tcp", Security()), ("tls", own_security())):
            with pytest.raises(InvalidInput, match="scheduler_address"):
                identity_of(f"{protocol}://{host}:{port}", security, 2.0)
    assert own.client.submit(sum, [1, 2]).result() == 3


@pytest.mark.nightly
def test_the_search_for_pages_finds_those_that_dask_shows_by_default(tmp_path):
    """Guards the test above."""
    with LocalCluster(
        n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0", local_directory=str(tmp_path)
    ):
        shown = pages(listening(os.getpid()))
    assert {"/health", "/json/counts.json"} <= {urlsplit(page).path for page in shown}


def test_restarted_scheduler_is_reconnected():
    clients = [SimpleNamespace(status="closed", close=lambda: None), SimpleNamespace(status="running")]
    offered = iter([clients[0], InvalidInput("scheduler_address", "gone", "there"), clients[1]])

    def connect():
        if isinstance(result := next(offered), InvalidInput):
            raise result
        return result

    cluster = Cluster(connect)
    with pytest.raises(ConnectionError, match="gone"):
        _ = cluster.client
    assert cluster.client is clients[1]
    assert cluster.client is clients[1], "kept while it runs"


def _loaded(module):
    return module in sys.modules


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense", "tcp://"])
def test_missing_scheduler_is_named(address):
    with pytest.raises(InvalidInput, match=r"scheduler_address.*a running Dask scheduler"):
        open_cluster(address, connect_timeout_s=0.5)


@pytest.mark.parametrize(
    "answer", [b"", b"HTTP/1.1 400 Bad Request\r\n\r\n"], ids=["silence", "a web server"]
)
def test_rejects_hosts_that_are_no_scheduler(answer):
    with socket.create_server(("127.0.0.1", 0)) as server:

        def listen():
            with server.accept()[0] as connection:
                connection.sendall(answer)
                while connection.recv(1000):
                    pass

        thread = threading.Thread(target=listen)
        thread.start()
        with pytest.raises(InvalidInput, match="scheduler_address"):
            open_cluster(f"tcp://127.0.0.1:{server.getsockname()[1]}", connect_timeout_s=0.5)
        thread.join(60.0)
    assert not thread.is_alive()
