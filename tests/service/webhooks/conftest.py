"""A receiver of webhooks."""

import pytest

from .local_receiver import Receiver


@pytest.fixture
def receiver():
    made = Receiver()
    yield made
    made.close()
