"""Fields of settings records: the first wrong one is named, with what it may be."""

import math
from dataclasses import dataclass, fields

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.ranges import Range
from bentray_kernels.request_fields import check, setting


@dataclass(frozen=True)
class Asked:
    mode: str = setting("red", "Which one.")
    size: float = setting(1.0, "How large.", Range(0.5, 2.0))


def look(given):
    check(given, {"mode": ("red", "blue")})


def test_accepts_values_in_range():
    for given in (Asked(), Asked("blue", 0.5), Asked("red", 2.0)):
        look(given)
    assert [one.metadata["description"] for one in fields(Asked)] == ["Which one.", "How large."]


@pytest.mark.parametrize(
    ("given", "field", "accepted"),
    [
        (Asked("green", 9.0), "mode", "one of red, blue"),
        (Asked(size=2.1), "size", "a number from 0.5 to 2"),
        (Asked(size=math.nan), "size", "a number from 0.5 to 2"),
        (Asked(size=-math.inf), "size", "a number from 0.5 to 2"),
        (Asked(size=10**400), "size", "a number from 0.5 to 2"),
    ],
)
def test_the_first_wrong_field_is_named(given, field, accepted):
    with pytest.raises(InvalidInput) as caught:
        look(given)
    assert (caught.value.field, caught.value.accepted) == (field, accepted)
