"""A small simulated scan for all tests of the session."""

import pytest

import bentray


@pytest.fixture(scope="session")
def simulated() -> bentray.Scan:
    """A ring of 24 elements around the 2-D phantom, by exact times."""
    return bentray.simulate(nodes=32, elements=24, coupling_mps=1375.0, progress=False)
