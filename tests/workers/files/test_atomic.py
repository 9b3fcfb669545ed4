"""Atomic files: the old content or the new, and no temporary files left."""

import pytest

from bentray_workers.files.atomic import atomic_replace, write_bytes


def test_the_new_content_replaces_the_old(tmp_path):
    target = tmp_path / "a.bin"
    target.write_bytes(b"old")
    write_bytes(target, b"new")
    assert target.read_bytes() == b"new"
    assert list(tmp_path.iterdir()) == [target]


def test_until_the_end_the_target_is_the_old_one(tmp_path):
    target = tmp_path / "a.bin"
    target.write_bytes(b"old")
    with atomic_replace(target) as partial:
        partial.write_bytes(b"new")
        assert target.read_bytes() == b"old"
        assert partial.name.endswith(".partial")
        assert partial.parent == tmp_path


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
@pytest.mark.parametrize("began", [True, False])
def test_on_an_error_the_target_is_untouched_and_the_partial_file_gone(tmp_path, error, began):
    target = tmp_path / "a.bin"
    target.write_bytes(b"old")

    def write():
        with atomic_replace(target) as partial:
            if began:
                partial.write_bytes(b"ne")
            raise error

    with pytest.raises(error):
        write()
    assert target.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_writer_that_writes_nothing_is_an_error(tmp_path):
    with pytest.raises(FileNotFoundError), atomic_replace(tmp_path / "a.bin"):
        pass
    assert not list(tmp_path.iterdir())


def test_two_writers_at_once_do_not_share_a_partial_file(tmp_path):
    target = tmp_path / "a.bin"
    with atomic_replace(target) as first:
        first.write_bytes(b"first")
        with atomic_replace(target) as second:
            second.write_bytes(b"second")
        assert target.read_bytes() == b"second"
    assert target.read_bytes() == b"first"
    assert list(tmp_path.iterdir()) == [target]
