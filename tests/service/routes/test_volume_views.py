"""Views of /v1/volumes/{id}: slices, histograms, coefficients and the summary with its quantities."""

import io

import numpy as np
import pytest
from PIL import Image

from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_kernels.splines import Spline
from bentray_kernels.tomography.result import Candidate
from bentray_service import pictures
from bentray_service.rows.ids import new_id
from bentray_workers.rendering import coefficients

from ..conftest import STREAM, made_once, npy, refused
from ..stored_volumes import store_volume


@pytest.fixture
def here(http):
    """The picture of an uploaded volume."""
    content = npy(np.arange(60, dtype=np.uint8).reshape(3, 4, 5))
    return http.post("/v1/volumes", content=content, headers=STREAM).json()["links"]["image"]


def test_every_axis_has_its_slices(http, here):
    sizes = {}
    for axis, last in (("x", 2), ("y", 3), ("z", 4)):
        asked = {"axis": axis, "index": last, "frame": False}
        sizes[axis] = Image.open(io.BytesIO(http.get(here, params=asked).content)).size
        refused(http.get(here, params={**asked, "index": last + 1}), "index", f"0 to {last}")
    assert sizes == {"x": (4, 5), "y": (3, 5), "z": (3, 4)}


def test_every_parameter_changes_picture_and_etag(http, here):
    asked = [
        {},
        {"axis": "x"},
        {"size": 300},
        {"interpolation": "cubic"},
        {"interpolation": "linear"},
        {"scale_bar": True},
        {"colour_bar": False},
        {"frame": False},
    ]
    answers = [http.get(here, params=request) for request in asked]
    assert len({answer.content for answer in answers}) == len(asked)
    assert len({answer.headers["etag"] for answer in answers}) == len(asked)


@pytest.mark.parametrize("view", ["slice.png", "refraction.png?width=32&height=24&iso=0.5"])
def test_a_view_is_made_once(http, cluster, view):
    made_once(http, cluster, f"/v1/volumes/{store_volume(http)}/{view}")


@pytest.mark.parametrize(
    ("view", "field", "accepted"),
    [
        ("slice.png?size=100", "size", ""),
        ("slice.png?index=12", "index", "0 to 11"),
        ("slice.png?quantity=speed", "quantity", "value"),
        ("histogram?quantity=speed", "quantity", "value"),
        ("refraction.png?iso=7", "iso", "0 to 1, the range of the volume"),
        ("refraction.png?iso=nan", "iso", "finite"),
        ("refraction.png?iso=0.8&iso=0.3&index=1.1&index=1.2", "iso", "rising"),
        ("refraction.png?iso=0.3&index=1.1&index=1.2", "index", "1: one for each"),
        ("refraction.png?mode=shaded&fresnel=true", "fresnel", "false, unless mode is refract"),
        ("refraction.png?backdrop=picture&squares=4", "squares", "16, unless backdrop is checkerboard"),
        (
            "refraction.png?supersampling=none&degree=2",
            "degree",
            "1, unless supersampling is real, or supersampling is prss",
        ),
        ("refraction.png?surroundings=2", "surroundings", "0 to 1"),
        ("refraction.png?smoothing=1&filter=trilinear", "smoothing", "B-spline"),
        (
            "refraction.png?width=4096&height=4096&supersampling=real&degree=2",
            "width, height, degree",
            "16777216",
        ),
        (
            "refraction.png?ray_spacing=2&supersampling=real",
            "ray_spacing",
            "1, unless supersampling is none or prss",
        ),
        ("refraction.png?isos=0.5", "isos", "one of iso, index"),
    ],
)
def test_refusals_need_no_worker(http, cluster, view, field, accepted):
    refused(http.get(f"/v1/volumes/{store_volume(http)}/{view}"), field, accepted)
    assert not cluster.submitted


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


def test_a_histogram_of_a_reconstruction(http, uploaded, submitted, until, work):
    volume = http.get(until(http, submitted(http, uploaded(http))["id"])["links"]["volume"]).json()
    body = http.get(volume["links"]["histogram"]).json()
    assert (body["quantity"], body["unit"], body["iso"]) == ("speed", "m/s", None)
    assert sum(body["counts"]) == np.prod(volume["shape"])
    assert [body["minimum"], body["maximum"]] == pytest.approx(volume["value_range"])
    refused(http.get(volume["links"]["histogram"], params={"quantity": "value"}), "quantity")


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
    assert "at most 1000 nodes" in refused(answer, "volume")["detail"]
    assert http.get(f"/v1/volumes/{new_id('volume')}/coefficients").status_code == 404


RAMP = 1500.0 + np.arange(60.0)[:, None] + np.zeros(60)


@pytest.fixture
def result(http, scan, work, submitted, until):
    """The volume of a reconstruction of a scan with a truth, whose nodes 0 to 9 mm are those of the image."""
    straight, bent = ({"rays": rays, "method": "sart"} for rays in ("straight", "curved"))
    work.trials = (Candidate(bent, 2e-7, 1e-7, 1.5e-7), Candidate(straight, 4e-7, 3e-7))

    def with_truth(file):
        file["truth/sound_speed_mps"] = RAMP
        file["truth"].attrs.update(spacing_m=1e-3, origin_m=[-0.02, -0.01])

    sent = http.post("/v1/datasets", content=scan(with_truth).read_bytes(), headers=STREAM).json()
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


@pytest.mark.parametrize(
    ("query", "field"),
    [
        ("format=npy&quantity=attenuation", "quantity"),
        ("format=npy&quantity=recovery", "quantity"),
        ("format=npy&quantity=reflection", "quantity"),
        ("format=npy&quantity=colour", "quantity"),
        ("format=mat&quantity=truth", "format"),
        ("quantity=truth", "quantity"),
    ],
)
def test_a_quantity_that_is_missing_or_not_alone_is_named(http, result, query, field):
    refused(http.get(f"{result}/data?{query}"), field)


def test_a_scan_without_truth_and_an_upload_have_none(http, here, uploaded, work, submitted, until):
    result = f"/v1/volumes/{until(http, submitted(http, uploaded(http))['id'])['volume']}"
    assert http.get(f"{result}/summary").json() == {
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
    upload = here.removesuffix("/slice.png")
    refused(http.get(f"{upload}/summary"), "volume")
    for volume in (result, upload):
        refused(http.get(f"{volume}/data?format=npy&quantity=truth"), "quantity")
