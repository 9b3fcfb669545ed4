"""k-Wave outputs in a zip with their geometry: traces are preserved, and invalid values are named."""

import io
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest

from bentray_workers.files.dataset import read_dataset
from bentray_workers.foreign_scans import convert_dataset

from .scans import ELEMENTS, RATE_HZ, SAMPLES, positions, refused

EMITTERS = (1, 4, 6)
RECEIVERS = (5, 0, 3, 2)


def pressures(seed: int) -> np.ndarray:
    """(emissions, Nt, receivers), as k-Wave records."""
    shape = (len(EMITTERS), SAMPLES, len(RECEIVERS))
    return np.random.default_rng(seed).standard_normal(shape).astype(np.float32)


def output(p: np.ndarray, step: float = 1.0 / RATE_HZ) -> bytes:
    """One output file."""
    made = io.BytesIO()
    with h5py.File(made, "w") as file:
        file["p"] = p
        file["dt"] = np.full((1, 1, 1), step, dtype=np.float32)
        file["Nt"] = np.full((1, 1, 1), SAMPLES, dtype=np.uint64)
    return made.getvalue()


def geometry(**changes: object) -> bytes:
    """The file beside them."""
    arrays = {
        "element_position_m": positions(),
        "tx": np.array(EMITTERS),
        "rx": np.array(RECEIVERS),
        "sound_speed_mps": 1500.0,
        "center_frequency_hz": 4e5,
    } | changes
    made = io.BytesIO()
    np.savez(made, **{name: array for name, array in arrays.items() if array is not None})
    return made.getvalue()


def members() -> dict[str, bytes]:
    results = {"geometry.npz": geometry()}
    for k in range(len(EMITTERS)):
        results[f"object/{k:03}.h5"] = output(pressures(0)[k : k + 1])
        results[f"water/{k:03}.h5"] = output(pressures(1)[k : k + 1])
    return results


def written(tmp_path: Path, found: dict[str, bytes]) -> Path:
    path = tmp_path / "scan.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in reversed(found.items()):
            archive.writestr(name, content)
    return path


def test_outputs_become_a_scan_in_the_order_of_their_names(tmp_path):
    convert_dataset(written(tmp_path, members()), tmp_path / "canonical.h5")
    dataset = read_dataset(tmp_path / "canonical.h5")
    np.testing.assert_array_equal(dataset.waveform.object, pressures(0).transpose(0, 2, 1))
    np.testing.assert_array_equal(dataset.waveform.water, pressures(1).transpose(0, 2, 1))
    assert dataset.tx.tolist() == list(EMITTERS)
    assert dataset.rx.tolist() == list(RECEIVERS)
    assert len(dataset.element_position_m) == ELEMENTS
    assert dataset.sampling_rate_hz == pytest.approx(RATE_HZ)
    assert dataset.center_frequency_hz == 4e5
    assert "k-Wave" in dataset.source
    assert sorted(path.name for path in tmp_path.iterdir()) == ["canonical.h5", "scan.zip"]


def test_the_water_may_be_left_out(tmp_path):
    result = {name: content for name, content in members().items() if not name.startswith("water")}
    told = convert_dataset(written(tmp_path, result), tmp_path / "canonical.h5")
    assert told.waveform.water is None


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"geometry.npz": None}, "geometry.npz"),
        ({"geometry.npz": geometry(tx=None)}, "acquisition/tx"),
        ({"geometry.npz": geometry(rx=np.arange(3))}, "waveform/object"),
        ({"geometry.npz": b"no archive"}, "file"),
        ({"object/000.h5": output(pressures(0)[:1, :-1])}, "object/001.h5"),
        ({"object/001.h5": output(pressures(0)[:1, :-1])}, "object/001.h5"),
        ({"object/002.h5": output(pressures(0)[:1], 1e-6)}, "object/002.h5"),
        ({"object/002.h5": b"no HDF5"}, "object/002.h5: file"),
        ({"object/002.h5": output(pressures(0)[0])}, "object/002.h5: p"),
        ({"object/000.h5": output(pressures(0)[:1], 0.0)}, "object/000.h5: dt"),
        ({"object/002.h5": None, "water/002.h5": None}, "waveform/object"),
        ({"water/002.h5": None}, "waveform/water"),
    ],
)
def test_names_missing_or_invalid_input(tmp_path, change, field):
    result = {name: content for name, content in (members() | change).items() if content is not None}
    refused(written(tmp_path, result), f"^{field}: ")
    assert [path.name for path in tmp_path.iterdir()] == ["scan.zip"]
