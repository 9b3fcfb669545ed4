"""/v1/volumes/{id}/refraction.png: pictures of uploads and results, and every refusal."""

import io
import threading

import numpy as np
import pytest
from PIL import Image

from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_kernels.tomography.result import Reconstruction
from bentray_service import pictures
from bentray_service.routes import pictures as routes_of_pictures
from bentray_workers.cluster.resources import RECONSTRUCTION
from bentray_workers.rendering import refraction, scene_cache, tiles
from bentray_workers.rendering.refraction_view import RefractionView

from ..conftest import refused
from ..stored_volumes import store_volume

SMALL = {"width": 32, "height": 24, "iso": 0.5}
# Workers of this process wait for it.
GO_ON = threading.Event()


def wait_to_go_on():
    assert GO_ON.wait(60.0)


def put(http, values=None, spacing=(1e-3,) * 3):
    volume_id = store_volume(http, values, spacing)
    return http.get(f"/v1/volumes/{volume_id}").json()["links"]["refraction"]


def test_a_picture_is_cast_in_the_render_lane(http, cluster):
    more = {"backdrop": "picture", "iso": [0.3, 0.8], "index": [1.3, 1.6]}
    answer = http.get(put(http), params={**SMALL, **more})
    assert answer.headers["content-type"] == "image/png"
    assert Image.open(io.BytesIO(answer.content)).size == (32, 24)
    assert cluster.submitted[-1] == {"pure": False, "resources": {"render": 1}, "priority": 10}


def test_every_parameter_changes_the_picture_or_its_tag(http):
    here = put(http)
    other = {
        "iso": 0.4,
        "index": 1.2,
        "outside": 1.1,
        "surroundings": 1,
        "filter": "trilinear",
        "smoothing": 0.1,
        "camera": "perspective",
        "backdrop": "picture",
        "supersampling": "none",
        "fresnel": True,
        "mode": "shaded",
        "degree": 2,
        "ray_spacing": 2,
        "depth": 3,
        "azimuth_deg": 5,
        "elevation_deg": 5,
        "zoom": 2,
        "squares": 5,
        "backdrop_distance": 2,
        "up": "x",
        "width": 31,
        "height": 31,
        "device": "cpu",
    }
    assert set(other) == set(RefractionView().plain())
    tags = {http.get(here, params=SMALL).headers["etag"]}
    for name, value in other.items():
        answer = http.get(here, params={**SMALL, name: value})
        assert answer.status_code == 200, answer.text
        tags.add(answer.headers["etag"])
    assert len(tags) == len(other) + 1


def test_without_an_iso_value_the_middle_of_the_range(http):
    here, middle = put(http), dict(SMALL, iso=0.5, smoothing=0)
    low, high = sampled(ONE_HOLE, 12).min(), sampled(ONE_HOLE, 12).max()
    middle["iso"] = 0.5 * (float(np.float32(low)) + float(np.float32(high)))
    without = {name: value for name, value in middle.items() if name != "iso"}
    assert http.get(here, params=without).headers["etag"] == http.get(here, params=middle).headers["etag"]


def test_the_steps_of_8_bit_integers_are_smoothed_unless_requested(http):
    ball = np.round(40.0 * sampled(ONE_HOLE, 16)).astype(np.uint8)
    view = {"width": 48, "height": 48, "iso": 20, "supersampling": "none"}

    def picture(of, **more):
        return http.get(of, params={**view, **more}).content

    whole, real = put(http, ball), put(http, ball.astype(np.float32))
    assert picture(whole) == picture(whole, smoothing=30) != picture(whole, smoothing=0)
    assert picture(real) == picture(real, smoothing=0)
    assert picture(whole, filter="trilinear") == picture(whole, filter="trilinear", smoothing=0)


def test_large_picture_is_rendered_in_tiles(http, cluster, monkeypatch):
    monkeypatch.setattr(tiles, "TASK_RAYS", 100)
    answer = http.get(put(http), params=SMALL)
    assert Image.open(io.BytesIO(answer.content)).size == (32, 24)
    assert len(cluster.submitted) == 8 + 1


