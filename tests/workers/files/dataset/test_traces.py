"""Traces of a slice from a file: an emission at a time as a whole, however they are stored; damage."""

from dataclasses import replace

import h5py
import numpy as np
import pytest

from bentray_kernels.acquisition import Waveform
from bentray_kernels.errors import InvalidInput
from bentray_workers.files.dataset import read_dataset, write_dataset
from bentray_workers.files.dataset import scan as trace_reading
from bentray_workers.files.dataset.scan import open_slice

from ....kernels.acquisition.traces import scan

HEIGHTS = 0.01 * np.arange(3)


def stored(path, stacked, kind, chunks):
    """A scan of random traces in a file, with the traces stored in a way of their own; returns the scan."""
    random = np.random.default_rng(0)
    one = scan(elements=8)
    shape = ((3,) if stacked else ()) + (8, 8, 50)
    both = [random.integers(-99, 99, shape).astype(kind) for _ in range(2)]
    dataset = replace(
        one,
        waveform=Waveform(*both, 2.0, random.random(shape[:-1]), None),
        slice_z_m=HEIGHTS if stacked else None,
    )
    write_dataset(path, dataset)
    with h5py.File(path, "r+") as file:
        for name, traces in zip(("object", "water"), both, strict=True):
            del file[f"waveform/{name}"]
            # As float64 too, which is read as float32.
            data = traces.astype(np.float64) if kind == np.float32 else traces
            more = {"chunks": chunks[-len(shape) :], "compression": "gzip"} if chunks else {}
            file.create_dataset(f"waveform/{name}", data=data, **more)
    return dataset


@pytest.mark.parametrize("block_bytes", [1, 2000, 10**9])
@pytest.mark.parametrize("chunks", [None, (1, 1, 8, 50), (2, 3, 5, 7), (3, 8, 8, 50)])
@pytest.mark.parametrize("kind", [np.int16, np.float32])
@pytest.mark.parametrize("stacked", [True, False])
def test_an_emission_at_a_time_is_the_whole(tmp_path, monkeypatch, stacked, kind, chunks, block_bytes):
    monkeypatch.setattr(trace_reading, "BLOCK_BYTES", block_bytes)
    path = tmp_path / "scan.h5"
    dataset = stored(path, stacked, kind, chunks)
    whole = read_dataset(path, traces=False)
    for index in range(dataset.slices):
        expected = dataset.slice(index).waveform
        with open_slice(path, whole, index) as slice_data:
            for name in ("object", "water"):
                sought, lazily = getattr(expected, name), getattr(slice_data.waveform, name)
                assert (lazily.shape, lazily.dtype) == (sought.shape, sought.dtype)
                for e in (5, 0, 7, 1):
                    np.testing.assert_array_equal(lazily[e], sought[e])
                np.testing.assert_array_equal(np.asarray(lazily), sought)
            assert slice_data.waveform.scale == 2.0
            np.testing.assert_array_equal(slice_data.waveform.object_scale, expected.object_scale)
            assert slice_data.waveform.water_scale is None


def test_damaged_traces_are_reported_when_read(tmp_path):
    path = tmp_path / "scan.h5"
    stored(path, False, np.int16, (1, 1, 8, 50))
    with h5py.File(path) as file:
        at = file["waveform/object"].id.get_chunk_info(3)
    content = bytearray(path.read_bytes())
    content[at.byte_offset : at.byte_offset + at.size] = bytes(at.size)
    path.write_bytes(content)
    with open_slice(path, read_dataset(path, traces=False), 0) as slice_data:
        assert slice_data.waveform.object[2].shape == (8, 50)
        with pytest.raises(InvalidInput, match="waveform/object: found damaged data"):
            slice_data.waveform.object[3]


def test_without_traces_there_are_none(tmp_path):
    known = replace(scan(elements=8), waveform=None, delta_tof_s=np.zeros((8, 8)))
    write_dataset(tmp_path / "scan.h5", known)
    with open_slice(tmp_path / "scan.h5", known, 0) as slice_data:
        assert slice_data.waveform is None
