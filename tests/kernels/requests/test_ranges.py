"""Ranges: acceptance of every number whatever its size; error messages fit on one line."""

import json
import math
from dataclasses import dataclass, replace
from typing import get_args, get_origin, get_type_hints

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import LONGEST_FIELD, LONGEST_VALUE, InvalidInput
from bentray_kernels.requests.ranges import Range, check_ranges, ranged, ranges_of
from bentray_kernels.tomography.numerics import Numerics
from bentray_kernels.tomography.settings import GaussNewtonSettings, Settings

from ...extremes import EXTREMES

numbers = st.sampled_from(EXTREMES) | st.floats() | st.integers()


@dataclass(frozen=True)
class Two:
    size: float = ranged(1.0, Range(0.0, 2.0, above=True, unit="m"), place="file@size")
    count: int | None = ranged(None, Range(1, 9))


@given(numbers, st.booleans(), st.booleans())
def test_a_number_is_in_or_out(value, above, below):
    within = Range(-1.0, 4096.0, above, below)
    exact = not (isinstance(value, float) and math.isnan(value)) and -1 <= value <= 4096
    at_an_open_end = (above and value == -1) or (below and value == 4096)
    assert within.holds(value) == (exact and not at_an_open_end)


def test_the_first_wrong_field_is_named_by_its_place():
    check_ranges(Two())
    with pytest.raises(
        InvalidInput, match=r"file@size: found 0.0; accepted: a number above 0 and at most 2 m"
    ):
        check_ranges(Two(size=0.0))
    with pytest.raises(InvalidInput, match="count: found 10"):
        check_ranges(Two(count=10))
    assert ranges_of(Two)["count"].schema == {"minimum": 1, "maximum": 9}
    assert json.loads(json.dumps(ranges_of(Two)["size"].schema)) == {"exclusiveMinimum": 0.0, "maximum": 2.0}


KINDS = (Settings, GaussNewtonSettings, Numerics)
NUMBERS = [
    (kind, name)
    for kind in KINDS
    for name, hint in get_type_hints(kind).items()
    if get_origin(hint) is not tuple and {int, float} & {hint, *get_args(hint)}
]


def test_every_number_of_a_reconstruction_has_its_range():
    assert set(NUMBERS) == {(kind, name) for kind in KINDS for name in ranges_of(kind)}


@pytest.mark.parametrize(("kind", "name"), NUMBERS, ids=[name for _, name in NUMBERS])
@pytest.mark.parametrize("value", EXTREMES, ids=lambda value: str(value)[:12])
def test_an_extreme_setting_is_rejected_or_in_its_range(kind, name, value):
    within = ranges_of(kind)[name]
    if within.holds(value):
        assert getattr(replace(kind(), **{name: value}), name) == value
        return
    with pytest.raises(InvalidInput) as refusal:
        replace(kind(), **{name: value})
    assert refusal.value.field.rpartition(".")[2] == name
    assert len(str(refusal.value)) < 1000


@given(st.text(), st.text() | st.integers() | st.binary())
def test_a_refusal_is_one_line_of_bounded_length(field, value):
    said = InvalidInput(field * 300, str(value) * 300, "less")
    assert len(said.field) <= LONGEST_FIELD
    assert len(said.value) <= LONGEST_VALUE
    assert said.field.isprintable()
    assert said.value.isprintable()


def test_an_integer_that_python_does_not_write():
    assert InvalidInput("seed", 10**5000, "less").value == "an integer of thousands of digits"
