"""Signatures of Standard Webhooks: one of its own examples, and what is not accepted."""

import base64
import hashlib
import hmac

import pytest

import bentray
from bentray_kernels.errors import InvalidInput
from bentray_service.webhooks.signature import signed_headers

# The example of the specification and of its libraries.
SECRET = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"
MESSAGE, TIME, BODY = "msg_p5jXN8AQM9LWM0D4loKWxJek", 1614265330, b'{"test": 2432232314}'
SIGNATURE = "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE="
OTHER = "whsec_" + base64.b64encode(bytes(32)).decode()


def test_the_example_of_the_specification():
    assert signed_headers([SECRET], MESSAGE, TIME, BODY) == {
        "webhook-id": MESSAGE,
        "webhook-timestamp": str(TIME),
        "webhook-signature": SIGNATURE,
    }


def test_what_was_signed_is_accepted():
    headers = signed_headers([OTHER, SECRET], MESSAGE, TIME, BODY)
    for secret in (SECRET, OTHER):
        capitals = {name.title(): value for name, value in headers.items()}
        assert bentray.verify_webhook(BODY, capitals, secret, now=TIME + 299.0) == {"test": 2432232314}


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"body": BODY.replace(b"4", b"5")}, "webhook-signature"),
        ({"secret": OTHER}, "webhook-signature"),
        ({"secret": "whsec_?"}, "secret"),
        ({"now": TIME + 301.0}, "webhook-timestamp"),
        ({"now": TIME - 301.0}, "webhook-timestamp"),
        ({"webhook-id": "msg-other"}, "webhook-signature"),
        ({"webhook-timestamp": str(TIME + 1)}, "webhook-signature"),
        ({"webhook-timestamp": "soon"}, "webhook-timestamp"),
        ({"webhook-timestamp": None}, "webhook-timestamp"),
        ({"webhook-signature": None}, "webhook-signature"),
        ({"webhook-signature": SIGNATURE.replace("v1,", "v2,")}, "webhook-signature"),
        ({"webhook-signature": "v1," + SIGNATURE[4:]}, "webhook-signature"),
    ],
)
def test_what_was_changed_is_refused(change, field):
    headers = signed_headers([SECRET], MESSAGE, TIME, BODY)
    given = {"body": BODY, "secret": SECRET, "now": TIME, **headers, **change}
    left = {name: given[name] for name in headers if given[name] is not None}
    with pytest.raises(InvalidInput, match=f"^{field}: "):
        bentray.verify_webhook(given["body"], left, given["secret"], now=given["now"])


def test_the_signature_is_that_of_a_few_lines():
    """A receiver in another language computes it so."""
    headers = signed_headers([OTHER], "msg-1", 5, b"{}")
    expected = hmac.new(bytes(32), b"msg-1.5.{}", hashlib.sha256).digest()
    assert headers["webhook-signature"] == "v1," + base64.b64encode(expected).decode()
