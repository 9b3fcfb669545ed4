"""/v1/volumes/{id}/coefficients: the arrays of the spline, and every refusal."""

import io

import numpy as np
import pytest

from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_kernels.splines import Spline
from bentray_service.rows.ids import new_id
from bentray_workers.rendering import coefficients

from ..stored_volumes import store_volume


@pytest.mark.parametrize(
    ("query", "name", "smoothing"),
    [
        ({}, "bspline3", 30.0),
        ({"smoothing": 0}, "bspline3", 0.0),
        ({"filter": "catmull-rom"}, "catmull-rom", 0.0),
    ],
)
def test_the_coefficients_are_those_of_the_spline(http, cluster, query, name, smoothing):
    values = np.round(200.0 * sampled(ONE_HOLE, 14)).astype(np.uint8)
    here = f"/v1/volumes/{store_volume(http, values)}"
    assert http.get(here).json()["links"]["coefficients"] == f"{here}/coefficients"
    answer = http.get(f"{here}/coefficients", params=query)
    assert answer.headers["content-type"] == "application/x-npy"
    computed = np.load(io.BytesIO(answer.content))
    expected = Spline.from_volume(values, name, smoothing=smoothing).coefficients
    assert computed.dtype == np.float32
    np.testing.assert_allclose(computed, expected, atol=1e-4)
    assert cluster.submitted[-1]["resources"] == {"render": 1}
    again = http.get(f"{here}/coefficients", params=query, headers={"If-None-Match": answer.headers["etag"]})
    assert again.status_code == 304


def test_large_and_unknown_volumes_are_refused(http, monkeypatch):
    monkeypatch.setattr(coefficients, "MAX_NODES", 1000)
    answer = http.get(f"/v1/volumes/{store_volume(http, sampled(ONE_HOLE, 12))}/coefficients")
    assert (answer.status_code, answer.json()["field"]) == (422, "volume")
    assert "at most 1000 nodes" in answer.json()["detail"]
    assert http.get(f"/v1/volumes/{new_id('volume')}/coefficients").status_code == 404
