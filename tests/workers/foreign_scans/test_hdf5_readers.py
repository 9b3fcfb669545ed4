"""Scans of zea and openUSCT become canonical files; other acquisitions are rejected by name."""

import numpy as np
import pytest

from bentray_workers.files.dataset import read_dataset
from bentray_workers.foreign_scans import convert_dataset

from .hdf5_scans import EMITTERS, emitted, openusct_fields, write_fields, zea_fields
from .scans import ELEMENTS, RATE_HZ, T0_S, positions, refused


def in_track(fields: dict) -> dict:
    """Fields of newer files of zea: in a track, with the positions in the group ``probe``."""
    moved = {f"tracks/track_0/{path}": value for path, value in fields.items()}
    moved["probe/probe_geometry"] = moved.pop("tracks/track_0/scan/probe_geometry")
    return moved | {"probe/name": np.bytes_("ring")}


@pytest.mark.parametrize(
    ("fields", "t0_s"),
    [(zea_fields(), T0_S), (in_track(zea_fields()), T0_S), (openusct_fields(), 0.0)],
    ids=["zea", "zea-track", "openusct"],
)
def test_synthetic_aperture_scans_are_converted(tmp_path, fields, t0_s):
    source = write_fields(tmp_path / "scan", fields)
    made = convert_dataset(source, tmp_path / "canonical.h5")
    assert made.waveform.object.strides == (0, 0, 0), "traces are not held"
    dataset = read_dataset(tmp_path / "canonical.h5")
    np.testing.assert_array_equal(dataset.waveform.object, emitted())
    np.testing.assert_allclose(dataset.element_position_m, positions(), atol=1e-8)
    assert dataset.tx.tolist() == list(EMITTERS)
    assert dataset.rx.tolist() == list(range(ELEMENTS))
    assert dataset.sampling_rate_hz == pytest.approx(RATE_HZ)
    assert dataset.t0_s == pytest.approx(t0_s)
    assert dataset.center_frequency_hz == pytest.approx(4e5)
    assert dataset.water_speed_mps == 1490.0
    assert not dataset.water_temperature_assumed
    assert dataset.waveform.water is None


def test_an_array_in_space_keeps_its_heights_and_integers_stay_integers(tmp_path):
    position = np.column_stack((positions(), np.linspace(0.0, 0.01, ELEMENTS)))
    counts = (1000 * zea_fields()["data/raw_data"]).astype(np.int16)
    fields = zea_fields(**{"scan/probe_geometry": position.astype(np.float32), "data/raw_data": counts})
    dataset = convert_dataset(write_fields(tmp_path / "scan", fields), tmp_path / "canonical.h5")
    assert dataset.element_position_m.shape == (ELEMENTS, 3)
    assert dataset.waveform.object.dtype == np.int16


def beams() -> np.ndarray:
    return np.ones((len(EMITTERS), ELEMENTS), np.float32)


@pytest.mark.parametrize(
    ("fields", "field", "found"),
    [
        (zea_fields(**{"scan/tx_apodizations": beams()}), "scan/tx_apodizations", "8 elements that emit"),
        (zea_fields(**{"scan/tx_apodizations": 0 * beams()}), "scan/tx_apodizations", "0 elements that emit"),
        (zea_fields(**{"scan/tx_apodizations": None}), "scan/tx_apodizations", "nothing"),
        (zea_fields(**{"data/raw_data": np.zeros((2, 3, 4, 8, 1))}), "data/raw_data", "2 frames"),
        (zea_fields(**{"data/raw_data": np.zeros((1, 3, 4, 8, 2))}), "data/raw_data", "2 channels"),
        (zea_fields(**{"data/raw_data": np.zeros((3, 4, 8))}), "data/raw_data", "shape"),
        (
            zea_fields(**{"scan/initial_times": np.array([0, 0, 1e-5])}),
            "scan/initial_times",
            "0 to 1e-05 s",
        ),
        (zea_fields(**{"scan/probe_geometry": positions()}), "scan/probe_geometry", "shape (8, 2)"),
        (zea_fields(**{"scan/sound_speed": np.float32("nan")}), "scan/sound_speed", "nan"),
        (in_track(zea_fields()) | {"tracks/track_1/label": 1}, "tracks", "several"),
        (openusct_fields(**{"@format_version": "2.0"}), "@format_version", "'2.0'"),
        (openusct_fields(**{"acquisition@sample_rate_hz": None}), "acquisition@sample_rate_hz", "nothing"),
        (openusct_fields(**{"acquisition/tx_elements": np.arange(9)}), "acquisition/tx_elements", "shape"),
        (openusct_fields(**{"acquisition/tx_elements": np.arange(3) + 7}), "acquisition/tx", "8 at"),
        (openusct_fields(**{"geometry/element_pos": np.zeros((3, 2))}), "geometry/element_pos", "shape"),
        (openusct_fields(**{"acquisition/data": np.zeros((3, 8))}), "acquisition/data", "shape (3, 8)"),
    ],
)
def test_other_acquisitions_are_named(tmp_path, fields, field, found):
    error = refused(write_fields(tmp_path / "scan", fields))
    assert error.field == field
    assert found in str(error.value)
    assert not (tmp_path / "canonical.h5").exists()
