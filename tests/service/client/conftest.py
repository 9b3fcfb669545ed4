"""A client of a service behind a real socket."""

import pytest

from bentray_service.client import Client


@pytest.fixture
def client(serve, work):
    with Client(serve(), poll_s=0.02) as client:
        yield client
