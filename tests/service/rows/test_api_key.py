"""Keys as their owners hold them: one form, and a secret that shows nowhere by accident."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_service.rows.keys import ApiKey


def test_there_and_back():
    token = ApiKey.new()
    assert ApiKey.from_text(token.shown()) == token
    assert ApiKey.new().shown() != token.shown()
    secret = token.shown().rpartition("_")[2]
    assert len(secret) == 40
    assert secret not in f"{token} {token!r} {token.digest()}"


@given(st.text(max_size=80))
def test_rejects_invalid_keys(text):
    assert ApiKey.from_text(text) is None
    assert ApiKey.from_text(ApiKey.new().shown() + text[:1]) is None or not text


@pytest.mark.parametrize("spoil", [str.upper, lambda t: f"{t}\n", lambda t: t[:-1], lambda t: f" {t}"])
def test_a_slip_is_rejected_and_not_repeated(spoil):
    spoiled = spoil(ApiKey.new().shown())
    assert ApiKey.from_text(spoiled) is None
    with pytest.raises(InvalidInput) as refusal:
        ApiKey.given("key", spoiled)
    assert spoiled[-20:-2] not in str(refusal.value)
