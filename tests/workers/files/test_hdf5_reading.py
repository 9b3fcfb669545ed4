"""Bounds on foreign files; data elsewhere in HDF5 are not read; most hostile files: ``hostile_datasets``."""

import io

import h5py
import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.bounded_reading import LARGEST_BYTES, declared, whole
from bentray_workers.files.damage import rejecting_damage
from bentray_workers.files.dataset import read_dataset, write_dataset
from bentray_workers.files.dataset.read import dataset_of, waveform_in
from bentray_workers.files.hdf5_reading import Limits, opened

from .datasets import small

PLACE = "traveltime/delta_tof_s"


@pytest.fixture
def path(tmp_path):
    write_dataset(tmp_path / "d.h5", small())
    return tmp_path / "d.h5"


def external_link(file, folder):
    with h5py.File(folder / "other.h5", "w") as other:
        other["secret"] = np.zeros((12, 24))
    file[PLACE] = h5py.ExternalLink(str(folder / "other.h5"), "/secret")


def external_group(file, folder):
    with h5py.File(folder / "other.h5", "w") as other:
        other["delta_tof_s"] = np.zeros((12, 24))
    del file["traveltime"]
    file["traveltime"] = h5py.ExternalLink(str(folder / "other.h5"), "/")


def virtual(file, folder):
    layout = h5py.VirtualLayout((12, 24), np.float64)
    layout[:] = h5py.VirtualSource(str(folder / "other.h5"), "secret", (12, 24))
    file.create_virtual_dataset(PLACE, layout)


def external_storage(file, folder):
    (folder / "secret.bin").write_bytes(bytes(12 * 24 * 8))
    file.create_dataset(PLACE, (12, 24), np.float64, external=[(str(folder / "secret.bin"), 0, 12 * 24 * 8)])


@pytest.mark.parametrize("build", [external_link, external_group, virtual, external_storage])
def test_data_elsewhere_are_not_read(path, tmp_path, build):
    with h5py.File(path, "a") as file:
        del file[PLACE]
        build(file, tmp_path)
    with pytest.raises(InvalidInput) as refused:
        read_dataset(path)
    assert refused.value.field in (PLACE, "traveltime")
    assert "damaged" not in refused.value.value


def test_unknown_members_are_not_opened(path):
    with h5py.File(path, "a") as file:
        file["more"] = h5py.ExternalLink("/dev/zero", "/x")
        file.create_dataset("text", data=["a"] * 10)
    assert read_dataset(path).title == "small"


@pytest.mark.parametrize(
    ("limits", "field"),
    [
        (Limits(total_bytes=1000), PLACE),
        (Limits(chunk_bytes=100), "waveform/object"),
        (Limits(text=10), "@format"),
    ],
)
def test_the_limits_are_the_callers(path, limits, field):
    with pytest.raises(InvalidInput, match=f"^{field}: "), opened(path, limits) as reader:
        dataset_of(reader, waveform_in)


def test_text_is_made_printable(path):
    with h5py.File(path, "a") as file:
        file.attrs["title"] = np.bytes_(b"a\x00b\x1b[31mc\xff")
    title = read_dataset(path).title
    assert title.startswith("ab[31mc")
    assert title.isprintable()


def test_the_file_is_closed_again(path):
    with opened(path) as reader:
        assert reader.has("geometry")
        assert not reader.has("geometry/nothing")
    with h5py.File(path, "a"):
        pass


def test_a_file_that_is_deleted_while_it_is_opened_is_rejected(tmp_path, monkeypatch):
    path = tmp_path / "scan.h5"
    write_dataset(path, small())
    whole = h5py.File

    def delete_first(name, *mode, **how):
        path.unlink()
        return whole(name, *mode, **how)

    monkeypatch.setattr(h5py, "File", delete_first)
    with pytest.raises(InvalidInput, match="accepted: a whole HDF5 file"), opened(path):
        pass


class Endless(io.RawIOBase):
    """Zeros without end, as a packed file may hold; counts what was asked of it."""

    def __init__(self):
        self.read_bytes = 0

    def read(self, count=-1):
        assert count >= 0, "all of it"
        self.read_bytes += count
        return b"\0" * count


def test_no_more_is_read_than_was_declared():
    endless = Endless()
    assert whole(endless, 1000) == b"\0" * 1000
    assert endless.read_bytes == 1000


def test_a_file_that_ends_early_says_where():
    with pytest.raises(InvalidInput, match="3 bytes of values; accepted: 4"):
        whole(io.BytesIO(b"abc"), 4)


def test_bytes_of_a_declared_volume():
    assert declared("sizes", (2, 3, 4), np.dtype("<f8")) == 192
    side = round((LARGEST_BYTES) ** (1 / 3))
    declared("sizes", (side, side, side), np.dtype("u1"))
    with pytest.raises(InvalidInput, match="sizes: found shape"):
        declared("sizes", (side, side, side), np.dtype("u2"))


@pytest.mark.parametrize("error", [StopIteration, ZeroDivisionError, UnicodeError, EOFError, RecursionError])
def test_reader_errors_become_damage(error):
    with pytest.raises(InvalidInput, match="damaged"), rejecting_damage("file", "a whole one"):
        raise error("odd")


@pytest.mark.parametrize("error", [MemoryError(), InvalidInput("a", "b", "c")])
def test_specific_errors_are_passed_on(error):
    with pytest.raises(type(error)) as caught, rejecting_damage("file", "a whole one"):
        raise error
    assert caught.value is error
