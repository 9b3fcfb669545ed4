"""OFF files: what lacks or is no number is named by its line; whole ones pass, however they are laid out."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.off_checks import check_off

WHOLE = b"OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n"


@pytest.mark.parametrize(
    "data",
    [
        WHOLE,
        WHOLE.replace(b"OFF\n", b"OFF "),
        WHOLE.replace(b"\n", b"\r\n"),
        WHOLE.replace(b"4 2 0", b"4 2 # edges are not counted"),
        b"# by hand\n\nCOFF\n3 1 0\n0 0 0 255 0 0\n1 0 0 0 0 0\n0 1e3 nan 0 0 0\n\n3 0 1 2 255 0 0\n",
    ],
)
def test_whole_files_pass(data):
    check_off(data)


@given(st.integers(0, len(WHOLE) - 2))
def test_every_truncation_is_detected(length):
    # Only the last digit of the last corner can go without a trace, and that leaves no corner here.
    if length >= 3:
        with pytest.raises(InvalidInput):
            check_off(WHOLE[:length])


@pytest.mark.parametrize(
    ("line", "instead", "words"),
    [
        (b"4 2 0", b"-4 2 0", r"file: found an OFF file with '-4 2 0' for its counts"),
        (b"4 2 0", b"many", "file: found an OFF file with 'many' for its counts"),
        (b"4 2 0", b"5 2 0", "ends too soon: 6 lines of the 5 vertices and 2 faces"),
        (b"4 2 0", b"4000000000 4000000000 0", "ends too soon"),
        (b"4 2 0", b"9" * 5000 + b" 1 0", "for its counts"),
        (b"1 1 0", b"1 x 0", "vertices: found '1 x 0' as vertex 2; accepted: three numbers"),
        (b"1 1 0", b"1 1", "vertices: found '1 1' as vertex 2"),
        (b"3 0 2 3", b"3 0 2 4", "faces: found '3 0 2 4' as face 1; accepted: .*, from 0 to 3"),
        (b"3 0 2 3", b"3 0 2 -1", "faces: found"),
        (b"3 0 2 3", b"3 0 2", "faces: found"),
        (b"3 0 2 3", b"2 0 2", "faces: found"),
        (b"3 0 2 3", b"9" * 5000 + b" 0 1 2", "faces: found"),
    ],
)
def test_names_invalid_input(line, instead, words):
    with pytest.raises(InvalidInput, match=words):
        check_off(WHOLE.replace(line, instead))
