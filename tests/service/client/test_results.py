"""Results of a service as arrays: places, units and provenance, as of a reconstruction in this process."""

import numpy as np
import pytest

from bentray_service.client import Client


@pytest.fixture
def result(serve, work, scan):
    with Client(serve(), poll_s=0.02) as client:
        job = client.submit(client.upload(scan()).id, {"nodes": 16})
        return client.result(client.wait(job.id).volume)


def test_a_reconstruction_has_places_units_and_provenance(result):
    assert result.axes == ("x", "y")
    assert result.speed.max() == 1540.0
    assert set(result.values) == {"speed", "coverage"}
    np.testing.assert_allclose(result.coordinates["x"], -0.01 + 1e-3 * np.arange(16))
    assert result.units == {"speed": "m/s", "coverage": "m"}
    assert result.attributes["bentray"] == "test"
    assert result.attributes["title"] == "Sixteen elements"
    assert result.attributes["id"].startswith("vol-")
    assert result.settings.nodes == 16


def test_an_uploaded_volume_keeps_its_unit_and_places(serve, work, tmp_path):
    values = np.arange(60, dtype=np.float32).reshape(3, 4, 5)
    np.save(tmp_path / "cube.npy", values)
    with Client(serve()) as client:
        record = client.upload(tmp_path / "cube.npy", kind="volume", spacing_m="0.002", title="Cube")
        result = client.result(record.id)
    np.testing.assert_array_equal(result.values["value"], values)
    assert (result.units, result.attributes["title"]) == ({"value": ""}, "Cube")
    np.testing.assert_allclose(result.coordinates["z"], 2e-3 * np.arange(5))