def test_a_volume_of_one_value_or_too_large_is_refused(http, cluster, monkeypatch):
    assert refused(http.get(put(http, np.ones((4, 4, 4)))), "volume")["found"] == "1 everywhere"
    assert http.head(put(http), params={"iso": 7}).status_code == 422
    monkeypatch.setattr(scene_cache, "MAX_BUILDING_BYTES", 1000)
    refused(http.get(put(http)), "volume", "1000 bytes")
    assert not cluster.submitted


def test_worker_rejection_is_422(http, monkeypatch):
    def refuse(path, view):
        raise InvalidInput("iso", "0.5", "what the filter leaves")

    monkeypatch.setattr(refraction, "picture_png", refuse)
    refused(http.get(put(http), params=SMALL), "iso", "what the filter leaves")


def breast(settings, slices, step):
    """A reconstruction with a fast ball in slow water."""
    ball = sampled(ONE_HOLE, settings.nodes)[..., :slices]
    return Reconstruction(
        speed=1500.0 + 50.0 * ball if slices > 1 else 1500.0 + 50.0 * ball[..., 0],
        coverage=np.ones(ball.shape if slices > 1 else ball.shape[:2]),
        spacing_m=(1e-3, 1e-3, step)[: 3 if slices > 1 else 2],
        origin_m=(0.0,) * (3 if slices > 1 else 2),
        water_speed_mps=1500.0,
        settings=settings,
        history=(),
        provenance={},
    )


@pytest.mark.parametrize(
    ("slices", "step", "found"),
    [(16, 1e-3, None), (1, 1e-3, "shape (16, 16)"), (16, float("nan"), "uneven slices")],
)
def test_a_reconstruction_as_glass(http, uploaded, submitted, until, work, monkeypatch, slices, step, found):
    plain = type(work).__call__

    def in_space(self, *given, **more):
        return breast(plain(self, *given, **more).settings, slices, step)

    monkeypatch.setattr(type(work), "__call__", in_space)
    volume = http.get(until(http, submitted(http, uploaded(http))["id"])["links"]["volume"]).json()
    answer = http.get(f"{volume['links']['self']}/refraction.png", params={"width": 32, "height": 32})
    if found is None:
        assert volume["links"]["refraction"] == f"{volume['links']['self']}/refraction.png"
        assert answer.content.startswith(b"\x89PNG")
        return
    assert "refraction" not in volume["links"]
    assert found in refused(answer, "volume", "even spacing")["found"]


def test_picture_during_reconstructions(on_workers, workers):
    """On a real cluster: the lane is free although every other one is busy."""
    with on_workers() as http:
        here = put(http)
        http.get(here, params=SMALL)
        GO_ON.clear()
        busy = [workers.client.submit(wait_to_go_on, pure=False, resources=RECONSTRUCTION) for _ in range(3)]
        try:
            assert http.get(here, params={**SMALL, "index": 1.1}).status_code == 200
            assert not any(future.done() for future in busy)
        finally:
            GO_ON.set()


def test_a_picture_that_no_worker_takes_is_503(on_workers, workers, monkeypatch):
    monkeypatch.setattr(pictures, "RENDER_SECONDS", 0.3)
    with on_workers() as http:
        here = put(http)
        GO_ON.clear()
        busy = workers.client.submit(wait_to_go_on, pure=False, resources={"render": 1})
        answer = http.get(here, params=SMALL)
        assert (answer.status_code, answer.json()["type"]) == (503, "/problems/busy")
        assert not busy.done()
        GO_ON.set()


def test_previews_count_less_in_the_rate_limit(http, monkeypatch):
    shares = []
    sign_in = http.app.state.access.sign_in
    monkeypatch.setattr(sign_in, "check_render", lambda caller, share: shares.append(share))
    here, side = put(http), {"iso": 0.5, "width": 64, "height": 64}
    monkeypatch.setattr(routes_of_pictures, "WHOLE_RAYS", 2 * 64 * 64)
    for more in ({}, {"supersampling": "real", "degree": 2}, {"ray_spacing": 2}, {"ray_spacing": 8}):
        assert http.get(here, params={**side, **more}).status_code == 200
    assert shares == [0.5, 1.0, 0.125, 0.1]
