"""/v1/volumes/{id}/summary and the quantities of a result: coverage, and the truth of its scan."""

import io

import numpy as np
import pytest

from bentray_kernels.tomography.result import Candidate

STREAM = {"Content-Type": "application/octet-stream"}
RAMP = 1500.0 + np.arange(60.0)[:, None] + np.zeros(60)


@pytest.fixture
def result(http, scan, work, submitted, until):
    """The volume of a reconstruction of a scan with a truth, whose nodes 0 to 9 mm are those of the image."""
    straight, bent = ({"rays": rays, "method": "sart"} for rays in ("straight", "curved"))
    work.trials = (Candidate(bent, 2e-7, 1e-7, 1.5e-7), Candidate(straight, 4e-7, 3e-7))

    def with_truth(file):
        file["truth/sound_speed_mps"] = RAMP
        file["truth"].attrs.update(spacing_m=1e-3, origin_m=[-0.02, -0.01])

    stream = {"Content-Type": "application/x-hdf5"}
    sent = http.post("/v1/datasets", content=scan(with_truth).read_bytes(), headers=stream).json()
    assert sent["has_truth"]
    return f"/v1/volumes/{until(http, submitted(http, sent['id'])['id'])['volume']}"


def values(http, result, quantity):
    answer = http.get(f"{result}/data", params={"format": "npy", "quantity": quantity})
    assert answer.status_code == 200, answer.text
    return np.load(io.BytesIO(answer.content))


def test_the_truth_is_read_at_the_nodes_of_the_result(http, result):
    # Node 0 of the image is at -10 mm, that of the truth at -20 mm.
    np.testing.assert_allclose(
        values(http, result, "truth"), 1510.0 + np.arange(16.0)[:, None] + np.zeros(16)
    )
    np.testing.assert_array_equal(values(http, result, "coverage"), np.ones((16, 16)))
    speed, coverage = (http.get(f"{result}/data?format=npy&quantity={one}") for one in ("speed", "coverage"))
    assert speed.headers["etag"] != coverage.headers["etag"]
    assert "coverage" in coverage.headers["content-disposition"]


def test_a_summary_names_quantities_candidates_and_errors(http, result):
    record = http.get(f"{result}/summary").json()
    assert record["quantities"] == ["speed", "coverage", "truth"]
    assert [(row["label"], row["chosen"]) for row in record["candidates"]] == [
        ("bent rays, SART", True),
        ("straight rays, SART", False),
    ]
    assert (record["criterion"], record["candidates"][0]["outcome"]) == ("held_out_rms_s", "chosen and shown")
    assert record["candidates"][0]["held_out_mean_s"] == 1.5e-7
    assert record["candidates"][1]["held_out_mean_s"] is None
    assert record["reason"].startswith("auto chose bent rays, SART")
    inside = values(http, result, "speed") - values(http, result, "truth")
    assert 0 < record["truth"]["nodes"] <= inside.size
    assert record["truth"]["rmse_mps"] == pytest.approx(np.sqrt(np.mean(inside**2)), rel=1e-9)
    assert record["truth"]["mean_absolute_error_mps"] == pytest.approx(np.abs(inside).mean(), rel=1e-9)
    assert record["truth"]["true_mean_mps"] == pytest.approx(record["truth"]["mean_mps"] - inside.mean())
    assert -1.0 <= record["truth"]["ssim"] <= 1.0


@pytest.mark.parametrize("quantity", ["attenuation", "recovery", "reflection", "colour"])
def test_a_quantity_that_is_missing_is_named(http, result, quantity):
    answer = http.get(f"{result}/data", params={"format": "npy", "quantity": quantity})
    assert (answer.status_code, answer.json()["field"]) == (422, "quantity")


def test_the_truth_has_one_image(http, result):
    answer = http.get(f"{result}/data", params={"format": "mat", "quantity": "truth"})
    assert (answer.status_code, answer.json()["field"]) == (422, "format")
    assert http.get(f"{result}/data", params={"quantity": "truth"}).json()["field"] == "quantity"


def test_a_scan_without_truth_has_none(http, uploaded, work, submitted, until):
    here = f"/v1/volumes/{until(http, submitted(http, uploaded(http))['id'])['volume']}"
    assert http.get(f"{here}/summary").json() == {
        "quantities": ["speed", "coverage"],
        "resolution_width_m": [],
        "trust": "no standard deviations, no cautions",
        "cautions": [],
        "grids": {},
        "candidates": [],
        "criterion": "",
        "misfit_over_noise": None,
        "reason": "",
        "automatic": "",
        "truth": None,
    }
    answer = http.get(f"{here}/data", params={"format": "npy", "quantity": "truth"})
    assert (answer.status_code, answer.json()["field"]) == (422, "quantity")


def test_an_upload_has_no_summary(http):
    buffer = io.BytesIO()
    np.save(buffer, np.zeros((3, 4, 5), np.float32))
    sent = http.post("/v1/volumes", content=buffer.getvalue(), headers=STREAM).json()
    assert http.get(f"{sent['links']['self']}/summary").json()["field"] == "volume"
    answer = http.get(sent["links"]["data"], params={"format": "npy", "quantity": "truth"})
    assert answer.json()["field"] == "quantity"
