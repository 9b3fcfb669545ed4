"""Measurements of KIT 3D USCT: their signals, and folders and zips of both generations."""

import numpy as np
import pytest
from scipy.io import savemat

from bentray_workers.files.dataset import read_dataset
from bentray_workers.foreign_scans import convert_dataset
from bentray_workers.foreign_scans.kit_signals import compress, decode_float16, reconstruct_undersampled

from .kit_measurement import (
    ARRAYS,
    EMITTERS,
    OF_ARRAY,
    RATE_HZ,
    SAMPLES,
    elements,
    encode_float16,
    excitation,
    write_measurement,
    zipped,
)
from .scans import refused


def test_the_float_format_holds_twelve_bits_of_every_size():
    small = np.arange(-4096, 4096)
    np.testing.assert_array_equal(decode_float16(encode_float16(small)), small)
    large = np.random.default_rng(0).integers(-(2**26), 2**26, 500)
    np.testing.assert_allclose(decode_float16(encode_float16(large)), large, rtol=2.0**-10)
    # Words of the definition: sign, exponent, fraction.
    words = {
        0x0000: 0,
        0x07FF: 2047,
        0x0800: 2048,
        0x1001: 4098,
        0x87FF: -1,
        0x8800: -4096,
        0xFFFF: -2049 << 14,
    }
    for word, value in words.items():
        assert decode_float16(np.array([word], np.uint16)).item() == value


def test_undersampled_traces_are_reconstructed():
    time = np.arange(SAMPLES) / RATE_HZ
    pulse = np.exp(-(((time - 1.2e-5) / 2e-6) ** 2)) * np.cos(2 * np.pi * 2.5e6 * (time - 1.2e-5))
    result = reconstruct_undersampled(np.vstack((pulse[::3], 0 * pulse[::3])))
    np.testing.assert_allclose(result[0], pulse, atol=1e-3)
    assert not result[1].any()
    assert reconstruct_undersampled(np.zeros((1, 99))).shape == (1, 300)


def test_the_coded_excitation_is_compressed_to_its_arrival():
    trace = np.zeros((1, 400))
    trace[0, 130:190] = excitation()
    assert np.argmax(np.abs(compress(trace, excitation()))) == 130
    np.testing.assert_array_equal(compress(trace, None), trace)


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("second", [False, True])
def test_a_measurement_is_converted(tmp_path, packed, second):
    source = write_measurement(tmp_path / "scan", second=second)
    if packed:
        source = zipped(source, tmp_path / "scan.zip")
    made = convert_dataset(source, tmp_path / "canonical.h5")
    assert made.waveform.object.strides == (0, 0, 0), "traces are not held"
    dataset = read_dataset(tmp_path / "canonical.h5")
    # Turned by 90 degrees and lifted by 2 cm.
    x, y, z = elements().reshape(-1, 3).T
    both = [np.column_stack((-y, x, z + 0.02))]
    if second:
        both.append(np.column_stack((y, -x, 0.02 - z)))
    np.testing.assert_allclose(dataset.element_position_m, np.concatenate(both), atol=1e-15)
    offset = ARRAYS * OF_ARRAY if second else 0
    assert dataset.tx.tolist() == [offset + (tas - 1) * OF_ARRAY + one - 1 for tas, one in EMITTERS]
    assert dataset.rx.tolist() == list(range(ARRAYS * OF_ARRAY))
    assert (dataset.sampling_rate_hz, dataset.t0_s, dataset.center_frequency_hz) == (RATE_HZ, 2e-6, 2.5e6)
    assert dataset.water_temperature_c == 25.0
    assert dataset.valid.sum() == dataset.valid.size - 1
    assert not dataset.valid[0, 0]
    traces = dataset.waveform.object
    assert not traces[0, 0].any()
    expected = np.rint(RATE_HZ * dataset.distance_m() / 1480.0)
    computed = np.argmax(np.abs(traces), axis=-1)
    np.testing.assert_array_equal(computed[dataset.valid], expected[dataset.valid])
    # Each was divided by its amplification.
    peaks = np.abs(traces).max(axis=-1)[dataset.valid]
    np.testing.assert_allclose(peaks, peaks[0], rtol=2e-2)


def test_the_empty_measurement_is_the_water_shot(tmp_path):
    write_measurement(tmp_path / "scan" / "object", delay=5.0)
    write_measurement(tmp_path / "scan" / "empty")
    dataset = convert_dataset(tmp_path / "scan", tmp_path / "canonical.h5")
    assert dataset.waveform.water is not None
    waveform = read_dataset(tmp_path / "canonical.h5").waveform
    late = np.argmax(np.abs(waveform.object[1, 2])) - np.argmax(np.abs(waveform.water[1, 2]))
    assert late == 5


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"AScans": None}, "AScans"),
        ({"AScans": np.zeros((SAMPLES, 3), np.int16)}, "AScans"),
        ({"TASIndices": None}, "TASIndices"),
        ({"receiverIndices": np.full((ARRAYS * OF_ARRAY, 1), 9.0)}, "receiverIndices"),
        ({"Amplification": np.zeros((2, 1))}, "Amplification"),
    ],
)
def test_names_missing_or_invalid_members(tmp_path, changes, field):
    source = write_measurement(tmp_path / "scan", **changes)
    error = refused(source)
    assert error.field.startswith("TAS")
    assert error.field.endswith(f".mat: {field}")


def test_a_measurement_without_geometry_or_with_another_water_is_named(tmp_path):
    (write_measurement(tmp_path / "bare") / "geometry.mat").unlink()
    refused(tmp_path / "bare", "TASElements: found nothing; accepted: the file of the geometry")
    write_measurement(tmp_path / "scan" / "object")
    other = write_measurement(tmp_path / "scan" / "water")
    savemat(other / "Movements.mat", {"MovementsListreal": np.zeros((1, 2))})
    refused(tmp_path / "scan", "water: found 3 emissions, 12 receivers, 300 samples")
    write_measurement(tmp_path / "scan" / "another")
    refused(tmp_path / "scan", "2 measurements")
    (tmp_path / "none").mkdir()
    refused(tmp_path / "none", "a folder with the files none")
