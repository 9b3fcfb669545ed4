"""Copying dataset files: values are preserved for every storage layout and chunking."""

import tempfile
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.dataset import copy, copy_dataset, read_dataset, write_dataset

from ....effort import effort
from ....memory_program import peak_of
from ..datasets import datasets, small
from ..test_dataset_files import assert_same


@given(datasets(), st.integers(1, 200))
@settings(max_examples=effort(20, 40), deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_a_copy_holds_the_same(dataset, piece_bytes):
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setattr(copy, "PIECE_BYTES", piece_bytes)
        source, target = Path(folder, "source.h5"), Path(folder, "target.h5")
        write_dataset(source, dataset)
        told = copy_dataset(source, target)
        assert_same(read_dataset(target), dataset)
    assert_same(replace(told, waveform=None), replace(dataset, waveform=None))
    if dataset.waveform is not None:
        assert (told.waveform.object.shape, told.waveform.object.dtype) == (
            dataset.waveform.object.shape,
            dataset.waveform.object.dtype,
        )


def test_a_copy_has_the_bytes_that_writing_gives(tmp_path):
    write_dataset(tmp_path / "a.h5", read_dataset(written(tmp_path / "source.h5")))
    copy_dataset(tmp_path / "source.h5", tmp_path / "b.h5")
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def written(path, traces=None, **how):
    """A small dataset, its object traces stored in a way of their own."""
    dataset = replace(small(), waveform=replace(small().waveform, water=None))
    write_dataset(path, dataset)
    if traces is not None:
        with h5py.File(path, "a") as file:
            del file["waveform/object"]
            file.create_dataset("waveform/object", data=traces, **how)
    return path


@pytest.mark.parametrize(
    ("kind", "how"),
    [
        (">i2", {}),
        ("<f8", {"chunks": (5, 7, 3), "compression": "gzip"}),
        (">f4", {"chunks": (12, 1, 20), "compression": "lzf", "shuffle": True}),
        ("u1", {"chunks": (1, 24, 20), "fletcher32": True}),
    ],
)
def test_traces_may_be_stored_in_any_way(tmp_path, monkeypatch, kind, how):
    monkeypatch.setattr(copy, "PIECE_BYTES", 2000)
    values = np.arange(12 * 24 * 20).reshape(12, 24, 20) % 256
    copy_dataset(written(tmp_path / "s.h5", values.astype(kind), **how), tmp_path / "t.h5")
    traces = read_dataset(tmp_path / "t.h5").waveform.object
    assert traces.dtype == (np.float32 if "f" in kind else np.int16)
    np.testing.assert_array_equal(traces, values)


def test_damaged_traces_are_named_and_leave_nothing(tmp_path):
    values = np.random.default_rng(0).integers(-999, 999, (12, 24, 20)).astype(np.int16)
    path = written(tmp_path / "s.h5", values, chunks=(1, 24, 20), compression="gzip")
    with h5py.File(path) as file:
        position = file["waveform/object"].id.get_chunk_info(7)
    content = bytearray(path.read_bytes())
    middle = position.byte_offset + position.size // 2
    content[middle : middle + 20] = bytes(20)
    path.write_bytes(content)
    with pytest.raises(InvalidInput, match=r"^waveform/object: "):
        copy_dataset(path, tmp_path / "t.h5")
    assert [left.name for left in tmp_path.iterdir()] == ["s.h5"]


def test_memory_is_that_of_a_few_pieces(tmp_path, monkeypatch):
    piece = 2**20
    monkeypatch.setattr(copy, "PIECE_BYTES", piece)
    path = written(tmp_path / "s.h5")
    with h5py.File(path, "a") as file:
        del file["waveform/object"]
        made = file.create_dataset("waveform/object", (12, 24, 100_000), np.int16)
        made[...] = 7
    assert peak_of(lambda: copy_dataset(path, tmp_path / "t.h5")) < 8 * piece < 12 * 24 * 100_000


@given(st.data())
@settings(max_examples=effort(20, 60), deadline=None)
def test_boxes_cover_every_value_once_and_stay_small(data):
    shape = tuple(data.draw(st.lists(st.integers(1, 12), min_size=3, max_size=4)))
    sides = st.tuples(*(st.integers(1, n) for n in shape))
    own, chunk = data.draw(st.none() | sides), data.draw(sides)
    result = SimpleNamespace(shape=shape, dtype=np.dtype(np.int16), chunks=own)
    limit = data.draw(st.integers(2, 4000))
    counts = np.zeros(shape, dtype=int)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(copy, "PIECE_BYTES", limit)
        for where in copy.blocks(result, chunk):
            counts[where] += 1
            assert counts[where].size * 2 <= max(limit, 2 * np.prod(own or 1))
            if own is not None:
                # No packed chunk is read twice.
                assert all(part.start % side == 0 for part, side in zip(where, own, strict=True))
    assert (counts == 1).all()
