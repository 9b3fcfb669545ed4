"""Types of traces in every format: integers of any width and order are kept, complex numbers are named."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.dataset import read_dataset
from bentray_workers.files.hdf5_reading import opened
from bentray_workers.foreign_scans import convert_dataset

from .hdf5_scans import EMITTERS, openusct_fields, write_fields, zea_fields
from .scans import ELEMENTS, RATE_HZ, positions, refused, traces, waveforms, write_matlab73

INTEGERS = [
    order + kind + size for kind in "iu" for size in "1248" for order in ("<" if size == "1" else "<>")
]


def ring(samples: np.ndarray) -> dict[str, np.ndarray]:
    """A scan of all elements in the upload format, (ntx, nrx, nt)."""
    every = np.arange(ELEMENTS)
    fields = {"element_position_m": positions(), "tx": every, "rx": every, "object": samples}
    return fields | {"sampling_rate_hz": np.array(RATE_HZ), "sound_speed_mps": np.array(1490.0)}


def hdf5(path: Path, samples: np.ndarray) -> None:
    groups = {
        "element_position_m": "geometry/",
        "tx": "acquisition/",
        "rx": "acquisition/",
        "object": "waveform/",
    }
    fields = {groups[name] + name: value for name, value in ring(samples).items() if name in groups}
    numbers = {"acquisition@sampling_rate_hz": RATE_HZ, "water@sound_speed_mps": 1490.0}
    named = {"@format": "uct-transmission", "@format_version": "1.0", "@dimension": 2}
    write_fields(path, fields | numbers | named)


def npz(path: Path, samples: np.ndarray) -> None:
    with path.open("wb") as file:
        np.savez(file, **ring(np.ascontiguousarray(samples)))


def matlab5(path: Path, samples: np.ndarray) -> None:
    savemat(path, waveforms() | {"full_dataset": samples.T}, appendmat=False)


def matlab73(path: Path, samples: np.ndarray) -> None:
    parts = np.dtype([("real", samples.real.dtype), ("imag", samples.real.dtype)])
    # MATLAB stores the parts of complex numbers as records.
    write_matlab73(
        path,
        waveforms() | {"full_dataset": samples.T.view(parts) if samples.dtype.kind == "c" else samples.T},
    )


def openusct(path: Path, samples: np.ndarray) -> None:
    write_fields(path, openusct_fields(**{"acquisition/data": samples[: len(EMITTERS)].transpose(0, 2, 1)}))


def zea(path: Path, samples: np.ndarray) -> None:
    raw = samples[: len(EMITTERS)].transpose(0, 2, 1)[None, ..., None]
    write_fields(path, zea_fields(**{"data/raw_data": raw}))


FORMATS = [hdf5, npz, matlab5, matlab73, openusct, zea]
every_format = pytest.mark.parametrize("write", FORMATS, ids=lambda write: write.__name__)


def samples(dtype: str) -> np.ndarray:
    """(ntx, nrx, nt), with the largest and smallest numbers of the type that 24 bits hold."""
    wave = traces().transpose(2, 1, 0)
    wave = np.round(100.0 * wave / np.abs(wave).max())
    if np.dtype(dtype).kind == "u":
        wave += 120.0
    counts = wave.astype(dtype)
    if np.dtype(dtype).kind in "iu":
        limits = np.iinfo(dtype)
        counts[0, 1, :2] = max(limits.min, -(2**24)), min(limits.max, 2**24)
    return counts


@every_format
@pytest.mark.parametrize("dtype", [*INTEGERS, "<f4", ">f4", "<f8", ">f8"])
def test_traces_of_every_type_are_kept(tmp_path: Path, write: Callable[[Path, np.ndarray], None], dtype: str):
    counts = samples(dtype)
    write(tmp_path / "scan", counts)
    convert_dataset(tmp_path / "scan", tmp_path / "canonical.h5")
    waveform = read_dataset(tmp_path / "canonical.h5").waveform
    assert waveform is not None
    assert waveform.object.dtype == (np.int16 if np.can_cast(dtype, np.int16) else np.float32)
    np.testing.assert_array_equal(waveform.object, counts[: len(waveform.object)].astype(np.float64))


@every_format
@pytest.mark.parametrize("dtype", ["c8", "c16"])
def test_complex_traces_are_named_with_what_to_do(
    tmp_path: Path, write: Callable[[Path, np.ndarray], None], dtype: str
):
    write(tmp_path / "scan", samples("f8").astype(dtype))
    refused(tmp_path / "scan", r"found complex numbers.*of complex traces the real part")


def test_two_channels_of_zea_are_named_as_iq_data(tmp_path: Path):
    write_fields(tmp_path / "scan", zea_fields(**{"data/raw_data": np.zeros((1, 3, 4, 8, 2), np.float32)}))
    refused(tmp_path / "scan", r"2 channels.*of IQ data the real part after modulation")


@pytest.mark.parametrize(
    "names", [("r", "i"), ("real", "imag"), ("Re", "Im"), ("real", "imaginary")], ids="-".join
)
def test_complex_numbers_in_hdf5_are_no_records(tmp_path: Path, names: tuple[str, str]):
    parts = np.zeros(3, [(name, "f4") for name in names])
    with h5py.File(tmp_path / "v.h5", "w") as file:
        file["values"], file["records"] = parts, np.zeros(3, [("x", "f4"), ("y", "f4")])
        file.attrs["rate"] = parts[0]
    with opened(tmp_path / "v.h5") as reader:
        for read in (lambda: reader.array("values", "f", "numbers"), lambda: reader.attribute("", "rate")):
            with pytest.raises(InvalidInput, match=r"found complex numbers \(complex64\)"):
                read()
        with pytest.raises(InvalidInput, match="found records"):
            reader.array("records", "f", "numbers")


@pytest.mark.parametrize("count", [-ELEMENTS, 0, ELEMENTS + 1, ELEMENTS + 0.5, np.nan, "eight"])
def test_a_count_of_elements_must_be_that_of_the_arrays(tmp_path: Path, count: object):
    write_fields(tmp_path / "scan", openusct_fields(**{"geometry@n_elements": count}))
    refused(tmp_path / "scan", r"^geometry@n_elements: ")
