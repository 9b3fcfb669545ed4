"""Results as arrays: places, units, provenance, and the same as a dataset of xarray."""

import sys

import numpy as np
import pytest

from bentray_service.client import Client, ClientError
from bentray_service.client.results import Result


@pytest.fixture
def result(serve, work, scan):
    with Client(serve(), poll_s=0.02) as client:
        job = client.submit(client.upload(scan()).id, {"nodes": 16})
        return client.result(client.wait(job.id).volume)


def test_a_reconstruction_has_places_units_and_provenance(result):
    assert result.axes == ("x", "y")
    assert result.values["speed"].max() == 1540.0
    assert set(result.values) == {"speed", "coverage"}
    np.testing.assert_allclose(result.coordinates["x"], -0.01 + 1e-3 * np.arange(16))
    assert result.units == {"speed": "m/s", "coverage": "m"}
    assert result.attributes["bentray"] == "test"
    assert result.attributes["title"] == "Sixteen elements"


def test_xarray_finds_a_place(result):
    found = result.to_xarray()
    assert found.speed.dims == ("x", "y")
    assert (found.speed.attrs, found.x.attrs) == ({"units": "m/s"}, {"units": "m"})
    assert found.attrs["bentray"] == "test"
    assert float(found.speed.sel(x=-0.01, y=-0.01, method="nearest")) == result.values["speed"][0, 0]


def test_missing_xarray_is_reported(monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ClientError, match="pip install"):
        Result((), {}, {}, {}).to_xarray()
