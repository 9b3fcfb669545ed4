"""A row of numbers after an option is the option repeated; every other word stays as it was."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_service.cli.options.view_options import repeat_option


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        ("-s 1", "-s 1"),
        ("-s 1 2 3", "-s 1 -s 2 -s 3"),
        ("-s 1 2 3 4", "-s 1 -s 2 -s 3 4"),
        ("a -s 1e-3 v.raw 5", "a -s 1e-3 v.raw 5"),
        ("-s 1 -s 2 -s 3", "-s 1 -s 2 -s 3"),
        ("-s many 2", "-s many -s 2"),
        ("-s 1 -2 -o p", "-s 1 -s -2 -o p"),
        ("-s", "-s"),
    ],
)
def test_rows(words: str, meant: str) -> None:
    assert list(repeat_option("-s", words.split())) == meant.split()


@given(st.lists(st.text(max_size=4).filter(lambda word: word != "-s")))
def test_without_the_option_nothing_changes(words: list[str]) -> None:
    assert list(repeat_option("-s", words)) == words
