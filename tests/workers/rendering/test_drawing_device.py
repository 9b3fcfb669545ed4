"""Pictures drawn by an OpenCL device: those of compiled code within a bound, with its name; lost devices."""

import io
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from bentray_kernels.errors import InvalidInput
from bentray_kernels.meshes.example_surfaces import torus
from bentray_kernels.opencl import Session, device_selection, engine_selection
from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_workers.files.volume import Volume, write_volume
from bentray_workers.rendering import field_picture, refraction
from bentray_workers.rendering.drawing_device import PROCESSOR
from bentray_workers.rendering.field_settings import FieldSettings
from bentray_workers.rendering.field_view import FieldView
from bentray_workers.rendering.refraction_view import RefractionView
from bentray_workers.rendering.turntable import Turntable, draw_turntable

from ..pixels import pixels_of
from .field_folders import field_of

# A ray that takes another path on the device shows in the pixels around, too, where edges are smoothed.
GLASS = RefractionView(iso=(0.5,), supersampling="none", width=96, height=64)
MIRROR = FieldView(width=64, height=48, mode="refract")

# Share of pixels that may differ by more than one level of 255: rays in float32, and in float64.
ODD_GLASS, ODD_FIELD = 5e-3, 1e-3


@pytest.fixture(scope="module")
def volume(tmp_path_factory):
    path = tmp_path_factory.mktemp("glass") / "v.h5"
    write_volume(path, Volume.from_values(sampled(ONE_HOLE, 24), (1e-3,) * 3))
    return path


@pytest.fixture(scope="module")
def field(tmp_path_factory):
    settings = FieldSettings(samples=10, inner_samples=6, divisions=8, image_size=65)
    return field_of(tmp_path_factory.mktemp("field"), torus(24, 16), settings)


def device_of(png: bytes) -> str:
    return str(Image.open(io.BytesIO(png)).info["Device"])


def odd(computed: bytes, expected: bytes) -> float:
    """Share of pixels that differ by more than one level."""
    return float((np.abs(pixels_of(computed).astype(int) - pixels_of(expected)).max(axis=2) > 1).mean())


@pytest.fixture
def failing(opencl_session, monkeypatch):
    """The device, opened for this test alone, whose queue breaks at the launch of the given number."""
    import pyopencl as cl

    def open_for(at):
        session = Session(opencl_session.device)
        monkeypatch.setattr(engine_selection, "open_session", lambda device: session)
        launch, launches = session.launch, []

        def broken(*arguments):
            launches.append(arguments)
            if len(launches) == at:
                session.queue = cl.CommandQueue(cl.Context([session.handle]))
            launch(*arguments)

        monkeypatch.setattr(session, "launch", broken)
        return session

    return open_for


@pytest.mark.opencl
def test_glass_by_the_device_is_that_of_compiled_code(volume, opencl_session):
    expected = refraction.picture_png(volume, replace(GLASS, device="cpu"))
    assert device_of(expected) == PROCESSOR
    computed = refraction.picture_png(volume, replace(GLASS, device="opencl"))
    device = opencl_session.device
    assert device_of(computed) == f"{device.label}, driver {device.driver}"
    assert odd(computed, expected) <= ODD_GLASS
    # Other indices of the same scene, from the copy on the device.
    other = replace(GLASS, index=(1.2,))
    pictures = [refraction.picture_png(volume, replace(other, device=word)) for word in ("opencl", "cpu")]
    assert odd(*pictures) <= ODD_GLASS
    assert odd(pictures[0], computed) > ODD_GLASS


@pytest.mark.opencl
def test_a_geometry_field_by_the_device_is_that_of_compiled_code(field, opencl_session):
    expected = field_picture.picture_png(field, replace(MIRROR, device="cpu"))
    assert device_of(expected) == PROCESSOR
    computed = field_picture.picture_png(field, replace(MIRROR, device="opencl"))
    assert device_of(computed).startswith(opencl_session.device.label)
    assert odd(computed, expected) <= ODD_FIELD


@pytest.mark.opencl
def test_a_turntable_states_what_drew_its_frames(volume, tmp_path, opencl_session):
    how = {"iso": (0.5,), "width": 32, "height": 24, "frames": 2, "device": "opencl"}
    for kind in ("zip", "apng"):
        (tmp_path / kind).mkdir()
        table = Turntable(**how, format=kind)
        draw_turntable(None, volume, table, tmp_path / f"t.{kind}", tmp_path / kind)
    with zipfile.ZipFile(tmp_path / "t.zip") as archive:
        frames = [archive.read(name) for name in archive.namelist()]
    for png in (*frames, (tmp_path / "t.apng").read_bytes()):
        assert device_of(png).startswith(opencl_session.device.label)


@pytest.mark.opencl
def test_the_processor_draws_once_more_what_a_lost_device_left(volume, field, failing, caplog):
    expected = refraction.picture_png(volume, replace(GLASS, device="cpu"))
    # The first launch is that of the self-test of the scene.
    session = failing(at=2)
    computed = refraction.picture_png(volume, replace(GLASS, device="opencl"))
    assert session.lost
    assert [record.getMessage() for record in caplog.records] == [session.lost]
    assert device_of(computed) == f"{PROCESSOR}: {session.lost}"
    np.testing.assert_array_equal(pixels_of(computed), pixels_of(expected))
    again = field_picture.picture_png(field, replace(MIRROR, device="opencl"))
    assert device_of(again) == f"{PROCESSOR}: {session.lost}"
    assert len(caplog.records) == 1, "it is not tried again"


def test_cpu_never_asks_for_devices(volume, field, monkeypatch):
    monkeypatch.delenv("BENTRAY_DEVICE", raising=False)
    monkeypatch.setattr(engine_selection, "find_devices", lambda: pytest.fail("asked"))
    monkeypatch.setattr(device_selection, "find_devices", lambda: pytest.fail("asked"))
    pictures = (
        refraction.picture_png(volume, replace(GLASS, device="cpu")),
        field_picture.picture_png(field, replace(MIRROR, device="cpu")),
    )
    assert {device_of(png) for png in pictures} == {PROCESSOR}


@pytest.mark.parametrize(
    ("draw", "view"), [(refraction.picture_png, GLASS), (field_picture.picture_png, MIRROR)]
)
def test_a_device_that_does_not_exist_is_an_error_before_the_file_is_read(tmp_path, monkeypatch, draw, view):
    monkeypatch.delenv("BENTRAY_DEVICE", raising=False)
    monkeypatch.setenv("BENTRAY_OPENCL_DEVICE", "none")
    with pytest.raises(InvalidInput, match="device: found 'opencl', but BENTRAY_OPENCL_DEVICE=none hides"):
        draw(tmp_path / "absent.h5", replace(view, device="opencl"))
    with pytest.raises(InvalidInput, match="device: found 'gpu'; accepted: one of auto, cpu, opencl"):
        replace(view, device="gpu")
