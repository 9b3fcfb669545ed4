"""The cluster provider: an embedded cluster, a given scheduler, and what is refused."""

import socket
import threading

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_workers.cluster import open_cluster
from bentray_workers.lanes import RENDER


def test_embedded_cluster_offers_both_lanes(cluster):
    facts = cluster.describe()
    assert facts["embedded"] is True
    assert facts["workers"] == 2
    assert facts["threads"] == 4
    assert facts["lanes"] == {"recon": 2.0, "render": 2.0}


def test_given_scheduler_is_joined_and_survives_leaving(cluster):
    address = cluster.client.cluster.scheduler_address
    if address.startswith("inproc"):
        address = cluster.client.scheduler.address
    with open_cluster(address) as joined:
        assert joined.describe()["embedded"] is False
        assert joined.client.submit(sum, [1, 2], resources=RENDER).result() == 3
    assert cluster.client.submit(sum, [2, 2]).result() == 4


def test_workers_in_processes_are_warm_and_isolated(tmp_path):
    import os

    with open_cluster(workers=1, local_directory=tmp_path) as own:
        pid = own.client.submit(os.getpid).result()
        assert pid != os.getpid()
        compiled = own.client.submit(_compiled_methods).result()
    assert "accurate" in compiled


def _compiled_methods():
    """Which solvers have run in this process: their compiled inner functions have signatures."""
    from bentray_kernels.eikonal.accurate import _pass

    return ["accurate"] if _pass.signatures else []


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense", "tcp://"])
def test_missing_scheduler_is_named(address):
    with pytest.raises(InvalidInput, match="scheduler_address") as refusal:
        open_cluster(address, connect_timeout_s=0.5)
    assert "a running Dask scheduler" in str(refusal.value)


@pytest.mark.parametrize(
    "answer", [b"", b"HTTP/1.1 400 Bad Request\r\n\r\n"], ids=["silence", "a web server"]
)
def test_what_is_no_scheduler_is_refused_in_time(answer):
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
        thread.join(10.0)
    assert not thread.is_alive()


def test_no_workers_is_refused():
    with pytest.raises(InvalidInput, match="workers"):
        open_cluster(workers=0)
