"""Signatures of messages to webhooks by Standard Webhooks (standardwebhooks.com, version 1)."""

import hmac
import json
import time
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from standardwebhooks.webhooks import EmptyWebhookSecretError, Webhook

from bentray_kernels.errors import InvalidInput

# Longest difference between the clocks of sender and receiver, s.
TOLERANCE_S = 300.0


def signed_headers(secrets: Sequence[str], message: str, timestamp: int, body: bytes) -> dict[str, str]:
    """The headers of a message.

    Args:
        secrets: valid secrets of the receiver.
        message: its id, the same in every attempt.
        timestamp: of this attempt, s since 1970.
        body: as it is sent.
    """
    signatures = (_signature(secret, message, timestamp, body.decode()) for secret in secrets)
    return {
        "webhook-id": message,
        "webhook-timestamp": str(timestamp),
        "webhook-signature": " ".join(signatures),
    }


def verify_webhook(
    body: bytes,
    headers: Mapping[str, str],
    secret: str,
    *,
    tolerance_s: float = TOLERANCE_S,
    now: float | None = None,
) -> dict[str, Any]:
    """Check the signature and age of a message that a webhook has received; returns its content.

    Remember the ``webhook-id`` of accepted messages: a message may arrive more than once.

    Args:
        body: as it was received, byte for byte.
        headers: of the request, with names in capitals or small letters.
        secret: of the tenant, ``whsec_…``.
        tolerance_s: longest difference to the clock of the sender, s.
        now: time of receipt, s since 1970; default: now.

    Raises:
        InvalidInput: when it was not sent by the service now.
    """
    given = {name.lower(): value for name, value in headers.items()}
    try:
        timestamp = int(given.get("webhook-timestamp", ""))
    except ValueError:
        given_time = repr(given.get("webhook-timestamp", "")[:40])
        raise InvalidInput("webhook-timestamp", given_time, "seconds since 1970") from None
    age = (time.time() if now is None else now) - timestamp
    if abs(age) > tolerance_s:
        raise InvalidInput("webhook-timestamp", f"{age:.0f} s ago", f"within {tolerance_s:g} s")
    try:
        text = body.decode()
    except UnicodeDecodeError:
        raise InvalidInput("body", "bytes that are not UTF-8", "a message as it was received") from None
    # Not ``Webhook.verify``, whose tolerance is fixed and whose errors name no field.
    expected = _signature(secret, given.get("webhook-id", ""), timestamp, text).encode()
    signatures = [word for word in given.get("webhook-signature", "").split() if word.startswith("v1,")]
    # All are compared, in constant time.
    equal = [hmac.compare_digest(signature.encode(), expected) for signature in signatures]
    if not any(equal):
        raise InvalidInput(
            "webhook-signature", f"{len(equal)} of version v1, none valid", "one by the secret"
        )
    content = json.loads(text)
    assert isinstance(content, dict)
    return content


def _signature(secret: str, message: str, timestamp: int, text: str) -> str:
    try:
        return Webhook(secret).sign(message, datetime.fromtimestamp(timestamp, UTC), text)
    except (ValueError, EmptyWebhookSecretError):
        raise InvalidInput("secret", f"{len(secret)} characters", "whsec_ and base64") from None
