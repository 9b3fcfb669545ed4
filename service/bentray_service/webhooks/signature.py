"""Signatures of messages to webhooks, as Standard Webhooks defines them (standardwebhooks.com, version 1)."""

from __future__ import annotations

import base64
import binascii
import hashlib
import hmac
import json
import time
from collections.abc import Mapping, Sequence
from typing import Any

from bentray_kernels.errors import InvalidInput

PREFIX = "whsec_"
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
    signatures = (f"v1,{_signature(_key(secret), message, str(timestamp), body)}" for secret in secrets)
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
    message, timestamp = given.get("webhook-id", ""), given.get("webhook-timestamp", "")
    try:
        age = (time.time() if now is None else now) - int(timestamp)
    except ValueError:
        raise InvalidInput("webhook-timestamp", repr(timestamp[:40]), "seconds since 1970") from None
    if abs(age) > tolerance_s:
        raise InvalidInput("webhook-timestamp", f"{age:.0f} s ago", f"within {tolerance_s:g} s")
    expected = _signature(_key(secret), message, timestamp, body)
    found = [one.partition(",") for one in given.get("webhook-signature", "").split()]
    # All are compared, in constant time.
    equal = [hmac.compare_digest(text, expected) for version, _, text in found if version == "v1"]
    if not any(equal):
        raise InvalidInput(
            "webhook-signature", f"{len(equal)} of version v1, none valid", "one by the secret"
        )
    content = json.loads(body)
    assert isinstance(content, dict)
    return content


def _signature(key: bytes, message: str, timestamp: str, body: bytes) -> str:
    content = f"{message}.{timestamp}.".encode() + body
    return base64.b64encode(hmac.new(key, content, hashlib.sha256).digest()).decode()


def _key(secret: str) -> bytes:
    try:
        return base64.b64decode(secret.removeprefix(PREFIX), validate=True)
    except binascii.Error:
        raise InvalidInput("secret", f"{len(secret)} characters", f"{PREFIX} and base64") from None
