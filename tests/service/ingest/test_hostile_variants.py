"""Every damaged file is rejected by field, cheaply, without echoing its content."""

import pytest

from bentray_kernels.errors import LONGEST_VALUE

from . import hostile_variants
from .forked_reader import Read, read_all

MAX_BYTES = 700 * 2**20
# What stands in some of the files, and in no answer.
SECRETS = ("passwd", "\\u001b", "..\\\\x")


@pytest.fixture(scope="module")
def reads(tmp_path_factory) -> dict[str, Read]:
    folder = tmp_path_factory.mktemp("variants")
    written = hostile_variants.files(folder)
    return dict(zip(written, read_all(list(written.values()), folder), strict=True))


def test_there_are_many():
    assert len(hostile_variants.REFUSED) > 150


@pytest.mark.parametrize("name", hostile_variants.REFUSED)
def test_it_is_rejected_by_name(reads, name):
    read = reads[name]
    assert read.status == 0, read
    assert set(read.answer) == {"error"}, read.answer
    error = read.answer["error"]
    assert error["field"] == hostile_variants.REFUSED[name][-1], error
    assert 0 < len(error["found"]) <= LONGEST_VALUE
    assert not any(secret in hostile_variants.spoken(error) for secret in SECRETS)
    assert read.most_bytes < MAX_BYTES
