"""/v1/volumes/{id}/histogram: NumPy's numbers, computed once; and every refusal."""

import numpy as np
import pytest

from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_service import pictures

from ..stored_volumes import store_volume


def test_the_counts_are_those_of_numpy_and_computed_once(http, cluster):
    values = np.round(200.0 * sampled(ONE_HOLE, 14)).astype(np.uint8)
    here = f"/v1/volumes/{store_volume(http, values)}"
    assert http.get(here).json()["links"]["histogram"] == f"{here}/histogram"
    body = http.get(f"{here}/histogram").json()
    counts, edges = np.histogram(values, 256)
    assert body["counts"] == counts.tolist()
    np.testing.assert_allclose(body["edges"], edges)
    assert (body["quantity"], body["unit"], body["smoothing"]) == ("value", "", 30.0)
    assert body["minimum"] < body["iso"] < body["maximum"]
    assert cluster.submitted[-1]["resources"] == {"render": 1}
    submitted = len(cluster.submitted)
    assert http.get(f"{here}/histogram").json() == body
    assert len(cluster.submitted) == submitted
    assert http.get(f"{here}/histogram?bins=10").json()["counts"] == np.histogram(values, 10)[0].tolist()
    assert len(cluster.submitted) == submitted + 1


def test_old_histograms_are_dropped(http, cluster, monkeypatch):
    monkeypatch.setattr(pictures, "MAX_HISTOGRAMS", 2)
    here = f"/v1/volumes/{store_volume(http)}/histogram"
    for bins in (2, 3, 4, 2):
        assert len(http.get(here, params={"bins": bins}).json()["counts"]) == bins
    assert len(cluster.submitted) == 4


def test_of_a_reconstruction(http, uploaded, submitted, until, work):
    volume = http.get(until(http, submitted(http, uploaded(http))["id"])["links"]["volume"]).json()
    body = http.get(volume["links"]["histogram"]).json()
    assert (body["quantity"], body["unit"], body["iso"]) == ("speed", "m/s", None)
    assert sum(body["counts"]) == np.prod(volume["shape"])
    assert [body["minimum"], body["maximum"]] == pytest.approx(volume["value_range"])
    wrong = http.get(volume["links"]["histogram"], params={"quantity": "value"})
    assert (wrong.status_code, wrong.json()["field"]) == (422, "quantity")


@pytest.mark.parametrize(
    ("query", "field", "accepted"),
    [
        ("quantity=speed", "quantity", "value"),
    ],
)
def test_rejects_invalid_input(http, cluster, query, field, accepted):
    answer = http.get(f"/v1/volumes/{store_volume(http)}/histogram?{query}")
    assert (answer.status_code, answer.json()["field"]) == (422, field), answer.json()
    assert accepted in answer.json()["accepted"]
    assert not cluster.submitted
