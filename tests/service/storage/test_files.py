"""The data folder: prepared, cleaned, locked, and closed to invented names."""

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_service.refusals import UnknownId
from bentray_service.storage.files import Files, lock
from bentray_service.storage.ids import new_id


def test_half_done_work_is_dropped(tmp_path):
    files = Files(tmp_path)
    files.prepare()
    left = files.incoming(new_id("dataset"))
    left.write_bytes(b"half")
    kept = files.dataset(new_id("dataset"))
    kept.write_bytes(b"whole")
    (files.scratch / "job").mkdir()
    (files.scratch / "job" / "picked.h5").write_bytes(b"x")
    files.drop_leftovers()
    assert not left.exists()
    assert not list(files.scratch.iterdir())
    assert kept.exists()


def test_adopt_moves_the_checked_file(tmp_path):
    files = Files(tmp_path)
    files.prepare()
    dataset = new_id("dataset")
    files.candidate(dataset).write_bytes(b"x")
    assert files.adopt(dataset) == files.dataset(dataset)
    assert files.dataset(dataset).read_bytes() == b"x"
    assert not files.candidate(dataset).exists()


@pytest.mark.parametrize("name", ["incoming", "candidate", "dataset"])
def test_no_invented_string_becomes_a_path(tmp_path, name):
    with pytest.raises(UnknownId):
        getattr(Files(tmp_path), name)("../../etc/passwd")


def test_a_folder_that_cannot_be_made(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInput, match="data_dir"):
        Files(tmp_path / "file").prepare()


def test_the_lock_is_given_back(tmp_path):
    first = lock(tmp_path)
    with pytest.raises(InvalidInput, match="another service"):
        lock(tmp_path)
    first.close()
    lock(tmp_path).close()
