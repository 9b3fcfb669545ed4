"""Bounds on foreign files: declared sizes are checked first, and never exceeded."""

import io

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.bounded_reading import LARGEST_BYTES, declared, whole
from bentray_workers.files.damage import rejecting_damage


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
