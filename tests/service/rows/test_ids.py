"""Ids: only what we made ourselves is an id."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_service.errors import UnknownId
from bentray_service.rows.ids import PREFIXES, checked, field_of, new_id, volume_of


@pytest.mark.parametrize("what", PREFIXES)
def test_a_new_id_is_an_id(what):
    made = new_id(what)
    assert checked(what, made) == made
    assert made != new_id(what)


@given(st.text())
def test_no_invented_string_is_an_id(text):
    with pytest.raises(UnknownId):
        checked("dataset", text)


@pytest.mark.parametrize(
    "text",
    [
        "ds-../../../../etc/passwd",
        "ds-" + "0" * 19,
        "ds-" + "0" * 20 + "\n",
        "job-" + "0" * 20,
        "ds-" + "A" * 20,
    ],
)
def test_near_misses(text):
    with pytest.raises(UnknownId) as caught:
        checked("dataset", text)
    assert caught.value.field == "dataset"


def test_a_job_has_one_volume():
    job = new_id("job")
    assert volume_of(job) == volume_of(job) == checked("volume", volume_of(job))


@given(st.binary(min_size=32, max_size=32).map(bytes.hex))
def test_a_content_has_one_field(content):
    assert field_of(content) == field_of(content) == checked("field", field_of(content))
